# SPDX-License-Identifier: Apache-2.0
"""
Facts that a log book knows, as they are stated: `NAME[=VALUE][,rate=RATE]`.

A fact is evidence and no filter: it is wrong at times. What it says about an
effect, the effect declares.
"""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, date, datetime

from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.fields import INVALID, Kind, Problems, number, show, unexpected

RATE = 0.02  # how often a fact that is stated is wrong, unless given
LEAST_RATE, MOST_RATE = 1e-4, 0.5
DATE = 'DATE'
UNITS_CHECKED = 'units_checked'
_RATE = number(LEAST_RATE, MOST_RATE)


@dataclass(frozen=True)
class Known:
    """
    A kind of fact.

    Attributes
    ----------
    meaning
        What is so, in words.
    look
        What to look at, to know it.
    values
        Words that it may have; `DATE` alone: a date of ISO 8601; none: it has no
        value.
    """

    meaning: str
    look: str
    values: tuple[str, ...] = ()

    def refuses(self, value: str) -> str:
        """
        Say what is wrong with a value; '' where nothing is.
        """
        if not self.values:
            return f'has no value, given {value!r}' if value else ''
        if self.values == (DATE,):
            try:
                date.fromisoformat(value)
            except ValueError:
                return f'is {value!r}, expected a date as in 2026-03-01'
            return ''
        return '' if value in self.values else f'is {value!r}, expected {" or ".join(self.values)}'


KNOWN: Mapping[str, Known] = {
    'no_towed_cable': Known(
        'no cable, net or line was in the water', 'look whether a cable or line was out'
    ),
    'deep_water': Known(
        'deep by the chart: more than some eight draughts', 'look at the chart: was it deep'
    ),
    'helm_amidships': Known(
        'the rudder was amidships, and she kept her course', 'ask whether the helm was amidships'
    ),
    'draughts_read': Known(
        'the draughts were read, and are those of the ship file', 'read the draughts'
    ),
    'shaft': Known(
        'after the stop the shaft was',
        'ask what the shaft did after the stop',
        ('locked', 'free', 'driven'),
    ),
    'no_waves': Known('no waves to speak of', 'ask whether there were waves'),
    'calm': Known('neither wind nor waves to speak of', 'ask whether it was calm'),
    'hull_cleaned': Known(
        'the hull was cleaned on', 'look up when the hull was cleaned last', (DATE,)
    ),
    UNITS_CHECKED: Known(
        'log and way over ground are in the units that they were imported with',
        'compare the figures of the record with the display of the instrument',
    ),
}


@dataclass(frozen=True)
class Fact:
    """
    One fact.

    Attributes
    ----------
    name
        A key of `KNOWN`.
    value
        '' for one that has none.
    rate
        How often such a fact is stated although it is not so.
    """

    name: str
    value: str = ''
    rate: float = RATE

    def __str__(self) -> str:
        stated = f'{self.name}={self.value}' if self.value else self.name
        return stated if self.rate == RATE else f'{stated},rate={self.rate:g}'

    @property
    def words(self) -> str:
        """What it says, as a sentence without its end."""
        return f'{KNOWN[self.name].meaning} {self.value}'.rstrip()

    @property
    def time_ns(self) -> int | None:
        """Its date [ns since the epoch], None where it has none."""
        if KNOWN[self.name].values != (DATE,):
            return None
        day = datetime.fromisoformat(self.value).replace(tzinfo=UTC)
        return round(day.timestamp() * 1e9)


class _WrongFact(Exception):
    """What is wrong with a fact, a sentence each."""


def parse_fact(text: str) -> Fact:
    """
    Read `NAME[=VALUE][,rate=RATE]`.

    Parameters
    ----------
    text
        As it is given to `shipdrag diagnose --fact`.

    Returns
    -------
    Fact

    Raises
    ------
    DiagnosisError
        If name, value or rate is none that is known; the message lists what is.

    Examples
    --------
    >>> from shipdrag_ros.ship.facts import parse_fact
    >>> parse_fact('shaft=locked,rate=0.05')
    Fact(name='shaft', value='locked', rate=0.05)
    """
    try:
        return _of_text(text, '')
    except _WrongFact as wrong:
        raise DiagnosisError(f'fact {text!r}: {"; ".join(wrong.args)}') from None


def usage() -> str:
    """
    Return the facts that may be stated, in words.
    """
    return ', '.join(
        f'{name}={"|".join(known.values)}' if known.values else name
        for name, known in KNOWN.items()
    )


def advice(name: str) -> str:
    """
    Say how a fact is learnt and stated.
    """
    values = KNOWN[name].values
    return f'{KNOWN[name].look} (--fact {name}{"=" + "|".join(values) if values else ""})'


def overriding(*sources: Sequence[Fact]) -> tuple[Fact, ...]:
    """
    Return facts of several sources, a later one in place of an earlier one of its name.
    """
    found = {fact.name: fact for facts in sources for fact in facts}
    return tuple(found.values())


def fact_list() -> Kind:
    """
    Expect facts: a list of texts as of `--fact`, or names with their values.
    """
    expectation = f'a list, or names with values: {usage()}'

    def read(value: object, path: str, problems: Problems) -> object:
        before = len(problems)
        if not isinstance(value, dict | list):
            return unexpected(value, path, problems, expectation)
        facts = []
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            try:
                if isinstance(value, dict):
                    facts.append(_of_pair(key, item, path))
                else:
                    facts.append(_of_item(item, f'{path}[{key}]'))
            except _WrongFact as wrong:
                problems.extend(wrong.args)
        for name, count in Counter(fact.name for fact in facts).items():
            if count > 1:
                problems.append(f'{path}: {name} is given {count} times, keep one')
        return INVALID if len(problems) > before else tuple(facts)

    return Kind(read, expectation)


def _of_item(item: object, path: str) -> Fact:
    """Read an item of a list: a text, `NAME: VALUE`, or name, value and rate."""
    if isinstance(item, str):
        return _of_text(item, f'{path}: ')
    if isinstance(item, dict) and 'name' in item:
        rest = {key: value for key, value in item.items() if key != 'name'}
        return _of_pair(item['name'], rest, path)
    if isinstance(item, dict) and len(item) == 1:
        ((name, value),) = item.items()
        return _of_pair(name, value, path)
    raise _WrongFact(f'{path}: {show(item)}, expected one of {usage()}')


def _of_pair(name: object, item: object, path: str) -> Fact:
    """Read what stands behind a name: true, a value, or `{value: , rate: }`."""
    place = f'{path}.{name}'
    rate: object = RATE
    if isinstance(item, dict):
        unknown = [key for key in item if key not in ('value', 'rate')]
        if unknown:
            raise _WrongFact(f'{place}.{unknown[0]}: unknown key; known are value, rate')
        rate, item = item.get('rate', RATE), item.get('value', True)
    if item is False or item is None:
        raise _WrongFact(f'{place}: {show(item)}; leave out what is not known to be so')
    if isinstance(item, str) and ',' in item:
        return _of_text(f'{name}={item}', f'{place}: ')
    return _checked(str(name), '' if item is True else str(item), rate, f'{place}: ')


def _of_text(text: str, place: str) -> Fact:
    """Read `NAME[=VALUE][,rate=RATE]`."""
    stated, *others = text.split(',')
    name, equals, value = (part.strip() for part in stated.partition('='))
    rate: object = RATE
    for other in others:
        key, _, word = (part.strip() for part in other.partition('='))
        if key != 'rate':
            raise _WrongFact(f'{place}{key!r} is not known; write NAME[=VALUE][,rate=RATE]')
        rate = word
        with suppress(ValueError):
            rate = float(word)
    if equals and not value:
        value = ' '  # none of what is expected
    return _checked(name, value, rate, place)


def _checked(name: str, value: str, rate: object, place: str) -> Fact:
    if name not in KNOWN:
        near = difflib.get_close_matches(name, KNOWN, n=1)
        hint = f'did you mean {near[0]}? ' if near else ''
        raise _WrongFact(f'{place}{name!r} is no known fact; {hint}known are {usage()}')
    refused = KNOWN[name].refuses(value)
    wrong = [f'{place}{name} {refused}'] if refused else []
    if not isinstance(rate, int | float) or _RATE.read(rate, 'rate', []) is INVALID:
        wrong.append(
            f'{place}rate is {rate!r}, expected {LEAST_RATE:g}..{MOST_RATE:g}, the share of such '
            'facts that are wrong'
        )
    if wrong:
        raise _WrongFact(*wrong)
    assert isinstance(rate, int | float)
    return Fact(name, value, float(rate))
