# SPDX-License-Identifier: Apache-2.0
"""
World B: coastdowns of another hand, to score a diagnosis and an estimator on.

Written from physics and manuals of instruments; it shares no code with the package or with
`hidden`.
"""
