"""Random grains released on random beds without a fluid: every step is found, and contact creates no energy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from incipient.body.contact_motion import ActiveContacts, ContactLaw, ContactMotion
from incipient.body.rigidbody import RigidBody
from incipient.body.state import BodyState, Inertia
from incipient.geometry.placement import Placement
from incipient.geometry.plane.beds import Flat, HalfDiscs, Polyline, Sinusoidal
from incipient.geometry.plane.grains import Disc, Ellipse, Polygon, Rectangle
from incipient.geometry.settle import proximity
from incipient.geometry.space.beds import Plane, SphereBed
from incipient.geometry.space.grains import Sphere

RIDGE = Polyline(
    (
        (-50.0, 0.0),
        (-1.0, 0.0),
        (0.0, 1.0),
        (0.5, 0.2),
        (1.0, 0.2),
        (1.4, -0.3),
        (3.0, 0.4),
        (50.0, 0.0),
    )
)
BEDS = (Flat(0.0), HalfDiscs(0.5, 1.0), HalfDiscs(0.3, 1.0), Sinusoidal(0.15, 2.0), RIDGE)
IN_SPACE = (Plane(), SphereBed.array(0.5, 1.0))
HEXAGON = Polygon(
    tuple((0.5 * math.cos(k * math.pi / 3), 0.5 * math.sin(k * math.pi / 3)) for k in range(6))
)
ANGULAR = (Ellipse((0.5, 0.25)), Rectangle(1.0, 0.5, 0.1), HEXAGON, Rectangle(1.0, 0.6))
STEPS = 10  # in contact
# Energy that a step may add, relative to the kinetic energy and the weight times the size: what the
# turn of a contact's normal in a step leaves, which falls with the square of the step; 0.21 at most when written.
LEAST, OF_STEP = 1e-6, 0.3
DEEPEST = 1e-5  # of the size, within the bed


def drawn(seed: int, round_grain: bool) -> tuple[ContactMotion, BodyState, np.ndarray, float]:
    """A grain in contact motion, where it starts, gravity of one, the step."""
    random = np.random.default_rng(seed)
    in_space = round_grain and random.random() < 0.3
    grain: Any = Sphere(random.uniform(0.4, 1.5)) if in_space else Disc(random.uniform(0.3, 1.5))
    if not round_grain:
        grain = ANGULAR[random.integers(len(ANGULAR))]
    bed: Any = (
        IN_SPACE[random.integers(len(IN_SPACE))] if in_space else BEDS[random.integers(len(BEDS))]
    )
    friction = random.choice([0.0, random.uniform(0.0, 1.0), random.uniform(0.0, 2.0)])
    kinetic = None if random.random() < 0.7 else friction * random.random()
    restitution = random.choice([0.0, 0.0, random.uniform(0.0, 0.9)])
    d, slope = (3 if in_space else 2), random.choice([0.0, random.uniform(-0.7, 0.7)])
    gravity = np.zeros(d)
    gravity[0], gravity[-1] = math.sin(slope), -math.cos(slope)
    place, turn = random.uniform(-2.0, 2.0, d), random.uniform(0.0, 2.0 * math.pi)
    under = bed.height([place[0]] if d == 2 else place[None, :2])
    place[-1] = float(np.asarray(under).ravel()[0]) + 0.55 * grain.size
    near = proximity(grain, bed)
    placement = Placement(tuple(place), turn) if d == 2 else Placement(tuple(place))
    while near.gaps(placement, 0.05 * grain.size).gaps.min(initial=1.0) < 0.0:
        placement = placement.raised(0.1 * grain.size)
    state = BodyState.at(placement, random.normal(size=3 * (d - 1)) * random.choice([0.0, 1.0]))
    step = 10.0 ** random.uniform(-3.0, -1.0) * math.sqrt(grain.size)
    rolling = random.choice([0.0, 0.0, random.uniform(0.0, 0.5)])
    law = ContactLaw(friction, kinetic, restitution, rolling)
    moves = ContactMotion(
        RigidBody(Inertia.about(grain.volume, grain.inertia, grain.gdim)),
        near.gaps,
        law,
        grain.size,
    )
    return moves, state, gravity, step


def followed(seed: int, round_grain: bool) -> bool:
    """Step a grain until it has been in contact for some steps, looking at each; whether it has been in any."""
    moves, state, gravity, dt = drawn(seed, round_grain)
    body, law, d, contacts, touched = (
        moves.body,
        moves.law,
        len(gravity),
        ActiveContacts.none(len(gravity)),
        0,
    )
    load = np.zeros(body.size)
    load[:d] = body.inertia.mass * gravity
    for _ in range(1000):
        taken = moves.step(state, dt, load, before=contacts)
        energies = [
            body.kinetic_energy(one) - float(load[:d] @ one.place) for one in (state, taken.end)
        ]
        raised = max(0.0, -float(load[:d] @ (taken.end.place - taken.motion.end.place)))
        scale = body.kinetic_energy(state) + body.inertia.mass * moves.reach
        bound = LEAST + OF_STEP * dt**2 / moves.reach
        assert energies[1] - energies[0] - raised <= bound * scale, seed
        assert sum(taken.contacts.work) <= bound * scale, seed
        gaps = moves.near(taken.end.placement, 0.05 * moves.reach).gaps
        assert gaps.min(initial=0.0) > -DEEPEST * moves.reach, seed
        impulses = taken.contacts.impulses
        assert len(impulses) or not taken.pushed.any(), (
            seed
        )  # what has changed the motion is reported
        if len(impulses):
            largest = float(np.abs(impulses).max())
            beyond = np.hypot(*impulses[:, 1:].T) - law.friction * impulses[:, 0]
            assert max(float(beyond.max()), -float(impulses[:, 0].min())) <= 1e-9 * largest, seed
        touched += len(impulses) > 0
        state, contacts = taken.end, taken.contacts
        if touched == STEPS or abs(float(state.place[0])) > 40.0:
            break
    return touched > 0


@pytest.mark.slow
@pytest.mark.parametrize(("round_grain", "seeds"), [(True, 12), (False, 3)])
def test_some_random_releases(round_grain: bool, seeds: int) -> None:
    assert sum(followed(seed, round_grain) for seed in range(seeds)) > 0.6 * seeds
