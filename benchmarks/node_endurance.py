# SPDX-License-Identifier: Apache-2.0
"""
What the node keeps of what is sent to it, and what it keeps of memory.

Bursts and floods over DDS on loopback, a node that is stopped meanwhile; a thousand
cycles of its life; a day of sailing at 10 Hz through monitor and recorder. Prints the
tables of docs/results/node_faults.txt, `--write` puts them there: some ten minutes of one core,
most of it the day (`--hours 6` for less; the table says how many).
"""

from __future__ import annotations

import argparse
import gc
import itertools
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import rclpy
from _onboard import SHIP_FILE, onboard
from _tables import put, table
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.qos import QoSProfile

from shipdrag_ros.bags.durable import PartLimits
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.coastdown.warming import warm
from shipdrag_ros.messages import Source, encode
from shipdrag_ros.messages.heard import health_of
from shipdrag_ros.node.inputs import message_class
from shipdrag_ros.node.node import CoastdownNode
from shipdrag_ros.node.recorder import Recorder
from shipdrag_ros.node.session import Session
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import Block, Channel
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import (
    STOP,
    EngineOrder,
    Scenario,
    sense,
    simulate,
    standard_sensors,
)

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'results' / 'node_faults.txt'
SEED = 1
BURST = 473
KEPT = 1000  # messages that the publisher keeps for who is late
FLOOD_HZ, FLOOD_S, STOPPED_S = 2000.0, 6.0, 2.0
CYCLES = 1000
RATE_HZ = 10.0
EVERY_S, STOPPED_ENGINE_S = 7200.0, 1500.0  # a coastdown every two hours
FULL_HOURS = 2.5  # by then all rings are full

PARTS = ('flood', 'cycles', 'day')

Row = tuple[str, str]


def burst_and_flood() -> list[Row]:
    """Send faster than any instrument, also to a process that stands still."""
    with onboard(use_sim_time='false', diagnose='false') as node:
        type_name = 'geometry_msgs/msg/TwistStamped'
        heard: dict[str, int] = {}

        def hear(message: object) -> None:
            for health in health_of(message.status):  # type: ignore[attr-defined]
                status = health.of('input speed_through_water')
                assert status is not None
                for key in ('messages', 'messages lost'):
                    heard[key] = int(status.number(key) or 0)

        node.peer.create_subscription(
            message_class('diagnostic_msgs/msg/DiagnosticArray'), '/diagnostics', hear, 10
        )
        kind = message_class(type_name)
        publisher = node.peer.create_publisher(kind, 'speed_through_water', QoSProfile(depth=KEPT))
        while not publisher.get_subscription_count():
            node.spin_for(0.1)
        node.spin_for(2.0)

        def send(number: int) -> None:
            message = kind()
            message.header.stamp = node.peer.get_clock().now().to_msg()
            message.twist.linear.x = 5.0 + 1e-3 * (number % 7)
            publisher.publish(message)

        for number in range(BURST):
            send(number)
        node.spin_for(3.0)
        rows = [
            (
                f'{BURST} messages at once from a reliable publisher',
                f'{heard["messages"]} of {BURST} heard and recorded, '
                f'{heard["messages lost"]} counted lost',
            )
        ]
        sent, begin = BURST, time.monotonic()
        stops = iter([(1.0, signal.SIGSTOP), (1.0 + STOPPED_S, signal.SIGCONT), (1e9, 0)])
        at_s, number = next(stops)
        while (now_s := time.monotonic() - begin) < FLOOD_S:
            if now_s > at_s:
                os.kill(node.process.pid, number)
                at_s, number = next(stops)
            if sent - BURST < now_s * FLOOD_HZ:
                send(sent)
                sent += 1
            else:
                time.sleep(0.0005)
        node.spin_for(4.0)
        send(sent)  # by whose number what was lost before is seen
        sent += 1
        node.spin_for(4.0)
        total = heard['messages'] + heard['messages lost']
        rows.append(
            (
                f'up to {FLOOD_HZ:.0f} Hz for {FLOOD_S:.0f} s, the process stopped for '
                f'{STOPPED_S:.0f} s of it, a publisher that keeps {KEPT}',
                f'{sent} sent = {heard["messages"]} heard + {heard["messages lost"]} counted lost'
                f'{"" if total == sent else f" + {sent - total} NOT COUNTED"}',
            )
        )
    return rows


def cycles(count: int) -> list[Row]:
    """Configure, activate, deactivate and clean up again and again, in this process."""
    process = psutil.Process()
    seen: list[tuple[float, int, int]] = []
    with tempfile.TemporaryDirectory() as folder:
        line = ['--ros-args', '-p', f'ship_file:={SHIP_FILE}', '-p', f'output_directory:={folder}']
        line += ['-p', 'autostart:=false', '-p', 'nmea:=udp://127.0.0.1:10110']
        line += ['--log-level', 'error']
        context = rclpy.Context()
        rclpy.init(args=line, context=context)
        node = CoastdownNode(context=context, arguments=line)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        for number in range(count):
            for transition in (
                node.trigger_configure,
                node.trigger_activate,
                node.trigger_deactivate,
                node.trigger_cleanup,
            ):
                assert transition() is TransitionCallbackReturn.SUCCESS
                executor.spin_once(timeout_sec=0.0)
            if (number + 1) % (count // 10) == 0:
                gc.collect()
                memory_mb = process.memory_info().rss / 2**20
                seen.append((memory_mb, process.num_threads(), process.num_fds()))
                print(f'  cycle {number + 1}: {seen[-1]}', file=sys.stderr, flush=True)
        node.close()
        executor.shutdown()
        rclpy.try_shutdown(context=context)
    (first, threads, files), (last, threads_now, files_now) = seen[1], seen[-1]
    return [
        (
            f'{count} cycles of configure, activate, deactivate, cleanup',
            f'{first:.0f} MB after {count // 5}, {last:.0f} MB after {count}; threads '
            f'{threads} and {threads_now}, open files {files} and {files_now}',
        )
    ]


def sailing(hours: float) -> Iterator[Block]:
    """Speed and position of a ship that stops its engine every two hours, an hour at a time."""
    length_s = hours * 3600.0
    orders = [
        order
        for time_s in np.arange(0.0, length_s - EVERY_S, EVERY_S).tolist()
        for order in (
            EngineOrder(time_s, shaft=STOP.shaft, thrust=STOP.thrust),
            EngineOrder(time_s + STOPPED_ENGINE_S, shaft=1.0, thrust=1.0),
        )
    ]
    lead_in_s = EVERY_S - STOPPED_ENGINE_S
    scenario = Scenario(
        speed_m_s=8.2,
        lead_in_s=lead_in_s,
        duration_s=length_s - lead_in_s,
        orders=tuple(orders),
    )
    sensors = [
        sensor
        for sensor in standard_sensors(rate_hz=RATE_HZ)
        if sensor.channel in (Channel.SPEED_THROUGH_WATER, Channel.POSITION)
    ]
    block = sense(simulate(Ship.load(SHIP_FILE), scenario), sensors, seed=SEED)
    begin_ns = block.receive_ns[0]
    edges = begin_ns + np.arange(0.0, length_s + 1.0, 3600.0) * 1e9
    places = np.searchsorted(block.receive_ns, edges)
    for first, last in itertools.pairwise(places):
        yield block[slice(int(first), int(last))]


def day(hours: float) -> list[Row]:
    """Take a day of sailing through monitor and recorder, message by message."""
    ship, parameters = Ship.load(SHIP_FILE), Parameters()
    warm(parameters)
    process = psutil.Process()
    memory_mb: list[float] = []
    messages = coastdowns = 0
    began_s = time.process_time()

    def ended(*_: object) -> None:
        nonlocal coastdowns
        coastdowns += 1

    with tempfile.TemporaryDirectory() as folder:
        monitor = Monitor(ship, parameters)
        recorder = Recorder(
            Path(folder),
            namespace='',
            ship=ship,
            parameters=parameters,
            history_ns=monitor.history_ns,
            limits=PartLimits(),
        )
        recorder.start()
        session = Session(
            monitor, recorder, publish=lambda _: None, node='/coastdown_node', ended=ended
        )
        for block in list(sailing(hours)):
            for message in encode(block):
                source = Source(message.topic.lstrip('/'), message.type)
                session.receive(source, message.payload, message.log_ns)
            messages += len(block)
            gc.collect()
            memory_mb.append(process.memory_info().rss / 2**20)
            said = f'  hour {len(memory_mb)}: {memory_mb[-1]:.1f} MB, {coastdowns} coastdowns'
            print(said, file=sys.stderr, flush=True)
        session.finish()
        status = recorder.status()
    faster = hours * 3600.0 / (time.process_time() - began_s)
    full = min(int(np.ceil(FULL_HOURS)), len(memory_mb) - 1)
    later = np.arange(full, len(memory_mb))
    slope = np.polyfit(later, memory_mb[full:], 1)[0] if len(later) > 2 else float('nan')
    return [
        (
            f'{hours:g} h of sailing, speed and position at {RATE_HZ:g} Hz, a coastdown every '
            f'two hours, simulated (seed {SEED}), through monitor and recorder, '
            f'{faster:.0f} times faster than life by CPU time',
            f'{messages} messages, {coastdowns} coastdowns, {status.lost} messages lost; memory '
            f'{memory_mb[full]:.0f} MB after {full + 1} h, {memory_mb[-1]:.0f} MB after '
            f'{hours:g} h: {slope:+.2f} MB an hour',
        )
    ]


def main() -> None:
    """Print the table, and write it if asked to."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--hours', type=float, default=24.0, help='of simulated sailing')
    parser.add_argument('--cycles', type=int, default=CYCLES, help='of the life of a node')
    parser.add_argument(
        '--parts', nargs='+', choices=PARTS, default=PARTS, help='what to do (default: all)'
    )
    parser.add_argument('--write', action='store_true', help='put the tables into the page')
    options = parser.parse_args()
    does = {
        'flood': burst_and_flood,
        'cycles': lambda: cycles(options.cycles),
        'day': lambda: day(options.hours),
    }
    for part in options.parts:
        made = '\n'.join(table(['what', 'what comes of it'], does[part]()))
        print(made, flush=True)
        if options.write:
            put(PAGE, {part: made})


if __name__ == '__main__':
    main()
