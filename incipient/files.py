"""Files written whole or not at all, and errors that say what stopped the writing.

Nothing here is collective: under MPI the caller writes on one rank, inside `incipient.parallel.collectively`.
"""

from __future__ import annotations

import csv
import errno
import io
import itertools
import json
import math
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from .errors import OutputError

MARK = ".incipient"  # of a directory: size and name of the files there that this program wrote, one a line
MARK_HEAD = (
    "Files in this directory that incipient has written and may replace, with their sizes:\n"
)
AWAY = "choose another directory, or move it away"
_REMEDIES = {
    errno.ENOSPC: "free some space or choose another directory",
    errno.EDQUOT: "free some of your quota or choose another directory",
    errno.EFBIG: "raise the limit on the size of files (ulimit -f)",
    errno.EACCES: "choose a directory you may write to",
    errno.EPERM: "choose a directory you may write to",
    errno.EROFS: "choose a directory on a file system that is not read-only",
    errno.ENOENT: "make the directory first",
    errno.EEXIST: "a file stands where a directory is needed; choose another directory",
    errno.ENOTDIR: "a file stands where a directory is needed; choose another directory",
    errno.EISDIR: "a directory stands where the file is needed; choose another directory",
}


@contextmanager
def reported(path: Path, also: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Turn an operating system's error (and errors of the types `also`) into one line with cause and remedy.

    Raises:
        OutputError: naming `path`, why it could not be written and what to do.
    """
    caught: tuple[type[Exception], ...] = (OSError, *also)
    try:
        yield
    except caught as error:
        cause = " ".join(str(error).split()) or type(error).__name__
        if path.suffix == ".h5" or getattr(error, "errno", None):
            cause = cause_of(error)
        remedy = _REMEDIES.get(
            getattr(error, "errno", None) or 0,
            "check that the directory exists, has space and may be written to",
        )
        raise OutputError(
            f"{path}: cannot be written: {cause[0].lower()}{cause[1:]}; {remedy}"
        ) from error


def cause_of(error: Exception) -> str:
    """Why an HDF5 file could not be read or written; what the library says of its own insides is left out."""
    code = getattr(error, "errno", None)
    return os.strerror(code) if code else "it is damaged or incomplete"


def numbered(path: Path) -> Path:
    """The first of path.1, path.2 ... that is not there yet."""
    names = (path.with_name(f"{path.name}.{number}") for number in itertools.count(1))
    return next(name for name in names if not name.exists())


def part_of(path: Path) -> Path:
    """Where a file is written before it takes its place."""
    return path.with_name(path.name + ".part")


def owned(directory: Path, grown: bool = True) -> set[str]:
    """Names of the files in a directory that this program has written and nobody has changed, as its `MARK` says.

    Without `grown` files that grow during a run may have been changed since.
    """
    there = set()
    for name, sizes in _marked(directory).items():
        with suppress(OSError):
            # The last size but one is that of a file whose writer was killed before it took the new one's place.
            complete = sizes[-1] is not None if grown else None not in sizes
            if not complete or (directory / name).lstat().st_size in sizes[-2:]:
                there.add(name)
    return there


def _marked(directory: Path) -> dict[str, list[int | None]]:
    """Sizes by name in the `MARK` of a directory, one a writing; None of files that grow. Raises OutputError."""
    mark = directory / MARK
    if not mark.is_file():
        return {}
    with reported(mark):
        lines = os.fsdecode(mark.read_bytes()).splitlines()[1:]
    sizes: dict[str, list[int | None]] = {}
    for size, _, name in (line.partition(" ") for line in lines):
        sizes.setdefault(name, []).append(int(size) if size.isdecimal() else None)
    return sizes


def own(directory: Path, sizes: Mapping[str, int | None], wanted: Path | None = None) -> None:
    """Record in the `MARK` of a directory that files are this program's, which may replace them.

    `sizes` in bytes are those of files that do not grow, else None. Raises OutputError, which names the mark or what is
    `wanted`.
    """
    mark, known = directory / MARK, _marked(directory)
    lines = [
        f"{'-' if size is None else size} {name}\n"
        for name, size in sorted(sizes.items())
        if "\n" not in name and known.get(name, [-1])[-1] != size
    ]
    if not lines:
        return
    _refuse_link(mark)
    # Not into a pipe either, which a directory of somebody else may hold.
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK
    with reported(wanted or mark), os.fdopen(os.open(mark, flags, 0o666), "ab", 0) as stream:
        head = "" if mark.stat().st_size else MARK_HEAD
        write_fully(stream, os.fsencode("".join([head, *lines])))


def own_as_they_are(directory: Path, names: Iterable[str]) -> None:
    """Record the sizes of files that have grown and are complete, so that one that changes is its owner's.

    Raises OutputError as `own`.
    """
    known, sizes = _marked(directory), {}
    for name in names:
        if known.get(name, [0])[-1] is None:
            with suppress(OSError):
                sizes[name] = (directory / name).lstat().st_size
    own(directory, sizes)


def require_own(path: Path, whose: Collection[str] | None = None) -> None:
    """Refuse to write a file that is a link or that this program did not write.

    Args:
        whose: names of this program's files in the directory; default: those that are `owned`.

    Raises:
        OutputError: naming the file.
    """
    with reported(path):
        _refuse_link(path)
        if path.is_file() and path.name not in (owned(path.parent) if whose is None else whose):
            raise OutputError(
                f"{path}: was not written by incipient, or has been changed since; {AWAY}"
            )


def _refuse_link(path: Path) -> None:
    if path.is_symlink():
        raise OutputError(f"{path}: is a link, and nothing is written through links; {AWAY}")


def require_ending(path: Path, ending: str) -> None:
    """Refuse another name for a file of a kind, which might be that of a result to be read; raises OutputError."""
    if path.suffix.lower() != ending:
        raise OutputError(f"{path}: is no name for this file; let it end in {ending}")


def claim(path: Path) -> None:
    """Make a file this program's before it is written; raises OutputError as `require_own`."""
    require_own(path)
    own(path.parent, {path.name: None}, path)


def write_text_atomically(path: Path, text: str) -> None:
    """Write a text file (UTF-8) so that a reader finds the old content or the new, never a part.

    A failure leaves the old file as it was.

    Raises:
        OutputError: when it cannot be written, or is not this program's (see `require_own`).
    """
    write_bytes_atomically(path, text.encode(errors="backslashreplace"))


def write_bytes_atomically(path: Path, data: bytes) -> None:
    """Write content of any kind as `write_text_atomically` writes text."""
    with replaced(path, part_of(path)) as part, part.open("xb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())  # some file systems tell of a full disk only here


@contextmanager
def replaced(path: Path, part: Path, also: tuple[type[Exception], ...] = ()) -> Iterator[Path]:
    """A file to write, which takes the place of `path` if nothing goes wrong.

    Raises:
        OutputError: as of `require_own` and `reported`.
    """
    require_own(path)
    with reported(path, also):
        part.unlink(missing_ok=True)  # of a writer that was killed, or a link
        try:
            yield part
            own(path.parent, {path.name: part.stat().st_size}, path)
            part.replace(path)
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def write_json(path: Path, data: Any) -> None:
    """Write data as strict JSON, atomically, keys in the order given.

    Dataclasses, mappings, sequences, numpy arrays and scalars, enumerations and paths are converted.
    A number that is not finite is written as null under its key: JSON has no other way to say it.

    Raises:
        OutputError: when it cannot be written.
        TypeError: for data that has no counterpart in JSON.
    """
    text = json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False)
    write_text_atomically(path, text + "\n")


def plain(data: Any) -> Any:
    """Data as dictionaries, lists, strings, finite numbers, booleans and None only; see `write_json`."""
    if isinstance(data, Enum):
        return plain(data.value)
    if isinstance(data, (np.generic, np.ndarray)):
        return plain(data.tolist())
    if data is None or isinstance(data, (bool, int, str)):
        return data
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    if isinstance(data, Path):
        return str(data)
    return _plain_container(data)


def _plain_container(data: Any) -> Any:
    if is_dataclass(data) and not isinstance(data, type):
        return {field.name: plain(getattr(data, field.name)) for field in fields(data)}
    if isinstance(data, Mapping):
        return {str(plain(key)): plain(value) for key, value in data.items()}
    if isinstance(data, (list, tuple, set, frozenset)):
        return [plain(value) for value in data]
    raise TypeError(f"{type(data).__name__} has no counterpart in JSON")


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """A CSV file of these columns as text; what a row lacks is empty, what it has besides is left out."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def make_directory(path: Path, wanted: Path | None = None) -> None:
    """Make a directory, and those that it is in, if need be; raises OutputError, which names it or what is `wanted`."""
    with reported(wanted or path):
        path.mkdir(parents=True, exist_ok=True)


def append_row(path: Path, row: Mapping[str, float | int | str]) -> None:
    """Append a row to a CSV file, starting it with a header if it is new.

    When this returns the operating system has the row: the end of the program loses nothing, that of the machine may,
    but for what `sync` has been called after.

    The keys are the column headings in full, with unit and sign: "drag [scene units, + downstream]".
    A row that does not fit on the disk is taken back, so that the file never ends in half a row.

    Raises:
        OutputError: when it cannot be written, or when the file has other columns.
    """
    header, line = _csv_line(row.keys()), _csv_line(row.values())
    claim(path)
    with reported(path), path.open("a+b", buffering=0) as stream:
        end = stream.seek(0, os.SEEK_END)
        stream.seek(0)
        if end and stream.readline() != header:
            raise OutputError(
                f"{path}: has other columns than the row to append; move it out of the way"
            )
        try:
            write_fully(stream, line if end else header + line)
        except OSError:
            with suppress(OSError):
                os.truncate(path, end)
            raise


def sync(path: Path) -> None:
    """Make sure that what has been written to a file is on the disk; nothing where there is no such file.

    Raises:
        OutputError: when it cannot be.
    """
    if not path.exists():
        return
    with reported(path), path.open("rb") as stream:
        os.fsync(stream.fileno())


def ends_with(path: Path, end: str) -> bool:
    """Whether there is such a file, and a text is the last that it holds."""
    closing = end.encode()
    with reported(path):
        if not path.exists() or path.stat().st_size < len(closing):
            return False
        with path.open("rb") as stream:
            stream.seek(-len(closing), os.SEEK_END)
            return stream.read() == closing


def insert_before_end(path: Path, text: str, end: str) -> None:
    """Put a text before the end of a file, in place, at a cost that does not grow with the file.

    `end` is what the file ends with, such as closing tags. It is written again behind the text and in one call with
    it, so that the file is complete before and after. A text that does not fit on the disk is taken back.

    Raises:
        OutputError: when it cannot be written.
    """
    closing = end.encode()
    own(path.parent, {path.name: None}, path)
    with reported(path), path.open("r+b", buffering=0) as stream:
        place = stream.seek(-len(closing), os.SEEK_END)
        try:
            write_fully(stream, text.encode() + closing)
        except OSError:
            with suppress(OSError):
                stream.seek(place)
                write_fully(stream, closing)
                stream.truncate()
            raise


def cut(path: Path, rows: int, size: int) -> None:
    """Cut a CSV file back to its first `size` bytes, a header and so many rows; without rows it goes.

    Raises:
        OutputError: when it is shorter, those bytes are not so many rows, or it cannot be written.
    """
    with reported(path):
        if rows == 0:
            path.unlink(missing_ok=True)
            return
        head = path.read_bytes()[:size] if path.exists() else b""
        if len(head) < size or head.count(b"\n") != rows + 1 or not head.endswith(b"\n"):
            raise OutputError(
                f"{path}: has lost some of its {rows} rows; put the file back, or start anew"
            )
        os.truncate(path, size)


def cut_after(path: Path, time: float) -> None:
    """Cut a CSV file, if there is one, back to its header and the rows whose first number is at most a time.

    Raises:
        OutputError: when its rows do not begin with numbers, or it cannot be written.
    """
    with reported(path, (ValueError,)):
        if not path.exists():
            return
        header, *rows = path.read_bytes().splitlines(keepends=True) or [b""]
        kept = [row for row in rows if float(row.split(b",")[0]) <= time and row.endswith(b"\n")]
        os.truncate(path, sum(map(len, [header, *kept])))


def write_fully(stream: io.RawIOBase, data: bytes) -> None:
    """Write without a buffer, which would be written once more when the stream is closed after a failure."""
    while data:
        data = data[stream.write(data) or 0 :]


def _csv_line(values: Any) -> bytes:
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow([plain(value) for value in values])
    return line.getvalue().encode()
