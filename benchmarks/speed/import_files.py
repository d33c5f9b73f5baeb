# SPDX-License-Identifier: Apache-2.0
"""
Files of other people, imported as they are: how many without an option, how many with one.

    SHIPDRAG_DATA=DIR python -m benchmarks.speed.import_files [--write]

A file counts as understood where a speed or a position of it becomes samples. The
option beside a file is the one that its refusal asks for. With `--write` the table
goes into docs/results/import.txt.
"""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks import ROOT, _verbs
from benchmarks._asked import asked
from benchmarks._tables import put, table

PAGE = ROOT / 'docs' / 'results' / 'import.txt'
FILES = (  # and the one option, '' where none is needed or none helps
    ('irene_2014_20140611.nmea.gz', ''),
    ('psaros_lake_geneva.nmea.gz', ''),
    ('formats/openrvdas_NBP1406_gp02.log', ''),
    ('formats/openrvdas_NBP1406_adcp.log', ''),
    ('formats/tsv_gamp_1hz.txt', '--speed-unit kn'),
    ('formats/tsv_dinghy_iso.log', '--speed-unit kn'),
    ('formats/csv_rowdy_us_dates.csv', '--speed-unit kn'),
    ('formats/n2k_candump_alinghi.txt', '--rate 30'),
    ('formats/n2k_raw.log', ''),
    ('blueboat_222_10hz.csv', ''),
    ('cse1_coast_153s_20hz.csv', ''),
    ('milliampere_nlp1_t275_20hz.csv', ''),
    ('esso_osaka_3m_180s_10hz.csv', ''),
    ('awsp_usv_coast_1hz.csv', ''),
    ('car/shotgoose_RR-Coastdown-3_coast_100hz.csv', '--map speed_over_ground=v_mps'),
    ('car/Michelin60A.csv', '--map speed_over_ground=1:km/h --rate 1'),
)
MOTION = ('speed_through_water', 'speed_over_ground', 'position')


def attempt(path: Path, option: str) -> tuple[list[str], str]:
    """Import a file; return the inputs understood, or why there are none."""
    with TemporaryDirectory() as folder:
        line = ['import', str(path), '-o', f'{folder}/out.mcap', *shlex.split(option)]
        try:
            return list(_verbs.found(*line)['written']), ''
        except RuntimeError as error:
            return [], str(error).splitlines()[-1]


def main() -> None:
    """Import the files and print the table."""
    data = Path(os.environ['SHIPDRAG_DATA'])
    rows = []
    without = with_one = 0
    for name, option in FILES:
        first, why = attempt(data / name, '')
        second, _ = attempt(data / name, option) if option else (first, '')
        without += bool(set(first) & set(MOTION))
        with_one += bool(set(second) & set(MOTION))
        reason = why.rpartition(name)[2].lstrip("': ")
        shown = ', '.join(first) or f'refused: {reason[:70]}...'
        more = ', '.join(each for each in second if each not in first)
        rows.append((name, shown, more or '-', f'`{option}`' if option else '-'))
    lines = table(('file', 'without an option', 'with one', 'the option'), rows)
    lines += ['', f'{without} of {len(FILES)} without an option, {with_one} with at most one.']
    print('\n'.join(lines))
    if asked(__doc__, write=False).write:
        put(PAGE, {'import_files': '\n'.join(lines)})


if __name__ == '__main__':
    main()
