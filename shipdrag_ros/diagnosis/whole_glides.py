# SPDX-License-Identifier: Apache-2.0
"""What coastdowns show alone, beside what the whole glides show that they are part of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.errors import DiagnosisError, EarlierError, EstimationError, ShipdragError
from shipdrag_ros.inference.decision import Verdict

Diagnose = Callable[[], DiagnosisResult]

_HELD = 'all of each glide is held against the model, such parts with the rest'
_AGREES = 'all of each glide, held against the model, shows nothing more'
_SOUND_PART = (
    'So it is not known whether anything is missing; give the sound part alone with '
    '--window START END'
)

_APART = 'what is named rests on the coastdowns alone, and need not explain such parts'


def with_whole_glides(
    alone: Diagnose, whole: Diagnose | None, notes: Sequence[str], *, coastdowns: int
) -> DiagnosisResult:
    """
    Diagnose with the parts that are no coastdown though no instrument shows why.

    Parameters
    ----------
    alone
        Diagnoses the coastdowns, or log and track where there is none.
    whole
        Diagnoses the glides with such parts; None where there are none that can be followed.
    notes
        What these parts are, a sentence each.
    coastdowns
        How many there are.

    Returns
    -------
    DiagnosisResult
        Of the coastdowns where they give a name, or where the whole shows nothing or cannot be
        followed; else of the whole.

    Raises
    ------
    DiagnosisError
        If nothing can be diagnosed, or the whole cannot be and the rest shows nothing: what is
        cut is no sign of nothing. If an earlier diagnosis cannot count.
    EstimationError
        If there is no such part, and no run has enough samples.
    """
    found: DiagnosisResult | None = None
    failed: tuple[str, ...] = ()
    try:
        found = alone()
    except EarlierError:  # it counts for no part of a glide either
        raise
    except (DiagnosisError, EstimationError) as error:
        if whole is None:
            raise
        if coastdowns:
            failed = (f'the coastdowns alone could not be diagnosed: {error}',)
    if found is not None and (whole is None or found.verdict is Verdict.NAMED):
        more = () if whole is None else (_APART,)
        return replace(found, notes=(*found.notes, *notes, *more))
    assert whole is not None
    try:
        held = whole()
    except EarlierError:
        raise
    except ShipdragError as error:  # a glide that is like none may not be followed
        why = f'all of each glide could not be held against the model: {error}'
        if found is None or found.verdict is Verdict.NONE:
            raise DiagnosisError(f'{"; ".join((*notes, *failed, why))}. {_SOUND_PART}') from error
        return replace(found, notes=(*found.notes, *notes, why))
    if found is not None and held.verdict is Verdict.NONE:
        return replace(found, notes=(*found.notes, *notes, _AGREES))
    before = () if found is None else found.notes
    return replace(
        held,
        notes=tuple(dict.fromkeys((*before, *held.notes, *notes, _HELD, *failed))),
        coastdowns_used=coastdowns if found is None else found.coastdowns_used,
    )
