"""Sweeps: cases, store, refinement and tables."""

from __future__ import annotations

import csv
import io
import json
import math
import random
import sqlite3
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import message

import incipient.sweep
from incipient import cli
from incipient.cli import main
from incipient.errors import OutputError
from incipient.flumes.thresholds import soulsby_whitehouse
from incipient.progress import telling
from incipient.scene import Scene, example, load, loads
from incipient.scene.section import unit_of
from incipient.sweep.cases import Source, SweepCase, axes_of, combined, resolved, table_of_cases
from incipient.sweep.procedure import Means
from incipient.sweep.refinement import SweepRefinement, direction
from incipient.sweep.request import parsed_seconds, requested
from incipient.sweep.store import DONE, FAILED, WAITING, Store
from incipient.sweep.table import as_csv, in_words, pockets, rows, size_classes
from incipient.sweep.worker import CaseOutcome, computed

# The values that a sweep varies, the identity of its cases, and their table.


SOURCE = Source("mine", example())


def test_ranges_hold_both_ends_and_equal_ratios_or_differences() -> None:
    assert axes_of(
        [
            "fluid.reynolds=log:0.1:1000:5",
            "contact.friction=lin:0.2:0.6:3",
            'a.b=1,[2, 3],"x, y",log:1:4:2',
        ]
    ) == {
        "fluid.reynolds": ("0.1", "1.0", "10.0", "100.0", "1000.0"),
        "contact.friction": ("0.2", "0.4", "0.6"),
        "a.b": ("1", "[2, 3]", '"x, y"', "1.0", "4.0"),
    }


def test_axes_of_python_and_toml_are_those_of_the_command_line() -> None:
    nested = {
        "fluid": {"reynolds": "log:1:100:3"},
        "bed.offset": [[0.0, 1.0]],
        "flow.kind": ["shear"],
        "body.diameter": np.array([0.5, 1.0]),
        "contact.friction": 0.5,
    }
    listed = ["fluid.reynolds=1.0,10.0,100.0", "bed.offset=[0.0, 1.0]", "flow.kind=shear"]
    assert axes_of(nested) == axes_of([*listed, "body.diameter=0.5,1.0", "contact.friction=0.5"])
    assert "over body.x: has no values" in message(lambda: axes_of({"body.x": []}))


def test_cases_are_combinations_or_pairs_for_each_row_of_a_table(tmp_path: Path) -> None:
    axes = axes_of(["a.x=1,2", "a.y=3,4"])
    assert combined(axes, False) == [
        ("a.x=1", "a.y=3"),
        ("a.x=1", "a.y=4"),
        ("a.x=2", "a.y=3"),
        ("a.x=2", "a.y=4"),
    ]
    assert combined(axes, True) == [("a.x=1", "a.y=3"), ("a.x=2", "a.y=4")]
    # Lists of different lengths, as polygons are, and one value by itself.
    assert axes_of({"a": {"x": [[[0, 1]], [[1, 2], [3, 4]]], "y": 2.5}}) == {
        "a.x": ("[[0, 1]]", "[[1, 2], [3, 4]]"),
        "a.y": ("2.5",),
    }
    path = tmp_path / "cases.csv"
    path.write_text('b.x,b.y\n1,"[2, 3]"\n4,\n')
    listed = table_of_cases(path)
    assert listed == [("b.x=1", "b.y=[2, 3]"), ("b.x=4",)]
    assert combined(axes_of(["a.x=1,2"]), False, listed)[-1] == ("b.x=4", "a.x=2")


@pytest.mark.parametrize(
    ("axis", "said"),
    [
        ("fluid.reynolds", "is not a key with values"),
        ("fluid.reynolds=", "is not a key with values"),
        ("fluid.reynolds=log:0:1:3", "ends above zero"),
        ("fluid.reynolds=log:1:x:3", "is not a range of numbers"),
        ("fluid.reynolds=lin:0:1:0", "gives 0 values"),
        ("fluid.reynolds=lin:1:nan:5", "1 to nan are not finite numbers"),
        ("fluid.reynolds=log:1:inf:5", "1 to inf are not finite numbers"),
        ("fluid.reynolds=1,,2", "has an empty value"),
    ],
)
def test_wrong_axes_are_refused(axis: str, said: str) -> None:
    assert said in message(lambda: axes_of([axis]))


def test_wrong_requests_are_refused(tmp_path: Path) -> None:
    pair = axes_of(["a.x=1,2", "a.y=3"])
    assert "a.x 2, a.y 1" in message(lambda: combined(pair, True))
    assert "given twice" in message(lambda: axes_of(["a.x=1,2"] * 2))
    assert "nothing is varied" in message(lambda: requested([SOURCE]))
    many = axes_of([f"a.x{n}=lin:0:1:1000" for n in range(3)])
    assert "at most 100000" in message(lambda: combined(many, False))
    ragged = tmp_path / "cases.csv"
    ragged.write_text("a.x,a.y\n1\n")
    assert "row 2 has a different number of cells" in message(lambda: table_of_cases(ragged))
    ragged.write_text("a.x,a.x\n1,2\n")
    assert "has two columns a.x; remove one of them" in message(lambda: table_of_cases(ragged))
    ragged.write_text("a.x,,\n1,,\n")  # empty columns, as spreadsheets write them
    assert table_of_cases(ragged) == [("a.x=1",)]
    ragged.write_text("a.x,a.y\n1,2\n")
    assert "--over a.x: the table of cases has it as well" in message(
        lambda: combined(pair, False, table_of_cases(ragged))
    )
    assert "cannot be read" in message(lambda: table_of_cases(tmp_path / "absent.csv"))
    wrong = requested([SOURCE], ["fluid.reynolds=1,-1"])
    assert "case 2 of 2 (fluid.reynolds=-1): --set fluid.reynolds=-1" in message(wrong.cases)
    for text in ("soon", "h", "1h and 5", "-1h"):
        assert "is not a time" in message(lambda text=text: parsed_seconds(text, "wall"))


def test_means_that_are_no_positive_numbers_are_refused() -> None:
    assert "--memory nan: is not above zero" in message(lambda: Means(memory_mib=float("nan")))
    assert "--memory 60: the libraries of a worker process take" in message(
        lambda: Means(memory_mib=60)
    )
    assert "--jobs 0: is not above zero" in message(lambda: Means(jobs=0))
    assert "--tries 0: is not above zero" in message(lambda: Means(tries=0))
    remedy = "are started by you; give --nworkers to its `dask worker` instead"
    assert remedy in message(lambda: Means(scheduler="tcp://here:1", jobs=2))


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
    assert (request.task, request.over) == ("threshold", {"fluid.reynolds": ("1.0", "4.0")})
    assert load(path).fluid.reynolds == 20.0  # others pass it by
    assert [*requested([Source.of(path)], ["body.diameter=1,2"]).over] == ["body.diameter"]
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
    tmp_path: Path, capsys: Any
) -> None:
    """Of each key the unit that `incipient new` writes beside it."""
    axes = [
        "body.diameter=0.5,10",
        "bed.kind=flat",
        "contact.friction=0.25",
    ]
    request, file = requested([SOURCE], axes), tmp_path / "sweep.sqlite"
    cases = request.cases()
    with Store(file, make=True) as store:
        store.add(cases)
        outcome = CaseOutcome(json.dumps({"verdict": None}), wall=2.5)
        store.finish([(cases[0].identity, 1, outcome)])
    assert main(["table", str(file)]) == 0
    head, first, second = capsys.readouterr().out.splitlines()
    places = [head.index(word) + len(word) for word in ("body.diameter [length]", "time [s]")]
    assert first[: places[0]].endswith("  0.5") and second[: places[0]].endswith("   10")
    assert (
        first[: places[1]].endswith("  2.5")
        and "bed.kind " in head
        and "contact.friction [-]" in head
    )
    assert (
        unit_of(Scene, "gravity.acceleration") == "length/time^2"
        and unit_of(Scene, "no.such") == ""
    )


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


CASES = [
    SweepCase(f"case{n}", "judge", "made", (f"a.x={n}",), json.dumps({"a": {"x": n}}))
    for n in range(40)
]


def outcome(drag: float) -> CaseOutcome:
    result = json.dumps({"verdict": None, "coefficients": {"drag": drag}, "text": "x" * 3000})
    return CaseOutcome(result, {"drag": drag, "held": True}, wall=1.5, versions={"incipient": "1"})


def filled(path: Path, count: int = 40) -> list[dict[str, Any]]:
    """A file of cases of which `count` are done, and its table."""
    with Store(path, make=True) as store:
        store.add(CASES)
        store.finish([(case.identity, 1, outcome(n)) for n, case in enumerate(CASES[:count])])
        store.write_view()
    return rows(path)


def changed(path: Path, statement: str) -> list[Any]:
    with sqlite3.connect(path) as base:
        found = base.execute(statement).fetchall()
    base.close()
    return found


def test_cases_wait_are_finished_and_wait_again_after_a_failure(tmp_path: Path) -> None:
    path = tmp_path / "sweep.sqlite"
    with Store(path, make=True) as store:
        store.add(CASES[:3])
        store.finish([("case0", 1, outcome(2.0)), ("case1", 3, CaseOutcome(reason="too heavy"))])
        store.add(CASES[:4])
        states = {"case0": DONE, "case1": FAILED, "case2": WAITING, "case3": WAITING}
        assert store.states() == states and store.keys() == ["a.x"]
        assert store.columns(states) == {"case0": {"drag": 2.0, "held": True}}
        store.add(CASES[:2], retry=True)
        assert store.states() == states | {"case1": WAITING}
    first, second, *_ = rows(path)
    assert (first["a.x"], first["drag"], first["versions"]) == (0, 2.0, "incipient 1")
    assert (second["tries"], second["reason"], "drag" in second) == (3, "", False)


def test_the_view_has_varied_keys_and_quantities_infinite_ones_too(tmp_path: Path) -> None:
    path, odd = tmp_path / "sweep.sqlite", SweepCase("odd", "run", "s", ("b.0=1",), '{"b": [7]}')
    with Store(path, make=True) as store:
        store.add([*CASES[:2], odd])
        store.finish([("case1", 1, CaseOutcome("{}", {"shields": math.inf}))])
        store.finish([("odd", 1, CaseOutcome("{}", {"shields": 0.5}))])
        store.write_view()
    query = 'SELECT "a.x", "b.0", shields, status FROM results'
    expected = [(0, None, None, WAITING), (1, None, math.inf, DONE)]
    assert changed(path, query) == [*expected, (None, 7, 0.5, DONE)]
    assert rows(path)[1]["shields"] == math.inf


def test_files_of_others_and_of_other_versions_are_refused(tmp_path: Path) -> None:
    text, other, old = (tmp_path / f"{name}.sqlite" for name in ("text", "other", "old"))
    text.write_text("not a database, but long enough to have the head of one\n" * 20)
    changed(other, "CREATE TABLE things (id TEXT)")
    filled(old, 0)
    changed(old, "PRAGMA user_version = 4")
    for path, words in (
        (text, "is not the file of a sweep"),
        (other, "is not the file of a sweep"),
        (old, "is the file of a sweep by another version of incipient; give another name"),
    ):
        with pytest.raises(OutputError, match=words):
            Store(path, make=True)
    with pytest.raises(OutputError, match="no such file"):
        Store(tmp_path / "absent.sqlite")


def test_a_second_writer_is_refused_and_readers_are_not(tmp_path: Path) -> None:
    path = tmp_path / "sweep.sqlite"
    filled(path, 1)
    with Store(path, make=True) as store:
        with pytest.raises(OutputError, match="another sweep writes to it; wait"):
            Store(path, make=True)
        assert len(rows(path)) == 40
        store.finish([("case1", 1, outcome(1.0))])
    with Store(path, make=True) as store:
        assert store.states()["case1"] == DONE


def test_random_bytes_give_one_line_or_a_table(tmp_path: Path) -> None:
    """Bytes at random places, as of a bad disk, in 200 files: no other error."""
    path, broken = tmp_path / "whole.sqlite", tmp_path / "broken.sqlite"
    filled(path)
    content, refused = path.read_bytes(), 0
    for seed in range(200):
        chance, damaged = random.Random(seed), bytearray(content)
        for place in (chance.randrange(len(content)) for _ in range(chance.choice((1, 20, 200)))):
            damaged[place] = chance.randrange(256)
        broken.write_bytes(damaged)
        try:
            table = rows(broken)
            as_csv(table), [in_words(row) for row in table]
        except OutputError as error:
            assert len(str(error)) < 400 and "\n" not in str(error)
            refused += 1
    assert refused > 40


def test_the_table_prints_the_first_cases_and_counts_all(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("incipient.commands.sweep.FIRST", 30)
    path = tmp_path / "sweep.sqlite"
    filled(path, 38)
    assert main(["table", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 32
    assert lines[-1].startswith("40 cases: 38 done, 2 waiting; the first 30 are shown")


def at_rest(slope: float, *centre: float, **columns: float) -> dict[str, Any]:
    """The row of a grain of size 20 on a bed with a slope."""
    axes = {f"centre_{axis}": x for axis, x in zip("xyz", centre, strict=True) if x}
    return {"bed.slope": slope, "fluid.reynolds": 1.0, "grain_size": 20.0, **axes, **columns}


@pytest.mark.parametrize(
    ("second", "line"),
    [
        (at_rest(5.0, 60.0, 0.0, 9.0), None),
        (at_rest(5.0, 60.1, 0.0, 9.0), None),  # half a percent of its size
        (at_rest(5.0, 62.0, 0.0, 9.0), "(0.1 of its size apart, 0 degrees turned)"),
        # In place, but turned by 0.1 rad about y: 5% of its size on its surface; in 2-D by an angle.
        (at_rest(5.0, 60.0, 0.0, 9.0, rotation_y=0.1), "(0 of its size apart, 5.7 degrees turned)"),
        (at_rest(5.0, 60.0, 0.0, 9.0, rotation=-0.1), "(0 of its size apart, 5.7 degrees turned)"),
        (at_rest(5.0, 62.0, 0.0, 9.0) | {"fluid.reynolds": 2.0}, None),  # no neighbour
        ({"bed.slope": 5.0, "fluid.reynolds": 1.0}, None),  # failed
    ],
)
def test_neighbours_that_rest_elsewhere_are_named(second: dict[str, Any], line: str | None) -> None:
    lines = pockets([second, at_rest(0.0, 60.0, 0.0, 9.0)], ["bed.slope", "fluid.reynolds"])
    assert len(lines) == (line is not None)
    if line is not None:
        assert lines[0].startswith(
            "bed.slope = 0 and 5: the grain rests on other points of the bed"
        )
        assert line in lines[0] and 'body.settle = "level"' in lines[0]


def test_a_grain_moved_by_its_own_section_is_not_named() -> None:
    table = [at_rest(0.0, x, 0.0, 9.0) | {"body.x": x} for x in (60.0, 70.0)]
    assert pockets(table, ["body.x"]) == []


# Cases that a sweep adds: on the boundary of analytical solutions, within the budget, the same ones each time.


# A block on a slope of tangent t, with its weight turned instead: its force along the slope is t + 0.1 with the flow's.
# It slides where that is above friction, and tips over its lower edge where it is above width over height, 0.5.
BLOCK = """
[load]
weight = [0.0, -1.0]
flow_force = [0.1, 0.0]
flow_couple = 0.0
centre = [0.0, 0.5]
[contacts]
points = [[-0.25, 0.0], [0.25, 0.0]]
normals = [[0.0, -1.0], [0.0, -1.0]]
friction = 0.3
"""
SLOPE = "load.weight=[0.0, -1.0],[0.5, -1.0],[1.0, -1.0]"
PUSH = 0.1


class Judged:
    """Judges the cases of a refinement, as worker processes do, and keeps their columns."""

    def __init__(self, tolerance: float, *over: str, most: int | None = None):
        request = requested(
            [Source("block", BLOCK)],
            over,
            task="judge",
            refine=tolerance,
            most=most,
        )
        self.results: dict[str, dict[str, Any]] = {}
        self.cases: list[SweepCase] = []
        following = request.cases()
        found = request.refinement(following)
        assert isinstance(found, SweepRefinement)
        self.refinement = found
        while following:
            self.cases += following
            self.results |= {case.identity: judged(case) for case in following}
            following = found.following(self.results)

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


def test_the_slope_at_which_a_block_slides_is_found_to_the_tolerance() -> None:
    """It slides from t = 0.3 - 0.1 on."""
    found = Judged(0.002, SLOPE)
    slope, _, rests = found.at()
    low, high = float(slope[rests].max()), float(slope[~rests].min())
    assert low <= 0.3 - PUSH <= high and high - low <= 0.002
    assert (
        f"rest at load.weight=[{low!r}, -1.0], moves at load.weight=[{high!r}, -1.0]"
        in "\n".join(found.refinement.lines())
    )
    assert len(found.cases) < 40  # 501 are as near to each other everywhere
    again = Judged(0.002, SLOPE)
    assert [case.identity for case in again.cases] == [case.identity for case in found.cases]


def test_the_curve_is_straight_between_cases() -> None:
    """S = (friction - t) / 0.1: interpolated, S/(1 + S) is nowhere farther off than the tolerance of its range."""
    found = Judged(0.02, SLOPE)
    slope, _, _ = found.at()
    slope = np.unique(slope)
    dense = np.linspace(0.0, 1.0, 5001)

    def share(t: np.ndarray) -> np.ndarray:
        factor = np.maximum((0.3 - t) / PUSH, 0.0)
        return np.asarray(factor / (1.0 + factor))

    missed = np.abs(np.interp(dense, slope, share(slope)) - share(dense))
    kinks = (dense > 0.3 - 0.02) & (
        dense < 0.3 + 0.02
    )  # where the tolerance of the slope says how near cases are
    assert missed[~kinks].max() <= 0.02 * 0.75


def test_the_boundary_over_a_second_key_is_found_for_each_of_its_values() -> None:
    """It rests where t + 0.1 <= min(friction, 0.5)."""
    found = Judged(1.0 / 64.0, SLOPE, "contacts.friction=0.15,0.4,0.7")
    slope, friction, rests = found.at()
    for one in (0.15, 0.4, 0.7):
        edge, mine = min(one, 0.5) - PUSH, friction == one
        low, high = slope[mine & rests].max(), slope[mine & ~rests].min()
        assert low <= edge + 1e-9 and edge <= high and high - low <= 1.0 / 64.0


def test_what_is_no_number_makes_families_refined_by_themselves() -> None:
    one, two = Judged(0.05, SLOPE), Judged(0.05, SLOPE, "contacts.convex=true,false")
    assert len(two.cases) == 2 * len(one.cases)
    changes = [line for line in two.refinement.lines() if "rest at" in line]
    assert len(changes) == 2 and sum("contacts.convex=false" in line for line in changes) == 1


def test_the_budget_is_kept_and_said() -> None:
    found = Judged(0.001, SLOPE, most=9)
    assert len(found.cases) <= 9
    assert "9 cases are spent before the tolerance is reached" in "\n".join(
        found.refinement.lines()
    )


@pytest.mark.slow
def test_a_sweep_goes_on_to_the_same_cases(tmp_path: Path, capfd: Any) -> None:
    """In two parts, by processes, what is judged here at once."""
    scene, file = tmp_path / "block.toml", tmp_path / "sweep.sqlite"
    scene.write_text(
        BLOCK
        + '[sweep]\ndo = "judge"\nrefine = 0.05\n[sweep.over]\nload.weight = [[0, -1], [1, -1]]\n'
    )
    assert cli.main(["sweep", str(scene), "--out", str(file), "--jobs", "1", "--most", "5"]) == 0
    assert "raise --most" in capfd.readouterr().out
    assert incipient.sweep.run(scene, file, jobs=1).known == 5
    whole = Judged(0.05, "load.weight=[0, -1],[1, -1]")
    factors = {name: columns["safety_factor"] for name, columns in whole.results.items()}
    assert {row["id"]: row["safety_factor"] for row in incipient.sweep.rows(file)} == factors


def test_between_values_are_equal_ratios_or_differences() -> None:
    def between(text: str, position: float) -> str:
        return direction(axes_of([text]), False)[0].settings(position)[0]

    assert between("a.b=log:1:100:3", 0.25) == "a.b=3.16227766017"
    assert between("a.b=lin:1:100:3", 0.25) == "a.b=25.75"
    assert between("a.b=1,100", 0.5) == "a.b=10.0"
    assert between("a.b=3,2,1", 0.25) == "a.b=1.5"
    assert between("a.b=[0, 1],[1, 3]", 0.5) == "a.b=[0.5, 2.0]"
    together, others = direction(axes_of(["a.b=1,2", "a.c=9,5"]), True)
    assert together.settings(0.25) == ("a.b=1.25", "a.c=8.0") and not others
    first, others = direction(axes_of(["a.b=1,1.0", "a.c=1,2", "a.d=1,2"]), False)
    assert first.settings(1.0) == ("a.c=2",) and [*others] == ["a.b", "a.d"]


@pytest.mark.parametrize(
    ("over", "together", "refined", "said"),
    [
        (["a.b=x,y"], False, {"refine": True}, "no key is varied over numbers"),
        (["a.b=1,2", "a.c=x,y"], True, {"refine": True}, "a.c is varied with other keys"),
        (["a.b=1,2"], False, {"refine": 2.0}, "--refine 2: is not a fraction of the range"),
        (["a.b=1,2"], False, {"refine": True, "most": 0}, "--most 0: is not a number of cases"),
        (["a.b=1,2"], False, {"most": 5}, "--most: applies to a refinement"),
    ],
)
def test_wrong_refinements_are_refused(
    over: Sequence[str], together: bool, refined: dict[str, Any], said: str
) -> None:
    def refused() -> None:
        requested([Source("mine", BLOCK)], over, together, task="judge", **refined).refinement([])

    assert said in message(refused)


def test_a_refinement_without_anything_that_changes_is_refused(tmp_path: Path, capsys: Any) -> None:
    """A channel without a grain has no safety factor, and begins to move in no mode."""
    scene = tmp_path / "channel.toml"
    scene.write_text(
        "[domain]\nlength = 4.0\nheight = 1.0\n[fluid]\nreynolds = 10.0\nscale = 'flow'\n[flow]\nkind = 'poiseuille'\n"
        "[numerics]\nmesh_size = 4.0\nerror_bars = false\n[output]\nfields = false\n"
    )
    order = [
        "sweep",
        str(scene),
        "--out",
        str(tmp_path / "x.sqlite"),
        "--jobs",
        "1",
        "--refine",
        "0.1",
    ]
    assert cli.main([*order, "--over", "fluid.reynolds=10,20"]) == 2
    assert (
        "--quantity safety_factor: no case has this column; available:" in capsys.readouterr().err
    )


def test_wrong_sections_and_columns_are_refused(tmp_path: Path, capsys: Any) -> None:
    scene = tmp_path / "block.toml"
    order = ["sweep", str(scene), "--out", str(tmp_path / "x.sqlite"), "--jobs", "1"]
    head = '[sweep]\ndo = "judge"\n'
    for extra, said in (
        ('refine = "much"\n', 'sweep.refine: is "much"'),
        ("refine = true\nmost = 1.5\n", "sweep.most: is 1.5; give a whole number"),
        (
            'refine = true\nquantity = "colour"\n',
            "--quantity colour: no case has this column; available: mode",
        ),
    ):
        scene.write_text(BLOCK + head + extra + "[sweep.over]\ncontacts.friction = [0.1, 0.2]\n")
        assert cli.main(order) == 2
        complaint = capsys.readouterr().err
        assert said in complaint and complaint.count("incipient: ") == 1


# Tables of sweeps as frames of pandas and Parquet files, series of loads from these, and size classes.


CASES_OF_TABLES = Path(__file__).parents[2] / "demos" / "cases"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A sweep of three judged cases, of which one waits and one moves."""
    source = Source.of(CASES_OF_TABLES / "block_on_incline.toml")
    axes = ["contacts.friction=0.2,0.5,0.6"]
    cases = requested([source], axes, task="judge").cases()
    with Store(tmp_path / "sweep.sqlite", make=True) as store:
        store.add(cases)
        store.finish([(case.identity, 1, computed("judge", case.text)) for case in cases[:2]])
    return tmp_path / "sweep.sqlite"


def assert_same(one: list[dict[str, Any]], other: list[dict[str, Any]]) -> None:
    """The same numbers and words; what a case does not have is missing, not a number or none."""
    assert len(one) == len(other)
    for mine, theirs in zip(one, other, strict=True):
        for name in {*mine, *theirs}:
            a, b = mine.get(name), theirs.get(name)
            none = [
                value is None or (isinstance(value, float) and math.isnan(value))
                for value in (a, b)
            ]
            assert all(none) or (a == b and not any(none)), name


def test_a_frame_has_the_rows(file: Path) -> None:
    pytest.importorskip("pandas")
    frame, rows = incipient.sweep.frame(file), incipient.sweep.rows(file)
    assert frame["contacts.friction"].tolist() == [0.2, 0.5, 0.6]
    assert frame["status"].tolist() == ["done", "done", "waiting"]
    # By hand: (friction cos 20 - sin 20)/0.1, at 0.2 zero.
    assert frame["safety_factor"].tolist()[:2] == pytest.approx([0.0, 1.278], abs=1e-3)
    assert_same(frame.to_dict("records"), rows)


def test_parquet_has_the_rows(file: Path, tmp_path: Path, capsys: Any) -> None:
    pytest.importorskip("pandas")
    parquet = pytest.importorskip("pyarrow.parquet")
    target = tmp_path / "table.parquet"
    assert cli.main(["table", str(file), "--parquet", str(target)]) == 0
    assert capsys.readouterr().out.strip() == str(target)
    assert_same(parquet.read_table(target).to_pylist(), incipient.sweep.rows(file))
    assert cli.main(["table", str(file), "--parquet", str(tmp_path / "absent" / "x.parquet")]) == 5
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("name", ["pandas", "pyarrow"])
def test_what_is_not_installed_is_said(
    name: str, file: Path, tmp_path: Path, monkeypatch: Any, capsys: Any
) -> None:
    monkeypatch.setitem(__import__("sys").modules, name, None)
    code = cli.main(["table", str(file), "--parquet", str(tmp_path / "table.parquet")])
    complaint = capsys.readouterr().err
    assert (
        code == 6 and complaint.count("\n") == 1 and "pip install 'incipient[tables]'" in complaint
    )


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


def test_classes_of_a_table_of_grains(tmp_path: Path) -> None:
    """Percentiles of 0.05/D within the spread of the class: 10% and its width; a tenth is not moved by any flow."""
    found = size_classes(grains(tmp_path / "grains.csv"), [1.0, 1.1, 2.0, 3.0, 5.0])
    assert sum(one["grains"] for one in found) == 4000
    assert [one["without_threshold"] for one in found][:3] == pytest.approx(
        [0.1 * one["grains"] for one in found][:3], rel=0.35
    )
    first = found[0]
    # Nine tenths have thresholds, so that the median of all is their percentile 50/0.9.
    expected = 0.05 / 1.05 * (0.9 + 0.2 * 0.5 / 0.9)
    assert first["shields_50"] == pytest.approx(expected, rel=0.02)
    assert first["shields_16"] < first["shields_50"] < first["shields_84"] < np.inf
    assert found[3] == {"size_low": 3.0, "size_high": 5.0, "grains": 0, "without_threshold": 0}


def test_the_command_prints_csv(tmp_path: Path, capsys: Any) -> None:
    path = grains(tmp_path / "grains.csv")
    assert cli.main(["table", str(path), "--size-classes", "1,2,3"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [row["size_low"] for row in rows] == ["1.0", "2.0"]
    assert float(rows[0]["shields_50"]) > float(rows[1]["shields_50"]) > 0.0
    assert cli.main(["table", str(path), "--size-classes", "1,x"]) == 2
    assert "is not a list of numbers" in capsys.readouterr().err


def test_classes_of_a_sweep(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Cases that are done, by the key that varies; three tell a median and no more, one tells no percentile."""
    sizes = (1.0, 1.5, 1.8, 2.0)
    done = [{"status": "done", "body.diameter": size, "shields": 0.1 * size} for size in sizes]
    found = [*done, {"status": "failed", "body.diameter": 1.2}]
    monkeypatch.setattr("incipient.sweep.table.rows", lambda path: found)
    first, second = size_classes(tmp_path / "sweep.sqlite", [1.0, 2.0, 3.0])
    assert (first["grains"], first["size_median"]) == (3, 1.5)
    assert first["shields_50"] == pytest.approx(0.15)
    assert "shields_84" not in first
    assert second["grains"] == 1 and not any(name.startswith("shields") for name in second)


@pytest.mark.parametrize(
    ("bounds", "size", "said"),
    [
        ([2.0, 1.0], None, "2, 1 do not increase"),
        ([1.0], None, "do not increase"),
        ([1.0, 2.0], "weight", "has no column weight"),
        ([10.0, 20.0], None, "has no threshold of a diameter from 10 to 20"),
    ],
)
def test_what_is_wrong_is_said(
    bounds: list[float], size: str | None, said: str, tmp_path: Path
) -> None:
    path = grains(tmp_path / "grains.csv")
    assert said in message(lambda: size_classes(path, bounds, size))
    assert "cannot be read" in message(lambda: size_classes(tmp_path / "absent.csv", [1.0, 2.0]))
