# SPDX-License-Identifier: Apache-2.0
"""
A diagnosis of a ship as it was found in earlier runs, to be given to the next one.

What earlier diagnoses of a ship say of hypotheses about her today.

An effect of hull or instruments that was there stays, unless it went unseen in the
time between, was cleaned off, or the diagnosis was wrong; how long it lasts, the
effect declares. Water, weather and helm are of their day and say nothing.
A diagnosis of before counts half, as what errs in both is no second witness: the ship
file's baseline, the noise as it was taken. Source: power priors, Ibrahim and Chen (2000),
Statistical Science 15, 46-60.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass
from functools import cached_property, partial
from os import PathLike
from typing import Any, NoReturn

from shipdrag_ros.diagnosis.document import document
from shipdrag_ros.diagnosis.facts import Facts
from shipdrag_ros.diagnosis.result import CarriedEffect, DiagnosisResult, SeenRun, WeighedEarlier
from shipdrag_ros.display import json_text, utc
from shipdrag_ros.errors import DiagnosisError, EarlierError, SimulationError
from shipdrag_ros.fields import (
    INVALID,
    Key,
    Kind,
    Problems,
    flag,
    list_of,
    number,
    read_keys,
    read_small_text,
    show,
    whole_number,
)
from shipdrag_ros.inference.decision import UNKNOWN, marginals, mixture
from shipdrag_ros.parameter import Parameter, Prior, Shape, log_normal, normal
from shipdrag_ros.posterior import priors
from shipdrag_ros.posterior.compare import ComparedHypotheses, Fitted
from shipdrag_ros.posterior.effects import EffectWay, kept_way
from shipdrag_ros.posterior.hypotheses import Explanation
from shipdrag_ros.ship import Ship
from shipdrag_ros.simulation.effect import Effect, Scope
from shipdrag_ros.simulation.effects import effects_of, find

_SAME_NS = 60 * 10**9  # stops of one ship so near to each other are one
_LENGTHS = 0.01  # relative, by which the lengths of one ship differ


@dataclass(frozen=True)
class EarlierCandidate:
    """
    What may have been missing.

    Attributes
    ----------
    probability
    effects
        Their sizes by the names of the parameters, by name; none: nothing was missing.
    """

    probability: float
    effects: Mapping[str, Mapping[str, Parameter]]


@dataclass(frozen=True)
class EarlierDiagnosis:
    """
    What a diagnosis found in runs of before.

    Attributes
    ----------
    name
        Of the file, for the user.
    ship
        Her name; '' where it is not known.
    length_m
        Of the ship; None where it is not known.
    runs
        That it rests on.
    before
        Runs of the diagnoses that were given to it, which it holds already.
    candidates
        With a name, or nothing; what their probabilities leave to 1 says nothing.
    of_force
        Whether the force was held against a stated baseline, so that it speaks of the hull.
    stated
        Effects that the ship file stated, so that they were not missing.
    """

    name: str
    ship: str
    length_m: float | None
    runs: tuple[SeenRun, ...]
    before: tuple[SeenRun, ...]
    candidates: tuple[EarlierCandidate, ...]
    of_force: bool
    stated: tuple[str, ...] = ()

    @classmethod
    def of(cls, found: DiagnosisResult, ship: Ship | None, *, name: str) -> EarlierDiagnosis:
        """
        Return what a result says of later runs.

        Parameters
        ----------
        found
            Of runs whose times are known.
        ship
            That they were of; None where none is known.
        name
            For the user.

        Raises
        ------
        DiagnosisError
            If its verdict waits for an answer, or no run is known.
        """
        return _diagnosis(json.loads(json_text(document(found, ship))), name)

    @property
    def last_ns(self) -> int:
        """When its last run was stopped [ns since the epoch]."""
        return max((run.time_ns for run in self.runs), default=0)

    def probability(self, name: str) -> float:
        """Return how probable it was that an effect was there."""
        return math.fsum(each.probability for each in self.candidates if name in each.effects)


def check(latest_first: Sequence[EarlierDiagnosis], ship: Ship, runs: Sequence[SeenRun]) -> None:
    """
    Refuse what cannot count for the runs at hand.

    Parameters
    ----------
    latest_first
        Earlier diagnoses.
    ship
        Of the runs.
    runs
        That are diagnosed.

    Raises
    ------
    EarlierError
        If one is of another ship or of later runs, or holds a run that would count twice.
    """
    for each in latest_first:
        if not each.runs:
            raise EarlierError(f'{each.name}: when its runs were is not known; leave it out')
        _refuse_other_ship(each, ship)
    _refuse_twice(latest_first, runs)
    first_ns = min(run.time_ns for run in runs)
    for each in latest_first:
        if each.last_ns > first_ns:
            raise EarlierError(
                f'{each.name}: its run of {utc(each.last_ns)} is later than the first one '
                f'diagnosed here, {utc(first_ns)}; give diagnoses of runs of before with '
                '--earlier FILE'
            )


def _refuse_other_ship(earlier: EarlierDiagnosis, ship: Ship) -> None:
    other = bool(earlier.ship and ship.name) and earlier.ship != ship.name
    if earlier.length_m is not None:
        other = other or abs(earlier.length_m / ship.length_m - 1.0) > _LENGTHS
    if other:
        length = '' if earlier.length_m is None else f' of {earlier.length_m:g} m'
        raise EarlierError(
            f'{earlier.name}: it is of the ship {earlier.ship!r}{length}, and these runs are of '
            f'{ship.name!r} of {ship.length_m:g} m; give diagnoses of one ship with --earlier FILE'
        )


def _refuse_twice(earlier: Sequence[EarlierDiagnosis], runs: Sequence[SeenRun]) -> None:
    """Refuse a run that would count twice."""
    known: list[tuple[SeenRun, str]] = [(run, 'here') for run in runs]
    for each in earlier:
        own = (*each.runs, *each.before)
        for run in own:
            twice = [
                where for other, where in known if abs(other.time_ns - run.time_ns) < _SAME_NS
            ]
            if twice:
                raise EarlierError(
                    f'{each.name}: it holds the run of {utc(run.time_ns)} ({run.name}), which '
                    f'counts {twice[0]} already; a run counts once, so leave one of them out'
                )
        known += [(run, f'in {each.name}') for run in own]


_LARGEST = 1_000_000  # bytes of a file
_MOST = 1000  # runs or candidates
_LATEST_NS = 2**62
_NOTHING, _UNKNOWN = 'none', 'unknown'
_EXPECTED = 'give what `shipdrag diagnose` wrote as JSON with --earlier FILE'


def read_earlier(path: str | PathLike[str]) -> EarlierDiagnosis:
    """
    Read what a diagnosis found.

    Parameters
    ----------
    path
        JSON that `shipdrag diagnose` wrote.

    Returns
    -------
    EarlierDiagnosis

    Raises
    ------
    DiagnosisError
        If it cannot be read, or is no such file; the message says what is wrong.
    """
    try:
        text = read_small_text(path, most_bytes=_LARGEST)
        given = json.loads(text, parse_constant=_refuse)
    except OSError as error:
        raise _wrong(path, error.strerror) from error
    except RecursionError as error:
        raise _wrong(path, 'nested too deeply') from error
    except ValueError as error:
        raise _wrong(path, f'not JSON: {error}') from error
    return _diagnosis(given, str(path))


def _wrong(name: str | PathLike[str], why: str | None) -> DiagnosisError:
    return DiagnosisError(f'{name}: {why}; {_EXPECTED}')


def _refuse(word: str) -> NoReturn:
    raise ValueError(f'{word} is no number')


def _object(**kinds: Kind) -> Kind:
    """Expect names with values; those of another version are passed over."""
    keys = {name: Key(kind, 'of the result', MISSING) for name, kind in kinds.items()}
    expectation = 'names with values'

    def read(value: object, path: str, problems: Problems) -> Any:
        if not isinstance(value, dict):
            problems.append(f'{path or "the document"}: {show(value)}, expected {expectation}')
            return INVALID
        before = len(problems)
        given = {name: value[name] for name in keys if name in value}
        found = read_keys(keys, given, path, problems)
        return INVALID if len(problems) > before else found

    return Kind(read, expectation)


def _or_null(kind: Kind) -> Kind:
    def read(value: object, path: str, problems: Problems) -> Any:
        return None if value is None else kind.read(value, path, problems)

    return Kind(read, kind.expectation)


def _read_line(value: object, path: str, problems: Problems) -> Any:
    if isinstance(value, str) and value.isprintable():
        return value
    problems.append(f'{path}: {show(value)}, expected a line of text')
    return INVALID


def _read_name(value: object, path: str, problems: Problems) -> Any:
    try:
        return find(str(value)).name
    except SimulationError:
        problems.append(f'{path}: {show(value)} is no effect that this version knows')
        return INVALID


def _read_effect(value: object, path: str, problems: Problems) -> Any:
    """Return name and sizes; what is of its day says nothing today, and may lack them."""
    found = _object(name=_NAME).read(value, path, problems)
    if found is INVALID:
        return INVALID
    effect = find(found['name'])
    sizes = {q.name: _SIZE for q in effect.parameters} if effect.lasts_s > 0.0 else {}
    given = _object(parameters=_object(**sizes)).read(value, path, problems)
    return INVALID if given is INVALID else (effect.name, given['parameters'])


_many = partial(list_of, maximum=_MOST)
_LINE, _NAME = Kind(_read_line, 'a line of text'), Kind(_read_name, 'the name of an effect')
_SIZE = _object(value=number(-1e12, 1e12), sd=_or_null(number(0.0, 1e12)))
_RUNS = _many(_object(bag=_LINE, time_ns=whole_number(0, _LATEST_NS, 'ns since the epoch')))
_CANDIDATE = _object(
    probability=number(0.0, 1.0),
    names=_many(_LINE),
    effects=_many(Kind(_read_effect, 'name and parameters')),
)
_DOCUMENT = _object(
    runs=_RUNS,
    ship=_or_null(_object(name=_LINE, length_m=number(1e-3, 1e4), effects=_many(_NAME))),
    earlier=_many(_object(runs=_RUNS, used=flag())),
    candidates=_many(_CANDIDATE),
)


def _diagnosis(read: Any, name: str) -> EarlierDiagnosis:
    problems: Problems = []
    given = {'ship': None, **read} if isinstance(read, dict) else read
    found = _DOCUMENT.read(given, '', problems)
    if problems:
        raise _wrong(name, problems[0])
    if not found['runs']:
        raise _wrong(name, 'runs: empty, and when it was made is not known')
    if given.get('question'):
        asked = f'{show(given["question"])}; diagnose its runs again'
        raise _wrong(name, f'question: its verdict waits for the answer: {asked}')
    of_force, ship = given.get('baseline') == 'stated', found['ship']
    before = [run for each in found['earlier'] if each['used'] for run in each['runs']]
    return EarlierDiagnosis(
        name,
        ship['name'] if ship else '',
        ship['length_m'] if ship else None,
        _seen(found['runs']),
        _seen(before),
        _candidates(found['candidates'], name, all_sized=of_force),
        of_force,
        ship['effects'] if ship else (),
    )


def _seen(runs: Iterable[Mapping[str, Any]]) -> tuple[SeenRun, ...]:
    return tuple(SeenRun(run['bag'], run['time_ns']) for run in runs)


def _candidates(
    listed: Sequence[Mapping[str, Any]], name: str, *, all_sized: bool
) -> tuple[EarlierCandidate, ...]:
    found = []
    for i, each in enumerate(listed):
        names = each['names']
        sizes = {
            effect: {
                # null: it could not be found
                key: Parameter(size['value'], math.nan if size['sd'] is None else size['sd'])
                for key, size in parameters.items()
            }
            for effect, parameters in each['effects']
        }
        if names == (_UNKNOWN,):
            continue
        named = set() if names == (_NOTHING,) else set(names)
        # without a baseline, an effect that could not be seen has no size
        if not names or ((sizes or all_sized) and named != set(sizes)):
            why = f'candidates[{i}]: the names are {show(list(names))}, and the effects others'
            raise _wrong(name, why)
        found.append(EarlierCandidate(each['probability'], sizes))
    total = math.fsum(each.probability for each in found)
    if not listed or total > 1.0 + 1e-6:
        raise _wrong(name, f'candidates: {len(listed)} of probability {total:g} in all')
    return tuple(found)


_HALF = priors.EARLIER_COUNTS.mean
_WIDEST = 1.0  # sd of the logarithm of a size ...
_WIDE = 2.0  # ... and a relative sd that is wider
_LEAST = 0.01  # probability that is worth a word


@dataclass(frozen=True)
class _Weighed:
    """
    One diagnosis, with what of it still holds.

    Attributes
    ----------
    diagnosis
    stays
        Probability that each effect, where it was there, is there still and as it
        was; without those of which it says nothing.
    unused
        Why it says nothing of an effect that it found, a sentence each.
    """

    diagnosis: EarlierDiagnosis
    stays: Mapping[str, float]
    unused: tuple[str, ...] = ()

    def log_weight(self, there: Collection[str], kept: Collection[str]) -> float:
        """
        Return the logarithm of by how much effects are likelier than without it.

        Parameters
        ----------
        there
            All that are there today.
        kept
            Those of them that are as this diagnosis found them.
        """
        known = math.fsum(each.probability for each in self.diagnosis.candidates)
        weight = 0.0 if kept else max(1.0 - known, 0.0)
        for each, ratio in zip(self.diagnosis.candidates, self._halved, strict=True):
            for name, stays in self.stays.items():
                was = name in each.effects
                ratio *= _ratio(find(name), stays, was=was, there=name in there, kept=name in kept)
            weight += ratio
        return math.log(weight) if weight > 0.0 else -math.inf

    @cached_property
    def _halved(self) -> list[float]:
        """Probabilities of the candidates, were the likelihood of each its root."""
        candidates = self.diagnosis.candidates
        prior = [math.prod(find(name).odds for name in each.effects) for each in candidates]
        found = [
            each.probability**_HALF * odds ** (1.0 - _HALF)
            for each, odds in zip(candidates, prior, strict=True)
        ]
        total = math.fsum(found)
        known = math.fsum(each.probability for each in candidates)
        return [known * each / total if total else 0.0 for each in found]


def _ratio(effect: Effect, stays: float, *, was: bool, there: bool, kept: bool) -> float:
    """
    Return by how much likelier an effect is there, or is not, as it was there or was not.

    Notes
    -----
    A chain of two states whose share in the long run is the prior probability. That a
    diagnosis does not list an effect says less than that it does: runs do not show all.
    """
    prior = effect.odds / (1.0 + effect.odds)
    if not was:
        stays *= 1.0 - priors.EARLIER_UNSEEN.mean
    if kept:
        return stays / prior if was else 0.0
    if there or was:
        return 1.0 - stays
    return (1.0 - (1.0 - stays) * prior) / (1.0 - prior)


@dataclass(frozen=True)
class Carried:
    """
    All that earlier diagnoses say of the runs at hand.

    Attributes
    ----------
    ship
        For the priors of the sizes.
    now_ns
        When the first run was stopped [ns since the epoch].
    weighed
        The latest first.
    """

    ship: Ship
    now_ns: int
    weighed: tuple[_Weighed, ...]

    def log_weight(self, hypothesis: Explanation) -> float:
        """
        Return the log evidence of the diagnoses for a hypothesis.

        Parameters
        ----------
        hypothesis
            About the runs at hand.

        Returns
        -------
        float
            0 on the average over the priors of the effects.
        """
        ways = [way for way in hypothesis.ways if not way.stated]
        there = {way.effect.name for way in ways}
        kept = {way.effect.name for way in ways if way.kept}
        return math.fsum(
            each.log_weight(there, {name for name in kept if self._source(name) is each})
            for each in self.weighed
        )

    def ways(self, effects: Sequence[Effect]) -> list[EffectWay]:
        """
        Return effects that are as they were found; of each that a diagnosis held possible.
        """
        return [
            kept_way(effect, self._kept[effect.name], self.ship)
            for effect in effects
            if effect.name in self._kept
        ]

    @cached_property
    def _kept(self) -> dict[str, tuple[Prior, ...]]:
        found = {}
        for name in {name for each in self.weighed for name in each.stays}:
            source = self._source(name)
            if source is not None:
                found[name] = self._sizes(find(name), source)
        return {name: priors for name, priors in found.items() if priors}

    def judged(self, found: ComparedHypotheses[Fitted]) -> tuple[WeighedEarlier, ...]:
        """
        Return what of each diagnosis counts, and what has become of it; the latest first.
        """
        now = marginals(found.probability)
        return tuple(
            WeighedEarlier(
                each.diagnosis.name,
                each.diagnosis.runs,
                tuple(
                    CarriedEffect(
                        name,
                        then,
                        stays,
                        now.get(name, 0.0),
                        resized=self._source(name) is each and _resized(name, found),
                    )
                    for name, stays in each.stays.items()
                    if (then := each.diagnosis.probability(name)) >= _LEAST
                ),
                each.unused,
                before=each.diagnosis.before,
            )
            for each in self.weighed
        )

    def _source(self, name: str) -> _Weighed | None:
        """Return the latest diagnosis that holds an effect possible."""
        for each in self.weighed:
            if each.stays.get(name, 0.0) > 0.0 and each.diagnosis.probability(name) > 0.0:
                return each
        return None

    def _sizes(self, effect: Effect, source: _Weighed) -> tuple[Prior, ...]:
        """Return priors of sizes about those found, wider by the time that has passed."""
        lasted = (self.now_ns - source.diagnosis.last_ns) * 1e-9 / effect.lasts_s
        holding = [each for each in source.diagnosis.candidates if effect.name in each.effects]
        sizes_now = []
        for quantity in effect.parameters_of(self.ship):
            sizes = [each.effects[effect.name][quantity.name] for each in holding]
            shares = [each.probability for each in holding]
            mean, found = mixture((p, size.value, _sd(size)) for p, size in zip(shares, sizes))
            sd = math.hypot(found / _HALF**0.5, mean * (priors.EARLIER_SIZE.sd + lasted))
            sizes_now.append(_about(quantity.prior, mean, sd))
        return tuple(sizes_now) if all(each.second > 0.0 for each in sizes_now) else ()


def _resized(name: str, found: ComparedHypotheses[Fitted]) -> bool:
    """Say whether an effect is likelier of any size than as it was found."""
    for names in found.probability:
        if name in names and names != UNKNOWN:
            ways = [way for way in found.best[names].hypothesis.ways if not way.stated]
            return not any(way.kept for way in ways if way.effect.name == name)
    return False


def _sd(size: Parameter) -> float:
    """Return the sd of a size; as large as itself where it is not known."""
    return abs(size.value) if math.isnan(size.sd) else size.sd


def _about(vague: Prior, mean: float, sd: float) -> Prior:
    """Return the prior of a size about what was found; of no width where there is none."""
    if vague.shape is Shape.NORMAL:
        return normal(sd, mean=mean)
    if mean <= 0.0:
        return normal(0.0)
    relative = min(sd / mean, _WIDE)  # a file may state any; the square of a large one overflows
    return log_normal(mean, min(math.sqrt(math.log1p(relative**2)), _WIDEST))


def carried(
    earlier: Sequence[EarlierDiagnosis],
    ship: Ship,
    runs: Sequence[SeenRun],
    facts: Facts,
    sought: Collection[str],
) -> Carried | None:
    """
    Hold earlier diagnoses against what is to be diagnosed.

    Parameters
    ----------
    earlier
        In any order.
    ship
        Of the runs; what her file states is not missing.
    runs
        That are diagnosed.
    facts
        Of the log book: what is dated between ends an effect.
    sought
        Names of the effects that her ship file and the runs can show.

    Returns
    -------
    Carried or None
        None without an earlier diagnosis.

    Raises
    ------
    DiagnosisError
        If one is of another ship, of later runs, or holds a run that would count twice.
    """
    if not earlier:
        return None
    latest_first = sorted(earlier, key=lambda each: -each.last_ns)
    now_ns = min(run.time_ns for run in runs)
    check(latest_first, ship, runs)
    weighed = []
    of_hull = next((each for each in latest_first if each.of_force), None)
    stated = {one.name for one in ship.effects}
    for each in latest_first:
        stays, unused = {}, []
        for name, effect in effects_of(ship).items():
            why = _unused(effect, each, stated, of_hull)
            if not why and name not in sought:
                why = 'neither her ship file nor an instrument of these runs can show it'
            if not why:
                stays[name] = _stays(effect, each, now_ns, facts)
            elif each.probability(name) >= _LEAST:
                unused.append(f'{name.replace("_", " ")}: {why}')
        weighed.append(_Weighed(each, stays, tuple(unused)))
    return Carried(ship, now_ns, tuple(weighed))


def _unused(
    effect: Effect,
    earlier: EarlierDiagnosis,
    stated: Collection[str],
    of_hull: EarlierDiagnosis | None,
) -> str:
    """Say why a diagnosis says nothing of an effect; '' where it does."""
    if effect.lasts_s <= 0.0:
        return 'water, weather and what was done in a run are of their day'
    if effect.name in stated or effect.name in earlier.stated:
        return 'the ship file states it, now or then'
    if effect.scope is Scope.HULL and earlier is not of_hull:
        # two that rest on one baseline are no two witnesses
        known = 'no baseline was stated' if of_hull is None else f'{of_hull.name} is later'
        return f'of the hull the latest diagnosis counts, and {known}'
    return ''


def _stays(effect: Effect, earlier: EarlierDiagnosis, now_ns: int, facts: Facts) -> float:
    """Return how probable it is that an effect that was found is still there as it was."""
    passed_s = (now_ns - earlier.last_ns) * 1e-9
    stays = (1.0 - priors.EARLIER_ERRS.mean) * math.exp(-passed_s / effect.lasts_s)
    for stated in facts.stated:
        since_ns = stated.fact.time_ns
        ended = since_ns is not None and earlier.last_ns <= since_ns <= now_ns
        if ended and stated.fact.name in effect.facts:
            stays *= stated.fact.rate
    return stays
