# SPDX-License-Identifier: Apache-2.0
"""
Which recordings are removed so that a disk never fills.

The oldest parts go first. A part that holds a coastdown, and the one before it
with its steady lead, is kept until nothing else is left, or for ever where nobody
has said how much to keep; one that still grows may hold one yet. What a compaction
left that was killed is worth nothing. A file that any process writes is locked, and
stays.
"""

from __future__ import annotations

import math
import os
import re
import stat
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from fcntl import LOCK_EX, LOCK_NB, LOCK_SH, LOCK_UN, flock
from itertools import pairwise
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import IO

from shipdrag_ros.bags.contents import contents_of
from shipdrag_ros.bags.mcap_file import PART
from shipdrag_ros.bags.records import CHUNK_LIMIT_BYTES, MAGIC
from shipdrag_ros.bags.recover import SUFFIX
from shipdrag_ros.display import printable
from shipdrag_ros.errors import reason_of
from shipdrag_ros.messages.topics import RESISTANCE, RESISTANCE_CURVE

DAY_S = 86_400.0
SHARE = 0.5  # of the disk, where nobody has said how much
_LEFT = re.escape(SUFFIX)
# a part, or what a compaction left of it
_NAME = re.compile(
    rf'(\.(?=.*{_LEFT}))?(?P<recording>coastdown_\d{{8}}T\d{{6}}Z){PART.pattern}\.mcap'
    rf'(?P<left>{_LEFT}(\.part)?)?'
)
_BLOCK_BYTES = 4096  # what even an empty file costs


@dataclass(frozen=True)
class Keep:
    """
    How much is kept.

    Attributes
    ----------
    days
        Age of a part, by its last change [d]; 0 is no limit.
    size_bytes
        Of all parts together; those that hold a coastdown go last. 0: `share` instead.
    share
        Of the disk, for all parts together [1]; those that hold a coastdown stay. 0 is no limit.
    """

    days: float = 0.0
    size_bytes: int = 0
    share: float = SHARE

    @property
    def everything(self) -> bool:
        """Whether nothing is ever removed."""
        return not self.days and not self.size_bytes and not self.share

    @property
    def text(self) -> str:
        """One sentence for a log."""
        if self.everything:
            return 'no recording is ever removed'
        if self.size_bytes:
            most = f'{self.size_bytes * 1e-9:.3g} GB, those with a coastdown last'
        else:
            most = f'{self.share:.0%} of the disk, none that holds a coastdown (keep_bytes)'
        limits = [f'beyond {most}'] if self.size_bytes or self.share else []
        if self.days:
            limits.append(f'older than {self.days:g} days, none that holds a coastdown')
        return f'the oldest recordings are removed {"; and ".join(limits)}'


@dataclass(frozen=True)
class Removed:
    """A part that was removed, and whether it held a coastdown."""

    path: Path
    coastdown: bool
    why: str

    @property
    def text(self) -> str:
        """One sentence for a log."""
        held = ' (it held a coastdown: nothing else was left to remove)' if self.coastdown else ''
        return f'removed {self.path.name}: {self.why}{held}'


@dataclass(frozen=True)
class _BagPart:
    path: Path
    size_bytes: int
    changed_s: float
    recording: str
    left: bool  # by a compaction


class Retention:
    """
    Keeps a directory of recordings within its limits.

    Parameters
    ----------
    directory
        Where the parts are; nothing else in it is touched, and no link followed.
    keep
        The limits.

    Attributes
    ----------
    over_bytes
        By how much the parts that may not be removed exceed the limit [bytes].
    problem
        What the last `tidy` could not judge or remove, why, and what to do; '' without any.
    """

    def __init__(self, directory: Path, keep: Keep) -> None:
        self._directory = directory
        self._keep = keep
        self._holds: dict[_BagPart, bool] = {}
        self.over_bytes = 0
        self.problem = ''

    def tidy(self, *, now_s: float) -> list[Removed]:
        """
        Remove what is too old or too much, but for files that somebody still writes.

        Parameters
        ----------
        now_s
            Present time [s since the epoch].

        Raises
        ------
        OSError
            If the directory cannot be read.
        """
        self.problem = ''
        if self._keep.everything:
            return []
        parts = self._parts()
        worth = self._worth_keeping(parts)
        oldest_s = now_s - self._keep.days * DAY_S if self._keep.days else -math.inf
        old = {part for part in parts if part.changed_s < oldest_s} - worth
        # a default takes no coastdown: somebody must have said how much to keep
        order = [part for part in parts if part not in worth or self._keep.size_bytes]
        limit, total = self._limit_bytes(), sum(part.size_bytes for part in parts)
        removed = []
        for part in sorted(order, key=lambda part: (part not in old, part in worth)):
            if part in old:
                why = f'older than {self._keep.days:g} days'
            elif limit and total > limit:
                why = f'recordings take more than {limit} bytes'
            else:
                break
            done = self._remove(part, why, part in worth)
            total -= part.size_bytes * len(done)
            removed += done
        self.over_bytes = max(total - limit, 0) if limit else 0
        return removed

    def _limit_bytes(self) -> int:
        if self._keep.size_bytes:
            return self._keep.size_bytes
        try:
            disk = os.statvfs(self._directory)
        except FileNotFoundError:  # there is no recording yet
            return 0
        return int(self._keep.share * disk.f_blocks * disk.f_frsize)

    def _parts(self) -> list[_BagPart]:
        """Return what compactions left, and the parts in the order of their recording."""
        parts = []
        for path in self._directory.iterdir() if self._directory.exists() else ():
            named = _NAME.fullmatch(path.name)
            with suppress(FileNotFoundError):  # somebody has just removed it
                about = path.lstat()
                if named and stat.S_ISREG(about.st_mode):
                    size, left = max(about.st_size, _BLOCK_BYTES), named['left'] is not None
                    part = _BagPart(path, size, about.st_mtime, named['recording'], left)
                    parts.append(part)
        return sorted(parts, key=lambda part: (not part.left, part.path))

    def _worth_keeping(self, parts: list[_BagPart]) -> set[_BagPart]:
        self._holds = {part: self._holds[part] for part in parts if part in self._holds}
        worth: set[_BagPart] = set()
        for before, part in pairwise([None, *(part for part in parts if not part.left)]):
            assert part is not None
            if part not in self._holds:
                judged = self._judged(part.path)
                self._holds |= {} if judged is None else {part: judged}
            if self._holds.get(part, True):
                worth.add(part)
                if before is not None and before.recording == part.recording:
                    worth.add(before)
        return worth

    def _judged(self, path: Path) -> bool | None:
        """
        Say whether a file is kept as one that holds a coastdown; so is one not understood.

        None while a process still writes it, which has locked it.
        """
        try:
            with open(path, 'rb', opener=_no_link) as file:
                with suppress(OSError):
                    try:
                        flock(file, LOCK_SH | LOCK_NB)
                        flock(file, LOCK_UN)  # at once: who has just made it locks it next
                    except BlockingIOError:
                        return None
                return _holds_coastdown(file)
        except Exception as error:  # whatever is in it, the others are looked at too
            self._complain(path, f'cannot be read ({reason_of(error)}), so that it stays')
            return True

    def _remove(self, part: _BagPart, why: str, coastdown: bool) -> list[Removed]:
        try:
            with open(part.path, 'rb', opener=_no_link) as file:
                # what cannot be locked is written by this node or another
                flock(file, LOCK_EX | LOCK_NB)
                part.path.unlink()
        except BlockingIOError:
            return []
        except OSError as error:
            self._complain(part.path, f'cannot be removed ({reason_of(error)})')
            return []
        return [Removed(part.path, coastdown, why)]

    def _complain(self, path: Path, why: str) -> None:
        if path.exists():
            self.problem = f'{printable(path.name)} {why}; move or remove it'


def _no_link(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK)


def _holds_coastdown(file: IO[bytes]) -> bool:
    """
    Say whether figures were published in it; of a file that is no bag, yes.

    One of `CHUNK_LIMIT_BYTES` at most is read: where its disk is pulled out, or somebody cuts
    it, that is an error then, while a page of a mapped file that is gone ends the process.
    """
    small = os.fstat(file.fileno()).st_size <= CHUNK_LIMIT_BYTES
    mapping = nullcontext() if small else mmap(file.fileno(), 0, access=ACCESS_READ)
    with mapping as mapped:
        data = mapped or file.read(CHUNK_LIMIT_BYTES)
        if data[: len(MAGIC)] != MAGIC:
            return True
        contents = contents_of(data)
    return any(
        topic.rpartition('/')[2] in (RESISTANCE.name, RESISTANCE_CURVE.name)
        and contents.counts[number] > 0
        for number, (topic, _) in contents.channels.items()
    )
