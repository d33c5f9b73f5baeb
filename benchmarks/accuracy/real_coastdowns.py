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
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import _verbs
from benchmarks._asked import asked
from benchmarks._tables import put, table
from benchmarks.accuracy._known_coasts import COASTS, Known, KnownCoast
from benchmarks.accuracy.real_records import OUT, PAGE, ROOT, prepared
from shipdrag_ros import display
from shipdrag_ros.bags import open_runs

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
    stated = (ROOT / words[at]).read_text(encoding='utf-8')
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
    options = asked(__doc__, write=False, estimator='one', out=OUT / 'real_coastdowns')
    if not prepared(options.out):
        return
    found = section(options.out.resolve(), options.estimator)
    print('\n' + found)
    if options.write:
        put(PAGE, {'coastdowns': found})


if __name__ == '__main__':
    main()
