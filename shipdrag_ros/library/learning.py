# SPDX-License-Identifier: Apache-2.0
"""An effect that has no name, learnt from the coastdowns of records."""

from __future__ import annotations

from collections.abc import Sequence

from shipdrag_ros.learning.search import Learnt
from shipdrag_ros.learning.search import learn as learn_runs
from shipdrag_ros.library.diagnosing import coasts_of
from shipdrag_ros.library.record import Record
from shipdrag_ros.library.replaying import (
    Listener,
    Notes,
    WindowedRun,
    refuse_overlaps,
    refuse_two_ships,
)
from shipdrag_ros.library.resistance import records_of
from shipdrag_ros.library.wording import says_it_in_python
from shipdrag_ros.progress import Progress, silent
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.term import check_name


@says_it_in_python
def learn(
    records: Record | Sequence[Record], *, ship: Ship | None = None, name: str = 'learnt'
) -> Learnt:
    """
    Learn the effect that several runs of a ship share and the library has no name for.

    Parameters
    ----------
    records
        Of one ship; with one run nothing is written.
    ship
        With a baseline; None: the one attached to the first record.
    name
        Of the effect: small letters, digits and _.

    Returns
    -------
    Learnt
        Its `term` is None where nothing may be written, and `reason` says why;
        `term.to_yaml()` is the text of a file.

    Raises
    ------
    BagError
        If the same part of a recording is given twice, or the runs are of two ships.
    DiagnosisError
        If no coastdown is found, or the ship has no baseline.
    EffectFileError
        If the name cannot be one.

    Notes
    -----
    Source: docs/learn.md.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> record = sd.simulate(sd.Ship.example(), duration_s=600.0, lead_in_s=400.0)
    >>> print(sd.learn(record).term)
    None
    """
    parts = records_of(records)
    runs = [WindowedRun(run, None) for record in parts for run in record.runs]
    return learn_from(Notes(), runs, ship or parts[0].given, name)


def learn_from(
    listener: Listener,
    runs: Sequence[WindowedRun],
    given: Ship | None,
    name: str,
    progress: Progress = silent,
) -> Learnt:
    """
    Learn from runs that are open; what the verb and a script share.

    Parameters
    ----------
    listener
        Called with what is found on the way.
    runs
        Of one ship.
    given
        The ship; None: the one attached to the first run.
    name
        Of the effect.
    progress
        Called with each stage, how much of it is done, and of how much.
    """
    check_name(name)
    refuse_overlaps(runs)
    if given is None:
        refuse_two_ships((run, None) for run, _ in runs)
    coasts, ship, parameters = coasts_of(listener, runs, given, progress, whole=True)
    coasts = sorted(coasts, key=lambda coast: coast.window.start_ns)
    return learn_runs(coasts, ship, parameters, name=name, progress=progress)
