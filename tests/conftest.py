# SPDX-License-Identifier: Apache-2.0
"""
What holds for all tests, and a made-up result, every field of which a page or a table shows.

Property tests try the same examples each time, new ones with
`--hypothesis-profile=default`. What was skipped for want of a browser is told.
"""

from __future__ import annotations

import fcntl
import gc
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import gettempdir
from typing import Any, TextIO

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from shipdrag_ros.coastdown.events import EndedBy, EndedCoastdown, InputCounts
from shipdrag_ros.estimation import estimators
from shipdrag_ros.estimation.result import (
    Estimate,
    FroudeMax,
    OrderTrial,
    ResistanceCurve,
    Track,
)
from shipdrag_ros.fleet.store import FROUDE, BagResult, Store, bag_schema, coastdown_schema
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import Recorded
from shipdrag_ros.replay.run_result import RunResult, TrueCurve
from shipdrag_ros.ship import Ship
from tests.runs import seen

# how long an example takes says how busy the machine is
settings.register_profile(
    'repeatable', derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile('repeatable')

NO_BROWSER = 'no browser'
_REQUIRED = 'SHIPDRAG_BROWSER_REQUIRED'
_BROWSERS = ('chromium', 'chromium-browser', 'google-chrome')
_FLAGS = ['--no-sandbox', '--disable-gpu', '--disable-quic', '--disable-dev-shm-usage']
_START_NS = 1_700_000_000_000_000_000
_SECOND_NS = 1_000_000_000


def _own_domain() -> tuple[int, TextIO]:
    """Find a domain that no other test process of this machine is in, and lock it."""
    for domain in range(10, 102):
        path = Path(gettempdir()) / f'shipdrag_ros_domain_{domain}.lock'
        try:
            lock = path.open('w')
        except PermissionError:  # that of another user
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
        else:
            return domain, lock
    raise RuntimeError('92 test processes run already')


# nodes of other test processes are not heard, from before the first of this one is made
_domain, _lock = _own_domain()
os.environ['ROS_DOMAIN_ID'] = str(_domain)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'
gc.disable()  # what is imported and collected stays


@pytest.fixture(autouse=True)
def defects(monkeypatch: pytest.MonkeyPatch) -> Iterator[set[tuple[str, int]]]:
    """Places of defects of estimators and forecasts: none, but where a test makes some."""
    found: set[tuple[str, int]] = set()
    monkeypatch.setattr(estimators, '_logged', found)
    yield found
    assert not found, 'an estimator or a forecast failed by a defect of the program'


@pytest.fixture(scope='session')
def own_domain() -> Callable[[], tuple[int, TextIO]]:
    """A function that finds one more domain, until its lock is closed."""
    return _own_domain


def pytest_collection_finish() -> None:
    """Let the collector of garbage look no more at half a million things that stay."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Count what no browser has opened, in one line."""
    skipped = [
        report
        for report in terminalreporter.stats.get('skipped', [])
        if isinstance(report.longrepr, tuple) and NO_BROWSER in report.longrepr[2]
    ]
    if skipped:
        terminalreporter.write_line(
            f'{len(skipped)} tests skipped: {NO_BROWSER}; with Chromium (apt-get install '
            'chromium) they open every kind of page'
        )


@pytest.fixture(scope='session')
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Make a folder once, for all processes of a test run."""
    base = tmp_path_factory.getbasetemp()
    base = base.parent if 'PYTEST_XDIST_WORKER' in os.environ else base

    def folder_of(name: str, make: Callable[[Path], object]) -> Path:
        folder, done = base / name, base / f'{name}.done'
        with (base / f'{name}.lock').open('w') as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not done.exists():
                folder.mkdir()
                make(folder)
                done.touch()
        return folder

    return folder_of


@pytest.fixture(scope='session')
def browser() -> Iterator[Any]:
    """Chromium, driven by Playwright; one a process, which cannot drive two."""
    program = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if program is None:
        why = f'no browser: none of {", ".join(_BROWSERS)} is installed'
        if os.environ.get(_REQUIRED):
            pytest.fail(f'{why}, and {_REQUIRED} is set')
        pytest.skip(why)
    playwright = pytest.importorskip('playwright.sync_api')
    with playwright.sync_playwright() as started:
        found = started.chromium.launch(executable_path=program, args=_FLAGS)
        yield found
        found.close()


@pytest.fixture(scope='session')
def ship_file() -> Path:
    """A ship to sail with."""
    return Path(__file__).resolve().parents[1] / 'config' / 'vitus_bering.yaml'


@pytest.fixture(scope='session')
def ship() -> Ship:
    return Ship(name='Vitus Bering', length_m=150.0, displaced_volume_m3=20200.0)


@pytest.fixture(scope='module')
def estimate(ship: Ship) -> Estimate:
    """r = v^2 / 3000 and a joint fit of it, 1500 s long."""
    speed = np.linspace(0.5, 8.2, 155)
    r = speed**2 / 3000.0
    curve = ResistanceCurve(
        speed_m_s=speed,
        resistance_m_s2=r,
        sigma_m_s2=0.02 * r + 1e-4,
        sigma_repeatable_m_s2=0.01 * r + 1e-4,
        froude=ship.froude(speed),
        slope=np.gradient(r, ship.froude(speed)),
        slope_sigma=np.full_like(speed, 1e-3),
        by_current_1_s=np.zeros_like(speed),
    )
    time_s = np.arange(1500.0)
    fitted = 8.2 / (1.0 + 8.2 * time_s / 3000.0)
    position = 3000.0 * np.log1p(8.2 * time_s / 3000.0)
    random = np.random.default_rng(5)
    stamps = _START_NS + (time_s * 1e9).astype(np.int64)
    return Estimate(
        estimator='s1_joint',
        start_ns=_START_NS,
        end_ns=_START_NS + 1500 * _SECOND_NS,
        order=5,
        orders=tuple(
            OrderTrial(n, 1.0 + 50.0 / n**6, 0.0025 + 3.0 / n**6, 100.0 + 3e4 / n**6, 10.0, 0.01)
            for n in range(1, 13)
        ),
        samples={'speed_through_water': 1500, 'position': 1500},
        noise_sd={'speed_through_water': 0.05, 'position': 10.0},
        calm=curve,
        conditions=curve,
        whole=curve,
        froude_valid=(0.05, 0.18),
        froude_max_by=FroudeMax.INFLECTION,
        froude_max_argmax=0.2,
        max_relative_sigma=0.013,
        last_speed_m_s=0.5,
        last_speed_sigma_m_s=0.01,
        last_resistance_m_s2=1e-4,
        last_sigma_m_s2=1e-5,
        tracks={
            'speed_through_water': Track(stamps, fitted + random.normal(0, 0.05, 1500), fitted),
            'position': Track(stamps, position + random.normal(0, 10.0, 1500), position),
        },
        notes=('A note of the estimator <b>itself</b>.',),
    )


@pytest.fixture(scope='module')
def coastdown(estimate: Estimate) -> EndedCoastdown:
    return EndedCoastdown(
        start_ns=estimate.start_ns,
        end_ns=estimate.end_ns,
        onset_detected_ns=estimate.start_ns + 40 * _SECOND_NS,
        ended_by=EndedBy.SPEED,
        estimate=estimate,
    )


@pytest.fixture(scope='module')
def run(ship: Ship, coastdown: EndedCoastdown) -> RunResult:
    return RunResult(
        run=seen('sea trial.mcap'),
        ship=ship,
        parameters=Parameters(),
        events=(),
        coastdowns=(coastdown,),
        inputs={
            'speed_through_water': InputCounts(1503, 1500, {'nan': 2, 'late': 1, 'frozen': 0}),
            'position': InputCounts(1500, 1500, {}),
        },
        recorded=Recorded(100, 100, None),
        truth=None,
    )


@pytest.fixture(scope='module')
def truth() -> TrueCurve:
    speed = np.linspace(0.0, 8.2, 83)
    return TrueCurve(speed, speed**2 / 3100.0, {'speed_m_s': 8.2, 'seed': 1})


@pytest.fixture(scope='module')
def simulated(run: RunResult, truth: TrueCurve) -> RunResult:
    return replace(run, truth=truth)


def fleet_result(number: int, added: float, *, error: str | None = None) -> BagResult:
    """A bag of one coastdown, as the fleet writes it."""
    speed = FROUDE * 28.0
    clean = 1e-3 * speed**2
    common = {'content_hash': f'{number:064x}', 'bag': f'{number}.mcap'}
    row = dict.fromkeys(coastdown_schema().names) | {
        **common,
        'time_ns': _START_NS + number * 15 * 86_400 * _SECOND_NS,
        'froude': FROUDE,
        'speed_m_s': speed,
        'resistance_m_s2': (1.0 + added) * clean,
        'sigma_m_s2': 0.03 * clean,
        'sigma_repeatable_m_s2': 0.01 * clean,
        'clean_m_s2': clean,
        'speed_at_stop_m_s': 8.0,
        'length_m': 80.0,
        'displaced_volume_m3': 1000.0,
        'water_density_kg_m3': 1025.0,
        'software_version': '1',
    }
    bag = dict.fromkeys(bag_schema().names) | {
        **common,
        'root': 'r',
        'ship': None if error else 'Test <b>ship</b>',
        'software_version': '1',
        'coastdowns': 0 if error else 1,
        'messages': 1,
        'warnings': [],
        'error': error,
    }
    return BagResult(bag, () if error else (row,))


@pytest.fixture(scope='session')
def fleet_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of one ship with twelve runs and one bag that could not be read."""
    made = Store(tmp_path_factory.mktemp('fleet') / 'store')
    for number in range(12):
        made.write(fleet_result(number, 0.01 * number))
    made.write(fleet_result(99, 0.0, error='no bag: 3 bytes of text'))
    made.keep_ship('Test <b>ship</b>', {'events.csv': 'date,kind\n2024-02-01,cleaning\n'})
    return made.path
