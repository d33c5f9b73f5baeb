# SPDX-License-Identifier: Apache-2.0
"""The library of effects as a whole: what is declared, and that all of it does something."""

from __future__ import annotations

import pickle
import sys
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shipdrag_ros import imports, strict_yaml
from shipdrag_ros.errors import EffectFileError, SimulationError
from shipdrag_ros.parameter import Parameter, Prior, Shape
from shipdrag_ros.samples import INPUTS
from shipdrag_ros.ship import LearntTerm, Ship, StatedEffect
from shipdrag_ros.simulation import (
    STANDARD_SD,
    Action,
    Frame,
    Scenario,
    Scope,
    sense,
    simulate,
    simulate_columns,
    standard_sensors,
)
from shipdrag_ros.simulation import effects as library
from shipdrag_ros.simulation.declared import effects_in
from shipdrag_ros.simulation.effects import LIBRARY, action_of, parse, using
from tests.runs import CARGO

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = Scenario(speed_m_s=8.2, lead_in_s=20.0, duration_s=600.0, heading_rad=0.4)
FRAME = Frame(CARGO, SCENARIO, SCENARIO.heading_rad)
PROMISED = {
    'current': ('earth', 'along_track_m_s', 'cross_track_m_s'),
    'wind': ('earth', 'head_m_s', 'cross_m_s'),
    'waves': ('earth', 'force_n', 'from'),
    'shallow_water': ('earth', 'depth_m'),
    'fouling': ('hull', 'friction_factor'),
    'locked_propeller': ('hull', 'drag_coefficient'),
    'windmilling_propeller': ('hull', 'drag_coefficient', 'stall_speed_m_s'),
    'towed_cable': ('hull', 'drag_area_m2'),
    'turning': ('run', 'drag_area_m2', 'start_s', 'duration_s'),
    'residual_thrust': ('run', 'decay_s', 'fraction'),
    'log_scale': ('sensor', 'factor'),
    'radar_scale': ('sensor', 'factor'),
    'log_offset': ('sensor', 'offset_m_s'),
    'log_lag': ('sensor', 'lag_s'),
    'log_dead_band': ('sensor', 'speed_m_s'),
    'time_offset': ('sensor', 'offset_s'),
    'current_change': ('earth', 'change_m_s'),
    'added_mass': ('hull', 'n_r_change'),
    'displacement': ('hull', 'fraction'),
}
EACH = pytest.mark.parametrize('name', LIBRARY)
# a value at which each first parameter is seen, where the median of its prior is 0
SEEN = {
    'current': 0.4,
    'wind': 8.0,
    'log_scale': 0.05,
    'radar_scale': 0.05,
    'log_offset': 0.2,
    'log_dead_band': 5.0,
    'time_offset': 8.0,
    'current_change': 0.3,
    'added_mass': 0.05,
    'displacement': 0.08,
}


def typical(name: str, ship: Ship = CARGO) -> list[float]:
    """Return values of all parameters at which the effect is plain to see."""
    first, *others = LIBRARY[name].parameters_of(ship)
    return [SEEN.get(name, first.prior.first), *(other.value for other in others)]


def readings(action: Action) -> dict[str, np.ndarray]:
    stated = simulate_columns(CARGO, SCENARIO, [action], np.arange(0.0, 621.0, 5.0))
    return {'log': stated.log_m_s[0], 'radar': stated.radar_position_m[0]}


@pytest.mark.parametrize('name', PROMISED)
def test_the_promised_names_stay(name):
    scope, *parameters = PROMISED[name]
    effect = LIBRARY[name]
    assert effect.scope == scope
    assert [quantity.name for quantity in effect.parameters][: len(parameters)] == parameters


def test_an_effect_is_declared_in_the_file_or_the_module_of_its_name():
    modules = {path.stem for path in Path(library.__file__).parent.glob('[!_]*.py')}
    file = resources.files('shipdrag_ros') / 'data' / 'effects.yaml'
    declared = set(strict_yaml.load(file.read_text(encoding='utf-8')))
    assert modules | declared == set(LIBRARY)
    assert not modules & declared
    assert list(LIBRARY) == sorted(LIBRARY)
    for name in declared:
        term = LIBRARY[name].act.args[0]
        assert isinstance(term, LearntTerm)
        assert term.name == name


def test_a_formula_of_the_library_is_checked_like_a_learnt_one(tmp_path):
    whole = (resources.files('shipdrag_ros') / 'data' / 'effects.yaml').read_text(encoding='utf-8')
    for right, wrong in (
        ('"friction_factor*R_F"', '"friction_factor*R_F*u"'),
        ('"friction_factor*R_F"', '"friction_factor*R_F/(u - 3*sqrt(g*L)/sqrt(g*L))"'),
        ('"offset_s"', '"offset_s*L"'),
        ('"change_m_s*(t/t_end)"', '"change_m_s*(t/t_end)**2"'),
        ('"lag_s"', '"lag_s*exp(-u/sqrt(g*L))"'),
        ('[log-normal, 0.25, 0.6]', '[log-normal, 0, 0.6]'),
        ('counted_in: V^(2/3)', 'counted_in: draught'),
        ('[reciprocal_run]', '[a_prayer]'),
        ('to_port: "cross_track_m_s"', 'to_port: "cross_track_m_s*L"'),
        ('expression: "depth_m"', 'expression: "depth_m", to_port: "depth_m"'),
    ):
        assert whole.count(right) >= 1
        (tmp_path / 'effects.yaml').write_text(whole.replace(right, wrong, 1), encoding='utf-8')
        with pytest.raises(EffectFileError):
            list(effects_in(tmp_path / 'effects.yaml'))
    (tmp_path / 'effects.yaml').write_text(whole, encoding='utf-8')
    assert len(list(effects_in(tmp_path / 'effects.yaml'))) > 10


def test_one_new_module_is_a_new_effect(tmp_path, monkeypatch):
    effects = tmp_path / 'shipdrag_ros' / 'simulation' / 'effects'
    effects.mkdir(parents=True)
    (effects / 'ice.py').write_text(
        'from shipdrag_ros.parameter import Parameter, half_normal\n'
        'from shipdrag_ros.simulation import Action, Effect, Scope\n'
        'EFFECT = Effect(name="ice", scope=Scope.EARTH, formula="F", source="a test", parameters=('
        'Parameter(name="force_n", unit="N", meaning="ice", prior=half_normal(1.0), low=0, '
        'high=1e9),), act=lambda frame, force: Action(resistance=(lambda v: 0 * v + force,)))\n'
    )
    monkeypatch.setattr(library, '__path__', [*library.__path__, str(effects)])
    monkeypatch.setattr(imports, '_PACKAGE', tmp_path / 'shipdrag_ros')
    monkeypatch.setattr(library, 'LIBRARY', library._every.__wrapped__())
    monkeypatch.delitem(sys.modules, f'{library.__name__}.ice')
    truth = simulate(CARGO, SCENARIO, effects=[parse('ice=1e5')])
    extra = truth.specific_resistance(5.0) * CARGO.mass_kg - CARGO.resistance_n(5.0)
    np.testing.assert_allclose(extra, 1e5, rtol=1e-9)


@EACH
def test_a_declaration_is_whole(name):
    effect = LIBRARY[name]
    assert effect.formula
    assert effect.source
    assert set(effect.struck_out_by) <= set(INPUTS)
    assert set(effect.confounders) <= set(LIBRARY) - {name}
    assert not effect.parameters[0].is_given
    for quantity in effect.parameters_of(CARGO):
        assert quantity.meaning
        if quantity is not effect.parameters[0] and quantity.is_given:
            assert quantity.accepts(quantity.value)


@EACH
def test_a_prior_lies_in_what_is_accepted(name):
    # N = 500, seed 2: 95 % at least, and none with density 0
    rng = np.random.default_rng(2)
    for quantity in LIBRARY[name].parameters_of(CARGO):
        draws = [quantity.prior.draw(rng) for _ in range(500)]
        assert np.mean([quantity.accepts(value) for value in draws]) > 0.95
        assert all(np.isfinite(quantity.prior.log_density(value)) for value in draws)


@EACH
def test_every_parameter_changes_a_reading(name):
    values = typical(name)
    before = readings(LIBRARY[name].action(FRAME, *values))
    for i, quantity in enumerate(LIBRARY[name].parameters_of(CARGO)):
        changed = list(values)
        changed[i] = -values[i] if quantity.words else 1.3 * values[i] or 0.5
        after = readings(LIBRARY[name].action(FRAME, *changed))
        gap = max(np.max(np.abs(after[key] - before[key])) for key in before)
        assert gap > 1e-4, quantity.name


@EACH
def test_every_effect_leaves_the_speed_steady_until_the_stop(name):
    stated = StatedEffect(
        name,
        {
            quantity.name: Parameter(value, 0.0)
            for quantity, value in zip(LIBRARY[name].parameters, typical(name))
        },
    )
    truth = simulate(CARGO, SCENARIO, effects=[stated])
    lead_in = truth.time_s <= 20.0
    np.testing.assert_allclose(truth.speed_through_water_m_s[lead_in], 8.2, rtol=1e-9)
    calm = simulate(CARGO, SCENARIO)
    moved = np.max(
        np.abs(truth.at(calm.time_s).velocity_over_ground_m_s - calm.velocity_over_ground_m_s)
    )
    assert (moved < 1e-12) == (LIBRARY[name].scope is Scope.SENSOR)


@EACH
def test_what_strikes_an_effect_out_reads_it(name):
    stated = [
        StatedEffect(name, {LIBRARY[name].parameters[0].name: Parameter(typical(name)[0], 0)})
    ]
    inputs = [channel.input for channel in STANDARD_SD]
    sensors = standard_sensors(noise=0.0, inputs=inputs, rate_hz=0.2)
    calm = sense(simulate(CARGO, SCENARIO), sensors, seed=1)
    changed = sense(simulate(CARGO, SCENARIO, effects=stated), sensors, seed=1)
    seen = {
        channel.input
        for channel in STANDARD_SD
        if np.max(np.abs((changed.value - calm.value)[calm.channel == channel])) > 1e-3
    }
    # a shaft that stands still is what a locked propeller's does, and the baseline's
    assert (
        set(LIBRARY[name].struck_out_by) - ({'shaft'} if name == 'locked_propeller' else set())
        <= seen
    )
    context = {'depth', 'rudder', 'shaft', 'heading'}
    assert seen & context <= set(LIBRARY[name].struck_out_by)


def test_actions_add_and_the_empty_one_is_nothing():
    wind = LIBRARY['wind'].action(FRAME, 5.0, 2.0)
    cable = LIBRARY['towed_cable'].action(FRAME, 0.8)
    shallow = LIBRARY['shallow_water'].action(FRAME, 20.0)
    assert Action() + wind == wind == wind + Action()
    together = wind + cable + shallow
    assert together.depth_m == 20.0
    assert together.wind_m_s == wind.wind_m_s
    v = np.array([-3.0, 0.0, 3.0])
    np.testing.assert_allclose(
        together.resistance_n(v), cable.resistance_n(v) + shallow.resistance_n(v), rtol=1e-14
    )
    np.testing.assert_allclose(together.resistance_n(-v), -together.resistance_n(v), rtol=1e-14)


@pytest.mark.parametrize(
    ('prior', 'mean', 'sd'),
    [
        (Prior(Shape.NORMAL, 1.0, 2.0), 1.0, 2.0),
        (Prior(Shape.HALF_NORMAL, 0.0, 2.0), 2.0 * np.sqrt(2 / np.pi), 2 * np.sqrt(1 - 2 / np.pi)),
        (Prior(Shape.LOG_NORMAL, 2.0, 0.3), 2.0 * np.exp(0.045), 2.0 * 0.3 * 1.07),
        (Prior(Shape.EITHER_SIGN, 2.0, 0.3), 0.0, 2.0 * np.exp(0.09)),
        (Prior(Shape.UNIFORM, -1.0, 3.0), 1.0, 4.0 / np.sqrt(12.0)),
        (Prior(Shape.CHOICE, 1.0, -1.0), 0.0, 1.0),
    ],
)
def test_priors_draw_what_their_density_says(prior, mean, sd):
    # N = 20 000, seed 3; bounds 5 standard errors
    rng = np.random.default_rng(3)
    draws = np.array([prior.draw(rng) for _ in range(20_000)])
    assert abs(np.mean(draws) - mean) < 5.0 * sd / np.sqrt(20e3)
    np.testing.assert_allclose(np.std(draws), sd, rtol=0.04)
    if prior.shape is not Shape.CHOICE:
        grid = np.linspace(-12.0, 12.0, 48_001)
        density = np.exp([prior.log_density(value) for value in grid])
        np.testing.assert_allclose(np.trapezoid(density, grid), 1.0, rtol=1e-3)
        np.testing.assert_allclose(np.trapezoid(density * grid, grid), mean, rtol=2e-3)
    scaled = prior.scaled(10.0)
    assert (
        abs(scaled.draw(np.random.default_rng(4)) / prior.draw(np.random.default_rng(4)) - 10.0)
        < 1e-9
    )


@EACH
@settings(max_examples=20, deadline=None)
@given(data=st.data())
def test_what_is_written_is_read(name, data):
    values = []
    for quantity in LIBRARY[name].parameters_of(CARGO):
        if quantity.words:
            values.append(data.draw(st.sampled_from(sorted(quantity.words.values()))))
        else:
            values.append(data.draw(st.floats(quantity.low, quantity.high)))
    names = [quantity.name for quantity in LIBRARY[name].parameters]
    rest = ''.join(f',{key}={value!r}' for key, value in zip(names[1:], values[1:]))
    stated = parse(f'{name}={values[0]!r}{rest}')
    assert stated == StatedEffect(name, {k: Parameter(v, 0.0) for k, v in zip(names, values)})
    action = action_of(FRAME, [stated])
    expected = LIBRARY[name].action(FRAME, *values)
    functions = {'resistance': (), 'log_error': ()}
    assert replace(action, **functions) == replace(expected, **functions)


def test_words_and_defaults_are_read():
    stated = parse('waves=2e4, from=astern')
    assert stated.parameters['from'].value == -1.0
    action = action_of(FRAME, [parse('waves=2e4')])
    assert action.wave_force_n == FRAME.earth(-2e4, 0.0)


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('foo=1', f'known are {", ".join(LIBRARY)}'),
        ('wind', r'no value; write wind=VALUE\[,cross_m_s=VALUE\]'),
        ('wind=x', "head_m_s is 'x', expected a number"),
        ('wind=1,speed=2', "parameter 'speed' is not known"),
        ('wind=1,head_m_s=2', "parameter 'head_m_s' is given twice"),
        ('waves=1,from=left', 'expected ahead or astern'),
    ],
)
def test_a_text_that_cannot_be_read_is_told(text, message):
    with pytest.raises(SimulationError, match=message):
        parse(text)


def test_all_impossible_effects_are_told_at_once():
    bare = Ship(length_m=150.0, displaced_volume_m3=20200.0)
    stated = [
        StatedEffect('barnacles', {}),
        StatedEffect('wind', {'head_m_s': Parameter(5.0, 0.0)}),
        StatedEffect('current', {'along_track_m_s': Parameter(9.0, 0.0)}),
        StatedEffect('log_scale', {'scale': Parameter(9.0, 0.0)}),
        StatedEffect('log_lag', {'lag_s': Parameter(np.nan, 0.0)}),
        StatedEffect('log_lag', {'lag_s': Parameter(1.0, 0.0)}),
        StatedEffect('locked_propeller', {}),
        StatedEffect('residual_thrust', {}),
    ]
    with pytest.raises(SimulationError) as told:
        action_of(Frame(bare, SCENARIO, 0.0), stated)
    for part in (
        "'barnacles' is not known",
        'wind needs air in the ship file',
        'along_track_m_s is 9.0, expected -5..5 m/s',
        "parameter 'scale' is not known; known are factor",
        'factor is missing',
        'lag_s is nan',
        'log_lag is given 2 times',
        'locked_propeller and residual_thrust cannot be there at the same time',
    ):
        assert part in str(told.value)


def test_a_ship_without_inertia_is_told() -> None:
    weightless = LearntTerm.from_yaml(
        'name: weightless\n'
        'term: {channel: inertia, scope: hull, variable: speed, shape: constant,\n'
        '  expression: "A*rho*nabla", valid: {}}\n'
        'parameters: {A: {value: -1, sd: 0, bounds: [-2, 2]}}\n'
    )
    with using([weightless]), pytest.raises(SimulationError, match='without inertia'):
        action_of(FRAME, [StatedEffect('weightless', {'A': Parameter(-1.0, 0.0)})])


def test_every_parameter_goes_from_process_to_process() -> None:
    """A diagnosis beside the node comes from a process of its own, sizes and all."""
    for effect in LIBRARY.values():
        for parameter in effect.parameters:
            assert repr(pickle.loads(pickle.dumps(parameter))) == repr(parameter)
