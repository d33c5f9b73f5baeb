# SPDX-License-Identifier: Apache-2.0
"""
How code is compiled, and how it is kept from outliving its source.

numba caches a compiled function by the date of the one file that it is in, but
the functions and constants it uses may be in others.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

# For code that is called a million times a second with arrays that Python owns: counting the
# references to them would cost more than the work. Such code cannot make arrays.
UNCOUNTED: dict[str, Any] = {'_nrt': False}
INLINED: dict[str, Any] = {**UNCOUNTED, 'forceinline': True}


def digest(*paths: str) -> str:
    """
    Return a digest of source files, paths being relative to the package.

    A compiled function that closes over it is compiled anew when one changes.
    """
    package = Path(__file__).parent
    return hashlib.sha256(b''.join((package / path).read_bytes() for path in paths)).hexdigest()
