# SPDX-License-Identifier: Apache-2.0
"""When she is driven, glides, is braked or turns: one bank of histories of switches."""
