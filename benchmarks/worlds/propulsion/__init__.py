# SPDX-License-Identifier: Apache-2.0
"""
A second world: ships, propellers, engines and instruments, to score the onset on.

It shares no code with the package's own simulation or with what it scores; all
that it takes from there is the door, `samples.Block` and `coastdown.Monitor`.
"""
