"""Rough walls by k-omega SST: below a smooth grain, with forms, in space; beside developed flow and smooth walls."""

from functools import partial

import numpy as np
import pytest
from mpi4py import MPI
from scenes import IN_PLANE
from turbulent import assert_alike, changes_by_new_meshes, stream

import incipient
from incipient.coupled.tractions import TractionProbe
from incipient.errors import SceneError
from incipient.planning.plan import make_plan
from incipient.planning.sizes import wall_layers
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Flat,
    Fluid,
    Gravity,
    Numerics,
    Output,
    RidgeBed,
    Sinusoidal,
    Sphere,
    SphereBed,
    Time,
    Turbulence,
)
from incipient.setup.setup import Setup
from incipient.simulation.build import prepared
from incipient.turbulence.developed import developed, of_discharge
from incipient.turbulence.wall_law import shift


def over_sand(roughness, reynolds, mesh_size, domain, **changes):
    """An open channel of mean velocity 1 over sand; none: over a smooth bed."""
    wall = {"wall": "rough", "roughness": roughness} if roughness else {}
    return stream(
        reynolds,
        domain,
        mesh_size,
        **{"turbulence": Turbulence(model="k-omega-sst", **wall)} | changes,
    )


def waves(roughness, amplitude=0.025, mesh_size=2.0):
    """The walls of a wavy bed at the Reynolds number 22,000."""
    bed = Sinusoidal(amplitude=amplitude, wavelength=1.0)
    scene = over_sand(roughness, 22000.0, mesh_size, Domain(length=4.0, height=1.0), bed=bed)
    return incipient.run(scene).turbulence


def on_sand(number, roughness, mesh_size=2.0, length=10.0, depth=4.0, upstream=0.0):
    """A disc of diameter 1 in a stream that developed over sand, u* d/nu given; the sand is on the bed or upstream."""
    mean = developed(number * depth, max(roughness, upstream) / depth).mean
    result = over_sand(
        roughness,
        number * depth * mean,
        mesh_size,
        Domain(length=length, height=depth, origin=(-0.4 * length, 0.0)),
        bed=Flat(),
        body=Disc(diameter=1.0, x=0.0, density=2.65),
        contact=Contact(friction=0.5),
    )
    upstream_sand = Turbulence(model="k-omega-sst", upstream_roughness=upstream)
    return result.model_copy(update={"turbulence": upstream_sand}) if upstream else result


@pytest.mark.slow
def test_flow_over_sand_on_a_free_mesh_is_developed_flow():
    """Waves of no height to speak of, with thin cells along them: u* within 1% of finite volumes in one dimension."""
    walls = waves(0.02, 5e-4, 1.4)
    assert 1.0 / walls.shear_velocity == pytest.approx(of_discharge(22000.0, 0.02).mean, rel=0.01)


@pytest.mark.slow
def test_waves_with_ever_finer_sand_are_smooth_ones():
    """u* k_s/nu of 11, 5 and 1.2 by the mean u*: the friction is ever nearer to that of smooth waves."""
    smooth = waves(0.0).shear_velocity
    away = np.array([waves(size).shear_velocity for size in (0.01, 0.005, 0.00125)]) / smooth - 1.0
    print(away)
    # Over a level bed 0.085, 0.015 and 0 by the model in one dimension.
    assert away[0] > 0.04 and (np.abs(away[1:]) < np.abs(away[:-1])).all()
    assert abs(away[-1]) < 2e-3


@pytest.mark.slow
def test_cells_that_are_finer_leave_loads_on_a_grain_on_sand_as_they_are():
    """u* d/nu = 80, u* k_s/nu = 8: cells of three sizes, the finest half as large as the coarsest.

    On cells of 1.6 to 2.4 the drag scatters from mesh to mesh by 0.5%, with these layers and with others.
    """
    sizes = (2.0**0.5, 1.0, 0.5**0.5)
    result = np.array([incipient.run(on_sand(80.0, 0.1, size)).load[IN_PLANE] for size in sizes])
    print(result)
    assert result[:, :2] == pytest.approx(result[-1:, :2].repeat(3, axis=0), rel=2e-3)
    assert np.abs(result[:, 2] - result[-1, 2]).max() < 2e-3 * abs(result[-1, 0])


@pytest.mark.slow
def test_upstream_of_a_grain_the_stream_stays_developed_over_sand():
    """u* d/nu = 60, u* k_s/nu = 12: u* of the bed over that of what enters, nine to seven diameters ahead of the grain.

    The grain takes as much of it as over a smooth bed that a stream enters which developed over such a bed. Where the
    sand is upstream only, the bed has less from the inflow on.
    """

    def ahead(roughness, upstream=0.0):
        scene = on_sand(60.0, roughness, 2.0, 24.0, 8.0, upstream)
        bed = incipient.run(scene).turbulence.along["bed"]
        x, friction = np.array(bed["x"]), np.array(bed["friction"])
        there = (x > -9.0) & (x < -7.0)
        return np.sqrt(0.5 * friction[there]) / Setup(scene).walls.shear_velocity

    smooth, rough, below = ahead(0.0), ahead(0.2), ahead(0.0, 0.2)
    print(smooth, rough, below)
    assert rough == pytest.approx(smooth, rel=0.02)
    assert (below < 0.97 * rough).all()


@pytest.mark.slow
def test_a_steady_flow_past_a_grain_on_sand_stays_in_time():
    """u* d/nu = 10, u* k_s/nu = 2: loads after two steps from the steady flow are those of that flow."""
    scene = on_sand(10.0, 0.2)
    later = scene.model_copy(update={"time": Time(step=0.5, end=1.0, start="steady")})
    assert_alike(later, scene, 1e-5)


def moving(motion, end, remesh_below=0.35, mesh_size=2.8, **body):
    """A light disc above a wavy bed with sand, u* k_s/nu about 9, from the steady flow."""
    return over_sand(
        0.2,
        3000.0,
        mesh_size,
        Domain(length=6.0, height=4.0),
        bed=Sinusoidal(amplitude=0.08, wavelength=1.0),
        body=Disc(diameter=1.0, centre=(3.0, 1.2), density=0.5, motion=motion, **body),
        gravity=Gravity(acceleration=0.2),
        contact=Contact(friction=0.6),
        time=Time(end=end, step=0.05, start="steady"),
        numerics=Numerics(
            order=2, error_bars=False, mesh_size=mesh_size, remesh_below=remesh_below
        ),
        output=Output(fields=False),
    )


@pytest.mark.slow
def test_new_meshes_over_sand_leave_a_free_grain_as_it_is(tmp_path):
    """Several meshes in eight steps, or one: loads and velocities change less than by what meshes err."""

    def run(many, finer, directory):
        incipient.run(moving("free", 0.4, 0.97 if many else 0.05, 2.8 * finer), directory)

    changed, wrong, meshes = changes_by_new_meshes(tmp_path, run, 2)
    assert meshes >= 2 and (changed < wrong).all()


ON_PLANE = {"bed": Flat(), "body": Sphere(diameter=1.0, x=3.0, density=2.65)}
IN_POCKET = {
    "bed": SphereBed(
        radius=0.5,
        spacing=1.0,
        arrangement="triangular",
        angle=90.0,
        offset=(4.0 + 12.0**-0.5, 3.0),
    ),
    "body": Sphere(diameter=1.0, x=4.0, density=2.5),
    "fluid": Fluid(reynolds=100.0, scale="grain"),
}


def of_sphere(mesh_size, grain, sizes, sand):
    """A sphere in a stream over sand in a domain of a length, width and height."""
    domain = Domain(**dict(zip(("length", "width", "height"), sizes, strict=True)))
    contact = Contact(friction=0.5, gap=0.05)
    return over_sand(sand, 1500.0, mesh_size, domain, contact=contact, **grain)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("over", "sand"),
    [
        (partial(on_sand, 20.0), 0.15),  # u* d/nu = 20 and u* k_s/nu = 3
        (partial(of_sphere, 3.0, ON_PLANE, (8.0, 6.0, 5.0)), 0.2),  # 22 and 4.4
        # 9 and 0.9, on a bed of equal spheres.
        (partial(of_sphere, 2.5, IN_POCKET, (9.0, 5.0, 5.866)), 0.1),
    ],
)
def test_a_grain_on_hydraulically_smooth_sand_bears_what_it_does_on_a_smooth_bed(over, sand):
    """Within 1% of the loads without sand, in the plane and in space."""
    assert_alike(over(sand), over(0.0), 0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sand", "mesh_size", "in_space", "within"),
    # Layers of cells grow twice as fast in 3-D: measured 1.2%, 1.8%, 0.2%; 0.1%, 5.5%, 1.8%, and in space
    # on 1.41 and 0.7 a lift 13.5% and 1.3% off.
    [(0.02, 1.41, 1.41, (0.015, 0.04, 0.02)), (0.0, 1.2, 1.0, (0.02, 0.1, 0.05))],
)
def test_ridges_across_a_slice_bear_what_waves_in_the_plane_do(sand, mesh_size, in_space, within):
    """Force on a bed by its width along the stream and up, and u*: the plane's.

    The lift is the level of the pressure, which the place of the outflow decides: in a domain of 4.25 wavelengths it is
    ten times as large, and 2% off without sand. Over smooth ridges the velocity changes by 0.2% for
    ever, the force on the bed hardly, for which the flow is taken. In the plane that is not found on 1.41.
    """
    forms, result = {"amplitude": 0.025, "wavelength": 1.0}, []
    plane, space = (
        (Sinusoidal(**forms), mesh_size, {}),
        (RidgeBed(**forms), in_space, {"width": 0.3}),
    )
    for bed, size, across in (plane, space):
        domain = Domain(length=4.0, height=1.0, **across)
        with prepared(over_sand(sand, 22000.0, size, domain, bed=bed), MPI.COMM_SELF) as run:
            part, gdim = run.turbulence, run.fluid.domain.gdim
            part.solve(run)
            force = TractionProbe(run.fluid, "bed", [0.0] * gdim).resultant().force / across.get(
                "width", 1.0
            )
            result.append([force[0], force[gdim - 1], part.wall_report().shear_velocity])
    plane, space = np.array(result)
    print(plane, space / plane)
    assert (np.abs(space / plane - 1.0) < within).all()


ROWS = {
    "inflow": "profile",
    "profile": ((0.1, 0.75), (0.5, 1.05)),
    "intensity": 0.01,
    "length": 0.1,
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reynolds", "asked", "length", "width", "close"),
    [
        (22000.0, {"wall": "rough", "roughness": 0.05}, 3.0, 0.3, (5e-3, 0.02, 0.02)),
        (22000.0, {"wall": "rough", "roughness": 0.02}, 3.0, 0.3, (5e-3, 0.02, 0.02)),
        # Two rows over sand: measured 1.7%.
        (22000.0, {"wall": "rough", "roughness": 0.05} | ROWS, 3.0, 0.3, (0.02,)),
        (9900.0, {}, 3.0, 0.3, (5e-3, 0.02, 0.02)),
        # By which triangles and tetrahedra may differ; the least y+ is that of one corner, next to the inflow.
        (11000.0, {"model": "k-epsilon"}, 4.0, 2.0, (1e-3, 3e-3, 1e-3)),
    ],
)
def test_a_slice_of_a_channel_is_the_plane_s(reynolds, asked, length, width, close):
    """u*, and the least and largest y+, in space between sides without friction, in as many rows."""
    model = Turbulence(**{"model": "k-omega-sst", **asked})
    plane, space = (
        incipient.run(stream(reynolds, domain, 2.0, turbulence=model)).turbulence
        for domain in (
            Domain(length=length, height=1.0),
            Domain(length=length, width=width, height=1.0),
        )
    )
    assert space.plane
    assert space.at_outflow == pytest.approx(plane.at_outflow, rel=close[0])
    for name, rel in zip(
        ("shear_velocity", "least", "largest"), (close[0], *close[1:]), strict=False
    ):
        assert getattr(space, name) == pytest.approx(getattr(plane, name), rel=rel), name


def test_sand_is_on_the_bed_and_small_beside_the_grain():
    """Cells at both walls are as each needs; what enters is over the sand; sand over a fifth of a grain is refused."""
    scene = on_sand(80.0, 0.1)
    walls, plan = Setup(scene).walls, make_plan(scene)
    first = wall_layers(Setup(scene), 2, 10.0).first
    assert first["body"] == pytest.approx(1.1 * walls.smooth)
    assert first["bed"] == pytest.approx(0.5 * shift(8.0) * walls.unit, rel=0.05)
    assert walls.roughness / walls.unit == pytest.approx(8.0, rel=1e-3)
    assert "u* k_s/nu about 8" in str(plan)
    assert any("higher than the gap below the grain, 0.01" in one for one in plan.warnings)
    with pytest.raises(SceneError, match=r"turbulence\.roughness: is 0\.25, 25% of"):
        make_plan(on_sand(80.0, 0.25))


FORMS = {"amplitude": 0.08, "wavelength": 1.0}


@pytest.mark.parametrize(
    ("sand", "bed", "across", "told"),
    [
        (0.065, Sinusoidal(**FORMS), {}, True),
        (0.065, RidgeBed(**FORMS), {"width": 0.5}, True),
        (0.06, Sinusoidal(**FORMS), {}, False),
    ],
)
def test_sand_is_told_that_is_as_large_as_forms(sand, bed, across, told):
    """Crests of waves 0.08 high and 1 long have the radius 1/(0.08 (2 pi)^2) = 0.317; sand of a fifth is 0.0633."""
    domain = Domain(length=4.0, height=1.0, **across)
    warnings = make_plan(over_sand(sand, 22000.0, 2.0, domain, bed=bed)).warnings
    words = "21% of the smallest length of its forms, 0.317"
    assert any(words in one for one in warnings) is told


def test_in_a_slower_flow_of_a_search_the_least_k_is_the_one_of_that_flow():
    """0.001 u*^2 with u* of the flow at hand, over V^2 of it."""
    with prepared(
        over_sand(0.02, 22000.0, 1.0, Domain(length=3.0, height=1.0)), MPI.COMM_SELF
    ) as run:
        part = run.turbulence
        for factor, onwards in ((1.0, False), (0.2, True)):
            part.solve(run, factor, onwards)
            shear_velocity = part.wall_report().shear_velocity
            assert part.fields.closure.least.value == pytest.approx(
                1e-3 * shear_velocity**2, rel=0.05
            )
    assert shear_velocity > 0.06
