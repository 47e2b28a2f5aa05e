"""The order of the velocity that is chosen where a scene leaves it open."""

from pathlib import Path
from typing import Any

import pytest
from scenes import BOX, FLOW_SCALE, scene

from incipient.accuracy.coarse_runs import changed, comparisons
from incipient.effects.plan import make_plan
from incipient.planning.flow_setup import has_inertia, order_of
from incipient.scene import Disc, Domain, Effects, Fluid, Lid, Numerics, Scene, Sphere, Time, load
from incipient.scene.example import grain_in_pocket, grain_on_bed
from incipient.scene.file import dumps, loads

DEMOS = Path(__file__).parents[2] / "demos" / "scenes"
AT = {"diameter": 1.0, "centre": (4.0, 3.0), "density": 2.0}
IN_TIME = {"time": Time(end=1.0, step=0.1)}
IN_SPACE = {"domain": Domain(length=12, width=6, height=6), "bed": None}
BALL = Sphere(diameter=1.0, centre=(4.0, 3.0, 3.0))
COURSE = ("0.1*cos(t)", "0", "0")
CASES: list[tuple[dict[str, Any], int]] = [
    ({}, 3),
    (IN_TIME, 3),
    ({"body": Disc(**AT), "bed": None}, 3),
    ({"domain": BOX, "fluid": FLOW_SCALE, "flow": Lid(), "body": None, "bed": None}, 3),
    ({**IN_TIME, "bed": None, "body": Disc(**AT, motion="free")}, 2),
    ({**IN_TIME, "bed": None, "body": Disc(**AT, motion="prescribed", course=COURSE)}, 2),
    ({**IN_SPACE, "body": BALL}, 2),
    ({**IN_SPACE, "body": BALL, "fluid": Fluid(reynolds=1.0, scale="grain", inertia=False)}, 3),
    ({**IN_SPACE, "body": BALL, "effects": Effects(inertia=False)}, 3),
    # Left to the plan, which finds inertia negligible: Oseen's 3/16 Re is below a thousandth.
    ({**IN_SPACE, "body": BALL, "fluid": Fluid(reynolds=1e-4, scale="grain")}, 3),
]


@pytest.mark.parametrize(("changes", "order"), CASES)
def test_what_is_chosen_and_why(changes: dict[str, Any], order: int) -> None:
    """As measured (docs/contribute/defaults.md): three in 2-D where nothing moves, and in creeping flow in 3-D."""
    made = scene(**changes)
    plan = make_plan(made)
    assert (order_of(made).number, plan.order) == (order, order)
    told = [
        line
        for line in plan.text().splitlines()
        if line.startswith(f"  velocity of order {order}: ")
    ]
    assert len(told) == 1 and told[0].endswith(plan.why_order) and plan.why_order
    assert f"  P{order}-P{order - 1} Taylor-Hood" in plan.text()


def test_highest_order_of_a_refinement_follows_the_plan() -> None:
    """Not the key: inertia left out by the plan, or by the scene in either section, leaves the mesh the same choice."""
    slow, fast = (
        scene(**IN_SPACE, body=BALL, fluid=Fluid(reynolds=value, scale="grain"))
        for value in (1e-4, 1.0)
    )
    without = scene(**IN_SPACE, body=BALL, effects=Effects(inertia=False))
    assert [has_inertia(one) for one in (slow, fast, without)] == [False, True, False]


@pytest.mark.parametrize(("changes", "_"), CASES)
@pytest.mark.parametrize("asked", [2, 3, 4])
def test_what_is_asked_for_is_taken(changes: dict[str, Any], _: int, asked: int) -> None:
    made = scene(**changes, numerics=Numerics(order=asked))
    plan = make_plan(made)
    assert order_of(made).number == plan.order == asked
    assert plan.why_order == "" and "velocity of order" not in plan.text()


@pytest.mark.parametrize("accuracy", [0.01, "verdict"])
@pytest.mark.parametrize("made", [grain_on_bed, grain_in_pocket])
def test_a_search_for_an_accuracy_begins_with_two(made: Any, accuracy: Any) -> None:
    assert order_of(changed(made(), numerics={"accuracy": accuracy})).number == 2


def test_runs_in_time_are_compared_with_one_order_more() -> None:
    longer, beside = comparisons(scene(**IN_TIME))
    assert (order_of(longer).number, order_of(beside).number) == (3, 4)


def test_auto_is_written_and_read() -> None:
    made = scene()
    assert 'order = "auto"' in dumps(made)
    assert loads(dumps(made)).numerics.order == "auto"
    assert (
        order_of(
            loads(dumps(scene(numerics=Numerics(order=2))), overrides=('numerics.order="auto"',))
        ).number
        == 3
    )
    assert order_of(loads(dumps(made), overrides=("numerics.order=auto",))).number == 3


@pytest.mark.parametrize(
    ("name", "order"),
    [("grain_on_bed", 3), ("vortex_street", 3), ("pothole_1", 2), ("sphere_in_pocket", 3)],
)
def test_the_shipped_scenes(name: str, order: int) -> None:
    found: Scene = load(DEMOS / f"{name}.toml")
    assert found.numerics.order == "auto" and order_of(found).number == order
