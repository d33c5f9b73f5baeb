# SPDX-License-Identifier: Apache-2.0
"""Any file as runs: a bag, a log or a table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shipdrag_ros.bags import Run, open_runs
from shipdrag_ros.bags.locate import is_bag
from shipdrag_ros.errors import ImportDataError
from shipdrag_ros.sources import formats
from shipdrag_ros.sources.format import Format, Job, best_of, head_of
from shipdrag_ros.sources.log import ImportResult
from shipdrag_ros.sources.run import read_joined, run_of


@dataclass(frozen=True)
class Understanding:
    """
    What was understood of a file that is no bag.

    Attributes
    ----------
    path
    kind
        Of the file, `a CSV file` for instance.
    result
        What became of it.
    """

    path: Path
    kind: str
    result: ImportResult

    def lines(self) -> list[str]:
        """
        Return what is to be said: what each input was taken from, and what was left out.
        """
        lines = [f'{self.path}: {self.kind}', *(f'  {each}' for each in self.result.understood)]
        return [*lines, *self.result.summary(self.path)[1:], *self.result.details()]


def read_any(
    paths: Iterable[Path],
    *,
    remap: Mapping[str, str] | None = None,
    joined: bool = False,
    options: Mapping[str, Any] | None = None,
    show: Callable[[Understanding], None] | None = None,
) -> list[Run]:
    """
    Open files of any format that is known, as `open_runs` opens bags.

    Parameters
    ----------
    paths
        MCAP files, rosbag2 directories, logs and tables.
    remap
        Recorded topic -> input.
    joined
        Whether all logs and tables are one run, as files of one instrument each
        are; otherwise each is a run of its own.
    options
        Values by `format.Option.key`, such as `{'speed_unit': 'kn'}`; a format
        takes those that it knows.
    show
        Called with what was understood of each log.

    Returns
    -------
    list of Run
        First those of the bags, then those of the logs, in the order given.

    Raises
    ------
    BagError
        If a bag cannot be read.
    ImportDataError
        If nothing in a log can be used, saying what to type.

    Notes
    -----
    Source: docs/import.md.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from shipdrag_ros.sources.reading import read_any
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table = Path(folder) / 'coast.csv'
    ...     _ = table.write_text('time_s,STW [kn]\\n0,12.0\\n1,11.9\\n')
    ...     (run,) = read_any([table])
    >>> [topic.topic for topic in run.topics]
    ['/speed_through_water']
    """
    bags: list[Path] = []
    logs: list[Path] = []
    for path in map(Path, paths):
        (bags if is_bag(path) else logs).append(path)
    runs = open_runs(bags, remap=remap) if bags else []
    groups = [logs] if joined and logs else [[path] for path in logs]
    return runs + [_imported(group, remap, options or {}, show) for group in groups]


def _imported(
    sources: Sequence[Path],
    remap: Mapping[str, str] | None,
    options: Mapping[str, Any],
    show: Callable[[Understanding], None] | None,
) -> Run:
    parts = [
        (each, job_of(each, source, options))
        for source in sources
        for each in [format_of(source, options)]
    ]
    try:
        found = read_joined(parts)
    except ImportDataError as error:
        if '--' not in str(error):
            raise
        raise ImportDataError(
            f'{error} (make a bag of it with `shipdrag import`, which takes these options)'
        ) from error
    for (declared, job), result in zip(parts, found.results, strict=True):
        if show is not None:
            show(Understanding(job.source, declared.kind, result))
    return run_of(found.log, sources, remap)


def format_of(source: Path, options: Mapping[str, Any]) -> Format:
    """
    Return the format of a file: the one that an option chooses, or by its beginning.

    Raises
    ------
    ImportDataError
        If it is of none that is known.
    """
    known = formats.found()
    asked = next((each for each in known if each.chosen_by in options), None)
    return asked or best_of(known, head_of(source))


def job_of(declared: Format, source: Path, options: Mapping[str, Any]) -> Job:
    """
    Return what a format is asked to do, with those of the options that it knows.
    """
    own = {option.key for option in declared.options}
    return Job(source, {key: value for key, value in options.items() if key in own})
