"""Choosing cell sizes and order from estimated errors, and what may be asked for."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from incipient.accuracy.coarse_runs import changed
from incipient.accuracy.goal import Goal
from incipient.adaptive.modelling import SMALLEST_GAP
from incipient.adaptive.orders import (
    AIM,
    COMPARED,
    cheapest_order,
    highest_order,
    left_for_corrected,
    next_order,
)
from incipient.adaptive.refinement import WORTH, Refinement, with_less_of
from incipient.adaptive.sizing import LARGEST, SMALLEST, Shares, resized
from incipient.errors import SceneError
from incipient.geometry.plane.curves import Line
from incipient.meshes import Near, Region, SizeField, Sizes
from incipient.meshes.model import meshed
from incipient.planning.layout import STEEPEST
from incipient.progress import Silent
from incipient.results.adaptation import Adaptation, Trial
from incipient.results.loads import Couples, Forces
from incipient.scene import Scene, loads
from incipient.scene.example import commented, grain_on_bed
from incipient.simulation.recorder import Recorder


def grid(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles of the unit square, n cells along a side."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    lower = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    a, b, c, d = lower, lower + 1, lower + n + 1, lower + n + 2
    return np.column_stack([x.ravel(), y.ravel()]), np.vstack(
        [np.column_stack([a, b, d]), np.column_stack([a, d, c])]
    )


def test_equal_shares_refine_evenly() -> None:
    """Errors that go as h^(2k) fall sixteen times when cells of order two are halved."""
    points, triangles = grid(10)
    shares = Shares(points, triangles, np.ones(len(points)))
    assert shares.sizes == pytest.approx(0.1 * np.sqrt(2 / np.sqrt(3)))
    wanted = resized(shares, order=2, relative=1 / 16, comm=MPI.COMM_SELF)
    assert wanted.field is not None
    assert wanted.field.sizes == pytest.approx(0.5 * shares.sizes, rel=1e-6)
    assert wanted.more_cells == pytest.approx(4.0, rel=1e-6)


def test_sizes_follow_the_shares_within_bounds() -> None:
    points, triangles = grid(40)
    errors = np.exp(-20.0 * np.hypot(*(points - 0.5).T))
    shares = Shares(points, triangles, errors)
    wanted = resized(shares, order=2, relative=0.1, comm=MPI.COMM_SELF)
    assert wanted.field is not None
    factors = wanted.field.sizes / shares.sizes
    assert factors.min() == pytest.approx(factors[np.argmax(errors)])
    assert factors.min() >= SMALLEST - 1e-12 and factors.max() <= LARGEST + 1e-12
    a, b = triangles[:, 0], triangles[:, 1]
    growth = np.abs(np.diff(wanted.field.sizes[np.column_stack([a, b])]))[:, 0]
    assert np.all(growth <= STEEPEST * np.linalg.norm(points[a] - points[b], axis=1) + 1e-12)


def test_no_error_makes_cells_as_large_as_allowed() -> None:
    points, triangles = grid(5)
    shares = Shares(points, triangles, np.ones(len(points)))
    wanted = resized(shares, order=2, relative=1e9, comm=MPI.COMM_SELF)
    assert wanted.field is not None
    assert wanted.field.sizes == pytest.approx(LARGEST * shares.sizes)


def test_mesh_has_the_sizes_of_the_field() -> None:
    """The field wants fine cells left of the middle; where it does not reach, other sizes hold."""
    points, triangles = grid(4)
    sizes = np.where(points[:, 0] < 0.4, 0.05, 0.5)
    corners = ((0.0, 0.0), (2.0, 0.0))
    region = Region((Line(*corners),), 1.0)
    mesh = meshed(region, Sizes(0.25, field=SizeField(points, triangles, sizes)), 1)
    centres = mesh.points[mesh.cells].mean(axis=1)
    left, right = (centres[:, 0] < 0.2).sum(), (centres[:, 0] > 1.2).sum()
    # Areas 0.2 and 0.8 in equilateral triangles of sides 0.05 and 0.25.
    assert left == pytest.approx(0.2 / (0.433 * 0.05**2), rel=0.1)
    # Thirty triangles: those between fine and coarse ones are smaller, so that there are 33.
    assert right == pytest.approx(0.8 / (0.433 * 0.25**2), rel=0.2)


def test_what_a_geometry_needs_is_not_coarsened() -> None:
    sizes = Sizes(
        1.0, (Near(0.1, 0.2, points=((0.0, 0.0),), needed=True), Near(0.3, 0.6, boundary="bed"))
    )
    coarse = sizes.coarsened(4.0, 0.5)
    assert coarse.far == 4.0
    assert [(near.size, near.growth) for near in coarse.near] == [(0.1, 0.5), (1.2, 0.6)]


@pytest.mark.parametrize(
    ("order", "excess", "cheapest"),
    [(2, 1.5, 2), (2, 5.0, 2), (2, 10.0, 3), (2, 1000.0, 4), (3, 2.0, 3), (4, 1e6, 4)],
)
def test_order_with_the_fewest_unknowns(order: int, excess: float, cheapest: int) -> None:
    assert cheapest_order(order, excess) == cheapest


def test_no_order_is_tried_in_space_with_inertia_that_the_solver_does_not_serve() -> None:
    assert (highest_order(3, True), highest_order(3, False), highest_order(2, True)) == (2, 4, 4)
    assert [next_order(order, 1e3, 3, 2)[0] for order in (2, 3)] == [2, 3]


def test_a_smaller_gap_or_a_larger_domain() -> None:
    scene = grain_on_bed()
    closer, said = with_less_of("gap", scene) or (scene, "")
    assert closer.contact is not None and closer.contact.gap == pytest.approx(0.0025)
    assert said == "gap 0.0025 of the grain's size"
    assert with_less_of("gap", changed(scene, contact={"gap": SMALLEST_GAP})) is None
    larger, said = with_less_of("domain", scene) or (scene, "")
    assert (larger.domain.length, larger.domain.height) == (36.0, 30.0)
    assert said == "domain 36 x 30"
    box = loads(commented(scene), overrides=("domain.kind=box", "flow={kind='lid'}"))
    assert with_less_of("domain", box) is None
    assert with_less_of("discretisation", scene) is None


# -- the quantity -----------------------------------------------------------------------------------


def loaded(force: float, couple: float) -> tuple[Forces, Couples]:
    scene = grain_on_bed()
    gravity = np.append(scene.gravity_vector, 0.0)
    volume, none = scene.grain.volume, np.zeros(3)
    flow = np.array([force, 0.0, 0.0])
    about = np.array([4.0, 0.51, 0.0])
    weights = Forces(flow, flow, -volume * gravity, scene.mass * gravity)
    return weights, Couples(np.array([0.0, 0.0, couple]), none, about)


def wanting(**numerics: object) -> Scene:
    return changed(grain_on_bed(), numerics={"accuracy": 0.01, **numerics})


def test_relative_errors() -> None:
    force, couple = loaded(2.0, -0.5)
    errors = np.array([0.03, 0.04, 0.0]), np.array([0.0, 0.0, 0.01])
    assert Goal.of(wanting()).error(force, couple, *errors) == pytest.approx(0.025)
    assert Goal.of(wanting(accuracy_of="couple")).error(force, couple, *errors) == pytest.approx(
        0.02
    )
    vanishing = loaded(2.0, 0.0)
    # 1% of force times diameter stands for a couple that is smaller.
    assert Goal.of(wanting(accuracy_of="couple")).error(*vanishing, *errors) == pytest.approx(0.5)


def test_goals_are_relative() -> None:
    force, couple = loaded(2.0, -0.5)
    assert np.allclose(Goal.of(wanting()).goals(force, couple), [[0.5, 0, 0], [0, 0.5, 0]])
    assert np.allclose(Goal.of(wanting(accuracy_of="couple")).goals(force, couple), [[0, 0, 2.0]])


def test_slope_of_the_safety_factor() -> None:
    """In a pocket: the change that its slope foretells is the change of its logarithm."""
    from incipient.contact.verdict import judged
    from incipient.evaluation.contact_verdict import load_of

    text, pocket = (
        commented(grain_on_bed()),
        ("bed.kind=half-discs", "bed.radius=0.5", "bed.spacing=1.2"),
    )
    wanted = ("bed.offset=1.0", "numerics.accuracy=0.01", "numerics.accuracy_of=safety factor")
    scene = loads(text, overrides=(*pocket, *wanted))
    goal, (force, couple) = Goal.of(scene), loaded(1.0, -0.1)
    (slope,) = goal.goals(force, couple)
    factors = [
        judged(load_of(scene.placement, *loads_), goal.contacts, 0.5).safety.value
        for loads_ in (loaded(0.99, -0.1), loaded(1.01, -0.1))
    ]
    assert np.log(factors[1] / factors[0]) == pytest.approx(0.02 * slope[0], rel=1e-2)


def test_a_safety_factor_that_may_be_infinite_is_refined_step_by_step() -> None:
    """Its error is infinite, which tells nothing of the cells needed; the finest allowed would be 25 times as many."""
    search = Refinement(wanting(accuracy_of="safety factor"), MPI.COMM_SELF, Recorder(), Silent())
    search.report(Trial(2, 200, 1000, np.inf, 0.1))
    points, triangles = grid(10)
    shares = Shares(points, triangles, np.ones(len(points)))
    following = search._next_mesh(search._first(), np.inf, shares)
    assert following is not None and 1000.0 < following.expected < 6000.0


def searching(seconds: float, **numerics: object) -> tuple[Refinement, Shares]:
    """A search on its first mesh, which took a time [s]."""
    search = Refinement(wanting(accuracy=1e-3, **numerics), MPI.COMM_SELF, Recorder(), Silent())
    search.report(Trial(2, 200, 1000, 0.1, seconds))
    points, triangles = grid(10)
    return search, Shares(points, triangles, np.full(len(points), 0.1 / len(points)))


def test_a_budget_too_small_for_the_mesh_wanted_is_used_for_a_coarser_one() -> None:
    """The next mesh is the finest that the budget allows; the search ends where none is worth it."""
    search, shares = searching(1.0)
    wanted = search._next_mesh(search._first(), 0.1, shares)
    assert wanted is not None
    allowed, _ = searching(1.0, budget_seconds=6.0)
    milder = allowed._within_budget(allowed._next_mesh(allowed._first(), 0.1, shares))
    assert (
        milder is not None
        and 1000.0 < milder.expected < 0.8 * wanted.expected
        and allowed.reason == ""
    )
    none, _ = searching(1.0, budget_seconds=1.0)
    assert none._within_budget(none._next_mesh(none._first(), 0.1, shares)) is None
    assert none.reason.startswith(
        "stopped at numerics.budget_seconds = 1: the next mesh would take about"
    )


def test_a_search_ends_with_the_least_error_that_it_found() -> None:
    search, _ = searching(1.0)
    first, second = search._first(), search._first(0.5)
    for attempt, error in ((first, 0.02), (second, 0.03)):
        search._keep(attempt, error)
    assert search._kept is not None and search._kept.attempt is first and search._kept.error == 0.02


def test_corrected_loads_that_agree_need_no_mesh_for_the_load_as_computed() -> None:
    """Their error is that on the mesh before: one such mesh shows it, and a finer one has less of it."""
    assert left_for_corrected(3.0, 0.25) == pytest.approx(COMPARED)  # good enough on this mesh
    assert left_for_corrected(30.0, 0.25) == pytest.approx(AIM / 7.5)  # not yet
    assert left_for_corrected(1.5, 0.25) == pytest.approx(AIM / 1.5)  # the load itself soon is
    assert left_for_corrected(30.0, 1.0) == pytest.approx(AIM / 30.0) and WORTH > COMPARED


def test_a_range_with_an_infinite_end() -> None:
    """In a pocket a force that is small may within its error be none, which is held at any factor."""
    pocket = ("bed.kind=half-discs", "bed.radius=0.5", "bed.spacing=1.2", "bed.offset=1.0")
    wanted = ("numerics.accuracy=0.01", "numerics.accuracy_of=safety factor")
    goal = Goal.of(loads(commented(grain_on_bed()), overrides=(*pocket, *wanted)))
    force, couple = loaded(0.1, 0.0)
    errors = np.array([0.01, 0.0, 0.0]), np.zeros(3)
    assert goal.error(force, couple, *errors) == pytest.approx(1.0 / 0.9 - 1.0 / 1.1)
    assert goal.error(force, couple, 10.0 * errors[0], errors[1]) == np.inf


# -- what may be asked for ----------------------------------------------------------------------------


@pytest.mark.parametrize("value", ["0", "1", "-0.1", "1e-7", "true", "high"])
def test_wrong_accuracies(value: str) -> None:
    with pytest.raises(
        SceneError, match=r"numerics\.accuracy: is .*give a relative error such as 0\.01"
    ):
        loads(commented(grain_on_bed()), overrides=(f"numerics.accuracy={value}",))


def test_accuracy_without_a_grain() -> None:
    cavity = '[domain]\nkind="box"\nlength=1\nheight=1\n[fluid]\nreynolds=100\nscale="flow"\n[flow]\nkind="lid"\n'
    with pytest.raises(
        SceneError, match=r"numerics\.accuracy: .*there is neither; add a section \[body\]"
    ) as caught:
        loads(cavity + "[numerics]\naccuracy=0.01\n")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (
            ("numerics.budget_seconds=5",),
            r"numerics\.budget_seconds: .*none is asked for; add numerics\.accuracy",
        ),
        (("numerics.accuracy=0.01", "flow={kind='still'}"), r"a fluid at rest exerts no force"),
        (("numerics.accuracy=0.01", "numerics.accuracy_of=drag"), r'"drag" is not known'),
        (
            ("numerics.accuracy=verdict", "time={end=1.0, step=0.1}"),
            r'"verdict" is for steady flow',
        ),
    ],
)
def test_contradictions(overrides: tuple[str, ...], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        loads(commented(grain_on_bed()), overrides=overrides)


@pytest.mark.parametrize(
    "key", ["accuracy='verdict'", "accuracy=0.01\naccuracy_of='safety factor'"]
)
def test_a_verdict_needs_what_a_verdict_needs(key: str) -> None:
    stream = (
        '[domain]\nlength=8\nheight=4\n[fluid]\nreynolds=20\nscale="grain"\n[flow]\nkind="uniform"\n'
        '[body]\nshape="disc"\ndiameter=1\ncentre=[3.0, 2.0]\n'
    )
    with pytest.raises(
        SceneError,
        match=r"needs a grain that rests on a bed, its density and friction; give body\.x",
    ):
        loads(f"{stream}[numerics]\n{key}\n")


def test_what_is_said() -> None:
    trials = (Trial(2, 200, 1000, 0.02, 0.5), Trial(3, 300, 3000, 0.004, 1.0))
    said = Adaptation(0.01, "force", 0.004, True, "reached", trials)
    first, *rest = said.lines()
    assert first.split(None, 1) == [
        "accuracy",
        "error of the force 4.0e-03 (of discretisation), asked for 0.01: reached",
    ]
    assert [line.split()[0] for line in rest] == ["P2", "P3"]
    assert said.to_dict()["trials"][1]["unknowns"] == 3000
