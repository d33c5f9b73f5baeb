# SPDX-License-Identifier: Apache-2.0
"""
Errors a user can mend.

Each message says what is wrong, which value, and what to do. Anything else
that is raised is a defect of this package.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path


class ShipdragError(Exception):
    """
    Base of all errors that a user can mend; the command line exits with 1.

    Examples
    --------
    >>> import shipdrag_ros as sd
    >>> try:
    ...     sd.read('missing.mcap')
    ... except sd.ShipdragError as error:
    ...     print(error)
    'missing.mcap' does not exist; give the path of a bag or a log
    """


def reason_of(error: BaseException) -> str:
    """
    Return why something failed, as the system or the library says it, for a sentence.
    """
    return str(getattr(error, 'strerror', None) or error) or type(error).__name__


class ProblemsError(ShipdragError):
    """
    Several findings reported together.

    Parameters
    ----------
    subject
        What was checked, a file name for instance.
    problems
        One line each: key, value and expectation.
    """

    def __init__(self, subject: str, problems: Sequence[str]) -> None:
        self.subject = subject
        self.problems = tuple(problems)
        lines = '\n'.join(f'  - {problem}' for problem in self.problems)
        super().__init__(f'{subject}: {len(self.problems)} problem(s)\n{lines}')


class ShipFileError(ProblemsError):
    """A ship file that cannot be used."""


class ParameterError(ProblemsError):
    """Parameters that are unknown, of the wrong type or out of range."""


class EffectFileError(ProblemsError):
    """A file of a learnt effect that cannot be used."""


class DataError(ProblemsError):
    """A table of measurements to which nothing can be fitted."""


class BagError(ShipdragError):
    """A bag that cannot be read or written."""


@contextmanager
def disk_errors(path: Path, done: str) -> Iterator[None]:
    """
    Make errors of the system those of a bag.

    Parameters
    ----------
    path
        Of the bag.
    done
        What is done to it, `read` for instance.

    Raises
    ------
    BagError
        If the disk refuses.
    """
    try:
        yield
    except OSError as error:
        raise BagError(f'{str(path)!r} cannot be {done}: {error.strerror or error}') from error


class ImportDataError(ShipdragError):
    """A log or a table that cannot be turned into a bag."""


class EstimationError(ShipdragError):
    """A window from which no resistance can be estimated."""


class SimulationError(ShipdragError):
    """A simulation that was asked for something impossible."""


class DiagnosisError(ShipdragError):
    """Runs, or a ship file, from which no effect can be named."""


class EarlierError(DiagnosisError):
    """An earlier diagnosis that cannot count for the runs at hand."""


class SensitivityError(ShipdragError):
    """A question of what matters that cannot be answered."""


class FleetError(ShipdragError):
    """A folder of bags, or a store of what they gave, that cannot be used."""
