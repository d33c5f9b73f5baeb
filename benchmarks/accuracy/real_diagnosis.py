# SPDX-License-Identifier: Apache-2.0
"""
What `shipdrag diagnose` says of measured records, as a user would run it.

Logs of two yachts with no coastdown in them. Reads the folder that SHIPDRAG_DATA names
and draws nothing at random. `--write` puts it into docs/results/real_records.txt.
"""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks._asked import asked
from benchmarks._tables import put
from benchmarks.accuracy.real_records import DATA, PAGE, prepared, run_command

IMPORT_LOG = f'shipdrag import ${DATA}/psaros_lake_geneva.nmea.gz -o yacht.mcap'
DIAGNOSE_LOG = 'shipdrag diagnose yacht.mcap'


def _irene(year: str, file: str) -> tuple[str, str]:
    """Return how a record of the yacht Irene is imported and diagnosed."""
    bag = f'irene_{year}.mcap'
    return f'shipdrag import ${DATA}/{file}.nmea.gz -o {bag}', f'shipdrag diagnose {bag}'


RECORDS = {
    'yacht, 3.5 h of sailing': (IMPORT_LOG, DIAGNOSE_LOG),
    'Irene, 2007': _irene('2007', 'irene_2007_regate_1_dec_07'),
    'Irene, 2013': _irene('2013', 'irene_2013_Flensburg2013_regate_3.8'),
    'Irene, 2014': _irene('2014', 'irene_2014_20140611'),
}


def diagnosed(name: str, *, out: Path) -> dict[str, Any]:
    """
    Import a record, diagnose it and return the document.
    """
    importing, diagnosing = RECORDS[name]
    run_command(importing, out=out)
    run_command(f'{diagnosing} --json diagnosis.json', out=out)
    text = (out / 'diagnosis.json').read_text().replace(f'{out}/', '')
    found: dict[str, Any] = json.loads(text)
    return found


def block(found: dict[str, Any]) -> str:
    """
    Return what was found as it stands in docs/results/real_records.txt.
    """
    first = found['no_coastdown'] or f'{found["coastdowns_used"]} coastdown(s) used.'
    lines = [f'{first} Verdict `{found["verdict"]}`, baseline `{found["baseline"]}`.', '']
    for effect in found['effects']:
        sizes = ', '.join(
            f'{key} {size["value"]:.3f} ± {size["sd"]:.3f} (one standard deviation)'
            for key, size in effect['parameters'].items()
        )
        lines.append(f'- {effect["name"]}: {sizes}, probability {effect["probability"]:.3f}')
    candidates = ', '.join(
        f'{" + ".join(each["names"])} {each["probability"]:.3f}' for each in found['candidates']
    )
    lines.append(f'- candidates: {candidates}')
    gaps = [_gap(when, gap) for when in ('before', 'after') if (gap := found['gap'][when])]
    lines.append(f'- gap: {"; ".join(gaps)}')
    decides = (f'would decide: {each}' for each in found['would_decide'])
    lines += [f'- {line}' for line in (*found['notes'], *decides)]
    return '\n'.join(lines)


def _gap(when: str, gap: dict[str, Any]) -> str:
    chi2 = gap['chi2_per_sample']
    text = f'{when} {1000.0 * gap["rms_speed_m_s"]:.1f} mm/s rms'
    return text if chi2 is None else f'{text}, chi2 {chi2:.2f}'


def main() -> None:
    """
    Run all.
    """
    options, blocks = asked(__doc__, write=False), {}
    for name in RECORDS:
        with TemporaryDirectory() as folder:
            if not prepared(Path(folder)):
                return
            blocks[name] = block(diagnosed(name, out=Path(folder)))
        print(f'{name}\n\n{blocks[name]}\n')
    if options.write:
        put(PAGE, blocks)


if __name__ == '__main__':
    main()
