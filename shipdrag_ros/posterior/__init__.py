# SPDX-License-Identifier: Apache-2.0
"""
One posterior: a ship that slows down, her instruments and the noise, inferred together.

The model is docs/model.md, letter by letter. `problem.Problem` holds one run under that model,
`laplace.infer(problem)` returns its `laplace.Posterior`, and `readout` reads r(v) from it.
"""
