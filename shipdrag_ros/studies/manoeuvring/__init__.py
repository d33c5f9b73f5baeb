# SPDX-License-Identifier: Apache-2.0
"""Ships that are steered: surge, sway and yaw after Abkowitz."""
