"""The values that a sweep varies, the identity of its cases, and their table."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import message

from incipient.cli import main
from incipient.flumes.thresholds import soulsby_whitehouse
from incipient.progress import telling
from incipient.scene import Scene, example, load, loads
from incipient.scene.section import unit_of
from incipient.sweep.axes import combined, of_mapping, parsed, table_of_cases
from incipient.sweep.cases import Source, resolved
from incipient.sweep.procedure import Means
from incipient.sweep.request import parsed_seconds, requested
from incipient.sweep.store import Store
from incipient.sweep.worker import CaseOutcome

SOURCE = Source("mine", example())


def test_ranges_hold_both_ends_and_equal_ratios_or_differences() -> None:
    assert parsed("fluid.reynolds=log:0.1:1000:5").values == (
        "0.1",
        "1.0",
        "10.0",
        "100.0",
        "1000.0",
    )
    assert parsed("contact.friction=lin:0.2:0.6:3").values == ("0.2", "0.4", "0.6")
    assert parsed('a.b=1,[2, 3],"x, y",log:1:4:2').values == ("1", "[2, 3]", '"x, y"', "1.0", "4.0")


def test_axes_of_python_and_toml_are_those_of_the_command_line() -> None:
    nested = {
        "fluid": {"reynolds": "log:1:100:3"},
        "bed.offset": [[0.0, 1.0]],
        "flow.kind": ["shear"],
    }
    assert of_mapping(nested) == [
        parsed("fluid.reynolds=1.0,10.0,100.0"),
        parsed("bed.offset=[0.0, 1.0]"),
        parsed("flow.kind=shear"),
    ]
    assert of_mapping({"body.diameter": np.array([0.5, 1.0])}) == [parsed("body.diameter=0.5,1.0")]


def test_cases_are_combinations_or_pairs_for_each_row_of_a_table(tmp_path: Path) -> None:
    axes = [parsed("a.x=1,2"), parsed("a.y=3,4")]
    assert combined(axes, False) == [
        ("a.x=1", "a.y=3"),
        ("a.x=1", "a.y=4"),
        ("a.x=2", "a.y=3"),
        ("a.x=2", "a.y=4"),
    ]
    assert combined(axes, True) == [("a.x=1", "a.y=3"), ("a.x=2", "a.y=4")]
    path = tmp_path / "cases.csv"
    path.write_text('b.x,b.y\n1,"[2, 3]"\n4,\n')
    listed = table_of_cases(path)
    assert listed == [("b.x=1", "b.y=[2, 3]"), ("b.x=4",)]
    assert combined(axes[:1], False, listed)[-1] == ("b.x=4", "a.x=2")


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
    assert said in message(lambda: parsed(axis))


def test_wrong_requests_are_refused(tmp_path: Path) -> None:
    pair = [parsed("a.x=1,2"), parsed("a.y=3")]
    assert "a.x 2, a.y 1" in message(lambda: combined(pair, True))
    assert "given twice" in message(lambda: combined(pair[:1] * 2, False))
    assert "nothing is varied" in message(lambda: requested([SOURCE]))
    many = [parsed(f"a.x{n}=lin:0:1:1000") for n in range(3)]
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
        lambda: combined(pair[:1], False, table_of_cases(ragged))
    )
    assert "cannot be read" in message(lambda: table_of_cases(tmp_path / "absent.csv"))
    wrong = requested([SOURCE], [parsed("fluid.reynolds=1,-1")])
    assert "case 2 of 2 (fluid.reynolds=-1): --set fluid.reynolds=-1" in message(wrong.cases)
    assert "is not a time" in message(lambda: parsed_seconds("soon", "wall"))


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
    [("8h", 28800.0), ("1h30m", 5400.0), ("90", 90.0), ("1.5d", 129600.0), ("2m5s", 125.0)],
)
def test_times_are_read(text: str, time: float) -> None:
    assert parsed_seconds(text, "wall") == time


def test_the_section_of_a_scene_says_what_is_varied(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        example() + '\n[sweep]\ndo = "threshold"\n[sweep.over]\nfluid.reynolds = "log:1:4:2"\n'
    )
    request = requested([Source.of(path)])
    assert (request.task, request.over) == ("threshold", (parsed("fluid.reynolds=1.0,4.0"),))
    assert load(path).fluid.reynolds == 20.0  # others pass it by
    assert (
        requested([Source.of(path)], [parsed("body.diameter=1,2")]).over[0].key == "body.diameter"
    )
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
        parsed("body.diameter=0.5,10"),
        parsed("bed.kind=flat"),
        parsed("contact.friction=0.25"),
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
