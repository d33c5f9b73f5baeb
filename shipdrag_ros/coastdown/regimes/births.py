# SPDX-License-Identifier: Apache-2.0
"""Histories that are born, merged and dropped."""

from __future__ import annotations

import math

import numpy as np

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.coastdown.regimes.motion import ROOT_TWO_PI, balance, free, hull_law, is_fade
from shipdrag_ros.coastdown.regimes.state import BankSetting, Histories
from shipdrag_ros.compiled import compiled

_PARENTS = (-1.0, -3.0, -7.0)  # nats below the best: histories that have children, in turn
LOST = 16.0
"""Nats below the best of a history that is dropped."""
_ALIKE_S = 8.0  # two stops so near each other are one ...
_SAME, _SAME_SPREAD = 0.6, 2.0  # ... where states differ by less: in sd, in variance
_SAME_LEVEL = 0.05  # ln: the power at which a turn ends
_THIN_EVERY, _SLOW_EVERY = 6, 3  # bins
_HALVINGS = 24  # in search of the weight of the last that is kept
_NO_RAMP_S = 1e-3  # nothing pushed before
_LOG_S = math.log(float(n.NO_THRUST))


@compiled(uncounted=True)
def _copy(bank: Histories, i: int, j: int) -> None:
    for k in range(s.STATES):
        bank.mean[j, k] = bank.mean[i, k]
        for m in range(s.STATES):
            bank.spread[j, k, m] = bank.spread[i, k, m]
    for k in range(bank.words.shape[1]):
        bank.words[j, k] = bank.words[i, k]


@compiled(uncounted=True)
def switch(bank: Histories, i: int, now_s: float, regime: int, ramp_s: float) -> None:
    """
    Write down a switch.
    """
    f = bank.row[i]
    if f.count == s.SWITCHES:  # the oldest is forgotten
        for k in range(s.SWITCHES - 1):
            bank.switched[i, k] = bank.switched[i, k + 1]
        f.count -= 1
    new = bank.switched[i, f.count]
    new.at, new.what, new.ramp = now_s, regime, ramp_s
    f.count += 1


@compiled(uncounted=True)
def born(
    bank: Histories,
    i: int,
    now_s: float,
    share: float,
    regime: int,
    ramp_s: float,
) -> int:
    """
    Copy a history that switches now; return its slot, or -1 where there is no room.
    """
    j = bank.used[0]
    # one that is not likelier would be dropped at once
    if j >= s.ROOM or not share > 0.0 or bank.row[i].behind + math.log(share) < -LOST:
        return -1
    _copy(bank, i, j)
    bank.used[0] = j + 1
    f = bank.row[j]
    if f.regime == s.AMID:  # what an engine gave is over
        free(bank, j, s.GUST, 0.0, 0.0)
    f.weight += math.log(share)
    f.since, f.ramp_s = now_s, ramp_s
    f.regime = regime
    switch(bank, j, now_s, regime, ramp_s)
    return int(j)


@compiled(inline=True, uncounted=True)
def _wind(setting: BankSetting) -> float:
    return float(n.ANY_WIND_SD if setting.engine > 0.0 else n.WIND_SD)


@compiled(uncounted=True)
def _glide(bank: Histories, j: int, setting: BankSetting) -> None:
    """Begin a glide: wind is what is left open."""
    law = hull_law(setting.hull, bank.mean[j, s.LN_U])[0] + bank.mean[j, s.LN_A]
    bank.row[j].first_a, bank.row[j].thrust = math.exp(law), 1.0
    bank.row[j].glided = 1
    free(bank, j, s.OPEN, 0.0, _wind(setting) ** 2)
    if setting.engine > 0.0:  # what an engine gave is over
        free(bank, j, s.GUST, 0.0, 0.0)


@compiled(uncounted=True)
def glides(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """
    Let the thrust run down.
    """
    if bank.row[i].regime not in (s.DRIVEN, s.LEVEL, s.AMID):
        _is_let_go(bank, i, setting, now_s, chance)
        return
    learnt, claimed = bank.row[i].regime == s.LEVEL, setting.engine > 0.0
    last = bank.switched[i, bank.row[i].count - 1]
    idles = learnt and last.what == s.GLIDE  # she glides already, as nothing pushes
    already, any_ = idles or now_s < 0.0, bank.row[i].regime == s.AMID
    downs = 1 if already else len(n.RUN_DOWN_S)
    before = balance(bank.mean[i], bank.row[i], now_s)[0]
    # later she is known
    odds = len(n.ODD) if claimed and any_ and bank.row[i].glided == 0 else 1
    for each in range(downs * odds):
        k, odd = each % downs, each // downs
        ramp_s = _NO_RAMP_S if already else n.RUN_DOWN_S[k] * setting.pace
        for kind in range(len(n.DRAGGED) if setting.shafts > 0 else s.STUCK):
            part = chance * (1.0 if already else setting.hull.run_down[k]) * n.DRAGGED_SHARE[kind]
            share = part * n.ODD_SHARE[odd] if odds > 1 else part
            j = born(bank, i, now_s, share, s.GLIDE, ramp_s)
            if j < 0:
                continue
            if idles:  # it is the same glide
                bank.row[j].count -= 1
            x, p = bank.mean[j], bank.spread[j]
            bank.row[j].before = before
            x[s.LN_A] += n.ODD[odd]
            _glide(bank, j, setting)
            bank.row[j].kind = bank.row[j].glide_kind = kind
            # the revs of an engine that is cut off may change as they like
            held = kind == s.STUCK or (kind == s.HELD and not claimed)
            revs = bank.row[i].revs if held else np.nan
            # of even power they are over those expected
            bank.row[j].free = np.nan if any_ or claimed else revs
            bank.row[j].revs = revs if any_ or claimed else np.nan
            x[s.LN_A] += n.DRAGGED[kind]
            tied, var = n.DRAGGED_EXPONENT[kind], n.DRAGGED_SD[kind] ** 2
            x[s.POWER] += tied * n.DRAGGED[kind]
            p[s.LN_A, s.LN_A] += var + (n.KEPT_SD**2 if learnt else 0.0)
            p[s.LN_A, s.POWER] += tied * var
            p[s.POWER, s.LN_A] = p[s.LN_A, s.POWER]
            p[s.POWER, s.POWER] += tied * tied * var + n.DRAGGED_EXPONENT_SD**2


@compiled(uncounted=True)
def _is_let_go(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """
    End what slowed her beside the water: an engine astern runs down as one ahead does.

    The wind is that of before, but for how far she has turned.
    """
    # what holds a body in a window that a person claims lets go at once
    x, f = bank.mean[i], bank.row[i]
    braked, ahead = f.regime == s.BRAKE and setting.engine == 0.0, 1.0
    if f.regime == s.GLIDE_TURN:
        turned = n.TURN_RATE * math.exp(x[s.LN_U]) / setting.hull.length_m * (now_s - f.since)
        ahead = math.exp(-0.5 * turned * turned)
    wind_var = ahead * ahead * f.wind_var + (1.0 - ahead * ahead) * _wind(setting) ** 2
    thrust = 0.0
    if braked:
        law = hull_law(setting.hull, x[s.LN_U])[0] + x[s.LN_A]
        thrust = -f.first_a * math.exp(min(x[s.OPEN] - law, 5.0))
    for k in range(len(n.RUN_DOWN_S) if braked else 1):
        ramp_s = n.RUN_DOWN_S[k] * setting.pace if braked else _NO_RAMP_S
        share = chance * setting.hull.run_down[k] if braked else chance
        j = born(bank, i, now_s, share, s.GLIDE, ramp_s)
        if j >= 0:
            bank.row[j].thrust = thrust
            free(bank, j, s.OPEN, ahead * f.wind, wind_var)


@compiled(inline=True, uncounted=True)
def _engages(bank: Histories, j: int) -> None:
    """End what the screw dragged."""
    kind = bank.row[j].glide_kind
    bank.mean[j, s.LN_A] -= n.DRAGGED[kind]
    bank.mean[j, s.POWER] -= n.DRAGGED_EXPONENT[kind] * n.DRAGGED[kind]


@compiled(uncounted=True)
def _any_power(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """Let an engine act in any way."""
    regime = bank.row[i].regime
    for kind in range(len(n.ENGINE)):
        if regime != s.AMID or bank.row[i].kind != kind:
            j = born(bank, i, now_s, chance / len(n.ENGINE), s.AMID, 1.0)
            if j >= 0:
                if regime in (s.GLIDE, s.BRAKE, s.GLIDE_TURN):
                    _engages(bank, j)
                amid(bank, j, setting, kind)


@compiled(uncounted=True)
def _fades(
    bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float, base: float
) -> None:
    """Let the engine give evenly less: the rate is what is left open."""
    for k in range(len(n.FADES)):
        j = born(bank, i, now_s, chance / len(n.FADES), s.LEVEL, 600.0 * setting.pace)
        if j >= 0:
            bank.row[j].kind = s.FADING
            bank.row[j].ramp_from, bank.row[j].revs = base, np.nan
            free(bank, j, s.OPEN, math.log(n.FADES[k]), n.FADES_SD**2)


@compiled(uncounted=True)
def _fade_ends(bank: Histories, i: int, now_s: float, chance: float) -> None:
    """Let an engine that gave less and less stay where it is."""
    target, by_open = balance(bank.mean[i], bank.row[i], now_s)
    j = born(bank, i, now_s, chance, s.LEVEL, 1.0)
    if j >= 0:
        bank.row[j].kind = s.GOVERNED
        before = bank.switched[j, bank.row[j].count - 2]
        if before.what == s.GLIDE:  # nothing pushed: it is the same glide
            bank.row[j].count -= 1
        bank.row[j].ramp_from = bank.mean[j, s.OPEN] = target
        for k in range(s.STATES):
            bank.spread[j, s.OPEN, k] *= by_open
        for k in range(s.STATES):
            bank.spread[j, k, s.OPEN] *= by_open


@compiled(uncounted=True)
def levels(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """
    Let the engine go to another level, or engage.
    """
    f, regime = bank.row[i], bank.row[i].regime
    engaged, claimed = regime in (s.DRIVEN, s.LEVEL, s.AMID), setting.engine > 0.0
    if claimed:
        # what the level was before, and is then, shafts alone show
        even = engaged and (regime != s.AMID or bank.row[i].kind == 0)
        level = 0.5 * chance if even and setting.shafts > 0 else 0.0
        _any_power(bank, i, setting, now_s, chance - level)
        engaged, chance = True, level
    else:  # or it varies, as often as a record begins so
        _any_power(bank, i, setting, now_s, chance * n.AMID[0])
        chance *= 1.0 - n.AMID[0]
    base = f.before
    if engaged:
        base = balance(bank.mean[i], f, now_s)[0]
        if not claimed and regime != s.AMID and not is_fade(bank.row[i]):
            if bank.clock[0] % _THIN_EVERY == 0:  # its begin is no sharper
                _fades(bank, i, setting, now_s, _THIN_EVERY * chance * n.FADES_SHARE, base)
            chance *= 1.0 - n.FADES_SHARE
    ramps = len(n.LEVEL_RAMP_S) if engaged else 1
    kinds = 1 if claimed else 2  # torque that is held is any power there
    for k in range(len(n.LEVELS)):
        for m in range(kinds * ramps):
            share = chance * n.LEVELS_SHARE[k] / (kinds * ramps)
            if m >= kinds and not claimed:  # the begin of a slow ramp is no sharper
                if bank.clock[0] % _SLOW_EVERY != 0:
                    continue
                share *= _SLOW_EVERY
            ramp_s = (n.LEVEL_RAMP_S[m // kinds] if engaged else n.ENGAGE_S) * setting.pace
            j = born(bank, i, now_s, share, s.LEVEL, ramp_s)
            if j < 0:
                continue
            bank.row[j].kind = m % kinds
            bank.row[j].free = n.WINDMILL[0]
            if regime == s.GLIDE and bank.row[i].kind == s.WINDMILLS:
                revs = f.revs
                bank.row[j].free = n.WINDMILL[0] if np.isnan(revs) else revs
            bank.row[j].revs = f.revs if claimed else np.nan
            bank.row[j].ramp_from = base if engaged else bank.mean[i, s.LN_U] - _LOG_S
            free(bank, j, s.OPEN, base + math.log(n.LEVELS[k]), n.LEVELS_SD[k] ** 2)
            if not engaged:
                _engages(bank, j)


@compiled(uncounted=True)
def amid(bank: Histories, j: int, setting: BankSetting, kind: int) -> None:
    """
    Put a history amid a manoeuvre under power: an acceleration that drifts is what is left open.
    """
    x, f = bank.mean[j], bank.row[j]
    engine = setting.engine
    if engine > 0.0:
        free(bank, j, s.LONGER, 0.0, n.LOG_LAG_SD**2)
    else:  # at full power it gives what the water takes
        law = hull_law(setting.hull, max(x[s.LN_U], setting.hull.sails))[0] + x[s.LN_A]
        engine = math.exp(law)
    f.first_a = n.ENGINE_GUST[kind] * engine
    free(bank, j, s.GUST, 0.0, f.first_a**2)
    bank.row[j].kind, f.revs = kind, np.nan
    free(bank, j, s.OPEN, 0.0, (n.ENGINE[kind] * engine) ** 2)


@compiled(inline=True, uncounted=True)
def _keep_wind(bank: Histories, j: int) -> None:
    """Write down the wind of a glide, as something else is open from now on."""
    f = bank.row[j]
    f.wind, f.wind_var = bank.mean[j, s.OPEN], bank.spread[j, s.OPEN, s.OPEN]


@compiled(uncounted=True)
def _turns(bank: Histories, i: int, now_s: float, chance: float, regime: int) -> None:
    for k in range(len(n.TURNS)):
        j = born(bank, i, now_s, chance / len(n.TURNS), regime, 1.0)
        if j >= 0:
            if regime == s.TURN:
                f, x, p = bank.row[j], bank.mean[i], bank.spread[i]
                f.before = balance(x, bank.row[i], now_s)[0]
                f.revs = np.nan
                # what the level before it taught
                f.a0, f.a_var = x[s.LN_A], p[s.LN_A, s.LN_A]
                f.p0, f.p_var = x[s.POWER], p[s.POWER, s.POWER]
            _keep_wind(bank, j)
            free(bank, j, s.OPEN, math.log(n.TURNS[k]), n.TURNS_SD**2)


@compiled(uncounted=True)
def brakes(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """
    Let something but the water slow her.
    """
    sizes = len(n.BRAKES) + (len(n.STOPPERS) if setting.engine > 0.0 else 0)
    for k in range(sizes):
        j = born(bank, i, now_s, chance / sizes, s.BRAKE, 1.0)
        if j >= 0:
            if bank.row[i].regime != s.GLIDE:
                _glide(bank, j, setting)
                before = balance(bank.mean[i], bank.row[i], now_s)[0]
                bank.row[j].before, bank.row[j].revs = before, np.nan
                bank.row[j].kind = bank.row[j].glide_kind = s.STANDS
                bank.mean[j, s.LN_A] += n.DRAGGED[s.STANDS]
                bank.spread[j, s.LN_A, s.LN_A] += n.DRAGGED_SD[s.STANDS] ** 2
            _keep_wind(bank, j)
            size = n.BRAKES[k] if k < len(n.BRAKES) else n.STOPPERS[k - len(n.BRAKES)]
            free(bank, j, s.OPEN, math.log(size), n.BRAKES_SD**2)


@compiled(uncounted=True)
def _back(bank: Histories, i: int, now_s: float, chance: float) -> None:
    """Let a turn end under the power of before."""
    j = born(bank, i, now_s, chance, s.LEVEL, 1.0)
    if j >= 0:
        before = bank.row[i].before
        bank.row[j].ramp_from, bank.row[j].revs = before, np.nan
        bank.row[j].kind = s.GOVERNED
        free(bank, j, s.OPEN, before, 0.02**2)


@compiled(uncounted=True)
def _settles(bank: Histories, i: int, setting: BankSetting, now_s: float, chance: float) -> None:
    """End the manoeuvre that the record began in: she is in balance."""
    j = born(bank, i, now_s, chance, s.DRIVEN, 1.0)
    if j >= 0:
        bank.row[j].count = 0
        driven(bank, j, setting.hull)


@compiled(uncounted=True)
def driven(bank: Histories, j: int, hull: HullPrior) -> None:
    """
    Put a history in balance at its speed, without a switch.
    """
    x, p, f = bank.mean[j], bank.spread[j], bank.row[j]
    f.since, f.before, f.ramp_s = -1e9, x[s.LN_U], 1.0
    f.first_a = f.gust_a = math.exp(hull_law(hull, x[s.LN_U])[0] + x[s.LN_A])
    free(bank, j, s.OPEN, x[s.LN_U], p[s.LN_U, s.LN_U])
    # the same error: she is in balance
    for k in range(s.STATES):
        if k != s.OPEN:
            p[k, s.OPEN] = p[s.OPEN, k] = 0.9 * p[s.LN_U, k]


@compiled(uncounted=True)
def _lies(bank: Histories, i: int, liar: int, chance: float) -> None:
    j = bank.used[0]
    if j < s.ROOM:
        _copy(bank, i, j)
        bank.used[0] = j + 1
        bank.row[j].weight += math.log(chance)
        bank.row[j].liar = liar
        bank.row[j].stays = bank.row[j].stays_way = np.nan
        bank.row[j].stuck = n.STUCK


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
        best = max(best, bank.row[i].weight)
    for i in range(parents):
        bank.row[i].behind = bank.row[i].weight - best
    likelier = np.inf
    for least in _PARENTS:  # the likeliest first: there may be no room for the children of all
        for i in range(parents):
            if least <= bank.row[i].behind < likelier:
                _children(bank, setting, i, now_s, both, steered)
        likelier = least


@compiled(uncounted=True)
def _children(
    bank: Histories, setting: BankSetting, i: int, now_s: float, both: bool, steered: bool
) -> None:
    """Let a history switch to all that it may."""
    f = bank.row[i]
    claimed = setting.engine > 0.0
    # a window is as long as a person finds it worth, and manoeuvres with it
    hours = setting.step_s / setting.pace / 3600.0
    regime = f.regime
    age_s = now_s - f.since if f.count > 0 else np.inf
    if both and f.liar == s.NOBODY:
        _lies(bank, i, s.THE_LOG, n.LIES * hours)
        _lies(bank, i, s.THE_TRACK, n.LIES * hours)
    if setting.shafts > 0 and not claimed and f.liar == s.NOBODY:
        _lies(bank, i, s.THE_SHAFTS, n.SHAFT_DIES * hours)
    fades = is_fade(bank.row[i])
    if regime == s.LEVEL and not fades and age_s > n.SETTLED_S * setting.pace:
        f.regime = regime = s.DRIVEN
        f.kind = s.GOVERNED
        f.a0, f.a_var = bank.mean[i, s.LN_A], bank.spread[i, s.LN_A, s.LN_A]
        f.p0, f.p_var = bank.mean[i, s.POWER], bank.spread[i, s.POWER, s.POWER]
    left = 0.0  # hazard of all that it may switch to
    if regime in (s.DRIVEN, s.LEVEL) or (regime == s.AMID and (claimed or f.count > 0)):
        if regime == s.LEVEL and not fades and age_s < f.ramp_s:  # on its way there
            return
        stop, level, turn = float(n.STOP), float(n.LEVEL), float(n.TURN)
        if claimed or age_s < n.MANOEUVRING_S * setting.pace:
            after = f.glided == 1
            stops = n.AFTER_KICK if after else n.OF_MANOEUVRES[0]
            rest = (1.0 - stops) / (n.OF_MANOEUVRES[1] + n.OF_MANOEUVRES[2])
            stop = n.MANOEUVRE * stops
            level = n.MANOEUVRE * n.OF_MANOEUVRES[1] * rest
            turn = n.MANOEUVRE * n.OF_MANOEUVRES[2] * rest
        if regime == s.AMID and not claimed:  # it ends at some level, and any turn is part of it
            level, turn = float(n.AMID[2]), 0.0
        if not np.isnan(setting.told_s):
            off = (now_s - setting.told_s) / (n.TOLD[1] * (setting.pace if claimed else 1.0))
            told = 3600.0 * math.exp(-0.5 * off * off) / (ROOT_TWO_PI * n.TOLD[1])
            stop, level = stop + n.TOLD[0] * told, level + (1.0 - n.TOLD[0]) * told
        glides(bank, i, setting, now_s, (1.0 - n.BRAKED) * stop * hours)
        brakes(bank, i, setting, now_s, n.BRAKED * stop * hours)
        levels(bank, i, setting, now_s, level * hours)
        if not claimed:
            _turns(bank, i, now_s, turn * hours, s.TURN)
        left = stop + level + turn
        if fades:
            _fade_ends(bank, i, now_s, n.FADE_OUT * hours)
            left += n.FADE_OUT
    elif regime == s.GLIDE:
        levels(bank, i, setting, now_s, n.GLIDE_LEVEL * hours)
        left = n.GLIDE_LEVEL + n.GLIDE_BRAKE
        if steered:
            _turns(bank, i, now_s, n.GLIDE_TURN * hours, s.GLIDE_TURN)
            left += n.GLIDE_TURN
        brakes(bank, i, setting, now_s, n.GLIDE_BRAKE * hours)
    elif regime == s.BRAKE:
        glides(bank, i, setting, now_s, n.BRAKE_GLIDE * hours)
        levels(bank, i, setting, now_s, n.BRAKE_LEVEL * hours)
        left = n.BRAKE_GLIDE + n.BRAKE_LEVEL
    elif regime == s.AMID:
        _settles(bank, i, setting, now_s, n.AMID[2] * hours)
        left = float(n.AMID[2])
    else:
        if regime == s.TURN:
            _back(bank, i, now_s, n.TURN_OUT * hours)
        else:
            glides(bank, i, setting, now_s, n.TURN_OUT * hours)
            if claimed:
                levels(bank, i, setting, now_s, n.GLIDE_LEVEL * hours)
        left = float(n.TURN_OUT)
    f.weight += math.log1p(-min(left * hours, 0.99))


@compiled(uncounted=True)
def _alike(bank: Histories, i: int, j: int, now_s: float, pace: float) -> bool:
    """Say whether two histories differ by moments alone, which what comes hardly tells."""
    f, v = bank.row[i], bank.row[j]
    last = f.count - 1
    if f.count != v.count or f.liar != v.liar or f.kind != v.kind or f.regime != v.regime:
        return False
    if f.regime == s.GLIDE or (f.regime == s.TURN and abs(f.before - v.before) > _SAME_LEVEL):
        return False
    if last < 0:
        return True
    for k in range(last + 1):
        one, other = bank.switched[i, k], bank.switched[j, k]
        if one.what != other.what:
            return False
        if one.what in (s.GLIDE, s.BRAKE) and abs(one.at - other.at) > _ALIKE_S * pace:
            return False
    if is_fade(f) or now_s - max(f.since, v.since) < max(f.ramp_s, v.ramp_s):
        return False
    for k in range(s.STATES):
        a, b = bank.spread[i, k, k], bank.spread[j, k, k]
        off = bank.mean[i, k] - bank.mean[j, k]
        if off * off > _SAME**2 * min(a, b) or max(a, b) > _SAME_SPREAD * min(a, b):
            return False
    return True


@compiled(uncounted=True)
def thin(bank: Histories, setting: BankSetting) -> float:
    """
    Weigh against the best and keep the likeliest; merge now and then.

    Returns the log predictive density of the bin.
    """
    count = bank.used[0]
    best = -np.inf
    for i in range(count):
        best = max(best, bank.row[i].weight)
    if best == -np.inf:  # it begins anew
        bank.used[0] = 0
        return -np.inf
    total = 0.0
    for i in range(count):
        total += math.exp(bank.row[i].weight - best)
    norm = best + math.log(total)
    for i in range(count):
        bank.row[i].weight -= norm
    _keep(bank, _least_of_the_best(bank))  # or the next births find no room
    if bank.clock[0] % _THIN_EVERY == 0:
        _merge(bank, bank.clock[0] * setting.step_s, setting.pace)
    return float(norm)


@compiled(uncounted=True)
def _keep(bank: Histories, least: float) -> None:
    """Drop the histories of less log weight."""
    kept = 0
    for i in range(bank.used[0]):
        if bank.row[i].weight > least:
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
        a, b = bank.row[into].weight, bank.row[i].weight
        total = max(a, b) + math.log1p(math.exp(-abs(a - b)))
        part, last = math.exp(b - total), bank.row[i].count - 1
        one, other = bank.switched[into, last], bank.switched[i, last]
        at, off = one.at, other.at - one.at
        if b > a:
            _copy(bank, i, into)
        bank.row[into].weight = total
        if last >= 0 and abs(off) <= _ALIKE_S * pace:
            one.at = at + part * off
    bank.used[0] = kept


@compiled(uncounted=True)
def _least_of_the_best(bank: Histories) -> float:
    """Return a log weight that `KEPT` histories at most exceed; `-LOST` where no more do."""
    low, least, high = -np.inf, -LOST, 0.0
    for _ in range(_HALVINGS):
        above = 0
        for i in range(bank.used[0]):
            above += bank.row[i].weight > least
        if above > s.KEPT:
            low = least
        elif least == -LOST:
            break
        else:
            high = least
        least = 0.5 * (low + high)
    return float(high if low > -np.inf else least)
