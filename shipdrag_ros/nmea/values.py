# SPDX-License-Identifier: Apache-2.0
"""Who measures what: the values of a sentence, and which of several sources is taken."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple, TypeVar

from shipdrag_ros.nmea.framing import Sentence
from shipdrag_ros.nmea.sentences import READERS, Fields, MeasuredValue, Mounting, NoValue
from shipdrag_ros.samples import Channel

AnySource = TypeVar('AnySource', 'SentenceSource', 'tuple[SentenceSource, str]')

_RANK = {kind: place for place, kind in enumerate(READERS)}


class SentenceSource(NamedTuple):
    """Who sends an input; the better source is the smaller."""

    rank: int
    detail: str
    talker: str
    kind: str

    def __str__(self) -> str:
        return f'{self.talker}{self.kind} {self.detail}'.strip()


def read_values(
    sentence: Sentence, mounting: Mounting
) -> list[tuple[Channel, SentenceSource | None, MeasuredValue | NoValue]]:
    """
    Return what a sentence measures, or why it does not.
    """
    found: list[tuple[Channel, SentenceSource | None, MeasuredValue | NoValue]] = []
    kind = sentence.kind or sentence.talker  # a proprietary one is all talker
    fields = Fields(kind, sentence.fields)
    for listed, read in READERS.get(kind, ()):
        channel = listed
        try:
            value = read(fields, mounting)
        except NoValue as reason:
            found.append((channel, None, reason))
        else:
            if value is None:
                continue
            if value.channel is not None:
                channel = value.channel
            rank = _RANK[kind]
            source = SentenceSource(rank, value.detail, sentence.talker, sentence.kind)
            found.append((channel, source, value))
    return found


def best(counts: Counter[AnySource]) -> AnySource:
    """
    Return the one source of an input, by the number of values of each.

    The first in the order of `SentenceSource` of those with at least half as many
    values as the most frequent: two instruments of different place or
    scale are never mixed.
    """
    return min(source for source, n in counts.items() if 2 * n >= max(counts.values()))
