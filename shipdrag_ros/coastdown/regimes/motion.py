# SPDX-License-Identifier: Apache-2.0
"""One history over one bin: the motion by its regime, then what the bin says."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.coastdown.regimes.state import (
    A0,
    A_VAR,
    ADVANCE,
    AMID,
    BEFORE,
    BRAKE,
    CHANGING,
    COUNT,
    CURRENT,
    DRIVEN,
    EDDY,
    EXCESS,
    FADING,
    FIRST_A,
    FREE,
    GLIDE,
    GLIDE_TURN,
    GLIDED,
    GONE,
    GROUND,
    GUST,
    GUST_A,
    HELD,
    HIGH,
    KIND,
    LAG,
    LEVEL,
    LIAR,
    LN_A,
    LN_U,
    LOG,
    LONGER,
    LOW,
    MEAN_LAG,
    MEAN_U,
    N_EDDY,
    N_EDDY_S,
    N_FIX,
    N_GROUND,
    N_GUST,
    N_LOG,
    N_RATE,
    N_WALK,
    N_WANDER,
    N_WANDER_S,
    OPEN,
    P0,
    P_VAR,
    POWER,
    RAMP_FROM,
    RAMP_S,
    RATE,
    REGIME,
    REVS,
    RUDDER,
    SINCE,
    STANDS,
    STATES,
    STAYS,
    STAYS_WAY,
    THE_LOG,
    THE_TRACK,
    THRUST,
    TORQUE,
    TURN,
    WANDER,
    WAY,
    WEIGHT,
    WINDMILLS,
    BankSetting,
    Histories,
)  # fmt: skip
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64, Int64

_PARTS = 5  # of a bin
_S = float(n.NO_THRUST)
_LAG_S, _GROUND_LAG_S = float(n.LOG_LAG_S), float(n.GROUND_LAG_S)
ROOT_TWO_PI = math.sqrt(2.0 * math.pi)
_WIDE, _WIDER = float(n.WIDE[0]), float(n.WIDE[1])
_LONGEST = math.log(float(n.LOG_LAG_MOST) / _LAG_S)
_REVERSED = -0.05  # of the steady revs
_MOST_GONE = 0.95  # of an engine that gives less and less


@compiled(inline=True, uncounted=True)
def hull_law(hull: HullPrior, log_u: float) -> tuple[float, float]:
    """Return ln of the resistance per moving mass by the curve, and its slope."""
    place = (log_u - hull.first) / hull.step
    i = int(min(max(math.floor(place), 0.0), len(hull.curve) - 2.0))
    slope = hull.curve[i + 1] - hull.curve[i]
    return hull.curve[i] + (place - i) * slope, slope / hull.step


@compiled(inline=True, uncounted=True)
def rest_speed(hull: HullPrior) -> float:
    """
    Return the speed of a hull at rest, which is never quite so [m/s].
    """
    return math.exp(hull.first - 1.0)


@compiled(inline=True, uncounted=True)
def _bounded(hull: HullPrior, log_u: float) -> float:
    """Return ln u of a hull that is at rest at least, and no faster than any."""
    last = hull.first + (len(hull.curve) - 1.0) * hull.step
    return float(min(max(log_u, hull.first - 1.0), last + 2.0))


@compiled(inline=True, uncounted=True)
def _at_rest(setting: BankSetting, u: float) -> float:
    """Return the sd of a speed of a claimed window that tells nothing at rest [m/s]."""
    rest = rest_speed(setting.hull) if setting.engine > 0.0 else 0.0
    return float(rest * (rest / u) ** 4)


@compiled(inline=True, uncounted=True)
def _advance(part: float, free: float) -> tuple[float, float]:
    """
    Return revs over speed, as of steady sailing, and their derivative by ln of `part`.

    `part` is the speed that balances over that of now. A governor holds the revs (`free` 0);
    where the torque is held, they go up with the water, to `free` without any.
    """
    if free == 0.0:
        return part, part
    root = math.sqrt(free * free + 4.0 * part * part * (1.0 - free))
    return 0.5 * (free + root), 2.0 * part * part * (1.0 - free) / root


@compiled(inline=True, uncounted=True)
def _thrust_left(f: Float64, now_s: float) -> float:
    """Return the thrust of a glide, over the resistance at its stop: the revs fall evenly."""
    left = max(0.0, 1.0 - (now_s - f[SINCE]) / f[RAMP_S])
    return float(f[THRUST] * left * left)


@compiled(inline=True, uncounted=True)
def balance(x: Float64, f: Float64, w: Int64, now_s: float) -> tuple[float, float]:
    """
    Return ln of the speed at which thrust and water would balance now.

    And its derivative by what is left open: the part of the ramp to a level.
    """
    regime = w[REGIME]
    if regime == TURN:
        return f[BEFORE], 0.0
    if regime == AMID:  # nobody knows: as if at the speed that she has
        return x[LN_U], 0.0
    if regime == LEVEL and w[KIND] == FADING:  # the speed falls evenly, at a rate left open
        gone = math.exp(min(x[OPEN], 3.0)) * (now_s - f[SINCE]) / f[RAMP_S]
        if gone > _MOST_GONE:
            return f[RAMP_FROM] + math.log(1.0 - _MOST_GONE), 0.0
        return f[RAMP_FROM] + math.log(1.0 - gone), -gone / (1.0 - gone)
    share = min(1.0, (now_s - f[SINCE]) / f[RAMP_S]) if regime == LEVEL else 1.0
    return f[RAMP_FROM] + (x[OPEN] - f[RAMP_FROM]) * share if share < 1.0 else x[OPEN], share


@compiled(uncounted=True)
def pushes(bank: Histories, i: int, now_s: float) -> bool:
    """Say whether the screw of a history pushes."""
    f, w, x = bank.number[i], bank.whole[i], bank.mean[i]
    if w[REGIME] != LEVEL:
        return w[REGIME] in (DRIVEN, TURN)
    target = balance(x, f, w, now_s)[0]
    free = f[FREE] if w[KIND] == TORQUE else 0.0
    rho = _advance(math.exp(min(target - x[LN_U], 1.0)), free)[0]
    return bool(rho * n.NO_THRUST > 1.0)


@compiled(inline=True, uncounted=True)
def _force(
    w: Int64, free: float, x: Float64, f: Float64, now_s: float, law: float, slope: float
) -> tuple[float, float, float, float, float]:
    """Return net force per mass, its derivatives by ln u, ln a and the open one, and a."""
    regime, a = w[REGIME], math.exp(min(max(law + x[LN_A], -20.0), 5.0))
    left, by_u, by_open = 1.0, 0.0, 0.0  # of the resistance that nothing balances
    if regime in (DRIVEN, LEVEL, TURN):
        target, share = balance(x, f, w, now_s)
        rho, by_target = _advance(math.exp(min(target - x[LN_U], 1.0)), free)
        thrust = (_S * rho * rho - rho) / (_S - 1.0)
        steep = by_target * (2.0 * _S * rho - 1.0) / (_S - 1.0)
        left, by_u, by_open = 1.0 - thrust, steep, a * steep * share
    elif regime == GLIDE:
        left = 1.0 - _thrust_left(f, now_s)
    if regime in (TURN, GLIDE_TURN):
        drag = math.exp(min(x[OPEN], 3.0))
        left, by_open = left + drag, -a * drag
    more = 0.0
    if regime == BRAKE:
        more = by_open = -math.exp(min(x[OPEN], 3.0)) * f[FIRST_A]
    elif regime == AMID:
        left, more, by_open = 0.0, x[OPEN], 1.0
    elif regime == GLIDE:
        more, by_open = -x[OPEN] * f[FIRST_A], -f[FIRST_A]
    net = -a * left + x[GUST] + more
    return net, -a * left * slope - a * by_u, -a * left, by_open, a


class Decay(NamedTuple):
    """What is left of gust, slow errors of log and speed over ground, and lag after a part."""

    gust: float
    wander: float
    eddy: float
    lag: float


@compiled(uncounted=True)
def decay_of(setting: BankSetting, noise: Float64) -> Decay:
    """
    Return what is left after a part of a bin.
    """
    dt, pace = setting.step_s / _PARTS, setting.pace
    return Decay(
        math.exp(-dt / (n.GUST_S * pace)),
        math.exp(-dt / (noise[N_WANDER_S] * pace)),
        math.exp(-dt / (noise[N_EDDY_S] * pace)),
        math.exp(-dt / (_LAG_S * pace)),
    )


@compiled(uncounted=True)
def predict(
    bank: Histories, i: int, setting: BankSetting, noise: Float64, decay: Decay, advance: float
) -> float:
    """
    Carry a history to the end of the bin; return its acceleration there [m/s^2].
    """
    x, p, f, w = bank.mean[i], bank.spread[i], bank.number[i], bank.whole[i]
    regime = w[REGIME]
    fades = regime == LEVEL and w[KIND] == FADING
    free = f[FREE] if regime == LEVEL and w[KIND] == TORQUE else 0.0
    dt = setting.step_s / _PARTS
    pace = setting.pace
    keep_g, keep_b, keep_e, keep_f = decay
    slowing = mean_u = mean_lag = 0.0
    u = math.exp(x[LN_U])
    if regime == DRIVEN:  # waves stay as they were learnt until that is forgotten
        law = hull_law(setting.hull, x[LN_U])[0]
        f[GUST_A] += (math.exp(law + x[LN_A]) - f[GUST_A]) * n.BIN_S / n.MEMORY_S
    for part in range(_PARTS):
        now_s = (bank.clock[0] - 1) * setting.step_s + (part + 0.5) * dt
        law, slope = hull_law(setting.hull, x[LN_U])
        net, by_u, by_a, by_open, a = _force(w, free, x, f, now_s, law, slope)
        change = min(max(dt * net / u, -0.5), 0.5)
        l_l = min(max(1.0 + dt * by_u / u - change, 0.2), 1.5)
        l_a, l_o, l_g = dt * by_a / u, dt * by_open / u, dt / u
        power = x[POWER]
        # ln a follows ln u by the exponent on top of the curve; the curve itself by its table
        for k in range(STATES):
            old, gust = p[LN_U, k], p[GUST, k]
            new = l_l * old + l_a * p[LN_A, k] + l_o * p[OPEN, k] + l_g * gust
            p[LN_A, k] = p[LN_A, k] + power * (new - old) + change * p[POWER, k]
            p[WAY, k] += dt * (u * old + p[CURRENT, k] + p[EDDY, k])
            p[LAG, k] = keep_f * p[LAG, k] - u * (new - old)
            p[LN_U, k], p[GUST, k] = new, gust * keep_g
            p[WANDER, k] *= keep_b
            p[EDDY, k] *= keep_e
        for k in range(CHANGING):
            old, gust = p[k, LN_U], p[k, GUST]
            new = l_l * old + l_a * p[k, LN_A] + l_o * p[k, OPEN] + l_g * gust
            p[k, LN_A] += power * (new - old) + change * p[k, POWER]
            p[k, WAY] += dt * (u * old + p[k, CURRENT] + p[k, EDDY])
            p[k, LAG] = keep_f * p[k, LAG] - u * (new - old)
            p[k, LN_U], p[k, GUST] = new, gust * keep_g
            p[k, WANDER] *= keep_b
            p[k, EDDY] *= keep_e
        for k in range(CHANGING, STATES):
            for j in range(CHANGING):
                p[k, j] = p[j, k]
        p[LN_U, LN_U] += 1e-10
        p[POWER, POWER] += n.EXPONENT_WALK**2 * abs(change)
        if regime in (TURN, GLIDE_TURN):
            p[OPEN, OPEN] += n.TURNS_DRIFT**2 * dt / (60.0 * pace)
        elif fades:
            p[OPEN, OPEN] += n.FADES_DRIFT**2 * dt / (600.0 * pace)
        elif regime in (DRIVEN, LEVEL):
            p[OPEN, OPEN] += n.POWER_DRIFT**2 * dt / (600.0 * pace)
        elif regime == AMID:
            p[OPEN, OPEN] += (n.AMID[1] * f[FIRST_A]) ** 2 * dt / (60.0 * pace)
        # half of it is wind, whose gusts fall with her way, and half wave groups, which do not
        full, now = f[GUST_A], a
        if regime in (GLIDE, GLIDE_TURN, BRAKE):  # the drag of a screw takes no part in it
            now = min(a, full)
        gusts = noise[N_GUST] ** 2 * max(0.5 * full * (now + full), now * now)
        if regime == AMID:  # an engine that is not held even
            if setting.engine > 0.0:
                gusts = (noise[N_GUST] * setting.engine) ** 2
            gusts += f[FIRST_A] ** 2
        p[GUST, GUST] += (1.0 - keep_g * keep_g) * gusts
        p[WANDER, WANDER] += (1.0 - keep_b * keep_b) * noise[N_WANDER] ** 2
        p[CURRENT, CURRENT] += n.CURRENT[1] ** 2 * dt / (n.CURRENT_S * pace)
        p[EDDY, EDDY] += (1.0 - keep_e * keep_e) * noise[N_EDDY] ** 2
        p[WAY, WAY] += noise[N_WALK] ** 2 * dt
        x[WAY] += dt * (u + x[CURRENT] + x[EDDY])
        lagged = keep_f * x[LAG] - u * change
        mean_lag += 0.5 * (x[LAG] + lagged) / _PARTS
        x[LAG] = lagged
        x[LN_U] = _bounded(setting.hull, x[LN_U] + change)
        before, u = u, math.exp(x[LN_U])
        mean_u += 0.5 * (before + u) / _PARTS
        x[LN_A] += power * change
        x[GUST] *= keep_g
        x[WANDER] *= keep_b
        x[EDDY] *= keep_e
        slowing = net
    x[WAY] -= advance
    f[MEAN_U], f[MEAN_LAG] = mean_u - u, mean_lag - x[LAG]
    return slowing


@compiled(inline=True, uncounted=True)
def _take(
    x: Float64,
    p: Float64,
    h: Float64,
    work: Float64,
    off: float,
    variance: float,
    bad: float,
    hull: HullPrior,
) -> tuple[float, float]:
    """
    Update by one reading, as usual, of more scatter, or bad.

    Return its log density, and how much more than its expectation that is.
    """
    total = variance
    for j in range(STATES):
        row = 0.0
        for k in range(STATES):
            if h[k] != 0.0:
                row += p[j, k] * h[k]
        work[0, j] = row
        total += h[j] * row
    wider = total + (_WIDER * _WIDER - 1.0) * variance
    usual = (1.0 - n.BAD - _WIDE) * math.exp(-0.5 * off * off / total) / math.sqrt(total)
    wide = _WIDE * math.exp(-0.5 * off * off / wider) / math.sqrt(wider)
    density = (usual + wide) / ROOT_TWO_PI + n.BAD * bad
    usual, wide = usual / (ROOT_TWO_PI * density), wide / (ROOT_TWO_PI * density)
    if usual + wide > 1e-6:
        gain = usual / total + wide / wider
        around = (usual / total**2 + wide / wider**2 - gain * gain) * off * off
        for j in range(STATES):
            x[j] += gain * work[0, j] * off
            more = (around - gain) * work[0, j]
            for k in range(j + 1):
                p[j, k] += more * work[0, k]
                p[k, j] = p[j, k]
        x[LN_U] = _bounded(hull, x[LN_U])
    return math.log(density), 0.5 + math.log(density * ROOT_TWO_PI * math.sqrt(total))


@compiled(inline=True, uncounted=True)
def _normal(off: float, sd: float) -> float:
    return math.exp(-0.5 * (off / sd) ** 2) / (ROOT_TWO_PI * sd)


@compiled(inline=True, uncounted=True)
def _untrue(f: Float64, column: int, value: float, wide: float, bad: float) -> float:
    """Return the log density of a reading that says nothing true: it stays, or is anything."""
    off = value - f[column]
    stays = 0.0 if np.isnan(off) else n.STUCK * _normal(off, wide)
    density = stays + (1.0 - n.STUCK) * bad
    f[EXCESS] += 0.5 + math.log(density * ROOT_TWO_PI * wide)
    share = stays / density
    f[column] = value if share < 0.1 else f[column] + 0.1 * share * off
    return math.log(density)


@compiled(inline=True, uncounted=True)
def _off(nu: float, expected: float) -> float:
    """Return the density of revs where they are known but for their own error."""
    return _normal(nu - expected, math.hypot(n.SHAFT_SD[0], n.SHAFT_SD[1] * expected))


@compiled(inline=True, uncounted=True)
def _as_usual(f: Float64, nu: float, expected: float, rises: float, falls: float) -> float:
    """
    Return the density of revs that are a ratio times those expected, and learn the ratio.

    The error of an expectation stays as it is: it is paid for once, by the first reading, and
    then held. `rises` and `falls` are parts of a change of the ratio that are learnt in a bin.
    """
    ratio, now = f[REVS], nu / max(expected, 0.05)
    density = _off(nu, ratio * expected)
    f[REVS] = ratio + (rises if now > ratio else falls) * min(max(now - ratio, -0.2), 0.2)
    return density


@compiled(uncounted=True)
def _driving(
    bank: Histories,
    i: int,
    nu: float,
    log_first: float,
    u_part: float,
    now_s: float,
    several: bool,
) -> float:
    """Return the density of the revs of a screw that drives."""
    f, w, x = bank.number[i], bank.whole[i], bank.mean[i]
    regime = w[REGIME]
    target, share = balance(x, f, w, now_s)
    fades = regime == LEVEL and w[KIND] == FADING
    settled = regime == TURN or fades or share == 1.0
    at = math.exp(min(target - log_first, 1.0))
    if regime == TURN or (regime == LEVEL and w[KIND] == TORQUE):
        free = float(n.WINDMILL[0]) if regime == TURN else f[FREE]
        at = _advance(math.exp(min(target - x[LN_U], 1.0)), free)[0] * u_part
    if np.isnan(f[REVS]):
        density = _normal(nu - at, n.SHAFT_FIRST_SD)
        f[REVS] = nu / at
    else:
        gain = 0.1 if settled else 1.0
        density = _as_usual(f, nu, at, gain, gain)
    # with fewer turns a metre it drives nothing
    f[REVS] = min(max(f[REVS], 1.0 / _S), max(1.0 / at, 1.3) if several else 1.3)
    if not settled:  # on its way to the level, or one of several that turns as before
        least = 0.0 if several else min(0.8 * math.exp(x[OPEN] - log_first), 0.9)
        density = 0.5 * density + (0.5 / (1.1 - least) if least < nu < 1.1 else 0.0)
    return density


@compiled(uncounted=True)
def _running_down(
    f: Float64, nu: float, u_part: float, left: float, part: float, scaled: bool
) -> float:
    """
    Return the density of revs while the thrust goes; `part` is that of shafts that fall together.

    The error of what is expected is paid for once, as that of a level.
    """
    falls = 0.5 * u_part * (1.0 + math.sqrt(1.0 + 4.0 * _S * (_S - 1.0) * left)) / _S
    if np.isnan(f[FREE]):
        density = 1.0 if nu > n.CREEPS else 0.0  # one that stands has run down
        if scaled:
            density = _normal(nu - falls, 0.5 * n.SHAFT_FIRST_SD)
        f[FREE] = nu / falls
    else:
        density = _normal(nu - f[FREE] * falls, 0.25 * n.SHAFT_FIRST_SD)
        f[FREE] += 0.5 * (nu / falls - f[FREE])
    any_ = 1.0 if n.WINDMILL[2] * u_part < nu < 1.05 else 0.0
    return part * density + (1.0 - part) * any_


@compiled(inline=True, uncounted=True)
def _holds(f: Float64, nu: float, density: float, scaled: bool) -> None:
    """Keep the revs; of a claimed window only as far as they are no error."""
    known = not scaled and not np.isnan(f[REVS])
    share = density / (density + n.SHAFT_LIES) if known else 1.0
    f[REVS] = f[REVS] + share * (nu - f[REVS]) if known else nu


@compiled(uncounted=True)
def _dragged(
    f: Float64, kind: int, nu: float, u_part: float, handled: bool, scaled: bool
) -> float:
    """
    Return the density of the revs of a screw that does not drive.

    Where they are not `scaled` by steady sailing, they are so by the most turns a metre there
    were, and may be as many.
    """
    revs = f[REVS]
    if kind == WINDMILLS:
        if not np.isnan(revs):  # it may turn slower later, by its friction, but not faster
            return _as_usual(f, nu, u_part, 0.05, 0.3 if scaled else 0.05)
        if not scaled:
            f[REVS] = nu / u_part
            return 1.0 / u_part if nu < u_part + n.SHAFT_SD[0] else 0.0
        f[REVS] = min(nu / u_part, n.WINDMILL[2])
        wide = math.hypot(n.SHAFT_SD[0], n.WINDMILL[1] * u_part)
        at = n.WINDMILL[0] * u_part
        return _normal(nu - at, wide) if nu < n.WINDMILL[2] * u_part + n.SHAFT_SD[0] else 0.0
    if kind == STANDS or np.isnan(revs):
        stands = _normal(nu, 2.0 * n.SHAFT_SD[0])
        last = 1.0 if np.isnan(revs) else max(revs, 0.0)
        # or anything below its last: it runs down
        below = 1.0 / (last + n.SHAFT_SD[0]) if nu < last + n.SHAFT_SD[0] else 0.0
        if scaled and not np.isnan(revs):  # mostly a little
            below = 0.5 * below + 0.5 * _off(nu, 0.9 * last)
        if not scaled:  # and does not stay
            below *= 2.0 * min(max(1.0 - nu / (last + n.SHAFT_SD[0]), 0.0), 1.0)
        density = 0.5 * stands + 0.5 * below
        if not scaled and last < n.CREEPS:  # or creeps on, as it likes
            density = 0.9 * _off(nu, last) + (0.1 / n.CREEPS if nu < n.CREEPS else 0.0)
        _holds(f, nu, density, scaled)
        return density
    moves = 0.1 if kind == HELD and scaled and handled else 0.01
    if not scaled and (kind != HELD or min(nu, revs) < n.CREEPS):
        moves = 0.0  # an engine starts and stops such a screw, and what is stuck stays
    stays = (1.0 - moves) * _off(nu, revs)
    density = stays + moves
    if kind == HELD and scaled:  # revs that creep are not held
        f[REVS] += (1.0 if handled else (moves + 0.1 * stays) / density) * (nu - revs)
    elif kind == HELD:  # a sensor that is stuck stays where it was
        _holds(f, nu, density, scaled)
    return density


@compiled(uncounted=True)
def _shown_level(
    bank: Histories, i: int, setting: BankSetting, nu: float, log_first: float, now_s: float,
    work: Float64,
) -> float:  # fmt: skip
    """Take the revs for those of a level that is reached in this bin; return the log density."""
    f, x = bank.number[i], bank.mean[i]
    reached_s = f[SINCE] + f[RAMP_S]
    if not now_s - setting.step_s < reached_s <= now_s or nu < n.CREEPS:
        return 0.0
    h = work[1]
    for j in range(STATES):
        h[j] = 0.0
    h[OPEN] = 1.0
    off = math.log(nu) - (x[OPEN] - log_first)
    return float(_take(x, bank.spread[i], h, work, off, n.SHAFT_FIRST_SD**2, 1.0, setting.hull)[0])


@compiled(uncounted=True)
def _shaft(
    bank: Histories, i: int, setting: BankSetting, said: Float64, log_first: float, now_s: float,
    work: Float64,
) -> float:  # fmt: skip
    """Return the log density of what the shafts do, by the regime."""
    f, regime, x = bank.number[i], bank.whole[i, REGIME], bank.mean[i]
    nu, low = said[HIGH], said[LOW]
    several, scaled = setting.shafts > 1, setting.engine == 0.0
    u_part = math.exp(min(x[LN_U] - log_first, 1.0))
    if low < _REVERSED:
        astern = regime in (BRAKE, AMID) or (regime == GLIDE and _thrust_left(f, now_s) < 0.0)
        return math.log(1.0 if astern else n.SHAFT_LIES)
    # at any revs, mostly at those of before
    if regime == AMID or (regime == LEVEL and not scaled):
        before, stands = f[REVS], nu < n.CREEPS  # then another pushes, unheard
        f[REVS] = nu
        if np.isnan(before):
            return math.log(n.BAD if stands else 1.0)
        if stands and before >= n.CREEPS:
            stops = n.MANOEUVRE * n.OF_MANOEUVRES[0] * n.BIN_S / 3600.0  # as often as she glides
            return math.log(n.BAD * stops)
        if stands:  # of the other they say nothing
            return 0.0
        moves = n.ENGINE_MOVES[bank.whole[i, KIND]]
        shown = math.log((1.0 - moves) * _off(nu, before) + moves)
        if regime == LEVEL:
            shown += _shown_level(bank, i, setting, nu, log_first, now_s, work)
        return shown
    if regime in (DRIVEN, LEVEL, TURN):
        density = _driving(bank, i, nu, log_first, u_part, now_s, several)
        if several and regime != LEVEL:  # they turn alike
            density *= math.exp(-0.5 * ((nu - low) / n.SHAFT_FIRST_SD) ** 2)
    else:
        kind, age_s = bank.whole[i, KIND], now_s - f[SINCE]
        if regime == GLIDE and kind >= HELD and np.isnan(f[REVS]) and not np.isnan(f[FREE]):
            # as before the stop
            f[REVS] = f[FREE] * math.exp(min(f[BEFORE] - log_first, 1.0))
        left = _thrust_left(f, now_s) if regime == GLIDE else 0.0
        if (regime == GLIDE and kind < HELD and age_s < setting.step_s) or left < 0.0:
            # it stopped within the bin, of which the revs are a mean, or runs down from astern
            density = 1.2 if nu < 1.05 else 0.0
        elif left > 0.0 and kind < HELD:
            density = _running_down(f, nu, u_part, left, 0.5 if several else 0.8, scaled)
        else:
            # as long as it may take to set other revs
            handled = age_s < n.LEVEL_RAMP_S[1] * setting.pace
            density = _dragged(f, kind, nu, u_part, handled, scaled)
        if regime == BRAKE:  # astern, where no sign is read; a tug is rarer
            density = 0.3 * density + (0.7 if nu < 1.1 else 0.0)
    return math.log(density + n.SHAFT_LIES)


@compiled(uncounted=True)
def _stop_seen(bank: Histories, i: int, nu: float, now_s: float, step_s: float) -> None:
    """Date a stop within its bin by the revs, whose mean is the lower the sooner it came."""
    f, w = bank.number[i], bank.whole[i]
    first_s = now_s - 0.5 * step_s
    if w[REGIME] != GLIDE or w[KIND] >= HELD or w[COUNT] == 0 or f[SINCE] != first_s:
        return
    if bank.at[i, w[COUNT] - 1] != first_s:  # she glided before
        return
    later = step_s * min(max(1.0 - 2.5 * (1.0 - nu), 0.0), 1.0)
    f[SINCE] += later
    bank.at[i, w[COUNT] - 1] = f[SINCE]


@compiled(uncounted=True)
def _thrust_seen(bank: Histories, i: int, gone_s: float, before_s: float) -> None:
    """End a run-down where a shaft shows that the thrust is gone."""
    f, w = bank.number[i], bank.whole[i]
    if np.isnan(gone_s) or w[REGIME] != GLIDE or w[KIND] >= HELD:
        return
    if f[SINCE] + f[RAMP_S] > before_s and w[COUNT] > 0 and bank.at[i, w[COUNT] - 1] == f[SINCE]:
        f[SINCE] = min(f[SINCE], gone_s - 0.1)
        f[RAMP_S] = gone_s - f[SINCE]
        bank.at[i, w[COUNT] - 1], bank.ramp[i, w[COUNT] - 1] = f[SINCE], f[RAMP_S]


@compiled(inline=True, uncounted=True)
def _forget(x: Float64, p: Float64, which: int, mean: float, var: float) -> None:
    """Give a state its prior again."""
    x[which] = mean
    for k in range(STATES):
        p[which, k] = p[k, which] = 0.0
    p[which, which] = var


@compiled(uncounted=True)
def _by_way(
    bank: Histories, i: int, setting: BankSetting, noise: Float64, advance: float, work: Float64
) -> float:
    """Update a history by the way between fixes; return its log density."""
    x, p, f = bank.mean[i], bank.spread[i], bank.number[i]
    bad, half, h = float(n.BAD_DENSITY), 0.5 * setting.step_s, work[1]
    if bank.whole[i, LIAR] == THE_TRACK:
        wide = math.hypot(2.5 * noise[N_FIX], noise[N_WALK] * math.sqrt(setting.step_s))
        return _untrue(f, STAYS_WAY, advance, wide, bad / setting.step_s)
    u = math.exp(x[LN_U])
    for j in range(STATES):
        h[j] = 0.0
    h[WAY], h[LN_U], h[CURRENT] = 1.0, -half * u, -half
    expected = x[WAY] - half * (u + x[CURRENT])
    variance = noise[N_FIX] ** 2 + (setting.step_s * _at_rest(setting, u)) ** 2
    gained, excess = _take(x, p, h, work, -expected, variance, bad, setting.hull)
    f[EXCESS] += excess
    if gained < math.log(2.0 * n.BAD * bad):  # from another mark: the way begins again at it
        _forget(x, p, WAY, half * (math.exp(x[LN_U]) + x[CURRENT]), noise[N_FIX] ** 2)
    return gained


@compiled(uncounted=True)
def _by_shafts(
    bank: Histories, i: int, setting: BankSetting, said: Float64, log_first: float, work: Float64
) -> float:
    """Return the log density of the revs, and date the stop and the end of thrust by them."""
    f, step_s = bank.number[i], setting.step_s
    now_s = (bank.clock[0] - 0.5) * step_s
    shown, scaled = _shaft(bank, i, setting, said, log_first, now_s, work), setting.engine == 0.0
    # a slow error of revs does not turn their sign
    gained = shown if said[LOW] < _REVERSED or not scaled else n.SHAFT_TEMPER * shown
    young = bank.whole[i, REGIME] == GLIDE and now_s - f[SINCE] < 2.0 * step_s
    if young and scaled and bank.whole[i, KIND] < HELD:
        # no slow error hides that the revs of all have not changed
        unchanged = math.log(_off(said[LOW], 1.0) + n.SHAFT_LIES)
        gained += (1.0 - n.SHAFT_TEMPER) * min(shown - unchanged, 0.0)
    _thrust_seen(bank, i, said[GONE], now_s - 1.5 * step_s)
    _stop_seen(bank, i, said[HIGH], now_s, step_s)
    return float(gained)


@compiled(uncounted=True)
def weigh(
    bank: Histories, i: int, setting: BankSetting, noise: Float64, said: Float64, slowing: float,
    log_first: float, work: Float64,
) -> None:  # fmt: skip
    """
    Update a history by what a bin says.
    """
    x, p, f = bank.mean[i], bank.spread[i], bank.number[i]
    regime, liar = bank.whole[i, REGIME], bank.whole[i, LIAR]
    h = work[1]
    gained = f[EXCESS] = 0.0
    bad, claimed = float(n.BAD_DENSITY), setting.engine > 0.0
    for which in (LOG, GROUND):
        if np.isnan(said[which]):
            continue
        if (which == LOG and liar == THE_LOG) or (which == GROUND and liar == THE_TRACK):
            wide = 1.5 * math.hypot(noise[N_LOG], noise[N_WANDER])
            wide = wide if which == LOG else math.hypot(noise[N_GROUND], noise[N_EDDY])
            gained += _untrue(f, STAYS, said[which], wide, bad)
            continue
        u = math.exp(x[LN_U])
        for j in range(STATES):
            h[j] = 0.0
        h[LN_U] = u
        expected = u + f[MEAN_U]
        # learnt at less speed, it may be less than that of now
        sd, value = max(noise[N_LOG], n.WHITE_FLOOR * u), said[which]
        # an engine may drive her astern, and a ship at rest is never quite so
        if claimed and (regime == AMID or abs(value) < rest_speed(setting.hull)):
            value = abs(value)
        if which == LOG:
            longer, lags = math.exp(min(x[LONGER], _LONGEST)), x[LAG] + f[MEAN_LAG]
            h[WANDER], h[LAG] = 1.0, longer
            h[LONGER] = longer * lags if x[LONGER] < _LONGEST else 0.0
            expected += x[WANDER] + longer * lags
        else:
            h[CURRENT] = h[EDDY] = 1.0
            expected += x[CURRENT] + x[EDDY] - setting.pace * _GROUND_LAG_S * slowing
            sd = noise[N_GROUND]
        if claimed:
            sd = math.hypot(sd, _at_rest(setting, u))
        shown, excess = _take(x, p, h, work, value - expected, sd * sd, bad, setting.hull)
        gained += shown
        f[EXCESS] += excess
    if not np.isnan(said[ADVANCE]):
        gained += _by_way(bank, i, setting, noise, said[ADVANCE], work)
    else:  # the next fix begins the way anew
        way = 0.5 * setting.step_s * (math.exp(x[LN_U]) + x[CURRENT])
        _forget(x, p, WAY, way, noise[N_FIX] ** 2)
    turning = regime in (TURN, GLIDE_TURN) or (
        regime == AMID and (not claimed or bank.whole[i, KIND] == len(n.ENGINE) - 1)
    )
    if not np.isnan(said[RATE]):
        u = math.exp(x[LN_U])
        # errors of fixes turn a course by more, the shorter the way
        sd = noise[N_RATE] * math.exp(min(max(log_first - x[LN_U], 0.0), 1.5))
        wide = n.TURN_RATE * u / setting.hull.length_m + sd
        share = 0.9 if turning else n.STEADY_TURNS
        density = share * _normal(said[RATE], wide) + (1.0 - share) * _normal(said[RATE], sd)
        # or anything up to a radian a second, as where fixes jump
        gained += n.SHAFT_TEMPER * math.log((1.0 - n.BAD) * density + 0.5 * n.BAD)
    if not np.isnan(said[RUDDER]):
        sd = n.RUDDER[1 if turning else 0]
        gained += n.SHAFT_TEMPER * math.log(_normal(said[RUDDER], sd) + n.SHAFT_LIES)
    if not np.isnan(said[HIGH]):
        gained += _by_shafts(bank, i, setting, said, log_first, work)
    # a covariance that rounding broke weighs nothing
    f[WEIGHT] = -np.inf if np.isnan(gained) else f[WEIGHT] + gained
    if regime in (DRIVEN, TURN) or (regime == AMID and bank.whole[i, GLIDED] == 0):
        # at balance neither is seen, only the filter's own errors
        _forget(x, p, LN_A, f[A0], f[A_VAR])
        _forget(x, p, POWER, f[P0], f[P_VAR])
    if regime == DRIVEN or (regime == AMID and not claimed):  # nor what a log lags behind
        _forget(x, p, LONGER, 0.0, n.LOG_LAG_SD**2)
