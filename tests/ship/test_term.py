# SPDX-License-Identifier: Apache-2.0
"""Files of learnt effects: sound ones act as their formula says, hostile ones are refused."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from shipdrag_ros.errors import EffectFileError, ShipFileError
from shipdrag_ros.ship import GRAVITY_M_S2, Ship
from shipdrag_ros.ship.model import friction_n
from shipdrag_ros.ship.term import LearntTerm, read_folders
from shipdrag_ros.simulation import Scenario, sense, simulate, simulate_columns, standard_sensors
from shipdrag_ros.simulation.declared import effect_of
from shipdrag_ros.simulation.effect import Frame
from shipdrag_ros.simulation.effects import LIBRARY, declared, find, parse, using

ROOT = Path(__file__).resolve().parents[2]
WEED = (ROOT / 'docs' / 'data' / 'effects' / 'weed.yaml').read_text(encoding='utf-8')
FADING = """
name: fading
term: {channel: force, scope: hull, variable: time, shape: decay,
  expression: "0.5*rho*A*nabla**(2/3)*u**2*exp(-t/(tau*sqrt(L/g)))",
  valid: {t: [0, 3000], u: [0.5, 8]}}
parameters: {A: {value: 0.02, sd: 0.001}, tau: {value: 100, sd: 5}}
"""
TURNED = """
name: turned
term: {channel: force, scope: earth, variable: heading, shape: periodic,
  expression: "rho*g*nabla*(A*cos(psi) + B*sin(psi))", valid: {u: [0.5, 8]}}
parameters: {A: {value: 2e-4, sd: 1e-5}, B: {value: 1e-4, sd: 1e-5}}
"""


WASHED = """
name: washed
term: {channel: log, scope: sensor, variable: time, shape: decay,
  expression: "A*u*exp(-t/(tau*sqrt(L/g)))", valid: {t: [0, 3000], u: [0.5, 8]}}
parameters: {A: {value: 0.05, sd: 0.01}, tau: {value: 100, sd: 5}}
"""
SANDED = """
name: sanded
term: {channel: force, scope: earth, variable: depth, shape: power,
  expression: "0.5*rho*A*nabla**(2/3)*u**2*(0.1*L/h)**2", valid: {h: [8, 40], u: [0.5, 8]}}
parameters: {A: {value: 0.02, sd: 0.001}}
"""
GROWN = """
name: grown
term: {channel: force, scope: hull, variable: date, shape: ramp,
  expression: "0.5*rho*A*nabla**(2/3)*u**2*(d - 20600)/30",
  valid: {d: [20600, 20630], u: [0.5, 8]}}
parameters: {A: {value: 0.02, sd: 0.001}}
"""


LATE = """
name: late
term: {channel: clock, scope: sensor, variable: speed, shape: constant, expression: "s*tau",
  valid: {}}
parameters:
  s: {value: 7, sd: 1, unit: s}
  tau: {prior: [half-normal, 0, 2], bounds: [0, 9], meaning: how often}
"""
SET = """
name: set_and_drift
term: {channel: water, scope: earth, variable: time, shape: ramp, expression: "A*t/t_end",
  to_port: "2*A", valid: {t: [0, 1e4]}}
parameters: {A: {prior: [normal, 0, 0.3], bounds: [-3, 3], unit: m/s}}
"""
BALLAST = """
name: ballast
term: {channel: inertia, scope: hull, variable: speed, shape: constant, expression: "W/g",
  valid: {u: [0, 20]}}
also:
- {channel: inertia, expression: "0.1*W/(rho*g*nabla)"}
- {channel: force, expression: "W/(rho*g*nabla)*R_F"}
parameters: {W: {prior: [log-normal, 0.01, 1], unit: N, counted_in: weight of the ship}}
"""


def frame_of(ship: Ship) -> Frame:
    """Return what a term acts in."""
    return Frame(ship, Scenario(speed_m_s=6.0), 0.0)


def plain(text: str) -> dict[str, Any]:
    """Return the plain data of a text."""
    return dict(YAML(typ='safe').load(text))


def refused(whole: Any) -> None:
    """Expect a plain error of the text of some data."""
    import io

    stream = io.StringIO()
    YAML(typ='safe').dump(whole, stream)
    with pytest.raises(EffectFileError):
        declared(LearntTerm.from_yaml(stream.getvalue()))


def test_a_term_acts_as_its_formula_says() -> None:
    ship, term = Ship.example(), LearntTerm.from_yaml(WEED)
    frame = Frame(ship, Scenario(speed_m_s=6.0), 0.0)
    speed = np.linspace(1.2, 7.8, 40)
    root = math.sqrt(GRAVITY_M_S2 * ship.length_m)
    step = 0.5 * (1.0 + np.tanh((0.09 * root - speed) / (0.02 * root)))
    wanted = 0.5 * ship.water.density_kg_m3 * 0.002 * ship.length_m**2 * speed**2 * step
    found = declared(term).action(frame, 0.002, 0.09).resistance_n(speed)
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


def test_beyond_its_speeds_a_force_goes_on_as_the_square() -> None:
    ship, term = Ship.example(), LearntTerm.from_yaml(WEED)
    [force_n] = effect_of(term).action(frame_of(ship), 0.002, 0.09).resistance
    inside, beyond, at_rest = force_n(np.array([7.9, 15.8, 0.0]))
    assert beyond == pytest.approx(4.0 * inside)
    assert at_rest == 0.0


@pytest.mark.parametrize(('factor', 'power'), [('g*L', 0.0), ('u*sqrt(g*L)', 1.0), ('u**2', 2.0)])
def test_below_its_speeds_a_force_goes_on_as_it_is_there(factor: str, power: float) -> None:
    text = f"""
name: held
term: {{channel: force, scope: hull, variable: speed, shape: power,
  expression: "0.5*rho*A*nabla**(2/3)*{factor} + 0*rho*nabla**(2/3)*u**2", valid: {{u: [2, 8]}}}}
parameters: {{A: {{value: 0.01, sd: 0}}}}
"""
    speed = np.array([4.0, 2.0, 1.0, 0.5, 0.0])
    held = effect_of(LearntTerm.from_yaml(text))
    [force_n] = held.action(frame_of(Ship.example()), 0.01).resistance
    force = force_n(speed)
    np.testing.assert_allclose(force, force[0] * (speed / 4.0) ** power, rtol=1e-6)


def test_a_force_in_time_is_followed() -> None:
    ship, term = Ship.example(), LearntTerm.from_yaml(FADING)
    scenario = Scenario(speed_m_s=6.0, duration_s=900.0)
    frame = Frame(ship, scenario, 0.0)
    action = declared(term).action(frame, 0.02, 100.0)
    after = np.linspace(0.0, 900.0, 200)
    area = sum(turn.drag_area_m2 * turn.share(after) for turn in action.turns)
    tau_s = 100.0 * math.sqrt(ship.length_m / GRAVITY_M_S2)
    whole = 0.02 * ship.displaced_volume_m3 ** (2 / 3)
    assert np.abs(area - whole * np.exp(-after / tau_s)).max() < 0.003 * whole


def test_a_force_of_the_earth_turns_with_the_heading() -> None:
    ship, term = Ship.example(), LearntTerm.from_yaml(TURNED)
    speed = np.array([3.0])
    forces = []
    for heading in (0.0, math.pi):
        frame = Frame(ship, Scenario(speed_m_s=6.0, heading_rad=heading), 0.0)
        forces.append(float(declared(term).action(frame, 2e-4, 1e-4).resistance_n(speed)[0]))
    assert forces[0] == pytest.approx(-forces[1])
    assert forces[0] > 0.0


def test_a_heading_acts_as_the_same_heading_a_turn_on() -> None:
    term = LearntTerm.from_yaml(TURNED.replace('A*cos(psi) + B*sin(psi)', 'A*psi + B'))
    ship, speed = Ship.example(), np.array([2.0, 5.0])
    before, after = (
        effect_of(term)
        .action(Frame(ship, Scenario(speed_m_s=5.0, heading_rad=psi), 0.0), 2e-4, 1e-4)
        .resistance_n(speed)
        for psi in (0.5, 0.5 + math.tau)
    )
    np.testing.assert_allclose(after, before)


def test_of_two_terms_of_one_name_the_later_is_known() -> None:
    weed = LearntTerm.from_yaml(WEED)
    other = LearntTerm.from_yaml(TURNED.replace('name: turned', 'name: weed'))
    for term in (weed, other, weed):
        declared(term)
        assert [each.name for each in find('weed').parameters] == list(term.parameters)


def test_a_log_in_time_reads_as_its_formula_says() -> None:
    ship, scenario = Ship.example(), Scenario(speed_m_s=6.0, duration_s=900.0)
    term = LearntTerm.from_yaml(WASHED)
    with using([term]):
        truth = simulate(ship, scenario, effects=[parse('washed=0.05')])
    (sensor,) = standard_sensors(noise=0.0, inputs=['speed_through_water'])
    block = sense(truth, [sensor], seed=1)
    time_s = (block.receive_ns - block.receive_ns[0]) * 1e-9
    since = np.maximum(time_s - scenario.lead_in_s, 0.0)
    tau_s = 100.0 * math.sqrt(ship.length_m / GRAVITY_M_S2)
    speed = np.interp(time_s, truth.time_s, truth.speed_through_water_m_s)
    wanted = speed * (1.0 + 0.05 * np.exp(-since / tau_s))
    np.testing.assert_allclose(block.value[:, 0], wanted, atol=2e-4)
    action = declared(term).action(frame_of(ship), 0.05, 100.0)
    column = simulate_columns(ship, scenario, [action], time_s).log_m_s[0]
    np.testing.assert_allclose(column, wanted, atol=2e-4)


def test_beyond_its_speeds_an_error_of_the_log_keeps_its_share() -> None:
    washed = declared(LearntTerm.from_yaml(WASHED))
    (error,) = washed.action(frame_of(Ship.example()), 0.05, 100.0).log_error
    speed = np.array([0.1, 0.5, 4.0, 8.0, 16.0, -16.0])
    np.testing.assert_allclose(error(speed, np.zeros(6)) / speed, 0.05)


def test_a_parameter_that_is_hardly_known_keeps_its_sign() -> None:
    # three sd below the value would be a pole at 0
    term = LearntTerm.from_yaml(FADING.replace('{value: 100, sd: 5}', '{value: 100, sd: 45}'))
    low, high = term.parameters['tau'].ends
    assert 0.0 < low < 50.0
    assert high > 200.0


def test_a_formula_is_as_sure_as_it_foretold_runs_left_out() -> None:
    rest = 'evidence: {runs: [a], over_nothing: 9, over_smooth: 5, halves_agree: true, '
    for cut, left in ((0.9, 0.1), (-3.0, 1.0)):
        term = LearntTerm.from_yaml(f'{WEED}{rest}held_out_gap_cut: {cut}}}')
        assert declared(term).formula_sd == pytest.approx(left)
    assert declared(LearntTerm.from_yaml(WEED)).formula_sd == 0.0


@pytest.mark.parametrize(
    ('text', 'runs', 'ratio'),
    [
        (SANDED, ({'depth_m': 10.0}, {'depth_m': 20.0}), 0.25),
        (SANDED, ({'depth_m': 40.0}, {'depth_m': 200.0}), 1.0),  # as at the end of what is valid
        (GROWN, ({'day': 20610.0}, {'day': 20620.0}), 2.0),
    ],
)
def test_a_force_by_depth_or_date_is_of_the_run(text, runs, ratio):
    effect, ship = declared(LearntTerm.from_yaml(text)), Ship.example()
    one, other = (
        effect.action(Frame(ship, Scenario(speed_m_s=6.0, **run), 0.0), 0.02).resistance_n(3.0)
        for run in runs
    )
    assert other == pytest.approx(ratio * one)


def test_more_of_it_slows_the_ship_more() -> None:
    ship, terms = Ship.example(), [LearntTerm.from_yaml(WEED), LearntTerm.from_yaml(FADING)]
    with using(terms):
        for name in ('weed', 'fading'):
            last = [
                simulate(
                    ship, Scenario(speed_m_s=6.0, duration_s=900.0), effects=effects
                ).speed_through_water_m_s[-1]
                for effects in ([], [parse(f'{name}=0.002')], [parse(f'{name}=0.004')])
            ]
            assert last[0] > last[1] > last[2]
    assert 'weed' not in LIBRARY


def test_a_term_may_act_on_clock_water_and_inertia() -> None:
    ship = Ship.example()
    frame = Frame(ship, Scenario(speed_m_s=6.0, duration_s=900.0, heading_rad=2.0), 0.0)
    assert declared(LearntTerm.from_yaml(LATE)).action(frame, 7.0, 2.0).log_late_s == 14.0
    water = declared(LearntTerm.from_yaml(SET)).action(frame, 0.4)
    np.testing.assert_allclose(water.current_m_s, (0.0, 0.8))
    np.testing.assert_allclose(water.current_change_m_s, (0.4, 0.0), atol=1e-15)
    effect = declared(LearntTerm.from_yaml(BALLAST))
    weight_n = ship.mass_kg * GRAVITY_M_S2
    (size,) = effect.parameters_of(ship)
    assert size.prior.first == pytest.approx(0.01 * weight_n)
    ballast = effect.action(frame, 0.2 * weight_n)
    assert ballast.mass_fraction == pytest.approx(0.2)
    assert ballast.n_r_change == pytest.approx(0.02)
    speed = np.array([2.0, 5.0])
    np.testing.assert_allclose(ballast.resistance_n(speed), 0.2 * friction_n(ship, speed))


def test_a_parameter_with_a_prior_needs_no_value() -> None:
    scale, often = declared(LearntTerm.from_yaml(LATE)).parameters
    assert (scale.value, scale.low) == (7.0, 0.0)
    assert not often.is_given
    assert (often.low, often.high, often.meaning) == (0.0, 9.0, 'how often')
    assert str(often.prior) == 'half-normal, 0 + 2'
    (velocity,) = declared(LearntTerm.from_yaml(SET)).parameters
    assert velocity.low == -3.0


@pytest.mark.parametrize(
    ('text', 'right', 'wrong', 'why'),
    [
        (LATE, 's*tau', 's*tau*t/s', 'and t is in it'),
        (LATE, 's*tau', 'tau', 'needs s'),
        (SET, 'A*t/t_end', 'A*(t/t_end)**2', 'evenly'),
        (SET, '"2*A"', '"2*A*L"', 'term.to_port'),
        (SET, 'channel: water', 'channel: air', 'cannot be simulated'),
        (SET, 'prior: [normal, 0, 0.3], ', '', 'neither value nor prior'),
        (SET, '[normal, 0, 0.3]', '[log-normal, 0, 0.3]', 'without a size'),
        (SET, '[normal, 0, 0.3]', '[log-normal, 1, 300]', 'without a size'),
        (SET, '[normal, 0, 0.3]', '[wishful, 1, 3]', 'expected'),
        (SET, '[-3, 3]', '[-3, 0, 3]', 'expected two'),
        (SET, '[-3, 3]', '[-0.3, 3]', 'is likely'),
        (SET, '[normal, 0, 0.3]', '[normal, 5, 0.3]', 'is likely'),
        (SET, 'prior:', 'value: 4, prior:', 'is accepted'),
        (SET, 'to_port: "2*A"', 'to_port: "1e3*A"', 'in SI'),
        (LATE, '[half-normal, 0, 2]', '[half-normal, 1, 2]', 'begins at 0'),
        (LATE, 'value: 7, sd: 1,', 'value: 7, sd: 1e6,', 'in SI'),
        (FADING, 'value: 0.02', 'value: 2e6', 'in SI'),
        (WASHED, 'A*u*exp', 'A*exp', 'share of the speed that changes'),
        (FADING, 'valid: {t', 'to_port: "A", valid: {t', 'no direction'),
        (BALLAST, 'unit: N', 'unit: kg', 'is no kg'),
        (BALLAST, 'inertia, expression: "0.1', 'depth, expression: "0.1', r'also\[0\]'),
        (BALLAST, '*R_F"', '*R_F*exp(50*t*t)"', r'also\[1\]'),
    ],
)
def test_what_a_channel_cannot_do_is_refused(text: str, right: str, wrong: str, why: str) -> None:
    assert right in text
    with pytest.raises(EffectFileError, match=why):
        LearntTerm.from_yaml(text.replace(right, wrong))


@pytest.mark.parametrize('text', [WEED, FADING, TURNED, WASHED, SANDED, GROWN, LATE, SET, BALLAST])
def test_a_term_survives_its_own_text_and_a_process(text: str) -> None:
    term = LearntTerm.from_yaml(text)
    assert LearntTerm.from_yaml(term.to_yaml()) == term
    assert pickle.loads(pickle.dumps(declared(term))).act(
        Frame(Ship.example(), Scenario(speed_m_s=6.0), 0.0), 0.001, 0.1
    )


WRONG_FORMULAS = (
    '0.5*rho*A*L**2*u**2*u_c*v',
    '0.5*A*L**2*u**2*u_c',
    'A*u_c',
    'rho*g*nabla*A',
    'rho*g*nabla*A/(u_c*sqrt(g*L) - u)*u',
    'rho*g*nabla*A/(u - 3*u_c/u_c*sqrt(g*L)/sqrt(g*L)*u/u)',
    'rho*g*nabla*A*exp(u*u_c)',
    'rho*g*nabla*A*step(u - u_c*sqrt(g*L), 0*u)',
    'rho*g*nabla*A*step(u - u_c*sqrt(g*L), u - u)',
    'rho*g*nabla*A*sqrt(u_c - 0.5)*u/u',
    'rho*g*nabla*A*u_c*t',
    'rho*g*nabla*A*u_c*cos(psi)',
    'rho*g*nabla*A*u_c*exp(50*u/sqrt(g*L)*50)',
    'rho*g*nabla*A*u_c**(u/sqrt(g*L)*0 - 500)*u/u',
    '__import__("os").system("touch /tmp/x")*A*u_c',
    '9**9**9**9*A*u_c',
    '(' * 190 + 'A' + ')' * 190,  # more of it: test_expression.py
)
WRONG: dict[str, tuple[Any, ...]] = {
    'name': ('', 'Weed', '../weed', 'a b', 'fouling', 'x' * 61, 7, None, ['a'], 'weed\n',
             '__init__'),
    'term.channel': ('thrust', 'water', 'ground', 'inertia', '', 1, None),
    'term.scope': ('world', '', 0, None, 'Hull'),
    'term.variable': ('depth', 'date', 'wind', 'shaft', 'mood', '', 3, None, 'time', 'heading'),
    'term.shape': ('wiggle', '', None, 5),
    'term.valid': ({}, {'u': [7.9, 1.1]}, {'u': [1.1]}, {'u': [1.0, 2.0, 3.0]}, {'v': [0, 1]},
                   {'u': [-1, 3]}, {'u': [0, math.inf]}, {'u': [0, math.nan]}, {'u': 'all'},
                   [0, 1], None, {'u': [0, 1e9]}, {'u': [True, 2]}),
    'term.expression': WRONG_FORMULAS,
    'parameters.A.value': (math.nan, math.inf, -math.inf, 1e300, 10**400, '1', True, None, [1]),
    'parameters.A.sd': (-1.0, math.nan, math.inf, '0', None, 1e300),
    'parameters.A.unit': ('m', 'kg', 'parsec', '', 2, True, None, 's'),
    'parameters.u_c.value': (math.nan, '0.1', None, 1e300),
    'parameters.u_c.unit': ('m/s', 'm2', 'N', 'x'),
    'parameters': ({}, None, [], 'A', {'A': {'value': 1, 'sd': 0}}, {'rho': {'value': 1, 'sd': 0}},
                   {f'p{k}': {'value': 1, 'sd': 0} for k in range(7)}),
    'covariance': ([[1.0]], [[1, 2], [3, 4]], [[1, 2, 3], [1, 2, 3]], 'x', [[-1, 0], [0, 1]],
                   [[1, 9], [9, 1]], [[math.nan, 0], [0, 1]], [[1, 0]]),
    'looks_like': ('all', [1], ['x' * 200], 3),
    'parameters.A.prior': ('normal', ['normal'], ['normal', 0, 0], ['flat', 0, 1],
                           ['log-normal', 1, 99], ['uniform', 2, 1], [['normal'], 0, 1],
                           ['normal', math.nan, 1], ['normal', 0, '1'], {}, 1),
    'parameters.A.bounds': ([1], [2, 1], [0, 1, 2], 'any', [0, math.inf], 1),
    'parameters.A.counted_in': ('furlongs', '', 1, 'draught'),
    'parameters.A.meaning': (1, None, ['x']),
    'term.to_port': ('A', 1, '__import__("os")'),
    'also': (7 * [{'channel': 'force', 'expression': '0.5*rho*A*L**2*u**2'}],
             'force', [1], [{}], [{'channel': 'force'}], [{'channel': 'x', 'expression': 'A'}],
             [{'channel': 'depth', 'expression': 'A'}], {'channel': 'log', 'expression': 'A'},
             [{'channel': 'log', 'expression': 'A', 'to_port': 'A'}],
             [{'channel': 'ground', 'expression': 'open("/etc/passwd")'}]),
    'limits': ({'z': {'upper_95': 1}}, {'A': 1}, {'A': {'upper_95': math.inf}}, [1]),
    'evidence': ({}, {'runs': 1}, 'much', {'runs': [], 'over_nothing': math.nan, 'over_smooth': 1,
                 'halves_agree': True, 'held_out_gap_cut': 0.5},
                 {'runs': [], 'over_nothing': 1, 'over_smooth': 1, 'halves_agree': 'yes',
                  'held_out_gap_cut': 0.5},
                 {'runs': [], 'over_nothing': 1, 'over_smooth': 1, 'halves_agree': True,
                  'held_out_gap_cut': 2.0}),
}  # fmt: skip


def cases() -> Iterator[tuple[str, Any]]:
    """Yield keys, each with a value that must not pass; then keys that are missing."""
    for key, values in WRONG.items():
        yield from ((key, value) for value in values)


HOSTILE_TEXTS = (
    '', 'null', '[]', '7', 'a: [', '\t', '!!python/object/apply:os.system ["true"]',
    'a: &x [1]\nb: *x', '%YAML 9.9\n---\n{}', '---\na: 1\n---\nb: 2', '{' * 500, '- ' * 5000,
    'a: 1\na: 2', 'x' * 2_000_000, '\x00', 'name: weed\nname: weed',
    '!!binary "aGVsbG8="', '!!set {a, b}', '? [a]\n: b', 'name: !!str weed',
)  # fmt: skip


def test_two_hundred_wrong_files_are_refused() -> None:
    count = 0
    for key, value in cases():
        whole: Any = copy.deepcopy(plain(WEED))
        *path, last = key.split('.')
        place = whole
        for part in path:
            place = place[part]
        place[last] = value
        refused(whole)
        count += 1
        # an unknown key beside it, or nothing at all in its place
        place[last + 'x'] = place.pop(last)
        refused(whole)
        count += 1
    for text in HOSTILE_TEXTS:
        with pytest.raises(EffectFileError):
            LearntTerm.from_yaml(text)
        count += 1
    assert count >= 200


def test_nothing_is_executed(tmp_path: Path) -> None:
    mark = tmp_path / 'mark'
    for formula in (
        f'__import__("pathlib").Path("{mark}").touch()',
        f'open("{mark}", "w")',
        f'exec("open(\\"{mark}\\", \\"w\\")")',
    ):
        whole = plain(WEED)
        whole['term']['expression'] = formula
        refused(whole)
    assert not mark.exists()


PLAIN = st.recursive(
    st.one_of(st.none(), st.booleans(), st.floats(), st.integers(), st.text(max_size=20)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=6,
)


@given(
    key=st.sampled_from(
        ['name', 'term', 'also', 'parameters', 'covariance', 'evidence', 'limits']
    ),
    value=PLAIN,
)
@settings(max_examples=200, deadline=None)
def test_any_value_of_a_key_passes_or_is_a_plain_error(key: str, value: Any) -> None:
    import io

    whole = plain(WEED) | {key: value}
    stream = io.StringIO()
    YAML(typ='safe').dump(whole, stream)
    try:
        term = LearntTerm.from_yaml(stream.getvalue())
    except EffectFileError:
        return
    acting = effect_of(term).action(frame_of(Ship.example()), 0.001, 0.09)
    assert np.isfinite(acting.resistance_n(2.0))


def test_a_cut_or_turned_file_passes_or_is_a_plain_error() -> None:
    rng = np.random.default_rng(8)
    for _ in range(300):
        letters = list(WEED)
        for _ in range(int(rng.integers(1, 6))):
            letters[int(rng.integers(len(letters)))] = chr(int(rng.integers(32, 127)))
        text = ''.join(letters)[: int(rng.integers(50, len(letters) + 1))]
        try:
            LearntTerm.from_yaml(text)
        except EffectFileError:
            continue


WEED_FILE = Path(__file__).resolve().parents[2] / 'docs' / 'data' / 'effects' / 'weed.yaml'


def test_the_files_of_a_folder_are_in_the_library_for_a_while() -> None:
    terms = read_folders([WEED_FILE.parent])
    before = dict(LIBRARY)
    with using(terms):
        assert set(LIBRARY) - set(before) == {term.name for term in terms}
        with pytest.raises(EffectFileError, match='weed'), using(terms):
            pass
    assert dict(LIBRARY) == before


def test_a_folder_that_cannot_be_used_says_why(tmp_path: Path) -> None:
    with pytest.raises(EffectFileError, match='cannot be read'):
        read_folders([tmp_path / 'none'])
    with pytest.raises(EffectFileError, match=r'no \.yaml file'):
        read_folders([tmp_path])
    for name in 'ab':
        (tmp_path / f'{name}.yaml').write_text(WEED_FILE.read_text())
    with pytest.raises(EffectFileError, match='that of another'):
        read_folders([tmp_path])
    (tmp_path / 'b.yaml').write_text('name: fouling')
    with pytest.raises(EffectFileError, match=r'b\.yaml'):
        read_folders([tmp_path])


def test_every_bad_file_of_a_folder_is_told(tmp_path: Path) -> None:
    (tmp_path / 'a.yaml').write_text(WEED_FILE.read_text().replace('name: weed', 'name: fouling'))
    (tmp_path / 'b.yaml').write_text('{')
    (tmp_path / 'c.yaml').write_text(WEED_FILE.read_text().replace('u_c*sqrt(g*L)', 'u_c'))
    with pytest.raises(EffectFileError) as told:
        read_folders([tmp_path, tmp_path / 'none'])
    places = ('b.yaml: ', 'none: cannot be read', 'a.yaml: name', 'c.yaml: term.expression')
    assert len(told.value.problems) == len(places)
    assert all(place in why for place, why in zip(places, told.value.problems, strict=True))


@pytest.mark.parametrize('count', [2, 201])
def test_a_ship_file_and_a_folder_refuse_the_same_in_the_same_words(count: int, tmp_path) -> None:
    texts = [WEED_FILE.read_text().replace('name: weed', 'name: fouling')] * 2
    if count > 2:
        texts = [
            WEED_FILE.read_text().replace('name: weed', f'name: weed_{i}') for i in range(count)
        ]
    for i, text in enumerate(texts):
        (tmp_path / f'{i:03d}.yaml').write_text(text)
    terms = tuple(LearntTerm.load(WEED_FILE) for _ in texts)
    whole = replace(Ship.example(), learnt=terms).to_yaml()
    for text in texts:
        name = text.partition('name: ')[2].partition('\n')[0]
        whole = whole.replace('name: weed\n', f'name: {name}\n', 1)
    with pytest.raises(EffectFileError) as by_folder:
        read_folders([tmp_path])
    with pytest.raises(ShipFileError) as by_ship:
        Ship.from_yaml(whole, subject='ship')
    found = [
        [problem.partition(start)[2] or problem for problem in told.value.problems]
        for told, start in ((by_folder, '.yaml: '), (by_ship, '].'))
    ]
    assert found[0] == found[1]
    assert ('at most 200' if count > 2 else 'effect of the library') in found[0][0]
