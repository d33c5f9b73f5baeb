# SPDX-License-Identifier: Apache-2.0
"""
Which files make up the bags that a user names.

A bag is a single MCAP file or a directory of rosbag2; a directory that was
left without its `metadata.yaml` by a crash is taken for what its files say.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shipdrag_ros import strict_yaml
from shipdrag_ros.bags.mcap_file import CONVERT, IMPORT
from shipdrag_ros.bags.records import MAGIC
from shipdrag_ros.errors import BagError

_SUFFIXES = ('.mcap', '.mcap.zstd')


@dataclass(frozen=True)
class BagFiles:
    """
    Files that make up one bag, in their order.

    Attributes
    ----------
    name
        As the user gave it.
    message_compression
        Compression of each message by rosbag2; '' for none.
    warnings
        What is missing, a sentence each.
    """

    name: str
    files: tuple[Path, ...]
    message_compression: str = ''
    warnings: tuple[str, ...] = field(default=())


def is_bag(path: Path) -> bool:
    """
    Say whether a path is to be opened as a bag, and not as a log that could be made one.

    What is not there is a bag too, so that the error is that of a bag.
    """
    if path.is_dir() or path.name == 'metadata.yaml':
        folder = path if path.is_dir() else path.parent
        return not any(folder.glob('*.db3')) or any(folder.glob('*.mcap*'))
    if not path.is_file() or path.name.endswith(_SUFFIXES):
        return True
    with path.open('rb') as file:
        return file.read(len(MAGIC)) == MAGIC


def locate(path: Path) -> list[BagFiles]:
    """
    Find the bags at a path.

    Raises
    ------
    BagError
        If there is none that can be read.
    """
    if not path.exists():
        raise BagError(f'{str(path)!r} does not exist; give the path of a bag or a log')
    if path.name == 'metadata.yaml':
        path = path.parent
    if not path.is_dir():
        return [BagFiles(str(path), (path,))]
    if (path / 'metadata.yaml').exists():
        return [_rosbag2(path)]
    return _without_metadata(path)


def _rosbag2(path: Path) -> BagFiles:
    about = _metadata(path / 'metadata.yaml')
    storage = about.get('storage_identifier')
    if storage != 'mcap':
        how = IMPORT if storage == 'sqlite3' else CONVERT
        raise BagError(f'{str(path)!r} is a bag in {storage!r} storage; {how}')
    packed = str(about.get('compression_format') or '')
    mode = str(about.get('compression_mode') or '').lower()
    if packed not in ('', 'zstd'):
        raise BagError(f'{str(path)!r} is compressed with {packed!r}; {CONVERT}')
    files: list[Path] = []
    missing: list[str] = []
    for name in about.get('relative_file_paths') or ():
        # older versions put the directory before the name, or leave the compression out
        file = path / Path(str(name)).name
        found = [each for each in (file, Path(f'{file}.zstd')) if each.is_file()]
        if found:
            files.append(found[0])
        else:
            missing.append(file.name)
    if not files:
        raise BagError(
            f'{str(path / "metadata.yaml")!r} lists no file that is there; restore them'
        )
    return BagFiles(
        str(path),
        tuple(files),
        message_compression=packed if mode == 'message' else '',
        warnings=tuple(f'{name} is listed in metadata.yaml and is not there' for name in missing),
    )


def _metadata(path: Path) -> dict[str, Any]:
    try:
        about = strict_yaml.load(path.read_text())['rosbag2_bagfile_information']
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BagError(
            f'{str(path)!r} is no metadata of rosbag2 ({error}); remove it to read the .mcap '
            'files beside it'
        ) from error
    if not isinstance(about, dict):
        raise BagError(f'{str(path)!r} holds {about!r}, expected the metadata of rosbag2')
    return about


def _without_metadata(path: Path) -> list[BagFiles]:
    files = sorted(
        (file for file in path.iterdir() if file.name.endswith(_SUFFIXES)), key=_natural_order
    )
    if not files:
        if any(path.glob('*.db3')):
            raise BagError(f'{str(path)!r} is a bag in sqlite3 storage; {IMPORT}')
        raise BagError(f'{str(path)!r} holds no .mcap file; {_instead(path)}')
    stem = re.escape(path.name)
    if len(files) > 1 and all(re.fullmatch(rf'{stem}_\d+\.mcap.*', f.name) for f in files):
        # as rosbag2 names the files that it splits a recording into
        note = 'metadata.yaml is missing; the files are joined in the order of their numbers'
        return [BagFiles(str(path), tuple(files), warnings=(note,))]
    return [BagFiles(str(file), (file,)) for file in files]


def _instead(folder: Path) -> str:
    """Say what to give for a folder without a bag."""
    other = sorted(each.name for each in folder.iterdir() if each.is_file())
    if not other:
        return 'give a bag'
    more = f' and {len(other) - 3} more' if len(other) > 3 else ''
    return (
        f'it holds {", ".join(other[:3])}{more}. Logs are given by their own names: '
        f'{str(folder / other[0])!r}'
    )


def _natural_order(path: Path) -> list[tuple[int, str]]:
    """Put part_10 behind part_9."""
    return [
        (int(piece), '') if piece.isdigit() else (-1, piece)
        for piece in re.split(r'(\d+)', path.name)
    ]
