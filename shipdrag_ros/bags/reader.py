# SPDX-License-Identifier: Apache-2.0
"""
Opening bags: which files make up which run.

Parts of one recording are joined; bags given together are runs of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from shipdrag_ros.bags.declarations import METADATA
from shipdrag_ros.bags.locate import BagFiles, locate
from shipdrag_ros.bags.mcap_file import McapFile
from shipdrag_ros.bags.run import Run
from shipdrag_ros.errors import BagError


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
