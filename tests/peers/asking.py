# SPDX-License-Identifier: Apache-2.0
"""A peer that asks too much: one request with as many entries as it is told."""

from __future__ import annotations

import sys

import rclpy
from rcl_interfaces.msg import Parameter, ParameterType
from rcl_interfaces.srv import GetParameters, SetParameters

name, count = sys.argv[1], int(sys.argv[2])
rclpy.init()
node = rclpy.create_node('asking')
if name == 'set_parameters':
    entry = Parameter(name='window_s')
    entry.value.type = ParameterType.PARAMETER_DOUBLE
    entry.value.double_value = 900.0
    request = SetParameters.Request(parameters=[entry] * count)
    client = node.create_client(SetParameters, f'/coastdown_node/{name}')
else:
    request = GetParameters.Request(names=['window_s'] * count)
    client = node.create_client(GetParameters, f'/coastdown_node/{name}')
client.wait_for_service(timeout_sec=20.0)
print('asking', flush=True)
future = client.call_async(request)
rclpy.spin_until_future_complete(node, future, timeout_sec=60.0)
print('answered' if future.done() else 'no answer', flush=True)
