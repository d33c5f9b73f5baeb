# SPDX-License-Identifier: Apache-2.0
"""What is deployed starts what there is, with few rights, as the tools that read it see it."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from shipdrag_ros.cli import main
from shipdrag_ros.messages import OUTPUT_TOPICS, TOPICS

ROOT = Path(__file__).resolve().parents[2]
DEPLOY = ROOT / 'deploy'
UNIT = DEPLOY / 'shipdrag.service'
ANALYZE = shutil.which('systemd-analyze')
EXPOSED_AT_MOST = 2.0  # of 10; above 4 systemd calls it medium

needs_systemd = pytest.mark.skipif(ANALYZE is None, reason='systemd-analyze is not installed here')


def of_unit(key: str) -> list[str]:
    return re.findall(rf'^{key}=(.*)$', UNIT.read_text(), flags=re.MULTILINE)


@needs_systemd
def test_systemd_accepts_the_unit(tmp_path: Path) -> None:
    assert ANALYZE is not None
    # the program is where it will be installed, and not here
    unit = tmp_path / UNIT.name
    unit.write_text(UNIT.read_text().replace('/opt/shipdrag/.venv/bin/shipdrag', '/bin/true'))
    done = subprocess.run(
        [ANALYZE, 'verify', '--recursive-errors=no', unit],
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, '')


@needs_systemd
def test_the_unit_exposes_little() -> None:
    assert ANALYZE is not None
    done = subprocess.run(
        [ANALYZE, 'security', '--offline=true', '--no-pager', UNIT],
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    found = re.search(r'exposure level for shipdrag.service: ([\d.]+)', done.stdout)
    assert found is not None, done.stdout + done.stderr
    assert float(found[1]) <= EXPOSED_AT_MOST


def test_the_unit_and_the_container_give_arguments_that_there_are(capsys) -> None:
    (line,) = of_unit('ExecStart')
    container = (DEPLOY / 'Containerfile').read_text().replace('\\\n', ' ')
    command = re.search(r'^CMD (\[.*\])$', container, flags=re.MULTILINE)
    assert command is not None
    words = re.findall(r'"([^"]+)"', command[1])
    assert shlex.split(line)[2:] == words
    # a ship file that is not there is the first thing said when all else is right
    assert main(['node', *words]) == 1
    assert '/etc/shipdrag/ship.yaml' in capsys.readouterr().err


def test_the_unit_waits_for_the_node_and_starts_it_again_where_it_hangs() -> None:
    assert of_unit('Type') == ['notify']  # tests/node/test_notify.py speaks to such a manager
    assert of_unit('NotifyAccess') == ['main']
    (seconds,) = of_unit('WatchdogSec')
    assert 60 <= int(seconds) <= 120
    assert of_unit('Restart') == ['on-failure']  # which a watchdog that bites is


def test_nothing_runs_as_root_or_writes_outside() -> None:
    container = (DEPLOY / 'Containerfile').read_text()
    assert re.search(r'^USER 10001', container, flags=re.MULTILINE)
    assert '--read-only' in container
    assert of_unit('DynamicUser') == ['yes']
    assert of_unit('ProtectSystem') == ['strict']
    assert of_unit('NoNewPrivileges') == ['yes']


def test_the_policy_names_every_topic_of_the_node() -> None:
    tree = ElementTree.parse(DEPLOY / 'sros2_policy.xml')
    node = tree.find('.//profile[@node="coastdown_node"]')
    assert node is not None
    heard = {topic.text for topic in node.findall('topics[@subscribe="ALLOW"]/topic')}
    sent = {topic.text for topic in node.findall('topics[@publish="ALLOW"]/topic')}
    assert heard == {*TOPICS, '/clock'}
    assert {f'~/{topic.name}' for topic in OUTPUT_TOPICS} <= sent
    operator = tree.find('.//profile[@node="operator"]')
    assert operator is not None
    asked = {service.text for service in operator.findall('services[@request="ALLOW"]/service')}
    assert not any('parameters' in str(name) for name in asked)
