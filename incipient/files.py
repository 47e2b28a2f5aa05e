"""Atomic writing of files, on one rank inside `incipient.parallel.collectively`."""

from __future__ import annotations

import csv
import errno
import fcntl
import io
import itertools
import json
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
from pydantic_core import to_jsonable_python

from .errors import OutputError, SceneError
from .input_files import cause_of

# File of a directory with the program's version, its processes, and the names of its files, one a line.
MARK = ".incipient"
PART = ".part"
CHUNK = 2**16  # rows of an array per chunk and checksum in HDF5
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
    errno.EISDIR: "a directory has the name of the file; choose another directory",
}


@contextmanager
def reported(path: Path, also: tuple[type[Exception], ...] = ()) -> Iterator[None]:
    """Convert OSError (and errors of the types `also`) to OutputError with path, cause and remedy."""
    caught: tuple[type[Exception], ...] = (OSError, *also)
    try:
        yield
    except caught as error:
        cause = cause_of(error)
        remedy = _REMEDIES.get(
            getattr(error, "errno", None) or 0,
            "check that the directory exists, has space and may be written to",
        )
        raise OutputError(
            f"{path}: cannot be written: {cause[0].lower()}{cause[1:]}; {remedy}"
        ) from error


def numbered(path: Path) -> Path:
    """First free name of path.1, path.2 ..."""
    names = (path.with_name(f"{path.name}.{number}") for number in itertools.count(1))
    return next(name for name in names if not name.exists())


def part_of(path: Path) -> Path:
    """Temporary path of a file during writing."""
    return path.with_name(path.name + PART)


def owned(directory: Path) -> set[str]:
    """Names of this program's files in a directory, from its `MARK`. Raises OutputError."""
    mark = directory / MARK
    if not mark.is_file():
        return set()
    with reported(mark):
        lines = os.fsdecode(mark.read_bytes()).splitlines()
    return {line for line in lines if not line.startswith("#")}


def own(path: Path) -> None:
    """Record a file as this program's, which may replace it. Raises OutputError."""
    if path.name not in owned(path.parent) and "\n" not in path.name:
        with reported(path), opened_mark(path.parent) as mark:
            write_fully(mark, os.fsencode(f"{path.name}\n"))


@contextmanager
def opened_mark(directory: Path) -> Iterator[io.FileIO]:
    """The `MARK` of a directory, created if missing, for appending. Raises OSError, OutputError."""
    path = directory / MARK
    _refuse_link(path)
    # Pipes in a foreign directory are refused.
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK
    with io.FileIO(os.open(path, flags, 0o666), "a") as mark:
        if not path.stat().st_size:
            write_fully(mark, f"# incipient {metadata.version('incipient')} wrote:\n".encode())
        yield mark


def hold_alone(file: IO[Any], busy: Callable[[], str]) -> None:
    """Lock an open file until it is closed; without effect on file systems without locks.

    Raises OutputError, with the message from `busy`, if another process holds the lock.
    """
    with suppress(OSError):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OutputError(busy()) from None


@contextmanager
def opened_hdf5(path: Path, remedy: str = "run the scene again") -> Iterator[Any]:
    """HDF5 file for reading. Raises OutputError with the remedy, also for errors of reading in the block."""
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as file:
            yield file
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as caught:
        code = getattr(caught, "errno", None)
        cause = os.strerror(code) if code else "it is damaged or incomplete"
        raise OutputError(f"{path}: cannot be read: {cause}; {remedy}") from caught


def require_own(path: Path, folder: bool = False) -> None:
    """Raise OutputError for an output file (or `folder`) that is a link or not this program's."""
    with reported(path):
        _refuse_link(path)
        name = path.name.removesuffix(PART)
        if (path.exists() if folder else path.is_file()) and name not in owned(path.parent):
            raise OutputError(f"{path}: was not written by incipient; {AWAY}")


def _refuse_link(path: Path) -> None:
    if path.is_symlink():
        raise OutputError(f"{path}: is a link, through which incipient does not write; {AWAY}")


def require_ending(path: Path, ending: str) -> None:
    """Raise OutputError for another suffix: the path may be that of an input file."""
    if path.suffix.lower() != ending:
        raise OutputError(f"{path}: is not a valid name for this file; let it end in {ending}")


def write_text_atomically(path: Path, text: str) -> None:
    """Write a UTF-8 file atomically; after a failure the old file is unchanged.

    Raises OutputError if writing failed, or the file is not this program's.
    """
    write_bytes_atomically(path, text.encode(errors="backslashreplace"))


def write_bytes_atomically(path: Path, data: bytes | memoryview) -> None:
    """Write bytes; as `write_text_atomically`."""
    with replaced(path, part_of(path)) as part, part.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())  # some file systems report a full disk only here


def write_hdf5(
    path: Path,
    datasets: Mapping[str, NDArray[Any]],
    attributes: Mapping[str, Any],
    links: Mapping[str, str] | None = None,
) -> None:
    """Write arrays with checksums to an HDF5 file atomically.

    links: other files in the directory with datasets of these names
    """
    import h5py

    image = io.BytesIO()  # HDF5 aborts the program on a full disk
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
    """Temporary file that replaces `path` after success. Raises OutputError."""
    require_own(path)
    with reported(path, also):
        part.unlink(missing_ok=True)  # left by a killed process, or a link
        own(path)
        try:
            yield part
            part.replace(path)
        finally:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def write_json(path: Path, data: Any) -> None:
    """Write data atomically as strict JSON; infinite numbers and NaN become null.

    Raises OutputError, or TypeError for data without a counterpart in JSON.
    """
    text = json.dumps(plain(data), indent=2, ensure_ascii=False, allow_nan=False)
    write_text_atomically(path, text + "\n")


def write_results(directory: Path, contents: Mapping[str, Any]) -> None:
    """Write files by name: text, or data as `write_json`. Raises OutputError."""
    make_directory(directory)
    for name, content in contents.items():
        if isinstance(content, str):
            write_text_atomically(directory / name, content)
        else:
            write_json(directory / name, content)


def plain(data: Any) -> Any:
    """Data as dictionaries, lists, strings, finite numbers, booleans and None; see `write_json`."""
    if isinstance(data, dict):
        return {key: plain(part) for key, part in data.items()}
    if isinstance(data, tuple | list):
        return [plain(part) for part in data]
    if hasattr(data, "to_dict"):
        return plain(data.to_dict())
    if is_dataclass(data):
        return plain_fields(data)
    if isinstance(data, Enum):
        return data.name
    return to_jsonable_python(data, inf_nan_mode="null", fallback=_listed)


def plain_fields(data: Any) -> dict[str, Any]:
    """Fields of a data class that its repr shows, and the properties that it names as `derived`."""
    shown = (item.name for item in fields(data) if item.repr)
    return {name: plain(getattr(data, name)) for name in (*shown, *getattr(data, "derived", ()))}


def _listed(data: Any) -> Any:
    if isinstance(data, (np.generic, np.ndarray)):
        return data.tolist()
    raise TypeError(f"{type(data).__name__} has no counterpart in JSON")


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """CSV text with these columns; missing values are empty, other keys are ignored."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def make_directory(path: Path, wanted: Path | None = None) -> None:
    """Create a directory with its parents. Raises OutputError about it, or about `wanted`."""
    with reported(wanted or path):
        path.mkdir(parents=True, exist_ok=True)


def write_new(path: Path, text: str) -> None:
    """Write a new UTF-8 file. Raises SceneError if it exists, otherwise OutputError."""
    with reported(path):
        try:
            with path.open("xb", buffering=0) as file:
                write_fully(file, text.encode())
        except FileExistsError:
            raise SceneError(f"{path}: already exists; choose another name") from None


def append_row(path: Path, row: Mapping[str, float | int | str]) -> None:
    """Append a row to a CSV file, with a header in a new file.

    The row survives a crash of the machine only after `sync`. On a full disk an incomplete row is removed. Raises
    OutputError.
    """
    header, line = csv_text([*row], [plain(row)]).encode().splitlines(keepends=True)
    require_own(path)
    own(path)
    with reported(path), path.open("ab", buffering=0) as file:
        end = file.tell()
        try:
            write_fully(file, line if end else header + line)
        except OSError:
            with suppress(OSError):
                os.truncate(path, end)
            raise


def sync(path: Path) -> None:
    """Flush a file to the disk if it exists. Raises OutputError."""
    if not path.exists():
        return
    with reported(path), path.open("rb") as file:
        os.fsync(file.fileno())


def cut_after(path: Path, time: float, least: int = 0) -> None:
    """Cut an existing CSV file after the last row whose first number is at most `time`.

    Raises OutputError if fewer than `least` rows are left, rows do not begin with numbers, or writing failed.
    """
    with reported(path, (ValueError,)):
        content = path.read_bytes() if path.exists() else b""
        header, *rows = content.splitlines(keepends=True) or [b""]
        last = time + 1e-12 * abs(time)
        kept = [row for row in rows if float(row.split(b",")[0]) <= last and row.endswith(b"\n")]
        if len(kept) < least:
            raise OutputError(
                f"{path}: has lost some of its {least} rows; restore the file, or start a new run"
            )
        if content:
            os.truncate(path, sum(map(len, [header, *kept])))


def write_fully(file: io.RawIOBase, data: bytes) -> None:
    """Write unbuffered: a buffer would be written again on closing after a failure."""
    while data:
        data = data[file.write(data) or 0 :]
