# SPDX-License-Identifier: Apache-2.0
"""A session without ROS, with what it published."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.messages import EncodedMessage, EventKind, OutputMessage, Source, read_event
from shipdrag_ros.node.recorder import Recorder
from shipdrag_ros.node.session import Session
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.ship import Ship

NODE = '/coastdown_node'


class Desk:
    """A session that records into a folder."""

    def __init__(self, directory: Path, ship: Ship, parameters: Parameters) -> None:
        self.ready = True
        monitor = Monitor(ship, parameters)
        self.published: list[OutputMessage] = []
        self.directory = directory
        self.recorder = Recorder(
            directory,
            namespace='',
            ship=ship,
            parameters=parameters,
            history_ns=monitor.history_ns,
        )
        self.session = Session(
            monitor,
            self.recorder,
            publish=self.published.append,
            node=NODE,
            ready=lambda: self.ready,
        )

    def receive(self, messages: Iterable[EncodedMessage]) -> None:
        for message in messages:
            source = Source(message.topic.strip('/'), message.type)
            self.session.receive(source, message.payload, message.log_ns)

    def kinds(self) -> list[EventKind]:
        """What was said on `~/events`."""
        events = [it for it in self.published if it.topic == f'{NODE}/events']
        return [read_event(it.payload).kind for it in events]

    def recorded(self) -> list[Path]:
        """Finish, and return the bags in their order."""
        self.session.finish()
        return sorted(self.directory.glob('*.mcap'))
