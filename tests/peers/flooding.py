# SPDX-License-Identifier: Apache-2.0
"""A driver that has gone mad: sends as fast as it can on one topic for some seconds."""

from __future__ import annotations

import sys
import time

import rclpy
from geometry_msgs.msg import TwistStamped

rclpy.init()
node = rclpy.create_node('flooding')
publisher = node.create_publisher(TwistStamped, 'wind_apparent', 1000)
message = TwistStamped()
end_s = time.monotonic() + float(sys.argv[1])
sent = 0
while time.monotonic() < end_s:
    for _ in range(10):
        now_ns = time.time_ns()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(now_ns, 10**9)
        message.twist.linear.x = -5.0 - 1e-6 * sent
        publisher.publish(message)
        sent += 1
    time.sleep(0.0005)
print(sent)
