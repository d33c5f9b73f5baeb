# SPDX-License-Identifier: Apache-2.0
"""The equation of motion of ship and shafts, stepped in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.worlds.propulsion.drive import CAMBER_RAD, Drive, Hold, Steady, thrust_and_torque
from benchmarks.worlds.propulsion.hull import Hull, air_drag, water_drag

STEP_S = 0.05
EVERY = 4  # steps between stored rows
ROW_S = STEP_S * EVERY
PITCH_RATE = 1.0 / 15.0  # of the steady pitch, each second
NO_THRUST_PITCH = -0.7 * np.pi * np.tan(CAMBER_RAD)  # at rest; where the lever says 0
ASTERN_DEDUCTION = 0.05  # thrust lost to the hull when a propeller pulls back
Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class Orders:
    """
    What the ship is ordered, each second.

    Attributes
    ----------
    mode, level, pitch : (shafts, n)
        `Mode`; rate of turn over the steady one; pitch over the steady one.
    turn : (n,)
        Rate of turn of the ship [rad/s].
    """

    mode: NDArray[np.int64]
    level: Float64
    pitch: Float64
    turn: Float64


@dataclass(frozen=True)
class Surroundings:
    """
    Wind, sea and water, each second.

    Attributes
    ----------
    wind : (2, n)
        Where the air goes to, east and north [m/s].
    push : (n,)
        Drag of the waves [N].
    current : (2, n)
        Where the water goes to [m/s].
    drag_factor : (n,)
        Drag of the hull over that in deep water.
    wander : (n,)
        Rate of turn that the helmsman leaves [rad/s].
    """

    wind: Float64
    push: Float64
    current: Float64
    drag_factor: Float64
    wander: Float64


@dataclass(frozen=True)
class Motion:
    """
    What happened, a row each `ROW_S`.

    Attributes
    ----------
    speed, east, north, yaw, drift : (n,)
        Through the water [m/s], place [m], heading from east [rad], sideways to port [m/s].
    thrust : (n,)
        Of all propellers [N].
    drive : (n,)
        What engines do to the ship [N]: the push of those that drive ahead, the pull of those
        that drive astern; not the drag of a propeller that an engine lets turn too slowly.
    engaged : (n,)
        How many shafts have an engine on them at some pitch.
    drag : (n,)
        Force against the motion less thrust on the hull: what a glide shows, without gusts [N].
    omega, pitch : (shafts, n)
        Rate of turn [rad/s]; pitch ratio.
    """

    time_s: Float64
    speed: Float64
    east: Float64
    north: Float64
    yaw: Float64
    drift: Float64
    thrust: Float64
    drive: Float64
    engaged: Float64
    drag: Float64
    omega: Float64
    pitch: Float64


def move(
    hull: Hull,
    drive: Drive,
    hold: Hold,
    start: Steady,
    rated: Steady,
    orders: Orders,
    around: Surroundings,
    course: float,
) -> Motion:
    """
    Sail a ship from its calm steady state through orders and surroundings.
    """
    inertia = rated.torque * drive.run_up_s / rated.omega
    engine = np.array(
        [
            start.omega, start.torque + drive.friction_on * rated.torque, inertia,
            inertia * (0.5 if drive.clutch else 1.0), drive.friction_on * rated.torque,
            drive.friction_off * rated.torque, drive.brake * rated.torque,
            drive.regenerate * rated.torque / rated.omega, float(hold), hull.pitch_ratio,
            start.diameter_m,
        ]
    )  # fmt: skip
    ship = np.array(
        [
            hull.mass_kg, hull.added_mass, hull.wake, hull.thrust_deduction, hull.air_area_m2,
            hull.length_m, hull.turn_loss, start.speed_m_s, course,
        ]
    )  # fmt: skip
    rows, shafts = _step(
        ship, hull.law, engine, orders.mode, orders.level, orders.pitch, orders.turn,
        around.wind, around.push, around.current, around.drag_factor, around.wander,
    )  # fmt: skip
    time = np.arange(rows.shape[1]) * ROW_S
    return Motion(time, *rows, *shafts)


@njit
def engine_torque(mode, level, omega, hold, steady_omega, torque, memory):  # type: ignore[no-untyped-def]
    """Torque of an engine that drives, and the memory of its governor."""
    if mode == 3:
        goal, low, high = -0.6 * steady_omega, -0.8 * torque, 0.0
    else:
        goal, low, high = level * steady_omega, 0.0, 1.15 * torque
    if mode == 1 and hold == 0:
        return level**2 * torque, memory
    if mode == 1 and hold == 1:
        power = level**3 * torque * steady_omega
        return min(power / max(omega, 0.2 * steady_omega), high), memory
    error = (goal - omega) / steady_omega
    memory = min(max(memory + error * 0.5 * STEP_S * torque, low), high)
    return min(max(memory + 4.0 * torque * error, low), high), memory


@njit
def turn_shaft(omega, rest, coulomb, inertia):  # type: ignore[no-untyped-def]
    """One step of a shaft: dry friction slows it, never turns it."""
    omega += rest * STEP_S / inertia
    slip = coulomb * STEP_S / inertia
    if abs(omega) <= slip:
        return 0.0
    return omega - slip * np.sign(omega)


@njit
def _step(ship, law, engine, mode, level, pitch_order, turn, wind, push, current, factor, wander):  # type: ignore[no-untyped-def]
    mass, added, wake, deduction, area, length, turn_loss, speed, yaw = ship
    steady_omega, rated, inertia_on, inertia_off = engine[:4]
    friction_on, friction_off, brake, regenerate, hold, design_pitch, diameter = engine[4:]
    shafts, seconds = mode.shape
    per_second = round(1.0 / STEP_S)
    n = (seconds - 1) * per_second // EVERY
    rows = np.zeros((9, n))
    out = np.zeros((2, shafts, n))
    omega = np.full(shafts, steady_omega)
    pitch = np.ones(shafts)
    memory = np.full(shafts, rated)
    east = 0.0
    north = 0.0
    for k in range(n * EVERY):
        i = k // per_second
        f = (k - i * per_second) / per_second
        thrust_all = 0.0
        driven = 0.0
        engaged = 0.0
        pulled = 0.0
        for s in range(shafts):
            m = mode[s, i]
            if m == 3 and speed < 0.05:
                m = 0
            order = pitch_order[s, i]
            if order < 0.0 and speed < 0.05:
                order = 0.0
                m = 5
            change = order - pitch[s]
            most = PITCH_RATE * STEP_S
            pitch[s] += min(max(change, -most), most)
            ratio = NO_THRUST_PITCH + pitch[s] * (design_pitch - NO_THRUST_PITCH)
            thrust, torque = thrust_and_torque(speed * (1.0 - wake), omega[s], ratio, diameter)
            given = 0.0
            coulomb = friction_on
            inertia = inertia_on
            if m == 1 or m == 3 or m == 5:
                given, memory[s] = engine_torque(
                    m, level[s, i], omega[s], hold, steady_omega, rated, memory[s]
                )
            else:
                coulomb = friction_off
                inertia = inertia_off
                memory[s] = 0.0
                if m == 2:
                    coulomb += brake
                if m == 4:
                    given = -regenerate * omega[s]
            omega[s] = turn_shaft(omega[s], given - torque, coulomb, inertia)
            thrust_all += thrust
            backward = m == 3 or pitch_order[s, i] < 0.0
            if m == 1 or m == 3:
                engaged += 1.0
            if (backward and thrust < 0.0) or ((m == 1 or m == 5) and thrust > 0.0):
                driven += abs(thrust)
            pulled += thrust * (1.0 - deduction if thrust > 0.0 else 1.0 - ASTERN_DEDUCTION)
        head = 0.0
        flow = 0.0
        c, si = np.cos(yaw), np.sin(yaw)
        for axis, along in ((0, c), (1, si)):
            air = wind[axis, i] + f * (wind[axis, i + 1] - wind[axis, i])
            head -= air * along
            flow += (current[axis, i + 1] - current[axis, i]) * along
        rate = turn[i] + wander[i]
        hull = water_drag(speed, law) * (factor[i] + f * (factor[i + 1] - factor[i]))
        turning = mass * turn_loss * 0.5 * length * turn[i] ** 2 * np.sign(speed)
        blown = air_drag(speed + head, area)
        waves = push[i] + f * (push[i + 1] - push[i])
        force = pulled - hull - turning - blown - waves
        drift = -0.4 * length * rate
        if k % EVERY == 0:
            j = k // EVERY
            rows[:5, j] = (speed, east, north, yaw, drift)
            rows[5:, j] = (thrust_all, driven, engaged, hull - pulled)
            out[0, :, j] = omega
            out[1, :, j] = pitch * design_pitch
        speed += STEP_S * (force / (mass * (1.0 + added)) - flow)
        east += STEP_S * (speed * c - drift * si + current[0, i])
        north += STEP_S * (speed * si + drift * c + current[1, i])
        yaw += STEP_S * rate
    return rows, out
