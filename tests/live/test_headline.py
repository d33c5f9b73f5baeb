# SPDX-License-Identifier: Apache-2.0
"""What stands in large letters, and what would be done by who reads it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shipdrag_ros.coastdown.events import EndedBy
from shipdrag_ros.live.figures import to_go_s
from shipdrag_ros.live.headline import Ended, Situation, Tone, headline

STEADY = Situation(
    silent_s=0.5, lifecycle='active', monitor='steady', lead_s=1440.0, ready_s=600.0
)
COASTING = replace(STEADY, monitor='coastdown', lead_s=0.0, coast_s=400.0)
ENDED = Ended(by='turn', ago_s=20.0, band=0.04)


@pytest.mark.parametrize(
    ('now', 'text', 'action'),
    [
        (Situation(), 'NO NODE HEARD', 'shipdrag node --ship FILE'),
        (Situation(bag='run.mcap'), 'READING', 'run.mcap'),
        (Situation(bag='run.mcap', trouble='no disk'), 'BAG NOT READ', 'No disk.'),
        (replace(STEADY, silent_s=65.0), 'NODE SILENT for 1:05', 'old'),
        (replace(STEADY, lifecycle='inactive'), 'NODE INACTIVE', 'nothing'),
        (replace(STEADY, trouble='no data: log'), 'NO SPEED', 'No data: log.'),
        (replace(COASTING, trouble='no data'), 'NO SPEED at 6:40 of a coastdown', 'No data.'),
        (
            replace(STEADY, doubt='log: frozen'),
            'STEADY 24 min: record ready',
            'Look first: log: frozen. The engine',
        ),
        (STEADY, 'STEADY 24 min: record ready', 'if the master decides so'),
        (replace(STEADY, lead_s=130.0), 'STEADY 2 of 10 min', 'Ready in 8 min'),
        (replace(STEADY, lead_s=0.0), 'NOT STEADY YET', 'Hold course'),
        (replace(STEADY, lead_s=0.0, steer_deg=269.6), 'NOT STEADY YET', 'Steer 270'),
        (replace(STEADY, monitor='candidate'), 'SLOWING', 'rudder amidships'),
        (COASTING, 'COASTDOWN 6:40', 'Hold the rudder'),
        (replace(COASTING, band=0.09, to_go_s=299.0), 'COASTDOWN 6:40, ±9 %', '5 more minutes'),
        (replace(COASTING, band=0.09, to_go_s=10.0), '±9 %', '1 more minute to ±5 %'),
        (replace(COASTING, band=0.021), '±2.1 %', 'Good enough'),
        (replace(STEADY, ended=ENDED, steer_deg=9.7), 'TURNED: this run ends here', 'steer 010'),
        (replace(STEADY, ended=ENDED, monitor='candidate'), 'TURNED', 'Sail on'),
        (replace(STEADY, ended=ENDED, monitor='candidate', sailed=True), 'SLOWING', 'rudder'),
        (replace(STEADY, ended=ENDED, paired=True), 'TURNED', 'Both runs'),
        (replace(STEADY, ended=replace(ENDED, ago_s=601.0)), 'STEADY 24 min', 'master'),
        (replace(STEADY, ended=replace(ENDED, band=None, why_not='a plateau')), 'RUN NOT', 'A pl'),
        (replace(STEADY, ended=replace(ENDED, by='news')), 'RUN ENDED: news', 'Sail on'),
    ],
)
def test_it_says_where_things_stand_and_what_to_do(now: Situation, text: str, action: str) -> None:
    said = headline(now)
    assert text in said.text
    assert action in said.action


def test_nothing_is_green_that_is_not_well() -> None:
    for now in (STEADY, replace(COASTING, band=0.02), replace(STEADY, ended=ENDED)):
        assert headline(now).tone is Tone.GOOD
        assert headline(replace(now, doubt='log: frozen')).tone is Tone.WATCH
        assert headline(replace(now, trouble='no data')).tone is Tone.BAD


@pytest.mark.parametrize('by', [by for by in EndedBy if by is not EndedBy.GIVEN])
def test_every_end_has_words_of_its_own(by: EndedBy) -> None:
    said = headline(replace(STEADY, ended=replace(ENDED, by=by.value)))
    assert not said.text.startswith('RUN ENDED')
    assert said.tone is Tone.GOOD


def test_the_time_to_go_follows_the_power_law_of_the_band() -> None:
    bands = [(10.0 * i, 0.5 * (10.0 * i / 100.0) ** -1.5) for i in range(1, 31)]
    found = to_go_s(bands, 0.05)
    assert found == pytest.approx(100.0 * 10.0 ** (1.0 / 1.5) - 300.0, rel=1e-6)
    assert to_go_s(bands, 0.2) == 0.0
    assert to_go_s([(t, 0.3) for t, _ in bands], 0.05) is None  # flat: it promises nothing
    assert to_go_s(bands[:2], 0.05) is None
    assert to_go_s([], 0.05) is None
