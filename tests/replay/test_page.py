# SPDX-License-Identifier: Apache-2.0
"""The page stands alone, says everything and lets nothing in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.coastdown.events import Dismissal, EndedCoastdown, NotCoastdown, Regimes
from shipdrag_ros.coastdown.regimes.bank import OUT
from shipdrag_ros.estimation.result import Estimate, FroudeMax
from shipdrag_ros.replay.page import comparison_picture, cut_picture, write_report
from shipdrag_ros.replay.run_result import RankedHull, RunResult, rank
from tests.page import Page
from tests.runs import seen


@pytest.fixture(scope='module')
def page(simulated: RunResult, tmp_path_factory: pytest.TempPathFactory) -> Any:
    path = tmp_path_factory.mktemp('page') / 'report.html'
    write_report(path, [simulated])
    return Page(path)


def test_the_page_needs_no_network(page: Any) -> None:
    assert page.links == []
    assert len(page.images) == 5
    assert all(image.startswith('data:image/svg+xml;base64,') for image in page.images)


def test_the_page_says_all_of_it(page: Any) -> None:
    words = (
        'Resistance from coastdowns: test ship',
        'sea trial.mcap',
        'the specific resistance is 0.01587 ± 0.00083 m/s²',
        'the minimum speed was reached',
        's1_joint: orthogonal polynomial',
        'true r [m/s²]',
        '2 nan, 1 late',
        'All 100 outputs in the bag are identical',
        'A note of the estimator <b>itself</b>.',
        'How to read the band',
    )
    assert [each for each in words if each not in page.text] == []
    assert 'All coastdowns together' not in page.text


def test_names_from_outside_are_text_and_nothing_else(run: RunResult, tmp_path: Path) -> None:
    evil = '<script>alert(1)</script>'
    write_report(
        tmp_path / 'report.html', [replace(run, run=seen(evil), ship=replace(run.ship, name=evil))]
    )
    assert '<script' not in (tmp_path / 'report.html').read_text(encoding='utf-8')
    assert evil in Page(tmp_path / 'report.html').text


def test_a_record_without_coastdown_is_a_result(run: RunResult, tmp_path: Path) -> None:
    dismissed = NotCoastdown(0, 60 * 10**9, Dismissal.TURN, 'the ship turned by 90 deg')
    none = replace(run, coastdowns=(), events=(dismissed,), steady_lead_s=345.0)
    write_report(tmp_path / 'report.html', [none])
    page = Page(tmp_path / 'report.html')
    assert 'No coastdown found: longest steady sailing 345 s; one stretch was looked' in page.text
    assert 'the ship turned by 90 deg' in page.text
    assert page.images == []


def test_a_coastdown_without_estimate_says_why(run: RunResult, tmp_path: Path) -> None:
    failed = replace(run.coastdowns[0], estimate=None, failure='only 3 samples')
    write_report(tmp_path / 'report.html', [replace(run, coastdowns=(failed,))])
    assert 'only 3 samples' in Page(tmp_path / 'report.html').text


def test_without_a_table_of_orders_none_is_drawn(run: RunResult, tmp_path: Path) -> None:
    (coastdown,) = run.coastdowns
    assert coastdown.estimate is not None
    averaged = replace(coastdown, estimate=replace(coastdown.estimate, order=None, orders=()))
    write_report(tmp_path / 'report.html', [replace(run, coastdowns=(averaged,))])
    page = Page(tmp_path / 'report.html')
    assert len(page.images) == 4
    assert 'number of coefficients' not in page.text
    assert 'averaged over models' in page.text


def test_hulls_compared_come_first(run: RunResult, tmp_path: Path) -> None:
    other = replace(run, ship=replace(run.ship, name='Rowdy'))
    write_report(tmp_path / 'report.html', [run, other], ranking=rank([run, other]))
    page = Page(tmp_path / 'report.html')
    assert page.text.index('Hulls compared') < page.text.index('sea trial.mcap')
    assert len(page.images) == 11


def test_coastdowns_of_one_ship_are_shown_together(run: RunResult, tmp_path: Path) -> None:
    write_report(tmp_path / 'report.html', [run, replace(run, run=seen('again.mcap'))])
    page = Page(tmp_path / 'report.html')
    assert page.text.index('All coastdowns together') < page.text.index('sea trial.mcap')
    assert 'run to run' in page.text
    assert len(page.images) == 12


def test_a_warning_about_the_bag_is_shown(run: RunResult, tmp_path: Path) -> None:
    write_report(tmp_path / 'report.html', [replace(run, warnings=('part 2 is missing',))])
    assert 'Warning: part 2 is missing' in Page(tmp_path / 'report.html').text


def test_hulls_beyond_the_colours_are_still_drawn(estimate: Estimate) -> None:
    hulls = [
        RankedHull(f'hull {n}', 0.1, FroudeMax.INFLECTION, (), estimate.valid_curve)
        for n in range(8)
    ]
    axis = comparison_picture(hulls).axes[0]
    assert [text.get_text() for text in axis.get_legend().get_texts()] == [
        hull.label for hull in hulls
    ]
    (dot,) = [line for line in axis.get_lines() if line.get_marker() == 'o'][:1]
    assert dot.get_xdata() == [0.1]


def test_a_cut_is_named_where_there_is_room_for_its_name(coastdown: EndedCoastdown) -> None:
    start_ns, end_ns = coastdown.start_ns, coastdown.end_ns
    length_ns = end_ns - start_ns
    cuts = tuple(
        NotCoastdown(start_ns + round(a * length_ns), start_ns + round(b * length_ns), reason, '')
        for a, b, reason in ((0.5, 0.8, Dismissal.THRUST), (0.9, 0.91, Dismissal.TURN))
    )
    share = np.array([1.0, 0.0])
    regimes = Regimes(
        np.array([start_ns, end_ns]),
        np.array([8.0, 1.0]),
        {name: 1.0 - share if name == 'gliding' else 0.0 * share for name in OUT}
        | {'driven': share},
        0.0,
        0.5,
    )
    shown = replace(coastdown, cuts=cuts, regimes=regimes)
    axis, strip = cut_picture(shown, None, 2e7).axes
    assert [text.get_text() for text in axis.texts] == [cuts[0].reason.value]
    assert len(axis.patches) == len(cuts)
    assert axis.get_xlim() == pytest.approx((0.0, length_ns * 1e-9))
    assert [text.get_text() for text in strip.get_legend().get_texts()] == ['driven', 'gliding']
