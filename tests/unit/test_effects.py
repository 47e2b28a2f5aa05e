"""Which effects the plan calls for, and what it says where it leaves one out."""

import json
import re
from functools import partial
from typing import get_args

import pytest
from scenes import SCENES

from incipient import load, make_plan
from incipient.planning.effects import OSEEN, EffectName, accuracy_asked, threshold_notes
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Effects,
    ExpressionFlow,
    Flat,
    Fluid,
    Gravity,
    Lid,
    Numerics,
    OpenChannel,
    Poiseuille,
    Rectangle,
    Scene,
    Shear,
    Sinusoidal,
    Still,
    Time,
    Uniform,
)
from incipient.scene.file import dumps, loads
from incipient.setup.setup import Setup

scene = partial(
    Scene,
    domain=Domain(length=12, height=6),
    fluid=Fluid(reynolds=20, scale="grain"),
    flow=Shear(),
    body=Disc(diameter=1, x=4, density=2.65),
    bed=Flat(),
    gravity=Gravity(acceleration=10),
    contact=Contact(friction=0.5),
)
FREE = {
    "body": Disc(diameter=1, centre=(4, 3), density=2, motion="free"),
    "contact": None,
    "time": Time(end=1, step=0.1),
}
TIDE = ExpressionFlow(components=("y*(1 + 0.5*sin(t/100))", "0"))


def effect(name, **changes):
    (result,) = [one for one in make_plan(scene(**changes)).effects if one.name == name]
    return result


def at(reynolds, **changes):
    return effect("inertia", fluid=Fluid(reynolds=reynolds, scale="grain"), **changes)


def test_every_effect_is_decided_once_and_written_by_its_name():
    """Readers of results know effects by these names."""
    names = [
        one["name"] for one in json.loads(json.dumps(make_plan(scene(**FREE)).to_dict()))["effects"]
    ]
    assert sorted(names) == sorted(get_args(EffectName)) and len(names) == 11
    assert {"inertia", "moving mesh", "free body", "third dimension"} < set(names)


# -- inertia -------------------------------------------------------------------------------------------------


BOX = {
    "domain": Domain(kind="box", length=40, height=40),
    "flow": Lid(),
    "bed": None,
    "contact": None,
    "body": Disc(diameter=0.01, centre=(20, 20)),
}
UNIFORM = {
    "body": Disc(diameter=1, centre=(4, 3)),
    "bed": None,
    "contact": None,
    "flow": Uniform(),
}
INERTIA = [
    # Oseen (1910): 3/16 Re of the drag. At Re 0.004 that is 0.075%, below a tenth of 1%.
    (0.004, {}, False, 3 / 16 * 0.004),
    (0.006, {}, True, 3 / 16 * 0.006),
    (0.04, {"numerics": Numerics(accuracy=0.1)}, False, 3 / 16 * 0.04),
    (0.004, {"numerics": Numerics(accuracy=0.001)}, True, 3 / 16 * 0.004),
    (1e-6, {"effects": Effects(inertia=True)}, True, 3 / 16 * 1e-6),
    (20.0, {"effects": Effects(inertia=False)}, False, 1.0),
    # In the open as far as the next wall; without one, the height of the domain.
    (0.004, UNIFORM, True, OSEEN * 0.004 * 6),
    # A small grain in a large cavity: inertia bends the flow that it meets; Re of the cavity is 4000 times as large.
    (0.001, BOX, True, OSEEN * 0.001 * 4000),
]


@pytest.mark.parametrize(("reynolds", "changes", "present", "expected"), INERTIA)
def test_inertia_is_left_out_where_it_is_small_beside_the_accuracy(
    reynolds, changes, present, expected
):
    result = at(reynolds, **changes)
    assert result.present is present and result.expected == pytest.approx(expected)
    assert result.forced is ("effects" in changes)


def test_the_plan_tells_the_effect_of_inertia_where_it_leaves_it_out():
    assert at(0.004).text() == (
        " no  inertia: Re = 0.004 on grain scale; estimated effect on drag 0.07%"
    )
    off = effect("inertia", effects=Effects(inertia=False))
    assert off.text().endswith("; estimated effect on drag 100% or more")
    assert accuracy_asked(Numerics(accuracy="verdict")) == accuracy_asked(Numerics()) == 0.01


@pytest.mark.parametrize(("factor", "change"), [(0.1, None), (10.0, "19%"), (100.0, "100%")])
def test_a_threshold_without_inertia_tells_what_it_would_change_there(factor, change):
    """By Oseen 3/16 of Re = 0.1 times the factor; below the accuracy of 1% nothing is said."""
    slow = Setup(scene(fluid=Fluid(reynolds=0.1, scale="grain", inertia=False)))
    said = [note for note in threshold_notes(slow, factor) if "inertia" in note]
    end = f"without inertia, which may change the drag at the threshold by up to {change}"
    assert said == ([] if change is None else [f"WARNING: {end}"])


RIPPLED = {"bed": Sinusoidal(amplitude=0.5, wavelength=4)}
IN_A_CHANNEL = {"flow": OpenChannel(), "fluid": Fluid(reynolds=600, scale="flow")}
SETTLING = {**FREE, "flow": Still(), "fluid": Fluid(reynolds=0.1, scale="grain")}
# Sixteen periods of a speed sin(2 pi t), at most 1, at the disc's top and of the disc.
SWAYED = {
    "flow": ExpressionFlow(components=("y*sin(2*pi*t)", "0")),
    "time": Time(end=16, step=0.05),
}
SWAYING = {
    **FREE,
    "bed": None,
    "domain": Domain(kind="box", length=16, height=12),
    "body": Disc(diameter=1, centre=(8, 6), motion="prescribed", course=("sin(2*pi*t)", "0", "0")),
    "flow": Still(),
    "time": Time(end=16, step=0.05),
}


@pytest.mark.parametrize(
    ("changes", "name", "value"),
    [
        # Speed 1 at height 1, viscosity 1/20.
        (RIPPLED, "bed_reynolds", pytest.approx(20.0, rel=0.01)),
        ({}, "bed_reynolds", None),
        # Half a parabola of mean 1 over depth 6: 1.5 y (12 - y) / 36 at the grain's top, y = 1, is 11/24.
        (IN_A_CHANNEL, "grain_reynolds", pytest.approx(100 * 11 / 24)),
        (IN_A_CHANNEL, "flow_reynolds", pytest.approx(600)),
        # Stokes (1851): (s - 1) g d^2 / (18 nu) with nu = 10 for the reference velocity of 1.
        (SETTLING, "grain_reynolds", pytest.approx(1 / 180)),
        (SETTLING, "density_ratio", pytest.approx(2)),
        (SETTLING, "stokes", pytest.approx(2 / 180 / 18)),
        (SETTLING, "froude", None),
        (SETTLING, "flow_reynolds", 0.0),
        (SWAYED, "grain_reynolds", pytest.approx(20, rel=0.02)),
        (SWAYING, "grain_reynolds", pytest.approx(20, rel=0.02)),
    ],
)
def test_numbers_are_those_of_the_speeds_at_grain_and_bed(changes, name, value):
    assert getattr(Setup(scene(**changes)).numbers, name) == value


def test_no_number_of_a_shear_depends_on_the_scale_of_its_reynolds_number():
    """Viscosity 1/20, of a disc of size 1 in height 6: a Reynolds number of 6 * 6 * 20 on the scale of the flow."""
    of_grain, of_flow = (
        make_plan(scene(fluid=Fluid(reynolds=reynolds, scale=scale)))
        for reynolds, scale in ((20, "grain"), (720, "flow"))
    )
    assert of_flow.numbers == of_grain.numbers
    assert of_flow.stabilisation == of_grain.stabilisation
    assert of_flow.numbers.flow_reynolds == pytest.approx(720)


# -- other effects -------------------------------------------------------------------------------------------


def test_a_slow_change_makes_the_plan_recommend_quasi_steady_flow():
    time = Time(end=600, step=1)
    slow = effect("unsteadiness", flow=TIDE, time=time, fluid=Fluid(reynolds=1e-5, scale="grain"))
    assert slow.present and "effects.unsteadiness = false would do" in slow.reason
    assert "estimated effect on drag" in slow.text()
    assert "false" not in effect("unsteadiness", flow=TIDE, time=time).reason


def test_a_stream_that_oscillates_slowly_around_a_held_grain():
    """U cos t: Stokes's drag grows by a sqrt(1/nu) + a^2/(3 nu) with a = 1/2 and nu = V L/Re = 1e4."""
    stream = ExpressionFlow(components=("cos(t)", "0"), velocity=1)
    very_viscous = Fluid(reynolds=1e-4, scale="grain")
    result = effect("unsteadiness", flow=stream, time=Time(end=6.3, step=0.1), fluid=very_viscous)
    assert result.expected == pytest.approx(0.5 / 1e2 + 0.25 / 3e4, rel=1e-2)


@pytest.mark.parametrize("settle", [True, False])
def test_a_released_grain_that_does_not_fill_its_pocket_is_told_of(settle):
    """Lowered at x it stands on the sphere behind it alone, and begins 0.026, not 0.05, from the two in front of it."""
    settings = (f"body.settle={str(settle).lower()}", "body.x=2.2886254", "contact.gap=0.05")
    scene = load(SCENES / "sphere_leaving_pocket.toml", settings)
    told = [one for one in make_plan(scene).warnings if "closer than its gap of 0.05" in one]
    assert len(told) == (0 if settle else 1)
    assert all("starts 0.0259 from its bed" in one and "body.settle = true" in one for one in told)


def test_a_rigid_lid_in_place_of_a_surface():
    """Fr^2 = V^2 / (g H) = 1/60: by Bernoulli a free surface would rise by half of that."""
    result = effect("free surface", flow=OpenChannel())
    assert (
        result.expected == pytest.approx(1 / 120)
        and "Froude number of this height 0.13" in result.reason
    )


def by_depth(reynolds):
    return Fluid(reynolds=reynolds, scale="flow")


FAST = Fluid(reynolds=60, scale="grain")
STOKES = Fluid(reynolds=20, scale="grain", inertia=False)
ONLY = "only with effects.turbulence = true"
DECISIONS = [
    ("inertia", {}, True, "Re = 20 on grain scale"),
    ("inertia", SWAYED, True, "Re = .*"),
    ("inertia", SWAYING, True, "Re = .*"),
    ("inertia", {"fluid": STOKES}, False, "fluid.inertia = false; Re = 20 on grain scale"),
    ("inertia", {"effects": Effects(inertia=False)}, False, "effects.inertia = false; Re = 20.*"),
    ("unsteadiness", {"time": Time(end=600, step=1)}, True, "until t = 600"),
    ("unsteadiness", UNIFORM | {"fluid": FAST}, False, ".*sheds vortices above 46"),
    ("unsteadiness", UNIFORM, False, r"no \[time\] section"),
    ("unsteadiness", {"fluid": FAST}, False, r"no \[time\] section"),  # on a bed
    ("gravity", {}, True, "weight and buoyancy.*"),
    ("gravity", {"body": Disc(diameter=1, x=5)}, True, "buoyancy of the grain; .*"),
    (
        *("gravity", {"body": None, "contact": None, "fluid": by_depth(20)}, True),
        "analytical hydrostatic pressure, no unknowns",
    ),
    ("gravity", {"effects": Effects(gravity=False)}, False, "effects.gravity = false; .*"),
    ("contact", {}, True, "the grain rests on the bed"),
    (
        *("contact", {"effects": Effects(contact=False)}, False),
        "effects.contact = false; the grain rests on the bed",
    ),
    ("free body", FREE, True, ".*; density ratio 2, Stokes number .*"),
    ("moving mesh", FREE, True, "the mesh follows the grain"),
    (
        *("turbulence", {"flow": Poiseuille(), "fluid": by_depth(2000)}, False),
        ".*may be turbulent from 1300 on.*",
    ),
    ("turbulence", {"flow": Poiseuille()}, False, ONLY),
    # Half of a channel between walls, with half its height.
    (
        *("turbulence", {"flow": OpenChannel(), "fluid": by_depth(700)}, False),
        '.*may be turbulent from 650 on.*else take a mean profile, flow.kind = "log-law"',
    ),
    # Along a plate twice as long as the domain is high.
    ("turbulence", {"flow": Uniform(), "fluid": by_depth(2e5)}, False, ONLY),
    (
        *("turbulence", {"flow": Uniform(), "fluid": by_depth(3e5)}, False),
        r".*Re of the length 6e\+05: boundary layers may be turbulent from 500000 on.*",
    ),
    # Endless shear: the domain's height says nothing of its depth.
    ("turbulence", {"fluid": by_depth(2000)}, False, ONLY),
]


@pytest.mark.parametrize(("name", "changes", "present", "reason"), DECISIONS)
def test_an_effect_is_present_for_a_reason(name, changes, present, reason):
    decision = effect(name, **changes)
    assert decision.present is present and re.fullmatch(reason, decision.reason)


# -- the section ---------------------------------------------------------------------------------------------


def test_auto_is_the_default_and_one_word():
    plain = 'effects = "auto"\n[domain]\nlength = 12\nheight = 6\n[fluid]\nreynolds = 20\nscale = "flow"\n'
    result = loads(plain + '[flow]\nkind = "shear"\n')
    assert result.effects == Effects()
    assert loads(dumps(result)) == result
    some = loads(
        plain.replace("auto", "x") + '[flow]\nkind = "shear"\n',
        overrides=["effects={inertia=false}"],
    )
    assert some.effects == Effects(inertia=False)


@pytest.mark.parametrize(
    ("changes", "said", "warned"),
    [
        ({"flow": Still()}, "at rest and exerts no load", True),
        ({"flow": ExpressionFlow(components=["0", "-0.0 * 2"])}, "at rest and exerts", True),
        ({"flow": ExpressionFlow(components=["0", "0.1"])}, "at rest and exerts", False),
        ({}, "at rest and exerts no load", False),
        (SETTLING, "at rest and exerts no load", False),
        # The velocity is given there: 0.03 of its size from the inflow a disc had a lift coefficient of 40.
        *(
            ({"body": Disc(diameter=1, x=x, density=2.65)}, r"from the inflow.*body\.x", warned)
            for x, warned in ((0.53, True), (1.4, True), (1.6, False))
        ),
        *(
            ({"contact": Contact(friction=0.5, gap=gap)}, f"contact.gap = {gap:g} is wide", warned)
            for gap, warned in ((0.03, False), (0.031, True), (0.1, True))
        ),
    ],
)
def test_a_plan_warns_in_its_text_of_what_is_doubtful(changes, said, warned):
    plan = make_plan(scene(**changes))
    assert len(plan.warnings) == warned
    assert bool(re.search(f"warning: .*{said}", plan.text())) is warned
    assert list(plan.to_dict()["warnings"]) == list(plan.warnings)


@pytest.mark.parametrize(
    ("settle", "said"),
    [
        (True, "with friction 0.3"),
        ("frictionless", "without friction"),
        ("level", "with friction 0.3 on the level bed"),
    ],
)
def test_the_plan_says_what_the_rest_of_a_grain_depends_on(settle, said):
    body = Disc(diameter=1, x=4, density=2.65, settle=settle)
    case = scene(body=body, contact=Contact(friction=0.3))
    contact = next(one for one in make_plan(case).effects if one.name == "contact")
    assert said in contact.reason


def test_a_released_grain_begins_with_the_gap_at_each_contact():
    """A box with rounded corners across a trough: beside its contact the end of a side has a small gap as well."""
    body = Rectangle(
        width=0.9,
        height=0.6,
        corner_radius=0.1,
        x=2.802084,
        density=2.5,
        settle=True,
        motion="released",
    )
    case = scene(
        bed=Sinusoidal(amplitude=0.1, wavelength=2.0),
        body=body,
        contact=Contact(friction=0.2842, gap=0.01),
        time=Time(end=0.8, step=0.1),
    )
    setup = Setup(case)
    assert len(setup.contacts.points) == 2
    assert setup.stance.gap == pytest.approx(0.01 * case.grain.size, rel=1e-6)
