# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros.coastdown.bins import (
    COUNT,
    PER_SECOND,
    TIME,
    Bins,
    add,
    close,
    displacement,
    line,
    mean_place,
    mean_speeds,
    mean_turning,
    span,
)
from shipdrag_ros.samples import Channel

SECOND_NS = 1_000_000_000
FIRST = 1_700_000_000
LOG = int(Channel.SPEED_THROUGH_WATER)
WIDTH = 60


def speeds(bins: Bins, source: int, first: int, last: int):
    """Return times [s], from the beginning of bin `last`, and speeds [m/s]."""
    totals = bins.speeds[source]
    before, newest = span(bins, source, last, last - first + 1)
    each = np.diff(totals[np.arange(before, newest + 1) & (len(totals) - 1)], axis=0)
    there = each[:, COUNT] != 0
    time = (each[there, TIME] - last * PER_SECOND) / PER_SECOND
    speed = mean_speeds(bins, source, np.arange(before, newest + 1))[1]
    return time, speed[there]


def binned(channel: int, time_s, a, b=None, *, size: int = 1000) -> Bins:
    """Put samples into bins, the last bin left open."""
    bins = Bins.fresh(size)
    b = np.zeros(len(time_s)) if b is None else b
    for t, x, y in zip(time_s, a, b):
        stamp = FIRST * SECOND_NS + round(t * 1e9)
        number = stamp // SECOND_NS
        if bins.samples[channel] and number > bins.filling[channel]:
            close(bins, channel, WIDTH)
        add(bins, channel, number, stamp, float(x), float(y))
    return bins


def test_a_bin_is_the_mean_of_its_second() -> None:
    bins = binned(LOG, [0.0, 0.5, 0.9, 1.2, 2.5], [1.0, 2.0, 6.0, 4.0, 9.0])
    time, speed = speeds(bins, LOG, FIRST, FIRST + 1)
    np.testing.assert_allclose(speed, [3.0, 4.0], rtol=1e-15)
    # kept in whole milliseconds and millionths
    np.testing.assert_allclose(time, [-1.0 + 1.4 / 3.0, 0.2], atol=5e-4)


@settings(max_examples=40, deadline=None)
@given(
    before=st.lists(st.floats(-40.0, 40.0), max_size=300),
    gap=st.integers(1, 400),
    after=st.lists(st.floats(-40.0, 40.0), min_size=WIDTH, max_size=2 * WIDTH),
)
def test_a_line_knows_nothing_of_what_was_before_it(before, gap: int, after) -> None:
    time = np.concatenate([np.arange(len(before)), len(before) + gap + np.arange(len(after) + 1)])
    speed = np.array([*before, *after, 0.0])
    whole = binned(LOG, time, speed, size=150)
    part = binned(LOG, time[len(before) :], speed[len(before) :], size=150)
    last = FIRST + len(before) + gap + len(after) - 1
    assert line(whole, LOG, last, WIDTH) == line(part, LOG, last, WIDTH)


@settings(max_examples=40, deadline=None)
@given(there=st.sets(st.integers(0, WIDTH - 1), min_size=4), seed=st.integers(0, 1000))
def test_a_line_through_what_is_there(there, seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.array([*sorted(there), WIDTH]) + rng.uniform(0.0, 0.99, len(there) + 1)
    bins = binned(LOG, time, rng.uniform(0.0, 20.0, len(time)))
    last = FIRST + WIDTH - 1
    slope, level, count = line(bins, LOG, last, WIDTH)
    t, v = speeds(bins, LOG, FIRST, last)
    assert count == len(t) == len(there)
    assert np.isnan(slope) == (1.5 * (t[-1] - t[0]) < WIDTH - 1)
    if not np.isnan(slope):
        expected = np.polyfit(t, v, 1)
        np.testing.assert_allclose(slope, expected[0], rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(level, np.polyval(expected, t[-1]), rtol=1e-9, atol=1e-9)


def test_the_longest_line_does_not_overflow() -> None:
    # a slope window at its upper bound, the speed from one end of its range to the other
    time = np.arange(4802.0)
    bins = binned(LOG, time, np.linspace(-40.0, 40.0, len(time)), size=6000)
    slope, level, _ = line(bins, LOG, FIRST + 4800, 4800)
    np.testing.assert_allclose(slope, 80.0 / 4801.0, rtol=1e-6)
    np.testing.assert_allclose(level, 40.0 - 80.0 / 4801.0, rtol=1e-6)


def test_a_line_reaches_back_over_a_gap() -> None:
    times = np.delete(np.arange(200.0), np.arange(80, 130))
    bins = binned(LOG, times, 0.1 * times)
    slope, level, count = line(bins, LOG, FIRST + 160, 60)
    assert count == 70
    np.testing.assert_allclose([slope, level], [0.1, 16.0], rtol=1e-6)
    np.testing.assert_allclose(line(bins, LOG, FIRST + 129, 60)[0], 0.1, rtol=1e-6)


def test_old_bins_are_overwritten_and_not_mistaken_for_new_ones() -> None:
    bins = binned(LOG, np.arange(100.0), 0.1 * np.arange(100.0), size=63)
    assert len(speeds(bins, LOG, FIRST, FIRST + 98)[1]) == 63
    assert line(bins, LOG, FIRST + 30, 20)[2] == 0


@pytest.mark.parametrize('channel', [Channel.POSITION, Channel.POSITION_GEODETIC])
def test_speed_of_a_track(channel: Channel) -> None:
    time = np.arange(0.0, 200.0, 0.5)
    east, north = 3.0 * time, 4.0 * time
    if channel is Channel.POSITION:
        bins = binned(int(channel), time, east, north)
    else:
        # across the date line
        latitude = 60.0 + np.degrees(north / 6_371_008.8)
        longitude = 179.999 + np.degrees(east / 6_371_008.8 / np.cos(np.radians(60.0)))
        longitude = (longitude + 180.0) % 360.0 - 180.0
        assert longitude.min() < 0.0 < longitude.max()
        bins = binned(int(channel), time, latitude, longitude)
    t, v = speeds(bins, int(channel), FIRST + 50, FIRST + 150)
    np.testing.assert_allclose(v, 5.0, rtol=1e-4)
    # the mean of 20 s of positions is behind the bin by half of that
    np.testing.assert_allclose(t[-1], 0.25 - 9.5, atol=1e-9)
    _, way_east, way_north = displacement(bins, int(channel), FIRST + 150, 10)
    np.testing.assert_allclose([way_east, way_north], [30.0, 40.0], rtol=1e-3)


def test_a_track_faster_than_any_ship_has_no_speed() -> None:
    time = np.arange(0.0, 200.0)
    east = 5.0 * time + np.where(time >= 100.0, 1000.0, 0.0)
    bins = binned(int(Channel.POSITION), time, east, 0.0 * time)
    _, v = speeds(bins, int(Channel.POSITION), FIRST + 50, FIRST + 150)
    assert v.max() < 40.0
    assert 80 <= len(v) < 101


def test_headings_are_averaged_on_the_circle() -> None:
    bins = binned(int(Channel.HEADING), np.arange(10.0), np.pi + 0.1 * (-1.0) ** np.arange(10))
    _, cosine, sine, count = mean_place(bins, int(Channel.HEADING), FIRST + 7, 4)
    assert count == 4
    np.testing.assert_allclose(abs(np.arctan2(sine, cosine)), np.pi, rtol=1e-12)


def test_a_shaft_that_turns_astern_keeps_its_sign() -> None:
    bins = binned(int(Channel.SHAFT), np.arange(10.0), np.full(10, -3.0))
    turning, count = mean_turning(bins, int(Channel.SHAFT), FIRST + 8, 4)
    assert (turning, count) == (-3.0, 4)
