# SPDX-License-Identifier: Apache-2.0
"""Imports without the collector of garbage, which goes on afterwards as before."""

from __future__ import annotations

import gc
from importlib import import_module

import pytest

from shipdrag_ros.imports import uncollected


def test_it_is_off_inside_and_on_afterwards_whatever_happens() -> None:
    assert gc.isenabled()
    with uncollected():
        assert not gc.isenabled()
    assert gc.isenabled()
    with pytest.raises(ModuleNotFoundError), uncollected():
        import_module('no_such_module')
    assert gc.isenabled()


def test_who_had_it_off_keeps_it_off() -> None:
    gc.disable()
    try:
        with uncollected():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
