# SPDX-License-Identifier: Apache-2.0
"""Residual resistance from shape: the forms of S4, and where they may not be used."""

from shipdrag_ros.residual.baseline import with_residual
from shipdrag_ros.residual.fit import AUTO, ResidualFit, fit_form, fit_residual, leave_hulls_out
from shipdrag_ros.residual.forms import FORMS, Form
from shipdrag_ros.residual.hulls import OPTIONAL, REQUIRED, Hulls

__all__ = [
    'AUTO',
    'FORMS',
    'OPTIONAL',
    'REQUIRED',
    'Form',
    'Hulls',
    'ResidualFit',
    'fit_form',
    'fit_residual',
    'leave_hulls_out',
    'with_residual',
]
