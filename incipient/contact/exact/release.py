"""A grain at the instant of its release, in numbers of order one: what the searches for its motion start from."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from incipient.arrays import Floats
from incipient.contact.exact import cones
from incipient.contact.exact.grasp import Grasp, grasp, wrenches
from incipient.contact.model import Load
from incipient.errors import SceneError
from incipient.geometry.contacts import Contacts

NO_LOAD = 1e-12  # of flow and weight: a sum below it is no load
CHECKED = 1e-9  # how far motions may enter contacts, relative to the free acceleration
LARGEST = 1e6  # friction with which motions are computed if it is larger or infinite
SYMMETRIC = 1e-9  # of the inertia's largest entry
SAME = 1e-7  # accelerations nearer than this, relative to the free one, are one solution


@dataclass(frozen=True, eq=False)
class Candidate:
    """An acceleration, with contact forces that go with it."""

    acceleration: Floats  # (6,) of the centre and about it
    local: Floats  # forces (k, 3)
    family: bool = False  # whether accelerations arbitrarily near to it are solutions too


def add(found: list[Candidate], candidate: Candidate, scale: float) -> None:
    """Append a candidate, or if its acceleration is there already note whether it belongs to a family."""
    for place, other in enumerate(found):
        if np.abs(candidate.acceleration - other.acceleration).max() <= SAME * scale:
            found[place] = replace(other, family=other.family or candidate.family)
            return
    found.append(candidate)


@dataclass(frozen=True, eq=False)
class Release:
    """Load and inertia of a grasp: forces in units of the load, lengths in its reach, masses in the grain's mass."""

    grasp: Grasp
    wrench: Floats  # (6,), of length one, or zero
    # (6, 6)
    mass: Floats
    inverse: Floats
    free: Floats  # (6,): the acceleration without contacts
    scale: float  # its size
    # (3k, 3k) and (3k,): local accelerations at the contacts by local forces, and without any
    compliance: Floats
    free_at_contacts: Floats
    # What a force of one, and a mass of one, are in the units of the load and the grain.
    force_unit: float
    mass_unit: float

    def acceleration(self, local: Floats) -> Floats:
        """Accelerations (6,) of the grain under its load and local forces (k, 3)."""
        return np.asarray(self.inverse @ (self.wrench + self.grasp.columns @ local.ravel()))

    def at_contacts(self, acceleration: Floats) -> Floats:
        """Local accelerations (k, 3) at the contacts by that of the grain."""
        return np.asarray((acceleration @ self.grasp.columns).reshape(-1, 3))

    def energy(self, acceleration: Floats) -> float:
        """acceleration . mass . acceleration, by which solutions are ordered."""
        return float(acceleration @ self.mass @ acceleration)


def release(
    load: Load, contacts: Contacts, friction: float, mass: float, inertia: Floats
) -> Release:
    """The problem of a case; friction above 1e6, or infinite, becomes 1e6.

    Raises SceneError if friction is negative, the mass not positive, or the inertia (3, 3) not symmetric and
    positive definite.
    """
    inertia = require_inertia(mass, inertia)
    held_by = grasp(load, contacts, min(friction, LARGEST), inertia)
    wrench, size = wrenches(load, held_by.reach).at(1.0)
    left = float(np.sqrt(wrench @ wrench))
    unit = wrench / left if left > NO_LOAD else np.zeros(6)
    scaled, inverse = np.eye(6), np.eye(6)
    scaled[3:, 3:] = inertia / (mass * held_by.reach**2)
    inverse[3:, 3:] = np.linalg.inv(scaled[3:, 3:])
    free = inverse @ unit
    from_forces = inverse @ held_by.columns
    return Release(
        grasp=held_by,
        wrench=unit,
        mass=scaled,
        inverse=inverse,
        free=free,
        scale=float(np.sqrt(free @ free)),
        compliance=held_by.columns.T @ from_forces,
        free_at_contacts=unit @ from_forces,
        force_unit=size * left,
        mass_unit=float(mass),
    )


def frictionless(case: Release) -> Candidate:
    """The only motion without friction: the acceleration nearest to the free one that enters no contact.

    By non-negative least squares for the pressures, or, should that fail its check, by a cone program.
    """
    root, pressures = np.linalg.cholesky(case.inverse), case.grasp.matrix[:, :, 0]
    local = np.zeros((len(case.grasp), 3))
    with suppress(RuntimeError):  # it cycles, which it rarely does
        local[:, 0] = nnls(root.T @ pressures, -root.T @ case.wrench)[0]
        acceleration = case.acceleration(local)
        opening = case.at_contacts(acceleration)[:, 0]
        work = local[:, 0] @ np.abs(opening)
        if opening.min() >= -CHECKED * case.scale and work <= CHECKED * case.scale * max(
            1.0, local.max()
        ):
            return Candidate(acceleration, local)
    acceleration, local[:, 0] = cones.frictionless(case.mass, pressures, case.wrench)
    return Candidate(acceleration, local)


def require_inertia(mass: float, inertia: Floats) -> Floats:
    """Return the inertia as an array (3, 3); raises SceneError for a mass or inertia that no body has."""
    if not (np.isfinite(mass) and mass > 0.0):
        raise SceneError(f"mass {mass} is not positive; give the grain's mass")
    table = np.array(inertia, dtype=float)
    if table.shape != (3, 3) or not np.isfinite(table).all():
        raise SceneError(
            f"inertia has shape {table.shape}; give (3, 3) finite numbers about the centre of mass"
        )
    if np.abs(table - table.T).max() > SYMMETRIC * np.abs(table).max():
        raise SceneError(
            "inertia is not symmetric; give the inertia tensor about the centre of mass"
        )
    if np.linalg.eigvalsh(table)[0] <= 0.0:
        raise SceneError(
            "inertia is not positive definite; give positive moments about every axis, also in 2D"
        )
    return table
