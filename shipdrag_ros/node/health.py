# SPDX-License-Identifier: Apache-2.0
"""
The health of all inputs at a tick: counts of the node and of the monitor, judged.

What is heard elsewhere by a type that an input accepts is named too: it is what
the one who wonders about silence looks for.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from shipdrag_ros.coastdown import InputHealth
from shipdrag_ros.display import printable
from shipdrag_ros.messages import TOPICS
from shipdrag_ros.messages.types import is_stamped
from shipdrag_ros.node.inputs import InputTopic
from shipdrag_ros.node.judging import (
    SILENT_S,
    Counts,
    Finding,
    InputFacts,
    Recently,
    behind_others,
    judge,
)
from shipdrag_ros.samples import MOTION_INPUTS

_SHOWN = 6  # candidates of an input


@dataclass(frozen=True)
class InputState:
    """
    One input as /diagnostics shows it.

    Attributes
    ----------
    topic
        What was counted since the node has it.
    finding
        What is to be said.
    health
        By the monitor; None while the node is not active.
    rate_hz
        Messages a second of steady time, before the last tick.
    fresh
        Whether it has been heard lately.
    """

    topic: InputTopic
    finding: Finding
    health: InputHealth | None
    recent: Counts
    rate_hz: float
    fresh: bool


class InputStates:
    """Judges the inputs, once a tick."""

    def __init__(self) -> None:
        self._recently: dict[str, Recently] = {}
        self._seen: tuple[InputState, ...] = ()

    @property
    def seen(self) -> tuple[InputState, ...]:
        """Of the last tick."""
        return self._seen

    def tick(
        self,
        topics: Sequence[InputTopic],
        health: Mapping[str, InputHealth],
        *,
        doubts: Mapping[str, str],
        simulated: bool,
    ) -> tuple[InputState, ...]:
        """
        Look at all inputs again.

        Parameters
        ----------
        health
            By input, of the monitor; empty while there is none.
        doubts
            What is odd about an input besides, by its name.
        simulated
            Whether the clock is simulated; it then says nothing about that of a sensor.
        """
        now_s = time.monotonic()
        fresh = {
            topic.name: topic.age_s is not None and topic.age_s < SILENT_S for topic in topics
        }
        behind = behind_others(
            {topic.name: topic.clock_offset_s for topic in topics if fresh[topic.name]},
            simulated=simulated,
        )
        self._seen = tuple(
            self._state(
                topic,
                health.get(topic.name),
                now_s,
                fresh,
                behind.get(topic.name),
                doubts.get(topic.name, ''),
                None if simulated else topic.clock_offset_s,
            )
            for topic in topics
        )
        return self._seen

    def _state(
        self,
        topic: InputTopic,
        health: InputHealth | None,
        now_s: float,
        fresh: Mapping[str, bool],
        behind: tuple[str, float] | None,
        doubt: str,
        offset_s: float | None,
    ) -> InputState:
        recently = self._recently.setdefault(topic.name, Recently())
        recently.add(now_s, _counts(topic, health))
        others = (name for name in MOTION_INPUTS if name != topic.name)
        facts = InputFacts(
            topic.name,
            needed=topic.name in MOTION_INPUTS and not any(fresh.get(name) for name in others),
            type=topic.type or topic.fed_by or None,
            fed=bool(topic.fed_by),
            may_be_fed=topic.may_be_fed,
            stamped=topic.type is None or is_stamped(topic.type),
            other_types=topic.other_types,
            accepted=topic.accepted,
            absent=topic.absent,
            senders=topic.senders,
            misfit=topic.incompatible_qos,
            active=health is not None,
            age_s=topic.age_s,
            recent=recently.counts,
            seconds=recently.seconds,
            offset_s=offset_s,
            behind=behind,
            doubt=doubt,
        )
        return InputState(
            topic, judge(facts), health, facts.recent, recently.rate_hz, fresh[topic.name]
        )


def _counts(topic: InputTopic, health: InputHealth | None) -> Counts:
    rejected = dict(topic.unreadable)
    if health is not None:
        rejected |= health.rejected
    return Counts(
        topic.received,
        0 if health is None else health.used,
        rejected,
        topic.lost,
        topic.unstamped,
    )


def candidates(
    published: Iterable[tuple[str, Sequence[str]]], inputs: Iterable[str], *, taken: Sequence[str]
) -> dict[str, list[str]]:
    """
    Return the topics whose type an input accepts, by input, the likeliest first.

    Parameters
    ----------
    published
        Topics of the graph and their types.
    inputs
        Those that look for one.
    taken
        Topics that are inputs already.
    """
    found: dict[str, list[str]] = {}
    there = [(topic, types) for topic, types in published if topic not in taken]
    for name in inputs:
        fits = [topic for topic, types in there if set(types) & set(TOPICS[name])]
        if fits:
            found[name] = sorted(fits, key=partial(_unlike, name))[:_SHOWN]
    return found


def _unlike(name: str, topic: str) -> int:
    """Rank a topic: one that shares words with the input is more likely to be it."""
    return -len(set(name.split('_')) & set(topic.lower().replace('/', '_').split('_')))


def candidates_text(found: Mapping[str, Sequence[str]]) -> str:
    """
    Say which topics may be meant, and how to name one; '' without any.
    """
    if not found:
        return ''
    listed = '; '.join(f'{name}: {printable(", ".join(topics))}' for name, topics in found.items())
    name, topics = next(iter(found.items()))
    return f'of a type that fits are {listed}; name one with -r {name}:={printable(topics[0])}'
