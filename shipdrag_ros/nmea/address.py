# SPDX-License-Identifier: Apache-2.0
"""Where NMEA 0183 is heard, as a user writes it."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from enum import Enum

from shipdrag_ros.errors import ShipdragError

FORMS = 'udp://ADDRESS:PORT, tcp://HOST:PORT or serial:DEVICE:BAUD'
_NET = re.compile(r'(udp|tcp)://(\[[0-9A-Fa-f:.%\w]+\]|[^\s:/\[\]]+):(\d{1,5})(?:@([\d.]+))?')
_SERIAL = re.compile(r'serial:(/\S+):(\d{3,7})')


class Way(Enum):
    """How the bytes arrive."""

    UDP = 'udp'
    TCP = 'tcp'
    SERIAL = 'serial'


@dataclass(frozen=True)
class Address:
    """
    One source of NMEA 0183.

    Attributes
    ----------
    way
        How the bytes arrive.
    place
        Address to hear on (UDP), host to connect to (TCP), or path of a serial device.
    number
        Port, or rate of the serial line [baud].
    text
        As the user gave it.
    interface
        Address of the interface on which a multicast group is joined, '' for the one that the
        system chooses.
    """

    way: Way
    place: str
    number: int
    text: str
    interface: str = ''

    @property
    def is_multicast(self) -> bool:
        """Whether datagrams come to a group, which is to be joined."""
        return self.way is Way.UDP and _is_multicast(self.place)

    def __str__(self) -> str:
        return self.text

    @classmethod
    def parse(cls, text: str) -> Address:
        """
        Read an address such as `udp://0.0.0.0:10110` or `serial:/dev/ttyUSB0:4800`.

        Parameters
        ----------
        text
            In one of `FORMS`; an IPv6 address stands in square brackets. Behind a multicast
            group may follow the interface that joins it, `udp://239.192.0.1:60001@10.0.0.5`.

        Raises
        ------
        ShipdragError
            If it has none of the forms, the port is not 1 to 65535, or the interface is none.

        Examples
        --------
        >>> from shipdrag_ros.nmea.address import Address
        >>> Address.parse('udp://0.0.0.0:10110').number
        10110
        """
        if found := _NET.fullmatch(text):
            if not 0 < int(found[3]) < 65536:
                raise ShipdragError(f'NMEA source {text!r}: port {found[3]}, expected 1 to 65535')
            address = cls(Way(found[1]), found[2].strip('[]'), int(found[3]), text, found[4] or '')
            address._check_group()
            return address
        if found := _SERIAL.fullmatch(text):
            return cls(Way.SERIAL, found[1], int(found[2]), text)
        raise ShipdragError(f'NMEA source {text!r}: expected {FORMS}')

    def _check_group(self) -> None:
        if self.is_multicast and ':' in self.place:
            raise ShipdragError(
                f'NMEA source {self.text!r}: groups of IPv6 are not joined; give one of IPv4, '
                '224.0.0.0 to 239.255.255.255'
            )
        if not self.interface:
            return
        if not self.is_multicast:
            raise ShipdragError(
                f'NMEA source {self.text!r}: no interface is expected but for a multicast '
                'group, udp://224.0.0.0 to 239.255.255.255'
            )
        try:
            ipaddress.IPv4Address(self.interface)
        except ValueError as error:
            raise ShipdragError(
                f'NMEA source {self.text!r}: interface {self.interface!r}, expected the IPv4 '
                'address of one of this computer'
            ) from error


def _is_multicast(place: str) -> bool:
    try:
        return ipaddress.ip_address(place).is_multicast
    except ValueError:  # a name
        return False


def parse_addresses(text: str) -> tuple[Address, ...]:
    """
    Read addresses separated by blanks; one given twice counts once.

    Raises
    ------
    ShipdragError
        If one has none of the forms.
    """
    return tuple(Address.parse(each) for each in dict.fromkeys(text.split()))
