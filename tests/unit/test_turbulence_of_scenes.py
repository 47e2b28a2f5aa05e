"""What a scene may say of turbulence, and what a plan makes of it: walls, mesh, what enters."""

from dataclasses import replace

import numpy as np
import pytest
from scenes import message

import incipient
from incipient import make_plan
from incipient.accuracy.coarse_runs import coarse, comparisons, is_coarse
from incipient.accuracy.errorbars import by_coarser_mesh, coarse_scenes, of_the_model, shares
from incipient.cost import calibration
from incipient.cost.command import chosen, predicted_plan
from incipient.cost.ladder import ladder
from incipient.cost.measurement import Variant
from incipient.cost.quantities import columns, goals
from incipient.errors import ConvergenceError, SceneError
from incipient.fluid.conditions import Friction
from incipient.planning.drawing import lay_out
from incipient.planning.stream import bed_stress
from incipient.planning.turbulence import WallLaw, coarsest, faster, grain_number, slowest, walls_of
from incipient.planning.turbulent_conditions import conditions, entering
from incipient.results.errorbars import Loads
from incipient.results.turbulence import WallReport
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
    Time,
    Turbulence,
)
from incipient.sweep.table import in_words, quantities

CHANNEL = {
    "domain": Domain(length=20, height=1),
    "fluid": Fluid(reynolds=11000, scale="flow"),
    "flow": OpenChannel(),
    "effects": Effects(turbulence=True),
}


MEASURED = {"inflow": "profile", "intensity": 0.01, "length": 0.1}


def channel(**changes):
    return Scene(**{**CHANNEL, **changes})


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
            'numerics.accuracy: "verdict" is that of a grain but there is none; give a number',
        ),
        (
            {"numerics": Numerics(accuracy=0.05, accuracy_of="force")},
            'numerics.accuracy_of: "force" is not there in a turbulent channel without a grain',
        ),
        (
            {"numerics": Numerics(accuracy=0.05, accuracy_includes="all")},
            'numerics.accuracy_includes: "all" means gap and domain but without a grain both belong to the scene',
        ),
        (
            {"body": Disc(diameter=0.2, centre=(4, 0.5))}
            | {"numerics": Numerics(accuracy=0.05, accuracy_of="shear velocity")},
            'numerics.accuracy_of: "shear velocity" is that of a turbulent channel without a grain; use "auto"',
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
            "flow.datum: is not there with turbulence, whose profile starts at the bed's height at the inflow; leave",
        ),
        (
            {"turbulence": {"wall": "rough"}},
            'turbulence.roughness: is 0 but wall is "rough"; give the equivalent',
        ),
        (
            {"turbulence": {"roughness": 0.01}},
            'turbulence.roughness: is 0.01 but wall is "equilibrium"; set wall',
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


def grain(diameter, reynolds=2e5):
    return channel(
        fluid=Fluid(reynolds=reynolds, scale="flow"), body=Disc(diameter=diameter, x=4), bed=Flat()
    )


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


def test_error_bars_of_a_grain_in_turbulence_have_mesh_gap_and_domain():
    """The stream enters at the bed's own height, so that no other datum is tried, and the plan names none."""
    scene = channel(
        fluid=Fluid(reynolds=2e5, scale="flow"),
        body=Disc(diameter=0.2, x=3.9375, density=2.65),
        bed=Sinusoidal(amplitude=0.02, wavelength=0.25),
    )
    assert list(of_the_model(scene)) == ["gap", "domain"]
    wider = [one for one in coarse_scenes(scene) if one.numerics.mesh_size == pytest.approx(2**0.5)]
    assert len(wider) == 1 and not wider[0].numerics.error_bars
    assert make_plan(scene).datum is None


def test_a_faster_flow_is_one_of_larger_reynolds_number_and_has_the_stress_of_its_own_law():
    """tau_b = (factor V)^2 (u*/V)^2, u*/V by the logarithmic law at the larger Reynolds number."""
    scene = grain(0.2)
    twice = faster(scene, 2.0)
    assert twice.viscosity == pytest.approx(0.5 * scene.viscosity)
    assert 2.0 * bed_stress(scene, 2.0) == pytest.approx(4.0 * walls_of(twice).shear_velocity ** 2)
    assert bed_stress(scene) < bed_stress(scene, 2.0) < 2.0 * bed_stress(scene)
    slow = faster(scene, slowest(scene))
    assert grain_number(slow) == pytest.approx(300.0, rel=1e-3)
    assert walls_of(slow).distance < 0.2


def test_a_sweep_s_table_has_the_friction_and_whether_it_holds():
    walls = WallReport(0.08, 49.0, 51.0, 0.05, 0.05, 0.005, 1 / 11000, 0.09)
    found = quantities("run", {"verdict": None, "turbulence": walls.to_dict()})
    assert found["friction"] == 0.005 and found["applicable"] and found["y_plus_max"] == 51.0
    assert "friction_low" not in found
    bars = {"safety_factor": None, "shear_velocity": [5e-4, 1e-4]}
    told = quantities("run", {"verdict": None, "turbulence": walls.to_dict(), "error_bars": bars})
    assert (told["bed_shear_velocity_low"], told["bed_shear_velocity_high"]) == pytest.approx(
        (0.0495, 0.0505)
    )
    assert (told["friction_low"], told["friction_high"]) == pytest.approx((0.005 * 0.99**2, 0.005 * 1.01**2))
    row = {"status": "done", "task": "run", **found}
    assert in_words(row) == "C_f 0.005"
    assert in_words(row | {"applicable": False}) == "C_f 0.005, law of the wall NOT APPLICABLE"
    judged = row | {"mode": "rest", "safety_factor": 2.673, "applicable": False}
    assert in_words(judged) == "rest, safety factor 2.673, law of the wall NOT APPLICABLE"


@pytest.mark.parametrize(("outside", "told"), [(0.0, False), (0.021, True)])
def test_a_share_of_walls_outside_of_the_law_is_told_where_there_is_one(outside, told):
    walls = WallReport(0.08, 41.0, 220.0, 0.05, 0.05, 0.005, 1 / 11000, 0.09, outside=outside, plane=False)
    (line,) = walls.lines()
    assert "the law of the wall holds" in line and ("along 2.1% of them" in line) is told
    assert ("not from" in line) is told


def test_the_ladder_of_turbulence_has_finer_cells_at_its_end_and_no_higher_order():
    """No other way to solve is tried; those that turbulence refuses are no choice either."""
    scene = channel(numerics=Numerics(order=2))
    runs = ladder(scene, chosen(scene, quick=False))
    assert [(one.order, round(one.mesh_size, 3)) for one in runs.variants] == [
        (order, size) for order in (2, 3) for size in (2.0, 1.414, 1.0, 0.707)
    ]
    assert runs.reference == Variant(3, pytest.approx(0.5**1.5)) and not runs.compared
    assert np.isnan(runs.ratio)  # by which nothing is extrapolated
    assert chosen(scene, quick=True).orders == (2,)
    refused = message(lambda: chosen(scene, quick=True, solvers=["stabilised"]))
    assert refused.endswith("give some of: own, chords, loose, umfpack, superlu")


@pytest.mark.parametrize(
    ("bed", "leading"), [(None, "outflow"), (Sinusoidal(amplitude=0.02, wavelength=1.0), "mean")]
)
def test_what_a_channel_is_compared_by(bed, leading):
    """u* at the outflow, over a bed that is not level in the mean; the other one is told beside."""
    scene = channel(bed=bed)
    reference = {"outflow_shear_velocity": 0.05, "mean_shear_velocity": 0.04}
    found = goals(scene, reference)
    assert columns(scene) == tuple(reference)
    (first,) = (goal for goal in found if goal.leading)
    assert first.name == scene.accuracy_of == "shear velocity"
    assert first.columns == (f"{leading}_shear_velocity",)
    run = {"outflow_shear_velocity": 0.051, "mean_shear_velocity": 0.042}
    assert first.error(run, reference) == pytest.approx(0.02 if bed is None else 0.05)


@pytest.mark.parametrize("width", [None, 0.5])
def test_what_is_known_of_laminar_scenes_is_not_believed_with_turbulence(width):
    """In the plane and in space, whatever studies of other scenes this machine knows."""
    scene = channel(domain=Domain(length=20, width=width, height=1), numerics=Numerics(mesh_size=4, order=2))
    assert calibration.kind(scene).endswith("with turbulence")
    assert not any("turbulence" in one.kind for one in calibration.shipped().values())
    planned = predicted_plan(scene)
    assert planned.cheaper == () and planned.plan.estimate.cells > 0


def test_the_mesh_s_term_is_exact_at_order_one_and_not_deceived_by_chance():
    """An error of 0.01 h is found as such; where two meshes agree, half of what the coarser two differ by stands."""

    def at(mesh_size, by_chance):
        error = 0.01 * (2**0.5 if by_chance and mesh_size < 2 else mesh_size)
        return Loads(np.array([1.0 + error, 0.0, 0.0]), np.zeros(3), shear=np.array([0.05, 0.05 + error]))

    def term(by_chance):
        scene = channel()
        return by_coarser_mesh(scene, at(1.0, by_chance), lambda one: at(one.numerics.mesh_size, by_chance))

    assert term(False).force == pytest.approx([0.01, 0.0, 0.0])
    assert term(False).shear == pytest.approx([0.0, 0.01])
    assert term(True).shear == pytest.approx([0.0, 0.01 * 2**0.5 / 2])


@pytest.mark.parametrize(
    ("changes", "most"),
    [
        ({}, 14 / 6),
        ({"flow": Poiseuille()}, 28 / 6),
        ({"domain": Domain(length=4, height=1)}, 1.0),
        ({"bed": Sinusoidal(amplitude=0.02, wavelength=1.0)}, np.inf),
    ],
)
def test_a_mesh_that_is_no_coarser_tells_no_error(changes, most):
    """Between planes there are six rows and four columns at the least, where a term would be as good as nothing."""
    scene = channel(**changes, numerics=Numerics(mesh_size=2.0))
    assert coarsest(scene) == pytest.approx(most)
    same = Loads(np.zeros(0), np.zeros(0), shear=np.array([0.05, 0.05]))
    if most < 2.0**1.5:
        with pytest.raises(
            ConvergenceError, match="as few rows or columns of cells: use numerics"
        ) as refused:
            by_coarser_mesh(scene, same, lambda one: same)
        assert coarse_scenes(scene) == []
        finer = float(str(refused.value).split(" = ")[1].split()[0])
        assert most / 2**0.5 - 0.01 < finer <= most / 2**0.5
    else:
        assert by_coarser_mesh(scene, same, lambda one: same).shear == pytest.approx([0.0, 0.0])
        sizes = [one.numerics.mesh_size for one in coarse_scenes(scene)]
        assert sizes == pytest.approx([2.0 * 2**0.5, 4.0])


def test_the_mesh_s_term_in_time_is_found_on_coarser_cells():
    """k and epsilon have one order: what elements of another one change says little of it."""
    scene = channel(time=Time(end=1, step=0.1))
    longer, beside = comparisons(scene)
    assert beside.order == longer.order == scene.order
    assert beside.numerics.mesh_size == pytest.approx(2**0.5) and longer.numerics.mesh_size == 1.0
    assert shares(scene)[1] == pytest.approx(1 / (2**0.5 - 1))


def test_errors_of_shear_velocities_are_told_with_that_of_c_f():
    """C_f = 2 u*^2 errs by twice as much, relative; over a bed that is not level the mean is told, too."""
    walls = WallReport(0.08, 41.0, 220.0, 0.04, 0.05, 0.005, 1 / 11000, 0.09)
    (line,) = walls.lines(np.array([5e-4, 2e-4]))
    assert "u* 0.05, within 5.0e-04, and C_f 0.005, within 1.0e-04, at the outflow" in line
    assert walls.shear_velocities[walls.leading] == 0.05
    wavy = replace(walls, plane=False)
    assert wavy.lines(np.array([5e-4, 2e-4]))[0].endswith(
        "u* 0.04, within 2.0e-04, in the mean along the walls"
    )
    assert wavy.shear_velocities[wavy.leading] == 0.04


def test_of_many_places_where_the_flow_runs_upstream_the_longest_are_told():
    """Narrow wedges next to contacts are full of eddies, each shorter than the one before."""
    spans = tuple((place, place + 0.01 * place) for place in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    walls = WallReport(0.08, 41.0, 220.0, 0.04, 0.05, 0.005, 1 / 11000, 0.09, backward=spans)
    assert walls.lines()[0].endswith(
        "x = 3 to 3.03, 4 to 4.04, 5 to 5.05, 6 to 6.06, and in 2 shorter places"
    )
    assert replace(walls, backward=spans[:1]).lines()[0].endswith("upstream from x = 1 to 1.01")


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


@pytest.mark.parametrize(("mesh_size", "order", "same"), [(2.0, 2, True), (1.0, 2, False), (2.0, 3, False)])
def test_a_coarse_scene_is_its_own_coarse_run(mesh_size, order, same):
    """With cells and elements of the coarse runs the scene's loads spare that without changes, which is one of them."""
    scene = channel(
        body=Disc(diameter=0.2, x=4.0, density=2.65),
        bed=Flat(),
        fluid=Fluid(reynolds=2e5, scale="flow"),
        numerics=Numerics(mesh_size=mesh_size, order=order),
    )
    assert is_coarse(scene) is same
    assert coarse(scene) in coarse_scenes(scene)


def test_walls_along_which_nothing_flows_are_told_all_the_same():
    """As after a first step in time that failed, of which result.json tells."""
    walls = WallReport(0.08, 0.0, 0.0, 0.0, 0.0, 0.0, 1 / 11000, 0.09)
    assert walls.to_dict()["suitable_distance"] == np.inf and not walls.applicable
    assert walls.lines(np.zeros(2))[-1].strip() == "u* 0 and C_f 0 at the outflow"


def test_a_threshold_with_turbulence_chooses_no_mesh():
    stone = Disc(diameter=0.2, x=4.0625, density=2.65)
    scene = channel(
        body=stone,
        bed=Sinusoidal(amplitude=0.02, wavelength=0.25),
        fluid=Fluid(reynolds=2e5, scale="flow"),
        gravity=Gravity(acceleration=10.0),
        contact=Contact(friction=0.6),
        numerics=Numerics(accuracy=0.05),
    )
    assert "a threshold needs numerics.accuracy left out with turbulence" in message(
        lambda: incipient.threshold(scene)
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
    found = walls_of(one)
    mean = np.log(found.shear_velocity * 11000) / 0.41 + 5.2 - 1 / 0.41
    assert found.shear_velocity * mean == pytest.approx(1.0, rel=1e-6)
    assert found.distance * found.shear_velocity * 11000 == pytest.approx(50.0)
    grid = lay_out(one, make_plan(one)).shape
    assert (grid.origin[1], grid.height) == pytest.approx((found.distance, 1 - found.distance))
    grid, far = lay_out(two, make_plan(two)).shape, walls_of(two).distance
    assert (grid.origin[1], grid.height) == pytest.approx((3 + far, 2 - 2 * far))
    asked = channel(turbulence=Turbulence(wall_distance=0.1))
    assert walls_of(asked).distance == 0.1


def test_a_bed_with_forms_bounds_the_mesh_itself():
    """The wall below is a distance of the law under it, that on top still a distance above the mesh."""
    bed = Sinusoidal(amplitude=0.1, wavelength=2, phase=90)
    found = channel(bed=bed, flow=Poiseuille(), domain=Domain(length=20, height=2))
    walls, layout = walls_of(found), lay_out(found, make_plan(found))
    assert walls.floor == pytest.approx(0.1 - walls.distance) and walls.depth == pytest.approx(0.95)
    assert layout.shape.top == pytest.approx(2.0 - walls.distance)
    places = np.array([0.1, 0.1 + walls.distance, 1.7, 2.0 - walls.distance])
    assert walls.from_next(places) == pytest.approx(
        walls.distance * np.array([1, 2, 0.3 / walls.distance, 1])
    )
    weak, strong = (one for one in conditions(found) if isinstance(one, Friction))
    assert (weak.boundary, weak.axis, strong.boundary, strong.axis) == ("bed", None, "top", 1)
    inner = np.linspace(0.1, 2.0 - walls.distance, 20001)
    mean = entering(found).speed(0.5 * (inner[1:] + inner[:-1])).mean()
    layer = walls.law.beyond(walls.shear_velocity, found.viscosity, walls.distance) * walls.shear_velocity
    assert mean * (inner[-1] - inner[0]) + layer == pytest.approx(1.9, rel=1e-4)


def test_a_channel_in_space_is_meshed_as_in_the_plane_layer_by_layer():
    """Half of it where it is its own mirror image; two cells across at the least."""
    scene = channel(domain=Domain(length=20, height=1, width=2, origin=(0, -1, 3)))
    found, plane = lay_out(scene, make_plan(scene)).shape, channel(numerics=Numerics(order=2))
    of_plane = lay_out(plane, make_plan(plane)).shape
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
    walls, found = walls_of(scene), lay_out(scene, make_plan(scene)).shape
    away, open_top = walls.distance, flow.kind == "open-channel"
    assert walls.sides == (0.0, 0.8) and walls.reach == (0.4 if open_top else 0.5 * 0.8)
    assert found.across == pytest.approx((0.4, 0.8 - away)) and found.sides == ("symmetry", "left")
    thickness = np.diff([0.0, *found.ends])
    assert found.ends[-1] == 1.0 and (np.diff(thickness) < 0.0).all()
    rubbing = {one.boundary: one.axis for one in conditions(scene) if isinstance(one, Friction)}
    assert rubbing == {"bottom": 2, "left": 1} | ({} if open_top else {"top": 2})

    y, z = (np.linspace(low, high, 801) for low, high in ((away, 0.8 - away), (away, walls.ceiling)))
    places = np.meshgrid(0.5 * (z[1:] + z[:-1]), 0.5 * (y[1:] + y[:-1]))
    assert walls.from_next(np.array([0.5]), np.array([0.1])) == pytest.approx(0.1)
    mean = entering(scene).speed(*(one.ravel() for one in places)).mean()
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
    walls, at_corner, lee = lay_out(scene, make_plan(scene)).sizes.near[-3:]
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
    enters, near = entering(found), np.array([0.01, 0.015, 0.1, 0.99])
    exact = 0.04 * law.velocity(0.04, viscosity, np.array([0.01, 0.015, 0.1, 0.01]))
    assert enters.speed(near) == pytest.approx(exact, rel=2e-3)
    k = 0.04**2 / 0.3 + 1.5e-4
    assert enters.energy(near[[0, 1, 3]]) == pytest.approx(k, rel=1e-6)
    length = 0.41 * near[[0, 1, 3]].clip(max=0.01 + 0.005)
    length[-1] = 0.41 * 0.01
    assert enters.dissipation(near[[0, 1, 3]]) == pytest.approx(0.09**0.75 * k**1.5 / length, rel=1e-6)
    third = Turbulence(**MEASURED, profile=[[*row, 0.01] for row in rows.tolist()])
    assert entering(channel(turbulence=third)).energy(near) == pytest.approx(0.01 + 1.5e-4)


def test_the_law_of_the_wall():
    """u+ = ln(y+)/0.41 + 5.2; on rough walls ln(y/k_s)/0.41 + 8.5 (Nikuradse 1933); u* from the speed and back."""
    smooth, rough = WallLaw(), WallLaw(roughness=0.2)
    assert smooth.velocity(1.0, 0.01, 1.0) == pytest.approx(np.log(100) / 0.41 + 5.2)
    assert rough.velocity(1.0, 1e-5, 1.0) == pytest.approx(np.log(5) / 0.41 + 8.5, rel=1e-3)
    for law in (smooth, rough):
        speeds = np.array([0.3, 1.0, 30.0])
        found = law.shear_velocity(speeds, 1e-4, 0.3)
        assert found * law.velocity(found, 1e-4, 0.3) == pytest.approx(speeds, rel=1e-8)


@pytest.mark.parametrize("turbulence", [None, Turbulence(inflow="given", intensity=0.1, length=0.05)])
@pytest.mark.parametrize("flow", [OpenChannel(velocity=3.0), Poiseuille(velocity=3.0)])
def test_the_mean_velocity_that_enters_is_that_of_the_flow(flow, turbulence):
    """With the law's share between mesh and walls."""
    found = channel(flow=flow, turbulence=turbulence)
    walls, enters = walls_of(found), entering(found)
    inner = np.linspace(walls.distance, 1 - (walls.number - 1) * walls.distance, 20001)
    below = walls.number * walls.shear_velocity
    below *= walls.law.beyond(walls.shear_velocity, found.viscosity, walls.distance)
    speeds = enters.speed(0.5 * (inner[1:] + inner[:-1]))
    assert speeds.mean() * (inner[-1] - inner[0]) + below == pytest.approx(3.0, rel=1e-4)
    k, epsilon = enters.energy(inner), enters.dissipation(inner)
    assert (k > 0).all() and (epsilon > 0).all()
    if turbulence is not None:
        assert k == pytest.approx(1.5 * 0.3**2) and epsilon == pytest.approx(0.09**0.75 * k**1.5 / 0.05)
