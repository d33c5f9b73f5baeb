# SPDX-License-Identifier: Apache-2.0
"""Histories that are born, merged and dropped."""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.coastdown.regimes.motion import ROOT_TWO_PI, balance, hull_law
from shipdrag_ros.coastdown.regimes.state import (
    A0,
    A_VAR,
    AMID,
    BEFORE,
    BEHIND,
    BRAKE,
    COUNT,
    DRIVEN,
    FADING,
    FIRST_A,
    FREE,
    GLIDE,
    GLIDE_KIND,
    GLIDE_TURN,
    GLIDED,
    GOVERNED,
    GUST,
    GUST_A,
    HELD,
    KEPT,
    KIND,
    LEVEL,
    LIAR,
    LN_A,
    LN_U,
    LONGER,
    NOBODY,
    OPEN,
    P0,
    P_VAR,
    POWER,
    RAMP_FROM,
    RAMP_S,
    REGIME,
    REVS,
    ROOM,
    SINCE,
    STANDS,
    STATES,
    STAYS,
    STAYS_WAY,
    STUCK,
    SWITCHES,
    THE_LOG,
    THE_TRACK,
    THRUST,
    TURN,
    WEIGHT,
    WINDMILLS,
    BankSetting,
    Histories,
)  # fmt: skip
from shipdrag_ros.compiled import compiled

_PARENTS = (-1.0, -3.0, -7.0)  # nats below the best: histories that have children, in turn
LOST = 16.0
"""Nats below the best of a history that is dropped."""
_ALIKE_S, _OLD_S = 8.0, 240.0  # switches so near each other, so long ago, are one
_THIN_EVERY = 6  # bins
_HALVINGS = 24  # in search of the weight of the last that is kept
_NO_RAMP_S = 1e-3  # nothing pushed before
_LOG_S = math.log(float(n.NO_THRUST))


@compiled(uncounted=True)
def _copy(bank: Histories, i: int, j: int) -> None:
    for k in range(STATES):
        bank.mean[j, k] = bank.mean[i, k]
        for m in range(STATES):
            bank.spread[j, k, m] = bank.spread[i, k, m]
    for k in range(bank.number.shape[1]):
        bank.number[j, k] = bank.number[i, k]
    for k in range(bank.whole.shape[1]):
        bank.whole[j, k] = bank.whole[i, k]
    for k in range(SWITCHES):
        bank.at[j, k] = bank.at[i, k]
        bank.what[j, k] = bank.what[i, k]
        bank.ramp[j, k] = bank.ramp[i, k]


@compiled(uncounted=True)
def free(bank: Histories, j: int, row: int, mean: float, var: float) -> None:
    """
    Give a state a prior of its own.
    """
    for k in range(STATES):
        bank.spread[j, row, k] = 0.0
        bank.spread[j, k, row] = 0.0
    bank.mean[j, row] = mean
    bank.spread[j, row, row] = var


@compiled(uncounted=True)
def switch(bank: Histories, i: int, now_s: float, regime: int, ramp_s: float) -> None:
    """
    Write down a switch.
    """
    w = bank.whole[i]
    if w[COUNT] == SWITCHES:  # the oldest is forgotten
        for k in range(SWITCHES - 1):
            bank.at[i, k] = bank.at[i, k + 1]
            bank.what[i, k] = bank.what[i, k + 1]
            bank.ramp[i, k] = bank.ramp[i, k + 1]
        w[COUNT] -= 1
    bank.at[i, w[COUNT]], bank.what[i, w[COUNT]] = now_s, regime
    bank.ramp[i, w[COUNT]] = ramp_s
    w[COUNT] += 1


@compiled(uncounted=True)
def _born(
    bank: Histories,
    i: int,
    now_s: float,
    share: float,
    regime: int,
    ramp_s: float,
) -> int:
    """Copy a history that switches now; return its slot, or -1 where there is no room."""
    j = bank.used[0]
    # one that is not likelier would be dropped at once
    if j >= ROOM or not share > 0.0 or bank.number[i, BEHIND] + math.log(share) < -LOST:
        return -1
    _copy(bank, i, j)
    bank.used[0] = j + 1
    f, w = bank.number[j], bank.whole[j]
    if w[REGIME] == AMID:  # what an engine gave is over
        free(bank, j, GUST, 0.0, 0.0)
    f[WEIGHT] += math.log(share)
    f[SINCE], f[RAMP_S] = now_s, ramp_s
    w[REGIME] = regime
    switch(bank, j, now_s, regime, ramp_s)
    return int(j)


@compiled(inline=True, uncounted=True)
def _wind(setting: BankSetting) -> float:
    return float(n.ANY_WIND_SD if setting.engine > 0.0 else n.WIND_SD)


@compiled(uncounted=True)
def _glide(bank: Histories, j: int, setting: BankSetting) -> None:
    """Begin a glide: wind is what is left open."""
    law = hull_law(setting.hull, bank.mean[j, LN_U])[0] + bank.mean[j, LN_A]
    bank.number[j, FIRST_A], bank.number[j, THRUST] = math.exp(law), 1.0
    bank.whole[j, GLIDED] = 1
    free(bank, j, OPEN, 0.0, _wind(setting) ** 2)
    if setting.engine > 0.0:  # what an engine gave is over
        free(bank, j, GUST, 0.0, 0.0)


@compiled(uncounted=True)
def glides(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """
    Let the thrust run down.
    """
    if bank.whole[i, REGIME] not in (DRIVEN, LEVEL, AMID):
        _is_let_go(bank, i, setting, now_s, chance)
        return
    learnt, claimed = bank.whole[i, REGIME] == LEVEL, setting.engine > 0.0
    last = bank.whole[i, COUNT] - 1
    idles = learnt and bank.what[i, last] == GLIDE  # she glides already, as nothing pushes
    already, any_ = idles or now_s < 0.0, bank.whole[i, REGIME] == AMID
    downs = 1 if already else len(n.RUN_DOWN_S)
    before = balance(bank.mean[i], bank.number[i], bank.whole[i], now_s)[0]
    # later she is known
    odds = len(n.ODD) if claimed and any_ and bank.whole[i, GLIDED] == 0 else 1
    for each in range(downs * odds):
        k, odd = each % downs, each // downs
        ramp_s = _NO_RAMP_S if already else n.RUN_DOWN_S[k] * setting.pace
        for kind in range(len(n.DRAGGED) if setting.shafts > 0 else STUCK):
            part = chance * (1.0 if already else setting.hull.run_down[k]) * n.DRAGGED_SHARE[kind]
            share = part * n.ODD_SHARE[odd] if odds > 1 else part
            j = _born(bank, i, now_s, share, GLIDE, ramp_s)
            if j < 0:
                continue
            if idles:  # it is the same glide
                bank.whole[j, COUNT] -= 1
            x, p = bank.mean[j], bank.spread[j]
            bank.number[j, BEFORE] = before
            x[LN_A] += n.ODD[odd]
            _glide(bank, j, setting)
            bank.whole[j, KIND] = bank.whole[j, GLIDE_KIND] = kind
            # the revs of an engine that is cut off may change as they like
            held = kind == STUCK or (kind == HELD and not claimed)
            revs = bank.number[i, REVS] if held else np.nan
            # of even power they are over those expected
            bank.number[j, FREE] = np.nan if any_ or claimed else revs
            bank.number[j, REVS] = revs if any_ or claimed else np.nan
            x[LN_A] += n.DRAGGED[kind]
            tied, var = n.DRAGGED_EXPONENT[kind], n.DRAGGED_SD[kind] ** 2
            x[POWER] += tied * n.DRAGGED[kind]
            p[LN_A, LN_A] += var + (n.KEPT_SD**2 if learnt else 0.0)
            p[LN_A, POWER] += tied * var
            p[POWER, LN_A] = p[LN_A, POWER]
            p[POWER, POWER] += tied * tied * var + n.DRAGGED_EXPONENT_SD**2


@compiled(uncounted=True)
def _is_let_go(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """End what slowed her beside the water: an engine astern runs down as one ahead does."""
    # what holds a body in a window that a person claims lets go at once
    x, braked = bank.mean[i], bank.whole[i, REGIME] == BRAKE and setting.engine == 0.0
    thrust = 0.0
    if braked:
        law = hull_law(setting.hull, x[LN_U])[0] + x[LN_A]
        thrust = -bank.number[i, FIRST_A] * math.exp(min(x[OPEN] - law, 5.0))
    for k in range(len(n.RUN_DOWN_S) if braked else 1):
        ramp_s = n.RUN_DOWN_S[k] * setting.pace if braked else _NO_RAMP_S
        share = chance * setting.hull.run_down[k] if braked else chance
        j = _born(bank, i, now_s, share, GLIDE, ramp_s)
        if j >= 0:
            bank.number[j, THRUST] = thrust
            free(bank, j, OPEN, 0.0, _wind(setting) ** 2)


@compiled(inline=True, uncounted=True)
def _engages(bank: Histories, j: int) -> None:
    """End what the screw dragged."""
    kind = bank.whole[j, GLIDE_KIND]
    bank.mean[j, LN_A] -= n.DRAGGED[kind]
    bank.mean[j, POWER] -= n.DRAGGED_EXPONENT[kind] * n.DRAGGED[kind]


@compiled(uncounted=True)
def _any_power(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """Let an engine act in any way."""
    regime = bank.whole[i, REGIME]
    for kind in range(len(n.ENGINE)):
        if regime != AMID or bank.whole[i, KIND] != kind:
            j = _born(bank, i, now_s, chance / len(n.ENGINE), AMID, 1.0)
            if j >= 0:
                if regime in (GLIDE, BRAKE, GLIDE_TURN):
                    _engages(bank, j)
                amid(bank, j, setting, kind)


@compiled(inline=True, uncounted=True)
def _is_fade(bank: Histories, i: int) -> bool:
    return bool(bank.whole[i, REGIME] == LEVEL and bank.whole[i, KIND] == FADING)


@compiled(uncounted=True)
def _fades(
    bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float, base: float
) -> None:
    """Let the engine give evenly less: the rate is what is left open."""
    for k in range(len(n.FADES)):
        j = _born(bank, i, now_s, chance / len(n.FADES), LEVEL, 600.0 * setting.pace)
        if j >= 0:
            bank.whole[j, KIND] = FADING
            bank.number[j, RAMP_FROM], bank.number[j, REVS] = base, np.nan
            free(bank, j, OPEN, math.log(n.FADES[k]), n.FADES_SD**2)


@compiled(uncounted=True)
def _fade_ends(bank: Histories, i: int, now_s: float, chance: float) -> None:
    """Let an engine that gave less and less stay where it is."""
    target, by_open = balance(bank.mean[i], bank.number[i], bank.whole[i], now_s)
    j = _born(bank, i, now_s, chance, LEVEL, 1.0)
    if j >= 0:
        bank.whole[j, KIND] = GOVERNED
        if bank.what[j, bank.whole[j, COUNT] - 2] == GLIDE:  # nothing pushed: it is the same glide
            bank.whole[j, COUNT] -= 1
        bank.number[j, RAMP_FROM] = bank.mean[j, OPEN] = target
        for k in range(STATES):
            bank.spread[j, OPEN, k] *= by_open
        for k in range(STATES):
            bank.spread[j, k, OPEN] *= by_open


@compiled(uncounted=True)
def levels(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """
    Let the engine go to another level, or engage.
    """
    f, regime = bank.number[i], bank.whole[i, REGIME]
    engaged, claimed = regime in (DRIVEN, LEVEL, AMID), setting.engine > 0.0
    if claimed:
        # what the level was before, and is then, shafts alone show
        even = engaged and (regime != AMID or bank.whole[i, KIND] == 0)
        level = 0.5 * chance if even and setting.shafts > 0 else 0.0
        _any_power(bank, i, setting, now_s, chance - level)
        engaged, chance = True, level
    else:  # or it varies, as often as a record begins so
        _any_power(bank, i, setting, now_s, chance * n.AMID[0])
        chance *= 1.0 - n.AMID[0]
    base = f[BEFORE]
    if engaged:
        base = balance(bank.mean[i], f, bank.whole[i], now_s)[0]
        if not claimed and regime != AMID and not _is_fade(bank, i):
            if bank.clock[0] % _THIN_EVERY == 0:  # its begin is no sharper
                _fades(bank, i, setting, now_s, _THIN_EVERY * chance * n.FADES_SHARE, base)
            chance *= 1.0 - n.FADES_SHARE
    ramps = len(n.LEVEL_RAMP_S) if engaged else 1
    kinds = 1 if claimed else 2  # torque that is held is any power there
    for k in range(len(n.LEVELS)):
        for m in range(kinds * ramps):
            share = chance * n.LEVELS_SHARE[k] / (kinds * ramps)
            ramp_s = (n.LEVEL_RAMP_S[m // kinds] if engaged else n.ENGAGE_S) * setting.pace
            j = _born(bank, i, now_s, share, LEVEL, ramp_s)
            if j < 0:
                continue
            bank.whole[j, KIND] = m % kinds
            bank.number[j, FREE] = n.WINDMILL[0]
            if regime == GLIDE and bank.whole[i, KIND] == WINDMILLS:
                revs = f[REVS]
                bank.number[j, FREE] = n.WINDMILL[0] if np.isnan(revs) else revs
            bank.number[j, REVS] = f[REVS] if claimed else np.nan
            bank.number[j, RAMP_FROM] = base if engaged else bank.mean[i, LN_U] - _LOG_S
            free(bank, j, OPEN, base + math.log(n.LEVELS[k]), n.LEVELS_SD[k] ** 2)
            if not engaged:
                _engages(bank, j)


@compiled(uncounted=True)
def amid(bank: Histories, j: int, setting: BankSetting, kind: int) -> None:
    """
    Put a history amid a manoeuvre under power: an acceleration that drifts is what is left open.
    """
    x, f = bank.mean[j], bank.number[j]
    engine = setting.engine
    if engine > 0.0:
        free(bank, j, LONGER, 0.0, n.LOG_LAG_SD**2)
    else:  # at full power it gives what the water takes
        law = hull_law(setting.hull, max(x[LN_U], setting.hull.sails))[0] + x[LN_A]
        engine = math.exp(law)
    f[FIRST_A] = n.ENGINE_GUST[kind] * engine
    free(bank, j, GUST, 0.0, f[FIRST_A] ** 2)
    bank.whole[j, KIND], f[REVS] = kind, np.nan
    free(bank, j, OPEN, 0.0, (n.ENGINE[kind] * engine) ** 2)


@compiled(uncounted=True)
def _turns(
    bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float, regime: int
) -> None:
    for k in range(len(n.TURNS)):
        j = _born(bank, i, now_s, chance / len(n.TURNS), regime, 1.0)
        if j >= 0:
            if regime == TURN:
                f, x, p = bank.number[j], bank.mean[i], bank.spread[i]
                f[BEFORE], f[REVS] = balance(x, f, bank.whole[i], now_s)[0], np.nan
                # what the level before it taught
                f[A0], f[A_VAR], f[P0], f[P_VAR] = (
                    x[LN_A],
                    p[LN_A, LN_A],
                    x[POWER],
                    p[POWER, POWER],
                )
            free(bank, j, OPEN, math.log(n.TURNS[k]), n.TURNS_SD**2)


@compiled(uncounted=True)
def brakes(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """
    Let something but the water slow her.
    """
    sizes = len(n.BRAKES) + (len(n.STOPPERS) if setting.engine > 0.0 else 0)
    for k in range(sizes):
        j = _born(bank, i, now_s, chance / sizes, BRAKE, 1.0)
        if j >= 0:
            if bank.whole[i, REGIME] != GLIDE:
                _glide(bank, j, setting)
                before = balance(bank.mean[i], bank.number[i], bank.whole[i], now_s)[0]
                bank.number[j, BEFORE], bank.number[j, REVS] = before, np.nan
                bank.whole[j, KIND] = bank.whole[j, GLIDE_KIND] = STANDS
                bank.mean[j, LN_A] += n.DRAGGED[STANDS]
                bank.spread[j, LN_A, LN_A] += n.DRAGGED_SD[STANDS] ** 2
            size = n.BRAKES[k] if k < len(n.BRAKES) else n.STOPPERS[k - len(n.BRAKES)]
            free(bank, j, OPEN, math.log(size), n.BRAKES_SD**2)


@compiled(uncounted=True)
def _back(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """Let a turn end under the power of before."""
    j = _born(bank, i, now_s, chance, LEVEL, 1.0)
    if j >= 0:
        before = bank.number[i, BEFORE]
        bank.number[j, RAMP_FROM], bank.number[j, REVS] = before, np.nan
        bank.whole[j, KIND] = GOVERNED
        free(bank, j, OPEN, before, 0.02**2)


@compiled(uncounted=True)
def _settles(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """End the manoeuvre that the record began in: she is in balance."""
    j = _born(bank, i, now_s, chance, DRIVEN, 1.0)
    if j >= 0:
        bank.whole[j, COUNT] = 0
        driven(bank, j, setting.hull)


@compiled(uncounted=True)
def driven(bank: Histories, j: int, hull: HullPrior) -> None:
    """
    Put a history in balance at its speed, without a switch.
    """
    x, p, f = bank.mean[j], bank.spread[j], bank.number[j]
    f[SINCE], f[BEFORE], f[RAMP_S] = -1e9, x[LN_U], 1.0
    f[FIRST_A] = f[GUST_A] = math.exp(hull_law(hull, x[LN_U])[0] + x[LN_A])
    free(bank, j, OPEN, x[LN_U], p[LN_U, LN_U])
    # the same error: she is in balance
    for k in range(STATES):
        if k != OPEN:
            p[k, OPEN] = p[OPEN, k] = 0.9 * p[LN_U, k]


@compiled(uncounted=True)
def _lies(bank: Histories, i: int, liar: int, chance: float) -> None:
    j = bank.used[0]
    if j < ROOM:
        _copy(bank, i, j)
        bank.used[0] = j + 1
        bank.number[j, WEIGHT] += math.log(chance)
        bank.whole[j, LIAR] = liar
        bank.number[j, STAYS] = bank.number[j, STAYS_WAY] = np.nan


@compiled(uncounted=True)
def bear(bank: Histories, setting: BankSetting, both: bool, steered: bool) -> None:
    """
    Let every likely history switch at the beginning of this bin.

    Parameters
    ----------
    both
        Two instruments show the motion: either may lie from now on.
    steered
        The rate of turn is seen: without it a turn in a glide is any brake.
    """
    now_s = (bank.clock[0] - 1) * setting.step_s
    parents = bank.used[0]
    best = -np.inf
    for i in range(parents):
        best = max(best, bank.number[i, WEIGHT])
    for i in range(parents):
        bank.number[i, BEHIND] = bank.number[i, WEIGHT] - best
    likelier = np.inf
    for least in _PARENTS:  # the likeliest first: there may be no room for the children of all
        for i in range(parents):
            if least <= bank.number[i, BEHIND] < likelier:
                _children(bank, setting, i, now_s, both, steered)
        likelier = least


@compiled(uncounted=True)
def _children(
    bank: Histories, setting: BankSetting, i: int, now_s: float, both: bool, steered: bool
) -> None:
    """Let a history switch to all that it may."""
    f, w = bank.number[i], bank.whole[i]
    claimed = setting.engine > 0.0
    # a window is as long as a person finds it worth, and manoeuvres with it
    hours = (n.BIN_S if claimed else setting.step_s) / 3600.0
    regime = w[REGIME]
    age_s = now_s - f[SINCE] if w[COUNT] > 0 else np.inf
    if both and w[LIAR] == NOBODY:
        _lies(bank, i, THE_LOG, n.LIES * hours)
        _lies(bank, i, THE_TRACK, n.LIES * hours)
    fades = _is_fade(bank, i)
    if regime == LEVEL and not fades and age_s > n.SETTLED_S * setting.pace:
        w[REGIME] = regime = DRIVEN
        w[KIND] = GOVERNED
        f[A0], f[A_VAR] = bank.mean[i, LN_A], bank.spread[i, LN_A, LN_A]
        f[P0], f[P_VAR] = bank.mean[i, POWER], bank.spread[i, POWER, POWER]
    left = 0.0  # hazard of all that it may switch to
    if regime in (DRIVEN, LEVEL) or (regime == AMID and (claimed or w[COUNT] > 0)):
        if regime == LEVEL and not fades and age_s < f[RAMP_S]:  # on its way there
            return
        stop, level, turn = float(n.STOP), float(n.LEVEL), float(n.TURN)
        if claimed or age_s < n.MANOEUVRING_S * setting.pace:
            after = w[GLIDED] == 1
            stops = n.AFTER_KICK if after else n.OF_MANOEUVRES[0]
            rest = (1.0 - stops) / (n.OF_MANOEUVRES[1] + n.OF_MANOEUVRES[2])
            stop = n.MANOEUVRE * stops
            level = n.MANOEUVRE * n.OF_MANOEUVRES[1] * rest
            turn = n.MANOEUVRE * n.OF_MANOEUVRES[2] * rest
        if regime == AMID and not claimed:  # it ends at some level, and any turn is part of it
            level, turn = float(n.AMID[2]), 0.0
        if not np.isnan(setting.told_s):
            off = (now_s - setting.told_s) / (n.TOLD[1] * (setting.pace if claimed else 1.0))
            told = 3600.0 * math.exp(-0.5 * off * off) / (ROOT_TWO_PI * n.TOLD[1])
            stop, level = stop + n.TOLD[0] * told, level + (1.0 - n.TOLD[0]) * told
        glides(bank, i, setting, now_s, (1.0 - n.BRAKED) * stop * hours)
        brakes(bank, i, setting, now_s, n.BRAKED * stop * hours)
        levels(bank, i, setting, now_s, level * hours)
        if not claimed:
            _turns(bank, i, setting, now_s, turn * hours, TURN)
        left = stop + level + turn
        if fades:
            _fade_ends(bank, i, now_s, n.FADE_OUT * hours)
            left += n.FADE_OUT
    elif regime == GLIDE:
        levels(bank, i, setting, now_s, n.GLIDE_LEVEL * hours)
        left = n.GLIDE_LEVEL + n.GLIDE_BRAKE
        if steered:
            _turns(bank, i, setting, now_s, n.GLIDE_TURN * hours, GLIDE_TURN)
            left += n.GLIDE_TURN
        brakes(bank, i, setting, now_s, n.GLIDE_BRAKE * hours)
    elif regime == BRAKE:
        glides(bank, i, setting, now_s, n.BRAKE_GLIDE * hours)
        levels(bank, i, setting, now_s, n.BRAKE_LEVEL * hours)
        left = n.BRAKE_GLIDE + n.BRAKE_LEVEL
    elif regime == AMID:
        _settles(bank, i, setting, now_s, n.AMID[2] * hours)
        left = float(n.AMID[2])
    else:
        if regime == TURN:
            _back(bank, i, setting, now_s, n.TURN_OUT * hours)
        else:
            glides(bank, i, setting, now_s, n.TURN_OUT * hours)
            if claimed:
                levels(bank, i, setting, now_s, n.GLIDE_LEVEL * hours)
        left = float(n.TURN_OUT)
    f[WEIGHT] += math.log1p(-min(left * hours, 0.99))


@compiled(uncounted=True)
def _alike(bank: Histories, i: int, j: int, now_s: float, pace: float) -> bool:
    """Say whether two histories differ by the moment of an old switch alone."""
    w, v = bank.whole[i], bank.whole[j]
    last = w[COUNT] - 1
    if w[COUNT] != v[COUNT] or w[LIAR] != v[LIAR] or w[KIND] != v[KIND] or last < 0:
        first = w[COUNT] == 0 and v[COUNT] == 0 and w[REGIME] == v[REGIME]
        return bool(first and w[LIAR] == v[LIAR] and w[KIND] == v[KIND])
    if w[REGIME] != v[REGIME] or now_s - bank.at[i, last] < _OLD_S * pace:
        return False
    if abs(bank.at[i, last] - bank.at[j, last]) > _ALIKE_S * pace:
        return False
    differ = 0
    for k in range(last + 1):
        differ += bank.what[i, k] != bank.what[j, k]
    return differ == 0


@compiled(uncounted=True)
def thin(bank: Histories, setting: BankSetting) -> float:
    """
    Weigh against the best and keep the likeliest; merge now and then.

    Returns the log predictive density of the bin.
    """
    count = bank.used[0]
    best = -np.inf
    for i in range(count):
        best = max(best, bank.number[i, WEIGHT])
    if best == -np.inf:  # it begins anew
        bank.used[0] = 0
        return -np.inf
    total = 0.0
    for i in range(count):
        total += math.exp(bank.number[i, WEIGHT] - best)
    norm = best + math.log(total)
    for i in range(count):
        bank.number[i, WEIGHT] -= norm
    if bank.clock[0] % _THIN_EVERY == 0:
        _keep(bank, -LOST)
        _merge(bank, bank.clock[0] * setting.step_s, setting.pace)
    _keep(bank, _least_of_the_best(bank))  # or the next births find no room
    return float(norm)


@compiled(uncounted=True)
def _keep(bank: Histories, least: float) -> None:
    """Drop the histories of less log weight."""
    kept = 0
    for i in range(bank.used[0]):
        if bank.number[i, WEIGHT] > least:
            if kept != i:
                _copy(bank, i, kept)
            kept += 1
    bank.used[0] = kept


@compiled(uncounted=True)
def _merge(bank: Histories, now_s: float, pace: float) -> None:
    count, kept = bank.used[0], 0
    for i in range(count):
        into = -1
        for j in range(kept):
            if _alike(bank, j, i, now_s, pace):
                into = j
                break
        if into < 0:
            if kept != i:
                _copy(bank, i, kept)
            kept += 1
            continue
        a, b = bank.number[into, WEIGHT], bank.number[i, WEIGHT]
        total = max(a, b) + math.log1p(math.exp(-abs(a - b)))
        part = math.exp(b - total)
        last = bank.whole[i, COUNT] - 1
        at = ramp = 0.0
        if last >= 0:
            at = bank.at[into, last] + part * (bank.at[i, last] - bank.at[into, last])
            ramp = bank.ramp[into, last] + part * (bank.ramp[i, last] - bank.ramp[into, last])
        if b > a:
            _copy(bank, i, into)
        bank.number[into, WEIGHT] = total
        if last >= 0:
            bank.at[into, last], bank.ramp[into, last] = at, ramp
    bank.used[0] = kept


@compiled(uncounted=True)
def _least_of_the_best(bank: Histories) -> float:
    """Return a log weight that `KEPT` histories at most exceed; `-LOST` where no more do."""
    low, least, high = -np.inf, -LOST, 0.0
    for _ in range(_HALVINGS):
        above = 0
        for i in range(bank.used[0]):
            above += bank.number[i, WEIGHT] > least
        if above > KEPT:
            low = least
        elif least == -LOST:
            break
        else:
            high = least
        least = 0.5 * (low + high)
    return float(high if low > -np.inf else least)
