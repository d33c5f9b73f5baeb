# SPDX-License-Identifier: Apache-2.0
"""What is heard becomes parts of the page: from bags, from a node's own words, for Signal K."""

from __future__ import annotations

import asyncio
import json
import math
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.applications import Starlette

from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.live.app import LivePage, signal_k_deltas, signal_k_units
from shipdrag_ros.live.bridge import Bridge, SpeedNow
from shipdrag_ros.live.figures import Ahead
from shipdrag_ros.live.headline import (
    Check,
    Held,
    course_check,
    depth_check,
    lead_check,
    reciprocal_check,
    rudder_check,
    shaft_check,
    wind_check,
)
from shipdrag_ros.live.outputs import ComingPath, recorded_runs
from shipdrag_ros.live.source import BagSource, NodeSource, Timeline
from shipdrag_ros.messages import EventKind, EventNote, event_message
from shipdrag_ros.messages.topics import (
    ERROR,
    OK,
    STALE,
    Health,
    NodeMessage,
    Samples,
    Status,
    health_of,
)
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import replay
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship

SHIP = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'


@pytest.fixture(scope='module')
def bags(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two short runs on opposite headings."""
    folder = tmp_path_factory.mktemp('bags')
    found = []
    for name, heading in (('out', '0'), ('back', '3.1416')):
        found.append(folder / f'{name}.mcap')
        line = ['simulate', '--ship', str(SHIP), '-o', str(found[-1]), '--speed', '8', '--seed']
        line += [str(len(found)), '--heading', heading, '--first-heading', '0']
        assert main([*line, '--lead-in', '400', '--duration', '400']) == 0
    return found


@cache
def read(bag: Path) -> tuple[Timeline, list[Any]]:
    """Read a bag; return its timeline, and what is told of coastdowns that have ended."""
    (run,) = open_runs([bag])
    ended: list[Any] = []
    timeline = Timeline(run, Ship.load(SHIP), Parameters(), ended=lambda one, _: ended.append(one))
    timeline.read()
    return timeline, ended


def timeline_of(bag: Path) -> Timeline:
    return read(bag)[0]


def play(timeline: Timeline, until_ns: int, bridge: Bridge) -> None:
    for moment in timeline.between(0, until_ns):
        for heard in moment.heard:
            bridge.hear(heard, 0.0)


def test_a_timeline_says_what_replay_says(bags: list[Path]) -> None:
    (run,) = open_runs(bags[:1])
    ship, (timeline, (found,)) = Ship.load(SHIP), read(bags[0])
    (expected,) = replay(run, ship=ship, compare=False).coastdowns
    assert (found.start_ns, found.end_ns) == (expected.start_ns, expected.end_ns)
    bridge = Bridge(ship)
    play(timeline, timeline.end_ns, bridge)
    (past,) = bridge.past
    assert past.curve is not None
    assert list(past.curve.resistance_m_s2) == list(expected.estimate.valid_curve.resistance_m_s2)
    assert past.compass_deg == pytest.approx(90.0, abs=1.0)
    figures = bridge.parts(0.0)['figures']
    assert figures['usual']['r'] * ship.mass_kg == pytest.approx(
        float(ship.resistance_n(figures['usual']['speed_m_s'])), rel=0.15
    )
    assert figures['usual']['over_clean'] == pytest.approx(0.0, abs=0.15)


def settled(source: BagSource, now_s: float) -> float:
    """Play a bag to its end, and say at what time of the caller that was."""
    end_s = time.monotonic() + 120.0
    while source.player()['playing']:
        assert time.monotonic() < end_s
        source.advance(now_s)
        now_s += 1.0
        time.sleep(0.005)
    return now_s


def test_two_bags_make_a_pair_and_seeking_back_shows_what_was(bags: list[Path]) -> None:
    source = BagSource(open_runs(bags), ship=None, speed=100.0)
    try:
        now_s = settled(source, 0.0)
        parts = source.bridge.parts(now_s)
        # made as at one time: a second decides which is the earlier
        assert sorted(run['heading_deg'] > 180.0 for run in parts['past']) == [False, True]
        assert parts['headline']['action'].startswith('Both runs of the pair are made')
        start_s = source.player()['start_s']
        source.control('seek', start_s + 300.0)
        assert source.advance(now_s)  # the picture jumps
        assert source.bridge.parts(now_s)['headline']['text'] == 'STEADY 4 of 10 min'
        source.control('seek', start_s + 600.0)
        source.advance(now_s)
        there = source.bridge.parts(now_s)
        assert there['headline']['text'].startswith('COASTDOWN 3:')
        source.control('seek', start_s + 700.0)
        source.control('seek', start_s + 600.0)
        source.advance(now_s)
        again = source.bridge.parts(now_s)
        assert {name: part for name, part in again.items() if name != 'verdict'} == {
            name: part for name, part in there.items() if name != 'verdict'
        }
        source.control('seek', float(source.player()['end_s']))  # the right end of the slider
        source.advance(now_s)
        assert not source.bridge.parts(now_s)['headline']['text'].startswith('COASTDOWN')
        for action, value in (('speed', 0.0), ('speed', math.nan), ('bag', 2), ('dance', 1.0)):
            with pytest.raises(ShipdragError, match='play, pause, speed'):
                source.control(action, value)
    finally:
        source.close()


def test_deltas_are_what_signal_k_asks_for(bags: list[Path]) -> None:
    timeline, bridge = timeline_of(bags[0]), Bridge(Ship.load(SHIP))
    assert signal_k_deltas(Bridge(), 0.0) == []
    play(timeline, timeline.end_ns, bridge)
    found = signal_k_deltas(bridge, 0.0)
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    values = {}
    for delta in found:
        assert delta['context'] == 'vessels.self'
        (update,) = delta['updates']
        assert update['timestamp'].endswith('Z')
        values |= {each['path']: each['value'] for each in update['values']}
    told = {path for path in values if not path.startswith('notifications.')}
    (meta,) = signal_k_units()['updates']
    assert told == {each['path'] for each in meta['meta']}
    assert values['performance.shipdrag.resistance'] > 1e5
    note = values['notifications.performance.shipdrag']
    assert note['state'] in ('nominal', 'normal', 'alert', 'warn', 'alarm', 'emergency')


def test_a_node_is_told_from_other_statuses_by_what_it_says() -> None:
    class Raw:
        def __init__(self, name: str, *keys: str) -> None:
            self.name, self.level, self.message = name, b'\x02', 'no'
            self.values = [type('Pair', (), {'key': key, 'value': '1'}) for key in keys]

    found = health_of(
        [
            Raw('driver: state', 'lifecycle'),
            Raw('ns/any name: state', 'lifecycle', 'monitor'),
            Raw('ns/any name: input depth', 'rate [Hz]'),
        ]
    )
    (health,) = found
    assert [each.part for each in health.statuses] == ['state', 'input depth']
    assert health.inputs[0].input == 'depth'
    assert health.inputs[0].number('rate') == 1.0
    assert health.inputs[0].level == ERROR


def test_trouble_of_the_node_is_the_headline_and_rejections_are_listed() -> None:
    bridge = Bridge()
    values = {'lifecycle': 'active', 'monitor': 'waiting'}
    state = Status('n', 'state', ERROR, 'no data: nothing on any of a, b', values)
    values_of = {'rejected nan': '3', 'rejected late': '0', 'rate [Hz]': '2', 'age [s]': '0.5'}
    values_of |= {'rejected absurd': '9' * 400, 'rejected frozen': '²'}  # of a peer
    heading = Status('n', 'input heading', 1, 'frozen', values_of)
    bridge.hear(Health((state, heading)), 10.0)
    parts = bridge.parts(11.0)
    assert parts['headline']['text'] == 'NO SPEED'
    assert parts['inputs'][0]['rejected'] == {'nan': 3}
    assert [parts['inputs'][0][name] for name in ('level', 'rate_hz', 'age_s')] == [1, 2.0, 0.5]

    later = bridge.parts(20.0)
    assert later['headline']['text'].startswith('NODE SILENT')
    assert [later['inputs'][0][name] for name in ('level', 'rate_hz', 'age_s')] == [3, None, 10.5]
    assert later['inputs'][0]['text'] == 'not known, the node is silent; its last word: frozen'


def test_what_nmea_does_not_use_stands_beside_the_inputs() -> None:
    bridge = Bridge()
    state = Status('n', 'state', OK, '', {'lifecycle': 'active', 'monitor': 'steady'})
    nmea = Status('n', 'nmea udp://127.0.0.1:10110', OK, 'depth is not used: set x', {})
    bridge.hear(Health((state, nmea)), 10.0)
    (row,) = bridge.parts(11.0)['inputs']
    assert row['name'] == nmea.part
    assert row['text'] == nmea.message


def test_the_steady_lead_is_kept_while_she_may_have_stopped() -> None:
    bridge = Bridge()
    for monitor, lead_s in (('steady', '688'), ('candidate', '0')):
        values = {'lifecycle': 'active', 'monitor': monitor, 'steady lead [s]': lead_s}
        values |= {'steady lead used at most [s]': '1800'}
        bridge.hear(Health((Status('n', 'state', OK, '', values),)), 10.0)
    lead, *_ = bridge.parts(11.0)['checks']
    assert lead['text'] == '11:28, at least 10:00'


def test_an_estimate_that_still_waits_is_one_line_of_the_log(bags: list[Path]) -> None:
    timeline = timeline_of(bags[0])
    bridge = Bridge(Ship.load(SHIP))
    play(timeline, timeline.end_ns, bridge)
    texts = [text for _, text in bridge.parts(0.0)['notes']]
    assert sum('first figure waits' in text for text in texts) <= 1


def test_the_rest_of_the_glide_is_shown_and_then_compared(bags: list[Path]) -> None:
    timeline = timeline_of(bags[0])
    bridge = Bridge(Ship.load(SHIP))
    play(timeline, timeline.start_ns + 300 * 10**9, bridge)
    before = bridge.parts(0.0)
    assert before['forecast'] is None
    assert before['if_stopped']['hull'] == 'the clean hull of the ship file'
    time_s, low_s, high_s = before['if_stopped']['time_s']
    assert 0.0 < low_s < time_s < (high_s or math.inf)
    assert before['track'] is None
    bridge = Bridge(Ship.load(SHIP))
    play(timeline, timeline.end_ns - 30 * 10**9, bridge)
    during = bridge.parts(0.0)
    assert during['if_stopped'] is None
    coming, track = during['forecast'], during['track']
    assert track['was'][-1] == [0.0, 0.0]
    assert track['was'][0][0] < -1000.0  # she sails east
    low, mark, high = (track['mark'][i][0] for i in (1, 0, 2))
    assert 0.0 < low < mark < high
    assert mark == pytest.approx(coming['way_m'], abs=60.0)
    time_s, low_s, high_s = coming['time_s']
    assert 0.0 < low_s < time_s < (high_s or math.inf)
    assert coming['rows'][0][0] == 0.0
    assert coming['way_m'] < time_s * coming['rows'][0][1]
    bridge = Bridge(Ship.load(SHIP))
    play(timeline, timeline.end_ns, bridge)
    checked = bridge.parts(0.0)['forecast']
    assert checked['withdrawn'] == 'the record ended'
    assert bridge.parts(0.0)['track']['over']
    foretold_s, low_s, high_s = checked['foretold_s']
    assert low_s < checked['was_s'] < high_s
    assert 100.0 < checked['was_s'] < 300.0
    assert low_s < foretold_s < high_s


def test_why_it_is_not_said_what_a_stop_would_do() -> None:
    assert Bridge().parts(0.0)['if_stopped'] == {'why': 'the ship is not known yet'}
    bridge = Bridge(Ship.load(SHIP))
    assert bridge.parts(0.0)['if_stopped'] == {'why': 'no speed is read'}
    stamps = 10**18 + np.arange(60) * 10**9
    at_anchor = Block.of(Channel.SPEED_THROUGH_WATER, stamps, np.full(60, 0.1))
    bridge.hear(Samples(at_anchor), 0.0)
    assert 'makes no way' in bridge.parts(1.0)['if_stopped']['why']


@pytest.mark.parametrize('first_m_s', [None, 3.0])
def test_where_the_first_log_is_silent_the_second_shows_the_speed(first_m_s: float | None) -> None:
    bridge = Bridge(Ship.load(SHIP))
    stamps = 10**18 + np.arange(200) * 10**9
    if first_m_s is not None:
        log = Block.of(Channel.SPEED_THROUGH_WATER, stamps[:90], np.full(90, first_m_s))
        bridge.hear(Samples(log), 0.0)
    second = Block.of(Channel.SPEED_THROUGH_WATER_2, stamps, np.full(200, 7.0))
    bridge.hear(Samples(second), 0.0)
    of_first = Status('n', 'input speed_through_water', STALE, 'silent', {'age [s]': '110'})
    of_second = Status('n', 'input speed_through_water_2', OK, '', {'age [s]': '0.5'})
    bridge.hear(Health((of_first, of_second)), 10.0)
    assert bridge.speed(11.0) == SpeedNow(7.0, 'through water', 1.5)
    assert 'time_s' in bridge.parts(11.0)['if_stopped']


def test_where_time_goes_back_the_course_and_the_page_are_of_the_new_time() -> None:
    source = NodeSource(Ship.load(SHIP))
    page = LivePage(source)
    for start_s, yaw in ((2_000_000, 0.0), (1_000_000, 1.0)):
        stamps = (start_s + np.arange(60)) * 10**9
        source.hear(Samples(Block.of(Channel.SPEED_THROUGH_WATER, stamps, np.full(60, 5.0))))
        source.hear(Samples(Block.of(Channel.HEADING, stamps, np.full(60, yaw))))
        page.tick()
    (course,) = [each for each in source.bridge.parts(0.0)['checks'] if each['name'] == 'Course']
    assert course['text'].startswith('0° ')
    _, data = page.frames.after(page.frames.number - 1)
    assert data.startswith(b'event: whole')


@pytest.mark.parametrize('of_first_s', [0, 40, 200])
def test_the_map_shows_one_antenna_the_first_that_still_speaks(of_first_s: int) -> None:
    ahead = Ahead()
    stamps = 10**18 + np.arange(200) * 10**9
    along = np.column_stack([np.arange(200.0), np.zeros(200)])
    part = slice(0, of_first_s)
    ahead.add(Block.of(Channel.POSITION, stamps[part], along[part]))
    ahead.add(Block.of(Channel.POSITION_2, stamps, along + np.array([0.0, 500.0])))
    aside = 0.0 if of_first_s == 200 else 500.0
    path = ComingPath(
        int(stamps[-1]), np.array([0.0, 9.0]), np.array([[199, aside], [208, aside]])
    )
    ahead.take_path(path, int(stamps[0]))
    assert ahead.track is not None
    was = np.array(ahead.track['was'])
    assert was[0] == pytest.approx([-199.0, 0.0])
    assert np.ptp(was[:, 1]) < 1.0


def test_the_last_run_is_the_hull_that_is_known(bags: list[Path]) -> None:
    timeline = timeline_of(bags[0])
    bridge = Bridge(Ship.load(SHIP))
    play(timeline, timeline.end_ns, bridge)
    later = Bridge(Ship.load(SHIP))
    day_ns = 86400 * 10**9
    (past,) = bridge.past
    later.add_past(replace(past, start_ns=past.start_ns - day_ns, end_ns=past.end_ns - day_ns))
    ahead = timeline_of(bags[1])
    play(ahead, ahead.start_ns + 300 * 10**9, later)
    assert later.parts(0.0)['if_stopped']['hull'].startswith('the coastdown of ')


def test_bytes_that_are_none_of_the_outputs_are_said_once_and_change_nothing_else() -> None:
    bridge = Bridge(Ship.load(SHIP))
    before = bridge.parts(0.0)
    outputs = ('speed', 'resistance', 'resistance_curve', 'events', 'diagnosis', 'forecast_path')
    for name in outputs:
        bridge.hear(NodeMessage(name, b'\x00\x01'), 0.0)
    after = bridge.parts(0.0)
    assert len(after['notes']) == 6
    assert {**after, 'notes': []} == before


@pytest.mark.parametrize(
    ('check', 'held', 'shown'),
    [
        (lead_check(599.0, 600.0), Held.WAIT, '9:59 of 10:00'),
        (lead_check(600.0, 600.0), Held.YES, ''),
        (lead_check(None, None), Held.UNKNOWN, ''),
        (
            wind_check((-8.0, 0.0), 8.0),
            Held.YES,
            '0 kn true, at most 10 kn',
        ),  # calm
        (wind_check((-8.0, 6.0), 8.0), Held.NO, '12 kn true, over 10 kn'),
        (wind_check(None, 8.0), Held.UNKNOWN, ''),
        (depth_check(42.0, 5.0, Ship.load(SHIP)), Held.YES, ''),
        (
            depth_check(40.0, 5.0, Ship.load(SHIP)),
            Held.NO,
            '40 m, less than 41 m',
        ),  # 3 sqrt(B T)
        (depth_check(20.0, 8.0, None), Held.YES, ''),  # 2.75 v^2 / g = 17.9 m
        (depth_check(None, 8.0, None), Held.UNKNOWN, ''),
        (rudder_check(math.radians(-4.0)), Held.YES, ''),
        (shaft_check(None), Held.UNKNOWN, 'see that it is not astern'),
        (shaft_check(-0.001), Held.YES, '0 rpm mean of the last minute'),  # no sign
        (shaft_check(2.0), Held.YES, ''),
        (shaft_check(-2.0), Held.NO, ''),
        (rudder_check(math.radians(-6.0)), Held.NO, ''),
        (course_check(math.radians(359.0), coasting=True), Held.YES, ''),
        (course_check(math.radians(-30.0), coasting=True), Held.NO, ''),
        (reciprocal_check(270.0, paired=False), Held.WAIT, ''),
        (reciprocal_check(270.0, paired=False, coasting=True), Held.WAIT, ''),
        (reciprocal_check(None, paired=True), Held.YES, ''),
    ],
)
def test_the_checklist_says_what_holds_and_what_it_compares(
    check: Check, held: Held, shown: str
) -> None:
    assert check.held is held
    assert check.text
    assert check.text == (shown or check.text)


def test_a_folder_without_recorded_coastdowns_says_so_for_each_bag(bags, tmp_path):
    (tmp_path / 'broken.mcap').write_bytes(b'no bag')
    (tmp_path / 'out.mcap').write_bytes(bags[0].read_bytes())
    found = list(recorded_runs(tmp_path))
    assert len(found) == 2
    assert {str(each).partition(':')[0] for each in found} == {'broken.mcap', 'out.mcap'}
    with pytest.raises(ShipdragError, match='is no folder'):
        list(recorded_runs(tmp_path / 'out.mcap'))


def test_a_folder_that_the_node_has_yet_to_make_is_told(tmp_path: Path) -> None:
    (told,) = recorded_runs(tmp_path / 'records')
    assert isinstance(told, str)
    assert 'records: there is no such folder so far' in told


def test_what_a_peer_says_in_the_name_of_the_node_stops_no_page() -> None:
    """A coastdown without its beginning, and figures that are none."""
    payload = event_message(EventNote(EventKind.ONSET, 5, 'a coastdown began', {})).payload
    values = {'lifecycle': 'active', 'monitor': 'coastdown'}
    values |= dict.fromkeys(('coastdown since [ns]', 'steady lead [s]'), 'inf')
    bridge = Bridge()
    for _ in range(3):
        bridge.hear(NodeMessage('events', payload), 0.0)
        bridge.hear(Health((Status('node', 'state', 0, '', values),)), 0.0)
    said = str(bridge.parts(1.0)['notes'])
    assert said.count('events brings what is not understood (KeyError') == 1


@pytest.mark.parametrize('kind', [EventKind.ONSET, EventKind.COASTDOWN])
@pytest.mark.parametrize('time', ['9' * 400, '-5', str(2**63)])
def test_a_time_outside_the_epoch_stops_no_page(kind: EventKind, time: str) -> None:
    note = EventNote(kind, 5, 'of a peer', {'start_ns': time, 'end_ns': time})
    bridge = Bridge()
    bridge.hear(Samples(Block.of(Channel.SPEED_THROUGH_WATER, np.array([10**18]), [5.0])), 0.0)
    bridge.hear(NodeMessage('events', event_message(note).payload), 0.0)
    assert 'no time since the epoch' in str(bridge.parts(1.0)['notes'])
    assert not bridge.past


def test_a_coastdown_of_a_peer_with_a_heading_that_is_none_is_not_taken() -> None:
    note = EventNote(EventKind.COASTDOWN, 5, 'a coastdown has ended', {'heading_rad': 'nan'})
    bridge = Bridge()
    bridge.hear(NodeMessage('events', event_message(note).payload), 0.0)
    assert 'ValueError: heading_rad is nan' in str(bridge.parts(1.0)['notes'])
    assert not bridge.past


def test_a_picture_that_cannot_be_made_is_said_on_the_page_until_it_can() -> None:
    class Failing(NodeSource):
        fails = True

        def player(self) -> Any:
            if self.fails:
                raise RuntimeError('out of order')
            return super().player()

    source = Failing(None)
    page = LivePage(source)

    def headline() -> str:
        _, data = page.frames.after(None)
        body = data.decode().partition('data: ')[2]
        return str(json.loads(body).get('headline'))

    async def watch() -> None:
        async with page._lifespan(Starlette()):
            for said, fails in ((True, False), (False, False)):
                end_s = time.monotonic() + 60.0
                while ('PAGE HAS FAILED' in headline()) != said:
                    assert time.monotonic() < end_s
                    await asyncio.sleep(0.05)
                assert not said or 'RuntimeError: out of order' in headline()
                source.fails = fails

    with ThreadPoolExecutor(1) as alone:  # a browser of other tests may have a loop in this one
        alone.submit(asyncio.run, watch()).result()
