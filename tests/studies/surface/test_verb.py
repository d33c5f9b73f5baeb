# SPDX-License-Identifier: Apache-2.0
"""`shipdrag surface`, from a table to a degree, a function and a page."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros.cli import main


@pytest.fixture
def table(tmp_path: Path) -> Path:
    """0.07 - 6e-5 alpha^2 + 3e-9 alpha^2 beta^2 on 9 x 9 angles, noise 1e-4."""
    rng = np.random.default_rng(3)
    alpha, beta = (a.ravel() for a in np.meshgrid(*[np.linspace(-90.0, 90.0, 9)] * 2))
    c_x = 0.07 - 6e-5 * alpha**2 + 3e-9 * alpha**2 * beta**2 + 1e-4 * rng.normal(size=81)
    path = tmp_path / 'forces.csv'
    rows = (f'{a},{b},{c},x' for a, b, c in zip(alpha, beta, c_x))
    path.write_text('alpha,beta,c_x,remark\n' + '\n'.join(rows))
    return path


def fit(table: Path, *more: str) -> int:
    return main(['surface', str(table), '--inputs', 'alpha,beta', '--target', 'c_x', *more])


def test_json_to_the_letter(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert fit(table, '--max-degree', '6', '--json') == 0
    shown = capsys.readouterr()
    found = json.loads(shown.out)
    assert found['degree'] == 4
    assert [row['degree'] for row in found['table']] == [2, 3, 4, 5, 6]
    assert [row['terms'] for row in found['table']] == [6, 10, 15, 21, 28]
    first, chosen = found['table'][0], found['table'][2]
    assert set(first) == {'degree', 'terms', 'sse', 'rmse', 'f', 'p'}
    assert first['f'] is None
    assert chosen['rmse'] == pytest.approx((chosen['sse'] / (81 - 15)) ** 0.5)
    assert chosen['p'] < 1e-6
    terms = {tuple(each['powers']): each for each in found['coefficients']}
    assert len(terms) == 15
    assert abs(terms[2, 2]['value'] - 3e-9) < 4.0 * terms[2, 2]['sd'] < 1e-10
    assert found['domain'] == {'alpha': [-90.0, 90.0], 'beta': [-90.0, 90.0]}
    assert 'degree 4' in shown.err


def test_exports_predicts_and_reports(table: Path, tmp_path, capsys) -> None:
    new, code, page = tmp_path / 'new.csv', tmp_path / 'c_x.py', tmp_path / 'page.html'
    new.write_text('beta,alpha\n10,20\n0,120\n')
    more = ('--predict', str(new), '--export', str(code), '--report', str(page), '--json')
    assert fit(table, *more) == 0
    shown = capsys.readouterr()
    inside, outside = json.loads(shown.out)['predictions']
    assert inside['inside']
    assert not inside['reasons']
    assert not outside['inside']
    assert outside['reasons'] == ['alpha 120 is outside -90..90 of the data']
    assert 'NO: alpha 120' in shown.err
    space: dict[str, object] = {}
    exec(code.read_text(), space)
    function = space['c_x']
    assert callable(function)
    assert function(20.0, 10.0) == pytest.approx(inside['value'], rel=1e-12)
    for name, along in (('alpha', (1e-4, 0.0)), ('beta', (0.0, 1e-4))):
        by = space[f'c_x_by_{name}']
        assert callable(by)
        step = function(20.0 + along[0], 10.0 + along[1]) - function(20.0, 10.0)
        assert by(20.0, 10.0) == pytest.approx(step / 1e-4, abs=1e-7)
        assert inside['gradient'][name] == pytest.approx(by(20.0, 10.0), rel=1e-9)
    text = page.read_text()
    assert 'degree 4' in text
    assert text.count('data:image/svg+xml') == 3


def test_errors_say_what_to_mend(table: Path, tmp_path, capsys) -> None:
    line = ['surface', str(table), '--inputs']
    assert main([*line, 'alpha,gamma', '--target', 'c_y']) == 1
    told = capsys.readouterr().err
    assert "no column 'gamma'" in told
    assert "no column 'c_y'" in told
    assert main([*line, 'alpha,beta', '--target', 'remark']) == 1
    assert "line 2, remark: 'x', expected a number" in capsys.readouterr().err
    assert main([*line, 'alpha,beta', '--target', 'alpha']) == 1
    assert "'alpha' is one of the inputs too" in capsys.readouterr().err
    for wrong in (['alpha,alpha', '--target', 'c_x'], ['a,', '--target', 'c_x']):
        with pytest.raises(SystemExit):
            main([*line, *wrong])
    with pytest.raises(SystemExit):
        fit(table, '--max-degree', '1')
    capsys.readouterr()
    odd = tmp_path / 'odd.csv'
    odd.write_text(table.read_text().replace('c_x', 'c-x'))
    code = tmp_path / 'f.py'
    assert main(
        ['surface', str(odd), '--inputs', 'alpha,beta', '--target', 'c-x', '--export', str(code)]
    )
    assert "'c-x' is no name in Python" in capsys.readouterr().err
    assert not code.exists()
