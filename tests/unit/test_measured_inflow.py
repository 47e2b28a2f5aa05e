"""A measured profile that enters between resolved walls: rows of the model's own developed flow give that flow back."""

import numpy as np
import pytest

from incipient.errors import SceneError
from incipient.planning.flow_setup import Setup
from incipient.planning.measured_inflow import LawOfSand, resolved_walls_as_asked
from incipient.planning.measured_profile import Measured
from incipient.scene import Domain, Effects, Fluid, OpenChannel, Poiseuille, Scene, Turbulence

GIVEN = Turbulence(model="k-omega-sst", inflow="given", intensity=0.05, length=0.1)


def scene(turbulence, flow=None, domain=None, reynolds=20000.0):
    return Scene(
        domain=domain or Domain(length=6.0, height=1.0),
        fluid=Fluid(reynolds=reynolds, scale="flow"),
        flow=flow or OpenChannel(),
        effects=Effects(turbulence=True),
        turbulence=turbulence,
    )


def asked(rows, **changes):
    kind = {
        "model": "k-omega-sst",
        "inflow": "profile",
        "profile": rows,
        "intensity": 1e-6,
        "length": 0.1,
    }
    return Turbulence(**{**kind, **changes})


@pytest.mark.parametrize("sand", [0.0, 0.001, 0.02])
@pytest.mark.parametrize("flow", [OpenChannel(), Poiseuille()])
def test_rows_of_developed_flow_give_it_back(flow, sand):
    """u* and, below the first row, speed, k and omega of the flow in one dimension; between rows they interpolate."""
    wall = {"wall": "rough", "roughness": sand} if sand else {}
    developed = Setup(scene(Turbulence(model="k-omega-sst", **wall), flow)).resolved_walls
    heights = np.array(
        [0.03, 0.06, 0.1, 0.15, 0.25, 0.4, *([0.6, 0.8] if developed.number == 1 else [])]
    )
    if developed.number == 2:
        heights = np.concatenate([heights, 1.0 - heights[::-1]])
    places = np.zeros((3, len(heights)))
    places[1] = heights
    rows = np.column_stack(
        [heights, developed.velocity(places, 0.0)[0], np.exp(developed.logarithms(places)[0])]
    )
    found = Setup(scene(asked(rows.tolist(), **wall), flow)).resolved_walls
    assert found.shear_velocity == pytest.approx(developed.shear_velocity, rel=2e-3)
    x = np.zeros((3, 40))
    x[1] = np.geomspace(1e-4, 0.9 if developed.number == 1 else 0.45, 40)
    assert found.velocity(x, 0.0)[0] == pytest.approx(developed.velocity(x, 0.0)[0], rel=2e-2)
    near = x[1] < 0.015
    away = found.logarithms(x) - developed.logarithms(x)
    assert np.abs(away[:, near]).max() < 0.1
    # From the rows on omega is by the mixing length, kappa y, at most the one given.
    log_k, log_omega = found.logarithms(places)
    length = np.minimum(0.41 * found.from_next(places), 0.1)
    assert np.exp(log_omega) == pytest.approx(np.exp(log_k / 2) / (0.09**0.25 * length), rel=1e-6)
    x[1] = 1.0 - x[1]
    if developed.number == 2:
        assert np.abs((found.logarithms(x) - developed.logarithms(x))[:, near]).max() < 0.1


def test_below_the_rows_the_bed_upstream_may_be_rough():
    """The law of sand holds down to smooth walls, u* is the one of rough walls."""
    rows = [[0.1, 0.8], [0.5, 1.0], [0.9, 1.1]]
    rough = Setup(scene(asked(rows, wall="rough", roughness=0.02))).resolved_walls
    geometry, base, names = (
        getattr(Setup(scene(asked(rows))), one) for one in ("geometry", "base_flow", "sides")
    )
    found = resolved_walls_as_asked(geometry, base, names, asked(rows, upstream_roughness=0.02))
    assert not found.rough
    assert found.shear_velocity == pytest.approx(rough.shear_velocity, rel=1e-8)
    x = np.zeros((3, 20))
    x[1] = np.geomspace(1e-3, 0.9, 20)
    assert found.velocity(x, 0.0) == pytest.approx(rough.velocity(x, 0.0), rel=1e-8)


@pytest.mark.parametrize("over_sand", [5.0, 20.0])
def test_a_row_over_rough_sand_has_the_shear_velocity_of_the_law_of_nikuradse(over_sand):
    """1/0.41 ln(y/k_s) + 8.5 (Schlichting & Gersten 2017, section 17.1.2), where u* k_s/nu is 300.

    Within 6%: with Aupoix's conditions at the wall the model has 5% more at 5 k_s, 3% at 20 k_s of a depth of 100 k_s.
    """
    law = LawOfSand(depth=1.0, sand=0.01)
    speed = np.log(over_sand) / 0.41 + 8.5
    found = law.shear_velocity(np.array([speed]), 0.01 / 300.0, np.array([0.01 * over_sand]))
    assert found == pytest.approx([1.0], rel=0.06)


@pytest.mark.parametrize("flow", [OpenChannel(), Poiseuille()])
def test_a_uniform_flow_enters_beyond_thin_layers_at_walls(flow):
    """Its mean is V, its k 3/2 of the square of the intensity, its mixing length as given or kappa y."""
    walls = Setup(scene(GIVEN, flow)).resolved_walls
    x = np.zeros((3, 4001))
    x[1] = (np.arange(4001) + 0.5) / 4001
    speed = walls.velocity(x, 0.0)[0]
    assert speed.mean() == pytest.approx(1.0, rel=2e-3)
    beyond = walls.from_next(x) > 0.06 * walls.depth
    assert speed[beyond] == pytest.approx(np.full(beyond.sum(), 1.008), rel=0.01)
    middle = np.array([[0.0], [0.5], [0.0]])
    log_k, log_omega = walls.logarithms(middle)
    assert np.exp(log_k) == pytest.approx(1.5 * 0.05**2, rel=0.05)
    assert np.exp(0.5 * log_k - log_omega) / 0.09**0.25 == pytest.approx(0.1, rel=1e-6)


def test_what_is_not_simulated_is_refused():
    rows = [[0.1, 0.8], [0.5, 1.0]]
    with pytest.raises(SceneError, match=r"has a row at 1\.2"):
        from incipient.effects.plan import make_plan

        make_plan(scene(asked([*rows, [1.2, 1.0]]), Poiseuille()))
    with pytest.raises(SceneError, match="has a row at 1, the wall on top is 1 above that below"):
        make_plan(scene(asked([*rows, [1.0, 1.0]]), Poiseuille()))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("model", ["k-omega-sst", "k-epsilon"])
def test_a_row_at_the_water_surface_is_a_row_like_others(model):
    """There is no wall to take a u* of; speeds between rows are the ones with a row just below it."""
    found = []
    for top in (1.0, 1.0 - 1e-9):
        setup = Setup(scene(asked([[0.1, 0.7], [0.5, 0.9], [top, 1.0]], model=model)))
        rows = (
            setup.resolved_walls.measured.rows if model == "k-omega-sst" else entering_rows(setup)
        )
        found.append(rows.speed(np.array([0.3, 0.7, 0.95])))
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def entering_rows(setup):
    """The measured rows between walls with wall functions."""
    asked_for = setup.turbulence
    return Measured.of(
        setup.walls, asked_for.profile, asked_for.intensity, asked_for.length, asked_for.c_mu
    )


@pytest.mark.parametrize("model", ["k-omega-sst", "k-epsilon"])
def test_the_stress_on_the_bed_is_that_of_the_lower_row(model):
    """Between walls, below a profile that is fast at the upper one; cells are made for the larger u*."""
    rows = [[0.1, 0.5], [0.5, 1.0], [0.9, 1.0]]
    between = Setup(scene(asked(rows, model=model), Poiseuille(), reynolds=2e5))
    below = Setup(scene(asked(rows, model=model), reynolds=2e5))
    assert between.bed_stress() == pytest.approx(below.bed_stress(), rel=0.02)
    walls = between.resolved_walls if model == "k-omega-sst" else between.walls
    assert walls.shear_velocity**2 > 2.0 * between.bed_stress()


def test_the_stress_on_the_bed_below_a_uniform_flow_that_enters_is_that_to_which_it_develops():
    found, developed = (Setup(scene(one)) for one in (GIVEN, Turbulence(model="k-omega-sst")))
    assert found.bed_stress() == pytest.approx(developed.bed_stress(), rel=1e-9)
    assert found.resolved_walls.shear_velocity**2 > 1.5 * found.bed_stress()
