# SPDX-License-Identifier: Apache-2.0
"""`python -m shipdrag_ros.cli`: the same without the console script."""

import sys

from shipdrag_ros.cli import main

sys.exit(main())
