# SPDX-License-Identifier: Apache-2.0
"""One history over one bin: the motion by its regime, then what the bin says."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.coastdown.regimes.state import BankSetting, Histories
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64

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
def _thrust_left(f: np.record, now_s: float) -> float:
    """Return the thrust of a glide, over the resistance at its stop: the revs fall evenly."""
    left = max(0.0, 1.0 - (now_s - f.since) / f.ramp_s)
    return float(f.thrust * left * left)


@compiled(uncounted=True)
def free(bank: Histories, i: int, which: int, mean: float, var: float) -> None:
    """
    Give a state a prior of its own.
    """
    for k in range(s.STATES):
        bank.spread[i, which, k] = 0.0
        bank.spread[i, k, which] = 0.0
    bank.mean[i, which] = mean
    bank.spread[i, which, which] = var


@compiled(inline=True, uncounted=True)
def is_fade(f: np.record) -> bool:
    """
    Say whether the engine gives evenly less.
    """
    return bool(f.regime == s.LEVEL and f.kind == s.FADING)


@compiled(inline=True, uncounted=True)
def balance(x: Float64, f: np.record, now_s: float) -> tuple[float, float]:
    """
    Return ln of the speed at which thrust and water would balance now.

    And its derivative by what is left open: the part of the ramp to a level.
    """
    regime = f.regime
    if regime == s.TURN:
        return f.before, 0.0
    if regime == s.AMID:  # nobody knows: as if at the speed that she has
        return x[s.LN_U], 0.0
    if is_fade(f):  # the speed falls evenly, at a rate left open
        gone = math.exp(min(x[s.OPEN], 3.0)) * (now_s - f.since) / f.ramp_s
        if gone > _MOST_GONE:
            return f.ramp_from + math.log(1.0 - _MOST_GONE), 0.0
        return f.ramp_from + math.log(1.0 - gone), -gone / (1.0 - gone)
    share = min(1.0, (now_s - f.since) / f.ramp_s) if regime == s.LEVEL else 1.0
    return f.ramp_from + (x[s.OPEN] - f.ramp_from) * share if share < 1.0 else x[s.OPEN], share


@compiled(uncounted=True)
def pushes(bank: Histories, i: int, now_s: float) -> bool:
    """Say whether the screw of a history pushes."""
    f, x = bank.row[i], bank.mean[i]
    if f.regime != s.LEVEL:
        return f.regime in (s.DRIVEN, s.TURN)
    target = balance(x, f, now_s)[0]
    free = f.free if f.kind == s.TORQUE else 0.0
    rho = _advance(math.exp(min(target - x[s.LN_U], 1.0)), free)[0]
    return bool(rho * n.NO_THRUST > 1.0)


@compiled(inline=True, uncounted=True)
def _force(
    x: Float64, f: np.record, now_s: float, law: float, slope: float
) -> tuple[float, float, float, float, float]:
    """Return net force per mass, its derivatives by ln u, ln a and the open one, and a."""
    regime, a = f.regime, math.exp(min(max(law + x[s.LN_A], -20.0), 5.0))
    left, by_u, by_open = 1.0, 0.0, 0.0  # of the resistance that nothing balances
    if regime in (s.DRIVEN, s.LEVEL, s.TURN):
        target, share = balance(x, f, now_s)
        free = f.free if regime == s.LEVEL and f.kind == s.TORQUE else 0.0
        rho, by_target = _advance(math.exp(min(target - x[s.LN_U], 1.0)), free)
        thrust = (_S * rho * rho - rho) / (_S - 1.0)
        steep = by_target * (2.0 * _S * rho - 1.0) / (_S - 1.0)
        left, by_u, by_open = 1.0 - thrust, steep, a * steep * share
    elif regime == s.GLIDE:
        left = 1.0 - _thrust_left(f, now_s)
    if regime in (s.TURN, s.GLIDE_TURN):
        drag = math.exp(min(x[s.OPEN], 3.0))
        left, by_open = left + drag, -a * drag
    more = 0.0
    if regime == s.BRAKE:
        more = by_open = -math.exp(min(x[s.OPEN], 3.0)) * f.first_a
    elif regime == s.AMID:
        left, more, by_open = 0.0, x[s.OPEN], 1.0
    elif regime == s.GLIDE:
        more, by_open = -x[s.OPEN] * f.first_a, -f.first_a
    net = -a * left + x[s.GUST] + more
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
        math.exp(-dt / (noise[s.N_WANDER_S] * pace)),
        math.exp(-dt / (noise[s.N_EDDY_S] * pace)),
        math.exp(-dt / (_LAG_S * pace)),
    )


@compiled(uncounted=True)
def predict(
    bank: Histories, i: int, setting: BankSetting, noise: Float64, decay: Decay, advance: float
) -> None:
    """
    Carry a history to the end of the bin.
    """
    x, p, f = bank.mean[i], bank.spread[i], bank.row[i]
    regime = f.regime
    fades = is_fade(f)
    dt = setting.step_s / _PARTS
    pace = setting.pace
    keep_g, keep_b, keep_e, keep_f = decay
    mean_u = mean_lag = 0.0
    u = math.exp(x[s.LN_U])
    if regime == s.DRIVEN:  # waves stay as they were learnt until that is forgotten
        law = hull_law(setting.hull, x[s.LN_U])[0]
        f.gust_a += (math.exp(law + x[s.LN_A]) - f.gust_a) * setting.forgets
    for part in range(_PARTS):
        now_s = (bank.clock[0] - 1) * setting.step_s + (part + 0.5) * dt
        law, slope = hull_law(setting.hull, x[s.LN_U])
        net, by_u, by_a, by_open, a = _force(x, f, now_s, law, slope)
        change = min(max(dt * net / u, -0.5), 0.5)
        l_l = min(max(1.0 + dt * by_u / u - change, 0.2), 1.5)
        l_a, l_o, l_g = dt * by_a / u, dt * by_open / u, dt / u
        power = x[s.POWER]
        # ln a follows ln u by the exponent on top of the curve; the curve itself by its table
        for k in range(s.STATES):
            old, gust = p[s.LN_U, k], p[s.GUST, k]
            new = l_l * old + l_a * p[s.LN_A, k] + l_o * p[s.OPEN, k] + l_g * gust
            p[s.LN_A, k] = p[s.LN_A, k] + power * (new - old) + change * p[s.POWER, k]
            p[s.WAY, k] += dt * (u * old + p[s.CURRENT, k] + p[s.EDDY, k])
            p[s.LAG, k] = keep_f * p[s.LAG, k] - u * (new - old)
            p[s.LN_U, k], p[s.GUST, k] = new, gust * keep_g
            p[s.WANDER, k] *= keep_b
            p[s.EDDY, k] *= keep_e
        for k in range(s.CHANGING):
            old, gust = p[k, s.LN_U], p[k, s.GUST]
            new = l_l * old + l_a * p[k, s.LN_A] + l_o * p[k, s.OPEN] + l_g * gust
            p[k, s.LN_A] += power * (new - old) + change * p[k, s.POWER]
            p[k, s.WAY] += dt * (u * old + p[k, s.CURRENT] + p[k, s.EDDY])
            p[k, s.LAG] = keep_f * p[k, s.LAG] - u * (new - old)
            p[k, s.LN_U], p[k, s.GUST] = new, gust * keep_g
            p[k, s.WANDER] *= keep_b
            p[k, s.EDDY] *= keep_e
        for k in range(s.CHANGING, s.STATES):
            for j in range(s.CHANGING):
                p[k, j] = p[j, k]
        p[s.LN_U, s.LN_U] += 1e-10
        p[s.POWER, s.POWER] += n.EXPONENT_WALK**2 * abs(change)
        if regime in (s.TURN, s.GLIDE_TURN):
            p[s.OPEN, s.OPEN] += n.TURNS_DRIFT**2 * dt / (60.0 * pace)
        elif fades:
            p[s.OPEN, s.OPEN] += n.FADES_DRIFT**2 * dt / (600.0 * pace)
        elif regime in (s.DRIVEN, s.LEVEL):
            p[s.OPEN, s.OPEN] += n.POWER_DRIFT**2 * dt / (600.0 * pace)
        elif regime == s.AMID:
            p[s.OPEN, s.OPEN] += (n.AMID[1] * f.first_a) ** 2 * dt / (60.0 * pace)
        # half of it is wind, whose gusts fall with her way, and half wave groups, which do not
        full, now = f.gust_a, a
        if regime in (s.GLIDE, s.GLIDE_TURN, s.BRAKE):  # the drag of a screw takes no part in it
            now = min(a, full)
        gusts = noise[s.N_GUST] ** 2 * max(0.5 * full * (now + full), now * now)
        if regime == s.AMID:  # an engine that is not held even
            if setting.engine > 0.0:
                gusts = (noise[s.N_GUST] * setting.engine) ** 2
            gusts += f.first_a**2
        p[s.GUST, s.GUST] += (1.0 - keep_g * keep_g) * gusts
        p[s.WANDER, s.WANDER] += (1.0 - keep_b * keep_b) * noise[s.N_WANDER] ** 2
        p[s.CURRENT, s.CURRENT] += n.CURRENT[1] ** 2 * dt / (n.CURRENT_S * pace)
        p[s.EDDY, s.EDDY] += (1.0 - keep_e * keep_e) * noise[s.N_EDDY] ** 2
        p[s.WAY, s.WAY] += noise[s.N_WALK] ** 2 * dt
        x[s.WAY] += dt * (u + x[s.CURRENT] + x[s.EDDY])
        lagged = keep_f * x[s.LAG] - u * change
        mean_lag += 0.5 * (x[s.LAG] + lagged) / _PARTS
        x[s.LAG] = lagged
        x[s.LN_U] = _bounded(setting.hull, x[s.LN_U] + change)
        before, u = u, math.exp(x[s.LN_U])
        mean_u += 0.5 * (before + u) / _PARTS
        x[s.LN_A] += power * change
        x[s.GUST] *= keep_g
        x[s.WANDER] *= keep_b
        x[s.EDDY] *= keep_e
    x[s.WAY] -= advance
    f.mean_u, f.mean_lag = mean_u - u, mean_lag - x[s.LAG]


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
    for j in range(s.STATES):
        row = 0.0
        for k in range(s.STATES):
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
        for j in range(s.STATES):
            x[j] += gain * work[0, j] * off
            more = (around - gain) * work[0, j]
            for k in range(j + 1):
                p[j, k] += more * work[0, k]
                p[k, j] = p[j, k]
        x[s.LN_U] = _bounded(hull, x[s.LN_U])
    return math.log(density), 0.5 + math.log(density * ROOT_TWO_PI * math.sqrt(total))


@compiled(inline=True, uncounted=True)
def _normal(off: float, sd: float) -> float:
    return math.exp(-0.5 * (off / sd) ** 2) / (ROOT_TWO_PI * sd)


@compiled(inline=True, uncounted=True)
def _untrue(
    f: np.record, stayed: float, value: float, wide: float, bad: float
) -> tuple[float, float]:
    """
    Return the log density of a reading that says nothing true: it stays, or is anything.

    And where it stays.
    """
    off = value - stayed
    stays = 0.0 if np.isnan(off) else n.STUCK * _normal(off, wide)
    density = stays + (1.0 - n.STUCK) * bad
    f.excess += 0.5 + math.log(density * ROOT_TWO_PI * wide)
    share = stays / density
    return math.log(density), value if share < 0.1 else stayed + 0.1 * share * off


@compiled(inline=True, uncounted=True)
def _off(nu: float, expected: float) -> float:
    """Return the density of revs where they are known but for their own error."""
    return _normal(nu - expected, math.hypot(n.SHAFT_SD[0], n.SHAFT_SD[1] * expected))


@compiled(inline=True, uncounted=True)
def _as_usual(f: np.record, nu: float, expected: float, rises: float, falls: float) -> float:
    """
    Return the density of revs that are a ratio times those expected, and learn the ratio.

    The error of an expectation stays as it is: it is paid for once, by the first reading, and
    then held. `rises` and `falls` are parts of a change of the ratio that are learnt in a bin.
    """
    ratio, now = f.revs, nu / max(expected, 0.05)
    density = _off(nu, ratio * expected)
    f.revs = ratio + (rises if now > ratio else falls) * min(max(now - ratio, -0.2), 0.2)
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
    f, x = bank.row[i], bank.mean[i]
    regime = f.regime
    target, share = balance(x, f, now_s)
    fades = is_fade(f)
    settled = regime == s.TURN or fades or share == 1.0
    at = math.exp(min(target - log_first, 1.0))
    if regime == s.TURN or (regime == s.LEVEL and f.kind == s.TORQUE):
        free = float(n.WINDMILL[0]) if regime == s.TURN else f.free
        at = _advance(math.exp(min(target - x[s.LN_U], 1.0)), free)[0] * u_part
    if np.isnan(f.revs):
        density = _normal(nu - at, n.SHAFT_FIRST_SD)
        f.revs = nu / at
    else:
        gain = 0.1 if settled else 1.0
        density = _as_usual(f, nu, at, gain, gain)
    # with fewer turns a metre it drives nothing
    f.revs = min(max(f.revs, 1.0 / _S), max(1.0 / at, 1.3) if several else 1.3)
    if not settled:  # on its way to the level, or one of several that turns as before
        least = 0.0 if several else min(0.8 * math.exp(x[s.OPEN] - log_first), 0.9)
        density = 0.5 * density + (0.5 / (1.1 - least) if least < nu < 1.1 else 0.0)
    return density


@compiled(uncounted=True)
def _running_down(
    f: np.record, nu: float, u_part: float, left: float, part: float, scaled: bool
) -> float:
    """
    Return the density of revs while the thrust goes; `part` is that of shafts that fall together.

    The error of what is expected is paid for once, as that of a level.
    """
    falls = 0.5 * u_part * (1.0 + math.sqrt(1.0 + 4.0 * _S * (_S - 1.0) * left)) / _S
    if np.isnan(f.free):
        density = 1.0 if nu > n.CREEPS else 0.0  # one that stands has run down
        if scaled:
            density = _normal(nu - falls, 0.5 * n.SHAFT_FIRST_SD)
        f.free = nu / falls
    else:
        density = _normal(nu - f.free * falls, 0.25 * n.SHAFT_FIRST_SD)
        f.free += 0.5 * (nu / falls - f.free)
    any_ = 1.0 if n.WINDMILL[2] * u_part < nu < 1.05 else 0.0
    return part * density + (1.0 - part) * any_


@compiled(inline=True, uncounted=True)
def _holds(f: np.record, nu: float, density: float, scaled: bool) -> None:
    """Keep the revs; of a claimed window only as far as they are no error."""
    known = not scaled and not np.isnan(f.revs)
    share = density / (density + n.SHAFT_LIES) if known else 1.0
    f.revs = f.revs + share * (nu - f.revs) if known else nu


@compiled(inline=True, uncounted=True)
def _standing(nu: float, revs: float, scaled: bool) -> float:
    """Return the density of the revs of a screw that stands, or comes to stand."""
    stands = _normal(nu, 2.0 * n.SHAFT_SD[0])
    last = 1.0 if np.isnan(revs) else max(revs, 0.0)
    # or anything below its last: it runs down
    below = 1.0 / (last + n.SHAFT_SD[0]) if nu < last + n.SHAFT_SD[0] else 0.0
    if scaled and not np.isnan(revs):  # mostly a little
        below = 0.5 * below + 0.5 * _off(nu, 0.9 * last)
    if not scaled:  # and does not stay
        below *= 2.0 * min(max(1.0 - nu / (last + n.SHAFT_SD[0]), 0.0), 1.0)
    return 0.5 * stands + 0.5 * below


@compiled(uncounted=True)
def _dragged(
    f: np.record, kind: int, nu: float, u_part: float, handled: bool, scaled: bool
) -> float:
    """
    Return the density of the revs of a screw that does not drive.

    Where they are not `scaled` by steady sailing, they are so by the most turns a metre there
    were, and may be as many.
    """
    revs = f.revs
    if kind == s.WINDMILLS:
        if not np.isnan(revs):  # it may turn slower later, by its friction, but not faster
            turns = _as_usual(f, nu, u_part, 0.05, 0.45 if scaled else 0.05)
            stops = n.STOPS_TURNING * _normal(nu, 2.0 * n.SHAFT_SD[0])  # or be held by it
            slower = min(nu / u_part - f.revs, 0.0)
            f.revs += stops / (stops + turns + n.SHAFT_LIES) * slower
            return turns + stops
        if not scaled:
            f.revs = nu / u_part
            return 1.0 / u_part if nu < u_part + n.SHAFT_SD[0] else 0.0
        f.revs = min(nu / u_part, n.WINDMILL[2])
        wide = math.hypot(n.SHAFT_SD[0], n.WINDMILL[1] * u_part)
        at = n.WINDMILL[0] * u_part
        return _normal(nu - at, wide) if nu < n.WINDMILL[2] * u_part + n.SHAFT_SD[0] else 0.0
    if kind == s.STANDS or np.isnan(revs):
        last = 1.0 if np.isnan(revs) else max(revs, 0.0)
        density = _standing(nu, revs, scaled)
        if not scaled and last < n.CREEPS:  # or creeps on, as it likes
            density = 0.9 * _off(nu, last) + (0.1 / n.CREEPS if nu < n.CREEPS else 0.0)
        _holds(f, nu, density, scaled)
        return density
    moves = 0.1 if kind == s.HELD and scaled and handled else 0.01
    if not scaled and (kind != s.HELD or min(nu, revs) < n.CREEPS):
        moves = 0.0  # an engine starts and stops such a screw, and what is stuck stays
    stays = (1.0 - moves) * _off(nu, revs)
    density = stays + moves
    if kind == s.HELD and scaled:  # revs that creep are not held
        f.revs += (1.0 if handled else (moves + 0.1 * stays) / density) * (nu - revs)
    elif kind == s.HELD:  # a sensor that is stuck stays where it was
        _holds(f, nu, density, scaled)
    return density


@compiled(uncounted=True)
def _shown_level(
    bank: Histories, i: int, setting: BankSetting, nu: float, log_first: float, now_s: float,
    work: Float64,
) -> float:  # fmt: skip
    """Take the revs for those of a level that is reached in this bin; return the log density."""
    f, x = bank.row[i], bank.mean[i]
    reached_s = f.since + f.ramp_s
    if not now_s - setting.step_s < reached_s <= now_s or nu < n.CREEPS:
        return 0.0
    h = work[1]
    for j in range(s.STATES):
        h[j] = 0.0
    h[s.OPEN] = 1.0
    off = math.log(nu) - (x[s.OPEN] - log_first)
    return float(_take(x, bank.spread[i], h, work, off, n.SHAFT_FIRST_SD**2, 1.0, setting.hull)[0])


@compiled(uncounted=True)
def _shaft(
    bank: Histories, i: int, setting: BankSetting, said: Float64, log_first: float, now_s: float,
    work: Float64,
) -> float:  # fmt: skip
    """Return the log density of what the shafts do, by the regime."""
    f, regime, x = bank.row[i], bank.row[i].regime, bank.mean[i]
    nu, low = said[s.HIGH], said[s.LOW]
    several, scaled = setting.shafts > 1, setting.engine == 0.0
    u_part = math.exp(min(x[s.LN_U] - log_first, 1.0))
    if low < _REVERSED:
        astern = regime in (s.BRAKE, s.AMID) or (
            regime == s.GLIDE and _thrust_left(f, now_s) < 0.0
        )
        return math.log(1.0 if astern else n.SHAFT_LIES)
    if f.liar == s.THE_SHAFTS:  # no better known where they stay than what a level has
        stays, f.stays = f.stays, nu
        if np.isnan(stays):
            return math.log(1.0 - n.STUCK)
        still = f.stuck * (_standing(nu, stays, True) if stays < n.CREEPS else _off(nu, stays))
        density = still + 1.0 - f.stuck
        f.stuck = min(max(still / density, n.BAD), 1.0 - n.BAD)
        return math.log(density)
    # at any revs, mostly at those of before
    if regime == s.AMID or (regime == s.LEVEL and not scaled):
        before, stands = f.revs, nu < n.CREEPS  # then another pushes, unheard
        f.revs = nu
        if np.isnan(before):
            return math.log(n.BAD if stands else 1.0)
        if stands and before >= n.CREEPS:
            hours = setting.step_s / setting.pace / 3600.0
            stops = n.MANOEUVRE * n.OF_MANOEUVRES[0] * hours  # as often as she glides
            return math.log(n.BAD * stops)
        if stands:  # of the other they say nothing
            return 0.0
        moves = n.ENGINE_MOVES[bank.row[i].kind]
        shown = math.log((1.0 - moves) * _off(nu, before) + moves)
        if regime == s.LEVEL:
            shown += _shown_level(bank, i, setting, nu, log_first, now_s, work)
        return shown
    if regime in (s.DRIVEN, s.LEVEL, s.TURN):
        density = _driving(bank, i, nu, log_first, u_part, now_s, several)
        if several and regime != s.LEVEL:  # they turn alike
            density *= math.exp(-0.5 * ((nu - low) / n.SHAFT_FIRST_SD) ** 2)
    else:
        kind, age_s = bank.row[i].kind, now_s - f.since
        if regime == s.GLIDE and kind >= s.HELD and np.isnan(f.revs) and not np.isnan(f.free):
            # as before the stop
            f.revs = f.free * math.exp(min(f.before - log_first, 1.0))
        left = _thrust_left(f, now_s) if regime == s.GLIDE else 0.0
        if (regime == s.GLIDE and kind < s.HELD and age_s < setting.step_s) or left < 0.0:
            # it stopped within the bin, of which the revs are a mean, or runs down from astern
            density = 1.2 if nu < 1.05 else 0.0
        elif left > 0.0 and kind < s.HELD:
            density = _running_down(f, nu, u_part, left, 0.5 if several else 0.8, scaled)
        else:
            # as long as it may take to set other revs
            handled = age_s < n.LEVEL_RAMP_S[1] * setting.pace
            density = _dragged(f, kind, nu, u_part, handled, scaled)
        if regime == s.BRAKE:  # astern, where no sign is read; a tug is rarer
            density = 0.3 * density + (0.7 if nu < 1.1 else 0.0)
    return math.log(density + n.SHAFT_LIES)


@compiled(uncounted=True)
def _stop_seen(bank: Histories, i: int, nu: float, now_s: float, step_s: float) -> None:
    """Date a stop within its bin by the revs, whose mean is the lower the sooner it came."""
    f = bank.row[i]
    first_s = now_s - 0.5 * step_s
    if f.regime != s.GLIDE or f.kind >= s.HELD or f.count == 0 or f.since != first_s:
        return
    last = bank.switched[i, f.count - 1]
    if last.at == first_s:  # else she glided before
        f.since += step_s * min(max(1.0 - 2.5 * (1.0 - nu), 0.0), 1.0)
        last.at = f.since


@compiled(uncounted=True)
def _thrust_seen(bank: Histories, i: int, gone_s: float, before_s: float) -> None:
    """End a run-down where a shaft shows that the thrust is gone."""
    f = bank.row[i]
    if np.isnan(gone_s) or f.regime != s.GLIDE or f.kind >= s.HELD:
        return
    last = bank.switched[i, f.count - 1]
    if f.since + f.ramp_s > before_s and f.count > 0 and last.at == f.since:
        f.since = min(f.since, gone_s - 0.1)
        f.ramp_s = gone_s - f.since
        last.at, last.ramp = f.since, f.ramp_s


@compiled(uncounted=True)
def _by_way(
    bank: Histories, i: int, setting: BankSetting, noise: Float64, advance: float, work: Float64
) -> float:
    """Update a history by the way between fixes; return its log density."""
    x, p, f = bank.mean[i], bank.spread[i], bank.row[i]
    bad, half, h = float(n.BAD_DENSITY), 0.5 * setting.step_s, work[1]
    if bank.row[i].liar == s.THE_TRACK:
        wide = math.hypot(2.5 * noise[s.N_FIX], noise[s.N_WALK] * math.sqrt(setting.step_s))
        bad /= setting.step_s
        untrue, f.stays_way = _untrue(f, f.stays_way, advance, wide, bad)
        return untrue
    u = math.exp(x[s.LN_U])
    for j in range(s.STATES):
        h[j] = 0.0
    h[s.WAY], h[s.LN_U], h[s.CURRENT] = 1.0, -half * u, -half
    expected = x[s.WAY] - half * (u + x[s.CURRENT])
    variance = noise[s.N_FIX] ** 2 + (setting.step_s * _at_rest(setting, u)) ** 2
    gained, excess = _take(x, p, h, work, -expected, variance, bad, setting.hull)
    f.excess += excess
    if gained < math.log(2.0 * n.BAD * bad):  # from another mark: the way begins again at it
        free(bank, i, s.WAY, half * (math.exp(x[s.LN_U]) + x[s.CURRENT]), noise[s.N_FIX] ** 2)
    return gained


@compiled(uncounted=True)
def _by_shafts(
    bank: Histories, i: int, setting: BankSetting, said: Float64, log_first: float, work: Float64
) -> float:
    """Return the log density of the revs, and date the stop and the end of thrust by them."""
    f, step_s = bank.row[i], setting.step_s
    now_s = (bank.clock[0] - 0.5) * step_s
    shown, scaled = _shaft(bank, i, setting, said, log_first, now_s, work), setting.engine == 0.0
    # a slow error of revs does not turn their sign
    gained = shown if said[s.LOW] < _REVERSED or not scaled else n.SHAFT_TEMPER * shown
    if f.liar == s.THE_SHAFTS:
        return float(gained)
    young = bank.row[i].regime == s.GLIDE and now_s - f.since < 2.0 * step_s
    if young and scaled and bank.row[i].kind < s.HELD:
        # no slow error hides that the revs of all have not changed
        unchanged = math.log(_off(said[s.LOW], 1.0) + n.SHAFT_LIES)
        gained += (1.0 - n.SHAFT_TEMPER) * min(shown - unchanged, 0.0)
    _thrust_seen(bank, i, said[s.GONE], now_s - 1.5 * step_s)
    _stop_seen(bank, i, said[s.HIGH], now_s, step_s)
    return float(gained)


@compiled(uncounted=True)
def weigh(
    bank: Histories, i: int, setting: BankSetting, noise: Float64, said: Float64,
    log_first: float, work: Float64,
) -> None:  # fmt: skip
    """
    Update a history by what a bin says.
    """
    x, p, f = bank.mean[i], bank.spread[i], bank.row[i]
    regime, liar = bank.row[i].regime, bank.row[i].liar
    h = work[1]
    gained = f.excess = 0.0
    bad, claimed = float(n.BAD_DENSITY), setting.engine > 0.0
    for which in (s.LOG, s.GROUND):
        if np.isnan(said[which]):
            continue
        if (which == s.LOG and liar == s.THE_LOG) or (which == s.GROUND and liar == s.THE_TRACK):
            wide = 1.5 * math.hypot(noise[s.N_LOG], noise[s.N_WANDER])
            wide = wide if which == s.LOG else math.hypot(noise[s.N_GROUND], noise[s.N_EDDY])
            untrue, f.stays = _untrue(f, f.stays, said[which], wide, bad)
            gained += untrue
            continue
        u = math.exp(x[s.LN_U])
        for j in range(s.STATES):
            h[j] = 0.0
        h[s.LN_U] = u
        expected = u + f.mean_u
        # learnt at less speed, it may be less than that of now
        sd, value = max(noise[s.N_LOG], n.WHITE_FLOOR * u), said[which]
        # an engine may drive her astern, and a ship at rest is never quite so
        if claimed and (regime == s.AMID or abs(value) < rest_speed(setting.hull)):
            value = abs(value)
        if which == s.LOG:
            longer, lags = math.exp(min(x[s.LONGER], _LONGEST)), x[s.LAG] + f.mean_lag
            h[s.WANDER], h[s.LAG] = 1.0, longer
            h[s.LONGER] = longer * lags if x[s.LONGER] < _LONGEST else 0.0
            expected += x[s.WANDER] + longer * lags
        else:  # of half a bin before, and some more by its filter
            lag_s = setting.pace * _GROUND_LAG_S
            law, slope = hull_law(setting.hull, x[s.LN_U])
            net, by_u, by_a, by_open, _ = _force(x, f, bank.clock[0] * setting.step_s, law, slope)
            since_s = 0.5 * setting.step_s + lag_s
            h[s.LN_U], h[s.LN_A] = u - since_s * by_u, -since_s * by_a
            h[s.OPEN], h[s.GUST] = -since_s * by_open, -since_s
            h[s.CURRENT] = h[s.EDDY] = 1.0
            expected += x[s.CURRENT] + x[s.EDDY] - lag_s * net
            sd = math.hypot(noise[s.N_GROUND], n.LOG_LAG_SD * lag_s * net)
        if claimed:
            sd = math.hypot(sd, _at_rest(setting, u))
        shown, excess = _take(x, p, h, work, value - expected, sd * sd, bad, setting.hull)
        gained += shown
        f.excess += excess
    if not np.isnan(said[s.ADVANCE]):
        gained += _by_way(bank, i, setting, noise, said[s.ADVANCE], work)
    else:  # the next fix begins the way anew
        way = 0.5 * setting.step_s * (math.exp(x[s.LN_U]) + x[s.CURRENT])
        free(bank, i, s.WAY, way, noise[s.N_FIX] ** 2)
    turning = regime in (s.TURN, s.GLIDE_TURN) or (
        regime == s.AMID and (not claimed or bank.row[i].kind == len(n.ENGINE) - 1)
    )
    if not np.isnan(said[s.RATE]):
        u = math.exp(x[s.LN_U])
        sd = noise[s.N_RATE]
        if not np.isnan(said[s.ADVANCE]):  # the shorter a way, the more errors of fixes turn it
            sd *= math.exp(min(max(log_first - x[s.LN_U], 0.0), 1.5))
        wide = n.TURN_RATE * u / setting.hull.length_m + sd
        share = 0.9 if turning else n.STEADY_TURNS
        density = share * _normal(said[s.RATE], wide) + (1.0 - share) * _normal(said[s.RATE], sd)
        # or anything up to a radian a second, as where fixes jump
        gained += n.SHAFT_TEMPER * math.log((1.0 - n.BAD) * density + 0.5 * n.BAD)
    if not np.isnan(said[s.RUDDER]):
        sd = n.RUDDER[1 if turning else 0]
        gained += n.SHAFT_TEMPER * math.log(_normal(said[s.RUDDER], sd) + n.SHAFT_LIES)
    if not np.isnan(said[s.HIGH]):
        gained += _by_shafts(bank, i, setting, said, log_first, work)
    # a covariance that rounding broke weighs nothing
    f.weight = -np.inf if np.isnan(gained) else f.weight + gained
    if regime in (s.DRIVEN, s.TURN) or (regime == s.AMID and bank.row[i].glided == 0):
        # at balance neither is seen, only the filter's own errors
        free(bank, i, s.LN_A, f.a0, f.a_var)
        free(bank, i, s.POWER, f.p0, f.p_var)
    if regime == s.DRIVEN or (regime == s.AMID and not claimed):  # nor what a log lags behind
        free(bank, i, s.LONGER, 0.0, n.LOG_LAG_SD**2)
