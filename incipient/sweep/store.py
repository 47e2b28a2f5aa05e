"""The SQLite file of a sweep: scenes, results, costs, versions and status of its cases.

The table `cases` has a row for each case, with the scene and the quantities of the table as JSON. A lock file admits
one writer.
"""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Container, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self
from urllib.parse import quote

from ..errors import OutputError, SceneError, shortened
from ..files import hold_alone, make_directory, reported
from .cases import SweepCase, differing
from .worker import CaseOutcome

# In the head of the file: "incp", and the version of its tables.
APPLICATION, FORMAT = 0x696E6370, 6
WAITING, DONE, FAILED = "waiting", "done", "failed"
COST = ("wall", "cpu", "peak_mib", "tries", "finished")
_TABLE = """
CREATE TABLE cases (
    id TEXT PRIMARY KEY, source TEXT NOT NULL, task TEXT NOT NULL, status TEXT NOT NULL, settings JSON NOT NULL,
    scene JSON NOT NULL, columns JSON NOT NULL DEFAULT '{}', result JSON, reason TEXT NOT NULL DEFAULT '', wall REAL,
    cpu REAL, peak_mib REAL, tries INTEGER NOT NULL DEFAULT 0, finished TEXT, versions JSON NOT NULL DEFAULT '{}',
    log TEXT NOT NULL DEFAULT ''
)
"""
_OF_DAMAGE = (sqlite3.Error, ValueError, TypeError, AttributeError, RecursionError)
_REMEDIES = {
    sqlite3.SQLITE_FULL: "free some space",
    sqlite3.SQLITE_IOERR: "free some space, check the disk, or copy the file to another",
    sqlite3.SQLITE_BUSY: "another program writes to it; wait until it has ended",
    sqlite3.SQLITE_READONLY: "check that directory and file may be written to",
    sqlite3.SQLITE_CANTOPEN: "check that directory and file may be written to",
    sqlite3.SQLITE_NOTADB: "it is not the file of a sweep; give another name",
}


class Store:
    """The open file; a context manager for one process.

    Raises SceneError if it is not the file of a sweep, OutputError if of another version, or not readable or writable.
    """

    def __init__(self, path: Path, make: bool = False):
        self.path, self._open = path, ExitStack()
        if not make and not path.is_file():
            raise SceneError(f"{path}: no such file; give the file of a sweep")
        with self._reported(), ExitStack() as opened:
            if make:
                make_directory(path.parent, path)
                lock = path.with_name(f".{path.name}.lock")
                with reported(path):
                    alone = opened.enter_context(lock.open("a"))
                    hold_alone(
                        alone,
                        lambda: f"{path}: another sweep writes to it; wait until it has ended",
                    )
            uri = f"file:{quote(str(path.absolute()))}?mode={'rwc' if make else 'rw'}"
            # Statements commit themselves; a transaction begins where several belong together.
            self._base = sqlite3.connect(uri, uri=True, timeout=60.0, isolation_level=None)
            opened.callback(self._base.close)
            self._base.row_factory = sqlite3.Row
            self._prepare(make)
            self._open = opened.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._open.close()

    @contextmanager
    def _reported(self, kinds: tuple[type[Exception], ...] = _OF_DAMAGE) -> Iterator[None]:
        try:
            yield
        except kinds as error:
            code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF
            remedy = _REMEDIES.get(
                code, "it is damaged; restore a copy, or save it by sqlite3 FILE .recover"
            )
            kind = SceneError if code == sqlite3.SQLITE_NOTADB else OutputError
            raise kind(f"{self.path}: {shortened(error)}; {remedy}") from error

    def _prepare(self, make: bool) -> None:
        application, number = (
            self._base.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("application_id", "user_version")
        )
        if application == APPLICATION and number == FORMAT:
            return
        if application == APPLICATION:
            raise OutputError(
                f"{self.path}: is the file of a sweep by another version of incipient; "
                "give another name, or use that version"
            )
        if not make or self._base.execute("SELECT 1 FROM sqlite_master").fetchone():
            raise SceneError(f"{self.path}: is not the file of a sweep; give another name")
        with self.transaction():
            self._base.execute(_TABLE)
            self._base.execute(f"PRAGMA application_id = {APPLICATION}")
            self._base.execute(f"PRAGMA user_version = {FORMAT}")

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Changes that are written together, or after an error not at all."""
        with self._reported((sqlite3.Error,)), self._base:
            self._base.execute("BEGIN IMMEDIATE")
            yield

    def add(self, cases: Sequence[SweepCase], retry: bool = False) -> None:
        """Add new cases; with `retry` failed cases wait again."""
        names = "id, source, task, status, settings, scene"
        insert = f"INSERT OR IGNORE INTO cases ({names}) VALUES (?, ?, ?, ?, ?, ?)"
        update = "UPDATE cases SET status = ?, reason = '' WHERE id = ? AND status = ?"
        with self.transaction():
            for case in cases:
                settings = json.dumps(case.settings)
                row = (case.identity, case.source, case.task, WAITING, settings, case.text)
                self._base.execute(insert, row)
                if retry:
                    self._base.execute(update, (WAITING, case.identity, FAILED))

    def finish(self, identity: str, tries: int, outcome: CaseOutcome) -> None:
        cells = vars(outcome) | {
            "status": FAILED if outcome.result is None else DONE,
            # SQLite reads no Infinity.
            "columns": re.sub(r"\bInfinity\b", "9e999", json.dumps(outcome.columns)),
            "versions": json.dumps(outcome.versions),
            "tries": tries,
            "finished": datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S"),
        }
        assigned = ", ".join(f"{name} = ?" for name in cells)
        with self._reported():
            self._base.execute(
                f"UPDATE cases SET {assigned} WHERE id = ?", (*cells.values(), identity)
            )

    def states(self) -> dict[str, str]:
        with self._reported():
            return dict(map(tuple, self._base.execute("SELECT id, status FROM cases")))

    def columns(self, identities: Container[str]) -> dict[str, dict[str, Any]]:
        query = "SELECT id, columns FROM cases WHERE status = ?"
        with self._reported():
            rows = self._base.execute(query, (DONE,))
            return {number: json.loads(text) for number, text in rows if number in identities}

    def keys(self) -> list[str]:
        """Varied keys: of the settings, then those in which scenes with the same settings differ, as after an edit."""
        alike = "GROUP BY source, task, settings HAVING COUNT(*) > 1 ORDER BY rowid"
        with self._reported():
            rows = self._base.execute("SELECT DISTINCT settings FROM cases ORDER BY rowid")
            settings = [setting for (text,) in rows for setting in json.loads(text)]
            keys = [setting.partition("=")[0].strip() for setting in settings]
            groups = self._base.execute(f"SELECT json_group_array(json(scene)) FROM cases {alike}")
            for (scenes,) in groups:
                keys += differing(json.loads(scenes))
        return list(dict.fromkeys(keys))

    def cases(self) -> list[dict[str, Any]]:
        """All cases in order; scene, columns and versions are parsed, the result is not."""
        parsed = ("scene", "columns", "versions")
        with self._reported():
            rows = [dict(row) for row in self._base.execute("SELECT * FROM cases ORDER BY rowid")]
            return [row | {name: dict(json.loads(row[name])) for name in parsed} for row in rows]
