# SPDX-License-Identifier: Apache-2.0
"""The live estimator, and in part the final one: what they find and refuse."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from shipdrag_ros.errors import EstimationError
from shipdrag_ros.estimation import Window, estimate, estimate_final
from shipdrag_ros.estimation.record import weighted_white_sd
from shipdrag_ros.estimation.result import Estimate, ResistanceCurve
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.priors import CURRENT
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.scenario import GaussMarkov
from tests.runs import CARGO as SHIP

START_NS = 1_700_000_000_123_456_789
END_NS = START_NS + 1500 * 10**9
CURVE = tuple(item.name for item in fields(ResistanceCurve))
RUNS = 40
Estimator = Callable[[Window, Ship, Parameters], Estimate]
both = pytest.mark.parametrize('estimator', [estimate, estimate_final])


def window(block: Block, end_ns: int = END_NS) -> Window:
    return Window.from_block(block, START_NS, end_ns)


def cut(block: Block) -> Window:
    return Window.from_block(block, int(block.stamp_ns[0]), int(block.stamp_ns[-1]))


def only(block: Block, *channels: Channel) -> Block:
    return block[np.isin(block.channel, channels)]


def changed(block: Block, channel: Channel, change: Any) -> Block:
    """Replace the values of one channel; the change sees stamps [s] and values."""
    value = block.value.copy()
    rows = block.channel == channel
    value[rows] = change((block.stamp_ns[rows] - START_NS) * 1e-9, value[rows])
    return replace(block, value=value)


def with_current(block: Block, speed: float, course_rad: float = 0.7) -> Block:
    drift = speed * np.array([np.cos(course_rad), np.sin(course_rad)])
    return changed(block, Channel.POSITION, lambda t, x: x + t[:, None] * drift)


def over_ground(block: Block, *, current: float) -> Block:
    """A third input: the log of another seed, over ground."""
    log = only(block, Channel.SPEED_THROUGH_WATER)
    value = log.value.copy()
    value[:, 0] += current
    channel = np.full(len(log), Channel.SPEED_OVER_GROUND, np.uint8)
    return replace(log, value=value, channel=channel)


def error(found: Estimate, coast: Any, ship: Ship) -> Float64:
    """Error of r over the valid range, evenly in speed, in parts of the largest r."""
    curve = found.valid_curve
    speed = np.linspace(curve.speed_m_s[0], curve.speed_m_s[-1], 100)
    r = np.interp(speed, curve.speed_m_s, curve.resistance_m_s2)
    truth = coast.resistance(speed, ship)
    result: Float64 = (r - truth) / coast.resistance(8.2, ship)
    return result


def away_from(found: Estimate, coast, ship: Ship) -> Float64:
    curve = found.valid_curve
    return curve.resistance_m_s2 - coast.resistance(curve.speed_m_s, ship)


def rmse(found: Estimate, coast: Any, ship: Ship) -> float:
    return float(np.sqrt(np.mean(error(found, coast, ship) ** 2)))


def same_bits(one: Estimate, two: Estimate) -> bool:
    return all(
        getattr(one.curve, name).tobytes() == getattr(two.curve, name).tobytes() for name in CURVE
    )


def test_figures_are_those_of_the_window(coast: Any, ship: Ship) -> None:
    found = estimate(window(coast.block(500)), ship, Parameters())
    assert (found.estimator, found.order, found.orders) == ('one', None, ())
    assert (found.start_ns, found.end_ns) == (START_NS, END_NS)
    assert found.samples == {'position': 500, 'speed_through_water': 500}
    for name, noise in (('speed_through_water', 0.05), ('position', 10.0)):
        np.testing.assert_allclose(found.noise_sd[name], noise, rtol=0.12)
        track = found.tracks[name]
        np.testing.assert_allclose((track.measured - track.fitted).std(), noise, rtol=0.12)
    truth = coast.speed(1500.0)
    assert abs(found.last_speed_m_s - truth) < 4.0 * found.last_speed_sigma_m_s
    last = coast.resistance(truth, ship)
    assert abs(found.last_resistance_m_s2 - last) < 4.0 * found.last_sigma_m_s2
    curve = found.valid_curve
    assert (
        found.max_relative_sigma == curve.sigma_repeatable_m_s2.max() / curve.resistance_m_s2.max()
    )
    assert np.all(curve.sigma_m_s2 > curve.sigma_repeatable_m_s2)


@pytest.mark.parametrize('current', [-0.4, 0.25])
def test_a_current_is_found_and_taken_out(coast: Any, ship: Ship, current: float) -> None:
    # 40 runs, seeds 0..39: 1.02 %, as without current. The current is 0.22 and 0.24 of its sigma
    # off (rms), as the log reads true and sigma holds logs that do not: 0.23 +- 3.5 sd of N = 40
    found = [
        estimate(window(with_current(coast.block(500, seed=seed), current)), ship, Parameters())
        for seed in range(RUNS)
    ]
    assert np.sqrt(np.mean([rmse(one, coast, ship) ** 2 for one in found])) < 0.011
    off = np.array([(one.current_m_s - current) / one.current_sigma_m_s for one in found])
    assert 0.14 < np.sqrt(np.mean(off**2)) < 0.32


def test_a_factor_of_the_log_is_found(coast: Any, ship: Ship) -> None:
    block = changed(coast.block(500), Channel.SPEED_THROUGH_WATER, lambda t, v: v * [1.03, 1.0])
    found = estimate(window(block), ship, Parameters())
    assert any(note.startswith('the log reads +') for note in found.notes)
    assert rmse(found, coast, ship) < 0.015


def test_outliers_hardly_matter(coast: Any, ship: Ship) -> None:
    # 40 runs, seeds 0..39; 3 % of the log wrong by 1 to 3 m/s
    plain, spoilt = [], []
    for seed in range(RUNS):
        block = coast.block(500, seed=seed)
        rng = np.random.default_rng(1000 + seed)

        def spikes(t: Float64, v: Float64, rng: np.random.Generator = rng) -> Float64:
            size = rng.uniform(1.0, 3.0, len(v)) * rng.choice([-1.0, 1.0], len(v))
            return v + np.column_stack([size * (rng.random(len(v)) < 0.03), np.zeros(len(v))])

        bad = changed(block, Channel.SPEED_THROUGH_WATER, spikes)
        plain.append(rmse(estimate(window(block), ship, Parameters()), coast, ship))
        found = estimate(window(bad), ship, Parameters())
        spoilt.append(rmse(found, coast, ship))
    assert np.sqrt(np.mean(np.square(spoilt))) < 1.3 * np.sqrt(np.mean(np.square(plain)))


def test_noise_that_is_slow_widens_the_band(coast: Any, ship: Ship) -> None:
    block = coast.block(500)
    slow = np.convolve(np.random.default_rng(5).normal(size=539), np.ones(40) / 40.0, 'valid')
    colour = 0.05 / slow.std() * slow
    coloured = changed(
        block,
        Channel.SPEED_THROUGH_WATER,
        lambda t, v: v + np.column_stack([colour, np.zeros(500)]),
    )
    found = [estimate(window(one), ship, Parameters()) for one in (block, coloured)]
    middle = [np.median(one.valid_curve.sigma_repeatable_m_s2) for one in found]
    assert middle[1] > 1.5 * middle[0]


@both
@pytest.mark.parametrize(
    ('channels', 'bound', 'current'),
    [
        ((Channel.SPEED_THROUGH_WATER,), 0.02, False),
        ((Channel.POSITION,), 0.06, False),
        ((Channel.SPEED_OVER_GROUND,), 0.1, False),
        ((Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND), 0.02, True),
        ((Channel.SPEED_THROUGH_WATER, Channel.SPEED_OVER_GROUND, Channel.POSITION), 0.02, True),
    ],
)
def test_every_set_of_inputs_serves(coast, ship, channels, bound, current, estimator):
    block = with_current(coast.block(500), 0.3)
    if channels == (Channel.POSITION,):
        block = coast.block(500)
    third = over_ground(coast.block(500, seed=9), current=0.3)
    found = estimator(
        window(only(in_arrival_order([block, third]), *channels)), ship, Parameters()
    )
    assert rmse(found, coast, ship) < bound
    assert set(found.samples) == {channel.input for channel in channels}
    # of the motion over ground alone it is little more than the prior's, and in the band
    assert (found.current_m_s is None) == (channels == (Channel.SPEED_THROUGH_WATER,))
    if current:
        assert found.current_sigma_m_s is not None
        np.testing.assert_allclose(found.current_m_s, 0.3, atol=4.0 * found.current_sigma_m_s)
    through_water = Channel.SPEED_THROUGH_WATER in channels
    assert any('a current is part of the speed' in n for n in found.notes) != through_water


def test_a_short_window_takes_what_it_cannot_show_from_the_prior(coast: Any, ship: Ship) -> None:
    found = estimate(
        window(coast.block(500, position_sigma=100.0), START_NS + 60 * 10**9), ship, Parameters()
    )
    assert found.current_sigma_m_s == pytest.approx(CURRENT.sd, rel=0.1)
    assert any('± 4.7 % off' in note for note in found.notes)  # of either kind of log


@both
def test_the_same_window_gives_the_same_bits(coast: Any, ship: Ship, estimator: Estimator) -> None:
    block = coast.block(300)
    base = estimator(window(block), ship, Parameters())
    wide = np.zeros((len(block), 4))
    wide[:, ::2] = block.value
    strided = replace(block, value=wide[:, ::2])
    assert same_bits(base, estimator(window(strided), ship, Parameters()))
    late = replace(block, stamp_ns=block.stamp_ns + 10**18)
    moved = Window.from_block(late, START_NS + 10**18, END_NS + 10**18)
    assert same_bits(base, estimator(moved, ship, Parameters()))


def test_every_parameter_changes_something(coast: Any, ship: Ship) -> None:
    cut = window(coast.block(500))
    base = estimate(cut, ship, Parameters())
    for parameters in (
        Parameters(froude_min=0.1),
        Parameters(speed_sigma_m_s=0.055),
        Parameters(position_sigma_m=11.0),
    ):
        assert not same_bits(base, estimate(cut, ship, parameters))


@both
def test_what_holds_no_coastdown_is_refused(coast: Any, ship: Ship, estimator: Estimator) -> None:
    block = coast.block(500)
    few = only(coast.block(4), Channel.SPEED_THROUGH_WATER)
    with pytest.raises(
        EstimationError, match='speed_through_water 4, speed_over_ground 0, position 0; a fit'
    ):
        estimator(window(few), ship, Parameters())
    rng = np.random.default_rng(1)
    steady = changed(
        only(block, Channel.SPEED_THROUGH_WATER),
        Channel.SPEED_THROUGH_WATER,
        lambda t, v: np.column_stack([8.0 + 0.05 * rng.normal(size=500), np.zeros(500)]),
    )
    with pytest.raises(EstimationError, match='no deceleration'):
        estimator(window(steady), ship, Parameters())
    bad = changed(block, Channel.POSITION, lambda t, x: np.where(t[:, None] > 1490.0, np.nan, x))
    with pytest.raises(EstimationError, match=r'value\(s\) are not finite'):
        estimator(window(bad), ship, Parameters())


DRAG_1_M = 3e-4  # v' = -DRAG v^2


@pytest.mark.parametrize('track', ['circle', 'still', 'none'])
def test_a_track_of_something_else_costs_no_figure(track: str) -> None:
    rng = np.random.default_rng(0)
    time_s = np.arange(900.0)
    stamps = (time_s * 1e9).astype(np.int64) + 10**15
    speed = 1.0 / (1.0 / 8.2 + DRAG_1_M * time_s) + rng.normal(0.0, 0.05, 900)
    blocks = [Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed)]
    if track != 'none':
        place = rng.normal(0.0, 1e-3, (900, 2))
        if track == 'circle':
            place += 5e3 * np.c_[np.cos(time_s / 50.0), np.sin(time_s / 50.0)]
        blocks.append(Block.of(Channel.POSITION, stamps, place))
    window = cut(in_arrival_order(blocks))
    found = estimate_final(window, SHIP, Parameters())
    curve = found.valid_curve
    r = np.interp(5.0, curve.speed_m_s, curve.resistance_m_s2)
    sigma = np.interp(5.0, curve.speed_m_s, curve.sigma_m_s2)
    expected = (1.0 + float(SHIP.n_r(5.0))) * DRAG_1_M * 25.0
    if track == 'still':  # in a given window no input is doubted: the log is, and that is said
        assert any('the log reads +' in note for note in found.notes)
        return
    assert abs(r - expected) < 3.0 * sigma < 0.3 * expected


@pytest.mark.parametrize('size', [1e303, 1e150, 1e12])
@pytest.mark.parametrize('estimator', ['one', 's1_position'])
def test_positions_where_no_ship_is_are_refused(size: float, estimator: str) -> None:
    time_s = np.arange(900.0)
    stamps = (time_s * 1e9).astype(np.int64) + 10**15
    speed = 1.0 / (1.0 / 8.2 + DRAG_1_M * time_s)
    speed += np.random.default_rng(0).normal(0.0, 0.05, 900)
    place = size + np.c_[size * time_s / 900.0, 0.0 * time_s]
    log = Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed)
    track = Block.of(Channel.POSITION, stamps, place)
    alone = cut(track)
    with pytest.raises(EstimationError, match='no ship has'):
        estimate_final(alone, SHIP, Parameters(estimator=estimator))
    if estimator == 'one':
        both = in_arrival_order([log, track])
        window = cut(both)
        found = estimate_final(window, SHIP, Parameters())
        assert found.samples == {'speed_through_water': 900}


def test_a_log_that_errs_slowly_widens_the_band_and_is_said(coast, ship) -> None:
    # N = 20, seeds 0..19: r is 0.66 of its sigma off (rms); 0.22 of a run, so 0.05 of 20
    squares, said = [], 0
    for seed in range(20):
        block = coast.block(500, seed=seed)
        rows = np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)
        time_s = (block.stamp_ns[rows] - block.stamp_ns[0]) * 1e-9
        block.value[rows, 0] += GaussMarkov(0.05, 60.0).sample(time_s, np.random.default_rng(seed))
        found = estimate_final(cut(block), ship, Parameters())
        away = away_from(found, coast, ship)
        squares.append(np.mean((away / found.valid_curve.sigma_repeatable_m_s2) ** 2))
        said += any('slow disturbances learnt' in note for note in found.notes)
    assert said >= 18
    assert 0.5 < np.sqrt(np.mean(squares)) < 0.85


def test_quadratic_drag_is_found_without_noise(coast, ship) -> None:
    found = estimate_final(
        cut(coast.block(500, speed_sigma=0.0, position_sigma=0.0)), ship, Parameters()
    )
    largest = float(found.curve.resistance_m_s2.max())
    # filter, scale and offset of the log stay open: 1 % at the top
    assert np.abs(away_from(found, coast, ship)).max() < 0.015 * largest
    assert found.estimator == 'one'
    assert found.order is None


def test_a_first_reading_that_is_wrong_is_not_followed(coast, ship) -> None:
    # N = 20, seeds 0..19; five of a hundred are wrong, the first among them, which powers of the
    # speed could run up to: 2.2 % measured, 1.5 % without, over 100 % if the first is followed
    largest = float(coast.resistance(np.array(coast.speed_m_s), ship))
    squares = []
    for seed in range(20):
        block = coast.block(100, seed=seed)
        rows = np.flatnonzero(block.channel == Channel.SPEED_THROUGH_WATER)
        block.value[rows[::20], 0] += 2.4
        found = estimate_final(cut(block), ship, Parameters())
        squares.append(np.mean(away_from(found, coast, ship) ** 2))
    assert np.sqrt(np.mean(squares)) < 0.03 * largest


def test_a_late_onset_is_found_with_all_families(coast, ship) -> None:
    # the window_with starts 8 s before the stop: the averaging must settle on the onset
    for seed in range(4):
        block = coast.block(500, seed=seed)
        rng = np.random.default_rng(100 + seed)
        steady_s = np.arange(-900.0, 0.0, 3.0)
        both = in_arrival_order(
            [
                Block.of(
                    Channel.SPEED_THROUGH_WATER,
                    block.stamp_ns[0] + np.round(steady_s * 1e9).astype(np.int64),
                    coast.speed_m_s + 0.05 * rng.normal(size=len(steady_s)),
                ),
                block[block.channel == Channel.SPEED_THROUGH_WATER],
            ]
        )
        start_ns = int(block.stamp_ns[0]) - 8_000_000_000
        late = Window.from_block(
            both, start_ns, int(block.stamp_ns[-1]), before_ns=int(both.stamp_ns[0])
        )
        found = estimate_final(late, ship, Parameters())
        away = away_from(found, coast, ship)
        largest = float(found.curve.resistance_m_s2.max())
        assert np.sqrt(np.mean(away**2)) < 0.03 * largest


LAG_S, LEAD_S, PACE_S = 6.0, 1000.0, 1.0


def filtered_and_wandering(coast, seed: int) -> Block:
    """Steady, then a coastdown: a log with a filter, whose noise it colours; positions wander."""
    time_s = np.arange(-LEAD_S, 700.0, PACE_S)
    rng = np.random.default_rng(seed)
    coasting = np.maximum(time_s, 0.0)
    noise = 0.02 * np.sqrt(2.0 * LAG_S / PACE_S) * rng.standard_normal(len(time_s))
    log = np.full(len(time_s), coast.speed_m_s)
    given = coast.speed(coasting) + noise
    for i in range(1, len(time_s)):
        log[i] = log[i - 1] + PACE_S / LAG_S * (given[i] - log[i - 1])
    along = np.where(time_s < 0.0, coast.speed_m_s * time_s, coast.distance(coasting))
    along = along + GaussMarkov(1.2, 120.0).sample(time_s, rng)
    along += 0.4 * rng.standard_normal(len(time_s))
    stamps = np.round((time_s + LEAD_S) * 1e9).astype(np.int64)
    return in_arrival_order(
        [
            Block.of(Channel.SPEED_THROUGH_WATER, stamps, log),
            Block.of(Channel.POSITION, stamps, np.column_stack([along, 0.0 * along])),
        ]
    )


def test_log_and_positions_are_no_worse_than_either(coast, ship) -> None:
    # N = 12, seeds 0..11: of log, of positions, of both
    start_ns = round(LEAD_S * 1e9)
    rms = []
    for seed in range(12):
        block = filtered_and_wandering(coast, seed)
        parts = [
            block[block.channel == Channel.SPEED_THROUGH_WATER],
            block[block.channel == Channel.POSITION],
            block,
        ]
        one = []
        for part in parts:
            late = Window.from_block(part, start_ns, int(part.stamp_ns[-1]), before_ns=0)
            found = estimate_final(late, ship, Parameters())
            largest = float(found.curve.resistance_m_s2.max())
            one.append(np.sqrt(np.mean(away_from(found, coast, ship) ** 2)) / largest)
        rms.append(one)
    log, positions, both = np.sqrt(np.mean(np.square(rms), axis=0))
    assert both < 1.1 * min(log, positions)


def test_white_noise_is_told_from_a_smooth_signal() -> None:
    rng = np.random.default_rng(1)
    signal = 8.0 / (1.0 + 0.003 * np.arange(500.0)) + 0.05 * rng.standard_normal(500)
    signal[::40] += 3.0
    assert weighted_white_sd(signal, np.ones(len(signal))) == pytest.approx(0.05, rel=0.15)


def test_a_short_coast_over_few_speeds_is_fitted() -> None:
    # N = 12, seeds 0..11: 9 s in which a ferry slows by a fifth, read behind a filter of 0.3 s.
    # None fails, RMSE below 20 % of the largest r (18 % found: a log's offset is that of
    # ships), and r is 1.5 of its sigma off (rms; 0.14 is its sd).
    ferry = Ship(length_m=5.0, displaced_volume_m3=1.76)
    time_s, decay = 0.05 * np.arange(181), np.exp(-0.05 / 0.3)
    stamps = np.round(time_s * 1e9).astype(np.int64)
    squares, off = [], []
    for seed in range(12):
        slow = np.random.default_rng(seed).standard_normal(len(time_s))
        slow[1:] *= np.sqrt(1.0 - decay**2)
        for i in range(1, len(slow)):
            slow[i] += decay * slow[i - 1]
        speed = 0.13 / (1.0 + 0.13 * 0.24 * time_s)
        read = Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed + 0.003 * slow)
        curve = estimate_final(cut(read), ferry, Parameters(froude_min=0.001)).curve
        v = curve.speed_m_s
        away = curve.resistance_m_s2 - 0.24 * v**2 * (1.0 + ferry.n_r(v))
        squares.append(np.mean(away**2))
        off.append(np.mean((away / curve.sigma_repeatable_m_s2) ** 2))
    largest = 0.24 * 0.13**2 * (1.0 + float(ferry.n_r(0.13)))
    assert np.sqrt(np.mean(squares)) < 0.2 * largest
    assert 1.0 < np.sqrt(np.mean(off)) < 1.9
