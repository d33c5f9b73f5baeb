# SPDX-License-Identifier: Apache-2.0
"""`shipdrag effect`, and learnt effects in `simulate` and `diagnose`."""

from __future__ import annotations

import json
import math
import shutil
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

import shipdrag_ros as sd
from shipdrag_ros import strict_yaml
from shipdrag_ros.bags.run import open_runs
from shipdrag_ros.cli import main
from shipdrag_ros.errors import EffectFileError, SimulationError
from shipdrag_ros.fleet.store import read_coastdowns
from shipdrag_ros.ship import LearntTerm, Ship
from shipdrag_ros.simulation import Scenario, simulate
from shipdrag_ros.simulation.effects import LIBRARY, carrying, declared, effects_of, parse, using

ROOT = Path(__file__).resolve().parents[2]
WEED = ROOT / 'docs' / 'data' / 'effects' / 'weed.yaml'
SHIP = ROOT / 'config' / 'vitus_bering.yaml'
EFFECTS = ['--effects', str(WEED.parent)]


def test_a_sound_file_can_be_used(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['effect', 'check', str(WEED), '--json']) == 0
    document = json.loads(capsys.readouterr().out)
    assert document['effects'][0]['name'] == 'weed'


def test_all_files_are_reported_whichever_is_bad(tmp_path, capsys) -> None:
    bad, empty = tmp_path / 'bad.yaml', tmp_path / 'none.yaml'
    bad.write_text(WEED.read_text().replace('unit: 1', 'unit: m', 1))
    assert main(['effect', 'check', str(bad), str(empty), str(WEED), '--json']) == 1
    told = capsys.readouterr()
    document = json.loads(told.out)
    assert [each['name'] for each in document['effects']] == ['weed']
    assert len(document['refused']) == 2
    assert 'bad.yaml: term.expression' in told.err
    assert 'none.yaml: cannot be read' in told.err


_SIZES = st.one_of(
    st.just(0.0),
    st.tuples(st.sampled_from([1.0, -1.0]), st.floats(-9.0, 8.0)).map(lambda x: x[0] * 10 ** x[1]),
)
_PARAMETERS = st.fixed_dictionaries(
    {},
    optional={
        'value': _SIZES,
        'sd': _SIZES.map(abs),
        'prior': st.tuples(
            st.sampled_from(['normal', 'half-normal', 'log-normal', 'either-sign', 'uniform']),
            st.one_of(st.just(0.0), st.floats(-2.0, 2.0), _SIZES),
            st.one_of(st.floats(0.1, 3.0), _SIZES),
        ).map(list),
        'bounds': st.one_of(st.just([-9.0, 9.0]), st.lists(_SIZES, min_size=2, max_size=2)),
    },
)
_ACTING = (
    ('force', 'speed', '0.5*rho*A*nabla**(2/3)*u**2'),
    ('force', 'speed', 'A*R_F*step(b*sqrt(g*L) - u, 0.03*sqrt(g*L))'),
    ('force', 'time', '0.5*rho*A*nabla**(2/3)*u**2*exp(-t/(b*sqrt(L/g)))'),
    ('water', 'time', 'A*sqrt(g*L)*t/t_end'),
    ('air', 'speed', 'A*sqrt(g*L)'),
    ('log', 'speed', 'A'),
    ('log', 'time', 'A*u*exp(-t/(b*sqrt(L/g)))'),
    ('ground', 'speed', 'A'),
    ('inertia', 'speed', 'A*rho*nabla'),
    ('clock', 'speed', 'A*sqrt(L/g)'),
    ('filter', 'speed', 'A*sqrt(L/g)'),
    ('shaft', 'speed', 'A*sqrt(g*L)'),
    ('depth', 'speed', 'A*L'),
)


@pytest.fixture(scope='module')
def record() -> sd.Record:
    return sd.simulate(Ship.example(), duration_s=300.0, lead_in_s=400.0)


@pytest.mark.timeout(900)  # a busy machine
@given(
    acting=st.sampled_from(_ACTING),
    scope=st.sampled_from(['hull', 'earth', 'sensor', 'run']),
    parameters=st.tuples(_PARAMETERS, _PARAMETERS),
)
@settings(max_examples=4, deadline=None, suppress_health_check=list(HealthCheck))
def test_what_passes_is_taken_by_simulate_and_diagnose(record, acting, scope, parameters):
    channel, variable, expression = acting
    form = {'channel': channel, 'scope': scope, 'variable': variable, 'expression': expression}
    form |= {'shape': 'constant' if variable == 'speed' else 'ramp', 'valid': {}}
    form['valid'] = {'u': [0.5, 8.0], 't': [0.0, 3000.0]}
    named = {'A': parameters[0]} | ({'b': parameters[1]} if 'b*' in expression else {})
    text = strict_yaml.dump({'name': 'any', 'term': form, 'parameters': named})
    try:
        term = LearntTerm.from_yaml(text)
    except EffectFileError:
        reject()
    sizes = [
        repr(q.prior.at(0.0) or q.prior.at(1.0)) if math.isnan(q.value) else repr(q.value)
        for q in declared(term).parameters
    ]
    ship = Ship.example()
    scenario = Scenario(speed_m_s=6.0, duration_s=300.0, lead_in_s=60.0)
    with using([term]):
        with suppress(SimulationError):  # what nothing is wrong with may still be too much
            truth = simulate(ship, scenario, effects=[parse('any=' + ',b='.join(sizes))])
            assert np.isfinite(truth.speed_through_water_m_s).all()
        assert sd.diagnose(record, ship=ship).verdict


def test_a_name_that_is_taken_is_an_error_of_its_file(tmp_path, capsys) -> None:
    wrong = tmp_path / 'wrong.yaml'
    for name in ('fouling', 'none', 'unknown'):
        wrong.write_text(WEED.read_text().replace('name: weed', f'name: {name}'))
        assert main(['effect', 'check', str(wrong)]) == 1
        said = capsys.readouterr().err
        assert 'wrong.yaml' in said
        assert repr(name) in said


def test_the_list_shows_what_is_learnt(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['effect', 'list', '--effects', str(WEED.parent)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith('weed') and line.rstrip().endswith('learnt') for line in lines)
    assert any(line.startswith('fouling') for line in lines)


@pytest.fixture(scope='module')
def weedy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated run with weed, alone in a folder."""
    bag = tmp_path_factory.mktemp('bags') / 'weed.mcap'
    line = ['simulate', '--ship', str(SHIP), '-o', str(bag), '--effect', 'weed=0.002']
    line += ['--lead-in', '700', '--duration', '1200']
    assert main(line) == 1  # without the folder it is not known
    assert main([*line, *EFFECTS]) == 0
    return bag


def test_a_learnt_effect_is_named_and_written_into_the_ship_file(weedy, tmp_path, capsys):
    written = tmp_path / 'weedy.yaml'
    line = ['diagnose', str(weedy), '--json']
    assert main([*line, *EFFECTS, '--write', str(written)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document['verdict'] == 'named'
    (found,) = document['effects']
    assert found['name'] == 'weed'
    size = found['parameters']['A']
    assert abs(size['value'] - 0.002) < 3.0 * size['sd']
    # the file holds the term, so that no folder is needed from here on
    (term,) = Ship.load(written).learnt
    assert term == LearntTerm.load(WEED)
    assert main([*line, '--ship', str(written)]) == 0
    again = json.loads(capsys.readouterr().out)
    likeliest = again['candidates'][0]
    assert (likeliest['names'], again['effects']) == (['none'], [])
    assert likeliest['probability'] > 0.8
    again_bag = tmp_path / 'again.mcap'
    assert main(['simulate', '--ship', str(written), '-o', str(again_bag)]) == 0
    assert 'weed: A = ' in capsys.readouterr().out


def test_a_term_of_the_ship_file_may_be_simulated_without_a_folder(tmp_path, capsys) -> None:
    ship = tmp_path / 'ship.yaml'
    term = replace(LearntTerm.load(WEED), name='weed_of_her_own')  # no test before knows it
    ship.write_text(replace(Ship.load(SHIP), learnt=(term,)).to_yaml())
    line = ['simulate', '--ship', str(ship), '-o', str(tmp_path / 'a.mcap')]
    assert main([*line, '--effect', 'weed_of_her_own=0.002', '--duration', '60']) == 0
    assert 'weed_of_her_own: A = 0.002' in capsys.readouterr().out


def test_a_hostile_term_in_a_ship_file_is_an_error(tmp_path, capsys) -> None:
    mark, hostile = tmp_path / 'mark', tmp_path / 'ship.yaml'
    term = LearntTerm.load(WEED)
    ship = replace(Ship.load(SHIP), learnt=(term,)).to_yaml()
    hostile.write_text(ship.replace('0.5*rho', f"open('{mark}', 'w')*rho"))
    assert main(['simulate', '--ship', str(hostile), '-o', str(tmp_path / 'a.mcap')]) == 1
    said = capsys.readouterr().err
    assert 'learnt[0].term.expression' in said
    assert not mark.exists()
    hostile.write_text(ship.replace('name: weed', 'name: fouling'))
    assert main(['simulate', '--ship', str(hostile), '-o', str(tmp_path / 'a.mcap')]) == 1
    assert 'effect of the library' in capsys.readouterr().err


def test_the_terms_in_use_are_attached_to_a_recording(weedy: Path) -> None:
    attached = open_runs([weedy])[0].attachments
    assert LearntTerm.from_yaml(attached['effects/weed.yaml']) == LearntTerm.load(WEED)


def test_a_fleet_names_it_and_does_a_bag_again_for_it(weedy: Path, tmp_path, capsys) -> None:
    bags = tmp_path / 'bags'
    bags.mkdir()
    line = ['simulate', '--ship', str(SHIP), '-o', str(bags / 'steady.mcap'), '--lead-in', '60']
    assert main([*line, '--duration', '1']) == 0
    line = ['fleet', str(bags), '-o', str(tmp_path / 'store'), '--workers', '1', '--json']
    assert main(line) == 0
    shutil.copy(weedy, bags)
    named = []
    for _ in range(2):
        capsys.readouterr()
        assert main([*line, *EFFECTS]) == 0
        named.append(json.loads(capsys.readouterr().out)['new'])
    assert named == [2, 0]  # the steady one anew
    rows = read_coastdowns(tmp_path / 'store').to_pylist()
    assert {row['verdict'] for row in rows} == {'named'}
    assert all('weed' in str(row['effects']) for row in rows)


@pytest.mark.parametrize('verb', ['replay', 'forecast', 'watch', 'trend', 'poster', 'node'])
def test_every_verb_takes_a_folder_of_effects(verb: str, tmp_path, capsys) -> None:
    more = {'node': ['--ship', str(SHIP), '--out', str(tmp_path)]}.get(verb, ['none'])
    (tmp_path / 'bad.yaml').write_text('name: fouling')
    assert main([verb, *more, '--effects', str(tmp_path)]) == 1
    assert 'bad.yaml' in capsys.readouterr().err


def test_the_ship_of_another_process_carries_the_terms() -> None:
    ship = Ship.load(SHIP)
    with using([LearntTerm.load(WEED)]):
        carried = carrying(ship)
    assert carrying(ship) == ship
    assert Ship.from_yaml(carried.to_yaml(), subject='ship') == carried
    assert set(effects_of(carried)) - set(LIBRARY) == {'weed'}
