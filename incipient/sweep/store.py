"""The one file of a sweep: cases, results, errors, costs, versions and status, in SQLite.

A sweep claims a case before it computes it, so that several sweeps on one file compute nothing twice; what a sweep that
has ended has claimed and not finished is free again. Results stand in the file as soon as they are there.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

from ..errors import OutputError
from ..files import reported
from ..output.lock import Holder
from .cases import Case

SCHEMA_VERSION = 1
APPLICATION = 0x696E6370  # in the file's head: "incp"
PATIENCE = 60.0  # seconds that a writer waits for another
WAITING, RUNNING, DONE, FAILED = "waiting", "running", "done", "failed"
_TABLES = """
CREATE TABLE cases (
    id TEXT PRIMARY KEY, task TEXT NOT NULL, source TEXT NOT NULL, settings TEXT NOT NULL, scene TEXT NOT NULL,
    status TEXT NOT NULL, reason TEXT NOT NULL DEFAULT '', owner TEXT, tries INTEGER NOT NULL DEFAULT 0,
    finished TEXT, wall REAL, cpu REAL, peak_mib REAL, versions TEXT, result TEXT
);
CREATE TABLE parameters (key TEXT PRIMARY KEY);
"""


@dataclass(frozen=True)
class Outcome:
    """What computing a case came to: the result as plain data, or the reason why there is none, and the cost.

    wall, cpu: seconds, those of the processor of all ranks; peak_mib: of all ranks
    """

    result: Mapping[str, Any] | None = None
    reason: str = ""
    wall: float = 0.0
    cpu: float = 0.0
    peak_mib: float = 0.0
    versions: Mapping[str, str] | None = None


class Store:
    """The file, opened; a context manager. Not collective: one process opens it.

    Raises:
        OutputError: it is not the file of a sweep, is of another version, or cannot be read or written.
    """

    def __init__(self, path: Path, make: bool = False):
        self.path, self._owner = path, json.dumps(asdict(Holder.here()))
        if not make and not path.is_file():
            raise OutputError(f"{path}: no such file; give the file of a sweep")
        if make:
            with reported(path):
                path.parent.mkdir(parents=True, exist_ok=True)
        with self._told():
            # Statements commit themselves; what belongs together says so.
            self._base = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
            self._base.row_factory = sqlite3.Row
            self._prepare()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._base.close()

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Turn SQLite's errors into one line."""
        try:
            yield
        except sqlite3.OperationalError as error:
            remedy = "free some space, or check that directory and file may be written to"
            raise OutputError(f"{self.path}: {error}; {remedy}") from error
        except sqlite3.DatabaseError as error:
            raise OutputError(
                f"{self.path}: is not the file of a sweep ({error}); give another name"
            ) from error

    def _prepare(self) -> None:
        application, version = (self._pragma(name) for name in ("application_id", "user_version"))
        if application == APPLICATION:
            if version != SCHEMA_VERSION:
                raise OutputError(f"{self.path}: is of another version of the program; give another name")
            return
        if application or self._base.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            raise OutputError(f"{self.path}: is the database of another program; give another name")
        # Readers are not kept waiting, and a killed writer leaves the file whole.
        self._base.execute("PRAGMA journal_mode = WAL")
        with self._together():
            if not self._pragma("application_id"):  # else another sweep has just made it
                for statement in filter(str.strip, _TABLES.split(";")):
                    self._base.execute(statement)
                self._base.execute(f"PRAGMA application_id = {APPLICATION}")
                self._base.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")

    def _pragma(self, name: str) -> int:
        return int(self._base.execute(f"PRAGMA {name}").fetchone()[0])

    @contextmanager
    def _together(self) -> Iterator[None]:
        """Write all of the block or nothing, and nobody else meanwhile."""
        with self._told():
            self._base.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                if self._base.in_transaction:
                    self._base.execute("ROLLBACK")
                raise
            self._base.execute("COMMIT")

    def add(self, cases: Sequence[Case], keys: Sequence[str]) -> None:
        """Put in the cases that are not there yet, and the keys that they vary."""
        rows = [
            (case.identity, case.task, case.source, json.dumps(case.settings), case.text, WAITING)
            for case in cases
        ]
        with self._together():
            self._base.executemany(
                "INSERT OR IGNORE INTO cases (id, task, source, settings, scene, status)"
                " VALUES (?, ?, ?, ?, ?, ?)",
                rows,
            )
            self._base.executemany("INSERT OR IGNORE INTO parameters VALUES (?)", [(key,) for key in keys])

    def free_abandoned(self) -> int:
        """Let cases wait again that a sweep which has ended was at; how many there were."""
        with self._together():
            held = self._base.execute(
                "SELECT DISTINCT owner FROM cases WHERE status = ?", (RUNNING,)
            ).fetchall()
            gone = [owner for (owner,) in held if _is_gone(owner)]
            return sum(
                self._base.execute(
                    "UPDATE cases SET status = ?, owner = NULL WHERE status = ? AND owner IS ?",
                    (WAITING, RUNNING, owner),
                ).rowcount
                for owner in gone
            )

    def free_failed(self, identities: Sequence[str]) -> None:
        """Let cases wait again that have failed."""
        with self._together():
            self._base.executemany(
                "UPDATE cases SET status = ? WHERE status = ? AND id = ?",
                [(WAITING, FAILED, identity) for identity in identities],
            )

    def states(self, identities: Sequence[str]) -> dict[str, str]:
        """The status of cases; of those that are not there, none."""
        wanted = set(identities)
        with self._told():
            return {
                row[0]: row[1]
                for row in self._base.execute("SELECT id, status FROM cases")
                if row[0] in wanted
            }

    def results(self, identities: Sequence[str]) -> dict[str, tuple[str, Any]]:
        """Task and result of those of the cases that are done, by identity."""
        found = {}
        with self._told():
            for identity in identities:
                row = self._base.execute(
                    "SELECT task, result FROM cases WHERE id = ? AND status = ?", (identity, DONE)
                ).fetchone()
                if row is not None:
                    found[identity] = row[0], json.loads(row[1])
        return found

    def claim(self, identity: str) -> bool:
        """Take a case that waits; False if another sweep has."""
        with self._told():
            changed = self._base.execute(
                "UPDATE cases SET status = ?, owner = ?, tries = tries + 1 WHERE id = ? AND status = ?",
                (RUNNING, self._owner, identity, WAITING),
            )
        return changed.rowcount == 1

    def finish(self, identity: str, outcome: Outcome) -> None:
        """Write what a claimed case came to."""
        texts = [
            None if data is None else json.dumps(data, allow_nan=False)
            for data in (outcome.versions, outcome.result)
        ]
        with self._told():
            self._base.execute(
                "UPDATE cases SET status = ?, reason = ?, owner = NULL, finished = datetime('now'), wall = ?, cpu = ?,"
                " peak_mib = ?, versions = ?, result = ? WHERE id = ? AND owner = ?",
                (
                    DONE if outcome.result is not None else FAILED,
                    outcome.reason,
                    outcome.wall,
                    outcome.cpu,
                    outcome.peak_mib,
                    *texts,
                    identity,
                    self._owner,
                ),
            )

    def give_back(self) -> None:
        """Let the cases wait again that this sweep has claimed and not finished."""
        with self._told():
            self._base.execute(
                "UPDATE cases SET status = ?, owner = NULL, tries = tries - 1 WHERE status = ? AND owner = ?",
                (WAITING, RUNNING, self._owner),
            )

    def keys(self) -> list[str]:
        """The keys that cases vary, in the order in which they came."""
        with self._told():
            return [key for (key,) in self._base.execute("SELECT key FROM parameters ORDER BY rowid")]

    def rows(self) -> list[dict[str, Any]]:
        """All cases as they stand in the file, in the order in which they came."""
        with self._told():
            return [dict(row) for row in self._base.execute("SELECT * FROM cases ORDER BY rowid")]


def _is_gone(owner: str | None) -> bool:
    holder = Holder.read((owner or "").encode())
    return holder is None or holder.is_gone()
