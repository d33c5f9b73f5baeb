# SPDX-License-Identifier: Apache-2.0
"""
One posterior: a ship that slows down, her instruments and the noise, inferred together.

The model is docs/model.md, letter by letter. `problem.RunModel` holds one run under that model,
`laplace.infer(problem)` returns its `laplace.RunPosterior`, and `readout` reads r(v) from it.
"""
