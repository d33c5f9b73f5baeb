# SPDX-License-Identifier: Apache-2.0
"""What all pages share: one HTML file that carries its pictures and needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from shipdrag_ros import __version__
from shipdrag_ros.display import Table
from shipdrag_ros.report.drawing import data_uri


@dataclass(frozen=True)
class Picture:
    """A picture that a page holds in itself."""

    uri: str
    caption: str

    @classmethod
    def of(cls, figure: Figure, caption: str) -> Picture:
        """
        Draw a figure.
        """
        return cls(data_uri(figure), caption)


@dataclass(frozen=True)
class Section:
    """
    Part of a page: what it has of these, in this order.

    Attributes
    ----------
    heading
    lines
        Points of a list.
    pictures
    tables
        Each with its caption; one without column heads is a list of facts.
    """

    heading: str = ''
    lines: Sequence[str] = ()
    pictures: Sequence[Picture] = ()
    tables: Sequence[tuple[str, Table]] = ()


def write_sections(
    path: Path,
    sections: Sequence[Section],
    *,
    title: str,
    sentence: str,
    source: str = '',
    foot: str = '',
) -> None:
    """
    Write a page of sections below one sentence that says what was found.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    sections
        In their order.
    title
        Of the page.
    sentence
        What was found.
    source, foot
        Where the data come from; where the formulas do.
    """
    write_page(
        path,
        'sections.html',
        title=title,
        sentence=sentence,
        source=source,
        sections=sections,
        foot=foot,
    )


def write_page(path: Path, template: str, *, title: str, **content: Any) -> None:
    """
    Fill a template of this package; what it is given is text, never markup.

    Parameters
    ----------
    path
        The file; an existing one is replaced.
    template
        Name of a file beside this one that extends `layout.html`.
    title
        Of the page.
    **content
        Whatever the template shows.
    """
    environment = Environment(
        loader=PackageLoader('shipdrag_ros.report', '.'),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template(template).render(title=title, version=__version__, **content)
    path.write_text(text.lstrip(), encoding='utf-8')
