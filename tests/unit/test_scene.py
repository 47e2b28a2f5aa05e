"""What follows from scenes in 2-D and 3-D: scaling, geometry, placement, symmetry, files, orders and tolerances."""

from __future__ import annotations

import math
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from pydantic import ValidationError
from scenes import BOX, FLOW_SCALE, grain_in_pocket, grain_on_bed, message, scene
from scenes import sphere_on_plane as sphere_scene

from incipient.accuracy.coarse_runs import changed, farther
from incipient.contact import Load
from incipient.contact.safety import safety_factor
from incipient.geometry.plane import beds as bed_geometry
from incipient.geometry.plane import grains as grain_geometry
from incipient.planning.discretisation import order_of
from incipient.planning.plan import make_plan
from incipient.scene import (
    Box,
    Capsule,
    Contact,
    Cylinder,
    Disc,
    Discs,
    Domain,
    Effects,
    Ellipse,
    Ellipsoid,
    ExpressionFlow,
    Flat,
    Fluid,
    Gravity,
    HalfDiscs,
    HeapBed,
    HeightMapBed,
    Inclined,
    Lid,
    LogLaw,
    Numerics,
    OpenChannel,
    Poiseuille,
    Polygon,
    Polyhedron,
    Polyline,
    Rectangle,
    RidgeBed,
    Shear,
    Sinusoidal,
    Sphere,
    SphereBed,
    Spheres,
    Star,
    Still,
    Superellipse,
    Superquadric,
    Time,
    Uniform,
)
from incipient.scene.file import dumps, loads
from incipient.scene.grains import mass_and_inertia
from incipient.setup.setup import Setup

# Scenes built from Python: what follows from them.


HIGH = Domain(length=12, height=6, origin=(0, 2))
FAR = Domain(length=12.0, width=8.0, height=6.0, origin=(100.0, -50.0, 7.0))
OF_TWO = {"body": Ellipse(semi_axes=(0.5, 1), x=4)}  # the largest diameter is 2
TRIANGLE = [(0, 0), (1, 0), (0, 1)]
TILTED = {"width": 1.0, "height": 0.6, "x": 4.0, "angle": 20.0}
SLOPE = {"bed": Inclined(slope=30), "gravity": Gravity(acceleration=10)}
ON_SLOPE = {"bed": Inclined(slope=20), "gravity": Gravity(acceleration=10)}
UNSTEADY = {"flow": ExpressionFlow(components=("y*sin(t)", "0")), "time": Time(end=1, step=0.1)}
CREEPING = Fluid(reynolds=1, scale="grain", inertia=False)
POINTS = np.array([[1.0, 2.0], [3.0, 4.0], [0.5, 2.0]])
BETWEEN = np.array([[0.0, 0.0], [1.0, 1.5], [0.499, 0.499]])  # on a sphere, and between spheres
FORMULAS = ExpressionFlow(components=("z*y", "t", "x"))
TIPPED = Ellipsoid(semi_axes=(0.5, 0.4, 0.3), x=5, orientation=(20, 0, 0), settle=True, density=2)
LYING = Capsule(diameter=1, length=2, x=5, settle=True, density=2)
ACROSS = 0.25 * (1 / 16 + 1 / 12) + 1 / 6 * (0.1 + 0.25 + 3 / 16)
SQUARE = SphereBed(radius=0.5, spacing=1.0, arrangement="square", offset=(4.6, 3.6))


def exactly(value: Any, error: float = 1e-12) -> Any:
    return pytest.approx(value, rel=error, abs=error)


def block(friction: float, settle: Any = True) -> dict[str, Any]:
    body = Rectangle(width=1, height=0.5, x=4, settle=settle)
    return {**ON_SLOPE, "body": body, "contact": Contact(friction=friction)}


def solver(result: Any) -> tuple[str, bool]:
    plan = make_plan(result)
    return plan.solver.name, plan.stabilisation.upwind


def velocities(result: Any) -> Any:
    return Setup(result).base_flow.velocity(POINTS, 3.0)


PLANE: list[tuple[dict[str, Any], Any, Any]] = [
    *(
        ({"domain": BOX, "fluid": FLOW_SCALE, "flow": Lid(), "body": None, "bed": None}, name, value)
        for name, value in (("top", "wall"), ("viscosity", 0.01), ("placement", None), ("contact_gap", 0.0))
    ),
    # nu = V L/Re with L = 2, the largest diameter, Re = 20 and V = rate L in shear.
    *(
        ({**OF_TWO, "flow": flow}, "viscosity", exactly(velocity * 2.0 / 20.0))
        for flow, velocity in (
            (Shear(rate=3), 6.0),
            (ExpressionFlow(components=("y", "0"), velocity=4), 4.0),
            (LogLaw(shear_velocity=4), 4.0),
            *((kind(velocity=4), 4.0) for kind in (Uniform, Poiseuille, OpenChannel, Still)),
        )
    ),
    *(
        ({"flow": flow}, "top", top)
        for top, flows in (
            ("stream", (Shear(), Uniform(), LogLaw(), ExpressionFlow(components=("y", "0")))),
            ("wall", (Poiseuille(), Still())),
            ("slip", (OpenChannel(),)),
        )
        for flow in flows
    ),
    *(
        ({"body": body}, "grain", geometry)
        for body, geometry in (
            (Ellipse(semi_axes=(1, 0.5), x=4), grain_geometry.Ellipse((1.0, 0.5))),
            (
                Rectangle(width=1, height=2, corner_radius=0.1, x=4),
                grain_geometry.Rectangle(1.0, 2.0, 0.1),
            ),
            (Polygon(vertices=TRIANGLE, x=4), grain_geometry.Polygon(TRIANGLE)),
            (
                Superellipse(semi_axes=(1, 0.5), exponent=4, x=4),
                grain_geometry.Superellipse((1.0, 0.5), 4.0),
            ),
            (Star(radius=0.5, cosines=(0, 0.1), x=4), grain_geometry.Star(0.5, (0.0, 0.1))),
            (
                Discs(discs=[(0, 0, 0.5), (0.5, 0, 0.4)], x=4),
                grain_geometry.Discs([(0, 0), (0.5, 0)], [0.5, 0.4]),
            ),
        )
    ),
    *(
        ({"domain": HIGH, **changes}, "bed_shape", geometry)
        for changes, geometry in (
            ({"bed": Flat()}, bed_geometry.Flat(2.0)),
            (SLOPE, bed_geometry.Flat(2.0)),
            (
                {"bed": Sinusoidal(amplitude=0.1, wavelength=2, phase=90)},
                bed_geometry.Sinusoidal(0.1, 2.0, math.pi / 2, 2.0),
            ),
            (
                {"bed": HalfDiscs(radius=0.5, spacing=1, offset=0.2)},
                bed_geometry.HalfDiscs(0.5, 1.0, 0.2, 2.0),
            ),
            (
                {"bed": Polyline(points=[(0, 0), (12, 1)])},
                bed_geometry.Polyline([(0, 0), (12, 1)], 2.0),
            ),
        )
    ),
    ({"fluid": FLOW_SCALE, "flow": Shear(rate=0.5)}, "viscosity", exactly(3.0 * 6.0 / 100.0)),
    ({"fluid": Fluid(reynolds=np.float64(3), scale="grain")}, "fluid.reynolds", 3.0),
    ({"domain": Domain(length=12, height=6, top="slip")}, "top", "slip"),
    (
        {"domain": Domain(kind="box", length=4, height=4), "flow": Still(), "body": Disc(diameter=1, x=2)},
        *("top", "wall"),
    ),
    # On a bed that falls by 30 degrees: g sin 30 along the stream, g cos 30 into the bed.
    ({"gravity": Gravity(acceleration=10)}, "gravity_vector", exactly([0.0, -10.0])),
    (SLOPE, "gravity_vector", exactly([5.0, -10 * math.sqrt(0.75)])),
    ({"flow": ExpressionFlow(components=("where(y < 1, y, 1)", "0"))}, "flow.changes", False),
    (UNSTEADY, "flow.changes", True),
    ({}, "contact_gap", 0.01),
    (
        {"body": Disc(diameter=2, x=4), "contact": Contact(friction=0.5, gap=0.02, tolerance=1e-5)},
        *("contact_tolerance", 2e-5),
    ),
    # A disc of diameter 1: half a diameter above a plane, sqrt(3)/2 above a saddle of discs, in which it settles.
    ({"domain": HIGH}, "placement.centre", exactly((4.0, 2.5))),
    (
        {"bed": HalfDiscs(radius=0.5, spacing=1, offset=0.5)},
        *("placement.centre", exactly((4.0, math.sqrt(0.75)))),
    ),
    (
        {
            "body": Disc(diameter=1, x=4.2, settle=True),
            "bed": HalfDiscs(radius=0.5, spacing=1, offset=0),
        },
        *("placement.centre", exactly((4.5, math.sqrt(0.75)), 1e-10)),
    ),
    ({"body": Disc(diameter=1, centre=(4, 0.501))}, "placement.centre", (4.0, 0.501)),
    (
        {"body": Disc(diameter=1, centre=(4, 3)), "bed": Sinusoidal(amplitude=0.5, wavelength=3)},
        *("placement.centre", (4.0, 3.0)),
    ),
    (
        {"body": Ellipse(semi_axes=(1, 0.5), centre=(3, 2), angle=90), "bed": None},
        *("placement.angle", exactly(math.pi / 2)),
    ),
    # A box tilted by 20 degrees stays so, or falls onto its face: half its height above the bed.
    ({"body": Rectangle(**TILTED)}, "placement.angle", exactly(math.radians(20.0))),
    ({"body": Rectangle(**TILTED, settle=True)}, "placement.angle", exactly(0.0)),
    ({"body": Rectangle(**TILTED, settle=True)}, lambda s: s.placement.centre[1], exactly(0.3)),
    # tan 20 degrees = 0.364: a block stays with friction 0.4; it slides off with 0.3, but not as on level ground.
    (block(0.4), "placement.centre", exactly((4.0, 0.25))),
    (block(0.3, "level"), "placement.centre", exactly((4.0, 0.25))),
    (block(0.3, "level"), "gravity_vector", exactly(10.0 * np.array([math.sin(math.pi / 9), -math.cos(math.pi / 9)]))),
]  # fmt: skip
SPACE: list[tuple[dict[str, Any], Any, Any]] = [
    ({}, "domain.origin", (0.0, 0.0, 0.0)),
    ({}, "placement.centre", exactly((5.0, 4.0, 0.5), 1e-6)),
    # The place across is counted from the domain's corner; by default it is in the middle.
    ({"domain": FAR, "body": Sphere(diameter=1, x=105.0)}, "placement.centre", exactly((105.0, -46.0, 7.5), 1e-6)),
    (
        {"domain": FAR, "body": Sphere(diameter=1, x=105.0, y=-49.0)},
        *("placement.centre", exactly((105.0, -49.0, 7.5), 1e-6)),
    ),
    # About x: y goes to z, z to -y; about z: x goes to y, y to -x.
    (
        {"body": Box(sides=(3, 2, 1), x=5.0, orientation=(90, 0, 90))},
        *("placement.rotation", exactly(np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]]))),
    ),
    (
        {"bed": SQUARE, "body": Sphere(diameter=1.0, x=5.0, settle=True)},
        *("placement.centre", exactly((5.1, 4.1, math.sqrt(0.5)), 1e-9)),
    ),
    # It tips sideways until it lies flat, on a plane at mid-width again.
    ({"body": TIPPED}, "placement.centre", exactly((5.0, 4.0, 0.3), 1e-9)),
    ({"body": TIPPED}, "asymmetry", ""),
    # In the pocket of three spheres: the regular tetrahedron of the four centres.
    (
        {"bed": SphereBed(radius=0.5, spacing=1.0, angle=90.0, offset=(5.0 - 1.0 / math.sqrt(3.0), 4.0))},
        *("placement.centre", exactly((5.0, 4.0, math.sqrt(2.0 / 3.0)), 1e-6)),
    ),
    *(
        ({"bed": bed, "gravity": Gravity(acceleration=2.0)}, "gravity_vector", exactly([1.0, 0.0, -math.sqrt(3.0)]))
        for bed in (Inclined(slope=30.0), SphereBed(radius=0.5, spacing=1.0, slope=30.0))
    ),
    # m (b^2 + c^2)/12 of a box turned by a right angle about z.
    (
        {"body": Box(sides=(3.0, 2.0, 1.0), x=5.0, density=2.0, orientation=(0, 0, 90))},
        lambda s: mass_and_inertia(s.body, s.placement)[1],
        exactly(np.diag([9.0 + 1.0, 4.0 + 1.0, 4.0 + 9.0])),
    ),
    # A capsule, r = 0.5, h = 1: V = pi r^2 h + 4/3 pi r^3; about the axis pi (r^4 h/2 + 8 r^5/15); across it a cylinder
    # of m = pi r^2 h, m (r^2/4 + h^2/12), and two hemispheres of m = 2/3 pi r^3, each m (2/5 r^2 + h^2/4 + 3/8 h r).
    (
        {"body": LYING},
        lambda s: [s.grain.volume, s.grain.size, *np.diag(s.grain.inertia)],
        exactly(np.pi * np.array([5 / 12, 2 / np.pi, ACROSS, 0.5**5 + 8 / 15 * 0.5**5, ACROSS])),
    ),
    (
        {"body": LYING},
        lambda s: s.grain.level([[0.0, 1.0, 0.0], [0.5, 0.3, 0.0], [0.0, 1.2, 0.0]]),
        exactly(np.array([0.0, 0.0, 0.2])),
    ),
    ({"body": LYING}, lambda s: s.placement.centre[2], exactly(0.5, 1e-8)),
    # Profiles go with the height; formulas have three components.
    ({}, velocities, exactly(np.array([[0.5, 2.0], [0, 0], [0, 0]]))),
    (
        {"flow": FORMULAS, "time": Time(end=1.0, step=0.1)},
        *(velocities, exactly(np.array([[1.5, 8.0], [3, 3], [1, 2]]))),
    ),
    # On spheres that are higher than the datum, and between them, the inflow is at rest on the bed.
    (
        {
            "bed": SphereBed(radius=0.5, spacing=1.0, arrangement="square"),
            "flow": Shear(datum="mean"), "body": None, "fluid": Fluid(reynolds=1, scale="flow"),
        },
        lambda s: Setup(s).base_flow.entering(BETWEEN, 0.0)[0] + [0.0, Setup(s).base_flow.datum],
        exactly(np.array([0.0, 0.499])),
    ),
    # A larger domain is wider as well, unless walls are at its sides.
    ({}, lambda s: (*farther(s).domain.sizes.values(),), (18.0, 12.0, 9.0)),
    ({}, lambda s: farther(s).domain.origin, (-3.0, -2.0, 0.0)),
    ({"domain": Domain(length=12, width=8, height=6, sides="wall")}, lambda s: farther(s).domain.width, 8.0),
    ({"body": Cylinder(diameter=1, length=8, centre=(5, 4, 3))}, lambda s: farther(s).domain.width, 8.0),
    # The solver, and whether its cells, which convect little, are upwinded.
    ({"numerics": Numerics(order=3)}, solver, ("block", True)),
    ({"numerics": Numerics(stabilisation="off")}, solver, ("block", False)),
    (
        {"fluid": Fluid(reynolds=1000, scale="grain"), "numerics": Numerics(stabilisation="off")},
        *(solver, ("direct", False)),
    ),
    ({"fluid": CREEPING}, solver, ("two-level", False)),
    ({"fluid": CREEPING, "numerics": Numerics(order=2)}, solver, ("block", False)),
]  # fmt: skip


@pytest.mark.parametrize(
    ("build", "changes", "name", "value"),
    [*((scene, *row) for row in PLANE), *((sphere_scene, *row) for row in SPACE)],
)
def test_what_follows_from_a_scene(build: Any, changes: Any, name: Any, value: Any) -> None:
    followed = attrgetter(name) if isinstance(name, str) else name
    assert followed(build(**changes)) == value


def test_a_grain_settles_by_friction_or_without():
    """By friction it stays where contacts first hold it; without, in the one rest that friction has no part in."""
    bed = HalfDiscs(radius=0.5, spacing=1.4, offset=0)

    def rest(settle, friction):
        body = Ellipse(semi_axes=(0.6, 0.4), x=4.2, angle=20, density=2.0, settle=settle)
        settled = scene(body=body, bed=bed, contact=Contact(friction=friction))
        load = Load(np.zeros(3), np.zeros(3), [0, -1, 0], [*settled.placement.centre, 0])
        return settled.placement, safety_factor(load, Setup(settled).contacts, 0.0).held

    alone, held = rest("frictionless", 0.8)
    assert held and rest("frictionless", 0.1)[0] == alone
    by_friction, held = rest(True, 0.8)
    assert not held and by_friction.centre[1] > alone.centre[1]


def test_scenes_are_immutable_and_hashable():
    with pytest.raises(ValidationError, match="frozen"):
        scene().title = "other"
    assert hash(scene()) == hash(scene())


# Scenes in 3-D: every grain on every bed, mass, symmetry, the angle of repose, flows.


SOLIDS = [
    Sphere(diameter=1.0, x=5.0),
    Ellipsoid(semi_axes=(0.6, 0.5, 0.3), x=5.0),
    Superquadric(semi_axes=(0.6, 0.5, 0.3), exponents=(4.0, 2.0), x=5.0),
    Box(sides=(1.0, 0.8, 0.6), edge_radius=0.1, x=5.0),
    Polyhedron(vertices=((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), x=5.0),
    Spheres(spheres=((0, 0, 0, 0.5), (0.6, 0, 0, 0.4)), x=5.0),
]
TERRAINS = [
    Flat(),
    SphereBed(radius=0.5, spacing=1.0),
    SphereBed(radius=0.5, spacing=1.0, arrangement="square", layers=2),
    SphereBed(radius=0.5, spacing=1.3, arrangement="random", seed=7),
    RidgeBed(amplitude=0.1, wavelength=2.0),
    HeightMapBed(heights=((0.0, 0.1, 0.0),) * 3, cell=(6.0, 4.0)),
    HeapBed(
        spheres=((4.6, 3.5, 0.0, 0.5), (4.6, 4.5, 0.0, 0.5), (5.47, 4.0, 0.1, 0.5)),
        posts=((6.4, 4.2, 0.3, 0.4),),
    ),
]
# Whether a scene is its own mirror image takes as long to find as the rest on a bed of spheres.
WHOLE = Domain(length=12, width=8, height=6, symmetric=False)
ACROSS = ExpressionFlow(components=("z", "z*sin(2*pi*t)", "0"))
# Euler's equations: w_y and the product of inertia I_xy change w_x and w_z.
SPINNING = Sphere(
    diameter=1.0,
    centre=(5.0, 4.0, 2.0),
    orientation=(0.0, 0.0, 45.0),
    motion="free",
    density=2.0,
    inertia=(0.1, 0.2, 0.2),
    spin=(0.0, 1.0, 0.0),
)


@pytest.mark.parametrize(
    ("body", "bed"),
    [
        # By default every grain lies on two beds or three, and every bed under two grains or three.
        pytest.param(
            *(body, bed),
            id=f"{body.shape}-{bed.kind}-{getattr(bed, 'arrangement', '')}",
            marks=() if (i + j) % 3 == 0 else pytest.mark.slow,
        )
        for i, body in enumerate(SOLIDS)
        for j, bed in enumerate(TERRAINS)
    ],
)
def test_every_grain_rests_on_every_bed(body, bed):
    made = sphere_scene(body=body, bed=bed, domain=WHOLE)
    distances = made.bed_shape.distance(Setup(made).contacts.points)
    assert np.abs(distances).max() < 2 * made.contact_tolerance


@pytest.mark.parametrize(
    ("changes", "halved"),
    [
        ({}, True),
        ({"body": Sphere(diameter=1.0, x=5.0, y=3.0)}, False),
        ({"body": Sphere(diameter=1.0, x=5.0, y=np.nextafter(4.0, 0.0))}, True),
        ({"body": Box(sides=(1.0, 0.8, 0.6), x=5.0, orientation=(0, 0, 30))}, False),
        ({"body": Box(sides=(1.0, 0.8, 0.6), x=5.0, orientation=(0, 30, 0))}, True),
        ({"body": Ellipsoid(semi_axes=(0.6, 0.5, 0.3), x=5.0, orientation=(0, 0, 10))}, False),
        ({"body": Spheres(spheres=((0, 0, 0, 0.5), (0.6, 0, 0, 0.4)), x=5.0)}, True),
        ({"body": Spheres(spheres=((0, 0, 0, 0.5), (0, 0.6, 0, 0.4)), x=5.0)}, False),
        ({"bed": RidgeBed(amplitude=0.1, wavelength=2.0)}, True),
        ({"bed": RidgeBed(amplitude=0.1, wavelength=2.0, angle=20.0)}, False),
        ({"bed": SphereBed(radius=0.5, spacing=1.0, offset=(0.0, 4.0))}, True),
        ({"bed": SphereBed(radius=0.5, spacing=1.0, offset=(0.0, 4.2))}, False),
        ({"flow": ExpressionFlow(components=("z", "y - 4", "0"))}, True),
        ({"flow": ExpressionFlow(components=("z", "0.1*z", "0"))}, False),
        # Across the flow and in time periodic like evenly spaced points.
        ({"flow": ExpressionFlow(components=("z", "z*sin(1.25*pi*y)**2", "0"))}, False),
        ({"flow": ACROSS, "time": Time(end=20, step=0.05)}, False),
        ({"body": SPINNING, "bed": None, "contact": None, "time": Time(end=1, step=0.1)}, False),
        ({"domain": WHOLE}, False),
    ],
)
def test_a_scene_that_is_its_own_mirror_image_is_halved(changes, halved):
    made = sphere_scene(**changes)
    assert Setup(made).symmetric is halved
    assert Setup(made).mirrored is (halved or made.domain is WHOLE)
    assert ("half of it is computed" in make_plan(made).text()) is halved
    if not halved and made.domain.symmetric is None:
        forced = {**changes, "domain": {**made.domain.model_dump(), "symmetric": True}}
        assert "domain.symmetric: is true, but" in message(lambda: sphere_scene(**forced))


# -- files: read once, the resolved scene holds what was in them ---------------------------------------


def raised(hole: bool = False) -> trimesh.Trimesh:
    """A surface that rises by a tenth of x from 3, with or without a hole."""
    points = [(0, 0, 3), (12, 0, 4.2), (12, 8, 4.2), (0, 8, 3), (6, 4, 3.6)]
    triangles = [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]
    return trimesh.Trimesh(points, triangles[hole:], process=False)


PEBBLE = {"shape": "mesh", "file": "pebble.stl", "size": 2.0, "x": 5.0}
MAP = {"kind": "height-map", "file": "bed.npy", "cell": (3.0, 2.0)}
SCAN = {"kind": "mesh", "file": "bed.ply", "cell": (0.5, 0.5)}
HEAP = {"kind": "heap", "file": "heap.csv", "posts": [(2.0, 4.0, 0.6, 0.4)]}


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with files of grains and beds."""
    trimesh.creation.icosphere(1, 0.5).export(tmp_path / "pebble.stl")
    raised().export(tmp_path / "bed.ply")
    raised(hole=True).export(tmp_path / "hole.ply")
    np.save(tmp_path / "bed.npy", np.outer(np.ones(5), [0.0, 0.1, 0.2, 0.1, 0.0]))
    (tmp_path / "heap.csv").write_text("x,y,z,radius\n4.6,3.5,0.1,0.5\n6.0,4.0,0.0,0.7\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("data", "places", "heights"),
    [
        (MAP, [[6.0, 4.0], [3.0, 1.0]], [0.2, 0.1]),
        (SCAN, [[4.0, 3.0], [8.1, 5.3]], [0.4, 0.81]),
        # Of each sphere's top, of posts too, and the plane between.
        (HEAP, [[4.6, 3.5], [6.0, 4.0], [2.0, 4.0], [1.0, 1.0]], [0.6, 0.7, 1.0, 0.0]),
        (PEBBLE, [[1.0, 1.0]], [0.0]),
    ],
)
def test_files_are_read_once_and_stand_in_the_resolved_scene(files, data, places, heights):
    made = sphere_scene(**{"bed" if "kind" in data else "body": data})
    assert made.bed_shape.height(places) == pytest.approx(heights, abs=1e-6)
    (files / data["file"]).unlink()
    again = loads(dumps(made))
    assert again == made and again.grain.size == pytest.approx(data.get("size", 1.0))


@pytest.mark.usefixtures("files")
def test_a_post_is_solid_down_to_the_plane():
    """Below its top the nearest point is straight beside it."""
    made = sphere_scene(bed=HEAP)
    assert made.bed_shape.distance([[1.4, 4.0, 0.3]])[0] == pytest.approx(0.2)
    assert made.bed_shape.nearest([[1.4, 4.0, 0.3]]) == pytest.approx(np.array([[1.6, 4.0, 0.3]]))


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize(
    ("data", "why"),
    [
        ({**SCAN, "file": "hole.ply"}, "has a hole as seen from above"),
        *(
            ({**MAP, key: 0.1}, f"bed.{key}: is 0.1; give a list in [brackets]")
            for key in ("cell", "offset")
        ),
    ],
)
def test_what_is_wrong_with_a_file_of_a_bed(data, why):
    assert why in message(lambda: sphere_scene(bed=data))


def test_a_scanned_grain_is_seen_to_be_none_of_its_mirror_image_at_few_points(files, monkeypatch):
    """Each point is compared with each triangle: with all points the plan of a pebble of 5,000 took half a minute."""
    from incipient.geometry import Triangulated

    ball = trimesh.creation.icosphere(3)
    ball.vertices[:, 1] *= 1.0 + 0.1 * ball.vertices[:, 1]
    ball.export(files / "pebble.stl")
    made = sphere_scene(bed=None, body={**PEBBLE, "x": None, "centre": (6.0, 4.0, 2.0)})
    counts, level = [], Triangulated.level
    monkeypatch.setattr(Triangulated, "level", lambda s, x: counts.append(len(x)) or level(s, x))
    assert not Setup(made).symmetric
    assert 0 < sum(counts) < 1000


# -- what a plan makes of them -------------------------------------------------------------------------


AT = {"diameter": 1.0, "centre": (4.0, 3.0), "density": 2.0}
IN_TIME = {"time": Time(end=1.0, step=0.1)}
IN_SPACE = {"domain": Domain(length=12, width=6, height=6), "bed": None}
BALL = {**IN_SPACE, "body": Sphere(diameter=1.0, centre=(4.0, 3.0, 3.0))}
COURSE = ("0.1*cos(t)", "0", "0")
CASES: list[tuple[dict[str, Any], int]] = [
    ({}, 3),
    (IN_TIME, 3),
    ({"body": Disc(**AT), "bed": None}, 3),
    ({"domain": BOX, "fluid": FLOW_SCALE, "flow": Lid(), "body": None, "bed": None}, 3),
    ({**IN_TIME, "bed": None, "body": Disc(**AT, motion="free")}, 2),
    ({**IN_TIME, "bed": None, "body": Disc(**AT, motion="prescribed", course=COURSE)}, 2),
    (BALL, 2),
    ({**BALL, "fluid": CREEPING}, 3),
    ({**BALL, "effects": Effects(inertia=False)}, 3),
    # Left to the plan, which finds inertia negligible: Oseen's 3/16 Re is below a thousandth.
    ({**BALL, "fluid": Fluid(reynolds=1e-4, scale="grain")}, 3),
]


@pytest.mark.parametrize(("changes", "order"), CASES)
def test_the_order_that_is_chosen_and_why(changes: dict[str, Any], order: int) -> None:
    """As measured (docs/contribute/defaults.md): three in 2-D where nothing moves, and in creeping flow in 3-D."""
    plan = make_plan(scene(**changes))
    assert (order_of(scene(**changes)), plan.order) == (order, order)
    assert plan.why_order and f"  velocity of order {order}: {plan.why_order}" in plan.text()
    given = make_plan(scene(**changes, numerics=Numerics(order=4)))
    assert (given.order, given.why_order) == (4, "")


@pytest.mark.parametrize("accuracy", [0.01, "verdict"])
@pytest.mark.parametrize(("made", "order"), [(grain_on_bed, 3), (grain_in_pocket, 2)])
def test_the_order_of_searches(made: Any, order: int, accuracy: Any) -> None:
    """A search has the order of the scene, except in 3-D, where its meshes are of order two."""
    assert order_of(changed(made(), numerics={"accuracy": accuracy})) == order
