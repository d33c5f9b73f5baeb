# SPDX-License-Identifier: Apache-2.0
"""
S3's sensitivity analysis: its observations beside ours, its reduced model, what it does not say.

    python -m benchmarks.accuracy.s3_sensitivity [--write]

prints the page; `--write` puts it into docs/s3_sensitivity.md, its pictures into docs/pictures.
Noise, in the diagnoses alone, has seeds 0 and 1. Two minutes of a processor. Times are of the
processor, in this process; the batched call is the best of 5, the loop of 161 runs is made once.
"""

from __future__ import annotations

import os

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from benchmarks._tables import publish
from benchmarks._tables import table as markdown
from benchmarks.accuracy import _plain_mariner
from benchmarks.accuracy._wrong_values import COAST_S, LEAD_IN_S, SPEED_M_S, verdicts
from shipdrag_ros.display import Table
from shipdrag_ros.report.drawing import BLUE, GREEN, ORANGE, STYLE, VERMILION, save
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.studies.manoeuvring.manoeuvre import (
    ManoeuvreMotion,
    Side,
    overshoots_rad,
    turn,
    zigzag,
)
from shipdrag_ros.studies.manoeuvring.ship import FORM, mariner
from shipdrag_ros.studies.manoeuvring.simulate import steer
from shipdrag_ros.studies.sensitivity.coast import coast_from
from shipdrag_ros.studies.sensitivity.coasting import CoastStudy, study_coast
from shipdrag_ros.studies.sensitivity.face import coasting as coasting_words
from shipdrag_ros.studies.sensitivity.face import pictures as sensitivity_pictures
from shipdrag_ros.studies.sensitivity.face import steering as steering_words
from shipdrag_ros.studies.sensitivity.loss import CHANGES, Losses, Norm
from shipdrag_ros.studies.sensitivity.steering import (
    APPROACH_S,
    Experiment,
    Observations,
    SteeringStudy,
    experiment,
    respond,
    study,
)

DOCS = Path(__file__).resolve().parents[2] / 'docs'
SHIP, PAPER, KEEP = mariner(), zigzag(15.0), 24
RTOL = 1e-6
ROUNDS = 5
CONTROLS_S = (0.0, 0.1, 0.5)
KNOWN = {15.0: (6.79, 5.61), 20.0: (7.79, 6.35), 25.0: (8.85, 7.01)}  # with these values, 0.1 s
SHIP_SPEED_M_S = 8.2


@dataclass(frozen=True)
class Speed:
    """
    Batched runs beside a loop of solve_ivp, [s] of the processor.

    Attributes
    ----------
    batched, looped
    runs
    largest
        Difference of a loss, over the largest loss.
    same
        Whether both keep the same derivatives.
    """

    batched: float
    looped: float
    runs: int
    largest: float
    same: bool


def speed(found: SteeringStudy) -> Speed:
    """
    Do the same 161 runs both ways.
    """
    factors = [
        (name, 1.0 + change) for name in FORM for change in CHANGES
    ]  # the order of the table of losses
    sets = [dict(SHIP.viscous)]
    sets += [{**SHIP.viscous, name: factor * SHIP.viscous[name]} for name, factor in factors]
    table = np.array([[one[name] for name in FORM] for one in sets])
    times = []
    for _ in range(ROUNDS):
        begin = time.process_time()
        motions = steer(SHIP, PAPER, table, control_s=0.0)
        times.append(time.process_time() - begin)
    time_s = motions.time_s
    begin = time.process_time()
    looped = [
        _plain_mariner.zigzag(SHIP, one, PAPER.rudder_rad, time_s, rtol=RTOL) for one in sets
    ]
    elapsed = time.process_time() - begin
    scale = np.array([1.0, 1.0, 1.0 / SHIP.length_m]) * SHIP.speed_m_s
    differences = (np.array(looped[1:]) - looped[0]) / scale
    losses = Losses(FORM, Norm.ROOT_MEAN_SQUARE.of(differences).reshape(len(FORM), -1))
    error = np.max(np.abs(losses.table - found.losses.table)) / np.max(losses.table)
    same = set(losses.select(KEEP).kept) == set(found.selection.kept)
    return Speed(min(times), elapsed, len(sets), float(error), same)


def checks() -> Table:
    """
    Show the figures of standard manoeuvres beside those known of the same values.
    """
    rows = []
    for angle, (starboard, port) in KNOWN.items():
        for first in Side:
            manoeuvre = zigzag(angle, first=first)
            cells = []
            for control_s in CONTROLS_S:
                motion = steer(SHIP, manoeuvre, control_s=control_s)[0]
                over = np.degrees(overshoots_rad(motion, manoeuvre))
                cells.append(f'{over[0]:.2f} / {over[1]:.2f}')
            motion = steer(SHIP, manoeuvre, approach_s=APPROACH_S)[0]
            over = np.degrees(overshoots_rad(motion, manoeuvre))
            largest = f'{max(over[::2]):.2f} / {max(over[1::2]):.2f}'
            known = f'{starboard} / {port}' if first is Side.STARBOARD else ''
            rows.append((f'{manoeuvre.name}, to {first}', *cells, largest, known))
    heads = [f'looks every {control_s:g} s' for control_s in CONTROLS_S[1:]]
    return Table(
        (
            'first / second overshoot [deg]',
            'at the very heading',
            *heads,
            f'largest to each side, 0.1 s, order after {APPROACH_S:g} s',
            'known',
        ),
        tuple(rows),
    )


def _turned(motion: ManoeuvreMotion, heading_rad: float, value: Float64) -> float:
    """Return what a turning ship has done when her heading has changed by so much."""
    turned = np.abs(motion.heading_rad)
    i = int(np.argmax(turned >= heading_rad))
    return float(np.interp(heading_rad, turned[i - 1 : i + 1], np.abs(value[i - 1 : i + 1])))


def circles() -> Table:
    """
    Show turning circles.
    """
    rows = []
    for first in Side:
        circle = turn(35.0, first=first)
        motions = [steer(SHIP, circle, approach_s=each)[0] for each in (0.0, APPROACH_S)]
        cells = [
            f'{_turned(motion, 0.5 * np.pi, motion.position_m[:, 0]):.0f} / '
            f'{_turned(motion, np.pi, motion.position_m[:, 1]):.0f}'
            for motion in motions
        ]
        known = '566 / 1029' if first is Side.STARBOARD else ''
        rows.append((f'turn:35 to {first}', *cells, known))
    heads = (
        'advance / tactical diameter [m]',
        'order at once',
        f'order after {APPROACH_S:g} s',
        'known',
    )
    return Table(heads, tuple(rows))


def observations() -> Table:
    """
    Show what the paper saw, for both norms and several helmsmen.
    """
    rows = []
    for control_s in CONTROLS_S:
        responses = respond(SHIP, PAPER, control_s=control_s)
        kept = [set(responses.losses(norm).select(KEEP).kept) for norm in Norm]
        for norm in Norm:
            seen = Observations.of(responses.losses(norm))
            rows.append(
                (
                    'at the very heading' if control_s == 0.0 else f'looks every {control_s:g} s',
                    str(norm),
                    f'{seen.unlike[0]:.1%}',
                    f'{seen.unlike[1]:.1%}',
                    f'{seen.growth:.2f}',
                    'the same' if kept[0] == kept[1] else f'{len(kept[0] - kept[1])} differ',
                )
            )
    heads = ('rudder reversed', 'norm', '+10 / -10 %', '+50 / -50 %', '50 / 10 %', 'kept by both')
    return Table(heads, tuple(rows))


def surge() -> list[tuple[str, Float64]]:
    """
    Return the surge speed after changes of Xu, the paper's figure 1.
    """
    i = FORM.index('Xu')
    sets = np.tile(SHIP.values, (1 + len(CHANGES), 1))
    sets[1:, i] *= 1.0 + np.array(CHANGES)
    speeds = steer(SHIP, PAPER, sets, control_s=0.0).speeds[:, :, 0]
    labels = ['as it is', *(f'Xu {change:+.0%}' for change in CHANGES)]
    return list(zip(labels, speeds))


def lines_of(table: Table) -> list[str]:
    """
    Return a table in Markdown.
    """
    return markdown(table.columns, table.rows)


def page(
    found: SteeringStudy, shown: Experiment, coast: CoastStudy, timed: Speed, wrong: Table
) -> list[str]:
    """
    Return the page.
    """
    root = Observations.of(found.losses)
    kept = found.selection.kept
    both = np.degrees(found.check.overshoots_rad)
    grouped = np.degrees(found.group_check.overshoots_rad[1])
    single = shown.partial_contribution[np.arange(len(FORM)), np.argmax(shown.loss, axis=1)]
    circle = shown.manoeuvres.index(turn(35.0))
    heavier = next(mimic for mimic in coast.mimics if mimic.effect.name == 'displacement')
    return [
        '# Sensitivity by a loss function (S3)',
        '',
        'Fang Xianghong, Xu Feng: *sensitivity of ship manoeuvring derivatives by a loss '
        'function*. Written by',
        '`python -m benchmarks.accuracy.s3_sensitivity --write`. '
        'The verb is `shipdrag sensitivity`, the analysis '
        '`shipdrag_ros/studies/sensitivity/loss.py`: it takes any',
        'simulator and knows no ship.',
        '',
        '    shipdrag sensitivity --manoeuvre zigzag:15 --keep 24 --report mariner.html',
        '    shipdrag sensitivity --ship config/vitus_bering.yaml --manoeuvre coastdown:8.2',
        '',
        '## The paper and ours',
        '',
        *lines_of(
            Table(
                ('', 'paper', 'here'),
                (
                    ('derivatives changed, one at a time', '40', str(len(FORM))),
                    ('zigzag of the losses', '15/15, 1200 samples of 0.5 s', 'the same'),
                    (
                        '+10 % and -10 %',
                        '"basically the same"',
                        f'differ by {root.unlike[0]:.1%} (median)',
                    ),
                    (
                        '+50 % and -50 %',
                        'close, differ more',
                        f'differ by {root.unlike[1]:.1%}',
                    ),
                    ('50 % over 10 %', '"basically 5 times"', f'{root.growth:.2f} (median)'),
                    (
                        'some losses are nearly 0',
                        'yes',
                        f'the least is {np.min(found.losses.mean):.1e}, the largest '
                        f'{np.max(found.losses.mean):.2f}',
                    ),
                    ('kept', '24 of 40', f'{len(kept)}, by both norms'),
                    (
                        '25/25 of the reduced model',
                        '"the change is very small"',
                        f'overshoots {both[1][0]:.2f} / {both[1][1]:.2f} for '
                        f'{both[0][0]:.2f} / {both[0][1]:.2f} deg',
                    ),
                ),
            )
        ),
        '',
        "The paper's formula of the loss is lost in the scan. That 50 % costs 5 times 10 % says "
        'that it is a norm, not a square: the root mean square',
        'of the differences in u, v (over the speed) and r (over speed per length) is used, the '
        'mean norm shown beside it.',
        '',
        '![Surge speed in a 15/15 zigzag after changes of Xu](pictures/s3_surge.png)',
        '',
        '## The helmsman must not be a clock',
        '',
        'What the paper saw is clean only where the rudder is reversed at the very heading. A '
        'helmsman who looks every 0.1 s reverses a whole look earlier or',
        'later after the smallest change: a floor under all small losses, by which they are '
        'ranked wrong. The losses here are of the first kind.',
        '',
        *lines_of(observations()),
        '',
        '## Check of the simulation',
        '',
        *lines_of(checks()),
        '',
        *lines_of(circles()),
        '',
        'Known: figures computed elsewhere with the same values, first to starboard, control '
        'every 0.1 s. All eight come back to the last digit when the rudder is',
        f'amidships for {APPROACH_S:g} s before the first order, in which the propeller turns her '
        'a little, and of the 15/15 the largest to starboard is taken, the third.',
        'Ordered at once the looks of the helmsman fall otherwise: one is worth up to '
        '0.1 degrees.',
        '`tests/studies/manoeuvring` compares the runs with a solve_ivp of their own: u and v '
        'to 2e-6 m/s, r to 1e-7 rad/s.',
        '',
        f'**Speed.** {timed.runs} runs of 600 s in one call: {1e3 * timed.batched:.0f} ms; a '
        f'plain loop of scipy `solve_ivp` (RK45, rtol {RTOL:g}, the reversal an event, the',
        f'formulas written out): {timed.looped:.1f} s of processor time in the same process, '
        f'**{timed.looped / timed.batched:.0f} times** as much. Losses agree to '
        f'{timed.largest:.0e} of the largest; '
        + ('both keep the same 24.' if timed.same else 'they do not keep the same 24.'),
        '',
        '## Losses',
        '',
        steering_words.LOSSES + '.',
        '',
        '![Mean loss of each derivative](pictures/s3_ranking.png)',
        '',
        *lines_of(steering_words.loss_table(found)),
        '',
        '## What 24 means',
        '',
        f'{len(SHIP.multiples)} of the 40 are exact multiples of others (Yvu = Yv, Yud = 2 Yd, '
        'Xudd = 2 Xdd, ..): not measured, but a force that grows with the',
        f'square of the speed written in powers of its change. The model is {len(SHIP.groups)} '
        f'measurements, and the 24 kept derivatives hold {found.independent} of them: the',
        '"simplification" drops powers of forces that it keeps. Dropped as measurements, with all '
        f'that follows from each, the same number of {found.independent} is',
        f'{len(found.group_derivatives)} derivatives, and overshoots '
        f'{grouped[0]:.2f} / {grouped[1]:.2f} instead of {both[1][0]:.2f} / {both[1][1]:.2f} deg.',
        '',
        *lines_of(steering_words.check_table(found)),
        '',
        '![25/25 zigzag of the full and of the reduced models](pictures/s3_check.png)',
        '',
        'The reduced 24 keep the form of the motion and lose its timing, a little more with every '
        'turn.',
        '',
        '## Which manoeuvre to sail',
        '',
        'Most derivatives are seen best where rudder and drift are largest; the side force of the '
        'propeller (Y0, N0) and the linear ones of sway in the gentlest.',
        'To be seen is not to be identified: the partial contribution is the part of a trace that '
        f'is orthogonal to the other 39. Where it is seen best it is {np.median(single):.1%}',
        f'(median; {np.median(shown.partial_contribution[:, circle]):.1g} in a 35 degree circle, '
        'which ends as three constants), in all nine together '
        f'{np.median(shown.partial_contribution_together):.1%}. '
        'A sensitive derivative is thus not yet one that a',
        'trial identifies, as the paper hopes (after Rhee and Kim); the multiples are, for good '
        'reason, stated and not fitted.',
        '',
        '![Loss of each derivative in each manoeuvre](pictures/s3_design.png)',
        '',
        steering_words.DESIGN + '.',
        '',
        *lines_of(steering_words.design_table(shown)),
        '',
        '## The same for a ship file',
        '',
        f'{coasting_words.sentence(coast)}',
        '',
        *(f'- {note}' for note in coasting_words.notes(coast)),
        '',
        '![Change of the record by each value of the ship file](pictures/s3_particulars.png)',
        '',
        coasting_words.LOSSES + '.',
        '',
        *lines_of(coasting_words.loss_table(coast)),
        '',
        f'A ship that is {heavier.size:.0%} heavier than her file says is one whose '
        f'{heavier.particular.key} is wrong by {heavier.error:+.0%}, but for {heavier.left:.1%} '
        'of the trace: take the volume',
        'from the draughts of the day.',
        '',
        '![What is left of each effect when a value is blamed](pictures/s3_mimics.png)',
        '',
        coasting_words.MIMICS + '.',
        '',
        *lines_of(coasting_words.mimic_table(coast)),
        '',
        'And what `diagnose` says of a ship of which nothing but one value of the file is wrong: '
        f'two reciprocal coastdowns of {COAST_S:.0f} s from {SPEED_M_S:g} m/s,',
        f'{LEAD_IN_S:.0f} s of steady sailing before, log and positions at 1 Hz, one pair a cell '
        '(seeds 0 and 1); candidates of 5 % and more.',
        '',
        *lines_of(wrong),
        '',
        'As the losses predict, no other value reaches the verdict than '
        + ', '.join(row[0] for row in wrong.rows if len(set(row[1:])) > 1)
        + '.',
    ]


def _surge_picture(time_s: Float64, speeds: Sequence[tuple[str, Float64]]) -> Figure:
    """Draw the surge speed of one manoeuvre after several changes of a derivative."""
    styles = (('#444444', '-'), (BLUE, '--'), (GREEN, '-.'), (VERMILION, ':'), (ORANGE, '--'))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 3.2), layout='constrained')
        axis = figure.subplots()
        for (label, speed), (color, style) in zip(speeds, styles):
            axis.plot(time_s, speed, color=color, linestyle=style, label=label)
        axis.set_xlabel('time after the first order [s]')
        axis.set_ylabel('u [m/s]')
        axis.legend(loc='upper right', ncols=len(speeds))
    return figure


def main() -> None:
    """
    Print the page, and write it where that is asked for.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        '--write', action='store_true', help='docs/s3_sensitivity.md and its pictures'
    )
    options = parser.parse_args()
    text = files('shipdrag_ros').joinpath('data', 'vitus_bering.yaml').read_text('utf-8')
    ship = Ship.from_yaml(text, subject='vitus_bering.yaml')
    found, shown = study(SHIP, PAPER, keep=KEEP), experiment(SHIP)
    coast = study_coast(ship, coast_from(ship, SHIP_SPEED_M_S))
    lines = page(found, shown, coast, speed(found), verdicts(ship))
    print('\n'.join(lines))
    if not options.write:
        return
    publish(DOCS / 's3_sensitivity.md', lines, rows=4, keep=1)
    time_s = found.check.full.time_s
    for name, figure in (
        ('surge', _surge_picture(time_s, surge())),
        ('ranking', sensitivity_pictures.ranking_picture(found)),
        ('check', sensitivity_pictures.check_picture(found)),
        ('design', sensitivity_pictures.design_picture(shown)),
        ('particulars', sensitivity_pictures.particulars_picture(coast)),
        ('mimics', sensitivity_pictures.mimic_picture(coast)),
    ):
        save(figure, DOCS / 'pictures' / f's3_{name}.png', pixels_per_inch=100)


if __name__ == '__main__':
    main()
