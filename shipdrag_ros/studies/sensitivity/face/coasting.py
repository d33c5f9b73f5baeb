# SPDX-License-Identifier: Apache-2.0
"""Which values of a ship file must be known well, in sentences, tables and pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from shipdrag_ros.cli.output import Presentation, by_columns
from shipdrag_ros.display import Section, Table
from shipdrag_ros.report.drawing import BLUE, one_axis
from shipdrag_ros.simulation.effects import effects_of
from shipdrag_ros.studies.sensitivity.coasting import LOG_SD_M_S, POSITION_SD_M, WORST, CoastStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure


PALE = '#c3d3df'


def particulars_picture(found: CoastStudy) -> Figure:
    """
    Draw the change of the record by each value, the largest on top.
    """
    order = found.losses.ranking
    table = found.losses.table[found.losses.order]
    places = np.arange(len(order))[::-1]
    with one_axis(9.0, 0.8 + 0.28 * len(order)) as (figure, axis):
        wrong, stated = table[:, :2].mean(axis=1), np.nan_to_num(table[:, 4:6].mean(axis=1))
        axis.barh(places, wrong, color=PALE, height=0.7, label='10 per cent wrong')
        label = 'wrong by the stated standard deviation'
        axis.barh(places, stated, color=BLUE, height=0.35, label=label)
        axis.axvline(1.0, color='#555555', linewidth=0.8, label='noise of one sample')
        axis.set_xscale('log')
        axis.set_yticks(places, order)
        axis.set_xlabel('root mean square change of the record [sd of log and position]')
        axis.grid(visible=False, axis='y')
        axis.legend(loc='lower right')
    return figure


def mimic_picture(found: CoastStudy) -> Figure:
    """
    Draw how much of each effect is left when a value is blamed for it.
    """
    places = np.arange(len(found.mimics))[::-1]
    with one_axis(9.0, 0.8 + 0.28 * len(places)) as (figure, axis):
        axis.barh(places, [mimic.left for mimic in found.mimics], color=BLUE, height=0.65)
        for place, mimic in zip(places, found.mimics):
            text = f'{mimic.value} {mimic.wrong_by:+.0%}'
            axis.text(mimic.left + 0.01, place, text, va='center', fontsize=7)
        axis.set_yticks(places, [mimic.effect for mimic in found.mimics])
        axis.set_xlim(0.0, 1.5)
        axis.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
        axis.set_xlabel('part of the effect that is left [1]')
        axis.grid(visible=False, axis='y')
    return figure


LOSSES = (
    'Change of the record by a wrong value, in standard deviations of log and position; of r(v) '
    'by 10 per cent; and the error that moves the record as far as all that is stated as uncertain'
)
MIMICS = (
    'Effects of the library at a usual size, and the wrong value that each may be taken for; '
    'left: what of the effect such an error does not explain'
)
_CLOSE = 0.1  # relative error
_LARGE = 0.5  # relative error; beyond it only that it is larger is said

_KNOWN, _MISTAKEN = 'What must be known well', 'What a wrong value is taken for'


def shown(found: CoastStudy) -> Presentation:
    """
    Return what is printed, and shown on a page.
    """

    def pictures() -> Iterator[tuple[str, Figure, str]]:
        known = (
            'How far the record moves when a value of the ship file is wrong by 10 per cent, and '
            'by its stated standard deviation. The longest bars are to be measured well.'
        )
        yield _KNOWN, particulars_picture(found), known
        mistaken = (
            'What is left of each effect when the value beside its bar is blamed for it. A short '
            'bar: a ship file that is so far wrong is taken for the effect, and no record '
            'separates the two; a long bar: the effect looks like nothing else.'
        )
        yield _MISTAKEN, mimic_picture(found), mistaken

    return Presentation(
        'Which particulars matter' + (f': {found.ship.name}' if found.ship.name else ''),
        sentence(found),
        [
            Section(lines=notes(found)),
            Section(_KNOWN, tables=((LOSSES, loss_table(found)),)),
            Section(_MISTAKEN, tables=((MIMICS, mimic_table(found)),)),
        ],
        pictures(),
        source=found.ship.summary(),
    )


def sentence(found: CoastStudy) -> str:
    """
    Say what must be known well.
    """
    kept = found.selection.kept
    return (
        f'{found.ship.name or "The ship"}, {found.coast.name} m/s: the values that matter most '
        f'are {", ".join(kept[:3])}; {len(kept)} of {len(found.importance)} have a mean loss '
        f'above {found.selection.threshold:.3g}.'
    )


def notes(found: CoastStudy) -> tuple[str, ...]:
    """
    Say what was done and what it means.
    """
    scenario, check = found.coast.scenario, found.check
    near = [mimic for mimic in found.mimics if mimic.left < 0.05]
    alike = '; '.join(f'{mimic.effect} like {mimic.value} {mimic.wrong_by:+.0%}' for mimic in near)
    said = [
        f'A coastdown of {scenario.duration_s:.0f} s from {scenario.speed_m_s:.2f} m/s, one '
        f'value changed at a time; noise of a sample: log {LOG_SD_M_S:g} m/s, position '
        f'{POSITION_SD_M:g} m.',
        'r(v) estimated from a record takes n_r alone from the ship file, hence the added mass, '
        'length and volume; all else matters where a record is compared with the baseline.',
        f'With every value that is not kept wrong by 10 %, so that they add up, a coastdown from '
        f'{check.coast.scenario.speed_m_s:.2f} m/s is off by {check.speed_m_s:.3f} m/s and '
        f'{check.position_m:.1f} m (root mean square).',
    ]
    certain = [one for one in found.importance if one.tolerable < _CLOSE]
    others = [one.tolerable for one in found.importance if one.tolerable >= _CLOSE]
    if certain and others:
        close = ', '.join(f'{one.particular.key} {one.tolerable:.1%}' for one in certain)
        said.append(
            f'To be known as well as the stated uncertainties deserve: {close}; all else may be '
            f'wrong by {_tolerable(min(others))}.'
        )
    if alike:
        said.append(
            f'To within a twentieth of what they do, effects look like a wrong value: {alike}.'
        )
    if not np.isfinite(found.losses.table[:, :4]).all():
        said.append(
            'A dash stands where so large a change leaves the table of the baseline, or where no '
            'standard deviation is stated.'
        )
    return tuple(said)


def loss_table(found: CoastStudy) -> Table:
    """
    Show what each value does, the most important first.
    """
    order = found.losses.ranking
    changed = found.losses.table[found.losses.order].T
    ranked = [found.importance[place] for place in found.losses.order]
    stated = [one.particular for one in ranked]
    heads = ('+10 %', '-10 %', '+50 %', '-50 %', '+1 sd')
    return by_columns(
        {
            '': order,
            'value': ('-' if math.isnan(one.value) else f'{one.value:.4g}' for one in stated),
            'sd': ('-' if math.isnan(one.sd) else f'{one.sd:.1%}' for one in stated),
            **{head: map(_number, column) for head, column in zip(heads, changed)},
            'estimated r': (f'{one.estimated:.2%}' for one in ranked),
            'stated r': (f'{one.stated:.2%}' for one in ranked),
            'know within': (_tolerable(one.tolerable) for one in ranked),
            'kept': ('yes' if name in found.selection.kept else 'no' for name in order),
        }
    )


def mimic_table(found: CoastStudy) -> Table:
    """
    Show which wrong value looks like which effect.
    """
    mimics = found.mimics
    library = effects_of(found.ship)
    units = [library[mimic.effect].parameters[0].unit for mimic in mimics]
    # at the limit the value would have to be wrong by more than is thought of
    bounds = ['at least ' if abs(mimic.wrong_by) >= WORST else '' for mimic in mimics]
    return by_columns(
        {
            'effect': (mimic.effect for mimic in mimics),
            'size': (f'{one.size:.3g} {unit}'.rstrip() for one, unit in zip(mimics, units)),
            'distance [sd]': (f'{mimic.distance_sd:.2f}' for mimic in mimics),
            'looks like': (mimic.value for mimic in mimics),
            'wrong by': (f'{bound}{one.wrong_by:+.0%}' for one, bound in zip(mimics, bounds)),
            'left': (f'{mimic.left:.1%}' for mimic in mimics),
        }
    )


def _number(value: float) -> str:
    return f'{value:.2f}' if math.isfinite(value) else '-'


def _tolerable(value: float) -> str:
    if math.isnan(value):
        return '-'
    return f'{value:.1%}' if value < _LARGE else f'over {_LARGE:.0%}'
