"""The second question of the exact judge: how does the grain begin to move when it is released?"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from incipient.arrays import Floats
from incipient.contact.exact.least import allowed, least_forces
from incipient.contact.exact.motion_modes import (
    ContactState,
    Mode,
    Uniqueness,
    contact_states,
    mode,
)
from incipient.contact.exact.planar_motion import planar_solutions
from incipient.contact.exact.release import Candidate, Release, frictionless, release
from incipient.contact.exact.spatial_motion import Law, coulomb, law_residual, spatial_solutions
from incipient.contact.exact.support import Support, support
from incipient.contact.model import Load
from incipient.errors import ConvergenceError
from incipient.geometry.contacts import Contacts

ZERO = 1e-8  # accelerations below it, relative to those without contacts, are zero
GOOD = 1e-9  # the residual of a solution above which other contact forces are tried
MANY = 64  # contacts in the plane up to which all solutions are enumerated


@dataclass(frozen=True, eq=False)
class Solution:
    """One motion that mechanics allows at the instant of release.

    `acceleration` (3,) of the centre of mass, `angular_acceleration` (3,); `contact_forces` (n, 3) on the
    grain; `contact_accelerations` (n, 3) of the grain at its contacts; `contact_states` (n,); `mode` of the
    whole; `forces_unique`: if not, other contact forces give the same accelerations, and these are the
    smallest (sum of squares). `residual`: how far Newton's and Coulomb's laws are missed, relative to the load.
    """

    acceleration: Floats
    angular_acceleration: Floats
    contact_forces: Floats
    contact_accelerations: Floats
    contact_states: tuple[ContactState, ...]
    mode: Mode
    forces_unique: bool
    residual: float

    def to_dict(self) -> dict[str, Any]:
        """All of it as numbers, strings and lists for JSON."""
        plain: dict[str, Any] = {
            name: getattr(self, name).tolist()
            for name in (
                "acceleration",
                "angular_acceleration",
                "contact_forces",
                "contact_accelerations",
            )
        }
        plain |= {"mode": self.mode.name, "wording": self.mode.value}
        plain["contact_states"] = [state.name for state in self.contact_states]
        return plain | {"forces_unique": self.forces_unique, "residual": self.residual}


@dataclass(frozen=True, eq=False)
class IncipientMotion:
    """How the grain begins to move: the first of the `solutions` found, which are all different accelerations.

    Rest comes first if it is one of them, then the motions in the order of their energy of acceleration,
    (m a.a + alpha.J.alpha) / 2. `uniqueness`: whether there can be others; `jams`: contact forces can balance
    one another, so that rest may depend on how the grain was wedged in.
    """

    solutions: tuple[Solution, ...]
    uniqueness: Uniqueness
    jams: bool

    @property
    def acceleration(self) -> Floats:
        """Acceleration (3,) of the centre of mass."""
        return self.solutions[0].acceleration

    @property
    def angular_acceleration(self) -> Floats:
        """(3,)."""
        return self.solutions[0].angular_acceleration

    @property
    def contact_forces(self) -> Floats:
        """The contact forces on the grain, (n, 3)."""
        return self.solutions[0].contact_forces

    @property
    def contact_states(self) -> tuple[ContactState, ...]:
        """Stick, roll, slide or lift, (n,)."""
        return self.solutions[0].contact_states

    @property
    def mode(self) -> Mode:
        """The mode of the whole grain."""
        return self.solutions[0].mode

    @property
    def moves(self) -> bool:
        """Whether the grain must move: False if rest is among the solutions."""
        return self.mode.moves

    @property
    def residual(self) -> float:
        """The worst of all solutions."""
        return max(solution.residual for solution in self.solutions)

    def to_dict(self) -> dict[str, Any]:
        """The first solution, with all of them in `solutions`, for JSON."""
        every = [solution.to_dict() for solution in self.solutions]
        verdict = {"uniqueness": self.uniqueness.name, "uniqueness_wording": self.uniqueness.value}
        return every[0] | verdict | {"jams": self.jams, "moves": self.moves, "solutions": every}


def incipient_motion(
    load: Load, contacts: Contacts, friction: float, mass: float, inertia: Floats
) -> IncipientMotion:
    """The accelerations with which a grain at rest answers the load, with contacts that push and rub.

    At every contact, with N the force and A_N the acceleration along the inward normal, T and A_T those along
    the surface: N >= 0, A_N >= 0, N A_N = 0 (no contact pulls, nothing is penetrated), and |T| <= friction N,
    where A_T != 0 with equality and T against A_T. `inertia` (3, 3) about the centre of mass. Planar cases
    (`safety_factor`; the plane's normal has to be a principal axis of inertia) are enumerated completely, cases
    without friction have one solution; in space solutions are sought from several starts. Infinite friction is
    computed as 1e6.

    Raises SceneError on negative friction, a mass that is not positive, an inertia that is not symmetric and
    positive definite, and ConvergenceError if no solution is found.
    """
    case = release(load, contacts, friction, mass, inertia)
    law, carried = coulomb(case), support(case.grasp)
    found, complete = _candidates(case, law, carried)
    if not found:
        raise ConvergenceError(
            "incipient motion: no start led to accelerations and forces that obey Coulomb's law; "
            "vary friction or load a little"
        )
    found.sort(key=lambda candidate: case.energy(candidate.acceleration))
    return IncipientMotion(
        solutions=tuple(_solution(case, law, carried, candidate) for candidate in found),
        uniqueness=_uniqueness(found, complete),
        jams=carried.can_jam(),
    )


def _candidates(case: Release, law: Law, carried: Support) -> tuple[list[Candidate], bool]:
    """The different solutions found, and whether these are all."""
    rest = Candidate(np.zeros(6), np.zeros((len(case.grasp), 3)))
    without_friction = frictionless(case)
    if np.abs(without_friction.acceleration).max() <= ZERO * case.scale:
        return [
            rest
        ], True  # held without friction: to move would take energy that the load has not
    if case.grasp.law.is_frictionless:
        return [without_friction], True
    if case.grasp.plane is not None and len(case.grasp) <= MANY:
        return planar_solutions(case), True
    held = carried.holds(case.wrench)
    return [rest] * held + spatial_solutions(case, law, without_friction, held), False


def _uniqueness(found: list[Candidate], complete: bool) -> Uniqueness:
    if any(candidate.family for candidate in found):
        return Uniqueness.FAMILY
    if len(found) > 1:
        return Uniqueness.SEVERAL
    return Uniqueness.ONLY if complete else Uniqueness.NOT_EXCLUDED


@dataclass(frozen=True, eq=False)
class Reading:
    """What an acceleration (6,) is, without what counts as zero: at the contacts (k, 3), their states, the mode."""

    acceleration: Floats
    at_contacts: Floats
    states: list[ContactState]
    mode: Mode


def reading(case: Release, acceleration: Floats) -> Reading:
    """Read an acceleration (6,)."""
    zero, acceleration = ZERO * case.scale, acceleration.copy()
    if np.abs(acceleration[3:]).max() <= zero:
        acceleration[3 * (np.abs(acceleration).max() > zero) :] = 0.0
    at_contacts = case.at_contacts(acceleration)
    states = contact_states(at_contacts, bool(acceleration[3:].any()), zero)
    named = mode(states, case.grasp.frames[:, 0], acceleration[3:], zero)
    return Reading(acceleration, at_contacts, states, named)


def _solution(case: Release, law: Law, carried: Support, candidate: Candidate) -> Solution:
    """A candidate with its states, its smallest forces and its units."""
    held_by, read = case.grasp, reading(case, candidate.acceleration)
    acceleration, at_contacts, states = read.acceleration, read.at_contacts, read.states
    local, unique = _smallest_forces(case, candidate, at_contacts, states)
    residual = math.inf if local is None else _residual(case, law, acceleration, local)
    if (
        residual > GOOD
    ):  # round-off decides on a boundary of states: perhaps those found before are better
        other = candidate.local if acceleration.any() else carried.forces(case.wrench)
        if other is not None and _residual(case, law, acceleration, other) < residual:
            local, residual = other, _residual(case, law, acceleration, other)
    assert local is not None
    local = held_by.law.nearest(local)
    unit = case.force_unit / case.mass_unit
    return Solution(
        acceleration=unit * acceleration[:3],
        angular_acceleration=unit / held_by.reach * acceleration[3:],
        contact_forces=case.force_unit * held_by.forces(local),
        contact_accelerations=unit * (at_contacts[:, None] @ held_by.frames)[held_by.copy, 0],
        contact_states=tuple(states[i] for i in held_by.copy.tolist()),
        mode=read.mode,
        forces_unique=unique,
        residual=residual,
    )


def _smallest_forces(
    case: Release, candidate: Candidate, at_contacts: Floats, states: list[ContactState]
) -> tuple[Floats | None, bool]:
    """The smallest local forces (k, 3) that give the acceleration, and whether no others do; None: not found."""
    local = np.zeros((len(case.grasp), 3))
    kept = [i for i, state in enumerate(states) if state is not ContactState.LIFT]
    if not kept:
        return local, True
    slides = np.array([states[i] is ContactState.SLIDE for i in kept])
    by = allowed(case.grasp, kept, slides, at_contacts[kept])
    found, unique = least_forces(by, case.wrench - case.mass @ candidate.acceleration)
    if found is None:
        return None, False
    local[kept] = found
    return local, unique


def _residual(case: Release, law: Law, acceleration: Floats, local: Floats) -> float:
    """The worst of Newton's and Coulomb's laws, relative to the load or to the largest contact force."""
    balance = case.mass @ acceleration - case.wrench - case.grasp.columns @ local.ravel()
    worst = max(float(np.abs(balance).max()), law_residual(law, local))
    return worst / max(1.0, float(np.abs(local).max()))
