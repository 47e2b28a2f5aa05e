"""Accelerations of a grain released from rest under Coulomb's law: enumerated in 2-D, by Newton's method in 3-D."""

import math
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from incipient.arrays import Booleans, Floats, Integers
from incipient.contact.friction import Law
from incipient.contact.impulses import STEPS, CoulombLaw, newton, projected
from incipient.contact.kernels import Kernel, dot, largest, length
from incipient.contact.problem import IN_PLANE, ContactProblem, Load
from incipient.contact.safety import (
    SafetyFactor,
    can_jam,
    factors_that_balance,
    forces_that_balance,
)
from incipient.errors import ConvergenceError, SceneError
from incipient.files import plain_fields
from incipient.geometry.contacts import Contacts, balance

ZERO = 1e-8  # accelerations below this, relative to the free one, are zero
SAME = 1e-7  # accelerations closer than this, relative to the free one, are one solution
NEARLY = 1e-9  # tolerance of parallel unit vectors and of cell boundaries
NO_LOAD = 1e-12  # resultant of flow and weight, relative to both, that counts as zero
MOST = 12  # solutions kept per case, those of least energy


class ContactState(Enum):
    """State of motion at a contact."""

    STICK = "stays where it is, and so does the whole grain"
    ROLL = "stays where it is while the grain turns"
    SLIDE = "keeps contact and accelerates along the surface"
    LIFT = "accelerates away from the surface"


class Mode(Enum):
    """Modes of incipient motion, from the states of all contacts and the angular acceleration alpha.

    - Without alpha: SLIDING if any contact slides, otherwise LIFTING.
    - No contact rolls: PIVOTING_AND_SLIDING if any slides, otherwise LIFTING_AND_ROTATING.
    - One contact rolls and another slides: PIVOTING_AND_SLIDING_APART.
    - Some contact rolls, none slides: PIVOTING if any lifts; SPINNING if none lifts and alpha is
      along all contact normals; otherwise ROLLING.
    """

    REST = "rest"
    SLIDING = "sliding: translation along at least one contact"
    LIFTING = "lifting: translation away from every contact"
    LIFTING_AND_ROTATING = "lifting off every contact and rotating"
    ROLLING = "rolling: the grain turns without slip at every contact"
    PIVOTING = "pivoting about contacts that do not slip, lifting off the others"
    SPINNING = "spinning about the normal of its contacts, which do not slip"
    PIVOTING_AND_SLIDING = "turning while sliding at the same contacts"
    PIVOTING_AND_SLIDING_APART = "pivoting about one contact while sliding on a different one"

    @property
    def label(self) -> str:
        return self.name.lower().replace("_", " ")


MODES = tuple(Mode)


class Uniqueness(Enum):
    """Whether mechanics allows other accelerations."""

    ONLY = "the only solution"
    SEVERAL = "one of several solutions"
    FAMILY = "one of a continuous family of solutions"
    NOT_EXCLUDED = "no other solution converged; others are not excluded"


@dataclass(frozen=True, eq=False)
class Solution:
    """Admissible motion at the instant of release; vectors (3,), contacts (n, 3).

    `residual`: violation of Newton's and Coulomb's laws, relative to the load.
    """

    acceleration: Floats
    angular_acceleration: Floats
    contact_forces: Floats
    contact_states: tuple[ContactState, ...]
    mode: Mode
    forces_unique: bool
    residual: float


@dataclass(frozen=True, eq=False)
class IncipientMotion:
    """Possible accelerations of a grain, rest first, then by energy (m a.a + alpha.J.alpha) / 2.

    `jams`: contact forces can balance one another, so that rest may depend on history.
    """

    solutions: tuple[Solution, ...]
    uniqueness: Uniqueness
    jams: bool

    @property
    def first(self) -> Solution:
        """Rest, or the solution of least energy."""
        return self.solutions[0]

    @property
    def moves(self) -> bool:
        """Whether rest is no solution."""
        return self.first.mode is not Mode.REST

    @property
    def residual(self) -> float:
        """Largest residual of all solutions."""
        return max(solution.residual for solution in self.solutions)

    def to_dict(self) -> dict[str, Any]:
        """JSON data: the first solution, and all in `solutions`."""
        return plain_fields(self.first) | plain_fields(self) | {"moves": self.moves}


@dataclass(frozen=True, eq=False)
class ReleaseProblem:
    """n grains released from rest, scaled to unit mass and load; m = 3 components in 2-D, 6 in 3-D."""

    contacts: ContactProblem
    columns: Floats  # (n, m, 3k): wrenches of unit local forces
    inverse: Floats  # (n, m, m), of mass and inertia
    wrench: Floats  # (n, m), of length one, or zero
    # Dimensional unit force and acceleration, (n,).
    force_unit: Floats
    acceleration_unit: Floats

    @classmethod
    def of(
        cls, contacts: ContactProblem, inverse: Floats, mass: Floats, factor: float = 1.0
    ) -> "ReleaseProblem":
        """Under `factor` times the flow's load, from inverses of mass and inertia of unit mass."""
        wrench, size = contacts.wrench(factor)
        left = np.sqrt((wrench * wrench).sum(axis=1))
        wrench = np.where(left > NO_LOAD, 1.0 / np.maximum(left, NO_LOAD), 0.0)[:, None] * wrench
        once = contacts.within(inverse)
        return cls(
            contacts,
            contacts.within(contacts.columns),
            contacts.within(np.ascontiguousarray(once.swapaxes(1, 2))),
            contacts.within(wrench[:, :, None])[:, :, 0],
            size * left,
            size * left / mass,
        )

    @cached_property
    def scale(self) -> Floats:
        return np.asarray(np.linalg.norm((self.inverse @ self.wrench[:, :, None])[:, :, 0], axis=1))

    def motions(self, most: int) -> tuple[Integers, Floats, Floats]:
        """Motions in order of energy, as `motion_rows`; complete in 2-D, without rest."""
        arguments = self.columns, self.inverse, self.contacts.law.bounded, self.wrench, most
        count, motions, forces = MOTIONS(*arguments, rows=len(self.wrench))
        return count, motions, forces

    def classified(self, accelerations: Floats) -> tuple[Floats, Floats, Integers, Integers]:
        """Accelerations (n, 6) of grains and (n, k, 3) of contacts, contact states (n, k), and modes (n,)."""
        normal, zero = self.contacts.normal_axis, ZERO * self.scale[:, None]
        if normal is not None:
            in_plane, accelerations = accelerations, np.zeros((len(normal), 6))
            accelerations[np.arange(len(normal))[:, None], IN_PLANE[normal]] = in_plane
        turning = accelerations[:, 3:] * (np.abs(accelerations[:, 3:]) > zero).any(axis=1)[:, None]
        whole = np.concatenate([accelerations[:, :3], turning], axis=1)
        whole *= (np.abs(whole) > zero).any(axis=1)[:, None]
        inward = self.contacts.inward
        at = (whole[:, None] @ self.contacts.columns)[:, 0].reshape(inward.shape)
        return whole, at, *states_and_modes(at, inward, whole[:, 3:], zero, zero)

    @cached_property
    def coulomb(self) -> CoulombLaw:
        gained, friction = self.inverse[0] @ self.columns[0], float(self.contacts.law.bounded[0])
        return CoulombLaw.of(self.columns[0].T @ gained, self.wrench[0] @ gained, friction)


def inverses(mass: Floats, inertia: Floats, reach: Floats) -> Floats:
    """Inverses (n, 6, 6) of unit mass and inertia (n, 3, 3) over mass (n,) and squared reach."""
    inverse = np.zeros((len(mass), 6, 6))
    inverse[:, [0, 1, 2], [0, 1, 2]] = 1.0
    inverse[:, 3:, 3:] = np.linalg.inv(inertia / (mass * reach**2)[:, None, None])
    return inverse


def inertia_faults(mass: Floats, inertia: Floats) -> dict[str, Booleans]:
    """Masks (n,) of cases with invalid mass (n,) or inertia (n, 3, 3), by fault."""
    finite = np.isfinite(inertia).all(axis=(1, 2))
    table = np.where(finite[:, None, None], inertia, np.eye(3))
    skew = np.abs(table - table.transpose(0, 2, 1)).max(axis=(1, 2))
    return {
        "mass is not positive; give the grain's mass": ~(np.isfinite(mass) & (mass > 0.0)),
        "inertia is not finite; give (3, 3) finite numbers about the centre of mass": ~finite,
        "inertia is not symmetric; give the inertia tensor about the centre of mass": skew
        > 1e-9 * np.abs(table).max(axis=(1, 2)),
        "inertia is not positive definite; give positive moments about every axis, also in 2-D": ~(
            np.linalg.eigvalsh(table)[:, 0] > 0.0
        ),
    }


def checked_inertia(mass: float, inertia: Floats) -> tuple[Floats, Floats]:
    """Mass (1,) and inertia (1, 3, 3); raises SceneError for invalid values."""
    table = np.array(inertia, dtype=float)
    if table.shape != (3, 3):
        raise SceneError(f"inertia has shape {table.shape}; give (3, 3) about the centre of mass")
    for fault, where in inertia_faults(np.array([mass]), table[None]).items():
        if where[0]:
            raise SceneError(fault.replace("mass is", f"mass {mass} is"))
    return np.array([mass]), table[None]


def incipient_motion(
    load: Load,
    contacts: Contacts,
    law: Law,
    mass: float,
    inertia: Floats,
) -> IncipientMotion:
    """Accelerations of a grain at rest under a load, at unilateral contacts with friction.

    With force N, T and acceleration A_N, A_T along inward normal and surface, each contact obeys
    Signorini's law (N and A_N are not negative, N A_N = 0) and Coulomb's (|T| <= friction N, with
    equality and T against A_T if that is not zero). `inertia` (3, 3) is about the centre of mass.
    Planar cases, whose normal is a principal axis of inertia, are enumerated completely; 3-D
    solutions are sought from several starts. Larger friction than 1e6 is computed as 1e6.

    Raises SceneError for negative friction and invalid mass or inertia, ConvergenceError if no
    solution converges.
    """
    known = checked_inertia(mass, inertia)
    return motion_of(ContactProblem.of(load, contacts, law, known[1][0]), *known)


def motion_of(
    problem: ContactProblem, mass: Floats, inertia: Floats, safety: SafetyFactor | None = None
) -> IncipientMotion:
    """Incipient motion of a single case of mass (1,) and inertia (1, 3, 3)."""
    case = ReleaseProblem.of(problem, inverses(mass, inertia, problem.reach), mass)
    accelerations, forces, complete = possible_motions(case, safety is None or safety.held)
    if len(accelerations) == 0:
        raise ConvergenceError(
            "incipient motion: no starting guess converged to accelerations and forces that obey Coulomb's law; "
            "vary friction or load a little"
        )
    family, kept = _families(case, accelerations, forces)
    unique = Uniqueness.ONLY if complete else Uniqueness.NOT_EXCLUDED
    if len(kept) > 1 or family:
        unique = Uniqueness.FAMILY if family else Uniqueness.SEVERAL
    solutions = tuple(_solution(case, accelerations[i], forces[i]) for i in kept)
    jams = can_jam(case.contacts) if safety is None else safety.jams
    return IncipientMotion(solutions, unique, jams)


def possible_motions(case: ReleaseProblem, may_rest: bool) -> tuple[Floats, Floats, bool]:
    """Accelerations (s, m) in order of energy, local forces (s, k, 3), and whether these are all."""
    law, scale, held = case.contacts.law, case.scale[0], None
    if may_rest or law.is_frictionless:
        free = _frictionless(case)
        if np.abs(free[0]).max() <= ZERO * scale:  # motion takes energy
            return np.zeros_like(free[0]), np.zeros_like(free[1]), True
        if law.is_frictionless:
            return *free, True
        held = forces_that_balance(case.contacts, 1.0)
    (count,), (motions,), (local,) = case.motions(MOST)
    if held is None and count == 0:
        kept = Case(
            case.columns[0], case.inverse[0], law.bounded[0], case.wrench[0], scale, motions, local
        )
        for solution in case.coulomb.solutions(np.zeros((1, local.shape[1]))):
            count = _keep(kept, solution, count)
    accelerations, forces = motions[:count, :-1], local.reshape(MOST, -1, 3)[:count]
    if held is not None:
        moves = np.abs(accelerations).max(axis=1, initial=0.0) > SAME * scale
        rest = np.zeros((1, accelerations.shape[1]))
        accelerations = np.concatenate([rest, accelerations[moves]])
        forces = np.concatenate([held / case.force_unit[0], forces[moves]])
    return accelerations, forces, case.contacts.normal_axis is not None


def _frictionless(case: ReleaseProblem) -> tuple[Floats, Floats]:
    root, columns = np.linalg.cholesky(case.inverse[0]), case.columns[0]
    _, pressures = balance(columns[:, ::3].T @ root, case.wrench[0] @ root)
    forces = np.zeros((1, len(pressures), 3))
    forces[0, :, 0] = pressures
    return (case.wrench + forces.reshape(1, -1) @ columns.T) @ case.inverse[0], forces


def _families(
    case: ReleaseProblem, accelerations: Floats, forces: Floats
) -> tuple[bool, list[int]]:
    """Whether there is a continuous family, and the solutions to keep: its ends."""
    law, moving = case.coulomb, [i for i in range(len(forces)) if accelerations[i].any()]
    if case.contacts.normal_axis is not None:
        pairs = [(i, j) for j in moving for i in moving if i < j]
        within = {
            i
            for pair in pairs
            if law.residual(forces[list(pair)].mean(axis=0)) <= NEARLY
            for i in pair
        }
        if len(moving) < len(forces):
            within |= {i for i in moving if _reaches_rest(case, accelerations[i])}
    else:
        within = {i for i in moving if law.friction > 0.0 and law.is_open(forces[i])}
    dropped = set(sorted(within)[1:-1])
    return bool(within), [i for i in range(len(forces)) if i not in dropped]


def _reaches_rest(case: ReleaseProblem, acceleration: Floats) -> bool:
    """Whether contact forces of a 2-D motion also balance the load: it may be arbitrarily slow."""
    at, zero = (acceleration @ case.columns[0]).reshape(-1, 3), ZERO * case.scale[0]
    slips = np.stack([at[:, 1] <= zero, at[:, 1] >= -zero], axis=1)
    edges = case.columns[0].reshape(3, -1, 3) @ case.contacts.generators[0, -2:].T
    admitted = edges[:, slips & (at[:, :1] <= zero)]
    balancing = admitted.shape[1] > 0
    return balancing and (
        factors_that_balance(admitted, case.wrench[0], admitted.shape[1]) is not None
    )


def _solution(case: ReleaseProblem, acceleration: Floats, forces: Floats) -> Solution:
    problem, unit = case.contacts, case.acceleration_unit[0]
    whole, at, kinds, modes = case.classified(acceleration[None])
    y = problem.within(whole[:, :, None])[0, :, 0]
    needed = case.wrench[0] - np.linalg.solve(case.inverse[0], y)

    local, unique = inner_forces(case, needed, kinds[0], at[0], forces)
    balance_missed = float(np.abs(needed + case.columns[0] @ local.ravel()).max())
    missed = max(balance_missed, case.coulomb.residual(local))
    states = list(ContactState)
    return Solution(
        acceleration=unit * whole[0, :3],
        angular_acceleration=unit / problem.reach[0] * whole[0, 3:],
        contact_forces=problem.forces(case.force_unit[0] * problem.law.project(local[None])[0]),
        contact_states=tuple(states[kinds[0, i]] for i in problem.copy.tolist()),
        mode=MODES[modes[0]],
        forces_unique=unique,
        residual=missed / max(1.0, float(np.abs(local).max())),
    )


def inner_forces(
    case: ReleaseProblem, wrench: Floats, kinds: Integers, at: Floats, forces: Floats
) -> tuple[Floats, bool]:
    """Local forces (k, 3) that balance a wrench (m,) in a motion, the shortest or deepest in the cones; and
    whether unique.
    """
    problem, slides, stays = case.contacts, np.flatnonzero(kinds == 2), np.flatnonzero(kinds < 2)
    spans = problem.generators[0]
    opposing = problem.law.edge(-at[None, :, 1:])[0, slides]
    units = np.concatenate([opposing, np.tile(spans, (len(stays), 1))])
    owners = np.concatenate([slides, np.repeat(stays, len(spans))])
    columns = (case.columns[0].reshape(len(wrench), -1, 3)[:, owners] * units).sum(axis=2)
    sizes = np.linalg.svd(columns, compute_uv=False) if len(owners) else np.ones(1)
    if len(owners) <= len(wrench) and sizes[-1] > 1e-10 * sizes[0]:  # independent columns
        return forces, True
    linear = len(owners) if problem.linear else len(slides)
    with suppress(ConvergenceError):
        factors = factors_that_balance(columns, wrench, linear)
        if factors is not None:
            forces = np.zeros_like(at)
            np.add.at(forces, owners, factors[:, None] * units)
    return forces, False


def states_and_modes(
    at: Floats, inward: Floats, turning: Floats, zero: Floats, slow: Floats
) -> tuple[Integers, Integers]:
    """Indices (n, k) in `ContactState` and (n,) in `MODES` from local motions and rotations (n, 3).

    zero, slow (n, 1): thresholds of motion, and of rotation about other axes.
    """
    across = turning[:, None] - (inward @ turning[:, :, None]) * inward
    spins = (np.abs(across) <= slow[:, :, None]).all(axis=(1, 2))
    turns, lifts = turning.any(axis=1), at[..., 0] > zero
    slides = ~lifts & (np.hypot(at[..., 1], at[..., 2]) > zero)
    kinds = np.where(lifts, 3, np.where(slides, 2, np.where(turns[:, None], 1, 0)))
    rests, rolls, slides, lifts = ((kinds == kind).any(axis=1) for kind in range(4))
    cases = (
        (rests, Mode.REST),
        (~turns & slides, Mode.SLIDING),
        (~turns, Mode.LIFTING),
        (~rolls & slides, Mode.PIVOTING_AND_SLIDING),
        (~rolls, Mode.LIFTING_AND_ROTATING),
        (slides, Mode.PIVOTING_AND_SLIDING_APART),
        (lifts, Mode.PIVOTING),
        (spins, Mode.SPINNING),
    )
    places = [MODES.index(mode) for _, mode in cases]
    modes = np.select([where for where, _ in cases], places, MODES.index(Mode.ROLLING))
    return kinds, modes


# Kernels compiled by numba (`kernels.Kernel`).


class Case(NamedTuple):
    """A case with motions (most, m + 1), the last entry the energy, and forces (most, 3k)."""

    columns: Floats
    inverse: Floats
    friction: float
    wrench: Floats
    scale: float
    motions: Floats
    forces: Floats


def motion_rows(
    columns: Floats, inverse: Floats, friction: Floats, wrench: Floats, most: int
) -> tuple[Integers, Floats, Floats]:
    """Number (n,) of motions of n cases, accelerations and energy (n, most, m + 1), local forces (n, most, 3k).

    columns (n, m, 3k): wrenches of unit local forces; inverse (n, m, m) of mass and inertia; wrench (n, m).
    """
    count, m, width = columns.shape
    reached = np.zeros(count, dtype=np.int64)
    motions, forces = np.zeros((count, most, m + 1)), np.zeros((count, most, width))
    for i in range(count):
        scale = length(inverse[i] @ wrench[i])
        case = Case(columns[i], inverse[i], friction[i], wrench[i], scale, motions[i], forces[i])
        if m == 3:
            reached[i] = _planar(case)
        else:
            reached[i] = _search(case)
    return reached, motions, forces


def _search(case: Case) -> int:
    width = case.columns.shape[1]
    gained = case.inverse @ case.columns
    gain, b = case.columns.T @ gained, case.wrench @ gained
    onto, offset = projected(gain, b)
    starts = np.zeros((width // 3 + 2, width))
    solutions = newton(onto, offset, 0.0, starts[:1], STEPS, STEPS)
    if len(solutions) > 0:
        way = b + gain @ solutions[0]
        for j in range(0, width, 3):
            _rub(solutions[0, j], way, case.friction, starts[1], j)
    for j in range(0, width, 3):
        _rub(abs(offset[j]), b, case.friction, starts[2 + j // 3], j)
    solutions = newton(onto, offset, case.friction, starts, STEPS, 3 * STEPS)
    count = 0
    for i in range(len(solutions)):
        count = _keep(case, solutions[i], count)
    return count


def _rub(pressure: float, way: Floats, friction: float, force: Floats, j: int) -> None:
    speed = max(math.hypot(way[j + 1], way[j + 2]), 1e-300)
    force[j] = pressure
    force[j + 1] = -friction * pressure * way[j + 1] / speed
    force[j + 2] = -friction * pressure * way[j + 2] / speed


def _keep(case: Case, force: Floats, count: int) -> int:
    whole, m = case.wrench.copy(), len(case.wrench)
    for i in range(m):
        whole[i] += dot(case.columns[i], force)
    acceleration = case.inverse @ whole
    energy = dot(acceleration, whole)
    for i in range(count):
        if largest(case.motions[i, :m] - acceleration) <= SAME * case.scale:
            return count
    most, place = len(case.motions), count
    while place > 0 and energy < case.motions[place - 1, m]:
        place -= 1
    if place == most:
        return count
    for i in range(min(count, most - 1), place, -1):
        case.motions[i], case.forces[i] = case.motions[i - 1], case.forces[i - 1]
    case.motions[place, :m], case.motions[place, m], case.forces[place] = (
        acceleration,
        energy,
        force,
    )
    return min(count + 1, most)


def _planar(case: Case) -> int:
    """Motions with forces on up to two edges of the cones, and as many contact accelerations that vanish."""
    k, count = case.columns.shape[1] // 3, 0
    cosine = 1.0 / math.hypot(1.0, case.friction)
    rows, edges = np.empty((2 * k, 3)), np.empty((2 * k, 3))  # of both tangential directions
    rows[:k], rows[k:] = case.columns[:, ::3].T, case.columns[:, 1::3].T
    edges[:k] = cosine * (rows[:k] + case.friction * rows[k:])
    edges[k:] = cosine * (rows[:k] - case.friction * rows[k:])
    gained, free = rows @ (edges @ case.inverse).T, rows @ (case.inverse @ case.wrench)
    count = _admit(case, gained, free, (0, 0.0, 0, 0.0), count)
    for p in range(2 * k):
        if abs(gained[p % k, p]) > NEARLY:
            factor = -free[p % k] / gained[p % k, p]
            count = _admit(case, gained, free, (p, factor, p, 0.0), count)
    for p in range(2 * k):
        for q in range(p + 1, 2 * k):
            i, j = p % k, q % k
            usual = k + i if i == j else j  # rolling, or closed at both
            last = usual + 1 if abs(_volume(gained, i, usual, p, q)) > NEARLY else 2 * k
            # Contacts on one line close together: any other acceleration may vanish too.
            for other in range(usual if last == usual + 1 else 0, last):
                size = gained[i, p] * gained[other, q] - gained[i, q] * gained[other, p]
                if abs(_volume(gained, i, other, p, q)) > NEARLY:
                    b = (gained[i, q] * free[other] - gained[other, q] * free[i]) / size
                    c = (gained[other, p] * free[i] - gained[i, p] * free[other]) / size
                    count = _admit(case, gained, free, (p, b, q, c), count)
    return count


def _volume(gained: Floats, i: int, j: int, p: int, q: int) -> float:
    """Determinant of the accelerations i, j by edges p, q, relative to their sizes."""
    first, second = gained[i, p] * gained[j, q], gained[i, q] * gained[j, p]
    return (first - second) / max(length(gained[i]) * length(gained[j]), 1e-300)


def _admit(
    case: Case, gained: Floats, free: Floats, factors: tuple[int, float, int, float], count: int
) -> int:
    """Keep the motion under forces on two edges if both laws hold.

    gained (2k, 2k): normal, then tangential accelerations of contacts by each edge; free (2k,).
    """
    p, b, q, c = factors
    if min(b, c) < -NEARLY:
        return count
    k, zero = len(free) // 2, NEARLY * case.scale
    for i in range(k):
        if free[i] + b * gained[i, p] + c * gained[i, q] < -zero:
            return count
    force, cosine = np.zeros(3 * k), 1.0 / math.hypot(1.0, case.friction)
    for edge, factor in ((p, b), (q, c)):
        i, side = edge % k, 1.0 if edge < k else -1.0
        opens = free[i] + b * gained[i, p] + c * gained[i, q]
        slips = free[k + i] + b * gained[k + i, p] + c * gained[k + i, q]
        if factor != 0.0 and (opens > zero or side * slips > zero):
            return count
        force[3 * i] += cosine * factor
        force[3 * i + 1] += side * case.friction * cosine * factor
    moves = length(case.inverse @ (case.wrench + case.columns @ force)) > zero
    return _keep(case, force, count) if moves else count


MOTIONS = Kernel(motion_rows)
