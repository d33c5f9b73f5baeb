# SPDX-License-Identifier: Apache-2.0
"""The bank over one bin: births, motion, readings, and the probability of each regime."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.coastdown.regimes.births import (
    amid,
    bear,
    born,
    brakes,
    driven,
    glides,
    levels,
    switch,
    thin,
)
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.coastdown.regimes.motion import decay_of, predict, pushes, rest_speed, weigh
from shipdrag_ros.coastdown.regimes.noise import NoiseFilters, listen
from shipdrag_ros.coastdown.regimes.state import BankSetting, Histories
from shipdrag_ros.compiled import compiled
from shipdrag_ros.samples import Float64

OUT = ('driven', 'run_down', 'gliding', 'braked', 'turning', 're_engaged')
"""What a probability is given of."""
(
    P_DRIVEN,
    P_RUN_DOWN,
    P_GLIDING,
    P_BRAKED,
    P_TURNING,
    P_ENGAGED,
    P_EVEN,
    P_STEADY,
    SPEED,
    FIT,
) = range(10)
OUTS = 10  # and of even power, of the first one, mean speed, excess of the log density
_TURNING_RAD_S = 0.05  # a shaft below it, times its pitch, drives no ship


class Bank(NamedTuple):
    """
    All that the filter remembers.

    Attributes
    ----------
    histories, noise
    revs : (4,)
        Of each shaft in the first steady state, times pitch [rad/s].
    first : (3,)
        ln of the speed then, the bins that both were learnt from, revs over speed in the last bin.
    said, out, work
        Of the last bin; room.
    """

    histories: Histories
    noise: NoiseFilters
    revs: Float64
    first: Float64
    said: Float64
    out: Float64
    work: Float64

    @classmethod
    def fresh(cls) -> Bank:
        """
        Return a bank that has seen nothing.
        """
        return cls(
            Histories.fresh(),
            NoiseFilters.fresh(),
            np.zeros(4),
            np.array([0.0, 0.0, np.nan]),
            np.full(s.SAID, np.nan),
            np.zeros(OUTS),
            np.zeros((2, s.STATES)),
        )


@compiled(uncounted=True)
def _start(bank: Bank, setting: BankSetting, j: int, speed: float, by_log: bool) -> None:
    """Put a history where nothing is known but one speed: driven evenly, or not."""
    all_, hull = bank.histories, setting.hull
    x, p, f = all_.mean[j], all_.spread[j], all_.row[j]
    x[:], p[:] = 0.0, 0.0
    x[s.LN_U] = math.log(speed)
    p[s.LN_U, s.LN_U] = 0.1**2 if by_log else 0.3**2
    x[s.LN_A], p[s.LN_A, s.LN_A] = hull.level, hull.level_var
    x[s.POWER], p[s.POWER, s.POWER] = hull.exponent, hull.exponent_var
    x[s.WAY] = 0.5 * setting.step_s * speed
    p[s.WAY, s.WAY] = bank.noise.used[s.N_FIX] ** 2
    p[s.LAG, s.LAG] = (n.LOG_LAG_S * setting.pace * setting.engine) ** 2
    p[s.LONGER, s.LONGER] = n.LOG_LAG_SD**2
    p[s.CURRENT, s.CURRENT] = n.CURRENT[0 if by_log else 1] ** 2
    f.a0, f.a_var = x[s.LN_A], p[s.LN_A, s.LN_A]
    f.p0, f.p_var = x[s.POWER], p[s.POWER, s.POWER]
    f.revs = f.stays = f.stays_way = np.nan
    driven(all_, j, hull)
    if f.regime == s.AMID:
        amid(all_, j, setting, 0 if setting.engine > 0.0 else 1)


@compiled(uncounted=True)
def _sailed(setting: BankSetting, speed: float) -> float:
    """Return how likely a ship sails so, over the likeliest."""
    off = (math.log(speed) - setting.hull.sails) / n.SAILS[1]
    return math.exp(-0.5 * off * off)


@compiled(uncounted=True)
def _begin(bank: Bank, setting: BankSetting, log: float, track: float) -> None:
    """Give birth to the first histories: driven evenly, or not; any instrument may lie."""
    all_ = bank.histories
    hull, claimed = setting.hull, setting.engine > 0.0
    both = not np.isnan(log) and not np.isnan(track)
    for liar in range(3 if both else 1):
        # the logarithm of rest is of no use; but claimed, she may be at rest, or go astern
        by_log = (log > 0.0 or (claimed and not np.isnan(log))) and liar != s.THE_LOG
        speed = log if by_log else track
        if claimed and not np.isnan(speed):
            speed = max(rest_speed(hull), abs(speed))
        if not speed > 0.0:
            continue
        for regime in (s.DRIVEN, s.AMID):
            if claimed and regime == s.DRIVEN:  # nobody knows
                continue
            chance = n.AMID[0] if regime == s.AMID else 1.0 - n.AMID[0]
            if liar > 0:
                chance *= n.LIES_FIRST
            j = all_.used[0]
            all_.used[0] = j + 1
            all_.words[j] = 0
            f = all_.row[j]
            f.weight = math.log(chance * _sailed(setting, speed))
            f.regime, f.liar = regime, liar
            _start(bank, setting, j, speed, by_log)
            if claimed:
                levels(all_, j, setting, -setting.step_s, float(len(n.ENGINE)))
                if setting.told_s <= 0.0:
                    odds = len(n.ENGINE) * n.TOLD[0] / (1.0 - n.TOLD[0])
                    glides(all_, j, setting, -setting.step_s, (1.0 - n.BRAKED) * odds)
                    brakes(all_, j, setting, -setting.step_s, n.BRAKED * odds)


@compiled(uncounted=True)
def _joined(bank: Bank, setting: BankSetting, log: float, track: float) -> None:
    """Let the likeliest history end: another record follows, of which nothing is known."""
    all_ = bank.histories
    best = 0
    while all_.row[best].behind < 0.0:
        best += 1
    liar = all_.row[best].liar
    by_log = log > 0.0 and liar != s.THE_LOG
    speed = log if by_log else track
    if not speed > 0.0 or (liar == s.THE_TRACK and not by_log):
        return
    now_s = (all_.clock[0] - 1) * setting.step_s
    chance = n.JOINED * setting.step_s / 3600.0 * _sailed(setting, speed)
    for regime in (s.DRIVEN, s.AMID):
        part = n.AMID[0] if regime == s.AMID else 1.0 - n.AMID[0]
        j = born(all_, best, now_s, chance * part, s.LEVEL if regime == s.DRIVEN else regime, 1.0)
        if j >= 0:  # a level that is sailing at once
            all_.row[j].regime, all_.row[j].kind, all_.row[j].glided = regime, s.GOVERNED, 0
            _start(bank, setting, j, speed, by_log)


@compiled(uncounted=True)
def _shafts(bank: Bank, step_s: float, even: float, speed: float) -> None:
    """Put the fastest and the slowest shaft over their steady revs; learn those."""
    said, revs = bank.said, bank.revs
    said[s.HIGH] = said[s.LOW] = np.nan
    known = bank.first[1] >= 6.0
    learns = even > 0.9 and bank.first[1] < 60.0 and speed > 0.0
    gain = 1.0 / (bank.first[1] + 1.0)
    learnt = False
    for k in range(4):
        value = said[s.SHAFTS + k]
        if np.isnan(value):
            continue
        if known and abs(revs[k]) > _TURNING_RAD_S:
            nu = value / revs[k]
            said[s.HIGH] = nu if np.isnan(said[s.HIGH]) else max(said[s.HIGH], nu)
            said[s.LOW] = nu if np.isnan(said[s.LOW]) else min(said[s.LOW], nu)
        if learns:
            revs[k] += (gain if revs[k] != 0.0 else 1.0) * (value - revs[k])
            learnt = True
    said[s.GONE] = np.nan
    if np.isnan(said[s.HIGH]):
        bank.first[2] = np.nan
    elif speed > 0.0:
        before, now = bank.first[2], said[s.HIGH] * math.exp(bank.first[0]) / speed
        gone = 1.0 / n.NO_THRUST_SEEN
        if before > gone >= now:
            part = (before - gone) / (before - now)
            said[s.GONE] = (bank.histories.clock[0] - 1.5 + part) * step_s
        bank.first[2] = now
    if learns and (learnt or not known):
        bank.first[0] += gain * (math.log(speed) - bank.first[0])
        bank.first[1] += 1.0


@compiled(uncounted=True)
def _pushes_or_not(bank: Histories, i: int, setting: BankSetting, now_s: float) -> None:
    """
    Write down when the screw of a lower level ceases to push, and when it pushes again.

    Between both she glides, and the way to the level was a run-down.
    """
    f = bank.row[i]
    if f.regime != s.LEVEL or f.count == 0:
        return
    last = bank.switched[i, f.count - 1]
    pushed = last.what == s.LEVEL
    if pushed == pushes(bank, i, now_s):
        return
    if pushed and last.ramp == 0.0:  # by the level as it is known now, not yet
        f.count -= 1
    elif pushed and now_s - f.since > n.ENGAGE_S * (
        setting.pace if f.kind == s.FADING else f.ramp_s / n.LEVEL_RAMP_S[0]
    ):
        last.what, last.ramp = s.GLIDE, now_s - f.since
        f.glided = 1
    elif not pushed:
        switch(bank, i, now_s, s.LEVEL, 0.0)


@compiled(uncounted=True)
def _sum_up(bank: Bank, setting: BankSetting) -> None:
    """Add the weights of each regime."""
    out, all_ = bank.out, bank.histories
    out[:] = 0.0
    now_s = all_.clock[0] * setting.step_s
    for i in range(all_.used[0]):
        share = math.exp(all_.row[i].weight)
        f = all_.row[i]
        regime = f.regime
        if regime == s.DRIVEN:
            out[P_DRIVEN] += share
            out[P_EVEN] += share
            out[P_STEADY] += share
        elif regime == s.LEVEL:
            if not pushes(all_, i, now_s):  # a glide, until the water has slowed her to that level
                out[P_GLIDING] += share
            else:
                out[P_ENGAGED if f.glided == 1 else P_DRIVEN] += share
                if f.kind != s.FADING and now_s - f.since > 5.0 * n.LEVEL_RAMP_S[1] * setting.pace:
                    out[P_EVEN] += share
        elif regime == s.GLIDE:
            running = now_s - f.since < f.ramp_s
            out[P_RUN_DOWN if running else P_GLIDING] += share
        elif regime == s.AMID:
            out[P_DRIVEN] += share
            out[P_EVEN] += share  # under power, and nothing to tell
        elif regime == s.BRAKE:
            out[P_BRAKED] += share
        else:
            out[P_TURNING] += share
        out[SPEED] += share * math.exp(all_.mean[i, s.LN_U])
        out[FIT] += share * f.excess


_SETTING = BankSetting(
    HullPrior(0.0, 0.0, np.zeros(1), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, np.zeros(1)),
    0.0,
    0.0,
    0.0,
    0,
    0.0,
    0.0,
)  # its types are all that counts


@compiled('f8(Bank, Setting)', like={'Bank': Bank.fresh(), 'Setting': _SETTING}, uncounted=True)
def step(bank: Bank, setting: BankSetting) -> float:
    """
    Take the bin in `bank.said`; the probabilities are then in `bank.out`.

    Returns its log predictive density.
    """
    all_, said = bank.histories, bank.said
    log, ground, way = said[s.LOG], said[s.GROUND], said[s.ADVANCE]
    by_log = not np.isnan(log)
    both = by_log and not (np.isnan(ground) and np.isnan(way))
    track = way / setting.step_s if np.isnan(ground) else ground
    if all_.used[0] == 0:
        _begin(bank, setting, log, track)
        if all_.used[0] == 0:
            return 0.0
        thin(all_, setting)
        _sum_up(bank, setting)
        bank.out[P_EVEN] = bank.out[P_STEADY] = 1.0
    all_.clock[0] += 1
    _shafts(bank, setting.step_s, bank.out[P_STEADY], bank.out[SPEED])
    used = bank.noise.used
    if all_.clock[0] > 1:
        bear(all_, setting, both, not (np.isnan(said[s.RATE]) and np.isnan(said[s.RUDDER])))
        if setting.engine == 0.0:
            _joined(bank, setting, log, track)
    advance = 0.0 if np.isnan(way) else way
    claimed = setting.engine > 0.0
    decay = decay_of(setting, used)
    rests = abs(advance) < setting.step_s * rest_speed(setting.hull)
    for i in range(all_.used[0]):
        # an engine may drive her astern
        astern = claimed and (rests or all_.row[i].regime == s.AMID)
        way = abs(advance) if astern else advance
        predict(all_, i, setting, used, decay, way)
        weigh(all_, i, setting, used, said, bank.first[0], bank.work)
        _pushes_or_not(all_, i, setting, all_.clock[0] * setting.step_s)
    shown, before = thin(all_, setting), bank.out[P_STEADY]
    _sum_up(bank, setting)
    if not claimed:
        listen(bank.noise, setting, said, before, bank.out[P_STEADY])
    return shown
