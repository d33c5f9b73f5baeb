# SPDX-License-Identifier: Apache-2.0
"""
Ways to differentiate noisy speeds that others offer, as the benchmarks compare with.

Each is a function from the samples of one coastdown to speed and acceleration,
with its own rule for how much to smooth. None knows of the equation of motion.
`make peers` installs what they need.
"""

from __future__ import annotations

import warnings
from dataclasses import asdict, dataclass

import numpy as np
from scipy.interpolate import make_smoothing_spline
from scipy.signal import savgol_filter
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
from statsmodels.tsa.statespace.mlemodel import MLEModel

from shipdrag_ros.estimation import Window
from shipdrag_ros.samples import Float64

with warnings.catch_warnings():
    warnings.simplefilter('ignore')  # it misses methods that need a convex solver
    import pynumdiff
    from pynumdiff.optimize import optimize

DEGREES = range(1, 21)
SAVGOL_ORDER = 3
GAUSS_SAMPLES = 500  # more are thinned: a Gaussian process takes time by the cube
PERIODS = 2.0  # a coastdown holds about one e-folding of the speed


@dataclass(frozen=True)
class Samples:
    """
    One coastdown, log and position read at the same times.

    Attributes
    ----------
    time_s : (n,)
        From the first sample on, ascending.
    speed_m_s : (n,)
        Of the log.
    distance_m : (n,)
        Along the track.
    """

    time_s: Float64
    speed_m_s: Float64
    distance_m: Float64

    @classmethod
    def of(cls, window: Window) -> Samples:
        """
        Take log and position out of a window; the track is straight.
        """
        log, position = window.speed_through_water, window.position
        if not np.array_equal(log.time_ns, position.time_ns):
            raise ValueError('log and position are not read at the same times')
        east_north = position.value - position.value.mean(axis=0)
        _, _, (along, _) = np.linalg.svd(east_north, full_matrices=False)
        distance = east_north @ along
        return cls(
            (log.time_ns - log.time_ns[0]) * 1e-9,
            log.value,
            distance * np.sign(distance[-1] - distance[0]),
        )

    @property
    def step_s(self) -> float:
        """Spacing of the samples, which are even."""
        return float(np.median(np.diff(self.time_s)))


@dataclass(frozen=True)
class Motion:
    """
    What a peer finds.

    Attributes
    ----------
    speed_m_s, acceleration_m_s2 : (m,)
        In the order of time.
    sd_m_s2 : (m,), optional
        Standard deviation of the acceleration where the peer states one.
    """

    speed_m_s: Float64
    acceleration_m_s2: Float64
    sd_m_s2: Float64 | None = None


def chebyshev(samples: Samples) -> Motion:
    """
    Fit Chebyshev series by least squares; take the degree of least BIC.
    """
    n = len(samples.time_s)
    best, least = None, np.inf
    for degree in DEGREES:
        fit = np.polynomial.Chebyshev.fit(samples.time_s, samples.speed_m_s, degree)
        residual = samples.speed_m_s - fit(samples.time_s)
        bic = n * np.log(np.mean(residual**2)) + (degree + 2) * np.log(n)
        if bic < least:
            best, least = fit, bic
    assert best is not None
    return Motion(best(samples.time_s), best.deriv()(samples.time_s))


def savitzky_golay(samples: Samples) -> Motion:
    """
    Smooth by scipy's filter; the window has the least cross-validated error.

    Notes
    -----
    Leaving out one sample changes its residual by 1 / (1 - h), h what the
    sample weighs in its own smoothed value.
    """
    speed = samples.speed_m_s
    n = len(speed)
    best, least = 0, np.inf
    for half in np.unique(np.geomspace(3, n // 2 - 1, 25).astype(int)):
        length = 2 * half + 1
        basis = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, length), SAVGOL_ORDER + 1))[0]
        own = np.sum(basis**2, axis=1)
        leverage = np.full(n, own[half])
        leverage[:half], leverage[n - half :] = own[:half], own[half + 1 :]
        residual = speed - savgol_filter(speed, length, SAVGOL_ORDER)
        error = np.mean((residual / (1.0 - leverage)) ** 2)
        if error < least:
            best, least = length, error
    return Motion(
        savgol_filter(speed, best, SAVGOL_ORDER),
        savgol_filter(speed, best, SAVGOL_ORDER, deriv=1, delta=samples.step_s),
    )


def smoothing_spline(samples: Samples) -> Motion:
    """
    Fit scipy's smoothing spline; generalised cross-validation is its own.
    """
    # in units of the spacing: its penalty has a dimension
    spline = make_smoothing_spline(samples.time_s / samples.step_s, samples.speed_m_s)
    at = samples.time_s / samples.step_s
    return Motion(spline(at), spline.derivative()(at) / samples.step_s)


class _ConstantAcceleration(MLEModel):
    """
    Distance, speed, acceleration and current; the jerk is white noise.
    """

    def __init__(self, measured: Float64, step_s: float) -> None:
        super().__init__(measured, k_states=4, k_posdef=3, initialization='diffuse')
        t = step_s
        self['transition'] = np.array(
            [
                [1.0, t, t**2 / 2.0, t],
                [0.0, 1.0, t, 0.0],
                [0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
        self['design'] = np.array([[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
        self['selection'] = np.eye(4)[:, :3]
        self._jerk = np.array(
            [
                [t**5 / 20.0, t**4 / 8.0, t**3 / 6.0],
                [t**4 / 8.0, t**3 / 3.0, t**2 / 2.0],
                [t**3 / 6.0, t**2 / 2.0, t],
            ]
        )

    @property
    def start_params(self) -> Float64:
        """Logarithms of the variances of speed, distance and jerk."""
        noise = np.var(np.diff(self.endog, n=2, axis=0), axis=0) / 6.0
        return np.log([*noise, 1e-10])

    def update(self, params: Float64, **kwargs: object) -> None:
        """
        Take variances.
        """
        super().update(params, **kwargs)
        variance = np.exp(np.clip(params, -80.0, 20.0))
        self['obs_cov'] = np.diag(variance[:2])
        self['state_cov'] = variance[2] * self._jerk


def kalman_rts(samples: Samples) -> Motion:
    """
    Smooth log and position together; variances by maximum likelihood.
    """
    model = _ConstantAcceleration(
        np.column_stack([samples.speed_m_s, samples.distance_m]), samples.step_s
    )
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        found = model.fit(method='lbfgs', disp=0, cov_type='none', maxiter=50)
    state, covariance = found.smoothed_state, found.smoothed_state_cov
    return Motion(state[1], state[2], np.sqrt(np.maximum(covariance[2, 2], 0.0)))


def gaussian_process(samples: Samples) -> Motion:
    """
    Fit scikit-learn's Matern 5/2 process; hyperparameters by its own search.

    More than `GAUSS_SAMPLES` samples are thinned to means of neighbours.
    """
    group = -(-len(samples.time_s) // GAUSS_SAMPLES)
    starts = np.arange(0, len(samples.time_s), group)
    count = np.diff([*starts, len(samples.time_s)])
    time = np.add.reduceat(samples.time_s, starts) / count
    speed = np.add.reduceat(samples.speed_m_s, starts) / count
    scale = float(samples.time_s[-1])
    mean, spread = speed.mean(), speed.std()
    kernel = ConstantKernel(1.0, (1e-2, 1e4)) * Matern(0.3, (1e-2, 1e2), nu=2.5) + WhiteKernel(
        1e-3, (1e-8, 1.0)
    )
    process = GaussianProcessRegressor(kernel, normalize_y=False)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore', ConvergenceWarning)
        process.fit((time / scale)[:, None], (speed - mean) / spread)
    amplitude = float(process.kernel_.k1.k1.constant_value)
    length = float(process.kernel_.k1.k2.length_scale)
    apart = (time[:, None] - time) / (scale * length)
    near = np.sqrt(5.0) * np.abs(apart)
    falling = np.exp(-near)
    value = amplitude * (1.0 + near + near**2 / 3.0) * falling
    slope = -amplitude * 5.0 / 3.0 * apart * (1.0 + near) * falling / (scale * length)
    by_data = np.linalg.solve(process.L_, slope.T)
    prior = amplitude * 5.0 / (3.0 * (scale * length) ** 2)
    variance = np.maximum(prior - np.sum(by_data**2, axis=0), 0.0)
    return Motion(
        mean + spread * (value @ process.alpha_),
        spread * (slope @ process.alpha_),
        spread * np.sqrt(variance),
    )


@dataclass(frozen=True)
class TunedByPynumdiff:
    """
    pynumdiff's Savitzky-Golay derivative, tuned by its own search.

    The best of savgoldiff, splinediff and rtsdiff on these coastdowns, and the
    search over it is short enough.
    """

    degree: int
    window_size: int
    smoothing_win: int

    @classmethod
    def on(cls, samples: Samples, acceleration_m_s2: Float64 | None = None) -> TunedByPynumdiff:
        """
        Search for the parameters on one record.

        Parameters
        ----------
        samples
            The record.
        acceleration_m_s2
            The true one at the samples, for a search against the truth; without
            it the search trades misfit for total variation, at a band limit of
            `PERIODS` periods a record.
        """
        n = len(samples.time_s)
        parameters, _ = optimize(
            pynumdiff.savgoldiff,
            samples.speed_m_s,
            samples.step_s,
            dxdt_truth=acceleration_m_s2,
            bandlimit=None if acceleration_m_s2 is not None else PERIODS / samples.time_s[-1],
            search_space_updates={
                'degree': [3, 5],
                'window_size': [n // 16 | 1, n // 4 | 1, n // 2 | 1],
                'smoothing_win': [3, n // 10 | 1],
            },
            parallel=False,
        )
        return cls(**parameters)

    def __call__(self, samples: Samples) -> Motion:
        """
        Differentiate the speeds.
        """
        speed = samples.speed_m_s
        return Motion(*pynumdiff.savgoldiff(speed, samples.step_s, **asdict(self)))
