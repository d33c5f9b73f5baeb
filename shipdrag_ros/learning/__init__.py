# SPDX-License-Identifier: Apache-2.0
"""
An effect that the library has no name for: a checked term, learnt from several runs.

`term.LearntTerm` is the term as data, `folder.use` makes the terms of a folder effects of the
library, `search.learn` finds one.
"""
