# SPDX-License-Identifier: Apache-2.0
"""The coastdowns with a known answer that tests of other estimators take too."""

from tests.estimation.conftest import coast, ship

__all__ = ['coast', 'ship']
