# SPDX-License-Identifier: Apache-2.0
"""What is wrong between log and way over ground is told from any sailing."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.signal import lfilter

from shipdrag_ros.diagnosis import SailingRecord, diagnose_sailing
from shipdrag_ros.diagnosis.legs import Left, Legs, StandingLog
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.inference.decision import Verdict
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel, Float64, in_arrival_order

PARAMETERS = Parameters()
METRES_A_DEGREE = 111_195.0
SEEDS = 8


@dataclass(frozen=True)
class Sailing:
    """
    A record to be made: what is wrong, and what is only a disturbance.

    Attributes
    ----------
    scale, radar_scale
        Relative, of the log and of the positions.
    offset_m_s
        Of the log.
    dip_m_s
        That the log reads too little about 4.5 m/s.
    current_m_s
        East, north.
    courses_deg, speeds_m_s
        Of legs of 12 minutes, taken in turn.
    place_sd_m, wander_m_s
        Noise of each position; how her speed wanders.
    """

    scale: float = 0.0
    radar_scale: float = 0.0
    offset_m_s: float = 0.0
    dip_m_s: float = 0.0
    current_m_s: tuple[float, float] = (0.0, 0.0)
    courses_deg: tuple[float, ...] = (10.0, 130.0, 250.0, 70.0, 190.0, 310.0)
    speeds_m_s: tuple[float, ...] = (3.0, 5.5, 4.0, 7.0)
    hours: float = 2.5
    place_sd_m: float = 3.0
    wander_m_s: float = 0.1
    geodetic: bool = False
    sources: tuple[Channel, ...] = (Channel.POSITION, Channel.HEADING)

    def block(self, seed: int) -> Block:
        """Sail and measure, one sample a second."""
        rng = np.random.default_rng(seed)
        time = np.arange(0.0, self.hours * 3600.0)
        leg = (time // 720.0).astype(int)
        courses = np.unwrap(np.radians(self.courses_deg))
        course = follow(courses[leg % len(courses)], 15.0)
        speed = follow(np.array(self.speeds_m_s)[leg % len(self.speeds_m_s)], 40.0)
        speed += wander(rng, time, self.wander_m_s, 60.0)
        yaw = course + wander(rng, time, 0.02, 8.0)
        leeway = 0.05 * np.sin(yaw - 1.0)  # pushed aside by a wind, up to 3 degrees
        water = [c + wander(rng, time, 0.03, 1500.0) for c in self.current_m_s]
        east = speed * np.cos(yaw + leeway) + water[0]
        north = speed * np.sin(yaw + leeway) + water[1]
        log = speed * np.cos(leeway) * (1.0 + self.scale) + self.offset_m_s
        log -= self.dip_m_s * np.exp(-(((speed - 4.5) / 0.8) ** 2))
        log += wander(rng, time, 0.04, 50.0) + rng.normal(0.0, 0.06, len(time))
        stamps = np.round(time * 1e9).astype(np.int64) + 10**18
        place = np.cumsum(np.array([east, north]).T, axis=0) * (1.0 + self.radar_scale)
        place += rng.normal(0.0, self.place_sd_m, place.shape)
        over = np.hypot(east, north) * (1.0 + self.radar_scale) + rng.normal(0.0, 0.08, len(time))
        values = {Channel.POSITION: place, Channel.HEADING: yaw, Channel.SPEED_OVER_GROUND: over}
        blocks = [Block.of(Channel.SPEED_THROUGH_WATER, stamps, log)]
        for channel in self.sources:
            value = values[channel]
            if channel is Channel.POSITION and self.geodetic:
                channel, value = Channel.POSITION_GEODETIC, degrees(place)
            blocks.append(Block.of(channel, stamps, value))
        return in_arrival_order(blocks)


def follow(target: Float64, lag_s: float) -> Float64:
    """Return a path that comes to its target with a lag."""
    keep = 1.0 - 1.0 / lag_s
    found: Float64 = lfilter([1.0 - keep], [1.0, -keep], target, zi=[keep * target[0]])[0]
    return found


def wander(rng: np.random.Generator, time: Float64, sd: float, tau_s: float) -> Float64:
    """Return a slow disturbance, Gauss-Markov of first order."""
    keep = math.exp(-1.0 / tau_s)
    drawn = rng.normal(0.0, sd, len(time))
    drawn[1:] *= math.sqrt(1.0 - keep**2)
    found: Float64 = lfilter([1.0], [1.0, -keep], drawn)
    return found


def degrees(place: Float64) -> Float64:
    """Return latitude and longitude near the equator, where both have even degrees."""
    return place[:, ::-1] / METRES_A_DEGREE


def found_in(sailing: Sailing, seed: int = 1, *, units_checked: bool = False) -> DiagnosisResult:
    """Diagnose one record."""
    return diagnose_sailing(
        [SailingRecord('sailing', sailing.block(seed), units_checked)], PARAMETERS
    )


CASES = {
    'log_scale': (Sailing(scale=-0.06, geodetic=True), 'factor', -0.06),
    'log_offset': (Sailing(offset_m_s=0.3, geodetic=True), 'offset_m_s', 0.3),
    # 0.5 m/s at 40 degrees; the first leg is sailed at 10 degrees
    'current': (
        Sailing(current_m_s=(0.383, 0.321), geodetic=True),
        'along_track_m_s',
        0.5 * math.cos(math.radians(30.0)),
    ),
}


def test_nothing_wrong_nothing_said() -> None:
    # N = 8 each, seeds 0..7: were more than 1 in 4 an alarm, none in 16 has a probability < 1 %
    for sailing in (Sailing(), Sailing(geodetic=True)):
        for seed in range(SEEDS):
            found = found_in(sailing, seed)
            assert found.verdict is Verdict.NONE
            assert found.effects == ()
            assert found.after is None


@pytest.mark.parametrize('set_s', [0.0, -3600.0])
def test_rows_that_came_late_and_a_clock_that_was_set_cost_no_diagnosis(set_s: float) -> None:
    sailing = Sailing(scale=-0.06, geodetic=True)
    sound, block = found_in(sailing), sailing.block(1)
    at = np.arange(len(block)) * 20 // len(block)  # in twenty parts of the record
    if set_s:
        after_ns = np.where(at > 9, round(set_s * 1e9), 0)
        late = replace(block, stamp_ns=block.stamp_ns + after_ns)
    else:
        parts = at < 9, at == 10, at == 9, at > 10
        late = block[np.concatenate([np.flatnonzero(part) for part in parts])]
    found = diagnose_sailing([SailingRecord('sailing', late)], PARAMETERS)
    assert [each.name for each in found.effects] == [each.name for each in sound.effects]
    sizes = [each.effects[0].parameters['factor'].value for each in (found, sound)]
    assert sizes[0] == pytest.approx(sizes[1], abs=0.01)
    said = [note for note in found.notes if note.startswith('sailing: stamps go back within it')]
    assert len(said) == 1


@pytest.mark.parametrize('name', CASES)
def test_what_is_wrong_is_named_and_nothing_else(name: str) -> None:
    # N = 8, seeds 0..7: were fewer than 1 in 2 named, 6 of 8 has a probability < 15 %; no name is
    # false, and 3 sd hold the size
    sailing, parameter, value = CASES[name]
    named = 0
    for seed in range(SEEDS):
        found = found_in(sailing, seed)
        assert found.candidates[0].names == (name,)
        if found.verdict is Verdict.NAMED:
            named += 1
            assert [effect.name for effect in found.effects] == [name]
            size = found.effects[0].parameters[parameter]
            assert abs(size.value - value) < 3.0 * size.sd
            assert size.sd < 0.05
            assert found.after is not None
            assert found.after.chi2_per_sample < found.before.chi2_per_sample
        else:
            assert found.verdict is Verdict.ONE_OF
    assert named >= 6


def test_it_says_why_it_is_a_scale_and_not_a_current() -> None:
    found = found_in(CASES['log_scale'][0])
    assert any(note.startswith('why not current: a current turns') for note in found.notes)
    assert any(note.startswith('why not log_offset: an offset is') for note in found.notes)
    assert found.baseline == 'none'
    assert found.where is not None
    assert found.where.channel == 'log'


@pytest.mark.parametrize('scale', [0.1508, 0.9438])
def test_a_log_in_another_unit_is_asked_about_and_a_scale_if_the_unit_is_right(
    scale: float,
) -> None:
    found = found_in(Sailing(scale=scale, geodetic=True))
    assert 'is the unit of one of them wrong?' in found.question
    assert (found.verdict, found.effects) == (Verdict.ONE_OF, ())
    assert found.candidates[0].names == ('log_scale',)
    checked = found_in(Sailing(scale=scale, geodetic=True), units_checked=True)
    assert (checked.verdict, checked.question) == (Verdict.NAMED, '')


def test_units_that_were_checked_in_one_record_are_asked_about_in_the_other() -> None:
    miles = Sailing(hours=1.0, scale=0.868 - 1.0, geodetic=True)
    sound = replace(miles, scale=0.0)

    def asked(*records: tuple[Sailing, bool]) -> str:
        told = [SailingRecord('s', each.block(1), checked) for each, checked in records]
        return diagnose_sailing(told, PARAMETERS).question

    assert asked((miles, False), (miles, True))
    assert not asked((miles, True), (sound, False))
    assert not asked((miles, True), (miles, True))


@pytest.mark.parametrize('seed', range(3))
def test_the_noise_of_fixes_on_one_course_is_neither_scale_nor_current(seed: int) -> None:
    steady = Sailing(courses_deg=(10.0,), speeds_m_s=(8.2,), hours=0.5, geodetic=True)
    found = found_in(replace(steady, place_sd_m=10.0, wander_m_s=0.01), seed)
    assert found.verdict is Verdict.NONE


def test_radar_may_be_wrong_where_the_positions_are_not_of_the_globe() -> None:
    found = found_in(replace(CASES['log_scale'][0], geodetic=False))
    assert found.verdict is Verdict.ONE_OF
    assert {('log_scale',), ('radar_scale',)} <= {each.names for each in found.candidates}
    assert 'a third source of speed, GNSS beside log and radar' in [
        each.measure for each in found.would_decide
    ]


@pytest.mark.parametrize(
    ('sailing', 'other'),
    [
        (Sailing(current_m_s=(0.5, 0.0), courses_deg=(0.0,)), 'log_offset'),
        (Sailing(offset_m_s=0.3, sources=(Channel.SPEED_OVER_GROUND,)), 'current'),
    ],
    ids=['one course', 'courses unknown'],
)
def test_without_turns_a_current_and_an_offset_are_not_told_apart(sailing, other):
    found = found_in(sailing)
    assert found.verdict is Verdict.ONE_OF
    assert {'current', 'log_offset'} <= {name for each in found.candidates for name in each.names}
    assert (other,) in [each.names for each in found.candidates]
    assert 'a run on the reciprocal heading' in [each.measure for each in found.would_decide]


@pytest.mark.parametrize(('lag_s', 'least'), [(5.0, 0.0), (20.0, 0.6), (30.0, 0.6)])
def test_a_log_that_lags_shows_where_the_speed_changes(lag_s: float, least: float) -> None:
    # N = 4, seeds 0..3; a filter of some seconds is no defect, and a late clock looks the same
    for seed in range(4):
        block = Sailing(geodetic=True).block(seed)
        is_log = block.channel == Channel.SPEED_THROUGH_WATER
        value = block.value.copy()
        value[is_log, 0] = follow(value[is_log, 0], lag_s)
        found = diagnose_sailing(
            [SailingRecord('sailing', replace(block, value=value))], PARAMETERS
        )
        first = found.candidates[0]
        assert first.names == ('log_lag',) if least else found.verdict is Verdict.NONE
        assert first.probability > least
        if least:
            size = first.effects[0].parameters['lag_s']
            assert abs(size.value - lag_s) < 2.0 * size.sd
            assert ('time_offset',) in [each.names for each in found.candidates]


def test_log_and_way_of_a_leg_are_means_of_the_same_motion() -> None:
    """A ship that stops, starts and turns between straight courses, without any noise."""
    time = np.arange(0.0, 1200.0)
    speed = 4.0 + 3.0 * np.sin(time / 40.0) + np.where(time > 630.0, 0.5, 0.0)
    course = np.where((time // 300.0) % 2, 0.9, 0.1)
    fine = np.arange(0.0, 1200.0, 0.01)
    way = np.interp(fine, time, speed) * np.exp(1j * np.interp(fine, time, course))
    place = np.concatenate([[0.0], np.cumsum(0.5 * (way[1:] + way[:-1])) * 0.01])[::100]
    stamps = np.round(time * 1e9).astype(np.int64)
    block = in_arrival_order(
        [
            Block.of(Channel.SPEED_THROUGH_WATER, stamps, speed),
            Block.of(Channel.POSITION, stamps, np.column_stack([place.real, place.imag])),
            Block.of(Channel.HEADING, stamps, course),
        ]
    )
    legs = Legs.of([SailingRecord('sailing', block)], PARAMETERS)
    assert legs.left_out == {Left.TURN: 6}  # on both sides of a change of course
    np.testing.assert_allclose(legs.log_m_s, legs.ground_m_s, rtol=0.0, atol=0.002)
    middle = legs.time_s + 0.5  # of the seconds whose samples are in it
    rate = 3.0 / 40.0 * np.cos(middle / 40.0)
    np.testing.assert_allclose(legs.acceleration_m_s2, rate, rtol=0.0, atol=0.02)


def test_a_fix_that_jumps_is_no_turn() -> None:
    sailing = Sailing(geodetic=True, hours=1.0, courses_deg=(10.0,))
    block = sailing.block(1)
    block = block[block.channel != Channel.HEADING]
    fixes = np.flatnonzero(block.channel == Channel.POSITION_GEODETIC)
    value = block.value.copy()
    value[fixes[10::60]] += 2000.0 / METRES_A_DEGREE
    for read in (block.value, value):
        legs = Legs.of([SailingRecord('sailing', replace(block, value=read))], PARAMETERS)
        assert Left.TURN not in legs.left_out
        assert len(legs) == 60


def test_two_at_once() -> None:
    found = found_in(Sailing(scale=-0.06, current_m_s=(0.4, 0.3), geodetic=True))
    assert [effect.name for effect in found.effects] == ['current', 'log_scale']
    # the log reads less than the way over ground where the water goes along, more against it
    by_course = next(note for note in found.notes if note.startswith('log over ground by course'))
    ratio = {name: float(read) for name, read in re.findall(r'(\w+) (\d\.\d+) \(', by_course)}
    assert ratio['north'] < 1.0 - 0.06 < ratio['south']
    assert ratio['east'] < 1.0 - 0.06 < ratio['west']


def test_a_strong_current_across_the_first_leg_is_a_current() -> None:
    # N = 2, seeds 0, 1: 1.1 m/s, of which 0.9 across, three prior sd
    for seed in range(2):
        found = found_in(Sailing(current_m_s=(0.2, 1.1), geodetic=True), seed)
        assert [effect.name for effect in found.effects] == ['current']


def test_an_error_that_bends_with_the_speed_has_no_name() -> None:
    found = found_in(Sailing(dip_m_s=0.5, speeds_m_s=(3.0, 4.5, 6.0, 7.0, 5.0)))
    assert found.verdict is Verdict.UNKNOWN
    assert found.effects == ()


def test_stops_and_dropouts_are_left_out_and_counted() -> None:
    block = CASES['log_scale'][0].block(1)
    second = (block.stamp_ns - block.stamp_ns.min()) * 1e-9
    is_log = block.channel == Channel.SPEED_THROUGH_WATER
    silent = is_log & (second > 3000.0) & (second < 3600.0)
    stopped = (second > 6000.0) & (second < 6600.0)
    moored = block.value.copy()
    moored[stopped & is_log, 0] = 0.02
    for column in range(2):
        at = stopped & (block.channel == Channel.POSITION_GEODETIC)
        moored[at, column] = moored[at, column][0]
    kept = replace(block, value=moored)[~silent]
    found = diagnose_sailing([SailingRecord('sailing', kept)], PARAMETERS)
    assert 'dropout 10' in found.notes[0]
    assert 'stop' in found.notes[0]
    assert [effect.name for effect in found.best] == ['log_scale']
    assert abs(found.best[0].parameters['factor'].value + 0.06) < 0.02


def test_records_are_taken_together() -> None:
    sailing = replace(CASES['log_scale'][0], hours=1.0)
    alone = diagnose_sailing([SailingRecord('one', sailing.block(1))], PARAMETERS)
    both = [SailingRecord(str(seed), sailing.block(seed)) for seed in (1, 2)]
    together = diagnose_sailing(both, PARAMETERS)
    assert together.verdict is Verdict.NAMED
    sd = [found.best[0].parameters['factor'].sd for found in (alone, together)]
    assert sd[1] < sd[0]


def test_the_second_of_a_kind_alone_is_diagnosed_as_the_first_would_be() -> None:
    block = CASES['log_scale'][0].block(1)
    code = block.channel.copy()
    for first in (Channel.SPEED_THROUGH_WATER, Channel.POSITION_GEODETIC):
        code[block.channel == first] = Channel[f'{first.name}_2']
    second = replace(block, channel=code)
    one, other = (
        diagnose_sailing([SailingRecord('s', each)], PARAMETERS) for each in (block, second)
    )
    assert one.verdict is Verdict.NAMED
    assert other.candidates == one.candidates
    assert other.where == one.where
    assert other.where is not None
    assert other.where.channel == 'log'


def test_a_second_log_and_other_positions_are_left_out_and_named() -> None:
    block = CASES['log_scale'][0].block(1)
    more = []
    for first in (Channel.SPEED_THROUGH_WATER, Channel.POSITION_GEODETIC):
        part = block[block.channel == first]
        # metres are only those of a radar
        second = Channel[f'{first.name.removesuffix("_GEODETIC")}_2']
        code = np.full(len(part), second, np.uint8)
        more.append(replace(part, channel=code, value=1.1 * part.value))
    one = diagnose_sailing([SailingRecord('s', block)], PARAMETERS)
    found = diagnose_sailing([SailingRecord('s', in_arrival_order([*more, block]))], PARAMETERS)
    assert found.candidates == one.candidates
    assert found.where == one.where
    notes = ' '.join(found.notes)
    assert 's: position_2 is not used beside position' in notes
    assert (
        's: speed_through_water_2 is not used beside speed_through_water, against which it reads '
        '+10.0 %'
    ) in notes


def test_the_convention_of_the_heading_turns_a_current() -> None:
    sources = (Channel.SPEED_OVER_GROUND, Channel.HEADING)
    sailing = Sailing(current_m_s=(0.383, 0.321), sources=sources)
    block = sailing.block(1)
    to_port = [
        diagnose_sailing(
            [SailingRecord('sailing', block)], replace(PARAMETERS, heading_convention=convention)
        )
        .best[0]
        .parameters['cross_track_m_s']
        .value
        for convention in ('rep103', 'compass')
    ]
    np.testing.assert_allclose(to_port[0], 0.25, rtol=0.0, atol=0.12)
    np.testing.assert_allclose(to_port[1], -to_port[0], rtol=0.0, atol=0.01)


@pytest.mark.parametrize(
    ('sailing', 'words'),
    [
        (Sailing(sources=(Channel.HEADING,)), 'with both a log and positions'),
        (Sailing(hours=0.1), 'give a longer record'),
    ],
)
def test_what_cannot_be_compared_is_refused(sailing: Sailing, words: str) -> None:
    with pytest.raises(DiagnosisError, match=words):
        found_in(sailing)


BAND_M_S = 0.6


def record(
    *, band_m_s: float = 0.0, dropped: float = 0.0, drifting: bool = False, seed: int = 1
) -> SailingRecord:
    """Sail two hours at changing speeds and courses, slower than the band for a third of it."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 7200.0)
    leg = (time // 600.0).astype(int)
    speed = np.array([0.4, 1.5, 2.5])[leg % 3] + 0.05 * np.sin(time / 100.0)
    course = np.radians(np.array([10.0, 130.0, 250.0, 310.0])[leg // 3])
    log: Float64 = speed + rng.normal(0.0, 0.03, len(time))
    velocity = np.array([speed * np.cos(course), speed * np.sin(course)]).T
    if drifting:  # with the water, the log rightly at 0
        velocity[speed < 1.0] = (0.3, 0.1)
        log[speed < 1.0] = 0.0
    log[speed < band_m_s] = 0.0
    # some minutes in ten without a reading, at any speed
    log[np.repeat(rng.random(120) < dropped, 60)] = 0.0
    place = np.cumsum(velocity, axis=0) + rng.normal(0.0, 1.0, (len(time), 2))
    stamps = np.round(time * 1e9).astype(np.int64) + 10**18
    return SailingRecord(
        'sailing',
        in_arrival_order(
            [
                Block.of(Channel.SPEED_THROUGH_WATER, stamps, log),
                Block.of(Channel.POSITION, stamps, place),
            ]
        ),
    )


def test_a_wheel_that_stands_still_has_a_dead_band() -> None:
    # N = 5, seeds 0 .. 4: the speed lies between those that are and are not read
    for seed in range(5):
        found = StandingLog.of([record(band_m_s=BAND_M_S, seed=seed)], Parameters())
        assert found is not None
        assert found.log_factor > 9.0  # odds of 1 to 50 beforehand
        assert 0.4 < found.way.unknowns[0].prior.at(found.z) < 1.5
        assert found.share > 0.95
        assert found.at_m_s.max() < BAND_M_S


@pytest.mark.parametrize('other', [{}, {'dropped': 0.3}, {'drifting': True}])
def test_other_zeros_are_no_dead_band(other: dict[str, float]) -> None:
    # N = 5, seeds 0 .. 4
    for seed in range(5):
        found = StandingLog.of([record(**other, seed=seed)], Parameters())
        assert found is None or found.log_factor < 0.0


def test_zeros_at_any_speed_are_said_and_not_named() -> None:
    found = diagnose_sailing([record(dropped=0.3)], Parameters())
    assert found.notes[0].startswith('the log reads exactly 0 in')
    assert not any('log_dead_band' in each.names for each in found.candidates)


def test_the_diagnosis_names_it_and_says_why() -> None:
    found = diagnose_sailing([record(band_m_s=BAND_M_S)], Parameters())
    assert found.verdict is Verdict.NAMED
    (effect,) = found.effects
    assert effect.name == 'log_dead_band'
    assert found.candidates[0].names == ('log_dead_band',)
    assert found.notes[0].startswith('the log reads exactly 0 in')
    assert found.where is not None
    assert found.where.channel == 'log'
    assert math.isfinite(found.before.chi2_per_sample)


def test_noise_of_the_way_over_ground_is_no_error_that_bends_with_the_speed() -> None:
    rng, records = np.random.default_rng(1), []
    time = np.arange(0.0, 3300.0)
    speed = 8.0 / (1.0 + np.maximum(time - 1800.0, 0.0) / 500.0)
    stamps = np.round(time * 1e9).astype(np.int64) + 10**18
    for name in 'abcd':  # steady for the most part: many legs of one speed, apart by noise alone
        place = np.zeros((len(time), 2))
        place[:, 0] = np.cumsum(speed)
        place += rng.normal(0.0, 10.0, place.shape)
        log = speed + rng.normal(0.0, 0.05, len(time))
        parts = [(Channel.SPEED_THROUGH_WATER, log), (Channel.POSITION, place)]
        block = in_arrival_order([Block.of(channel, stamps, value) for channel, value in parts])
        records.append(SailingRecord(name, block))
    assert diagnose_sailing(records, Parameters()).verdict is Verdict.NONE
