# SPDX-License-Identifier: Apache-2.0
"""
What an attacker tries, and what happens.

`python benchmarks/attacks.py` attacks files, the NMEA input and a node that it
starts itself, on the loopback of this machine and in a folder that it removes. It prints
a table and ends with 1 where an attack succeeded. Without ROS the attacks on the
node are left out, and said so.
"""

from __future__ import annotations

import importlib.util
import os
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import _attacks_files, _attacks_nmea
from benchmarks._attack import Attack, Succeeded

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'


def attacks() -> list[Attack]:
    """
    Return all attacks that can be tried here.
    """
    found = [*_attacks_files.ATTACKS, *_attacks_nmea.ATTACKS]
    if importlib.util.find_spec('rclpy') is not None:
        from benchmarks import _attacks_node

        found += _attacks_node.ATTACKS
    return found


def main() -> int:
    """
    Try all attacks and print what happened.
    """
    all_attacks = attacks()
    succeeded = 0
    print('| what | attack | what happens | s |\n|---|---|---|---|')
    for attack in all_attacks:
        start_s = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            try:
                said = attack.run(Path(folder).resolve())
            except Succeeded as error:
                succeeded += 1
                said = f'SUCCEEDED: {error}'
        print(f'| {attack.area} | {attack.kind} | {said} | {time.monotonic() - start_s:.1f} |')
    print(f'\n{len(all_attacks)} attacks, {succeeded} succeeded')
    if not any(attack.area == 'node' for attack in all_attacks):
        print('ROS is not installed here: the node itself was not attacked')
    else:
        from benchmarks import _attacks_node

        _attacks_node.NODE.close()
    return 1 if succeeded else 0


if __name__ == '__main__':
    sys.exit(main())
