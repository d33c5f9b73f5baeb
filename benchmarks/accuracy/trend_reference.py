# SPDX-License-Identifier: Apache-2.0
"""
The trend's posterior beside one by sampling (numpyro, NUTS), on the same model.

The trend averages normals over a grid of sizes and weighs outliers in a few rounds. Here the
priors that are written down in `trend/hull_state.py` are sampled: level, growth, season, jump and
change of growth at each step, and the wander as it runs; outliers are a mixture in the likelihood,
scatter is continuous between the ends of the grid. The dates of the steps are given to both (with
dates unknown too, the sampler does not mix). Half of the ships are cleaned once. Growth, present
level and jump of both, side by side; `r hat` of two chains says whether the sampling holds.

    pip install numpyro    # 0.22.0; nothing else needs it
    python -m benchmarks.accuracy.trend_reference --ships 6
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks._asked import asked
from benchmarks.accuracy.trend_score import ship
from shipdrag_ros.trend import hull_state as priors
from shipdrag_ros.trend.hull_state import Growth, HullState, Runs, Steps

CHAINS = 2
OUTLIER, OUTLIER_SCALE = priors._OUTLIER_PROBABILITY, priors._OUTLIER_SCALE


def sampled(runs: Runs, steps: Steps, draws: int, seed: int) -> dict[str, np.ndarray]:
    """Return samples, a row a chain, of growth, level, the jumps and the log posterior."""
    try:
        import jax
        import jax.numpy as jnp
        import numpyro
        import numpyro.distributions as dist
        from jax.scipy.special import logsumexp
        from numpyro.infer import MCMC, NUTS
    except ImportError as error:
        raise SystemExit(f'{error}: pip install numpyro') from error

    numpyro.enable_x64()
    t, y, sd = (jnp.asarray(each) for each in (runs.years, runs.added, runs.sd))
    after = jnp.asarray(runs.years[:, None] >= steps.years[None, :], float)
    since = jnp.maximum(runs.years[:, None] - steps.years[None, :], 0.0)
    gaps, end, many = jnp.diff(runs.years), runs.years[-1], len(steps)
    low, high = np.log(priors.SCATTER[[0, -1]])
    shares = np.log(np.outer(priors._WANDER_PRIOR, priors._WALK_PRIOR))

    def log_normal(rest: Any, scale: Any) -> Any:
        return -0.5 * (rest / scale) ** 2 - jnp.log(scale)

    def model() -> None:
        level = numpyro.sample('level', dist.Normal(0.0, priors.LEVEL_SD))
        growth = numpyro.sample('growth', dist.Normal(*priors.GROWTH_PER_YEAR))
        wave = numpyro.sample('wave', dist.Normal(0.0, priors.SEASON_SD).expand([2]))
        jump = numpyro.sample('jump', dist.Normal(0.0, priors.STEP_SD).expand([many]))
        change = numpyro.sample('change', dist.Normal(0.0, priors.GROWTH_CHANGE_SD).expand([many]))
        median, log_sd = np.log(priors._SCATTER_MEDIAN), priors._SCATTER_LOG_SD
        scatter = jnp.exp(
            numpyro.sample('scatter', dist.TruncatedNormal(median, log_sd, low=low, high=high))
        )
        z = numpyro.sample('z', dist.Normal().expand([3, len(runs) - 1]))
        walk = jnp.concatenate([jnp.zeros(1), jnp.cumsum(jnp.sqrt(gaps) * z[0])])
        slope = jnp.concatenate([jnp.zeros(1), jnp.cumsum(jnp.sqrt(gaps) * z[1])])
        # between two runs: integrated Brownian motion, given the slopes at its ends
        bridge = jnp.sqrt(gaps**3 / 12.0) * z[2] + 0.5 * (slope[1:] + slope[:-1]) * gaps
        smooth = jnp.concatenate([jnp.zeros(1), jnp.cumsum(bridge)])
        season = wave[0] * jnp.cos(2.0 * np.pi * t) + wave[1] * jnp.sin(2.0 * np.pi * t)
        plain = level + growth * t + after @ jump + since @ change
        # every setting of the wander at once, by its prior
        wander = (
            priors.WANDER[:, None, None] * smooth + priors.WALK[None, :, None] * walk
        ) + jnp.zeros((len(priors.WANDER), len(priors.WALK), len(runs)))
        rest, noise = y - plain - season - wander, jnp.sqrt(scatter**2 + sd**2)
        each = jnp.logaddexp(
            np.log1p(-OUTLIER) + log_normal(rest, noise),
            np.log(OUTLIER) + log_normal(rest, OUTLIER_SCALE * noise),
        )
        by_setting = shares + each.sum(axis=-1)
        total = logsumexp(by_setting)
        numpyro.factor('likelihood', total)
        share = jnp.exp(by_setting - total)
        now = (share * (plain[-1] + wander[..., -1])).sum()
        rise = (now - level - jump @ (jump <= 0.0)) / end
        numpyro.deterministic('now', now)
        numpyro.deterministic('rise', rise)

    sampler = MCMC(
        NUTS(model, target_accept_prob=0.9),
        num_warmup=draws // 2,
        num_samples=draws,
        num_chains=CHAINS,
        chain_method='sequential',
        progress_bar=False,
    )
    sampler.run(jax.random.PRNGKey(seed))
    found = sampler.get_samples(group_by_chain=True)
    return {name: np.asarray(found[name]) for name in ('rise', 'now', 'jump')}


def r_hat(chains: np.ndarray) -> float:
    """Return how far chains are apart beside their width; 1 where they agree (split in halves)."""
    half = chains.shape[1] // 2
    parts = np.concatenate([chains[:, :half], chains[:, half : 2 * half]])
    within = parts.var(axis=1, ddof=1).mean()
    return float(np.sqrt((half - 1.0) / half + parts.mean(axis=1).var(ddof=1) / within))


def main() -> None:
    """Print the table, and how far the two are apart."""
    options = asked(__doc__, ships=6, years=1.5, draws=1000, seed=1)
    rng = np.random.default_rng(options.seed)
    off: dict[str, list[float]] = {'growth': [], 'level': [], 'jump': []}
    width: dict[str, list[float]] = {name: [] for name in off}
    for number in range(options.ships):
        world = ship(rng, options.years, 0.05 if number % 2 else 0.0)
        cleaned = [] if world.cleaned is None else [world.cleaned]
        runs, steps = world.runs, Steps(np.array(cleaned))
        state = HullState(runs, steps, Growth())
        trend = {
            'growth': state.growth_per_year(),
            'level': state.level(runs.years[-1:]),
            'jump': state.changes(),
        }
        found = sampled(runs, steps, options.draws, number)
        chains = {'growth': found['rise'], 'level': found['now']}
        if cleaned:
            chains['jump'] = found['jump'][..., 0]
        for name, each in chains.items():
            value, sd = float(trend[name].value[0]), float(trend[name].sd[0])
            off[name].append((value - each.mean()) / each.std())
            width[name].append(sd / each.std())
            print(
                f'ship {number}, {len(runs)} runs, {name:6s}: trend {value:.3f} +- {sd:.3f}, '
                f'sampled {each.mean():.3f} +- {each.std():.3f}, r hat {r_hat(each):.3f}',
                flush=True,
            )
    for name in off:
        if off[name]:
            print(
                f'{name}: apart by {np.mean(np.abs(off[name])):.2f} sampled sd on average, '
                f'{np.max(np.abs(off[name])):.2f} at most; the sd of the trend is '
                f'{np.mean(width[name]):.2f} times that sampled'
            )


if __name__ == '__main__':
    main()
