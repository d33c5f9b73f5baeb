# SPDX-License-Identifier: Apache-2.0
"""Several diagnoses joined in one answer: of the force, of log and track, of whole glides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.diagnosis.words import names_text, probability, sentence
from shipdrag_ros.errors import DiagnosisError, EarlierError, EstimationError, ShipdragError
from shipdrag_ros.inference.decision import NONE, Verdict

Diagnose = Callable[[], DiagnosisResult]

_HELD = 'all of each glide is compared with the model, such parts with the rest'
_APART = 'what is named rests on the coastdowns alone, and need not explain such parts'
_SOUND_PART = (
    'So it is not known whether anything is missing; give the sound part alone with '
    '--window START END'
)


def with_whole_glides(
    alone: Diagnose, whole: Diagnose | None, notes: Sequence[str], *, coastdowns: int
) -> DiagnosisResult:
    """
    Diagnose with the parts that are no coastdown.

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
        Of the whole; of the coastdowns where the whole cannot be followed, or has no name though
        they have one.

    Raises
    ------
    DiagnosisError
        If nothing can be diagnosed, or the whole cannot be and the rest shows nothing: what is
        cut is no sign of nothing. If an earlier diagnosis cannot count.
    EstimationError
        If there is no such part, and no run has enough samples.
    """
    if whole is None:
        found = alone()
        return replace(found, notes=(*found.notes, *notes))
    try:
        held = whole()
    except EarlierError:  # it counts for no part of a glide either
        raise
    except ShipdragError as error:  # a glide that is like none may not be followed
        return _not_followed(alone, notes, error)
    used = replace(held, coastdowns_used=coastdowns)
    if held.verdict is Verdict.UNKNOWN and coastdowns:
        try:
            found = alone()
        except (DiagnosisError, EstimationError) as error:
            why = f'the coastdowns alone could not be diagnosed: {error}'
            return replace(used, notes=(*held.notes, *notes, _HELD, why))
        if found.verdict is Verdict.NAMED:
            return replace(found, notes=(*found.notes, *notes, _APART))
    return replace(used, notes=(*held.notes, *notes, _HELD))


def _not_followed(alone: Diagnose, notes: Sequence[str], error: ShipdragError) -> DiagnosisResult:
    """Diagnose the coastdowns alone; what is cut from them is no sign of nothing."""
    why = f'all of each glide could not be held against the model: {error}'
    try:
        found = alone()
    except EarlierError:
        raise
    except (DiagnosisError, EstimationError) as failed:
        said = f'the coastdowns alone could not be diagnosed: {failed}'
        raise DiagnosisError(f'{"; ".join((*notes, said, why))}. {_SOUND_PART}') from error
    if found.candidates[0].names == NONE:
        raise DiagnosisError(f'{"; ".join((*notes, why))}. {_SOUND_PART}') from error
    return replace(found, notes=(*found.notes, *notes, why))


def with_log_track(force: DiagnosisResult, log_track: DiagnosisResult) -> DiagnosisResult:
    """
    Join what coastdowns show of the force with what log and track show.

    Parameters
    ----------
    force
        Of coastdowns without a stated baseline.
    log_track
        Of the same records.

    Returns
    -------
    Diagnosis
        Where log and track disagree, that is the answer, and a note says what the force
        shows besides: what turns the log wrong, or moves the water, leaves a force
        behind that is none.
    """
    examined = tuple(dict.fromkeys((*force.examined, *log_track.examined)))
    if log_track.verdict is Verdict.NONE:
        agree = (
            'log and track agree: nothing is wrong between them that these records could show '
            f'(probability {probability(log_track.nothing)})'
        )
        return replace(force, notes=(*force.notes, agree, *log_track.notes), examined=examined)
    besides = () if force.verdict is Verdict.NONE else (_besides(force),)
    return replace(
        log_track,
        notes=(*besides, *log_track.notes, *force.notes),
        would_decide=log_track.would_decide or force.would_decide,
        baseline=force.baseline,
        coastdowns_used=force.coastdowns_used,
        no_coastdown='',
        examined=examined,
        traces=force.traces,
        facts=force.facts,
    )


def _besides(force: DiagnosisResult) -> str:
    """Say what the force shows besides."""
    if force.verdict is Verdict.UNKNOWN:
        return f'in the force besides: {sentence(force)}'
    likely = ', '.join(
        f'{names_text(each.names)} ({probability(each.probability)})'
        for each in force.candidates
        if each.names
    )
    return f'in the force besides, compared with all hulls of her length and volume: {likely}'
