# SPDX-License-Identifier: Apache-2.0
"""The client stands beside its tests, and is imported by its own name."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
