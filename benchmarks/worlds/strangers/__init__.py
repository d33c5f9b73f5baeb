# SPDX-License-Identifier: Apache-2.0
"""
Ships with an effect that no library has a name for, several runs each, to score learning on.

Hulls, weather and instruments are those of `hidden_b`; what is hidden was written from physics,
before and without the list of forms that the package tries.
"""
