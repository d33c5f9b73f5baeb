# SPDX-License-Identifier: Apache-2.0
"""
What a coastdown from here would show, said before the engine is stopped.

It is simulated with the ship of the file, from the present speed and with the present instruments,
and diagnosed as one that was made: from what size on would each effect be named.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from shipdrag_ros.diagnosis import words
from shipdrag_ros.diagnosis.diagnose import diagnose
from shipdrag_ros.diagnosis.observation import CoastRun
from shipdrag_ros.diagnosis.result import DiagnosisResult
from shipdrag_ros.display import ship_speed, utc
from shipdrag_ros.errors import DiagnosisError
from shipdrag_ros.estimation import Window
from shipdrag_ros.estimation.record import weighted_white_sd
from shipdrag_ros.inference import priors as usual
from shipdrag_ros.parameters import Parameters
from shipdrag_ros.posterior.weather import measured_by, with_usual_shape
from shipdrag_ros.samples import SECOND_NS, Channel
from shipdrag_ros.ship import Ship, StatedEffect
from shipdrag_ros.simulation import START_NS, Scenario, Sensor, sense, simulate
from shipdrag_ros.simulation.effects import find
from shipdrag_ros.simulation.scenario import GaussMarkov
from shipdrag_ros.simulation.sensors import STANDARD_SD

_NOW_S = 120.0  # that are now
_LEAST = 12  # readings of an instrument, to show its scatter
_SLOWINGS = 3.0  # of m u / R: to a quarter of the speed, by quadratic drag


class CoastAhead(NamedTuple):
    """
    What a coastdown from here would show.

    Attributes
    ----------
    as_of_ns
        When the steady record ended [ns since the epoch].
    speed_m_s
        Through water, from which it would begin.
    mass_kg
        Of the ship: speeds are in knots, those of a model in m/s.
    duration_s
        How long it would last.
    found
        The diagnosis of one in which nothing is missing; its `limits` count.
    """

    as_of_ns: int
    speed_m_s: float
    mass_kg: float
    duration_s: float
    found: DiagnosisResult

    @property
    def sentence(self) -> str:
        """What it would show, in words."""
        shown = words.shown(self.found)
        begun = (
            f'A coastdown from {ship_speed(self.speed_m_s, self.mass_kg)}, '
            f'{self.duration_s / 60.0:.0f} min long, would'
        )
        named = f'name, nine times in ten{shown}' if shown else 'name no effect of any size'
        clean = ', '.join(
            f'{words.names_text([name])} above {limit.percent_of_r:.0f} % of r'
            for name, limit in self.found.limits.items()
            if 'hull_cleaned' in find(name).facts and not math.isnan(limit.percent_of_r)
        )
        of_clean = f'; if the hull is clean, rule out {clean}' if clean else ''
        return f'{begun} {named}{of_clean} (as of {utc(self.as_of_ns)}).'


def look_ahead(lead: Window, ship: Ship, parameters: Parameters) -> CoastAhead:
    """
    Say what a coastdown would show that begins where a steady record ends.

    Parameters
    ----------
    lead
        Steady sailing up to now.
    ship
        Her file; without a baseline a usual hull slows down.
    parameters
        As for a diagnosis.

    Raises
    ------
    DiagnosisError
        If no instrument tells the speed of now, or it is not above that of `froude_min`.
    SimulationError
        If the ship file cannot be simulated.

    Notes
    -----
    The instruments have their own rates and scatter; slow disturbances are the medians of the
    prior of the noise, the air is still and the water as deep as it is read, or deep.
    """
    speed_m_s = _speed(lead)
    hull = with_usual_shape(ship)
    low_m_s = float(hull.speed(parameters.froude_min))
    if not speed_m_s > low_m_s:
        now, low = (ship_speed(each, hull.mass_kg) for each in (speed_m_s, low_m_s))
        raise DiagnosisError(
            f'nothing would be read, as {now} is not above {low}, which is that of froude_min'
        )
    force = float(hull.resistance_n(speed_m_s)) / hull.mass_kg
    inertia = 1.0 + float(hull.n_r(speed_m_s))
    slowing_s = inertia * speed_m_s / force
    lead_s = (lead.end_ns - lead.start_ns) / SECOND_NS
    calm = min(speed_m_s / usual.WATER_SPEED.mean, 1.0)
    gust_s = usual.GUST_TIME.mean / math.sqrt(2.0 / slowing_s)
    sensors, depth_m, effects = _sensors(lead, speed_m_s), Scenario.depth_m, []
    if any(each.channel is Channel.DEPTH for each in sensors):
        effect = measured_by('depth')
        depth = effect.parameters_of(hull)[0]
        depth_m = min(max(float(np.median(lead.depth.value)), depth.low), depth.high)
        effects = [StatedEffect(effect.name, {depth.name: replace(depth, value=depth_m)})]
    truth = simulate(
        hull,
        Scenario(
            speed_m_s=speed_m_s,
            lead_in_s=lead_s,
            duration_s=min(_SLOWINGS * slowing_s, parameters.window_s),
            depth_m=depth_m,
            water_speed=GaussMarkov(calm * usual.WATER.mean, usual.WATER_TIME.mean),
            gust_force=GaussMarkov(usual.GUST.mean * force * hull.mass_kg, gust_s),
        ),
        effects=effects,
    )
    block = sense(truth, sensors, seed=1)
    slow = truth.speed_through_water_m_s < low_m_s
    ended = truth.time_s[np.argmax(slow)] if slow.any() else truth.time_s[-1]
    begun_ns = START_NS + round(lead_s * SECOND_NS)
    end_ns = START_NS + round(float(ended - truth.time_s[0]) * SECOND_NS)
    window = Window.from_block(block, begun_ns, end_ns, before_ns=START_NS)
    run = CoastRun('a coastdown from here', replace(window, geodetic=lead.geodetic))
    as_simulated = replace(parameters, heading_convention='rep103')
    found = diagnose([run], ship, as_simulated, advise=False)
    return CoastAhead(lead.end_ns, speed_m_s, hull.mass_kg, (end_ns - begun_ns) / SECOND_NS, found)


def _since_ns(lead: Window) -> int:
    """Return since when it is now [ns]."""
    return lead.end_ns - round(_NOW_S * SECOND_NS)


def _speed(lead: Window) -> float:
    """Return the speed of now [m/s]."""
    since_ns = _since_ns(lead)
    for series in lead.each('speed_through_water', 'speed_over_ground', 'position'):
        now = series[int(np.searchsorted(series.time_ns, since_ns)) :]
        if len(now) < _LEAST:
            continue
        if now.value.ndim == 1:
            return float(np.median(now.value))
        half = len(now) // 2
        early, late = now[:half], now[half:]
        way = late.value.mean(axis=0) - early.value.mean(axis=0)
        time_s = (late.time_ns.mean() - early.time_ns.mean()) / SECOND_NS
        return float(np.hypot(*way) / time_s)
    raise DiagnosisError(
        f'no input has told the speed {_LEAST} times in the last {_NOW_S / 60.0:.0f} minutes'
    )


def _sensors(lead: Window, speed_m_s: float) -> list[Sensor]:
    """Return the instruments that are heard now, with their rates and their scatter."""
    found = []
    for channel in STANDARD_SD:
        series = lead.series(channel.input)
        if len(series) < _LEAST or series.time_ns[-1] < _since_ns(lead):
            continue
        span_s = (series.time_ns[-1] - series.time_ns[0]) / SECOND_NS
        value = np.unwrap(series.value) if channel.kind is Channel.HEADING else series.value
        even = np.ones(len(value))
        sd = max(weighted_white_sd(column, even) for column in np.atleast_2d(value.T))
        slow = None
        if channel.kind is Channel.SPEED_THROUGH_WATER:
            size = max(usual.LOG.mean * sd, usual.LOG_LEAST.mean * speed_m_s)
            slow = GaussMarkov(size, usual.LOG_TIME.mean)
        elif channel.kind is Channel.POSITION:
            slow = GaussMarkov(usual.PLACE.mean * speed_m_s, usual.PLACE_TIME.mean)
        rate_hz = (len(series) - 1) / span_s
        found.append(Sensor(channel=channel, rate_hz=rate_hz, sd=sd, coloured=slow))
    return found
