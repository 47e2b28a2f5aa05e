"""Judging forces of other programs: cases, tables, files of forces."""

from __future__ import annotations

import csv
import json
import re
import sys
import warnings
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scenes import CASES, message
from scenes import rows_of as table_of
from scipy.signal import lfilter
from test_safety_factor import random_cases

from incipient.arrays import Floats
from incipient.cli import main
from incipient.errors import Interrupted, SceneError
from incipient.judging import batch
from incipient.judging.batch import judge_table
from incipient.judging.case import Case, load_case
from incipient.judging.forces import ForcesInTime, JudgedForces, judge_forces, read_forces
from incipient.judging.in_place import grain_in_place
from incipient.judging.series import judge_series, mean_in_time, read_series
from incipient.judging.table import read_table
from incipient.progress import Silent
from incipient.scene import loads

# Cases given by hand: what a file means, and one line for everything that can be wrong with it.


PLANE = """
[load]
weight = [0.0, -1.0]
flow_force = [0.3, 0.1]
flow_couple = -0.2
centre = [1.0, 0.5]

[contacts]
points = [[1.0, 0.0]]
normals = [[0.0, -1.0]]
friction = 0.5

[grain]
mass = 2.0
inertia = 0.25
"""

SPACE = """
[load]
weight = [0, 0, -1]
flow_force = [0.3, 0, 0.1]
flow_couple = [0, 0.2, 0]
centre = [0, 0, 0.5]

[contacts]
points = [[0, 0, 0]]
normals = [[0, 0, -1]]
areas = [0.1]
friction = 0
"""

BODY = """
[load]
weight = [0.0, -1.0]
flow_force = [0.3, 0.0]
flow_couple = 0.0

[contacts]
points = [[0.0, -0.5]]
normals = [[0.0, -1.0]]
friction = 0.5

[body]
shape = "disc"
diameter = 1.0
centre = [0.0, 0.0]
density = 2.0
"""


@pytest.fixture
def case(tmp_path):
    """Reads a case from text."""

    def read(text, *overrides):
        path = tmp_path / "grain.toml"
        path.write_text(text)
        return load_case(path, overrides)

    return read


@pytest.mark.parametrize(
    ("given", "matrix"),
    [
        ("[1.0, 2.0, 2.5]", np.diag([1.0, 2.0, 2.5])),
        ("[[2, 1, 0], [1, 2, 0], [0, 0, 3]]", None),
    ],
)
def test_inertia_in_space(case, given, matrix):
    assert case(PLANE).mass_and_inertia()[1] == pytest.approx(0.25 * np.eye(3))
    result = case(f"{SPACE}\n[grain]\nmass = 1\ninertia = {given}")
    assert result.to_load().flow_couple == pytest.approx([0.0, 0.2, 0.0])
    assert result.contacts.table.areas == pytest.approx([0.1])
    _, inertia = result.mass_and_inertia()
    expected = np.array([[2.0, 1, 0], [1, 2, 0], [0, 0, 3]]) if matrix is None else matrix
    assert inertia == pytest.approx(expected)


def test_rounded_normals_are_made_unit(case):
    result = case(PLANE.replace("[[0.0, -1.0]]", "[[0.5, -0.866]]"))
    assert np.linalg.norm(result.contacts.table.normals[0]) == pytest.approx(1.0, abs=1e-15)


SPHERE = """[body]
shape = "sphere"
diameter = 1.0
centre = [1.0, 0.5, 0.0]
"""
SPREAD = "\n[errors]\nflow_force = [0.1, 0.1]\n"

WRONG = [
    (
        PLANE,
        "weight = [0.0, -1.0]\n",
        "",
        "load.weight: is missing; add it: force at the centre of mass",
    ),
    (
        PLANE,
        "[0.0, -1.0]\nflow_force",
        "[0.0, nan]\nflow_force",
        "load.weight: is not finite; give finite",
    ),
    (PLANE, "[0.3, 0.1]", "[0.3]", "load.flow_force: is not a vector; give [x, y]"),
    (PLANE, "[0.3, 0.1]", '"strong"', "load.flow_force: is not a vector"),
    (PLANE, "[0.3, 0.1]", "[[1, 2], [3]]", "load.flow_force: is not a vector"),
    (
        PLANE,
        "[0.3, 0.1]",
        "[0.3, 0.1, 0.0]",
        "load.flow_force: is for 3-D, load.weight has 2 components",
    ),
    (PLANE, "-0.2", "[0.0, 0.0, -0.2]", "load.flow_couple: is for 3-D, load.weight has 2"),
    (PLANE, "-0.2", "[0.0, -0.2]", "load.flow_couple: is not a torque"),
    (PLANE, "centre = [1.0, 0.5]\n", "", "load.centre: is missing"),
    (
        PLANE,
        "[[0.0, -1.0]]",
        "[[0.0, 0.0]]",
        "contacts.normals[0]: has length 0; give a unit vector",
    ),
    (PLANE, "[[0.0, -1.0]]", "[[0.0, -2.0]]", "contacts.normals[0]: has length 2; give a unit"),
    (PLANE, "[[0.0, -1.0]]", "[[0.0, 1.0]]", "contacts.normals[0]: points into the grain; give it"),
    (
        PLANE,
        "[[0.0, -1.0]]",
        "[[0.0, -1.0], [0, -1]]",
        "contacts.normals: 2 given for 1 point; give one",
    ),
    (PLANE, "[[1.0, 0.0]]", "[]", "contacts.points: has 0 items; give 1 or more"),
    (PLANE, "[[1.0, 0.0]]", "[[1.0, 0.5]]", "contacts.points[0]: lies at the centre of mass"),
    (PLANE, "[[1.0, 0.0]]", "[[1.0, nan]]", "contacts.points[0]: is not finite"),
    (
        PLANE,
        "friction = 0.5",
        "friction = -0.5",
        "contacts.friction: is -0.5; give a number of at least 0",
    ),
    (
        PLANE,
        "friction = 0.5",
        "fricton = 0.5",
        'contacts.fricton: unknown key; did you mean "friction"?',
    ),
    (PLANE, "friction = 0.5", "friction = 0.5\nareas = [-1.0]", "contacts.areas[0]: is -1.0; give"),
    (PLANE, "mass = 2.0", "mass = 0.0", "grain.mass: is 0.0; give a number greater than 0"),
    (
        PLANE,
        "inertia = 0.25",
        "inertia = -1.0",
        "grain.inertia: is not a symmetric positive matrix",
    ),
    (PLANE, "inertia = 0.25", "inertia = [1.0, 2.0, 4.0]", "grain.inertia: has principal moments"),
    (
        PLANE,
        "inertia = 0.25",
        "inertia = [1.0, 1.0, 1.0]",
        "grain.inertia: is for 3-D, load.weight has 2",
    ),
    (
        SPACE,
        "[0, 0.2, 0]",
        "0.2",
        "load.flow_couple: is for 2-D, load.weight has 3 components; give all",
    ),
    (
        BODY,
        "[[0.0, -0.5]]",
        "[[0.0, -0.6]]",
        "contacts.points[0]: lies 0.1 off the grain; give points",
    ),
    (BODY, "[[0.0, -0.5]]", "[[0.0, -0.4]]", "contacts.points[0]: lies 0.1 inside the grain"),
    (BODY, "centre = [0.0, 0.0]", "x = 0.0", "body.x: a case has no bed"),
    (PLANE, "[grain]\nmass = 2.0\ninertia = 0.25", SPHERE, "body.shape: is for 3-D, load.weight"),
    (
        BODY,
        "[body]",
        "[grain]\nmass = 1\ninertia = 1\n[body]",
        "body: both [body] and [grain] are given",
    ),
    (PLANE + SPREAD, "[0.1, 0.1]", "[0.1, -0.1]", "errors.flow_force: is -0.1; a standard error"),
    (
        PLANE + SPREAD,
        "[0.1, 0.1]",
        "[1e300, 1]",
        "errors.flow_force: holds 1e+300; give numbers of at most",
    ),
    (PLANE + SPREAD, "[0.1, 0.1]", "[0.1, 0.1, 0.1]", "errors.flow_force: is for 3-D"),
    (
        PLANE + SPREAD,
        "[0.1, 0.1]",
        "[0.1, 0.1]\nsamples = 1",
        "errors.samples: is 1; give a number of",
    ),
]


@pytest.mark.parametrize(("text", "old", "new", "said"), WRONG, ids=[w[3][:40] for w in WRONG])
def test_one_line_names_file_key_and_remedy(case, text, old, new, said):
    assert old in text
    line = message(lambda: case(text.replace(old, new)))
    assert re.match(r".*grain\.toml: ", line)
    assert said in line
    assert "; " in line


def test_a_normal_may_point_inward_on_a_grain_that_is_not_convex(case):
    hook = PLANE.replace("[[1.0, 0.0]]", "[[1.0, 0.0], [1.0, 1.0]]").replace(
        "[[0.0, -1.0]]", "[[0.0, -1.0], [0.0, -1.0]]"
    )
    with pytest.raises(SceneError, match=r"normals\[1\]: points into the grain"):
        case(hook)
    assert len(case(hook, "contacts.convex=false").contacts.table) == 2
    with pytest.raises(SceneError, match=r"normals\[0\]: points into the grain"):
        case(PLANE.replace("[[0.0, -1.0]]", "[[0.0, 1.0]]"), "contacts.convex=false")


def test_built_from_python():
    with pytest.raises(SceneError, match=r"^Case: load: is missing"):
        Case(contacts={"points": [[0, 0]], "normals": [[0, -1]], "friction": 0.5})


# Tables of cases and series of loads: reading, wrong rows and columns, verdicts by statics.


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


def verdicts(
    path: Path, *settings: str, jobs: int = 1
) -> tuple[dict[str, Any], list[dict[str, str]]]:
    """The outcome of a table, and the rows of verdicts.csv."""
    outcome = judge_table(path, settings, path.parent, jobs, Silent())
    return outcome, table_of(path.parent / "verdicts.csv")


INTO = "points into the grain; turn it; if the grain is not convex, convex=0"
# A cell in a column, and the reason in the answer; None: the case still has an answer.
WRONG_OF_TABLES = [
    ("force_x", "abc", 'force_x is "abc"; give a number'),
    ("force_y", "1_0", 'force_y is "1_0"; give a number'),
    ("force_y", "٣", 'force_y is "٣"; give a number'),
    ("weight_x", "nan", "weight_x is empty or not finite; give a number"),
    ("couple", "inf", "couple is empty or not finite; give a number"),
    ("friction", "", "friction is empty or not finite; give a number"),
    ("friction", "-0.5", "friction -0.5 is not a coefficient; give a number that is not negative"),
    ("contact_1_x", "", "contact_1_x is empty or not finite; give a number"),
    ("normal_2_y", "7", "normal_2 is not of length 1; give a unit vector out of the grain"),
    (
        "centre_x",
        "-9",
        INTO,
    ),
    ("mass", "-1", "mass -1.0 is not positive; give the grain's mass"),
    ("mass", "", "mass nan is not positive; give the grain's mass"),
    ("inertia", "0", "inertia is not positive definite; give positive moments about every axis"),
    ("force_x", "1,2", "has 19 cells for 18 columns; give one for each"),
    ("force_x", "a" * 131_073, "is not a line of CSV"),
    ("force_x", '"', "has 1 cell for 18 columns"),
    ("force_x", "1e300", None),
    ("weight_y", "1e-200", None),
    ("contact_2_x", "1e160", None),
    ("centre_x", "-1e200", None),
]


def test_wrong_rows_fail_with_their_reasons_and_touch_no_others(tmp_path: Path) -> None:
    """Each third row has one of the wrong cells, or no contact."""
    rows = rows_of(3 * len(WRONG_OF_TABLES) + 3)
    outcome, right = verdicts(write(tmp_path / "right.csv", rows))
    assert outcome["failed"] == 0
    reasons: dict[int, str | None] = {
        1 + 3 * k: reason for k, (*_, reason) in enumerate(WRONG_OF_TABLES)
    }
    for k, (column, cell, _) in enumerate(WRONG_OF_TABLES):
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
    assert (outcome["failed"], outcome["cases"]) == (len(failed), len(rows))
    assert outcome["reasons"] == dict(list(failed.items())[:5])
    turned = next(place for place, reason in reasons.items() if reason == INTO)
    assert verdicts(tmp_path / "wrong.csv", "convex=0")[1][turned]["reason"] == ""


def test_threads_judge_chunks_as_one_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = rows_of(110)
    rows[75][0] = "x"
    rows[85][COLUMNS.index("friction")] = "-1"
    path = write(tmp_path / "cases.csv", rows)
    whole = verdicts(path)
    monkeypatch.setattr(batch, "CHUNK", 40)
    assert verdicts(path, jobs=3) == whole
    assert sorted(whole[0]["reasons"]) == [76, 86]


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
    rows = table_of(tmp_path / "verdicts.csv")
    assert rows[:40] == verdicts(path)[1][:40] and len(rows) == 110
    assert {row["reason"] for row in rows[40:]} == {"not judged: interrupted; call again"}


def test_parquet_as_csv(tmp_path: Path) -> None:
    """Also for names that are not UTF-8, empty cells and rows that fail."""
    rows = rows_of(60)
    rows[7][COLUMNS.index("contact_2_x")] = rows[8][COLUMNS.index("force_x")] = ""
    named = [[f"disc {place}", *row] for place, row in enumerate(rows)]
    outcome, expected = verdicts(write(tmp_path / "cases.csv", named, ["name", *COLUMNS]))
    columns = {
        name: [float(cell) if cell else None for cell in column]
        for name, column in zip(COLUMNS, zip(*rows, strict=True), strict=True)
    }
    pyarrow = pytest.importorskip("pyarrow")
    names = pyarrow.array([row[0].encode() for row in named[:-1]] + [b"\xff"])
    path = write_parquet(
        tmp_path / "cases.parquet", {"name": names.view(pyarrow.utf8()), **columns}
    )
    again, stored = verdicts(path)
    assert stored[-1].pop("name") == "\ufffd" and expected[-1].pop("name") == "disc 59"
    assert (again, stored) == (outcome, expected)


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
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said_by: Any
) -> None:
    path = tmp_path / "cases.parquet"
    path.write_bytes(b"no Parquet")
    for order in (
        ["--batch", str(path)],
        [str(CASES / "block_on_incline.toml"), "--series", str(path)],
    ):
        complaint = said_by("judge", *order, code=2)
        assert complaint.count("\n") == 1 and "or of a Parquet file of numbers" in complaint
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    complaint = said_by("judge", "--batch", path, code=6)
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
        (COLUMNS, ["mass=2"], "--set mass: the table has this column"),
        (["name;force_x"], [], 'has one column, "name;force_x"; separate columns by commas'),
        (COLUMNS, ["about_x=nan"], "--set about_x=nan: is not a finite number"),
        (COLUMNS, ["about_x=left"], "--set about_x=left: is not a finite number"),
        ([name for name in COLUMNS if name != "mass"], [], "no column mass; give it"),
        ([*COLUMNS, "contact_4_x"], [], "no column contact_3_x"),
        ([*COLUMNS, "force_z"], [], "no column couple_x"),
        ([*COLUMNS, "about_x"], [], "no column about_y; give it, or --set about_y=VALUE"),
        ([*COLUMNS, "about_y"], [], "no column about_x; give it, or --set about_x=VALUE"),
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
    load, contacts, inert = case.to_load(), case.contacts.table, case.mass_and_inertia()
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


def test_the_command_judges_the_shipped_table(tmp_path: Path, said_by: Any) -> None:
    out = tmp_path / "new" / "directory"
    order = ["judge", "--batch", str(CASES / "batch.csv"), "--out", str(out)]
    assert 'row 6: force_x is "x"; give a number' in said_by(*order)
    *rows, wrong = table_of(out / "verdicts.csv")
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
    assert "verdicts.csv: was not written by incipient" in said_by(*order[:-1], others, code=5)


def test_a_table_of_which_no_row_is_judged_is_an_error(tmp_path: Path, capsys: Any) -> None:
    row = dict(zip(COLUMNS, rows_of(1)[0], strict=True)) | {"normal_1_x": "0", "normal_1_y": "0"}
    path = write(tmp_path / "cases.csv", [list(row.values())])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert main(["judge", "--batch", str(path), "--out", str(tmp_path)]) == 2
    said = capsys.readouterr()
    assert "row 1: normal_1 is not of length 1; give a unit vector out of the grain" in said.out
    assert (
        said.err == f"incipient: {path}: no case could be judged; correct its rows as said above\n"
    )


# A block of weight 1 on a flat bed with friction 0.5: it slides for a push above 0.5.
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


def pushed(**columns: Any) -> dict[str, Any]:
    """A push of 0.75 for one unit of time, and of 0.25 otherwise."""
    time = np.linspace(0.0, 4.0, 4001)
    push = np.where((time >= 1.0) & (time < 2.0), 0.75, 0.25)
    return {"time": time, "force_x": push, "force_y": 0.0 * time, "couple": 0.0 * time, **columns}


@pytest.mark.parametrize("shares", [{"friction": 1.0}, {"weight_x": 0.0, "weight_y": -2.0}])
def test_weight_and_friction_may_vary(shares: dict[str, float], case: Any) -> None:
    """Half the friction, or half the weight, halves the force that is held."""
    halved = np.where(pushed()["time"] < 2.0, 0.5, 0.25)
    columns = {name: share * halved for name, share in shares.items()}
    factors = judge_series(case(BLOCK), pushed(**columns)).batch.factors
    assert factors[[0, -1]] == pytest.approx([2.0, 1.0])


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"force_z": np.zeros(4001)}, "column force_z is not known"),
        ({"force_x": np.full(4001, np.nan)}, "force_x is not finite in sample 1"),
        ({"time": np.zeros(4001)}, "time does not increase"),
        (
            dict.fromkeys(("time", "force_x", "force_y", "couple"), np.zeros(0)),
            "there are no samples",
        ),
        ({"weight_y": np.zeros(4001)}, "no column weight_x"),
        ({"friction": np.full(4001, -1.0)}, "friction is negative"),
    ],
)
def test_wrong_series_are_refused(columns: dict[str, Any], said: str, case: Any) -> None:
    assert said in message(lambda: judge_series(case(BLOCK), pushed(**columns)))


def written(path: Path) -> Path:
    """A CSV file of the series."""
    columns = pushed()
    return write(path, np.array(list(columns.values())).T.tolist(), list(columns))


def test_a_series_of_parquet_is_that_of_csv(tmp_path: Path) -> None:
    of_csv = read_series(written(tmp_path / "forces.csv"))
    of_parquet = read_series(write_parquet(tmp_path / "forces.parquet", pushed()))
    assert list(of_parquet) == list(of_csv)
    assert np.array_equal(list(of_parquet.values()), list(of_csv.values()))


def test_the_command_judges_a_series(tmp_path: Path, said_by: Any) -> None:
    """Without the flow's load in the case, which is never read."""
    path = written(tmp_path / "forces.csv")
    case = tmp_path / "block.toml"
    lines = BLOCK.splitlines(keepends=True)
    case.write_text("".join(line for line in lines if not line.startswith("flow_")))
    order = ["judge", str(case), "--series", str(path), "--out", str(tmp_path / "out")]
    said = said_by(*order, "--law", "U2")
    assert "25.000% of the time" in said and "series.png" in said
    assert "instantaneous probability 0.25" in said
    # A push of 0.5 is held: for a quarter of the time it is 0.75, else 0.25, and grows as the square of the velocity.
    assert f"probability 0.05  {np.sqrt(0.5 / 0.75):.4g} " in said
    assert f"probability 0.5   {np.sqrt(0.5 / 0.25):.4g} " in said
    # Coulomb's law: for one unit of time 0.25 of 0.75 is more than can be held.
    (event,) = json.loads((tmp_path / "out" / "series.json").read_text())["events"]
    assert (event.pop("start"), event.pop("mode")) == (1.0, "sliding")
    assert event == pytest.approx({"length": 1.0, "impulse": 0.25, "least": 2.0 / 3.0})
    samples = (tmp_path / "out" / "series.csv").read_text().splitlines()
    assert len(samples) == 4002 and samples[1501].endswith("sliding")
    said = said_by(*order, "--since", "2")
    assert "rest                100.000% of the time" in said and "from time 2 on" in said
    unread = ("--set", "load.flow_force=[0.1, 0.0]", "--set", "errors.friction=0.1")
    note = f"\nnot read            load.flow_force, [errors] of {case}\n"
    assert note in said_by(*order, *unread) and "not read" not in said
    assert "there are no samples from 5 on; the last time is 4" in said_by(
        *order, "--since", "5", code=2
    )
    case.write_text(case.read_text().replace("friction =", "# friction ="))
    said = said_by(*order, code=2)
    assert f"{case}: contacts.friction: is missing" in said and "flow_force" not in said


def test_a_case_replaces_all_records_of_an_earlier_one(tmp_path: Path, said_by: Any) -> None:
    """Otherwise the page of a disc has the series of a block; files of others stay."""
    out, forces = ["--out", str(tmp_path)], CASES / "openfoam_block"
    block = [
        "judge",
        str(forces / "case.toml"),
        "--forces",
        str(forces / "postProcessing" / "forces"),
    ]
    said_by(*block, "--density", "1", *out)
    (tmp_path / "mine.csv").write_text("")
    names = {path.name for path in tmp_path.iterdir()} - {".incipient", "mine.csv"}
    judged = {"judgement.json", "judgement.png"}
    assert names == judged | {"series.csv", "series.json", "series.png"}
    said_by("judge", str(CASES / "disc_in_pocket.toml"), *out)
    assert {path.name for path in tmp_path.iterdir()} == judged | {".incipient", "mine.csv"}


def test_wrong_rows_of_a_series_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "forces.csv"
    path.write_text("time,force_x\n1,2\n2,x\n")
    with pytest.raises(SceneError, match=r'forces\.csv: row 2: force_x is "x"; give'):
        read_series(path)


# Forces of another program: OpenFOAM's files, means with errors, grains in place, motion in time.


BLOCK_OF_FORCES = CASES / "openfoam_block"
FORCES = BLOCK_OF_FORCES / "postProcessing" / "forces"
TIMES = np.arange(1, 61) * 0.1
PRESSURE = np.column_stack([1.0 + 0.1 * np.sin(9.0 * TIMES), 0.3 + 0.0 * TIMES, 0.0 * TIMES])
VISCOUS = np.column_stack([0.2 + 0.0 * TIMES, 0.05 * np.cos(7.0 * TIMES), 0.0 * TIMES])
PUSH = PRESSURE + VISCOUS
TWIST = np.column_stack([0.0 * TIMES, 0.0 * TIMES, -0.1 + 0.02 * np.sin(5.0 * TIMES)])
CENTRE = "# CofR          : (4.5 0.5 0)\n"


def numbers(values: np.ndarray, bracket: bool) -> str:
    text = " ".join(f"{one:.10e}" for one in values)
    return f"({text})" if bracket else text


def of_com(
    folder: Path, name: str = "", rows: slice = slice(None), factor: float = 1.0, **how: bool
) -> Path:
    """`force_NAME.dat` and `moment_NAME.dat`, vectors in brackets (up to 2012) or not; all but times times a factor."""
    folder.mkdir(parents=True, exist_ok=True)
    for kind, parts in (("force", (PRESSURE, VISCOUS)), ("moment", (0.7 * TWIST, 0.3 * TWIST))):
        parts = (*parts, 0.0 * PRESSURE) if how.get("porous") else parts
        columns = [factor * part[rows] for part in (sum(parts), *parts)]
        lines = [f"# {kind}\n{CENTRE}# Time total_x total_y total_z pressure_x pressure_y\n"]
        for time, *at in zip(TIMES[rows], *columns, strict=True):
            cells = (numbers(one, how.get("bracket", False)) for one in at)
            lines.append("\t".join([f"{time:g}", *cells]) + "\n")
        (folder / f"{kind}{name}.dat").write_text("".join(lines))
    return folder


def of_org(folder: Path, porous: bool = False) -> Path:
    """`forces.dat` with both, as openfoam.org and foam-extend write it."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"# Forces\n{CENTRE}# Time  \tforces(pressure viscous) moment(pressure viscous)\n"]
    for time, pressure, viscous, twist in zip(TIMES, PRESSURE, VISCOUS, TWIST, strict=True):
        more = f" {numbers(0.0 * twist, True)}" if porous else ""
        force = f"({numbers(pressure, True)} {numbers(viscous, True)}{more})"
        moment = f"({numbers(0.7 * twist, True)} {numbers(0.3 * twist, True)}{more})"
        lines.append(f"{time:g}\t{force} {moment}\n")
    (folder / "forces.dat").write_text("".join(lines))
    return folder


@pytest.mark.parametrize("porous", [False, True])
@pytest.mark.parametrize("made", ["brackets", "columns", "org"])
def test_formats_are_told_by_header_and_columns(tmp_path: Path, made: str, porous: bool) -> None:
    """Also where the last line is cut short, as of a run that goes on."""
    folder, is_org = tmp_path / "forces" / "0", made == "org"
    if is_org:
        of_org(folder, porous)
    else:
        of_com(folder, bracket=made == "brackets", porous=porous)
    for path in folder.iterdir():
        path.write_text(path.read_text() + "6.1 (1.0 0.")
    file = folder / ("forces.dat" if is_org else "force.dat")
    for path in (tmp_path / "forces", folder, file):
        forces = read_forces(path)
        assert forces.times == pytest.approx(TIMES)
        assert forces.forces == pytest.approx(PUSH, abs=1e-9)
        assert forces.moments == pytest.approx(TWIST, abs=1e-9)
        assert forces.centre.tolist() == [4.5, 0.5, 0.0]


@pytest.mark.parametrize(
    ("files", "slow", "sources"),
    [
        # Ordered by number, not by letters: "10" comes after "2.5", whose samples end before it.
        (
            [("0", "", 0, 40, 0.1), ("2.5", "", 25, 60, 1.0), ("10", "", 55, 60, 1.0)],
            25,
            ("0/force.dat 0.1 to 2.5", "2.5/force.dat 2.6 to 5.5", "10/force.dat 5.6 to 6"),
        ),
        # OpenFOAM adds the start to the name where the folder has a file (`writeFile::newFileAtTime`): a rerun
        (
            [("0", "", 0, 60, 0.1), ("0", "_0", 0, 50, 1.0)],
            0,
            ("0/force_0.dat 0.1 to 5", "0/force.dat superseded"),
        ),
        # and a run resumed in the same folder.
        (
            [("0", "", 0, 45, 0.1), ("0", "_3", 30, 60, 1.0)],
            30,
            ("0/force.dat 0.1 to 3", "0/force_3.dat 3.1 to 6"),
        ),
    ],
)
def test_later_starts_replace_what_earlier_ones_have_from_there_on(
    tmp_path: Path,
    files: list[tuple[str, str, int, int, float]],
    slow: int,
    sources: tuple[str, ...],
) -> None:
    """The first samples are a tenth of the others; each file alone is read as it is."""
    for folder, name, first, end, factor in files:
        path = of_com(tmp_path / folder, name, slice(first, end), factor) / f"force{name}.dat"
        assert read_forces(path).moments == pytest.approx(factor * TWIST[first:end], abs=1e-9)
    forces, end = read_forces(tmp_path), 50 if slow == 0 else 60
    assert forces.times == pytest.approx(TIMES[:end])
    expected = np.vstack([0.1 * PUSH[:slow], PUSH[slow:end]])
    assert forces.forces == pytest.approx(expected, abs=1e-9)
    assert forces.sources == sources


@pytest.mark.parametrize(
    ("files", "said"),
    [
        # Was 3 resumed from the first run, or from that which was started again?
        ([("0", ""), ("0", "_0"), ("3", "")], "0/force_0.dat and 3/force.dat"),
        ([("3", ""), ("3.0", "")], "3/force.dat and 3.0/force.dat"),
        ([("", ""), ("0", "")], "force.dat and 0/force.dat"),
        # Of two programs.
        ([("", ""), (".", "org")], "force.dat and forces.dat"),
    ],
)
def test_a_folder_that_can_be_read_in_two_ways_is_refused(
    tmp_path: Path, files: list[tuple[str, str]], said: str
) -> None:
    for folder, name in files:
        of_org(tmp_path) if name == "org" else of_com(tmp_path / folder, name)
    assert said in message(lambda: read_forces(tmp_path))


def test_moments_about_two_points_are_refused_if_both_count(tmp_path: Path) -> None:
    of_com(tmp_path / "0", rows=slice(0, 30))
    of_com(tmp_path / "0", "_0", slice(0, 30))
    changed(tmp_path / "0" / "moment.dat", "(4.5 ", "(4.4 ")
    assert read_forces(tmp_path).centre.tolist() == [4.5, 0.5, 0.0]
    of_com(tmp_path / "3", rows=slice(30, 60))
    changed(tmp_path / "3" / "moment.dat", "(4.5 ", "(4.6 ")
    said = message(lambda: read_forces(tmp_path))
    assert "0/force_0.dat and 3/force.dat" in said and "have moments about" in said


def changed(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def both(change: Callable[[Path], Any]) -> Callable[[Path, Path], Any]:
    return lambda force, moment: (change(force), change(moment))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (
            lambda f, m: changed(f, "\n0.1\t1.2", "\n0.1\t1.3"),
            "the total at time 0.1 is not the sum",
        ),
        (lambda f, m: changed(m, CENTRE, ""), "add a line '# CofR"),
        (lambda f, m: m.unlink(), "moment.dat is missing; write moments also"),
        (lambda f, m: changed(m, "\n0.1\t", "\n0.15\t"), "has other times than force.dat"),
        (lambda f, m: f.write_text("0.1" + 9 * " nan" + "\n"), "is not finite at time 0.1"),
        (lambda f, m: f.write_text("hello\n"), "cannot be read"),
        (lambda f, m: f.write_text("1 2 3\n"), "has 3 numbers a line; force.dat has 10"),
        (lambda f, m: f.unlink(), "moment.dat has no file of forces next to it"),
        (lambda f, m: f.write_text(CENTRE), "force.dat has no samples yet"),
        (both(lambda path: changed(path, "\n0.2\t", "\n0.1\t")), "time 0.1 twice or out of order"),
        (lambda f, m: m.write_text(m.read_text() + "# CofR : (0 0 0)\n"), "about 2 points (CofR)"),
        (lambda f, m: changed(m, "(4.5 ", "(1e999 "), "does not name the point of its moments"),
        (both(Path.unlink), "holds no forces; give a folder"),
    ],
)
def test_what_is_wrong_in_files_is_said_in_one_line(
    tmp_path: Path, spoil: Callable[[Path, Path], Any], said: str
) -> None:
    folder = of_com(tmp_path / "0")
    spoil(folder / "force.dat", folder / "moment.dat")
    assert said in message(lambda: read_forces(tmp_path))


def test_error_of_a_mean_is_that_of_its_batches() -> None:
    """An AR(1) process of variance one and correlation r: the variance of its mean is (1 + r)/((1 - r) n)."""
    random, r, n, estimates = np.random.default_rng(5), 0.8, 4000, []
    for _ in range(100):
        noise = random.standard_normal(n) * np.sqrt(1.0 - r**2)
        values, _ = lfilter([1.0], [1.0, -r], noise, zi=[r * random.standard_normal()])
        estimates.append(mean_in_time(values, np.arange(n, dtype=float)))
    means, errors = np.transpose(estimates)
    exact = np.sqrt((1.0 + r) / ((1.0 - r) * n))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(exact, rel=0.1)
    assert np.std(means) == pytest.approx(exact, rel=0.2)


# As of case.toml: a mass of 1.65 and a weight less buoyancy of 6 for a volume of one.
SET = ["body.density=1.65", "fluid.density=1", f"gravity.acceleration={6 / 0.65}"]
SET += ["contact.friction=0.5", "errors.samples=10"]
DOWN = "gravity.direction=[0, -1, 0]"
BOX = ("body.shape=box", "body.sides=[1, 1, 1]", "body.centre=[4.5, 0.5, 0.5]")
FLAT = Path("flat")


def in_place(
    *overrides: str,
    grain: Path | None = BLOCK_OF_FORCES / "block.stl",
    bed: Path = BLOCK_OF_FORCES / "bed.stl",
) -> Case:
    return grain_in_place(grain, bed, [*SET, DOWN, *overrides])


def verdict(case: Case, forces: ForcesInTime | None = None, density: float = 1.0) -> JudgedForces:
    return judge_forces(case, forces or read_forces(FORCES), density, 5.0)


def factor(judged: JudgedForces) -> float:
    return float(judged.judgement["verdict"]["safety_factor"])


@pytest.fixture
def block_of_forces() -> Case:
    """The case of the demo."""
    return load_case(BLOCK_OF_FORCES / "case.toml", ["errors.samples=10"], needs_flow=False)


def test_the_block_tips_or_slides_as_statics_say(block_of_forces: Case) -> None:
    """It slides from F = mu (W - L) on, and tips about its downstream edge from the moment about that on."""
    forces = read_forces(FORCES)
    late = forces.times >= 5.0
    drag, lift, couple = (
        mean_in_time(values[late], forces.times[late])[0]
        for values in (*forces.forces.T[:2], forces.moments[:, 2])
    )
    weight, friction = 6.0, 0.5
    slides = friction * weight / (drag + friction * lift)
    # Moments about (5, 0): the drag at height 1/2 and the couple turn it downstream, lift and weight have arms of 1/2.
    tips = 0.5 * weight / (0.5 * drag + 0.5 * lift - couple)
    assert factor(verdict(block_of_forces)) == pytest.approx(min(slides, tips), rel=1e-6)
    # Twice the density: twice the load.
    twice = factor(verdict(block_of_forces, density=2.0))
    assert factor(verdict(block_of_forces)) == pytest.approx(2.0 * twice, rel=1e-9)


@pytest.mark.parametrize("where", ["case", "in place"])
def test_the_point_of_the_moments_does_not_change_the_verdict(
    where: str, block_of_forces: Case
) -> None:
    """M_a = M_b + (b - a) ^ F, Varignon's theorem."""
    case, forces = block_of_forces if where == "case" else in_place(), read_forces(FORCES)
    shift = np.array([-3.0, 2.0, 0.7 if where == "in place" else 0.0])
    moments = forces.moments - np.cross(shift, forces.forces)
    moved = ForcesInTime(forces.times, forces.forces, moments, forces.centre + shift)
    plain, other = verdict(case, forces), verdict(case, moved)
    assert factor(plain) == pytest.approx(factor(other), rel=1e-9)
    assert plain.series.batch.factors == pytest.approx(other.series.batch.factors, rel=1e-9)
    assert plain.series.batch.mode_names == other.series.batch.mode_names


@pytest.mark.parametrize("how", ["files", "box on a plane"])
def test_the_shipped_block_is_judged_as_by_its_case(how: str, block_of_forces: Case) -> None:
    """Contacts, weight and inertia from the surfaces give the verdict of those in case.toml."""
    case = in_place() if how == "files" else in_place(*BOX, grain=None, bed=FLAT)
    mine, theirs = verdict(case), verdict(block_of_forces)
    assert factor(mine) == pytest.approx(factor(theirs), rel=1e-6)
    assert mine.series.batch.factors == pytest.approx(theirs.series.batch.factors, rel=1e-6)
    assert mine.series.batch.mode_names == theirs.series.batch.mode_names
    assert case.grain is not None and case.grain.mass == pytest.approx(1.65)
    assert np.array(case.grain.inertia) == pytest.approx(0.275 * np.eye(3), abs=1e-12)


def test_a_turned_frame_changes_nothing(tmp_path: Path) -> None:
    """The run, its grain and bed turned together, gravity with them."""
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.6, 0.3]))
    for name in ("block", "bed"):
        surface = trimesh.load(BLOCK_OF_FORCES / f"{name}.stl")
        surface.apply_transform(turn).export(tmp_path / f"{name}.stl")
    matrix, forces = turn[:3, :3], read_forces(FORCES)
    vectors = (forces.forces @ matrix.T, forces.moments @ matrix.T, matrix @ forces.centre)
    down = f"gravity.direction={(-matrix[:, 1]).tolist()}"
    # STL holds single precision.
    changes = [*SET, down, "contact.tolerance=1e-4"]
    case = grain_in_place(tmp_path / "block.stl", tmp_path / "bed.stl", changes)
    turned = verdict(case, ForcesInTime(forces.times, *vectors))
    assert factor(turned) == pytest.approx(factor(verdict(in_place())), rel=1e-5)


IN_SCENE = """
domain = {length = 12, width = 10, height = 6}
fluid = {reynolds = 0.1, scale = "grain"}
flow = {kind = "shear"}
body = {shape = "mesh", file = "block.stl", x = 5}
bed = {kind = "flat"}
"""


@pytest.mark.parametrize("fault", ["turned", "twice"])
def test_a_repaired_surface_stands_where_its_file_has_it(tmp_path: Path, fault: str) -> None:
    """The block of its file, a unit cube, with three triangles turned inside out, or two given twice."""
    block = trimesh.load(BLOCK_OF_FORCES / "block.stl")
    faces = block.faces.copy()
    if fault == "turned":
        faces[:3] = faces[:3, ::-1]
    else:
        faces = np.vstack([faces, faces[:2, ::-1]])
    path = tmp_path / "block.stl"
    trimesh.Trimesh(block.vertices, faces, process=False).export(path)
    case = in_place(grain=path)
    assert case.load.centre == pytest.approx((4.5, 0.5, 0.5), abs=1e-7)
    assert factor(verdict(case)) == pytest.approx(factor(verdict(in_place())), rel=1e-6)
    for folder in (tmp_path, BLOCK_OF_FORCES):
        scene = loads(IN_SCENE, folder)
        assert scene.placement.centre == pytest.approx((5.0, 5.0, 0.5), abs=1e-7)
        assert scene.grain.volume == pytest.approx(1.0, abs=1e-7)


GRAIN, BED = BLOCK_OF_FORCES / "block.stl", BLOCK_OF_FORCES / "bed.stl"


@pytest.mark.parametrize(
    ("overrides", "grain", "bed", "said"),
    [
        ([], None, FLAT, "--grain is missing"),
        ([], GRAIN, None, "--bed is missing"),
        (SET[1:], GRAIN, FLAT, "body: has no mass; give body.density"),
        (SET[:1] + SET[2:], GRAIN, FLAT, "by --set): fluid.density: is missing; add it"),
        (SET, GRAIN, BED, "upwards is against gravity.direction"),
        ([*SET, "gravity.direction=[0, 0, 0]"], GRAIN, FLAT, "direction: is zero"),
        ([*SET, DOWN, "bed.height=-0.1"], GRAIN, FLAT, "of its size above the bed"),
        ([*SET, DOWN, "bed.height=1"], GRAIN, BED, "leave it out"),
        # The block is 1 high: its centre is 0.3 above, or 0.1 below, a plane that it stands in.
        ([*SET, DOWN, "bed.height=0.2"], GRAIN, FLAT, "in the bed, by 0.115"),
        ([*SET, DOWN, "bed.height=0.6"], GRAIN, FLAT, "is below the bed"),
        ([*SET, DOWN, "bed.height=9"], GRAIN, FLAT, "is below the bed"),
        # Seen against a gravity of the wrong sign the bed is above the block.
        (
            [*SET, "gravity.direction=[0, 1, 0]"],
            GRAIN,
            BED,
            "below the bed; reverse gravity.direction",
        ),
        (SET, BED, FLAT, "bed.stl"),
        (SET, BLOCK_OF_FORCES / "absent.stl", FLAT, "absent.stl"),
        ([*SET, *BOX[:2]], None, FLAT, "neither x nor centre is given"),
    ],
)
def test_what_is_wrong_of_a_grain_in_place_is_said(
    overrides: list[str], grain: Path | None, bed: Path | None, said: str
) -> None:
    assert said in message(lambda: grain_in_place(grain, bed, overrides))


@pytest.mark.parametrize(("law", "power"), [("U", 1.0), ("U2", 2.0)])
def test_motion_in_time_of_a_pulsating_force(law: str, power: float) -> None:
    """A drag of 2 + cos(2 pi t) on a block that slides from 2.5 on: a third of each period, once in each."""
    times = np.linspace(0.0, 20.0, 8_001)
    forces = (2.0 + np.cos(2.0 * np.pi * times))[:, None] * [1.0, 0.0, 0.0]
    pulsating = ForcesInTime(times, forces, 0.0 * forces, np.array([4.5, 0.5, 0.5]))
    case = in_place("contact.friction=0.416666666666666667", *BOX, grain=None, bed=FLAT)
    judged = judge_forces(case, pulsating, 1.0, 0.0, law)
    motion, velocities = judged.judgement["motion"], judged.judgement["threshold"]
    assert motion["probability"] == pytest.approx(1.0 / 3.0, abs=2e-3)
    assert motion["error"] is not None and motion["error"] < 0.02
    assert motion["rate"] == pytest.approx(1.0, rel=1e-9) and motion["low"] < 1.0 < motion["high"]
    assert velocities["mean"][0] ** power == pytest.approx(2.5 / 2.0, rel=1e-3)
    for quantile in velocities["quantiles"]:
        # The drag is above 2 + cos(pi p) for a fraction p of the time.
        exact = 2.5 / (2.0 + np.cos(np.pi * quantile["probability"]))
        assert quantile["factor"] ** power == pytest.approx(exact, rel=2e-3)
        assert quantile["low"] <= quantile["factor"] <= quantile["high"]


def test_a_series_that_never_moves() -> None:
    """No event in a time T: the rate is below 3/T with 95%, by Poisson's law."""
    times = np.arange(50.0)
    names = ("force_y", "force_z", "couple_x", "couple_y", "couple_z")
    columns = {"time": times, "force_x": 0.0 * times + 0.1, **dict.fromkeys(names, 0.0 * times)}
    motion = judge_series(in_place(*BOX, grain=None, bed=FLAT), columns).record["motion"]
    assert [motion[name] for name in ("probability", "error", "rate", "low")] == [
        0.0,
        None,
        0.0,
        0.0,
    ]
    assert motion["high"] == pytest.approx(3.0 / 49.0)


@pytest.mark.parametrize(
    ("words", "needs"),
    [
        (["--since", "1"], "--since: needs --forces or --series"),
        (["--law", "U"], "--law: needs --forces or --series"),
        (["--jobs", "1"], "--jobs: needs --batch"),
        (["--density", "1"], "--density: needs --forces"),
        (["--grain", "a.stl"], "--grain: needs --forces"),
        (["--bed", "flat"], "--bed: needs --forces"),
        (["--forces", str(FORCES)], "--forces: needs --density"),
        (["--forces", str(FORCES), "--density", "-1"], "--density: is -1"),
        (["--forces", str(FORCES), "--density", "1", "--bed", "flat"], "leave one of them out"),
        (["--forces", str(FORCES), "--density", "1", "--since", "9.9"], "3 samples from time 9.9"),
        (["--batch", "cases.csv"], "leave out "),
        (None, "there is no case; give a case file, --batch FILE, or --forces with --grain"),
        (
            ("none.toml",),
            "none.toml: cannot be read (No such file or directory); give the name of a case file",
        ),
        (("--batch", "absent.csv"), "absent.csv: cannot be read (No such file or directory)"),
        (("--batch", "absent.csv", "--jobs", "0"), "--jobs: is 0; give 1 or more"),
    ],
)
def test_wrong_options_are_refused(words: Any, needs: str, said_by: Any) -> None:
    """After a case in a list, alone otherwise."""
    case = [str(BLOCK_OF_FORCES / "case.toml")] if isinstance(words, list) else []
    assert needs in said_by("judge", *case, *(words or ()), code=2)


@pytest.mark.parametrize("how", ["case", "in place"])
def test_the_command(how: str, tmp_path: Path, said_by: Any) -> None:
    order = ["judge", "--forces", str(FORCES), "--density", "1", "--law", "U2"]
    order += ["--out", str(tmp_path / "out")]
    if how == "case":
        order += [str(BLOCK_OF_FORCES / "case.toml"), "--since", "6"]
    else:
        order += ["--grain", str(GRAIN), "--bed", str(BED)]
        order += [word for one in (*SET, DOWN) for word in ("--set", one)]
    said = said_by(*order)
    if how == "case":
        assert "mean from time 6 on" in said and "A block on a bed, forces of OpenFOAM\n" in said
    else:
        assert "instantaneous probability 0, 100 samples" in said
    for name in ("judgement.json", "series.csv", "series.json", "judgement.png", "series.png"):
        assert (tmp_path / "out" / name).is_file()
    stored = json.loads((tmp_path / "out" / "judgement.json").read_text())
    root = np.sqrt(stored["verdict"]["safety_factor"])
    assert stored["threshold"]["mean"][0] == pytest.approx(root, rel=1e-12)
    assert len(stored["case"]["contacts"]["points"]) == (2 if how == "case" else 4)
    assert [source[:12] for source in stored["forces"]] == ["0/force.dat ", "5/force.dat "]
