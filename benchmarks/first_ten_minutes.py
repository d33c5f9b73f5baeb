# SPDX-License-Identifier: Apache-2.0
"""
The first ten minutes of four people: the commands of the README, counted and timed.

    python benchmarks/first_ten_minutes.py [--only DOOR] [--wheel] [--kept] [--write]

Takes the commands from the four doors of README.md and runs them one after the other
in an empty folder. Nothing compiled is kept from before, but with `--kept`; what is
measured is the wall time and the processor time of each door up to its first result, and
of the same commands once more. What only a ship can give is replaced: the chief engineer's records
by a simulated coastdown, the drivers of the ROS developer by a publisher of NavSatFix
and TwistStamped at 10 Hz, up to the first health that says that both are used; half an
hour of steady sailing and the coastdown itself come on top for both. With `--wheel` the
installation is timed too: a wheel is built, and put into a new environment without ROS.
With `--write` the table goes into docs/index.md.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from _tables import put, table

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / 'docs' / 'index.md'
SHIP = ROOT / 'config' / 'vitus_bering.yaml'
LIMIT_S = 900.0
DOORS = ('Chief engineer', 'Office', 'ROS developer', 'Researcher')


@dataclass(frozen=True)
class Spent:
    """What a door took: commands typed, wall and processor time [s]."""

    commands: int
    wall_s: float
    cpu_s: float


def door(name: str) -> str:
    """Return the section of the README."""
    text = (ROOT / 'README.md').read_text(encoding='utf-8')
    return text.partition(f'\n## {name}')[2].partition('\n## ')[0]


def commands(name: str) -> list[str]:
    """Return the command lines of a door."""
    return [
        line.strip()
        for line in re.findall(r'^ {4}(\S.*)$', door(name), flags=re.MULTILINE)
        if re.match(r'(\.venv/bin/shipdrag|ros2 run) ', line.strip())
    ]


class Machine:
    """A folder with nothing in it, and what runs the commands there."""

    def __init__(self, folder: Path, *, kept: bool = False) -> None:
        self.folder = folder
        self.environment = os.environ | {
            'SHIPDRAG_CACHE_DIR': str(folder / 'cache'),
            'PYTHONPATH': str(ROOT),
            'PYTHONUNBUFFERED': '1',
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_DOMAIN_ID': '97',
        }
        if kept:
            del self.environment['SHIPDRAG_CACHE_DIR']
        shutil.copy(SHIP, folder / 'ship.yaml')

    def run(self, *words: str) -> None:
        """Run a command to its end."""
        done = subprocess.run(
            words, cwd=self.folder, env=self.environment, capture_output=True, text=True
        )
        assert done.returncode == 0, (words, done.stderr)

    def run_until(self, heard: Callable[[str], bool], *words: str) -> None:
        """Run a command until what it prints is what one waited for, and end it."""
        log = self.folder / 'log'
        with log.open('w') as stream:
            running = subprocess.Popen(
                words, cwd=self.folder, env=self.environment, stdout=stream, stderr=stream
            )
        try:
            end_s = time.monotonic() + LIMIT_S
            while not heard(log.read_text()):
                assert running.poll() is None, log.read_text()
                assert time.monotonic() < end_s, log.read_text()
                time.sleep(0.05)
        finally:
            running.terminate()
            running.wait(60.0)

    def shipdrag(self, line: str) -> list[str]:
        """Return the words that run a command line of the README."""
        words = shlex.split(line.replace('.venv/bin/shipdrag', 'shipdrag'))
        return [sys.executable, '-m', 'shipdrag_ros.cli', *words[1:]]


def chief_engineer(machine: Machine) -> int:
    """Node and page until they are up, then the report of a record."""
    node, page, replay = commands('Chief engineer')[:3]
    machine.run_until(lambda text: 'ready to estimate' in text, *machine.shipdrag(node))
    machine.run_until(
        lambda text: 'the page: http' in text, *machine.shipdrag(page), '--port', '0'
    )
    bag = machine.folder / 'record.mcap'
    if not bag.exists():
        shutil.copy(machine.folder.parent / 'record.mcap', bag)
    machine.run(*machine.shipdrag(replay.replace('records/*.mcap', bag.name)))
    machine.run(*machine.shipdrag(f'shipdrag diagnose {bag.name}'))
    return 4


def office(machine: Machine) -> int:
    """All but the last line, which serves a page until it is ended."""
    lines = commands('Office')
    for line in lines[:-1]:
        machine.run(*machine.shipdrag(line))
    machine.run_until(
        lambda text: 'the page: http' in text, *machine.shipdrag(lines[-1]), '--port', '0'
    )
    return len(lines)


def ros_developer(machine: Machine) -> int:
    """The node by its remaps, with a driver's topics, until the health says `used`."""
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from geometry_msgs.msg import TwistStamped
    from sensor_msgs.msg import NavSatFix, NavSatStatus

    from shipdrag_ros.messages.heard import health_of

    os.environ.update(
        {name: machine.environment[name] for name in machine.environment if 'ROS_' in name}
    )
    words = shlex.split(commands('ROS developer')[0])
    context = rclpy.Context()
    rclpy.init(context=context)
    peer = rclpy.create_node('driver', context=context)
    fix = peer.create_publisher(NavSatFix, '/fix', 10)
    velocity = peer.create_publisher(TwistStamped, '/vel', 10)
    used: dict[str, float] = {}
    sent = 0

    def send() -> None:
        nonlocal sent
        stamp = peer.get_clock().now().to_msg()
        place = NavSatFix(latitude=54.5 + sent * 5e-6, longitude=10.25)
        place.status.status = NavSatStatus.STATUS_FIX
        speed = TwistStamped()
        place.header.stamp = speed.header.stamp = stamp
        speed.twist.linear.x = 5.5 + 0.01 * (sent % 7)  # a value that repeats is frozen
        fix.publish(place)
        velocity.publish(speed)
        sent += 1

    def hear(message: DiagnosticArray) -> None:
        for health in health_of(message.status):
            for name in ('position', 'speed_over_ground'):
                status = health.of(f'input {name}')
                used[name] = 0.0 if status is None else status.number('used') or 0.0

    peer.create_timer(0.1, send)
    peer.create_subscription(DiagnosticArray, '/diagnostics', hear, 10)
    executor = rclpy.executors.SingleThreadedExecutor(context=context)
    executor.add_node(peer)

    def ready(text: str) -> bool:
        executor.spin_once(timeout_sec=0.05)
        return len(used) == 2 and min(used.values()) > 0.0

    line = [sys.executable, '-m', 'shipdrag_ros.node.main', *words[4:]]
    machine.run_until(ready, *line)
    executor.shutdown()
    rclpy.shutdown(context=context)
    return 1


def researcher(machine: Machine) -> int:
    """The block of Python."""
    (block,) = re.findall(r'```python\n([\s\S]*?)```', door('Researcher'))
    (machine.folder / 'first.py').write_text(f"import matplotlib\nmatplotlib.use('agg')\n{block}")
    machine.run(sys.executable, 'first.py')
    return len(re.findall(r'^(?!import)\S', block, flags=re.MULTILINE))


RUNS = dict(zip(DOORS, (chief_engineer, office, ros_developer, researcher), strict=True))


def spent_on(run: Callable[[Machine], int], machine: Machine) -> Spent:
    """Run a door and return what it took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begin_s = time.monotonic()
    count = run(machine)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Spent(count, time.monotonic() - begin_s, cpu_s)


def installed(machine: Machine) -> int:
    """Build the wheel and install it where nothing is; returns the commands."""
    machine.environment.pop('PYTHONPATH')
    source = machine.folder / 'source'
    machine.run('git', 'clone', '--quiet', '--depth', '1', f'file://{ROOT}', str(source))
    machine.run(sys.executable, '-m', 'build', '--wheel', '--outdir', 'dist', str(source))
    machine.run(sys.executable, '-m', 'venv', 'venv')
    (wheel,) = (machine.folder / 'dist').glob('*.whl')
    python = str(machine.folder / 'venv' / 'bin' / 'python')
    machine.run(python, '-m', 'pip', 'install', '--quiet', str(wheel))
    machine.run(str(machine.folder / 'venv' / 'bin' / 'shipdrag'), '--version')
    return 2


def main() -> None:
    """Run the doors and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n\n')[0])
    parser.add_argument('--only', choices=DOORS, action='append')
    parser.add_argument('--wheel', action='store_true', help='time the installation too')
    parser.add_argument('--kept', action='store_true', help='use what is compiled already')
    parser.add_argument('--write', action='store_true', help=f'put the table into {PAGE.name}')
    options = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as place:
        bag = Path(place) / 'record.mcap'
        line = ['simulate', '--ship', str(SHIP), '--effect', 'fouling=0.5', '--lead-in', '1800']
        subprocess.run(
            [sys.executable, '-m', 'shipdrag_ros.cli', *line, '-o', str(bag)],
            check=True,
            capture_output=True,
            env=os.environ | {'PYTHONPATH': str(ROOT)},
        )
        if options.wheel:
            folder = Path(place) / 'wheel'
            folder.mkdir()
            spent = spent_on(installed, Machine(folder))
            rows.append(('installation of the wheel', 2, f'{spent.wall_s:.0f}', '-', '-', '-'))
        for name in options.only or DOORS:
            folder = Path(place) / name.replace(' ', '_')
            folder.mkdir()
            machine = Machine(folder, kept=options.kept)
            cold = spent_on(RUNS[name], machine)
            for made in ('months', 'results', 'report', 'records'):
                shutil.rmtree(folder / made, ignore_errors=True)
            warm = spent_on(RUNS[name], machine)
            seconds = [f'{each:.0f}' for one in (cold, warm) for each in (one.wall_s, one.cpu_s)]
            rows.append((name, cold.commands, *seconds))
            print(rows[-1], file=sys.stderr, flush=True)
    head = ['door', 'commands', 'first time [s]', 'its CPU [s]', 'again [s]', 'its CPU [s]']
    load = f'{os.cpu_count()} cores, load {os.getloadavg()[0]:.0f} by all that ran beside'
    made = '\n'.join([*table(head, rows), '', f'On a machine with {load}.'])
    print(made)
    if options.write:
        put(PAGE, {'first ten minutes': made})


if __name__ == '__main__':
    main()
