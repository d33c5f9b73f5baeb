# SPDX-License-Identifier: Apache-2.0
"""
The onboard node: lifecycle and wiring, nothing else.

Between its topics stand the same decoder, monitor and encoder as in replay.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from shipdrag_ros.bags.durable import PartLimits
from shipdrag_ros.bags.retention import Keep
from shipdrag_ros.coastdown import Monitor
from shipdrag_ros.display import json_text
from shipdrag_ros.errors import ShipdragError, ShipFileError
from shipdrag_ros.messages import OUTPUT_TOPICS, TOPICS, EventKind, OutputMessage, Source
from shipdrag_ros.messages.topics import ERROR, Health, Status, diagnosis_message
from shipdrag_ros.node import health
from shipdrag_ros.node.announcer import Announcer
from shipdrag_ros.node.background import Compiling, Diagnosing, DiagnosisStatus
from shipdrag_ros.node.inputs import LATCHED, InputTopic, Mailbox, message_class
from shipdrag_ros.node.nmea_feed import NmeaFeed
from shipdrag_ros.node.recorder import Recorder
from shipdrag_ros.node.requests import NodeParameters, add_services, limit_services
from shipdrag_ros.node.session import Session, Watching
from shipdrag_ros.node.settings import NodeSettings
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.samples import ALL_MOTION, MOTION_INPUTS
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effects import carrying, checked

NAME = 'coastdown_node'
LOOK_S = 0.2  # a driver that starts is heard this soon; a look costs 0.1 ms
DIAGNOSTICS_S = 1.0
TURNS = 25  # of the mailbox before a tick, after a pause
FIRST_S = 0.3  # by then who listens is found; compiling begins behind it


class CoastdownNode(LifecycleNode):
    """
    Managed node that estimates resistance from coastdowns.

    Parameters
    ----------
    arguments
        Command line, to check its parameter files.

    Attributes
    ----------
    shown
        Called with the health every second, for a terminal.

    Raises
    ------
    ParameterError
        If a parameter is unknown, of the wrong type or out of range.
    """

    def __init__(self, *, context: Context, arguments: Sequence[str] = ()) -> None:
        super().__init__(
            NAME, context=context, automatically_declare_parameters_from_overrides=True
        )
        self._node_parameters = NodeParameters(self, arguments)
        self._failure: ShipdragError | None = None
        self._settings: NodeSettings | None = None
        self._ship: Ship | None = None
        self._recorder: Recorder | None = None
        self._announcer = Announcer(self.get_logger())
        self._session: Session | None = None
        self._compiling: Compiling | None = None
        self._diagnosing: Diagnosing | None = None
        self._diagnosed: DiagnosisStatus | None = None
        self._ahead = ''
        self._input_topics: list[InputTopic] = []
        self._nmea: NmeaFeed | None = None
        self._input_states = health.InputStates()
        self._mailbox = Mailbox(())
        self._watching = Watching((), Parameters(), simulated=False)
        self._outputs: dict[str, Publisher] = {}
        self.shown: Callable[[Health], None] = lambda health: None
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # runs without /clock
        self.create_timer(DIAGNOSTICS_S, self._publish_diagnostics, clock=steady)
        self._first = self.create_timer(FIRST_S, self._publish_diagnostics, clock=steady)
        self.create_timer(LOOK_S, self._look, clock=steady)
        add_services(self, lambda: self._session)
        services = (*self.services, self._service_change_state)  # which rclpy does not list
        limit_services(services, self.get_logger().warning)

    def declare_parameters(
        self, namespace: str, parameters: list[Any], ignore_override: bool = False
    ) -> Any:
        """
        Declare as rclpy does, and values without a type too, as `[]` is, for us to refuse.
        """
        for _, value, descriptor in parameters:
            descriptor.dynamic_typing |= value is None
        return super().declare_parameters(namespace, parameters, ignore_override)

    def start(self) -> None:
        """
        Configure and activate if `autostart` is set.

        Raises
        ------
        ShipdragError
            Why that is impossible.
        """
        if not self._node_parameters.settings().autostart:
            self.get_logger().info('waiting to be configured: autostart is false')
            return
        for trigger in (self.trigger_configure, self.trigger_activate):
            if trigger() is not TransitionCallbackReturn.SUCCESS:
                raise self._failure or ShipdragError('the node did not start, see its log')

    def close(self) -> None:
        """
        End what is running and destroy the node; ROS may be gone already.
        """
        if self._diagnosing is not None:
            self._diagnosing.close()  # the coastdown that ends now will not be diagnosed
        self._release('the process ends')
        self.destroy_node()

    # lifecycle

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Check the settings, load the ship, make the topics."""
        return self._attempt(self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to estimate, and to record if so set."""
        return self._attempt(self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give the last figures and close the bag."""
        return self._attempt(lambda: self._deactivate('deactivated'))

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Drop the topics; parameters may be set again, after an error too."""
        return self._attempt(self._release)

    on_shutdown = on_error = on_cleanup

    def _attempt(self, action: Callable[[], None]) -> TransitionCallbackReturn:
        """Run a transition; rclpy would swallow what it raises."""
        try:
            action()
        except ShipdragError as error:
            self._failure = error
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        except Exception:
            self.get_logger().fatal(traceback.format_exc())
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def _configure(self) -> None:
        settings = self._node_parameters.settings()
        if not settings.ship_file:
            raise ShipFileError('ship_file', ["is '', expected the path of a ship file"])
        _, directory = settings.paths()
        self._ship = carrying(checked(Ship.load(settings.ship_file)))
        self._settings = settings
        self.get_logger().info(f'recordings are written to {directory}')
        self._diagnosing = Diagnosing(self._ship, settings.parameters, enabled=settings.diagnose)
        for topic in OUTPUT_TOPICS:
            qos = LATCHED if topic.latched else QoSProfile(depth=10)
            publisher = self.create_publisher(message_class(topic.type), f'~/{topic.name}', qos)
            self._outputs[topic.under(self.get_fully_qualified_name())] = publisher
        self._outputs['ship'] = self.create_publisher(String, '~/ship', LATCHED)
        self._outputs['ship'].publish(String(data=self._ship.to_yaml()))
        self._input_topics = [
            InputTopic(
                self,
                name,
                accepted=accepted,
                fixed=settings.types.get(name, ''),
                arrived=self._hear,
                simulated=self._simulated,
            )
            for name, accepted in TOPICS.items()
        ]
        self._input_states = health.InputStates()
        self._mailbox = Mailbox(self._input_topics)
        self._nmea = NmeaFeed(self, settings, session=lambda: self._session)
        self._nmea.start(self._input_topics)
        self._node_parameters.fixed = True
        if self._compiling is None or self._compiling.estimator != settings.parameters.estimator:
            self._compiling = Compiling(settings.parameters)
        effective = ', '.join(f'{name}={value!r}' for name, value in settings.to_mapping().items())
        self.get_logger().info(f'configured: {effective}')

    def _activate(self) -> None:
        assert self._ship is not None
        assert self._settings is not None
        assert self._diagnosing is not None
        assert self._compiling is not None
        assert self._nmea is not None
        self._nmea.renew()
        monitor = Monitor(self._ship, self._settings.parameters)
        self._recorder = Recorder(
            Path(self._settings.output_directory),
            namespace=self.get_namespace().rstrip('/'),
            ship=self._ship,
            parameters=self._settings.parameters,
            history_ns=monitor.history_ns,
            limits=PartLimits(self._settings.part_size_bytes, self._settings.part_duration_s),
            keep=Keep(self._settings.keep_days, self._settings.keep_bytes),
        )
        self._session = Session(
            monitor,
            self._recorder,
            publish=self._send,
            node=self.get_fully_qualified_name(),
            ended=self._diagnosing.begin,
            on_event=self._announcer.event,
            ready=self._compiling.done,
        )
        self._watching = Watching(
            self._input_topics, self._settings.parameters, simulated=self._simulated
        )
        if self._settings.record:
            self._recorder.start()
        self._session.note(EventKind.LIFECYCLE, 'active', self._now_ns())
        recording = self._recorder.status()
        self.get_logger().info(f'active; {recording.text}; {recording.kept}')
        self._announcer.status(health.recording_status(recording))

    def _deactivate(self, why: str) -> None:
        if self._session is not None:
            session, self._session = self._session, None
            session.note(EventKind.LIFECYCLE, why, self._now_ns())
            session.finish()
            left = f'; {session.waiting} messages are for a replay' if session.waiting else ''
            self.get_logger().info(f'{why}; {session.recorder.status().text}{left}')

    def _release(self, why: str = 'released') -> None:
        self._deactivate(why)
        if self._diagnosing is not None:
            self._diagnosing.close()
        if self._nmea is not None:
            self._nmea.close()
        self._diagnosing = self._nmea = None
        for topic in self._input_topics:
            topic.close()
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        self._input_topics, self._outputs = [], {}
        self._mailbox = Mailbox(())
        self._ship = self._settings = self._recorder = None
        self._node_parameters.fixed = False

    @property
    def _compiling_s(self) -> float | None:
        work = self._compiling
        return None if work is None or work.done() else work.seconds

    @property
    def _simulated(self) -> bool:
        return bool(self.get_parameter('use_sim_time').value)

    # traffic

    def _send(self, message: OutputMessage) -> None:
        if self.context.ok():  # after an outside shutdown the bag alone gets the last figures
            self._outputs[message.topic].publish(message.payload)

    def _now_ns(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _hear(self) -> bool:
        """Take what has come on all topics, in its order; say whether that was anything."""
        if self._session is not None and self._session.full:
            return False  # each input keeps some more, and counts what it drops
        taken = self._mailbox.take(ahead=not self._simulated)
        for topic, type_name, data, received_ns in taken:
            now_ns = self._now_ns()
            if self._session is None or now_ns == 0:  # 0: sim time before the first /clock
                topic.unused += 1
                continue
            source = Source(topic.name, type_name)
            if self._nmea is not None and not self._nmea.admits(source, data, now_ns):
                continue
            self._watching.watch_clock(self._session, now_ns)
            count = partial(topic.count, received_ns=0 if self._simulated else received_ns)
            # by the clock of the node, and not when it comes to it: what waited is no younger
            arrival_ns = now_ns if self._simulated else min(received_ns or now_ns, now_ns)
            self._session.receive(source, data, arrival_ns, count)
        return bool(taken)

    def _look(self) -> None:
        for topic in self._input_topics:
            topic.look()
        self._hear()  # what a changed subscription left, and what a limit held back
        if self._session is not None:
            self._announcer.compiling(self._compiling, self._session.waiting)
            self._session.go_on()

    # health

    def _publish_diagnostics(self) -> None:
        self._first.cancel()
        for _ in range(TURNS):  # what came before this tick is timed before it
            if self._simulated or not self._hear():
                break
        now_ns = self._now_ns()
        session = self._session
        judged = {} if session is None else session.monitor.counts()
        if session is not None:
            self._watching.tick(session, judged, now_ns)
            for part in session.recorder.removed():
                self.get_logger().warning(part.text)
                session.note(EventKind.FILES, part.text, now_ns)
        # what is odd besides what became of readings, which nobody has judged while code compiles
        doubts = {}
        if session is not None and self._compiling_s is None:
            doubts = session.monitor.doubts() | self._watching.doubts()
        facts = [
            topic.facts(judged.get(topic.name), doubts.get(topic.name, ''))
            for topic in self._shown_topics
        ]
        states = self._input_states.tick(facts, simulated=self._simulated)
        self._rebind(states, now_ns)
        standing = self._standing(states, now_ns)
        statuses = [health.state_status(standing, states), *(state.status for state in states)]
        if self._nmea is not None:
            statuses += self._nmea.statuses()
        if self._recorder is not None:
            statuses.append(health.recording_status(self._recorder.status()))
            self._announcer.status(statuses[-1])
        if session is not None:
            statuses.append(health.estimate_status(session.latest, session.why_none))
            self._announcer.inputs(states)
            self._announcer.silence(states, standing.candidates)
        if self._diagnosing is not None:
            found = self._diagnosing.status
            if session is not None and self._compiling is not None and self._compiling.done():
                self._diagnosing.look_ahead(session.monitor)
            statuses.append(health.diagnosis_status(found, self._diagnosing.ahead))
            if found is not self._diagnosed:
                self._diagnosed = found
                self._publish_diagnosis(found, now_ns)
                self.get_logger().info(f'diagnosis: {statuses[-1].message}')
            if self._diagnosing.ahead != self._ahead:  # also why it could not be foretold
                self._ahead = self._diagnosing.ahead
                self.get_logger().info(self._ahead)
        message = DiagnosticArray(status=[self._labelled(each) for each in statuses])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)
        self.shown(Health(tuple(statuses)))
        if self._compiling is not None:
            self._compiling.begin()

    def _labelled(self, status: Status) -> DiagnosticStatus:
        """Return a status as a message that says whose it is, as diagnostic_updater has it."""
        return DiagnosticStatus(
            level=bytes([status.level]),
            name=f'{self.get_fully_qualified_name().lstrip("/")}: {status.part}',
            message=status.message,
            hardware_id='' if self._ship is None else self._ship.name,
            values=[KeyValue(key=key, value=text) for key, text in status.values.items()],
        )

    def _publish_diagnosis(self, status: DiagnosisStatus, now_ns: int) -> None:
        if status.found is None or status.coastdown is None:
            return
        text = json_text(status.found, indent=None)
        node = self.get_fully_qualified_name()
        message = diagnosis_message(text, status.coastdown.end_ns, node=node)
        if self._session is None:
            self._send(message)
        else:
            self._session.note_diagnosis(message, now_ns)

    def _rebind(self, states: Sequence[health.InputFacts], now_ns: int) -> None:
        """Give up a type that is no use where another is published; said and recorded."""
        if self._session is None or self._compiling_s is not None:
            return  # nothing was judged yet
        for topic, state in zip(self._shown_topics, states, strict=True):
            text = state.finding.text
            if (not state.fresh or state.finding.level >= ERROR) and topic.rebind(text):
                said = f'{topic.name}: now {topic.type}; before: {text}'
                self._session.note(EventKind.SOURCE, said, now_ns)

    @property
    def _shown_topics(self) -> list[InputTopic]:
        return [topic for topic in self._input_topics if topic.is_shown]

    def _standing(self, states: Sequence[health.InputFacts], now_ns: int) -> health.Standing:
        session, settings = self._session, self._settings
        hint, own = '', (self.get_name(), self.get_namespace())
        if not any(each.fresh for each in states if each.name in ALL_MOTION):
            name = self.get_fully_qualified_name()
            others = [
                (topic, types)
                for topic, types in self.get_topic_names_and_types()
                if not topic.startswith(f'{name}/')  # what NMEA feeds is published there
            ]
            taken = [topic.topic for topic in self._input_topics]
            by_nmea = '' if self._nmea is None else self._nmea.silence()
            fitting = health.candidates(others, MOTION_INPUTS, taken=taken)
            hint = '; '.join(filter(None, [by_nmea, fitting]))
        return health.Standing(
            self._state_machine.current_state[1],
            None if session is None else session.monitor,
            now_ns,
            self._simulated,
            candidates=hint,
            compiling_s=self._compiling_s,
            waiting=0 if session is None else session.waiting,
            namesakes=max(self.get_node_names_and_namespaces().count(own) - 1, 0),
            steady_needed_s=0.0 if settings is None else settings.parameters.slope_window_s,
        )
