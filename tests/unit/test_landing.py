"""A moving grain that has met the bed is judged there, as if it stood at rest under the loads at the end."""

import math

import numpy as np
import pytest

from incipient.body.state import BodyState
from incipient.effects.moving_grain.landing import FARTHER, landing
from incipient.geometry.placement import Placement
from incipient.planning.flow_setup import Setup
from incipient.results.loads import Forces, Torques
from incipient.scene import (
    Contact,
    Disc,
    Domain,
    Effects,
    Flat,
    Fluid,
    Gravity,
    HalfDiscs,
    Rectangle,
    Scene,
    Still,
    Time,
)

GAP = 0.05
BOX = Rectangle(width=1.0, height=0.5, centre=(2.0, 2.0), density=3.0, motion="free")
WEIGHT = 2.0 * 0.5 * 10.0  # (density - 1) area g


def scene(**changes):
    sections = {
        "domain": Domain(kind="box", length=4.0, height=4.0),
        "fluid": Fluid(reynolds=10.0, scale="grain"),
        "flow": Still(),
        "body": BOX,
        "gravity": Gravity(acceleration=10.0),
        "contact": Contact(friction=0.5, gap=GAP),
        "time": Time(end=1.0, step=0.1),
    }
    return Scene(**{**sections, **changes})


def landed(found, centre, push, angle=0.0):
    """The landing of the grain at a place, moving, under a push of the flow through its centre."""
    gravity, area = np.append(found.gravity_vector, 0.0), found.grain.volume
    force = Forces(np.array(push), np.array(push), -area * gravity, (found.mass or 0.0) * gravity)
    torque = Torques(np.zeros(3), np.zeros(3), np.array([*centre, 0.0]))
    state = BodyState.at(Placement(centre, math.radians(angle)), [0.3, -0.4, 1.0])
    met = Setup(found).surroundings.clearance(state.placement)
    return landing(Setup(found), state, met, force, torque)


@pytest.mark.parametrize("bed", [None, Flat()])
@pytest.mark.parametrize("share", [0.25, 0.75])
def test_a_box_that_lands_flat_stays_as_long_as_friction_holds_it(bed, share):
    """Pushed by a share of its weight: the safety factor is friction over the share; both lower corners touch."""
    found = landed(scene(bed=bed), (2.0, 0.25 + GAP * BOX.grain().size), (share * WEIGHT, 0.0, 0.0))
    assert found.contacts.points[:, 0].tolist() == pytest.approx([1.5, 2.5])
    assert found.verdict["safety_factor"] == pytest.approx(0.5 / share, rel=1e-6)
    assert found.verdict["moves"] is (share > 0.5)
    where = "bottom" if bed is None else "bed"
    assert found.verdict["sentence"].startswith(
        f"at rest where it met the {where}, under the loads at the end"
    )
    assert "body.x = 2 " in found.verdict["note"] and found.why_not == ""
    assert "no error bar" in found.verdict["note"]


def test_a_disc_that_lands_in_a_pocket_has_both_contacts():
    """Between half-discs of radius 1/2 that are 1.2 apart, and a gap above both: it rests there by itself."""
    body = Disc(diameter=1.0, centre=(2.0, 3.0), density=3.0, motion="free")
    bed = HalfDiscs(radius=0.5, spacing=1.2, offset=1.4)
    height = math.sqrt((1.0 + GAP) ** 2 - 0.6**2)
    found = landed(scene(body=body, bed=bed), (2.0, height), (0.0, 0.0, 0.0))
    assert len(found.contacts.points) == 2
    assert found.contacts.normals[:, 0].tolist() == pytest.approx(
        [-0.6 / (1 + GAP), 0.6 / (1 + GAP)]
    )
    assert not found.verdict["moves"]


def test_a_contact_that_is_farther_than_the_gap_is_none():
    """Tilted by more than the gap allows, the box stands on one corner, and its weight tips it over."""
    size = BOX.grain().size
    height = 0.5 * math.sin(math.radians(5)) + 0.25 * math.cos(math.radians(5)) + GAP * size
    found = landed(scene(), (2.0, height), (0.0, 0.0, 0.0), angle=5.0)
    assert len(found.contacts.points) == 1 and found.verdict["moves"]
    assert FARTHER > 1.0


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"contact": None}, "it needs a section [contact] with a friction"),
        ({"effects": Effects(contact=False)}, "effects.contact is false"),
        (
            {"body": BOX.model_copy(update={"locked": ("angle",)})},
            "body.locked holds motions of the grain",
        ),
    ],
)
def test_why_there_is_no_verdict(changes, why):
    found = landed(scene(**changes), (2.0, 0.25 + 0.01), (1.0, 0.0, 0.0))
    assert found.verdict is None and found.contacts is not None
    assert found.why_not.startswith(why)


def test_a_side_is_no_bed():
    found = landed(scene(), (0.51, 2.0), (-1.0, 0.0, 0.0))
    assert (found.contacts, found.verdict) == (None, None)
    assert found.why_not == "the grain met the left, which is not the bed"
