"""Sweeps: cases, store, refinement and tables."""

from __future__ import annotations

import csv
import io
import json
import math
import sqlite3
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from scenes import CASES, message

import incipient.sweep
from incipient.errors import MissingError, OutputError, SceneError
from incipient.flumes.thresholds import soulsby_whitehouse
from incipient.progress import telling
from incipient.scene import example, load, loads
from incipient.sweep import procedure
from incipient.sweep.cases import Source, SweepCase, axes_of, combined, resolved, table_of_cases
from incipient.sweep.procedure import Means
from incipient.sweep.refinement import SweepRefinement, refined_key
from incipient.sweep.request import parsed_seconds, requested
from incipient.sweep.store import DONE, FAILED, WAITING, Store
from incipient.sweep.table import pockets, rows, size_classes
from incipient.sweep.worker import CaseOutcome, computed

# The values that a sweep varies, the identity of its cases, and their table.


SOURCE = Source("mine", example())


@pytest.mark.parametrize(
    ("over", "axes"),
    [
        (["a.b=log:0.1:1000:5"], {"a.b": ("0.1", "1", "10", "100", "1000")}),
        (["a.b=lin:0.2:0.6:3", "a.c=2"], {"a.b": ("0.2", "0.4", "0.6"), "a.c": ("2",)}),
        (['a.b=1,[2, 3],"x, y",log:1:4:2'], {"a.b": ("1", "[2, 3]", '"x, y"', "1", "4")}),
        # Of Python and TOML.
        ({"a": {"b": "log:1:100:3"}, "c.d": 0.5}, {"a.b": ("1", "10", "100"), "c.d": ("0.5",)}),
        ({"a.b": np.array([0.5, 1.0]), "a.c": ["x"]}, {"a.b": ("0.5", "1.0"), "a.c": ("x",)}),
        # Lists of different lengths, as polygons are.
        ({"a.x": [[[0, 1]], [[1, 2], [3, 4]]]}, {"a.x": ("[[0, 1]]", "[[1, 2], [3, 4]]")}),
    ],
)  # fmt: skip
def test_axes_have_all_values_of_a_key_as_text(over: Any, axes: dict[str, Any]) -> None:
    assert axes_of(over) == axes


ROWS = [("b.x=1", "b.y=[2, 3]"), ("b.x=4",)]
FOUR = [("a.x=1", "a.y=3"), ("a.x=1", "a.y=4"), ("a.x=2", "a.y=3"), ("a.x=2", "a.y=4")]


@pytest.mark.parametrize(
    ("over", "together", "table", "cases"),
    [
        (["a.x=1,2", "a.y=3,4"], False, (), FOUR),
        (["a.x=1,2", "a.y=3,4"], True, (), [FOUR[0], FOUR[3]]),
        (["a.x=1,2"], False, ROWS, [(*row, x) for row in ROWS for x in ("a.x=1", "a.x=2")]),
    ],
)
def test_cases_are_combinations_or_pairs_for_each_row_of_a_table(
    over: list[str], together: bool, table: Any, cases: list[tuple[str, ...]]
) -> None:
    assert combined(axes_of(over), together, table) == cases


def test_cells_and_columns_of_a_table_of_cases_may_be_empty(tmp_path: Path) -> None:
    """As spreadsheets write them."""
    (tmp_path / "cases.csv").write_text('b.x,b.y,\n1,"[2, 3]",\n4,,\n')
    assert table_of_cases(tmp_path / "cases.csv") == ROWS


PAIR = axes_of(["a.x=1,2", "a.y=3"])


def refined(*over: str, together: bool = False, **how: Any) -> Any:
    return requested([Source("mine", BLOCK)], over, zip=together, do="judge", **how).refinement([])


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: axes_of({"body.x": []}), "over body.x: has no values"),
        (lambda: axes_of(["fluid.reynolds"]), "is not a key with values"),
        (lambda: axes_of(["fluid.reynolds="]), "is not a key with values"),
        (lambda: axes_of(["a.x=log:0:1:3"]), "ends above zero"),
        (lambda: axes_of(["a.x=log:1:x:3"]), "is not a range of numbers"),
        (lambda: axes_of(["a.x=lin:0:1"]), "is not a range of numbers"),
        (lambda: axes_of(["a.x=lin:0:1:0"]), "gives 0 values"),
        (lambda: axes_of(["a.x=lin:1:nan:5"]), "1 to nan are not finite numbers"),
        (lambda: axes_of(["a.x=1,,2"]), "has an empty value"),
        (lambda: axes_of(["a.x=1,2"] * 2), "given twice"),
        (lambda: combined(PAIR, True), "a.x 2, a.y 1"),
        (lambda: combined(axes_of([f"a.x{n}=lin:0:1:1000" for n in range(3)]), False), "at most 100000"),
        (lambda: combined(PAIR, False, [("a.x=1",)]), "--over a.x: the table of cases has it as well"),
        (lambda: requested([SOURCE]), "nothing is varied"),
        (lambda: requested([Source("torn", "[sweep")]), "torn: end of document: expected"),
        (
            requested([SOURCE], ["fluid.reynolds=1,-1"]).cases,
            "case 2 of 2 (fluid.reynolds=-1): --set fluid.reynolds=-1",
        ),
        (lambda: table_of_cases(Path("absent.csv")), "cannot be read"),
        (lambda: parsed_seconds("soon", "wall"), "is not a time"),
        (lambda: parsed_seconds("1h and 5", "wall"), "is not a time"),
        (lambda: parsed_seconds("-1h", "wall"), "is not a time"),
        (lambda: Means(memory_mib=float("nan")), "--memory nan: is not above zero"),
        (lambda: Means(memory_mib=60), "--memory 60: the libraries of a worker process take"),
        (lambda: Means(jobs=0), "--jobs 0: is not above zero"),
        (lambda: Means(tries=0), "--tries 0: is not above zero"),
        (
            lambda: Means(scheduler="tcp://here:1", jobs=2),
            "are started by you; give --nworkers to its `dask worker` instead",
        ),
        (lambda: refined("a.b=x,y", refine=True), "no key is varied over numbers"),
        (lambda: refined("a.b=[0],[1]", refine=True), "no key is varied over numbers"),
        (lambda: refined("a.b=1,2", "a.c=1,2", together=True, refine=True), "refines one key; leave out --zip"),
        (lambda: refined("a.b=1,2", refine=2.0), "sweep.refine: is 2.0; give true"),
        (lambda: refined("a.b=1,2", refine=True, most=0), "sweep.most: is 0; give"),
        (lambda: refined("a.b=1,2", most=5), "--most: applies to a refinement"),
        (lambda: requested([Source("mine", '[sweep]\nrefine = "much"')]), 'sweep.refine: is "much"'),
        (
            lambda: refined("a.b=1,2", refine=True, quantity="colour").following({"x": {"mode": "rest"}}),
            "--quantity colour: no case has this column; available: mode",
        ),
    ],
)  # fmt: skip
def test_wrong_requests_are_refused(call: Callable[[], object], said: str) -> None:
    assert said in message(call)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a.x,a.y\n1\n", "row 2 has a different number of cells"),
        ("a.x,a.x\n1,2\n", "has two columns a.x; remove one of them"),
    ],
)
def test_wrong_tables_of_cases_are_refused(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "cases.csv").write_text(text)
    assert said in message(lambda: table_of_cases(tmp_path / "cases.csv"))


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("8h", 28800.0),
        ("8H", 28800.0),
        ("1h30m", 5400.0),
        ("90", 90.0),
        ("1.5d", 129600.0),
        ("2m5s", 125.0),
    ],
)
def test_times_are_read(text: str, time: float) -> None:
    assert parsed_seconds(text, "wall") == time


def test_the_section_of_a_scene_says_what_is_varied(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        example() + '\n[sweep]\ndo = "threshold"\n[sweep.over]\nfluid.reynolds = "log:1:4:2"\n'
    )
    request = requested([Source.of(path)])
    assert request.section.do == "threshold" and request.axes == {"fluid.reynolds": ("1", "4")}
    assert load(path).fluid.reynolds == 20.0  # others pass it by
    assert [*requested([Source.of(path)], ["body.diameter=1,2"]).axes] == ["body.diameter"]
    path.write_text(path.read_text().replace("do =", "to ="))
    assert "sweep.to: unknown key" in message(lambda: requested([Source.of(path)]))


def test_the_identity_hangs_on_content_and_task_alone() -> None:
    changes = ("fluid.reynolds=40", "contact.friction=0.4")

    def identity(*settings: str, task: str = "run", source: Source = SOURCE) -> str:
        return resolved(source, settings, task).identity

    ways = {
        identity(*changes),
        identity("contact.friction=0.4", "fluid.reynolds=40.0"),
        identity("fluid.reynolds=4e1", "contact.friction=0.4", "title=x", "output.pictures=true"),
        identity(source=Source.of(loads(example(), overrides=changes))),
    }
    assert len(ways) == 1
    others = {identity(), identity(task="threshold"), identity("numerics.mesh_size=2")}
    assert len(ways | others) == 4


def test_the_curve_beside_ours_is_that_of_soulsby_and_whitehouse() -> None:
    """As printed: 0.30/(1 + 1.2 D*) + 0.055 (1 - exp(-0.020 D*)); 0.055 for coarse grains, about 0.03 for sand."""
    shields = soulsby_whitehouse(np.array([1e-9, 1.0, 17.0, 1e6]))
    assert shields == pytest.approx(
        [0.30, 0.30 / 2.2 + 0.055 * 0.0198013267, 0.0298, 0.055], rel=5e-3
    )


def test_the_table_has_units_in_its_heads_and_numbers_to_the_right(
    tmp_path: Path, said_by: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of each key the unit that `incipient new` writes beside it; the first cases are printed, all are counted."""
    monkeypatch.setattr("incipient.commands.sweep.FIRST", 2)
    axes, file = ["body.diameter=0.5,10,3", "bed.kind=flat"], tmp_path / "sweep.sqlite"
    cases = requested([SOURCE], axes).cases()
    with Store(file, make=True) as store:
        store.add(cases)
        store.finish(cases[0].identity, 1, CaseOutcome(json.dumps({"verdict": None}), wall=2.5))
    head, first, second, count = said_by("table", file).splitlines()
    places = [head.index(word) + len(word) for word in ("body.diameter [length]", "time [s]")]
    assert first[: places[0]].endswith("  0.5") and second[: places[0]].endswith("   10")
    assert first[: places[1]].endswith("  2.5") and "bed.kind " in head
    assert count.startswith("3 cases: 1 done, 2 waiting; the first 2 are shown")


def test_brackets_in_a_stage_are_no_markup(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    """A closing tag without an opening one would be an error of markup, which ends a sweep."""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with telling(0) as voice:
        voice.begin("mesh of sand[/coarse]")
        voice.say("1/2  title=[/coarse]: failed")
        voice.count("[/cases]", 1, 2)
    shown = capsys.readouterr().err
    assert "[/cases]" in shown and "title=[/coarse]: failed" in shown


# The file of a sweep: its cases and columns, files of others, damage, a second writer.


STORED = [
    SweepCase(f"case{n}", "judge", "made", (f"a.x={n}",), json.dumps({"a": {"x": n}}))
    for n in range(40)
]


def outcome(drag: float) -> CaseOutcome:
    result = json.dumps({"verdict": None, "coefficients": {"drag": drag}, "text": "x" * 3000})
    return CaseOutcome(result, {"drag": drag, "held": True}, wall=1.5, versions={"incipient": "1"})


def filled(path: Path, count: int = 40) -> list[dict[str, Any]]:
    """A file of cases of which `count` are done, and its table."""
    with Store(path, make=True) as store:
        store.add(STORED)
        with store.transaction():
            for n, case in enumerate(STORED[:count]):
                store.finish(case.identity, 1, outcome(n))
    return rows(path)


def changed(path: Path, statement: str) -> list[Any]:
    with sqlite3.connect(path) as base:
        actual = base.execute(statement).fetchall()
    base.close()
    return actual


def test_cases_wait_are_finished_and_wait_again_after_a_failure(tmp_path: Path) -> None:
    """Their table has the varied keys and the quantities, also infinite ones and parts of a list."""
    path, odd = tmp_path / "sweep.sqlite", SweepCase("odd", "run", "s", ("b.0=1",), '{"b": [7]}')
    with Store(path, make=True) as store:
        store.add([*STORED[:2], odd])
        store.finish("case0", 1, outcome(math.inf))
        store.finish("case1", 3, CaseOutcome(reason="heavy"))
        store.add(STORED[:3])
        states = {"case0": DONE, "case1": FAILED, "odd": WAITING, "case2": WAITING}
        assert store.states() == states and store.keys() == ["a.x", "b.0"]
        assert store.columns(states) == {"case0": {"drag": math.inf, "held": True}}
        store.add(STORED[:2], retry=True)
        assert store.states() == states | {"case1": WAITING}
    first, second, third, _ = rows(path)
    assert (first["a.x"], first["drag"], first["versions"]) == (0, math.inf, "incipient 1")
    assert (second["tries"], second["reason"], "drag" in second) == (3, "", False)
    assert (third["b.0"], "a.x" in third, third["status"]) == (7, False, WAITING)
    read = "SELECT settings, columns ->> 'drag' FROM cases"  # as the manual does
    assert changed(path, read)[0] == ('["a.x=0"]', math.inf)


def test_cases_of_an_edited_scene_are_told_apart(tmp_path: Path) -> None:
    file, edited = tmp_path / "block.sqlite", BLOCK.replace("[0.1, 0.0]", "[0.2, 0.0]")
    with Store(file, make=True) as store:
        for text in (BLOCK, edited):
            cases = requested([Source("block", text)], ["contacts.friction=0.2,0.4"], do="judge")
            store.add(cases.cases())
        assert store.keys() == ["contacts.friction", "load.flow_force"]
    pushes = [json.loads(row["load.flow_force"])[0] for row in rows(file)]
    assert pushes == [0.1, 0.1, 0.2, 0.2]


def test_a_varied_file_is_named(tmp_path: Path) -> None:
    """The complete scene has its points instead."""
    text = example().replace('shape = "disc"', 'shape = "polygon"\nfile = "none"')
    source = Source("mine", text.replace("diameter = 1.0  ", "#"), tmp_path)
    for name, height in (("low", 0.4), ("high", 0.8)):
        (tmp_path / f"{name}.csv").write_text(f"x,y\n0,0\n1,0\n1,{height}\n0,{height}\n")
    cases = requested([source], ["body.file=low.csv,high.csv"]).cases()
    with Store(tmp_path / "shapes.sqlite", make=True) as store:
        store.add(cases)
    assert [row["body.file"] for row in rows(tmp_path / "shapes.sqlite")] == ["low.csv", "high.csv"]


def test_files_of_others_and_of_other_versions_are_refused(tmp_path: Path) -> None:
    text, other, old = (tmp_path / f"{name}.sqlite" for name in ("text", "other", "old"))
    text.write_text("not a database, but long enough to have the head of one\n" * 20)
    changed(other, "CREATE TABLE things (id TEXT)")
    filled(old, 0)
    changed(old, "PRAGMA user_version = 4")
    for path, error, words in (
        (text, SceneError, "is not the file of a sweep"),
        (other, SceneError, "is not the file of a sweep"),
        (
            old,
            OutputError,
            "is the file of a sweep by another version of incipient; give another name",
        ),
    ):
        with pytest.raises(error, match=words):
            Store(path, make=True)
    with pytest.raises(SceneError, match="no such file"):
        Store(tmp_path / "absent.sqlite")
    assert not (tmp_path / "absent.sqlite").exists() and text.read_text().startswith("not a")


def test_a_second_writer_is_refused_and_readers_are_not(tmp_path: Path) -> None:
    path = tmp_path / "sweep.sqlite"
    filled(path, 1)
    with Store(path, make=True) as store:
        with pytest.raises(OutputError, match="another sweep writes to it; wait"):
            Store(path, make=True)
        assert len(rows(path)) == 40
        store.finish("case1", 1, outcome(1.0))
    with Store(path, make=True) as store:
        assert store.states()["case1"] == DONE


def test_a_damaged_file_is_one_line(tmp_path: Path) -> None:
    """A cell that is no JSON, and pages without content as of a bad disk."""
    path = tmp_path / "sweep.sqlite"
    filled(path)
    content = path.read_bytes()
    changed(path, "UPDATE cases SET columns = '{' WHERE id = 'case7'")
    for damage in (path.read_bytes(), content[:4096] + bytes(len(content) - 4096)):
        path.write_bytes(damage)
        with pytest.raises(OutputError, match=r"sweep\.sqlite: .*; it is damaged; restore a copy"):
            rows(path)


def at_rest(slope: float, *centre: float, **columns: float) -> dict[str, Any]:
    """The row of a grain of size 20 on a bed with a slope."""
    axes = {f"centre_{axis}": x for axis, x in zip("xyz", centre, strict=True) if x}
    return {"bed.slope": slope, "body.x": 60.0, "grain_size": 20.0, **axes, **columns}


@pytest.mark.parametrize(
    ("second", "line"),
    [
        (at_rest(0.0, 70.0, 0.0, 9.0) | {"body.x": 70.0}, None),  # moved by its own section
        (at_rest(5.0, 60.0, 0.0, 9.0), None),
        (at_rest(5.0, 60.1, 0.0, 9.0), None),  # half a percent of its size
        (at_rest(5.0, 62.0, 0.0, 9.0), "(0.1 of its size apart, 0 degrees turned)"),
        # In place, but turned by 0.1 rad about y: 5% of its size on its surface; in 2-D by an angle.
        (at_rest(5.0, 60.0, 0.0, 9.0, rotation_y=0.1), "(0 of its size apart, 5.7 degrees turned)"),
        (at_rest(5.0, 60.0, 0.0, 9.0, rotation=-0.1), "(0 of its size apart, 5.7 degrees turned)"),
        (at_rest(5.0, 62.0, 0.0, 9.0) | {"body.x": 61.0}, None),  # no neighbour
        ({"bed.slope": 5.0, "body.x": 60.0}, None),  # failed
    ],
)
def test_neighbours_that_rest_elsewhere_are_named(second: dict[str, Any], line: str | None) -> None:
    lines = pockets([second, at_rest(0.0, 60.0, 0.0, 9.0)], ["bed.slope", "body.x"])
    said = "bed.slope = 0 and 5: the grain rests on other points of the bed {}; body.settle = "
    starts = [] if line is None else [said.format(line)]
    assert [told[: len(start)] for told, start in zip(lines, starts, strict=True)] == starts


def test_neighbours_at_each_reynolds_number_are_named_once() -> None:
    rests = [at_rest(0.0, 60.0, 0.0, 9.0), at_rest(5.0, 62.0, 0.0, 9.0)]
    table = [rest | {"fluid.reynolds": number} for rest in rests for number in (1.0, 5.0)]
    (line,) = pockets(table, ["fluid.reynolds", "bed.slope"])
    assert line.startswith("bed.slope = 0 and 5: ")
    scenes = [row | {"source": f"grain {count}"} for count, row in enumerate(table)]
    assert pockets(scenes, ["fluid.reynolds", "bed.slope"]) == []


# Cases that a sweep adds: on the boundary of analytical solutions, within the budget, the same ones each time.


# A block on a slope of tangent t = 0.7, with its weight turned instead: its force along the slope is t + 0.1 with the
# flow's. It slides where that is above friction, and is too wide to tip below a tangent of 2.
BLOCK = """
[load]
weight = [0.7, -1.0]
flow_force = [0.1, 0.0]
flow_couple = 0.0
centre = [0.0, 0.5]
[contacts]
points = [[-1.0, 0.0], [1.0, 0.0]]
normals = [[0.0, -1.0], [0.0, -1.0]]
"""
FRICTION, TANGENT, PUSH = "contacts.friction=0.0,0.5,1.0", 0.7, 0.1


class Judged:
    """Judges the cases of a refinement, as worker processes do, and keeps their columns."""

    def __init__(self, tolerance: float, *over: str, most: int | None = None):
        request = requested([Source("block", BLOCK)], over, do="judge", refine=tolerance, most=most)
        self.results: dict[str, dict[str, Any]] = {}
        self.cases: list[SweepCase] = []
        following = request.cases()
        refinement = request.refinement(following)
        while following:
            self.cases += following
            self.results |= {case.identity: judged(case) for case in following}
            following = refinement.following(self.results)
        self.lines = "\n".join(refinement.lines())

    def at(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Tangent, friction and whether it rests, of all cases."""
        content = [json.loads(case.text) for case in self.cases]
        slope = np.array([case["load"]["weight"][0] for case in content])
        friction = np.array([case["contacts"]["friction"] for case in content])
        rests = [not self.results[case.identity]["moves"] for case in self.cases]
        return slope, friction, np.array(rests)


def judged(case: SweepCase) -> dict[str, Any]:
    outcome = computed("judge", case.text)
    assert outcome.result is not None, outcome.reason
    return outcome.columns


def test_the_friction_at_which_a_block_rests_is_found_to_the_tolerance() -> None:
    """From t + 0.1 on, for each value of another key; the same cases each time."""
    over = FRICTION, "load.weight=[0.2, -1.0],[0.7, -1.0]"
    actual, again = Judged(0.002, *over), Judged(0.002, *over)
    slope, friction, rests = actual.at()
    for tangent in (0.2, 0.7):
        mine = slope == tangent
        low, high = float(friction[mine & ~rests].max()), float(friction[mine & rests].min())
        assert low <= tangent + PUSH <= high and high - low <= 0.002
        ends = f"moves at contacts.friction={low!r}, rest at contacts.friction={high!r}"
        assert f"{ends} (load.weight=[{tangent}, -1.0])" in actual.lines
    assert len(actual.cases) < 80  # 501 are as near to each other everywhere
    assert [case.identity for case in again.cases] == [case.identity for case in actual.cases]


def test_the_curve_is_straight_between_cases() -> None:
    """S = (friction - t) / 0.1: interpolated, S/(1 + S) is nowhere farther off than the tolerance of its range."""
    friction = np.unique(Judged(0.02, FRICTION).at()[1])
    # The tolerance of the friction says how near cases are at the kink.
    dense = [x for x in np.linspace(0.0, 1.0, 5001) if abs(x - TANGENT) >= 0.02]

    def share(at: Any) -> np.ndarray:
        factor = np.maximum((np.asarray(at) - TANGENT) / PUSH, 0.0)
        return np.asarray(factor / (1.0 + factor))

    missed = np.abs(np.interp(dense, friction, share(friction)) - share(dense))
    assert missed.max() <= 0.02 * 0.75


def test_a_sweep_ends_where_no_worker_process_starts_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As without memory for its libraries; a scheduler of the user's is waited for."""
    monkeypatch.setattr(procedure, "local_client", lambda *_: nullcontext(Mock()))
    monkeypatch.setattr(procedure, "number_of_workers", lambda _: 0)
    monkeypatch.setattr(procedure, "RESTART", 0.1)
    case, file = tmp_path / "block.toml", tmp_path / "sweep.sqlite"
    case.write_text(BLOCK)
    why = "worker processes do not start; free memory for them: 0 of 2 cases are finished"
    with pytest.raises(OutputError, match=why):
        procedure.run(case, file, ["contacts.friction=0,1"], do="judge", wall=10)


def test_ends_of_all_digits_are_the_cases_computed() -> None:
    """Between 0.1234567890123456 and 0.9876543210987654 the block comes to rest at 0.8."""
    actual = Judged(0.05, "contacts.friction=0.1234567890123456,0.9876543210987654")
    _, friction, rests = actual.at()
    assert friction[~rests].max() <= TANGENT + PUSH <= friction[rests].min()
    assert friction[rests].min() - friction[~rests].max() <= 0.05


def test_the_budget_is_kept_and_said() -> None:
    actual = Judged(0.001, FRICTION, most=9)
    assert len(actual.cases) <= 9
    assert "9 cases are spent before the tolerance is reached; raise --most" in actual.lines


@pytest.mark.parametrize(
    ("text", "ends", "setting"),
    [
        ("a.b=log:1:100:3", (1.0, 10.0), "a.b=3.16227766017"),
        ("a.b=lin:1:100:3", (1.0, 50.5), "a.b=25.75"),
        ("a.b=1,100", (1.0, 100.0), "a.b=10"),
        ("a.b=3,2,1", (1.0, 2.0), "a.b=1.5"),
        ("a.b=3,2,1", (3.0, 3.0), "a.b=3"),
    ],
)
def test_between_values_are_equal_ratios_or_differences(
    text: str, ends: tuple[float, float], setting: str
) -> None:
    key, values = refined_key(axes_of(["a.a=1,1.0", text, "a.d=1,2"]))
    refinement = SweepRefinement(key, values, [], Mock(), set(), "x", 0.02, 1000)
    assert refinement.setting(refinement.middle(*ends)) == setting


# Tables of sweeps as frames of pandas, and size classes.


def present(row: dict[str, Any]) -> dict[str, Any]:
    """What a row has: of a frame without NaN."""
    return {name: value for name, value in row.items() if value is not None and value == value}


def test_frames_have_the_rows(tmp_path: Path, monkeypatch: Any) -> None:
    """Of three judged cases, of which one waits and one moves."""
    pytest.importorskip("pandas")
    source, file = Source.of(CASES / "block_on_incline.toml"), tmp_path / "sweep.sqlite"
    cases = requested([source], ["contacts.friction=0.2,0.5,0.6"], do="judge").cases()
    with Store(file, make=True) as store:
        store.add(cases)
        for case in cases[:2]:
            store.finish(case.identity, 1, computed("judge", case.text))
    rows = [*map(present, incipient.sweep.rows(file))]
    assert [row["contacts.friction"] for row in rows] == [0.2, 0.5, 0.6]
    # By hand: (friction cos 20 - sin 20)/0.1, at 0.2 zero.
    assert [row["safety_factor"] for row in rows[:2]] == pytest.approx([0.0, 1.278], abs=1e-3)
    assert [*map(present, incipient.sweep.frame(file).to_dict("records"))] == rows
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingError, match=r"pip install 'incipient\[tables\]'"):
        incipient.sweep.frame(file)


# -- size classes ------------------------------------------------------------------------------------


def grains(path: Path) -> Path:
    """Sizes 1 to 3 whose critical stresses are equal but for 10%: Shields numbers go as 1/D. Some have none."""
    rng = np.random.default_rng(0)
    sizes = rng.uniform(1.0, 3.0, 4000)
    shields = 0.05 / sizes * rng.uniform(0.9, 1.1, 4000)
    shields[::10] = np.inf
    lines = [
        f"{size!r},{value!r}" for size, value in zip(sizes.tolist(), shields.tolist(), strict=True)
    ]
    path.write_text(
        "\n".join(["diameter,shields", *lines, "2.0,"]) + "\n"
    )  # the last carries others
    return path


def test_classes_of_a_table_of_grains(tmp_path: Path, said_by: Any) -> None:
    """Percentiles of 0.05/D within the spread of the class: 10% and its width; a tenth is not moved by any flow."""
    path = grains(tmp_path / "grains.csv")
    actual = list(
        csv.DictReader(io.StringIO(said_by("table", path, "--size-classes", "1,1.1,2,3,5")))
    )
    counts, stuck = (
        np.array([float(row[name]) for row in actual]) for name in ("grains", "without_threshold")
    )
    assert counts.sum() == 4000 and stuck[:3] == pytest.approx(0.1 * counts[:3], rel=0.35)
    first = {name: float(cell) for name, cell in actual[0].items()}
    # Nine tenths have thresholds, so that the median of all is their percentile 50/0.9.
    expected = 0.05 / 1.05 * (0.9 + 0.2 * 0.5 / 0.9)
    assert first["shields_50"] == pytest.approx(expected, rel=0.02)
    assert first["shields_16"] < first["shields_50"] < first["shields_84"] < np.inf
    assert (actual[3]["size_low"], actual[3]["grains"], actual[3]["shields_50"]) == ("3.0", "0", "")
    assert "is not a list of numbers" in said_by("table", path, "--size-classes", "1,x", code=2)


def test_classes_of_a_sweep(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Cases that are done, by the key that varies; three tell a median and no more, one tells no percentile."""
    done = [
        {"status": "done", "body.diameter": d, "shields": 0.1 * d} for d in (1.0, 1.5, 1.8, 2.0)
    ]
    actual = [*done, {"status": "failed", "body.diameter": 1.2}]
    monkeypatch.setattr("incipient.sweep.table.rows", lambda path: actual)
    first, second = size_classes(tmp_path / "sweep.sqlite", [1.0, 2.0, 3.0])
    assert (first["grains"], first["size_median"], second["grains"]) == (3, 1.5, 1)
    assert first["shields_50"] == pytest.approx(0.15) and "shields_84" not in first
    assert not any(name.startswith("shields") for name in second)


@pytest.mark.parametrize(
    ("name", "bounds", "size", "said"),
    [
        ("grains", [2.0, 1.0], None, "2, 1 do not increase"),
        ("grains", [1.0], None, "do not increase"),
        ("grains", [1.0, 2.0], "weight", "has no column weight"),
        ("grains", [10.0, 20.0], None, "has no threshold of a diameter from 10 to 20"),
        ("absent", [1.0, 2.0], None, "cannot be read"),
    ],
)
def test_wrong_classes_are_refused(
    name: str, bounds: list[float], size: str | None, said: str, tmp_path: Path
) -> None:
    grains(tmp_path / "grains.csv")
    assert said in message(lambda: size_classes(tmp_path / f"{name}.csv", bounds, size))
