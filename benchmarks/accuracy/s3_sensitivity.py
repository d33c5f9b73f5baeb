# SPDX-License-Identifier: Apache-2.0
"""
S3's sensitivity analysis: its observations beside ours, its reduced model, what it does not say.

    python -m benchmarks.figures s3_sensitivity

Prints the tables; `--pictures` draws those of docs/s3_sensitivity.md.
Noise, in the diagnoses alone, has seeds 0 and 1. Two minutes of a processor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from benchmarks import ROOT
from benchmarks._asked import asked
from benchmarks._tables import table as markdown
from shipdrag_ros.diagnosis import CoastRun, diagnose
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.display import Table
from shipdrag_ros.estimation import Window
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.report.drawing import BLUE, GREEN, ORANGE, STYLE, VERMILION, save
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation import START_NS, Scenario, sense, simulate, standard_sensors
from shipdrag_ros.studies import manoeuvring
from shipdrag_ros.studies.sensitivity import coasting, steering
from shipdrag_ros.studies.sensitivity.face import coasting as coasting_words
from shipdrag_ros.studies.sensitivity.face import verb as steering_words
from shipdrag_ros.studies.sensitivity.loss import CHANGES, Norm

DOCS = ROOT / 'docs'
SHIP, PAPER, KEEP = manoeuvring.mariner(), manoeuvring.zigzag(15.0), 24
CONTROLS_S = (0.0, 0.1, 0.5)
KNOWN = {15.0: (6.79, 5.61), 20.0: (7.79, 6.35), 25.0: (8.85, 7.01)}  # with these values, 0.1 s
SHIP_SPEED_M_S = 8.2


def checks() -> Table:
    """
    Show the figures of standard manoeuvres beside those known of the same values.
    """
    rows = []
    for angle, (starboard, port) in KNOWN.items():
        for first in manoeuvring.Side:
            manoeuvre = manoeuvring.zigzag(angle, first=first)
            cells = []
            for control_s in CONTROLS_S:
                motion = manoeuvring.steer(SHIP, manoeuvre, control_s=control_s)[0]
                over = np.degrees(manoeuvring.overshoots_rad(motion, manoeuvre))
                cells.append(f'{over[0]:.2f} / {over[1]:.2f}')
            motion = manoeuvring.steer(SHIP, manoeuvre, approach_s=steering.APPROACH_S)[0]
            over = np.degrees(manoeuvring.overshoots_rad(motion, manoeuvre))
            largest = f'{max(over[::2]):.2f} / {max(over[1::2]):.2f}'
            known = f'{starboard} / {port}' if first is manoeuvring.Side.STARBOARD else ''
            rows.append((f'{manoeuvre.name}, to {first}', *cells, largest, known))
    heads = [f'looks every {control_s:g} s' for control_s in CONTROLS_S[1:]]
    return Table(
        (
            'first / second overshoot [deg]',
            'at the very heading',
            *heads,
            f'largest to each side, 0.1 s, order after {steering.APPROACH_S:g} s',
            'known',
        ),
        tuple(rows),
    )


def _turned(motion: manoeuvring.Motions, heading_rad: float, value: Float64) -> float:
    """Return what a turning ship has done when her heading has changed by so much."""
    turned = np.abs(motion.heading_rad)
    i = int(np.argmax(turned >= heading_rad))
    return float(np.interp(heading_rad, turned[i - 1 : i + 1], np.abs(value[i - 1 : i + 1])))


def circles() -> Table:
    """
    Show turning circles.
    """
    rows = []
    for first in manoeuvring.Side:
        circle = manoeuvring.turn(35.0, first=first)
        begins = (0.0, steering.APPROACH_S)
        motions = [manoeuvring.steer(SHIP, circle, approach_s=each)[0] for each in begins]
        cells = [
            f'{_turned(motion, 0.5 * np.pi, motion.position_m[:, 0]):.0f} / '
            f'{_turned(motion, np.pi, motion.position_m[:, 1]):.0f}'
            for motion in motions
        ]
        known = '566 / 1029' if first is manoeuvring.Side.STARBOARD else ''
        rows.append((f'turn:35 to {first}', *cells, known))
    heads = (
        'advance / tactical diameter [m]',
        'order at once',
        f'order after {steering.APPROACH_S:g} s',
        'known',
    )
    return Table(heads, tuple(rows))


def observations() -> Table:
    """
    Show what the paper saw, for both norms and several helmsmen.
    """
    rows = []
    for control_s in CONTROLS_S:
        responses = steering.respond(SHIP, PAPER, control_s=control_s)
        kept = [set(responses.losses(norm).select(KEEP).kept) for norm in Norm]
        for norm in Norm:
            seen = steering.Observations.of(responses.losses(norm))
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
    i = manoeuvring.FORM.index('Xu')
    sets = np.tile(SHIP.values, (1 + len(CHANGES), 1))
    sets[1:, i] *= 1.0 + np.array(CHANGES)
    speeds = manoeuvring.steer(SHIP, PAPER, sets, control_s=0.0).speeds[:, :, 0]
    labels = ['as it is', *(f'Xu {change:+.0%}' for change in CHANGES)]
    return list(zip(labels, speeds))


ERRORS = (-0.2, -0.1, 0.1, 0.25)  # of the file, relative to the truth
LEAD_IN_S, COAST_S, SPEED_M_S = 1200.0, 1500.0, 8.0
_SHOWN = 0.05  # probability from which a candidate is shown


def verdicts(ship: Ship) -> Table:
    """
    Show the answers to two reciprocal coastdowns, log and positions at 1 Hz.
    """
    rows = []
    for one in coasting.particulars(ship, speed_m_s=SPEED_M_S):
        answers = []
        for error in ERRORS:
            truth = one.scaled(ship, 1.0 / (1.0 + error))
            runs = [_run(truth, heading, seed) for seed, heading in enumerate((0.0, math.pi))]
            answers.append(_answer(diagnose(runs, ship, Parameters())))
        rows.append((one.key, *answers))
    return Table(('the file is wrong by', *(f'{error:+.0%}' for error in ERRORS)), tuple(rows))


def _run(truth: Ship, heading_rad: float, seed: int) -> CoastRun:
    scenario = Scenario(
        speed_m_s=SPEED_M_S, lead_in_s=LEAD_IN_S, duration_s=COAST_S, heading_rad=heading_rad
    )
    sensors = standard_sensors(inputs=('speed_through_water', 'position'))
    block = sense(simulate(truth, scenario), sensors, seed=seed)
    stop = START_NS + round(LEAD_IN_S * 1e9)
    first, last = int(block.stamp_ns.min()), int(block.stamp_ns.max())
    return CoastRun(f'run {seed}', Window.from_block(block, stop, last, before_ns=first))


def _answer(found: DiagnosisResult) -> str:
    shown = [
        f'{" + ".join(each.names) or "nothing"} {each.probability:.0%}'
        for each in found.candidates
        if each.probability >= _SHOWN
    ]
    return f'{found.verdict}: {", ".join(shown)}' if shown else str(found.verdict)


def tables(
    found: steering.SteeringStudy,
    shown: steering.Experiment,
    coast: coasting.CoastStudy,
    wrong: Table,
) -> Iterator[str]:
    """
    Yield the lines of the result file.
    """
    root = steering.Observations.of(found.losses)
    for heading, table in (
        ('Losses, where the rudder is reversed', observations()),
        ('Overshoots', checks()),
        ('Circles', circles()),
        (steering_words.LOSSES, steering_words.loss_table(found)),
        ('25/25 of the full and of the reduced models', steering_words.check_table(found)),
        (steering_words.DESIGN, steering_words.design_table(shown)),
        (coasting_words.LOSSES, coasting_words.loss_table(coast)),
        (coasting_words.MIMICS, coasting_words.mimic_table(coast)),
        ('What diagnose says of one wrong value of the file, seeds 0 and 1', wrong),
    ):
        yield from ('', heading, '', *markdown(table.columns, table.rows))
    yield ''
    kept = f'{len(found.selection.kept)} of {len(manoeuvring.FORM)}'
    yield f'50 % over 10 %: {root.growth:.2f}; kept {kept}'
    yield coasting_words.sentence(coast)
    yield from (f'- {note}' for note in coasting_words.notes(coast))


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
    Print the tables, and draw where that is asked for.
    """
    options = asked(__doc__, pictures=False)
    ship = Ship.example()
    found, shown = steering.study(SHIP, PAPER, keep=KEEP), steering.experiment(SHIP)
    coast = coasting.study_coast(ship, coasting.coast_from(ship, SHIP_SPEED_M_S))
    print(*tables(found, shown, coast, verdicts(ship)), sep='\n')
    if not options.pictures:
        return
    time_s = found.check.full.time_s
    for name, figure in (
        ('surge', _surge_picture(time_s, surge())),
        ('ranking', steering_words.ranking_picture(found)),
        ('check', steering_words.check_picture(found)),
        ('design', steering_words.design_picture(shown)),
        ('particulars', coasting_words.particulars_picture(coast)),
        ('mimics', coasting_words.mimic_picture(coast)),
    ):
        save(figure, DOCS / 'pictures' / f's3_{name}.png', pixels_per_inch=100)


if __name__ == '__main__':
    main()
