"""Files written whole or not at all, and errors that say what stopped the writing.

Nothing here is collective: under MPI the caller writes on one rank, inside `incipient.parallel.collectively`.
"""

from __future__ import annotations

import csv
import errno
import fcntl
import io
import itertools
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib import metadata
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from .errors import OutputError

# Of a directory: the program's version, who has worked there, and below each other the names of its files there.
MARK = ".incipient"
PART = ".part"
CHUNK = 2**16  # rows of an array that HDF5 writes, and checks, at a time
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
    return path.with_name(path.name + PART)


def owned(directory: Path) -> set[str]:
    """Names of the files in a directory that this program has written, by its `MARK`; raises OutputError."""
    mark = directory / MARK
    if not mark.is_file():
        return set()
    with reported(mark):
        lines = os.fsdecode(mark.read_bytes()).splitlines()
    return {line for line in lines if not line.startswith("#")}


def own(path: Path) -> None:
    """Record that a file is this program's, which may replace it; raises OutputError, which names it."""
    if path.name not in owned(path.parent) and "\n" not in path.name:
        with reported(path), opened_mark(path.parent) as mark:
            write_fully(mark, os.fsencode(f"{path.name}\n"))


@contextmanager
def opened_mark(directory: Path) -> Iterator[io.FileIO]:
    """The `MARK` of a directory, made if need be, for lines to be appended; raises OSError or OutputError."""
    path = directory / MARK
    _refuse_link(path)
    # Not into a pipe either, which a directory of somebody else may hold.
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK
    with io.FileIO(os.open(path, flags, 0o666), "a") as mark:
        if not path.stat().st_size:
            write_fully(mark, f"# incipient {metadata.version('incipient')} wrote:\n".encode())
        yield mark


def hold_alone(file: IO[Any], busy: Callable[[], str]) -> None:
    """Lock an open file until it is closed; a file system without locks lets two in.

    Raises:
        OutputError: another process holds it, in the words of `busy`.
    """
    with suppress(OSError):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(busy()) from None


@contextmanager
def opened_hdf5(path: Path, remedy: str, error: type[OutputError] = OutputError) -> Iterator[Any]:
    """An HDF5 file, to be read. Raises `error` in one line with the remedy, also where the block fails on it."""
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            yield file
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as caught:
        raise error(f"{path}: cannot be read: {cause_of(caught)}; {remedy}") from caught


def require_own(path: Path, folder: bool = False) -> None:
    """Refuse to write a file (or `folder`) that is a link or not this program's; raises OutputError, which names it."""
    with reported(path):
        _refuse_link(path)
        name = path.name.removesuffix(PART)
        if (path.exists() if folder else path.is_file()) and name not in owned(path.parent):
            raise OutputError(f"{path}: was not written by incipient; {AWAY}")


def _refuse_link(path: Path) -> None:
    if path.is_symlink():
        raise OutputError(f"{path}: is a link, and nothing is written through links; {AWAY}")


def require_ending(path: Path, ending: str) -> None:
    """Refuse another name for a file of a kind, which might be that of a result to be read; raises OutputError."""
    if path.suffix.lower() != ending:
        raise OutputError(f"{path}: is no name for this file; let it end in {ending}")


def write_text_atomically(path: Path, text: str) -> None:
    """Write a text file (UTF-8) so that a reader finds the old content or the new, never a part.

    A failure leaves the old file as it was.

    Raises:
        OutputError: when it cannot be written, or is not this program's (see `require_own`).
    """
    write_bytes_atomically(path, text.encode(errors="backslashreplace"))


def write_bytes_atomically(path: Path, data: bytes | memoryview) -> None:
    """Write content of any kind as `write_text_atomically` writes text."""
    with replaced(path, part_of(path)) as part, part.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())  # some file systems tell of a full disk only here


def write_hdf5(
    path: Path,
    datasets: Mapping[str, NDArray[Any]],
    attributes: Mapping[str, Any],
    links: Mapping[str, str] | None = None,
) -> None:
    """Write an HDF5 file of arrays with checksums as `write_bytes_atomically`; its content is in memory meanwhile.

    `links` name other files in the directory, which hold datasets of the same names.
    """
    import h5py

    image = io.BytesIO()  # HDF5 that runs out of space takes the program with it
    with h5py.File(image, "w") as file:
        file.attrs.update(attributes)
        for name, value in datasets.items():
            chunks = (min(len(value), CHUNK), *value.shape[1:])
            checked = {"fletcher32": True, "chunks": chunks} if value.size else {}
            file.create_dataset(name, data=value, **checked)
        for name, other in (links or {}).items():
            file[name] = h5py.ExternalLink(other, name)
    write_bytes_atomically(path, image.getbuffer())


@contextmanager
def replaced(path: Path, part: Path, also: tuple[type[Exception], ...] = ()) -> Iterator[Path]:
    """A file to write, which takes the place of `path` if nothing goes wrong.

    Raises:
        OutputError: as of `require_own` and `reported`.
    """
    require_own(path)
    with reported(path, also):
        part.unlink(missing_ok=True)  # of a writer that was killed, or a link
        own(path)
        try:
            yield part
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
    require_own(path)
    own(path)
    with reported(path), path.open("a+b", buffering=0) as file:
        end = file.seek(0, os.SEEK_END)
        file.seek(0)
        if end and file.readline() != header:
            raise OutputError(
                f"{path}: has other columns than the row to append; move it out of the way"
            )
        try:
            write_fully(file, line if end else header + line)
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
    with reported(path), path.open("rb") as file:
        os.fsync(file.fileno())


def cut_after(path: Path, time: float, least: int = 0) -> None:
    """Cut a CSV file, if there is one, back to its header and the rows whose first number is at most a time.

    Raises:
        OutputError: when fewer than `least` rows are left, its rows do not begin with numbers, or it cannot be written.
    """
    with reported(path, (ValueError,)):
        content = path.read_bytes() if path.exists() else b""
        header, *rows = content.splitlines(keepends=True) or [b""]
        last = time + 1e-12 * abs(time)
        kept = [row for row in rows if float(row.split(b",")[0]) <= last and row.endswith(b"\n")]
        if len(kept) < least:
            remedy = "put the file back, or start a new run"
            raise OutputError(f"{path}: has lost some of its {least} rows; {remedy}")
        if content:
            os.truncate(path, sum(map(len, [header, *kept])))


def write_fully(file: io.RawIOBase, data: bytes) -> None:
    """Write without a buffer, which would be written once more when the file is closed after a failure."""
    while data:
        data = data[file.write(data) or 0 :]


def _csv_line(values: Any) -> bytes:
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow([plain(value) for value in values])
    return line.getvalue().encode()
