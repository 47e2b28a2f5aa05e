"""The file of a sweep when it is damaged, changed by hand, or of an earlier version of the program."""

from __future__ import annotations

import json
import random
import shutil
import sqlite3
from pathlib import Path

import pytest

from incipient.errors import OutputError
from incipient.reporting.sweep import context_of
from incipient.sweep import store as stores
from incipient.sweep.cases import SweepCase
from incipient.sweep.store import DAMAGED, DONE, WAITING, CaseOutcome, Store, network_of
from incipient.sweep.table import as_csv, columns, in_words, rows

CASES = [
    SweepCase(f"case{n}", "judge", "made", (f"a.x={n}",), json.dumps({"a": {"x": n}}), "")
    for n in range(40)
]
AS_LONG_AS_RESULTS = "x" * 3000


def filled(path: Path) -> list[dict]:
    """A file of finished cases, closed as a sweep leaves it, and its table."""
    with Store(path, make=True) as store:
        store.add(CASES, ["a.x"])
        for number, case in enumerate(CASES):
            assert store.claim([case.identity])
            result = {
                "verdict": None,
                "coefficients": {"drag": float(number)},
                "text": AS_LONG_AS_RESULTS,
            }
            store.finish(
                {case.identity: CaseOutcome(result, wall=1.5, versions={"incipient": "1"})}
            )
    return rows(path)


def changed(path: Path, statement: str, *values: object) -> None:
    with sqlite3.connect(path) as base:
        base.execute(statement, values)
    base.close()


@pytest.mark.parametrize("start", range(5))
def test_random_bytes_give_one_line_or_a_table_that_says_what_is_damaged(
    tmp_path: Path, start: int
) -> None:
    """Two hundred bytes at random places, as of a bad disk, in 200 files in all: no other error, no wrong number."""
    path, broken = tmp_path / "whole.sqlite", tmp_path / "broken.sqlite"
    whole = filled(path)
    content, unnoticed = path.read_bytes(), 0
    for seed in range(40 * start, 40 * start + 40):
        chance, bytes_of = random.Random(seed), bytearray(content)
        number = chance.choice((1, 20, 200))
        for place in (chance.randrange(len(content)) for _ in range(number)):
            bytes_of[place] = chance.randrange(256)
        for left_over in tmp_path.glob("broken*"):
            left_over.unlink()
        broken.write_bytes(bytes_of)
        try:
            found = rows(broken)
        except OutputError as error:
            assert len(str(error)) < 400 and "\n" not in str(error)
            continue
        as_csv(found), columns(found), [in_words(row) for row in found]
        sure = [row for row in found if row["status"] != DAMAGED]
        assert all(
            {**row, "status": "", "tries": 0}
            in [{**one, "status": "", "tries": 0} for one in whole]
            for row in sure
        )
        unnoticed += len(sure) == len(whole)
    assert unnoticed < 40  # free pages, and single bytes that do not matter


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("result", '{"verdict": null}'),
        ("scene", '{"a": {"x": 7}}'),
        ("wall", 99.0),
        ("status", "dome"),
    ],
)
def test_a_changed_case_is_noticed_and_waits_again(
    tmp_path: Path, column: str, value: object
) -> None:
    path = tmp_path / "sweep.sqlite"
    whole = filled(path)
    changed(path, f"UPDATE cases SET {column} = ? WHERE id = 'case3'", value)
    found = rows(path)
    assert [row["id"] for row in found if row["status"] == DAMAGED] == ["case3"]
    assert "computes it again" in in_words(found[3]) and "drag" not in found[3]
    with Store(path, make=True) as store:
        assert store.mark_damaged() == 1
        assert store.results(["case2", "case3"]).keys() == {"case2"}
        store.add(CASES, ["a.x"])
        assert store.states(["case2", "case3"]) == {"case2": DONE, "case3": WAITING}
        assert store.claim(["case3"]) and store.mark_damaged() == 0
        store.finish(
            {"case3": CaseOutcome({"verdict": None, "coefficients": {"drag": 3.0}}, wall=1.5)}
        )
        assert store.mark_damaged() == 0
    anew = rows(path)
    assert [row["id"] for row in anew] == [row["id"] for row in whole]
    assert anew[3]["drag"] == 3.0 and anew[3]["a.x"] == 3


def test_scenes_that_are_none_are_damaged_whatever_their_checksum(tmp_path: Path) -> None:
    """As somebody who wants to harm may write them; a report of such a file ended without a reason."""
    path, forged = tmp_path / "sweep.sqlite", ["5", '"words"', "[" * 5000 + "]" * 5000, None]
    filled(path)
    changed(path, "CREATE TABLE anew AS SELECT * FROM cases")  # without NOT NULL
    changed(path, "DROP TABLE cases")
    changed(path, "ALTER TABLE anew RENAME TO cases")
    with sqlite3.connect(path) as base:
        base.row_factory = sqlite3.Row
        tried = [(task, scene) for task in ("judge", "threshold") for scene in forged]
        for number, (task, scene) in enumerate(tried):
            content = scene, task, f"source {number}", f"case{number}"
            base.execute("UPDATE cases SET scene = ?, task = ?, source = ? WHERE id = ?", content)
            row = base.execute("SELECT * FROM cases WHERE id = ?", content[3:]).fetchone()
            new = stores._checksum(row), *content[3:]
            base.execute("UPDATE cases SET checksum = ? WHERE id = ?", new)
    base.close()
    assert [row["status"] for row in rows(path)] == [DAMAGED] * 8 + [DONE] * 32
    page = context_of(path)
    assert "32 computed, 0 failed, 8 damaged" in page["counted"]
    assert [*page["scenes"]] == ["made"]


def test_a_file_without_checksums_is_read_and_given_them(tmp_path: Path) -> None:
    """As the first version of the file was: the same tables without the column."""
    path, kept = tmp_path / "sweep.sqlite", tmp_path / "kept.sqlite"
    whole = filled(path)
    changed(path, "ALTER TABLE cases DROP COLUMN checksum")
    changed(path, "ALTER TABLE cases DROP COLUMN log")
    changed(path, "DROP TABLE shown")
    changed(path, "DROP INDEX cases_by_status")
    changed(path, "PRAGMA user_version = 1")
    shutil.copy(path, kept)
    assert rows(path) == whole
    with Store(path, make=True) as store:
        assert store.mark_damaged() == 0
    changed(path, "UPDATE cases SET result = '{}' WHERE id = 'case0'")
    assert rows(path)[0]["status"] == DAMAGED
    changed(kept, "UPDATE cases SET result = '{}' WHERE id = 'case0'")
    assert rows(kept)[0]["status"] == DAMAGED


def test_a_missing_column_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "sweep.sqlite"
    filled(path)
    changed(path, "ALTER TABLE cases RENAME COLUMN versions TO versionz")
    with pytest.raises(OutputError, match=r"is damaged \(no column versions\); put back a copy"):
        rows(path)


def test_network_file_systems_are_found_by_their_mount(tmp_path: Path) -> None:
    """Lines as in proc(5), with octal escapes; the longest mount point that holds a file counts."""
    mounts = tmp_path / "mounts"
    home = tmp_path / "my home"
    mounts.write_text(
        f"/dev/sda1 / ext4 rw 0 0\nserver:/home {str(home).replace(' ', chr(92) + '040')} nfs4 rw,vers=4.2 0 0\n"
        f"/dev/sdb1 {home}/scratch ext4 rw 0 0\nhost: {tmp_path}/far fuse.sshfs rw 0 0\n".replace(
            f"{home}/scratch", str(home).replace(" ", chr(92) + "040") + "/scratch"
        )
    )
    places = ("my home/a", "my home/b/c", "my home/scratch/d", "far/e", "my homes/f", "g")
    assert [network_of(tmp_path / one / "x.sqlite", mounts) for one in places] == [
        *("nfs4", "nfs4", "", "fuse.sshfs", "", "")
    ]


def test_no_shared_memory_is_used_on_a_network_file_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A file that was begun on a local disk, too; SQLite's WAL needs shared memory (sqlite.org/wal.html)."""
    path = tmp_path / "sweep.sqlite"
    filled(path)
    with sqlite3.connect(path) as base:
        assert base.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    base.close()
    monkeypatch.setattr(stores, "network_of", lambda path: "nfs4")
    with Store(path, make=True) as store:
        assert "is on a network file system (nfs4)" in caplog.text
        store.free_failed([])
        assert {one.name for one in tmp_path.iterdir()} <= {path.name, f"{path.name}-journal"}
    with sqlite3.connect(path) as base:
        assert base.execute("PRAGMA journal_mode").fetchone() == ("delete",)
    base.close()
    assert [row["drag"] for row in rows(path)] == [float(n) for n in range(len(CASES))]
