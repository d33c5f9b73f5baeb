# SPDX-License-Identifier: Apache-2.0
"""`shipdrag residual`, from tests of hulls to predictions, a page and a ship file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.ship import Ship
from tests.studies.residual.conftest import RIVER_SHIP


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """40 hulls at 8 speeds, c_R in Sirotina's terms but for noise of 1 %."""
    rng = np.random.default_rng(1)
    shapes = rng.uniform([6.0, 2.8, 0.80, -0.01], [9.5, 5.5, 0.87, 0.02], (40, 4))
    rows = np.column_stack([shapes.repeat(8, axis=0), np.tile(np.linspace(0.08, 0.2, 8), 40)])
    l_b, b_t, c_b, _, froude = rows.T
    slenderness = np.cbrt(l_b**2 * b_t / c_b)
    c_r = 2.0 - 0.15 * l_b + 0.05 * b_t + 2.0 * (c_b - 0.8) + 6.0 * froude**2 * slenderness
    c_r *= 1e-3 + 1e-5 * rng.normal(size=320)
    path = tmp_path / 'models.csv'
    lines = (','.join(f'{x:.6g}' for x in (*row, y)) for row, y in zip(rows, c_r))
    path.write_text('L_B,B_T,C_B,lcb,Fr,c_R\n' + '\n'.join(lines))
    return path


def fit(table: Path, *more: str, form: str = 'sirotina') -> int:
    return main(['residual', str(table), '--form', form, '--target', 'c_R', *more])


def test_json_to_the_letter(table: Path, tmp_path, capsys) -> None:
    new, page = tmp_path / 'new.csv', tmp_path / 'page.html'
    new.write_text('Fr;slenderness;B_T;L_B\n0.14;6.68;4.1;7.8\n0.14;6.68;4.1;20\n')
    assert fit(table, '--predict', str(new), '--report', str(page), '--json') == 0
    shown = capsys.readouterr()
    found = json.loads(shown.out)
    assert found['form'] == 'sirotina'
    assert list(found['coefficients']) == [f'b{i}' for i in range(15)]
    assert 0.0 < found['F'] < (0.02 * 2e-3) ** 2
    assert 10.0 < found['condition'] < 1e4
    assert found['F'] ** 0.5 < found['left_out_rms'] < 0.1 * 2e-3
    assert f'left out is missed by {found["left_out_rms"]:.2g} (rms)' in shown.err
    assert found['domain']['Fr'] == [0.08, 0.2]
    assert list(found['domain']) == ['L_B', 'B_T', 'C_B', 'Fr']
    good, bad = found['predictions']
    assert set(good) == {'value', 'sd', 'inside', 'reasons'}
    assert good['inside']
    assert good['reasons'] == []
    assert 0.0 < good['sd'] < 0.1 * good['value']
    assert not bad['inside']
    assert 'L_B 20 is outside' in bad['reasons'][0]
    assert 'NO: L_B 20' in shown.err
    assert '40 hulls, 320 rows' in shown.err
    assert 'Of 2 predictions 1 may be used' in shown.err
    text = page.read_text()
    assert text.count('data:image/svg+xml') == 2
    assert 'L_B 20 is outside' in text
    assert '(10 C_B - 8.19)²' in text


@pytest.mark.parametrize('form', ['sakhnovsky', 'auto'])
def test_each_form(form: str, table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert fit(table, '--json', form=form) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['form'] == ('sakhnovsky' if form == 'sakhnovsky' else 'sirotina')
    assert found['predictions'] == []


def test_writes_a_ship_file_or_refuses(table: Path, tmp_path, capsys) -> None:
    ship, out = tmp_path / 'ship.yaml', tmp_path / 'out.yaml'
    ship.write_text(RIVER_SHIP)
    assert fit(table, '--ship', str(ship), '--write', str(out)) == 0
    assert Ship.load(out).baseline != Ship.load(ship).baseline
    # her table begins above rest, and she can be simulated all the same
    bag, speed = str(tmp_path / 'run.mcap'), str(float(Ship.load(out).speed(0.16)))
    line = ['simulate', '--ship', str(out), '-o', bag, '--speed', speed, '--duration', '60']
    assert main(line) == 0
    wide = tmp_path / 'wide.yaml'
    wide.write_text(RIVER_SHIP.replace('16.5', '30.0').replace('4.1', '2.5'))
    capsys.readouterr()
    refused = tmp_path / 'refused.yaml'
    assert fit(table, '--ship', str(wide), '--write', str(refused)) == 1
    assert 'B_T 12 is outside' in capsys.readouterr().err
    assert not refused.exists()
    assert fit(table, '--ship', str(ship)) == 1
    assert 'belong together' in capsys.readouterr().err
    assert fit(table, '--lcb', '0.005') == 1
    assert 'of the ship of --ship FILE' in capsys.readouterr().err
    more = ('--ship', str(ship), '--write', str(refused))
    assert fit(table, *more, form='sakhnovsky') == 1
    assert 'give --lcb' in capsys.readouterr().err
    assert fit(table, *more, '--lcb', '0.005', form='sakhnovsky') == 0


def test_errors_say_what_to_mend(table: Path, tmp_path, capsys) -> None:
    bare = tmp_path / 'bare.csv'
    bare.write_text('L_B,Fr,c_R\n8,0.1,0.001\n')
    assert fit(bare, form='sakhnovsky') == 1
    told = capsys.readouterr().err
    assert "no column 'B_T'" in told
    assert "no column 'lcb'" in told
    bare.write_text('L_B,B_T,Fr,c_R\n8,4,0.1,0.001\n')
    assert fit(bare) == 1
    assert 'neither C_B nor slenderness' in capsys.readouterr().err
    line = ['residual', str(table), '--form', 'sirotina', '--target']
    assert main([*line, 'C_B']) == 1
    assert "'C_B' is a ratio of the hull; name the column" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        fit(table, form='cubic')
