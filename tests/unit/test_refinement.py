"""Cases that a sweep adds: on the boundary of analytical solutions, within the budget, the same ones each time."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import message

import incipient.sweep
from incipient import cli
from incipient.sweep.axes import parsed
from incipient.sweep.cases import Source, SweepCase
from incipient.sweep.refinement import SweepRefinement, direction
from incipient.sweep.request import requested
from incipient.sweep.worker import computed

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
            [parsed(one) for one in over],
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
    def middle(text: str) -> str:
        return direction([parsed(text)], False)[0].settings(0.5)[0]

    assert middle("a.b=log:1:100:3") == "a.b=3.16227766017"
    assert middle("a.b=lin:1:100:3") == "a.b=25.75"
    assert middle("a.b=1,100") == "a.b=10.0"
    assert middle("a.b=3,2,1") == "a.b=1.5"
    assert middle("a.b=[0, 1],[1, 3]") == "a.b=[0.5, 2.0]"
    together, others = direction([parsed("a.b=1,2"), parsed("a.c=9,5")], True)
    assert together.settings(0.25) == ("a.b=1.25", "a.c=8.0") and not others
    first, others = direction([parsed("a.b=1,1.0"), parsed("a.c=1,2"), parsed("a.d=1,2")], False)
    assert first.settings(1.0) == ("a.c=2",) and [axis.key for axis in others] == ["a.b", "a.d"]


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
        axes = [parsed(one) for one in over]
        requested([Source("mine", BLOCK)], axes, together, task="judge", **refined).refinement([])

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
