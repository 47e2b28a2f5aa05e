"""The one file of a sweep: cases, results, errors, costs, versions and status, in SQLite.

A sweep claims a case before it computes it, so that several sweeps on one file compute nothing twice; what a sweep that
has ended has claimed and not finished is free again. Results stand in the file as soon as they are there. Each case has
a checksum of what it is and what came out: one that was changed since is `DAMAGED`, and computed again.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
import sqlite3
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, Self
from urllib.parse import quote

from ..errors import OutputError, shortened
from ..files import make_directory
from ..output.lock import Holder
from . import quantities
from .cases import SweepCase

log = logging.getLogger("incipient")
# File systems, as the kernel names them, that several machines share.
_FREE = "9p afs beegfs ceph coda davfs gfs2 glusterfs lustre moosefs nfs nfs3 nfs4 ocfs2 orangefs pvfs2 sshfs"
OF_NETWORKS = frozenset(_FREE.split()) | {
    "cifs",
    "smb3",
    "smbfs",
    "fhgfs",
    "gpfs",
    "panfs",
    "quobyte",
    "wekafs",
}
SCHEMA_VERSION, WITHOUT_COLUMNS, WITHOUT_LOGS, WITHOUT_CHECKSUMS = 4, 3, 2, 1
LARGE = 20_000  # cases above which tables and pictures are by the table `shown`, without a look at checksums
AT_A_TIME = 1000  # rows that are read at a time
CHECKED = 2**28  # bytes of a file above which its pages are not checked as a whole when it is read
APPLICATION = 0x696E6370  # in the file's head: "incp"
PATIENCE = 60.0  # seconds that a writer waits for another
WAITING, RUNNING, DONE, FAILED, DAMAGED = "waiting", "running", "done", "failed", "damaged"
CHANGED = "was changed or damaged after it was written; the next incipient sweep computes it again"
_TABLES = """
CREATE TABLE cases (
    id TEXT PRIMARY KEY, task TEXT NOT NULL, source TEXT NOT NULL, settings TEXT NOT NULL, scene TEXT NOT NULL,
    status TEXT NOT NULL, reason TEXT NOT NULL DEFAULT '', owner TEXT, tries INTEGER NOT NULL DEFAULT 0,
    finished TEXT, wall REAL, cpu REAL, peak_mib REAL, versions TEXT, result TEXT, checksum TEXT, log TEXT
);
CREATE TABLE parameters (key TEXT PRIMARY KEY);
"""
# What finished cases have for the table, a column each; and what cases are counted by.
_SHOWN = """
CREATE TABLE shown (number INTEGER PRIMARY KEY);
CREATE INDEX cases_by_status ON cases (status, source);
"""
# What a case is, what came out, and what changes while it is at work.
_CASE = ("id", "task", "source", "settings", "scene")
_OUTCOME = ("reason", "finished", "wall", "cpu", "peak_mib", "versions", "result")
_COLUMNS = frozenset((*_CASE, *_OUTCOME, "status", "owner", "tries"))
_ADDED = {
    "checksum": WITHOUT_CHECKSUMS,
    "log": WITHOUT_LOGS,
}  # columns, and the last version without them
_NUMBERED = "SELECT rowid AS number, * FROM cases WHERE rowid = ?"
_IDENTIFIED = "SELECT rowid AS number, * FROM cases WHERE id = ?"
_UNREADABLE = "\N{REPLACEMENT CHARACTER}"  # in place of bytes that are no text
_OF_THE_DISK = {
    sqlite3.SQLITE_FULL: "free some space",
    sqlite3.SQLITE_IOERR: "free some space, check the disk, or copy the file to another",
    sqlite3.SQLITE_BUSY: "another program writes to it; wait until it has ended",
    sqlite3.SQLITE_LOCKED: "another program writes to it; wait until it has ended",
}
_OF_RIGHTS = (
    sqlite3.SQLITE_READONLY,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_PERM,
    sqlite3.SQLITE_AUTH,
)


def _uri(path: Path, make: bool) -> str:
    """How SQLite opens a file. A reader does not let the journal of somebody else's file change or remove any."""
    mode = "rwc" if make else "ro" if os.path.lexists(f"{path}-journal") else "rw"
    return f"file:{quote(os.fsencode(path.absolute()))}?mode={mode}"


@dataclass(frozen=True)
class CaseOutcome:
    """Outcome of a case: the result as plain data, or the reason why there is none, and the cost.

    wall, cpu: seconds, those of the processor of all ranks; peak_mib: of all ranks
    log: where it was computed and what was said; lost: its process died or was ended, and another try may do better
    """

    result: Mapping[str, Any] | None = None
    reason: str = ""
    wall: float = 0.0
    cpu: float = 0.0
    peak_mib: float = 0.0
    versions: Mapping[str, str] | None = None
    log: str = ""
    lost: bool = False


class Store:
    """The file, opened; a context manager. Not collective: one process opens it.

    Raises:
        OutputError: it is not the file of a sweep, is damaged, of another version, or cannot be read or written.
    """

    def __init__(self, path: Path, make: bool = False):
        self.path, self._owner = path, json.dumps(asdict(Holder.here()))
        if not make and not path.is_file():
            raise OutputError(f"{path}: no such file; give the file of a sweep")
        if make:
            make_directory(path.parent, path)
        with self._reported():
            # Statements commit themselves; what belongs together says so.
            self._base = sqlite3.connect(
                _uri(path, make), uri=True, timeout=PATIENCE, isolation_level=None
            )
            try:
                self._base.row_factory = sqlite3.Row
                # Text that was damaged differs from its checksum, and is not an error of the file as a whole.
                self._base.text_factory = partial(str, encoding="utf-8", errors="replace")
                self._prepare(make)
            except BaseException:
                self._base.close()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._base.close()

    @contextmanager
    def _reported(self) -> Iterator[None]:
        """Turn errors of SQLite, and of what a row holds, into one line."""
        try:
            yield
        except (sqlite3.Error, UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
            raise OutputError(f"{self.path}: {_complaint(error)}") from error

    def _prepare(self, make: bool) -> None:
        application, version = (self._pragma(name) for name in ("application_id", "user_version"))
        if application == APPLICATION:
            if not WITHOUT_CHECKSUMS <= version <= SCHEMA_VERSION:
                raise OutputError(
                    f"{self.path}: is of another version of the program; give another name"
                )
            columns = {*_COLUMNS, *(name for name, last in _ADDED.items() if version > last)}
            self._require_whole(columns, make or self.path.stat().st_size <= CHECKED)
            if make:
                self._choose_journal()
                self._add_columns(version)
            return
        if not make:
            raise OutputError(f"{self.path}: is not the file of a sweep; give another name")
        if application or self._base.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            raise OutputError(f"{self.path}: is the database of another program; give another name")
        self._choose_journal()
        with self._together():
            if not self._pragma("application_id"):  # else another sweep has just made it
                for statement in filter(str.strip, (_TABLES + _SHOWN).split(";")):
                    self._base.execute(statement)
                self._base.execute(f"PRAGMA application_id = {APPLICATION}")
                self._base.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")

    def _require_whole(self, columns: Set[str], wholly: bool) -> None:
        """Refuse a file whose pages do not fit together, if `wholly` checked: cases may be missing without a trace."""
        found = {row["name"] for row in self._base.execute("PRAGMA table_info(cases)")}
        missing = sorted(columns - found)
        said = (
            str(self._base.execute("PRAGMA integrity_check(1)").fetchone()[0]) if wholly else "ok"
        )
        if missing or said != "ok":
            raise OutputError(
                f"{self.path}: {_damaged(f'no column {missing[0]}' if missing else said)}"
            )

    def _choose_journal(self) -> None:
        """With WAL readers are not kept waiting, but it needs shared memory, which no network file system has."""
        kind = network_of(self.path)
        self._base.execute(f"PRAGMA journal_mode = {'DELETE' if kind else 'WAL'}")
        if kind:
            remedy = "let one sweep at a time write to it, or keep it on a local disk"
            log.warning("%s: is on a network file system (%s): %s", self.path, kind, remedy)

    def _add_columns(self, version: int) -> None:
        """Give a file of an earlier version the columns that it lacks."""
        if version == SCHEMA_VERSION:
            return
        with self._together():
            version = self._pragma("user_version")
            for name in (name for name, last in _ADDED.items() if version <= last):
                self._base.execute(f"ALTER TABLE cases ADD COLUMN {name} TEXT")
            self._base.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
            for statement in filter(str.strip, _SHOWN.split(";")):
                self._base.execute(statement)
            numbers = self._base.execute("SELECT rowid FROM cases").fetchall()
            for row in (self._base.execute(_NUMBERED, tuple(one)).fetchone() for one in numbers):
                if version == WITHOUT_CHECKSUMS:
                    update = "UPDATE cases SET checksum = ? WHERE id = ?"
                    self._base.execute(update, (_checksum(row), row["id"]))
                if row["status"] in (DONE, FAILED):
                    self._show(row)

    def _show(self, row: sqlite3.Row) -> None:
        """Put what a finished case has for the table into columns, which are made as they come."""
        try:
            found = quantities.found(row, self.keys())
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
            return  # damaged
        known = self._columns()
        for name in (name for name in found if name not in known):
            # A column without a type keeps numbers as they are.
            kind = "BOOLEAN" if isinstance(found[name], bool) else ""
            self._base.execute(f"ALTER TABLE shown ADD COLUMN {_quoted(name)} {kind}")
        names, values = ["number", *map(_quoted, found)], [row["number"], *found.values()]
        holders = ", ".join("?" * len(values))
        self._base.execute(
            f"INSERT OR REPLACE INTO shown ({', '.join(names)}) VALUES ({holders})", values
        )

    def _columns(self) -> dict[str, str]:
        """Columns of the table `shown`, with their types."""
        found = self._base.execute("PRAGMA table_info(shown)")
        return {row["name"]: row["type"] for row in found if row["name"] != "number"}

    @property
    def is_large(self) -> bool:
        """Whether there are more than `LARGE` cases, and columns of theirs."""
        with self._reported():
            if self._pragma("user_version") <= WITHOUT_COLUMNS:
                return False
            (last,) = self._base.execute("SELECT max(rowid) FROM cases").fetchone()
            return (last or 0) > LARGE

    def counts(self) -> dict[str, int]:
        """How many cases have each status."""
        with self._reported():
            return {
                one: n
                for one, n in self._base.execute(
                    "SELECT status, count(*) FROM cases GROUP BY status"
                )
            }

    def first_of_sources(self) -> list[dict[str, Any]]:
        """The first case of each source."""
        with self._reported():
            first = self._base.execute("SELECT min(rowid) FROM cases GROUP BY source").fetchall()
            rows = [
                self._base.execute(_NUMBERED, one).fetchone() for one in sorted(map(tuple, first))
            ]
            return [damaged(dict(row)) if _is_damaged(row) else dict(row) for row in rows]

    def columns_shown(self) -> list[str]:
        """Names of the varied keys and quantities of finished cases."""
        with self._reported():
            return list(self._columns())

    def values(self, names: Sequence[str]) -> list[list[Any]]:
        """The values of each of these columns, of all finished cases, None where one has none. Not checked."""
        with self._reported():
            cursor = self._base.cursor()
            cursor.row_factory = None
            columns = ", ".join(map(_quoted, names))
            cursor.execute(f"SELECT {columns} FROM shown ORDER BY number")
            found: list[list[Any]] = [[] for _ in names]
            # In parts: a million small tuples at a time take several times as long.
            while part := cursor.fetchmany(AT_A_TIME):
                for column, values in zip(found, zip(*part, strict=True), strict=True):
                    column.extend(values)
            return found

    def shown(self) -> Iterator[dict[str, Any]]:
        """All cases in the order in which they came, without their scenes and results. Not checked."""
        first, last = ("source", "task", "status"), (*_OUTCOME[:-1], "tries", "id")
        with self._reported():
            kinds = self._columns()
            names = [*first, *kinds, *last]
            columns = [*first, *(f"shown.{_quoted(name)}" for name in kinds), *last]
            join = "FROM cases LEFT JOIN shown ON number = cases.rowid ORDER BY cases.rowid"
            for row in self._base.execute(f"SELECT {', '.join(columns)} {join}"):
                found = zip(names, row, strict=True)
                yield {
                    name: bool(cell) if kinds.get(name) == "BOOLEAN" else cell
                    for name, cell in found
                    if cell is not None or name in last
                }

    def _pragma(self, name: str) -> int:
        return int(self._base.execute(f"PRAGMA {name}").fetchone()[0])

    @contextmanager
    def _together(self) -> Iterator[None]:
        """Write all of the block or nothing, and nobody else meanwhile."""
        with self._reported():
            self._base.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                if self._base.in_transaction:
                    self._base.execute("ROLLBACK")
                raise
            self._base.execute("COMMIT")

    def add(self, cases: Sequence[SweepCase], keys: Sequence[str]) -> None:
        """Put in the cases that are not there yet, or damaged, and the keys that they vary."""
        names = (*_CASE, "checksum", "status")
        rows = []
        for case in cases:
            content = case.identity, case.task, case.source, json.dumps(case.settings), case.text
            rows.append((*content, _checksum(dict(zip(_CASE, content, strict=True))), WAITING))
        emptied = ["reason = ''", "owner = NULL", *(f"{name} = NULL" for name in _OUTCOME[1:])]
        renewed = ", ".join([*(f"{name} = excluded.{name}" for name in names[1:]), *emptied])
        with self._together():
            self._base.executemany(
                f"INSERT INTO cases ({', '.join(names)}) VALUES ({', '.join('?' * len(names))})"
                f" ON CONFLICT (id) DO UPDATE SET {renewed} WHERE status = '{DAMAGED}'",
                rows,
            )
            self._base.executemany(
                "INSERT OR IGNORE INTO parameters VALUES (?)", [(key,) for key in keys]
            )

    def mark_damaged(self) -> int:
        """Give the status `DAMAGED` to cases that were changed since they were written; how many there are."""
        if not self._changed():
            return 0
        with self._together():
            found = self._changed()
            marked = [(DAMAGED, number) for number in found]
            self._base.executemany("UPDATE cases SET status = ? WHERE rowid = ?", marked)
            self._base.executemany("DELETE FROM shown WHERE number = ?", [(one,) for one in found])
        return len(found)

    def _changed(self) -> list[int]:
        with self._reported():
            rows = self._base.execute("SELECT rowid AS number, * FROM cases")
            return [row["number"] for row in rows if _is_damaged(row)]

    def free_abandoned(self) -> int:
        """Let cases wait again that a sweep which has ended was at; how many there were."""
        with self._together():
            held = self._base.execute(
                "SELECT DISTINCT owner FROM cases WHERE status = ?", (RUNNING,)
            )
            holders = {
                owner: Holder.read(str(owner or "").encode()) for (owner,) in held.fetchall()
            }
            gone = [
                owner for owner, holder in holders.items() if holder is None or holder.is_gone()
            ]
            update = "UPDATE cases SET status = ?, owner = NULL WHERE status = ? AND owner IS ?"
            return sum(
                self._base.execute(update, (WAITING, RUNNING, owner)).rowcount for owner in gone
            )

    def free_failed(self, identities: Sequence[str]) -> None:
        """Let cases wait again that have failed."""
        failed = [(WAITING, FAILED, identity) for identity in identities]
        with self._together():
            self._base.executemany(
                "UPDATE cases SET status = ? WHERE status = ? AND id = ?", failed
            )

    def states(self, identities: Sequence[str]) -> dict[str, str]:
        """The status of cases; of those that are not there, none."""
        wanted = set(identities)
        with self._reported():
            rows = self._base.execute("SELECT id, status FROM cases")
            return {row["id"]: row["status"] for row in rows if row["id"] in wanted}

    def results(self, identities: Sequence[str]) -> dict[str, tuple[str, Any]]:
        """Task and result of those of the cases that are done and not damaged, by identity."""
        found, query = {}, "SELECT * FROM cases WHERE id = ? AND status = ?"
        with self._reported():
            for identity in identities:
                row = self._base.execute(query, (identity, DONE)).fetchone()
                if row is not None and not _is_damaged(row):
                    found[identity] = row["task"], json.loads(row["result"])
        return found

    def claim(self, identities: Sequence[str], again: Sequence[str] = ()) -> set[str]:
        """Take the cases that wait, and begin those `again` that were taken before; which other sweeps have not."""
        take = (
            "UPDATE cases SET status = ?, owner = ?, tries = tries + 1 WHERE id = ? AND status = ?"
        )
        repeat = "UPDATE cases SET tries = tries + 1 WHERE id = ? AND owner = ?"
        with self._together():
            taken = {
                one
                for one in identities
                if self._base.execute(take, (RUNNING, self._owner, one, WAITING)).rowcount == 1
            }
            self._base.executemany(repeat, [(one, self._owner) for one in again])
        return taken

    def finish(self, outcomes: Mapping[str, CaseOutcome]) -> None:
        """Write what claimed cases came to, by identity."""
        with self._together():
            for identity, outcome in outcomes.items():
                self._finish(identity, outcome)

    def _finish(self, identity: str, outcome: CaseOutcome) -> None:
        both = outcome.versions, outcome.result
        versions, result = (
            None if one is None else json.dumps(one, allow_nan=False) for one in both
        )
        state = FAILED if result is None else DONE
        now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S")
        found = (outcome.reason, now, outcome.wall, outcome.cpu, outcome.peak_mib, versions, result)
        changed = self._base.execute(
            f"UPDATE cases SET status = ?, owner = NULL, log = ?, {', '.join(f'{name} = ?' for name in _OUTCOME)}"
            " WHERE id = ? AND owner = ?",
            (state, outcome.log, *found, identity, self._owner),
        )
        if changed.rowcount:
            row = self._base.execute(_IDENTIFIED, (identity,)).fetchone()
            self._base.execute(
                "UPDATE cases SET checksum = ? WHERE id = ?", (_checksum(row), identity)
            )
            self._show(row)

    def give_back(self) -> None:
        """Let the cases wait again that this sweep has claimed and not finished."""
        with self._reported():
            self._base.execute(
                "UPDATE cases SET status = ?, owner = NULL, tries = tries - 1 WHERE status = ? AND owner = ?",
                (WAITING, RUNNING, self._owner),
            )

    def keys(self) -> list[str]:
        """The keys that cases vary, in the order in which they came."""
        with self._reported():
            found = [
                key for (key,) in self._base.execute("SELECT key FROM parameters ORDER BY rowid")
            ]
        if not all(
            isinstance(key, str) and key.isprintable() and _UNREADABLE not in key for key in found
        ):
            raise OutputError(f"{self.path}: {_damaged('a key of its parameters is none')}")
        return found

    def rows(self, most: int | None = None) -> list[dict[str, Any]]:
        """All cases, or the first, in the order in which they came; damaged ones with that status and no result."""
        with self._reported():
            found = self._base.execute(
                "SELECT * FROM cases ORDER BY rowid LIMIT ?", (-1 if most is None else most,)
            )
            return [damaged(dict(row)) if _is_damaged(row) else dict(row) for row in found]


def network_of(path: Path, mounts: Path = Path("/proc/self/mounts")) -> str:
    """The kind of the network file system that a file is on; empty for a local disk, or where Linux does not tell."""
    best, found = -1, ""
    with suppress(OSError):
        place = str(path.absolute().parent.resolve())
        for line in mounts.read_text().splitlines():
            _, point, kind, *_ = line.split()
            point = re.sub(r"\\(\d{3})", lambda octal: chr(int(octal[1], 8)), point).rstrip("/")
            if (place == point or place.startswith(f"{point}/")) and len(point) >= best:
                best, found = len(point), kind
    return found if found.removeprefix("fuse.") in OF_NETWORKS else ""


def _quoted(name: str) -> str:
    """A name for SQL."""
    doubled = name.replace('"', '""')
    return f'"{doubled}"'


def _checksum(row: Mapping[str, Any] | sqlite3.Row) -> str:
    """The checksum of what a case is and what came out."""
    held, empty = row.keys(), {"reason": ""}
    content = [row[name] if name in held else empty.get(name) for name in (*_CASE, *_OUTCOME)]
    return hashlib.sha256(json.dumps(content, default=repr).encode()).hexdigest()


def _is_damaged(row: sqlite3.Row) -> bool:
    """Whether a case is not what was written; of those written without a checksum, whether it cannot be."""
    held = row.keys()
    status = row["status"]
    if status not in (WAITING, RUNNING, DONE, FAILED) or (status == DONE) != bool(row["result"]):
        return True
    return "checksum" in held and row["checksum"] != _checksum(row)


def damaged(row: Mapping[str, Any]) -> dict[str, Any]:
    """A case of which nothing is believed but that it is there."""
    believed = {name: str(row[name]) for name in ("id", "source", "task")}
    return {**dict.fromkeys(row), **believed, "status": DAMAGED, "reason": CHANGED}


def _complaint(error: Exception) -> str:
    """Message of an error of SQLite, and the remedy."""
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF
    if code == sqlite3.SQLITE_NOTADB:
        return f"is not the file of a sweep ({shortened(error)}); give another name"
    if code in _OF_RIGHTS:
        return f"{shortened(error)}; check that directory and file may be written to"
    return f"{shortened(error)}; {_OF_THE_DISK[code]}" if code in _OF_THE_DISK else _damaged(error)


def _damaged(why: object) -> str:
    remedy = (
        "put back a copy, give another name, or save what can be read with sqlite3 FILE .recover"
    )
    return f"is damaged ({shortened(why)}); {remedy}"
