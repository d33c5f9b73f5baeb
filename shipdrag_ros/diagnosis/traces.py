# SPDX-License-Identifier: Apache-2.0
"""What was measured, beside what the model says without and with what is missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.diagnosis.linear import Linear, Problem
from shipdrag_ros.diagnosis.observation import Measured
from shipdrag_ros.estimation.ode_fit.record import KINDS
from shipdrag_ros.samples import Float64

ACROSS = 'position_across'


@dataclass(frozen=True)
class Compared:
    """
    One measured quantity of a run, held against the model.

    Attributes
    ----------
    quantity
        An input; `position` is the distance along the heading, and
        `position_across` the one to port of it.
    time_s : (n,)
        After the engine stop; negative in the steady record.
    speed_m_s : (n,)
        Through water, of the model after.
    measured : (n,)
        Means over short times [m/s or m].
    before, after : (n,)
        Of the model as its file states it, and with what explains the run.
    sd : (n,)
        Of the noise, its slow disturbances included.
    white_before, white_after : (n,)
        Residuals, whitened by that noise: independent, of sd 1.
    """

    quantity: str
    time_s: Float64
    speed_m_s: Float64
    measured: Float64
    before: Float64
    after: Float64
    sd: Float64
    white_before: Float64
    white_after: Float64


@dataclass(frozen=True)
class Trace:
    """
    A run.

    Attributes
    ----------
    name
        For the user.
    lead_in_s
        Length of the steady record, from which the noise is learnt.
    compared
        Each quantity that was measured.
    """

    name: str
    lead_in_s: float
    compared: tuple[Compared, ...]


def traces(problem: Problem, before: Linear, after: Linear) -> tuple[Trace, ...]:
    """
    Return each run as it was measured and as two models have it.

    Parameters
    ----------
    problem
        That both were fitted to.
    before, after
        Two models at their best fit.
    """
    return tuple(_trace(problem, j, before, after) for j in range(len(problem.seen)))


def _trace(problem: Problem, run: int, before: Linear, after: Linear) -> Trace:
    seen = problem.seen[run]
    speed = problem.predict(run, after).speed
    n = len(seen.along)
    blocks: list[tuple[str, Measured, slice]] = [(name, seen.along, slice(0, n)) for name in KINDS]
    if seen.across is not None:
        blocks.append((ACROSS, seen.across, slice(n, n + len(seen.across))))
    found = []
    for quantity, block, part in blocks:
        own = np.ones(len(block), bool)
        if quantity in KINDS:
            own = block.rows.kind == KINDS[quantity]
        if not own.any():
            continue
        measured = block.rows.value[own]
        noise = np.linalg.inv(block.whitener)
        found.append(
            Compared(
                quantity,
                block.rows.time_s[own] - seen.lead_in_s,
                speed[block.at[own]],
                measured,
                measured - before.residuals[run][part][own],
                measured - after.residuals[run][part][own],
                np.sqrt(np.sum(noise[own] ** 2, axis=1)),
                before.tables[run][0, part][own],
                after.tables[run][0, part][own],
            )
        )
    return Trace(seen.name, seen.lead_in_s, tuple(found))
