# SPDX-License-Identifier: Apache-2.0
"""
The rest of a glide, foretold from an estimate of any estimator.

`foretell.foretell(estimate, ship) -> result.Forecast`: when, and how far on, she has each lower
speed, with bands of 90 %. `followed.Followed` is what a record then shows.
"""
