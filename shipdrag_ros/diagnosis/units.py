# SPDX-License-Identifier: Apache-2.0
"""A log that is off by the ratio of two units is asked about them, before anything is judged."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.result import DiagnosisResult, Gap
from shipdrag_ros.display import mistaken_units
from shipdrag_ros.inference.decision import Verdict
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, POSITION


def asked(ratio: float) -> str:
    """
    Ask about units where log over ground is a ratio of two; else return ''.

    Parameters
    ----------
    ratio
        Of the log over the speed over ground.

    Returns
    -------
    str
        For the reader.
    """
    units = mistaken_units(ratio)
    if not units:
        return ''
    return (
        f'the log reads {ratio:.2f} times the way over ground, near {units}: is the unit of '
        'one of them wrong? Import it again with its unit, as in '
        '--map speed_through_water=COLUMN:kn'
    )


def waiting(question: str, **rest: Any) -> DiagnosisResult:
    """
    Return a diagnosis that waits for the answer to a question.

    Parameters
    ----------
    question
        A sentence.
    **rest
        What else there is to be said, as in `DiagnosisResult`.
    """
    return DiagnosisResult(
        verdict=Verdict.ONE_OF,
        effects=(),
        candidates=(),
        nothing=0.0,
        unnamed=0.0,
        before=Gap(None, None, math.nan),
        question=question,
        **rest,
    )


def ratio_before_the_stop(seen: Observation) -> float:
    """
    Return log over ground in the steady record; NaN without both.

    Parameters
    ----------
    seen
        A run.
    """
    rows = seen.along.rows
    steady = rows.time_s < seen.lead_in_s
    of_log = rows.value[steady & (rows.kind == LOG)]
    ground = rows.value[steady & (rows.kind == OVER_GROUND)]
    if not len(ground):
        placed = steady & (rows.kind == POSITION)
        ground = np.diff(rows.value[placed]) / np.diff(rows.time_s[placed])
    if not len(of_log) or not len(ground) or not np.median(ground) > 0.0:
        return float('nan')
    return float(np.median(of_log) / np.median(ground))
