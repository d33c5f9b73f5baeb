# SPDX-License-Identifier: Apache-2.0
"""
Pages of the site that are made when it is built: the help of each verb, the notebooks.

The notebooks are run, in some two minutes; SHIPDRAG_DOCS_QUICK=1 shows their code alone.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient

from shipdrag_ros.cli import parser, verbs

NOTEBOOKS = Path(__file__).parent / 'notebooks'
LIMIT_S = 600  # of a cell, on a machine where nothing is compiled yet
WIDTH = 92  # characters, of a line of help


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """
    Add the pages; called by MkDocs.
    """
    files.append(File.generated(config, 'commands.md', content=commands()))
    for path in sorted(NOTEBOOKS.glob('*.ipynb')):
        page = f'notebooks/{path.stem}.md'
        files.append(File.generated(config, page, content='\n\n'.join(cells(path))))
    return files


def on_page_markdown(markdown: str, **_: object) -> str:
    """
    Let links to notebooks lead to their pages; called by MkDocs.
    """
    return re.sub(r'\((notebooks/\w+)\.ipynb\)', r'(\1.md)', markdown)


def commands() -> str:
    """
    Return the page of the command line, from the help of each verb.
    """
    os.environ['COLUMNS'] = str(WIDTH)
    parts = [
        '# Commands',
        'What `shipdrag VERB --help` prints. Exit status: 0 done, 1 user error, 2 usage.',
    ]
    whole = parser(*(verb.name for verb in verbs()))
    (below,) = (it.choices for it in whole._actions if it.dest == 'verb')
    assert isinstance(below, dict)
    for verb in verbs():
        parts += [f'## {verb.name}', f'```text\n{below[verb.name].format_help().strip()}\n```']
    return '\n\n'.join(parts)


def cells(path: Path) -> Iterator[str]:
    """
    Yield the cells of a notebook, and what they print and draw, as Markdown.
    """
    notebook = nbformat.read(path, as_version=4)
    if not os.environ.get('SHIPDRAG_DOCS_QUICK'):
        with TemporaryDirectory() as folder:
            where = {'metadata': {'path': folder}}
            NotebookClient(notebook, timeout=LIMIT_S, resources=where).execute()
    for cell in notebook.cells:
        if cell.cell_type == 'markdown':
            yield cell.source
            continue
        yield f'```python\n{cell.source}\n```'
        for output in cell.outputs:
            yield from _output(output)


def _output(output: dict[str, Any]) -> Iterator[str]:
    data = output.get('data', {})
    if 'image/png' in data:
        yield f'![drawn](data:image/png;base64,{"".join(data["image/png"].split())})'
    elif 'text/html' in data:
        yield re.sub(r'\n\s*\n', '\n', data['text/html'])  # an empty line would end the HTML
    elif text := (output.get('text') or data.get('text/plain', '')).rstrip():
        yield f'```text\n{text}\n```'
