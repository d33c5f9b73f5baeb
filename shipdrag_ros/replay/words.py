# SPDX-License-Identifier: Apache-2.0
"""What bags gave, in sentences, the same in the terminal and on the page."""

from __future__ import annotations

from shipdrag_ros import __version__
from shipdrag_ros.coastdown.events import EndedCoastdown, Regimes
from shipdrag_ros.display import duration, plus_minus
from shipdrag_ros.estimation.reciprocal import Combined
from shipdrag_ros.replay import Recorded
from shipdrag_ros.ship import Ship

_ROUNDING = 1e-6  # of a figure; what is larger has another cause


def explained(regimes: Regimes) -> str:
    """
    Say how well the model of what she did explains the record, beside those it was learnt on.
    """
    return f'as well as {regimes.explained:.0%} of those that it was learnt on'


def recorded_sentence(recorded: Recorded) -> str:
    """
    Say whether the replayed outputs are those in the bag.
    """
    if not recorded.compared:
        return (
            'No outputs of the bag were compared: it holds none, or was replayed with another '
            'ship file, other parameters, a window or a stop.'
        )
    if recorded.identical == recorded.compared:
        return f'All {recorded.compared} outputs in the bag are identical to the replayed ones.'
    if recorded.largest_difference < _ROUNDING:
        size = (
            f'no figure differs by more than {recorded.largest_difference:.1g} of its value, '
            'which is the rounding of another machine or library'
        )
    else:
        size = f'first difference: {recorded.first_difference}'
    if recorded.by not in (None, __version__):
        size = (
            f'version {recorded.by} recorded it and this is {__version__}: the estimates differ '
            f'by {recorded.largest_difference_sigma:.2g} standard deviations at most. The {size}'
        )
    return (
        f'{recorded.identical} of {recorded.compared} outputs in the bag are identical to the '
        f'replayed ones; {size}.'
    )


def no_coastdown_sentence(steady_lead_s: float | None, dismissed: int, why: str = '') -> str:
    """
    Say that no coastdown was found, and what was looked at.

    Parameters
    ----------
    steady_lead_s
        The longest that the ship was steady [s]; None where that was not looked for.
    dismissed
        How many stretches were looked at and dismissed.
    why
        What the speed did instead, where nothing was dismissed.
    """
    known = [] if steady_lead_s is None else [f'longest steady sailing {duration(steady_lead_s)}']
    if dismissed:
        stretches = 'one stretch was' if dismissed == 1 else f'{dismissed} stretches were'
        known.append(f'{stretches} looked at and dismissed, see below')
    else:
        known.append(why or 'nothing in it looked like one')
    return f'No coastdown found: {"; ".join(known)}.'


def summary(coastdown: EndedCoastdown, ship: Ship | None = None) -> tuple[str, ...]:
    """
    Say what a coastdown gave, or why it gave nothing.

    Parameters
    ----------
    coastdown
    ship
        For force, power and the clean hull; None: without them.
    """
    if coastdown.estimate is None:
        return (f'No resistance could be estimated: {coastdown.failure or "no reason given"}.',)
    return coastdown.estimate.summary(ship)


def combined_notes(combined: Combined) -> tuple[str, ...]:
    """
    Say what several coastdowns together can and cannot show, a sentence each.
    """
    if combined.current_m_s is None or combined.current_sigma_m_s is None:
        current = (
            'These runs do not show a current: none is taken out. Runs on opposite headings would.'
        )
    else:
        value = plus_minus(combined.current_m_s, 2.0 * combined.current_sigma_m_s)
        current = (
            f'The current along the heading of the first run is {value} m/s (two standard '
            'deviations); it is taken out.'
        )
    return (
        current,
        'Run to run is the standard deviation of one run about the mean of all; where it is '
        'larger than the runs themselves state, sigma is widened.',
    )
