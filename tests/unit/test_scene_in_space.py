"""Scenes in space: what they are made of, where the grain comes to rest, their symmetry, what wrong ones are told."""

import math

import numpy as np
import pytest
import trimesh
from scenes import message
from scenes import sphere_on_plane as scene

from incipient.accuracy.coarse_runs import farther
from incipient.accuracy.errorbars import coarse_scenes
from incipient.contact.verdict import judge
from incipient.evaluation.contact_verdict import find_contacts, load_of
from incipient.planning.plan import make_plan
from incipient.results.loads import Forces, Torques
from incipient.scene import (
    Box,
    Capsule,
    Contact,
    Cylinder,
    Disc,
    Domain,
    Effects,
    Ellipsoid,
    ExpressionFlow,
    Flat,
    Fluid,
    Gravity,
    HalfDiscs,
    HeapBed,
    HeightMapBed,
    Inclined,
    Mesh,
    MeshBed,
    Numerics,
    Polyhedron,
    RidgeBed,
    Scene,
    Shear,
    Sphere,
    SphereBed,
    Spheres,
    Still,
    Superquadric,
    Time,
)
from incipient.scene.file import dumps, load, loads, schema
from incipient.scene.mass import mass_and_inertia
from incipient.setup.setup import Setup
from incipient.simulation.loads import weights

TETRAHEDRON = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
SOLIDS = [
    Sphere(diameter=1.0, x=5.0),
    Ellipsoid(semi_axes=(0.6, 0.5, 0.3), x=5.0),
    Superquadric(semi_axes=(0.6, 0.5, 0.3), exponents=(4.0, 2.0), x=5.0),
    Box(sides=(1.0, 0.8, 0.6), edge_radius=0.1, x=5.0),
    Polyhedron(vertices=TETRAHEDRON, x=5.0),
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


def test_a_width_makes_a_scene_three_dimensional():
    found = scene()
    assert found.gdim == 3 and found.up == 2
    assert found.domain.origin == (0.0, 0.0, 0.0) and found.domain.across == (0.0, 8.0)
    assert found.placement.centre == pytest.approx((5.0, 4.0, 0.5))
    assert Domain(length=12.0, height=6.0).origin == (0.0, 0.0)


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
def test_every_grain_rests_on_every_bed_and_is_read_back(body, bed):
    # Whether it is its own mirror image is looked at below, and takes as long as the rest on a bed of spheres.
    whole = Domain(length=12.0, width=8.0, height=6.0, symmetric=False)
    found = scene(body=body, bed=bed, domain=whole)
    assert loads(dumps(found)) == found
    contacts = find_contacts(found)
    assert np.abs(found.bed_shape.distance(contacts.points)).max() < 2 * found.contact_tolerance


def test_orientation_turns_about_x_then_y_then_z():
    placement = Box(sides=(3, 2, 1), x=5.0, orientation=(90, 0, 90)).placed((0.0, 0.0, 0.0))
    # About x: y goes to z, z to -y; about z: x goes to y, y to -x.
    assert placement.to_scene(np.eye(3)) == pytest.approx(
        np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    )


def test_the_place_across_is_counted_from_the_domains_corner():
    domain = Domain(length=12.0, width=8.0, height=6.0, origin=(100.0, -50.0, 7.0))
    middle, aside = (
        scene(domain=domain, body=Sphere(diameter=1, x=105.0, y=y)).placement for y in (None, -49.0)
    )
    assert middle.centre == pytest.approx((105.0, -46.0, 7.5))
    assert aside.centre == pytest.approx((105.0, -49.0, 7.5))


def test_gravity_is_turned_by_the_slope_of_every_bed():
    for bed in (Inclined(slope=30.0), SphereBed(radius=0.5, spacing=1.0, slope=30.0)):
        found = scene(bed=bed, gravity=Gravity(acceleration=2.0))
        assert found.gravity_vector == pytest.approx([1.0, 0.0, -math.sqrt(3.0)])


def test_mass_and_inertia_are_those_of_the_grain_as_it_is_turned():
    body = Box(sides=(3.0, 2.0, 1.0), x=5.0, density=2.0, orientation=(0, 0, 90))
    mass, inertia = mass_and_inertia(body, scene(body=body).placement)
    assert mass == pytest.approx(12.0)
    assert inertia == pytest.approx(np.diag([9.0 + 1.0, 4.0 + 1.0, 4.0 + 9.0]))  # m (b^2 + c^2)/12


# -- symmetry ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "halved"),
    [
        ({}, True),
        ({"body": Sphere(diameter=1.0, x=5.0, y=3.0)}, False),
        ({"body": Box(sides=(1.0, 0.8, 0.6), x=5.0, orientation=(0, 0, 30))}, False),
        ({"body": Box(sides=(1.0, 0.8, 0.6), x=5.0, orientation=(0, 30, 0))}, True),
        ({"body": Spheres(spheres=((0, 0, 0, 0.5), (0.6, 0, 0, 0.4)), x=5.0)}, True),
        ({"body": Spheres(spheres=((0, 0, 0, 0.5), (0, 0.6, 0, 0.4)), x=5.0)}, False),
        ({"bed": RidgeBed(amplitude=0.1, wavelength=2.0)}, True),
        ({"bed": RidgeBed(amplitude=0.1, wavelength=2.0, angle=20.0)}, False),
        ({"bed": SphereBed(radius=0.5, spacing=1.0, offset=(0.0, 4.0))}, True),
        ({"bed": SphereBed(radius=0.5, spacing=1.0, offset=(0.0, 4.2))}, False),
        ({"flow": ExpressionFlow(components=("z", "y - 4", "0"))}, True),
        ({"flow": ExpressionFlow(components=("z", "0.1*z", "0"))}, False),
        ({"domain": Domain(length=12, width=8, height=6, symmetric=False)}, False),
    ],
)
def test_a_scene_that_is_its_own_mirror_image_is_halved(changes, halved):
    found = scene(**changes)
    assert Setup(found).symmetric is halved
    asked = {**found.domain.model_dump(), "symmetric": True}
    if not halved and found.domain.symmetric is None:
        assert "domain.symmetric: is true, but" in message(
            lambda: scene(**{**changes, "domain": asked})
        )


def test_a_flow_without_a_value_is_refused_where_its_mirror_image_is_looked_at():
    """With the key of the formula: at once where the scene is said to be symmetric, else when it is set up."""
    changes = {
        "flow": ExpressionFlow(components=("1/(x - 1.2)", "0", "0"))
    }  # places are tenths of the length
    why = 'flow.components[0]: "1/(x - 1.2)" is inf at x = 1.2, y = 0, z = 0, t = 0; give a formula'
    assert message(lambda: Setup(scene(**changes)).symmetric).startswith(why)
    asked = Domain(length=12, width=8, height=6, symmetric=True)
    found = message(lambda: scene(**changes, domain=asked))
    assert found.startswith(f"Scene: domain.symmetric: {why}")


def test_the_plan_says_why_the_whole_is_computed():
    words = make_plan(scene(body=Sphere(diameter=1.0, x=5.0, y=3.0))).text()
    assert "the whole of it is computed: the grain's centroid is 1 from mid-width, y = 4" in words
    assert "half of it is computed" in make_plan(scene()).text()


# -- the angle of repose -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("turned", "place", "tangent"),
    # Towards the gap between two spheres the grain turns about their points of contact, towards a sphere about one:
    # sides of the regular tetrahedron of the four centres (Li & Komar 1986, Sedimentology 33, 413, for equal spheres).
    [(90.0, 1.0, 1.0 / math.sqrt(8.0)), (-90.0, -1.0, 1.0 / math.sqrt(2.0))],
)
def test_a_sphere_in_a_pocket_of_spheres_leaves_it_at_the_angle_of_repose(turned, place, tangent):
    repose = math.degrees(math.atan(tangent))
    found = {}
    for slope in (repose - 0.01, repose + 0.01):
        offset = (5.0 - place / math.sqrt(3.0), 4.0)
        bed = SphereBed(radius=0.5, spacing=1.0, angle=turned, offset=offset, slope=slope)
        one = scene(
            body=Sphere(diameter=1.0, x=5.0, density=2.65),
            bed=bed,
            flow=Still(),
            gravity=Gravity(acceleration=10.0),
            contact=Contact(friction=1.0),
        )
        assert one.placement.centre == pytest.approx((5.0, 4.0, math.sqrt(2.0 / 3.0)))
        buoyancy, weight = weights(one)
        force = Forces(np.zeros(3), np.zeros(3), buoyancy, weight)
        torque = Torques(np.zeros(3), np.zeros(3), np.array(one.placement.centre))
        load, inert = (
            load_of(one.placement, force, torque),
            mass_and_inertia(one.body, one.placement),
        )
        found[slope > repose] = judge(load, find_contacts(one), 1.0, inert).equilibrium.moves
    assert found == {False: False, True: True}


def test_a_grain_settles_into_a_pocket():
    bed = SphereBed(radius=0.5, spacing=1.0, arrangement="square", offset=(4.6, 3.6))
    placement = scene(bed=bed, body=Sphere(diameter=1.0, x=5.0, settle=True)).placement
    assert placement.centre == pytest.approx((5.1, 4.1, math.sqrt(0.5)), abs=1e-9)


# -- flows ---------------------------------------------------------------------------------------------


def test_profiles_go_with_the_height_and_formulas_have_three_components():
    points = np.array([[1.0, 2.0], [3.0, 4.0], [0.5, 2.0]])
    assert Setup(scene()).base_flow.velocity(points, 0.0) == pytest.approx(
        np.array([[0.5, 2.0], [0, 0], [0, 0]])
    )
    flow = ExpressionFlow(components=("z*y", "t", "x"))
    changing = scene(flow=flow, time=Time(end=1.0, step=0.1))
    assert Setup(changing).base_flow.velocity(points, 3.0) == pytest.approx(
        np.array([[1.5, 8.0], [3, 3], [1, 2]])
    )


def test_the_inflow_is_at_rest_on_spheres_that_are_higher_than_the_datum():
    bed = SphereBed(radius=0.5, spacing=1.0, arrangement="square")
    found = scene(
        bed=bed, flow=Shear(datum="mean"), body=None, fluid=Fluid(reynolds=1, scale="flow")
    )
    assert 0.2 < Setup(found).base_flow.datum < 0.5
    over_a_sphere, between = Setup(found).base_flow.entering(
        np.array([[0.0, 0.0], [1.0, 1.5], [0.499, 0.499]]), 0.0
    )[0]
    assert over_a_sphere == 0.0 and between == pytest.approx(0.499 - Setup(found).base_flow.datum)


# -- files ---------------------------------------------------------------------------------------------


def test_a_scanned_grain_is_read_once_and_stands_in_the_resolved_scene(tmp_path):
    trimesh.creation.icosphere(1, 0.5).export(tmp_path / "pebble.stl")
    text = dumps(scene()).replace(
        'shape = "sphere"\ndiameter = 1.0', 'shape = "mesh"\nfile = "pebble.stl"\nsize = 2.0'
    )
    (tmp_path / "scene.toml").write_text(text)
    found = load(tmp_path / "scene.toml")
    assert found.grain.size == pytest.approx(2.0) and found.body.file is None
    (tmp_path / "pebble.stl").unlink()
    again = loads(dumps(found))
    assert again == found and again.grain.volume == pytest.approx(found.grain.volume)


def test_a_height_map_is_read_once_and_stands_in_the_resolved_scene(tmp_path):
    np.save(tmp_path / "bed.npy", np.outer(np.ones(5), [0.0, 0.1, 0.2, 0.1, 0.0]))
    data = {"kind": "height-map", "file": str(tmp_path / "bed.npy"), "cell": (3.0, 2.0)}
    found = Scene(**{**scene().model_dump(), "bed": data})
    assert found.bed_shape.height([[6.0, 4.0], [3.0, 1.0]]) == pytest.approx([0.2, 0.1])
    assert loads(dumps(found)) == found
    for key in ("cell", "offset"):
        wrong = {**scene().model_dump(), "bed": {**data, key: 0.1}}
        assert f"bed.{key}: is 0.1; give two lengths" in message(lambda wrong=wrong: Scene(**wrong))


def test_a_capsule_has_the_moments_of_a_cylinder_with_hemispheres_and_lies_on_its_bed():
    """r = 0.5, cylinder h = 1: V = pi r^2 h + 4/3 pi r^3; about the axis rho pi (r^4 h/2 + 8 r^5/15).

    Across: cylinder m (r^2/4 + h^2/12) with m = pi r^2 h; two hemispheres of m = 2/3 pi r^3, each
    m (2/5 r^2 + h^2/4 + 3/8 h r).
    """
    lying = scene(body=Capsule(diameter=1, length=2, x=5, settle=True, density=2))
    r, h, grain = 0.5, 1.0, lying.grain
    tube, end = math.pi * r**2 * h, 2.0 / 3.0 * math.pi * r**3
    assert grain.volume == pytest.approx(tube + 2.0 * end)
    along = tube * r**2 / 2.0 + 2.0 * end * 0.4 * r**2
    across = tube * (r**2 / 4.0 + h**2 / 12.0)
    across += 2.0 * end * (0.4 * r**2 + h**2 / 4.0 + 0.375 * h * r)
    assert np.diag(grain.inertia) == pytest.approx([across, along, across])
    assert grain.size == pytest.approx(2.0)
    assert grain.level([[0.0, 1.0, 0.0], [0.5, 0.3, 0.0], [0.0, 1.2, 0.0]]) == pytest.approx(
        [0.0, 0.0, 0.2], abs=1e-12
    )
    assert lying.placement.centre[2] == pytest.approx(0.5, abs=1e-8)
    assert "length: is 1, no more than the diameter" in message(
        lambda: Capsule(diameter=1, length=1, x=5)
    )


def test_a_scanned_bed_is_the_upper_side_of_its_triangles(tmp_path):
    x, y = np.meshgrid(np.linspace(0.0, 12.0, 25), np.linspace(0.0, 8.0, 17), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), 3.0 + 0.1 * x.ravel()])
    corner = np.arange(25 * 17).reshape(25, 17)[:-1, :-1].ravel()
    triangles = np.vstack(
        [
            np.column_stack([corner, corner + 17, corner + 1]),
            np.column_stack([corner + 17, corner + 18, corner + 1]),
        ]
    )
    trimesh.Trimesh(points, triangles, process=False).export(tmp_path / "bed.ply")
    data = {"kind": "mesh", "file": str(tmp_path / "bed.ply"), "cell": (0.5, 0.5)}
    found = Scene(**{**scene().model_dump(), "bed": data})
    assert found.bed_shape.height([[4.0, 3.0], [8.1, 5.3]]) == pytest.approx([0.4, 0.81], abs=1e-6)
    assert loads(dumps(found)) == found
    trimesh.Trimesh(points, triangles[1:], process=False).export(tmp_path / "bed.ply")
    assert "has a hole as seen from above" in message(
        lambda: Scene(**{**scene().model_dump(), "bed": data})
    )


# -- coarse runs ---------------------------------------------------------------------------------------


def test_a_larger_domain_is_wider_too_unless_walls_are_at_its_sides():
    larger = farther(scene()).domain
    assert (larger.length, larger.width, larger.height) == (18.0, 12.0, 9.0)
    assert larger.origin == (-3.0, -2.0, 0.0)
    walled = Domain(length=12.0, width=8.0, height=6.0, sides="wall")
    assert farther(scene(domain=walled)).domain.width == 8.0
    across = Cylinder(diameter=1, length=8, centre=(5, 4, 3))
    assert farther(scene(body=across)).domain.width == 8.0
    assert (
        len(coarse_scenes(scene(contact=Contact(friction=0.5)))) == 5
    )  # three gaps; two larger domains


# -- wrong scenes --------------------------------------------------------------------------------------

WRONG = [
    (
        {"domain": Domain(length=12, height=6)},
        'body.shape: domain.width is missing, which the three-dimensional "sphere"',
    ),
    (
        {"body": Disc(diameter=1, x=5)},
        'body.shape: "disc" is two-dimensional, but domain.width makes',
    ),
    ({"bed": HalfDiscs(radius=0.5, spacing=1)}, 'bed.kind: "half-discs" is two-dimensional, but'),
    ({"flow": ExpressionFlow(components=("y", "0"))}, "flow.components: has 2 items; give three"),
    (
        {"body": Sphere(diameter=1, x=5, y=8.5)},
        "body.x: y = 8.5 is outside the domain, 0 to 8; move",
    ),
    (
        {"body": Sphere(diameter=1, x=5, y=7.8)},
        "body.x: the grain reaches y = 8.3, the domain's side at largest y",
    ),
    ({"body": Sphere(diameter=1, x=0.2)}, "body.x: the grain reaches x = -0.3"),
    (
        {"body": Sphere(diameter=7, x=5)},
        "body.x: the grain reaches z = 7, the domain's top is at 6",
    ),
    (
        {"body": Sphere(diameter=1, centre=(5, 4, 0.3))},
        "body.centre: the grain reaches 0.2 into the bed; raise",
    ),
    (
        {"body": Sphere(diameter=1, centre=(5, 4, 5.8))},
        "body.centre: the grain reaches z = 6.3, the domain's top",
    ),
    (
        {"body": Cylinder(diameter=1, length=7, centre=(5, 4, 3))},
        "body.length: the cylinder reaches from y = 0.5 to 7.5, the domain from 0 to 8; give domain.width",
    ),
    (
        {"bed": SphereBed(radius=7, spacing=14)},
        "bed: rises to z = 7, the top is at 6; enlarge domain.height",
    ),
    (
        {"bed": HeightMapBed(heights=((0.0, 0.1), (0.0, 0.1)), cell=(4.0, 8.0))},
        "bed: reaches from x = 0 to 4, the domain from 0 to 12; enlarge its cell",
    ),
    (
        {"effects": Effects(third_dimension=False)},
        "effects.third_dimension: is false but domain.width is given",
    ),
    (
        {"bed": SphereBed(radius=0.5, spacing=1, slope=10)},
        "bed.slope: a slope turns gravity but there is no",
    ),
    (
        {"domain": Domain(length=1e20, width=8, height=6)},
        "domain.length: is so large that numbers there are",
    ),
]
WRONG_KEYS = [
    (
        lambda: Domain(length=1, height=1, sides="slip"),
        "Domain: sides: needs width, which is not given; add",
    ),
    (
        lambda: Domain(length=1, height=1, symmetric=True),
        "Domain: symmetric: needs width, which is not",
    ),
    (
        lambda: Domain(length=1, height=1, width=1, symmetric="no"),
        'Domain: symmetric: is "no"; use "auto"',
    ),
    (
        lambda: Domain(length=1, height=1, width=1, origin=(1, 2)),
        "Domain: origin: has 2 items; give three, as",
    ),
    (
        lambda: Sphere(diameter=1),
        "Sphere: x: neither x nor centre is given; give x to rest on the bed",
    ),
    (
        lambda: Sphere(diameter=1, y=1, centre=(1, 1, 1)),
        "Sphere: y: goes with x, but centre is given; leave",
    ),
    (
        lambda: Cylinder(diameter=1, length=1, x=1),
        "Cylinder: x: a cylinder is fixed and does not rest on a bed; give",
    ),
    (
        lambda: Cylinder(diameter=1, length=1, centre=(1, 1, 1), motion="free", density=1),
        "Cylinder: motion: a cylinder across the flow is fixed",
    ),
    (
        lambda: Cylinder(diameter=1, length=1, centre=(1, 1, 1), orientation=(90, 0, 0)),
        "Cylinder: orientation: a cylinder lies across the flow; leave it out",
    ),
    (
        lambda: Sphere(diameter=1, centre=(1, 1)),
        "Sphere: centre: has 2 items; give three, as in [x, y, z]",
    ),
    (
        lambda: Box(sides=(1, 1, 1), edge_radius=0.6, x=1),
        "Box: edge_radius: edge_radius 0.6 is not between",
    ),
    (lambda: Polyhedron(vertices=((0, 0, 0),) * 4, x=1), "Polyhedron: vertices: "),
    (
        lambda: Spheres(spheres=((0, 0, 0),), x=1),
        "Spheres: spheres[0]: has 3 items; give four, as in",
    ),
    (lambda: Spheres(spheres=((0, 0, 0, 1), (5, 0, 0, 1)), x=1), "Spheres: spheres: "),
    (lambda: Mesh(x=1), "Mesh: file: neither file nor vertices is given; give the name of an STL"),
    (
        lambda: Mesh(file="nothing.stl", x=1),
        "Mesh: file: nothing.stl cannot be read (No such file or directory); give the name",
    ),
    (
        lambda: Mesh(vertices=TETRAHEDRON, triangles=((0, 1, 2),), x=1),
        "Mesh: triangles: the surface is not watertight",
    ),
    (
        lambda: SphereBed(radius=1, spacing=1),
        "SphereBed: spacing: 1 is less than two radii, 2: the spheres",
    ),
    (
        lambda: SphereBed(radius=1, spacing=4, layers=2),
        "SphereBed: layers: spheres so far apart carry no further",
    ),
    (
        lambda: SphereBed(radius=1, spacing=4, seed=1),
        "SphereBed: seed: is read only for a random arrangement",
    ),
    (
        lambda: HeapBed(),
        "HeapBed: file: neither file nor spheres is given; give the name of a CSV file",
    ),
    (
        lambda: HeapBed(file="none.csv"),
        "HeapBed: file: none.csv cannot be read (No such file or directory)",
    ),
    (
        lambda: HeapBed(spheres=()),
        "HeapBed: spheres: a bed of spheres has none; give one or more",
    ),
    (
        lambda: HeapBed(spheres=((0, 0, 0, -1),)),
        "HeapBed: spheres[0][3]: is -1; give a number greater than 0",
    ),
    (
        lambda: MeshBed(file="bed.png"),
        "MeshBed: file: bed.png cannot be read (No such file or directory); give the name of an STL",
    ),
    (
        lambda: HeightMapBed(),
        "HeightMapBed: file: neither file nor heights is given; give the name",
    ),
    (
        lambda: HeightMapBed(heights=((0, 0), (0,)), cell=(1, 1)),
        "HeightMapBed: heights: are in rows of different",
    ),
    (
        lambda: HeightMapBed(heights=((0, 0), (0, 0))),
        "HeightMapBed: cell: is missing; give the spacing",
    ),
]


@pytest.mark.parametrize(("changes", "words"), WRONG)
def test_one_line_for_every_wrong_scene(changes, words):
    assert words in message(lambda: scene(**changes))


@pytest.mark.parametrize(("build", "words"), WRONG_KEYS)
def test_one_line_for_every_wrong_key(build, words):
    assert message(build).startswith(words)


def test_a_broken_file_of_triangles_is_told(tmp_path):
    (tmp_path / "broken.stl").write_text("solid nothing\nendsolid\n")
    assert "broken.stl" in message(lambda: Mesh(file=str(tmp_path / "broken.stl"), x=1.0))
    surface = trimesh.creation.icosphere(1, 0.5)
    surface.update_faces(np.arange(len(surface.faces)) > 0)
    surface.export(tmp_path / "open.stl")
    found = message(lambda: Mesh(file=str(tmp_path / "open.stl"), x=1.0))
    assert "is not watertight" in found and "open.stl" in found


def test_remedies_name_grains_of_the_scenes_dimension():
    text = '[domain]\nlength=1\nheight=1\n{}[fluid]\nreynolds=1\nscale="flow"\n[flow]\nkind="shear"\n[body]\nx=1\n'
    planar = message(lambda: loads(text.format("")))
    spatial = message(lambda: loads(text.format("width=1\n")))
    assert '"discs"' in planar and '"sphere"' not in planar
    assert '"sphere"' in spatial and '"disc"' not in spatial


def test_editors_know_scenes_in_space():
    definitions = schema()["definitions"]
    assert definitions["Sphere"]["required"] == ["shape", "diameter"]
    assert "width" in definitions["Domain"]["properties"]


def test_numerics_are_those_of_the_plane():
    plan = make_plan(scene(numerics=Numerics(order=3)))
    assert plan.order == 3 and plan.solver.name == "block" and plan.stabilisation.upwind
    plain = make_plan(scene(numerics=Numerics(stabilisation="off")))
    assert (
        plain.solver.name == "block" and not plain.stabilisation.present
    )  # its cells do not convect much
    fast = make_plan(
        scene(fluid=Fluid(reynolds=1000, scale="grain"), numerics=Numerics(stabilisation="off"))
    )
    assert fast.solver.name == "direct"
    creeping = Fluid(reynolds=1, scale="grain", inertia=False)
    assert make_plan(scene(fluid=creeping)).solver.name == "two-level"
    assert make_plan(scene(fluid=creeping, numerics=Numerics(order=2))).solver.name == "block"


def test_a_scanned_grain_is_seen_to_be_none_of_its_mirror_image_at_few_points(
    tmp_path, monkeypatch
):
    """Each point is compared with each triangle: with all points the plan of a pebble of 5,000 took half a minute."""
    from incipient.geometry import Triangulated

    ball = trimesh.creation.icosphere(3)
    ball.vertices[:, 1] *= 1.0 + 0.1 * ball.vertices[:, 1]
    ball.export(tmp_path / "grain.ply")
    asked = []
    level = Triangulated.level

    def counted(self, x):
        asked.append(len(x))
        return level(self, x)

    monkeypatch.setattr(Triangulated, "level", counted)
    body = {
        "shape": "mesh",
        "file": str(tmp_path / "grain.ply"),
        "size": 1.0,
        "centre": (6.0, 4.0, 2.0),
    }
    found = Scene(
        **{**scene().model_dump(exclude={"contact", "gravity"}), "bed": None, "body": body}
    )
    assert not Setup(found).symmetric
    assert 0 < sum(asked) < 1000


def test_a_heap_of_spheres_from_a_file(tmp_path):
    """Heights of each sphere's top, of posts too, and the plane between; the same scene by the file and by numbers."""
    (tmp_path / "heap.csv").write_text("x,y,z,radius\n4.6,3.5,0.1,0.5\n6.0,4.0,0.0,0.7\n")
    data = {"kind": "heap", "file": str(tmp_path / "heap.csv"), "posts": [(2.0, 4.0, 0.6, 0.4)]}
    found = scene(bed=data)
    assert found == scene(
        bed=HeapBed(
            spheres=((4.6, 3.5, 0.1, 0.5), (6.0, 4.0, 0.0, 0.7)), posts=((2.0, 4.0, 0.6, 0.4),)
        )
    )
    heights = found.bed_shape.height([[4.6, 3.5], [6.0, 4.0], [2.0, 4.0], [1.0, 1.0]])
    assert heights == pytest.approx([0.6, 0.7, 1.0, 0.0])
    # Below its top a post is solid down to the plane: the nearest point is straight beside it.
    beside = [[1.4, 4.0, 0.3]]
    assert found.bed_shape.distance(beside)[0] == pytest.approx(0.2)
    assert found.bed_shape.nearest(beside)[0] == pytest.approx([1.6, 4.0, 0.3])
