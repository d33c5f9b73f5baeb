# SPDX-License-Identifier: Apache-2.0
"""
Which parameters of a simulator matter, by how far its motion moves with each.

Any simulator will do: it is given sets of parameters, and returns the motion of
each in numbers that may be compared with each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from shipdrag_ros.errors import SensitivityError
from shipdrag_ros.samples import Float64

CHANGES = (0.1, -0.1, 0.5, -0.5)  # of a parameter, relative
_COLUMNS = ('+10', '-10', '+50', '-50', '+sd', '-sd')  # of a table of losses
_ROUNDING = 1e-12


class Norm(StrEnum):
    """How a difference of motions is made one number; both of degree one."""

    ROOT_MEAN_SQUARE = 'root mean square'
    MEAN_NORM = 'mean norm'

    def of(self, differences: Float64) -> Float64:
        """
        Return the loss of differences (..., n, q).
        """
        squares = np.einsum('...q,...q->...', differences, differences)
        if self is Norm.ROOT_MEAN_SQUARE:
            return np.asarray(np.sqrt(np.mean(squares, axis=-1)))
        return np.asarray(np.mean(np.sqrt(squares), axis=-1))


@dataclass(frozen=True)
class Selection:
    """
    Parameters that are kept, most important first, and the others.

    Attributes
    ----------
    kept, dropped
        Names.
    threshold
        Of the mean loss: kept ones lie above it.
    """

    kept: tuple[str, ...]
    dropped: tuple[str, ...]
    threshold: float


@dataclass(frozen=True)
class Losses:
    """
    Loss of each change of each parameter.

    Attributes
    ----------
    names
        Of the p parameters.
    table : (p, c)
        NaN where a changed parameter cannot be simulated.
    """

    names: tuple[str, ...]
    table: Float64

    @property
    def mean(self) -> Float64:
        """Mean loss of each parameter (p,), over those of `CHANGES` that all of them bear."""
        table = self.table[:, : len(CHANGES)]
        common = np.isfinite(table).all(axis=0)
        if not common.any():
            return np.full(len(self.names), np.nan)
        return np.asarray(table[:, common].mean(axis=1))

    def to_dict(self) -> dict[str, dict[str, float]]:
        """
        Return the losses of each parameter by the names of the changes, and their mean.
        """
        return {
            name: {**dict(zip(_COLUMNS, row)), 'mean': mean}
            for name, row, mean in zip(self.names, self.table.tolist(), self.mean.tolist())
        }

    @property
    def order(self) -> list[int]:
        """Places of the parameters, the largest mean loss first."""
        found: list[int] = np.argsort(-self.mean, kind='stable').tolist()
        return found

    @property
    def ranking(self) -> tuple[str, ...]:
        """Names, the largest mean loss first."""
        return tuple(self.names[i] for i in self.order)

    def select(self, count: int) -> Selection:
        """
        Keep so many parameters, those that matter most.

        Raises
        ------
        SensitivityError
            If there are not so many, or no change can be simulated of all.
        """
        if np.isnan(self.mean[0]):
            lost = ~np.isfinite(self.table)
            names = ', '.join(name for name, row in zip(self.names, lost) if row.any())
            raise SensitivityError(
                f'{names}: no change can be simulated of all parameters; choose a milder manoeuvre'
            )
        if not 1 <= count <= len(self.names):
            raise SensitivityError(
                f'keep is {count!r}, expected 1..{len(self.names)}, the number of parameters'
            )
        ranking, mean = self.ranking, np.append(self.mean[self.order], 0.0)
        # halfway in the logarithm between the last one kept and the first one dropped
        threshold = float(np.sqrt(mean[count - 1]) * np.sqrt(mean[count]))
        return Selection(ranking[:count], ranking[count:], threshold)


@dataclass(frozen=True)
class Responses:
    """
    How motions differ from the unchanged one.

    Attributes
    ----------
    names
        Of the p parameters.
    steps : (p, c)
        Changes of each, in its unit.
    differences : (p, c, n, q)
    """

    names: tuple[str, ...]
    steps: Float64
    differences: Float64

    def losses(self, norm: Norm = Norm.ROOT_MEAN_SQUARE) -> Losses:
        """
        Return the loss of each change.

        Notes
        -----
        S3, whose formula is lost; what it reports of its results, a loss that
        grows as the change, holds for both norms.
        """
        return Losses(self.names, norm.of(self.differences))

    def slopes(self, up: int = 0, down: int = 1) -> Float64:
        """
        Return the change of motion by a step of each parameter (p, n q).

        From the changes in two columns of `steps`, of equal size and opposite
        sign.
        """
        half = 0.5 * (self.differences[:, up] - self.differences[:, down])
        return half.reshape(len(self.names), -1)


def vary(
    simulate: Callable[[Float64], Float64], names: Sequence[str], values: Float64, steps: Float64
) -> Responses:
    """
    Change one parameter at a time, all in one call of a simulator.

    Parameters
    ----------
    simulate : (k, p) to (k, n, q)
        From sets of parameters to motions: n times, q quantities without unit. Called once, with
        1 + p c sets; the first is unchanged.
    names
        Of the p parameters.
    values : (p,)
        Of the parameters, each in its own unit.
    steps : (p, c)
        What is added to each value, one after the other; a step that is NaN
        is not made, and its differences are NaN.

    Returns
    -------
    Responses
        What each of the p c changes does to what the simulator gives.

    Raises
    ------
    SensitivityError
        If the numbers do not fit each other, or the unchanged parameters
        cannot be simulated.

    Notes
    -----
    Source: S3, one-at-a-time sensitivity.

    Examples
    --------
    >>> import numpy as np
    >>> from shipdrag_ros.studies.sensitivity.loss import vary
    >>> time = np.linspace(0.0, 1.0, 5)
    >>> responses = vary(
    ...     lambda sets: sets[:, :1] * np.exp(-sets[:, 1:] * time),
    ...     ['size', 'rate'],
    ...     np.array([1.0, 2.0]),
    ...     np.array([[0.1], [0.2]]),
    ... )
    >>> responses.differences.shape
    (2, 1, 5)
    """
    count, changes = len(names), steps.shape[-1]
    if values.shape != (count,) or steps.shape != (count, changes):
        raise SensitivityError(
            f'{count} names, values {values.shape} and steps {steps.shape} do not fit each '
            f'other; expected ({count},) and ({count}, changes)'
        )
    sets = np.tile(values, (1 + count * changes, 1))
    varied = sets[1:].reshape(count, changes, count)
    of_each = np.arange(count)
    varied[of_each, :, of_each] += np.nan_to_num(steps)
    motions = simulate(sets)
    if not np.all(np.isfinite(motions[0])):
        raise SensitivityError(
            'the simulation with unchanged parameters is not finite; begin from parameters that '
            'can be simulated'
        )
    differences = (motions[1:] - motions[0]).reshape(count, changes, *motions.shape[1:])
    differences[np.isnan(steps)] = np.nan
    return Responses(tuple(names), steps, differences)


def partial_contribution(slopes: Float64) -> Float64:
    """
    Return the part of each response that is orthogonal to all others.

    Parameters
    ----------
    slopes : (p, m)
        Changes of motion, of one experiment or of several side by side.

    Returns
    -------
    (p,)
        0: a change of the others looks the same, so that this experiment
        cannot determine the parameter; 1: nothing else looks like it.
    """
    size = np.linalg.norm(slopes, axis=1)
    seen = size > 0.0
    shares = np.zeros(len(slopes))
    if seen.any():
        unit = slopes[seen] / size[seen, None]
        triangle = np.asarray(np.linalg.qr(unit.T, mode='r'), np.float64)
        # 1 over the square of a share is the diagonal of the inverse of what unit responses have
        # in common; directions below the rounding of their sums are no directions
        _, found, axes = np.linalg.svd(triangle)
        lengths = np.full(len(axes), _ROUNDING * found[0])
        lengths[: len(found)] = np.maximum(found, lengths[0])
        shares[seen] = 1.0 / np.linalg.norm(axes.T / lengths, axis=1)
    return shares
