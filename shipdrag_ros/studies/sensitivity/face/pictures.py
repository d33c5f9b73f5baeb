# SPDX-License-Identifier: Apache-2.0
"""Pictures of what matters: rankings, manoeuvres beside each other, maps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from shipdrag_ros.report.drawing import BLUE, ORANGE, VERMILION, new_figure, styled
from shipdrag_ros.studies.manoeuvring.manoeuvre import ManoeuvreMotion
from shipdrag_ros.studies.manoeuvring.ship import meaning
from shipdrag_ros.studies.sensitivity.coasting import CoastStudy
from shipdrag_ros.studies.sensitivity.steering import Experiment, SteeringStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PALE = '#c3d3df'


def ranking_picture(found: SteeringStudy) -> Figure:
    """
    Draw the mean losses of all derivatives, the largest first.
    """
    losses, order = found.losses, found.losses.ranking
    places = np.arange(len(order))[::-1]
    chosen = [losses.names.index(name) for name in order]
    with styled():
        figure = new_figure(9.0, 0.8 + 0.2 * len(order))
        axis = figure.subplots()
        count = len(found.selection.kept)
        for part, color, label in (
            (slice(0, count), BLUE, 'kept'),
            (slice(count, None), _PALE, 'set to 0'),
        ):
            axis.barh(places[part], losses.mean[chosen][part], color=color, label=label)
        axis.plot(
            found.mean_norms.mean[chosen],
            places,
            linestyle='none',
            marker='|',
            color=VERMILION,
            label='by the mean norm',
        )
        if found.selection.threshold > 0.0:
            axis.axvline(found.selection.threshold, color='#555555', linewidth=0.8)
        axis.set_xscale('log')
        axis.set_yticks(places, [f'{meaning(name)}  {name}' for name in order], fontsize=8)
        axis.set_ylim(-0.7, len(order) - 0.3)
        axis.set_xlabel('mean loss [of the speed: 0.1 is a tenth]')
        axis.grid(visible=False, axis='y')
        axis.legend(loc='lower right')
    return figure


def check_picture(found: SteeringStudy) -> Figure:
    """
    Draw heading and rudder, speeds and yaw rate of the full and the reduced models.
    """
    full, kept = found.check.full, found.check.reduced
    by_group = found.group_check.reduced
    lines: Sequence[tuple[ManoeuvreMotion, str, str, str]] = (
        (full, 'full', '#444444', '-'),
        (kept, f'{len(found.selection.kept)} derivatives kept', VERMILION, '--'),
        (by_group, f'{found.independent} measurements kept', BLUE, ':'),
    )
    with styled():
        figure = new_figure(9.0, 5.2)
        axes = figure.subplots(2, 2, sharex=True)
        for motion, label, color, style in lines:
            for axis, name, values in (
                (axes[0, 0], 'heading [deg]', np.degrees(motion.heading_rad)),
                (axes[0, 1], 'yaw rate r [deg/s]', np.degrees(motion.yaw_rate_rad_s)),
                (axes[1, 0], 'speed ahead u [m/s]', motion.surge_m_s),
                (axes[1, 1], 'sway v [m/s]', motion.sway_m_s),
            ):
                axis.plot(motion.time_s, values, color=color, linestyle=style, label=label)
                axis.set_ylabel(name)
        for axis in axes[1]:
            axis.set_xlabel('time after the first order [s]')
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside upper center', ncols=len(labels))
    return figure


def design_picture(shown: Experiment) -> Figure:
    """
    Draw the losses of all derivatives in all manoeuvres as a map.
    """
    from matplotlib.colors import LogNorm

    manoeuvres = [manoeuvre.name for manoeuvre in shown.manoeuvres]
    with styled({'axes.grid': False}):
        figure = new_figure(9.0, 3.0)
        axis = figure.subplots()
        largest = float(np.max(shown.loss))
        image = axis.imshow(
            np.maximum(shown.loss.T, 1e-5 * largest),
            norm=LogNorm(1e-4 * largest, largest),
            cmap='Blues',
            aspect='auto',
        )
        best = np.argmax(shown.loss, axis=1)
        axis.plot(
            np.arange(len(best)), best, linestyle='none', marker='o', color=ORANGE, markersize=4
        )
        axis.set_xticks(np.arange(len(shown.names)), shown.names, rotation=90)
        axis.set_yticks(np.arange(len(manoeuvres)), manoeuvres)
        axis.set_xlabel('derivative')
        axis.set_ylabel('manoeuvre')
        figure.colorbar(image, label='loss of 10 %\n[of the speed]')
    return figure


def particulars_picture(found: CoastStudy) -> Figure:
    """
    Draw the change of the record by each value, the largest on top.
    """
    order = (*found.selection.kept, *found.selection.dropped)
    table = found.losses.table[[found.losses.names.index(name) for name in order]]
    places = np.arange(len(order))[::-1]
    with styled():
        figure = new_figure(9.0, 0.8 + 0.28 * len(order))
        axis = figure.subplots()
        axis.barh(
            places, table[:, :2].mean(axis=1), color=_PALE, height=0.7, label='10 per cent wrong'
        )
        axis.barh(
            places,
            np.nan_to_num(table[:, 4:6].mean(axis=1)),
            color=BLUE,
            height=0.35,
            label='wrong by the stated standard deviation',
        )
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
    with styled():
        figure = new_figure(9.0, 0.8 + 0.28 * len(places))
        axis = figure.subplots()
        left = [mimic.left for mimic in found.mimics]
        axis.barh(places, left, color=BLUE, height=0.65)
        for place, mimic in zip(places, found.mimics):
            text = f'{mimic.particular.key} {mimic.error:+.0%}'
            axis.text(mimic.left + 0.01, place, text, va='center', fontsize=7)
        axis.set_yticks(places, [mimic.effect.name for mimic in found.mimics])
        axis.set_xlim(0.0, 1.5)
        axis.set_xticks([0.0, 0.25, 0.5, 0.75, 1.0])
        axis.set_xlabel('part of the effect that is left [1]')
        axis.grid(visible=False, axis='y')
    return figure
