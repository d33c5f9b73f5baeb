# SPDX-License-Identifier: Apache-2.0
"""
Measured records, imported and replayed as a user would.

Reads the folder that SHIPDRAG_DATA names. Prints what became of each record, and
a second opinion on each r(v); writes bags, reports and pictures. Nothing is
drawn at random but the noise of the simulated ship (seed 1). `--write` puts the
tables into docs/results/real_records.txt.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from benchmarks import ROOT, _verbs
from benchmarks._asked import asked
from benchmarks._tables import put, table
from shipdrag_ros import display
from shipdrag_ros.bags import open_runs
from shipdrag_ros.estimation import pictures
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.replay import ReplayResult, replay, words
from shipdrag_ros.replay.run_result import RunResult
from shipdrag_ros.report import drawing
from shipdrag_ros.samples import Float64

PAGE = ROOT / 'docs' / 'results' / 'real_records.txt'
OUT = ROOT / 'benchmarks' / 'out'
DATA = 'SHIPDRAG_DATA'
SIMULATED = 'config/vitus_bering.yaml'


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

    @property
    def given(self) -> Parameters:
        """Its parameters."""
        return Parameters.load(ROOT / 'benchmarks' / 'ships' / f'{self.parameters}.yaml')

    def bag(self, out: Path) -> Path:
        """
        Import it anew; return its bag.
        """
        path = out / f'{self.name}.mcap'
        path.unlink(missing_ok=True)
        run_command(self.import_command(), out=out)
        return path

    def replay_command(self, *, window: bool = True) -> str:
        """
        Return the line that estimates r(v), by the window or by finding the onset.
        """
        given = ' --window {:g} {:g}'.format(*self.window_s) if window else ''
        parameters = f'benchmarks/ships/{self.parameters}.yaml'
        return f'shipdrag replay {self.name}.mcap --parameters {parameters}{given}'


def usv(test: str, parameters: str) -> Record:
    """
    Return a test of the catamaran, one position a second.
    """
    columns = '--map position=x_m,y_m --map heading=yaw_rad --time t_s --where segment=coast'
    columns = f'{columns} --where test=Test_{test}'
    name, file, speeds = f'usv_test_{test}', 'awsp_usv_coast_1hz.csv', (0.5, 0.8, 1.1)
    return Record(name, file, columns, 'usv', parameters, (1.0, 15.0), speeds)


def car(test: str, end_s: float, parameters: str) -> Record:
    """
    Return a test of a car at 100 Hz, cut to its coast.
    """
    name, file = f'car_{test.lower().replace("-", "_")}', f'shotgoose_RR-Coastdown-{test}'
    columns, speeds = '--time t_s --map speed_over_ground=v_mps', (4.0, 7.0, 9.0)
    file = f'car/{file}_coast_100hz.csv'
    return Record(name, file, columns, 'car', parameters, (0.0, end_s), speeds)


def slow_car(test: str, parameters: str) -> Record:
    """
    Return a test of a car at 1 Hz.
    """
    name, columns = f'car_{test.lower()}', '--rate 1 --map speed_over_ground=1:km/h'
    window_s, speeds = (0.0, 172.0), (2.0, 4.0, 6.0)
    return Record(name, f'car/{test}.csv', columns, 'car', parameters, window_s, speeds)


MODEL_SHIP = Record(
    'model_ship', 'cse1_coast_153s_20hz.csv',
    '--time t_s --map speed_through_water=u_mps --map heading=psi_rad', 'model_ship',
    'small_craft_speed', (6.0, 32.0), (0.05, 0.1, 0.15),
)  # fmt: skip
MODEL_SHIP_JOINT = replace(
    MODEL_SHIP,
    name='model_ship_joint',
    columns=f'{MODEL_SHIP.columns} --map position=x_m,y_m',
    parameters='small_craft',
)
FERRY = Record(
    'ferry', 'milliampere_coast_t457_20hz.csv',
    '--time t_s --map speed_over_ground=speed_mps --map position=pos_e_m,pos_n_m', 'ferry',
    'small_craft', (8.5, 34.8), (0.12, 0.17, 0.22),
)  # fmt: skip
CAR_ENDS_S = {'2': 15.0, '3': 13.0, '2WD-1': 12.3, '4WD-1': 17.8}
RECORDS = (
    MODEL_SHIP,
    MODEL_SHIP_JOINT,
    FERRY,
    *(usv(test, 'few_positions') for test in ('6', '8', '10')),
    *(car(test, end_s, 'car_speed') for test, end_s in CAR_ENDS_S.items()),
    *(slow_car(test, 'car_speed') for test in ('Michelin60A', 'Michelin60A1')),
)


def prepared(out: Path) -> bool:
    """
    Say whether the records are there; if so, make a folder for what becomes of them.
    """
    if DATA not in os.environ:
        print(f'skipped: {DATA} is not set, it names the folder of the measured records')
        return False
    out.mkdir(parents=True, exist_ok=True)
    return True


def run_command(line: str, *, out: Path) -> None:
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
        arguments.append(os.path.expandvars(word))
    _verbs.run(*arguments)


def replayed(record: Record, out: Path, *, window: bool = True, **changes: Any) -> ReplayResult:
    """
    Replay its bag and return what the commands print; with changed parameters too.
    """
    (run,) = open_runs([out / f'{record.name}.mcap'])
    parameters = replace(record.given, **changes)
    return replay(run, parameters=parameters, window=record.window_s if window else None)


def estimated(record: Record, out: Path, **changes: Any) -> Estimate:
    """
    Return the estimate in the window, with changed parameters.
    """
    (coastdown,) = replayed(record, out, **changes).coastdowns
    assert coastdown.estimate is not None
    return coastdown.estimate


def figures(found: Estimate, record: Record) -> Iterator[tuple[float, float, str]]:
    """
    Yield speed, two sigma, and r with it as text, where a speed is inside.
    """
    curve = found.valid_curve
    for speed in record.speeds_m_s:
        if curve.speed_m_s[0] <= speed <= curve.speed_m_s[-1]:
            r, sigma = (
                float(np.interp(speed, curve.speed_m_s, values))
                for values in (curve.resistance_m_s2, curve.sigma_m_s2)
            )
            yield speed, 2.0 * sigma, f'{speed:g}: {display.plus_minus(r, 2.0 * sigma)}'


def limits(found: Estimate) -> str:
    """
    Return the valid range [m/s].
    """
    return '{:.2f} to {:.2f}'.format(*found.valid_curve.speed_m_s[[0, -1]])


def second_opinion(found: Estimate) -> Float64:
    """
    Fit v' = -(c0 + c1 v + c2 v |v|) to the samples and return c0, c1, c2.

    Least squares through the equation of motion: it shares the samples with
    the estimate and nothing else. The speed is fitted; without one the
    distance, and then no coefficient is negative, or noise would rule them.
    """
    name = next((each for each in found.tracks if each != 'position'), 'position')
    track = found.tracks[name]
    time_s = (track.time_ns - found.start_ns) * 1e-9
    column = 1 if name == 'position' else 0

    def residual(x: Float64) -> Float64:
        solved = solve_ivp(
            lambda _, s: (-(x[1] + x[2] * s[0] + x[3] * s[0] * abs(s[0])), s[0]),
            (time_s[0], time_s[-1]),
            (x[0], x[4]),
            t_eval=time_s,
            rtol=1e-7,
            atol=1e-9,
        )
        return np.asarray(solved.y[column] - track.measured)

    v0 = float(found.curve.speed_m_s[-1])
    quadratic = float(found.curve.resistance_m_s2.mean()) / v0**2
    start = [v0, 1e-3 * quadratic, 1e-3 * quadratic, quadratic, 0.0]
    low = [-np.inf, *(3 * [0.0 if name == 'position' else -np.inf]), -np.inf]
    fit = least_squares(residual, start, bounds=(low, np.inf), x_scale='jac')
    return np.asarray(fit.x[1:4])


def show(record: Record, out: Path) -> tuple[Estimate, list[str]]:
    """
    Print what became of one record; return its estimate and its line of the table.
    """
    watched, result = (replayed(record, out, window=window) for window in (False, True))
    onsets = ', '.join(f'ended by {each.ended_by.value}' for each in watched.coastdowns)
    found = estimated(record, out)
    print(f'\n== {record.name}: {result.ship.name}; onset without --window: {onsets or "none"}')
    print(f'  {record.import_command()}\n  {record.replay_command()}')
    noise = ', '.join(f'{name} {sd:.2g}' for name, sd in found.noise_sd.items())
    print(f'  {found.duration_s:.1f} s; noise {noise}; Fr_max by {found.froude_max_by.value}')
    c0, c1, c2 = second_opinion(found)
    print(f"  second opinion: v' = -({c0:.2g} {c1:+.2g} v {c2:+.2g} v|v|)")
    cells = []
    for speed, band, shown in figures(found, record):
        other = (1.0 + float(result.ship.n_r(speed))) * (c0 + c1 * speed + c2 * speed * speed)
        cells.append(f'{shown} ({other:.{display.decimals_of(band)}f})')
    fit = f'{found.estimator.removeprefix("s1_")}, {found.order}'
    share = f'{100 * found.max_relative_sigma:.0f}'
    return found, [record.name, fit, limits(found), '<br>'.join(cells), share]


def default_line(record: Record, published: Estimate, out: Path) -> list[str]:
    """
    Return what the default estimator gives beside the published problem.
    """
    (default,) = replayed(
        record, out, estimator='one', order_max=Parameters().order_max
    ).coastdowns
    cells = [
        '<br>'.join([f'{each.estimator}, {limits(each)}', *(s for *_, s in figures(each, record))])
        for each in (published, default.estimate)
        if each is not None
    ]
    if default.estimate is None:
        cells.append(f'none: {default.failure}')
    return [record.name, *cells]


def show_model_ship_at_rest(out: Path) -> None:
    """
    Print r of the model ship where the speed all but vanishes.
    """
    print('\n== model ship: r near rest [m/s^2, 2 sigma]')
    found = estimated(MODEL_SHIP, out, froude_min=0.001)
    low = float(found.valid_curve.speed_m_s[0])
    print(*(s for *_, s in figures(found, replace(MODEL_SHIP, speeds_m_s=(low,)))))


def show_ferry_path(out: Path) -> None:
    """
    Print the ferry's path as each of the three problems has it.
    """
    print('\n== ferry: path by each problem [m]')
    for estimator in ('s1_speed', 's1_position', 's1_joint'):
        found = estimated(FERRY, out, estimator=estimator)
        if (track := found.tracks.get('position')) is None:
            speed = found.tracks['speed_over_ground']
            length = float(np.trapezoid(speed.fitted, (speed.time_ns - found.start_ns) * 1e-9))
        else:
            length = float(np.ptp(track.fitted))
        noise = ', '.join(f'{name} {sd:.2g}' for name, sd in found.noise_sd.items())
        print(f'  {estimator:<12} {length:.3f}; order {found.order}, noise {noise}')


def draw(out: Path) -> None:
    """
    Draw r(v) of the model ship and of a simulated one.
    """
    line = f'shipdrag simulate --ship {SIMULATED} -o simulated.mcap --lead-in 900 --seed 1'
    run_command(line, out=out)
    (run,) = open_runs([out / 'simulated.mcap'])
    made = {'real_record': replayed(MODEL_SHIP, out), 'simulated': replay(run)}
    for name, result in ((name, RunResult.of(each)) for name, each in made.items()):
        (coastdown,) = result.coastdowns
        assert coastdown.estimate is not None
        true = result.truth
        figure = pictures.resistance_picture(
            coastdown.estimate,
            result.ship,
            truth=None if true is None else (true.speed_m_s, true.resistance_m_s2),
        )
        drawing.save(figure, out / f'{name}.png')
        print(f'picture: {out / name}.png, {words.summary(coastdown, result.ship)[0]}')


def main() -> None:
    """
    Import, replay, print and draw.
    """
    options = asked(__doc__, out=OUT / 'real_records', write=False)
    out = options.out
    if not prepared(out):
        return
    (out / 'simulated.mcap').unlink(missing_ok=True)
    found, published = {}, []
    for record in RECORDS:
        record.bag(out)
        run_command(f'{record.replay_command()} --report {record.name}.html', out=out)
        found[record.name], line_of_it = show(record, out)
        published.append(line_of_it)
    show_model_ship_at_rest(out)
    show_ferry_path(out)
    default = [default_line(record, found[record.name], out) for record in RECORDS]
    in_brackets = 'r at m/s: ± 2 sigma (second opinion)'
    of_published = ('record', 'fit, order', 'valid [m/s]', in_brackets, 'w [%]')
    blocks = {
        'published problems': '\n'.join(table(of_published, published)),
        'defaults': '\n'.join(table(('record', 'published problem', 'default'), default)),
    }
    print('', *blocks.values(), sep='\n')
    if options.write:
        put(PAGE, blocks)
    draw(out)


if __name__ == '__main__':
    main()
