# SPDX-License-Identifier: Apache-2.0
"""
The same minute of one ship as loggers of every format write it.

Written from the formats' own descriptions; nothing here is shared with the
importers. `ardupilot` and `ulog` follow the layouts of their documentation, the
bags are made by `rosbags`.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

START = datetime(2024, 5, 17, 9, 30, 0, tzinfo=UTC)
ROWS = 60
KNOT = 1852.0 / 3600.0


def stw(k: int) -> float:
    """Return the speed through water [m/s]."""
    return round(6.0 - 0.02 * k, 3)


def sog(k: int) -> float:
    """Return the speed over ground [m/s]."""
    return round(6.3 - 0.02 * k, 3)


def latitude(k: int) -> float:
    """Return the latitude [deg], going north at about the speed over ground."""
    return 54.5 + sum(sog(i) for i in range(k)) / 111_195.0


def longitude(k: int) -> float:
    """Return the longitude [deg]."""
    return 10.25


def compass(k: int) -> float:
    """Return the true heading [deg]."""
    return 355.0 + 0.05 * k


def when(k: int) -> datetime:
    """Return the time of a row."""
    return START + timedelta(seconds=k)


def epoch_ns(k: int) -> int:
    """Return the time of a row [ns since 1970]."""
    return int(when(k).timestamp()) * 10**9


def csv() -> bytes:
    """A table with units in its names."""
    lines = ['Time (UTC),STW [kn],SOG [kn],Lat,Lon,Heading [deg]']
    for k in range(ROWS):
        lines.append(
            f'{when(k):%Y-%m-%dT%H:%M:%SZ},{stw(k) / KNOT:.5f},{sog(k) / KNOT:.5f},'
            f'{latitude(k):.7f},{longitude(k):.7f},{compass(k):.2f}'
        )
    return '\n'.join(lines).encode()


def csv_commas() -> bytes:
    """A table of a spreadsheet of the continent: titles, units below, decimal commas, dates."""
    lines = ['Probefahrt 3, Schiff X', '', 'Datum;Date;Time;STW;Latitude;Longitude', ';;;m/s;°;°']
    for k in range(ROWS):
        degrees, minutes = divmod(latitude(k) * 60.0, 60.0)
        east, east_minutes = divmod(longitude(k) * 60.0, 60.0)
        speed = f'{stw(k):.4f}'.replace('.', ',')
        lines.append(
            f'x;{when(k):%d.%m.%Y};{when(k):%H:%M:%S};{speed};'
            f'{int(degrees):02d}{minutes:07.4f}N;{int(east):03d}{east_minutes:07.4f}E'
        )
    return '\r\n'.join(lines).encode()


def sentence(body: str) -> str:
    """Add the checksum, by an arithmetic of its own."""
    check = 0
    for byte in body.encode('latin-1'):
        check ^= byte
    return f'${body}*{check:02X}'


def nmea() -> bytes:
    """NMEA 0183: RMC, VHW, HDT."""
    lines = []
    for k in range(ROWS):
        degrees, minutes = divmod(latitude(k) * 60.0, 60.0)
        east, east_minutes = divmod(longitude(k) * 60.0, 60.0)
        lines += [
            sentence(
                f'GPRMC,{when(k):%H%M%S},A,{int(degrees):02d}{minutes:08.5f},N,'
                f'{int(east):03d}{east_minutes:08.5f},E,{sog(k) / KNOT:.3f},355.0,'
                f'{when(k):%d%m%y},,,A'
            ),
            sentence(f'VWVHW,,,,M,{stw(k) / KNOT:.3f},N,,'),
            sentence(f'HEHDT,{compass(k):.2f},T'),
        ]
    return '\r\n'.join(lines).encode()


def n2k_messages(k: int) -> list[tuple[int, bytes]]:
    """Return PGN and payload of what a ship sends in a second."""
    angle = round(math.radians(compass(k) % 360.0) * 1e4)
    return [
        (128259, struct.pack('<BHHBH', k, round(stw(k) * 100), 0xFFFF, 0, 0xFFFF)),
        (129025, struct.pack('<ii', round(latitude(k) * 1e7), round(longitude(k) * 1e7))),
        (129026, struct.pack('<BBHHH', k, 0xFC, angle, round(sog(k) * 100), 0xFFFF)),
        (127250, struct.pack('<BHhhB', k, angle, 0x7FFF, 0x7FFF, 0xFC)),
        (130306, struct.pack('<BHHBH', k, 812, 31416, 0xFA, 0xFFFF)),
        (127488, struct.pack('<BHHbH', 0, 1500 * 4, 0xFFFF, 0x7F, 0xFFFF)),
        (
            126992,
            struct.pack(
                '<BBHI', k, 0xF0, (START.date() - datetime(1970, 1, 1).date()).days, 342000000
            ),
        ),
    ]


def _can_id(pgn: int, sender: int = 35) -> int:
    return (2 << 26) | (pgn << 8) | sender


def _frames(line: Callable[[int, int, bytes], str], end: str = '\n') -> bytes:
    """Write each message of each second in a line."""
    return end.join(line(k, *each) for k in range(ROWS) for each in n2k_messages(k)).encode()


def candump() -> bytes:
    """Frames as `candump -L` writes them."""
    return _frames(
        lambda k, pgn, data: (
            f'({epoch_ns(k) // 10**9}.000000) can0 {_can_id(pgn):08X}#{data.hex().upper()}'
        )
    )


def actisense() -> bytes:
    """Messages as Actisense's N2K ASCII."""
    return _frames(
        lambda k, pgn, data: f'A{when(k):%H%M%S}.000 23FF2 {pgn:05X} {data.hex().upper()}', '\r\n'
    )


def yacht_devices() -> bytes:
    """Frames as a gateway of Yacht Devices sends them (RAW)."""
    return _frames(
        lambda k, pgn, data: (
            f'{when(k):%H:%M:%S}.000 R {_can_id(pgn):08X} {data.hex(" ").upper()}'
        ),
        '\r\n',
    )


def slcan() -> bytes:
    """Frames of a serial CAN adapter, with its milliseconds of a minute."""
    return _frames(
        lambda k, pgn, data: (
            f'T{_can_id(pgn):08X}{len(data)}{data.hex().upper()}{(30_000 + 1000 * k) % 60_000:04X}'
        )
    )


def canboat() -> bytes:
    """Frames as canboat's plain format."""
    return _frames(
        lambda k, pgn, data: (
            f'{when(k):%Y-%m-%dT%H:%M:%S}.000Z,2,{pgn},35,255,{len(data)},{data.hex(",")}'
        )
    )


def signalk() -> bytes:
    """Deltas of a Signal K server."""
    lines = []
    for k in range(ROWS):
        values = {
            'navigation.speedThroughWater': stw(k),
            'navigation.speedOverGround': sog(k),
            'navigation.headingTrue': math.radians(compass(k) % 360.0),
            'navigation.position': {'latitude': latitude(k), 'longitude': longitude(k)},
            'environment.wind.speedApparent': 8.12,
            'environment.wind.angleApparent': 0.5,
        }
        update = {
            '$source': 'nmea.35',
            'timestamp': f'{when(k):%Y-%m-%dT%H:%M:%S}.000Z',
            'values': [{'path': path, 'value': value} for path, value in values.items()],
        }
        lines.append(json.dumps({'context': 'vessels.self', 'updates': [update]}))
    return '\n'.join(lines).encode()


def gpx() -> bytes:
    """A track as a plotter exports it."""
    points = ''.join(
        f'<trkpt lat="{latitude(k):.7f}" lon="{longitude(k):.7f}">'
        f'<time>{when(k):%Y-%m-%dT%H:%M:%SZ}</time><speed>{sog(k)}</speed></trkpt>\n'
        for k in range(ROWS)
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<gpx version="1.0" creator="plotter" '
        f'xmlns="http://www.topografix.com/GPX/1/0">\n<trk><trkseg>\n{points}</trkseg></trk></gpx>\n'
    ).encode()


def ardupilot() -> bytes:
    """A dataflash log: definitions, then GPS and ATT."""
    sizes = dict(zip('BHILQfcCnNZ', (1, 2, 4, 4, 8, 4, 2, 2, 4, 16, 64), strict=True))
    codes = {'L': 'i', 'c': 'h', 'C': 'H'}
    kinds = {
        130: ('GPS', 'QBBIHBLLff', 'TimeUS,I,Status,GMS,GWk,NSats,Lat,Lng,Alt,Spd'),
        131: ('ATT', 'QccccCC', 'TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw'),
    }

    def form(layout: str) -> str:
        return '<' + ''.join(codes.get(letter, letter) for letter in layout)

    def message(number: int, body: bytes) -> bytes:
        return bytes((0xA3, 0x95, number)) + body

    def definition(number: int, name: str, layout: str, columns: str) -> bytes:
        length = 3 + sum(sizes[letter] for letter in layout)
        return message(
            128,
            struct.pack(
                '<BB4s16s64s', number, length, name.encode(), layout.encode(), columns.encode()
            ),
        )

    parts = [definition(128, 'FMT', 'BBnNZ', 'Type,Length,Name,Format,Columns')]
    parts += [definition(number, *kind) for number, kind in kinds.items()]
    leap_s, week_s = 18, 7 * 86_400
    for k in range(ROWS):
        gps_s = int(when(k).timestamp()) - 315_964_800 + leap_s
        week, of_week = divmod(gps_s, week_s)
        time_us = 20_000_000 + k * 1_000_000
        parts.append(
            message(
                130,
                struct.pack(
                    form(kinds[130][1]),
                    *(time_us, 0, 3, of_week * 1000, week, 12),
                    *(round(latitude(k) * 1e7), round(longitude(k) * 1e7), 3.0, sog(k)),
                ),
            )
        )
        yaw = round(compass(k) % 360.0 * 100)
        parts.append(message(131, struct.pack(form(kinds[131][1]), time_us, 0, 0, 0, 0, 0, yaw)))
    return b''.join(parts)


def ulog() -> bytes:
    """A log of PX4: definitions, then GNSS and attitude."""

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack('<HB', len(body), ord(kind)) + body

    gps = (
        'vehicle_gps_position:uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;'
        'float vel_m_s;uint8_t fix_type;'
    )
    attitude = 'vehicle_attitude:uint64_t timestamp;float[4] q;'
    parts = [b'ULog\x01\x12\x35\x01', struct.pack('<Q', 0)]
    parts += [message('F', gps.encode()), message('F', attitude.encode())]
    parts += [
        message('A', struct.pack('<BH', 0, 0) + b'vehicle_gps_position'),
        message('A', struct.pack('<BH', 0, 1) + b'vehicle_attitude'),
    ]
    for k in range(ROWS):
        boot_us = 20_000_000 + k * 1_000_000
        body = struct.pack(
            '<QQiifB',
            boot_us,
            epoch_ns(k) // 1000,
            round(latitude(k) * 1e7),
            round(longitude(k) * 1e7),
            sog(k),
            3,
        )
        parts.append(message('D', struct.pack('<H', 0) + body))
        half = math.radians(compass(k)) / 2.0
        body = struct.pack('<Q4f', boot_us, math.cos(half), 0.0, 0.0, math.sin(half))
        parts.append(message('D', struct.pack('<H', 1) + body))
    return b''.join(parts)


def ros1(folder: Path) -> bytes:
    """A bag of ROS 1, by rosbags."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    path = folder / 'made.bag'
    with Writer(path) as writer:
        kind = 'geometry_msgs/msg/TwistStamped'
        connection = writer.add_connection('/log/speed_through_water', kind, typestore=store)
        for k in range(ROWS):
            message = _twist(store, k, seq=k)
            writer.write(connection, epoch_ns(k), store.serialize_ros1(message, kind))
    made = path.read_bytes()
    path.unlink()
    return made


def sqlite3(folder: Path) -> bytes:
    """The file of a bag of rosbag2 in sqlite3 storage, by rosbags."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    path = folder / 'made'
    with Writer(path, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        kind = 'geometry_msgs/msg/TwistStamped'
        connection = writer.add_connection('/speed_through_water', kind, typestore=store)
        for k in range(ROWS):
            writer.write(connection, epoch_ns(k), store.serialize_cdr(_twist(store, k), kind))
    return next(path.glob('*.db3')).read_bytes()


def _twist(store, k: int, **more: int):
    types = store.types
    header = types['std_msgs/msg/Header'](
        **more,
        stamp=types['builtin_interfaces/msg/Time'](sec=epoch_ns(k) // 10**9, nanosec=0),
        frame_id='base_link',
    )
    vector = types['geometry_msgs/msg/Vector3']
    twist = types['geometry_msgs/msg/Twist'](
        linear=vector(x=stw(k), y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.0)
    )
    return types['geometry_msgs/msg/TwistStamped'](header=header, twist=twist)


TEXTS = {
    'csv': ('log.csv', csv),
    'csv_commas': ('log.txt', csv_commas),
    'nmea': ('log.nmea', nmea),
    'candump': ('candump.log', candump),
    'actisense': ('actisense.txt', actisense),
    'yacht_devices': ('ydwg.raw', yacht_devices),
    'canboat': ('canboat.txt', canboat),
    'slcan': ('slcan.txt', slcan),
    'signalk': ('signalk.jsonl', signalk),
    'gpx': ('track.gpx', gpx),
}
BINARIES = {'ardupilot': ('log.bin', ardupilot), 'ulog': ('log.ulg', ulog)}


def samples(folder: Path) -> dict[str, tuple[str, bytes]]:
    """Return name and content of a file of each format, by kind."""
    found = {kind: (name, make()) for kind, (name, make) in {**TEXTS, **BINARIES}.items()}
    found['ros1'] = ('log.bag', ros1(folder))
    found['sqlite3'] = ('log.db3', sqlite3(folder))
    return found
