"""Sections of scenes in 2-D and 3-D, orders and tolerances."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from domains import unit_box
from pydantic import ValidationError
from scenes import BOX, FLOW_SCALE, message, scene
from scenes import sphere_on_plane as sphere_scene

from incipient.accuracy.coarse_runs import changed, comparisons, farther
from incipient.accuracy.errorbars import coarse_scenes
from incipient.contact import Load
from incipient.contact.safety import safety_factor
from incipient.contact.verdict import judge
from incipient.fluid import FlowModel, Prescribed
from incipient.fluid import Fluid as FlowFluid
from incipient.fluid.transient import LEAST, ShareOfError, Transient, of_steps
from incipient.geometry.plane import beds as bed_geometry
from incipient.geometry.plane import grains as grain_geometry
from incipient.geometry.plane.beds import Polyline as PolylineBed
from incipient.planning.discretisation import STEADY, of_steady, order_of
from incipient.planning.effects import inertia
from incipient.planning.plan import make_plan
from incipient.results.contact_verdict import find_contacts, load_of
from incipient.results.loads import Forces, Torques
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
    Mesh,
    MeshBed,
    Numerics,
    OpenChannel,
    Poiseuille,
    Polygon,
    Polyhedron,
    Polyline,
    Rectangle,
    RidgeBed,
    Scene,
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
from incipient.scene.example import grain_in_pocket, grain_on_bed
from incipient.scene.file import dumps, load, loads, schema
from incipient.scene.mass import mass_and_inertia
from incipient.scene.messages import variants
from incipient.setup.setup import Setup
from incipient.simulation.loads import weights

# Scenes built from Python: what follows from them.


def test_a_cavity_in_three_words():
    cavity = Scene(domain=BOX, fluid=FLOW_SCALE, flow=Lid(velocity=1))
    assert cavity.gdim == 2
    assert cavity.top == "wall"
    assert cavity.viscosity == 0.01
    assert cavity.grain is cavity.bed_shape is cavity.placement is None
    assert cavity.contact_gap == cavity.contact_tolerance == 0.0
    np.testing.assert_array_equal(cavity.gravity_vector, [0.0, 0.0])


@pytest.mark.parametrize(
    ("flow", "velocity"),
    [
        (Shear(rate=3), 6.0),
        (Uniform(velocity=4), 4.0),
        (LogLaw(shear_velocity=4), 4.0),
        (Poiseuille(velocity=4), 4.0),
        (OpenChannel(velocity=4), 4.0),
        (ExpressionFlow(components=("y", "0"), velocity=4), 4.0),
        (Still(velocity=4), 4.0),
    ],
)
def test_scaling_on_the_grain(flow, velocity):
    """nu = V L / Re with L = 2, the largest diameter, and V = rate L in shear."""
    found = scene(flow=flow, body=Ellipse(semi_axes=(0.5, 1), x=4))
    assert found.reference_length == 2.0
    assert found.reference_velocity == velocity
    assert found.viscosity == pytest.approx(velocity * 2.0 / 20.0, rel=1e-15)


def test_scaling_on_the_flow():
    found = scene(fluid=FLOW_SCALE, flow=Shear(rate=0.5))
    assert (found.reference_length, found.reference_velocity) == (6.0, 3.0)
    assert found.viscosity == pytest.approx(3.0 * 6.0 / 100.0, rel=1e-15)


@pytest.mark.parametrize(
    ("flow", "top"),
    [
        (Shear(), "stream"),
        (Uniform(), "stream"),
        (LogLaw(), "stream"),
        (ExpressionFlow(components=("y", "0")), "stream"),
        (Poiseuille(), "wall"),
        (OpenChannel(), "slip"),
        (Still(), "wall"),
    ],
)
def test_the_top_that_suits_the_flow(flow, top):
    assert scene(flow=flow).top == top


def test_a_stated_top_holds():
    assert scene(domain=Domain(length=12, height=6, top="slip")).top == "slip"


def test_sides_of_the_domain():
    domain = Domain(length=12, height=6, origin=(-4, 1))
    assert (domain.left, domain.right, domain.bottom, domain.ceiling) == (-4.0, 8.0, 1.0, 7.0)


def test_gravity_points_down_and_turns_with_the_slope():
    """On a bed that falls by 30 degrees: g sin 30 along the stream, g cos 30 into the bed."""
    np.testing.assert_array_equal(
        scene(gravity=Gravity(acceleration=10)).gravity_vector, [0.0, -10.0]
    )
    inclined = scene(bed=Inclined(slope=30), gravity=Gravity(acceleration=10))
    np.testing.assert_allclose(inclined.gravity_vector, [5.0, -10 * math.sqrt(0.75)], rtol=1e-15)


def test_shapes_become_geometry():
    shapes = {
        Disc(diameter=1, x=4): grain_geometry.Disc(1.0),
        Ellipse(semi_axes=(1, 0.5), x=4): grain_geometry.Ellipse((1.0, 0.5)),
        Rectangle(width=1, height=2, corner_radius=0.1, x=4): grain_geometry.Rectangle(
            1.0, 2.0, 0.1
        ),
        Polygon(vertices=[(0, 0), (1, 0), (0, 1)], x=4): grain_geometry.Polygon(
            [(0, 0), (1, 0), (0, 1)]
        ),
        Superellipse(semi_axes=(1, 0.5), exponent=4, x=4): grain_geometry.Superellipse(
            (1.0, 0.5), 4.0
        ),
        Star(radius=0.5, cosines=(0, 0.1), x=4): grain_geometry.Star(0.5, (0.0, 0.1)),
        Discs(discs=[(0, 0, 0.5), (0.5, 0, 0.4)], x=4): grain_geometry.Discs(
            [(0, 0), (0.5, 0)], [0.5, 0.4]
        ),
    }
    for body, geometry in shapes.items():
        assert scene(body=body).grain == geometry


def test_beds_become_geometry_on_the_lower_side_of_the_domain():
    domain = Domain(length=12, height=6, origin=(0, 2))
    beds = {
        Flat(): bed_geometry.Flat(2.0),
        Sinusoidal(amplitude=0.1, wavelength=2, phase=90): bed_geometry.Sinusoidal(
            0.1, 2.0, math.pi / 2, 2.0
        ),
        HalfDiscs(radius=0.5, spacing=1, offset=0.2): bed_geometry.HalfDiscs(0.5, 1.0, 0.2, 2.0),
        Polyline(points=[(0, 0), (12, 1)]): PolylineBed([(0, 0), (12, 1)], 2.0),
    }
    for bed, geometry in beds.items():
        assert scene(domain=domain, bed=bed).bed_shape == geometry
    inclined = scene(domain=domain, bed=Inclined(slope=3), gravity=Gravity(acceleration=1))
    assert inclined.bed_shape == bed_geometry.Flat(2.0)


def test_a_grain_rests_where_it_touches():
    """A disc of diameter 1: centre half a diameter above a plane, sqrt(3)/2 above a saddle of discs."""
    domain = Domain(length=12, height=6, origin=(0, 2))
    assert scene(domain=domain).placement.centre == pytest.approx((4.0, 2.5), rel=1e-12)
    saddle = scene(bed=HalfDiscs(radius=0.5, spacing=1, offset=0.5))
    assert saddle.placement.centre == pytest.approx((4.0, math.sqrt(0.75)), rel=1e-12)


def test_a_grain_is_held_where_it_is_put():
    held = scene(body=Ellipse(semi_axes=(1, 0.5), centre=(3, 2), angle=90), bed=None)
    assert held.placement.centre == (3.0, 2.0)
    assert held.placement.angle == pytest.approx(math.pi / 2)
    assert scene(body=Disc(diameter=1, centre=(4, 0.501))).placement.centre == (4.0, 0.501)


def test_a_grain_settles_if_asked_to():
    """A box tilted by 20 degrees stays so, or falls onto its face: half its height above the bed."""
    tilted = {"width": 1.0, "height": 0.6, "x": 4.0, "angle": 20.0}
    assert scene(body=Rectangle(**tilted)).placement.angle == pytest.approx(math.radians(20.0))
    settled = scene(body=Rectangle(**tilted, settle=True)).placement
    assert settled.angle == pytest.approx(0.0, abs=1e-12)
    assert settled.centre[1] == pytest.approx(0.3, rel=1e-12)


def test_a_grain_settles_by_friction_or_without():
    """By friction it stays where contacts first hold it; without, in the one rest that friction has no part in."""
    bed = HalfDiscs(radius=0.5, spacing=1.4, offset=0)

    def rest(settle, friction):
        body = Ellipse(semi_axes=(0.6, 0.4), x=4.2, angle=20, density=2.0, settle=settle)
        found = scene(body=body, bed=bed, contact=Contact(friction=friction))
        load = Load(np.zeros(3), np.zeros(3), [0, -1, 0], [*found.placement.centre, 0])
        return found.placement, safety_factor(load, find_contacts(found), 0.0).held

    alone, held = rest("frictionless", 0.8)
    assert held
    assert rest("frictionless", 0.1)[0] == alone
    by_friction, held = rest(True, 0.8)
    assert not held
    assert by_friction.centre[1] > alone.centre[1]


@pytest.mark.parametrize("given", ["slide", 1, None])
def test_how_a_grain_settles_is_true_false_or_frictionless(given):
    assert "settle: is " in message(lambda: Disc(diameter=1, x=4.2, settle=given))


def test_a_disc_settles_into_the_pocket_of_two_half_discs():
    """The centres of three discs of diameter 1 that touch form an equilateral triangle."""
    body = Disc(diameter=1, x=4.2, settle=True)
    settled = scene(body=body, bed=HalfDiscs(radius=0.5, spacing=1, offset=0)).placement
    assert settled.centre == pytest.approx((4.5, math.sqrt(0.75)), rel=1e-10)


def test_friction_of_the_scene_holds_a_box_on_a_slope():
    """tan 20 degrees = 0.364: a box stays with friction 0.4 and slides off with 0.3."""
    changes = {
        "body": Rectangle(width=1, height=0.5, x=4, settle=True),
        "bed": Inclined(slope=20),
        "gravity": Gravity(acceleration=10),
    }
    stays = scene(**changes, contact=Contact(friction=0.4)).placement
    assert stays.centre == pytest.approx((4.0, 0.25), rel=1e-12)
    refused = message(lambda: scene(**changes, contact=Contact(friction=0.3)))
    assert refused.startswith("Scene: body.x: the grain rolls off")
    level = Rectangle(width=1, height=0.5, x=4, settle="level")
    found = scene(**{**changes, "body": level}, contact=Contact(friction=0.3))
    assert found.placement.centre == pytest.approx((4.0, 0.25), rel=1e-12)
    turned = 10.0 * math.sin(math.radians(20.0))
    assert found.gravity_vector[0] == pytest.approx(turned)


def test_gap_and_tolerance_are_lengths():
    found = scene(
        body=Disc(diameter=2, x=4), contact=Contact(friction=0.5, gap=0.02, tolerance=1e-5)
    )
    assert (found.contact_gap, found.contact_tolerance) == (0.04, 2e-5)
    assert scene().contact_gap == 0.01


def test_expressions_know_whether_they_depend_on_time():
    assert not ExpressionFlow(components=("where(y < 1, y, 1)", "0")).changes
    unsteady = ExpressionFlow(components=("y*sin(t)", "0"))
    assert unsteady.changes
    assert scene(flow=unsteady, time=Time(end=1, step=0.1)).flow == unsteady


def test_scenes_are_immutable_and_hashable():
    found = scene()
    with pytest.raises(ValidationError, match="frozen"):
        found.title = "other"
    assert hash(found) == hash(scene())


def test_numbers_may_come_from_numpy():
    assert Fluid(reynolds=np.float64(3), scale="flow").reynolds == 3.0
    assert Domain(length=1, height=1, origin=np.array([1.0, 2.0]).tolist()).origin == (1.0, 2.0)


def test_every_key_is_described():
    pending, seen = [Scene], set()
    while pending:
        section = pending.pop()
        seen.add(section)
        for name, field in section.model_fields.items():
            assert field.description, f"{section.__name__}.{name}"
            pending += [option for option in variants(field.annotation) if option not in seen]
    # Scene, sections, the wave and the gust in one each, flows, shapes, beds; plane + space.
    assert len(seen) == 1 + 13 + 1 + 9 + (7 + 9) + (5 + 5)


def test_import_loads_no_finite_elements():
    code = (
        "import sys, incipient.scene; "
        "print([m for m in ('dolfinx', 'gmsh', 'petsc4py', 'mpi4py', 'pyvista') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_beds_are_allowed_below_a_grain_held_above_them():
    assert (
        scene(body=Disc(diameter=1, centre=(4, 3)), bed=Sinusoidal(amplitude=0.5, wavelength=3)).bed
        is not None
    )


def test_a_box_may_hold_still_fluid_a_bed_and_a_grain():
    found = scene(
        domain=Domain(kind="box", length=4, height=4), flow=Still(), body=Disc(diameter=1, x=2)
    )
    assert found.top == "wall"


# Scenes in space: what they are made of, where the grain comes to rest, their symmetry, what wrong ones are told.


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
    found = sphere_scene()
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
    found = sphere_scene(body=body, bed=bed, domain=whole)
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
        sphere_scene(domain=domain, body=Sphere(diameter=1, x=105.0, y=y)).placement
        for y in (None, -49.0)
    )
    assert middle.centre == pytest.approx((105.0, -46.0, 7.5))
    assert aside.centre == pytest.approx((105.0, -49.0, 7.5))


def test_gravity_is_turned_by_the_slope_of_every_bed():
    for bed in (Inclined(slope=30.0), SphereBed(radius=0.5, spacing=1.0, slope=30.0)):
        found = sphere_scene(bed=bed, gravity=Gravity(acceleration=2.0))
        assert found.gravity_vector == pytest.approx([1.0, 0.0, -math.sqrt(3.0)])


def test_mass_and_inertia_are_those_of_the_grain_as_it_is_turned():
    body = Box(sides=(3.0, 2.0, 1.0), x=5.0, density=2.0, orientation=(0, 0, 90))
    mass, inertia = mass_and_inertia(body, sphere_scene(body=body).placement)
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
    found = sphere_scene(**changes)
    assert Setup(found).symmetric is halved
    asked = {**found.domain.model_dump(), "symmetric": True}
    if not halved and found.domain.symmetric is None:
        assert "domain.symmetric: is true, but" in message(
            lambda: sphere_scene(**{**changes, "domain": asked})
        )


def test_a_flow_without_a_value_is_refused_where_its_mirror_image_is_looked_at():
    """With the key of the formula: at once where the scene is said to be symmetric, else when it is set up."""
    changes = {
        "flow": ExpressionFlow(components=("1/(x - 1.2)", "0", "0"))
    }  # places are tenths of the length
    why = 'flow.components[0]: "1/(x - 1.2)" is inf at x = 1.2, y = 0, z = 0, t = 0; give a formula'
    assert message(lambda: Setup(sphere_scene(**changes)).symmetric).startswith(why)
    asked = Domain(length=12, width=8, height=6, symmetric=True)
    found = message(lambda: sphere_scene(**changes, domain=asked))
    assert found.startswith(f"Scene: domain.symmetric: {why}")


def test_the_plan_says_why_the_whole_is_computed():
    words = make_plan(sphere_scene(body=Sphere(diameter=1.0, x=5.0, y=3.0))).text()
    assert "the whole of it is computed: the grain's centroid is 1 from mid-width, y = 4" in words
    assert "half of it is computed" in make_plan(sphere_scene()).text()


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
        one = sphere_scene(
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
    placement = sphere_scene(bed=bed, body=Sphere(diameter=1.0, x=5.0, settle=True)).placement
    assert placement.centre == pytest.approx((5.1, 4.1, math.sqrt(0.5)), abs=1e-9)


# -- flows ---------------------------------------------------------------------------------------------


def test_profiles_go_with_the_height_and_formulas_have_three_components():
    points = np.array([[1.0, 2.0], [3.0, 4.0], [0.5, 2.0]])
    assert Setup(sphere_scene()).base_flow.velocity(points, 0.0) == pytest.approx(
        np.array([[0.5, 2.0], [0, 0], [0, 0]])
    )
    flow = ExpressionFlow(components=("z*y", "t", "x"))
    changing = sphere_scene(flow=flow, time=Time(end=1.0, step=0.1))
    assert Setup(changing).base_flow.velocity(points, 3.0) == pytest.approx(
        np.array([[1.5, 8.0], [3, 3], [1, 2]])
    )


def test_the_inflow_is_at_rest_on_spheres_that_are_higher_than_the_datum():
    bed = SphereBed(radius=0.5, spacing=1.0, arrangement="square")
    found = sphere_scene(
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
    text = dumps(sphere_scene()).replace(
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
    found = Scene(**{**sphere_scene().model_dump(), "bed": data})
    assert found.bed_shape.height([[6.0, 4.0], [3.0, 1.0]]) == pytest.approx([0.2, 0.1])
    assert loads(dumps(found)) == found
    for key in ("cell", "offset"):
        wrong = {**sphere_scene().model_dump(), "bed": {**data, key: 0.1}}
        assert f"bed.{key}: is 0.1; give a list in [brackets]" in message(
            lambda wrong=wrong: Scene(**wrong)
        )


def test_a_capsule_has_the_moments_of_a_cylinder_with_hemispheres_and_lies_on_its_bed():
    """r = 0.5, cylinder h = 1: V = pi r^2 h + 4/3 pi r^3; about the axis rho pi (r^4 h/2 + 8 r^5/15).

    Across: cylinder m (r^2/4 + h^2/12) with m = pi r^2 h; two hemispheres of m = 2/3 pi r^3, each
    m (2/5 r^2 + h^2/4 + 3/8 h r).
    """
    lying = sphere_scene(body=Capsule(diameter=1, length=2, x=5, settle=True, density=2))
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
    found = Scene(**{**sphere_scene().model_dump(), "bed": data})
    assert found.bed_shape.height([[4.0, 3.0], [8.1, 5.3]]) == pytest.approx([0.4, 0.81], abs=1e-6)
    assert loads(dumps(found)) == found
    trimesh.Trimesh(points, triangles[1:], process=False).export(tmp_path / "bed.ply")
    assert "has a hole as seen from above" in message(
        lambda: Scene(**{**sphere_scene().model_dump(), "bed": data})
    )


# -- coarse runs ---------------------------------------------------------------------------------------


def test_a_larger_domain_is_wider_too_unless_walls_are_at_its_sides():
    larger = farther(sphere_scene()).domain
    assert (larger.length, larger.width, larger.height) == (18.0, 12.0, 9.0)
    assert larger.origin == (-3.0, -2.0, 0.0)
    walled = Domain(length=12.0, width=8.0, height=6.0, sides="wall")
    assert farther(sphere_scene(domain=walled)).domain.width == 8.0
    across = Cylinder(diameter=1, length=8, centre=(5, 4, 3))
    assert farther(sphere_scene(body=across)).domain.width == 8.0
    assert (
        len(coarse_scenes(sphere_scene(contact=Contact(friction=0.5)))) == 5
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
    assert words in message(lambda: sphere_scene(**changes))


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
    plan = make_plan(sphere_scene(numerics=Numerics(order=3)))
    assert plan.order == 3 and plan.solver.name == "block" and plan.stabilisation.upwind
    plain = make_plan(sphere_scene(numerics=Numerics(stabilisation="off")))
    assert (
        plain.solver.name == "block" and not plain.stabilisation.present
    )  # its cells do not convect much
    fast = make_plan(
        sphere_scene(
            fluid=Fluid(reynolds=1000, scale="grain"), numerics=Numerics(stabilisation="off")
        )
    )
    assert fast.solver.name == "direct"
    creeping = Fluid(reynolds=1, scale="grain", inertia=False)
    assert make_plan(sphere_scene(fluid=creeping)).solver.name == "two-level"
    assert (
        make_plan(sphere_scene(fluid=creeping, numerics=Numerics(order=2))).solver.name == "block"
    )


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
        **{**sphere_scene().model_dump(exclude={"contact", "gravity"}), "bed": None, "body": body}
    )
    assert not Setup(found).symmetric
    assert 0 < sum(asked) < 1000


def test_a_heap_of_spheres_from_a_file(tmp_path):
    """Heights of each sphere's top, of posts too, and the plane between; the same scene by the file and by numbers."""
    (tmp_path / "heap.csv").write_text("x,y,z,radius\n4.6,3.5,0.1,0.5\n6.0,4.0,0.0,0.7\n")
    data = {"kind": "heap", "file": str(tmp_path / "heap.csv"), "posts": [(2.0, 4.0, 0.6, 0.4)]}
    found = sphere_scene(bed=data)
    assert found == sphere_scene(
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


# What iterations may leave: given, or a share of a step's own error.


def vortex(x: np.ndarray, t: float) -> np.ndarray:
    return np.sin(4 * t) * np.vstack([np.sin(3 * x[1]), np.sin(2 * x[0])])


@pytest.fixture
def fluid() -> Any:
    sides = [Prescribed(name, vortex) for name in ("left", "right", "bottom", "top")]
    with FlowFluid(unit_box(2, 3), FlowModel(unsteady=True), sides, reynolds=50.0) as made:
        yield made


@pytest.mark.parametrize(
    ("error", "expected"), [(None, 1e-6), (1e-3, 2e-4), (1e-5, 2e-6), (1e-12, 1e-8), (1.0, 1e-3)]
)
def test_a_share_of_the_error_between_bounds(error: float | None, expected: float) -> None:
    assert ShareOfError(0.2, 1e-6, 1e-8, 1e-3).after(error) == pytest.approx(expected)


def test_auto_and_given() -> None:
    assert (of_steady("auto"), of_steady(1e-4)) == (STEADY, 1e-4)
    assert (of_steps("auto"), of_steps(1e-4), of_steps(1e-14)) == (ShareOfError(), 1e-4, LEAST)


def test_each_step_is_solved_to_a_share_of_the_error_of_the_one_before(fluid: FlowFluid) -> None:
    """The tolerance follows the error as it grows and falls, and is kept by the error left."""
    asked = ShareOfError(0.1, 1e-7, 1e-12, 1.0)
    steps = list(Transient(fluid, tolerance=asked).march(1.0, 0.02))
    errors = [None, *(step.error for step in steps)]
    for step, error in zip(steps, errors, strict=False):
        assert step.tolerance == asked.after(error)
        assert step.report.error <= step.tolerance
    known = [step.error for step in steps if step.error]
    assert max(known) > 3 * min(known)


def test_one_correction_a_step_is_enough_for_most(fluid: FlowFluid) -> None:
    """What is left then is indeed below the tolerance, as a solution to round-off shows step by step."""
    transient = Transient(fluid, tolerance=ShareOfError(0.1, 1e-7, 1e-12, 1.0))
    alone = 0
    for step in transient.march(1.0, 0.02):
        if step.report.iterations == 1:
            alone += 1
            found = fluid.state.x.array.copy()
            fluid.correct()
            left = fluid.squared_velocities(fluid.state.x.array - found) ** 0.5
            assert left <= step.tolerance * fluid.squared_velocities(found) ** 0.5
            fluid.state.x.array[:] = found
            fluid.renew_factors()
    assert alone > 0


def test_corrections_are_saved(fluid: FlowFluid) -> None:
    """Over a whole run with the default: fewer than two thirds of what solving to 1e-9 takes."""
    counts = []
    for tolerance in (ShareOfError(), 1e-9):
        fluid.time, fluid.state.x.array[:] = 0.0, 0.0
        steps = list(Transient(fluid, tolerance=tolerance).march(1.0, 0.01))
        counts.append(sum(step.report.iterations for step in steps))
    assert counts[0] < 2 / 3 * counts[1]


@pytest.mark.parametrize("order", [1, 2])
def test_errors_told_by_states_of_two_meshes_are_not_believed(fluid: FlowFluid, order: int) -> None:
    """The tolerance after a new mesh goes by the error before it, in a run that is resumed in between as well."""
    transient = Transient(fluid, order, ShareOfError())
    list(transient.march(0.5, 0.1))
    new_mesh, small = fluid.time, 1e-9
    transient.continue_on(fluid, None, transient.past)
    transient.last_error = small  # as small as no step here errs
    transient.advance(0.1)
    resumed = Transient(fluid, order, ShareOfError())
    resumed.resume(
        transient.number, transient.next_length, transient.past, transient.last_error, new_mesh
    )
    for _ in range(order):
        resumed.advance(0.1)
        assert resumed.last_error == small
    resumed.advance(0.1)
    assert resumed.last_error is not None and resumed.last_error > 10.0 * small


# The order of the velocity that is chosen where a scene leaves it open.


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
    assert (order_of(made), plan.order) == (order, order)
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
    assert [inertia(Setup(one)).present for one in (slow, fast, without)] == [False, True, False]


@pytest.mark.parametrize(("changes", "_"), CASES)
@pytest.mark.parametrize("asked", [2, 3, 4])
def test_what_is_asked_for_is_taken(changes: dict[str, Any], _: int, asked: int) -> None:
    made = scene(**changes, numerics=Numerics(order=asked))
    plan = make_plan(made)
    assert order_of(made) == plan.order == asked
    assert plan.why_order == "" and "velocity of order" not in plan.text()


@pytest.mark.parametrize("accuracy", [0.01, "verdict"])
@pytest.mark.parametrize("made", [grain_on_bed, grain_in_pocket])
def test_a_search_for_an_accuracy_begins_with_two(made: Any, accuracy: Any) -> None:
    assert order_of(changed(made(), numerics={"accuracy": accuracy})) == 2


def test_runs_in_time_are_compared_with_one_order_more() -> None:
    longer, beside = comparisons(scene(**IN_TIME))
    assert (order_of(longer), order_of(beside)) == (3, 4)


def test_auto_is_written_and_read() -> None:
    made = scene()
    assert 'order = "auto"' in dumps(made)
    assert loads(dumps(made)).numerics.order == "auto"
    assert (
        order_of(
            loads(dumps(scene(numerics=Numerics(order=2))), overrides=('numerics.order="auto"',))
        )
        == 3
    )
    assert order_of(loads(dumps(made), overrides=("numerics.order=auto",))) == 3


@pytest.mark.parametrize(
    ("name", "order"),
    [("grain_on_bed", 3), ("vortex_street", 3), ("pothole_1", 2), ("sphere_in_pocket", 3)],
)
def test_the_shipped_scenes(name: str, order: int) -> None:
    found: Scene = load(DEMOS / f"{name}.toml")
    assert found.numerics.order == "auto" and order_of(found) == order
