# SPDX-License-Identifier: Apache-2.0
"""
Measured records, imported and replayed as a user would.

Reads the folder that SHIPDRAG_DATA names. Prints what became of each record, and
a second opinion on each r(v); writes bags, reports and pictures. Nothing is
drawn at random but the noise of the simulated ship (seed 1). `--write` puts the
tables into docs/results/real_records.txt.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import shlex
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._tables import put, table
from benchmarks.accuracy._second_opinion import second_opinion
from shipdrag_ros import display
from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main as shipdrag
from shipdrag_ros.estimation import pictures
from shipdrag_ros.estimation import words as estimate_words
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import ReplayResult, replay
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.report import drawing

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / 'docs' / 'results' / 'real_records.txt'
DATA = 'SHIPDRAG_DATA'
SIMULATED = 'config/vitus_bering.yaml'


RECORD_HEAD = table(
    ('record', 'fit, order', 'valid [m/s]', 'r at m/s: ± 2 sigma (second opinion)', 'w [%]'), ()
)
DEFAULT_HEAD = table(('record', 'published problem', 'default'), ())


@dataclass(frozen=True)
class Record:
    """
    A measured coastdown, and what a user says about it.

    Attributes
    ----------
    name
        Of its bag.
    table
        File in the folder of the records.
    columns
        Arguments of `import`.
    ship, parameters
        Files in `benchmarks/ships`.
    window_s
        From the engine stop, or the first sound sample, to the end [s from the
        start of the record].
    speeds_m_s
        Where r is printed.
    """

    name: str
    table: str
    columns: str
    ship: str
    parameters: str
    window_s: tuple[float, float]
    speeds_m_s: tuple[float, ...]

    def import_command(self) -> str:
        """
        Return the line that makes its bag.
        """
        return (
            f'shipdrag import ${DATA}/{self.table} -o {self.name}.mcap {self.columns} '
            f'--ship benchmarks/ships/{self.ship}.yaml'
        )

    def replay_command(self, *, window: bool = True) -> str:
        """
        Return the line that estimates r(v), by the window or by finding the onset.
        """
        given = ' --window {:g} {:g}'.format(*self.window_s) if window else ''
        parameters = f'benchmarks/ships/{self.parameters}.yaml'
        return f'shipdrag replay {self.name}.mcap --parameters {parameters}{given}'


_MODEL = ('cse1_coast_153s_20hz.csv', '--time t_s --map speed_through_water=u_mps')
_USV = '--map position=x_m,y_m --map heading=yaw_rad --time t_s --where segment=coast'
_CAR = '--time t_s --map speed_over_ground=v_mps'
_ONE_HZ = '--rate 1 --map speed_over_ground=1:km/h'


def _usv(test: str) -> Record:
    columns = f'{_USV} --where test={test}'
    table = 'awsp_usv_coast_1hz.csv'
    return Record(
        f'usv_{test.lower()}', table, columns, 'usv', 'few_positions', (1.0, 15.0), (0.5, 0.8, 1.1)
    )


def _car(test: str, end_s: float) -> Record:
    table = f'car/shotgoose_RR-Coastdown-{test}_coast_100hz.csv'
    name = f'car_{test.lower().replace("-", "_")}'
    return Record(name, table, _CAR, 'car', 'car_speed', (0.0, end_s), (4.0, 7.0, 9.0))


def _slow_car(test: str) -> Record:
    speeds = (2.0, 4.0, 6.0)
    table, name = f'car/{test}.csv', f'car_{test.lower()}'
    return Record(name, table, _ONE_HZ, 'car', 'car_speed', (0.0, 172.0), speeds)


MODEL_SHIP = Record(
    'model_ship',
    _MODEL[0],
    f'{_MODEL[1]} --map heading=psi_rad',
    'model_ship',
    'small_craft_speed',
    (6.0, 32.0),
    (0.05, 0.1, 0.15),
)
MODEL_SHIP_JOINT = replace(
    MODEL_SHIP,
    name='model_ship_joint',
    columns=f'{MODEL_SHIP.columns} --map position=x_m,y_m',
    parameters='small_craft',
)
FERRY = Record(
    'ferry',
    'milliampere_coast_t457_20hz.csv',
    '--time t_s --map speed_over_ground=speed_mps --map position=pos_e_m,pos_n_m',
    'ferry',
    'small_craft',
    (8.5, 34.8),
    (0.12, 0.17, 0.22),
)
RECORDS = (
    MODEL_SHIP,
    MODEL_SHIP_JOINT,
    FERRY,
    *(_usv(test) for test in ('Test_6', 'Test_8', 'Test_10')),
    *(_car(test, s) for test, s in (('2', 15.0), ('3', 13.0), ('2WD-1', 12.3), ('4WD-1', 17.8))),
    *(_slow_car(test) for test in ('Michelin60A', 'Michelin60A1')),
)


def run_command(line: str, *, data: Path, out: Path) -> None:
    """
    Run a line of the page; what it makes is in `out`.

    Raises
    ------
    RuntimeError
        With what it said, if it fails.
    """
    arguments = []
    for word in shlex.split(line)[1:]:
        if word.endswith(('.mcap', '.html', '.json')):
            word = str(out / word)
        elif word.endswith('.yaml'):
            word = str(ROOT / word)
        arguments.append(word.replace(f'${DATA}', str(data)))
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = shipdrag(arguments)
    if status != 0:
        raise RuntimeError(f'{line}: {said.getvalue()}')


def replayed(record: Record, out: Path, *, window: bool = True, **changes: Any) -> ReplayResult:
    """
    Replay its bag and return what the commands print; with changed parameters too.
    """
    path = ROOT / 'benchmarks' / 'ships' / f'{record.parameters}.yaml'
    parameters = Parameters.from_yaml(path.read_text(), subject=str(path))
    (run,) = open_runs([out / f'{record.name}.mcap'])
    return replay(
        run,
        parameters=replace(parameters, **changes),
        window=record.window_s if window else None,
    )


def resistance_at(found: Estimate, speed_m_s: float) -> tuple[float, float] | None:
    """
    Return r and sigma at a speed; None outside the valid range.
    """
    curve = found.valid_curve
    if not curve.speed_m_s[0] <= speed_m_s <= curve.speed_m_s[-1]:
        return None
    r, sigma = (
        float(np.interp(speed_m_s, curve.speed_m_s, values))
        for values in (curve.resistance_m_s2, curve.sigma_m_s2)
    )
    return r, sigma


@dataclass(frozen=True)
class Outcome:
    """What one record gave, and its line of the table."""

    estimate: Estimate
    line: str


def show(record: Record, out: Path) -> Outcome:
    """
    Print what became of one record.
    """
    watched = replayed(record, out, window=False)
    assert watched.run.span_ns is not None
    start_ns = watched.run.span_ns[0]
    onsets = [
        f'{(each.start_ns - start_ns) * 1e-9:.0f} s, ended by {each.ended_by.value}'
        for each in watched.coastdowns
    ]
    result = replayed(record, out)
    (coastdown,) = result.coastdowns
    found = coastdown.estimate
    assert found is not None
    print(f'\n== {record.name}: {result.ship.name}')
    print('  ' + record.import_command())
    print('  ' + record.replay_command())
    for name, counts in result.inputs.items():
        rejected = ', '.join(f'{n} {why}' for why, n in counts.rejected.items()) or 'none'
        print(f'  {name}: {counts.messages} messages, rejected: {rejected}')
    print(f'  onset found without --window: {"; ".join(onsets) or "none"}')
    noise = ', '.join(f'{name} {sd:.2g}' for name, sd in found.noise_sd.items())
    print(
        f'  {found.estimator}, {found.duration_s:.1f} s, order {found.order}, ended by '
        f'{coastdown.ended_by.value}; noise {noise}; w {100 * found.max_relative_sigma:.1f} %'
    )
    curve = found.valid_curve
    print(
        f'  valid {curve.speed_m_s[0]:.3f} to {curve.speed_m_s[-1]:.3f} m/s, Fr '
        f'{curve.froude[0]:.3f} to {curve.froude[-1]:.3f} ({found.froude_max_by.value}); the '
        f'fit ends at {found.curve.speed_m_s[-1]:.3f} m/s'
    )
    c0, c1, c2 = second_opinion(found)
    cells = []
    for speed in record.speeds_m_s:
        other = (1.0 + float(result.ship.n_r(speed))) * (c0 + c1 * speed + c2 * speed * speed)
        at = resistance_at(found, speed)
        if at is None:
            print(f'  r({speed:g} m/s) is outside; second opinion {other:.4g}')
            continue
        shown = display.plus_minus(at[0], 2 * at[1])
        print(f'  r({speed:g} m/s) = {shown} m/s^2 (2 sigma); second opinion {other:.4g}')
        cells.append(f'{speed:g}: {shown} ({other:.{display.decimals_of(2 * at[1])}f})')
    print(f"  second opinion: v' = -({c0:.2g} {c1:+.2g} v {c2:+.2g} v|v|)")
    fit = f'{found.estimator.removeprefix("s1_")}, {found.order}'
    limits = f'{curve.speed_m_s[0]:.2f} to {curve.speed_m_s[-1]:.2f}'
    share = f'{100 * found.max_relative_sigma:.0f}'
    line = f'| {record.name} | {fit} | {limits} | {"<br>".join(cells)} | {share} |'
    for note in estimate_words.notes(coastdown.estimate):
        print(textwrap.fill(note, 96, initial_indent='  - ', subsequent_indent='    '))
    return Outcome(found, line)


def default_line(record: Record, published: Estimate, out: Path) -> str:
    """
    Return what the default estimators give beside the published problem.
    """
    cells = [record.name]
    found = [
        replayed(record, out, estimator=estimator, order_max=Parameters().order_max)
        .coastdowns[0]
        .estimate
        for estimator in ('one',)
    ]
    for each in (published, *found):
        assert each is not None
        curve = each.valid_curve
        at = [resistance_at(each, speed) for speed in record.speeds_m_s]
        shown = [
            f'{speed:g}: {display.plus_minus(r[0], 2 * r[1])}'
            for speed, r in zip(record.speeds_m_s, at)
            if r is not None
        ]
        limits = f'{curve.speed_m_s[0]:.2f} to {curve.speed_m_s[-1]:.2f}'
        cells.append('<br>'.join([f'{each.estimator}, {limits}', *shown]))
    return f'| {" | ".join(cells)} |'


def show_model_ship_at_rest(out: Path) -> None:
    """
    Print r of the model ship where the speed all but vanishes, and by other orders.
    """
    print('\n== model ship: r near rest, and by the number of coefficients [m/s^2, 2 sigma]')
    for changes in ({'froude_min': 0.001}, {'order_max': 5}, {'order_max': 6}):
        (coastdown,) = replayed(MODEL_SHIP, out, **changes).coastdowns
        found = coastdown.estimate
        assert found is not None
        low = float(found.valid_curve.speed_m_s[0])
        shown = [
            f'r({speed:.3g} m/s) = {display.plus_minus(at[0], 2 * at[1])}'
            for speed in (low, 0.1, 0.15)
            if (at := resistance_at(found, speed)) is not None
        ]
        print(f'  {changes}: order {found.order}, {", ".join(shown)}')


def show_ferry_path(out: Path) -> None:
    """
    Print the ferry's path as each of the three problems has it.
    """
    print('\n== ferry: path by each problem [m]')
    for estimator in ('s1_speed', 's1_position', 's1_joint'):
        (coastdown,) = replayed(FERRY, out, estimator=estimator).coastdowns
        found = coastdown.estimate
        assert found is not None
        track = found.tracks.get('position')
        if track is None:
            speed = found.tracks['speed_over_ground']
            length = float(np.trapezoid(speed.fitted, (speed.time_ns - found.start_ns) * 1e-9))
        else:
            length = float(np.ptp(track.fitted))
        noise = ', '.join(f'{name} {sd:.2g}' for name, sd in found.noise_sd.items())
        print(f'  {estimator:<12} {length:.3f}; order {found.order}, noise {noise}')


def show_repeats(found: dict[str, Outcome], names: Sequence[str], speed_m_s: float) -> None:
    """
    Print how far repeated runs differ, beside what each says of itself.
    """
    values = [
        at for name in names if (at := resistance_at(found[name].estimate, speed_m_s)) is not None
    ]
    r, sigma = np.array(values).T
    print(
        f'  r({speed_m_s:g} m/s) of {", ".join(names)}: {" ".join(f"{each:.4f}" for each in r)}; '
        f'sd from run to run {100 * np.std(r, ddof=1) / r.mean():.0f} %, stated sigma '
        f'{100 * np.mean(sigma) / r.mean():.0f} %'
    )


def draw(out: Path, data: Path) -> None:
    """
    Draw r(v) of the model ship and of a simulated one.
    """
    real = RunResult.of(replayed(MODEL_SHIP, out))
    bag = out / 'simulated.mcap'
    run_command(
        f'shipdrag simulate --ship {SIMULATED} -o {bag.name} --lead-in 900 --seed 1',
        data=data,
        out=out,
    )
    (run,) = open_runs([bag])
    for name, result in (('real_record', real), ('simulated', RunResult.of(replay(run)))):
        (coastdown,) = result.coastdowns
        assert coastdown.estimate is not None
        true = result.truth
        figure = pictures.resistance_picture(
            coastdown.estimate,
            result.ship,
            truth=None if true is None else (true.speed_m_s, true.resistance_m_s2),
        )
        drawing.save(figure, out / f'{name}.png')
        print(f'picture: {out / name}.png, {coastdown.estimate.summary(result.ship)[0]}')


def main() -> None:
    """
    Import, replay, print and draw.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, default=ROOT / 'benchmarks' / 'out' / 'real_records')
    parser.add_argument('--write', action='store_true', help=f'the tables into {PAGE.name}')
    options = parser.parse_args()
    out = options.out
    if DATA not in os.environ:
        print(f'skipped: {DATA} is not set, it names the folder of the measured records')
        return
    data = Path(os.environ[DATA])
    out.mkdir(parents=True, exist_ok=True)
    for old in out.glob('*.mcap'):
        old.unlink()
    found = {}
    for record in RECORDS:
        run_command(record.import_command(), data=data, out=out)
        line = f'{record.replay_command()} --report {record.name}.html'
        run_command(line, data=data, out=out)
        found[record.name] = show(record, out)
    show_model_ship_at_rest(out)
    show_ferry_path(out)
    print('\n== repeated runs')
    show_repeats(found, ['usv_test_6', 'usv_test_8', 'usv_test_10'], 0.8)
    show_repeats(found, ['car_2', 'car_3'], 7.0)
    show_repeats(found, ['car_michelin60a', 'car_michelin60a1'], 4.0)
    published = [*RECORD_HEAD, *(outcome.line for outcome in found.values())]
    default = [
        *DEFAULT_HEAD,
        *(default_line(record, found[record.name].estimate, out) for record in RECORDS),
    ]
    blocks = {'published problems': '\n'.join(published), 'defaults': '\n'.join(default)}
    print('', *blocks.values(), sep='\n')
    if options.write:
        put(PAGE, blocks)
    draw(out, data)


if __name__ == '__main__':
    main()
