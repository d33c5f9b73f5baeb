# SPDX-License-Identifier: Apache-2.0
"""
Measured coastdowns: what the program says beside what is known by other means.

Reads the folder that SHIPDRAG_DATA names. Each record is imported with all its
columns and replayed twice, as the monitor finds it and in the window that a person
would give, with the default estimators. A figure agrees if it lies within two
joint standard deviations of the one that is known, and its own is at most 1.5
times the other's; both without the uncertainty of n_r, which they share. `--write`
puts the table into docs/results/real_records.txt.
Nothing is random. Takes about a minute.

What is known is from the page on the records (reality, section 3) and from their provenance, each
found from the samples by other means: fits of an equation of motion, times of passage, motor and
rudder columns. Its +- is two standard deviations. Where nothing is known of r, `known` is empty.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _verbs
from benchmarks._asked import asked
from benchmarks._tables import put, table
from benchmarks.accuracy import real_records as real
from shipdrag_ros import display
from shipdrag_ros.bags import open_runs


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

    record: real.Record
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
    record = replace(real.usv(test, 'short'), name=f'usv_{test}')
    return KnownCoast(record, (0.0, 15.0), f'coasts 13 to 15 s, the heading turns {turn} deg')


def _car(test: str, end_s: float) -> KnownCoast:
    record = real.car(test, end_s, 'short')
    return KnownCoast(record, (0.0, end_s), 'cut to the coast by those who measured')


def _slow_car(test: str, *known: Known) -> KnownCoast:
    return KnownCoast(real.slow_car(test, 'short'), (0.0, 172.0), _SPIKES, known)


def _boat(run: str, window_s: tuple[float, float]) -> real.Record:
    table = f'blueboat_{run}_10hz.csv'
    name, speeds = f'blueboat_{run}', (0.3, 0.4)
    return real.Record(name, table, _BOAT, 'blueboat', 'short_compass', window_s, speeds)


def _ferry(name: str, window_s: tuple[float, float]) -> real.Record:
    columns = f'{real.FERRY.columns} --map heading=yaw_rad {_MOTORS}'
    file = 'milliampere_nlp1_t275_20hz.csv'
    return real.Record(name, file, columns, 'ferry', 'short_compass', window_s, (0.116,))


def _tanker(part: str, window_s: tuple[float, float]) -> real.Record:
    file = f'esso_osaka_3m_{part}_10hz.csv'
    return real.Record(
        f'esso_osaka_{part}', file, _TANKER, 'esso_osaka', 'short', window_s, (0.17,)
    )


_FERRY_KNOWN = (_at(0.116, 0.0053, 0.0009),)
_TRUE_COAST_S = (16.2, 25.2)  # 287 to 296 s of its column of times
COASTS = (
    KnownCoast(
        replace(
            real.MODEL_SHIP,
            name='model_ship_shaft',
            columns=f'{real.MODEL_SHIP.columns} --map shaft=max_abs_cmd',
            parameters='short',
        ),
        (5.0, 32.0),
        'the engine stops at 5 s; the speed goes through zero: a hidden force or current',
    ),
    KnownCoast(
        replace(
            real.FERRY,
            name='ferry_motors',
            columns=f'{real.FERRY.columns} {_MOTORS}',
            parameters='short',
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
    *(_car(test, end_s) for test, end_s in real.CAR_ENDS_S.items()),
    KnownCoast(
        replace(
            real.car('1', 0.0, 'short'),
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


HEAD = ('record', 'what it holds', 'found by itself', 'in the given window', 'known', 'judged')
AGREES_SD = 2.0
WIDEST = 1.5  # of the stated standard deviation to that of the known figure
SLACK_S = 3.0  # by which a reported stretch may exceed the coast
_SHOWN = 3
_LONGEST = 160  # characters of an error
# how refusals are worded where no `not_coastdowns` is written
_WORDS = {
    'thrust': re.compile(r'\b(thrust|engine|propeller|shaft)', re.IGNORECASE),
    'brake': re.compile(r'\bbrake|from outside', re.IGNORECASE),
    'astern': re.compile(r'\bastern\b', re.IGNORECASE),
    'rudder': re.compile(r'\b(rudder|helm)\b', re.IGNORECASE),
    'turn': re.compile(r'\b(turn|turns|turned|turning)\b', re.IGNORECASE),
}


@dataclass(frozen=True)
class Said:
    """
    What one replay says.

    Attributes
    ----------
    coastdowns, dismissed
        As `replay --json` has them; empty if it ended in an error.
    error
        What it ended with; empty if it did not.
    start_ns
        Of the bag.
    """

    coastdowns: Sequence[dict[str, Any]]
    dismissed: Sequence[dict[str, Any]]
    error: str
    start_ns: int

    @property
    def estimates(self) -> list[dict[str, Any]]:
        """The coastdowns with an r(v)."""
        return [each for each in self.coastdowns if each['speed_m_s']]

    def seconds(self, found: dict[str, Any]) -> tuple[float, float]:
        """
        Return begin and end [s from the start of the bag].
        """
        start, end = ((found[key] - self.start_ns) * 1e-9 for key in ('start_ns', 'end_ns'))
        return start, end

    def reasons(self) -> set[str]:
        """
        Return why something was dismissed or refused, by the words of `not_coastdowns`.
        """
        said = [self.error, *(str(each['failure']) for each in self.coastdowns)]
        said += [note for each in self.coastdowns for note in each['notes']]
        text = ' '.join(said)
        found = {reason for reason, words_of_it in _WORDS.items() if words_of_it.search(text)}
        return found | {each['reason'] for each in self.dismissed}


def replayed(coast: KnownCoast, out: Path, start_ns: int, *, window: bool, estimator: str) -> Said:
    """
    Replay by the command line and read what it says.
    """
    words = shlex.split(coast.record.replay_command(window=window))[1:]
    at = words.index('--parameters') + 1
    stated = (real.ROOT / words[at]).read_text(encoding='utf-8')
    changed = out / f'{coast.record.name}.parameters.yaml'
    if 'estimator:' not in stated:  # where another cannot work, the record names its own
        stated += f'\nestimator: {estimator}\n'
    changed.write_text(stated, encoding='utf-8')
    words[1], words[at] = str(out / words[1]), str(changed)
    try:
        found = _verbs.found(*words)
    except RuntimeError as error:
        said = str(error).rpartition('ERROR: ')[2].replace(f'{out}/', '')
        return Said((), (), ' '.join(said.split()), start_ns)
    return Said(found['coastdowns'], found.get('not_coastdowns', ()), '', start_ns)


def resistance(found: dict[str, Any], known: Known) -> tuple[float, float, float] | None:
    """
    Return r, its sigma, and that without n_r; None outside the valid range.

    Over a range of speed, r is the range over the time of passage, and sigma that of r
    in its middle: errors are alike over a short range.
    """
    speed, r, *sigmas = (
        np.array(found[f'{key}_m_s{power}'], np.float64)
        for key, power in (('speed', ''), ('resistance', 2), ('sigma', 2), ('sigma_repeatable', 2))
    )
    if known.from_m_s < speed[0] or known.to_m_s > speed[-1]:
        return None
    at = np.linspace(known.from_m_s, known.to_m_s, 51)
    middle = 0.5 * (known.from_m_s + known.to_m_s)
    stated, repeatable = (float(np.interp(middle, speed, sigma)) for sigma in sigmas)
    return float(1.0 / np.mean(1.0 / np.interp(at, speed, r))), stated, repeatable


def judged(coast: KnownCoast, itself: Said, window: Said) -> str:
    """
    Say whether what is reported is what is known.

    Of what the monitor found by itself, where it has a figure; else of the window.
    """
    spans = [(said, each) for said in (itself, window) for each in said.estimates]
    chosen = [each for _, each in spans]
    wrong = [problem for said, each in spans for problem in _beyond(coast, said, each)]
    right = coast.refusal and set(coast.refusal) & (itself.reasons() | window.reasons())
    if wrong:
        return 'NO: ' + '; '.join(dict.fromkeys(wrong))
    if not coast.known and not coast.refusal:
        return 'nothing known of r'
    if not chosen:
        return f'yes: refused, {", ".join(sorted(right))}' if right else 'NO: no figure'
    if not coast.known:
        return 'yes: said' if right else 'yes: inside the coast'
    best = next((each for each in chosen if _covers(each, coast)), chosen[0])
    problems = [problem for known in coast.known for problem in _off(best, known)]
    if problems:
        return 'NO: ' + '; '.join(problems)
    if coast.refusal and not right:
        return f'NO: agrees, but nothing is said of {" or ".join(coast.refusal)}'
    return 'yes'


def _covers(found: dict[str, Any], coast: KnownCoast) -> bool:
    return all(resistance(found, known) is not None for known in coast.known)


def _beyond(coast: KnownCoast, said: Said, found: dict[str, Any]) -> Iterator[str]:
    """Say by how much a reported stretch lies beyond the coast."""
    start, end = said.seconds(found)
    assert coast.coast_s is not None
    first, last = coast.coast_s
    if start < first - SLACK_S or end > last + SLACK_S:
        yield f'reported is {start:.0f} to {end:.0f} s, the coast {first:.0f} to {last:.0f} s'


def _off(found: dict[str, Any], known: Known) -> Iterator[str]:
    at = resistance(found, known)
    label = _speed(known)
    if at is None:
        yield f'{label} m/s outside of the valid range'
        return
    sd = 0.5 * known.two_sd_m_s2
    r, _, own_sd = at
    off = abs(r - known.r_m_s2) / hypot(own_sd, sd)
    if off > AGREES_SD:
        yield f'{label} m/s off by {off:.1f} joint sd'
    if own_sd > WIDEST * sd:
        yield f'{label} m/s: its sd is {own_sd / sd:.1f} times the known one'


def _speed(known: Known) -> str:
    if known.from_m_s == known.to_m_s:
        return f'{known.from_m_s:g}'
    return f'{known.from_m_s:g} to {known.to_m_s:g}'


def judged_words(coast: KnownCoast, said: Said) -> str:
    """
    Return what a replay says, as a cell.
    """
    wanted = coast.known or tuple(Known(v, v, 0.0, 0.0) for v in coast.record.speeds_m_s)
    lines = []
    if said.error:
        short = said.error[:_LONGEST] + ('...' if len(said.error) > _LONGEST else '')
        lines.append(f'error: {short}')
    if not said.coastdowns and not said.error:
        lines.append('no coastdown')
    for each in said.coastdowns:
        start, end = said.seconds(each)
        lines.append(f'{start:.0f} to {end:.0f} s, ended by {each["ended_by"]}')
        if not each['speed_m_s']:
            lines.append(f'no estimate: {each["failure"]}')
            continue
        for known in wanted:
            at = resistance(each, known)
            shown = 'outside' if at is None else display.plus_minus(at[0], 2.0 * at[1])
            lines.append(f'{_speed(known)}: {shown}')
    cuts = [
        f'{each["reason"]} {start:.0f} to {end:.0f} s'
        for each in said.dismissed
        for start, end in [said.seconds(each)]
    ]
    if cuts:
        more = f' and {len(cuts) - _SHOWN} more' if len(cuts) > _SHOWN else ''
        lines.append(f'cut or dismissed: {", ".join(cuts[:_SHOWN])}{more}')
    return '<br>'.join(line.replace('|', '/') for line in lines)


def row(coast: KnownCoast, out: Path, estimator: str = 'one') -> tuple[str, ...]:
    """
    Import a record, replay it both ways and return its line of the table.
    """
    (run,) = open_runs([coast.record.bag(out)])
    assert run.span_ns is not None
    itself, window = (
        replayed(coast, out, run.span_ns[0], window=given, estimator=estimator)
        for given in (False, True)
    )
    known = [
        f'{_speed(each)}: {display.plus_minus(each.r_m_s2, each.two_sd_m_s2)}'
        for each in coast.known
    ]
    return (
        coast.record.name,
        coast.fact,
        judged_words(coast, itself),
        judged_words(coast, window),
        '<br>'.join(known) or '-',
        judged(coast, itself, window),
    )


def section(out: Path, estimator: str) -> str:
    """
    Import and replay all records; return the table.
    """
    rows = []
    for coast in COASTS:
        rows.append(row(coast, out, estimator))
        print('\n  '.join(rows[-1]).replace('<br>', '\n    '), flush=True)
    yes, no = (sum(each[-1].startswith(word) for each in rows) for word in ('yes', 'NO'))
    count = f'{yes} of {yes + no} records of which something is known are reported rightly.'
    return '\n'.join([*table(HEAD, rows), '', count])


def main() -> None:
    """
    Print the table, and write it into the page if asked.
    """
    options = asked(__doc__, write=False, estimator='one', out=real.OUT / 'real_coastdowns')
    if not real.prepared(options.out):
        return
    found = section(options.out.resolve(), options.estimator)
    print('\n' + found)
    if options.write:
        put(real.PAGE, {'coastdowns': found})


if __name__ == '__main__':
    main()
