# SPDX-License-Identifier: Apache-2.0
"""
Bags that earlier versions recorded are still bags, whatever has changed since.

Each was recorded by the node of that version, over ROS topics, from the ship of the
demonstration: 330 s of steady sailing, then 300 s of a coastdown, at 0.5 Hz.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

from shipdrag_ros import __version__
from shipdrag_ros.bags import open_runs
from shipdrag_ros.bags.check import check
from shipdrag_ros.bags.writer import RecordWriter, attachment, content_of
from shipdrag_ros.cli import main
from shipdrag_ros.errors import ParameterError
from shipdrag_ros.messages import EncodedMessage
from shipdrag_ros.parameters import Parameters

FOLDER = Path(__file__).parent / 'frozen'


@pytest.mark.parametrize('version', ['0.1.0', '0.2.0'])
def test_a_bag_of_an_earlier_version_is_read_and_replayed(version: str, tmp_path, capsys) -> None:
    path = FOLDER / f'recorded_by_{version}.mcap'
    assert check([path])[0].sound
    (run,) = open_runs([path])
    assert (run.software, run.warnings, run.indexed) == (version, (), True)
    inputs = {topic.input: topic.messages for topic in run.topics if topic.input}
    assert inputs == dict.fromkeys(('heading', 'position', 'shaft', 'speed_through_water'), 316)
    document = tmp_path / 'replay.json'
    assert main(['replay', str(path), '--json', str(document)]) == 0
    said = ' '.join(capsys.readouterr().out.split())
    assert 'outputs in the bag are identical to the replayed ones' in said
    if version != __version__ and 'All' not in said.partition('outputs in the bag')[0][-12:]:
        assert f'version {version} recorded it and this is {__version__}' in said
    assert json.loads(document.read_text())['recorded']['by'] == version


def test_a_parameter_that_is_gone_is_left_out_of_a_bag_and_an_error_in_a_file(tmp_path, capsys):
    """The bag of 0.1.0 again, with a key and a value that this version does not have."""
    path = tmp_path / 'a.mcap'
    (run,) = open_runs([FOLDER / 'recorded_by_0.1.0.mcap'])
    with RecordWriter(path) as bag:
        for name, text in run.attachments.items():
            gone = 'wake_s: 3.0\nestimator: warped\n' if name == 'parameters.yaml' else ''
            kept = [it for it in text.splitlines() if not gone or not it.startswith('estimator')]
            bag.add(attachment(name, '\n'.join([*kept, gone])))
        with (FOLDER / 'recorded_by_0.1.0.mcap').open('rb') as file:
            for schema, channel, message in make_reader(file).iter_messages():
                number, times = (
                    bag.declare(channel, schema),
                    (message.log_time, message.publish_time),
                )
                content = content_of(number, EncodedMessage('', '', message.data, *times))
                bag.add_content(number, content, log_ns=message.log_time)
    assert main(['replay', str(path)]) == 0
    said = ' '.join(capsys.readouterr().out.split())
    assert 'parameters.yaml: wake_s: unknown key' in said
    assert "estimator: 'warped', which is 'one' now; expected one of" in said
    (changed,) = open_runs([path])
    with pytest.raises(ParameterError, match='wake_s: unknown key'):
        Parameters.from_yaml(changed.attachments['parameters.yaml'], subject='mine')
