# SPDX-License-Identifier: Apache-2.0
"""
Compile now what a first start would compile: about a minute of one core.

`make warm`, or `SHIPDRAG_CACHE_DIR=FOLDER python deploy/warm.py` for a service
whose cache lies there.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import walk_packages

import shipdrag_ros
from shipdrag_ros.compiled import compile_all

# faces and the node compile nothing of their own; the node needs ROS
_OTHERS = {'node', 'cli', 'face', 'live', 'report', 'fleet'}


def main() -> None:
    """
    Import every room that compiles, and compile it.
    """
    for module in walk_packages(shipdrag_ros.__path__, 'shipdrag_ros.'):
        if not _OTHERS & set(module.name.split('.')):
            import_module(module.name)
    compile_all()


if __name__ == '__main__':
    main()
