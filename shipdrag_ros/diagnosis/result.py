# SPDX-License-Identifier: Apache-2.0
"""What a diagnosis says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from shipdrag_ros.display import short_repr
from shipdrag_ros.estimation.result import Estimate
from shipdrag_ros.inference.decision import CERTAIN, Verdict, smallest_set
from shipdrag_ros.parameter import Parameter
from shipdrag_ros.samples import Float64
from shipdrag_ros.ship import Ship
from shipdrag_ros.ship.facts import Fact

FORCE = 'force'  # on the ship, against her baseline
LOG_TRACK = 'log_track'  # the log against the way over ground
DOUBTED = 0.5  # probability that what was stated is wrong, from which the data contradict it


@dataclass(frozen=True)
class SeenRun:
    """
    A run that a diagnosis rests on.

    Attributes
    ----------
    name
        For the user.
    time_ns
        When it was stopped; without a coastdown, when the record begins [ns since the
        epoch].
    """

    name: str
    time_ns: int


@dataclass(frozen=True)
class CarriedEffect:
    """
    An effect that an earlier diagnosis found, and what has become of it.

    Attributes
    ----------
    name
    probability
        That it was there, then.
    stays
        That it is there still and as it was, if it was, before the runs at hand.
    now
        That it is there, with the runs at hand.
    resized
        Whether it is there, if it is, of another size or sign than was found then.
    """

    name: str
    probability: float
    stays: float
    now: float
    resized: bool = False

    @property
    def contradicted(self) -> bool:
        """Whether the runs at hand contradict it, or its size."""
        expected = self.probability * self.stays > DOUBTED
        return expected and (self.resized or self.now < DOUBTED)


@dataclass(frozen=True)
class WeighedEarlier:
    """
    An earlier diagnosis, and what of it counts.

    Attributes
    ----------
    name
        Of its file.
    runs
        That it holds.
    effects
        Of hull and instruments, that count; empty: it held none of them probable.
    unused
        What of it does not count, and why, a sentence each.
    used
        Whether it counts at all.
    before
        Runs of the diagnoses that were given to it, which it holds already.
    """

    name: str
    runs: tuple[SeenRun, ...]
    effects: tuple[CarriedEffect, ...] = ()
    unused: tuple[str, ...] = ()
    used: bool = True
    before: tuple[SeenRun, ...] = ()


@dataclass(frozen=True)
class EffectEstimate:
    """
    An effect with its size.

    Attributes
    ----------
    name
    probability
        Over all hypotheses that hold it; of a candidate, that of the candidate.
    parameters
        In their units.
    """

    name: str
    probability: float
    parameters: Mapping[str, Parameter]


@dataclass(frozen=True)
class Candidate:
    """
    One name, or a pair.

    Attributes
    ----------
    names
        Empty: nothing is missing; `UNKNOWN`: something without a name.
    probability
    effects
        The same with the sizes that they would have.
    """

    names: tuple[str, ...]
    probability: float
    effects: tuple[EffectEstimate, ...] = ()


@dataclass(frozen=True)
class Limit:
    """
    How large an effect that is not named can be.

    Attributes
    ----------
    parameter
        Name of its size.
    bound
        `upper_95`, or `lower_95` of one that is the stronger the smaller its parameter is.
    value
        The bound, of the absolute size, given that the effect is there.
    would_be_named
        Least size that nine of ten such runs name; 0: any, None: none that is thought of.
    percent_of_r
        Of the resistance that the run shows, at the bound.
    """

    parameter: str
    bound: str
    value: float
    would_be_named: float | None
    percent_of_r: float


@dataclass(frozen=True)
class Advice:
    """
    What would decide, and how probably it would.

    Attributes
    ----------
    measure
        What to do, in words.
    probability
        That something is named after it; None: not known.
    cost
        Of the crew, in words.
    """

    measure: str
    probability: float | None
    cost: str = ''


@dataclass(frozen=True)
class RunSize:
    """
    The size of an effect in one of some runs that differ.

    Attributes
    ----------
    run
        Its name.
    effect, parameter
        Names.
    size
        With its standard deviation.
    """

    run: str
    effect: str
    parameter: str
    size: Parameter


@dataclass(frozen=True)
class WeighedFact:
    """
    A fact of the log book, and what the data say of it.

    Attributes
    ----------
    fact
    run
        Its name; '' where the fact is stated of all runs.
    wrong
        Probability that the fact is wrong; None: it says nothing about what was
        examined.
    against
        Effects of the most probable hypothesis that contradicts it.
    """

    fact: Fact
    run: str
    wrong: float | None
    against: tuple[str, ...] = ()

    @property
    def contradicted(self) -> bool:
        """Whether the data contradict it."""
        return self.wrong is not None and self.wrong > DOUBTED


@dataclass(frozen=True)
class Where:
    """
    Where model and data disagree.

    Attributes
    ----------
    channel
        'log', 'radar', 'log_radar' or 'force'.
    time_s
        After the stop, from .. to.
    speed_m_s
        From .. to.
    """

    channel: str
    time_s: tuple[float, float]
    speed_m_s: tuple[float, float]


@dataclass(frozen=True)
class Gap:
    """
    How far model and data are apart.

    Attributes
    ----------
    rms_speed_m_s, rms_position_m
        None without such a measurement.
    chi2_per_sample
        Of residuals whitened by the noise of the steady record.
    """

    rms_speed_m_s: float | None
    rms_position_m: float | None
    chi2_per_sample: float


@dataclass(frozen=True)
class Compared:
    """
    One measured quantity of a run, held against the model.

    Attributes
    ----------
    quantity
        An input; `position` is the distance along the heading, and
        `position_across` the one to port of it.
    time_s : (n,)
        After the engine stop; negative in the steady record.
    speed_m_s : (n,)
        Through water, of the model after.
    measured : (n,)
        Means over short times [m/s or m].
    before, after : (n,)
        Of the model as its file states it, and with what explains the run.
    sd : (n,)
        Of the noise, its slow disturbances included.
    white_before, white_after : (n,)
        Residuals, whitened by that noise: independent, of sd 1.
    """

    quantity: str
    time_s: Float64
    speed_m_s: Float64
    measured: Float64
    before: Float64
    after: Float64
    sd: Float64
    white_before: Float64
    white_after: Float64


@dataclass(frozen=True)
class RunTrace:
    """
    A run.

    Attributes
    ----------
    name
        For the user.
    lead_in_s
        Length of the steady record, from which the noise is learnt.
    compared
        Each quantity that was measured.
    """

    name: str
    lead_in_s: float
    compared: tuple[Compared, ...]


@dataclass(frozen=True)
class DiagnosisResult:
    """
    The result.

    Attributes
    ----------
    verdict
    effects
        Of `named`, otherwise empty.
    candidates
        The smallest set that holds 99 %, most probable first.
    nothing, unnamed
        Probabilities that nothing, and that something without a name is missing.
    would_decide
    where
        None where model and data agree.
    before, after, held_out_before, held_out_after
        The last two are None with one run, and where no effect was added.
    baseline
        'stated', 'fitted_here' or 'none'.
    best
        Effects of the most probable candidate, named or not.
    notes
        For the reader.
    traces
        Each run, measured and simulated: before, and after the effects of `best`
        are added; after where nothing is missing: the baseline moved as far as
        the runs ask for; where it is unknown: with something smooth instead.
    coastdowns_used
        Number of coastdowns that the diagnosis rests on.
    examined
        Of `FORCE` and `LOG_TRACK`, what the runs could show; a verdict `none`
        speaks of these alone.
    no_coastdown
        Where none is used: that none was found and why, a sentence.
    estimates
        r(v) of the coastdowns as measured, where they were estimated.
    in_runs
        The ship as she was in all runs, with her mass then; None: as in her file.
    facts
        All that were stated, with what the data say of each.
    runs_differ
        Where no one size of an effect fits all runs: the size in each. The
        effects above have that of the last run.
    runs
        That it rests on.
    earlier
        Diagnoses of before that were given, with what of each counts.
    limits
        By name, of each effect that is not named.
    question
        That is to be answered before anything is judged, a sentence; '' for none.
    """

    __repr__ = short_repr

    verdict: Verdict
    before: Gap
    baseline: str
    effects: tuple[EffectEstimate, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    nothing: float = 0.0
    unnamed: float = 0.0
    would_decide: tuple[Advice, ...] = ()
    where: Where | None = None
    after: Gap | None = None
    held_out_before: Gap | None = None
    held_out_after: Gap | None = None
    best: tuple[EffectEstimate, ...] = ()
    notes: tuple[str, ...] = ()
    traces: tuple[RunTrace, ...] = ()
    coastdowns_used: int = 0
    examined: tuple[str, ...] = ()
    no_coastdown: str = ''
    facts: tuple[WeighedFact, ...] = ()
    runs_differ: tuple[RunSize, ...] = ()
    estimates: tuple[Estimate, ...] = ()
    in_runs: Ship | None = None
    runs: tuple[SeenRun, ...] = ()
    earlier: tuple[WeighedEarlier, ...] = ()
    question: str = ''
    limits: Mapping[str, Limit] = field(default_factory=dict)

    @property
    def held(self) -> tuple[Candidate, ...]:
        """The smallest set that holds 90 %, most probable first."""
        probability = {each.names: each.probability for each in self.candidates}
        return self.candidates[: len(smallest_set(probability, CERTAIN))]
