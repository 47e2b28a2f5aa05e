"""Tables of cases and series of loads: reading, wrong rows and columns, verdicts by statics."""

from __future__ import annotations

import csv
import json
import sys
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import message
from test_many_cases import random_cases

from incipient import cli
from incipient.arrays import Floats
from incipient.errors import Interrupted, SceneError
from incipient.judging import batch
from incipient.judging.batch import Verdicts, judge_table
from incipient.judging.case import Case, load_case
from incipient.judging.series import judge_series, read_series
from incipient.judging.table import read_table
from incipient.progress import Silent

CASES = Path(__file__).parents[2] / "demos" / "cases"
VECTORS = ("force", "weight", "centre", "contact_1", "normal_1", "contact_2", "normal_2")
COLUMNS = [f"{vector}_{axis}" for vector in VECTORS for axis in "xy"]
COLUMNS += ["couple", "friction", "mass", "inertia"]


def rows_of(count: int) -> list[list[str]]:
    """Random cases of two contacts in 2-D as cells of a table."""
    cases = random_cases(count, 2, 2)
    contacts = [part[:, i] for i in range(2) for part in (cases.points, cases.normals)]
    vectors = [one[:, :2] for one in (cases.force, cases.weight, cases.centre, *contacts)]
    numbers = cases.torque[:, 2], cases.law.coefficient, cases.mass, cases.inertia[:, 2, 2]
    table: Floats = np.column_stack([*vectors, *numbers])
    return [list(map(repr, row)) for row in table.tolist()]


def write(path: Path, rows: list[list[str]], columns: list[str] = COLUMNS) -> Path:
    with path.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows([columns, *rows])
    return path


def write_parquet(path: Path, columns: dict[str, Any]) -> Path:
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    parquet.write_table(pyarrow.table(columns), path)
    return path


def verdicts(path: Path, *settings: str, jobs: int = 1) -> tuple[Verdicts, list[dict[str, str]]]:
    """The outcome of a table, and the rows of verdicts.csv."""
    outcome = judge_table(path, settings, path.parent, jobs, Silent())
    with (path.parent / "verdicts.csv").open(encoding="utf-8", newline="") as stream:
        return outcome, list(csv.DictReader(stream))


# A cell in a column, and the reason in the answer; None: the case still has an answer.
WRONG = [
    ("force_x", "abc", 'force_x is "abc"; give a number'),
    ("force_y", "1_0", 'force_y is "1_0"; give a number'),
    ("force_y", "٣", 'force_y is "٣"; give a number'),
    ("weight_x", "nan", "weight_x is empty or not finite; give a number"),
    ("couple", "inf", "couple is empty or not finite; give a number"),
    ("friction", "", "friction is empty or not finite; give a number"),
    ("friction", "-0.5", "friction -0.5 is not a coefficient; give a number that is not negative"),
    ("contact_1_x", "", "points contain a number that is not finite; give finite numbers"),
    ("normal_2_y", "7", "give unit normals"),
    ("mass", "-1", "mass -1.0 is not positive; give the grain's mass"),
    ("mass", "", "mass nan is not positive; give the grain's mass"),
    ("inertia", "0", "inertia is not positive definite; give positive moments about every axis"),
    ("force_x", "1,2", "has 19 cells for 18 columns; give one for each"),
    ("force_x", "a" * 131_073, "is not a line of CSV"),
    ("force_x", '"', "has 1 cells for 18 columns"),
    ("force_x", "1e300", None),
    ("weight_y", "1e-200", None),
    ("contact_2_x", "1e160", None),
    ("centre_x", "-1e200", None),
]


def test_wrong_rows_fail_with_their_reasons_and_touch_no_others(tmp_path: Path) -> None:
    """Each third row has one of the wrong cells, or no contact."""
    rows = rows_of(3 * len(WRONG) + 3)
    outcome, right = verdicts(write(tmp_path / "right.csv", rows))
    assert outcome.failed == 0
    reasons: dict[int, str | None] = {1 + 3 * k: reason for k, (*_, reason) in enumerate(WRONG)}
    for k, (column, cell, _) in enumerate(WRONG):
        rows[1 + 3 * k][COLUMNS.index(column)] = cell
    rows[-2][6:14], reasons[len(rows) - 2] = [""] * 8, "there is none; a grain that touches nothing"
    lines = [",".join(COLUMNS), "", *map(",".join, rows)]  # an empty line is no row
    (tmp_path / "wrong.csv").write_text("\ufeff" + "\n".join(lines) + "\n", encoding="utf-8")
    outcome, answers = verdicts(tmp_path / "wrong.csv")
    assert [row["row"] for row in answers] == [str(place + 1) for place in range(len(rows))]
    for place, (answer, before) in enumerate(zip(answers, right, strict=True)):
        reason = reasons.get(place, "")
        if reason is None:
            assert answer["reason"] or float(answer["safety_factor"]) >= 0.0
        elif reason:
            assert reason in answer["reason"] and answer["safety_factor"] == answer["mode"] == ""
        else:
            assert answer == before
    failed = {int(row["row"]): row["reason"] for row in answers if row["reason"]}
    assert outcome.failed == len(failed) and outcome.cases == len(rows)
    assert outcome.reasons == dict(list(failed.items())[:5])


def test_threads_judge_chunks_as_one_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = rows_of(110)
    rows[75][0] = "x"
    rows[85][COLUMNS.index("friction")] = "-1"
    path = write(tmp_path / "cases.csv", rows)
    whole = verdicts(path)
    monkeypatch.setattr(batch, "CHUNK", 40)
    assert verdicts(path, jobs=3) == whole
    assert sorted(whole[0].reasons) == [76, 86]


class Stopped(Silent):
    """Is interrupted when a chunk has been judged."""

    def count(self, what: str, done: int, total: int) -> None:
        raise KeyboardInterrupt


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interrupted_table_has_the_verdicts_so_far(
    jobs: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "CHUNK", 40)
    path = write(tmp_path / "cases.csv", rows_of(110))
    with pytest.raises(Interrupted, match="has the verdicts on the first 40 rows"):
        judge_table(path, [], tmp_path, jobs, Stopped())
    with (tmp_path / "verdicts.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert rows[:40] == verdicts(path)[1][:40] and len(rows) == 110
    assert {row["reason"] for row in rows[40:]} == {"not judged: interrupted; call again"}


def test_parquet_as_csv(tmp_path: Path) -> None:
    """Also for names that are not UTF-8, empty cells and rows that fail."""
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = rows_of(60)
    rows[7][COLUMNS.index("contact_2_x")] = rows[8][COLUMNS.index("force_x")] = ""
    named = [[f"disc {place}", *row] for place, row in enumerate(rows)]
    outcome, expected = verdicts(write(tmp_path / "cases.csv", named, ["name", *COLUMNS]))
    columns = {
        name: [float(cell) if cell else None for cell in column]
        for name, column in zip(COLUMNS, zip(*rows, strict=True), strict=True)
    }
    import pyarrow

    names = pyarrow.array([row[0].encode() for row in named[:-1]] + [b"\xff"])
    path = write_parquet(
        tmp_path / "cases.parquet", {"name": names.view(pyarrow.utf8()), **columns}
    )
    assert judge_table(path, [], tmp_path, 1, Silent()) == outcome
    stored = parquet.read_table(tmp_path / "verdicts.parquet").to_pylist()
    assert stored[-1].pop("name") == "\ufffd" and expected[-1].pop("name") == "disc 59"
    for one, other in zip(stored, expected, strict=True):
        number = one.pop("safety_factor"), one.pop("held")
        assert number == (float(other.pop("safety_factor") or "nan"), other.pop("held") == "1") or (
            number == (None, None) and one["reason"]
        )
        assert {name: str(cell) for name, cell in one.items()} == {
            name: cell for name, cell in other.items() if name in one
        }


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
    """Seconds as timestamps were once read as milliseconds: rates 1000 times too small."""
    path = write_parquet(tmp_path / "table.parquet", {"time": values})
    said = message(lambda: read_table(path))
    assert f"column time is of type {kind}" in said and "save it as floating-point" in said


def test_numbers_of_any_width_are_taken(tmp_path: Path) -> None:
    values = {
        "int8": np.array([1, 2], dtype=np.int8),
        "float32": np.array([1, 2], dtype=np.float32),
        "uint64": np.array([1, 2**63], dtype=np.uint64),
        "decimal": [Decimal("1.5"), None],
        "none": [None, None],
    }
    columns = read_table(write_parquet(tmp_path / "table.parquet", values)).columns
    assert [columns[name].tolist() for name in ("int8", "float32")] == [[1.0, 2.0]] * 2
    assert columns["uint64"].tolist() == [1.0, 2.0**63]
    assert (
        columns["decimal"][0] == 1.5 and np.isnan([columns["decimal"][1], *columns["none"]]).all()
    )


def test_damaged_parquet_and_a_missing_library_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    path = tmp_path / "cases.parquet"
    path.write_bytes(b"no Parquet")
    for order in (
        ["--batch", str(path)],
        [str(CASES / "block_on_incline.toml"), "--series", str(path)],
    ):
        assert cli.main(["judge", *order]) == 2
        complaint = capsys.readouterr().err
        assert complaint.count("\n") == 1 and "or of a Parquet file of numbers" in complaint
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert cli.main(["judge", "--batch", str(path)]) == 6
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
        ([*COLUMNS, "a" * 5000], [], "aaa... is not known"),
        ([*COLUMNS, "a" * 200_000], [], "cannot be read (field larger than field limit"),
        ([*COLUMNS, "mass"], [], "two columns mass"),
        (COLUMNS, ["mass=2"], "two columns mass"),
        (COLUMNS, ["about_x=nan"], "--set about_x=nan: is not a finite number"),
        (COLUMNS, ["about_x=left"], "--set about_x=left: is not a finite number"),
        ([*COLUMNS, "contact_4_x"], [], "no column contact_3_x"),
        ([*COLUMNS, "force_z"], [], "no column couple_x"),
        ([], [], "no column force_x"),
    ],
)
def test_wrong_columns_are_refused(
    columns: list[str], settings: list[str], said: str, tmp_path: Path
) -> None:
    path = write(tmp_path / "cases.csv", [["1"] * len(columns)], columns)
    complaint = message(lambda: verdicts(path, *settings))
    assert said in complaint and len(complaint) < 400
    known = complaint.partition("known are ")[2].split(", ")
    assert len(known) == len(set(known))


def test_couples_about_a_point_and_friction_for_all(tmp_path: Path) -> None:
    """A push at the height of the ground does not tip, one above the centre does; W b/(F h) = 2/5."""
    columns = [name for name in COLUMNS if name not in ("friction", "mass", "inertia")]
    block = ["-2", "0", "0", "-1", "2", "0", "0", "-1"]
    rows = [["5", "0", "0", "-1", "0", "0.5", *block, "0", "0", height] for height in ("0", "1")]
    path = write(tmp_path / "cases.csv", rows, [*columns, "about_x", "about_y"])
    factors = [float(row["safety_factor"]) for row in verdicts(path, "friction=9")[1]]
    assert factors == pytest.approx([9.0 / 5.0, 0.4])


def test_inertia_in_3d(tmp_path: Path) -> None:
    """The sphere on three of the demo in a table: its products of inertia are zero if they are left out."""
    case = load_case(CASES / "sphere_on_three_spheres.toml")
    load, contacts, inert = case.to_load(), case.to_contacts(), case.mass_and_inertia()
    assert inert is not None
    vectors = {"force": 3 * load.flow_force, "couple": 3 * load.flow_couple, "weight": load.weight}
    vectors |= {"centre": load.centre, "inertia": np.diag(inert[1])}
    for number in range(3):
        vectors[f"contact_{number + 1}"] = contacts.points[number]
        vectors[f"normal_{number + 1}"] = contacts.normals[number]
    row = {
        f"{name}_{axis}": one
        for name, v in vectors.items()
        for axis, one in zip("xyz", v, strict=True)
    }
    row |= {"friction": case.contacts.friction, "mass": inert[0], "inertia_xy": float("nan")}
    path = write(tmp_path / "cases.csv", [list(map(repr, map(float, row.values())))], list(row))
    ((answer,),) = verdicts(path)[1:]
    # Thrice the load: a third of the factor, see the head of the demo.
    factor = 0.5 / (2 * np.sqrt(3)) / (0.2 * 0.5 * np.sqrt(2 / 3) + 0.037010) / 3.0
    assert float(answer["safety_factor"]) == pytest.approx(factor, rel=1e-5)
    assert answer["mode"] == "pivoting"


def test_the_command_judges_the_shipped_table(tmp_path: Path, capsys: Any) -> None:
    out = tmp_path / "new" / "directory"
    order = ["judge", "--batch", str(CASES / "batch.csv"), "--out", str(out)]
    assert cli.main(order) == 0
    assert 'row 6: force_x is "x"; give a number' in capsys.readouterr().out
    with (out / "verdicts.csv").open() as stream:
        *rows, wrong = csv.DictReader(stream)
    # Statics: moments about a contact; the same in twice the flow; friction; a lever; a disc that nothing holds.
    pocket = 0.25 / (0.3 * 0.5 * np.cos(np.radians(30)) + 0.04)
    expected = [pocket, 0.5 * pocket, 0.5 / 0.6, 0.2 / 0.5 / 0.6, 0.0]
    assert [float(row["safety_factor"]) for row in rows] == pytest.approx(expected, rel=1e-5)
    assert [row["mode"] for row in rows] == ["rest", "pivoting", "sliding", "pivoting", "rolling"]
    assert wrong["mode"] == "" and rows[0]["name"] == "disc in a pocket of two"
    summary = json.loads((out / "batch.json").read_text())
    assert (summary["cases"], summary["failed"]) == (6, 1)
    others = tmp_path / "others"
    others.mkdir()
    (others / "verdicts.csv").write_text("mine")
    assert cli.main([*order[:-1], str(others)]) == 5
    assert "verdicts.csv: was not written by incipient" in capsys.readouterr().err


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


BLOCK = """
[load]
weight = [0.0, -1.0]
flow_force = [0.25, 0.0]
flow_couple = 0.0
centre = [0.0, 0.5]
[contacts]
points = [[-2.0, 0.0], [2.0, 0.0]]
normals = [[0.0, -1.0], [0.0, -1.0]]
friction = 0.5
[grain]
mass = 1.0
inertia = 1.0
"""


@pytest.fixture
def block(tmp_path: Path) -> Case:
    """A block of weight 1 on a flat bed with friction 0.5: it slides for a push above 0.5."""
    (tmp_path / "block.toml").write_text(BLOCK)
    return load_case(tmp_path / "block.toml")


def pushed(**columns: Any) -> dict[str, Any]:
    """A push of 0.75 for one unit of time, and of 0.25 otherwise."""
    time = np.linspace(0.0, 4.0, 4001)
    push = np.where((time >= 1.0) & (time < 2.0), 0.75, 0.25)
    return {"time": time, "force_x": push, "force_y": 0.0 * time, "couple": 0.0 * time, **columns}


def test_a_block_slides_while_it_is_pushed_too_hard(block: Case) -> None:
    """Coulomb's law: for one unit of time 0.25 of 0.75 is more than can be held."""
    series = judge_series(block, pushed())
    assert series.batch.factors[[0, 1500]] == pytest.approx([2.0, 2.0 / 3.0])
    assert series.shares == pytest.approx({"rest": 0.75, "sliding": 0.25})
    (event,) = series.events
    assert (event.start, event.mode) == (1.0, "sliding")
    assert (event.length, event.impulse, event.least) == pytest.approx((1.0, 0.25, 2.0 / 3.0))


def test_weight_and_friction_may_vary(block: Case) -> None:
    """Half the friction, or half the weight, halves the force that is held."""
    halved = np.where(pushed()["time"] < 2.0, 0.5, 0.25)
    for columns in ({"friction": halved}, {"weight_x": 0.0 * halved, "weight_y": -2.0 * halved}):
        factors = judge_series(block, pushed(**columns)).batch.factors
        assert factors[[0, -1]] == pytest.approx([2.0, 1.0])


def test_couples_of_a_series_are_about_the_point_of_the_case(tmp_path: Path) -> None:
    """A push at the height of the ground does not tip the block: about that point its couple is zero."""
    (tmp_path / "block.toml").write_text(BLOCK)
    for about, shares in ((0.0, {"rest": 1.0}), (1.0, {"pivoting": 1.0})):
        changes = [f"load.about=[0.0, {about}]", "contacts.friction=9.0"]
        case = load_case(tmp_path / "block.toml", changes)
        assert judge_series(case, pushed(force_x=np.full(4001, 5.0))).shares == shares


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"force_z": np.zeros(4001)}, "column force_z is not known"),
        ({"force_x": np.full(4001, np.nan)}, "force_x is not finite in sample 1"),
        ({"time": np.zeros(4001)}, "time does not increase"),
        ({"weight_y": np.zeros(4001)}, "no column weight_x"),
        ({"friction": np.full(4001, -1.0)}, "friction is negative"),
    ],
)
def test_wrong_series_are_refused(columns: dict[str, Any], said: str, block: Case) -> None:
    assert said in message(lambda: judge_series(block, pushed(**columns)))


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_the_command_judges_a_series(kind: str, block: Case, tmp_path: Path, capsys: Any) -> None:
    """Without the flow's load in the case, which is never read."""
    columns, path = pushed(), tmp_path / f"forces.{kind}"
    if kind == "csv":
        write(path, np.array(list(columns.values())).T.tolist(), list(columns))
    else:
        write_parquet(path, columns)
    case = tmp_path / "block.toml"
    lines = BLOCK.splitlines(keepends=True)
    case.write_text("".join(line for line in lines if not line.startswith("flow_")))
    order = ["judge", str(case), "--series", str(path), "--out", str(tmp_path / "out")]
    assert cli.main([*order, "--law", "U2"]) == 0
    said = capsys.readouterr().out
    assert "25.000% of the time" in said and "series.png" in said
    assert "probability at an instant 0.25" in said
    # A push of 0.5 is held: for a quarter of the time it is 0.75, else 0.25, and grows as the square of the velocity.
    assert f"probability 0.05  {np.sqrt(0.5 / 0.75):.4g} " in said
    assert f"probability 0.5   {np.sqrt(0.5 / 0.25):.4g} " in said
    stored = json.loads((tmp_path / "out" / "series.json").read_text())
    assert stored["events"][0]["impulse"] == pytest.approx(0.25)
    samples = (tmp_path / "out" / "series.csv").read_text().splitlines()
    assert len(samples) == 4002 and samples[1501].endswith("sliding")
    case.write_text(case.read_text().replace("friction =", "# friction ="))
    assert cli.main(order) == 2
    said = capsys.readouterr().err
    assert f"{case}: contacts.friction: is missing" in said and "flow_force" not in said


def test_wrong_rows_of_a_series_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "forces.csv"
    path.write_text("time,force_x\n1,2\n2,x\n")
    with pytest.raises(SceneError, match=r'forces\.csv: row 2: force_x is "x"; give'):
        read_series(path)
