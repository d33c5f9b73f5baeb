# SPDX-License-Identifier: Apache-2.0
"""Which parameters of a simulation matter: S3."""

from shipdrag_ros.studies import Study

STUDY = Study(
    'sensitivity',
    'which derivatives or values of a ship file matter',
    (
        'shipdrag sensitivity --manoeuvre zigzag:15 --keep 24 --report mariner.html',
        'shipdrag sensitivity --ship ship.yaml --manoeuvre coastdown:8.2',
    ),
)
