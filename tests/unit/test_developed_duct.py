"""Developed flow by k-omega SST between side walls, by finite volumes in a section: what enters ducts."""

import numpy as np
import pytest
from one_dimensional import k_omega_channel
from turbulent import channel

from incipient import make_plan
from incipient.forms.k_omega_sst import EXPONENT
from incipient.planning.developed_channel import developed, of_discharge
from incipient.planning.developed_duct import developed_duct, middles
from incipient.planning.duct import duct_mean, duct_speed
from incipient.planning.flow_setup import Setup
from incipient.planning.meshing import lay_out
from incipient.scene import Domain, Fluid, Numerics, OpenChannel, Poiseuille, RidgeBed, Turbulence

SQUARE = 1.0  # half width over depth, of which a closed duct has two
SMOOTH = (0.0, 0.0)


def prandtl(reynolds):
    """u* over V of smooth pipes: 1/f^(1/2) = 2 log10(Re f^(1/2)) - 0.8, f = 8 (u*/V)^2."""
    root = 0.15
    for _ in range(50):
        root = 1.0 / (2.0 * np.log10(reynolds * root) - 0.8)
    return root / np.sqrt(8.0)


@pytest.mark.parametrize(
    ("reynolds", "half_width", "sand"),
    [
        (1.0, 0.3, SMOOTH),
        (3500.0, 1.0, SMOOTH),
        (9900.0, 2.5, SMOOTH),
        (1e4, 0.05, SMOOTH),
        (1e4, 50.0, SMOOTH),
        (1e4, 0.5, (0.1, 0.1)),
        (2000.0, 1.0, (0.0, 0.2)),
        # Where a smooth side meets the floor a limiter of the model switches to and fro.
        pytest.param(1e6, 1.0, (0.0, 0.05), marks=pytest.mark.slow),
    ],
)
def test_walls_bear_what_the_pressure_does_and_the_discharge_is_that_asked_for(
    reynolds, half_width, sand
):
    """Momentum: the mean stress on the walls is the pressure's gradient times area over length of walls (exact)."""
    found = developed_duct(reynolds, half_width, sand=sand)
    area = half_width
    assert found.shear_velocity**2 * (1.0 + half_width) == pytest.approx(
        found.gradient * area, rel=1e-9
    )
    y, z = (np.diff(ends) for ends in found.ends)
    assert (found.values[0] * np.outer(y, z)).sum() / area == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("half_width", [1.0, 0.3, 3.0])
def test_a_slow_flow_is_the_series_of_laminar_ducts(half_width):
    """Pressure gradient and speeds of White's series (`planning.duct`), which errs by 1e-5; at second order."""
    width, depth = 2.0 * half_width, 2.0
    errors = []
    for coarse in (1.0, 0.5):
        found = developed_duct(1.0, half_width, coarse)
        assert found.is_laminar
        errors.append(abs(found.gradient * duct_mean(width, depth) - 1.0))
        y, z = (
            one.ravel()
            for one in np.meshgrid(*(middles(ends) for ends in found.ends), indexing="ij")
        )
        exact = duct_speed(y, z, width, depth)
        assert np.abs(found.values[0].ravel() - exact).max() < 0.006 * exact.max()
    print(half_width, errors)
    assert errors[1] < 1.2e-3 and errors[0] / errors[1] > 3.0


@pytest.mark.parametrize(
    ("coarse", "near"), [(1.0, 0.015), pytest.param(0.5, 5e-3, marks=pytest.mark.slow)]
)
def test_amid_a_wide_duct_the_flow_is_that_between_planes(coarse, near):
    """At one Re_tau of the middle: mean speed of finite volumes in one dimension, and k at half the depth."""
    found = developed_duct(1.1e4, 8.0, coarse)
    u = np.sqrt(found.gradient)  # of the stress in the middle, where nothing comes from the sides
    speed, log_k, _ = (one[-1] for one in found.values)
    heights, sizes = middles(found.ends[1]), np.diff(found.ends[1])
    assert found.stresses[1][-1] == pytest.approx(u**2, rel=1e-3)
    assert speed @ sizes / u == pytest.approx(k_omega_channel(1.1e4 * u), rel=2e-3)
    plane = developed(1.1e4 * u)
    k = np.interp(0.5, plane.heights, np.exp(plane.log_k))
    assert np.interp(0.5, heights, np.exp(log_k)) / u**2 == pytest.approx(k, rel=near)


@pytest.mark.parametrize(
    ("coarse", "near"), [(1.0, 0.015), pytest.param(0.5, 5e-3, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("side", [0.0, 0.05])
def test_amid_a_wide_duct_over_sand_the_flow_is_that_over_a_rough_plane(side, coarse, near):
    """At the discharge of the middle: speeds, ln k and ln omega of finite volumes in one dimension, and u*.

    Sides are smooth or as rough as the floor.
    """
    found = developed_duct(1.1e4, 8.0, coarse, (side, 0.05))
    mean = float(found.values[0, -1] @ np.diff(found.ends[1]))
    plane = of_discharge(1.1e4 * mean, 0.05)
    u = mean / plane.mean
    assert found.stresses[1][-1] == pytest.approx(u**2, rel=0.4 * near)
    z, y = np.geomspace(1e-3, 1.0, 20), np.full(20, 8.0)
    assert found.speed(y, z) == pytest.approx(
        u * np.interp(z, plane.heights, plane.speed), rel=near
    )
    log_k = np.interp(z, plane.heights, plane.log_k) + 2.0 * np.log(u)
    log_omega = np.interp(z, plane.heights, plane.log_omega) + np.log(u)
    assert np.abs(found.logarithms(y, z) - [log_k, log_omega]).max() < near


def test_walls_of_little_sand_are_smooth():
    """u* of a square duct, where u* k_s/nu is 0.46."""
    smooth, sandy = (developed_duct(5e4, SQUARE, sand=(one, one)) for one in (0.0, 2e-4))
    assert sandy.shear_velocity == pytest.approx(smooth.shear_velocity, rel=1e-3)


@pytest.mark.parametrize("reynolds", [5e4, pytest.param(5e5, marks=pytest.mark.slow)])
def test_rough_square_ducts_bear_by_nikuradses_law(reynolds):
    """u* is that of pipes with the hydraulic diameter within 1.5%, where u* k_s/nu is 470 and 4700.

    f = (2 log10(3.7 D/k_s))^-2, f = 8 (u*/V)^2 (Nikuradse 1933, VDI-Forschungsheft 361).
    """
    found = developed_duct(reynolds, SQUARE, sand=(0.1, 0.1))
    side, floor = found.shear_velocities
    print(reynolds, side, floor)
    assert side == pytest.approx(floor, rel=1e-9)
    assert found.shear_velocity == pytest.approx(
        8.0**-0.5 / (2.0 * np.log10(37.0 * 2.0)), rel=0.015
    )


def test_a_stream_from_a_rough_bed_onto_a_smooth_one_comes_between_smooth_sides():
    """In the middle of a wide channel what enters is that over the rough plane; next to a side it is at rest.

    `tau_b` is the stress on the bed in the middle, where it was rough; cells at walls are those of smooth ones.
    """
    scene = channel(
        domain=Domain(length=8, height=1, width=16, sides="wall"),
        flow=OpenChannel(),
        fluid=Fluid(reynolds=1.1e4, scale="flow"),
        numerics=Numerics(order=2, mesh_size=2.0),
        bed=RidgeBed(amplitude=0.02, wavelength=1.0),
        turbulence=Turbulence(model="k-omega-sst", upstream_roughness=0.05),
    )
    walls = Setup(scene).resolved_walls
    assert walls.rough == () and walls.names == ("bed", "left")
    z = np.geomspace(0.01, 1.0, 9) * walls.depth
    middle = np.array([np.zeros(9), np.full(9, 8.0), walls.floor + z])
    speed = walls.velocity(middle, 0.0)[0]
    rough = of_discharge(1.1e4 * walls.depth, 0.05 / walls.depth)
    assert speed / speed[-1] == pytest.approx(
        np.interp(z / walls.depth, rough.heights, rough.speed) / rough.speed[-1], rel=0.01
    )
    assert np.abs(walls.velocity(middle * [[1.0], [0.0], [1.0]], 0.0)).max() < 1e-12
    u = speed[-1] / rough.speed[-1]
    assert walls.bed_stress == pytest.approx(u**2, rel=0.01)
    told = float(walls.text().rpartition("u* k_s/nu about ")[2].rstrip(")"))
    assert told == pytest.approx(0.05 * np.sqrt(walls.bed_stress) * 1.1e4, rel=5e-3)


@pytest.mark.slow
def test_volumes_converge_at_second_order():
    """u* of a square duct at Re 100,000 by its width, on volumes 2, 1 and 1/2 times as large."""
    coarse, usual, fine = (
        developed_duct(5e4, SQUARE, size).shear_velocity for size in (2.0, 1.0, 0.5)
    )
    print(coarse, usual, fine)
    assert (usual - coarse) / (fine - usual) > 3.5
    assert usual == pytest.approx(fine, rel=5e-4)


@pytest.mark.parametrize("reynolds", [4410.0, 1.78e4, pytest.param(1e6, marks=pytest.mark.slow)])
def test_friction_of_square_ducts(reynolds):
    """u* within 3% of Prandtl's law of smooth pipes with the hydraulic diameter; Re by the width.

    Direct simulation has u*/V = 300/4410 at the first (Gavrilakis 1992, J. Fluid Mech. 244, 101): within 5%. Without
    secondary flow the stress falls off towards the corners, and is a sixth above its mean in the middle of the walls.
    """
    found = developed_duct(0.5 * reynolds, SQUARE)
    u = found.shear_velocity
    print(reynolds, u, prandtl(reynolds))
    assert found.shear_velocities == pytest.approx((u, u), rel=1e-6)
    assert u == pytest.approx(prandtl(reynolds), rel=0.03)
    assert reynolds > 4410.0 or u == pytest.approx(300.0 / 4410.0, rel=0.05)
    stress = found.stresses[0] / u**2
    assert (np.diff(stress) > 0.0).all() and 1.1 < stress[-1] < 1.3
    assert not found.is_laminar


def test_what_enters_is_what_was_found_and_next_to_walls_a_law():
    """At the volumes' middles the values themselves; nearer u = u*^2 z/nu, k as a power, omega by molecules."""
    found = developed_duct(5000.0, 0.8)
    y, z = (
        one.ravel()
        for one in np.meshgrid(*(middles(ends)[1:] for ends in found.ends), indexing="ij")
    )
    speed, log_k, log_omega = found.values[:, 1:, 1:].reshape(3, -1)
    assert found.speed(y, z) == pytest.approx(speed, rel=1e-9)
    assert found.logarithms(y, z) == pytest.approx(np.array([log_k, log_omega]), abs=1e-9)
    first, middle = found.ends[1][1], found.ends[0][-1:]
    low, high = found.logarithms(middle.repeat(2), first * np.array([0.25, 0.5])).T
    assert high - low == pytest.approx([EXPONENT * np.log(2.0), -2.0 * np.log(2.0)], rel=1e-9)
    slope = found.speed(middle, np.array([0.2 * first])) / (0.2 * first)
    assert slope / 5000.0 == pytest.approx(found.stresses[1][-1:], rel=0.01)
    walls = np.linspace(0.0, 0.8, 9), np.zeros(9)
    assert max(np.abs(found.speed(*one)).max() for one in (walls, walls[::-1])) < 1e-15


@pytest.mark.parametrize("flow", [OpenChannel(), Poiseuille()])
def test_a_duct_to_the_wall_has_thin_cells_at_its_sides_and_lets_in_the_developed_flow(flow):
    """Rows and layers begin 0.6 nu/u* thick; what enters has the mean velocity, no slip, and u* of the mean stress."""
    duct = Domain(length=8, height=1, width=1.6, origin=(0, -0.5, 2), sides="wall")
    fluid, numerics = Fluid(reynolds=2e4, scale="flow"), Numerics(order=2, mesh_size=2.0)
    scene = channel(
        domain=duct,
        flow=flow,
        fluid=fluid,
        numerics=numerics,
        turbulence=Turbulence(model="k-omega-sst"),
    )
    setup, plan = Setup(scene), make_plan(scene)
    walls, found, open_top = (
        setup.resolved_walls,
        lay_out(setup, plan).shape,
        flow.kind == "open-channel",
    )
    assert walls.names == ("bottom", *(() if open_top else ("top",)), "left")
    assert walls.depth == (1.0 if open_top else 0.5) and walls.reach == min(walls.depth, 0.8)
    assert any("no secondary flow" in line for line in plan.warnings)
    assert found.sides == ("inflow", "outflow", "symmetry", "left", "bottom", "top") and found.half
    columns, layers, rows = (np.diff([0.0, *ends]) for ends in found.ends)
    first = np.array([layers[-1] * 0.8, rows[0]]) / walls.unit
    assert (first > 1.0).all() and (first < 2.0).all() and (np.diff(layers) < 1e-12).all()
    assert rows[-1] == pytest.approx(rows.max() if open_top else rows[0])
    assert np.ptp(columns) < 1e-12

    y, z = (np.linspace(low, low + size, 401) for low, size in ((-0.5, 1.6), (2.0, 1.0)))
    y, z = np.meshgrid(0.5 * (y[1:] + y[:-1]), 0.5 * (z[1:] + z[:-1]))
    places = np.array([np.zeros(y.size), y.ravel(), z.ravel()])
    velocity = walls.velocity(places, 0.0)
    assert velocity[0].mean() == pytest.approx(1.0, rel=2e-3) and np.abs(velocity[1:]).max() == 0.0
    mirrored = places * [[1.0], [-1.0], [1.0]] + [[0.0], [0.6], [0.0]]
    assert np.abs(walls.velocity(mirrored, 0.0) - velocity).max() < 1e-12
    assert np.abs(walls.logarithms(mirrored) - walls.logarithms(places)).max() < 1e-9
    # A first guess is what enters where nothing but the duct's own walls is near, and at rest next to any other.
    away = np.minimum(np.minimum(places[1] + 0.5, 1.1 - places[1]), places[2] - 2.0)
    away = away if open_top else np.minimum(away, 3.0 - places[2])
    assert np.abs(walls.start(places.T, away)[0] - velocity).max() < 1e-12
    assert np.abs(walls.start(places.T, np.zeros(y.size))[0]).max() < 1e-12
    # The momentum of the developed flow: the mean stress on the walls by the pressure's gradient.
    wetted = (1.6 + 2.0) / 1.6 if open_top else (2 * 1.6 + 2.0) / 1.6
    gradient = walls.duct.gradient / walls.depth
    assert walls.shear_velocity**2 * wetted == pytest.approx(gradient, rel=1e-9)
    near = 0.1 * walls.first
    slope = walls.velocity(np.array([[0.0], [0.3], [2.0 + near]]), 0.0)[0, 0] / near
    assert setup.bed_stress() == pytest.approx(
        walls.viscosity * slope, rel=0.02
    )  # in the middle of the bed
