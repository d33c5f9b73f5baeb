# SPDX-License-Identifier: Apache-2.0
"""How the inputs are doing, from counts and the last few samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from shipdrag_ros.coastdown.memory import RECENT, InputTally
from shipdrag_ros.coastdown.past import NEVER
from shipdrag_ros.samples import FURTHER, INPUTS, Channel, Reason


@dataclass(frozen=True)
class InputHealth:
    """
    State of one input since the monitor was made.

    Attributes
    ----------
    messages, used
        Samples that came and samples that were accepted.
    rejected
        Samples by reason, lower-case names; reasons without any are left out.
    last_receive_ns
        Arrival of the last accepted sample; None before it.
    rate_hz
        By the stamps of the last few accepted samples; None before two.
    clock_offset_s
        Median of arrival minus stamp of the last few: latency, and what the
        clock of the sensor differs by.
    """

    messages: int
    used: int
    rejected: dict[str, int]
    last_receive_ns: int | None
    rate_hz: float | None
    clock_offset_s: float | None


@dataclass(frozen=True)
class MonitorProgress:
    """
    How far the monitor is.

    Attributes
    ----------
    steady_s
        Since when the ship is steady; 0 where she is not.
    used_s
        The longest steady record that is of use.
    coastdown_since_ns
        Stamp of the stop; None where no coastdown runs.
    probability
        Of each regime now, by its name; empty while they sleep, in steady sailing.
    """

    steady_s: float
    used_s: float
    coastdown_since_ns: int | None
    probability: Mapping[str, float] = field(default_factory=dict)

    @property
    def values(self) -> dict[str, str]:
        """The same as texts by key, the unit in the key."""
        figures = {
            'steady lead [s]': f'{self.steady_s:.0f}',
            'steady lead used at most [s]': f'{self.used_s:.0f}',
        }
        if self.coastdown_since_ns is not None:
            figures['coastdown since [ns]'] = str(self.coastdown_since_ns)
        for name, share in self.probability.items():
            figures[f'probability of {name.replace("_", " ")} [1]'] = f'{share:.2f}'
        return figures


def input_health(tally: InputTally) -> dict[str, InputHealth]:
    """
    Show the health of every input, by its name; of further instruments, of those heard.
    """
    every = {name: _health(tally, name) for name in INPUTS}
    return {name: one for name, one in every.items() if one.messages or name not in FURTHER}


def _health(tally: InputTally, name: str) -> InputHealth:
    channels = [channel for channel in Channel if channel.input == name]
    reasons = tally.reasons[channels].sum(axis=0)
    # an input has one channel, but for the two encodings of a position: take the later
    last = max(channels, key=lambda channel: int(tally.arrival_ns[channel].max()))
    known = tally.stamp_ns[last] != NEVER
    stamps, arrivals = tally.stamp_ns[last][known], tally.arrival_ns[last][known]
    newest = (int(tally.reasons[last, Reason.ACCEPTED]) - 1) % RECENT
    # after a clock was set the stamps of before are no guide to the rate
    span = int(stamps.max() - stamps.min()) if len(stamps) else 0
    return InputHealth(
        messages=int(reasons.sum()),
        used=int(reasons[Reason.ACCEPTED]),
        rejected={
            reason.name.lower(): int(reasons[reason])
            for reason in Reason
            if reason is not Reason.ACCEPTED and reasons[reason]
        },
        last_receive_ns=int(tally.arrival_ns[last, newest]) if len(stamps) else None,
        rate_hz=(len(stamps) - 1) / (span * 1e-9) if span else None,
        clock_offset_s=float(np.median(arrivals - stamps)) * 1e-9 if len(stamps) else None,
    )
