"""Grains of scenes at rest, and the datum of the undisturbed flow."""

import math
from functools import partial

import numpy as np
import pytest
from scenes import CHANNEL, DISC, scene

from incipient import make_plan
from incipient.body.state import BodyState
from incipient.geometry.placement import Placement
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Effects,
    ExpressionFlow,
    Flat,
    Fluid,
    Gravity,
    HalfDiscs,
    Inclined,
    Poiseuille,
    Polyline,
    Rectangle,
    Scene,
    Shear,
    Sinusoidal,
    Still,
    Time,
)
from incipient.setup.setup import Setup
from incipient.simulation.landing import FARTHER, landing
from incipient.sweep.worker import quantities

# The datum of the undisturbed flow: one for the whole bed, wherever the domain cuts it.


HEIGHTS = np.linspace(0.0, 6.0, 6001)
PHASES = np.linspace(0.0, 1.2, 5)
OBSTACLE = [(0, 0.01), (3, 0.02), (3.4, 0.5), (3.5, 0), (7, 0.02), (8, 0), (11, 0.01), (12, 0)]
FLOWS = ("shear", "poiseuille", "open-channel", "uniform", "log-law")


def rough(phase: float = 0.0, kind: str = "shear", **flow):
    """A disc in a pocket of half-discs, moved along the channel together with them."""
    return scene(
        bed=HalfDiscs(radius=0.5, spacing=1.2, offset=1 + phase),
        body=Disc(diameter=1, x=4 + phase),
        flow={"kind": kind, **flow},
    )


def speeds(velocity) -> np.ndarray:
    """Along the inflow, as high as HEIGHTS."""
    return velocity(np.vstack([np.zeros_like(HEIGHTS), HEIGHTS, np.zeros_like(HEIGHTS)]), 0.0)[0]


@pytest.mark.parametrize(
    ("bed", "crest", "mean"),
    [
        (Flat(), 0, 0),
        (Inclined(slope=3), 0, 0),
        (Sinusoidal(amplitude=0.3, wavelength=40, phase=-90), 0.3, 0),  # no crest within the domain
        (HalfDiscs(radius=0.5, spacing=1.2), 0.5, np.pi * 0.5**2 / 2 / 1.2),
        (Polyline(points=[(0.5 * k, 0.2 * (k % 2)) for k in range(-3, 30)]), 0.2, 0.1),
        (
            Polyline(points=[(-5, 3), (0, 0), (6, 0), (6.1, 0.4), (12, 0.4), (20, 9)]),
            0,
            0.4 * 5.95 / 12,
        ),
        (
            Polyline(points=[(0, 0.4), (6, 0.4), (6.1, 0), (12, 0)]),
            0.4,
            0.4 * 6.05 / 12,
        ),  # a step down
        (Polyline(points=OBSTACLE), 0.01, None),
    ],
)
def test_crest_and_mean_of_beds_and_a_given_height(bed, crest, mean):
    """Heights in the scene; the base line is where the domain begins. What is outside the domain does not count."""
    high = {
        "domain": Domain(length=12, height=6, origin=(0, 2)),
        "bed": bed,
        "body": None,
        "gravity": Gravity(acceleration=1),
        "fluid": {"reynolds": 20, "scale": "flow"},
    }
    for datum, height in (("crest", crest), ("mean", mean), (0.5 * crest, 0.5 * crest)):
        if height is not None:
            result = Setup(scene(**high, flow=Shear(datum=datum))).base_flow.datum
            assert result == pytest.approx(2 + height)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"bed": HalfDiscs(radius=0.5, spacing=1.2)},
            "y = 0.448057: the effective height of the bed, computed from its shape; "
            "the shear flow starts",
        ),
        (
            {"bed": HalfDiscs(radius=0.5, spacing=1.2), "flow": Shear(datum="crest")},
            "y = 0.5: the crest of the bed; the shear flow starts",
        ),
        (
            {"bed": Sinusoidal(amplitude=0.1, wavelength=2), "flow": Poiseuille(datum="mean")},
            "y = 0: the mean height of the bed; the poiseuille flow starts",
        ),
        (
            {"bed": Sinusoidal(amplitude=0.1, wavelength=2), "flow": Shear(datum=0.05)},
            "y = 0.05: flow.datum = 0.05; the shear flow starts",
        ),
        (
            {"bed": Polyline(points=OBSTACLE)},
            "what is higher, up to y = 0.5, does not count; the shear flow",
        ),
    ],
)
def test_the_plan_tells_the_datum(changes, words):
    assert words in make_plan(scene(**changes)).text()


@pytest.mark.parametrize("kind", FLOWS)
@pytest.mark.parametrize("phase", PHASES[1:])
def test_the_phase_of_the_bed_changes_nothing_about_the_stream(kind, phase):
    """Stream, inflow from the crests, stress at the bed and dimensionless numbers are those of one datum."""
    first, moved = (Setup(rough(at, kind=kind)) for at in (0.0, phase))
    assert np.array_equal(speeds(moved.base_flow.velocity), speeds(first.base_flow.velocity))
    from_crest = (
        speeds(Setup(rough(at, kind=kind, datum="crest")).base_flow.entering) for at in (0.0, phase)
    )
    assert np.array_equal(*from_crest)
    assert moved.bed_stress() == first.bed_stress()
    assert moved.numbers.grain_reynolds == pytest.approx(first.numbers.grain_reynolds, rel=1e-6)
    assert moved.numbers.bed_reynolds == pytest.approx(first.numbers.bed_reynolds, rel=1e-4)


@pytest.mark.parametrize("kind", FLOWS)
@pytest.mark.parametrize("datum", ["auto", "crest", "mean", 0.1])
@pytest.mark.parametrize("phase", PHASES)
def test_the_inflow_is_at_rest_on_the_bed_and_carries_the_same_flux(kind, datum, phase):
    """Nothing flows backwards; a bed above the datum takes little of the flux, and only there.

    Less than 2% of it, of the fuller profile of a turbulent stream 3%.
    """
    moved = rough(phase, kind=kind, datum=datum)
    base_flow, y, bed = Setup(moved).base_flow, HEIGHTS, moved.bed_shape.height([0.0])[0]
    there, everywhere = speeds(base_flow.entering), speeds(base_flow.velocity)
    assert there.min() == 0.0 and not there[y < max(bed, base_flow.datum) - 1e-9].any()
    assert np.array_equal(there[y > 1.0], everywhere[y > 1.0])
    if kind != "uniform":
        assert there[y <= bed].max(initial=0.0) == 0.0
        missing = 0.03 if kind == "log-law" else 0.02
        assert there.sum() == pytest.approx(everywhere.sum(), rel=missing)


BED, CREST = HalfDiscs(radius=0.5, spacing=1.2), Shear(datum="crest")
WEIGHING = {"body": Disc(diameter=1, x=4, density=2.65), "gravity": Gravity(acceleration=10.0)}
DEEP = {"bed": HalfDiscs(radius=2, spacing=8), "body": Disc(diameter=1, x=4), "domain": CHANNEL}


def bed_stress(result):
    """Over the viscosity."""
    return Setup(result).bed_stress() / result.viscosity


@pytest.mark.parametrize(
    ("build", "number", "value"),
    [
        # Shear: nu rate; parabola of mean V over the depth h above the datum: 6 nu V/h; half a parabola: 3 nu V/h.
        (lambda: rough(kind="shear", datum="crest"), bed_stress, 1.0),
        (lambda: rough(kind="poiseuille", datum="crest"), bed_stress, 6 / 5.5),
        (lambda: rough(kind="open-channel", datum="crest"), bed_stress, 3 / 5.5),
        # Half-discs of radius 1/2, speed 1/2 there, viscosity 1/20.
        (lambda: rough(datum="crest"), lambda s: Setup(s).numbers.bed_reynolds, 0.5 * 0.5 * 20),
        # A grain that hides below the crests adds nothing; one form and a half are no row of them.
        (lambda: scene(**DEEP), lambda s: Setup(s).base_flow.datum, 2.0),
        (lambda: scene(**DEEP), lambda s: Setup(s).numbers.grain_reynolds, 0.0),
        (lambda: scene(**DEEP), lambda s: Setup(s).numbers.bed_reynolds, 2 * 2 * 20),
        # The wall below a held grain is at the datum: half the domain above crests half as high as the grain.
        (
            lambda: scene(body=Disc(diameter=1, centre=(4, 3)), bed=BED, flow=CREST),
            *(lambda s: Setup(s).numbers.reach, 2.5),
        ),
        (lambda: scene(body=DISC), lambda s: Setup(s).numbers.reach, 0.5),
        # tau_b = mu G in a shear flow; Re = G d^2/nu = 20, g = 10 d G^2, density 2.65.
        (lambda: scene(**WEIGHING), lambda s: Setup(s).numbers.shields, 0.05 / (1.65 * 10.0)),
        (lambda: scene(**WEIGHING), lambda s: Setup(s).numbers.shear_reynolds, 0.05**0.5 * 20.0),
        (lambda: scene(body=DISC), lambda s: Setup(s).numbers.shields is None, True),
        # Without a bed the datum is the lower side.
        (
            lambda: scene(body=Disc(diameter=1, centre=(4, 3)), bed=None),
            *(lambda s: Setup(s).base_flow.datum, 0.0),
        ),
    ],
)
def test_numbers_of_the_flow_above_the_datum(build, number, value):
    assert number(build()) == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize(
    "changes",
    [
        {"flow": ExpressionFlow(components=("y", "0"))},
        {"body": Disc(diameter=1, centre=(4, 3)), "bed": None},
    ],
)
def test_flows_without_a_profile_or_a_bed_have_no_datum(changes):
    assert make_plan(scene(**changes)).datum is None


def test_the_shields_number_of_a_scene_is_told_by_the_plan_and_a_column_of_sweeps() -> None:
    """Column `shields` is the critical one of thresholds."""
    result = Setup(scene(**WEIGHING)).numbers
    assert "Shields number 0.00303" in result.text()
    row = quantities("run", {"verdict": None, "plan": {"numbers": {"shields": result.shields}}})
    assert row == {"flow_shields": result.shields}


# A moving grain that has met the bed is judged there, as if it stood at rest under the loads at the end.


GAP = 0.05
BOX = Rectangle(width=1.0, height=0.5, centre=(2.0, 2.0), density=3.0, motion="free")
WEIGHT = 2.0 * 0.5 * 10.0  # (density - 1) area g


landing_scene = partial(
    Scene,
    domain=Domain(kind="box", length=4.0, height=4.0),
    fluid=Fluid(reynolds=10.0, scale="grain"),
    flow=Still(),
    body=BOX,
    gravity=Gravity(acceleration=10.0),
    contact=Contact(friction=0.5, gap=GAP),
    time=Time(end=1.0, step=0.1),
)


def landed(result, centre, push, angle=0.0):
    """The landing of the grain at a place, moving, under a push of the flow through its centre."""
    state = BodyState.at(Placement(centre, math.radians(angle)), [0.3, -0.4, 1.0])
    met = Setup(result).clearance(state.placement)
    return landing(Setup(result), state, met, np.array([*push, 0.0, 0.0, 0.0]))


@pytest.mark.parametrize("bed", [None, Flat()])
@pytest.mark.parametrize("share", [0.25, 0.75])
def test_a_box_that_lands_flat_stays_as_long_as_friction_holds_it(bed, share):
    """Pushed by a share of its weight: the safety factor is friction over the share; both lower corners touch."""
    contacts, verdict, why_not = landed(
        landing_scene(bed=bed), (2.0, 0.25 + GAP * BOX.grain.size), (share * WEIGHT, 0.0, 0.0)
    )
    assert contacts.points[:, 0].tolist() == pytest.approx([1.5, 2.5])
    assert verdict["safety_factor"] == pytest.approx(0.5 / share, rel=1e-6)
    assert verdict["moves"] is (share > 0.5)
    where = "bottom" if bed is None else "bed"
    assert verdict["sentence"].startswith(
        f"at rest where it met the {where}, under the loads at the end"
    )
    assert "body.x = 2 " in verdict["note"] and why_not == ""
    assert "no error bar" in verdict["note"]


def test_a_disc_that_lands_in_a_pocket_has_both_contacts():
    """Between half-discs of radius 1/2 that are 1.2 apart, and a gap above both: it rests there by itself."""
    body = Disc(diameter=1.0, centre=(2.0, 3.0), density=3.0, motion="free")
    bed = HalfDiscs(radius=0.5, spacing=1.2, offset=1.4)
    height = math.sqrt((1.0 + GAP) ** 2 - 0.6**2)
    contacts, verdict, _ = landed(landing_scene(body=body, bed=bed), (2.0, height), (0.0, 0.0, 0.0))
    assert len(contacts.points) == 2
    assert contacts.normals[:, 0].tolist() == pytest.approx([-0.6 / (1 + GAP), 0.6 / (1 + GAP)])
    assert not verdict["moves"]


def test_a_contact_that_is_farther_than_the_gap_is_none():
    """Tilted by more than the gap allows, the box stands on one corner, and its weight tips it over."""
    size = BOX.grain.size
    height = 0.5 * math.sin(math.radians(5)) + 0.25 * math.cos(math.radians(5)) + GAP * size
    contacts, verdict, _ = landed(landing_scene(), (2.0, height), (0.0, 0.0, 0.0), angle=5.0)
    assert len(contacts.points) == 1 and verdict["moves"]
    assert FARTHER > 1.0


BOTTOM, LEFT = (2.0, 0.25 + 0.01), (0.51, 2.0)


@pytest.mark.parametrize(
    ("changes", "place", "why"),
    [
        ({"contact": None}, BOTTOM, "it needs a section [contact] with a friction"),
        ({"effects": Effects(contact=False)}, BOTTOM, "effects.contact is false"),
        (
            {"body": BOX.model_copy(update={"locked": ("angle",)})},
            *(BOTTOM, "body.locked holds motions of the grain"),
        ),
        ({}, LEFT, "the grain met the left, which is not the bed"),
    ],
)
def test_why_there_is_no_verdict(changes, place, why):
    contacts, verdict, why_not = landed(landing_scene(**changes), place, (1.0, 0.0, 0.0))
    assert verdict is None and (contacts is None) == (place is LEFT)
    assert why_not.startswith(why)
