# SPDX-License-Identifier: Apache-2.0
"""What belongs to one run alone: a `run.yaml` beside its bag, which overrides the ship file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shipdrag_ros.errors import ShipFileError
from shipdrag_ros.fields import declare, keys_of, number, parse, read_keys, section, text_of
from shipdrag_ros.ship.facts import Fact, fact_list, overriding
from shipdrag_ros.ship.model import Ship, inconsistencies

_FRESH, _SEA = 999.0, 1026.0  # kg/m^3 at 15 degrees


@dataclass(frozen=True)
class RunWater:
    """
    The water of one run.
    """

    temperature_c: float | None = declare(
        number(-2.0, 40.0, 'degC'), 'temperature, from which the viscosity follows', default=None
    )
    density_kg_m3: float | None = declare(number(900.0, 1100.0, 'kg/m^3'), 'density', default=None)
    density: float | None = declare(
        number(900.0, 1100.0, 'kg/m^3'), 'the same in other words', default=None
    )


@dataclass(frozen=True)
class RunSheet:
    """
    One run, where it differs from the ship file.

    `load` and `from_yaml` check every value; constructing one directly does not.
    """

    facts: tuple[Fact, ...] = declare(fact_list(), 'what a log book knows of it', default=())
    draught_m: float | None = declare(number(0.01, 40.0, 'm'), 'draught', default=None)
    displaced_volume_m3: float | None = declare(
        number(1e-4, 1e6, 'm^3'), 'displaced volume', default=None
    )
    water: RunWater | None = declare(section(RunWater), 'the water', default=None)

    @property
    def temperature_c(self) -> float | None:
        """Temperature of the water [degC]; None where it is not stated."""
        return None if self.water is None else self.water.temperature_c

    @classmethod
    def load(cls, path: Path) -> RunSheet:
        """
        Read a file.

        Raises
        ------
        ShipFileError
            Naming every problem of the file at once.
        """
        content = text_of(path, what='a run file', error=ShipFileError)
        return cls.from_yaml(content, subject=str(path))

    @classmethod
    def from_yaml(cls, content: str, *, subject: str) -> RunSheet:
        """
        Read a text; `subject` names it in errors.

        Raises
        ------
        ShipFileError
            Naming every problem of the text at once.
        """
        data = parse(content, subject=subject, error=ShipFileError)
        problems: list[str] = []
        accepted = read_keys(keys_of(cls), data, '', problems)
        water = accepted.get('water')
        if water and water.density is not None and water.density_kg_m3 is not None:
            problems.append('water: density and density_kg_m3 are the same; keep one')
        if problems:
            raise ShipFileError(subject, problems)
        return cls(**accepted)

    def of(self, ship: Ship, *, subject: str, facts: Sequence[Fact] = ()) -> Ship:
        """
        Return the ship as she was in the run, with what is known of it.

        Parameters
        ----------
        ship
            As her file states her; the resistance coefficients stay hers.
        subject
            Names the run in errors.
        facts
            Of all runs, which override those of the ship and of the run.

        Raises
        ------
        ShipFileError
            If what is overridden does not fit the rest of the ship file.
        """
        water = ship.water
        if self.water is not None:
            density = self.water.density_kg_m3 or self.water.density or ship.water.density_kg_m3
            viscosity = ship.water.kinematic_viscosity_m2_s
            if self.water.temperature_c is not None:
                viscosity = kinematic_viscosity(self.water.temperature_c, density)
            water = replace(ship.water, density_kg_m3=density, kinematic_viscosity_m2_s=viscosity)
        changed = replace(
            ship,
            draught_m=self.draught_m or ship.draught_m,
            displaced_volume_m3=self.displaced_volume_m3 or ship.displaced_volume_m3,
            water=water,
            facts=overriding(ship.facts, self.facts, facts),
        )
        problems = list(inconsistencies({name: getattr(changed, name) for name in keys_of(Ship)}))
        if problems:
            raise ShipFileError(subject, problems)
        return changed


def kinematic_viscosity(temperature_c: float, density_kg_m3: float) -> float:
    """
    Return the kinematic viscosity of water [m^2/s].

    Parameters
    ----------
    temperature_c
        Of the water [degC].
    density_kg_m3
        From that of fresh water to that of the sea: how salt it is.

    Returns
    -------
    float
        Between fresh and sea water by the density.

    Notes
    -----
    The formulas of the ITTC 1978 performance prediction method for fresh and for
    sea water; within 2 % of ITTC 7.5-02-01-03 from 0 to 30 degrees.
    """
    fresh = (0.000585 * (temperature_c - 12.0) - 0.03361) * (temperature_c - 12.0) + 1.2350
    sea = (0.000659 * (temperature_c - 1.0) - 0.05076) * (temperature_c - 1.0) + 1.7688
    return 1e-6 * float(np.interp(density_kg_m3, (_FRESH, _SEA), (fresh, sea)))
