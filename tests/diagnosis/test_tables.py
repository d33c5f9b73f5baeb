# SPDX-License-Identifier: Apache-2.0
"""The score of the method is read as the benchmark writes it."""

from __future__ import annotations

import json

import pytest

from shipdrag_ros.diagnosis.tables import Score

SUMMARY = {
    'seed': 7,
    'cases': 960,
    'figures': {
        'precision of a name': {'count': 588, 'of': 600},
        'alarm, nothing hidden': {'count': 9, 'of': 300},
        'named, first shelf': {'count': 0, 'of': 0},
        'expected calibration error': 0.04,
        'CPU s a case, median': 1.5,
    },
    'confusion': {},
}


def test_main_figures_are_shown() -> None:
    score = Score.from_json(json.dumps(SUMMARY))
    assert score is not None
    assert (score.cases, score.seed) == (960, 7)
    rows = score.table().rows
    assert [row[1:] for row in rows] == [('98.0 %', '600'), ('3.0 %', '300'), ('0.040', '')]


def test_what_was_not_scored_is_left_out() -> None:
    unknown = {**SUMMARY, 'figures': {'expected calibration error': float('nan')}}
    score = Score.from_json(json.dumps(unknown))
    assert score is not None
    assert score.table().rows == ()


@pytest.mark.parametrize('text', ['', '\n', '{}', '{"cases": 0}'])
def test_an_empty_file_is_no_score(text: str) -> None:
    assert Score.from_json(text) is None


def test_what_is_published_can_be_read() -> None:
    score = Score.published()
    assert score is None or (score.cases > 0 and score.table().rows)
