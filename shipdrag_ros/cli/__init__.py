# SPDX-License-Identifier: Apache-2.0
"""
The command line: a module has `add_arguments` and `run` of its verb, or `add_NAME` and
`run_NAME` of each of its verbs.

Only the module of the verb that was asked for is imported, so that help comes
at once and a verb does not pay for what another needs.
"""

from __future__ import annotations

import argparse
import inspect
import os
import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from shipdrag_ros import __version__
from shipdrag_ros.cli import arguments
from shipdrag_ros.cli.arguments import Help
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.imports import uncollected, what_to_install
from shipdrag_ros.studies import found


class Verb(NamedTuple):
    """
    A verb, what it does in one line, and the module it stands in.

    What its help says stands in the docstring of its module, or of its `run_NAME`: how it is
    described, and examples; a study gives these by itself.
    """

    name: str
    summary: str
    module: str
    examples: tuple[str, ...] = ()


_SUMMARIES = {
    'demo': 'simulated ship -> ROS topics -> node -> bag -> replay -> report',
    'node': 'the onboard node: estimates live and records',
    'watch': 'the page of the bridge: over the running node, or over bags',
    'replay': 'the same estimator over bags, without ROS',
    'simulate': 'simulated coastdown with sensors, as a bag',
    'simulate-fleet': 'months of a few ships, as a folder of bags',
    'baseline': 'learn the baseline, and how far runs scatter, from clean runs',
    'diagnose': 'where model and data disagree, and which effect is missing',
    'learn': 'an effect that has no name, learnt from several runs of one ship',
    'effect': 'files of learnt effects: what is in them, and may they be used',
    'forecast': 'the rest of each glide foretold, beside what followed',
    'fleet': 'replay and diagnose every bag below folders, one row a coastdown',
    'trend': 'added resistance of a fleet against time, which hull to clean',
    'poster': 'stopping without engine: time and way from speed to speed',
    'import': 'logs and tables of other programs -> bag',
    'completion': 'completion of the command line in a shell',
    'doctor': 'what of the installation works, and what to do about the rest',
    'info': 'what is in a bag',
    'check': 'is a bag sound',
    'recover': 'save what is whole in a damaged bag',
}
_SHARED = {  # modules of more than one verb
    '.bags': ('info', 'check', 'recover'),
    '.effects': ('diagnose', 'baseline', 'learn', 'effect'),
    '.fleet': ('fleet', 'trend', 'poster'),
    '.installation': ('doctor', 'completion'),
    '.on_board': ('node', 'watch'),
    '.simulate': ('simulate', 'simulate-fleet'),
}
_MODULES = {'import': '.import_'} | {name: m for m, names in _SHARED.items() for name in names}
_OWN = tuple(
    Verb(name, summary, _MODULES.get(name, f'.{name}')) for name, summary in _SUMMARIES.items()
)
Helps = dict[str, tuple[list[str], str]]
"""What the values of an argument are called, and its help."""
_SECTION = re.compile(r'^(\w+)\n-+\n', re.MULTILINE)

# matrices here are small: threads that wait for each other cost up to twenty times the work
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

USER_ERROR = 1
INTERRUPTED, BROKEN_PIPE = 130, 141  # what a shell reports of a program killed by SIGINT, SIGPIPE


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run a verb; the console script `shipdrag`.

    Parameters
    ----------
    arguments
        Command line without the program's name; that of the process by
        default.

    Returns
    -------
    int
        Exit status: 0 done, 1 user error, 130 interrupted.

    Raises
    ------
    SystemExit
        As argparse does, with 0 after help and 2 after wrong usage.
    """
    line = list(sys.argv[1:] if arguments is None else arguments)
    try:
        try:
            return _run(line)
        finally:
            sys.stdout.flush()  # here, where a broken pipe is still caught
    except BrokenPipeError:
        # the reader went away, `| head` for instance; let the last flush go nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE


def _run(line: list[str]) -> int:
    verb = next((word for word in line if not word.startswith('-')), '')
    try:
        options = parser(verb).parse_args(line)
        with _more_effects(getattr(options, 'effects_from', [])):
            status: int = options.run(options)
        return status
    except KeyboardInterrupt:
        return INTERRUPTED
    except ShipdragError as error:
        print(f'ERROR: {error}', file=sys.stderr)
    except ModuleNotFoundError as error:
        advice = what_to_install(error)
        if advice is None:
            raise
        print(f'ERROR: `shipdrag {verb}` cannot do this: {advice}', file=sys.stderr)
    except BrokenPipeError:
        raise
    except OSError as error:
        print(f'ERROR: {_error_text(error)}', file=sys.stderr)
    return USER_ERROR


def _more_effects(folders: Sequence[Path]) -> AbstractContextManager[None]:
    if not folders:
        return nullcontext()
    from shipdrag_ros.ship.term import read_folders
    from shipdrag_ros.simulation.effects import using

    return using(read_folders(folders))


def _error_text(error: OSError) -> str:
    if error.errno is None:  # raised by a library for a reason of its own
        raise error
    if error.filename is None:  # as when a disk is full
        return f'the result cannot be written: {error.strerror}; make room or write elsewhere'
    return (
        f'{str(error.filename)!r}: {error.strerror}; '
        'check the path and that it may be read or written'
    )


def verbs() -> tuple[Verb, ...]:
    """
    Return all verbs; those of studies are looked for, also in other packages, which takes a while.
    """
    studies = found(frozenset(_SUMMARIES))
    of_studies = (
        Verb(each.verb, each.summary, f'{where}.face.verb', each.examples)
        for where, each in studies
    )
    return (*_OWN, *of_studies)


class _Top(argparse.HelpFormatter):
    """List the verbs of studies apart, as papers."""

    def _format_action(self, action: argparse.Action) -> str:
        text = super()._format_action(action)
        return f'{text}\npapers:\n' if action.dest == next(reversed(_SUMMARIES)) else text


def parser(*of: str) -> argparse.ArgumentParser:
    """
    Return the parser of the command line, with the arguments of the verbs `of`.
    """
    top = argparse.ArgumentParser(
        prog='shipdrag',
        formatter_class=_Top,
        description='Hydrodynamic resistance of a ship from its coastdowns. '
        'Exit status: 0 done, 1 user error, 2 usage.',
    )
    top.add_argument('--version', action='version', version=f'shipdrag_ros {__version__}')
    added_to = top.add_subparsers(title='verbs', metavar='VERB', dest='verb', required=True)
    for known in _OWN if of and _SUMMARIES.keys() >= {*of} else verbs():
        added = added_to.add_parser(
            known.name, help=known.summary, description=known.summary, formatter_class=Help
        )
        if known.name in of:
            with uncollected():
                module = import_module(known.module, __name__)
            own = known.name.replace('-', '_')
            add = getattr(module, f'add_{own}', None) or module.add_arguments
            run = getattr(module, f'run_{own}', None) or module.run
            text = inspect.getdoc(module if run.__name__ == 'run' else run)
            said = sections(text)
            added.description = said.get('', known.summary)
            if examples := known.examples or said.get('Examples', '').splitlines():
                added.epilog = '\n  '.join(['examples:', *examples])
            add(added)
            if known.name != 'effect':  # each of its parts has what it needs
                arguments.add(added, '--effects')
            added.set_defaults(run=run)
            names = vars(arguments) | vars(module)
            _explain(added, helps(arguments.__doc__, names) | helps(text, names))
    return top


def sections(text: str | None) -> dict[str, str]:
    """
    Return a docstring by its sections; python -OO drops it.
    """
    parts = ['', *_SECTION.split(text or '')]
    return dict(zip(parts[::2], parts[1::2])) if text else {}


def helps(text: str | None, names: Mapping[str, Any]) -> Helps:
    """
    Return what a docstring says of arguments: what the values of each are called, and its help.

    Parameters
    ----------
    text
        Of the docstring.
    names
        That it may hold in braces.
    """
    listed = sections(text).get('Options', '')
    with suppress(LookupError, ValueError):  # a study of another package may write braces
        listed = listed.format_map(names)
    found = re.findall(r'^(\S+)(.*)\n((?: .*\n?)+)', listed, re.MULTILINE)
    return {name: (values.split(), ' '.join(lines.split())) for name, values, lines in found}


def _explain(parser: argparse.ArgumentParser, known: Helps) -> None:
    """Give each argument that has none its help."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                _explain(below, known)
        elif action.help is None:
            names = (*action.option_strings, str(action.metavar), action.dest)
            values, action.help = next(
                (known[name] for name in names if name in known), ([], None)
            )
            if action.option_strings and values and action.metavar is None:
                action.metavar = values[0] if len(values) == 1 else tuple(values)
