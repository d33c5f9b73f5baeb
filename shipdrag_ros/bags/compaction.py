# SPDX-License-Identifier: Apache-2.0
"""
Making the file of a finished part small and quick to read.

The name holds a whole file at every moment: first the one that grew, then, from
one moment to the next, the compact one.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from shipdrag_ros.bags.live import sync_directory
from shipdrag_ros.bags.recover import recover
from shipdrag_ros.errors import BagError

SUFFIX = '.compacting'


def compact(path: Path, *, messages: int) -> None:
    """
    Rewrite a file that is no longer written into compressed chunks with an index.

    Parameters
    ----------
    path
        From `LiveFile`; afterwards the same messages.
    messages
        How many there are.

    Raises
    ------
    BagError
        If that is impossible; the file is then as it was.
    """
    compacted = path.with_name(path.name + SUFFIX)
    made = [compacted]
    try:
        compacted.unlink(missing_ok=True)  # from an attempt that failed
        written = recover(path, compacted)
        made += [written.quarantine] if written.quarantine else []
        if written.messages_recovered != messages or written.quarantine:
            raise BagError(
                f'{str(path)!r} cannot be compacted: it holds {written.messages_recovered} sound '
                f'messages, {messages} were written'
            )
        compacted.replace(path)
        sync_directory(path.parent)
    except OSError as error:
        raise BagError(f'{str(path)!r} cannot be compacted: {error}') from error
    finally:
        for each in made:
            with suppress(OSError):
                each.unlink()
