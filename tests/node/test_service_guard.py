# SPDX-License-Identifier: Apache-2.0
"""A burst is answered, a flood is refused, and an honest peer is heard again after it."""

from __future__ import annotations

from time import monotonic

import pytest

pytest.importorskip('rclpy')

from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import (
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from std_srvs.srv import Trigger

from shipdrag_ros.node.requests import CHANGES, NO_TYPE, TRIGGERS, RateLimit, limit_services


def test_a_burst_and_then_so_many_a_second() -> None:
    now_s = 100.0
    limit = RateLimit(2.0, 5.0, clock=lambda: now_s)
    assert [limit.allows() for _ in range(7)] == [True] * 5 + [False] * 2
    now_s += 0.5
    assert [limit.allows() for _ in range(2)] == [True, False]
    now_s += 3600.0
    assert [limit.allows() for _ in range(6)] == [True] * 5 + [False]


class Served:
    """What `limit_services` needs of a service: its type, name and callback."""

    def __init__(self, srv_type: type) -> None:
        self.srv_type = srv_type
        self.srv_name = '/asked'
        self.answered = 0
        self.callback = self.answer

    def answer(self, request: object, response: object) -> object:
        self.answered += 1
        return response


@pytest.mark.parametrize('kind', [Trigger, ChangeState, SetParameters, SetParametersAtomically])
def test_each_service_refuses_in_its_own_words(kind: type) -> None:
    service, warned = Served(kind), []
    limit_services([service], warned.append)
    request = kind.Request()
    if hasattr(request, 'parameters'):
        request.parameters = [Parameter(name='a'), Parameter(name='b')]
    per_second, at_once = TRIGGERS if kind is Trigger else CHANGES
    began_s = monotonic()
    while not warned:
        last = service.callback(request, kind.Response())
        assert service.answered <= 500
    later = per_second * (monotonic() - began_s)  # allowed meanwhile, on a busy machine
    assert at_once <= service.answered <= at_once + later + 1
    if kind is SetParameters:
        assert [one.successful for one in last.results] == [False, False]
    elif kind is SetParametersAtomically:
        assert not last.result.successful
    else:
        assert not last.success


def test_what_only_reads_may_be_asked_more_often() -> None:
    for kind in (GetParameters, ListParameters):
        service, warned = Served(kind), []
        limit_services([service], warned.append)
        for _ in range(150):
            service.callback(kind.Request(), kind.Response())
        assert service.answered == 150
        while not warned:
            last = service.callback(kind.Request(), kind.Response())
            assert service.answered <= 5000
        assert last == kind.Response()  # nothing, which can be sent


@pytest.mark.parametrize('kind', [SetParameters, SetParametersAtomically])
def test_a_parameter_of_no_type_never_comes_to_rclpy_which_would_end_the_node(kind: type) -> None:
    service, warned = Served(kind), []
    limit_services([service], warned.append)
    odd = Parameter(name='window_s', value=ParameterValue(type=99))
    request = kind.Request(parameters=[Parameter(name='a'), odd])
    response = service.callback(request, kind.Response())
    assert service.answered == 0
    results = response.results if kind is SetParameters else [response.result]
    assert {(each.successful, each.reason) for each in results} == {(False, NO_TYPE)}
    assert warned == [f'/asked: {NO_TYPE}']
