# SPDX-License-Identifier: Apache-2.0
"""A figure becomes part of a page or a file, the same from the same data."""

from __future__ import annotations

import base64

import pytest
from matplotlib.figure import Figure

from shipdrag_ros.estimation import pictures
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.report import drawing


@pytest.mark.parametrize('name', ['picture.svg', 'picture.png'])
def test_a_picture_is_saved_as_its_name_says(estimate: Estimate, tmp_path, name: str) -> None:
    drawing.save(pictures.order_picture(estimate), tmp_path / name)
    head = (tmp_path / name).read_bytes()[:100]
    assert head.startswith(b'\x89PNG') if name.endswith('png') else b'<?xml' in head


def test_the_same_data_give_the_same_bytes(estimate: Estimate) -> None:
    first, second = (drawing.data_uri(pictures.order_picture(estimate)) for _ in range(2))
    assert first == second
    kind, data = first.split(',', 1)
    assert kind == 'data:image/svg+xml;base64'
    assert b'</svg>' in base64.b64decode(data)


@pytest.mark.parametrize(('width', 'wide'), [(drawing.SIZE[0], False), (7.2, False), (9.0, True)])
def test_a_picture_much_wider_than_others_takes_the_page_for_itself(width, wide):
    assert drawing.picture(Figure(figsize=(width, 3.0)), 'caption').wide == wide
