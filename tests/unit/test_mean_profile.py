"""The mean profile of a turbulent stream against published ones, and what a scene and a plan make of it."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scenes import message, scene

from incipient import make_plan
from incipient.planning.meshing import lay_out
from incipient.results.si import in_si
from incipient.scene import Domain, Fluid, HalfDiscs, LogLaw, Uniform
from incipient.scene.file import loads
from incipient.setup.driving_force import sustaining_force
from incipient.setup.mean_profile import KAPPA, MeanProfile
from incipient.setup.numbers import numbers_of
from incipient.setup.setup import Setup

DNS = Path(__file__).parents[1] / "reference" / "channel_dns.csv"


def in_wall_units(roughness=0.0, depth=1e5):
    return MeanProfile(1.0, 1.0, roughness, depth)


def test_a_smooth_bed_has_the_profile_of_direct_simulations():
    """Lee & Moser (2015, J. Fluid Mech. 774, 395), Re_tau 5186, up to where the channel's middle is felt."""
    with DNS.open(newline="") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        found = [
            (float(row["y_plus"]), float(row["U_plus"]))
            for row in rows
            if row["re_tau"].startswith("518")
        ]
    y, u = np.transpose([pair for pair in found if pair[0] < 500])
    assert len(y) > 10
    assert in_wall_units().speed(y) == pytest.approx(u, rel=0.05)


def test_a_smooth_bed_has_a_viscous_sublayer_and_the_logarithmic_law():
    """u = y at the bed; van Driest's own constant above is 5.24 with 0.4 and 26 (J. Aeronaut. Sci. 23, 1007)."""
    smooth = in_wall_units()
    assert smooth.speed(np.array([1e-3, 1.0])) == pytest.approx([1e-3, 1.0], rel=3e-3)
    y = np.array([300.0, 1000.0, 5000.0])
    # Found: 5.287, 5.280 and 5.278 with a kappa of 0.41, where his is 0.40.
    assert smooth.speed(y) - np.log(y) / KAPPA == pytest.approx(5.24, abs=0.1)


@pytest.mark.parametrize("k", [70.0, 200.0, 500.0])
def test_a_rough_bed_has_the_law_of_nikuradse(k):
    """u = ln(y/k)/kappa + 8.5 (Nikuradse 1933, VDI-Forschungsheft 361)."""
    y = np.array([20.0, 100.0]) * k
    # Cebeci and Chang's shift with van Driest's damping gives 8.74, 8.55 and 8.72.
    assert in_wall_units(k).speed(y) - np.log(y / k) / KAPPA == pytest.approx(8.5, abs=0.3)


def test_the_profile_in_the_scene_s_units():
    """Lengths over nu/u*, speeds over u*; it starts at the datum, and its top is the domain's."""
    flow = LogLaw(shear_velocity=2.0, roughness=0.3, datum=0.1)
    found = scene(
        flow=flow, bed=HalfDiscs(radius=0.5, spacing=1.2), fluid=Fluid(reynolds=50, scale="grain")
    )
    assert found.reference_velocity == 2.0 and found.viscosity == pytest.approx(2.0 / 50)
    heights = np.array([0.05, 0.1, 0.6, 6.0])
    points = np.vstack([np.zeros(4), heights, np.zeros(4)])
    expected = 2.0 * in_wall_units(0.3 * 50).speed(np.maximum(heights - 0.1, 0.0) * 50)
    speed = Setup(found).base_flow.velocity(points, 0.0)
    assert speed[0] == pytest.approx(expected, rel=1e-7) and not speed[1].any()
    assert found.top == "stream"


def test_in_si_units_the_velocity_is_that_of_shear():
    """Sand of 1 mm below u* = 2 cm/s in water: Re* = 20, and a stress of rho u*^2 = 0.4 Pa."""
    units = {"diameter": 1e-3, "velocity": 0.02, "viscosity": 1e-6, "fluid_density": 1000.0}
    text = '[domain]\nlength=12\nheight=6\n[flow]\nkind="log-law"\n[bed]\nkind="flat"\n[body]\nx=4\nshape="disc"\n'
    text += 'diameter=1\n[fluid]\nscale="grain"\n[units]\n'
    found = loads(text + "".join(f"{key}={value}\n" for key, value in units.items()))
    assert found.fluid.reynolds == pytest.approx(20.0)
    told = in_si(found)
    assert told["bed_stress"] == pytest.approx(0.4) and told["shear_velocity"] == pytest.approx(
        0.02
    )


def test_the_force_brings_down_what_the_bed_takes_more_than_viscosity_does():
    """Over the height it adds up to u*^2 less the viscous stress on top, that at a smooth bed being u*^2."""
    import dolfinx
    import ufl
    from mpi4py import MPI

    from incipient import compat

    found = scene(flow=LogLaw(shear_velocity=2.0), fluid=Fluid(reynolds=30, scale="flow"))
    mesh = dolfinx.mesh.create_rectangle(
        MPI.COMM_SELF,
        [np.array([0.0, 0.0]), np.array([1.0, 6.0])],
        [1, 100],
        dolfinx.mesh.CellType.quadrilateral,
    )
    measure = ufl.dx(domain=mesh, metadata={"quadrature_degree": 8})
    force = sustaining_force(
        Setup(found).base_flow.mean_profile, Setup(found).base_flow.datum, found.up
    )(ufl.SpatialCoordinate(mesh), None)
    whole = dolfinx.fem.assemble_scalar(compat.form(force[0] * measure))
    top = MeanProfile(2.0, found.viscosity, 0.0, 6.0).speed(np.array([6.0 - 1e-4, 6.0]))
    assert whole == pytest.approx(4.0 - found.viscosity * (top[1] - top[0]) / 1e-4, rel=1e-5)
    assert force[1] == 0


def test_the_plan_tells_what_the_stream_is():
    found = scene(flow=LogLaw(roughness=1.0), fluid=Fluid(reynolds=20, scale="grain"))
    numbers, text = numbers_of(Setup(found)), make_plan(found).text()
    assert numbers.shear_reynolds == pytest.approx(20.0)
    assert numbers.flow_reynolds == pytest.approx(Setup(found).base_flow.mean_speed * 6.0 * 20.0)
    assert (
        "mean profile of a turbulent flow, maintained by a body force instead of the turbulent stress"
        in text
    )
    assert (
        "no  turbulence: only with effects.turbulence = true; mean profile only, the bed is hydraulically"
        in text
    )
    assert "between smooth and rough, u* k_s/nu = 20" in text and "channels are laminar" not in text
    slow = scene(flow=LogLaw(), fluid=Fluid(reynolds=30, scale="flow"))
    assert (
        "hydraulically smooth" in make_plan(slow).text()
        and "laminar to 650" in make_plan(slow).text()
    )


def test_cells_at_the_bed_follow_the_profile():
    """Ten wall units: 10/20; below a stream of another kind there are none."""
    found = scene(flow=LogLaw(), fluid=Fluid(reynolds=20, scale="grain"))
    (near,) = [
        one for one in lay_out(Setup(found), make_plan(found)).sizes.near if one.boundary == "bed"
    ]
    assert near.size == pytest.approx(0.5)
    other = scene(flow=Uniform())
    assert not [
        one for one in lay_out(Setup(other), make_plan(other)).sizes.near if one.boundary == "bed"
    ]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"flow": {"kind": "log-law", "roughness": -1}}, "flow.roughness: is -1"),
        (
            {"flow": LogLaw(roughness=30.0)},
            "flow.roughness: is 600 times nu/u*; the mean profile is known up to 500",
        ),
        (
            {"flow": LogLaw(), "domain": Domain(length=12, height=6, top="wall")},
            'domain.top: "wall" contradicts the flow "log-law"; use "auto", "slip" or "stream"',
        ),
        (
            {"flow": LogLaw(), "domain": Domain(length=12, height=6, kind="box")},
            'flow.kind: "log-law" needs open ends but a box is closed',
        ),
        ({"flow": LogLaw(datum=0.7), "bed": HalfDiscs(radius=0.5, spacing=1.2)}, "flow.datum: "),
    ],
)
def test_what_a_scene_with_it_may_not_be(changes, words):
    assert words in message(lambda: scene(**changes))
