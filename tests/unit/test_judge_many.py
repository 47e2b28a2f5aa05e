"""Tables of cases: what is read, wrong rows, and batches that are stopped."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import message
from test_many_cases import random_cases

from incipient import cli
from incipient.arrays import Floats
from incipient.contact import Cases
from incipient.errors import OutputError
from incipient.progress import Silent
from incipient.simulation import batch_table
from incipient.simulation.batch_table import open_table
from incipient.simulation.judge_batch import judge_table
from incipient.simulation.judge_series import read_columns

CASES = Path(__file__).parents[2] / "demos" / "cases"


COLUMNS = [
    "force_x",
    "force_y",
    "couple",
    "weight_x",
    "weight_y",
    "centre_x",
    "centre_y",
    "friction",
    "mass",
]
COLUMNS += [
    "inertia",
    *(f"{kind}_{i}_{axis}" for i in (1, 2) for kind in ("contact", "normal") for axis in "xy"),
]


def rows_of(cases: Cases) -> list[list[str]]:
    """Cases of two contacts in the plane as cells of a table."""
    geometry = [part[:, i, :2] for i in range(2) for part in (cases.points, cases.normals)]
    table: Floats = np.column_stack(
        [
            cases.force[:, :2],
            cases.couple[:, 2],
            cases.weight[:, :2],
            cases.centre[:, :2],
            cases.friction,
            cases.mass,
            cases.inertia[:, 2, 2],
            *geometry,
        ]
    )
    return [list(map(repr, row)) for row in table.tolist()]


def write(path: Path, rows: list[list[str]], columns: list[str] = COLUMNS) -> Path:
    with path.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([columns, *rows])
    return path


def written(directory: Path) -> list[dict[str, str]]:
    with (directory / "verdicts.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


# What is put in which column, and what is said of it; None: the case still has an answer.
WRONG = [
    ("force_x", "abc", 'force_x is "abc"; give a number'),
    ("force_y", "1_0", 'force_y is "1_0"; give a number'),
    ("weight_x", "nan", "weight_x is empty or not finite; give a number"),
    ("couple", "inf", "couple is empty or not finite; give a number"),
    ("friction", "", "friction is empty or not finite; give a number"),
    ("friction", "-0.5", "friction -0.5 is not a coefficient; give a number that is not negative"),
    (
        "contact_1_x",
        "",
        "contacts: points contain a number that is not finite; give finite numbers",
    ),
    ("normal_2_y", "7", "give unit normals"),
    ("mass", "-1", "mass -1.0 is not positive; give the grain's mass"),
    ("mass", "", "mass nan is not positive; give the grain's mass"),
    (
        "inertia",
        "0",
        "inertia is not positive definite; give positive moments about every axis, also in 2D",
    ),
    ("force_x", "1e300", None),
    ("weight_y", "1e-200", None),
    ("contact_2_x", "1e160", None),
    ("centre_x", "-1e200", None),
]


def test_wrong_rows_fail_with_their_reasons_and_touch_no_others(tmp_path: Path) -> None:
    """10,000 rows, of which 1,500 hold nonsense, and some have cells too many or no contact."""
    rows = rows_of(random_cases(10_000, 2, 2))
    right = judge_table(
        open_table(write(tmp_path / "right.csv", rows), []), tmp_path / "right", 1, Silent()
    )
    assert right.failed == 0
    expected, rng = written(tmp_path / "right"), np.random.default_rng(3)
    said: dict[int, str | None] = {}
    for place in rng.choice(
        [one for one in range(10_000) if one % 1000 > 1], 1500, replace=False
    ).tolist():
        column, value, reason = WRONG[int(rng.integers(len(WRONG)))]
        rows[place][COLUMNS.index(column)] = value
        said[place] = reason
    for place in range(0, 10_000, 1000):
        rows[place], said[place] = (
            [*rows[place], "0"],
            "has 19 cells for 18 columns; give one for each",
        )
        none = [*rows[place + 1][:10], *[""] * 8]
        rows[place + 1], said[place + 1] = (
            none,
            "there is none; a grain that touches nothing cannot be judged",
        )
    found = judge_table(
        open_table(write(tmp_path / "wrong.csv", rows), []), tmp_path / "wrong", 1, Silent()
    )
    answers = written(tmp_path / "wrong")
    assert [row["row"] for row in answers] == [str(place + 1) for place in range(10_000)]
    for place, (answer, before) in enumerate(zip(answers, expected, strict=True)):
        reason = said.get(place, "")
        if reason == "":
            assert answer | {"safety_factor": ""} == before | {"safety_factor": ""}
            assert float(answer["safety_factor"]) == pytest.approx(
                float(before["safety_factor"]), rel=1e-12
            )
        elif reason is not None:
            assert reason in answer["reason"] and answer["safety_factor"] == answer["mode"] == ""
        else:
            assert answer["reason"] or float(answer["safety_factor"]) >= 0.0
    assert found.failed == sum(answer["reason"] != "" for answer in answers)


class Killed(Silent):
    """Ends a call after some chunks."""

    def __init__(self, after: int):
        self.left = after

    def count(self, what: str, done: int, total: int) -> None:
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_is_judged_is_kept(jobs: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped after two chunks of eight, a second call judges the others, and says what one call does."""
    monkeypatch.setattr(batch_table, "CHUNK", 40)
    path = write(tmp_path / "cases.csv", rows_of(random_cases(310, 2, 2)))
    whole = judge_table(open_table(path, []), tmp_path / "whole", 1, Silent())
    with pytest.raises(KeyboardInterrupt):
        judge_table(open_table(path, []), tmp_path / "out", jobs, Killed(2))
    chunks = sorted((tmp_path / "out" / "verdicts.chunks").glob("*.csv"))
    assert len(chunks) == 2 or (
        jobs == 2 and len(chunks) > 2
    )  # workers finish what they have begun
    before = {one: one.stat().st_mtime_ns for one in chunks}
    other = write(tmp_path / "other.csv", rows_of(random_cases(310, 2, 2, flat=True)))
    with pytest.raises(OutputError, match="holds chunks of another table"):
        judge_table(open_table(other, []), tmp_path / "out", 1, Silent())
    assert {one: one.stat().st_mtime_ns for one in chunks} == before
    found = judge_table(open_table(path, []), tmp_path / "out", 1, Silent())
    assert found.kept == len(chunks) and found.modes == whole.modes
    assert written(tmp_path / "out") == written(tmp_path / "whole")
    assert not (tmp_path / "out" / "verdicts.chunks").exists()


@pytest.mark.parametrize("damage", ["a line less", "cut within a line", "other rows", "no text"])
def test_a_damaged_chunk_is_judged_again(
    damage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A chunk that had lost a line was taken as it was: fewer cases, exit code 0."""
    monkeypatch.setattr(batch_table, "CHUNK", 40)
    path = write(tmp_path / "cases.csv", rows_of(random_cases(310, 2, 2)))
    whole = judge_table(open_table(path, []), tmp_path / "whole", 1, Silent())
    with pytest.raises(KeyboardInterrupt):
        judge_table(open_table(path, []), tmp_path / "out", 1, Killed(2))
    chunk = tmp_path / "out" / "verdicts.chunks" / "000001.csv"
    lines = chunk.read_text().splitlines(keepends=True)
    damaged = {
        "a line less": "".join(lines[:-1]),
        "cut within a line": "".join(lines)[:-9],
        "other rows": "".join([*lines[1:], lines[0]]),
        "no text": "\0\n" * 40,
    }
    chunk.write_text(damaged[damage])
    found = judge_table(open_table(path, []), tmp_path / "out", 1, Silent())
    assert (found.cases, found.kept, found.modes) == (310, 1, whole.modes)
    assert written(tmp_path / "out") == written(tmp_path / "whole")


def test_a_table_that_changes_while_it_is_read_is_refused(tmp_path: Path) -> None:
    rows = rows_of(random_cases(30, 2, 2))
    table = open_table(write(tmp_path / "cases.csv", rows), [])
    write(tmp_path / "cases.csv", rows[:-1])
    said = message(lambda: judge_table(table, tmp_path / "out", 1, Silent()))
    assert "has 29 rows in chunk 1 instead of 30" in said


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_one_wrong_row_does_not_end_a_batch(kind: str, tmp_path: Path) -> None:
    """A row of three cells, a name longer than CSV readers take, numbers that overflow; the rows around are judged."""
    rows = [["disc", *row] for row in rows_of(random_cases(6, 2, 2))]
    columns = ["name", *COLUMNS]
    judge_table(open_table(write(tmp_path / "r.csv", rows, columns), []), tmp_path, 1, Silent())
    right = [row["safety_factor"] for row in written(tmp_path)]
    rows[1][0] = "a" * 131_073
    for name, value in (("mass", "1e-300"), ("inertia", "1e300"), ("force_x", "9")):
        rows[3][columns.index(name)] = value
    path = write(tmp_path / "wrong.csv", rows, columns)
    if kind == "csv":
        path.write_text(path.read_text().replace(",".join(rows[4]), "1,2,3"))
    else:
        pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
        values = {
            name: list(column)
            for name, column in zip(columns, zip(*rows, strict=True), strict=True)
        }
        numbers = {name: [float(cell) for cell in values[name]] for name in COLUMNS}
        names = pyarrow.array([name.encode() for name in values["name"][:-1]] + [b"\xff"])
        table = pyarrow.table({"name": names.view(pyarrow.utf8()), **numbers})
        parquet.write_table(table, path := tmp_path / "wrong.parquet")
    found = judge_table(open_table(path, []), tmp_path / "out", 1, Silent())
    if kind == "parquet":
        stored = parquet.read_table(tmp_path / "out" / "verdicts.parquet").to_pylist()
        assert stored[5]["name"] == "\ufffd" and stored[1]["name"] == "a" * 10_000
        factors = [repr(row["safety_factor"]) for row in stored]
    else:
        factors = [row["safety_factor"] for row in written(tmp_path / "out")]
    for place in (0, 2, 5):
        assert factors[place] == right[place]
    assert found.cases == 6 and "shorten" in found.reasons[2]
    assert (5 in found.reasons) == (kind == "csv")


def test_a_damaged_group_of_rows_fails_its_rows(tmp_path: Path) -> None:
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    rows = np.array(rows_of(random_cases(30, 2, 2)), dtype=float)
    path = tmp_path / "cases.parquet"
    table = pyarrow.table(dict(zip(COLUMNS, rows.T, strict=True)))
    parquet.write_table(table, path, row_group_size=10, compression="none")
    place = parquet.ParquetFile(path).metadata.row_group(1).column(0).dictionary_page_offset
    data = bytearray(path.read_bytes())
    data[place : place + 12] = b"\xff" * 12
    path.write_bytes(data)
    found = judge_table(open_table(path, []), tmp_path, 1, Silent())
    assert (found.cases, found.failed) == (30, 10)
    assert "group 2 of rows cannot be read" in found.reasons[11] and 10 not in found.reasons


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([True, False], "bool"),
        ([b"1_2", b"3"], "binary"),
        (["1_2", "٣"], "string"),
        ([{"a": 1}, {"a": 2}], "struct<a: int64>"),
        (np.array([0, 10], dtype="datetime64[s]"), "timestamp"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_columns_that_are_no_numbers_are_refused(values: Any, kind: str, tmp_path: Path) -> None:
    """Seconds as timestamps came out as milliseconds: rates 1000 times too small, and nothing said so."""
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    rows = np.array(rows_of(random_cases(2, 2, 2)), dtype=float)
    batch = {**dict(zip(COLUMNS, rows.T, strict=True)), "force_x": values}
    series = {"time": values, "force_x": [1.0, 2.0], "force_y": [0.0, 0.0], "couple": [0.0, 0.0]}
    for table, column, read in (
        (batch, "force_x", lambda path: open_table(path, [])),
        (series, "time", read_columns),
    ):
        parquet.write_table(pyarrow.table(table), tmp_path / "table.parquet")
        said = message(lambda read=read: read(tmp_path / "table.parquet"))  # type: ignore[misc]
        assert f"column {column} is of type {kind}" in said and "save it as floating-point" in said


def test_numbers_of_any_width_are_taken(tmp_path: Path) -> None:
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    kinds = (pyarrow.int8(), pyarrow.float32(), pyarrow.decimal128(5, 1), pyarrow.uint64())
    names = ("time", "force_x", "force_y", "couple")
    columns = {
        name: pyarrow.array([1, 2], pyarrow.int64()).cast(pyarrow.decimal128(20, 1)).cast(kind)
        for name, kind in zip(names, kinds, strict=True)
    }
    parquet.write_table(pyarrow.table(columns), tmp_path / "series.parquet")
    found = read_columns(tmp_path / "series.parquet")
    assert all(found[name].tolist() == [1.0, 2.0] for name in names)


def test_parquet_as_csv(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    rows = rows_of(random_cases(60, 2, 2))
    rows[7][COLUMNS.index("contact_2_x")] = rows[8][COLUMNS.index("force_x")] = ""
    judge_table(open_table(write(tmp_path / "cases.csv", rows), []), tmp_path, 1, Silent())
    columns = [
        [float(cell) if cell else None for cell in column] for column in zip(*rows, strict=True)
    ]
    parquet.write_table(pyarrow.table(columns, names=COLUMNS), tmp_path / "cases.parquet")
    judge_table(open_table(tmp_path / "cases.parquet", []), tmp_path, 1, Silent())
    stored = parquet.read_table(tmp_path / "verdicts.parquet").to_pylist()
    for one, other in zip(stored, written(tmp_path), strict=True):
        assert (one["mode"], one["reason"]) == (other["mode"], other["reason"])
        assert one["safety_factor"] == (
            float(other["safety_factor"]) if other["safety_factor"] else None
        )


def test_parquet_without_pyarrow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert cli.main(["judge", "--batch", str(tmp_path / "cases.parquet")]) == 6
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1 and "pip install 'incipient[parquet]'" in complaint


@pytest.mark.parametrize(
    ("columns", "settings", "said"),
    [
        (
            [name for name in COLUMNS if name != "friction"],
            [],
            "no column friction; give it, or --set friction=VALUE",
        ),
        ([*COLUMNS, "fricton"], [], "column fricton is not known"),
        ([*COLUMNS, "mass"], [], "two columns mass"),
        (COLUMNS, ["mass=2"], "two columns mass"),
        (COLUMNS, ["about_x=nan"], "--set about_x=nan: is no finite number"),
        (COLUMNS, ["about_x=left"], "--set about_x=left: is no finite number"),
        ([*COLUMNS, "contact_4_x"], [], "no column contact_3_x"),
        ([*COLUMNS, "force_z"], [], "no column weight_z"),
    ],
)
def test_wrong_columns_are_refused(
    columns: list[str], settings: list[str], said: str, tmp_path: Path
) -> None:
    path = write(tmp_path / "cases.csv", [["1"] * len(columns)], columns)
    assert said in message(lambda: open_table(path, settings))


def test_couples_about_a_point_and_friction_for_all(tmp_path: Path) -> None:
    """A push at the height of the ground does not tip, one above the centre does; friction is given for all rows."""
    columns = [name for name in COLUMNS if name not in ("friction", "mass", "inertia")] + [
        "about_x",
        "about_y",
    ]
    block = ["-2", "0", "0", "-1", "2", "0", "0", "-1"]
    rows = [["5", "0", "0", "0", "-1", "0", "0.5", *block, "0", height] for height in ("0", "1")]
    table = open_table(write(tmp_path / "cases.csv", rows, columns), ["friction=9"])
    judge_table(table, tmp_path, 1, Silent())
    # W b / (F h) = 2 / 5
    low, high = (float(row["safety_factor"]) for row in written(tmp_path))
    assert low == pytest.approx(9.0 / 5.0) and high == pytest.approx(0.4)


def test_the_command_judges_the_shipped_table(tmp_path: Path, capsys: Any) -> None:
    order = ["judge", "--batch", str(CASES / "batch.csv"), "--out", str(tmp_path / "out")]
    assert cli.main(order) == 0
    assert 'row 6: force_x is "x"; give a number' in capsys.readouterr().out
    *rows, wrong = written(tmp_path / "out")
    # Statics: moments about a contact; the same in twice the flow; friction; a lever; a disc that nothing holds.
    expected = [
        0.25 / (0.3 * 0.5 * np.cos(np.radians(30)) + 0.04),
        None,
        0.5 / 0.6,
        0.2 / 0.5 / 0.6,
        0.0,
    ]
    expected[1] = 0.5 * expected[0]
    assert [float(row["safety_factor"]) for row in rows] == pytest.approx(expected, rel=1e-5)
    assert [row["mode"] for row in rows] == ["rest", "pivoting", "sliding", "pivoting", "rolling"]
    assert wrong["mode"] == "" and rows[0]["name"] == "disc in a pocket of two"
    summary = json.loads((tmp_path / "out" / "batch.json").read_text())
    assert (summary["cases"], summary["failed"]) == (6, 1)
    (tmp_path / "out" / "verdicts.csv").write_text("mine")
    assert (
        cli.main(order) == 5
        and "verdicts.csv: was not written by incipient, or has been changed"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "there is no case; give a case file, --batch FILE, or --forces with --grain"),
        (["case.toml", "--batch", "cases.csv"], "leave out case.toml"),
        (["--batch", "absent.csv"], "absent.csv: cannot be read (No such file or directory)"),
        (["--batch", "absent.csv", "--jobs", "0"], "--jobs: is 0; give 1 or more"),
    ],
)
def test_wrong_calls(options: list[str], said: str, capsys: Any) -> None:
    assert cli.main(["judge", *options]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("killed", ["parent", "worker"])
def test_killed_outright_it_leaves_no_process_and_goes_on(killed: str, tmp_path: Path) -> None:
    """SIGKILL to the parent or to one of two workers; a second call ends with what one call gives."""
    rows = rows_of(random_cases(10_000, 2, 2))
    path = write(tmp_path / "cases.csv", [row for _ in range(8) for row in rows])
    order = [
        sys.executable,
        "-m",
        "incipient",
        "judge",
        "--batch",
        str(path),
        "--jobs",
        "2",
        "--out",
    ]
    whole = subprocess.run([*order, str(tmp_path / "whole")], check=True, capture_output=True)
    assert b"cases               80000" in whole.stdout
    parent = subprocess.Popen(
        [*order, str(tmp_path / "out")], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    chunks = tmp_path / "out" / "verdicts.chunks"
    while len(list(chunks.glob("*.csv"))) < 2:
        assert parent.poll() is None
        time.sleep(0.02)
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children").read_text().split()
    workers = [
        one for one in children if b"spawn_main" in Path(f"/proc/{one}/cmdline").read_bytes()
    ]
    assert len(workers) == 2
    os.kill(parent.pid if killed == "parent" else int(workers[0]), signal.SIGKILL)
    _, complaint = parent.communicate(timeout=60)
    if killed == "worker":
        assert (
            parent.returncode == 4
            and b"a process was ended" in complaint
            and complaint.count(b"\n") == 1
        )
    time.sleep(1.0)
    for child in map(Path("/proc").joinpath, children):
        assert not child.exists() or "\nState:\tZ" in (child / "status").read_text()
    left = len(list(chunks.glob("*.csv")))
    assert 2 <= left < 8
    subprocess.run([*order, str(tmp_path / "out")], check=True, capture_output=True)
    assert json.loads((tmp_path / "out" / "batch.json").read_text())["kept"] == left
    assert (tmp_path / "out" / "verdicts.csv").read_bytes() == (
        tmp_path / "whole" / "verdicts.csv"
    ).read_bytes()
