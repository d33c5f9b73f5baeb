# SPDX-License-Identifier: Apache-2.0
"""
Print the script that completes verbs, options and files. Where a shell looks for it: bash:
~/.local/share/bash-completion/completions/shipdrag; zsh: a file _shipdrag in a folder of
$fpath; fish: ~/.config/fish/completions/shipdrag.fish.

Options
-------
shell
    for which shell
--out FILE
    write it there (default: to stdout)

Examples
--------
shipdrag completion bash -o shipdrag.bash
shipdrag completion fish
"""

from __future__ import annotations

import argparse
from pathlib import Path

import shtab

from shipdrag_ros import cli

SHELLS = ('bash', 'zsh', 'fish')
_FOLDER = ('DIR', 'STORE', 'DIR_OR_URL')
_FILE = ('FILE', 'BAG', 'SOURCE')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """
    Add what the verb takes.
    """
    parser.add_argument('shell', choices=SHELLS)
    parser.add_argument('-o', '--out', type=Path)


def run(options: argparse.Namespace) -> int:
    """
    Print or write the script.
    """
    text = script(options.shell)
    if options.out is None:
        print(text)
    else:
        options.out.write_text(text + '\n', encoding='utf-8')
        print(f'{options.out} completes shipdrag in {options.shell} once it is read')
    return 0


def script(shell: str) -> str:
    """
    Return the script for a shell, one of `SHELLS`.
    """
    whole = cli.parser(*(verb.name for verb in cli.verbs()))
    verbs = next(each for each in whole._actions if isinstance(each, argparse._SubParsersAction))
    for parser in (whole, *verbs.choices.values()):
        for action in parser._actions:
            metavar = str(action.metavar or '').partition('.')[0]
            if metavar in _FOLDER:
                action.complete = shtab.DIRECTORY
            elif metavar in _FILE:
                action.complete = shtab.FILE
    return shtab.complete(whole, shell)
