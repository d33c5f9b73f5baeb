# SPDX-License-Identifier: Apache-2.0
"""Force, and log against track, as one answer."""

from __future__ import annotations

from dataclasses import replace

from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.diagnosis.words import names_text, probability, sentence
from shipdrag_ros.inference.decision import Verdict


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
    return f'in the force besides, held against a form fitted to the runs: {likely}'
