# SPDX-License-Identifier: Apache-2.0
"""Ways to stop, and manoeuvres that are no coastdown: what the ship is ordered and when."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from benchmarks.worlds.propulsion.drive import (
    CLUTCHED,
    DIRECT,
    ELECTRIC,
    GEARBOX,
    Drive,
    Hold,
    Mode,
)
from benchmarks.worlds.propulsion.hull import HULLS, Hull
from benchmarks.worlds.propulsion.motion import Float64, Orders, Surroundings
from benchmarks.worlds.propulsion.sea import SEAS, Sea

PRE_ROLL_S = 900  # before anything is read


@dataclass(frozen=True)
class Case:
    """
    One record: a kind of stop or manoeuvre, a ship, a sea, a seed.
    """

    kind: str
    hull: str
    sea: str
    seed: int

    @property
    def random(self) -> np.random.Generator:
        """What decides everything else of it."""
        name = f'{self.kind}|{self.hull}|{self.sea}'.encode()
        return np.random.default_rng([self.seed, zlib.crc32(name)])

    @cached_property
    def ship(self) -> Hull:
        """The hull, with lightly or heavily loaded propellers of high or low pitch."""
        hull = HULLS[self.hull]
        random = np.random.default_rng([self.seed, zlib.crc32(self.hull.encode())])
        return replace(
            hull,
            disc_m2=hull.disc_m2 * float(random.uniform(0.65, 1.5)),
            pitch_ratio=hull.pitch_ratio * float(random.uniform(0.85, 1.15)),
        )

    @property
    def weather(self) -> Sea:
        """The sea."""
        return SEAS[self.sea]


@dataclass
class Plan:
    """
    What a case does.

    Attributes
    ----------
    at
        When the first thing happens [s], PRE_ROLL_S included.
    orders
        In the making.
    spoilt_at
        When a glide is spoilt; beyond the record where it is not.
    pitch_heard
        Whether the pitch of a controllable propeller is on a topic.
    """

    hull: Hull
    random: np.random.Generator
    at: int
    drive: Drive
    hold: Hold
    shafts: int
    orders: Orders
    pitch_heard: bool
    spoilt_at: int = 1 << 40
    speed_m_s: float = 0.0

    def ramp(self, start: int, length: int, goal: float) -> None:
        """Bring the revs from what they are to a goal."""
        level = self.orders.level
        level[:, start : start + length] = np.linspace(level[0, start - 1], goal, length)
        level[:, start + length :] = goal


def _off(plan: Plan) -> None:
    plan.orders.mode[:, plan.at :] = Mode.OFF


def _braked(plan: Plan) -> None:
    wait = plan.at + int(plan.random.integers(2, 12))
    plan.orders.mode[:, plan.at : wait] = Mode.OFF
    plan.orders.mode[:, wait:] = Mode.BRAKE


def _zero_pitch(plan: Plan) -> None:
    plan.hold = Hold.REVS
    plan.orders.mode[:, plan.at :] = Mode.KEPT
    plan.orders.pitch[:, plan.at :] = 0.0
    # revs are brought down after the pitch, as a combinator does
    plan.ramp(plan.at + 5, 20, float(plan.random.uniform(0.35, 1.0)))


def _staggered(plan: Plan) -> None:
    when = plan.at
    for shaft in range(plan.shafts):
        plan.orders.mode[shaft, when:] = Mode.OFF
        when += int(np.exp(plan.random.uniform(np.log(4.0), np.log(180.0))))


def _slow(plan: Plan) -> None:
    plan.ramp(plan.at, 60, 0.3)
    plan.orders.mode[:, plan.at + 60 :] = Mode.OFF


def _regenerating(plan: Plan) -> None:
    plan.orders.mode[:, plan.at :] = Mode.REGENERATE


STOPS: dict[str, Callable[[Plan], None]] = {
    'direct drive, fuel cut': _off,
    'declutched': _off,
    'declutched, shaft locked': _braked,
    'pitch to zero, pitch heard': _zero_pitch,
    'pitch to zero, not heard': _zero_pitch,
    'shafts one by one': _staggered,
    'slow run-down': _slow,
    'electric, regenerating': _regenerating,
}


def _slow_down(plan: Plan, fraction: float) -> None:
    plan.ramp(plan.at, int(plan.random.integers(5, 90)), fraction)


def _turn(plan: Plan, degrees: float) -> None:
    plan.hold = Hold.POWER
    rate = plan.random.uniform(0.12, 0.35) * 6.0 / plan.hull.length_m
    rate = float(np.clip(rate, np.radians(0.15), np.radians(1.2)))
    length = int(np.radians(degrees) / rate)
    side = plan.random.choice([-1.0, 1.0])
    shape = np.ones(length)
    edge = min(15, length // 3)
    shape[:edge] = np.linspace(0.0, 1.0, edge)
    shape[-edge:] = shape[:edge][::-1]
    shape *= np.radians(degrees) / shape.sum()
    plan.orders.turn[plan.at : plan.at + length] = side * shape


def _crash_stop(plan: Plan) -> None:
    wait = plan.at + int(plan.random.integers(5, 90))
    if plan.pitch_heard:
        plan.orders.pitch[:, plan.at :] = -0.6
        plan.hold = Hold.REVS
        return
    plan.orders.mode[:, plan.at : wait] = Mode.OFF
    plan.orders.mode[:, wait:] = Mode.ASTERN


def _kick(plan: Plan, mode: Mode) -> None:
    long = 1.0 if plan.hull.length_m > 50 else 0.5
    plan.spoilt_at = plan.at + int(long * plan.random.uniform(200, 600))
    end = plan.spoilt_at + int(plan.random.uniform(20, 60))
    plan.orders.mode[:, plan.at :] = Mode.OFF
    plan.orders.mode[:, plan.spoilt_at : end] = mode
    plan.orders.level[:, plan.spoilt_at : end] = plan.random.uniform(0.4, 0.7)
    if mode is Mode.AHEAD:
        plan.hold = Hold.REVS


def _one_of_two(plan: Plan) -> None:
    plan.orders.mode[0, plan.at :] = Mode.OFF


def _nothing(plan: Plan) -> None:
    pass


def _harbour(plan: Plan) -> None:
    plan.hold = Hold.REVS
    when = plan.at
    for level in (0.75, 0.55, 0.4, 0.28):
        plan.ramp(when, int(plan.random.integers(10, 40)), level)
        when += int(plan.random.uniform(150, 500))
    plan.orders.mode[:, when:] = Mode.OFF


OTHERS: dict[str, Callable[[Plan], None]] = {
    'slow-down to 80 %': partial(_slow_down, fraction=0.8),
    'slow-down to 60 %': partial(_slow_down, fraction=0.6),
    'slow-down to 50 %': partial(_slow_down, fraction=0.5),
    'slow-down to 30 %': partial(_slow_down, fraction=0.3),
    'turn of 35 deg': partial(_turn, degrees=35.0),
    'turn of 60 deg': partial(_turn, degrees=60.0),
    'turn of 90 deg': partial(_turn, degrees=90.0),
    'crash stop': _crash_stop,
    'kick ahead in a glide': partial(_kick, mode=Mode.AHEAD),
    'kick astern in a glide': partial(_kick, mode=Mode.ASTERN),
    'one shaft of two': _one_of_two,
    'shallow water': _nothing,
    'current changes': _nothing,
    'harbour in steps': _harbour,
}
_DRIVES = {
    'direct drive, fuel cut': DIRECT,
    'declutched, shaft locked': CLUTCHED,
    'pitch to zero, pitch heard': CLUTCHED,
    'pitch to zero, not heard': CLUTCHED,
    'electric, regenerating': ELECTRIC,
}


def planned(case: Case, random: np.random.Generator) -> Plan:
    """
    Draw what a case does.
    """
    hull = case.ship
    at = PRE_ROLL_S + int(random.uniform(720, 2100))
    seconds = at + (3000 if hull.length_m > 50 else 1800)
    drive, hold = _drive(case), Hold(int(random.integers(3)))
    shape = (_shafts(case, hull), seconds)
    mode = np.full(shape, int(Mode.AHEAD))
    orders = Orders(mode, np.ones(shape), np.ones(shape), np.zeros(seconds))
    heard = case.kind == 'pitch to zero, pitch heard'
    heard |= case.kind == 'crash stop' and hull.name == 'ferry'
    plan = Plan(hull, random, at, drive, hold, shape[0], orders, heard)
    {**STOPS, **OTHERS}[case.kind](plan)
    plan.speed_m_s = hull.service_m_s * float(random.uniform(0.65, 1.0))
    return plan


def _drive(case: Case) -> Drive:
    if case.kind in _DRIVES:
        return _DRIVES[case.kind]
    small = GEARBOX if case.hull == 'workboat' else CLUTCHED
    if case.kind in STOPS:
        return small
    return DIRECT if case.hull == 'tanker' else small


def _shafts(case: Case, hull: Hull) -> int:
    if case.kind == 'shafts one by one':
        return 4 if hull.name == 'workboat' else 2
    return 2 if case.kind == 'one shaft of two' else hull.shafts


def disturbed(
    case: Case, around: Surroundings, at: int, course: float, random: np.random.Generator
) -> Surroundings:
    """
    Add what a passage through shallow water or a tidal stream does.
    """
    n = len(around.drag_factor)
    second = np.arange(n)

    def step(start: float, length: float) -> Float64:
        return np.clip((second - start) / length, 0.0, 1.0)

    if case.kind == 'shallow water':
        there = step(at, random.uniform(60, 400)) - step(at + random.uniform(900, 1500), 200)
        return replace(around, drag_factor=1.0 + random.uniform(0.2, 0.6) * there)
    if case.kind == 'current changes':
        size = random.uniform(0.3, 1.0) * random.choice([-1.0, 1.0])
        way = course + random.uniform(-0.6, 0.6)
        change = size * step(at, random.uniform(60, 600))
        along = np.outer([np.cos(way), np.sin(way)], change)
        return replace(around, current=around.current + along)
    return around


def stops(seed: int) -> list[Case]:
    """
    Return the coastdowns of a seed: every way and ship, a sea in turn.
    """
    return [
        Case(kind, hull, list(SEAS)[(i + j) % 3], seed)
        for i, kind in enumerate(STOPS)
        for j, hull in enumerate(HULLS)
    ]


def others(seed: int) -> list[Case]:
    """
    Return the manoeuvres that are no coastdown, each with a ship and a sea in turn.
    """
    return [
        Case(kind, list(HULLS)[i % 3], list(SEAS)[(seed + i) % 3], seed)
        for i, kind in enumerate(OTHERS)
    ]
