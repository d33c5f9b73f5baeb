# SPDX-License-Identifier: Apache-2.0
"""A window that a person claims to be a coastdown, read by the bank."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import compress, product

import numpy as np

from shipdrag_ros.coastdown.regimes import numbers as n
from shipdrag_ros.coastdown.regimes import state as s
from shipdrag_ros.coastdown.regimes.bank import Bank, step
from shipdrag_ros.coastdown.regimes.binned import Binned, bin_window
from shipdrag_ros.coastdown.regimes.births import LOST
from shipdrag_ros.coastdown.regimes.hull import HullPrior
from shipdrag_ros.coastdown.regimes.motion import hull_law, rest_speed
from shipdrag_ros.coastdown.regimes.read_out import (
    Spans,
    median,
    probability_of,
    spans_of,
    stretches,
)
from shipdrag_ros.coastdown.regimes.state import BankSetting
from shipdrag_ros.estimation.window import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship

REGIMES = ((s.DRIVEN, s.AMID, s.LEVEL), (s.GLIDE,), (s.BRAKE,), (s.GLIDE_TURN,))
ENGINES, GLIDES, BRAKES, TURNS = range(4)


@dataclass(frozen=True)
class WindowRegimes:
    """
    What the bank makes of a window.

    Attributes
    ----------
    binned
        What it was told.
    probability : (4, bins)
        That an engine acts, that she glides, that something stops her, that she glides in a turn.
    rest
        Speed of a ship at rest, which is never quite so [m/s].
    """

    binned: Binned
    spans: Spans
    probability: Float64
    rest: float

    def stretches(self, *which: int) -> list[tuple[int, int]]:
        """
        Return first bins, and those after the last, of the stretches that may be so.
        """
        likely = self.probability[list(which)].sum(axis=0) > n.HOLD[0]
        likely[: self.binned.before] = False
        return stretches(likely)

    def lost(self, span: tuple[int, int]) -> float:
        """
        Return the speed that is lost in some bins [m/s].
        """
        speed = self.binned.speed[span[0] : span[1]]
        speed = speed[np.isfinite(speed)]
        some = max(1, min(3, len(speed) // 3))
        return float(speed[:some].mean() - speed[-some:].mean()) if len(speed) else 0.0

    def dates(self, span: tuple[int, int], *which: int) -> tuple[float, float]:
        """
        Return when a stretch of bins began and ended [bins], of the histories that hold it.
        """
        codes = [code for each in which for code in REGIMES[each]]
        step_s = self.binned.step_s
        found = self.spans.part(np.isin(self.spans.what, codes))
        likely = self.probability[list(which), slice(*span)].sum(axis=0)
        likely = span[0] + np.flatnonzero(likely >= min(0.5, likely.max()))
        places = []
        for at, dated in ((likely[0], 'date_s'), (likely[-1], 'end_s')):
            at_s = (at + 0.5) * step_s
            held = found.part((found.begin_s < at_s) & (at_s < found.end_s))
            share = held.weight / held.weight.sum()
            places.append(median(getattr(held, dated), share) / step_s)
        begin, end = places
        return max(begin, span[0] - 0.5), min(end, span[1] + 0.5)


def read(window: Window, ship: Ship, parameters: Parameters) -> WindowRegimes | None:
    """
    Let the bank read a window and the record before it; None where nothing shows a speed.

    Notes
    -----
    No steady record shows the noise: all settings of it are weighed by their evidence.
    """
    longest_s = float(n.BIN_S) * math.sqrt(ship.length_m / float(n.BIN_LENGTH_M))
    binned = bin_window(window, parameters, longest_s)
    if binned is None or not binned.top > 0.0:
        return None
    hull = HullPrior.any_body(ship)
    read_out = np.isfinite(binned.said[:, s.SHAFTS : s.SHAFTS + 4]).any(axis=0)
    resistance = math.exp(hull_law(hull, math.log(binned.top))[0] + hull.level)
    setting = BankSetting.of(hull, binned.step_s, shafts=int(read_out.sum()))._replace(
        told_s=binned.before * binned.step_s,
        engine=max(resistance, binned.swing),
    )
    # a log errs by a part of the speed: as that of the ship of the table
    wanders = n.WANDER * binned.top / math.exp(hull.sails) * longest_s / float(n.BIN_S)
    short, long = n.WANDER_S
    settings = [*product(n.ANY_GUST, wanders, [long]), *product(n.GUST[:1], wanders, [short])]
    banks = [_bank(binned, *each) for each in settings]
    evidence = [0.0 for _ in banks]
    for k, said in enumerate(binned.said):
        for each, bank in enumerate(banks):
            bank.said[:] = said
            shown = step(bank, setting)
            if k >= binned.before:
                evidence[each] += shown
        # one so far behind would weigh nothing, as a history that is so
        likely = [each >= max(evidence) - LOST for each in evidence]
        banks, evidence = list(compress(banks, likely)), list(compress(evidence, likely))
    if not evidence or not np.isfinite(max(evidence)):  # rounding broke every one
        return None
    share = np.exp(np.array(evidence) - max(evidence))
    share /= share.sum()
    parts = [
        spans._replace(weight=part * spans.weight)
        for part, spans in zip(share, (spans_of(bank, setting) for bank in banks), strict=True)
    ]
    joined = Spans(*(np.concatenate(each) for each in zip(*parts, strict=True)))
    probability = [
        probability_of(joined.part(np.isin(joined.what, codes)), len(binned.said), binned.step_s)
        for codes in REGIMES
    ]
    return WindowRegimes(binned, joined, np.array(probability), rest_speed(hull))


def _bank(binned: Binned, gust: float, wander: float, wander_s: float) -> Bank:
    """Return a bank that is to read a window with some noise."""
    bank = Bank.fresh()
    noise = bank.noise.used
    noise[:] = binned.noise
    noise[s.N_GUST] = gust
    noise[[s.N_WANDER, s.N_EDDY]], noise[[s.N_WANDER_S, s.N_EDDY_S]] = wander, wander_s
    bank.revs[:] = most_revs(binned)
    bank.first[:] = math.log(binned.top), 60.0, np.nan
    # what nothing shows before the first bin that is read goes by
    bank.histories.clock[0] = np.argmax(np.isfinite(binned.speed))
    return bank


def most_revs(binned: Binned) -> Float64:
    """
    Return the most revs times pitch of each shaft, (4,) [rad/s], with the sign it mostly has.
    """
    turning = np.nan_to_num(binned.said[:, s.SHAFTS : s.SHAFTS + 4])
    most = np.abs(turning).max(axis=0)
    mostly = np.sign(np.where(np.abs(turning) > 0.5 * most, turning, 0.0)).sum(axis=0)
    return np.asarray(most * np.where(mostly < 0.0, -1.0, 1.0))
