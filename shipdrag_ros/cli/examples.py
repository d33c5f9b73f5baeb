# SPDX-License-Identifier: Apache-2.0
"""Command lines that stand below the help of each verb; a test runs every one."""

from __future__ import annotations

from shipdrag_ros.studies import found

EXAMPLES = {
    'demo': ('shipdrag demo', 'shipdrag demo --out demo --speed-up 20'),
    'node': (
        'shipdrag node --ship ship.yaml --out records',
        'shipdrag node --ship ship.yaml --out records --ros-args -p window_s:=1800.0 '
        '-r position:=/gps --params-file parameters.yaml',
    ),
    'watch': (
        'shipdrag watch --port 8090 --earlier records',
        'shipdrag watch run.mcap --speed 20',
    ),
    'replay': (
        'shipdrag replay run.mcap --report report.html',
        'shipdrag replay run.mcap --ship ship.yaml --window 600 1800 --json result.json',
    ),
    'simulate': (
        'shipdrag simulate --ship ship.yaml -o calm.mcap --lead-in 1800',
        'shipdrag simulate --ship ship.yaml -o fouled.mcap --effect fouling=0.3 '
        '--effect current=0.4,cross_track_m_s=0.1',
        'shipdrag simulate --ship ship.yaml -o weed.mcap --effects effects --effect weed=0.0014',
    ),
    'simulate-fleet': (
        'shipdrag simulate-fleet -o fleet --ships 1 --months 1 --seed 4',
        'shipdrag simulate-fleet -o weekly --ships 1 --months 0.5 --every 7 --sound',
    ),
    'baseline': (
        'shipdrag baseline clean_1.mcap clean_2.mcap --ship ship.yaml -o learnt.yaml',
        'shipdrag baseline clean_1.mcap --ship ship.yaml -o first.yaml --json baseline.json',
    ),
    'diagnose': (
        'shipdrag diagnose out.mcap back.mcap --report diagnosis.html --write ship_now.yaml',
        'shipdrag diagnose run.mcap --ship ship.yaml --window 600 1800',
    ),
    'learn': (
        'shipdrag learn out.mcap back.mcap -o weed.yaml --name weed_2 --report learnt.html',
        'shipdrag learn clean_1.mcap clean_2.mcap --ship ship.yaml -o new.yaml --json learnt.json',
    ),
    'effect': (
        'shipdrag effect check effects/weed.yaml',
        'shipdrag effect list --effects effects',
    ),
    'forecast': (
        'shipdrag forecast run.mcap --after 120 300',
        'shipdrag forecast run.mcap --ship ship.yaml --json forecast.json',
        'shipdrag forecast run.mcap --if-stopped-now',
    ),
    'fleet': (
        'shipdrag fleet records -o store --workers 1',
        'shipdrag fleet records -o store --json fleet.json',
    ),
    'trend': (
        'shipdrag trend store --json trend.json',
        "shipdrag trend store --sql 'select ship, count(*) from coastdowns group by ship'",
    ),
    'poster': (
        'shipdrag poster store --report poster.html',
        'shipdrag poster store --json poster.json',
    ),
    'import': (
        'shipdrag import LOG.nmea.gz -o log.mcap --ship ship.yaml',
        'shipdrag import log.csv -o plane.mcap --time t:ms --map speed_through_water=u:kn '
        '--map position=x,y:km',
        'shipdrag import log.csv -o globe.mcap --rate 1 --map position=lat,lon:deg',
    ),
    'completion': (
        'shipdrag completion bash -o shipdrag.bash',
        'shipdrag completion fish',
    ),
    'doctor': ('shipdrag doctor', 'shipdrag doctor --out records --json'),
    'info': ('shipdrag info run.mcap', 'shipdrag info out.mcap back.mcap --json info.json'),
    'check': ('shipdrag check run.mcap', 'shipdrag check out.mcap back.mcap --json check.json'),
    'recover': (
        'shipdrag recover damaged.mcap -o saved.mcap',
        'shipdrag recover damaged.mcap -o again.mcap --json recover.json',
    ),
}


def epilog(verb: str) -> str:
    """
    Return the examples of a verb, as they stand below its help.
    """
    lines = EXAMPLES.get(verb) or _of_studies()[verb]
    return '\n'.join(
        [f'example{"s" if len(lines) > 1 else ""}:', *(f'  {line}' for line in lines)]
    )


def _of_studies() -> dict[str, tuple[str, ...]]:
    return {study.verb: study.examples for _, study in found(frozenset(EXAMPLES))}
