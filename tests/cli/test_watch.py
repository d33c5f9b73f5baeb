# SPDX-License-Identifier: Apache-2.0
"""What `watch` says of the bags that it plays."""

from __future__ import annotations

import shutil
from pathlib import Path

from shipdrag_ros.cli import parser
from shipdrag_ros.cli.output import Output
from shipdrag_ros.cli.watch import _source


def test_what_is_noted_of_a_bag_stands_on_the_page(steady_bag: Path, tmp_path: Path) -> None:
    bag = shutil.copy(steady_bag, tmp_path / 'own.mcap')
    sheet = tmp_path / 'run.yaml'
    sheet.write_text('facts: [calm]\n')
    options = parser('watch').parse_args(['watch', str(bag)])
    notes = ['before']
    with _source(options, None, [], Output(), notes):
        assert notes == ['before', f'{bag}: {sheet} holds for this run']
