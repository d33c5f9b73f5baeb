# SPDX-License-Identifier: Apache-2.0
"""
Write tables of the docs from the code.

`python docs/tables.py` rewrites what stands between the markers in docs/ros.md, docs/effects.md,
docs/results/priors.md, effects.txt and regimes_numbers.txt; a test fails while the two differ.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from shipdrag_ros.coastdown import numbers as vouching_numbers
from shipdrag_ros.coastdown.regimes import numbers
from shipdrag_ros.fields import keys_of
from shipdrag_ros.forecast import foretell
from shipdrag_ros.inference import priors as noise_priors
from shipdrag_ros.messages import OUTPUT_TOPICS, TOPICS
from shipdrag_ros.parameter import Declared, Parameter
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.problem import families_declared
from shipdrag_ros.samples import FURTHER
from shipdrag_ros.simulation.effects import LIBRARY, confounders, discriminating_measurements

DOCS = Path(__file__).resolve().parent
ROS = DOCS / 'ros.md'
EFFECTS = DOCS / 'effects.md'
EFFECTS_MORE = DOCS / 'results' / 'effects.txt'
REGIMES = DOCS / 'results' / 'regimes_numbers.txt'
PRIORS = DOCS / 'results' / 'priors.md'
_INPUT_MEANING = {
    'speed_through_water': 'speed log, `linear.x` forward [m/s]',
    'speed_over_ground': 'radar or GNSS, `hypot(linear.x, linear.y)` [m/s], frame not trusted',
    'position': 'radar-derived from a fixed mark, or GNSS: metres in a fixed frame, or latitude '
    'and longitude',
    'heading': 'yaw; as Float64 degrees of a true compass, which hold no time: they count from '
    'their arrival',
    'shaft': 'joints `shaft...`, up to four: `velocity` [rad/s], negative astern; joints '
    '`pitch...` of controllable propellers: `position`, a ratio or an angle, 0 no thrust',
    'rudder': 'joint `rudder`, `position` [rad]',
    'wind_apparent': 'air relative to the ship in base_link [m/s]; head wind: `linear.x` < 0',
    'depth': 'water depth from the surface [m]',
}
_OUTPUT_MEANING = {
    'speed': 'estimated speed through water, variance at [0]',
    'resistance': 'specific resistance r as `linear.x` [m/s² = N/kg], retarding positive, '
    'variance at [0]; in calm deep water where wind and depth are measured or stated, else in '
    'the conditions of the run: /diagnostics says which',
    'resistance_curve': 'fields `speed, resistance, sigma, froude`, one point a speed; latched',
    'forecast': 'the rest of the glide with a band of 90 %: fields `time, speed, speed_low, '
    'speed_high, distance, distance_low, distance_high` from the stamp on, one point a time; '
    'the distance is through water (over ground: `~/forecast_path`); '
    'empty when withdrawn; latched',
    'forecast_path': 'positions to come, in metres as `position` sends them, or east and north of '
    'the first since the stop; empty when withdrawn; latched',
    'events': 'onsets, ends, resets, life cycle, clock jumps',
    'diagnosis': 'JSON of `shipdrag diagnose` after each coastdown; latched',
}


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    head = list(head)
    lines = [head, ['---'] * len(head), *rows]
    cells = ([cell.replace('|', r'\|') for cell in line] for line in lines)
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in cells)


def _short(type_name: str) -> str:
    return type_name.replace('/msg/', '/')


def inputs() -> str:
    """
    Return the table of the topics that are heard.
    """
    rows = (
        [f'`{name}`', ', '.join(_short(kind) for kind in kinds), _INPUT_MEANING[name]]
        for name, kinds in TOPICS.items()
        if name not in FURTHER
    )
    return _table(['topic', 'types accepted', 'meaning'], rows)


def outputs() -> str:
    """
    Return the table of the topics that are published.
    """
    rows = [
        [f'`~/{topic.name}`', _short(topic.type), _OUTPUT_MEANING[topic.name]]
        for topic in OUTPUT_TOPICS
    ]
    diagnostics = (
        'state, health of each input, the latest figures, the verdict in a sentence; 1 Hz on '
        'steady time'
    )
    rows.append(['`/diagnostics`', 'diagnostic_msgs/DiagnosticArray', diagnostics])
    return _table(['topic', 'type', 'meaning'], rows)


def parameters() -> str:
    """
    Return the table of the parameters that change a result.
    """
    rows = []
    for name, key in keys_of(Parameters).items():
        kind = key.kind
        if kind.choices:
            allowed = ', '.join(f'`{choice}`' for choice in kind.choices)
        elif kind.low is None:
            allowed = kind.expectation
        else:
            allowed = f'{kind.low:g} .. {kind.high:g}'
        default = f'`{key.default}` {kind.unit}'.strip()
        rows.append([f'`{name}`', default, allowed, key.text])
    return _table(['parameter', 'default', 'allowed', 'meaning'], rows)


def _per(quantity: Parameter) -> str:
    return f' times {quantity.measured_in.text}' if quantity.measured_in.text else ''


def effects() -> str:
    """
    Return the table of what effects do.
    """
    rows = (
        [
            f'`{effect.name}`',
            effect.scope,
            effect.formula,
            effect.source,
            ', '.join(f'`{name}`' for name in effect.struck_out_by) or '-',
            ', '.join(f'`{name}`' for name in effect.needs) or '-',
            ', '.join(f'`{name}`' for name in effect.not_with) or '-',
            f'{effect.odds:g}',
        ]
        for effect in LIBRARY.values()
    )
    head = ['effect', 'scope', 'formula', 'source', 'struck out by', 'needs in the ship file']
    return _table([*head, 'not together with', 'odds'], rows)


def effect_parameters() -> str:
    """
    Return the table of the parameters of effects.
    """
    rows = []
    for effect in LIBRARY.values():
        for quantity in effect.parameters:
            if quantity.words:
                accepted = ', '.join(f'`{word}`' for word in quantity.words)
            else:
                accepted = f'{quantity.low:g} .. {quantity.high:g}{_per(quantity)}'
            default = f'{quantity.value:g}{_per(quantity)}' if quantity.is_given else ''
            rows.append(
                [
                    f'`{effect.name}`',
                    f'`{quantity.name}`',
                    quantity.unit or '-',
                    quantity.meaning,
                    f'{quantity.prior}{_per(quantity)}',
                    accepted,
                    default or 'to be given',
                ]
            )
    head = ['effect', 'parameter', 'unit', 'meaning', 'prior', 'accepted', 'default']
    return _table(head, rows)


def effect_confounders() -> str:
    """
    Return the table of effects that leave nearly the same trace.
    """
    rows = (
        [
            f'`{name}`',
            f'`{other}`',
            '; '.join(discriminating_measurements(name, other)) or 'nothing that can be recorded',
        ]
        for name in LIBRARY
        for other in confounders(name)
        if name < other
    )
    return _table(['effect', 'looks like', 'what decides'], rows)


def model_priors() -> str:
    """
    Return the table of the priors of the one posterior.
    """
    return _declared(priors.TABLE)


def model_forecast() -> str:
    """
    Return the table of the priors of the forecast.
    """
    return _declared(foretell.PRIORS)


def _declared(rows_of: Iterable[Declared]) -> str:
    rows = (
        [f'`{each.letter}`', each.meaning, str(each.prior), each.unit or '-', each.source]
        for each in rows_of
    )
    return _table(['letter', 'meaning', 'prior', 'unit', 'source'], rows)


def model_noise() -> str:
    """
    Return the table of the priors of the noise.
    """
    return _declared(noise_priors.TABLE)


def model_families() -> str:
    """
    Return the table of what a hull may differ by.
    """
    rows = (
        [name, f'{chance:.3g}', friction, wave, size]
        for name, chance, friction, wave, size in families_declared()
    )
    return _table(['hypothesis', 'probability', '`theta_f`', '`theta_w`', 'size of `s`'], rows)


Tables = Mapping[str, Callable[[], str]]
TABLES: Tables = {'inputs': inputs, 'outputs': outputs, 'parameters': parameters}
PAGES: Mapping[Path, Tables] = {
    ROS: TABLES,
    EFFECTS: {'effects': effects},
    EFFECTS_MORE: {'effect parameters': effect_parameters, 'confounders': effect_confounders},
    PRIORS: {
        'priors': model_priors,
        'noise priors': model_noise,
        'families': model_families,
        'forecast priors': model_forecast,
    },
    REGIMES: {
        'numbers': numbers.NUMBERS.table,
        'vouching numbers': vouching_numbers.NUMBERS.table,
    },
}


def updated(text: str, tables: Tables = TABLES) -> str:
    """
    Return a page with every marked table made anew.

    Raises
    ------
    ValueError
        If the page lacks the markers of a table.
    """
    for name, table in tables.items():
        begin, end = f'<!-- {name} -->', f'<!-- end {name} -->'
        if begin not in text or end not in text:
            raise ValueError(f'no {begin} .. {end} in the page')
        made = f'{begin}\n{table()}\n{end}'
        text = re.sub(f'{begin}.*?{end}', lambda _, made=made: made, text, flags=re.DOTALL)
    return text


if __name__ == '__main__':
    for page, tables in PAGES.items():
        page.write_text(updated(page.read_text(encoding='utf-8'), tables), encoding='utf-8')
