"""Meshes of scenes with turbulence: where they begin at walls, and how fine they are there."""

import math

import numpy as np
import pytest
from turbulent import channel, grain, inflow_at

from incipient import make_plan
from incipient.fluid.conditions import Friction
from incipient.planning.meshing import lay_out
from incipient.planning.wall_cells import layers
from incipient.planning.wall_conditions import conditions
from incipient.scene import (
    Domain,
    Fluid,
    HeapBed,
    Numerics,
    OpenChannel,
    Poiseuille,
    Polyline,
    Sinusoidal,
    Sphere,
    Turbulence,
)
from incipient.setup.setup import Setup


def test_the_mesh_ends_where_the_law_of_the_wall_begins():
    """50 nu/u* from one wall, or from two."""
    one, two = (
        channel(),
        channel(flow=Poiseuille(), domain=Domain(length=20, height=2, origin=(0, 3))),
    )
    found = Setup(one).walls
    assert found.nearest * found.shear_velocity * 11000 == pytest.approx(50.0)
    grid = lay_out(Setup(one), make_plan(one)).shape
    assert grid.extents[1] == pytest.approx((found.nearest, 1.0))
    grid, far = lay_out(Setup(two), make_plan(two)).shape, Setup(two).walls.nearest
    assert grid.extents[1] == pytest.approx((3 + far, 5 - far))
    assert Setup(channel(turbulence=Turbulence(wall_distance=0.1))).walls.nearest == 0.1


@pytest.mark.parametrize(
    ("model", "slip"), [("k-epsilon", 1.0), ("k-omega-sst", (0.45 / 11.06) ** 2)]
)
def test_a_bed_with_forms_bounds_the_mesh_itself(model, slip):
    """The wall below is one of the law alone, that on top is beyond the mesh; all that flows enters the mesh.

    Friction below is that of a layer `slip` times as thick, which in the viscous sublayer hardly is there.
    """
    bed = Sinusoidal(amplitude=0.1, wavelength=2, phase=90)
    domain = Domain(length=20, height=2)
    found = channel(bed=bed, flow=Poiseuille(), domain=domain, turbulence=Turbulence(model=model))
    walls, layout = Setup(found).walls, lay_out(Setup(found), make_plan(found))
    assert walls.ground == pytest.approx(0.1) and walls.depth == pytest.approx(0.95)
    assert layout.shape.top == walls.ceiling == pytest.approx(2.0 - walls.nearest)
    weak, strong = (one for one in conditions(Setup(found)) if isinstance(one, Friction))
    assert (weak.boundary, weak.axis, strong.boundary, strong.axis) == ("bed", None, "top", 1)
    assert weak.distance == pytest.approx(slip * walls.nearest)
    assert strong.distance == walls.nearest
    inner = np.linspace(0.1, walls.ceiling, 20001)
    mean = inflow_at(found, 0.5 * (inner[1:] + inner[:-1]))[0].mean()
    y = (np.arange(20000) + 0.5) / 20000 * walls.nearest
    u = walls.shear_velocity
    layer = walls.nearest * u * walls.law("top").velocity(u, found.viscosity, y).mean()
    assert mean * (inner[-1] - inner[0]) + layer == pytest.approx(1.9, rel=1e-4)


def test_a_channel_in_space_is_meshed_as_in_the_plane_layer_by_layer():
    """Half of it where it is its own mirror image; two cells across at the least."""
    scene = channel(domain=Domain(length=20, height=1, width=2, origin=(0, -1, 3)))
    found, plane = (
        lay_out(Setup(scene), make_plan(scene)).shape,
        channel(numerics=Numerics(order=2)),
    )
    of_plane = lay_out(Setup(plane), make_plan(plane)).shape
    assert found.extents[2][0] == pytest.approx(3 + of_plane.extents[1][0])
    for ends, in_plane in zip(found.ends[::2], of_plane.ends, strict=True):
        assert ends == pytest.approx(in_plane, rel=1e-12)
    assert found.extents[1] == (0.0, 1.0) and len(found.ends[1]) == 2
    assert found.sides[2:4] == ("symmetry", "left")


def test_cells_are_small_where_the_bed_sticks_out_and_in_the_lee():
    """At the upper corner of a step down, and along its shear layer for six heights; not at the lower corner."""
    bed = Polyline(points=[(0, 0.2), (5, 0.2), (5, 0), (20, 0)])
    scene = channel(bed=bed, turbulence=Turbulence(wall_distance=0.02), numerics=Numerics(order=2))
    walls, at_corner, lee = lay_out(Setup(scene), make_plan(scene)).sizes.near[-3:]
    assert (walls.boundary, walls.size) == ("bed", pytest.approx(0.06))
    assert at_corner.points == ((5.0, 0.2),) and at_corner.size == pytest.approx(0.05 * 0.06)
    assert lee.points[0] == (5.0, 0.2) and lee.points[-1] == pytest.approx((6.2, 0.0))
    assert lee.size == pytest.approx(0.09 * 0.2)


@pytest.mark.parametrize("flow", [OpenChannel(), Poiseuille()])
@pytest.mark.parametrize("mesh_size", [2.0, 1.0])
def test_rows_next_to_walls_are_as_fine_as_the_distance_of_the_law_asks_for(flow, mesh_size):
    """The first row is as thick as the distance, times mesh_size; none over 0.06 of a depth; they grow by degrees."""
    numerics = Numerics(order=2, mesh_size=mesh_size)
    scene = channel(flow=flow, fluid=Fluid(reynolds=1e6, scale="flow"), numerics=numerics)
    walls, grid = Setup(scene).walls, lay_out(Setup(scene), make_plan(scene)).shape
    thick = np.diff([0.0, *grid.ends[1]]) * np.ptp(grid.extents[1])
    assert thick.sum() == pytest.approx(1.0 - walls.number * walls.nearest)
    assert 0.7 < thick[0] / (mesh_size * walls.nearest) < 1.4
    assert thick.max() <= 0.75 * mesh_size * walls.depth * 0.08 * (1 + 1e-9)
    if walls.number == 2:
        assert thick == pytest.approx(thick[::-1])
        thick = thick[: len(thick) // 2]
    assert (np.diff(thick) > -1e-12).all() and (
        thick[1:] / thick[:-1]
    ).max() < 1.0 + 0.45 * mesh_size


def test_level_ground_about_a_grain_in_space_is_at_the_datum():
    """Far from the grain a planar bed takes the place of a bed with forms: where the profile of the inflow starts."""
    scene = channel(
        domain=Domain(length=10, width=10, height=5),
        fluid=Fluid(reynolds=20_000.0, scale="grain"),
        flow=OpenChannel(velocity=20.0, datum=0.7),
        body=Sphere(diameter=1.0, centre=(5.0, 5.0, 1.7)),
        bed=HeapBed(
            spheres=((5.0, 4.0, 0.9, 0.45), (5.0, 6.0, 0.9, 0.45)), posts=((4.0, 5.0, 0.5, 0.5),)
        ),
        numerics=Numerics(error_bars=False, meshed_bed=0.6),
    )
    assert Setup(scene).walls.depth == pytest.approx(4.3)
    without = scene.model_copy(update={"flow": OpenChannel(velocity=20.0)})
    assert Setup(without).walls.depth == pytest.approx(5.0 - 1.35)  # by default the crest


def test_the_first_cells_at_walls_in_the_viscous_sublayer_are_thin():
    """In nu/u* of the inflow, in rows between planes and in layers at a bed; at a grain half as thick."""
    asked = Turbulence(model="k-omega-sst")
    plane = Setup(channel(turbulence=asked, numerics=Numerics(mesh_size=1.0, order=2)))
    rows = lay_out(plane, make_plan(plane.scene)).shape.ends[1]
    # Of a height of one; rows grow from the wall on.
    assert rows[0] == pytest.approx(0.6 * plane.walls.unit, rel=0.2)
    assert "y+ about 0.45" in plane.walls.text()
    sand = Setup(grain(0.05).model_copy(update={"turbulence": asked}))
    first = layers(sand, 2, math.inf).first
    assert first[sand.walls.names[0]] == pytest.approx(sand.walls.unit, rel=0.02)
    assert first["body"] == pytest.approx(0.5 * first[sand.walls.names[0]])
    assert layers(Setup(grain(0.2)), 2, math.inf) is None
