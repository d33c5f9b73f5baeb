# SPDX-License-Identifier: Apache-2.0
"""The one builder of pages: HTML files that carry their pictures and need no network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from shipdrag_ros import __version__
from shipdrag_ros.display import Link, Section, Table

_TEMPLATE = 'page.html'
_LISTED = 2  # sections with an entry, from which on a list of contents helps


def write_page(
    path: Path,
    title: str,
    sections: Sequence[Section],
    *,
    sentence: str = '',
    source: str = '',
    foot: str = '',
) -> None:
    """
    Write a page of sections to a file; an existing one is replaced.

    The other parameters are those of `page_text`.
    """
    text = page_text(title, sections, sentence=sentence, source=source, foot=foot)
    path.write_text(text, encoding='utf-8')


def page_text(
    title: str,
    sections: Sequence[Section],
    *,
    sentence: str = '',
    source: str = '',
    foot: str = '',
    above: Link | None = None,
) -> str:
    """
    Return a page of sections (HTML); what it is given is text, never markup.

    Parameters
    ----------
    title
        Of the page.
    sections
        In their order. Where two or more have an `entry`, a list of contents
        leads to them.
    sentence
        What was found, before all else.
    source, foot
        Where the data come from; where the formulas do.
    above
        Leads to the page that this one belongs to.
    """
    environment = Environment(
        loader=PackageLoader('shipdrag_ros.report', '.'),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters['sides'] = _sides
    text = environment.get_template(_TEMPLATE).render(
        title=title,
        version=__version__,
        sentence=sentence,
        source=source,
        sections=tuple(enumerate(sections)),
        contents=sum(bool(section.entry) for section in sections) >= _LISTED,
        foot=foot,
        above=above,
    )
    return text.lstrip()


def _sides(table: Table) -> tuple[str, ...]:
    """Return the class of each column: words to the left, figures to the right."""
    return tuple(
        'words' if not number or any(row[number][:1].isalpha() for row in table.rows) else ''
        for number in range(len(table.columns))
    )
