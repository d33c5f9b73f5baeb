# SPDX-License-Identifier: Apache-2.0
"""
Change one number of a model at a time, by 10 and 50 per cent up and down, and show how far the
motion moves: root mean square of its differences. With a manoeuvring model: which derivatives
matter in a zigzag or a turning circle, a check of the model without the others, and which
manoeuvre shows which derivative. With a ship file: which of its values must be known well for a
coastdown to be judged right, and which effect a wrong one is taken for.

Options
-------
--report FILE.html
    write the result with its pictures to one HTML file
--model
    manoeuvring model (default: {_MODEL})
--ship FILE
    ship file with a baseline, in its place
--manoeuvre NAME
    zigzag:ANGLE or turn:ANGLE [degrees of rudder]; with --ship {coasting.KIND} or
    {coasting.KIND}:SPEED [m/s] (default: {_MANOEUVRE}; with --ship {coasting.KIND} from
    {coasting.SPEED_FRACTION:g} of the highest speed of the baseline)
--keep N
    how many to keep (default: {_KEEP} derivatives; with --ship those values of which 10 per cent
    move the record beyond its noise)
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shipdrag_ros.cli.arguments import add
from shipdrag_ros.cli.output import Output, Presentation, by_columns, show
from shipdrag_ros.display import Section, Table
from shipdrag_ros.report.drawing import BLUE, ORANGE, VERMILION, new_figure, one_axis, styled
from shipdrag_ros.ship import Ship
from shipdrag_ros.studies.manoeuvring import Motions, mariner, meaning, parse
from shipdrag_ros.studies.sensitivity import coasting, steering
from shipdrag_ros.studies.sensitivity.face import coasting as face

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def ranking_picture(found: steering.SteeringStudy) -> Figure:
    """
    Draw the mean losses of all derivatives, the largest first.
    """
    losses, order = found.losses, found.losses.ranking
    places = np.arange(len(order))[::-1]
    means, count = losses.mean[losses.order], len(found.selection.kept)
    with one_axis(9.0, 0.8 + 0.2 * len(order)) as (figure, axis):
        axis.barh(places[:count], means[:count], color=BLUE, label='kept')
        axis.barh(places[count:], means[count:], color=face.PALE, label='set to 0')
        by_mean = found.mean_norms.mean[losses.order]
        axis.plot(by_mean, places, '|', color=VERMILION, label='by the mean norm')
        if found.selection.threshold > 0.0:
            axis.axvline(found.selection.threshold, color='#555555', linewidth=0.8)
        axis.set_xscale('log')
        axis.set_yticks(places, [f'{meaning(name)}  {name}' for name in order], fontsize=8)
        axis.set(ylim=(-0.7, len(order) - 0.3), xlabel='mean loss [of the speed: 0.1 is a tenth]')
        axis.grid(visible=False, axis='y')
        axis.legend(loc='lower right')
    return figure


def check_picture(found: steering.SteeringStudy) -> Figure:
    """
    Draw heading and rudder, speeds and yaw rate of the full and the reduced models.
    """
    full, kept = found.check.full, found.check.reduced
    by_group = found.group_check.reduced
    lines: Sequence[tuple[Motions, str, str, str]] = (
        (full, 'full', '#444444', '-'),
        (kept, f'{len(found.selection.kept)} derivatives kept', VERMILION, '--'),
        (by_group, f'{found.independent} measurements kept', BLUE, ':'),
    )
    with styled():
        figure = new_figure(9.0, 5.2)
        axes = figure.subplots(2, 2, sharex=True)
        for motion, label, color, style in lines:
            surge, sway, yaw = motion.speeds.T
            for axis, name, values in (
                (axes[0, 0], 'heading [deg]', np.degrees(motion.heading_rad)),
                (axes[0, 1], 'yaw rate r [deg/s]', np.degrees(yaw)),
                (axes[1, 0], 'speed ahead u [m/s]', surge),
                (axes[1, 1], 'sway v [m/s]', sway),
            ):
                axis.plot(motion.time_s, values, color=color, linestyle=style, label=label)
                axis.set_ylabel(name)
        for axis in axes[1]:
            axis.set_xlabel('time after the first order [s]')
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside upper center', ncols=len(labels))
    return figure


def design_picture(shown: steering.Experiment) -> Figure:
    """
    Draw the losses of all derivatives in all manoeuvres as a map.
    """
    from matplotlib.colors import LogNorm

    manoeuvres = [manoeuvre.name for manoeuvre in shown.manoeuvres]
    with one_axis(9.0, 3.0, {'axes.grid': False}) as (figure, axis):
        largest = float(np.max(shown.loss))
        norm = LogNorm(1e-4 * largest, largest)
        floored = np.maximum(shown.loss.T, 1e-5 * largest)
        image = axis.imshow(floored, norm=norm, cmap='Blues', aspect='auto')
        axis.plot(np.argmax(shown.loss, axis=1), 'o', color=ORANGE, markersize=4)
        axis.set_xticks(np.arange(len(shown.names)), shown.names, rotation=90)
        axis.set_yticks(np.arange(len(manoeuvres)), manoeuvres)
        axis.set(xlabel='derivative', ylabel='manoeuvre')
        figure.colorbar(image, label='loss of 10 %\n[of the speed]')
    return figure


LOSSES = (
    'Loss by a derivative that is 10 or 50 per cent wrong: root mean square of the differences in '
    'u, v and r, times 1000'
)
CHECK = (
    f'The check; rudder amidships for {steering.APPROACH_S:g} s, then first to starboard, the '
    f'helmsman looks every {steering.CONTROL_S:g} s; differences over the whole manoeuvre'
)
DESIGN = (
    'Which manoeuvre shows which derivative: loss of 10 per cent, times 1000. Partial '
    'contribution: the part of it that is orthogonal to the responses of all others'
)

_RANKING, _CHECKED = 'How much each matters', 'The model without the others'
_SAILED = 'Which manoeuvre to sail'


def shown(found: steering.SteeringStudy, sailed: steering.Experiment) -> Presentation:
    """
    Return what is printed, and shown on a page.

    Parameters
    ----------
    found
        The losses and the reduced model.
    sailed
        Of several manoeuvres.
    """

    def pictures() -> Iterator[tuple[str, Figure, str]]:
        ranking = (
            'How much the motion changes when a derivative is wrong: the longer the bar, the '
            'better it must be known. Pale bars, short of the line, may be left out of the model.'
        )
        yield _RANKING, ranking_picture(found), ranking
        checked = (
            f'{steering.CHECKED_BY.name} of the full and of the reduced models: lines that lie '
            'on each other show that what was left out is not missed.'
        )
        yield _CHECKED, check_picture(found), checked
        design = (
            'Loss of 10 per cent of each derivative in each manoeuvre: the darker, the better it '
            'is seen. Dot: the manoeuvre that shows it best.'
        )
        yield _SAILED, design_picture(sailed), design

    order = found.losses.ranking
    meanings = by_columns({'derivative': order, 'what it is': map(meaning, order)})
    caption = 'What the derivatives are: which force, and what it grows with'
    return Presentation(
        f'Which derivatives matter: {found.ship.name}',
        sentence(found),
        [
            Section(lines=notes(found)),
            Section(_RANKING, tables=((LOSSES, loss_table(found)),)),
            Section(_CHECKED, tables=((CHECK, check_table(found)),)),
            Section(_SAILED, tables=((DESIGN, design_table(sailed)),)),
            Section('What the names mean', tables=((caption, meanings),)),
        ],
        pictures(),
        source=found.ship.source,
    )


def sentence(found: steering.SteeringStudy) -> str:
    """
    Say what is kept.
    """
    kept, dropped = found.selection.kept, found.selection.dropped
    return (
        f'{found.ship.name}, {found.manoeuvre.name}: of {len(kept) + len(dropped)} derivatives '
        f'{len(kept)} have a mean loss above {found.selection.threshold:.3g} and are kept; '
        f'{kept[0]} ({meaning(kept[0])}) matters most.'
    )


def notes(found: steering.SteeringStudy) -> tuple[str, ...]:
    """
    Say what was done, what the losses look like, and what the number kept means.
    """
    root, mean = steering.Observations.of(found.losses), steering.Observations.of(found.mean_norms)
    agree = 'the same' if found.norms_agree else 'not quite the same'
    ship, kept = found.ship, found.selection.kept
    after = sum(ship.multiples.get(name) in kept for name in found.selection.dropped)
    return (
        'A derivative says how much of a force or moment (X ahead, Y sideways, N turning) comes '
        'with a motion (u change of speed, v sway, r yaw) or with the rudder (d). The loss is how '
        'far the manoeuvre moves when it is wrong, as a part of the speed.',
        'One derivative is changed at a time, all simulations in one call: from steady sailing, '
        'first to starboard, the rudder reversed at the very heading, 1200 samples 0.5 s apart; '
        f'u and v over {ship.speed_m_s:g} m/s, r over speed per length.',
        f'+10 and -10 % differ by {root.unlike[0]:.1%} (median), +50 and -50 % by '
        f'{root.unlike[1]:.1%}; 50 % costs {root.growth:.2f} times 10 %. Of the mean norm: '
        f'{mean.unlike[0]:.1%}, {mean.unlike[1]:.1%}, {mean.growth:.2f}; it keeps {agree} '
        f'{len(kept)}.',
        f'{len(ship.multiples)} of the {len(ship.viscous)} derivatives are exact multiples of '
        f'others, so that the model is {len(ship.groups)} measurements: the {len(kept)} kept hold '
        f'{found.independent} of them, and {after} of the dropped ones follow from a kept one.',
        f'Chosen by measurement, with all that follows from each, the same {found.independent} '
        f'are {len(found.group_derivatives)} derivatives; the check shows which of the two models '
        'is closer.',
    )


def loss_table(found: steering.SteeringStudy) -> Table:
    """
    Show the losses, the most important derivative first.
    """
    order = found.losses.ranking
    table = np.column_stack([found.losses.table, found.losses.mean, found.mean_norms.mean])
    heads = ('+10 %', '-10 %', '+50 %', '-50 %', 'mean', 'by mean norm')
    return by_columns(
        {
            '': order,
            **{
                head: [f'{1e3 * value:.3f}' for value in column]
                for head, column in zip(heads, table[found.losses.order].T)
            },
            'kept': ('yes' if name in found.selection.kept else 'no' for name in order),
            'multiple of': (found.ship.multiples.get(name, '-') for name in order),
        }
    )


def check_table(found: steering.SteeringStudy) -> Table:
    """
    Show how close the reduced models come.
    """
    ship, kept = found.ship, found.selection.kept
    grouped, independent = f'{len(found.group_derivatives)}', f'{found.independent}'
    rows = (
        ('full', f'{len(ship.viscous)}', f'{len(ship.groups)}', *_degrees(found.check, 0)),
        ('kept', f'{len(kept)}', independent, *_degrees(found.check, 1)),
        ('kept by measurement', grouped, independent, *_degrees(found.group_check, 1)),
    )
    heads = (
        *(steering.CHECKED_BY.name, 'derivatives', 'measurements'),
        *('overshoot 1 [deg]', 'overshoot 2 [deg]'),
        *('rms u [m/s]', 'v [m/s]', 'r [deg/s]', 'heading [deg]'),
    )
    return Table(heads, rows)


def _degrees(check: steering.ReducedModelCheck, model: int) -> tuple[str, ...]:
    over = [f'{value:.2f}' for value in np.degrees(check.overshoots_rad[model])]
    over += ['-'] * (2 - len(over))
    if model == 0:
        return (*over, '-', '-', '-', '-')
    surge, sway, yaw, heading = check.rms_difference.values()
    turned = f'{np.degrees(yaw):.3f}', f'{np.degrees(heading):.2f}'
    return (*over, f'{surge:.3f}', f'{sway:.3f}', *turned)


def design_table(shown: steering.Experiment) -> Table:
    """
    Show which manoeuvre makes which derivative visible.
    """
    there = shown.partial_contribution[np.arange(len(shown.names)), np.argmax(shown.loss, axis=1)]
    return by_columns(
        {
            '': shown.names,
            **{
                manoeuvre.name: [f'{1e3 * value:.2f}' for value in column]
                for manoeuvre, column in zip(shown.manoeuvres, shown.loss.T)
            },
            'shown most by': (manoeuvre.name for manoeuvre in shown.best),
            'partial contribution there': (f'{value:.1%}' for value in there),
            'in all together': (f'{value:.1%}' for value in shown.partial_contribution_together),
        }
    )


_MODELS = {'mariner': mariner}
_MODEL, _MANOEUVRE, _KEEP = 'mariner', 'zigzag:15', 24


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add the arguments of the verb.
    """
    subject = parser.add_mutually_exclusive_group()
    # without a default of argparse, which would not say that both are given
    subject.add_argument('--model', choices=list(_MODELS))
    subject.add_argument('--ship', type=Path, metavar='FILE')
    parser.add_argument('--manoeuvre', metavar='NAME')
    parser.add_argument('--keep', type=int, metavar='N')
    add(parser, '--report', '--json')


def run(options: argparse.Namespace) -> int:
    """
    Analyse and show it.
    """
    output = Output(options.json)
    asked, keep = options.manoeuvre, options.keep
    if options.ship is None:
        model = _MODELS[options.model or _MODEL]()
        manoeuvre = parse(_MANOEUVRE if asked is None else asked)
        steered = steering.study(model, manoeuvre, keep=_KEEP if keep is None else keep)
        sailed = steering.experiment(model)
        seen = shown(steered, sailed)
        document = {**steered.to_dict(), 'experiment': sailed.to_dict()}
    else:
        ship = Ship.load(options.ship)
        coast = coasting.parse_coast(ship, coasting.KIND if asked is None else asked)
        coasted = coasting.study_coast(ship, coast, keep=keep)
        seen, document = face.shown(coasted), coasted.to_dict()
    show(output, seen, options.report)
    output.json(document)
    return 0
