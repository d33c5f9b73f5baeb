# SPDX-License-Identifier: Apache-2.0
"""
The command line: one module a verb, each with `add_arguments` and `run`.

Only the module of the verb that was asked for is imported, so that help comes
at once and a verb does not pay for what another needs.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from shipdrag_ros import __version__
from shipdrag_ros.cli.arguments import Help, add_effects
from shipdrag_ros.cli.examples import epilog
from shipdrag_ros.errors import ShipdragError
from shipdrag_ros.imports import uncollected, what_to_install
from shipdrag_ros.studies import found


class Verb(NamedTuple):
    """A verb, its module (a leading dot: of this package), and what it does in one line."""

    name: str
    module: str
    summary: str


_OWN = (
    Verb(
        'demo',
        '.demo',
        'simulated ship -> ROS topics -> node -> bag -> replay -> report',
    ),
    Verb('node', '.node', 'the onboard node: estimates live and records'),
    Verb('watch', '.watch', 'the page of the bridge: over the running node, or over bags'),
    Verb('replay', '.replay', 'the same estimator over bags, without ROS'),
    Verb('simulate', '.simulate', 'simulated coastdown with sensors, as a bag'),
    Verb('simulate-fleet', '.simulate_fleet', 'months of a few ships, as a folder of bags'),
    Verb(
        'baseline',
        '.baseline',
        'learn the baseline, and how far runs scatter, from clean runs',
    ),
    Verb(
        'diagnose',
        '.diagnose',
        'where model and data disagree, and which effect is missing',
    ),
    Verb('learn', '.learn', 'an effect that has no name, learnt from several runs of one ship'),
    Verb('effect', '.effect', 'files of learnt effects: what is in them, and may they be used'),
    Verb('forecast', '.forecast', 'the rest of each glide foretold, beside what followed'),
    Verb('fleet', '.fleet', 'replay and diagnose every bag below folders, one row a coastdown'),
    Verb('trend', '.trend', 'added resistance of a fleet against time, which hull to clean'),
    Verb('poster', '.poster', 'stopping without engine: time and way from speed to speed'),
    Verb('import', '.import_', 'logs and tables of other programs -> bag'),
    Verb('completion', '.completion', 'completion of the command line in a shell'),
    Verb('doctor', '.doctor', 'what of the installation works, and what to do about the rest'),
    Verb('info', '.info', 'what is in a bag'),
    Verb('check', '.check', 'is a bag sound'),
    Verb('recover', '.recover', 'save what is whole in a damaged bag'),
)
_WITHOUT_EFFECTS = ('effect', 'completion', 'doctor', 'info', 'check', 'recover', 'import')

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
    studies = found(frozenset(verb.name for verb in _OWN))
    of_studies = (Verb(each.verb, f'{where}.face.verb', each.summary) for where, each in studies)
    return (*_OWN, *of_studies)


def parser(*of: str) -> argparse.ArgumentParser:
    """
    Return the parser of the command line, with the arguments of the verbs `of`.
    """
    top = argparse.ArgumentParser(
        prog='shipdrag',
        description='Hydrodynamic resistance of a ship from its coastdowns. '
        'Exit status: 0 done, 1 user error, 2 usage.',
    )
    top.add_argument('--version', action='version', version=f'shipdrag_ros {__version__}')
    added_to = top.add_subparsers(title='verbs', metavar='VERB', dest='verb', required=True)
    own = {verb.name for verb in _OWN}
    for known in _OWN if of and own.issuperset(of) else verbs():
        added = added_to.add_parser(
            known.name, help=known.summary, description=known.summary, formatter_class=Help
        )
        if known.name in of:
            added.epilog = epilog(known.name)
            with uncollected():
                module = import_module(known.module, __name__)
            module.add_arguments(added)
            if known.name not in _WITHOUT_EFFECTS:
                add_effects(added)
            added.set_defaults(run=module.run)
    return top
