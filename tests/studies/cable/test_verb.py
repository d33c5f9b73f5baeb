# SPDX-License-Identifier: Apache-2.0
"""`shipdrag cable`: readable, as JSON, as a page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.studies.cable.drag import Cable, CableSurface, Tangent, tangent_range
from shipdrag_ros.studies.cable.face import verb as words

LINE = ['cable', '--length', '50', '--diameter', '0.1', '--speed', '3']
C0 = 0.25 * np.pi * (0.99 + 0.0099 * 500.0) / 500.0


def document(capsys: pytest.CaptureFixture[str], *more: str) -> Any:
    assert main([*LINE, *more, '--json']) == 0
    return json.loads(capsys.readouterr().out)


def test_the_document_has_its_figures(capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys)
    assert list(found) == ['c0', 'drag_n', 'linear_gain_n_per_m_s', 'linear_range', 'errors']
    drag_n = 0.5 * 1025.0 * C0 * 50.0 * 0.1 * 9.0
    np.testing.assert_allclose(found['c0'], C0, rtol=1e-13)
    np.testing.assert_allclose(found['drag_n'], drag_n, rtol=1e-13)
    np.testing.assert_allclose(found['linear_gain_n_per_m_s'], 2.0 * drag_n / 3.0, rtol=1e-13)
    np.testing.assert_allclose(found['linear_range'], [0.7597, 1.4625], rtol=0.0, atol=5e-5)
    rows = {row[0]: row[1:] for row in found['errors']}
    np.testing.assert_allclose(rows[1.0], [-2.0 / 3.0, 0.0], rtol=1e-13)
    np.testing.assert_allclose(rows[1.5], [1.0 / 4.5 - 1.0, -1.0 / 9.0], rtol=1e-13)
    for end in found['linear_range']:
        np.testing.assert_allclose(rows[end][1], -0.1, rtol=1e-12)


def test_each_option_changes_the_figures(capsys: pytest.CaptureFixture[str]) -> None:
    smooth = document(capsys)
    rough = document(capsys, '--rough')
    np.testing.assert_allclose(rough['c0'], 0.25 * np.pi * (0.98 + 19.6) / 500.0, rtol=1e-13)
    stated = document(capsys, '--c0', '0.02')
    assert stated['c0'] == 0.02
    np.testing.assert_allclose(stated['drag_n'] / smooth['drag_n'], 0.02 / C0, rtol=1e-13)
    fresh = document(capsys, '--density', '1000')
    np.testing.assert_allclose(fresh['drag_n'] / smooth['drag_n'], 1000 / 1025, rtol=1e-13)
    np.testing.assert_allclose(
        document(capsys, '--tolerance', '0.04')['linear_range'], [1 / 1.2, 1 / 0.8], rtol=1e-13
    )
    assert document(capsys, '--tolerance', '1')['linear_range'] == [0.5, None]
    assert document(capsys, '--speed', '1')['errors'][5][1:] != smooth['errors'][5][1:]


def test_the_readable_result_says_what_to_use_and_what_not(capsys) -> None:
    assert main(LINE) == 0
    shown = capsys.readouterr().out
    for part in (
        'A smooth cable, 50 m by 0.1 m, towed along the flow at 3 m/s: 215.2 N.',
        'within 10 % of it from 2.279 m/s to 4.387 m/s (u = V/V0 from 0.7597 to 1.4625)',
        'errs by -18.4 % at 0.7 and by -11.1 % at 1.5',
        'C V within 10 %, V',
        '0.90909 to 1.1111 m/s',
        'simulate --effect towed_cable=0.0466527',
    ):
        assert part in shown
    assert 'WARNING' not in shown
    assert main([*LINE, '--tolerance', '2']) == 0
    assert 'without upper end' in capsys.readouterr().out


def test_a_long_cable_without_a_stated_coefficient_is_warned_of(capsys) -> None:
    line = ['cable', '--length', '300', '--diameter', '0.02', '--speed', '3']
    assert main(line) == 0
    assert 'WARNING: length over diameter is 1.5e+04' in capsys.readouterr().out
    assert main([*line, '--c0', '0.02']) == 0
    assert 'WARNING' not in capsys.readouterr().out


def test_the_page_shows_the_same(tmp_path: Path) -> None:
    page = tmp_path / 'cable.html'
    assert main([*LINE, '--report', str(page)]) == 0
    text = page.read_text(encoding='utf-8')
    assert 'A smooth cable, 50 m by 0.1 m' in text
    assert '-18.4 % at 0.7' in text
    assert text.count('<img src="data:image/svg+xml') == 2


@pytest.mark.parametrize('name', ['--length', '--diameter', '--speed', '--c0', '--tolerance'])
@pytest.mark.parametrize('value', ['0', '-1', 'nan', 'inf', '1e300', 'x'])
def test_impossible_values_are_wrong_usage(name: str, value: str, capsys) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([*LINE, f'{name}={value}'])
    assert stopped.value.code == 2
    assert f"argument {name}: '{value}', expected a number above 0" in capsys.readouterr().err


def test_one_coefficient_at_a_time(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([*LINE, '--rough', '--c0', '0.02'])
    assert stopped.value.code == 2
    assert 'not allowed with' in capsys.readouterr().err


def test_a_short_cable_is_a_user_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['cable', '--length', '1', '--diameter', '0.1', '--speed', '3']) == 1
    assert 'length over diameter is 10' in capsys.readouterr().err


CABLE = Cable(50.0, 0.1, CableSurface.ROUGH)
TANGENT = Tangent(CABLE.in_water(1025.0), 2.0)


def test_the_picture_shows_the_lines_and_the_range() -> None:
    for tolerance in (0.1, 2.0):
        top, bottom = words.tangent_picture(TANGENT, tolerance).axes
        drag, touching, naive = (np.asarray(line.get_data()) for line in top.get_lines()[:3])
        np.testing.assert_allclose(drag[1], TANGENT.drag.force_n(drag[0]), rtol=1e-14)
        assert np.all(touching[1] <= drag[1] + 1e-9)
        np.testing.assert_allclose(
            naive[1], naive[0] * TANGENT.drag.force_n(np.ones(1)), rtol=1e-14
        )
        (shaded,) = bottom.patches
        low, high = tangent_range(tolerance)
        assert shaded.get_x() == low * 2.0
        np.testing.assert_allclose(
            shaded.get_x() + shaded.get_width(), min(high, 2.5) * 2.0, rtol=1e-14
        )


def test_the_cable_is_marked_among_the_coefficients() -> None:
    (axis,) = words.coefficient_picture(CABLE).axes
    *_, mark = axis.get_lines()
    assert (mark.get_xdata()[0], mark.get_ydata()[0]) == (CABLE.slenderness, CABLE.c0)
