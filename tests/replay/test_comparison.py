# SPDX-License-Identifier: Apache-2.0
"""What was recorded beside what is replayed, message by message."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shipdrag_ros import __version__
from shipdrag_ros.bags import open_runs
from shipdrag_ros.coastdown.events import Event, Update
from shipdrag_ros.messages import OutputMessage, types
from shipdrag_ros.messages.publishing import outputs
from shipdrag_ros.replay import Recorded
from shipdrag_ros.replay.comparison import Comparison
from shipdrag_ros.replay.words import recorded_sentence


def message(stamp_ns: int, payload: bytes = b'', name: str = 'speed') -> OutputMessage:
    kind = 'geometry_msgs/msg/TwistWithCovarianceStamped'
    return OutputMessage(f'/coastdown_node/{name}', kind, payload, stamp_ns)


@pytest.mark.parametrize(
    ('recorded', 'replayed', 'expected'),
    [
        ([], [1, 2], (0, 0, None)),
        ([1, 2, 3], [1, 2, 3], (3, 3, None)),
        ([3, 4], [1, 2, 3, 4, 5], (2, 2, None)),
        ([1, 3], [1, 2, 3], (3, 2, 'at 2 ns: recorded nothing, replayed')),
        ([1, 2, 3], [1, 3], (3, 2, 'at 2 ns: recorded 0 bytes')),
        ([1, 2], [], (2, 0, 'at 1 ns: recorded')),
        ([5, 6, 1, 2], [5, 6, 1, 2], (4, 4, None)),
    ],
)
def test_comparison(recorded, replayed, expected):
    comparison = Comparison(iter([message(stamp) for stamp in recorded]))
    for stamp in replayed:
        comparison.add(message(stamp))
    found = comparison.finish()
    assert (found.compared, found.identical) == expected[:2]
    if expected[2] is None:
        assert found.first_difference is None
    else:
        assert found.first_difference is not None
        assert expected[2] in found.first_difference


def test_a_recorded_cloud_of_no_whole_figures_is_a_difference() -> None:
    kind = 'sensor_msgs/msg/PointCloud2'
    cloud = types.make(kind, header=types.header(5, ''), data=np.zeros(5, np.uint8))
    curve = OutputMessage('/n/resistance_curve', kind, types.serialize(kind, cloud), 5)
    found = Comparison(iter([curve])).finish()
    assert (found.compared, found.identical, found.largest_difference) == (1, 0, np.inf)
    assert 'at 5 ns: recorded 0 points' in str(found.first_difference)


def test_topics_are_compared_each_for_itself() -> None:
    recorded = [message(stamp, name=name) for name in ('speed', 'resistance') for stamp in (1, 2)]
    comparison = Comparison(iter([*recorded, message(1, name='events')]))
    for stamp in (1, 2):
        for name in ('speed', 'resistance', 'events'):
            comparison.add(message(stamp, name=name))
    assert comparison.finish() == Recorded(4, 4, None, beside=4)


def test_a_figure_that_differs_is_shown(recording: tuple[Path, list[Event]]) -> None:
    (run,) = open_runs([recording[0]])
    original = list(run.outputs())
    updates = [event for event in recording[1] if isinstance(event, Update)]
    changed = replace(
        updates[3], estimate=replace(updates[3].estimate, last_resistance_m_s2=0.125)
    )
    comparison = Comparison(iter(original))
    for event in [*updates[:3], changed, *updates[4:]]:
        for each in outputs(event):
            comparison.add(each)
    found = comparison.finish()
    # and the final curve and both withdrawals, which were not given
    assert found.compared - found.identical == 4
    assert found.largest_difference == np.inf  # of that curve
    assert found.first_difference is not None
    assert 'replayed 0.125 m/s^2' in found.first_difference
    assert f'/coastdown_node/resistance at {changed.stamp_ns} ns' in found.first_difference


def test_how_much_figures_differ_is_told(recording: tuple[Path, list[Event]]) -> None:
    updates = [event for event in recording[1] if isinstance(event, Update)]
    last = updates[3].estimate.last_resistance_m_s2
    curve = updates[3].estimate.curve
    speed_sigma = updates[3].estimate.last_speed_sigma_m_s
    sigma = updates[3].estimate.last_sigma_m_s2
    for changed, difference in (
        (replace(updates[3].estimate, last_resistance_m_s2=last * (1.0 - 1e-13)), 1e-13),
        (
            replace(
                updates[3].estimate,
                conditions=replace(curve, resistance_m_s2=curve.resistance_m_s2 * 1.01),
            ),
            0.01 / 1.01,
        ),
        (
            replace(updates[3].estimate, last_speed_sigma_m_s=speed_sigma * (1.0 + 1e-6)),
            2e-6,  # of the variance
        ),
        (replace(updates[3].estimate, last_sigma_m_s2=sigma * (1.0 + 1e-6)), 2e-6),
    ):
        comparison = Comparison(iter(outputs(updates[3])))
        for each in outputs(replace(updates[3], estimate=changed)):
            comparison.add(each)
        assert comparison.finish().largest_difference == pytest.approx(difference, rel=0.01)


def test_a_difference_is_told_in_standard_deviations(recording: tuple[Path, list[Event]]) -> None:
    (update, *_) = [event for event in recording[1] if isinstance(event, Update)]
    was = update.estimate
    apart = replace(was, last_resistance_m_s2=was.last_resistance_m_s2 + 3.0 * was.last_sigma_m_s2)
    comparison = Comparison(iter(outputs(update)), by='0.1.0')
    for each in outputs(replace(update, estimate=apart)):
        comparison.add(each)
    found = comparison.finish()
    assert found.largest_difference_sigma == pytest.approx(3.0)
    assert found.by == '0.1.0'
    assert 'version 0.1.0 recorded it' in recorded_sentence(found)
    assert 'differ by 3 standard deviations' in recorded_sentence(found)
    assert 'version' not in recorded_sentence(replace(found, by=__version__))
