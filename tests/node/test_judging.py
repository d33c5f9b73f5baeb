# SPDX-License-Identifier: Apache-2.0
"""What is said of an input, by what became of its readings."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.messages.topics import ERROR, OK, STALE, WARN
from shipdrag_ros.node.health import (
    InputCounts,
    InputFacts,
    Recently,
    behind_others,
    convention_doubt,
    judge,
)

WELL = InputFacts(
    'speed_through_water',
    needed=True,
    type='geometry_msgs/msg/TwistStamped',
    senders=('/log',),
    age_s=0.1,
    recent=InputCounts(300, 300),
    seconds=30.0,
    offset_s=0.2,
)


def counts(used: int, **rejected: int) -> InputCounts:
    return InputCounts(used + sum(rejected.values()), used, rejected)


def test_what_is_well_is_receiving() -> None:
    assert (judge(WELL).level, judge(WELL).text) == (OK, 'receiving')


@pytest.mark.parametrize(
    ('changed', 'level', 'said'),
    [
        ({'recent': counts(0, nan=300)}, ERROR, 'none of 300 readings used in 30 s'),
        ({'recent': counts(0, nan=300)}, ERROR, ': 300 nan; the sensor'),
        ({'recent': counts(0, frozen=300)}, ERROR, 'it is stuck, look at it'),
        ({'recent': counts(100, outlier=200)}, ERROR, '33% of 300'),
        ({'recent': counts(285, absurd=15)}, WARN, '95% of 300'),
        ({'recent': counts(299, absurd=1)}, OK, 'receiving'),
        (
            {'recent': counts(0, future=300), 'offset_s': -3600.0},
            ERROR,
            'its clock is 3600.0 s ahead of that of this computer',
        ),
        ({'recent': InputCounts(300, 1, {'duplicate': 299}, 0, 300)}, ERROR, 'holds no time'),
        ({'recent': InputCounts(300, 300, {}, 7)}, WARN, '7 messages lost in 30 s'),
        ({'recent': counts(3)}, WARN, '0.1 Hz is too slow'),
        ({'recent': counts(5), 'seconds': 25.3}, WARN, '0.19 Hz is too slow, at least 0.2'),
        ({'behind': ('position', 6.0)}, WARN, '6.0 s behind those of position'),
        ({'behind': ('position', 1.0)}, OK, 'receiving'),
        ({'offset_s': 8.0}, WARN, '8.0 s behind that of this computer'),
        ({'senders': ('/a', '/a', '/b')}, WARN, '3 publishers, /a 2 times, /b'),
        ({'age_s': None}, WARN, 'no data'),
        ({'age_s': 99.0}, STALE, 'no data for 99 s'),
        ({'age_s': 99.0, 'senders': ()}, STALE, 'no publisher any more'),
        ({'type': None, 'age_s': None, 'senders': ()}, WARN, 'no publisher'),
        ({'type': None, 'age_s': None, 'senders': (), 'needed': False}, OK, 'no publisher'),
        ({'misfit': 'DURABILITY'}, WARN, 'its DURABILITY QoS does not fit'),
        ({'doubt': 'it is off'}, WARN, 'it is off'),
    ],
)
def test_what_is_wrong_is_said(changed: dict[str, Any], level: int, said: str) -> None:
    found = judge(replace(WELL, **changed))
    assert found.level == level
    assert said in found.text


def test_a_type_whose_package_is_not_here_says_what_to_install() -> None:
    dvl = 'marine_acoustic_msgs/msg/Dvl'
    facts = InputFacts('speed_over_ground', needed=True, other_types=(dvl,), absent=(dvl,))
    finding = judge(facts)
    assert finding.level == ERROR
    assert finding.text.endswith('its package is not here: install marine_acoustic_msgs')


def test_a_class_of_a_package_that_is_not_here_is_told() -> None:
    pytest.importorskip('rclpy')
    from shipdrag_ros.node.inputs import is_installed, message_class

    assert is_installed('geometry_msgs/msg/Twist')
    assert not is_installed('nowhere_msgs/msg/Log')
    with pytest.raises(ShipdragError, match='the package nowhere_msgs is not installed here'):
        message_class('nowhere_msgs/msg/Log')


def test_context_may_be_worse_than_motion() -> None:
    rudder = replace(WELL, name='rudder', needed=False)
    assert judge(replace(rudder, recent=counts(100, nan=200))).level == WARN
    assert judge(replace(rudder, recent=counts(0, nan=200))).level == ERROR


def test_the_gravest_comes_first_and_none_is_left_out() -> None:
    found = judge(replace(WELL, senders=('/a', '/b'), recent=counts(0, nan=30)))
    assert found.level == ERROR
    assert found.text.startswith('none of 30')
    assert '2 publishers' in found.text


def test_only_what_came_lately_counts() -> None:
    recently = Recently()
    for second in range(100):
        bad = max(second - 50, 0)
        recently.add(
            float(second), InputCounts(10 * second, 10 * (second - bad), {'nan': 10 * bad})
        )
    assert recently.counts == InputCounts(300, 0, {'nan': 300})
    assert recently.seconds == 30.0
    assert recently.rate_hz == pytest.approx(10.0)


def test_a_sensor_that_is_switched_on_late_is_not_too_slow() -> None:
    recently = Recently()
    for second in range(22):
        said = 10 * max(second - 20, 0)
        recently.add(float(second), InputCounts(said, said))
    found = judge(replace(WELL, recent=recently.counts, seconds=recently.seconds))
    assert recently.seconds == 1.0
    assert found.level == OK


def test_counts_that_begin_anew_are_no_loss() -> None:
    recently = Recently()
    recently.add(0.0, InputCounts(100, 100))
    recently.add(1.0, InputCounts(110, 5))
    recently.add(2.0, InputCounts(120, 15))
    assert recently.counts == InputCounts(10, 10)


def test_the_one_with_the_least_lag_is_the_measure() -> None:
    offsets = {'speed_through_water': 6.2, 'position': 0.2, 'rudder': 99.0}
    assert behind_others(offsets) == {'speed_through_water': ('position', 6.0)}
    assert behind_others({'position': 5.0, 'speed_over_ground': None}) == {}


def test_one_that_is_ahead_of_this_computer_puts_no_other_behind() -> None:
    offsets = {'speed_through_water': -30.0, 'position': 0.5, 'speed_over_ground': 4.5}
    assert behind_others(offsets) == {'speed_over_ground': ('position', 4.0)}
    assert behind_others(offsets, simulated=True)['position'][0] == 'speed_through_water'
    assert behind_others({'speed_through_water': -30.0, 'position': -29.0}) == {}


def test_a_heading_that_is_turned_twice_is_said() -> None:
    assert convention_doubt('rep103', stamped=False, fed=True) == ''
    assert convention_doubt('compass', stamped=True, fed=False) == ''
    assert 'its type is known to count from north' in convention_doubt(
        'compass', stamped=False, fed=False
    )
    assert 'NMEA' in convention_doubt('compass', stamped=True, fed=True)
