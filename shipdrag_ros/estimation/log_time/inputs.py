# SPDX-License-Identifier: Apache-2.0
"""What a window offers to the live estimator, as rows of one linear model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation.distance import along_track
from shipdrag_ros.estimation.log_time.robust import despike
from shipdrag_ros.estimation.ode_fit.stated import stated_weight
from shipdrag_ros.estimation.window import Series, Window
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, POSITION, Input
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.regression.orthogonal import TimeScale
from shipdrag_ros.samples import Float64, Int64

ENOUGH = 5  # distinct stamps of an input, without which it is left out


@dataclass(frozen=True)
class Inputs:
    """
    The inputs used, kind after kind.

    Attributes
    ----------
    scale
        Of time, over all of them.
    stamps : 3 of (count,) int64
        [ns].
    time_s : (n,)
        From the first stamp.
    value, clean : (n,)
        Speed [m/s] or distance along the track [m], and without spikes.
    stated : (n,)
        Weight by the variances that samples state, 1 for the typical one.
    count : (3,) int64
        Samples of each kind.
    known_sd : (3,)
        A-priori standard deviation of each, 0 where unknown.
    notes
        What was left out, a sentence each.
    """

    scale: TimeScale
    stamps: tuple[Int64, ...]
    time_s: Float64
    value: Float64
    clean: Float64
    stated: Float64
    count: Int64
    known_sd: Float64
    notes: tuple[str, ...]

    @property
    def span_s(self) -> float:
        """Length of the window."""
        return self.scale.span_ns * 1e-9

    @property
    def used(self) -> list[int]:
        """Kinds with samples."""
        return [int(kind) for kind in Input if self.count[kind]]

    @property
    def separates_water_from_ground(self) -> bool:
        """Whether there is a log, and something over ground."""
        over_ground = self.count[POSITION] + self.count[OVER_GROUND]
        return bool(self.count[LOG] and over_ground)

    def part(self, kind: int) -> slice:
        """
        Return where a kind is.
        """
        first = int(self.count[:kind].sum())
        return slice(first, first + int(self.count[kind]))


def gather(window: Window, parameters: Parameters) -> Inputs:
    """
    Bring the inputs of a window into rows.

    Raises
    ------
    EstimationError
        If there is too little, or what there is cannot be used.
    """
    series: list[Series] = [getattr(window, input_.key) for input_ in Input]
    notes = []
    used: dict[int, Series] = {}
    for kind, one in enumerate(series):
        stamps = 1 + np.count_nonzero(np.diff(one.time_ns)) if len(one) else 0
        if stamps < ENOUGH:
            if stamps:
                notes.append(
                    f'{Input(kind).key}: {len(one)} sample(s) left out, {ENOUGH} distinct stamps '
                    'are needed'
                )
            continue
        bad = int((~np.isfinite(one.value)).sum())
        if bad:
            raise EstimationError(
                f'{Input(kind).key}: {bad} value(s) are not finite: give accepted samples only'
            )
        used[kind] = one
    if not used:
        counts = ', '.join(f'{input_.key} {len(one)}' for input_, one in zip(Input, series))
        raise EstimationError(
            f'samples in the window: {counts}; {ENOUGH} distinct stamps or more of one input are '
            'needed: give a longer window'
        )
    if LOG not in used:
        notes.append('no speed through water: a current is part of the speed')
    values = [_values(kind, one) for kind, one in used.items()]
    scale = TimeScale.of(*(one.time_ns for one in used.values()))
    speed_sd = parameters.speed_sigma_m_s
    time_s: list[Float64] = [
        np.asarray((one.time_ns - scale.first_ns) * 1e-9, np.float64) for one in used.values()
    ]
    stated = [
        stated_weight(when, value, one.variance)
        for when, value, one in zip(time_s, values, used.values())
    ]
    return Inputs(
        scale,
        tuple(used[k].time_ns if k in used else np.empty(0, np.int64) for k in Input),
        np.concatenate(time_s),
        np.concatenate(values),
        np.concatenate([despike(value) for value in values]),
        np.concatenate(stated),
        np.array([len(used[k]) if k in used else 0 for k in Input]),
        np.array([speed_sd, speed_sd, parameters.position_sigma_m]),
        tuple(notes),
    )


def _values(kind: int, series: Series) -> Float64:
    if kind != POSITION:
        return series.value
    time = TimeScale.of(series.time_ns).normalise(series.time_ns)
    return along_track(time, series.value)
