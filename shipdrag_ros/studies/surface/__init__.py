# SPDX-License-Identifier: Apache-2.0
"""Polynomial surfaces of coefficients: S5."""

from shipdrag_ros.studies import Study

STUDY = Study(
    'surface',
    'polynomial surface of coefficients, with the degree they show',
    (
        'shipdrag surface table.csv --inputs alpha,beta --target c_x --report surface.html',
        'shipdrag surface table.csv --inputs alpha,beta --target c_x --json surface.json',
    ),
)
