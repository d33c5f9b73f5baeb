# SPDX-License-Identifier: Apache-2.0
"""Property tests try the same examples each time, new ones with `--hypothesis-profile=default`."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile('repeatable', derandomize=True)
settings.load_profile('repeatable')
