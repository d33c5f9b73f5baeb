# SPDX-License-Identifier: Apache-2.0
"""
What a peer may ask of the node: services and parameters.

No illegal transition ends it, no flood holds it up.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from time import monotonic
from types import SimpleNamespace
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.service import Service
from std_srvs.srv import Trigger

from shipdrag_ros.display import printable
from shipdrag_ros.errors import ParameterError
from shipdrag_ros.fields import parse, text_of
from shipdrag_ros.node.recorder import RecordingState
from shipdrag_ros.node.session import Session
from shipdrag_ros.node.settings import KEYS, START_ONLY, NodeSettings, about, sections

LONGEST = 1000  # names or parameters of a request
_Convert = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
_api = ctypes.pythonapi
_api.PyCapsule_GetPointer.restype = ctypes.c_void_p
_api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
_api.PyCapsule_New.restype = ctypes.py_object
_api.PyCapsule_New.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]


class TooLong:
    """Stands for a request that was not unpacked."""


def unpack_no_giants(service: Service) -> None:
    """
    Let a service be called with `TooLong` instead of a request of more than `LONGEST` entries.

    rclpy makes Python objects of a whole request before anybody can look at it: of 300 000
    parameters for half a minute, in which nothing else runs. The message lies in memory by
    then, with its number of entries at its beginning; one that has too many is not unpacked.

    Parameters
    ----------
    service
        One whose requests do not begin with a sequence stays as it is.
    """
    kind: Any = service.srv_type
    support: Any = type(kind.Request)
    first = next(iter(kind.Request.get_fields_and_field_types().values()), '')
    if not first.startswith('sequence<') or support._CONVERT_TO_PY is None:
        return
    unpack = _Convert(_api.PyCapsule_GetPointer(support._CONVERT_TO_PY, None))

    def convert(message: int) -> Any:
        # C holds a sequence as its address, its size and its capacity
        size = ctypes.c_size_t.from_address(message + ctypes.sizeof(ctypes.c_void_p)).value
        return unpack(message) if size <= LONGEST else TooLong()

    called = _Convert(convert)

    class Counted(support):
        """The type of a request, as rclpy looks for what to do with it."""

        _CONVERT_TO_PY = _api.PyCapsule_New(ctypes.cast(called, ctypes.c_void_p), None, None)
        keeps = called  # as long as it can be called

    request = Counted('Request', (), {})
    service.srv_type = SimpleNamespace(Request=request, Response=kind.Response)


CHANGES = (2.0, 20.0)  # a second in the long run, and at once
TRIGGERS = (0.2, 10.0)  # each may make a file, or drop an hour of memory
READS = (50.0, 200.0)
TOO_LONG = f'refused: more than {LONGEST} entries'
REFUSED = 'refused: asked too often; ask again in some seconds'
NO_TYPE = 'refused: a parameter of an unknown type'
_TYPES = frozenset(kind.value for kind in Parameter.Type)
_LIMITS = {
    'Trigger': TRIGGERS,
    'ChangeState': CHANGES,
    'SetParameters': CHANGES,
    'SetParametersAtomically': CHANGES,
}
INACTIVE = 'the node is not active'


class RateLimit:
    """
    Allows a burst, and then so many a second.

    Parameters
    ----------
    per_second
        Allowed in the long run [1/s].
    at_once
        Allowed after a pause.
    clock
        Steady time [s].
    """

    def __init__(
        self, per_second: float, at_once: float, *, clock: Callable[[], float] = monotonic
    ) -> None:
        self._per_second = per_second
        self._at_once = at_once
        self._clock = clock
        self._left = at_once
        self._asked_s = clock()

    def allows(self) -> bool:
        """
        Say whether one more is allowed now.
        """
        now_s = self._clock()
        self._left += (now_s - self._asked_s) * self._per_second
        self._left = min(self._left, self._at_once)
        self._asked_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


def limit_services(services: Iterable[Service], warn: Callable[[str], object]) -> None:
    """
    Let each service refuse what comes too often, is too long, or is no transition.

    Parameters
    ----------
    services
        Those that change something have the narrower limit.
    warn
        Called once a burst with the service that refuses.
    """
    for service in services:
        limit = RateLimit(*_LIMITS.get(service.srv_type.__name__, READS))
        if service.srv_type is ChangeState:
            _refuse_illegal(service, warn)
        unpack_no_giants(service)
        service.callback = _limited(service.callback, limit, service.srv_name, warn)


def _refuse_illegal(change_state: Service, warn: Callable[[str], object]) -> None:
    """Refuse transitions that are not there; rclpy would raise out of the executor."""
    change = change_state.callback

    def refuse_or_change(request: Any, response: Any) -> Any:
        label = request.transition.label
        try:
            if not label.isprintable():  # rcl would print it as it is
                raise rclpy_implementation.RCLError(f'no transition is named {label!r}')
            return change(request, response)
        except rclpy_implementation.RCLError as error:
            warn(f'transition refused: {printable(str(error))}')
            response.success = False
            return response

    change_state.callback = refuse_or_change


def _limited(
    answer: Callable[[Any, Any], Any],
    limit: RateLimit,
    name: str,
    warn: Callable[[str], object],
) -> Callable[[Any, Any], Any]:
    refusing = False

    def limited(request: Any, response: Any) -> Any:
        nonlocal refusing
        if isinstance(request, TooLong):
            warn(f'{name}: {TOO_LONG}')
            return _refuse(request, response, TOO_LONG)
        if limit.allows():
            refusing = False
            # of another type rclpy would raise out of the executor
            if all(each.value.type in _TYPES for each in getattr(request, 'parameters', ())):
                return answer(request, response)
            warn(f'{name}: {NO_TYPE}')
            return _refuse(request, response, NO_TYPE)
        if not refusing:
            refusing = True
            warn(f'{name}: asked too often, requests are refused')
        return _refuse(request, response, REFUSED)

    return limited


def _refuse(request: Any, response: Any, why: str) -> Any:
    """Say no in the words of the service; what only reads gives nothing."""
    refusal = SetParametersResult(successful=False, reason=why)
    if hasattr(response, 'success'):
        response.success = False
    if hasattr(response, 'message'):
        response.message = why
    if isinstance(response, SetParameters.Response):
        many = isinstance(request, TooLong)
        response.results = [refusal] * (LONGEST if many else len(request.parameters))
    elif isinstance(response, SetParametersAtomically.Response):
        response.result = refusal
    return response


def add_services(node: Node, session: Callable[[], Session | None]) -> None:
    """
    Offer `~/start_recording`, `~/stop_recording`, `~/engine_stopped` and `~/reset`.

    Parameters
    ----------
    session
        Returns that of the activation, None while there is none.
    """

    def answer(asked: str, request: Any, response: Any) -> Any:
        active, now_ns = session(), int(node.get_clock().now().nanoseconds)
        if active is None:
            response.success, response.message = False, INACTIVE
        elif asked == 'engine_stopped':
            response.success, response.message = active.engine_stopped(now_ns)
        elif asked == 'reset':
            active.reset('asked for', now_ns)
            response.success, response.message = True, 'all memory is dropped'
        else:
            if asked == 'start_recording':
                active.recorder.start()
            else:
                active.recorder.stop()
            status = active.recorder.status()
            response.success = status.state is not RecordingState.FAILED
            response.message = status.text
        return response

    for name in ('start_recording', 'stop_recording', 'engine_stopped', 'reset'):
        node.create_service(Trigger, f'~/{name}', partial(answer, name))


ROS_OWN = ('use_sim_time', 'start_type_description_service')  # declared by rclpy itself
SUBJECT = 'node parameters'


class NodeParameters:
    """
    The declared parameters: checked together, fixed while configured.

    Parameters
    ----------
    node
        Made with `automatically_declare_parameters_from_overrides`, so that unknown names and
        values without a type are seen.
    arguments
        Command line, to check its parameter files.

    Raises
    ------
    ParameterError
        Naming every unknown key and every bad value at once.
    """

    def __init__(self, node: Node, arguments: Sequence[str]) -> None:
        _check_sections(arguments, node)
        self._node = node
        self.fixed = False
        given = {name: each.value for name, each in node.get_parameters_by_prefix('').items()}
        own = {name: given.pop(name) for name in ROS_OWN}
        if bad := [f'{name}: {own[name]!r}' for name in own if not isinstance(own[name], bool)]:
            raise ParameterError(SUBJECT, [f'{each}, expected true or false' for each in bad])
        given = {name: given[name] for name in given if not name.startswith('qos_overrides.')}
        values = NodeSettings.from_mapping(given, subject=SUBJECT).to_mapping()
        for name in given:
            node.undeclare_parameter(name)
        for name, value in values.items():
            node.declare_parameter(name, value, _descriptor(name), ignore_override=True)
        node.add_on_set_parameters_callback(self._on_set)

    def settings(self) -> NodeSettings:
        """
        Return what is set now.
        """
        return NodeSettings.from_mapping(self._values(), subject=SUBJECT)

    def _values(self) -> dict[str, Any]:
        return {name: self._node.get_parameter(name).value for name in KEYS}

    def _on_set(self, changes: list[Parameter]) -> SetParametersResult:
        ours = {*KEYS, 'use_sim_time'}
        changed = {change.name: change.value for change in changes if change.name in ours}
        reason = ''
        if changed and self.fixed:
            reason = f'{", ".join(changed)}: read-only while configured; clean up first'
        elif changed:
            changed.pop('use_sim_time', None)
            try:
                NodeSettings.from_mapping({**self._values(), **changed}, subject=SUBJECT)
            except ParameterError as error:
                reason = '; '.join(error.problems)
        return SetParametersResult(successful=not reason, reason=reason)


def _descriptor(name: str) -> ParameterDescriptor:
    kind, start_only = KEYS[name].kind, name in START_ONLY
    descriptor = ParameterDescriptor(
        name=name,
        description=about(name),
        additional_constraints=(
            'set at the start alone' if start_only else 'read-only while configured'
        ),
        read_only=start_only,
    )
    if kind.choices:
        allowed = ', '.join(filter(None, kind.choices))
        descriptor.additional_constraints += f'; one of {allowed}'
    if kind.low is None or kind.high is None:
        return descriptor
    if isinstance(KEYS[name].default, int):
        limits = IntegerRange(from_value=int(kind.low), to_value=int(kind.high))
        descriptor.integer_range = [limits]
    else:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(kind.low), to_value=float(kind.high))
        ]
    return descriptor


def _check_sections(arguments: Sequence[str], node: Node) -> None:
    """
    Refuse a parameter file none of whose sections is for this node.

    Parameters
    ----------
    arguments
        The command line, `--params-file FILE` in it.

    Raises
    ------
    ParameterError
        Naming the sections there are.
    """
    name = node.get_fully_qualified_name()
    for flag, path in pairwise(arguments):
        if flag != '--params-file':
            continue
        text = text_of(path, what='a parameter file', error=ParameterError)
        found = [where for where, _ in sections(parse(text, subject=path, error=ParameterError))]
        if not any(_pattern(section).fullmatch(name) for section in found):
            raise ParameterError(
                path,
                [f'sections are {found!r}, expected one for {name!r}; "/**" is for any node'],
            )


def _pattern(section: str) -> re.Pattern[str]:
    parts = {'/**': '(/[^/]+)*', '/*': '/[^/]+'}
    return re.compile(
        ''.join(parts.get(part, re.escape(part)) for part in re.findall('/[^/]+', section))
    )
