# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: over a node on real topics, over a bag, and two days old."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import yaml

from shipdrag_ros.bags import open_runs
from shipdrag_ros.cli import main
from shipdrag_ros.live.app import PAGE, LivePage
from shipdrag_ros.live.source import BagSource, NodeSource
from shipdrag_ros.messages.topics import Samples
from shipdrag_ros.samples import Block, Channel, in_arrival_order
from shipdrag_ros.ship import Ship
from tests.live.test_layout import SCREENS, assert_sound

SHIP = Path(__file__).parents[2] / 'config' / 'vitus_bering.yaml'
TOO_WIDE = 'document.documentElement.scrollWidth - document.documentElement.clientWidth'
DRAWN = """
(id => {
  const canvas = document.querySelector(`#${id} canvas`);
  if (!canvas) return 0;
  const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  const colours = new Set();
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] > 200) colours.add(data.slice(i, i + 3).join());
  }
  return colours.size;
})
"""
LARGEST_BYTES = 150_000


def violations(page: Any) -> list[str]:
    """What axe finds wrong with a page."""
    axe = pytest.importorskip('axe_playwright_python.sync_playwright')
    return [
        f'{found["id"]}: {found["nodes"][0]["target"]}'
        for found in axe.Axe().run(page).response['violations']
    ]


def test_a_coastdown_over_topics_from_steady_to_verdict(start, view, tmp_path, fleet_store):
    pytest.importorskip('rclpy')
    from shipdrag_ros.node.spectator import Rehearsal
    from shipdrag_ros.simulation import Scenario, sense, simulate, standard_sensors

    watch = start('shipdrag_ros.cli', 'watch', '--port', '0', '--store', fleet_store)
    url = watch.wait_for(r'the page: (\S+)')
    fleet = watch.wait_for(r'the fleet: (\S+)')
    assert httpx.get(fleet, timeout=200.0).status_code == 200  # drawn when it is asked for
    viewer = view(url)
    viewer.wait_for('#headline', 'NO NODE HEARD')  # and what to do stands below
    assert 'shipdrag node' in viewer.text('#action')

    parameters = {
        'ship_file': str(SHIP),
        'output_directory': str(tmp_path / 'bags'),
        'use_sim_time': True,
        'steady_s': 400.0,
        'slope_window_s': 30.0,
        'froude_min': 0.12,  # an early end
    }
    file = tmp_path / 'parameters.yaml'
    file.write_text(yaml.safe_dump({'/**': {'ros__parameters': parameters}}))
    node = start('shipdrag_ros.node.main', '--ros-args', '--params-file', file)
    node.wait_for('ready to estimate')
    scenario = Scenario(speed_m_s=8.2, lead_in_s=440.0, duration_s=420.0)
    block = sense(simulate(Ship.load(SHIP), scenario), standard_sensors(), seed=1)
    said: list[str] = []

    def note(_: float) -> None:
        text = viewer.text('#headline')
        if not said or said[-1].split(' ')[0] != text.split(' ')[0]:
            said.append(text)

    with Rehearsal(lambda _: None) as rehearsal:
        rehearsal.wait_for_node(block, alive=lambda: None, timeout_s=240.0)
        # a node that compiles is silent for some seconds: steady sailing is waited for
        stop_ns = int(block.stamp_ns[0]) + 430 * 10**9
        rehearsal.player.play(block[block.stamp_ns < stop_ns], speed=140.0, progress=note)
        viewer.wait_for('#headline', 'STEADY')
        viewer.wait_for('#verdict', 'A coastdown from 15.9 knots')  # before the stop
        note(0.0)
        slowly_ns = int(block.stamp_ns[-1]) - 15 * 10**9
        glide = block[(block.stamp_ns >= stop_ns) & (block.stamp_ns < slowly_ns)]
        rehearsal.player.play(glide, speed=140.0, progress=note)
        viewer.wait_for('#headline', 'COASTDOWN COMPLETE')
        # a busy page loses readings of best effort at 140 times, the shaft's may be all of them
        rehearsal.player.play(block[block.stamp_ns >= slowly_ns], speed=2.0, progress=note)
        # on a busy machine they may come after the last sample
        rehearsal.listen(until=lambda: rehearsal.estimates > 10, timeout_s=240.0)
        assert rehearsal.estimates > 10
    assert viewer.text('#ship') == 'Vitus Bering'
    # a lead ends some seconds before it is clear what she does; a busy machine sends no speed
    between = ('SLOWING:', 'NOT', 'NO')
    states = [word for word in (text.split(' ')[0] for text in said) if word not in between]
    assert states[-2:] == ['STEADY', 'COASTDOWN'], said
    assert 'Now the reciprocal: steer ' in viewer.text('#action')
    assert float(viewer.text('#figure-force').split()[0]) > 100.0
    assert abs(float(viewer.text('#figure-over').split()[0].strip('+'))) < 15.0  # she is clean
    assert 'clean hull' in viewer.text('#curve-say')
    for chart in ('curve', 'speeds', 'shafts'):
        end_s = time.monotonic() + 60.0  # drawn with the next message
        while viewer.page.evaluate(f'{DRAWN}("{chart}")') <= 3:
            assert time.monotonic() < end_s, chart
            viewer.page.wait_for_timeout(50)
    assert 'speed through water' in viewer.text('#inputs')
    assert 'Steady lead' in viewer.text('#checks')
    agreed = viewer.wait_for('#verdict', 'Nothing is missing')
    assert violations(viewer.page) == []

    # the page's process is gone and comes again; the node does not notice
    port = url.rstrip('/').rpartition(':')[2]
    watch.kill()
    viewer.wait_for('#lost', 'NO CONNECTION', within_s=240.0)
    assert not viewer.page.is_visible('#engine-stopped')
    again = start('shipdrag_ros.cli', 'watch', '--port', port, '--allow-marks')
    again.wait_for('the page')
    viewer.page.wait_for_selector('#lost', state='hidden')
    viewer.wait_for('#verdict', agreed)  # as the node says it; the curve is latched
    viewer.wait_for('#curve-say', 'clean hull')
    viewer.page.click('#engine-stopped')
    assert 'weighed with the readings' in viewer.wait_for('#marked', 'weighed')

    assert node.stop() == 0
    viewer.wait_for('#headline', 'NODE SILENT', within_s=240.0)
    assert again.stop() == 0


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A coastdown of a fouled ship."""
    path = tmp_path_factory.mktemp('bags') / 'a recording with quite a long name, 2026-06-01.mcap'
    line = ['simulate', '--ship', str(SHIP), '-o', str(path), '--speed', '8', '--seed', '1']
    line += ['--lead-in', '700', '--duration', '600', '--heading', '0']
    assert main([*line, '--effect', 'fouling=0.3']) == 0
    return path


def test_a_bag_is_played_to_the_verdict_and_sought(bag: Path, serving: Any, view: Any) -> None:
    source = BagSource(open_runs([bag]), speed=200.0)
    try:
        with serving(LivePage(source)) as url:
            viewer = view(url)
            viewer.wait_for('#verdict', 'What would decide')  # the end, where it stands still
            assert 'fouling' in viewer.text('#verdict')
            viewer.wait_for('#past', '090')
            viewer.wait_for('#action', 'steer 270')
            for width in SCREENS:
                assert_sound(viewer.page, width)
            viewer.page.set_viewport_size({'width': 1280, 'height': 900})
            viewer.page.fill('#seek', str(source.player()['start_s'] + 690))
            viewer.wait_for('#headline', 'STEADY 1')
            viewer.page.fill('#seek', str(source.player()['start_s'] + 900))
            viewer.wait_for('#played', '15:00 of')
            headline = viewer.wait_for('#headline', 'COASTDOWN 3:')
            viewer.page.keyboard.press('ArrowLeft')
            viewer.wait_for('#played', '14:00 of')
            assert viewer.text('#headline') != headline

            viewer.page.click('#units')
            assert viewer.text('#figure-force').endswith('m/s²')
            viewer.page.keyboard.press('u')
            assert viewer.text('#figure-force').endswith('kN')
            for mode in ('dusk', 'night', 'day'):
                viewer.page.keyboard.press('n')
                assert viewer.page.get_attribute('html', 'data-mode') == mode
                assert violations(viewer.page) == []
            viewer.page.click('#units')
            assert_sound(viewer.page, 390)
            assert viewer.page.evaluate(TOO_WIDE) == 0
            assert violations(viewer.page) == []
    finally:
        source.close()


def test_two_days_are_drawn_at_once_and_night_is_red(serving: Any, view: Any) -> None:
    source = NodeSource(Ship.load(SHIP))
    stamps = (np.arange(1_700_000_000, 1_700_000_000 + 2 * 86400)) * 1_000_000_000
    speed = 8.0 + np.sin(np.arange(len(stamps)) / 5000.0)
    channels = (Channel.SPEED_THROUGH_WATER, Channel.SHAFT)
    blocks = [Block.of(channel, stamps, speed) for channel in channels]
    source.hear(Samples(in_arrival_order(blocks)))
    with serving(LivePage(source)) as url:
        viewer = view(url)
        viewer.wait_for('#trace-say', 'Now: log')
        assert viewer.page.evaluate('window.shipdrag.picture.rows.length') > 10_000
        viewer.page.select_option('#span', '172800')
        drawn_ms = viewer.page.evaluate(
            """() => { const t = performance.now();
            document.getElementById('span').dispatchEvent(new Event('change'));
            return performance.now() - t; }"""
        )
        assert drawn_ms < 2000.0  # speed/live_page.py measures it; here: not seconds
        assert viewer.page.evaluate('window.shipdrag.picture.rows.length') < 20_000
        viewer.page.click('#mode')
        viewer.page.click('#mode')
        body = viewer.page.evaluate('getComputedStyle(document.body).backgroundColor')
        red, green, blue = viewer.page.evaluate(
            'getComputedStyle(document.body).color.match(/[0-9]+/g).map(Number)'
        )
        assert body == 'rgb(0, 0, 0)'
        assert red > 4 * max(green, blue) - 60  # no green or blue to speak of


def test_the_page_is_small_and_asks_nobody_else() -> None:
    files = [path for path in PAGE.rglob('*') if path.is_file()]
    assert sum(path.stat().st_size for path in files) <= LARGEST_BYTES
    assert (PAGE / 'vendor' / 'uPlot.LICENSE').read_text().startswith('The MIT License')
    for path in files:
        if path.parent == PAGE:
            assert 'http' not in path.read_text().replace('http://www.w3.org/2000/svg', '')


def test_time_passes(view: Any, serving: Any) -> None:
    with serving(LivePage(NodeSource())) as url:
        viewer = view(url)
        viewer.wait_for('#headline', 'NO NODE HEARD')
        first = viewer.text('#utc-time')
        end_s = time.monotonic() + 100.0
        while viewer.text('#utc-time') == first:
            assert time.monotonic() < end_s
            viewer.page.wait_for_timeout(100)
