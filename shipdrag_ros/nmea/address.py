# SPDX-License-Identifier: Apache-2.0
"""Where NMEA 0183 is heard, as a user writes it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum

from shipdrag_ros.errors import ShipdragError

FORMS = 'udp://ADDRESS:PORT, tcp://HOST:PORT or serial:DEVICE:BAUD'
_NET = re.compile(r'(udp|tcp)://(\[[0-9A-Fa-f:.%\w]+\]|[^\s:/\[\]]+):(\d{1,5})')
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
    """

    way: Way
    place: str
    number: int
    text: str

    def __str__(self) -> str:
        return self.text

    @classmethod
    def parse(cls, text: str) -> Address:
        """
        Read an address such as `udp://0.0.0.0:10110` or `serial:/dev/ttyUSB0:4800`.

        Parameters
        ----------
        text
            In one of `FORMS`; an IPv6 address stands in square brackets.

        Raises
        ------
        ShipdragError
            If it has none of the forms, or the port is not 1 to 65535.

        Examples
        --------
        >>> from shipdrag_ros.nmea.address import Address
        >>> Address.parse('udp://0.0.0.0:10110').number
        10110
        """
        if found := _NET.fullmatch(text):
            if not 0 < int(found[3]) < 65536:
                raise ShipdragError(f'NMEA source {text!r}: port {found[3]}, expected 1 to 65535')
            return cls(Way(found[1]), found[2].strip('[]'), int(found[3]), text)
        if found := _SERIAL.fullmatch(text):
            return cls(Way.SERIAL, found[1], int(found[2]), text)
        raise ShipdragError(f'NMEA source {text!r}: expected {FORMS}')


def parse_addresses(text: str) -> tuple[Address, ...]:
    """
    Read addresses separated by blanks; one given twice counts once.

    Raises
    ------
    ShipdragError
        If one has none of the forms.
    """
    return tuple(Address.parse(each) for each in dict.fromkeys(text.split()))
