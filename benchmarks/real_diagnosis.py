# SPDX-License-Identifier: Apache-2.0
"""
What `shipdrag diagnose` says of two measured records, as a user would run it.

A yacht's log with no coastdown in it, and the coast of a model ship without a
stated baseline. Reads the folder that SHIPDRAG_DATA names and draws nothing at
random.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from real_records import DATA, MODEL_SHIP, run_command

IMPORT_LOG = f'shipdrag import ${DATA}/psaros_lake_geneva.nmea.gz -o yacht.mcap'
DIAGNOSE_LOG = 'shipdrag diagnose yacht.mcap'
DIAGNOSE_MODEL = 'shipdrag diagnose {}.mcap --window {:g} {:g}'.format(
    MODEL_SHIP.name, *MODEL_SHIP.window_s
)
RECORDS = {
    'yacht, 3.5 h of sailing': (IMPORT_LOG, DIAGNOSE_LOG),
    'model ship, 26 s of coasting': (MODEL_SHIP.import_command(), DIAGNOSE_MODEL),
}


def diagnosed(name: str, *, data: Path, out: Path) -> dict[str, Any]:
    """
    Import a record, diagnose it and return the document.
    """
    importing, diagnosing = RECORDS[name]
    run_command(importing, data=data, out=out)
    run_command(f'{diagnosing} --json diagnosis.json', data=data, out=out)
    found: dict[str, Any] = json.loads((out / 'diagnosis.json').read_text())
    return found


def show(name: str, found: dict[str, Any]) -> None:
    """
    Print what was found.
    """
    print(f'{name}: {found["verdict"]}, baseline {found["baseline"]}')
    for effect in found['effects']:
        sizes = ', '.join(
            f'{key} {size["value"]:.4f} sd {size["sd"]:.4f}'
            for key, size in effect['parameters'].items()
        )
        print(f'  {effect["name"]}: {sizes}')
    for candidate in found['candidates']:
        print(f'  {" + ".join(candidate["names"])}: {candidate["probability"]:.3f}')
    for when in ('before', 'after'):
        gap = found['gap'][when]
        print(
            f'  {when}: {1000.0 * gap["rms_speed_m_s"]:.1f} mm/s rms, '
            f'chi2 {gap["chi2_per_sample"]:.2f} a sample'
        )
    for note in [*found['notes'], *(f'would decide: {each}' for each in found['would_decide'])]:
        print(f'  {note}')


def main() -> None:
    """
    Run both.
    """
    argparse.ArgumentParser(description=__doc__).parse_args()
    if DATA not in os.environ:
        print(f'skipped: {DATA} is not set')
        return
    for name in RECORDS:
        with TemporaryDirectory() as folder:
            show(name, diagnosed(name, data=Path(os.environ[DATA]), out=Path(folder)))


if __name__ == '__main__':
    main()
