# SPDX-License-Identifier: Apache-2.0
"""The notebooks run from top to bottom, and are kept without what they print."""

from __future__ import annotations

from pathlib import Path

import pytest

nbformat = pytest.importorskip('nbformat')
nbclient = pytest.importorskip('nbclient')
pytest.importorskip('ipykernel')

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / 'docs' / 'notebooks').glob('*.ipynb'))
LIMIT_S = 580


@pytest.mark.timeout(600)  # on a machine where nothing is compiled yet
@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_it_runs(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('PYTHONPATH', str(ROOT))
    notebook = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(
        notebook,
        timeout=LIMIT_S,
        kernel_name='python3',
        resources={'metadata': {'path': str(tmp_path)}},
    )
    client.execute()
    shown = [
        output for cell in notebook.cells if cell.cell_type == 'code' for output in cell.outputs
    ]
    assert sum('image/png' in output.get('data', {}) for output in shown) >= 1
    assert any('text/html' in output.get('data', {}) for output in shown)
    errors = ''.join(output['text'] for output in shown if output.get('name') == 'stderr')
    assert 'shipdrag' not in errors  # of this package; a kernel has troubles of its own


@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_it_is_kept_without_outputs(path: Path) -> None:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        if cell.cell_type == 'code':
            assert cell.outputs == []
            assert cell.execution_count is None


def test_there_are_four() -> None:
    named = {'coastdown', 'hidden_effect', 'fleet_year', 'learn'}
    assert {path.stem for path in NOTEBOOKS} == named
