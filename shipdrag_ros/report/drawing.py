# SPDX-License-Identifier: Apache-2.0
"""What all pictures share: colours, style, and how one becomes part of a page."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shipdrag_ros.display import Picture

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, distinct to colour-blind readers; line styles and
# shades of grey differ as well, for print
BLUE, VERMILION, GREEN, ORANGE, SKY, PURPLE = (
    '#0072B2',
    '#D55E00',
    '#009E73',
    '#E69F00',
    '#56B4E9',
    '#CC79A7',
)
SIZE = (5.4, 3.7)
"""Of a picture [inches]: two beside each other fill a page, one a phone."""
_BROAD = 1.4  # times that width: a picture takes a page for itself
STYLE: dict[Any, Any] = {
    'font.family': 'DejaVu Sans',  # comes with matplotlib: the same picture everywhere
    'font.size': 9,
    'axes.grid': True,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'grid.color': '#dddddd',
    'grid.linewidth': 0.6,
    'legend.frameon': False,
    'legend.fontsize': 8,
    'lines.linewidth': 1.4,
    'svg.hashsalt': 'shipdrag',  # the same page from the same data
}
_PIXELS_PER_INCH = 200  # of what is drawn as pixels


def styled(more: Mapping[Any, Any] | None = None) -> AbstractContextManager[None]:
    """
    Draw in the style of all pages; matplotlib is imported with the first picture.
    """
    import matplotlib

    return matplotlib.rc_context({**STYLE, **(more or {})})


def new_figure(width: float, height: float) -> Figure:
    """
    Return an empty figure [inches].
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout='constrained')


@contextmanager
def one_axis(
    width: float, height: float, more: Mapping[Any, Any] | None = None
) -> Iterator[tuple[Figure, Axes]]:
    """
    Draw a figure [inches] of one axis, in the style of all pages.
    """
    with styled(more):
        figure = new_figure(width, height)
        yield figure, figure.subplots()


def picture(figure: Figure, caption: str) -> Picture:
    """
    Draw a figure for a page.
    """
    return Picture(data_uri(figure), caption, wide=figure.get_figwidth() > _BROAD * SIZE[0])


def data_uri(figure: Figure) -> str:
    """
    Return a figure as an SVG that a page can carry in itself.
    """
    buffer = io.BytesIO()
    with styled():
        # without a date the same data give the same bytes
        figure.savefig(buffer, format='svg', dpi=_PIXELS_PER_INCH, metadata={'Date': None})
    return 'data:image/svg+xml;base64,' + base64.b64encode(buffer.getvalue()).decode('ascii')


def save(figure: Figure, path: Path, *, pixels_per_inch: int = _PIXELS_PER_INCH) -> None:
    """
    Write a figure to a file; its ending gives the format.
    """
    with styled():
        figure.savefig(path, dpi=pixels_per_inch)
