# SPDX-License-Identifier: Apache-2.0
"""One case made: what the instruments read, and what is true."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from benchmarks.worlds.propulsion.cases import PRE_ROLL_S, STOPS, Case, Plan, disturbed, planned
from benchmarks.worlds.propulsion.drive import Steady, steady
from benchmarks.worlds.propulsion.hull import Hull, water_drag
from benchmarks.worlds.propulsion.instruments import EPOCH_NS, fit_out, read
from benchmarks.worlds.propulsion.motion import ROW_S, Float64, Motion, move
from benchmarks.worlds.propulsion.sea import Weather, surroundings, waves
from shipdrag_ros.samples import Block
from shipdrag_ros.ship import ConstantAddedMass, MerchantAddedMass, Propulsion, Ship, TableBaseline

DRIVEN_SHARE = 0.05  # of the steady thrust
SETTLED_S = 120.0  # a ship that keeps this share of her speed over this time
SETTLED_SHARE = 0.98  # glides no more: the wind drives her


@dataclass(frozen=True)
class Truth:
    """
    What is true of one record, times from its start [s].

    Attributes
    ----------
    driven : (n,)
        Whether an engine pushes or pulls the ship, a row each `ROW_S`.
    gliding : (n,)
        Whether no engine is on a propeller with pitch and she is above the end speed.
    idle : (n,)
        Whether it is no question whether she glides: below the end speed, or where an engine is
        on a propeller that pushes nothing, a glide to the hull.
    glide
        From the end of drive to the end of the glide or what spoils it; None where
        there is no glide.
    first_speed_m_s
        At the stop.
    speed, retardation : (m,)
        What the glide shows [m/s, N/kg]: hull, mean wind and waves, propellers, without
        gusts; ascending in speed.
    """

    driven: np.ndarray
    gliding: np.ndarray
    idle: np.ndarray
    glide: tuple[float, float] | None
    first_speed_m_s: float
    speed: Float64
    retardation: Float64


@dataclass(frozen=True)
class World:
    """
    A case as the program meets it, and the truth.
    """

    case: Case
    ship: Ship
    blocks: dict[str, list[Block]]
    truth: Truth
    motion: Motion
    start: Steady


def build(case: Case) -> World:
    """
    Make a case; its seed and name decide everything.
    """
    random = case.random
    hull = case.ship
    plan = planned(case, random)
    seconds = plan.orders.mode.shape[1]
    course = float(random.uniform(-np.pi, np.pi))
    around, weather = surroundings(hull, case.weather, course, seconds, random)
    around = disturbed(case, around, plan.at, course, random)
    start = steady(hull, plan.speed_m_s, plan.shafts, weather.drag_n(hull, plan.speed_m_s))
    rated = steady(hull, hull.service_m_s, plan.shafts)
    whole = move(hull, plan.drive, plan.hold, start, rated, plan.orders, around, course)
    motion = _after(whole, PRE_ROLL_S)
    sea = waves(hull, case.weather, weather.head, plan.speed_m_s)
    blocks = read(motion, fit_out(random), sea, plan.pitch_heard, start.omega, random)
    truth = _truth(case, plan, motion, start, weather)
    return World(case, ship_file(hull, random), blocks, truth, motion, start)


def ship_file(hull: Hull, random: np.random.Generator) -> Ship:
    """
    What the crew knows: length, a volume, at times a rough curve of resistance.
    """
    merchant = hull.name == 'tanker'
    added = MerchantAddedMass() if merchant else ConstantAddedMass(value=0.06, sd=0.03)
    propulsion = Propulsion(run_down_s=8.0, sd=4.0) if random.random() < 0.5 else None
    speeds = np.linspace(0.15, 1.15, 9) * hull.service_m_s
    wrong = 1.0 + 0.08 * random.standard_normal() + 0.05 * random.standard_normal() * speeds
    drag = [hull.drag_n(speed) * factor for speed, factor in zip(speeds, wrong, strict=True)]
    rough = (
        TableBaseline(speed_m_s=tuple(speeds), resistance_n=tuple(drag), relative_sd=0.1)
        if random.random() < 0.3 and min(np.diff(drag)) > 0
        else None
    )
    return Ship(
        name=hull.name,
        length_m=hull.length_m,
        displaced_volume_m3=hull.volume_m3 * float(1.0 + 0.02 * random.standard_normal()),
        added_mass=added,
        propulsion=propulsion,
        baseline=rough,
    )


def inputs(world: World, names: tuple[str, ...]) -> list[Block]:
    """
    Return the blocks of some instruments.
    """
    return [block for name in names for block in world.blocks[name]]


def seconds(stamp_ns: int) -> float:
    """
    Return the time from the start of the record [s].
    """
    return (stamp_ns - EPOCH_NS) * 1e-9


def _after(motion: Motion, start_s: int) -> Motion:
    """The part that is read; times, places and yaw go on from it."""
    first = round(start_s / ROW_S)
    read = {each.name: getattr(motion, each.name)[..., first:] for each in fields(motion)}
    return Motion(**{**read, 'time_s': read['time_s'] - start_s})


def _truth(case: Case, plan: Plan, motion: Motion, start: Steady, weather: Weather) -> Truth:
    hull = case.ship
    stop = plan.at - PRE_ROLL_S
    spoilt = plan.spoilt_at - PRE_ROLL_S
    driven = motion.drive > DRIVEN_SHARE * start.thrust * start.shafts
    gliding = (motion.engaged == 0.0) & ~driven & (motion.speed > hull.end_m_s)
    pushes_not = (motion.engaged > 0.0) & (motion.drive == 0.0)
    time = motion.time_s
    glide = None
    if case.kind in STOPS or 'kick' in case.kind:
        end = _end(hull, motion, stop, spoilt)
        before = driven & (time < end)
        begin = float(time[before][-1] + ROW_S)
        glide = (begin, end) if end - begin > 30.0 else None
    speed, force = np.empty(0), np.empty(0)
    if glide:
        # the propeller's own seconds of adjustment are not what the glide shows
        inside = (time > glide[0] + 20.0) & (time < glide[1])
        speed, force = _curve(hull, weather, motion.speed[inside], motion.drag[inside])
    before_stop = (time > stop - 30) & (time < stop)
    return Truth(
        driven,
        gliding,
        pushes_not | (motion.speed <= hull.end_m_s),
        glide,
        float(motion.speed[before_stop].mean()) if before_stop.any() else start.speed_m_s,
        speed,
        force / hull.mass_kg,
    )


def _end(hull: Hull, motion: Motion, stop: float, spoilt: float) -> float:
    """When a glide is over: slow, spoilt, or as slow as the wind lets her get."""
    time = motion.time_s
    rows = round(SETTLED_S / ROW_S)
    smooth = np.convolve(motion.speed, np.ones(rows // 2) / (rows // 2), 'same')
    later = np.concatenate([smooth[rows:], np.zeros(rows)])
    settled = (later > SETTLED_SHARE * smooth) & (time > stop + 2 * SETTLED_S)
    over = (time > stop) & ((motion.speed < hull.end_m_s) | settled)
    return min(float(time[over][0]) if over.any() else float(time[-1]), float(spoilt))


def _curve(hull: Hull, weather: Weather, speed: Float64, drag: Float64) -> tuple[Float64, Float64]:
    """Mean force at each of some speeds: a glide passes each speed about once."""
    if len(speed) < 100:
        return np.empty(0), np.empty(0)
    edges = np.linspace(speed.min(), speed.max(), 41)
    place = np.clip(np.digitize(speed, edges) - 1, 0, 39)
    count = np.bincount(place, minlength=40)
    some = count > 0
    middle = np.bincount(place, speed, 40)[some] / count[some]
    force = np.bincount(place, drag, 40)[some] / count[some]
    air = [hull.drag_n(v) - water_drag(v, hull.law) + weather.drag_n(hull, v) for v in middle]
    return middle, force + np.array(air)
