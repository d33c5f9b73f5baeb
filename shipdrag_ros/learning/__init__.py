# SPDX-License-Identifier: Apache-2.0
"""
An effect that the library has no name for: a checked term, learnt from several runs.

`search.learn` finds one among the forms of `forms`; the term as data is `ship.LearntTerm`, and
`simulation.declared` makes an effect of it.
"""
