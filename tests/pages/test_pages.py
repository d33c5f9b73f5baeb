# SPDX-License-Identifier: Apache-2.0
"""Every kind of page that a verb writes, opened in a browser: no picture without data."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import pytest

from shipdrag_ros.cli import main, parser, verbs

ROOT = Path(__file__).resolve().parents[2]
SHIP = ROOT / 'config' / 'vitus_bering.yaml'
DESK, PHONE, PAPER = 1280, 412, 680  # width of the window [pixels]; A4 within its margins

# what a page is made of, by the bag it needs and the command that writes it to {page}
PAGES = {
    'replay, motion': 'replay {coast}',
    'replay, s1_joint': 'replay {coast} --parameters {s1_joint}',
    'replay, s1_speed': 'replay {coast} --parameters {s1_speed}',
    'replay, window': 'replay {coast} --window 320 900',
    'replay, two of one ship': 'replay {coast} {back}',
    'replay, hulls compared': 'replay {coast} {back} --compare',
    'replay, no coastdown': 'replay {steady}',
    'diagnose, stated baseline': 'diagnose {coast} {back}',
    'diagnose, fitted baseline': 'diagnose {coast} --ship {plain}',
    'diagnose, no coastdown': 'diagnose {steady}',
    'learn, no form': 'learn {coast} -o {folder}/no_form.yaml',
    'trend': 'trend {store}',
    'poster': 'poster {store}',
    'cable': 'cable --length 50 --diameter 0.1 --speed 3',
    'sensitivity, steering': 'sensitivity --manoeuvre zigzag:15 --keep 24',
    'sensitivity, coasting': 'sensitivity --ship {ship} --manoeuvre coastdown:8',
    'surface, two inputs': 'surface {root}/docs/data/c_x.csv --inputs alpha,beta --target c_x',
    'surface, one input': 'surface {root}/docs/data/c_x.csv --inputs alpha --target c_x',
    'residual': 'residual {root}/docs/data/river_ships.csv --form auto --target c_R',
}

# of each picture: its axes that show nothing but frame, ticks, words and lines from edge to edge
EMPTY_AXES = """
(() => {
  const empty = [];
  let axes_seen = 0;
  for (const img of document.images) {
    const holder = document.createElement('div');
    const bytes = Uint8Array.from(atob(img.src.split(',')[1]), c => c.charCodeAt(0));
    const text = new TextDecoder().decode(bytes);
    holder.append(new DOMParser().parseFromString(text, 'image/svg+xml').documentElement);
    document.body.append(holder);
    for (const axes of holder.querySelectorAll('g[id^="axes_"]')) {
      if (axes.parentElement.closest('g[id^="axes_"]')) continue;  // a second scale
      axes_seen += 1;
      const frame = axes.querySelector(':scope > g[id^="patch_"]').getBoundingClientRect();
      const shown = [...axes.children].some(part => {
        if (/^(matplotlib\\.axis|legend|text|axes)_/.test(part.id)) return false;
        const all = [part, ...part.querySelectorAll('path, use, image')];
        return all.some(mark => {
          if (!mark.matches('path, use, image') || mark.closest('defs')) return false;
          const box = mark.getBoundingClientRect();
          const inside = box.right >= frame.left && box.left <= frame.right
            && box.bottom >= frame.top && box.top <= frame.bottom;
          if (!inside) return false;
          if (part.id.startsWith('patch_')) {  // a bar, if it is neither edge nor shading
            const wide = Math.min(box.right, frame.right) - Math.max(box.left, frame.left);
            const high = Math.min(box.bottom, frame.bottom) - Math.max(box.top, frame.top);
            return getComputedStyle(mark).fill !== 'none'
              && wide < frame.width - 2 && high < frame.height - 2;
          }
          const points = (mark.getAttribute('d') || '').match(/[MLCQ]/g) || [];
          return !mark.matches('path') || points.length > 2;
        });
      });
      if (!shown) empty.push(`axes ${axes_seen} of: ${img.alt}`);
    }
    holder.remove();
  }
  return {pictures: document.images.length, axes: axes_seen, empty};
})()
"""
NOT_LOADED = (
    '[...document.images].filter(i => !(i.complete && i.naturalWidth > 0)).map(i => i.alt)'
)
# charts stack on a phone: in how many columns they stand
BESIDE = """
new Set([...document.querySelectorAll('figure')].map(f => f.getBoundingClientRect().left)).size
"""
# charts and tables without a caption
UNTOLD = """
[...document.querySelectorAll('figure, .table')].filter(part => {
  const caption = part.matches('figure') ? part.querySelector('figcaption')
    : document.getElementById(part.getAttribute('aria-labelledby'));
  return !caption || caption.textContent.trim().length < 10;
}).map(part => part.textContent.slice(0, 50))
"""
CONTRAST = """
(() => {
  const light = text => {
    const [r, g, b] = text.match(/[0-9.]+/g).map(v => v / 255)
      .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const paper = light(getComputedStyle(document.body).backgroundColor);
  const ratios = [...document.querySelectorAll('h1, h2, p, li, td, th, figcaption')].map(part => {
    const ink = light(getComputedStyle(part).color);
    return (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05);
  });
  return {paper, least: Math.min(...ratios)};
})()
"""
TOO_WIDE = 'document.documentElement.scrollWidth - document.documentElement.clientWidth'


@pytest.fixture(scope='module')
def words(tmp_path_factory: pytest.TempPathFactory, fleet_store: Path) -> dict[str, str]:
    """What stands for the words in braces: bags and files."""
    folder = tmp_path_factory.mktemp('pages')
    found = {
        'ship': str(SHIP),
        'root': str(ROOT),
        'store': str(fleet_store),
        'folder': str(folder),
    }
    for name, options in (
        ('coast', ('--lead-in', '600')),
        ('back', ('--lead-in', '600', '--heading', '3.1416', '--first-heading', '0')),
        ('steady', ('--lead-in', '900', '--duration', '1')),
    ):
        path = folder / f'{name}.mcap'
        line = ['simulate', '--ship', str(SHIP), '-o', str(path), '--speed', '8', '--seed', '3']
        assert main([*line, *options]) == 0
        found[name] = str(path)
    for name in ('s1_joint', 's1_speed'):
        (folder / f'{name}.yaml').write_text(f'estimator: {name}\n')
        found[name] = str(folder / f'{name}.yaml')
    (folder / 'plain.yaml').write_text('length_m: 150.0\ndisplaced_volume_m3: 20200.0\n')
    return found | {'plain': str(folder / 'plain.yaml')}


@pytest.mark.parametrize('kind', PAGES)
def test_a_page_opens_and_no_picture_is_without_data(tab, words, tmp_path, kind):
    page = tmp_path / 'page.html'
    line = PAGES[kind].format_map(words).split()
    assert main([*line, '--report', str(page)]) == 0
    for width, media in ((PHONE, 'screen'), (PAPER, 'print'), (DESK, 'screen')):
        tab.show_as(media)
        tab.open(page, width=width)
        assert tab.problems == []
        assert tab.run(NOT_LOADED) == []
        assert tab.run(TOO_WIDE) == 0, (width, media)
        assert tab.run(BESIDE) <= (1 if width == PHONE else 2)
        assert tab.run(UNTOLD) == []
    found = tab.run(EMPTY_AXES)
    assert found['empty'] == []
    without = 'no coastdown' in kind or kind in ('poster', 'learn, no form')
    assert found['axes'] >= found['pictures'] >= (not without)


@pytest.mark.parametrize(('scheme', 'darkest', 'lightest'), [('light', 0.9, 1), ('dark', 0, 0.1)])
def test_a_page_is_read_by_day_and_by_night(tab, tmp_path, scheme, darkest, lightest):
    page = tmp_path / 'page.html'
    line = f'cable --length 50 --diameter 0.1 --speed 3 --report {page}'
    assert main(line.split()) == 0
    tab.show_as(scheme=scheme)
    tab.open(page, width=DESK)
    found = tab.run(CONTRAST)
    tab.show_as()
    assert darkest <= found['paper'] <= lightest
    assert found['least'] >= 4.5  # WCAG AA


def test_every_verb_that_writes_a_page_is_among_them() -> None:
    names = [verb.name for verb in verbs()]
    writing = {name for name in names if '--report' in options(parser(name), name)}
    assert writing == {line.split()[0] for line in PAGES.values()}


def options(top: argparse.ArgumentParser, verb: str) -> set[str]:
    (verbs,) = (each for each in top._actions if isinstance(each, argparse._SubParsersAction))
    return set(verbs.choices[verb]._option_string_actions)


@pytest.mark.parametrize(
    ('draw', 'empty'),
    [
        (lambda axis: axis.plot([1.0, 2.0, 3.0], [1.0, 3.0, 2.0]), 0),
        (lambda axis: axis.plot([1.0, 2.0], [1.0, 3.0], '.'), 0),
        (lambda axis: axis.barh([1.0, 2.0], [0.5, 0.7]), 0),
        (lambda axis: axis.fill_between([1.0, 2.0, 3.0], [1.0, 3.0, 2.0]), 0),
        (lambda axis: axis.imshow([[1.0, 2.0]]), 0),
        (lambda axis: axis.plot([], [], label='nothing'), 1),
        (lambda axis: axis.plot([1.0, 2.0, 3.0], [float('nan')] * 3, 'o-'), 1),
        (lambda axis: axis.semilogy([], [], marker='o'), 1),
        (lambda axis: axis.axvline(0.5, label='chosen'), 1),
        (lambda axis: axis.axhspan(0.1, 0.5), 1),
        (lambda axis: axis.text(0.5, 0.5, 'words'), 1),
        (lambda axis: axis.legend([], []), 1),
    ],
)
def test_the_check_knows_empty_axes(tab, tmp_path, draw, empty):
    from matplotlib.figure import Figure

    from shipdrag_ros.report.drawing import data_uri

    figure = Figure(figsize=(4.0, 3.0))
    axis = figure.subplots()
    draw(axis)
    axis.secondary_xaxis('top')
    axis.set_title('a title')
    page = tmp_path / 'page.html'
    page.write_text(f'<html><body><img src="{data_uri(figure)}" alt="it"></body></html>')
    tab.open(page, width=DESK)
    found = tab.run(EMPTY_AXES)
    assert (found['axes'], len(found['empty'])) == (1, empty)


def test_what_a_page_complains_about_and_asks_for_is_noticed(tab: Any, tmp_path: Path) -> None:
    page = tmp_path / 'page.html'
    page.write_text(
        '<html><body><img src="http://127.0.0.1:9/no.png"><script>console.log("said");'
        'throw new Error("thrown")</script></body></html>'
    )
    tab.open(page, width=DESK)
    for part in ('asks for http://127.0.0.1:9/no.png', 'said', 'thrown'):
        assert any(part in problem for problem in tab.problems), part
