# SPDX-License-Identifier: Apache-2.0
"""The doors that a stranger uses first: each shows an example, and it runs."""

from __future__ import annotations

import doctest
import importlib

import pytest

DOORS = (
    ('ship.model', 'Ship.load'),
    ('ship.model', 'Ship.from_yaml'),
    ('samples', 'Block.of'),
    ('parameters', 'Parameters.from_mapping'),
    ('regression.orthogonal', 'OrthogonalBasis.on'),
    ('regression.least_squares', 'least_squares'),
    ('regression.surface', 'fit_surface'),
    ('simulation.surge', 'simulate'),
    ('simulation.sensors', 'sense'),
    ('studies.cable.drag', 'Cable'),
    ('studies.cable.drag', 'tangent_range'),
    ('studies.manoeuvring.simulate', 'steer'),
    ('studies.sensitivity.loss', 'vary'),
    ('messages.encoding', 'encode'),
    ('messages.decoding', 'decode'),
    ('estimation.window', 'Window.from_block'),
    ('estimation.choice', 'estimate'),
    ('estimation.final', 'estimate_final'),
    ('coastdown.monitor', 'Monitor'),
    ('diagnosis.diagnose', 'diagnose'),
)


@pytest.mark.parametrize(('room', 'door'), DOORS)
def test_shows_an_example_that_runs(room: str, door: str) -> None:
    module = importlib.import_module(f'shipdrag_ros.{room}')
    target = module
    for part in door.split('.'):
        target = getattr(target, part)
    # its own docstring, not those of its methods
    examples = doctest.DocTestParser().get_doctest(
        target.__doc__ or '', {}, f'{room}.{door}', module.__file__, None
    )
    assert examples.examples
    said: list[str] = []
    doctest.DocTestRunner().run(examples, out=said.append)
    assert not said, ''.join(said)
