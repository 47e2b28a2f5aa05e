"""What a scene may say of turbulence, and what a plan makes of it: walls, mesh, what enters."""

import numpy as np
import pytest
from one_dimensional import law_of_the_wall
from scenes import message
from turbulent import channel, grain

from incipient import make_plan
from incipient.effects.turbulence.limits import grain_number, slowest
from incipient.errors import SceneError
from incipient.fluid.conditions import Friction
from incipient.planning.flow_setup import Setup
from incipient.planning.meshing import lay_out
from incipient.planning.wall_conditions import conditions, entering
from incipient.planning.wall_law import WallLaw
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Effects,
    Flat,
    Fluid,
    Gravity,
    HeapBed,
    LogLaw,
    Numerics,
    OpenChannel,
    Poiseuille,
    Polyline,
    Sinusoidal,
    Sphere,
    Time,
    Turbulence,
)

TO_THE_WALL = {"model": "k-omega-sst"}
MEASURED = {"inflow": "profile", "intensity": 0.01, "length": 0.1}


def entering_of(scene):
    setup = Setup(scene)
    return entering(setup.walls, setup.turbulence)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"effects": Effects(), "turbulence": Turbulence()},
            "turbulence: describes turbulence, which effects.",
        ),
        (
            {"domain": Domain(length=20, width=2, height=1, sides="stream")},
            'domain.sides: "stream" with turbulence is not simulated by this version; use "wall"',
        ),
        (
            {"time": Time(end=1, step=0.1), "numerics": Numerics(accuracy=0.05)},
            "numerics.accuracy: is not sought of turbulence in time by this version; leave it out",
        ),
        (
            {"numerics": Numerics(accuracy="verdict")},
            'numerics.accuracy: "verdict" needs a grain but there is none; give a number',
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
            {"domain": Domain(length=20, height=1, top="free-surface"), "gravity": Gravity(acceleration=10)}
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
            {"flow": OpenChannel(datum="crest")},
            "flow.datum: is not read with turbulence, whose profile starts at the bed's height at the inflow; leave",
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
            ({"turbulence": {"upstream_roughness": 0.1} | asked}, f"turbulence.upstream_roughness: {words}")
            for asked, words in (
                ({}, 'is not read by model = "k-epsilon"; leave it out, or use model = "k-omega-sst"'),
                (
                    TO_THE_WALL | {"wall": "rough", "roughness": 0.1},
                    'is for smooth walls, but wall is "rough"',
                ),
                (TO_THE_WALL | {"inflow": "given"}, 'is not read with inflow = "given"; leave it out'),
                (TO_THE_WALL, "is read only past grains and bed forms"),
            )
        ),
        *(
            ({"turbulence": {"first_cell": 2.0} | asked}, f"turbulence.first_cell: {words}")
            for asked, words in (
                ({}, 'is not read by model = "k-epsilon"; leave it out, or give wall_distance'),
                (
                    TO_THE_WALL | {"wall": "rough", "roughness": 0.1},
                    'is for smooth walls, but wall is "rough"; leave it out',
                ),
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
                ([], "has not two or more rows of one length"),
                ([[0.1, 0.7], [0.5, 0.9, 0.01]], "has not two or more rows of one length"),
                ([[0.0, 0.7], [0.5, 0.9]], "has heights that do not ascend from above zero"),
                ([[0.1, 0.0], [0.5, 0.9]], "has a speed or a k that is not positive; leave walls out"),
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
        ({"turbulence": {"model": "k-omega"}}, 'turbulence.model: "k-omega" is not known; use "k-epsilon"'),
    ],
)
def test_what_contradicts_turbulence_is_told_in_one_line(changes, words):
    assert words in message(lambda: channel(**changes))


def test_a_flow_too_slow_for_the_law_of_the_wall_is_refused_by_the_plan():
    with pytest.raises(
        SceneError, match=r"the law of the wall would have to reach 37% of the depth, at most 20%"
    ):
        make_plan(channel(fluid=Fluid(reynolds=2000, scale="flow")))


def test_a_grain_too_small_for_the_law_of_the_wall_is_refused_by_the_plan_and_a_small_one_told_of():
    """u* is 0.0405 (estimated by the logarithmic law): u* d/nu is 8100 times the diameter."""
    with pytest.raises(
        SceneError, match=r'has u\* d/nu = 162, .* must be 300 at least; use flow.kind = "log-law"'
    ):
        make_plan(grain(0.02))
    warned = make_plan(grain(0.08)).warnings
    assert any(
        "u* d/nu = 648: the layer that the law of the wall stands for is 8% of it" in one for one in warned
    )
    assert not any("law of the wall" in one for one in make_plan(grain(0.2)).warnings)


def test_loads_that_the_model_or_few_cells_make_uncertain_are_warned_of():
    """As docs/large_grains.md has measured them: a sphere of three cells across, and round grains at all."""
    sphere = {"body": Sphere(diameter=0.4, x=0.6), "bed": Flat(), "contact": Contact(friction=0.6, gap=0.03)}
    sphere |= {
        "domain": Domain(length=1.6, width=1.2, height=1.0),
        "fluid": Fluid(reynolds=2e5, scale="flow"),
    }

    def told(mesh_size):
        return " ".join(make_plan(channel(**sphere, numerics=Numerics(mesh_size=mesh_size))).warnings)

    assert "the grain is 3.1 cells across" in told(7.0) and "use numerics.mesh_size = 3.6 or less" in told(
        7.0
    )
    assert "cells across" not in told(3.5) and "cells across" not in " ".join(make_plan(grain(0.2)).warnings)
    assert "the k-epsilon model is far from measured loads" in told(3.5)
    assert not any("k-epsilon model is far" in one for one in make_plan(channel()).warnings)


def test_a_faster_flow_is_one_of_larger_reynolds_number_and_has_the_stress_of_its_own_law():
    """tau_b = (factor V)^2 (u*/V)^2, u*/V by the logarithmic law at the larger Reynolds number."""
    scene = grain(0.2)
    twice = Setup(scene).faster(2.0).scene
    assert twice.viscosity == pytest.approx(0.5 * scene.viscosity)
    assert 2.0 * Setup(scene).bed_stress(2.0) == pytest.approx(4.0 * Setup(twice).walls.shear_velocity ** 2)
    assert Setup(scene).bed_stress() < Setup(scene).bed_stress(2.0) < 2.0 * Setup(scene).bed_stress()
    slow = Setup(scene).faster(slowest(Setup(scene))).scene
    assert grain_number(Setup(slow)) == pytest.approx(300.0, rel=1e-3)
    assert Setup(slow).walls.distance < 0.2


def test_rows_of_a_profile_lie_between_the_walls():
    """Over an open channel they may go on above it, whose top is no wall."""
    rows = Turbulence(**MEASURED, profile=[[0.1, 0.7], [1.5, 1.0]])
    make_plan(channel(turbulence=rows))
    refused = message(lambda: make_plan(channel(flow=Poiseuille(), turbulence=rows)))
    assert refused.startswith(
        "turbulence.profile: has a row at 1.5, the wall on top is 1 above that below; leave"
    )


def test_the_law_of_the_wall_does_not_begin_within_the_sand():
    """Rough walls at the sand's height have u+ = 8.5, at a hundredth of it the law has no velocity any more."""
    rough = Turbulence(wall="rough", roughness=0.05, wall_distance=0.05)
    fluid = Fluid(reynolds=1e6, scale="flow")
    make_plan(channel(turbulence=rough, fluid=fluid))
    near = rough.model_copy(update={"wall_distance": 5e-4})
    refused = message(lambda: make_plan(channel(turbulence=near, fluid=fluid)))
    assert refused.startswith(
        "turbulence.roughness: is 0.05, and the law of the wall begins within the sand, 0.0005 from the wall; set"
    )


def test_a_bed_finer_than_the_layer_of_the_law_of_the_wall_is_refused_by_the_plan():
    """The layer of 50 nu/u* stands for several waves, which 10^5 cells would be made for; longer waves are planned."""
    distance = Setup(channel(bed=Sinusoidal(amplitude=0.001, wavelength=1.0))).walls.distance
    finer = channel(bed=Sinusoidal(amplitude=0.01 * distance, wavelength=0.9 * distance))
    assert 'give a flat bed and turbulence.wall = "rough"' in message(lambda: make_plan(finer))
    make_plan(channel(bed=Sinusoidal(amplitude=0.1 * distance, wavelength=2.2 * distance)))


def test_a_grain_in_midstream_is_away_from_walls():
    """A gap narrower than twice the law's distance is no result; next to a wall on top nothing is meshed."""
    sections = {
        "fluid": Fluid(reynolds=2e5, scale="flow"),
        "bed": Flat(),
        "turbulence": Turbulence(wall_distance=0.01),
    }

    def held(height, flow):
        return channel(body=Disc(diameter=0.2, centre=(10.0, height)), flow=flow, **sections)

    def told(height, flow):
        return [one for one in make_plan(held(height, flow)).warnings if one.startswith("the grain is held")]

    assert told(0.115, OpenChannel())[0].startswith(
        "the grain is held 0.015 from the bed, twice the distance of the law of the wall is 0.02: what flows"
    )
    assert not told(0.5, OpenChannel()) and not told(0.89, OpenChannel())
    assert told(0.88, Poiseuille())[0].startswith("the grain is held 0.01 from the top")
    assert message(lambda: make_plan(held(0.895, Poiseuille()))).startswith(
        "body.centre: the grain reaches 0.995, the mesh ends at 0.99, the distance of the law of the wall below"
    )


def test_the_plan_says_what_it_takes_the_walls_for():
    text = make_plan(channel()).text()
    assert "yes  turbulence: effects.turbulence = true: k-epsilon model; law of the wall from 0.08" in text
    assert "y+ about 50" in text


def test_turbulence_is_never_there_unless_asked_for():
    plan = make_plan(channel(effects=Effects()))
    (found,) = [one for one in plan.effects if one.name == "turbulence"]
    assert not found.present and "set effects.turbulence = true" in found.reason


def test_the_mesh_ends_where_the_law_of_the_wall_begins():
    """50 nu/u* from one wall, or from two; the mean of the logarithmic law over the depth is u+(h) - 1/kappa."""
    one, two = channel(), channel(flow=Poiseuille(), domain=Domain(length=20, height=2, origin=(0, 3)))
    found = Setup(one).walls
    mean = np.log(found.shear_velocity * 11000) / 0.41 + 5.2 - 1 / 0.41
    assert found.shear_velocity * mean == pytest.approx(1.0, rel=1e-6)
    assert found.distance * found.shear_velocity * 11000 == pytest.approx(50.0)
    grid = lay_out(Setup(one), make_plan(one)).shape
    assert (grid.origin[1], grid.height) == pytest.approx((found.distance, 1 - found.distance))
    grid, far = lay_out(Setup(two), make_plan(two)).shape, Setup(two).walls.distance
    assert (grid.origin[1], grid.height) == pytest.approx((3 + far, 2 - 2 * far))
    asked = channel(turbulence=Turbulence(wall_distance=0.1))
    assert Setup(asked).walls.distance == 0.1


def test_a_bed_with_forms_bounds_the_mesh_itself():
    """The wall below is a distance of the law under it, that on top still a distance above the mesh."""
    bed = Sinusoidal(amplitude=0.1, wavelength=2, phase=90)
    found = channel(bed=bed, flow=Poiseuille(), domain=Domain(length=20, height=2))
    walls, layout = Setup(found).walls, lay_out(Setup(found), make_plan(found))
    assert walls.floor == pytest.approx(0.1 - walls.distance) and walls.depth == pytest.approx(0.95)
    assert layout.shape.top == pytest.approx(2.0 - walls.distance)
    places = np.array([0.1, 0.1 + walls.distance, 1.7, 2.0 - walls.distance])
    assert walls.from_next(places) == pytest.approx(
        walls.distance * np.array([1, 2, 0.3 / walls.distance, 1])
    )
    weak, strong = (one for one in conditions(Setup(found)) if isinstance(one, Friction))
    assert (weak.boundary, weak.axis, strong.boundary, strong.axis) == ("bed", None, "top", 1)
    inner = np.linspace(0.1, 2.0 - walls.distance, 20001)
    mean = entering_of(found).speed(0.5 * (inner[1:] + inner[:-1])).mean()
    layer = walls.law.beyond(walls.shear_velocity, found.viscosity, walls.distance) * walls.shear_velocity
    assert mean * (inner[-1] - inner[0]) + layer == pytest.approx(1.9, rel=1e-4)


def test_a_channel_in_space_is_meshed_as_in_the_plane_layer_by_layer():
    """Half of it where it is its own mirror image; two cells across at the least."""
    scene = channel(domain=Domain(length=20, height=1, width=2, origin=(0, -1, 3)))
    found, plane = lay_out(Setup(scene), make_plan(scene)).shape, channel(numerics=Numerics(order=2))
    of_plane = lay_out(Setup(plane), make_plan(plane)).shape
    assert found.grid.origin[1] == pytest.approx(3 + of_plane.origin[1])
    assert (found.grid.rows, found.grid.columns) == (of_plane.rows, of_plane.columns)
    assert found.across == (0.0, 1.0) and found.sides == ("symmetry", "left") and found.layers == 2


@pytest.mark.parametrize("flow", [OpenChannel(), Poiseuille()])
def test_a_duct_has_walls_on_its_sides_and_lets_in_what_it_is_asked_for(flow):
    """The mesh stands off from all walls; the mean over the section, layers included, is the flow's; u* by Keulegan."""
    duct = Domain(length=20, height=1, width=0.8, sides="wall")
    scene = channel(
        domain=duct, flow=flow, fluid=Fluid(reynolds=1e5, scale="flow"), numerics=Numerics(order=2)
    )
    walls, found = Setup(scene).walls, lay_out(Setup(scene), make_plan(scene)).shape
    away, open_top = walls.distance, flow.kind == "open-channel"
    assert walls.sides == (0.0, 0.8) and walls.reach == (0.4 if open_top else 0.5 * 0.8)
    assert found.across == pytest.approx((0.4, 0.8 - away)) and found.sides == ("symmetry", "left")
    thickness = np.diff([0.0, *found.ends])
    assert found.ends[-1] == 1.0 and (np.diff(thickness) < 0.0).all()
    rubbing = {one.boundary: one.axis for one in conditions(Setup(scene)) if isinstance(one, Friction)}
    assert rubbing == {"bottom": 2, "left": 1} | ({} if open_top else {"top": 2})

    y, z = (np.linspace(low, high, 801) for low, high in ((away, 0.8 - away), (away, walls.ceiling)))
    places = np.meshgrid(0.5 * (z[1:] + z[:-1]), 0.5 * (y[1:] + y[:-1]))
    assert walls.from_next(np.array([0.5]), np.array([0.1])) == pytest.approx(0.1)
    mean = entering_of(scene).speed(*(one.ravel() for one in places)).mean()
    beyond = walls.shear_velocity * walls.law.beyond(walls.shear_velocity, scene.viscosity, away)
    along = walls.beside * (y[-1] - y[0]) + 2 * (z[-1] - z[0])
    assert mean * (y[-1] - y[0]) * (z[-1] - z[0]) + along * beyond == pytest.approx(0.8, rel=1e-3)
    assert "no secondary flow" in make_plan(scene).text()
    hydraulic = 0.8 / (0.8 * walls.number + 2.0)
    estimate = walls.law.velocity(walls.shear_velocity, scene.viscosity, hydraulic) - 1 / walls.law.kappa
    assert walls.shear_velocity * estimate == pytest.approx(1.0)


def test_cells_are_small_where_the_bed_sticks_out_and_in_the_lee():
    """At the upper corner of a step down, and along its shear layer for six heights; not at the lower corner."""
    bed = Polyline(points=[(0, 0.2), (5, 0.2), (5, 0), (20, 0)])
    scene = channel(bed=bed, turbulence=Turbulence(wall_distance=0.02), numerics=Numerics(order=2))
    walls, at_corner, lee = lay_out(Setup(scene), make_plan(scene)).sizes.near[-3:]
    assert (walls.boundary, walls.size) == ("bed", pytest.approx(0.06))
    assert at_corner.points == ((5.0, 0.2),) and at_corner.size == pytest.approx(0.05 * 0.06)
    assert lee.points[0] == (5.0, 0.2) and lee.points[-1] == pytest.approx((6.2, 0.0))
    assert lee.size == pytest.approx(0.09 * 0.2)


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
    assert enters.dissipation(near[[0, 1, 3]]) == pytest.approx(0.09**0.75 * k**1.5 / length, rel=1e-6)
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
    between = WallLaw(roughness=2.85e-4).bounds(0.05, 1e-6, 1.0)  # u* k/nu = 14.2, half way in its logarithm
    assert between == pytest.approx((6e-4, 6e-3 * (0.2 / 6e-3) ** 0.7071), rel=2e-3)


def test_sand_that_is_too_high_for_the_depth_is_refused_by_a_remedy_that_helps():
    fluid = Fluid(reynolds=1e6, scale="flow")
    with pytest.raises(
        SceneError, match=r"have to reach 30% of the depth, at most 20%; use a smaller roughness"
    ):
        make_plan(channel(turbulence=Turbulence(wall="rough", roughness=0.3), fluid=fluid))
    gravel = Turbulence(wall="rough", roughness=0.15)
    with pytest.raises(SceneError, match=r"is 75% of the grain, at most 50%; use a smaller roughness"):
        make_plan(
            channel(turbulence=gravel, fluid=fluid, body=Disc(diameter=0.2, centre=(10, 0.5)), bed=Flat())
        )


@pytest.mark.parametrize("flow", [OpenChannel(), Poiseuille()])
@pytest.mark.parametrize("mesh_size", [2.0, 1.0])
def test_rows_next_to_walls_are_as_fine_as_the_distance_of_the_law_asks_for(flow, mesh_size):
    """The first row is as thick as the distance, times mesh_size; none over 1/14 of a depth; they grow by degrees."""
    numerics = Numerics(order=2, mesh_size=mesh_size)
    scene = channel(flow=flow, fluid=Fluid(reynolds=1e6, scale="flow"), numerics=numerics)
    walls, grid = Setup(scene).walls, lay_out(Setup(scene), make_plan(scene)).shape
    thick = np.diff([0.0, *grid.ends]) * grid.height
    assert len(thick) == grid.rows and thick.sum() == pytest.approx(1.0 - walls.number * walls.distance)
    assert 0.7 < thick[0] / (mesh_size * walls.distance) < 1.4
    assert thick.max() <= 0.75 * mesh_size * walls.depth / 14 * (1 + 1e-9)
    if walls.number == 2:
        assert thick == pytest.approx(thick[::-1])
        thick = thick[: len(thick) // 2]
    assert (np.diff(thick) > -1e-12).all() and (thick[1:] / thick[:-1]).max() < 1.0 + 0.45 * mesh_size


@pytest.mark.parametrize("turbulence", [None, Turbulence(inflow="given", intensity=0.1, length=0.05)])
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
        assert k == pytest.approx(1.5 * 0.3**2) and epsilon == pytest.approx(0.09**0.75 * k**1.5 / 0.05)


def test_level_ground_about_a_grain_in_space_is_at_the_datum():
    """Far from the grain level ground takes the place of a bed with forms: where the profile of the inflow starts."""
    scene = channel(
        domain=Domain(length=10, width=10, height=5),
        fluid=Fluid(reynolds=20_000.0, scale="grain"),
        flow=OpenChannel(velocity=20.0, datum=0.7),
        body=Sphere(diameter=1.0, centre=(5.0, 5.0, 1.7)),
        bed=HeapBed(spheres=((5.0, 4.0, 0.9, 0.45), (5.0, 6.0, 0.9, 0.45)), posts=((4.0, 5.0, 0.5, 0.5),)),
        numerics=Numerics(error_bars=False, meshed_bed=0.6),
    )
    assert Setup(scene).walls.depth == pytest.approx(4.3)
    without = scene.model_copy(update={"flow": OpenChannel(velocity=20.0)})
    assert Setup(without).walls.depth == pytest.approx(5.0 - 1.35)  # by default the crest


def test_the_first_cells_at_resolved_walls_are_as_thick_as_asked():
    """In nu/u* of what enters, in rows between planes and in layers at a bed; at a grain half as thick."""
    asked = Turbulence(model="k-omega-sst", first_cell=2.0)
    plane = Setup(channel(turbulence=asked, numerics=Numerics(mesh_size=1.0, order=2)))
    rows = lay_out(plane, make_plan(plane.scene)).shape.ends
    unit = plane.resolved_walls.unit
    assert rows[0] == pytest.approx(2.0 * unit, rel=0.2)  # of a height of one; rows grow from the wall on
    assert "first cells 2 nu/u* thick" in plane.resolved_walls.text()
    sand = Setup(grain(0.05).model_copy(update={"turbulence": asked})).resolved_walls
    layers = sand.thin_layers(2).first
    assert layers[sand.names[0]] == pytest.approx(2.0 * sand.unit) and layers["body"] == pytest.approx(
        sand.unit
    )
