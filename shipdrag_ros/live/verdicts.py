# SPDX-License-Identifier: Apache-2.0
"""A diagnosis for the page, from its document: that of a node's topic or of a bag."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

_OPTION = re.compile(r' \(--fact [^)]*\)')  # of the command line, which a bridge has not
_SETS_SIZED = 3  # candidates whose sizes are shown
_OTHERWISE = {'none': 'nothing is missing', 'unknown': 'something without a name'}


def verdict_part(found: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return what the page shows of a document.

    Raises
    ------
    KeyError, TypeError, ValueError, AttributeError
        If it is none of this package.
    """
    sized = [(effect['name'], effect) for effect in found['effects']]
    if not sized:  # a set: what each would have
        sized = [
            (
                ' + '.join(each['names']) + (f', {effect["name"]}' if each['names'][1:] else ''),
                effect,
            )
            for each in found['candidates'][:_SETS_SIZED]
            for effect in each['effects']
        ]
        sized = [(f'if {name}', effect) for name, effect in sized]
    named = [(' + '.join(each['names']), each['probability']) for each in found['candidates']]
    return {
        'state': 'done',
        'sentence': ' '.join(filter(None, [found['sentence'], found.get('caveat', '')])),
        'sizes': [
            f'{name}, {size["text"]}'.replace('_', ' ')
            for name, effect in sized
            for size in effect['parameters'].values()
        ],
        'probabilities': [[_OTHERWISE.get(name, name), float(share)] for name, share in named],
        'decide': [_OPTION.sub('', each['text']) for each in found['advice']],
    }
