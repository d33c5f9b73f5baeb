# SPDX-License-Identifier: Apache-2.0
"""What the verbs do, as functions and results that a script shares with the command line."""
