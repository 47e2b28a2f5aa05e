"""Friction, cohesion and the angle of repose in the statics of contacts."""

from __future__ import annotations

import math
from functools import partial
from itertools import product
from math import atan2, degrees, sqrt

import dolfinx
import numpy as np
import pytest
import ufl
from domains import rectangle, ring
from mpi4py import MPI
from scenes import message, scene
from test_safety_factor import ends, load

from incipient import compat
from incipient.compat import petsc
from incipient.contact import (
    Cases,
    Contacts,
    Load,
    incipient_motion,
    judge,
    judge_many,
    safety_factor,
)
from incipient.contact.friction import FrictionCone
from incipient.contact.safety import ConeState
from incipient.contact.verdict import Reason
from incipient.errors import SceneError
from incipient.files import plain
from incipient.fluid import FlowModel, Fluid, Prescribed
from incipient.fluid.along_walls import along_wall
from incipient.fluid.conditions import Friction
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Flat
from incipient.geometry.plane.grains import Rectangle
from incipient.geometry.settle import touching
from incipient.geometry.space.beds import Plane, SphereBed
from incipient.geometry.space.grains import Box, Sphere
from incipient.judging.case import Case, judge_case
from incipient.mesh.domain import build
from incipient.meshes.model import meshed
from incipient.pictures.judged import judged
from incipient.scene import Contact, example, loads
from incipient.turbulence.wall_law import WallLaw

pytestmark = pytest.mark.quick


# Walls of any shape that resist the flow along them: what crosses, and the force that is read off their part alone.


INNER, VISCOSITY, DRAG = 0.5, 0.25, 1.5


def exact(rate):
    """A, B of u = A r + B/r with u(1) = 1 and the shear stress nu r d(u/r)/dr = c (u - rate r) at the inner circle."""
    # -2 nu B/a^2 = c (A a + B/a - rate a), A + B = 1
    b = -DRAG * INNER * (1 - rate) / (2 * VISCOSITY / INNER**2 + DRAG * (1 / INNER - INNER))
    return 1 - b, b


def turning(x, t):
    return np.array([-x[1], x[0]])


def solved(around, rate):
    """Errors of the velocity, of the couple, and what crosses the inner circle, which turns; the outer turns at one."""
    moves = rate != 0.0
    wall = Friction(
        "inner", 0.1, lambda speed, turbulent, viscosity, distance: DRAG + 0 * speed, moves=moves
    )
    a, b = exact(rate)
    conditions = [wall, Prescribed("outer", turning)]
    with Fluid(ring(INNER, 1.0, around, 2), FlowModel(), conditions, 1 / VISCOSITY) as fluid:
        if moves:
            fluid.walls.carry("inner", np.zeros(2), np.array([rate]), np.zeros(2))
        assert fluid.solve(1e-10).converged
        x, v = fluid.constraints.points[:, :2], fluid.velocity.x.array.reshape(-1, 2)
        r = np.linalg.norm(x, axis=1, keepdims=True)
        velocity = np.abs(v - (a + b / r**2) * np.column_stack([-x[:, 1], x[:, 0]])).max()
        along = along_wall(fluid, "inner", fluid.state[0])
        assert along.lengths.sum() == pytest.approx(2 * np.pi * INNER, rel=1e-4)
        assert_means_of_normals(along, 2 * np.pi / around)
        through = np.abs((along.velocities * along.normals).sum(axis=1)).max()
        motion = dolfinx.fem.Function(fluid.space.velocity)
        motion.interpolate(lambda x: np.array([-x[1], x[0]]))
        power = fluid.walls.power(fluid.state, motion, "inner")
        couple = dolfinx.fem.assemble_scalar(compat.form(power))
    stress = DRAG * (a * INNER + b / INNER - rate * INNER)
    return velocity, abs(couple / (2 * np.pi * INNER**2 * stress) - 1), through


def assert_means_of_normals(along, angle):
    """Normals point to the middle; as means over two cells of an angle they are shorter than one.

    Weighted with P1 functions, 2 (1 - cos a)/a^2 = 1 - a^2/12, and shorter than 0.95 in corners alone.
    """
    length = np.linalg.norm(along.normals, axis=1, keepdims=True)
    assert along.normals / length == pytest.approx(-along.places / INNER, abs=5e-3)
    assert length == pytest.approx(1 - angle**2 / 12, abs=angle**4 / 20)


@pytest.mark.parametrize("rate", [0.0, -1.0])
def test_slip_with_friction_on_a_circle(rate):
    """Circular Couette flow over a wall whose stress is c times the velocity past it: errors fall as h^1.7 or faster.

    What crosses a circle that turns is that its cells are not quite round, and small on both meshes.
    """
    coarse, fine = (np.array(solved(around, rate)) for around in (12, 24))
    assert (fine < [2e-3, 2e-4, 2e-3]).all()
    assert (coarse / fine > 2**1.7)[: 2 if rate else 3].all()


@pytest.mark.parametrize("thickness", [0.25, 1e-3])
def test_a_wall_dissipates_also_next_to_thin_cells(thickness):
    """The power of any velocity without pressure is not negative: Nitsche's method needs nu over the cells' thickness.

    With nu over the root of their area the least eigenvalue next to cells 250 times as long as thick was -0.5 of the
    largest.
    """
    wall = Friction("bottom", 0.1, lambda speed, turbulent, viscosity, distance: DRAG + 0 * speed)
    grid = rectangle((0.0, 0.0), 1.0, thickness, 4, 1)
    domain = build(MPI.COMM_SELF, partial(meshed, grid))
    with Fluid(domain, FlowModel(), [wall], 1 / VISCOSITY) as fluid:
        fluid.state.x.array[:] = 0.0
        form = fluid.residual_form(*ufl.TestFunctions(fluid.space.mixed))
        matrix = petsc.assemble_matrix(compat.form(ufl.derivative(form, fluid.state)))
        matrix.assemble()
        rows = fluid.space.velocity_map
        whole = matrix.convert("dense").getDenseArray()[np.ix_(rows, rows)]
        powers = np.linalg.eigvalsh(0.5 * (whole + whole.T))
    assert powers.min() > -1e-9 * powers.max()


def test_where_the_flow_rests_the_turbulence_gives_the_friction():
    """In equilibrium u*^2 over the speed; at rest that of k over u+ (Kuzmin, Mierka & Turek 2007); below y+ 11 nu/y.

    Both frictions are blended: the third root of the sum of their cubes.
    """
    law, away = WallLaw(), (1e-4, 0.1)
    shear = 0.05
    speed = shear * law.velocity(shear, *away)
    below = away[0] / away[1]
    for drag, outer in (
        (law.drag(speed, 0.04, *away), shear**2 / speed),
        (law.drag(1e-12, shear, *away), shear / law.velocity(shear, *away)),
    ):
        assert drag == pytest.approx((outer**3 + below**3) ** (1.0 / 3.0), rel=1e-6)
    assert law.drag(1e-12, 1e-3, *away) == pytest.approx(1e-4 / 0.1, rel=1e-3)
    assert law.drag(speed, 2 * shear, *away) == pytest.approx(
        2 * shear / law.velocity(2 * shear, *away), rel=0.01
    )


# Contacts that pull: N >= -c, |T| <= friction (N + c), against closed forms and linear programs.


FRICTION, PULL, WEIGHT, PUSH = 0.5, 0.3, 2.0, 1.5


PUSHED = load((PUSH, 0.0), weight=(0.0, -WEIGHT))


@pytest.mark.parametrize(
    ("width", "height", "friction", "held", "states"),
    [
        (4.0, 0.2, FRICTION, FRICTION * (WEIGHT + PULL), {ConeState.EDGE}),
        (1.0, 3.0, 5.0, (WEIGHT + PULL) / 3.0, {ConeState.EDGE, ConeState.INSIDE}),
    ],
    ids=["slides", "topples"],
)
def test_a_block_slides_or_topples_when_friction_and_cohesion_are_exceeded(
    width: float, height: float, friction: float, held: float, states: set[ConeState]
):
    """s F = friction (W + c), and s F h/2 = (W + c) b/2 about the corner ahead; the other pulls with c/2."""
    law = FrictionCone.of(friction, PULL)
    result = safety_factor(PUSHED, ends(0.5 * width, 0.5 * height), law)
    assert result.value == pytest.approx(held / PUSH)
    assert result.contact_forces[:, 1].sum() == pytest.approx(WEIGHT)
    assert set(result.contact_states) == states


def grid() -> Contacts:
    """Points of the lower face of a unit cube, each with its part of the area."""
    line, down = np.linspace(-0.5, 0.5, 5), np.array([0.0, 0.0, -1.0])
    part = np.array([0.5, 1.0, 1.0, 1.0, 0.5]) / 4.0
    points = [[x, y, -0.5] for x in line for y in line]
    return Contacts(points, np.tile(down, (25, 1)), np.outer(part, part).ravel())


@pytest.mark.parametrize(
    "face",
    [
        ends(0.5, 0.5),
        grid(),
        touching(Rectangle(1.0, 1.0), Placement((0.0, 0.0)), Flat(-0.5), 1e-6),
        touching(Box((1.0, 1.0, 1.0)), Placement((0.0, 0.0, 0.0)), Plane(origin_z=-0.5), 1e-6),
    ],
    ids=["ends", "grid", "rectangle", "box"],
)
def test_a_face_holds_its_cohesion_once_whatever_its_points(face: Contacts):
    """Torn off at s L = W + c, tipped over an edge at s F h/2 = (W + c) b/2, h = b; alone and in batches."""
    down, zero, law = face.normals[0], np.zeros(3), FrictionCone.of(5.0, PULL)
    push = 4.0 * np.array([-down, [1.0, 0.0, 0.0]])
    surface = face.points, face.normals
    cases = Cases(*surface, push, 0.0 * push, WEIGHT * down, zero, law, areas=face.areas)
    alone = [safety_factor(Load(one, zero, WEIGHT * down, zero), face, law).value for one in push]
    for factors in (alone, judge_many(cases).factors):
        assert factors == pytest.approx([(WEIGHT + PULL) / 4.0] * 2)


@pytest.mark.parametrize("units", [1.0, 1e-13, 1e9])
def test_a_sphere_is_torn_off_a_plane(units):
    """s F = W + c; beyond, the centre accelerates by (F - W - c)/m. In units of any size."""
    contact = Contacts(np.array([[0.0, 0.0, -0.5]]), np.array([[0.0, 0.0, -1.0]]))
    law = FrictionCone.of(FRICTION, PULL * units)
    zero, weight = np.zeros(3), np.array([0.0, 0.0, -WEIGHT * units])
    load = Load(np.array([0.0, 0.0, 4.0 * units]), zero, weight, zero)
    assert safety_factor(load, contact, law).value == pytest.approx((WEIGHT + PULL) / 4.0)
    motion = incipient_motion(load, contact, law, 2.0 * units, 0.2 * units * np.eye(3))
    assert motion.first.acceleration == pytest.approx([0.0, 0.0, (4.0 - WEIGHT - PULL) / 2.0])
    assert motion.first.contact_forces[0] == pytest.approx([0.0, 0.0, -PULL * units])


def test_the_paper_s_criteria_know_no_cohesion():
    verdict = judge(PUSHED, ends(2.0, 0.1), FrictionCone.of(FRICTION, 10.0 * PULL))
    assert not verdict.moves and verdict.criteria.moves
    assert verdict.agreement.reason is Reason.COHESION
    # Pictures had forgotten cohesion: they showed forces at the safety factor, as if none balanced the load.
    pictured = judged(plain(verdict.to_dict()))
    assert pictured.share == 1.0 and set(pictured.states) == {"INSIDE"}
    assert pictured.forces.sum(axis=0) == pytest.approx(-verdict.criteria.load.force, abs=1e-9)


def test_cohesion_is_not_why_a_disc_rolls():
    disc, zero = Contacts(np.array([[0.0, -0.5, 0.0]]), np.array([[0.0, -1.0, 0.0]])), np.zeros(3)
    load = Load(np.array([0.3, 0.0, 0.0]), np.array([0.0, 0.0, -0.1]), -np.eye(3)[1], zero)
    verdict = judge(load, disc, FrictionCone.of(FRICTION, PULL), (1.0, 0.125 * np.eye(3)))
    assert verdict.agreement.reason is Reason.ROLLING_CALLED_SLIDING


def test_cohesion_is_a_key_of_scenes_and_cases():
    assert Contact(friction=0.4, cohesion=2.0).law.cohesion == 2.0
    corners = ends(2.0, 0.1)
    case = Case.model_validate(
        {
            "load": {
                "weight": [0, -WEIGHT],
                "flow_force": [PUSH, 0],
                "flow_couple": 0,
                "centre": [0, 0],
            },
            "contacts": {
                "points": corners.points[:, :2].tolist(),
                "normals": corners.normals[:, :2].tolist(),
                "friction": FRICTION,
                "cohesion": PULL,
            },
        }
    )
    assert judge_case(case)["verdict"]["safety_factor"] == pytest.approx(
        FRICTION * (WEIGHT + PULL) / PUSH
    )


@pytest.mark.parametrize(("share", "holds"), [(0.99, False), (1.01, True)])
def test_a_grain_settles_where_cohesion_holds_its_weight(share, holds):
    """A block on an incline: W sin a <= friction (W cos a + c); its face is one contact."""
    slope, (width, height) = math.radians(40.0), (1.0, 0.25)
    weight = 1.65 * width * height * 3.0
    cohesion = share * weight * (math.sin(slope) / FRICTION - math.cos(slope))
    block = {"shape": "rectangle", "width": width, "height": height, "x": 6.0}
    settled = partial(
        scene,
        bed={"kind": "inclined", "slope": 40.0},
        body=block | {"density": 2.65, "settle": True},
        gravity={"acceleration": 3.0},
        contact={"friction": FRICTION, "cohesion": cohesion},
    )
    if holds:
        assert settled().placement.centre == pytest.approx((6.0, 0.5 * height))
    else:
        assert "the grain rolls off" in message(settled)


def test_a_grain_that_never_touches_the_bed_has_none():
    free = ["body={shape='disc', diameter=1.0, centre=[20.0, 5.0], density=2.0, motion='free'}"]
    settings = [*free, "time={end=1.0, step=0.1}", "contact={friction=0.5, cohesion=1.0}"]
    with pytest.raises(SceneError, match=r"contact\.cohesion: .*never touches the bed"):
        loads(example(), overrides=settings)


@pytest.mark.parametrize("pull", [-0.1, math.nan, math.inf])
def test_a_pull_that_is_none_is_refused(pull):
    with pytest.raises(SceneError, match=r"cohesion .* is not allowed"):
        safety_factor(PUSHED, ends(0.5, 0.5), FrictionCone(np.array(0.5), np.array(pull)))


# The angle of repose of a bead in the pockets of a bed of spheres against geometry, for every spacing and size.
#
# A force through the bead's centre rolls it over the line through the centres of the spheres ahead of it as soon as
# the resultant with its weight points beyond that line: tan(angle) = distance ahead / height above. The spheres
# behind could hold it only with more friction than the height over the distance to them, above which a contact may
# pull down.


SPACINGS = (1.0, 1.05, 1.1, 1.2, 1.3, 1.4)
SIZES = (0.6, 1.0, 1.5, 2.0)
FRICTIONS = (0.0, 0.1, 0.5)
RIGHT = np.pi / 2
# Bed and flow: squared distances in spacings from the bead to the nearest centres, and from there ahead to the line
# through those that it rolls over; the angle of the rows; which centre stands where; how many spheres it rests on.
POCKETS = {
    "square": ("square", 1 / 2, 1 / 4, 0.0, (0.5, 0.5), 4),
    "square, over one": ("square", 1 / 2, 1 / 2, RIGHT / 2, (sqrt(0.5), 0.0), 4),
    "square, on two": ("square", 1 / 4, 1 / 4, 0.0, (0.5, 0.0), 2),
    "triangular": ("triangular", 1 / 3, 1 / 12, RIGHT, (sqrt(1 / 12), 0.5), 3),
    "triangular, over one": ("triangular", 1 / 3, 1 / 3, RIGHT, (sqrt(1 / 3), 0.0), 3),
    "triangular, on two": ("triangular", 1 / 4, 1 / 4, 0.0, (0.5, 0.0), 2),
}


def case_of(pocket, spacing, size):
    """Bed, height of a bead's centre above the base plane, distance ahead; None: it would lie on the plane."""
    kind, around, ahead, angle, offset, _ = POCKETS[pocket]
    height_2 = (0.5 + 0.5 * size) ** 2 - around * spacing**2
    if height_2 <= (0.5 * size) ** 2:
        return None
    bed = SphereBed.array(
        0.5, spacing, kind, (spacing * offset[0], spacing * offset[1]), 0.0, angle
    )
    return bed, sqrt(height_2), sqrt(ahead) * spacing


def angle_of(bed, height, size, friction):
    """The angle in degrees at which a force along x moves the bead, by the exact judge; its contacts."""
    centre = (0.0, 0.0, height)
    contacts = touching(Sphere(size), Placement(centre), bed, 1e-6 * size)
    load = Load(
        np.array([1.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, -1.0]), np.array(centre)
    )
    return degrees(atan2(safety_factor(load, contacts, friction).value, 1.0)), contacts


@pytest.mark.parametrize("pocket", POCKETS)
def test_angle_of_repose_of_every_pocket(pocket):
    checked = 0
    for spacing, size, friction in product(SPACINGS, SIZES, FRICTIONS):
        case = case_of(pocket, spacing, size)
        if case is None:
            continue
        bed, height, ahead = case
        result, contacts = angle_of(bed, height, size, friction)
        assert len(contacts.points) == POCKETS[pocket][-1], (spacing, size)
        expected = degrees(atan2(ahead, height))
        assert result == pytest.approx(expected, abs=1e-5), (spacing, size, friction)
        checked += 1
    assert checked >= 45


@pytest.mark.parametrize("spacing", [1.25, 1.4])
def test_a_bead_on_the_base_plane_leans_on_two_spheres(spacing):
    """Where the spheres of a square bed stand farther apart than sqrt(1.5), an equal bead lies on the plane."""
    ahead = sqrt(0.75 - 0.25 * spacing**2)
    bed = SphereBed.array(0.5, spacing, "square", (ahead, 0.5 * spacing))
    result, contacts = angle_of(bed, 0.5, 1.0, 0.5)
    assert len(contacts.points) == 3
    assert result == pytest.approx(degrees(atan2(ahead, 0.5)), abs=1e-5)
