# SPDX-License-Identifier: Apache-2.0
"""The doors that a stranger uses first: each says all that must be known, and shows an example."""

from __future__ import annotations

import doctest
import importlib
import inspect
import re
from typing import Any

import pytest

import shipdrag_ros

DOORS = (
    ('ship.model', 'Ship.load'),
    ('ship.model', 'Ship.from_yaml'),
    ('samples', 'Block.of'),
    ('parameters', 'Parameters.from_mapping'),
    ('studies.s1.motion', 'OrthogonalBasis.on'),
    ('studies.least_squares', 'least_squares'),
    ('studies.surface.fit', 'fit_surface'),
    ('simulation.surge', 'simulate'),
    ('simulation.sensors', 'sense'),
    ('studies.cable.drag', 'Cable'),
    ('studies.cable.drag', 'tangent_range'),
    ('studies.manoeuvring', 'steer'),
    ('studies.sensitivity.loss', 'vary'),
    ('messages.encoding', 'encode'),
    ('messages.decoding', 'decode'),
    ('estimation.window', 'Window.from_block'),
    ('estimation.choice', 'estimate'),
    ('estimation.choice', 'estimate_final'),
    ('coastdown.monitor', 'Monitor'),
    ('diagnosis.diagnose', 'diagnose'),
    ('library.record', 'read'),
    ('library.record', 'Record'),
    ('library.record', 'Coastdown'),
    ('library.record', 'Resistance'),
    ('library.record', 'estimate'),
    ('library.diagnosis', 'Diagnosis'),
    ('library.diagnosis', 'diagnose'),
    ('library.diagnosis', 'learn'),
    ('library.simulated', 'simulate'),
    ('library.trends', 'Trends'),
    ('library.trends', 'trends'),
)
# exported too, and described where their fields are declared
MORE = (('ship.model', 'Ship'), ('parameters', 'Parameters'), ('errors', 'ShipdragError'))


SHAPES = ('Float64', 'ArrayLike', 'Int64')
SILENT = {'coastdown.monitor'}  # raises nothing, and says so in its notes


def opened(room: str, door: str) -> Any:
    """Return what a door is."""
    target: Any = importlib.import_module(f'shipdrag_ros.{room}')
    for part in door.split('.'):
        target = getattr(target, part)
    return target


def sections(doc: str) -> dict[str, str]:
    """Return the numpydoc sections of a docstring."""
    parts = re.split(r'^(\w+)\n-+$', doc, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def described(text: str) -> dict[str, tuple[str, str]]:
    """Return type and description of each argument of a section."""
    found: dict[str, tuple[str, str]] = {}
    for names, kind, about in re.findall(
        r'^(\w+(?:, \w+)*)(?: : ([^\n]*))?\n((?:(?:    [^\n]*)?\n)*)', text + '\n', re.MULTILINE
    ):
        found |= {name: (kind, ' '.join(about.split())) for name in names.split(', ')}
    return found


@pytest.mark.parametrize(('room', 'door'), DOORS)
def test_says_all_that_must_be_known(room: str, door: str) -> None:
    target = opened(room, door)
    found = sections(inspect.getdoc(target) or '')
    told = described(found.get('Parameters') or found['Attributes'])
    known = inspect.signature(target).parameters
    assert set(told) == set(known) - {'self'}
    for name, (kind, about) in told.items():
        assert about or kind, f'{name}: nothing is said of it'
        annotation = str(known[name].annotation)
        if any(shape in annotation for shape in SHAPES):
            assert kind.startswith(('(', 'scalar')), f'{name}: no shape'
        if re.match(r"'?(float|int)\b", annotation) and re.search(r'_(m|s|ns|rad|kg)(_|$)', name):
            assert about, f'{name}: nothing is said of it'
    if not inspect.isclass(target):
        assert 'Returns' in found
    assert 'Raises' in found or room in SILENT
    # where it comes from
    assert re.search(r'Source|S[1-5]\b|WGS84|CDR|m du/dt|Variances', found['Notes'])


def test_every_exported_name_is_a_door() -> None:
    assert {id(getattr(shipdrag_ros, name)) for name in shipdrag_ros.__all__} <= {
        id(opened(*each)) for each in (*DOORS, *MORE)
    }


@pytest.mark.parametrize(('room', 'door'), DOORS + MORE)
def test_shows_an_example_that_runs(room: str, door: str) -> None:
    module = importlib.import_module(f'shipdrag_ros.{room}')
    target = opened(room, door)
    # its own docstring, not those of its methods
    examples = doctest.DocTestParser().get_doctest(
        target.__doc__ or '', {}, f'{room}.{door}', module.__file__, None
    )
    assert examples.examples
    said: list[str] = []
    doctest.DocTestRunner(verbose=False).run(examples, out=said.append)
    assert not said, ''.join(said)
