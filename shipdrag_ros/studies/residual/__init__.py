# SPDX-License-Identifier: Apache-2.0
"""Residual resistance from shape: the forms of S4, and where they may not be used."""

from shipdrag_ros.studies import Study

STUDY = Study(
    'residual',
    'residual resistance from ratios of the hull, guarded',
    (
        'shipdrag residual hulls.csv --form auto --target c_R --predict new_hulls.csv '
        '--report residual.html',
        'shipdrag residual hulls.csv --form sirotina --target c_R --json residual.json',
    ),
)
