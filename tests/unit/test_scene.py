"""Scenes built from Python: what follows from them."""

import math
import subprocess
import sys

import numpy as np
import pytest
from pydantic import ValidationError
from scenes import BOX, FLOW_SCALE, message, scene

from incipient.contact import Load
from incipient.contact.safety import safety_factor
from incipient.evaluation.contact_verdict import find_contacts
from incipient.geometry.plane import beds as bed_geometry
from incipient.geometry.plane import grains as grain_geometry
from incipient.geometry.plane.beds import Polyline as PolylineBed
from incipient.scene import (
    Contact,
    Disc,
    Discs,
    Domain,
    Ellipse,
    ExpressionFlow,
    Flat,
    Fluid,
    Gravity,
    HalfDiscs,
    Inclined,
    Lid,
    LogLaw,
    OpenChannel,
    Poiseuille,
    Polygon,
    Polyline,
    Rectangle,
    Scene,
    Shear,
    Sinusoidal,
    Star,
    Still,
    Superellipse,
    Time,
    Uniform,
)
from incipient.scene.messages import variants


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
