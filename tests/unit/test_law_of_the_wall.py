"""The law of the wall, smooth and rough, and the profile that enters by it."""

import numpy as np
import pytest
from one_dimensional import law_of_the_wall
from turbulent import channel, entering_of, grain

from incipient import make_plan
from incipient.effects.turbulence.limits import grain_number, slowest
from incipient.errors import SceneError
from incipient.planning.flow_setup import Setup
from incipient.planning.wall_law import WallLaw
from incipient.scene import (
    Disc,
    Flat,
    Fluid,
    OpenChannel,
    Poiseuille,
    Turbulence,
)

MEASURED = {"inflow": "profile", "intensity": 0.01, "length": 0.1}


def test_u_star_by_a_measured_profile_is_that_of_the_row_next_to_the_wall():
    """u/u* = ln(u* y/nu)/0.41 + 5.2 at the row; halved speeds in a flow of twice V are the same flow."""
    found = []
    for reynolds, speed in ((2e5, 1.0), (4e5, 0.5)):
        rows = [[0.1, 0.7 * speed], [0.9, speed]]
        scene = channel(
            fluid=Fluid(reynolds=reynolds, scale="flow"),
            turbulence=Turbulence(**MEASURED, wall_distance=0.006, profile=rows),
        )
        walls = Setup(scene).walls
        u_plus = np.log(walls.shear_velocity * 0.1 / walls.viscosity) / 0.41 + 5.2
        assert 0.7 * speed / walls.shear_velocity == pytest.approx(u_plus, rel=0.01)
        found.append(walls.shear_velocity / walls.viscosity)
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_a_faster_flow_is_one_of_larger_reynolds_number_and_has_the_stress_of_its_own_law():
    """tau_b = (factor V)^2 (u*/V)^2, u*/V by the logarithmic law at the larger Reynolds number."""
    scene = grain(0.2)
    twice = Setup(scene).faster(2.0).scene
    assert twice.viscosity == pytest.approx(0.5 * scene.viscosity)
    once, faster = Setup(scene).bed_stress(), Setup(scene).bed_stress(2.0)
    assert faster == pytest.approx(4.0 * Setup(twice).walls.shear_velocity ** 2)
    assert 2.0 * once < faster < 4.0 * once
    slow = Setup(scene).faster(slowest(Setup(scene))).scene
    assert grain_number(Setup(slow)) == pytest.approx(300.0, rel=1e-3)
    assert Setup(slow).walls.distance < 0.2


def test_a_measured_profile_enters_with_the_law_of_the_wall_below_and_above_it():
    """Rows of the law of one u* give that law and k = u*^2/C_mu^(1/2) near walls; k is taken from a third column."""
    law, viscosity = WallLaw(), 1.0 / 1e5
    y = np.geomspace(0.02, 0.98, 9)
    rows = np.column_stack([y, 0.04 * law.velocity(0.04, viscosity, np.minimum(y, 1 - y))])
    asked = Turbulence(**(MEASURED | {"length": 1.0}), profile=rows.tolist(), wall_distance=0.01)
    found = channel(flow=Poiseuille(), fluid=Fluid(reynolds=1e5, scale="flow"), turbulence=asked)
    enters, near = entering_of(found), np.array([0.01, 0.015, 0.1, 0.99])
    exact = 0.04 * law.velocity(0.04, viscosity, np.array([0.01, 0.015, 0.1, 0.01]))
    assert enters.speed(near) == pytest.approx(exact, rel=2e-3)
    k = 0.04**2 / 0.3 + 1.5e-4
    assert enters.energy(near[[0, 1, 3]]) == pytest.approx(k, rel=1e-6)
    length = 0.41 * near[[0, 1, 3]].clip(max=0.01 + 0.005)
    length[-1] = 0.41 * 0.01
    assert enters.dissipation(near[[0, 1, 3]]) == pytest.approx(
        0.09**0.75 * k**1.5 / length, rel=1e-6
    )
    third = Turbulence(**MEASURED, profile=[[*row, 0.01] for row in rows.tolist()])
    assert entering_of(channel(turbulence=third)).energy(near) == pytest.approx(0.01 + 1.5e-4)


def test_the_law_of_the_wall():
    """u+ = ln(y+)/0.41 + 5.2; on rough walls ln(y/k_s)/0.41 + 8.5 (Nikuradse 1933); u* from the speed and back."""
    smooth, rough = WallLaw(), WallLaw(roughness=0.2)
    assert smooth.velocity(1.0, 0.01, 1.0) == pytest.approx(np.log(100) / 0.41 + 5.2)
    assert rough.velocity(1.0, 1e-5, 1.0) == pytest.approx(np.log(5) / 0.41 + 8.5, rel=1e-12)
    for law in (smooth, rough, WallLaw(roughness=1e-3)):
        speeds = np.array([0.3, 1.0, 30.0])
        found = law.shear_velocity(speeds, 1e-4, 0.3)
        assert found * law.velocity(found, 1e-4, 0.3) == pytest.approx(speeds, rel=1e-7)


def test_between_smooth_and_rough_walls_the_law_is_nikuradse_s():
    """As `tests/one_dimensional.py` has it from the source: sand is not felt up to u* k/nu of 2.25, rough from 90."""
    sand = np.array([1.0, 2.25, 5.0, 20.0, 60.0, 90.0, 1000.0])
    found = [float(WallLaw(roughness=1e-3 * one).velocity(1.0, 1e-3, 2.0)) for one in sand]
    assert found == pytest.approx([float(law_of_the_wall(2000.0, one)) for one in sand], abs=2e-3)
    assert found[1] == pytest.approx(np.log(2000.0) / 0.41 + 5.2)


def test_rough_walls_are_judged_by_sand_and_depth_and_smooth_ones_by_viscosity():
    """Rough: from k to a fifth of the depth; the default is the larger of 50 nu/u* and k, which the law holds at."""
    fluid = Fluid(reynolds=1e6, scale="flow")
    for k in (5e-4, 0.005, 0.02, 0.05):
        scene = channel(turbulence=Turbulence(wall="rough", roughness=k), fluid=fluid)
        walls = Setup(scene).walls
        assert walls.distance == pytest.approx(max(50.0 * 1e-6 / walls.shear_velocity, k))
        assert walls.law.holds(walls.shear_velocity, 1e-6, walls.distance, 1.0)
    law = WallLaw(roughness=0.01)
    assert law.bounds(0.05, 1e-6, 1.0) == pytest.approx((0.01, 0.2))
    assert WallLaw().bounds(0.05, 1e-6, 1.0) == pytest.approx((6e-4, 6e-3))
    assert WallLaw(roughness=4e-5).bounds(0.05, 1e-6, 1.0) == pytest.approx((6e-4, 6e-3))
    between = WallLaw(roughness=2.85e-4).bounds(
        0.05, 1e-6, 1.0
    )  # u* k/nu = 14.2, half way in its logarithm
    assert between == pytest.approx((6e-4, 6e-3 * (0.2 / 6e-3) ** 0.7071), rel=2e-3)


def test_sand_that_is_too_high_for_the_depth_is_refused_by_a_remedy_that_helps():
    fluid = Fluid(reynolds=1e6, scale="flow")
    with pytest.raises(
        SceneError, match=r"have to reach 30% of the depth, at most 20%; use a smaller roughness"
    ):
        make_plan(channel(turbulence=Turbulence(wall="rough", roughness=0.3), fluid=fluid))
    gravel = Turbulence(wall="rough", roughness=0.15)
    with pytest.raises(
        SceneError, match=r"is 75% of the grain, at most 50%; use a smaller roughness"
    ):
        make_plan(
            channel(
                turbulence=gravel,
                fluid=fluid,
                body=Disc(diameter=0.2, centre=(10, 0.5)),
                bed=Flat(),
            )
        )


@pytest.mark.parametrize(
    "turbulence", [None, Turbulence(inflow="given", intensity=0.1, length=0.05)]
)
@pytest.mark.parametrize("flow", [OpenChannel(velocity=3.0), Poiseuille(velocity=3.0)])
def test_the_mean_velocity_that_enters_is_that_of_the_flow(flow, turbulence):
    """With the law's share between mesh and walls."""
    found = channel(flow=flow, turbulence=turbulence)
    walls, enters = Setup(found).walls, entering_of(found)
    inner = np.linspace(walls.distance, 1 - (walls.number - 1) * walls.distance, 20001)
    below = walls.number * walls.shear_velocity
    below *= walls.law.beyond(walls.shear_velocity, found.viscosity, walls.distance)
    speeds = enters.speed(0.5 * (inner[1:] + inner[:-1]))
    assert speeds.mean() * (inner[-1] - inner[0]) + below == pytest.approx(3.0, rel=1e-4)
    k, epsilon = enters.energy(inner), enters.dissipation(inner)
    assert (k > 0).all() and (epsilon > 0).all()
    if turbulence is not None:
        assert k == pytest.approx(1.5 * 0.3**2) and epsilon == pytest.approx(
            0.09**0.75 * k**1.5 / 0.05
        )
