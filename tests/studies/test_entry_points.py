# SPDX-License-Identifier: Apache-2.0
"""A study of a stranger's package is a verb; one that is broken is named, and breaks nothing."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

STUDY = """
from shipdrag_ros.studies import Study
STUDY = Study('{verb}', 'a study of mine', ('shipdrag {verb}',))
"""
VERB = """
def add_arguments(parser):
    parser.description = 'mine'
def run(options):
    print('it ran')
    return 0
"""


def shipdrag(folder: Path, *line: str) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join([str(folder), os.environ.get('PYTHONPATH', '')])
    return subprocess.run(
        [sys.executable, '-m', 'shipdrag_ros.cli', *line],
        env={**os.environ, 'PYTHONPATH': paths},
        capture_output=True,
        text=True,
    )


def install(folder: Path, name: str, verb: str) -> None:
    """Put a package where an installer puts it, with its entry point."""
    for part in (f'{name}/face', f'{name}-1.0.dist-info'):
        (folder / part).mkdir(parents=True)
    (folder / name / '__init__.py').write_text(STUDY.format(verb=verb))
    (folder / name / 'face' / '__init__.py').touch()
    (folder / name / 'face' / 'verb.py').write_text(VERB)
    about = folder / f'{name}-1.0.dist-info'
    (about / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n')
    (about / 'entry_points.txt').write_text(f'[shipdrag.papers]\n{name} = {name}:STUDY\n')


def test_a_study_of_another_package_is_a_verb(tmp_path: Path) -> None:
    install(tmp_path, 'stranger', 'mine')
    assert shipdrag(tmp_path, 'mine').stdout == 'it ran\n'
    assert 'a study of mine' in shipdrag(tmp_path, '--help').stdout


def test_one_that_cannot_be_loaded_is_named_and_breaks_nothing(tmp_path: Path) -> None:
    install(tmp_path, 'broken', 'mine')
    (tmp_path / 'broken' / '__init__.py').write_text('import no_such_module\n')
    install(tmp_path, 'thief', 'cable')
    install(tmp_path, 'other', 'replay')
    done = shipdrag(tmp_path, 'cable', '--length', '50', '--diameter', '0.1', '--speed', '3')
    assert done.returncode == 0
    assert 'it ran' not in done.stdout
    assert "'broken' (broken:STUDY) of shipdrag.papers is left out: No module named" in done.stderr
    for name in ('thief', 'other'):
        assert (
            f"'{name}' ({name}:STUDY) of shipdrag.papers is left out: Study(verb=" in done.stderr
        )
    assert done.stderr.count('is left out') == 3
