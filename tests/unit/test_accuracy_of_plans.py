"""Accuracies: cells expected, calibration, runs with turbulence."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scenes import ROOT, SCENES, message
from turbulent import channel

import incipient
from incipient import load
from incipient.accuracy.coarse_runs import changed, coarse, comparisons, is_coarse
from incipient.accuracy.errorbars import coarse_scenes
from incipient.accuracy.first_mesh import Attempt, first_mesh, planned
from incipient.accuracy.search import Estimate
from incipient.accuracy.searches import Compared
from incipient.accuracy.terms import by_coarser_mesh, by_coarser_runs, terms_of_model
from incipient.cost.measurement import Quantity, of_run
from incipient.errors import ConvergenceError, MeshError
from incipient.files import plain
from incipient.meshes.size_map import expected_cells
from incipient.planning import meshing
from incipient.planning.discretisation import order_of, velocity_order
from incipient.planning.plan import make_plan
from incipient.planning.sizes import coarsest, ratio_of_rows
from incipient.progress import Silent
from incipient.results.errorbars import NO_GRAIN, ErrorBars, Loads, Term
from incipient.results.of_runs import OF_WALLS
from incipient.results.quantity import place_words, screen_lines, separation_words
from incipient.results.result import Result
from incipient.results.wall_report import OF_MODEL, WallReport
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Flat,
    Fluid,
    Gravity,
    Numerics,
    Scene,
    Sinusoidal,
    Sphere,
    Time,
    Turbulence,
    loads,
)
from incipient.setup.setup import Setup
from incipient.simulation.state import Recorder
from incipient.sweep.table import in_words
from incipient.sweep.worker import quantities

# How many cells are expected before a mesh is made, and the refusal of too many.


RIPPLES = """\
[domain]
length = 1e5
height = 360
[fluid]
reynolds = 20
scale = "flow"
[flow]
kind = "shear"
[bed]
"""


HALF_DISCS = ("bed.kind=half-discs", "bed.radius=0.1", "bed.spacing=0.24", "bed.offset=0")


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        *(
            (name, (f"numerics.mesh_size={size}",))
            for name in ("cavity", "cylinder", "grain_on_bed", "pothole_1")
            for size in (0.5, 2.0)
        ),
        ("grain_on_bed", HALF_DISCS),  # cells of a bed that grow with the distance
    ],
)
def test_about_as_many_cells_are_expected_as_are_made(name: str, changes: tuple[str, ...]) -> None:
    scene = load(SCENES / f"{name}.toml", changes)
    laid_out = meshing.lay_out(Setup(scene), make_plan(scene))
    cells = sum(expected_cells(laid_out.shape, laid_out.sizes).values())
    made = first_mesh(scene)
    assert made is not None and made.cells / 3 < cells < 3 * made.cells


IN_SPACE = """
[domain]
length = 10.0
height = 5.0
width = 10.0
[fluid]
reynolds = 10.0
scale = "flow"
[flow]
kind = "shear"
"""
SPHERE = '[body]\nshape = "sphere"\ndiameter = 1.0\nx = 5.0\ndensity = 2.65\n'
GRAVITY = "[gravity]\nacceleration = 1.0\n"
MANY_DISCS = 'kind = "half-discs"\nradius = 1e-4\nspacing = 2e-4'
MANY_SPHERES = 'kind = "spheres"\nradius = 1e-4\nspacing = 2.1e-4'


@pytest.mark.parametrize(
    ("domain", "bed"),
    [
        (RIPPLES, MANY_DISCS),
        (RIPPLES, 'kind = "sinusoidal"\namplitude = 1e-4\nwavelength = 1e-3'),
        (RIPPLES, 'kind = "sinusoidal"\namplitude = 100\nwavelength = 1'),
        *(
            (f"{IN_SPACE}{grain}[bed]\n", bed)
            for grain in (SPHERE, "")
            for bed in (
                f'{MANY_SPHERES}\narrangement = "random"',
                MANY_SPHERES,
                'kind = "ridges"\namplitude = 1e-5\nwavelength = 1e-4',
            )
        ),
    ],
)
def test_too_many_bed_forms_are_refused_at_once(domain: str, bed: str) -> None:
    """All spheres below the grain, 10^8 of them, would not fit into the memory."""
    computed = message(lambda: loads(f"{domain}{bed}\n"))
    remedy = "--set numerics.max_cells" if domain == RIPPLES else "use a flat bed instead"
    assert "bed: has forms, about " in computed and remedy in computed


@pytest.mark.parametrize(
    ("text", "part", "remedy"),
    [
        (
            RIPPLES.replace("[bed]\n", "").replace("height = 360", "height = 0.1"),
            *("domain", "numerics.mesh_size"),
        ),
        (
            f'{RIPPLES}kind = "polyline"\npoints = [[0, 0], [5, 0], [5.0001, 0.1], [1e5, 0]]',
            *("bed", "numerics.mesh_size"),
        ),
        *(
            (
                f"{IN_SPACE}{SPHERE}[bed]\n{bed}\n{GRAVITY}[contact]\nfriction = 0.5\ngap = 1e-9\n",
                *("narrow places", "contact.gap"),
            )
            for bed in ('kind = "flat"', 'kind = "spheres"\nradius = 0.5\nspacing = 1.05')
        ),
    ],
)
def test_a_mesh_of_too_many_cells_is_refused_before_it_is_made(
    text: str, part: str, remedy: str
) -> None:
    """Cells as large as the space about a sphere's contact is wide are as many as its radius over the gap, in parts."""
    computed = message(lambda: first_mesh(loads(text)))
    assert computed.startswith("numerics.max_cells: a mesh of about ")
    assert f"most for the {part}" in computed and f"enlarge {remedy}" in computed
    allowed = int(computed.rpartition("=")[2])
    scene = loads(text, overrides=[f"numerics.max_cells={allowed}"])
    meshing.lay_out(Setup(scene), make_plan(scene))._require_few_cells()


def test_a_flat_domain_is_refused_before_it_is_filled_with_boxes() -> None:
    """By hand: 1e5 / (0.51 times 30) = 6,500 by as many, or half of them, in two rows; 7.5 GiB had been asked for."""
    far = [f"domain.{key}=1e5" for key in ("length", "width")]
    scene = load(SCENES / "sphere_on_plane.toml", [*far, "body.x=5e4"])
    with pytest.raises(MeshError, match=r"too flat to be meshed: 1e\+05 long and 30 across"):
        first_mesh(scene)


@pytest.mark.parametrize(
    ("across", "remedy"),
    [
        (
            [[0, 0.1, 0], [0, 0, 1e-5]],
            "the surface of body crosses itself in .*: make body thicker or blunter there",
        ),
        (
            [[0, 1, 0], [0.3, 0.3, 1e-4]],
            "could not be meshed: .*; use another numerics.mesh_size, and make thin parts",
        ),
    ],
)
def test_what_helps_a_grain_that_cannot_be_meshed_is_said(
    across: list[list[float]], remedy: str
) -> None:
    """A blade, whose cells made smaller again and again cross all the same, and a sheet."""
    vertices = [[0, 0, 0], [1, 0, 0], *across]
    body = f'[body]\nshape = "polyhedron"\nvertices = {vertices}\ncentre = [5.0, 5.0, 2.0]\n'
    with pytest.raises(MeshError, match=remedy):
        first_mesh(loads(f"{IN_SPACE}{body}[numerics]\nmesh_size = 3.0\n"))


# The calibration of corrected forces notices corrections with a wrong sign or a wrong factor.


@pytest.fixture(scope="module")
def calibration() -> ModuleType:
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        import calibration
    finally:
        sys.path.pop(0)
    return calibration


IN_BOX = """
[domain]
kind = "box"
length = 4.0
height = 4.0
[fluid]
reynolds = 40.0
scale = "flow"
[flow]
kind = "lid"
[body]
shape = "disc"
diameter = 1.0
centre = [1.5, 2.5]
[numerics]
order = 2
mesh_size = 6.0
[output]
fields = false
"""


@pytest.fixture(scope="module")
def cases(calibration: ModuleType) -> Callable[[str], tuple[Scene, Result]]:
    """A scene in which the correction of a term is most of all, and the nearly true result of it."""

    @cache
    def case(name: str) -> tuple[Scene, Result]:
        known = {"gap": "disc in a channel", "domain": "disc, domain 12 x 6"}
        scene = calibration.scene_of(known[name]) if name in known else loads(IN_BOX)
        return scene, incipient.run(calibration.nearly_true(scene), comm=MPI.COMM_SELF)

    return case


TERMS = ["discretisation", "gap", "domain"]


@pytest.mark.parametrize(
    "name", [*TERMS[:1], *(pytest.param(one, marks=pytest.mark.slow) for one in TERMS[1:])]
)
def test_corrected_forces_are_within_their_bars(
    name: str, calibration: ModuleType, cases: Any
) -> None:
    scene, true = cases(name)
    computed = incipient.run(scene, comm=MPI.COMM_SELF)
    assert name in [term.name for term in computed.error_bars.terms if term.correction is not None]
    row = calibration.compared("", computed, true)
    assert row.within and row.corrected_bar < 0.4 * row.computed_bar


# What is told of a turbulent flow: its errors and what they cost, its walls, and where it runs upstream.


NOTHING = Loads(np.zeros(6))


def test_error_bars_of_a_grain_in_turbulence_have_mesh_gap_and_domain():
    """The stream enters at the bed's own height, so that no other datum is tried, and the plan names none."""
    scene = channel(
        fluid=Fluid(reynolds=2e5, scale="flow"),
        body=Disc(diameter=0.2, x=3.9375, density=2.65),
        bed=Sinusoidal(amplitude=0.02, wavelength=0.25),
    )
    estimated = [name for name, each in terms_of_model(scene).items() if callable(each)]
    assert estimated == ["gap", "domain"]
    wider = [one for one in coarse_scenes(scene) if one.numerics.mesh_size == pytest.approx(2**0.5)]
    assert len(wider) == 1 and not wider[0].numerics.error_bars
    assert not make_plan(scene).datum


GIVEN = {"inflow": "given", "intensity": 0.05, "length": 0.1}


def walls_of(least, largest, mean, at_outflow, friction=0.005, **changes):
    """Walls of a channel by the k-epsilon model."""
    return WallReport(
        "k-epsilon", 0.08, least, largest, mean, at_outflow, friction, 1 / 11000, **changes
    )


@pytest.mark.parametrize("told", [False, True])
def test_a_flow_that_has_not_converged_is_told_everywhere(told):
    """In the run's text, its report, and a sweep's table and words; with its residual history."""
    spread, changes = 0.012 * told, ((0.1, 0.2), (0.01, 0.03))
    walls = walls_of(
        *(0.2, 2.0, 0.05, 0.05),
        converged=not told,
        spread=spread,
        changes=changes,
    )
    computed = quantities("run", {"verdict": None, "turbulence": plain(walls)})
    assert computed["load_spread"] == spread
    row = {"status": "done", "task": "run", **computed}
    texts = ("\n".join(walls.lines()), in_words(row), walls.warning)
    words = (
        "NOT CONVERGED after 2 iterations: the flow changed by 1.0e-02 in the last, the turbulence by 3.0e-02; "
        "loads are means of the last ones, within 1.2%",
        "NOT CONVERGED",
        "NOT CONVERGED",
    )
    assert walls.changes == changes and walls.converged == (not told)
    assert [one in text for one, text in zip(words, texts, strict=True)] == [told] * 3


@pytest.mark.parametrize(("width", "simplices"), [(None, 2), (0.5, 12)])
def test_cells_of_a_channel_are_counted_before_it_is_run(width, simplices):
    """Six rows of thirteen columns, of two triangles each, or in 3-D two layers of six tetrahedra."""
    domain = Domain(length=20, width=width, height=1)
    plan = planned(channel(domain=domain, numerics=Numerics(mesh_size=4, order=2)))
    assert plan.estimate.cells == 6 * 13 * simplices


def test_a_sweep_s_table_has_the_friction():
    walls = walls_of(49.0, 51.0, 0.05, 0.05, 0.005)
    computed = quantities("run", {"verdict": None, "turbulence": plain(walls)})
    assert computed["friction"] == 0.005 and computed["y_plus_max"] == 51.0
    assert "friction_low" not in computed
    bars = {"safety_factor": None, "shear_velocity": [5e-4, 1e-4]}
    told = quantities("run", {"verdict": None, "turbulence": plain(walls), "error_bars": bars})
    assert (told["bed_shear_velocity_low"], told["bed_shear_velocity_high"]) == pytest.approx(
        (0.0495, 0.0505)
    )
    assert (told["friction_low"], told["friction_high"]) == pytest.approx(
        (0.005 * 0.99**2, 0.005 * 1.01**2)
    )
    stored = {"turbulence": plain(walls), "error_bars": bars}
    (mean,) = (one for one in OF_WALLS if one.key == "turbulence.shear_velocity")
    assert mean.bar(stored) == pytest.approx((0.0499, 0.0501))
    row = {"status": "done", "task": "run", **computed}
    assert in_words(row) == "C_f 0.005"
    judged = row | {"mode": "rest", "safety_factor": 2.673}
    assert in_words(judged) == "rest, safety factor 2.673"


def test_a_sweep_s_table_says_when_a_held_grain_would_have_moved():
    verdict = {"mode": "rest", "moves": False, "safety_factor": 1.623, "first_motion": 0.35}
    row = {"status": "done", "task": "run", **quantities("run", {"verdict": verdict})}
    assert in_words(row) == "rest, safety factor 1.623, would have moved at t = 0.35"


def test_map_coordinates_are_told_in_decimals():
    assert [place_words(one) for one in (350004.767, 8.3249, -12.3456, 0.0)] == [
        "350004.77",
        "8.3249",
        "-12.346",
        "0",
    ]


@pytest.mark.parametrize("level", [True, False])
def test_what_a_channel_is_compared_by(level):
    """u* at the outflow, over a bed that is not level in the mean."""
    walls = walls_of(41.0, 220.0, 0.04, 0.05, 0.005)
    result = SimpleNamespace(centrelines=None, turbulence=walls, elevations=None)
    bed = Flat() if level else Sinusoidal(amplitude=0.025, wavelength=1.0)
    (computed,) = of_run(channel(bed=bed), result, []).items()
    assert computed == (
        "shear velocity",
        Quantity({"shear_velocity": 0.05 if level else 0.04}, computed[1].scale),
    )
    assert computed[1].error({"shear_velocity": 1.02 * computed[1].scale}) == pytest.approx(0.02)


def test_the_mesh_s_term_is_exact_at_order_one_and_not_deceived_by_chance():
    """An error of 0.01 h, h by the rows; where two meshes agree, what the coarser two differ by falls at order two."""
    fine, coarse = (
        ratio_of_rows(Setup(channel(numerics=Numerics(mesh_size=size))), 2**0.5)
        for size in (1.0, 2**0.5)
    )

    def at(mesh_size, by_chance):
        height = fine * coarse if mesh_size > 1.9 else fine if by_chance or mesh_size > 1.1 else 1.0
        error = 0.01 * height
        shear_velocities = np.array([0.05, 0.05 + error])
        return Loads((1.0 + error) * np.eye(6)[0], {"shear_velocity": shear_velocities})

    def term(by_chance):
        scene = channel()
        return by_coarser_mesh(
            scene, at(1.0, by_chance), lambda one: at(one.numerics.mesh_size, by_chance)
        )

    assert term(False).force == pytest.approx([0.01, 0.0, 0.0])
    assert term(False).others["shear_velocity"] == pytest.approx([0.0, 0.01])
    assert term(True).others["shear_velocity"] == pytest.approx([0.0, 0.01 / fine])


def test_over_a_wavy_bed_differences_of_meshes_are_not_taken_to_fall():
    """u* over a wavy bed errs by 0.06%, 0.13% and 0.14% on ever finer meshes (docs/contribute/defaults.md)."""
    scene = channel(bed=Sinusoidal(amplitude=0.025, wavelength=1.0))
    errors = dict(zip([1.0, 2**0.5, 2.0], [1.4e-3, 1.3e-3, 0.6e-3], strict=True))

    def at(size):
        error = next(value for one, value in errors.items() if one == pytest.approx(size))
        return Loads(NO_GRAIN, {"shear_velocity": np.array([0.0, 1.0 + error])})

    term = by_coarser_mesh(scene, at(1.0), lambda one: at(one.numerics.mesh_size))
    assert term.others["shear_velocity"][1] > errors[1.0]


@pytest.mark.parametrize(("mesh_size", "rows"), [(1.0, 2.0**0.5), (1.8, 9 / 7), (2.55, 7 / 6)])
def test_cells_between_planes_are_compared_by_their_rows(mesh_size: float, rows: float) -> None:
    """By hand: 12.06 rows of full size, each 0.75 mesh_size of one, rounded up; 17/12 is more than the factor."""
    fluid = Fluid(reynolds=22000, scale="flow")
    scene = channel(fluid=fluid, numerics=Numerics(order=2, mesh_size=mesh_size))
    assert ratio_of_rows(Setup(scene), 2.0**0.5) == pytest.approx(rows)


@pytest.mark.parametrize(
    ("changes", "columns"),
    [
        ({}, np.inf),
        ({"domain": Domain(length=4, height=1), "turbulence": GIVEN}, 8),
        ({"bed": Sinusoidal(amplitude=0.02, wavelength=1.0)}, np.inf),
    ],
)
def test_a_mesh_that_is_no_coarser_tells_no_error(changes, columns):
    """Between planes there are six rows and eight columns at the least, where a term would be as good as nothing.

    Rows are evenly 0.08 of the depth high, the first being the distance of the wall times 4/3 or more (by hand).
    """
    scene = channel(**changes, numerics=Numerics(mesh_size=2.0))
    setup = Setup(scene)
    rows = (1.0 - setup.walls.nearest) / 0.08
    most = min(rows / 6, columns / 8) / (0.75 if velocity_order(setup)[0] == 2 else 1.0)
    most = most if setup.walls.plane else np.inf
    assert coarsest(setup) == pytest.approx(most, rel=0.02)
    same = Loads(NO_GRAIN, {"shear_velocity": np.array([0.05, 0.05])})
    if most < 2.0**1.5:
        with pytest.raises(
            ConvergenceError, match="no fewer rows or columns of cells: use numerics"
        ) as refused:
            by_coarser_mesh(scene, same, lambda one: same)
        assert coarse_scenes(scene) == []
        finer = float(str(refused.value).split(" = ")[1].split()[0])
        assert most / 2**0.5 - 0.01 < finer <= most / 2**0.5
    else:
        assert by_coarser_mesh(scene, same, lambda one: same).others[
            "shear_velocity"
        ] == pytest.approx([0.0, 0.0])
        sizes = [one.numerics.mesh_size for one in coarse_scenes(scene)]
        assert sizes == pytest.approx([2.0 * 2**0.5, 4.0])


def test_the_mesh_s_term_in_time_is_found_on_coarser_cells():
    """k and epsilon have one order: what elements of another one change says little of it."""
    scene = channel(time=Time(end=1, step=0.1))
    longer, beside = comparisons(scene)
    assert len({order_of(one) for one in (beside, longer, scene)}) == 1
    assert beside.numerics.mesh_size == pytest.approx(2**0.5) and longer.numerics.mesh_size == 1.0

    def solved(one):
        return Loads(one.numerics.mesh_size * np.eye(6)[0])

    _, of_mesh = by_coarser_runs(scene, solved(scene), solved).parts
    assert of_mesh.force[0] == pytest.approx(1.0)


def test_of_many_places_where_the_flow_runs_upstream_the_longest_are_told():
    """Narrow wedges next to contacts are full of eddies, each shorter than the one before."""
    spans = tuple((place, place + 0.01 * place) for place in (6.0, 5.0, 4.0, 3.0, 2.0, 1.0))
    walls = walls_of(41.0, 220.0, 0.04, 0.05, 0.005, backward=spans)
    ordered = ", ".join(f"x = {place:g} to {1.01 * place:g}" for place in (6.0, 5.0, 4.0, 3.0))
    assert separation_words(spans) == f"{ordered}, and 2 shorter intervals"
    assert separation_words(spans[-1:]) == "x = 1 to 1.01"
    assert walls.lines() == [f"{'model':<20}{OF_MODEL['k-epsilon']}"]


def test_the_history_tells_where_the_flow_separates():
    """x of the longest place, NaN without; nothing in space (all as defined)."""
    walls = walls_of(41.0, 220.0, 0.04, 0.05, 0.005, along={"bottom": {}})
    computed = replace(walls, backward=((2.0, 4.0), (1.0, 1.5))).columns()
    assert (computed["separation"], computed["reattachment"]) == (2.0, 4.0)
    assert math.isnan(walls.columns()["separation"])
    assert "separation" not in replace(walls, along={}).columns()


# On three meshes x of separation and reattachment; the last case: the coarsest flow does not separate.
ENDS = (
    ((1.0, 5.31), (1.02, 5.27), (1.1, 5.24)),
    ((1.0, 5.31), (1.02, 5.27), ()),
)


def of_separation(spans):
    return Loads(NO_GRAIN, {"separated": np.reshape(spans, (-1, 2))})


@pytest.mark.parametrize("ends", ENDS)
def test_where_the_flow_separates_and_reattaches_has_error_bars(ends):
    """By the differences of meshes as u* has them: a share of the finer ones at order one, of the coarser at two."""
    spans = [(one, (0.2, 0.4)) if one else () for one in ends]
    walls = walls_of(41.0, 59.0, 0.04, 0.05, 0.005, backward=spans[0])
    finest, coarser, coarsest = (of_separation(one) for one in spans)
    near = Term.of_difference("discretisation", finest, coarser, 2.4, "")
    computed = near.at_least(Term.of_difference("discretisation", coarser, coarsest, 1.2, ""))
    # Each end errs by as much as the other one: 0.04 and 0.08 here, or the length on the mesh with a place alone.
    far = (0.08, 0.08) if ends[2] else (4.25, 4.25)
    assert computed.others["separated"] == pytest.approx(np.maximum(0.096, 1.2 * np.array(far)))
    bars = ErrorBars((computed,))
    stored = {
        "verdict": None,
        "turbulence": plain(walls),
        "error_bars": bars.to_dict() | {"safety_factor": None},
    }
    table, within = quantities("run", stored), 1.2 * np.array(far)
    assert (table["separation"], table["reattachment"]) == (1.0, 5.31)
    assert table["separation_high"] == pytest.approx(1.0 + max(0.048, within[0]))
    words = "x = 1 to 5.31 (within {:.1e} and {:.1e}), x = 0.2 to 0.4".format(
        *computed.others["separated"]
    )
    assert separation_words(spans[0], bars.total.others["separated"]) == words
    both = replace(computed, others={**computed.others, "shear_velocity": np.array([0.01, 0.02])})
    assert "u* 2.0e-02   x of separation" in "\n".join(ErrorBars((both,)).lines())


def test_a_place_where_the_flow_separates_is_compared_with_itself_on_other_meshes():
    """Over waves another one is the longest on coarser meshes, or the waves' places are one there."""
    spans = [((1.0, 1.6), (2.0, 2.5)), ((2.0, 2.6), (1.02, 1.5)), ((2.0, 2.7), (1.05, 1.4))]
    finest, coarser, coarsest = (of_separation(one) for one in spans)
    assert Term.of_difference("", finest, coarser, 1.0, "").others["separated"] == pytest.approx(
        [0.1, 0.1]
    )
    far = Term.of_difference("", coarser.where_separates(finest), coarsest, 1.0, "")
    assert far.others["separated"] == pytest.approx([0.1, 0.1])
    whole = of_separation([[1.0, 3.0]])
    assert Term.of_difference("", finest, whole, 1.0, "").others["separated"] == pytest.approx(
        [1.4, 1.4]
    )


def in_space(mesh_size):
    """A sphere on a level bed in a flow that its mesh resolves to the walls."""
    return channel(
        domain=Domain(length=8.0, width=6.0, height=5.0),
        body=Sphere(diameter=1.0, x=3.0),
        bed=Flat(),
        contact=Contact(friction=0.5, gap=0.05),
        turbulence=Turbulence(model="k-omega-sst"),
        numerics=Numerics(mesh_size=mesh_size),
    )


def test_components_of_loads_in_space_err_alike():
    """Errors of 0.3 and 0.4 that go with the cells' size are 0.5 each, on the next coarser mesh 0.71.

    They scatter, so that those of the next coarser mesh, which the coarser two tell, are not taken to have fallen.
    """

    def solved(one):
        off = one.numerics.mesh_size
        return Loads(np.array([2.0 + 0.3 * off, 0.0, 0.4 * off, 0.0, 1.0 + 0.2 * off, 0.0]))

    term = by_coarser_mesh(in_space(1.0), solved(in_space(1.0)), solved)
    coarser = 2.0**0.5
    assert term.force == pytest.approx([0.5 * coarser, 0.0, 0.5 * coarser])
    assert term.torque == pytest.approx([0.0, 0.2 * coarser, 0.0])


def test_cells_in_space_that_tell_nothing_are_not_compared_with():
    by_coarser_mesh(in_space(1.6), NOTHING, lambda one: NOTHING)
    with pytest.raises(ConvergenceError, match=r"use numerics.mesh_size = 1.6 or less"):
        by_coarser_mesh(in_space(1.61), NOTHING, lambda one: NOTHING)


def test_walls_in_space_that_are_no_planes_are_told_from_those_that_are():
    """Past the former loads scatter from mesh to mesh, and cells larger than 3.2 tell nothing."""
    assert in_space(1.0).resolves_uneven_walls
    wide = Domain(length=20.0, width=2.0, height=1.0)
    assert not channel(domain=wide, turbulence={"model": "k-omega-sst"}).resolves_uneven_walls
    assert not channel(
        body=Disc(diameter=0.2, x=4.0, density=2.65), bed=Flat()
    ).resolves_uneven_walls


def test_a_search_begins_with_cells_that_resolve_the_walls():
    """Four times the default cells would not; the plan counts the same mesh."""
    wanted = changed(in_space(1.0), numerics={"accuracy": 0.05})
    search = Compared(wanted, MPI.COMM_SELF, Recorder(), Silent())
    assert search.first().scene.numerics.mesh_size == 3.2


def test_a_finer_unsteady_run_is_expected_to_take_as_much_work_as_was_measured():
    """As cells to the power 1.5, over steps: halved steps, and cells smaller by the square root of two."""
    scene = load("demos/scenes/standing_wave.toml", ["numerics.accuracy=0.03"])
    search = Compared(scene, MPI.COMM_SELF, Recorder(), Silent())
    finer = search.refined(Attempt(scene), Estimate(None), 0.5)
    assert finer.work == pytest.approx(2.0 * finer.growth) == pytest.approx(2.0**1.75)
    assert finer.scene.numerics.mesh_size == pytest.approx(2.0**0.5)


def test_what_a_flow_still_changes_by_is_in_the_error_of_a_search():
    term = Term("discretisation", np.array([0.1, 0.0, 0.2, 0.0, 0.3, 0.0]), "")
    computed = term.with_changes(np.array([0.01, 0.0, 0.02, 0.0, 0.04, 0.0]))
    assert computed.load == pytest.approx([0.11, 0.0, 0.22, 0.0, 0.34, 0.0])


@pytest.mark.parametrize(
    ("mesh_size", "order", "same"), [(2.0, 2, True), (1.0, 2, False), (2.0, 3, False)]
)
def test_a_coarse_scene_is_its_own_coarse_run(mesh_size, order, same):
    """With cells and elements of the coarse runs the scene's loads spare that without changes, which is one of them."""
    scene = channel(
        body=Disc(diameter=0.2, x=4.0, density=2.65),
        bed=Flat(),
        fluid=Fluid(reynolds=2e5, scale="flow"),
        numerics=Numerics(mesh_size=mesh_size, order=order),
    )
    assert is_coarse(scene) is same
    assert coarse(scene) in coarse_scenes(scene)


def test_walls_along_which_nothing_flows_are_told_all_the_same():
    """As after a first step in time that failed, of which result.json tells."""
    walls = plain(walls_of(0.0, 0.0, 0.0, 0.0, 0.0))
    bars = {"shear_velocity": [0.0, 0.0]}
    (line,) = screen_lines(OF_WALLS, {"turbulence": walls, "error_bars": bars})
    assert "u* at the outflow 0 +- 0.0e+00   C_f 0   mean" in line


def test_a_threshold_with_turbulence_chooses_no_mesh():
    stone = Disc(diameter=0.2, x=4.0625, density=2.65)
    scene = channel(
        body=stone,
        bed=Sinusoidal(amplitude=0.02, wavelength=0.25),
        fluid=Fluid(reynolds=2e5, scale="flow"),
        gravity=Gravity(acceleration=10.0),
        contact=Contact(friction=0.6),
        numerics=Numerics(accuracy=0.05),
    )
    assert "a threshold needs numerics.accuracy left out with turbulence" in message(
        lambda: incipient.threshold(scene)
    )
