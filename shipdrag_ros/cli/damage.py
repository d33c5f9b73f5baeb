# SPDX-License-Identifier: Apache-2.0
"""Damages as a table, for the verbs that find them."""

from __future__ import annotations

from collections.abc import Sequence

from shipdrag_ros.bags.salvage import Damage
from shipdrag_ros.cli.output import Output
from shipdrag_ros.display import Table

_SHOWN = 40


def damage_table(output: Output, damages: Sequence[Damage], count: int) -> None:
    """
    Print the first damages, and how many more there are.
    """
    output.table(
        Table(
            ('offset', 'record', 'kind', 'what'),
            tuple(
                (
                    f'{each.offset}',
                    each.record,
                    each.kind.value,
                    ': '.join(filter(None, (each.file, each.detail))) or '-',
                )
                for each in damages[:_SHOWN]
            ),
        )
    )
    if count > _SHOWN:
        output.say(f'and {count - min(_SHOWN, len(damages))} more; --json lists them')
