# SPDX-License-Identifier: Apache-2.0
"""Compiling in a thread, while the node hears and answers."""

from __future__ import annotations

import json
import sys
import threading
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from shipdrag_ros.bags import open_runs
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.events import EndedCoastdown
from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.document import document
from shipdrag_ros.diagnosis.words import sentence
from shipdrag_ros.display import json_text
from shipdrag_ros.estimation import Window
from shipdrag_ros.messages import types
from shipdrag_ros.messages.topics import AHEAD, OK
from shipdrag_ros.node import background as compiling_module
from shipdrag_ros.node.background import (
    COMPILER,
    Compiling,
    Diagnosing,
    DiagnosisState,
    DiagnosisStatus,
    leave_if_compiling,
)
from shipdrag_ros.node.health import diagnosis_status
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import coast_windows, replay
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import STANDARD_INPUTS, Scenario, sense, simulate, standard_sensors
from shipdrag_ros.simulation.effects import parse
from tests.node.conftest import values
from tests.recorded import rows


def test_compiling_is_never_waited_for_and_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()  # or it may be over before it is looked at
    monkeypatch.setattr(compiling_module, 'warm', lambda parameters: go_on.wait(240.0))
    compiling = Compiling(Parameters())
    assert not compiling.done()
    assert compiling.seconds == 0.0
    compiling.begin()
    compiling.begin()  # once only
    running = [thread for thread in threading.enumerate() if thread.name == COMPILER]
    assert [thread.daemon for thread in running] == [True]  # or the process could not end
    assert not compiling.done()
    go_on.set()
    running[0].join(240.0)
    assert compiling.done()
    assert compiling.failure == ''
    assert compiling.seconds > 0.0
    leave_if_compiling(1)  # and goes on, as nothing compiles


SHIP_FILE = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'
LEAD_IN_S, COAST_S = 660.0, 660.0
SETTINGS = {'steady_s': 600.0, 'slope_window_s': 30.0, 'data_stop_s': 20.0, 'update_s': 30.0}
PARAMETERS = Parameters.from_mapping(SETTINGS, subject='test')
SHIP = Ship.load(SHIP_FILE)
TOPIC = '/coastdown_node/diagnosis'
SPEED = 120.0  # times as fast as life
WITHIN_S = 400.0  # the first diagnosis of a machine compiles


@cache
def record(*effects: str) -> Block:
    """A coastdown, and a heading that goes on after the speeds have ceased."""
    scenario = Scenario(speed_m_s=8.2, lead_in_s=LEAD_IN_S, duration_s=COAST_S)
    truth = simulate(SHIP, scenario, effects=[parse(text) for text in effects])
    block = sense(truth, standard_sensors(rate_hz=1.0, inputs=STANDARD_INPUTS), seed=1)
    silent_ns = int(block.receive_ns[0]) + round((LEAD_IN_S + COAST_S - 60.0) * 1e9)
    return block[(block.receive_ns < silent_ns) | (block.channel == Channel.HEADING)]


@cache
def a_coastdown() -> tuple[EndedCoastdown, Window]:
    monitor = Monitor(SHIP, PARAMETERS)
    (ended,) = (event for event in monitor.update(record()) if isinstance(event, EndedCoastdown))
    return ended, monitor.ended_window(ended)


def result_of(diagnosing: Diagnosing) -> DiagnosisStatus:
    end = time.monotonic() + WITHIN_S
    while (status := diagnosing.status).state is DiagnosisState.RUNNING:
        assert time.monotonic() < end
        time.sleep(0.05)
    diagnosing.close()
    return status


def test_whether_it_can_diagnose_is_said(start_node, diagnostics) -> None:
    start_node(ship_file=str(SHIP_FILE), diagnose=False, record=False)
    told = diagnostics.wait_for('diagnosis', 'the parameter diagnose is false')
    assert (values(told)['state'], told.level) == ('off', b'\x00')
    for ship, state, reason in (
        (replace(SHIP, baseline=None), 'impossible', 'states no `baseline`'),
        (SHIP, 'none yet', 'none yet'),
    ):
        status = diagnosis_status(Diagnosing(ship, PARAMETERS, enabled=True).status)
        assert (status.values['state'], status.level) == (state, OK)
        assert reason in status.message


def test_node_names_what_is_missing_as_the_verb_does(start_node, peer, diagnostics, tmp_path):
    node = start_node(ship_file=str(SHIP_FILE), use_sim_time=True, **SETTINGS)
    block = record('current=0.5')
    peer.player.connect(block)
    peer.player.play(block, speed=SPEED)

    heard = peer.listen(TOPIC, 'std_msgs/msg/String', latched=True)
    (told,) = peer.spin_until(lambda: heard, within_s=WITHIN_S)
    status = diagnostics.wait_for('diagnosis', 'Missing in the model: current')
    late = peer.listen(TOPIC, 'std_msgs/msg/String', latched=True)
    peer.spin_until(lambda: late)  # who joins late gets it too
    assert late == heard
    assert node.stop() == 0

    (bag,) = (tmp_path / 'bags').glob('*.mcap')
    result = replay(*open_runs([bag]))
    assert result.recorded.first_difference is None
    assert result.recorded.compared == result.recorded.identical > 60
    ((_, window),) = coast_windows(result)
    found = diagnose([CoastRun('the coastdown', window)], result.ship, result.parameters)
    assert status.message == sentence(found)
    assert status.level == b'\x01'
    assert values(status)['verdict'] == 'named'
    assert 'diagnosis: Missing in the model: current' in node.log
    assert values(status)[AHEAD] in node.log
    # the document of the verb to the last digit, on the topic and in the bag
    expected = json.loads(json_text(document(found, result.ship)))
    answer = json.loads(told.data)
    assert answer.pop('coastdown')['end_ns'] == int(values(status)['end of the coastdown [ns]'])
    assert answer.pop('caveat') == ''
    assert answer == expected
    (kept,) = rows(bag, TOPIC)
    assert types.deserialize('std_msgs/msg/String', kept.payload).data == told.data


def test_what_a_coastdown_would_show_is_said_in_steady_sailing(monkeypatch) -> None:
    monitor = Monitor(SHIP, PARAMETERS)
    diagnosing = Diagnosing(SHIP, PARAMETERS, enabled=True)
    block = record()
    since_s = (block.receive_ns - block.receive_ns[0]) * 1e-9
    monitor.update(block[since_s < 500.0])
    diagnosing.look_ahead(monitor)
    assert not diagnosing._queue._threads  # not steady for long enough: nothing was begun
    monitor.update(block[(since_s >= 500.0) & (since_s < 650.0)])
    diagnosing.look_ahead(monitor)
    end = time.monotonic() + WITHIN_S
    while not diagnosing.ahead:
        assert time.monotonic() < end
        time.sleep(0.05)
    diagnosing.close()
    assert diagnosing.ahead.startswith('A coastdown from 15.9 knots, ')
    status = diagnosis_status(diagnosing.status, diagnosing.ahead)
    assert status.values[AHEAD] == diagnosing.ahead
    monkeypatch.setattr(sys, 'executable', '/bin/false')
    failing = Diagnosing(SHIP, PARAMETERS, enabled=True)
    failing.look_ahead(monitor)
    while not failing.ahead:
        assert time.monotonic() < end
        time.sleep(0.05)
    failing.close()
    assert failing.ahead == 'What a coastdown would show: exit 1: '


def test_too_little_steady_record_is_told() -> None:
    ended, window = a_coastdown()
    diagnosing = Diagnosing(SHIP, PARAMETERS, enabled=True)
    diagnosing.begin(ended, replace(window, before=None))
    status = result_of(diagnosing)
    assert status.state is DiagnosisState.IMPOSSIBLE
    assert '0 s of steady sailing' in status.reason


def test_coastdown_without_estimate_is_not_diagnosed() -> None:
    ended, window = a_coastdown()
    diagnosing = Diagnosing(SHIP, PARAMETERS, enabled=True)
    diagnosing.begin(replace(ended, estimate=None, failure='withdrawn: 1 %'), window)
    status = result_of(diagnosing)
    assert status.state is DiagnosisState.IMPOSSIBLE
    assert 'withdrawn: 1 %' in status.reason


def test_process_that_dies_is_a_failure_that_harms_nothing(monkeypatch) -> None:
    monkeypatch.setattr(sys, 'executable', '/bin/false')
    diagnosing = Diagnosing(SHIP, PARAMETERS, enabled=True)
    diagnosing.begin(*a_coastdown())
    status = result_of(diagnosing)
    assert status.state is DiagnosisState.FAILED
    assert 'exit 1' in status.reason


def test_end_of_the_node_does_not_wait_for_a_diagnosis() -> None:
    diagnosing = Diagnosing(SHIP, PARAMETERS, enabled=True)
    ended, window = a_coastdown()
    for _ in range(3):
        diagnosing.begin(ended, window)
    time.sleep(0.5)
    diagnosing.close()
    # killed, or not begun; the others are dropped
    assert diagnosing.status.reason.startswith(('exit -9', 'the node has ended'))
