# SPDX-License-Identifier: Apache-2.0
"""
Coastdowns with something hidden in them, to score a diagnosis on.

Nothing here is shared with the package: hull, motion, effects and sensors are
written again, with other formulas where physics has several. What a diagnosis
may see is an `Observation`; the truth is asked for after its verdict is kept.
"""
