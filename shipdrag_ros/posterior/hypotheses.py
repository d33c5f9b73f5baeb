# SPDX-License-Identifier: Apache-2.0
"""
Hypotheses about runs of one ship: what may be missing, and all rows linear in its unknowns.

The motion and the instruments are those of `motion.predict`. What an effect adds to rows is the
difference of two simulations at its parameters; the derivatives by all else but the stop are those
of the motion under its force.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from shipdrag_ros.inference.linear import Families
from shipdrag_ros.inference.rows import LOG, OVER_GROUND, POSITION, Noise, Rows
from shipdrag_ros.parameter import Parameter, Shape
from shipdrag_ros.posterior import motion, priors
from shipdrag_ros.posterior.effects import EffectWay, retardation_of
from shipdrag_ros.posterior.motion import EXTRAS
from shipdrag_ros.posterior.problem import EXACT, RunModel
from shipdrag_ros.samples import Float64, Int64
from shipdrag_ros.simulation.effect import Action, Effect, Frame

IN_SPEED, IN_TIME, QUICK_IN_TIME = 'u', 't', 't, quick'
IN_LOG, QUICK_IN_LOG, IN_GROUND = 'log', 'log, quick', 'ground'
"""Where something smooth without a name may be."""
_FORMS = 4  # splines over a run, of the error of a formula
SPLINES = {'': 0, IN_SPEED: 0, IN_TIME: 6, IN_LOG: 6, IN_GROUND: 6}
SPLINES |= {QUICK_IN_TIME: 18, QUICK_IN_LOG: 18}
"""Of something smooth, over a run: a force may change quickly."""
_STEP_Z = 0.02  # of differences
_STALLS = np.linspace(-1.5, 2.25, 26)  # tried for `_STALL`: a tenth of the speed apart
_OWN = (motion.SPEED, motion.TAU, motion.STOP, motion.PLACE, motion.CURRENT)  # of a run
# behind the extras: place to port, first heading, shaft speed of a propeller that the water
# turns, where friction stops it, scatter of the resistance from run to run, light air to the
# east and to the north
_PORT, _HEADING, _FREE, _STALL, _SCATTER, *_AIR, _LOCAL = range(EXTRAS, EXTRAS + 8)
_OF_MOTION = slice(EXTRAS - _LOCAL)  # what `motion.predict` knows
_ABSENT = 1e10  # precision from which an instrument is not there
_STEP_M_S, _STEP_S = 0.1, 0.5  # of differences
_NOTHING = Action()


class SimulatedRows(NamedTuple):
    """
    What columns of a simulation show of a run.

    Attributes
    ----------
    along : (m, n)
        The rows of the motion.
    rest : (m, q)
        Places to port, then wind, depth, shaft and heading.
    distance : (m, a)
        Ahead, at the times of the places to port.
    """

    along: Float64
    rest: Float64
    distance: Float64


@dataclass(frozen=True)
class RunSight:
    """
    One run as hypotheses see it.

    Attributes
    ----------
    model
        Rows of the motion, their noise and the prior of the stop.
    frame
    rest, whitener : (q,), (q, q)
        What is measured besides, places to port first.
    across
        How many places to port.
    heading_sd_rad
    stated_run_down_s
        Of the thrust, as the ship file states it; 0 without.
    scatter
        Of the resistance from run to run, relative.
    shaft
        Whether it is measured after its fall.
    simulate
        From actions (m,), steady speeds, and by how much the stop is later than in the frame.
    """

    model: RunModel
    frame: Frame
    rest: Float64
    whitener: Float64
    across: int
    heading_sd_rad: float
    stated_run_down_s: float
    scatter: float
    shaft: bool
    simulate: Callable[[Sequence[Action], Float64 | float, Float64 | float], SimulatedRows]

    @cached_property
    def over_run(self) -> Float64:
        """Part of the coastdown at each row, 0 .. 1."""
        time_s = self.model.rows.time_s
        result: Float64 = np.clip(time_s / time_s[-1], 0.0, 1.0)
        return result

    @cached_property
    def form_bumps(self) -> Float64:
        """What the error of a formula is made of, (4, n)."""
        return bsplines(self.over_run, _FORMS)

    @cached_property
    def across_bumps(self) -> Float64:
        """The same at the places to port, (4, a)."""
        return bsplines(np.linspace(0.0, 1.0, self.across), _FORMS)


@dataclass(frozen=True)
class Explanation:
    """
    What may be missing, in one way.

    Attributes
    ----------
    ways
        Of the effects, by name.
    smooth
        Where something smooth without a name is besides; '' without.
    frozen
        Whether all is as stated to the digit: no hypothesis, but what a gap is seen by.
    """

    ways: tuple[EffectWay, ...] = ()
    smooth: str = ''
    frozen: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects, sorted; without those that the ship file states."""
        named = [way for way in self.ways if not (way.stated or way.nameless)]
        return tuple(sorted({way.effect.name for way in named}))

    @property
    def unnamed(self) -> bool:
        """Whether something without a name is there."""
        return bool(self.smooth) or any(way.nameless for way in self.ways)

    def effects_in(self, run: int | None) -> list[Effect]:
        """Return the effects that are missing in a run; None: in any."""
        return [
            way.effect
            for way in self.ways
            if not (way.stated or way.nameless) and (run is None or way.acts_in(run))
        ]

    @property
    def log_odds(self) -> float:
        """Prior log odds over nothing."""
        unnamed = math.log(priors.UNNAMED_ODDS.mean) if self.smooth else 0.0
        return sum(way.log_odds for way in self.ways) + unnamed

    @cached_property
    def unknowns(self) -> tuple[Parameter, ...]:
        """Of the effects, and of what they leave open."""
        return tuple(q for way in self.ways for q in way.unknowns)

    @cached_property
    def placed(self) -> tuple[tuple[EffectWay, slice], ...]:
        """Each way, and where its unknowns stand among those of the effects."""
        ends = accumulate(len(way.unknowns) for way in self.ways)
        return tuple(
            (way, slice(end - len(way.unknowns), end)) for way, end in zip(self.ways, ends)
        )

    def actions(self, frame: Frame, run: int, z: Float64) -> list[Action]:
        """Return what each effect does in a run."""
        return [way.action(frame, z[own].tolist(), run) for way, own in self.placed]

    @property
    def forms(self) -> list[int]:
        """Places among the effects of those whose formula may be off."""
        return [
            i for i, way in enumerate(self.ways) if way.effect.formula_sd > 0.0 and not way.stated
        ]


@dataclass
class _Asked:
    """Columns of one simulation; each is there once."""

    numbers: dict[tuple[float, Action, float], int] = field(default_factory=dict)

    def add(self, action: Action, began: _Began) -> int:
        return self.numbers.setdefault((began.later_s, action, began.speed_m_s), len(self.numbers))

    def simulate(self, run: RunSight) -> SimulatedRows:
        later_s, actions, speed_m_s = zip(*self.numbers, strict=True)
        return run.simulate(actions, np.array(speed_m_s), np.array(later_s))


class _Began(NamedTuple):
    """What acts in a run without effects, her steady speed, and by how much later she stops."""

    still: Action
    speed_m_s: float
    later_s: float


class RunTable(NamedTuple):
    """
    Rows of one run, linear about some unknowns.

    Attributes
    ----------
    along : (1 + l, n)
        Residual, then derivatives of the prediction; not whitened.
    rest : (1 + l, q)
        The same of what is measured besides, whitened.
    place : (l,)
        Of each line among all unknowns.
    white
        Noise of the rows, and how the hull damps there.
    residual : (q,)
        Of `rest`, not whitened.
    speed_m_s : (n,)
        Through water, at the rows of the motion.
    """

    along: Float64
    rest: Float64
    place: Int64
    white: Noise
    residual: Float64
    speed_m_s: Float64


@dataclass(frozen=True)
class ShipRuns:
    """
    Runs of one ship, with the unknowns that they share.

    Attributes
    ----------
    runs
        With one law.
    """

    runs: tuple[RunSight, ...]

    @property
    def coefficients(self) -> int:
        """How many coefficients of forces there are."""
        return self.runs[0].model.coefficients

    @cached_property
    def places(self) -> tuple[Int64, ...]:
        """Of each run's own unknowns among those of all."""
        k, own = self.coefficients, self._own
        shared = [i for i in range(_LOCAL) if i not in own]
        found = []
        for j in range(len(self.runs)):
            place = np.empty(k + _LOCAL, np.int64)
            place[:k] = np.arange(k)
            place[[k + i for i in shared]] = k + np.arange(len(shared))
            first = k + len(shared) + j * len(own)
            place[[k + i for i in own]] = first + np.arange(len(own))
            found.append(place)
        return tuple(found)

    @property
    def apart(self) -> bool:
        """Whether runs are of different days."""
        days = [run.frame.scenario.day for run in self.runs]
        return (max(days) - min(days)) * 24.0 > priors.SAME_DAY.mean

    @cached_property
    def _own(self) -> list[int]:
        """Unknowns that each run has for itself; of other days, the air too."""
        return [*_OWN, _PORT, _HEADING, _SCATTER, *(_AIR if self.apart else ())]

    @property
    def own(self) -> list[Int64]:
        """Places of the unknowns that belong to each run alone."""
        k = self.coefficients
        mine = [k + i for i in self._own]
        return [place[mine] for place in self.places]

    @cached_property
    def size(self) -> int:
        """Number of unknowns that every hypothesis has."""
        return 1 + max(int(place.max()) for place in self.places)

    @cached_property
    def start(self) -> Float64:
        """Where a search begins: the baseline as it is stated."""
        found = np.zeros(self.size)
        for run, place in zip(self.runs, self.places):
            found[place[_OF_MOTION]] = run.model.start
            found[place[self.coefficients + _FREE]] = priors.FREE_SHAFT.mean
        found[: self.coefficients] = 0.0
        return found

    def as_stated(self, at: Float64) -> Float64:
        """
        Return unknowns with all that is not a matter of where a run began as it is stated.
        """
        found, _ = self._base(priors.NOTHING, 0)
        k = self.coefficients
        for place in self.places:
            kept = place[[k + i for i in (motion.SPEED, motion.PLACE, _PORT, _HEADING, _STALL)]]
            found[kept] = at[kept]
        return found

    def stopping_elsewhere(self, at: Float64) -> list[Float64]:
        """
        Return unknowns with the free shaft stopping at other speeds; none where none is read.
        """
        if not any(run.shaft for run in self.runs):
            return []
        elsewhere = np.tile(at, (len(_STALLS), 1))
        elsewhere[:, self.places[0][self.coefficients + _STALL]] = _STALLS
        return list(elsewhere)

    def width(self, hypothesis: Explanation) -> int:
        """Return the number of unknowns of a hypothesis."""
        effects = len(hypothesis.unknowns) + _FORMS * len(hypothesis.forms)
        return self.size + effects + SPLINES[hypothesis.smooth] * len(self.runs)

    def priors(self, hypothesis: Explanation, now: Float64) -> Families:
        """
        Return the families of a hypothesis; means count from some unknowns (p,).
        """
        size, width = self.size, self.width(hypothesis)
        smooth = size + len(hypothesis.unknowns) + _FORMS * len(hypothesis.forms)
        hulls = self._hulls[priors.SMOOTH if hypothesis.smooth == IN_SPEED else priors.NOTHING]
        sizes = np.array(priors.SMOOTH_SIZES if width > smooth else (1.0,))
        components = [
            [size + own.start + i for i in way.components]
            for way, own in hypothesis.placed
            if way.components
        ]
        alike = len(sizes) * 2 ** len(components)
        mean, precision = (np.repeat(each, alike, axis=0) for each in hulls[:2])
        if hypothesis.frozen:
            precision[:, self._stated] = EXACT**-2.0
        count, more = len(mean), width - size
        mean = np.hstack([mean, np.zeros((count, more))])
        precision = np.hstack([precision, np.ones((count, more))])
        which = np.arange(count)
        precision[:, smooth:] = sizes[which // 2 ** len(components) % len(sizes), None] ** -2.0
        for i, each in enumerate(components):
            precision[np.ix_(which >> i & 1 == 1, each)] = priors.SMALL_COMPONENTS.mean**-2.0
        log_chance = np.repeat(hulls.log_chance - math.log(alike), alike)
        return Families(mean - now, precision, log_chance)

    @cached_property
    def _hulls(self) -> dict[str, Families]:
        """By name, the families of the unknowns that every hypothesis has."""
        families, k = max((run.model.families for run in self.runs), key=len), self.coefficients
        found = {}
        for name in (priors.NOTHING, priors.SMOOTH):
            # without a baseline the hull is something smooth in any case
            hulls = families.named(name) or families
            bases = [self._base(name, number) for number in range(len(hulls))]
            mean, precision = (np.array(each) for each in zip(*bases))
            mean[:, :k], precision[:, :k] = hulls.mean[:, :k], hulls.precision[:, :k]
            chance = hulls.chance / hulls.chance.sum()
            found[name] = Families(mean, precision, np.log(chance))
        return found

    @cached_property
    def _stated(self) -> Int64:
        """Places of what a ship file states, or would: all but how runs began, and filters."""
        began = (motion.SPEED, motion.STOP, motion.PLACE, _PORT, _HEADING)
        free = [self.coefficients + i for i in (*began, motion.LAG, motion.GROUND_LAG)]
        kept = np.concatenate([place[free] for place in self.places])
        return np.setdiff1d(np.arange(self.size), kept)

    def _base(self, name: str, number: int) -> tuple[Float64, Float64]:
        """Return mean and precision of the unknowns that are no coefficients, in a family."""
        mean, precision = np.zeros(self.size), np.ones(self.size)
        given = np.zeros(self.size, bool)
        k = self.coefficients
        calm = priors.sheltered(max(run.model.speed_m_s for run in self.runs))
        for run, place in zip(self.runs, self.places):
            all_ = run.model.families
            alike = all_.named(name) or all_
            which = number % len(alike)  # a run without a log has fewer
            own, own_mean, own_precision = (
                each[k:] for each in (place[_OF_MOTION], alike.mean[which], alike.precision[which])
            )
            # an instrument that runs share may not be in all of them
            acts = own_precision < _ABSENT
            known = acts | ~given[own]
            mean[own[known]], precision[own[known]] = own_mean[known], own_precision[known]
            given[own[acts]] = True
            mean[place[k + _FREE]] = priors.FREE_SHAFT.mean
            precision[place[k + _FREE]] = priors.FREE_SHAFT.sd**-2.0
            precision[place[k + _PORT]] = 1e-6  # of where she was, nothing is known
            precision[place[k + _HEADING]] = max(run.heading_sd_rad, EXACT) ** -2.0
            precision[place[k + _SCATTER]] = max(run.scatter, EXACT) ** -2.0
            for i in _AIR:
                precision[place[k + i]] = (calm * priors.LIGHT_AIR.sd) ** -2.0
            at = place[k + motion.CURRENT]
            if precision[at] < _ABSENT:
                precision[at] = (calm * priors.CALM_CURRENT.sd) ** -2.0
        return mean, precision

    def linearise(
        self, hypotheses: Sequence[Explanation], at: Sequence[Float64]
    ) -> list[list[RunTable] | None]:
        """
        Return the rows of each run under each hypothesis, linear about its unknowns.

        None where a hypothesis cannot be simulated.
        """
        found: list[list[RunTable] | None] = [[] for _ in hypotheses]
        for j in range(len(self.runs)):
            for i, table in enumerate(self.linearise_run(j, hypotheses, at)):
                mine = found[i]
                if mine is not None and table is not None:
                    mine.append(table)
                else:
                    found[i] = None
        return found

    def linearise_run(
        self, j: int, hypotheses: Sequence[Explanation], at: Sequence[Float64]
    ) -> list[RunTable | None]:
        """Return the rows of one run under each hypothesis; None as in `linearise`."""
        run, batch = self.runs[j], _Asked()
        plans = [self._plan(j, h, x, batch) for h, x in zip(hypotheses, at, strict=True)]
        shown = batch.simulate(run)
        return [self._table(j, h, x, plan, shown) for h, x, plan in zip(hypotheses, at, plans)]

    def _plan(self, j: int, hypothesis: Explanation, at: Float64, batch: _Asked) -> _Places:
        run, z = self.runs[j], at[self.size : self.size + len(hypothesis.unknowns)]
        began = self.began(j, at)
        actions = [began.still, *hypothesis.actions(run.frame, j, z), self.air(j, at)]
        whole = Action.total(*actions)

        def instead(i: int, action: Action) -> int:
            """Ask for a column in which one of the actions is another."""
            changed = [*actions]
            changed[i] = action
            return batch.add(Action.total(*changed), began)

        steps: list[tuple[int, int, float]] = []
        for i, (way, own) in enumerate(hypothesis.placed, 1):
            for stepped in (z[own] + _STEP_Z * np.eye(len(way.unknowns))).tolist():
                column = instead(i, way.action(run.frame, stepped, j))
                steps.append((_LOCAL + len(steps), column, _STEP_Z))
        for line, wind in zip(_AIR, ((_STEP_M_S, 0.0), (0.0, _STEP_M_S))):
            steps.append((line, batch.add(whole + Action(wind_m_s=wind), began), _STEP_M_S))
        stalled = whole.friction_m_s * math.expm1(priors.SHAFT_FRICTION.sd * _STEP_Z)
        shafts = Action(free_shaft=_STEP_Z), Action(friction_m_s=stalled)
        for line, shaft in zip((_FREE, _STALL), shafts if run.shaft else ()):
            steps.append((line, batch.add(whole + shaft, began), _STEP_Z))
        without = [instead(1 + form, _NOTHING) for form in hypothesis.forms]
        at_stop = began, began._replace(later_s=began.later_s + _STEP_S)
        # what an effect does begins with the stop
        base, acting = ([batch.add(each, at) for at in at_stop] for each in (began.still, whole))
        return _Places(base, acting, steps, without, Action.total(*actions[1:]))

    def air(self, j: int, at: Float64) -> Action:
        """Return what light air does that blows in a run in every hypothesis."""
        east, north = (float(at[self.places[j][self.coefficients + i]]) for i in _AIR)
        return Action(wind_m_s=(east, north))

    def began(self, j: int, at: Float64) -> _Began:
        """Return how a run began at some unknowns."""
        run, place, k = self.runs[j], self.places[j], self.coefficients
        tau_s = run.model.forces.tau_s * math.exp(float(at[place[k + motion.TAU]]))
        friction = priors.SHAFT_FRICTION
        still = Action(
            run_down_change_s=tau_s - run.stated_run_down_s,
            free_shaft=float(at[place[k + _FREE]]),
            friction_m_s=run.model.speed_m_s
            * friction.mean
            * math.exp(friction.sd * float(at[place[k + _STALL]])),
        )
        speed_m_s, later_s = (float(at[place[k + i]]) for i in (motion.SPEED, motion.STOP))
        return _Began(still, speed_m_s, later_s)

    def _table(
        self, j: int, hypothesis: Explanation, at: Float64, plan: _Places, shown: SimulatedRows
    ) -> RunTable | None:
        run, model, place, k = self.runs[j], self.runs[j].model, self.places[j], self.coefficients
        own, q = at[place[_OF_MOTION]], len(hypothesis.unknowns)
        rows, n = model.rows, len(model.rows.time_s)
        forces = _with(model.forces, plan.action, run.frame, run)
        table, speed = motion.predict(forces, own, model.grid_s, rows)
        alone = motion.settled(model.forces, own[:k])  # without effects
        residual, _ = motion.predict(alone, own[k:], model.grid_s, rows)
        acted, moved = shown.along[plan.acting] - shown.along[plan.base]
        if not all(np.isfinite(each).all() for each in (table, residual, acted, moved)):
            return None
        extra = len(hypothesis.forms) * _FORMS
        smooth = self._smooth(j, hypothesis.smooth, forces, own)
        lines = 1 + k + _LOCAL + q + extra + len(smooth)
        along, rest = np.zeros((lines, n)), np.zeros((lines, len(run.rest)))
        along[0] = residual[0] - acted
        along[1 : 1 + k + EXTRAS] = table[1:]
        along[1 + k + _SCATTER] = table[1] + table[2]  # both parts of the law
        acting, later = plan.acting
        along[1 + k + motion.STOP] = residual[1 + motion.STOP] + (moved - acted) / _STEP_S
        rest[1 + k + motion.STOP] = (shown.rest[later] - shown.rest[acting]) / _STEP_S
        along[0] -= at[place[k + _SCATTER]] * along[1 + k + _SCATTER]
        rest[0] = run.rest - shown.rest[acting]
        a, first = run.across, 1 + k + _LOCAL
        if a:
            port, heading = place[k + _PORT], place[k + _HEADING]
            distance = shown.distance[acting]
            rest[0, :a] -= at[port] + at[heading] * distance
            rest[1 + k + _PORT, :a], rest[1 + k + _HEADING, :a] = 1.0, distance
        line, stepped, step = map(np.array, zip(*plan.steps, strict=True))
        for found, columns in ((along, shown.along), (rest, shown.rest)):
            found[1 + k + line] = (columns[stepped] - columns[acting]) / step[:, None]
        for i, (form, column) in enumerate(zip(hypothesis.forms, plan.without)):
            sd, to = hypothesis.ways[form].effect.formula_sd, first + q + _FORMS * i
            trace = sd * (shown.along[acting] - shown.along[column])
            along[to : to + _FORMS] = run.form_bumps * trace
            if a:
                trace = sd * (shown.rest[acting, :a] - shown.rest[column, :a])
                rest[to : to + _FORMS, :a] = run.across_bumps * trace
        along[first + q + extra :] = smooth
        # forms and what is smooth stand at some unknowns too
        beyond = at[self.size + q :]
        mine = self._beyond(j, hypothesis)
        along[0] -= beyond[mine] @ along[first + q :]
        rest[0] -= beyond[mine] @ rest[first + q :]
        if not (np.isfinite(along).all() and np.isfinite(rest).all()):
            return None
        damping, inertia = motion.damping_of(forces, own[:k], np.maximum(speed, 0.0))
        white = model.white._replace(damping_1_s=damping, inertia=inertia)
        places = np.concatenate([place, self.size + np.arange(q), self.size + q + mine])
        return RunTable(along, rest @ run.whitener.T, places, white, rest[0].copy(), speed)

    def _beyond(self, j: int, hypothesis: Explanation) -> Int64:
        """Return places, behind the effects' unknowns, of those that a run has."""
        forms, count = _FORMS * len(hypothesis.forms), SPLINES[hypothesis.smooth]
        return np.concatenate([np.arange(forms), forms + count * j + np.arange(count)])

    def smooth(self, j: int, where: str, at: Float64) -> Float64:
        """
        Return columns (k, n) of something smooth in a run, of unit relative size.
        """
        return self._smooth(j, where, self.runs[j].model.forces, at[self.places[j][_OF_MOTION]])

    def _smooth(self, j: int, where: str, forces: motion.Forces, own: Float64) -> Float64:
        run = self.runs[j]
        rows, u_0, count = run.model.rows, run.model.speed_m_s, SPLINES[where]
        found = np.zeros((count, len(rows.time_s)))
        if count == 0:
            return found
        place = place_of(where)
        if place == IN_TIME:
            return _force_in_time(run, forces, own, count)
        if place == IN_LOG:
            by_log = rows.kind == LOG
            found[:, by_log] = u_0 * bsplines(run.over_run, count)[:, by_log]
            return found
        ground, position = rows.kind == OVER_GROUND, rows.kind == POSITION
        found[:, ground] = u_0 * bsplines(run.over_run, count)[:, ground]
        time = np.linspace(rows.time_s[0], rows.time_s[-1], 400)
        bumps = bsplines(np.clip(time / rows.time_s[-1], 0.0, 1.0), count)
        way = np.cumsum(bumps, axis=1) * (time[1] - time[0])
        for i in range(count):
            found[i, position] = u_0 * np.interp(rows.time_s[position], time, way[i])
        return found


def place_of(smooth: str) -> str:
    """
    Return where something smooth is, quick or not.
    """
    return smooth.partition(',')[0]


class _Places(NamedTuple):
    """
    Columns that a hypothesis needs of a run; steps of unknowns, by line and by how much.

    `base` and `acting`, without effects and with them, are each of the stop and of a later one.
    """

    base: list[int]
    acting: list[int]
    steps: list[tuple[int, int, float]]
    without: list[int]
    action: Action


def _with(forces: motion.Forces, action: Action, frame: Frame, run: RunSight) -> motion.Forces:
    """Return forces with what an action adds."""
    grid = run.model.law.speed_m_s
    # a table of the ship file may end below the highest speed that a fit may try
    low, high = frame.ship.baseline_range_m_s
    r, inertia = retardation_of(action, frame, np.clip(grid, low, high))
    if not r.any() and inertia == 0.0:
        return forces
    slope = np.gradient(r, forces.step_m_s, edge_order=2)
    more = forces.inertia.copy()
    more[0] += inertia
    return forces._replace(known=forces.known + np.stack([r, slope]), inertia=more)


def _force_in_time(run: RunSight, forces: motion.Forces, own: Float64, count: int) -> Float64:
    """Return what forces of unit size, over r(u_0), do to the rows; one for each time."""
    rows = run.model.rows
    end = float(rows.time_s[-1])
    time = np.linspace(0.0, end, 240)
    step = time[1]
    probe = Rows(time, np.full(len(time), LOG, np.int64), np.zeros(len(time)))
    plain = own.copy()
    plain[-EXTRAS + motion.SCALE :] = 0.0
    plain[-EXTRAS + motion.STOP] = 0.0
    table, _ = motion.predict(forces, plain, run.model.grid_s, probe)
    k = run.model.coefficients
    u = np.maximum(-table[0], 0.0)
    damping, inertia = motion.damping_of(forces, own[:k], u)
    known, columns = motion.shapes_at(forces, u[:1])
    r_0 = float(known[0, 0] + own[:k] @ columns[0, :, 0])
    left = np.exp(-damping * step)
    force = -r_0 * bsplines(time / end, count) / inertia
    speed = np.zeros_like(force)
    for i in range(1, len(time)):
        speed[:, i] = left[i] * speed[:, i - 1] + 0.5 * step * (
            force[:, i] + left[i] * force[:, i - 1]
        )
    way = np.cumsum(speed, axis=1) * step
    found = np.zeros((count, len(rows.time_s)))
    after, position = rows.time_s > 0.0, rows.kind == POSITION
    for i in range(count):
        moved = np.where(
            position, np.interp(rows.time_s, time, way[i]), np.interp(rows.time_s, time, speed[i])
        )
        found[i] = np.where(after, moved, 0.0)
    return found


def bsplines(x: Float64, count: int) -> Float64:
    """
    Return cubic B-splines on even knots over 0 .. 1, (count, n); they add up to 1.
    """
    inner = np.linspace(0.0, 1.0, count - 2)
    knots = np.concatenate([np.zeros(3), inner, np.ones(3)])
    table = BSpline.design_matrix(np.clip(x, 0.0, 1.0), knots, 3).toarray()
    return np.ascontiguousarray(table.T)


def half(hypothesis: Explanation, size: int) -> list[int]:
    """Return places of unknowns that have one side only."""
    unknowns = hypothesis.unknowns
    return [size + i for i, q in enumerate(unknowns) if q.prior.shape is Shape.HALF_NORMAL]
