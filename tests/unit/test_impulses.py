"""Impulses at contacts obey Signorini's and Coulomb's laws, whatever the contacts."""

from __future__ import annotations

import numpy as np
import pytest

from incipient.arrays import Floats
from incipient.body.contact_motion import ContactLaw, ContactMotion, turns, wrenches
from incipient.body.rigidbody import RigidBody
from incipient.body.state import BodyState, Inertia
from incipient.contact.acceleration import incipient_motion
from incipient.contact.impulses import contact_impulses, resisted_impulses
from incipient.contact.problem import Load
from incipient.geometry.closest import proximity
from incipient.geometry.contacts import ClosestPoints, Contacts, frame_of
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Flat
from incipient.geometry.plane.grains import Disc, Rectangle

INVERSE = np.diag([1.0, 1.0, 1.0, 10.0, 10.0, 10.0])


def pressed_from_below(random: np.random.Generator, count: int) -> tuple[Floats, Floats]:
    """Rows (3k, 6) of contacts of about a sphere with normals upwards, and the normals (k, 3)."""
    normals = random.normal(size=(count, 3))
    normals[:, 2] = np.abs(normals[:, 2]) + 0.3
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    points = -0.5 * normals + 0.05 * random.normal(size=(count, 3))
    first, second = frame_of(normals)
    return wrenches(points, np.stack([normals, first, second], axis=1), np.zeros(3)), normals


def missed(gain: Floats, free: Floats, friction: Floats, impulses: Floats) -> float:
    """By how much impulses (k, 3) miss the laws, written out, relative to the largest velocity."""
    velocities = (gain @ impulses.ravel() + free).reshape(-1, 3)
    slip, rubbed = (np.hypot(one[:, 1], one[:, 2]) for one in (velocities, impulses))
    limit = friction * impulses[:, 0]
    power = (velocities[:, 1:] * impulses[:, 1:]).sum(axis=1)
    laws = (
        -velocities[:, 0],
        -impulses[:, 0],
        np.abs(velocities[:, 0] * impulses[:, 0]),
        rubbed - limit,
        np.abs(power + slip * limit),
    )
    return max(float(law.max()) for law in laws) / float(np.abs(free).max())


@pytest.mark.parametrize(
    ("free", "friction", "expected"),
    [
        ([0.1, 1.0, 0.0], 0.5, [0.0, 0.0, 0.0]),
        ([-1.0, 0.3, 0.4], 0.6, [1.0, -0.3, -0.4]),
        ([-1.0, 3.0, 4.0], 0.5, [1.0, -0.3, -0.4]),
    ],
    ids=["opens", "sticks", "slides"],
)
def test_one_contact_sticks_slides_or_opens(
    free: list[float], friction: float, expected: list[float]
) -> None:
    """By hand, for a gain of one."""
    found = contact_impulses(np.eye(3), np.array(free), np.array([friction]))
    assert found == pytest.approx(np.array([expected]))


def test_a_thousand_random_grains_obey_both_laws() -> None:
    """One to five contacts, redundant ones too, each with a friction of its own, none among them."""
    random = np.random.default_rng(3)
    for _ in range(1000):
        count = int(random.integers(1, 6))
        rows, _ = pressed_from_below(random, count)
        falling = np.array([*random.normal(size=2), -1.0, *random.normal(size=3)])
        friction = random.choice([0.0, 0.2, 0.7, 1.5], size=count)
        gain, free = rows @ INVERSE @ rows.T, rows @ falling
        assert missed(gain, free, friction, contact_impulses(gain, free, friction)) < 1e-8


def test_a_thousand_random_grains_resist_rolling() -> None:
    """Both laws at one to five contacts, and at each a couple against the turn along the surface, bounded by P_N."""
    random = np.random.default_rng(7)
    for _ in range(1000):
        count = int(random.integers(1, 6))
        normals = random.normal(size=(count, 3))
        normals[:, 2] = np.abs(normals[:, 2]) + 0.3
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        ways = np.stack([normals, *frame_of(normals)], axis=1)
        arms = -0.5 * normals + 0.05 * random.normal(size=(count, 3))
        rows = np.vstack([wrenches(arms, ways, np.zeros(3)), 0.5 * turns(ways, 3).reshape(-1, 6)])
        falling = np.array([*random.normal(size=2), -1.0, *random.normal(size=3)])
        friction, rolling = (
            random.choice([0.0, 0.2, 0.7, 1.5], size=count),
            random.choice([0.01, 0.1, 0.5]),
        )
        gain, free = rows @ INVERSE @ rows.T, rows @ falling
        impulses = resisted_impulses(gain, free, friction, rolling)
        ended = (
            falling + INVERSE @ rows[3 * count :].T @ (impulses[count:] * [0.0, 1.0, 1.0]).ravel()
        )
        own = gain[: 3 * count, : 3 * count]
        assert missed(own, rows[: 3 * count] @ ended, friction, impulses[:count]) < 1e-8
        turning = (
            rows @ (ended + INVERSE @ rows[: 3 * count].T @ impulses[:count].ravel())
        ).reshape(-1, 3)
        couples, turned = impulses[count:, 1:], turning[count:, 1:]
        limit = rolling * impulses[:count, 0]
        assert (np.linalg.norm(couples, axis=1) <= limit + 1e-8).all()
        power = (couples * turned).sum(axis=1)
        assert power == pytest.approx(-limit * np.linalg.norm(turned, axis=1), abs=1e-8)


def test_velocities_from_rest_are_the_judges_accelerations() -> None:
    """From rest a step's velocities are its length times the accelerations at release, by the exact judge."""
    random = np.random.default_rng(5)
    for _ in range(20):
        rows, normals = pressed_from_below(random, 1)
        point = -0.5 * normals
        rows = wrenches(point, np.stack([normals, *frame_of(normals)], axis=1), np.zeros(3))
        force, couple = np.array([*random.normal(size=2), -1.0]), 0.1 * random.normal(size=3)
        load = Load(force, couple, np.zeros(3), np.zeros(3))
        judged = incipient_motion(load, Contacts(point, -normals), 0.4, 1.0, 0.1 * np.eye(3))
        wrench = np.concatenate([force, couple])
        gain, free = rows @ INVERSE @ rows.T, rows @ INVERSE @ wrench
        impulses = contact_impulses(gain, free, np.array([0.4]))
        found = INVERSE @ (wrench + rows.T @ impulses.ravel())
        exact = np.concatenate([judged.first.acceleration, judged.first.angular_acceleration])
        assert found == pytest.approx(exact, abs=1e-7)


def test_painleves_rod_has_impulses_where_it_has_no_forces() -> None:
    """A rod that slides along on its lower end, which is ahead of it, jams; over a step it has an impulse.

    At 60 degrees and friction 2 a pressure on the end accelerates it into the ground (Painleve 1895).
    """
    angle, friction = np.radians(60.0), np.array([2.0])
    arm = 0.5 * np.array([[-np.cos(angle), -np.sin(angle), 0.0]])
    ways = np.array([[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
    rows = wrenches(arm, ways, np.zeros(3))
    gain = rows @ np.diag([1.0, 1.0, 1.0, 12.0, 12.0, 12.0]) @ rows.T
    assert min(gain[0, 0] + way * friction[0] * gain[0, 1] for way in (-1.0, 1.0)) < 0.0
    for way in (-1.0, 1.0):
        free = rows @ np.array([way, -0.01, 0.0, 0.0, 0.0, 0.0])
        impulses = contact_impulses(gain, free, friction)
        assert impulses[0, 0] > 0.0
        assert missed(gain, free, friction, impulses) < 1e-8


@pytest.mark.parametrize("density", [0.0, 1e-9, 1e6])
def test_bodies_without_mass_and_with_any_take_the_same_steps(density: float) -> None:
    """With added mass a body without mass rests on its bed as any other: no step is shortened."""
    grain = Disc(1.0)
    body = RigidBody(Inertia.about(density * grain.volume, density * grain.inertia, grain.gdim))
    moves = ContactMotion(body, proximity(grain, Flat()).gaps, ContactLaw(0.5), grain.size)
    state, load = BodyState.at(Placement((0.0, 0.5))), np.array([0.2, -1.0, 0.0])
    added = np.diag([1.0, 1.0, 0.1])
    taken = moves.step(state, 0.1, load, added)
    assert taken.end.place[1] == pytest.approx(0.5, abs=1e-8)
    assert abs(taken.end.velocity[1]) < 1e-9
    assert taken.contacts.forces(0.1)[0, 1] == pytest.approx(1.0, rel=1e-6)


def test_gaps_are_those_of_corners_and_of_the_lowest_points() -> None:
    """Both lower corners of a block that stands on a plane, and the one place of a disc."""
    block = proximity(Rectangle(1.0, 0.5), Flat()).gaps(Placement((0.0, 0.26)), 0.05)
    assert isinstance(block, ClosestPoints)
    assert sorted(block.points[:, 0].tolist()) == pytest.approx([-0.5, 0.5])
    assert block.gaps == pytest.approx([0.01, 0.01])
    disc = proximity(Disc(1.0), Flat()).gaps(Placement((0.3, 0.49)), 0.05)
    assert disc.gaps == pytest.approx([-0.01])
    assert disc.normals == pytest.approx(np.array([[0.0, 1.0]]))
    assert len(proximity(Disc(1.0), Flat()).gaps(Placement((0.3, 5.0)), 0.05)) == 0
