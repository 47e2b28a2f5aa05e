"""What a scene may say of turbulence, and what its plan warns of or refuses."""

import pytest
from scenes import message
from turbulent import channel, grain

from incipient import make_plan
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
    Sphere,
    Time,
    Turbulence,
    Uniform,
)

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
    assert not any("law of the wall" in one for one in make_plan(grain(0.2)).warnings)


def test_loads_that_the_model_or_few_cells_make_uncertain_are_warned_of():
    """As docs/contribute/defaults.md has measured them: a sphere of three cells across, and round grains at all."""
    sphere = {
        "body": Sphere(diameter=0.4, x=0.6),
        "bed": Flat(),
        "contact": Contact(friction=0.6, gap=0.03),
    }
    sphere |= {
        "domain": Domain(length=1.6, width=1.2, height=1.0),
        "fluid": Fluid(reynolds=2e5, scale="flow"),
    }

    def told(mesh_size):
        return " ".join(
            make_plan(channel(**sphere, numerics=Numerics(mesh_size=mesh_size))).warnings
        )

    assert "the grain is 3.1 cells across" in told(
        7.0
    ) and "use numerics.mesh_size = 3.6 or less" in told(7.0)
    assert "cells across" not in told(3.5) and "cells across" not in " ".join(
        make_plan(grain(0.2)).warnings
    )
    assert "the k-epsilon model is far from measured loads" in told(3.5)
    assert not any("k-epsilon model is far" in one for one in make_plan(channel()).warnings)


def test_rows_of_a_profile_lie_between_the_walls():
    """Over an open channel they may go on above it, whose top is no wall."""
    rows = Turbulence(**MEASURED, profile=[[0.1, 0.7], [1.5, 1.0]])
    make_plan(channel(turbulence=rows))
    high = Turbulence(**MEASURED, profile=[[1.1, 0.7], [1.5, 1.0]])
    told = message(lambda: make_plan(channel(turbulence=high)))
    assert told.startswith("turbulence.profile: has no row within the depth of 1; give heights")
    refused = message(lambda: make_plan(channel(flow=Poiseuille(), turbulence=rows)))
    assert refused.startswith(
        "turbulence.profile: has a row at 1.5, the wall on top is 1 above that below; leave"
    )


def test_a_grain_in_midstream_is_away_from_walls():
    """A gap narrower than twice the law's distance is no result."""
    sections = {
        "fluid": Fluid(reynolds=2e5, scale="flow"),
        "bed": Flat(),
        "turbulence": Turbulence(wall_distance=0.01),
    }

    def held(height, flow):
        return channel(body=Disc(diameter=0.2, centre=(10.0, height)), flow=flow, **sections)

    def told(height, flow):
        return [
            one
            for one in make_plan(held(height, flow)).warnings
            if one.startswith("the grain is held")
        ]

    assert told(0.115, OpenChannel())[0].startswith(
        "the grain is held 0.015 from the bed, twice the distance of the law of the wall is 0.02: flow in the gap"
    )
    assert not told(0.5, OpenChannel()) and not told(0.89, OpenChannel())
    assert told(0.88, Poiseuille())[0].startswith("the grain is held 0.01 from the top")


def test_the_plan_says_what_it_takes_the_walls_for():
    text = make_plan(channel()).text()
    assert "yes  turbulence: effects.turbulence = true: k-epsilon model; walls 0.08" in text
    assert "y+ about 50" in text


def test_turbulence_is_never_there_unless_asked_for():
    plan = make_plan(channel(effects=Effects()))
    (found,) = [one for one in plan.effects if one.name == "turbulence"]
    assert not found.present and "set effects.turbulence = true" in found.reason
