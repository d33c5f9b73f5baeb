# SPDX-License-Identifier: Apache-2.0
"""
Measured coastdowns of which something is known that this program did not find.

The figures are from the page on what is known of the records (reality, section 3)
and from their provenance, each found from the samples by other means: fits of an
equation of motion, times of passage, motor and rudder columns. Their +- is two
standard deviations. Where nothing is known of r, `known` is empty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from benchmarks.accuracy.real_records import (
    CAR_ENDS_S,
    FERRY,
    MODEL_SHIP,
    Record,
    car,
    slow_car,
    usv,
)


@dataclass(frozen=True)
class Known:
    """
    A resistance found independently.

    Attributes
    ----------
    from_m_s, to_m_s
        Speed, or range of speed: r is then the range over the time of passage.
    r_m_s2, two_sd_m_s2
        Specific resistance, and two standard deviations.
    """

    from_m_s: float
    to_m_s: float
    r_m_s2: float
    two_sd_m_s2: float


@dataclass(frozen=True)
class KnownCoast:
    """
    A record with all its useful columns, and what is known of it.

    Attributes
    ----------
    record
        How it is imported and which window a person would give.
    coast_s
        The stretch that is a coastdown [s from the start of the record]; None: there
        is none.
    fact
        What is known besides, and where from.
    known
        The resistance there.
    refusal
        Reasons of `not_coastdowns` one of which makes it right to give no figure.
    """

    record: Record
    coast_s: tuple[float, float] | None
    fact: str
    known: tuple[Known, ...] = ()
    refusal: tuple[str, ...] = ()


def _at(speed_m_s: float, r_m_s2: float, two_sd_m_s2: float) -> Known:
    return Known(speed_m_s, speed_m_s, r_m_s2, two_sd_m_s2)


_MOTORS = '--map shaft=motor1_rpm,motor2_rpm,motor3_rpm,motor4_rpm:rpm'
_BOAT = (
    '--time t --map speed_through_water=surge --map position=lat,lon:deg --map heading=yaw:deg '
    '--map shaft=thr_l,thr_r'
)
_TANKER = (
    '--time t_s --map speed_through_water=u_mps --map position=x_m,y_m --map heading=psi_rad '
    '--map shaft=prop_rps:rev/s --map rudder=rudder_rad'
)
_SPIKES = '1 Hz, spikes of 2 to 4 m/s'


def _usv(test: str, turn: int) -> KnownCoast:
    record = replace(usv(test, 'short'), name=f'usv_{test}')
    return KnownCoast(record, (0.0, 15.0), f'coasts 13 to 15 s, the heading turns {turn} deg')


def _car(test: str, end_s: float) -> KnownCoast:
    record = car(test, end_s, 'short')
    return KnownCoast(record, (0.0, end_s), 'cut to the coast by those who measured')


def _slow_car(test: str, *known: Known) -> KnownCoast:
    return KnownCoast(slow_car(test, 'short'), (0.0, 172.0), _SPIKES, known)


def _boat(run: str, window_s: tuple[float, float]) -> Record:
    table = f'blueboat_{run}_10hz.csv'
    name, speeds = f'blueboat_{run}', (0.3, 0.4)
    return Record(name, table, _BOAT, 'blueboat', 'short_compass', window_s, speeds)


def _ferry(name: str, window_s: tuple[float, float]) -> Record:
    columns = f'{FERRY.columns} --map heading=yaw_rad {_MOTORS}'
    file = 'milliampere_nlp1_t275_20hz.csv'
    return Record(name, file, columns, 'ferry', 'short_compass', window_s, (0.116,))


def _tanker(part: str, window_s: tuple[float, float]) -> Record:
    file = f'esso_osaka_3m_{part}_10hz.csv'
    return Record(f'esso_osaka_{part}', file, _TANKER, 'esso_osaka', 'short', window_s, (0.17,))


_FERRY_KNOWN = (_at(0.116, 0.0053, 0.0009),)
_TRUE_COAST_S = (16.2, 25.2)  # 287 to 296 s of its column of times
COASTS = (
    KnownCoast(
        replace(
            MODEL_SHIP,
            name='model_ship_shaft',
            columns=f'{MODEL_SHIP.columns} --map shaft=max_abs_cmd',
            parameters='short',
        ),
        (5.0, 32.0),
        'the engine stops at 5 s; the speed goes through zero: a hidden force or current',
    ),
    KnownCoast(
        replace(
            FERRY, name='ferry_motors', columns=f'{FERRY.columns} {_MOTORS}', parameters='short'
        ),
        (8.0, 34.4),
        'all motors at 0 from 8.0 s for 26.4 s; in sway, the heading turns 16 deg',
    ),
    KnownCoast(
        _ferry('ferry_tempting', (8.2, 29.15)),
        _TRUE_COAST_S,
        'motors at up to 440 rpm in the window; the coast is 16 to 25 s',
        _FERRY_KNOWN,
        ('thrust',),
    ),
    KnownCoast(
        _ferry('ferry_coast', _TRUE_COAST_S),
        _TRUE_COAST_S,
        'the coast of the record before',
        _FERRY_KNOWN,
    ),
    *(_usv(test, turn) for test, turn in (('6', 54), ('8', 39), ('10', 65))),
    *(_car(test, end_s) for test, end_s in CAR_ENDS_S.items()),
    KnownCoast(
        replace(
            car('1', 0.0, 'short'),
            name='car_whole',
            table='car/shotgoose_RR-Coastdown-1_whole_100hz.csv',
            window_s=(9.43, 19.79),
            speeds_m_s=(7.0,),
        ),
        (9.43, 16.9),
        'accelerates, coasts from 9.43 s, brake 7.5 s later',
        (_at(7.0, 0.82, 0.01),),
    ),
    _slow_car('Michelin60A'),
    _slow_car('Michelin60A1'),
    _slow_car(
        'Michelin60B', _at(4.0, 0.038, 0.005), _at(6.0, 0.044, 0.009), _at(7.2, 0.055, 0.04)
    ),
    KnownCoast(
        _boat('222', (59.8, 95.3)),
        (59.8, 95.0),
        'thrusters at 0 from 59.8 s',
        (Known(0.65, 1.0, 0.231, 0.02),),
    ),
    KnownCoast(_boat('218', (24.6, 44.6)), (24.6, 44.6), 'thrusters at 0 from 24.6 s, for 20 s'),
    KnownCoast(
        _boat('221', (30.5, 58.5)),
        (30.5, 58.5),
        'thrusters at 0 from 30.5 s, going ASTERN',
        refusal=('astern',),
    ),
    KnownCoast(
        _tanker('180s', (475.0, 503.5)),
        (476.0, 482.0),
        'reversed until 471 s, kick ahead at 476 s, stopped from outside at 483 s: no coastdown '
        'of more than 6 s',
        refusal=('thrust', 'brake', 'plateau', 'slow', 'settled', 'lead_in', 'other'),
    ),
    KnownCoast(
        _tanker('2030s', (37.0, 62.0)),
        (37.0, 62.0),
        'rudder at -0.6 rad by the notes, 0 in its column; the heading turns by 0.5 rad',
        (_at(0.17, 0.0026, 0.0002),),
        ('rudder', 'turn'),
    ),
)
