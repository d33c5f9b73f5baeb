# SPDX-License-Identifier: Apache-2.0
"""The script that counts the house counts code, and nothing else."""

from __future__ import annotations

from pathlib import Path

from benchmarks import house as counted


def test_docstrings_comments_and_blanks_are_no_code(tmp_path: Path) -> None:
    (tmp_path / 'shipdrag_ros' / 'studies').mkdir(parents=True)
    body = [
        '"""A module."""',
        '',
        'LIMIT = 1  # code, with a comment',
        '"""What it limits."""',
        '# a comment',
        'def wide(a, b, c, d, e, f, g, h, i):',
        '    """',
        '    Two lines of code.',
        '    """',
        '    return (a,',
        '            b)',
        'class Each:',
        '    def narrow(self, a, b, c, d, e, f, g, h): ...',
    ]
    (tmp_path / 'shipdrag_ros' / 'a.py').write_text('\n'.join(body))
    (tmp_path / 'shipdrag_ros' / 'studies' / 'b.py').write_text('TEXT = """two\nlines"""\n')
    found = counted.count(tmp_path)
    assert (found.raw, found.lines, found.core) == (15, 8, 6)
    assert (found.modules, found.core_modules) == (2, 1)
    assert found.wide == [('a.py:wide', 9)]
    assert found.long == []


def test_a_long_function_is_told_unless_it_is_compiled(tmp_path: Path) -> None:
    (tmp_path / 'shipdrag_ros').mkdir()
    lines = ['    x += 1'] * 61
    text = ['def slow(x):', *lines, '@compiled(SIGNATURE)', 'def fast(x):', *lines]
    (tmp_path / 'shipdrag_ros' / 'a.py').write_text('\n'.join(text))
    assert counted.count(tmp_path).long == [('a.py:slow', 62)]


def test_numbers_are_counted_by_where_they_stand(tmp_path: Path) -> None:
    path = tmp_path / 'a.py'
    path.write_text(
        'LIMIT = 3.0\n'
        'A, B = range(4)\n'
        "GUST = Declared('-', 'gusts', normal(0.1, mean=7), '', 'mine')\n"
        'def half(x):\n'
        '    return 0.5 * x + 9.81\n'
    )
    assert counted.numbers(path) == {'constants': 2, 'printed': 2, 'code': 1}
