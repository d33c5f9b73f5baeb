# SPDX-License-Identifier: Apache-2.0
"""
What a stranger does to a node and its page, a line each: goal and result.

`python tests/peers/attacks.py` tries every line, or those that are named, and prints
the table of docs/results/attacks.txt; `--write` puts it there. It shares no code
with the package. What else is tried is in `tests/node` and `tests/live/test_guard.py`.
"""

from __future__ import annotations

import argparse
import math
import os
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

if __name__ == '__main__':
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    os.environ.setdefault('ROS_DOMAIN_ID', str(110 + os.getpid() % 90))


from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter, ParameterType
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import JointState
from stranger import (
    OK,
    SHIP,
    Clock,
    Program,
    Stranger,
    cdr_twist,
    coasting,
    nmea,
    payloads,
    point,
    twist,
)

READY = 'ready to estimate'
LOG = 'input speed_through_water'
PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'results' / 'attacks.txt'
Found = tuple[bool, str]


class Bench:
    """A folder, a stranger, and the programs that one line starts."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.bags = folder / 'bags'
        self.peer = Stranger()
        self.programs: list[Program] = []
        (folder / 'ship.yaml').write_text(SHIP)

    def close(self) -> None:
        for each in self.programs:
            each.end()
        self.peer.close()

    def start(self, *line: str | Path, until: str) -> Program:
        self.programs.append(Program(self.folder / f'{len(self.programs)}.log', *line))
        self.programs[-1].wait_for(until)
        return self.programs[-1]

    def node(self, *options: str, ros: Sequence[str] = ()) -> Program:
        line = ('node', '--ship', self.folder / 'ship.yaml', '--out', self.bags, *options)
        return self.start(*line, '--ros-args', *ros, until=READY)

    def run(self, *line: str | Path, check: bool = True) -> str:
        """Run a verb to its end; return all that it says."""
        done = subprocess.run(
            [Path(sys.executable).with_name('shipdrag'), *line],
            capture_output=True,
            text=True,
            check=check,
            errors='replace',
            timeout=600.0,
        )
        return done.stdout + done.stderr

    def sail(self, *, ground: bool = False) -> None:
        """One sound reading of the log, never the same twice."""
        now_ns = time.time_ns()
        self.peer.log.publish(cdr_twist(now_ns, 5.0 + 0.01 * math.sin(now_ns * 1e-9)))
        if ground:
            self.peer.ground.publish(twist(now_ns, 5.0 + 0.01 * math.cos(now_ns * 1e-9)))

    def seconds_until(
        self, found: Callable[[], object], *, meanwhile: Callable[[], None], within_s: float
    ) -> float | None:
        """Return how long it took, None if it did not come."""
        began_s = time.monotonic()
        while not found():
            if time.monotonic() > began_s + within_s:
                return None
            meanwhile()
            self.peer.spin(0.1)
        return time.monotonic() - began_s


def late(seconds: float | None) -> str:
    return 'never' if seconds is None else f'after {seconds:.0f} s'


def under_way(bench: Bench) -> tuple[list[bytes], Callable[[], None]]:
    """Sail until the node uses what it hears; return what was sent, and how to send more."""
    sent = []

    def sail() -> None:
        sent.append(cdr_twist(time.time_ns(), 5.0 + 1e-4 * len(sent)))
        bench.peer.log.publish(sent[-1])

    bench.seconds_until(lambda: bench.peer.value(LOG, 'used') > 10, meanwhile=sail, within_s=30.0)
    return sent, sail


def stopped_for_15_s(bench: Bench) -> Found:
    node = bench.node()
    sent, sail = under_way(bench)
    node.process.send_signal(signal.SIGSTOP)
    bench.seconds_until(lambda: False, meanwhile=sail, within_s=15.0)
    node.process.send_signal(signal.SIGCONT)
    bench.seconds_until(lambda: False, meanwhile=sail, within_s=5.0)
    rejected = sum(bench.peer.rejected(LOG).values())
    lost = bench.peer.value(LOG, 'messages lost')
    node.end(signal.SIGTERM)
    left = payloads(sorted(bench.bags.glob('*.mcap')), '/speed_through_water')
    joined = sent.index(left[0])
    missing = len(sent) - joined - len(left)
    good = missing <= 1 and not rejected and not lost  # the last may be on its way
    return good, f'{len(left)} of {len(sent) - joined} recorded, {rejected:.0f} rejected'


def a_stall_of_tcp(bench: Bench) -> Found:
    """A multiplexer whose line stands still for 20 s; ZDA, RMC or GGA states the time."""
    said, good = [], True
    for kind in ('ZDA', 'RMC', 'GGA'):
        with Multiplexer(kind) as line:
            node = bench.node(
                '--nmea', f'tcp://127.0.0.1:{line.port}', ros=('-p', 'record:=false')
            )
            bench.peer.arrays.clear()
            bench.seconds_until(
                lambda: bench.peer.value(LOG, 'used') > 50, meanwhile=lambda: None, within_s=40.0
            )
            before = (bench.peer.value(LOG, 'used'), sum(bench.peer.rejected(LOG).values()))
            line.stalled = True
            bench.peer.spin(20.0)
            line.stalled = False
            bench.peer.spin(6.0)
            used = bench.peer.value(LOG, 'used') - before[0]
            rejected = sum(bench.peer.rejected(LOG).values()) - before[1]
            good = good and rejected <= 0.02 * used and used > 150
            said.append(f'{kind}: {rejected:.0f} of {used + rejected:.0f} rejected')
            node.end(signal.SIGTERM)
    return good, '; '.join(said)


def fifty_life_cycles(bench: Bench) -> Found:
    node = bench.node()
    client = bench.peer.node.create_client(ChangeState, '/coastdown_node/change_state')
    client.wait_for_service(timeout_sec=20.0)
    sizes, failed = [], 0
    for number in range(50):
        for label in ('deactivate', 'cleanup', 'configure', 'activate'):
            request = ChangeState.Request()
            request.transition.id = getattr(Transition, f'TRANSITION_{label.upper()}')
            for _ in range(60):  # so many a second are allowed
                if bench.peer.call(client, request).success:
                    break
                bench.peer.spin(0.5)
            else:
                failed += 1
        if number in (9, 49):
            sizes.append(memory_mib(node.process.pid))
    good = not failed and sizes[1] < sizes[0] + 20.0
    return good, f'{failed} failed; {sizes[0]:.0f} MiB after 10, {sizes[1]:.0f} MiB after 50'


def memory_by_rate(bench: Bench) -> Found:
    """Log, speed over ground and position at a rate, recorded; the memory a minute apart."""
    said, good = [], True
    for rate_hz in (1.0, 10.0, 100.0):
        node, way, sizes = bench.node(), 0.0, []
        began_s = due_s = time.monotonic()
        for at_s in (30.0, 90.0):
            while due_s < began_s + at_s:
                bench.sail(ground=True)
                way += 5.0 / rate_hz
                bench.peer.place.publish(point(time.time_ns(), way))
                due_s += 1.0 / rate_hz
                bench.peer.spin(max(due_s - time.monotonic(), 0.0))
            sizes.append(memory_mib(node.process.pid))
        came = bench.peer.value('input position', 'messages') / 90.0
        node.end(signal.SIGTERM)
        good = good and sizes[1] < 512.0 and sizes[1] < sizes[0] + 64.0
        said.append(f'{rate_hz:.0f} Hz ({came:.0f}): {sizes[0]:.0f}, {sizes[1]:.0f} MiB')
    return good, '; '.join(said)


def control_characters(bench: Bench) -> Found:
    """Everywhere a peer may write text, it writes what would rule a terminal."""
    port = free_port()
    node = bench.node('--nmea', f'udp://127.0.0.1:{port}')
    evil = '\x1b]0;owned\x07\x9b31m'
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    shaft = bench.peer.node.create_publisher(JointState, 'shaft', 10)
    parameters = bench.peer.node.create_client(SetParameters, '/coastdown_node/set_parameters')
    change = bench.peer.node.create_client(ChangeState, '/coastdown_node/change_state')
    parameters.wait_for_service(timeout_sec=20.0)
    entry = Parameter()
    entry.name = f'window_s{evil}'
    entry.value.type = ParameterType.PARAMETER_STRING
    entry.value.string_value = evil
    typed = Parameter()
    typed.name = 'estimator'
    typed.value.type = ParameterType.PARAMETER_STRING
    typed.value.string_value = evil
    for each in (entry, typed):
        bench.peer.call(parameters, SetParameters.Request(parameters=[each]))
    request = ChangeState.Request()
    request.transition.label = evil
    bench.peer.call(change, request)

    def sail() -> None:
        now_ns = time.time_ns()
        bench.sail()
        line.sendto(f'$II{evil}VHW,1,2*00\r\n'.encode('latin-1'), ('127.0.0.1', port))
        line.sendto(nmea(f'P{evil},1'), ('127.0.0.1', port))
        message = JointState(name=[f'shaft{evil}', evil], velocity=[1.0, 2.0])
        message.header.stamp = twist(now_ns, 0.0).header.stamp
        message.header.frame_id = evil
        shaft.publish(message)

    bench.seconds_until(lambda: False, meanwhile=sail, within_s=8.0)
    said = str(bench.peer.arrays[-1]) + node.log
    node.end(signal.SIGTERM)
    for verb in ('info', 'check', 'replay'):
        said += bench.run(verb, *sorted(bench.bags.glob('*.mcap')), check=False)
    found = [each for each in ('\x1b]', '\x07', '\x9b') if each in said]
    return (
        not found,
        f'{len(said)} characters of log, health and verbs; {len(found)} kinds in them',
    )


def spoilt(fault: str, random_: random.Random, second: int, value: float) -> float:
    """Return what a source reads instead of a speed."""
    if fault == 'random':
        return random_.uniform(0.0, 10.0)
    if fault == '20 % spikes':
        return value if random_.random() < 0.8 else random_.uniform(-30.0, 30.0)
    if fault == 'of another axis':
        return random_.gauss(0.0, 0.1) + 0.1 * math.sin(second / 9.0)
    return {
        'NaN': math.nan,
        'zero': 0.0,
        'constant': 3.0,
        'reversed': -value,
        'in knots': value * 3600.0 / 1852.0,
        '0.5 times': value * 0.5,
        '1.6 times': value * 1.6,
    }.get(fault, value)


def hear(
    bench: Bench,
    doubted: str,
    beside: str,
    fault: str,
    *,
    within_s: int = 130,
    from_s: int = 0,
    current_m_s: float = 0.0,
) -> tuple[int | None, bool]:
    """
    Sail for 7 min, stop the engine, glide for 6: when not green, was the stop found?

    Where it must be not green before she stops, that is looked at closely from a time on.
    """
    closely_s = within_s + 15 if within_s < 420 else 0
    node = bench.node(ros=('-p', 'use_sim_time:=true', '-p', 'record:=false'))
    noise, wrong = random.Random(1), random.Random(2)
    way, named, found = 0.0, None, False
    for name in (doubted, beside):  # what is sent before the node hears it is not in its minute
        bench.peer.until(
            partial(bench.peer.value, f'input {name}', 'publishers'), meanwhile=lambda: None
        )
    for second in range(420 + 360):
        clock = Clock()
        clock.clock.sec = 1_700_000_000 + second
        bench.peer.clock.publish(clock)
        # /diagnostics comes once a second
        closely = named is None and from_s <= second < closely_s
        bench.peer.spin(0.25 if closely else 0.02)
        true = coasting(second - 420.0) + 0.02 * math.sin(0.2 * second)
        way += true + current_m_s
        at_ns = (1_700_000_000 + second) * 10**9 - 10**8
        for name in (doubted, beside):
            value, said = true + noise.gauss(0.0, 0.02), fault if name == doubted else ''
            if name == 'position':
                metres = way + noise.gauss(0.0, 0.5)
                bench.peer.place.publish(point(at_ns, metres / 1e3 if said else metres))
                continue
            topic = bench.peer.log if name == 'speed_through_water' else bench.peer.ground
            topic.publish(twist(at_ns, spoilt(said, wrong, second, value)))
        status = bench.peer.now(f'input {doubted}')
        told = status is not None and 'no data' not in status.message
        if named is None and told and status.level[0] != OK and 'publisher' not in status.message:
            named = second
        state = bench.peer.now('state')
        found = found or (state is not None and state.message.startswith('coastdown'))
        if found and named is not None:
            break
    node.end(signal.SIGTERM)
    return named, found


def nonsense(
    bench: Bench, *faults: str, doubted: str, beside: str, within_s: int = 80, from_s: int = 0
) -> Found:
    """Return what becomes of faults of one source while another is sound."""
    said, good = [], True
    for fault in faults:
        bench.peer.close()
        bench.peer = Stranger()
        # that it stands still is known after `frozen_s`: 3 m/s may be a current of 2 before
        limit_s = 130 if fault == 'constant' else within_s
        named, found = hear(bench, doubted, beside, fault, within_s=limit_s, from_s=from_s)
        good = good and named is not None and named <= limit_s
        good = good and found
        said.append(
            f'{fault}: {"never" if named is None else f"{named} s"}, '
            f'the stop {"found" if found else "missed"}'
        )
    return good, '; '.join(said)


def a_log_that_says_nothing(bench: Bench) -> Found:
    faults = ('random', 'zero', 'constant', 'reversed', 'of another axis', '20 % spikes')
    return nonsense(bench, *faults, doubted='speed_through_water', beside='speed_over_ground')


def a_log_that_says_nothing_beside_positions(bench: Bench) -> Found:
    return nonsense(bench, 'random', 'zero', doubted='speed_through_water', beside='position')


def a_log_in_a_wrong_scale(bench: Bench) -> Found:
    where = {'doubted': 'speed_through_water', 'beside': 'position'}
    good, first = nonsense(bench, 'in knots', **where)
    # what a current of 2.5 or 3 m/s may be, too, shows once she slows
    found, second = nonsense(bench, '0.5 times', '1.6 times', **where, within_s=420 + 180)
    bench.peer.close()
    bench.peer = Stranger()
    named, _ = hear(bench, 'speed_through_water', 'position', 'sound', current_m_s=2.0)
    third = f'sound in 2 m/s: {"never" if named is None else f"{named} s"}'
    return good and found and named is None, f'{first}; {second}; {third}'


def a_track_that_says_nothing(bench: Bench) -> Found:
    _, first = nonsense(bench, 'in km', doubted='position', beside='speed_through_water')
    good, second = nonsense(
        bench, 'random', doubted='speed_over_ground', beside='speed_through_water'
    )
    return good and 'missed' not in first and 'never' not in first, f'{first}; {second}'


def wrong_readings(bench: Bench) -> Found:
    """No numbers, and the wrong unit."""
    where = {'doubted': 'speed_through_water', 'beside': 'speed_over_ground'}
    good, first = nonsense(bench, 'NaN', **where)
    _, second = nonsense(bench, 'in knots', **where)
    return good and 'never' not in second, f'{first}; {second}'


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])


def memory_mib(pid: int) -> float:
    status = Path(f'/proc/{pid}/status').read_text()
    return float(re.search(r'VmRSS:\s+(\d+)', status)[1]) / 1024.0


class Multiplexer:
    """Serves sentences over TCP at 10 Hz, each second with its time; the line may stand still."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._listening = socket.create_server(('127.0.0.1', 0))
        self._listening.settimeout(0.2)
        self.port = self._listening.getsockname()[1]
        self.stalled = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self) -> Multiplexer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._listening.close()

    def _serve(self) -> None:
        held, waiting, number = None, b'', 0
        while not self._ended.wait(0.1):
            if held is None:
                try:
                    held, _ = self._listening.accept()
                except TimeoutError:
                    continue
            number += 1
            knots = 9.7 + 0.02 * math.sin(0.37 * number)
            waiting += nmea(f'IIVHW,,T,,M,{knots:.3f},N,,K')
            if number % 10 == 0:
                waiting += nmea(self._time())
            if self.stalled:
                continue
            try:
                held.sendall(waiting)
            except OSError:
                held = None
            waiting = b''

    def _time(self) -> str:
        now = time.time()
        clock = time.strftime('%H%M%S', time.gmtime(now)) + f'{now % 1:.2f}'[1:]
        if self._kind == 'ZDA':
            return f'GPZDA,{clock},{time.strftime("%d,%m,%Y", time.gmtime(now))},00,00'
        if self._kind == 'RMC':
            day = time.strftime('%d%m%y', time.gmtime(now))
            return f'GPRMC,{clock},A,5400.000,N,00800.000,E,9.7,90.0,{day},,,A'
        return f'GPGGA,{clock},5400.000,N,00800.000,E,1,08,1.0,5.0,M,40.0,M,,'


GOAL = 'not green within 60 s (constant: 120 s) and two ticks, the stop is found'
LINES: dict[str, tuple[str, Callable[[Bench], Found]]] = {
    '1 a log that says nothing, over ground is sound': (GOAL, a_log_that_says_nothing),
    '1 a log that says nothing, the position is sound': (
        GOAL,
        a_log_that_says_nothing_beside_positions,
    ),
    '1 a log in a wrong scale, the position is sound': (
        'in knots: not green within 60 s and two ticks; less: 180 s after the stop; sound: never',
        a_log_in_a_wrong_scale,
    ),
    '1 a track that says nothing, the log is sound': (GOAL, a_track_that_says_nothing),
    '6 a stall of TCP of 20 s': ('at most 2 % rejected', a_stall_of_tcp),
    '7 control characters of peers': ('none in log, health, verbs', control_characters),
    'SIGSTOP for 15 s': ('all recorded, none rejected', stopped_for_15_s),
    'no numbers, wrong unit; over ground is sound': (
        'not green within 60 s; NaN: the stop is found',
        wrong_readings,
    ),
    '50 life cycles': ('none fails, no growth', fifty_life_cycles),
    'three inputs at 1, 10, 100 Hz (received), after 30 and 90 s': (
        'below 512 MiB, growth below 64 MiB',
        memory_by_rate,
    ),
}


def attack(name: str, folder: Path) -> Found:
    """Try one line in a folder of its own."""
    bench = Bench(folder)
    try:
        return LINES[name][1](bench)
    finally:
        bench.close()


def write(rows: dict[str, str]) -> None:
    """Put rows into the table; those of lines that were not tried now stay as they are."""
    kept = PAGE.read_text().splitlines() if PAGE.exists() else []
    old = {line.split(' | ')[0].removeprefix('| '): line for line in kept if line.startswith('| ')}
    made = [{**old, **rows}[name] for name in LINES if name in {**old, **rows}]
    head = (__doc__ or '').strip().splitlines()[0]
    table = ['| what | goal | result |', '| --- | --- | --- |', *made]
    PAGE.write_text(
        '\n'.join([head, 'Made by `python tests/peers/attacks.py --write`.', '', *table, ''])
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('lines', nargs='*', help='parts of names of lines')
    parser.add_argument('--write', action='store_true')
    options = parser.parse_args()
    names = [n for n in LINES if not options.lines or any(part in n for part in options.lines)]
    rows, failed = [], 0
    for name in names:
        began_s = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            good, text = attack(name, Path(folder))
        failed += not good
        verdict = 'holds' if good else 'FAILS'
        rows.append(f'| {name} | {LINES[name][0]} | {verdict}: {text} |')
        print(f'{rows[-1]}  ({time.monotonic() - began_s:.0f} s)', flush=True)
    if options.write:
        write(dict(zip(names, rows, strict=True)))
    return failed > 0


if __name__ == '__main__':
    sys.exit(main())
