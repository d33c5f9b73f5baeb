# SPDX-License-Identifier: Apache-2.0
"""
Hypotheses about runs, simulated and made linear.

All that all hypotheses need of a run, each with a step in each of its unknowns,
are columns of one batched simulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from shipdrag_ros.diagnosis.coast_terms import BaselineTerm, Predicted, Term
from shipdrag_ros.diagnosis.model import Hypothesis, Linear
from shipdrag_ros.diagnosis.observation import Observation
from shipdrag_ros.diagnosis.terms import trial_z
from shipdrag_ros.inference.noise import apply
from shipdrag_ros.inference.rows import LOG, OVER_GROUND
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import Action, Columns, Frame, Scenario, simulate_columns

_STEP_Z = 0.02  # of the differences, in units of the prior
_STEP_M_S = 0.01  # of the steady speed
_NOTHING = Action()


@dataclass
class _Batch:
    """Columns of one simulation, as they are asked for; each is there once."""

    numbers: dict[tuple[Action, float], int] = field(default_factory=dict)

    def add(self, action: Action, speed_m_s: float) -> int:
        """Ask for a column; return its number."""
        return self.numbers.setdefault((action, speed_m_s), len(self.numbers))

    @property
    def actions(self) -> list[Action]:
        """What acts in each column."""
        return [action for action, _ in self.numbers]

    @property
    def speeds(self) -> list[float]:
        """Steady speed of each column [m/s]."""
        return [speed_m_s for _, speed_m_s in self.numbers]


@dataclass(frozen=True)
class _Plan:
    """
    Which columns a hypothesis needs of a run.

    Attributes
    ----------
    base
        At its unknowns.
    steps
        Parameter, column and size of the step of each.
    without
        Without each effect whose form is open.
    """

    base: int
    steps: list[tuple[int, int, float]]
    without: list[int]


@dataclass(frozen=True)
class _Predictions:
    """What all columns of a simulation predict of a run: as `Predicted`, a line a column."""

    along: Float64
    across: Float64
    speed: Float64
    log: Float64
    ground: Float64
    over_ground: Float64
    distance: Float64

    def of(self, column: int) -> Predicted:
        """Return what one column predicts."""
        return Predicted(
            self.along[column],
            self.across[column],
            self.speed[column],
            self.log[column],
            self.ground[column],
            self.over_ground[column],
            self.distance[column],
        )


@dataclass(frozen=True)
class CoastSimulation:
    """
    Runs, and the simulation of hypotheses about them.

    Attributes
    ----------
    ship
        As its file states it.
    seen
        The runs.
    reference_rad
        Heading of the first of all runs, along which effects of the earth are
        stated.
    """

    ship: Ship
    seen: tuple[Observation, ...]
    reference_rad: float

    @cached_property
    def bare(self) -> Ship:
        """The ship without effects: those that its file states are terms."""
        return replace(self.ship, effects=())

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """One a run; effects of the earth lie along the first run."""
        return tuple(
            Frame(
                run.ship,
                Scenario(
                    speed_m_s=run.speed_m_s,
                    lead_in_s=run.lead_in_s,
                    # beyond the last row, whatever the difference is rounded to
                    duration_s=run.duration_s + 1e-6,
                    heading_rad=run.heading_rad,
                ),
                self.reference_rad,
            )
            for run in self.seen
        )

    def linearise(
        self,
        hypotheses: Sequence[Hypothesis],
        at: Sequence[Float64],
        near: Sequence[Linear | None] | None = None,
    ) -> list[Linear]:
        """
        Return the whitened rows of each hypothesis about some unknowns.

        Parameters
        ----------
        hypotheses
            Of this model.
        at
            (p,) each.
        near
            The same about unknowns near by: the derivatives by what is known
            well beforehand, the baseline, are taken from there.

        Returns
        -------
        list of Linear
            Not finite where it cannot be simulated.
        """
        before = near or [None] * len(hypotheses)
        runs = [self._run(j, hypotheses, at, before) for j in range(len(self.seen))]
        return [
            Linear(
                hypothesis,
                z,
                tuple(run[i][0] for run in runs),
                tuple(run[i][1] for run in runs),
            )
            for i, (hypothesis, z) in enumerate(zip(hypotheses, at, strict=True))
        ]

    def responses(self, base: Linear, hypotheses: Sequence[Hypothesis]) -> Float64:
        """
        Return the linear response to the last term of each, (hypotheses, rows), whitened.

        It is 0 where it cannot be simulated.
        """
        found = []
        for j, (frame, seen) in enumerate(zip(self.frames, self.seen, strict=True)):
            batch = _Batch()
            speed = float(base.z[len(base.hypothesis.unknowns) + j])
            acting = self._acting(j, base.hypothesis, base.z)
            whole = sum((term.action(frame, j, values) for term, _, values in acting), _NOTHING)
            base_column = batch.add(whole, speed)
            own_columns = []
            for hypothesis in hypotheses:
                term = hypothesis.terms[-1]
                first, *others = term.unknowns
                sizes = [first.prior.at(trial_z(first)), *(u.prior.at(u.start) for u in others)]
                more = term.action(frame, j, sizes) if term.acts_in(j) else _NOTHING
                own_columns.append(batch.add(whole + more, speed))
            columns = self._simulate(j, batch)
            context = seen.context.predict(columns, batch.actions)
            predicted = _predicted(seen, columns)
            rows = np.hstack([predicted.along, predicted.across, context])
            change = rows[own_columns] - rows[base_column]
            change[~np.isfinite(change).all(axis=1)] = 0.0
            found.append(self._whitened(j, change))
        return np.hstack(found)

    def predict(self, run: int, linear: Linear) -> Predicted:
        """
        Return what a hypothesis predicts of a run, without its row terms.

        Parameters
        ----------
        run
            Its place among the runs.
        linear
            Of a hypothesis.

        Returns
        -------
        Predicted
            Without measurement terms.
        """
        batch = _Batch()
        plan = self._plan(run, linear.hypothesis, linear.z, batch)
        columns = self._simulate(run, batch)
        return _predicted(self.seen[run], columns).of(plan.base)

    def shown(
        self, run: int, base: Linear, added: Sequence[tuple[Term, Sequence[float]]]
    ) -> tuple[Float64, Float64]:
        """
        Return the speed that a run would show, with each of some terms besides.

        Parameters
        ----------
        run
            Its place among the runs.
        base
            Of a hypothesis, at its best fit.
        added
            Terms and the values of their parameters.

        Returns
        -------
        time_s : (m,)
            After the stop.
        speed_m_s : (1 + added, m)
            By the log where there is one; the first line is of nothing besides.
        """
        batch, frame, seen = _Batch(), self.frames[run], self.seen[run]
        acting = self._acting(run, base.hypothesis, base.z)
        whole = sum((term.action(frame, run, values) for term, _, values in acting), _NOTHING)
        speed = float(base.z[len(base.hypothesis.unknowns) + run])
        at = [batch.add(whole, speed)]  # what is alike shares a column
        for term, values in added:
            more = term.action(frame, run, values) if term.acts_in(run) else _NOTHING
            at.append(batch.add(whole + more, speed))
        columns = self._simulate(run, batch)
        by_log = bool((seen.along.rows.kind == LOG).any())
        speeds = columns.log_m_s if by_log else columns.radar_speed_m_s
        after = columns.time_s > seen.lead_in_s
        return columns.time_s[after] - seen.lead_in_s, speeds[at][:, after]

    def _simulate(self, run: int, batch: _Batch) -> Columns:
        frame = self.frames[run]
        return simulate_columns(
            frame.ship,
            frame.scenario,
            batch.actions,
            self.seen[run].time_s,
            speed_m_s=np.array(batch.speeds),
        )

    def _run(
        self,
        run: int,
        hypotheses: Sequence[Hypothesis],
        at: Sequence[Float64],
        near: Sequence[Linear | None],
    ) -> list[tuple[Float64, Float64]]:
        batch, seen = _Batch(), self.seen[run]
        plans = [
            self._plan(run, h, z, batch, known=before is not None)
            for h, z, before in zip(hypotheses, at, near, strict=True)
        ]
        columns = self._simulate(run, batch)
        predicted = _predicted(seen, columns)
        context = seen.context.predict(columns, batch.actions)
        found = []
        for hypothesis, z, plan, before in zip(hypotheses, at, plans, near, strict=True):
            table, residual = self._table(run, hypothesis, z, plan, predicted, context)
            if before is not None:
                kept = [1 + unknown for unknown in _known(hypothesis)]
                table[kept] = before.tables[run][kept]
            found.append((table, residual))
        return found

    def _plan(
        self, run: int, hypothesis: Hypothesis, z: Float64, batch: _Batch, *, known: bool = False
    ) -> _Plan:
        skipped = set(_known(hypothesis)) if known else set()
        frame = self.frames[run]
        speed = float(z[len(hypothesis.unknowns) + run])
        acting = self._acting(run, hypothesis, z)
        actions = [term.action(frame, run, values) for term, _, values in acting]
        whole = sum(actions, _NOTHING)
        base = batch.add(whole, speed)
        steps: list[tuple[int, int, float]] = []
        without: dict[int, int] = {}
        errors = hypothesis.model_errors
        with_errors = {id(error.term) for error in errors}
        for i, (term, place, values) in enumerate(acting):
            free = [k for k in range(len(term.unknowns)) if place + k not in skipped]
            if not free and id(term) not in with_errors:
                continue
            others = sum((action for j, action in enumerate(actions) if j != i), _NOTHING)
            if id(term) in with_errors:
                without[id(term)] = batch.add(others, speed)
            for k in free:
                value = term.unknowns[k].prior.at(z[place + k] + _STEP_Z)
                if value != values[k]:
                    stepped = [*values[:k], value, *values[k + 1 :]]
                    column = batch.add(others + term.action(frame, run, stepped), speed)
                    steps.append((place + k, column, _STEP_Z))
        column = batch.add(whole, speed + _STEP_M_S)
        steps.append((len(hypothesis.unknowns) + run, column, _STEP_M_S))
        return _Plan(base, steps, [without.get(id(error.term), base) for error in errors])

    def _acting(
        self, run: int, hypothesis: Hypothesis, z: Float64
    ) -> list[tuple[Term, int, list[float]]]:
        """Return what acts in a run, the places of its unknowns and their values."""
        return [
            (term, place, [u.prior.at(z[place + i]) for i, u in enumerate(term.unknowns)])
            for term, (_, place) in zip(hypothesis.terms, hypothesis.parts)
            if term.acts_in(run)
        ]

    def _table(
        self,
        run: int,
        hypothesis: Hypothesis,
        z: Float64,
        plan: _Plan,
        predicted: _Predictions,
        context: Float64,
    ) -> tuple[Float64, Float64]:
        """Return whitened rows, and the residual as it is."""
        seen, base = self.seen[run], predicted.of(plan.base)
        n = len(seen.along)
        k = 0 if seen.across is None else len(seen.across)
        table = np.zeros((1 + len(z), n + k + len(seen.context)))
        table[0, :n] = seen.along.rows.value - base.along
        if seen.across is not None:
            table[0, n : n + k] = seen.across.rows.value - base.across
        table[0, n + k :] = seen.context.value - context[plan.base]
        at = [1 + unknown for unknown, _, _ in plan.steps]
        column = [column for _, column, _ in plan.steps]
        step = np.array([step for _, _, step in plan.steps])[:, None]
        table[at, :n] = (predicted.along[column] - base.along) / step
        table[at, n : n + k] = (predicted.across[column] - base.across) / step
        table[at, n + k :] = (context[column] - context[plan.base]) / step
        added = [term.columns(seen, run, base) for term in hypothesis.measurement_terms]
        for error, other in zip(hypothesis.model_errors, plan.without):
            trace = base.along - predicted.along[other], base.across - predicted.across[other]
            added.append(error.columns(seen, trace))
        behind = hypothesis.parts[len(hypothesis.terms) :]
        for (part, place), (along, across) in zip(behind, added, strict=True):
            for i, of_part in enumerate(part.unknowns):
                of_unknown = table[1 + place + i]
                of_unknown[:n], of_unknown[n : n + k] = along[i], across[i]
                table[0] -= of_unknown * of_part.prior.at(z[place + i])
                of_unknown *= of_part.prior.slope(z[place + i])
        residual = table[0].copy()
        return self._whitened(run, table), residual

    def _whitened(self, run: int, table: Float64) -> Float64:
        """Whiten lines of rows; as they are where one is not finite."""
        if not np.isfinite(table).all():
            return table
        seen = self.seen[run]
        n = len(seen.along)
        k = 0 if seen.across is None else len(seen.across)
        # unknowns of other runs, and those known from near by, leave lines of 0, which stay so
        lines = table.any(axis=1)
        filled, whitened = table[lines], np.zeros(table.shape, order='F')
        whitened[lines, :n] = apply(seen.along.whitener, filled[:, :n])
        if seen.across is not None:
            whitened[lines, n : n + k] = apply(seen.across.whitener, filled[:, n : n + k])
        whitened[lines, n + k :] = apply(seen.context.whitener, filled[:, n + k :])
        return whitened


def _known(hypothesis: Hypothesis) -> list[int]:
    """Return the unknowns of the baseline, which stay near where they were."""
    return [
        place + k
        for part, place in hypothesis.parts
        if isinstance(part, BaselineTerm)
        for k in range(len(part.unknowns))
    ]


def rows_of(seen: Observation, columns: Columns) -> tuple[Float64, Float64, Float64]:
    """Return rows along and across (k, n), and the distance ahead (k, m), of each column."""
    found = _predicted(seen, columns)
    return found.along, found.across, found.distance


def _predicted(seen: Observation, columns: Columns) -> _Predictions:
    """Return what each column predicts of the rows."""
    cos, sin = math.cos(seen.heading_rad), math.sin(seen.heading_rad)
    place, velocity = columns.radar_position_m, columns.velocity_over_ground_m_s
    ahead = cos * place[..., 0] + sin * place[..., 1]
    to_port = cos * place[..., 1] - sin * place[..., 0]
    ground = cos * velocity[..., 0] + sin * velocity[..., 1]
    kind, at = seen.along.rows.kind, seen.along.at
    along = ahead[:, at]
    along[:, kind == LOG] = columns.log_m_s[:, at[kind == LOG]]
    along[:, kind == OVER_GROUND] = columns.radar_speed_m_s[:, at[kind == OVER_GROUND]]
    across = to_port[:, :0] if seen.across is None else to_port[:, seen.across.at]
    speed = columns.speed_through_water_m_s
    shown = columns.log_m_s, columns.radar_speed_m_s
    return _Predictions(along, across, speed, *shown, ground, ahead)
