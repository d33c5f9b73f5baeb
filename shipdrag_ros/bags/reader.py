# SPDX-License-Identifier: Apache-2.0
"""Opening bags, and what is in them: which files make up which run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from shipdrag_ros.bags.declarations import METADATA
from shipdrag_ros.bags.locate import BagFiles, locate
from shipdrag_ros.bags.mcap_file import McapFile
from shipdrag_ros.bags.run import Run, TopicInfo
from shipdrag_ros.errors import BagError
from shipdrag_ros.messages import TOPICS


def open_runs(paths: Iterable[Path], *, remap: Mapping[str, str] | None = None) -> list[Run]:
    """
    Open bags; parts of one recording become one run.

    Parameters
    ----------
    paths
        MCAP files and rosbag2 directories.
    remap
        Recorded topic -> input.

    Raises
    ------
    BagError
        If a bag cannot be read, or its topics are ambiguous.
    """
    runs: dict[str, tuple[BagFiles, list[McapFile]]] = {}
    for bag in [bag for path in paths for bag in locate(Path(path))]:
        parts = [McapFile(file) for file in bag.files]
        about = parts[0].contents.metadata.get(METADATA, {})
        if len(parts) == 1 and 'recording_id' in about:
            recording = runs.setdefault(f'id {about["recording_id"]}', (bag, []))
            recording[1].extend(parts)
        else:
            runs.setdefault(f'bag {bag.files[0].resolve()}', (bag, parts))
    return [Run(*_in_order(bag, parts), remap=remap) for bag, parts in runs.values()]


def _in_order(bag: BagFiles, parts: list[McapFile]) -> tuple[BagFiles, list[McapFile]]:
    """Sort the parts of a recording by their number."""
    if len(parts) < 2 or METADATA not in parts[0].contents.metadata:
        return bag, parts
    numbered: dict[int, McapFile] = {}
    for part in parts:
        text = part.contents.metadata[METADATA].get('part', '0')
        number = int(text) if text.isdecimal() else 0
        if number in numbered:
            raise BagError(
                f'{str(part.path)!r} and {str(numbered[number].path)!r} are the same part '
                f'{number} of one recording; give one of them'
            )
        numbered[number] = part
    missing = sorted(set(range(min(numbered), max(numbered))) - set(numbered))
    warnings = tuple(f'part {number} of the recording is missing' for number in missing)
    ordered = [numbered[number] for number in sorted(numbered)]
    joined = BagFiles(
        str(ordered[0].path),
        tuple(part.path for part in ordered),
        warnings=bag.warnings + warnings,
    )
    return joined, ordered


@dataclass(frozen=True)
class TopicRate:
    """A topic with its mean rate over the bag; None where that says nothing."""

    topic: TopicInfo
    rate_hz: float | None


@dataclass(frozen=True)
class BagInfo:
    """
    What is in a bag.

    Attributes
    ----------
    name
        As the user gave it.
    paths
        Its files.
    size_bytes
        Of all files.
    start_ns, end_ns
        First and last time of arrival [ns]; None without messages.
    messages
        In all topics.
    compression
        Of the chunks: `none`, `lz4`, `zstd`, joined by commas.
    indexed
        Whether all files have a sound index.
    topics
        By name.
    missing
        Inputs that it does not hold.
    attachments
        Size by name [bytes].
    software
        Version of this package that recorded it, None if it was another tool.
    node
        Full name of the node whose outputs it holds, None without any.
    warnings
        What is wrong with it.
    """

    name: str
    paths: tuple[Path, ...]
    size_bytes: int
    start_ns: int | None
    end_ns: int | None
    messages: int
    compression: str
    indexed: bool
    topics: tuple[TopicRate, ...]
    missing: tuple[str, ...]
    attachments: dict[str, int]
    software: str | None
    node: str | None
    warnings: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        """From the first message to the last [s]."""
        if self.start_ns is None or self.end_ns is None:
            return 0.0
        return (self.end_ns - self.start_ns) * 1e-9


def info(run: Run) -> BagInfo:
    """
    Say what is in a run; nothing but its index is read where it has one.
    """
    start_ns, end_ns = run.span_ns or (None, None)
    duration_s = 0.0 if start_ns is None or end_ns is None else (end_ns - start_ns) * 1e-9
    found = {topic.input for topic in run.topics}
    compressions = {kind for part in run.parts for kind in part.contents.compressions}
    if run.paths != tuple(part.path for part in run.parts):
        compressions = set()  # those of a bag made for the moment, of a log
    return BagInfo(
        name=run.name,
        paths=run.paths,
        size_bytes=sum(path.stat().st_size for path in run.paths),
        start_ns=start_ns,
        end_ns=end_ns,
        messages=sum(topic.messages for topic in run.topics),
        compression=', '.join(sorted(kind or 'none' for kind in compressions)) or 'none',
        indexed=all(part.contents.indexed for part in run.parts),
        topics=tuple(TopicRate(topic, _rate_hz(topic, duration_s)) for topic in run.topics),
        missing=tuple(name for name in TOPICS if name not in found),
        attachments={name: len(text.encode()) for name, text in run.attachments.items()},
        software=run.software,
        node=run.node,
        warnings=run.warnings,
    )


def _rate_hz(topic: TopicInfo, duration_s: float) -> float | None:
    if topic.messages < 2 or duration_s <= 0.0:
        return None
    return (topic.messages - 1) / duration_s
