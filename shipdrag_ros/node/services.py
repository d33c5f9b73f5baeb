# SPDX-License-Identifier: Apache-2.0
"""What anybody on the ROS graph may ask of an active node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import Trigger

from shipdrag_ros.node.recorder import RecordingState
from shipdrag_ros.node.session import Session

INACTIVE = 'the node is not active'

SessionAction = Callable[[Session], tuple[bool, str]]


def add_services(node: Node, session: Callable[[], Session | None]) -> None:
    """
    Offer `~/start_recording`, `~/stop_recording` and `~/reset`.

    Parameters
    ----------
    session
        Returns that of the activation, None while there is none.
    """

    def start_recording(active: Session) -> tuple[bool, str]:
        active.recorder.start()
        return _recording(active)

    def stop_recording(active: Session) -> tuple[bool, str]:
        active.recorder.stop()
        return _recording(active)

    def reset(active: Session) -> tuple[bool, str]:
        active.reset('asked for', int(node.get_clock().now().nanoseconds))
        return True, 'all memory is dropped'

    def answered(action: SessionAction) -> Callable[[Any, Any], Any]:
        def answer(request: Any, response: Any) -> Any:
            active = session()
            found = (False, INACTIVE) if active is None else action(active)
            response.success, response.message = found
            return response

        return answer

    for action in (start_recording, stop_recording, reset):
        node.create_service(Trigger, f'~/{action.__name__}', answered(action))


def _recording(active: Session) -> tuple[bool, str]:
    status = active.recorder.status()
    return status.state is not RecordingState.FAILED, status.text
