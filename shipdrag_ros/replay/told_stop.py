# SPDX-License-Identifier: Apache-2.0
"""A stop of the engine that a person tells, put into the run where it was."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import datetime

import numpy as np

from shipdrag_ros.bags.run import Mark, Run, StopMark
from shipdrag_ros.display import utc
from shipdrag_ros.errors import BagError
from shipdrag_ros.samples import SECOND_NS, Block

StopTime = float | datetime
"""In s from the start of the bag, or as a time of day with its zone."""


def told_ns(run: Run, stop: StopTime) -> int:
    """
    Return when a stop was told [ns, time of arrival].

    Raises
    ------
    BagError
        If it lies outside of the bag.
    """
    span = run.span_ns
    start_ns, end_ns = (0, -1) if span is None else span
    said, at_s = (
        (f'{stop} s', stop)
        if not isinstance(stop, datetime)
        else (stop.isoformat(), stop.timestamp() - start_ns / SECOND_NS)
    )
    length_s = (end_ns - start_ns) / SECOND_NS
    if not 0.0 <= at_s <= length_s:
        raise BagError(
            f'stop at {said}: expected inside of {run.name!r}, which begins at {utc(start_ns)} '
            f'and is {max(length_s, 0.0):.3f} s long'
        )
    return start_ns + round(at_s * SECOND_NS)


def told_beside(run: Run, stop: StopTime, starts_ns: Iterable[int]) -> str:
    """
    Say where coastdowns begin, beside a stop that was told.

    Parameters
    ----------
    run, stop
        As of `told_ns`.
    starts_ns
        Of the coastdowns that were found.
    """
    told = told_ns(run, stop)
    begins = ', '.join(f'{utc(each)} ({(each - told) / SECOND_NS:+.0f} s)' for each in starts_ns)
    return (
        f'the stop that is given, {utc(told)}, is weighed by the regime filter; coastdowns begin '
        f'at: {begins or "there is none"}'
    )


def with_stop(items: Iterable[Block | Mark], at_ns: int | None) -> Iterator[Block | Mark]:
    """
    Put a stop between the samples of a run.

    Parameters
    ----------
    items
        In the order of arrival.
    at_ns
        Its time of arrival [ns].
    """
    for item in items:
        if at_ns is None or not isinstance(item, Block) or not len(item):
            yield item
            continue
        first = int(np.argmax(item.receive_ns >= at_ns)) if item.receive_ns[-1] >= at_ns else -1
        if first < 0:
            yield item
            continue
        yield item[:first]
        yield StopMark(at_ns)
        yield item[first:]
        at_ns = None
    if at_ns is not None:  # after the last sample
        yield StopMark(at_ns)
