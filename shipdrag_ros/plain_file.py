# SPDX-License-Identifier: Apache-2.0
"""Small text files, read so that no pipe, device or endless file can hang or fill the reader."""

from __future__ import annotations

import os
import stat
from os import PathLike


def read_small_text(path: str | PathLike[str], *, most_bytes: int) -> str:
    """
    Return the text of a regular file.

    Parameters
    ----------
    path
        The file; a link to one is followed.
    most_bytes
        Largest file that is read [bytes].

    Raises
    ------
    OSError
        If it is no regular file, too large, or cannot be read; `strerror` says why.
    ValueError
        If it is not UTF-8.
    """
    # a pipe without a writer would wait for ever without O_NONBLOCK
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(descriptor, 'rb') as file:
        about = os.fstat(descriptor)
        if stat.S_ISDIR(about.st_mode):
            raise IsADirectoryError(0, 'Is a directory')
        if not stat.S_ISREG(about.st_mode):
            raise OSError(0, 'no regular file')
        # one more than allowed: files of /proc say 0 and go on
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise OSError(0, f'more than {most_bytes} bytes, too many')
    return content.decode('utf-8-sig')
