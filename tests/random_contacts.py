"""Random grains on random beds, and the contacts of hard cases."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from incipient.contact import Contacts, Load
from incipient.contact.verdict import judge

# Random contact problems in space, and the laws that their answers have to obey, written independently.
#
# Three kinds of grains: spheres, whose normals all pass through the centre; irregular grains on a bed, with
# normals that do not; and contacts anywhere with normals anywhere, which no grain need have.


FRICTION = (0.05, 0.2, 0.4, 0.6, 1.0, 2.0)
EYE = np.eye(3)
KINDS = ("sphere", "irregular", "anywhere")


@dataclass(frozen=True, eq=False)
class Case:
    """What the exact judge is asked."""

    load: Load
    contacts: Contacts
    friction: float
    mass: float
    inertia: np.ndarray


def random_case(seed: int, kind: str | None = None) -> Case:
    """The case of a seed: 3 to 6 contacts, forces, arms and masses of order one."""
    random = np.random.default_rng(seed)
    kind = kind or KINDS[seed % 3]
    count = int(random.integers(3, 7))
    points, normals = _contacts(random, kind, count)
    force, couple = random.normal(size=3), random.normal(size=3) * random.choice([0.0, 0.1, 0.5])
    weight = np.array([0.0, 0.0, -random.choice([0.0, 0.5, 1.0, 3.0], p=[0.05, 0.25, 0.4, 0.3])])
    axes = random.normal(size=(3, 3))
    return Case(
        Load(force, couple, weight, np.zeros(3)),
        Contacts(points, normals),
        float(random.choice(FRICTION)),
        float(random.uniform(0.5, 2.0)),
        0.05 * axes @ axes.T + 0.1 * np.eye(3),
    )


def _contacts(random, kind, count):
    below = random.normal(size=(count, 3)) * [1.0, 1.0, 0.7] - [0.0, 0.0, 1.0]
    below /= np.linalg.norm(below, axis=1)[:, None]
    if kind == "sphere":
        return below, below
    if kind == "irregular":
        normals = below + 0.4 * random.normal(size=(count, 3))
        points = below * random.uniform(0.6, 1.2, size=(count, 1))
    else:
        normals, points = random.normal(size=(count, 3)), random.normal(size=(count, 3))
        normals[0] *= np.sign(normals[0] @ points[0])  # one at least has to point out of the grain
    return points, normals / np.linalg.norm(normals, axis=1)[:, None]


def rotation(seed: int):
    """A random rotation (3, 3)."""
    axes, upper = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    axes = axes * np.sign(np.diag(upper))
    return axes * np.sign(np.linalg.det(axes))


def changed(case: Case, turn=EYE, shift=0.0, units=(1.0, 1.0, 1.0), places=slice(None)) -> Case:
    """The same case turned, in units of length, force and mass that are so many times as small, and moved.

    `places`: its contacts in another order, or some of them several times.
    """
    (length, force, mass), load = units, case.load
    acting = Load(
        force * turn @ load.flow_force,
        length * force * turn @ load.flow_couple,
        force * turn @ load.weight,
        length * turn @ load.centre + shift,
    )
    points = length * case.contacts.points @ turn.T + shift
    areas = None if case.contacts.areas is None else length**2 * case.contacts.areas[places]
    contacts = Contacts(points[places], (case.contacts.normals @ turn.T)[places], areas)
    inertia = mass * length**2 * turn @ case.inertia @ turn.T
    return Case(acting, contacts, case.friction, mass * case.mass, inertia)


def normal_and_shear(vectors, normals):
    """The inward normal parts (n,) and the parts along the surface (n, 3) of vectors at contacts."""
    inward = -(vectors * normals).sum(axis=1)
    return inward, vectors + inward[:, None] * normals


def safety_misses(case: Case, result) -> float:
    """How far forces, couples and cones are missed at the factor shown, relative to load or largest force."""
    if math.isnan(result.factor):
        return float(np.abs(result.contact_forces).max())
    forces, arms = result.contact_forces, case.contacts.points - case.load.centre
    flow_force, flow_couple = (
        result.factor * case.load.flow_force,
        result.factor * case.load.flow_couple,
    )
    force = forces.sum(axis=0) + flow_force + case.load.weight
    couple = np.cross(arms, forces).sum(axis=0) + flow_couple
    normal, shear = normal_and_shear(forces, case.contacts.normals)
    outside = np.linalg.norm(shear, axis=1) - case.friction * normal
    largest = max(
        np.abs(part).max() for part in (forces, flow_force, flow_couple, case.load.weight)
    )
    return float(
        max(np.abs(force).max(), np.abs(couple).max(), outside.max(), -normal.min(), 0.0)
        / (largest or 1.0)
    )


def motion_misses(case: Case, solution) -> float:
    """How far a motion misses Newton's laws, non-penetration and Coulomb's friction, relative as above.

    Products that have to vanish, force times acceleration, are divided by the sizes of both.
    """
    arms, load, forces = case.contacts.points - case.load.centre, case.load, solution.contact_forces
    a, alpha = solution.acceleration, solution.angular_acceleration
    force = load.flow_force + load.weight + forces.sum(axis=0) - case.mass * a
    couple = load.flow_couple + np.cross(arms, forces).sum(axis=0) - case.inertia @ alpha
    normal, shear = normal_and_shear(forces, case.contacts.normals)
    opening, sliding = normal_and_shear(a + np.cross(alpha, arms), case.contacts.normals)
    size, speed = np.linalg.norm(shear, axis=1), np.linalg.norm(sliding, axis=1)
    pressed = max(
        np.abs(part).max() for part in (forces, load.flow_force, load.flow_couple, load.weight)
    )
    moved = max(np.abs(a).max(), np.abs(alpha).max(), pressed)  # masses and arms are of order one
    against = (shear * sliding).sum(axis=1) + case.friction * normal * speed
    return max(
        np.abs(force).max() / pressed,
        np.abs(couple).max() / pressed,
        -normal.min() / pressed,
        (size - case.friction * normal).max() / pressed,
        -opening.min() / moved,
        np.abs(normal * opening).max() / (pressed * moved),
        np.abs(against).max() / (pressed * moved),
    )


# Contacts at which judges could stumble: no friction and endless friction, one place twice, opposite normals.


# Name: places and normals out of a unit disc at the origin.
PLACES: dict[str, tuple[list[list[float]], list[list[float]]]] = {
    "one contact": ([[0, -1]], [[0, -1]]),
    "the same contact three times": ([[0, -1]] * 3, [[0, -1]] * 3),
    "two contacts 1e-9 apart": ([[-5e-10, -1], [5e-10, -1]], [[0, -1]] * 2),
    "opposite contacts": ([[0, -1], [0, 1]], [[0, -1], [0, 1]]),
    "a wedge": ([[-0.6, -0.8], [0.6, -0.8]], [[-0.6, -0.8], [0.6, -0.8]]),
}
FRICTIONS = (0.0, 1e-12, 0.5, 1e12)


def judged(name: str, friction: float) -> tuple[str, str]:
    """Whether the disc, of weight one under a sideways flow of a tenth, moves, with what margin, and how."""
    points, normals = (np.pad(np.array(rows, float), ((0, 0), (0, 1))) for rows in PLACES[name])
    load = Load(
        np.array([0.1, 0.0, 0.0]),
        np.array([0.0, 0.0, -0.02]),
        np.array([0.0, -1.0, 0.0]),
        np.zeros(3),
    )
    told = judge(load, Contacts(points, normals), friction, (1.0, 0.5 * np.eye(3)))
    safety = told.equilibrium.safety.value
    return (
        f"{'moves' if told.moves else 'rests'}, safety factor {safety:.4g}",
        told.equilibrium.label,
    )
