"""The k-omega SST model in scenes."""

import math

import numpy as np
import pytest
from one_dimensional import k_omega_channel
from scenes import IN_PLANE, SCENES, message
from turbulent import stream

import incipient
from incipient.accuracy.coarse_runs import kept_runs
from incipient.coupled import turbulent_flow
from incipient.errors import ConvergenceError
from incipient.planning.plan import make_plan
from incipient.results.result import Result
from incipient.results.wall_report import MOST_COARSE
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Effects,
    Flat,
    Fluid,
    Gravity,
    LogLaw,
    Numerics,
    OpenChannel,
    Poiseuille,
    Polyline,
    Scene,
    Sinusoidal,
    Turbulence,
)
from incipient.scene.file import load
from incipient.setup.setup import Setup
from incipient.turbulence.continuation import continued
from incipient.turbulence.developed import developed, of_discharge

# The k-omega SST model in scenes: against finite volumes, simulations and laminar flow, on ranks and in time.


# U_b+ of channels between walls by direct simulation, at Re_tau (Hoyas & Jimenez 2006; Lee & Moser 2015).
DIRECT = {547.0: 18.401, 1000.5: 19.990}


def channel(reynolds, length=6.0, mesh_size=1.0, **changes):
    """An open channel of depth 1 by k-omega SST."""
    domain = changes.pop("domain", Domain(length=length, height=1.0))
    return stream(reynolds, domain, mesh_size, **changes)


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [{"length": 40.0}, {"length": 12.0, "width": 2.0}])
def test_a_long_channel_stays_as_it_enters(sizes):
    """Forty depths; with grad-div the velocity alternated from cell to cell, more down the stream, to no flow at all.

    In space, two depths wide, k went up and down by a tenth for ever with the upwinding of flows past grains. Cells
    twice as large make u* of short channels 0.5% too small, in space 0.3% too large.
    """
    mean = k_omega_channel(547.0)
    walls = incipient.run(stream(547.0 * mean, Domain(height=1.0, **sizes), 2.0)).turbulence
    assert walls.at_outflow * mean == pytest.approx(1.0, rel=0.008)


@pytest.mark.parametrize("y_plus", [3.0, 12.0, 50.0])
def test_a_wall_may_be_at_any_distance(y_plus):
    """Re_tau = 1000.5: from the viscous sublayer to the logarithmic layer u* is within 2.5% of direct simulation's."""
    model = Turbulence(model="k-omega-sst", wall_distance=y_plus / 1000.5)
    walls = incipient.run(channel(1000.5 * DIRECT[1000.5], turbulence=model)).turbulence
    print(y_plus, 1 / walls.at_outflow, 1 / walls.shear_velocity)
    assert walls.largest == pytest.approx(y_plus, rel=0.1)
    assert 1 / walls.at_outflow == pytest.approx(DIRECT[1000.5], rel=0.025)


@pytest.mark.parametrize(
    ("re_tau", "sand", "distance", "within"),
    [
        *((re_tau, 0.0, None, 3e-3) for re_tau in (180.0, 547.0, 1000.5, 2004.0)),
        (1000.0, 5.2, None, 2e-3),
        (1000.0, 11.0, None, 2e-3),
        (1000.0, 40.0, None, 0.02),
        (1000.0, 40.0, 0.05, 0.05),
    ],
)
def test_a_channel_is_that_of_finite_volumes(re_tau, sand, distance, within):
    """U_b+ beside the same model in one dimension, with the same shift of a rough wall; of direct simulation within 3%.

    u* k_s/nu = 5.2 and 11 are in the middle. The sand of 40 puts the mesh's edge 6 nu/u* from the wall of the
    turbulence, in the buffer layer, where powers of the distance are fitted ones; y+ = 50 is the law of the wall with
    kappa = 0.41, from which the model's own layer is 2% away over smooth walls, too. That shift and Aupoix's (2015)
    values at the wall give the same U_b+ within 1%.
    """
    mean = developed(re_tau, sand / re_tau).mean
    assert k_omega_channel(re_tau, sand=sand) == pytest.approx(mean, rel=0.01 if sand else 1e-3)
    rough = {"wall": "rough", "roughness": sand / re_tau, "wall_distance": distance} if sand else {}
    model = Turbulence(model="k-omega-sst", **rough)
    walls = incipient.run(channel(re_tau * mean, turbulence=model)).turbulence
    print(re_tau, sand, 1 / walls.at_outflow, 1 / walls.shear_velocity, mean)
    assert 1 / walls.at_outflow == pytest.approx(mean, rel=within)
    if not sand:
        assert walls.largest < 2.5
        assert 1 / walls.shear_velocity == pytest.approx(mean, rel=within)
        assert 1 / walls.at_outflow == pytest.approx(DIRECT.get(re_tau, mean), rel=0.03)


def test_fine_sand_is_told_to_be_smooth():
    rough = Turbulence(model="k-omega-sst", wall="rough", roughness=0.001)
    warnings = make_plan(channel(11000.0, 2.0, 2.0, turbulence=rough)).warnings
    assert any("hydraulically smooth" in line for line in warnings)


@pytest.mark.parametrize(
    ("model", "length", "rel"),
    [("k-omega-sst", 4.0, 1e-3), pytest.param("k-epsilon", 20.0, 2e-3, marks=pytest.mark.slow)],
)
def test_a_channel_between_walls_is_two_open_ones(model, length, rel):
    mesh_size = 1.0 if model == "k-omega-sst" else 2.0
    one = stream(11000.0, Domain(length=length, height=1.0), mesh_size, model)
    both = stream(22000.0, Domain(length=length, height=2.0), mesh_size, model, flow=Poiseuille())
    computed, expected = (incipient.run(scene).turbulence.at_outflow for scene in (both, one))
    assert computed == pytest.approx(expected, rel=rel)


@pytest.mark.slow
@pytest.mark.parametrize("reynolds", [9900.0, pytest.param(19650.0, marks=pytest.mark.slow)])
def test_error_bars_contain_the_error(reynolds):
    """u* of Re_tau 547 and 1000 on three meshes, against one twice as fine as the finest, where they are within 1%."""
    best = incipient.run(channel(reynolds, mesh_size=0.5)).turbulence.shear_velocities
    for size in (2.0, 2.0**0.5, 1.0):
        result = incipient.run(channel(reynolds, numerics=Numerics(mesh_size=size, order=2)))
        bars = result.error_bars.total.others["shear_velocity"]
        errors = np.abs(result.turbulence.shear_velocities - best)
        print(reynolds, size, errors / best, bars / best)
        assert (errors <= bars).all()
    assert (bars < 0.01 * best).all()


@pytest.mark.slow
def test_a_uniform_flow_develops_to_that_which_stays():
    """160 depths after the inflow u* is the developed flow's, within 1%."""
    given = Turbulence(model="k-omega-sst", inflow="given", intensity=0.05, length=0.1)
    computed = incipient.run(
        channel(9900.0, length=160.0, mesh_size=2.0, turbulence=given)
    ).turbulence
    developed = Setup(channel(9900.0)).walls.shear_velocity
    assert computed.at_outflow == pytest.approx(developed, rel=0.01)


def test_slow_flow_is_laminar():
    """u*^2 = 3 nu V/h of half a parabola (exact); the plan says that the model has no turbulence there."""
    result = incipient.run(channel(100.0, 4.0))
    assert result.turbulence.at_outflow == pytest.approx(np.sqrt(0.03), rel=2e-3)
    assert any("laminar by the k-omega model" in line for line in result.plan.warnings)


def over_mean_profile(number, depth=60.0):
    """Drag, lift and couple of a disc in a channel, over those in laminar flow below a log-law, less one."""
    grain = {
        "bed": Flat(),
        "body": Disc(diameter=1.0, x=0.0, density=2.65),
        "contact": Contact(friction=0.5),
        "domain": Domain(length=24.0, height=depth, origin=(-9.6, 0.0)),
        "numerics": Numerics(order=2, error_bars=False, mesh_size=1.5),
    }
    mean = developed(number * depth).mean
    model = channel(number * depth * mean, **grain)
    plain = {"turbulence": None, "effects": Effects(), "flow": LogLaw(shear_velocity=1.0)}
    law = channel(3.0, **grain | plain).model_copy(
        update={"fluid": Fluid(reynolds=number, scale="grain")}
    )
    turbulent, laminar = (incipient.run(one).load[IN_PLANE] for one in (model, law))
    computed = turbulent * mean**2 / laminar - 1.0
    print(number, computed)
    return computed


@pytest.mark.slow
def test_loads_on_sand_tend_to_those_of_laminar_flow_over_the_mean_profile():
    """u* d/nu = 1 within 3%, nearer than at 10, where the model's own mean profile and eddies count.

    Stress falls to zero over the 60 grains of depth, below a log-law it does not: that alone is 1% of drag, 2% of lift.
    """
    slow, fast = over_mean_profile(1.0), over_mean_profile(10.0)
    assert np.abs(slow).max() < 0.03
    assert (np.abs(slow) < np.abs(fast)).all()


@pytest.mark.slow
def test_a_flow_that_does_not_converge_has_means_of_its_loads(monkeypatch):
    """A tolerance below round-off is never met: loads differ from converged ones by less than their tolerance, 1e-4."""
    computed, outcomes = [], []

    def kept(*arguments):
        outcomes.append(continued(*arguments))
        return outcomes[-1]

    monkeypatch.setattr(turbulent_flow, "continued", kept)
    for tolerance in ("auto", 1e-25):
        numerics = Numerics(order=2, error_bars=False, mesh_size=2.8, tolerance=tolerance)
        mean = developed(80.0).mean
        disc = {"body": Disc(diameter=1.0, x=0.0, density=2.65), "contact": Contact(friction=0.5)}
        box = Domain(length=10.0, height=4.0, origin=(-4.0, 0.0))
        computed.append(
            incipient.run(channel(80.0 * mean, domain=box, bed=Flat(), numerics=numerics, **disc))
        )
    converged, other = computed
    assert converged.turbulence.converged and converged.turbulence.spread == 0.0
    assert not other.turbulence.converged and 0.0 < other.turbulence.spread < 1e-6
    assert len(other.to_dict()["turbulence"]["changes"]) > len(converged.turbulence.changes)
    assert "NOT CONVERGED after" in other.text() and "NOT CONVERGED" not in converged.text()
    assert other.force.flow == pytest.approx(converged.force.flow, rel=1e-4, abs=1e-9)
    assert other.force.flow == pytest.approx(outcomes[-1].loads[:3], rel=1e-12)


@pytest.mark.slow
def test_a_large_wake_is_found():
    """u* d/nu = 102, where solving by turns finds no flow: loads of which finer cells change at most 0.5%.

    They are also within 0.5% of those of an earlier version on cells as long as thick along walls, 22,295 unknowns of
    the flow.
    """
    mean = developed(102.0 * 4.0).mean
    grain = {
        "bed": Flat(),
        "body": Disc(diameter=1.0, x=0.0, density=2.65),
        "contact": Contact(friction=0.5),
        "domain": Domain(length=10.0, height=4.0, origin=(-4.0, 0.0)),
    }
    loads = []
    for size in (1.7, 1.41):
        numerics = Numerics(order=2, error_bars=False, mesh_size=size)
        computed = incipient.run(channel(102.0 * 4.0 * mean, numerics=numerics, **grain))
        loads.append(computed.load[IN_PLANE])
        assert (
            computed.cost["iterations"]["turbulence"] < 60
        )  # 187 to 298 where single nodes shorten all cells' steps
    assert loads[0] == pytest.approx(loads[1], rel=5e-3)
    assert loads[1] == pytest.approx([0.639798, 0.387428, -0.0088965], rel=5e-3)


@pytest.mark.slow
def test_a_flow_with_dead_water_at_a_contact_converges():
    """A stone at u* d/nu = 800 with the default gap: an earlier version did not find it in 300 steps.

    Its loads lie between those at u* d/nu = 430 and 1300, to 1%.
    """
    loads = []
    for reynolds in (45_000.0, 90_000.0, 150_000.0):
        grain = {
            "bed": Flat(),
            "body": Disc(diameter=0.2, x=2.9375, density=2.65),
            "contact": Contact(friction=0.6),
            "domain": Domain(length=6.0, height=1.0),
        }
        computed = incipient.run(channel(reynolds, mesh_size=2.0, **grain))
        loads.append(computed.force.flow[:2])
        assert computed.turbulence.converged and len(computed.turbulence.changes) < 60
    slow, asked, fast = loads
    assert (asked > 0.99 * np.minimum(slow, fast)).all()
    assert (asked < 1.01 * np.maximum(slow, fast)).all()


@pytest.mark.slow
def test_a_step_is_reattached_where_others_say():
    """Within 5% of the 6.543 of CFL3D by this model (benchmarks/reference/k_omega_sst.csv); k-epsilon is 19% short.

    Measured are 6.26 +- 0.10 (Driver & Seegmiller 1985, AIAA J. 23, 163).
    """
    scene = load(SCENES / "backward_facing_step.toml")
    model = {"model": "k-omega-sst", "wall_distance": None}
    coarse = {"mesh_size": 2.0, "error_bars": False}
    sections = {
        "turbulence": scene.turbulence.model_copy(update=model),
        "numerics": scene.numerics.model_copy(update=coarse),
    }
    walls = incipient.run(scene.model_copy(update=sections)).turbulence
    _, end = walls.separated
    print(end, walls.largest)
    assert walls.largest < 2.5
    assert end == pytest.approx(6.543, rel=0.05)


def on_waves(reynolds, acceleration):
    """A disc in the trough of a wavy bed, of u* d/nu about 11 at Re 1150; V is one."""
    return channel(
        reynolds,
        domain=Domain(length=12.0, height=8.0),
        bed=Sinusoidal(amplitude=0.08, wavelength=1.0),
        body=Disc(diameter=1.0, x=4.75, density=2.65),
        contact=Contact(friction=0.6),
        gravity=Gravity(acceleration=acceleration),
        numerics=Numerics(order=2, error_bars=False, mesh_size=2.0),
    )


@pytest.mark.slow
def test_loads_below_a_rough_stream_follow_the_speed_that_enters():
    """Over those below a smooth stream of the same discharge: between the squares of speeds at its foot and its top.

    What enters has V/u* of the same model with Aupoix's conditions, whose u+ is up to 0.32 off Nikuradse's: 3% of V/u*.
    """
    loads, speeds = [], []
    for sand in (0.0, 1.0):
        model = Turbulence(model="k-omega-sst", upstream_roughness=sand)
        scene = on_waves(2600.0, 0.1).model_copy(update={"turbulence": model})
        walls = Setup(scene).walls
        speeds.append(walls.inflow.velocity_at(np.array([0.25, 1.0]))[0])
        loads.append(incipient.run(scene).load[IN_PLANE])
    mean = k_omega_channel(walls.depth / walls.unit, sand=1.0 / walls.unit)
    assert 1.0 / walls.shear_velocity == pytest.approx(mean, rel=0.03)
    foot, top = (speeds[1] / speeds[0]) ** 2
    assert top < 0.95 and foot > 1.15
    assert all(top < one < foot for one in np.divide(loads[1], loads[0]))


@pytest.mark.slow
@pytest.mark.parametrize("sand", [0.0, 0.2])
def test_the_grain_is_about_to_move_at_its_threshold(sand):
    """A run of the critical flow, on a mesh of its own, has the safety factor one within 2%; tau_b is what enters."""

    def over_sand(reynolds, acceleration):
        wall = {"wall": "rough", "roughness": sand} if sand else {}
        model = Turbulence(model="k-omega-sst", **wall)
        return on_waves(reynolds, acceleration).model_copy(update={"turbulence": model})

    computed = incipient.threshold(over_sand(2600.0, 0.1))
    assert 0.2 < computed.factor < 0.8 and computed.adaptation is None
    critical = over_sand(2600.0 * computed.factor, 0.1 / computed.factor**2)
    assert incipient.run(critical).verdict["safety_factor"] == pytest.approx(1.0, rel=0.02)
    stress = of_discharge(2600.0 * computed.factor, sand / 8.0)
    weight = 1.65 * 0.1 / computed.factor**2
    assert computed.shields == pytest.approx(1.0 / stress.mean**2 / weight, rel=1e-4)
    assert computed.shear_reynolds == pytest.approx(stress.re_tau / 8.0, rel=1e-4)
    assert any("tau_b of the inflow" in note for note in computed.notes)


@pytest.mark.parametrize(
    ("order", "mesh_size", "within"),
    [(2, 3.0, 0.01), (2, 4.0, 0.015), (3, 1.0, 0.005), (3, 2.0, 0.01), (3, 3.0, 0.01)],
)
def test_any_order_and_size_of_cells_converges(order, mesh_size, within):
    """u* against the 1-D model's, as near as by an earlier version (2.3% on cells of 4, 3% on those of 3, order 3).

    With a derivative of quadrature degree 5 velocities of order 3 grew eightfold in each iteration; with first rows as
    coarse as all others k grew twofold.
    """
    numerics = Numerics(order=order, mesh_size=mesh_size, error_bars=False)
    computed = incipient.run(channel(20000.0, numerics=numerics)).turbulence
    assert computed.converged and len(computed.changes) <= 12
    mean = of_discharge(20000.0, 0.0).mean
    print(order, mesh_size, 1 / computed.shear_velocity / mean - 1, len(computed.changes))
    assert 1.0 / computed.shear_velocity == pytest.approx(mean, rel=within)


@pytest.mark.parametrize(
    ("order", "mesh_size", "within"), [(2, 4.0, 0.05), (2, 3.4, 0.02), (3, 2.8, 0.02)]
)
def test_a_flow_past_a_grain_converges_on_coarse_cells(order, mesh_size, within):
    """u* d/nu = 30, loads near those on cells of 0.7 of both orders: on cells of 4.0, 3.4, 2.8, 2.0, 1.4 and 1.0 of
    order 2 the lift is 4.1%, 0.2%, 0.1%, 0.3%, 0.02% and 0.001% off.

    Where first layers grew with all cells k in them grew without end from 3 nu/u* on.
    """
    mean = developed(120.0).mean
    grain = {"body": Disc(diameter=1.0, x=0.0, density=2.65), "contact": Contact(friction=0.5)}
    box = Domain(length=10.0, height=4.0, origin=(-4.0, 0.0))
    numerics = Numerics(order=order, mesh_size=mesh_size, error_bars=False)
    computed = incipient.run(
        channel(120.0 * mean, domain=box, bed=Flat(), numerics=numerics, **grain)
    )
    assert computed.turbulence.converged
    print(order, mesh_size, computed.force.flow, len(computed.turbulence.changes))
    assert computed.force.flow[:2] == pytest.approx([0.5821, 0.3555], rel=within)


def test_an_accuracy_is_reached_where_walls_are_resolved():
    result = incipient.run(channel(20000.0, numerics=Numerics(accuracy=0.02)))
    assert result.adaptation.met and result.turbulence.converged
    assert result.turbulence.mesh_size < 3.0


# Cells along a smooth bump in turbulent flow by k-omega SST: placed as friction needs them, and judged.


X = [-3.0 + 0.15 * i for i in range(41)]
BUMP = tuple((x, 0.08 * math.cos(math.pi * x / 1.5) ** 2 if abs(x) < 0.7501 else 0.0) for x in X)
BEHIND_CREST = (
    0.00296  # C_f at x = 0.2 on cells 0.025 long; 0.00259 on those of 0.05, 0.00185 on those of 0.1
)


def over_bump(mesh_size: float) -> Result:
    """The flow over a bump 0.08 high and 1.5 long in a channel of depth one."""
    domain = Domain(length=6.0, height=1.0, origin=(-3.0, 0.0))
    bed = Polyline(points=BUMP, smooth=True)
    return incipient.run(stream(40000.0, domain, mesh_size, bed=bed))


@pytest.mark.slow
def test_cells_along_a_bump_follow_its_friction():
    """With cells 0.1 long the friction behind the crest was 40% too small; those too long are not called resolved."""
    walls, coarse = (over_bump(size).turbulence for size in (1.0, 2.0))
    along = walls.along["bed"]  # at nodes 0.05 apart, between which friction halves
    assert np.interp(0.2, along["x"], along["friction"]) == pytest.approx(BEHIND_CREST, rel=0.15)
    assert walls.judged_along and walls.coarse_along < MOST_COARSE and not walls.doubt
    assert coarse.coarse_along > MOST_COARSE
    assert "NOT RESOLVED" in coarse.lines()[0] and "set numerics.mesh_size = 1;" in coarse.doubt


def test_a_coarse_run_that_fails_does_not_advise_the_user_for_its_own_scene():
    def fails(scene: Scene) -> None:
        raise ConvergenceError("cells at walls are thick; use a smaller fluid.reynolds")

    domain = Domain(length=1.0, height=1.0)
    scene = Scene(domain=domain, fluid=Fluid(reynolds=1.0, scale="flow"), flow=OpenChannel())
    said = message(lambda: kept_runs({}, lambda: "", fails)(scene), ConvergenceError)
    assert said == "cells at walls are thick, in a run for comparison"
