# SPDX-License-Identifier: Apache-2.0
"""What someone wrote down about a hull."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipdrag_ros.fleet.store import HullEvent, read_events, write_events

DAY_NS = 86_400_000_000_000


def test_events_are_read_in_the_order_of_time_each_once() -> None:
    text = (
        'date,kind,note\n1970-01-03,Docking\n# a comment\n\n1970-01-02,cleaning,Lisbon, divers\n'
    )
    events, problems = read_events(text + text)
    assert events == (
        HullEvent(DAY_NS, 'cleaning', 'Lisbon,divers'),
        HullEvent(2 * DAY_NS, 'docking'),
    )
    assert problems == ()
    assert read_events(write_events(events)) == (events, ())


@given(st.text())
def test_a_note_is_read_back_as_it_was_written(note: str) -> None:
    note = ' '.join(note.split())  # an event a line
    event = HullEvent(DAY_NS, 'cleaning', note)
    assert read_events(write_events([event])) == ((event,), ())


def test_a_time_of_another_zone_is_utc() -> None:
    ((event,), _) = read_events('1970-01-02T01:00:00+01:00,coating')
    assert event.time_ns == DAY_NS


@pytest.mark.parametrize(
    ('line', 'why'),
    [
        ('yesterday,cleaning', "'yesterday', expected a date as 2026-03-01"),
        ('2026-03-01,painted', "'painted', expected one of cleaning, docking"),
        ('2026-03-01', "'', expected one of cleaning"),
        ('9999-12-31T23:59:59-23:00,cleaning', 'expected a year from 1900 to 2200'),
        ('2026-03-01;cleaning', "'2026-03-01;cleaning', expected a date"),
        ('x' * 200_000, 'field larger than field limit'),
        ('2026-03-01,cleaning,"the hull', 'unexpected end of data; write a note as "a note"'),
        ('2026-03-01,cleaning,"he said "clean" of it"', 'a quote inside it twice'),
    ],
)
def test_a_line_that_is_none_is_told(line: str, why: str) -> None:
    events, (problem,) = read_events(f'date,kind\n{line}\n2026-01-01,cleaning\n')
    assert len(events) == 1
    assert problem.startswith('events.csv line 2 is left out: ')
    assert why in problem
