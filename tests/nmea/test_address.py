# SPDX-License-Identifier: Apache-2.0
"""Where NMEA is heard, as written by a user."""

from __future__ import annotations

import pytest

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.nmea.live import Address, Way, parse_addresses


def test_each_form() -> None:
    found = parse_addresses(
        'udp://0.0.0.0:10110 tcp://mux.local:2000 tcp://[::1]:2000 serial:/dev/ttyUSB0:4800 '
        'udp://0.0.0.0:10110'
    )
    assert [(each.way, each.place, each.number) for each in found] == [
        (Way.UDP, '0.0.0.0', 10110),
        (Way.TCP, 'mux.local', 2000),
        (Way.TCP, '::1', 2000),
        (Way.SERIAL, '/dev/ttyUSB0', 4800),
    ]
    assert str(found[0]) == 'udp://0.0.0.0:10110'
    assert parse_addresses('') == ()


@pytest.mark.parametrize(
    'text',
    [
        'udp://127.0.0.1:1@127.0.0.1',
        'udp://239.192.0.1:1@999.0.0.1',
        'udp://:1',
        'udp://a',
        'udp://a:0',
        'tcp://a:65536',
        'serial:ttyUSB0:4800',
        'http://a:1',
    ],
)
def test_what_is_no_address_says_what_is(text: str) -> None:
    with pytest.raises(ShipdragError, match='expected'):
        Address.parse(text)


def test_a_group_may_name_its_interface() -> None:
    group, one, other = parse_addresses(
        'udp://239.192.0.1:60001@127.0.0.1 udp://224.0.0.1:1 udp://10.0.0.1:1'
    )
    assert group.is_multicast
    assert (group.place, group.number, group.interface) == ('239.192.0.1', 60001, '127.0.0.1')
    assert str(group) == 'udp://239.192.0.1:60001@127.0.0.1'
    assert one.is_multicast
    assert not other.is_multicast
    with pytest.raises(ShipdragError, match='groups of IPv6 are not joined'):
        Address.parse('udp://[ff02::1]:60001')
