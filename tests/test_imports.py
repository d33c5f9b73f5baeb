# SPDX-License-Identifier: Apache-2.0
"""Imports without the collector of garbage, which goes on afterwards as before."""

from __future__ import annotations

import gc

import pytest

from shipdrag_ros.imports import uncollected


def fail(seen: list[bool]) -> None:
    with uncollected():
        seen.append(gc.isenabled())
        raise ImportError


def test_it_is_off_inside_and_on_afterwards_whatever_happens() -> None:
    assert gc.isenabled()
    seen: list[bool] = []
    with pytest.raises(ImportError):
        fail(seen)
    assert seen == [False]
    assert gc.isenabled()


def test_who_had_it_off_keeps_it_off() -> None:
    gc.disable()
    try:
        with uncollected():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
