# SPDX-License-Identifier: Apache-2.0
"""A script is never sent to an option of the command line."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import shipdrag_ros as sd
from shipdrag_ros.library import shown
from shipdrag_ros.library.shown import in_python
from shipdrag_ros.sources import formats
from shipdrag_ros.sources.format import Option

PACKAGE = Path(sd.__file__).parent


@pytest.mark.parametrize(
    ('typed', 'argument'),
    [
        (
            '--map speed_through_water=1:kn --rate 1',
            "columns={'speed_through_water': '1:kn'} rate_hz=1",
        ),
        ("--map 'depth=Water depth:m', or", "columns={'depth': 'Water depth:m'}, or"),
        ('--map wind_apparent=AWS:kn,AWA:deg', "columns={'wind_apparent': 'AWS:kn,AWA:deg'}"),
        ("--time 't x':ms, or :s", "time='t x:ms', or :s"),
        ('--time and --rate: both', 'time= and rate_hz=HZ: both'),
        ('--date YYYY-MM-DD of', "options={'date': 'YYYY-MM-DD'} of"),
        ('--date-order dmy or', "options={'date_order': 'dmy'} or"),
        ('as UTC (--zone).', "as UTC (options={'zone': ...})."),
        ('give --no-checksum', "give options={'no_checksum': True}"),
        ('--remap /gps/fix:=position: no', "remap={'/gps/fix': 'position'}: no"),
        ('--window where it is', 'window=(START, END) where it is'),
        ('one with --ship FILE', "one with ship='FILE'"),
        ('(--fact deep_water)', "(facts=['deep_water'])"),
        ('`rosbags-convert --src BAG --dst NEW`', '`rosbags-convert --src BAG --dst NEW`'),
    ],
)
def test_options_become_arguments(typed: str, argument: str) -> None:
    assert in_python(typed) == argument


@pytest.fixture
def new_format(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A format that takes options which no other one takes."""
    options = Option('--gain', 'FACTOR', 'of the speeds'), Option('--as-it-is', '', 'no filter')
    formats_then = (*formats.found(), formats.found()[0]._replace(name='new', options=options))
    monkeypatch.setattr(formats, 'found', lambda: formats_then)
    for kept in (shown._read, shown._option):
        kept.cache_clear()
    yield
    for kept in (shown._read, shown._option):
        kept.cache_clear()


@pytest.mark.usefixtures('new_format')
def test_options_of_a_new_format_need_no_list() -> None:
    assert in_python('give --gain 2 or --as-it-is.') == (
        "give options={'gain': '2'} or options={'as_it_is': True}."
    )
    assert in_python('as UTC (--zone).') == "as UTC (options={'zone': ...})."


def test_no_option_that_a_message_of_the_library_names_is_left_over() -> None:
    # all rooms below the doors; of another program are --src, --dst and --nthreads
    rooms = ('bags', 'coastdown', 'diagnosis', 'estimation', 'sources', 'library', 'messages')
    rooms += ('replay', 'ship', 'simulation')
    own = {'--src', '--dst', '--dst-storage', '--effect', '--report', '--option'}
    for path in (file for room in rooms for file in (PACKAGE / room).rglob('*.py')):
        for line in path.read_text(encoding='utf-8').splitlines():
            left = set(re.findall(r'(?<![\w-])--[a-z][a-z-]+', in_python(line)))
            assert left <= own, (path, line)


@pytest.mark.parametrize('door', [sd.estimate, sd.Record.coastdowns])
def test_an_error_keeps_its_class_and_speaks_python(door: Callable[[sd.Record], object]) -> None:
    steady = pd.DataFrame({'t': np.arange(60.0), 'log': np.full(60, 6.0)})
    record = sd.read(steady, columns={'speed_through_water': 'log'}, time='t')
    with pytest.raises(sd.ShipdragError, match="give one with ship='FILE'") as refused:
        door(record)
    assert type(refused.value).__name__ == 'BagError'
