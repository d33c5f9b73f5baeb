# SPDX-License-Identifier: Apache-2.0
"""A diagnosis in words and tables, the same in the terminal and on the page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from shipdrag_ros.diagnosis.result import (
    FORCE,
    LOG_TRACK,
    Candidate,
    Compared,
    DiagnosisResult,
    EffectEstimate,
    Limit,
    RunSize,
    RunTrace,
    WeighedEarlier,
)
from shipdrag_ros.display import M_S_PER_KNOT, TRACK_LABELS, Table, plus_minus, utc
from shipdrag_ros.estimation.words import in_service
from shipdrag_ros.inference.decision import NONE, UNKNOWN, Verdict
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.ship import CoefficientBaseline, Ship
from shipdrag_ros.ship.sections import NO_CLEAN_HULL
from shipdrag_ros.simulation.effect import Effect, Scope
from shipdrag_ros.simulation.effects import find

_CHANNELS = {
    'log': 'in the speed log',
    'radar': 'in radar or GNSS',
    'log_radar': 'between log and radar, which of the two is not known',
    'force': 'in the force on the ship',
}
NOTHING_BETWEEN = 'nothing between log and track'
NOTHING, UNNAMED, OTHERS = 'nothing is missing', 'something without a name', 'all others together'
_ANY_HULL = ' What is named of the hull here is against a usual hull, clean or not.'
_LEAST = 0.001  # probability that is stated
_MOST_LIMITS = 5
_LARGE_N = 1e4  # from here on a force is stated in kN


def summary(found: DiagnosisResult, ship: Ship | None = None) -> tuple[str, ...]:
    """
    Say what was found: that there is no coastdown, the verdict, what was examined, and where.

    Parameters
    ----------
    found
    ship
        With her, also what she needs at her usual speed.

    Returns
    -------
    tuple of str
        A paragraph each; the verdict first, where there is a coastdown.
    """
    where = '' if found.where is None else f'Model and data disagree {place(found)}.'
    first = (found.no_coastdown, sentence(found), differing(found.runs_differ))
    last = 'Sizes elsewhere are those of the last run.' if found.runs_differ else ''
    lines = (*first, last, *needs(found, ship), examined(found), where)
    return (*filter(None, lines), *facts(found), *earlier(found), *found.notes)


def needs(found: DiagnosisResult, ship: Ship | None) -> tuple[str, ...]:
    """
    Say what she needs at her usual speed; nothing of a ship that is not known.
    """
    if ship is None or found.question:
        return ()
    return in_service(found.estimates, found.in_runs or ship)


def sentence(found: DiagnosisResult) -> str:
    """
    Return the verdict in a sentence; first a question, or that there is no clean hull.
    """
    if found.question:
        right = f'; if the unit is right: {listed(found.held)}' if found.held else ''
        return f'{found.question}. The verdict waits for the answer{right}.'
    if found.baseline == 'fitted_here':
        names = {name for each in found.held if each.names != UNKNOWN for name in each.names}
        of_hull = any(find(name).scope is Scope.HULL for name in names)
        return f'{NO_CLEAN_HULL}{_ANY_HULL if of_hull else ""} {_verdict(found)}'
    return _verdict(found)


def _verdict(found: DiagnosisResult) -> str:
    """Return the verdict on what was examined."""
    match found.verdict:
        case Verdict.NONE if found.baseline == 'none':
            return (
                'Log and track agree: nothing is wrong between them that this record could show '
                f'(probability {probability(found.nothing)}).'
            )
        case Verdict.NONE:
            nothing = 'nothing else' if found.baseline == 'fitted_here' else 'nothing'
            return (
                f'Model and data agree: {nothing} is missing that these runs could show '
                f'(probability {probability(found.nothing)}).{would_be_named(found)}'
            )
        case Verdict.NAMED if found.runs_differ:
            names = names_text([effect.name for effect in found.effects])
            return (
                f'Missing in the model, and not alike in these runs: {names}; probability '
                f'{least_probable(found)}.{_besides(found)}'
            )
        case Verdict.NAMED:
            sizes = ' and '.join(_sized(effect) for effect in found.effects)
            return (
                f'Missing in the model: {sizes}; probability '
                f'{least_probable(found)}.{_besides(found)}'
            )
        case Verdict.ONE_OF:
            fitted = found.baseline == 'fitted_here'  # some could not be seen, and have no size
            seen = [
                each
                for each in found.held
                if each.effects or not fitted or each.names in (NONE, UNKNOWN)
            ]
            rest = [each for each in seen if each.names != NONE]
            if len(rest) == len(seen):
                return f'Missing is one of these: {listed(rest)}. These runs cannot separate them.'
            said = f'{"Nothing else" if fitted else "Nothing"} is missing'
            if found.baseline == 'none':  # the force was not examined
                said = 'Log and track agree'
            said = f'{said} ({probability(found.nothing)})'
            if not rest:
                return f'{said}.'
            if seen[0].names == NONE:  # the most probable comes first
                return f'{said}, or {listed(rest)}. These runs cannot separate them.'
            return (
                f'Missing is one of these: {listed(rest)}; or {said[0].lower()}{said[1:]}. '
                'These runs cannot separate them.'
            )
        case Verdict.UNKNOWN:
            return (
                f'Something is missing that is none of the known effects, {place(found)} '
                f'(probability {probability(found.unnamed)}).'
            )


def least_probable(found: DiagnosisResult) -> str:
    """
    Return how probable the named effects are; of two the less probable.
    """
    return probability(min(effect.probability for effect in found.effects))


def _besides(found: DiagnosisResult) -> str:
    """Say which effects may be there beside those that are named; '' where none is likely."""
    named = {effect.name for effect in found.effects}
    share: dict[str, float] = {}
    for each in found.held:
        for name in set(each.names) - named if named <= set(each.names) else ():
            share[name] = share.get(name, 0.0) + each.probability
    if not share:
        return ''
    listed = ', '.join(f'{names_text([name])} ({probability(p)})' for name, p in share.items())
    return f' Beside it there may be: {listed}.'


def would_be_named(found: DiagnosisResult) -> str:
    """
    Say what would have been named, what shows best first; '' where no limits are known.
    """
    if not found.limits:
        return ''
    if not (sizes := shown(found)):
        return ' No single effect of any size would have been named by these runs.'
    return f' These runs would have named, nine times in ten{sizes}.'


def shown(found: DiagnosisResult) -> str:
    """
    List the effects that show best, and from what size on; '' where none would be named.
    """
    known = sorted(
        (_effort(least, each), name, _from(least, find(name).parameters[0], each))
        for name, each in found.limits.items()
        if (least := each.would_be_named) is not None
    )[:_MOST_LIMITS]
    if not known:
        return ''
    several = any(len(find(name).parameters) > 1 for _, name, _ in known)
    sizes = ', '.join(f'{names_text([name])} {edge}' for _, name, edge in known)
    return f'{", other parameters as usual" if several else ""}: {sizes}'


def _from(least: float, quantity: Parameter, limit: Limit) -> str:
    if not least:
        return 'of any size'
    edge = size(quantity, Parameter(float(f'{least:.2g}'), 0.0))
    return f'up to {edge}' if limit.bound == 'lower_95' else f'from {edge}'


def _effort(least: float, limit: Limit) -> float:
    """Return how much of an effect is needed, over what is usual."""
    needed = least / limit.value
    return 1.0 / needed if needed and limit.bound == 'lower_95' else needed


def differing(sizes: Sequence[RunSize]) -> str:
    """
    Say how the runs differ; '' where one size of all that is missing fits all.
    """
    if not sizes:
        return ''
    effects = names_text(list(dict.fromkeys(each.effect for each in sizes)))
    of_runs = '; '.join(
        f'{each.run}: {plus_minus(each.size.value, 2.0 * each.size.sd)}' for each in sizes
    )
    name = sizes[0].parameter.replace('_', ' ')
    return (
        f'These runs differ: no one size fits all. {effects}, {name}: {of_runs} (two '
        'standard deviations).'
    )


def examined(found: DiagnosisResult) -> str:
    """
    Say what was examined, and what was not; '' where nothing was, as the verdict waits.
    """
    if not found.examined:
        return ''
    parts = {FORCE: 'the force on the ship', LOG_TRACK: 'the log against the way over ground'}
    seen = [words for part, words in parts.items() if part in found.examined]
    unseen = [words for part, words in parts.items() if part not in found.examined]
    said = f'Examined: {" and ".join(seen)}'
    return f'{said}; not examined: {" and ".join(unseen)}.' if unseen else f'{said}.'


def facts(found: DiagnosisResult) -> list[str]:
    """
    Say which facts the data contradict, and which say nothing here, a line each.
    """
    lines = []
    for each in found.facts:
        where = f' ({each.run})' if each.run else ''
        if each.contradicted and each.wrong is not None:
            instead = f', most probably {names_text(each.against)}' if each.against else ''
            lines.append(
                f'The data contradict the fact `{each.fact}`{where}: {each.fact.words}. It is '
                f'wrong with probability {probability(each.wrong)}{instead}; look at it again.'
            )
        elif each.wrong is None:
            lines.append(
                f'The fact `{each.fact}`{where} is not used: it says nothing of the log against '
                'the way over ground.'
            )
    return lines


def earlier(found: DiagnosisResult) -> list[str]:
    """
    Say what earlier diagnoses count for, and what these runs make of it, a line each.
    """
    return [line for each in found.earlier for line in _earlier(each)]


def _earlier(given: WeighedEarlier) -> Iterator[str]:
    first, last = (utc(f(run.time_ns for run in given.runs)) for f in (min, max))
    when = f'{first} to {last}' if first != last else first
    if not given.used:
        yield (
            f'The earlier diagnosis {given.name} ({when}) is not used: it counts for coastdowns '
            'that are held against a stated baseline.'
        )
        return
    counts = '; '.join(
        f'{names_text([each.name])} was {probability(each.probability)} probable, lasts until now '
        f'with {probability(each.stays)}, and is {probability(each.now)} probable with these runs'
        for each in given.effects
    )
    nothing = 'it found nothing of hull or instruments, which speaks a little against any'
    yield f'The earlier diagnosis {given.name} ({when}) counts: {counts or nothing}.'
    for each in given.effects:
        if each.contradicted:
            size = ', and of another size or sign than it was then' if each.resized else ''
            yield (
                f'These runs contradict the earlier diagnosis {given.name}: '
                f'{names_text([each.name])} is {probability(each.now)} probable now{size}. It was '
                'repaired, cleaned or set anew since, or one of the two is wrong; look which.'
            )
    for line in given.unused:
        yield f'Not used of the earlier diagnosis {given.name}: {line}.'


def advice(found: DiagnosisResult) -> list[str]:
    """
    Return what would decide, a line each.
    """
    return [
        each.measure
        + (f'; costs {each.cost}' if each.cost else '')
        + (
            ''
            if each.probability is None
            else f'; decides with probability {probability(each.probability)}'
        )
        for each in found.would_decide
    ]


def place(found: DiagnosisResult) -> str:
    """
    Say where model and data disagree.
    """
    if found.where is None:
        return 'nowhere'
    where = found.where
    (first, last), (slow, fast) = where.time_s, where.speed_m_s
    since = 'of the record' if of_log_track(found) else 'after the stop'
    if last <= 0.0:
        first, last, since = abs(first), abs(last), 'before the stop'
    return (
        f'{_CHANNELS[where.channel]}, {first:.0f} to {last:.0f} s {since}, '
        f'at {slow / M_S_PER_KNOT:.1f} to {fast / M_S_PER_KNOT:.1f} knots ({slow:.1f} to '
        f'{fast:.1f} m/s)'
    )


def model(found: DiagnosisResult) -> str:
    """
    Say what the runs were held against.
    """
    match found.baseline:
        case _ if of_log_track(found):
            return 'log as it is'
        case 'fitted_here':
            return 'all hulls of her length and volume'
        case _:
            return 'model as stated'


def of_log_track(found: DiagnosisResult) -> bool:
    """
    Say whether the answer rests on the log against the way over ground alone.
    """
    if found.baseline == 'fitted_here':
        return found.where is not None and found.where.channel != FORCE
    return found.baseline == 'none'


def added(found: DiagnosisResult) -> str:
    """
    Say what the model after has that the one before has not.
    """
    match found.verdict:
        case Verdict.NONE:
            return 'with the baseline moved to fit'
        case Verdict.UNKNOWN:
            return 'with an unknown, smooth disturbance'
        case _ if not found.best:
            return 'with a constant part besides'
        case _:
            return f'with {names_text([effect.name for effect in found.best])}'


@dataclass(frozen=True)
class Answer:
    """A possible answer, and how probable it is."""

    words: str
    probability: float


def answers(found: DiagnosisResult) -> tuple[Answer, ...]:
    """
    Return the candidates, then nothing and something unnamed, and what is left.

    Nothing while the verdict waits.
    """
    if found.question:
        return ()
    nothing = NOTHING if found.baseline != 'none' else NOTHING_BETWEEN
    listed = [
        Answer(names_text(each.names) if each.names else nothing, each.probability)
        for each in found.candidates
    ]
    names = [each.names for each in found.candidates]
    if NONE not in names:
        listed.append(Answer(nothing, found.nothing))
    if UNKNOWN not in names:
        listed.append(Answer(UNNAMED, found.unnamed))
    others = 1.0 - sum(each.probability for each in listed)
    return (*listed, Answer(OTHERS, others)) if others >= _LEAST else tuple(listed)


def names_text(names: Sequence[str]) -> str:
    """
    Name effects; none: nothing is missing.
    """
    if names == UNKNOWN:
        return UNNAMED
    return ' + '.join(name.replace('_', ' ') for name in names) or NOTHING


def of_the_earth(ruled_out: Sequence[Effect]) -> str:
    """
    Say what latitude and longitude rule out.
    """
    return (
        'the positions are latitude and longitude, whose scale is that of the Earth: '
        f'{", ".join(effect.name for effect in ruled_out)} is ruled out'
    )


def probability(value: float) -> str:
    """
    Return a probability; what is all but certain is not said to be certain.
    """
    if value > 1.0 - _LEAST:
        return f'> {100.0 - 100.0 * _LEAST:g} %'
    return f'{100.0 * value:.1f} %' if value >= _LEAST else f'< {100.0 * _LEAST:g} %'


def baseline(found: DiagnosisResult, ship: Ship | None) -> str:
    """
    Say where the baseline comes from, and how well it is stated to be known.
    """
    if found.baseline == 'none':
        return 'no baseline was needed: log and way over ground are held against each other'
    given = None if ship is None else ship.baseline
    if found.baseline == 'fitted_here' or given is None:
        return 'none is stated: the runs are compared with all hulls of her length and volume'
    if isinstance(given, CoefficientBaseline):
        sd = given.relative_sd
        known = f'friction ± {200.0 * sd.friction:g} %, wave ± {200.0 * sd.wave:g} %'
    else:
        known = f'± {200.0 * given.relative_sd:g} %'
    return f'{given.source or "of unstated source"}; {known} (two standard deviations, as stated)'


def size(quantity: Parameter, found: Parameter) -> str:
    """
    Return a value with two standard deviations; what was a choice has none.
    """
    for word, value in quantity.words.items():
        if value == found.value:
            return word
    if found.sd == 0.0:
        return f'{found.value:g} {quantity.unit}'.rstrip()
    text = plus_minus(found.value, 2.0 * found.sd)
    return f'({text}) {quantity.unit}' if quantity.unit else text


def quantity_text(quantity: Parameter) -> str:
    """
    Name a parameter without its unit.
    """
    suffix = quantity.unit.lower().replace('/', '_').replace('^', '')
    name = quantity.name.removesuffix(f'_{suffix}') if suffix else quantity.name
    return name.replace('_', ' ')


def _sized(effect: EffectEstimate) -> str:
    """Return an effect with its sizes."""
    sizes = ', '.join(
        f'{quantity_text(quantity)} {_on_board(quantity, effect.parameters[quantity.name])}'
        for quantity in find(effect.name).parameters
    )
    return f'{names_text([effect.name])} ({sizes})'


def _on_board(quantity: Parameter, found: Parameter) -> str:
    """Return a size as it is read on board: speeds in knots, large forces in kN."""
    text = size(quantity, found)
    if found.sd == 0.0:
        return text
    if quantity.unit == 'm/s':
        knots = plus_minus(found.value / M_S_PER_KNOT, 2.0 * found.sd / M_S_PER_KNOT)
        return f'({knots}) knots = {text}'
    if quantity.unit == 'N' and abs(found.value) >= _LARGE_N:
        return f'({plus_minus(1e-3 * found.value, 2e-3 * found.sd)}) kN'
    return text


def listed(candidates: Sequence[Candidate]) -> str:
    """
    Name candidates, each with its probability.
    """
    return ', '.join(
        f'{names_text(each.names)} ({probability(each.probability)})' for each in candidates
    )


def probabilities_table(found: DiagnosisResult) -> Table:
    """
    Show how probable each answer is.
    """
    rows = tuple((each.words, probability(each.probability)) for each in answers(found))
    return Table(('what is missing', 'probability'), rows)


def parameters_table(effects: Sequence[EffectEstimate]) -> Table:
    """
    Show how large effects are; the names are those of `simulate --effect`.
    """
    rows = tuple((effect.name, *row) for effect in effects for row in _parameters(effect))
    return Table(('effect', 'parameter', 'value', 'sd', 'meaning'), rows)


def sizes_table(found: DiagnosisResult) -> Table:
    """
    Show how large what is named is, or each candidate would be, were it the one.
    """
    if found.effects:
        return parameters_table(found.effects)
    rows = tuple(
        (names_text(each.names), probability(each.probability), *row)
        for each in found.candidates
        for effect in each.effects
        for row in _parameters(effect)
    )
    return Table(('candidate', 'probability', 'parameter', 'value', 'sd', 'meaning'), rows)


def limits_table(found: DiagnosisResult) -> Table:
    """
    Show how large each effect that is not named can be, and from what size on it would be named.
    """
    rows = [
        (
            names_text([name]),
            quantity.name,
            f'{"at least" if each.bound == "lower_95" else "at most"} {each.value:.2g}',
            '-' if least is None else f'{least:.2g}' if least else 'any size',
            '-' if math.isnan(each.percent_of_r) else f'{each.percent_of_r:.1f} %',
        )
        for name, each in found.limits.items()
        for quantity, least in [(find(name).parameters[0], each.would_be_named)]
    ]
    heads = ('effect', 'parameter', 'if it is there, 95 %', 'would be named from', 'of r')
    return Table(heads, tuple(rows))


def _parameters(effect: EffectEstimate) -> Iterator[tuple[str, ...]]:
    """Yield name, value, sd and meaning of each parameter; what was a choice has no sd."""
    for quantity in find(effect.name).parameters:
        found = effect.parameters[quantity.name]
        value, sd = size(quantity, found), '-'
        if found.sd != 0.0:
            value, _, sd = plus_minus(found.value, found.sd).partition(' ± ')
        yield quantity.name, value, sd, quantity.meaning


def facts_table(found: DiagnosisResult) -> Table:
    """
    Show the facts that were stated, and how probable it is that each is wrong.
    """
    rows = [
        (
            str(each.fact),
            each.run or 'all',
            f'{each.fact.words}',
            '-' if each.wrong is None else probability(each.wrong),
        )
        for each in found.facts
    ]
    return Table(('fact', 'of run', 'says', 'wrong with probability'), tuple(rows))


def gaps_table(found: DiagnosisResult) -> Table:
    """
    Show how far model and data are apart.
    """
    named = 'a constant part'  # where no effect has a size
    if found.best:
        named = names_text([effect.name for effect in found.best])
    known = {
        model(found): found.before,
        f'with {named}': found.after,
        f'each run predicted, {model(found)}': found.held_out_before,
        f'each run predicted, with {named} learnt from the others': found.held_out_after,
    }
    rows = [
        (
            name,
            _number(gap.rms_speed_m_s, '.3f'),
            _number(gap.rms_position_m, '.1f'),
            '-' if math.isnan(gap.chi2_per_sample) else f'{gap.chi2_per_sample:.2f}',
        )
        for name, gap in known.items()
        if gap is not None
    ]
    return Table(
        ('', 'speed rms [m/s]', 'position rms [m]', 'chi² a sample; noise: 1'), tuple(rows)
    )


def noise_table(traces: Sequence[RunTrace]) -> Table:
    """
    Show what the noise of each measurement is, and what is left of it.
    """
    rows = [
        (f'{trace.name}: {label.lower()} [{unit}]', *_noise(compared))
        for trace in traces
        for compared in trace.compared
        for label, unit in (TRACK_LABELS[compared.quantity],)
    ]
    heads = ('', 'sd in steady sailing', 'at the end', 'left over before', 'left over after')
    return Table(heads, tuple(rows))


def _noise(compared: Compared) -> tuple[str, ...]:
    steady = compared.time_s < 0.0
    figures = (
        float(np.median(compared.sd[steady if steady.any() else ...])),
        float(compared.sd[-1]),
        *(
            float(np.sqrt(np.mean((compared.measured - simulated) ** 2)))
            for simulated in (compared.before, compared.after)
        ),
    )
    return tuple(f'{figure:.0f}' if figure >= 100.0 else f'{figure:.2g}' for figure in figures)


def _number(value: float | None, form: str) -> str:
    return '-' if value is None else format(value, form)
