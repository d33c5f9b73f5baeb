# SPDX-License-Identifier: Apache-2.0
"""
Which derivatives of a steered ship matter, and which manoeuvre shows each.

Speeds are made pure numbers by the ship's speed, the yaw rate by speed over
length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from shipdrag_ros.samples import Float64
from shipdrag_ros.studies.manoeuvring import (
    FORM,
    Manoeuvre,
    Motions,
    SteeredShip,
    overshoots_rad,
    steer,
    turn,
    zigzag,
)
from shipdrag_ros.studies.sensitivity.loss import (
    CHANGES,
    Losses,
    Norm,
    Responses,
    Selection,
    partial_contribution,
    vary,
)

CHECKED_BY = zigzag(25.0)
CONTROL_S = 0.1  # between two looks of the helmsman in that check
APPROACH_S = 10.0  # with the rudder amidships before it
DESIGN = (
    *(zigzag(angle) for angle in (5.0, 10.0, 15.0, 20.0, 25.0, 35.0)),
    *(turn(angle) for angle in (10.0, 20.0, 35.0)),
)


@dataclass(frozen=True)
class Observations:
    """
    What S3 says of its losses, of ours; medians over the parameters.

    Attributes
    ----------
    unlike
        By how much the losses of + and - differ, relative: of 10 and of 50
        per cent.
    growth
        Loss of 50 over that of 10 per cent.
    """

    unlike: tuple[float, float]
    growth: float

    @classmethod
    def of(cls, losses: Losses) -> Observations:
        """
        Look at the losses of `CHANGES`.
        """
        table = losses.table
        unlike = np.abs(table[:, ::2] / table[:, 1::2] - 1.0)
        growth = table[:, 2:].mean(axis=1) / table[:, :2].mean(axis=1)
        small, large = np.nanmedian(unlike, axis=0).tolist()
        return cls((small, large), float(np.nanmedian(growth)))


@dataclass(frozen=True)
class ReducedModelCheck:
    """
    `CHECKED_BY` of the full and of a reduced model.

    Attributes
    ----------
    full, reduced
        Their motions.
    """

    full: Motions
    reduced: Motions

    @property
    def overshoots_rad(self) -> tuple[Float64, Float64]:
        """First and second, of the full and of the reduced model; fewer where there are fewer."""
        full, reduced = (overshoots_rad(one, CHECKED_BY)[:2] for one in (self.full, self.reduced))
        return full, reduced

    @property
    def rms_difference(self) -> dict[str, float]:
        """Root mean square over the manoeuvre, by quantity; not finite where a model is lost."""
        names = ('surge_m_s', 'sway_m_s', 'yaw_rate_rad_s', 'heading_rad')
        speeds = self.full.speeds - self.reduced.speeds
        apart = np.column_stack([speeds, self.full.heading_rad - self.reduced.heading_rad])
        return dict(zip(names, np.sqrt(np.mean(apart**2, axis=0)).tolist()))


@dataclass(frozen=True)
class SteeringStudy:
    """
    S3's analysis of one ship.

    Attributes
    ----------
    ship
    manoeuvre
        That the losses are of.
    losses, mean_norms
        By the two norms.
    selection
        By the root mean square.
    check
        Of the derivatives that are kept.
    group_derivatives
        Those of as many measurements as the kept ones hold, chosen where derivatives that are
        one measurement change together.
    group_check
        Of these.
    """

    ship: SteeredShip
    manoeuvre: Manoeuvre
    losses: Losses
    mean_norms: Losses
    selection: Selection
    check: ReducedModelCheck
    group_derivatives: tuple[str, ...]
    group_check: ReducedModelCheck

    def to_dict(self) -> dict[str, Any]:
        """
        Return the document of the analysis, as JSON has it.
        """
        full, reduced = self.check.overshoots_rad
        return {
            'manoeuvre': self.manoeuvre.name,
            'loss': self.losses.to_dict(),
            **asdict(self.selection),
            'check': {
                'manoeuvre': CHECKED_BY.name,
                'overshoot_full_deg': np.degrees(full),
                'overshoot_reduced_deg': np.degrees(reduced),
                'rms_difference': self.check.rms_difference,
            },
            'mean_norm': self.mean_norms.to_dict(),
            'independent': self.independent,
            'multiples': self.ship.multiples,
        }

    @property
    def independent(self) -> int:
        """How many measurements the kept derivatives hold."""
        return _independent(self.ship, self.selection.kept)

    @property
    def norms_agree(self) -> bool:
        """Whether both norms keep the same derivatives."""
        kept = self.selection.kept
        return set(kept) == set(self.mean_norms.select(len(kept)).kept)


@dataclass(frozen=True)
class Experiment:
    """
    What each manoeuvre shows of each derivative.

    Attributes
    ----------
    names
        Of the p derivatives.
    manoeuvres
        m of them.
    loss : (p, m)
        Of 10 per cent, root mean square.
    partial_contribution : (p, m)
        Part of it that is orthogonal to the responses of all others.
    partial_contribution_together : (p,)
        The same where all manoeuvres are made.
    """

    names: tuple[str, ...]
    manoeuvres: tuple[Manoeuvre, ...]
    loss: Float64
    partial_contribution: Float64
    partial_contribution_together: Float64

    def to_dict(self) -> dict[str, dict[str, float]]:
        """
        Return the loss of each derivative in each manoeuvre, by their names.
        """
        manoeuvres = [each.name for each in self.manoeuvres]
        return {
            name: dict(zip(manoeuvres, row)) for name, row in zip(self.names, self.loss.tolist())
        }

    @property
    def best(self) -> tuple[Manoeuvre, ...]:
        """The manoeuvre that shows most of each derivative."""
        return tuple(self.manoeuvres[i] for i in np.argmax(self.loss, axis=1))


def respond(
    ship: SteeredShip,
    manoeuvre: Manoeuvre,
    *,
    together: bool = False,
    changes: Sequence[float] = CHANGES,
    control_s: float = 0.0,
) -> Responses:
    """
    Change each derivative by fractions of it; u, v and r are pure numbers.

    Parameters
    ----------
    together
        Whether derivatives that are one measurement change together, under the name of the first.
    control_s
        As in `steer`. A helmsman who looks now and then reverses a whole look
        earlier or later after the smallest change, which hides it; hence he
        reverses at the very moment by default.
    """
    groups = ship.groups if together else tuple((name,) for name in FORM)
    place = [next(i for i, group in enumerate(groups) if name in group) for name in FORM]
    scale = np.array([1.0, 1.0, 1.0 / ship.length_m]) * ship.speed_m_s

    def simulate(factors: Float64) -> Float64:
        derivatives = ship.values * factors[:, place]
        return steer(ship, manoeuvre, derivatives, control_s=control_s).speeds / scale

    names = [group[0] for group in groups]
    return vary(simulate, names, np.ones(len(names)), np.tile(changes, (len(names), 1)))


def check(ship: SteeredShip, kept: Sequence[str]) -> ReducedModelCheck:
    """
    Sail a zigzag without the derivatives that are not kept.

    The helmsman looks every `CONTROL_S` after an approach of `APPROACH_S`, as in
    published figures.
    """
    reduced = np.where([name in kept for name in FORM], ship.values, 0.0)
    sets = np.array([ship.values, reduced])
    both = steer(ship, CHECKED_BY, sets, control_s=CONTROL_S, approach_s=APPROACH_S)
    return ReducedModelCheck(both[0], both[1])


def study(ship: SteeredShip, manoeuvre: Manoeuvre, *, keep: int) -> SteeringStudy:
    """
    Find which derivatives matter, and try the model without the others.

    Parameters
    ----------
    ship
    manoeuvre
        S3: a 15/15 zigzag.
    keep
        How many derivatives; S3: 24.

    Raises
    ------
    SensitivityError
        If there are not so many.
    """
    responses = respond(ship, manoeuvre)
    losses = responses.losses()
    selection = losses.select(keep)
    measured = respond(ship, manoeuvre, together=True).losses()
    firsts = measured.select(_independent(ship, selection.kept)).kept
    derivatives = tuple(name for group in ship.groups if group[0] in firsts for name in group)
    return SteeringStudy(
        ship=ship,
        manoeuvre=manoeuvre,
        losses=losses,
        mean_norms=responses.losses(Norm.MEAN_NORM),
        selection=selection,
        check=check(ship, selection.kept),
        group_derivatives=derivatives,
        group_check=check(ship, derivatives),
    )


def experiment(ship: SteeredShip, manoeuvres: Sequence[Manoeuvre] = DESIGN) -> Experiment:
    """
    Find which manoeuvre makes which derivative visible.
    """
    changes = (*CHANGES[:2], 1e-3, -1e-3)  # tiny: what is not linear would look like no other
    responses = [respond(ship, manoeuvre, changes=changes) for manoeuvre in manoeuvres]
    slopes = [one.slopes(2, 3) for one in responses]
    return Experiment(
        FORM,
        tuple(manoeuvres),
        np.column_stack([one.losses().table[:, :2].mean(axis=1) for one in responses]),
        np.column_stack([partial_contribution(one) for one in slopes]),
        partial_contribution(np.hstack(slopes)),
    )


def _independent(ship: SteeredShip, kept: Sequence[str]) -> int:
    return len({ship.multiples.get(name, name) for name in kept})
