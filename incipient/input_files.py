"""Reading of regular input files, with errors in one line."""

from __future__ import annotations

import csv
import errno
import io
import os
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from .arrays import unwarned
from .errors import IncipientError, SceneError, shortened

LARGEST_TEXT, LARGEST_TABLE = 16, 1024  # MiB
LONGEST_NAME = 300  # characters of a path in a message


@contextmanager
def reading(
    path: Path,
    remedy: str,
    largest: float = float("inf"),
    error: type[IncipientError] = SceneError,
    name: str = "",
) -> Iterator[None]:
    """Convert errors of reading in the block to one line. Refuse pipes and devices: reading may not end.

    Args:
        largest: size [MiB].
        error: OutputError for files of the program.
        name: prefix of the message; default: "PATH:".

    Raises IncipientError of the type `error`; those of the block pass unchanged.
    """
    begin = shortened(name or f"{path}:", LONGEST_NAME)
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if not stat.S_ISREG(status.st_mode):
            raise error(f"{begin} is a pipe or a device; {remedy}")
        if status.st_size > largest * 2**20:
            raise OSError(errno.EFBIG, f"it is larger than {largest:g} MiB")
        with unwarned():
            yield
    except IncipientError:
        raise
    except UnicodeDecodeError as caught:
        raise error(f"{begin} is not UTF-8 text at byte {caught.start}; save it as UTF-8") from None
    except Exception as caught:
        raise error(f"{begin} cannot be read ({cause_of(caught)}); {remedy}") from None


def cause_of(error: Exception) -> str:
    """Cause of an error of reading, in a few words."""
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, MemoryError):
        return "it does not fit into the memory"
    words = (isinstance(error, OSError) and error.strerror) or error
    return shortened(words) or type(error).__name__


def read_text(path: Path, remedy: str, name: str = "", largest: float = LARGEST_TEXT) -> str:
    """Text of a UTF-8 file with uniform line ends. Raises as `reading`."""
    with reading(path, remedy, largest, name=name):
        text = path.read_bytes().decode("utf-8-sig")
        return text.replace("\r\n", "\n").replace("\r", "\n")


def read_table(path: Path, remedy: str) -> tuple[list[str], list[list[str]]]:
    """Header and rows, of equal length, of a CSV file. Raises as `reading`."""
    text = read_text(path, remedy, largest=LARGEST_TABLE)
    with reading(path, remedy):
        names, *rows = [row for row in csv.reader(io.StringIO(text, newline="")) if row] or [[]]
    names = [name.strip() for name in names]
    require_different(path, names)
    wrong = next((k for k, row in enumerate(rows, 2) if len(row) != len(names)), None)
    if wrong is not None:
        raise SceneError(
            f"{path}: row {wrong} has a different number of cells from the first; "
            "add or remove cells"
        )
    return names, rows


def require_different(path: Path, names: Sequence[str]) -> None:
    """Raise SceneError for two columns of one name."""
    twice = next((name for name in names if name and names.count(name) > 1), None)
    if twice is not None:
        raise SceneError(f"{path}: has two columns {shortened(twice)}; remove one of them")
