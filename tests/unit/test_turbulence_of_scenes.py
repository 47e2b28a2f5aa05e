"""Turbulence of scenes: plans, the law of the wall, profiles of mean velocity."""

import math
from contextlib import nullcontext

import numpy as np
import pytest
from one_dimensional import law_of_the_wall
from scenes import REFERENCE, message, rows_of, scene
from turbulent import channel, grain, inflow_at

from incipient import make_plan
from incipient.errors import SceneError
from incipient.planning.meshing import lay_out
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Effects,
    Flat,
    Fluid,
    Gravity,
    HalfDiscs,
    LogLaw,
    Numerics,
    OpenChannel,
    Poiseuille,
    Polyline,
    Scene,
    Sinusoidal,
    Sphere,
    SphereBed,
    Time,
    Turbulence,
    Uniform,
)
from incipient.setup.base_flow import KAPPA, MeanProfile
from incipient.setup.setup import Setup
from incipient.turbulence.wall_law import WallLaw, shift

# What a scene may say of turbulence, and what its plan warns of or refuses.


TO_THE_WALL = {"model": "k-omega-sst"}
MEASURED = {"inflow": "profile", "intensity": 0.01, "length": 0.1}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"effects": Effects(), "turbulence": Turbulence()},
            "turbulence: describes turbulence, but effects.",
        ),
        (
            {"domain": Domain(length=20, width=2, height=1, sides="stream")},
            'domain.sides: "stream" with turbulence is not simulated by this version; use "slip"',
        ),
        (
            {"domain": Domain(length=20, width=2, height=1, sides="wall")},
            'domain.sides: "wall" with turbulence is retired: no secondary flow is modelled in corners; use "slip"',
        ),
        (
            {
                "time": Time(end=1, step=0.1),
                "domain": Domain(length=20, width=2, height=1),
            },
            "time: with turbulence in 3-D is retired: a model of the mean flow has no fluctuations; leave it out for "
            "the steady loads on a held grain, or judge forces of a large-eddy simulation: incipient judge --forces",
        ),
        (
            {"time": Time(end=1, step=0.1), "numerics": Numerics(accuracy=0.05)},
            "numerics.accuracy: is not available for unsteady turbulence; leave it out",
        ),
        (
            {"numerics": Numerics(accuracy="verdict")},
            'numerics.accuracy: "verdict" needs a grain but there is none; add a section '
            "[body] or give a number",
        ),
        (
            {"numerics": Numerics(accuracy=0.05, accuracy_of="force")},
            'numerics.accuracy_of: "force" does not exist in a turbulent channel without a grain',
        ),
        (
            {"numerics": Numerics(accuracy=0.05, accuracy_includes="all")},
            'numerics.accuracy_includes: "all" means gap and domain but without a grain both belong to the scene',
        ),
        (
            {"body": Disc(diameter=0.2, centre=(4, 0.5))}
            | {"numerics": Numerics(accuracy=0.05, accuracy_of="shear velocity")},
            'numerics.accuracy_of: "shear velocity" is for a turbulent channel without a grain; use "auto"',
        ),
        (
            {"flow": LogLaw()},
            'flow.kind: "log-law" with turbulence is not simulated by this version; use "poiseuille"',
        ),
        (
            {"domain": Domain(length=20, height=1, top="stream")},
            'domain.top: "stream" contradicts turbulence below it',
        ),
        (
            {
                "domain": Domain(length=20, height=1, top="free-surface"),
                "gravity": Gravity(acceleration=10),
            }
            | {"time": Time(end=1, step=0.1)},
            'domain.top: "free-surface" with turbulence is not simulated by this version; use "auto"',
        ),
        (
            {"fluid": Fluid(reynolds=11000, scale="flow", inertia=False)},
            "fluid.inertia: is false, but without inertia",
        ),
        (
            {"time": Time(end=1, step=0.1, start="stokes")},
            'time.start: "stokes" leaves out inertia, without which there is no turbulence; use "steady" or "rest"',
        ),
        (
            {"time": Time(end=1, step=0.1), "numerics": Numerics(convection="extrapolated")},
            "numerics.convection: with turbulence the walls' friction is implicit",
        ),
        (
            {"flow": Uniform(), "turbulence": TO_THE_WALL},
            'flow.kind: "uniform" with turbulence is not simulated by this version; use "poiseuille" or '
            '"open-channel", or judge forces of another program (incipient judge --forces)',
        ),
        (
            {"flow": OpenChannel(datum="crest")},
            "flow.datum: is not read with turbulence, whose profile starts at the mean height of bedforms; leave",
        ),
        (
            {"turbulence": {"wall": "rough"}},
            'turbulence.roughness: is 0 but wall is "rough"; give the equivalent',
        ),
        (
            {"turbulence": {"roughness": 0.01}},
            'turbulence.roughness: is 0.01 but wall is "equilibrium"; set wall',
        ),
        *(
            (
                {"turbulence": {"upstream_roughness": 0.1} | asked},
                f"turbulence.upstream_roughness: {words}",
            )
            for asked, words in (
                (
                    TO_THE_WALL | {"wall": "rough", "roughness": 0.1},
                    'is for smooth walls, but wall is "rough"',
                ),
                (
                    TO_THE_WALL | {"inflow": "given"},
                    'is not read with inflow = "given"; leave it out',
                ),
                (TO_THE_WALL, "is read only past grains and bedforms"),
            )
        ),
        (
            {"turbulence": {"inflow": "given", "intensity": 0.1}},
            'turbulence.length: is missing, which inflow = "given"',
        ),
        (
            {"turbulence": {"length": 0.1}},
            'turbulence.length: is read only with inflow = "given" or "profile"; leave it out',
        ),
        (
            {"turbulence": {"profile": [[0.1, 0.7], [0.5, 0.9]]}},
            'turbulence.profile: is read only with inflow = "profile"; leave it out',
        ),
        *(
            ({"turbulence": MEASURED | {"profile": rows}}, f"turbulence.profile: {words}")
            for rows, words in (
                ([], "does not have two or more rows of one length"),
                ([[0.1, 0.7], [0.5, 0.9, 0.01]], "does not have two or more rows of one length"),
                ([[0.0, 0.7], [0.5, 0.9]], "has heights that do not increase from above zero"),
                (
                    [[0.1, 0.0], [0.5, 0.9]],
                    "has a speed or a k that is not positive; omit walls",
                ),
            )
        ),
        (
            {
                "body": Disc(diameter=0.2, centre=(4, 0.5)),
                "bed": Polyline(points=[(0, 0.1), (2, 0.1), (2, 0), (20, 0)]),
                "effects": Effects(),
            },
            "bed.points: has a vertical step at x = 2, and grains over steps are not simulated",
        ),
        ({"turbulence": {"c_2": 1.2}}, "turbulence.c_2: is 1.2; give 1 < c_1 < c_2"),
        (
            {"turbulence": {"model": "k-omega"}},
            'turbulence.model: "k-omega" is not known; use "k-epsilon"',
        ),
    ],
)
def test_what_contradicts_turbulence_is_told_in_one_line(changes, words):
    assert words in message(lambda: channel(**changes))


def test_a_grain_that_is_small_for_the_law_of_the_wall_is_told_of():
    """u* is 0.0405 (by the logarithmic law): u* d/nu is 8100 times the diameter, within 4% of the model's."""
    warned = make_plan(grain(0.08)).warnings
    (told,) = [one for one in warned if "the layer that the law of the wall stands for" in one]
    assert float(told.split("u* d/nu = ")[1].split(":")[0]) == pytest.approx(648.0, rel=0.04)
    assert "is 8% of it" in told


def sphere(mesh_size, reynolds=2e5):
    return channel(
        body=Sphere(diameter=0.4, x=0.6),
        bed=Flat(),
        contact=Contact(friction=0.6, gap=0.03),
        domain=Domain(length=1.6, width=1.2, height=1.0),
        fluid=Fluid(reynolds=reynolds, scale="flow"),
        numerics=Numerics(mesh_size=mesh_size),
    )


def above_spheres(x, reynolds):
    """A sphere above a bed of equal ones by k-omega SST, its centre so far behind the inflow."""
    return channel(
        domain=Domain(length=9.0, width=5.0, height=5.866),
        fluid=Fluid(reynolds=reynolds, scale="grain"),
        bed=SphereBed(
            radius=0.5, spacing=1.0, arrangement="triangular", angle=90.0, offset=(4.2887, 3.0)
        ),
        body=Sphere(diameter=1.0, centre=(x, 2.5, 1.6), density=2.65),
        gravity=Gravity(acceleration=0.2),
        contact=Contact(friction=0.6),
        turbulence=Turbulence(model="k-omega-sst"),
    )


def in_mean_profile(mesh_size, reynolds=60.0, error_bars=False):
    """A sphere on a plane in laminar flow of this u* d/nu."""
    return Scene(
        domain=Domain(length=8.0, width=6.0, height=4.0),
        fluid=Fluid(reynolds=reynolds, scale="grain"),
        flow=LogLaw(shear_velocity=1.0),
        bed=Flat(),
        body=Sphere(diameter=1.0, x=3.0),
        contact=Contact(friction=0.5),
        numerics=Numerics(mesh_size=mesh_size, error_bars=error_bars),
    )


def held(height, flow):
    return channel(
        body=Disc(diameter=0.2, centre=(10.0, height)),
        bed=Flat(),
        flow=flow,
        fluid=Fluid(reynolds=2e5, scale="flow"),
        turbulence=Turbulence(wall_distance=0.01),
    )


@pytest.mark.parametrize(
    ("scene", "words", "warned"),
    [
        (grain(0.2), "law of the wall", False),
        (sphere(7.0), "the grain is 3.1 times as wide as its cells", True),
        (sphere(7.0), "use numerics.mesh_size = 3.6 or less", True),
        (sphere(3.5), "as wide as its cells", False),
        (grain(0.2), "as wide as its cells", False),
        # Cells at walls, half the grain's size, do not count where those at the grain are smaller.
        (sphere(1.0, 1e4), "as wide as its cells", False),
        (sphere(1.34, 1e4), "the grain is 5 times as wide as its cells", True),
        # In laminar flow, too: lift 24.3 on these cells, 18.5 on those of 1.5; at 6 for 60 it is 3.862 and 3.854.
        (in_mean_profile(2.5), "the grain is 2.7 times as wide as its cells, which are up", True),
        (in_mean_profile(2.5), "use numerics.mesh_size = 1.1 or less", True),
        (in_mean_profile(2.5, error_bars=True), "as wide as its cells", False),
        (in_mean_profile(2.5, reynolds=6.0), "as wide as its cells", False),
        (in_mean_profile(1.0), "as wide as its cells", False),
        (sphere(3.5), "the k-epsilon model is far from measured loads", True),
        (channel(), "k-epsilon model is far", False),
        # In midstream it is away from walls; a gap narrower than twice the law's distance is no result.
        (
            held(0.115, OpenChannel()),
            "the grain is held 0.015 from the bed, twice the distance of the law of the wall is 0.02: flow in the gap",
            True,
        ),
        (held(0.5, OpenChannel()), "the grain is held", False),
        (held(0.89, OpenChannel()), "the grain is held", False),
        (held(0.88, Poiseuille()), "the grain is held 0.01 from the top", True),
        # Spheres are meshed as they are up to 3 from the grain's centre, and are planar from 4 on.
        (above_spheres(4.0, 300.0), "the inflow cuts bedforms", False),
        (above_spheres(3.0, 300.0), "the inflow cuts bedforms", True),
        (above_spheres(4.0, 300.0), "often does not converge", False),
        (above_spheres(4.0, 30000.0), "often does not converge", True),
    ],
)
def test_loads_that_model_cells_walls_or_inflow_make_uncertain_are_warned_of(scene, words, warned):
    """As docs/contribute/defaults.md has measured them: a sphere of three cells across, and round grains at all."""
    assert (words in " ".join(make_plan(scene).warnings)) is warned


def test_the_grain_s_reynolds_number_is_that_of_the_mean_profile():
    """At its top, by the law of the wall, not by the parabola of laminar flow, which has a quarter of it."""
    numbers = make_plan(grain(0.08)).numbers
    top = law_of_the_wall(numbers.shear_reynolds)
    assert numbers.grain_reynolds == pytest.approx(numbers.shear_reynolds * top, rel=0.05)


@pytest.mark.parametrize(
    ("flow", "lowest", "refused"),
    [
        (OpenChannel(), 0.1, ""),
        (OpenChannel(), 1.1, "has no row within the depth of 1; give heights"),
        (Poiseuille(), 0.1, "has a row at 1.5, the wall on top is 1 above that below; leave"),
    ],
)
def test_rows_of_a_profile_lie_between_the_walls(flow, lowest, refused):
    """Over an open channel they may go on above it, whose top is no wall."""
    rows = Turbulence(**MEASURED, profile=[[lowest, 0.7], [1.5, 1.0]])
    said = pytest.raises(SceneError, match=rf"^turbulence\.profile: {refused}")
    with said if refused else nullcontext():
        make_plan(channel(flow=flow, turbulence=rows))


# The law of the wall, smooth or rough, at any distance, and how far from walls meshes end.


FLUID = Fluid(reynolds=1e6, scale="flow")


def test_a_faster_flow_is_one_of_larger_reynolds_number_and_has_the_stress_of_its_own_law():
    """tau_b = (factor V)^2 (u*/V)^2, u*/V at the larger Reynolds number."""
    scene = grain(0.2)
    twice = Setup(scene).faster(2.0).scene
    assert twice.viscosity == pytest.approx(0.5 * scene.viscosity)
    once, faster = Setup(scene).bed_stress(), Setup(scene).bed_stress(2.0)
    assert faster == pytest.approx(4.0 * Setup(twice).walls.shear_velocity ** 2)
    assert 2.0 * once < faster < 4.0 * once


def test_the_law_of_the_wall_between_smooth_and_rough_is_nikuradse_s():
    """As `tests/one_dimensional.py` has it from the source: sand is not felt up to u* k/nu of 2.25, rough from 90.

    u+ = ln(y+)/0.41 + 5.2, on rough walls ln(y/k_s)/0.41 + 8.5 (Nikuradse 1933); u* from the speed and back.
    """
    sand = np.array([1.0, 2.25, 5.0, 20.0, 60.0, 90.0, 1000.0])
    laws = [WallLaw(roughness=1e-3 * one) for one in sand]
    result = [float(law.velocity(1.0, 1e-3, 2.0)) for law in laws]
    assert result == pytest.approx([float(law_of_the_wall(2000.0, one)) for one in sand], abs=2e-3)
    assert result[1] == pytest.approx(np.log(2000.0) / 0.41 + 5.2)
    assert result[-1] == pytest.approx(np.log(2.0) / 0.41 + 8.5)
    speeds = np.array([0.3, 1.0, 30.0])
    for law in laws[::3]:
        u = law.shear_velocity(speeds, 1e-4, 0.3)
        assert u * law.velocity(u, 1e-4, 0.3) == pytest.approx(speeds, rel=1e-7)


def test_in_the_viscous_sublayer_friction_is_that_of_a_linear_profile():
    """u+ = y+ below 11.06: u*^2 = nu U/y, whatever k says there (exact); u* from the speed and back."""
    law, viscosity, y = WallLaw(), 1e-3, 2e-3
    speeds = np.array([0.1, 1.0, 10.0])
    u = law.shear_velocity(speeds, viscosity, y)
    assert (u * y / viscosity < 11.06).all()
    assert u**2 == pytest.approx(viscosity * speeds / y, rel=1e-12)
    assert law.velocity(u, viscosity, y) * u == pytest.approx(speeds, rel=1e-12)
    assert law.drag(speeds, 0.0, viscosity, y) == pytest.approx(viscosity / y, rel=2e-3)


@pytest.mark.parametrize("k", [5e-4, 0.005, 0.05])
def test_rough_walls_are_as_far_as_they_are_high(k):
    """The default is the larger of 50 nu/u* and the roughness; a grain is smooth."""
    rough = Turbulence(wall="rough", roughness=k)
    walls = Setup(channel(turbulence=rough, fluid=FLUID)).walls
    assert walls.nearest == pytest.approx(max(50.0 * walls.unit, k))
    with_grain = Setup(grain(0.5, 1e6).model_copy(update={"turbulence": rough})).walls
    assert with_grain.law("body").roughness == 0.0 and with_grain.law("bed").roughness == k
    assert with_grain.distance("body") == pytest.approx(50.0 * with_grain.unit)


@pytest.mark.parametrize("sand", [3.0, 11.0, 40.0, 300.0])
def test_a_rough_wall_in_the_viscous_sublayer_is_a_smooth_one_farther_away(sand):
    """Where u+ is what Nikuradse's roughness takes away: none below u* k/nu = 5, 8.5 at 32.6ths of the roughness."""
    lost = 5.2 - 8.5 + np.log(sand) / 0.41
    if sand < 90.0:
        lost *= np.sin(0.4258 * (np.log(sand) - 0.811))
    y = shift(sand)
    bent = 1.0 - np.exp(-y / 11.0) - y / 11.0 * np.exp(-y / 3.0)
    reichardt = np.log1p(0.41 * y) / 0.41 + (5.2 - np.log(0.41) / 0.41) * bent
    assert reichardt == pytest.approx(max(lost, 0.0), abs=2e-3)
    rough = Turbulence(model="k-omega-sst", wall="rough", roughness=sand / 2000.0)
    walls = Setup(channel(fluid=Fluid(reynolds=35000, scale="flow"), turbulence=rough)).walls
    beyond = walls.from_origin("bottom") - walls.nearest
    assert beyond == pytest.approx(shift(walls.roughness / walls.unit) * walls.unit)
    assert walls.law("bottom").roughness == 0.0


def test_walls_are_never_farther_than_a_part_of_the_depth_a_grain_and_forms():
    """However slow the flow is: a fifth of the depth, half a grain, twice the smallest length of forms."""
    slow = Fluid(reynolds=500, scale="flow")
    bed = Sinusoidal(amplitude=0.004, wavelength=0.04)
    assert Setup(channel(fluid=slow)).walls.nearest == pytest.approx(0.2)
    assert Setup(grain(0.05, 500.0)).walls.distance("body") == pytest.approx(0.025)
    result = Setup(channel(fluid=slow, bed=bed))
    assert result.walls.nearest == pytest.approx(2.0 * result.scene.bed_shape.feature)


@pytest.mark.parametrize(
    ("scene", "turbulence", "words"),
    [
        (
            channel(fluid=FLUID),
            Turbulence(wall_distance=0.3),
            r"wall_distance: is 0.3, at most 0.2 in this depth",
        ),
        (
            channel(fluid=FLUID),
            Turbulence(wall="rough", roughness=0.3),
            "roughness: is 0.3, 30% of the depth",
        ),
        (
            grain(0.2),
            Turbulence(wall="rough", roughness=0.1),
            r"roughness: is 0\.1, 50% of the depth or the grain",
        ),
    ],
)
def test_walls_that_are_too_far_or_too_rough_are_refused(scene, turbulence, words):
    with pytest.raises(SceneError, match=words):
        make_plan(scene.model_copy(update={"turbulence": turbulence}))


@pytest.mark.parametrize("bed", [None, Flat()])
@pytest.mark.parametrize("model", ["k-epsilon", "k-omega-sst"])
@pytest.mark.parametrize("flow", [OpenChannel(velocity=3.0), Poiseuille(velocity=3.0)])
def test_the_mean_velocity_that_enters_is_that_of_the_flow(flow, model, bed):
    """With what flows between the mesh and plane walls, by the law."""
    result = channel(flow=flow, turbulence=Turbulence(model=model), bed=bed)
    walls = Setup(result).walls
    inner = np.linspace(walls.nearest, 1 - (walls.number - 1) * walls.nearest, 20001)
    y = (np.arange(20000) + 0.5) / 20000 * walls.nearest
    u = walls.shear_velocity
    below = walls.number * walls.nearest * u * WallLaw().velocity(u, result.viscosity, y).mean()
    speeds, k, second = inflow_at(result, 0.5 * (inner[1:] + inner[:-1]))
    assert speeds.mean() * (inner[-1] - inner[0]) + below == pytest.approx(3.0, rel=1e-4)
    assert (k > 0).all() and (second > 0).all()


# The mean profile of a turbulent stream against published ones, and what a scene and a plan make of it.


def in_wall_units(roughness=0.0, depth=1e5):
    return MeanProfile(1.0, 1.0, roughness, depth)


def test_a_smooth_bed_has_the_profile_of_direct_simulations():
    """Lee & Moser (2015, J. Fluid Mech. 774, 395), Re_tau 5186, up to where the channel's middle is felt."""
    result = [
        (float(row["y_plus"]), float(row["U_plus"]))
        for row in rows_of(REFERENCE / "channel_dns.csv")
        if row["re_tau"].startswith("518")
    ]
    y, u = np.transpose([pair for pair in result if pair[0] < 500])
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
    result = scene(
        flow=flow, bed=HalfDiscs(radius=0.5, spacing=1.2), fluid=Fluid(reynolds=50, scale="grain")
    )
    assert result.reference_velocity == 2.0 and result.viscosity == pytest.approx(2.0 / 50)
    heights = np.array([0.05, 0.1, 0.6, 6.0])
    points = np.vstack([np.zeros(4), heights, np.zeros(4)])
    expected = 2.0 * in_wall_units(0.3 * 50).speed(np.maximum(heights - 0.1, 0.0) * 50)
    speed = Setup(result).base_flow.velocity(points, 0.0)
    assert speed[0] == pytest.approx(expected, rel=1e-7) and not speed[1].any()
    assert result.top == "stream"


ROUGH = scene(flow=LogLaw(roughness=1.0), fluid=Fluid(reynolds=20, scale="grain"))
SMOOTH = scene(flow=LogLaw(), fluid=Fluid(reynolds=30, scale="flow"))


def test_numbers_of_a_mean_profile():
    setup = Setup(ROUGH)
    assert setup.numbers.shear_reynolds == pytest.approx(20.0)
    assert setup.numbers.flow_reynolds == pytest.approx(setup.base_flow.mean_speed * 6.0 * 20.0)


@pytest.mark.parametrize(
    ("scene", "words", "said"),
    [
        (
            ROUGH,
            "mean profile of a turbulent flow, maintained by a body force instead of the turbulent stress",
            True,
        ),
        (
            ROUGH,
            "no  turbulence: only with effects.turbulence = true; mean profile only, the bed is hydraulically",
            True,
        ),
        (ROUGH, "between smooth and rough, u* k_s/nu = 20", True),
        (ROUGH, "channels are laminar", False),
        (SMOOTH, "hydraulically smooth", True),
        (SMOOTH, "channels are laminar to 650", True),
        (
            channel(),
            "yes  turbulence: effects.turbulence = true: k-epsilon model; walls 0.08",
            True,
        ),
        (channel(), "y+ about 50", True),
    ],
)
def test_the_plan_tells_what_the_stream_is(scene, words, said):
    assert (words in make_plan(scene).text()) is said


def test_cells_at_the_bed_follow_the_profile():
    """Ten wall units: 10/20; below a stream of another kind there are none."""
    result = scene(flow=LogLaw(), fluid=Fluid(reynolds=20, scale="grain"))
    (near,) = [
        one for one in lay_out(Setup(result), make_plan(result)).sizes.near if one.boundary == "bed"
    ]
    assert near.size == pytest.approx(0.5)
    other = scene(flow=Uniform())
    assert not [
        one for one in lay_out(Setup(other), make_plan(other)).sizes.near if one.boundary == "bed"
    ]


# A measured profile that enters between walls: rows of developed flow give that flow back.


MODELS = pytest.mark.parametrize("model", ["k-omega-sst", "k-epsilon"])
ROWS = [[0.1, 0.8], [0.5, 1.0], [0.9, 1.1]]


def scene_with_profile(turbulence, flow=None, reynolds=20000.0):
    return Scene(
        domain=Domain(length=6.0, height=1.0),
        fluid=Fluid(reynolds=reynolds, scale="flow"),
        flow=flow or OpenChannel(),
        effects=Effects(turbulence=True),
        turbulence=turbulence,
    )


def asked(rows, **changes):
    kind = {"model": "k-omega-sst", "inflow": "profile", "profile": rows}
    return Turbulence(**{**kind, "intensity": 1e-6, "length": 0.1, **changes})


def over_discs(offset, turbulence):
    """A channel over half-discs, one of which has its centre at the offset; the inflow is at x = 0."""
    return Scene(
        domain=Domain(length=12.0, height=8.0),
        fluid=Fluid(reynolds=2600.0, scale="flow"),
        flow=OpenChannel(),
        bed=HalfDiscs(radius=0.5, spacing=1.2, offset=offset),
        effects=Effects(turbulence=True),
        turbulence=turbulence,
    )


def over_spheres(offset):
    """A channel over spheres in squares, one of which has its centre at the offset."""
    return Scene(
        domain=Domain(length=9.0, width=5.0, height=8.0),
        fluid=Fluid(reynolds=2600.0, scale="flow"),
        flow=OpenChannel(),
        bed=SphereBed(radius=0.5, spacing=1.0, arrangement="square", offset=(offset, 0.0)),
        effects=Effects(turbulence=True),
        turbulence=Turbulence(model="k-omega-sst"),
    )


@pytest.mark.parametrize(
    ("turbulence", "volume"),
    [
        (Turbulence(model="k-omega-sst"), 0.5**2 * math.pi / 2.0 / 1.2),
        (asked(ROWS), 0.5**2 * math.pi / 2.0 / 1.2),  # measured rows are heights above it
        (None, math.pi / 12.0),
    ],
)
def test_the_inflow_over_forms_does_not_depend_on_where_it_cuts_them(turbulence, volume):
    """It starts at their mean height, the volume of half-discs and of half spheres over an area; at rest on the bed."""
    profiles = []
    for offset in (0.0, 0.2, 0.5):
        scene = over_spheres(offset) if turbulence is None else over_discs(offset, turbulence)
        setup = Setup(scene)
        assert setup.walls.datum == pytest.approx(volume, rel=0.01)
        foot = float(scene.bed_height(np.array([[*scene.domain.entrance[:-1], 0.0][:2]]))[0])
        heights = np.array([0.99 * min(foot, volume), foot, *np.linspace(1.0, 8.0, 20)])
        inflow = setup.mean_inflow(setup.base_flow.column(scene.domain.entrance, heights), 0.0)
        fastest = inflow[0].max()
        assert (inflow[0, :2] < 0.1 * fastest).all()
        profiles.append(inflow[0, 2:])
    assert profiles[0] == pytest.approx(profiles[1], rel=1e-3)
    assert profiles[0] == pytest.approx(profiles[2], rel=1e-3)


@pytest.mark.parametrize("sand", [0.0, 0.02])
@pytest.mark.parametrize("flow", [OpenChannel(), Poiseuille()])
def test_rows_of_developed_flow_give_it_back(flow, sand):
    """u* within 6%: at y+ = 30 the law is not the model's own; omega by the mixing length at the rows."""
    wall = {"wall": "rough", "roughness": sand} if sand else {}
    developed = scene_with_profile(Turbulence(model="k-omega-sst", **wall), flow)
    heights = np.array([0.03, 0.06, 0.1, 0.15, 0.25, 0.4, 0.6, 0.8])
    if flow.kind == "poiseuille":
        heights = np.concatenate([heights[:6], 1.0 - heights[5::-1]])
    speed, k, _ = inflow_at(developed, heights)
    rows = np.column_stack([heights, speed, k])
    result, was = scene_with_profile(asked(rows.tolist(), **wall), flow), Setup(developed).walls
    assert Setup(result).walls.shear_velocity == pytest.approx(was.shear_velocity, rel=0.06)
    places = np.geomspace(was.nearest, 0.45, 40)
    fast, _, _ = inflow_at(result, places)
    in_developed, _, _ = inflow_at(developed, places)
    outer = places > 0.03
    assert fast[outer] == pytest.approx(in_developed[outer], rel=2e-2)
    assert np.abs(fast - in_developed).max() < 0.15 * in_developed.max()
    _, k, omega = inflow_at(result, heights)
    away = np.minimum(heights, 1.0 - heights) if flow.kind == "poiseuille" else heights
    length = np.minimum(0.41 * away, 0.1)
    by_length = np.sqrt(k) / (0.09**0.25 * length)
    assert omega[1:-1] == pytest.approx(by_length[1:-1], rel=0.04)


@MODELS
def test_rows_of_the_law_of_the_wall_give_k_in_equilibrium(model):
    """k = u*^2/C_mu^(1/2) in the logarithmic layer, where damping is none; a third column is k itself."""
    y = np.geomspace(0.02, 0.98, 9)
    law = 0.04 * (np.log(0.04e5 * y) / 0.41 + 5.2)
    rows = np.column_stack([y, law]).tolist()
    flow = scene_with_profile(asked(rows, model=model, length=1.0), reynolds=1e5)
    near = np.array([0.05, 0.1])
    speed, k, second = inflow_at(flow, near)
    assert speed == pytest.approx(0.04 * (np.log(0.04e5 * near) / 0.41 + 5.2), rel=2e-3)
    assert k == pytest.approx(0.04**2 / 0.3, rel=0.02)
    omega = np.sqrt(k) / (0.09**0.25 * 0.41 * near)
    assert second == pytest.approx(omega if model == "k-omega-sst" else 0.09 * k * omega, rel=0.01)
    third = scene_with_profile(asked([[*row, 0.01] for row in rows], model=model), reynolds=1e5)
    assert inflow_at(third, near)[1] == pytest.approx(0.01, rel=1e-3)


def test_below_the_rows_the_bed_upstream_may_be_rough():
    """The law of sand holds down to smooth walls, u* is the one of rough walls."""
    rough = Setup(scene_with_profile(asked(ROWS, wall="rough", roughness=0.02))).walls
    flow = scene_with_profile(asked(ROWS)).model_copy(
        update={"turbulence": asked(ROWS, upstream_roughness=0.02)}
    )
    result = Setup(flow).walls
    assert result.roughness == 0.0 and result.is_resolved
    assert result.shear_velocity == pytest.approx(rough.shear_velocity, rel=1e-8)


@pytest.mark.parametrize("over_sand", [5.0, 20.0])
def test_a_row_over_rough_sand_has_the_shear_velocity_of_the_law_of_nikuradse(over_sand):
    """1/0.41 ln(y/k_s) + 8.5 (Schlichting & Gersten 2017, section 17.1.2), where u* k_s/nu is 300."""
    speed = 0.05 * (np.log(over_sand) / 0.41 + 8.5)
    rows = [[0.01 * over_sand, speed], [0.9, 1.1]]
    walls = Setup(
        scene_with_profile(asked(rows, wall="rough", roughness=0.01), reynolds=300.0 / 0.01 / 0.05)
    ).walls
    assert walls.shear_velocity == pytest.approx(0.05, rel=1e-6)


@MODELS
@pytest.mark.parametrize("flow", [OpenChannel(velocity=3.0), Poiseuille(velocity=3.0)])
def test_a_uniform_flow_enters_beyond_thin_layers_at_walls(flow, model):
    """Its mean is V, its k 3/2 of the square of the intensity, its mixing length as given or kappa y."""
    given = Turbulence(model=model, inflow="given", intensity=0.05, length=0.1)
    made = scene_with_profile(given, flow, reynolds=2e5)
    y = (np.arange(4001) + 0.5) / 4001
    speed, k, second = inflow_at(made, y)
    assert speed.mean() == pytest.approx(3.0, rel=5e-3)
    beyond = (y > 0.1) & (y < 0.9)
    assert np.ptp(speed[beyond]) < 0.01 * 3.0
    assert k[2000] == pytest.approx(1.5 * 0.15**2, rel=0.05)
    omega = second[2000] if model == "k-omega-sst" else second[2000] / (0.09 * k[2000])
    assert k[2000] ** 0.5 / omega / 0.09**0.25 == pytest.approx(0.1, rel=1e-3)
    developed = scene_with_profile(Turbulence(model=model), flow, reynolds=2e5)
    assert Setup(made).bed_stress() == pytest.approx(Setup(developed).bed_stress(), rel=1e-9)


@pytest.mark.filterwarnings("error")
@MODELS
def test_a_row_at_the_water_surface_is_a_row_like_others(model):
    """There is no wall to take a u* of; speeds between rows are the ones with a row just below it."""
    heights = np.array([0.3, 0.7, 0.95])
    result = [
        inflow_at(
            scene_with_profile(asked([[0.1, 0.7], [0.5, 0.9], [top, 1.0]], model=model)), heights
        )[0]
        for top in (1.0, 1.0 - 1e-9)
    ]
    assert result[0] == pytest.approx(result[1], rel=1e-6)


@MODELS
def test_the_stress_on_the_bed_is_that_of_the_lower_row(model):
    """Between walls, below a profile that is fast at the upper one; cells are made for the larger u*."""
    rows = [[0.1, 0.5], [0.5, 1.0], [0.9, 1.0]]
    between = Setup(scene_with_profile(asked(rows, model=model), Poiseuille(), reynolds=2e5))
    below = Setup(scene_with_profile(asked(rows, model=model), reynolds=2e5))
    assert between.bed_stress() == pytest.approx(below.bed_stress(), rel=0.02)
    assert between.walls.shear_velocity**2 > 2.0 * between.bed_stress()
