# SPDX-License-Identifier: Apache-2.0
"""
A regression of residual resistance on shape, the guard over it, and a ship file made of it.

S4 shows that such regressions meet the hulls they were made from and mislead
for all others. So what leaves here says where it may be used. The
published forms of the coefficient stand first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shipdrag_ros.errors import DataError
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import CoefficientBaseline, CoefficientSd, Ship
from shipdrag_ros.studies.least_squares import LinearFit, least_squares
from shipdrag_ros.studies.surface.fit import Domain, Prediction

REQUIRED = ('L_B', 'B_T', 'Fr')
OPTIONAL = ('C_B', 'slenderness', 'lcb')
_CONTRADICTION = 0.02  # beyond what the digits of ratios in print explain


@dataclass(frozen=True)
class Hulls:
    """
    Hulls at speeds, one a row.

    Attributes
    ----------
    L_B, B_T, C_B : (n,)
        Length to breadth, breadth to draught, block coefficient.
    slenderness : (n,)
        L / V^(1/3).
    Fr : (n,)
        v / sqrt(g L).
    lcb : (n,) or None
        Centre of buoyancy along the ship over L; None where not known.
    """

    L_B: Float64
    B_T: Float64
    C_B: Float64
    slenderness: Float64
    Fr: Float64
    lcb: Float64 | None = None

    @classmethod
    def of(cls, subject: str, names: tuple[str, ...], values: Float64) -> Hulls:
        """
        Take columns; C_B or slenderness follows from the others.

        Parameters
        ----------
        subject
            What the columns are from, for errors.
        names : (k,)
            Some of `REQUIRED` and `OPTIONAL`.
        values : (n, k)

        Raises
        ------
        DataError
            If both C_B and slenderness are missing, or a ratio is not above 0.
        """
        columns = dict(zip(names, values.T))
        problems = []
        for name in ('L_B', 'B_T', 'C_B', 'slenderness', 'Fr'):
            bad = np.flatnonzero(columns.get(name, np.ones(1)) <= 0.0)
            if len(bad):
                problems.append(
                    f'{name}: {columns[name][bad[0]]:g} in row {bad[0] + 1}, expected above 0; '
                    f'{len(bad)} such row(s)'
                )
        if 'C_B' not in columns and 'slenderness' not in columns:
            problems.append('neither C_B nor slenderness; give one, the other follows')
        if problems:
            raise DataError(subject, problems)
        product = columns['L_B'] ** 2 * columns['B_T']
        if 'slenderness' not in columns:
            columns['slenderness'] = np.cbrt(product / columns['C_B'])
        if 'C_B' not in columns:
            columns['C_B'] = product / columns['slenderness'] ** 3
        known = (*REQUIRED, *OPTIONAL)
        return cls(**{name: column for name, column in columns.items() if name in known})

    def __len__(self) -> int:
        return len(self.Fr)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Hulls:
        """
        Return some of the rows.
        """
        known = {name: column for name, column in vars(self).items() if column is not None}
        return replace(self, **{name: column[rows] for name, column in known.items()})

    @property
    def contradictions(self) -> int:
        """How many rows state a C_B and a slenderness that cannot both be."""
        follows = np.cbrt(self.L_B**2 * self.B_T / self.C_B)
        return int(np.sum(np.abs(self.slenderness / follows - 1.0) > _CONTRADICTION))

    def groups(self) -> NDArray[np.intp]:
        """
        Return the number of the hull that each row belongs to, from 0.
        """
        shapes = [each for each in (self.L_B, self.B_T, self.C_B, self.lcb) if each is not None]
        _, number = np.unique(np.column_stack(shapes), axis=0, return_inverse=True)
        return number.reshape(-1)

    def moved(self, factor: float, powers: Mapping[str, float]) -> Hulls:
        """
        Multiply ratios by powers of a factor.
        """
        return replace(
            self, **{name: getattr(self, name) * factor**power for name, power in powers.items()}
        )


@dataclass(frozen=True)
class RegressionForm:
    """
    A regression that is linear in its coefficients.

    Attributes
    ----------
    name
        Of the form.
    terms
        From n hulls to a column (n,) for each coefficient b0, b1, .., by what it is; psi is the
        slenderness L / V^(1/3).
    variables
        Ratios of `Hulls` that separate its hulls, Fr included.
    froude_max
        What its author made it for.
    """

    name: str
    terms: Callable[[Hulls], Mapping[str, Float64]]
    variables: tuple[str, ...]
    froude_max: float = float('inf')

    @property
    def needs_lcb(self) -> bool:
        """It cannot be used without the centre of buoyancy."""
        return 'lcb' in self.variables

    def columns(self, hulls: Hulls) -> Float64:
        """
        Return (n, p) values of the terms.
        """
        return np.column_stack(list(self.terms(hulls).values()))

    def place(self, hulls: Hulls) -> Float64:
        """
        Return (n, d) values of `variables`.
        """
        return np.column_stack([getattr(hulls, name) for name in self.variables])


def _sakhnovsky(hulls: Hulls) -> dict[str, Float64]:
    if hulls.lcb is None:
        raise DataError('sakhnovsky', ['lcb: missing, this form needs it'])
    return {
        '1': np.ones_like(hulls.Fr),
        'L/B': hulls.L_B,
        '(B/T) C_B': hulls.B_T * hulls.C_B,
        'C_B': hulls.C_B,
        'Fr': hulls.Fr,
        'lcb': hulls.lcb,
        '(L/B)²': hulls.L_B**2,
        '((B/T) C_B lcb)²': (hulls.B_T * hulls.C_B * hulls.lcb) ** 2,
        '(C_B psi)²': (hulls.C_B * hulls.slenderness) ** 2,
        'Fr²': hulls.Fr**2,
        'lcb²': hulls.lcb**2,
        'psi': hulls.slenderness,
        'psi²': hulls.slenderness**2,
        'C_B Fr': hulls.C_B * hulls.Fr,
        '((B/T) psi)²': (hulls.B_T * hulls.slenderness) ** 2,
    }


def _sirotina(hulls: Hulls) -> dict[str, Float64]:
    linear = {
        'Fr_V': hulls.Fr * np.sqrt(hulls.slenderness),  # v / sqrt(g V^(1/3))
        # about the middle of the series
        '(L/B - 7.88)': hulls.L_B - 7.88,
        '(2 B/T - 8.42)': 2.0 * (hulls.B_T - 4.21),
        '(10 C_B - 8.19)': 10.0 * (hulls.C_B - 0.819),
    }
    squares = {
        f'{one}²' if one == other else f'{one} {other}': linear[one] * linear[other]
        for one, other in combinations_with_replacement(linear, 2)
    }
    return {'1': np.ones_like(hulls.Fr), **linear, **squares}


# S4 (1) and (2)
SAKHNOVSKY = RegressionForm(
    'sakhnovsky', _sakhnovsky, ('L_B', 'B_T', 'C_B', 'lcb', 'Fr'), froude_max=0.14
)
SIROTINA = RegressionForm('sirotina', _sirotina, ('L_B', 'B_T', 'C_B', 'Fr'))
FORMS = {form.name: form for form in (SAKHNOVSKY, SIROTINA)}


AUTO = 'auto'
OPEN = 1e-6  # which part of a row the data may leave open: the digits of printed ratios
FIRM = 2.0  # standard deviations by which a trend must be wrong
_STEP = 1e-4  # of a ratio, for derivatives
_ENOUGH = 3  # hulls left out that say how far a new hull scatters
_HUMP = 0.3  # Froude number of the first hump that a hollow follows


@dataclass(frozen=True)
class Expectation:
    """
    A trend that physics gives.

    Attributes
    ----------
    text
        What is expected, to be stated where it is not met.
    powers
        Of the factor by which a ratio is multiplied, for it and the ratios tied to it.
    sign
        +1 where resistance rises with the ratio, -1 where it falls.
    froude_max
        Beyond this nothing is expected.

    Notes
    -----
    After Guldhammer and Harvald, Ship Resistance (1974): their diagrams of C_R
    rise with Fr up to the first hump and fall with L / V^(1/3) throughout, and
    10^3 C_R rises by 0.16 for each unit of B/T at the same L / V^(1/3).
    """

    text: str
    powers: Mapping[str, float]
    sign: int
    froude_max: float = float('inf')


FASTER = {'Fr': 1.0}
LONGER = {'L_B': 1.0, 'slenderness': 2.0 / 3.0}
FLATTER = {'B_T': 1.0, 'L_B': -0.5}
EXPECTATIONS = (
    Expectation(f'rises with Fr below {_HUMP:g}', FASTER, 1, _HUMP),
    Expectation('falls with L/B at the same B/T and C_B', LONGER, -1),
    Expectation('rises with B/T at the same slenderness and C_B', FLATTER, 1),
)


@dataclass(frozen=True)
class ResidualFit:
    """
    A form fitted to measured hulls.

    Attributes
    ----------
    form
        Which.
    hulls
        The data.
    count
        How many different hulls they are.
    fit
        Of the form's columns.
    domain
        Hull of the data in the form's ratios.
    spread
        By what factor hulls that were left out miss their standard deviation.
    left_out
        Mean square error on them; infinite where the others predict none.
    notes
        What a reader must know, a sentence each.
    """

    form: RegressionForm
    hulls: Hulls
    count: int
    fit: LinearFit
    domain: Domain
    spread: float
    left_out: float
    notes: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """
        Return the document of the fit, as JSON has it.
        """

        def named(values: Iterable[object]) -> dict[str, object]:
            return {f'b{i}': value for i, value in enumerate(values)}

        return {
            'form': self.form.name,
            'terms': named(self.terms),
            'coefficients': named(self.fit.coefficients),
            'coefficient_sd': named(self.coefficient_sd),
            'F': self.criterion,
            'left_out_rms': math.sqrt(self.left_out),
            'rank': self.fit.rank,
            'condition': self.fit.condition,
            'hulls': self.count,
            'domain': self.domain.ranges,
            'notes': self.notes,
        }

    @property
    def terms(self) -> tuple[str, ...]:
        """What each coefficient stands before."""
        return tuple(self.form.terms(self.hulls))

    @property
    def coefficient_sd(self) -> Float64:
        """(p,) Standard deviations of the coefficients; infinite where left open."""
        is_open = self.fit.undetermined(np.eye(len(self.fit.coefficients))) > OPEN
        known = np.sqrt(np.maximum(np.diag(self.fit.covariance), 0.0))
        return np.where(is_open, np.inf, known)

    @property
    def criterion(self) -> float:
        """F of S4 (3): mean square of what the fit leaves."""
        return self.fit.sse / len(self.hulls)

    def predict(self, hulls: Hulls) -> list[Prediction]:
        """
        Predict hulls; where that may not be used, with all reasons.

        Notes
        -----
        A row is refused that the data leave open, that is outside their convex
        hull, whose leverage is beyond that of all data, that is below 0, or where a
        trend of `EXPECTATIONS` is wrong by more than `FIRM` standard deviations.
        """
        columns = self.form.columns(hulls)
        value, leverage = self.fit.predict(columns), self.fit.leverage(columns)
        is_open = self.fit.undetermined(columns) > OPEN
        sd = self.spread * np.sqrt(self.fit.variance * (1.0 + leverage))
        sd[is_open] = np.inf
        reasons = self.domain.reasons(self.form.place(hulls))
        most = float(self.fit.leverage(self.form.columns(self.hulls)).max())
        for i, why in enumerate(reasons):
            if is_open[i]:
                why.append(
                    f'the data determine {self.fit.rank} of {len(self.fit.coefficients)} '
                    'combinations of coefficients, and this hull needs another'
                )
            elif leverage[i] > most * (1.0 + OPEN):
                why.append(f'leverage {leverage[i]:.2g}, {most:.2g} at most among the data')
            if value[i] < 0.0:
                why.append('against physics: below 0')
        for text, wrong in self._wrong_trends(hulls):
            for i in np.flatnonzero(wrong).tolist():
                reasons[i].append(f'against physics: resistance {text}, here it does not')
        return Prediction.each(value, sd, reasons)

    def _wrong_trends(self, hulls: Hulls) -> Iterator[tuple[str, NDArray[np.bool_]]]:
        for expected in EXPECTATIONS:
            up, down = (
                self.form.columns(hulls.moved(1.0 + step, expected.powers))
                for step in (_STEP, -_STEP)
            )
            along = (up - down) / (2.0 * _STEP)
            slope = expected.sign * self.fit.predict(along)
            sd = self.spread * np.sqrt(self.fit.variance * self.fit.leverage(along))
            known = self.fit.undetermined(along) <= OPEN
            is_wrong = (slope < -FIRM * sd) & known & (hulls.Fr <= expected.froude_max)
            yield expected.text, is_wrong


def fit_residual(hulls: Hulls, values: Float64, *, form: str) -> ResidualFit:
    """
    Fit a form, or the one that predicts left-out hulls best.

    Where no hull can be predicted from the others, the smaller residual
    variance decides.

    Parameters
    ----------
    hulls
        Measured, n rows.
    values : (n,)
        Residual resistance, coefficient or per weight.
    form
        A name of `FORMS`, or `AUTO`.

    Raises
    ------
    DataError
        If there is no such form, it needs an lcb that the hulls lack, or rows are too few.

    Notes
    -----
    S4 (1) to (3), least squares with scaled columns.
    """
    if form in FORMS:
        return fit_form(FORMS[form], hulls, values)
    if form != AUTO:
        raise DataError('form', [f'{form!r}, expected one of {", ".join((*FORMS, AUTO))}'])
    untried = [each for each in FORMS.values() if each.needs_lcb and hulls.lcb is None]
    fits = [fit_form(each, hulls, values) for each in FORMS.values() if each not in untried]
    best = min(fits, key=lambda found: (found.left_out, found.fit.variance))
    why = (
        f'The form of {each.name.capitalize()} was not tried: it needs the column lcb.'
        for each in untried
    )
    return replace(best, notes=(*best.notes, *why))


def leave_hulls_out(
    form: RegressionForm, hulls: Hulls, values: Float64
) -> tuple[Float64, Float64, Float64]:
    """
    Predict each hull from all others.

    Returns
    -------
    error : (n,)
        Predicted less measured; NaN where the others leave a hull open.
    sd : (n,)
        Standard deviation as the fit to the others states it.
    leverage : (n,)
        Over the largest of the others.
    """
    groups = hulls.groups()
    error, sd, leverage = np.full((3, len(values)), np.nan)
    columns = form.columns(hulls)
    for number in range(groups.max() + 1):
        out = groups == number
        if out.all():
            continue
        others, left_out = columns[~out], columns[out]
        fit = least_squares(others, values[~out])
        known = fit.undetermined(left_out) <= OPEN
        size = fit.leverage(left_out)
        error[out] = np.where(known, fit.predict(left_out) - values[out], np.nan)
        sd[out] = np.sqrt(fit.variance * (1.0 + size))
        leverage[out] = size / fit.leverage(others).max()
    return error, sd, leverage


def fit_form(form: RegressionForm, hulls: Hulls, values: Float64) -> ResidualFit:
    """
    Fit any form that is linear in its coefficients; see `fit_residual`.
    """
    fit = least_squares(form.columns(hulls), values)
    if fit.freedom < 1:
        why = f'{len(hulls)} row(s) determine {fit.rank} coefficients and leave no scatter'
        raise DataError(form.name, [f'{why}; give more hulls or Froude numbers'])
    groups = hulls.groups()
    count = int(groups.max()) + 1
    error, sd, _ = leave_hulls_out(form, hulls, values)
    known = np.isfinite(error) & (sd > 0.0)
    spread, left_out = 1.0, float('inf')
    notes = []
    if fit.rank < len(fit.coefficients):
        notes.append(
            f'{count} hulls determine {fit.rank} of {len(fit.coefficients)} coefficients: '
            'single ones mean nothing, and hulls that need the others are refused.'
        )
    if len(np.unique(groups[known])) >= _ENOUGH:
        spread = max(1.0, float(np.sqrt(np.mean((error[known] / sd[known]) ** 2))))
        left_out = float(np.mean(error[known] ** 2))
    else:
        notes.append(
            'How far a new hull is off is not known: too few hulls can be predicted from the '
            'others. The sd holds the scatter of these hulls alone.'
        )
    if hulls.Fr.max() > form.froude_max:
        notes.append(
            f'Fr goes up to {hulls.Fr.max():g}, the form was made for {form.froude_max:g} at most.'
        )
    if hulls.contradictions:
        notes.append(
            f'{hulls.contradictions} row(s) state C_B and slenderness that contradict each '
            'other; both are used as they are.'
        )
    domain = Domain.of(form.variables, form.place(hulls))
    return ResidualFit(form, hulls, count, fit, domain, spread, left_out, tuple(notes))


_POINTS = 15  # Froude numbers tried
_VAGUE = 1.0  # of the value: a larger sd makes it no baseline
_LARGEST = 0.1  # a coefficient above this is one in other units


def with_residual(ship: Ship, fitted: ResidualFit, *, lcb: float | None) -> Ship:
    """
    Return the ship with the fitted coefficient as her wave resistance.

    Parameters
    ----------
    ship
        With breadth, draught and a baseline of coefficients, of which friction
        and allowance are kept.
    fitted
        To c_R on the wetted surface.
    lcb
        Centre of buoyancy over L, where the form needs it.

    Raises
    ------
    DataError
        If a particular is missing, the hull is outside the data, or the values
        are no coefficients.

    Notes
    -----
    c_R is what friction of a flat plate leaves, so the form factor becomes 0. The
    table holds only Froude numbers at which the guard accepts this hull; the
    largest relative standard deviation among them is stated for all.
    """
    base = ship.baseline
    breadth, draught = ship.breadth_m or 0.0, ship.draught_m or 0.0
    problems = [
        f'{name}: missing, the hull is described by its ratios'
        for name, size in (('breadth_m', breadth), ('draught_m', draught))
        if not size
    ]
    if not isinstance(base, CoefficientBaseline):
        problems.append('baseline: expected one of coefficients, its friction is kept')
    if fitted.form.needs_lcb and lcb is None:
        problems.append(f'lcb: the form {fitted.form.name} needs it; give --lcb')
    if problems:
        raise DataError(ship.name or 'ship file', problems)
    assert isinstance(base, CoefficientBaseline)
    ratios = {
        'L_B': ship.length_m / breadth,
        'B_T': breadth / draught,
        'slenderness': ship.slenderness,
    }
    if lcb is not None:
        ratios['lcb'] = lcb
    froude = np.linspace(fitted.hulls.Fr.min(), fitted.hulls.Fr.max(), _POINTS)
    rows = np.array([[*ratios.values(), each] for each in froude])
    found = fitted.predict(Hulls.of(ship.name, (*ratios, 'Fr'), rows))
    # the longest stretch that the guard accepts
    changes = np.flatnonzero(np.diff([each.inside for each in found])) + 1
    stretches = [part for part in np.split(np.arange(_POINTS), changes) if found[part[0]].inside]
    used = max(stretches, key=len, default=np.arange(0))
    if len(used) < 2:
        # of the Froude number that comes nearest to being accepted
        reasons = min((each.reasons for each in found), key=len)
        raise DataError(f'{ship.name or "ship"}: the fit may not be used for this hull', reasons)
    kept = [found[i] for i in used]
    value = np.array([each.value for each in kept])
    relative = float(np.max([each.sd / each.value for each in kept]))
    if value.max() > _LARGEST:
        problems.append(
            f'wave_coefficient: {value.max():.3g}, expected at most {_LARGEST:g}; the target '
            'must be c_R itself on the wetted surface, neither times 1000 nor a force'
        )
    elif relative > _VAGUE:
        problems.append(
            f'wave_coefficient: the sd is up to {relative:.2g} times the value, expected at '
            f'most {_VAGUE:g}; the data do not determine it'
        )
    if problems:
        raise DataError(ship.name or 'ship file', problems)
    low, high = froude[used[0]], froude[used[-1]]
    baseline = replace(
        base,
        form_factor=0.0,
        wave_froude=tuple(froude[used].tolist()),
        wave_coefficient=tuple(value.tolist()),
        relative_sd=CoefficientSd(friction=base.relative_sd.friction, wave=relative),
        source=f'wave: form {fitted.form.name} fitted to {fitted.count} hulls, accepted for '
        f'Fr {low:.3g} to {high:.3g}; friction: {base.source}',
    )
    return replace(ship, baseline=baseline)
