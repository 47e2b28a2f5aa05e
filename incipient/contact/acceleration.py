"""Incipient motion: the accelerations with which a grain at rest answers a load, under Coulomb's law.

In 2-D every motion is found by enumeration. An acceleration y of the grain opens contact i where N_i y > 0 and slides
on it where N_i y = 0, T_i y != 0; these planes cut space into cells in each of which the admissible forces are fixed:
the free acceleration, those that slide on one contact, and the lines where two contacts stay or one sticks. The ends of
continuous families are among the motions found, since they lie on lines. In 3-D Coulomb's equations (`impulses`) are
solved by Newton's method from several starts.
"""

import math
from dataclasses import dataclass, fields
from enum import Enum
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import lsq_linear, nnls

from incipient.arrays import Booleans, Floats, Integers
from incipient.contact.friction import INFINITE
from incipient.contact.impulses import (
    PATIENCE,
    STEPS,
    CoulombLaw,
    newton,
)
from incipient.contact.problem import ContactProblem, Kernel, Load
from incipient.contact.safety import (
    SafetyFactor,
    can_jam,
    dot,
    forces_that_balance,
    largest,
    length,
)
from incipient.errors import ConvergenceError, SceneError
from incipient.geometry.contacts import Contacts

ZERO = 1e-8  # accelerations below it, relative to the free one, are zero
SAME = 1e-7  # accelerations nearer than this, relative to the free one, are one solution
NEARLY = 1e-9  # of unit vectors: what counts as parallel, or as the boundary of a cell
NO_LOAD = 1e-12  # of flow and weight: a sum below it is no load
SYMMETRIC = 1e-9  # of the inertia's largest entry
SINGULAR = 1e-9  # singular values below it leave a family of solutions open
RANK = 1e-10  # singular values below it, relative to the largest, count as zero
LEAST_STEPS = 50  # of Newton's method for the smallest contact forces
MOST = 12  # solutions kept of a case, those of least energy
PARTS = 9  # of the friction, at which solutions are continued where none is found


class ContactState(Enum):
    """What the grain does at a contact, by its acceleration there: normal, tangential, and angular."""

    STICK = "stays where it is, and so does the whole grain"
    ROLL = "stays where it is while the grain turns"
    SLIDE = "keeps contact and accelerates along the surface"
    LIFT = "accelerates away from the surface"


class Mode(Enum):
    """What the whole grain begins to do.

    The definitions exclude one another and leave nothing out. With the states of all contacts, and the angular
    acceleration alpha of the grain:

    - REST: no acceleration at all.
    - Without alpha: SLIDING if any contact slides (others may lift), else all lift: LIFTING.
    - With alpha, no contact rolls: PIVOTING_AND_SLIDING if any contact slides, else LIFTING_AND_ROTATING.
    - With alpha, some contact rolls and another slides: PIVOTING_AND_SLIDING_APART.
    - With alpha, some contact rolls and none slides: PIVOTING if any contact lifts, SPINNING if none lifts and
      alpha is along the normals of all contacts, else ROLLING.

    At the instant of release rolling on a contact and pivoting about it are one motion; what tells them apart
    here is whether the grain keeps all its contacts or leaves some.
    """

    REST = "rest"
    SLIDING = "sliding: translation along at least one contact"
    LIFTING = "lifting: translation away from every contact"
    LIFTING_AND_ROTATING = "lifting off every contact and rotating"
    ROLLING = "rolling: every contact keeps its place while the grain turns"
    PIVOTING = "pivoting about the contacts that keep their place, lifting off the others"
    SPINNING = "spinning about the normal of its contacts, which keep their place"
    PIVOTING_AND_SLIDING = "turning and sliding at the same contacts, none keeps its place"
    PIVOTING_AND_SLIDING_APART = "pivoting about one contact while sliding on a different one"

    @property
    def moves(self) -> bool:
        """Whether the grain begins to move."""
        return self is not Mode.REST

    @property
    def label(self) -> str:
        """The name in words."""
        return self.name.lower().replace("_", " ")


MODES = tuple(Mode)


class Uniqueness(Enum):
    """Whether the acceleration given is the only one that mechanics allows."""

    ONLY = "the only solution"
    SEVERAL = "one of several solutions"
    FAMILY = "one of a continuous family of solutions"
    NOT_EXCLUDED = "no other solution was found; others are not excluded"


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
        plain = {item.name: getattr(self, item.name) for item in fields(self)}
        plain = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in plain.items()}
        states = [state.name for state in self.contact_states]
        return plain | {
            "mode": self.mode.name,
            "wording": self.mode.value,
            "contact_states": states,
        }


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


@dataclass(frozen=True, eq=False)
class AccelerationProblem:
    """A grain at the instant of its release, dimensionless: the load of length one, the grain's mass one.

    In 2-D wrenches and accelerations have m = 3 components, in 3-D 6.
    """

    contacts: ContactProblem
    columns: Floats  # (m, 3k): wrenches of unit local forces
    inverse: Floats  # (m, m), of mass and inertia
    wrench: Floats  # (m,), of length one, or zero
    friction: float
    # A force, and an acceleration, of one in the units of the load and the grain.
    force_unit: float
    acceleration_unit: float

    @classmethod
    def of(
        cls, load: Load, contacts: Contacts, friction: float, mass: float, inertia: Floats
    ) -> "AccelerationProblem":
        """The problem of a case, with friction of at most 1e6; raises SceneError as `incipient_motion` does."""
        table = checked_inertia(mass, inertia)
        problem = ContactProblem.of(load, contacts, min(friction, INFINITE), table)
        wrench, size = problem.wrench(1.0)
        left = float(np.linalg.norm(wrench))
        inverse = np.eye(6)
        inverse[3:, 3:] = np.linalg.inv(table / (mass * problem.reach**2))
        plane = np.eye(6) if problem.projection is None else problem.projection
        return cls(
            contacts=problem,
            columns=plane @ problem.columns,
            inverse=plane @ inverse @ plane.T,
            wrench=plane @ wrench / left if left > NO_LOAD else np.zeros(len(plane)),
            friction=0.0 if problem.cone.is_frictionless else problem.cone.coefficient,
            force_unit=size * left,
            acceleration_unit=size * left / mass,
        )

    @cached_property
    def scale(self) -> float:
        """Magnitude of the free acceleration."""
        return float(np.linalg.norm(self.inverse @ self.wrench))

    @cached_property
    def law(self) -> CoulombLaw:
        """Coulomb's law for forces (k, 3) and the local accelerations they give."""
        gained = self.inverse @ self.columns
        return CoulombLaw.of(self.columns.T @ gained, self.wrench @ gained, self.friction)

    def spatial(self, acceleration: Floats) -> Floats:
        """An acceleration (m,) as (6,)."""
        projection = self.contacts.projection
        return acceleration if projection is None else np.asarray(acceleration @ projection)


def checked_inertia(mass: float, inertia: Floats) -> Floats:
    """The inertia as an array (3, 3); raises SceneError on what is no mass or inertia."""
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


def is_inertia(mass: Floats, inertia: Floats) -> Booleans:
    """Which masses (n,) and inertias (n, 3, 3) `checked_inertia` accepts, (n,)."""
    finite = np.isfinite(mass) & (mass > 0.0) & np.isfinite(inertia).all(axis=(1, 2))
    table = np.where(finite[:, None, None], inertia, np.eye(3))
    skew = np.abs(table - table.transpose(0, 2, 1)).max(axis=(1, 2))
    right = finite & (skew <= SYMMETRIC * np.abs(table).max(axis=(1, 2)))
    return np.asarray(right & (np.linalg.eigvalsh(table)[:, 0] > 0.0))


def incipient_motion(
    load: Load,
    contacts: Contacts,
    friction: float,
    mass: float,
    inertia: Floats,
    safety: SafetyFactor | None = None,
) -> IncipientMotion:
    """The accelerations with which a grain at rest answers the load, at contacts that push and rub.

    At every contact, with N the force and A_N the acceleration along the inward normal, T and A_T tangential:
    N >= 0, A_N >= 0, N A_N = 0 (no contact pulls, nothing is penetrated), and |T| <= friction N, where A_T is
    not zero with equality and T against A_T. `inertia` (3, 3) about the centre of mass. Plane cases (the plane's
    normal has to be a principal axis of inertia) are enumerated completely, cases without friction have one
    solution; in 3-D solutions are sought from several starts. Infinite friction is computed as 1e6. `safety`: the
    safety factor of the same case, if it is known.

    Raises SceneError on negative friction, a mass that is not positive, an inertia that is not symmetric and
    positive definite, and ConvergenceError if no solution is found.
    """
    case = AccelerationProblem.of(load, contacts, friction, mass, inertia)
    accelerations, forces, complete = _motions(case, safety is None or safety.held)
    if len(accelerations) == 0:
        raise ConvergenceError(
            "incipient motion: no start led to accelerations and forces that obey Coulomb's law; "
            "vary friction or load a little"
        )
    family, kept = _families(case, accelerations, forces)
    unique = Uniqueness.ONLY if complete else Uniqueness.NOT_EXCLUDED
    if len(kept) > 1 or family:
        unique = Uniqueness.FAMILY if family else Uniqueness.SEVERAL
    solutions = tuple(_solution(case, accelerations[i], forces[i]) for i in kept)
    jams = can_jam(case.contacts) if safety is None else safety.jams
    return IncipientMotion(solutions, unique, jams)


def _motions(case: AccelerationProblem, may_rest: bool) -> tuple[Floats, Floats, bool]:
    """Accelerations and forces found, rest first if it is one of them, and whether these are all."""
    rest = np.zeros((1, len(case.wrench))), np.zeros((1, len(case.contacts), 3))
    motions, forces = _frictionless(case)
    if np.abs(motions).max() <= ZERO * case.scale:
        return *rest, True  # to move would take energy that the load does not have
    if case.friction == 0.0:
        return motions, forces, True
    held = forces_that_balance(case.contacts, case.spatial(case.wrench)) if may_rest else None
    row = case.columns[None], case.inverse[None], np.array([case.friction]), case.wrench[None]
    (count,), accelerations, local = MOTIONS(*row, MOST)
    motions, forces = (
        accelerations[0, :count, :-1],
        local[0, :count].reshape(count, *rest[1].shape[1:]),
    )
    if held is None and count == 0:
        more = case.law.solutions(rest[1][0])
        forces = next((reached for reached in more if len(reached)), forces)
        motions = (case.wrench + forces.reshape(len(forces), -1) @ case.columns.T) @ case.inverse
    if held is not None:
        moves = np.abs(motions).max(axis=1, initial=0.0) > SAME * case.scale
        motions = np.concatenate([rest[0], motions[moves]])
        forces = np.concatenate([held[None], forces[moves]])
    return motions, forces, len(case.wrench) == 3


def _frictionless(case: AccelerationProblem) -> tuple[Floats, Floats]:
    """The only motion without friction, (1, m), and its forces: the accelerations that enter no contact nearest to the
    free one, by non-negative least squares for the pressures."""
    root, forces = np.linalg.cholesky(case.inverse), np.zeros((1, len(case.contacts), 3))
    forces[0, :, 0] = _nonnegative(root.T @ case.columns[:, ::3], -root.T @ case.wrench)[0]
    return (case.wrench + forces[0].ravel() @ case.columns.T)[None] @ case.inverse, forces


def _nonnegative(columns: Floats, target: Floats) -> tuple[Floats, float]:
    """The factors >= 0 whose sum of columns is nearest to the target, and what that misses."""
    if columns.shape[1] == 0:
        return np.zeros(0), float(np.linalg.norm(target))
    try:
        factors = nnls(columns, target)[0]
    except RuntimeError:  # it cycles, which it rarely does
        factors = lsq_linear(columns, target, (0.0, np.inf), tol=1e-15).x
    return factors, float(np.linalg.norm(columns @ factors - target))


def _families(
    case: AccelerationProblem, accelerations: Floats, forces: Floats
) -> tuple[bool, list[int]]:
    """Whether there is a continuous family, and which solutions to keep: of a family its ends."""
    law, moving = case.law, [i for i in range(len(forces)) if accelerations[i].any()]
    if len(case.wrench) == 3:
        pairs = [(i, j) for j in moving for i in moving if i < j]
        mean = [law.residual((forces[i] + forces[j]) / 2) <= NEARLY for i, j in pairs]
        within = {i for pair, is_one in zip(pairs, mean, strict=True) if is_one for i in pair}
        if len(moving) < len(forces):
            within |= {i for i in moving if _reaches_rest(case, accelerations[i])}
    else:
        within = {i for i in moving if case.friction > 0.0 and _is_open(law, forces[i])}
    dropped = set(sorted(within)[1:-1])
    return bool(within), [i for i in range(len(forces)) if i not in dropped]


def _reaches_rest(case: AccelerationProblem, acceleration: Floats) -> bool:
    """Whether forces that a motion in 2-D admits also balance the load: it may then be as slow as one likes."""
    assert case.contacts.generators is not None
    at = (acceleration @ case.columns).reshape(-1, 3)
    edges = case.columns.reshape(3, -1, 3) @ case.contacts.generators[-2:].T
    zero = ZERO * case.scale
    slips = np.stack([at[:, 1] <= zero, at[:, 1] >= -zero], axis=1)
    return bool(_nonnegative(edges[:, slips & (at[:, :1] <= zero)], -case.wrench)[1] <= NEARLY)


def _is_open(law: CoulombLaw, local: Floats) -> bool:
    """Whether the equations at a solution leave a direction open in which accelerations change."""
    trial = (local.ravel() @ law.onto + law.offset).reshape(-1, 3)
    pressure = np.maximum(trial[:, 0], 0.0)
    shear = np.maximum(np.hypot(trial[:, 1], trial[:, 2]), 1e-300)
    kept = np.minimum(law.friction * pressure / shear, 1.0)
    along = trial[:, 1:] * ((kept < 1.0) / shear)[:, None]
    projection = np.zeros((len(trial), 3, 3))
    projection[:, 0, 0] = pressure > 0.0
    projection[:, 1:, 0] = along * law.friction
    projection[:, 1:, 1:] = np.eye(2) - along[:, :, None] * along[:, None]
    projection[:, 1:, 1:] *= kept[:, None, None]
    moved = projection @ law.onto.T.reshape(len(trial), 3, -1)
    derivative = np.eye(trial.size) - moved.reshape(trial.size, -1)
    if np.linalg.cond(derivative, 1) < 0.01 / SINGULAR:
        return False
    _, sizes, right = np.linalg.svd(derivative)
    ways = right[sizes <= SINGULAR * max(1.0, sizes[0])]
    return bool((np.abs(ways @ law.gain) > 1e3 * SINGULAR).any())


def _solution(case: AccelerationProblem, acceleration: Floats, forces: Floats) -> Solution:
    """A solution with its states, smallest forces and units."""
    problem = case.contacts
    whole = case.spatial(acceleration)[None].copy()
    at_contacts, kinds, modes = classify_motions(
        whole, problem.columns[None], np.array([case.scale]), problem.frames[None, :, 0]
    )
    y = whole[0] if problem.projection is None else problem.projection @ whole[0]
    needed = case.wrench - np.linalg.solve(case.inverse, y)
    local, unique = smallest_forces(case, needed, kinds[0], at_contacts[0])

    def missed(tried: Floats) -> float:
        """How far Newton's and Coulomb's laws are missed."""
        balance = np.abs(needed + case.columns @ tried.ravel()).max()
        return max(float(balance), case.law.residual(tried)) / max(1.0, float(np.abs(tried).max()))

    options = [forces] if local is None else [local, forces]
    misses = [missed(tried) for tried in options]
    best = 0 if misses[0] <= NEARLY else int(np.argmin(misses))
    local, unit = problem.cone.project(options[best]), case.acceleration_unit
    states = [list(ContactState)[kind] for kind in kinds[0]]
    return Solution(
        acceleration=unit * whole[0, :3],
        angular_acceleration=unit / problem.reach * whole[0, 3:],
        contact_forces=case.force_unit * problem.forces(local),
        contact_accelerations=unit * (at_contacts[0][:, None] @ problem.frames)[problem.copy, 0],
        contact_states=tuple(states[i] for i in problem.copy.tolist()),
        mode=MODES[modes[0]],
        forces_unique=unique,
        residual=misses[best],
    )


def classify_motions(
    accelerations: Floats, columns: Floats, scale: Floats, inward: Floats
) -> tuple[Floats, Integers, Integers]:
    """Local accelerations (n, k, 3) at contacts, places (n, k) in `ContactState`, and (n,) in `MODES`.

    accelerations: (n, 6), of which what counts as zero becomes zero; columns: (n, 6, 3k) wrenches of unit local forces
    scale: (n,) of the free acceleration; inward: (n, k, 3) normals
    """
    zero = ZERO * scale[:, None]
    accelerations[:, 3:] *= (np.abs(accelerations[:, 3:]) > zero).any(axis=1)[:, None]
    accelerations *= (np.abs(accelerations) > zero).any(axis=1)[:, None]
    at = (accelerations[:, None] @ columns)[:, 0].reshape(*inward.shape)
    return at, *states_and_modes(at, inward, accelerations[:, 3:], zero, zero)


def states_and_modes(
    at: Floats, inward: Floats, turning: Floats, zero: Floats, slow: Floats
) -> tuple[Integers, Integers]:
    """Places (n, k) in `ContactState` and (n,) in `MODES` by local motions (n, k, 3) at contacts and turning (n, 3).

    inward: (n, k, 3) normals; zero, slow: (n, 1), motions and turning about other axes up to which there is none
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


def smallest_forces(
    case: AccelerationProblem, wrench: Floats, kinds: Integers, at_contacts: Floats
) -> tuple[Floats | None, bool]:
    """The shortest local forces (k, 3) that balance a wrench (m,), and whether no others do; None: not found.

    Contacts that lift have none, those that slide only friction in full against the sliding. With G the wrenches of
    unit forces and P the projection on what is admissible, they are P(G^T v) for the v that minimises
    |P(G^T v)|^2 / 2 + wrench.v.
    """
    problem, slides, lifts = case.contacts, (kinds == 2)[:, None], (kinds == 3)[:, None]
    cosine, sine = problem.cone.scaling[:2]
    axes = 1 if case.friction == 0.0 else (3 if problem.plane is None else 2)

    def edge(shear: Floats) -> tuple[Floats, Floats]:
        """The unit forces (k, 3) on the edges of the cones along shears (k, 2), and the magnitudes (k, 1) of these."""
        size = np.maximum(np.hypot(shear[:, :1], shear[:, 1:]), 1e-300)
        return np.concatenate([np.full_like(size, cosine), sine * shear / size], axis=1), size

    opposing = edge(-at_contacts[:, 1:])[0]
    span = np.where(slides[:, None], 0.0, np.diag(np.arange(3.0) < axes))
    span[:, 0] = np.where(slides, opposing, span[:, 0])
    span[lifts[:, 0]] = 0.0
    rows = case.columns.reshape(len(wrench), -1, 3)
    columns = np.einsum("mkj,kaj->mka", rows, span).reshape(len(wrench), -1)
    factors, _, rank, _ = np.linalg.lstsq(columns, -wrench, rcond=RANK)
    if np.abs(columns @ factors + wrench).max() > NEARLY:
        return None, False
    local = (factors.reshape(-1, 1, 3) @ span)[:, 0]
    inside = np.where(slides[:, 0] | (axes == 1), local[:, 0], problem.cone.margin(local))
    unique = bool(rank == span.any(axis=2).sum())
    if unique or inside.min() >= -1e-13:
        return local, unique
    v = np.linalg.lstsq(columns.T, factors, rcond=RANK)[0]

    def projected(v: Floats) -> tuple[Floats, Floats, Floats, float]:
        """The forces P(G^T v), their second derivatives (k, 3, 3), what they miss, and the function minimised."""
        pulled = (v @ case.columns).reshape(-1, 3)
        unit, shear = edge(pulled[:, 1:])
        unit = np.where(slides, opposing, unit)
        size = np.maximum((unit * pulled).sum(axis=1, keepdims=True), 0.0)
        within = ~slides & (problem.cone.margin(pulled) >= 0.0)[:, None]
        across = unit[:, [0, 2, 1]] * [0.0, -1.0, 1.0] * np.sqrt(size / (shear * max(sine, 1e-300)))
        turning = across[:, :, None] * across[:, None] * ~slides[:, None]
        bent = unit[:, :, None] * unit[:, None] * (size > 0.0)[:, None] + turning
        bent = np.where(within[:, None], np.eye(3), bent) * ~lifts[:, None]
        forces = np.where(lifts, 0.0, np.where(within, pulled, size * unit))
        missed = wrench + case.columns @ forces.ravel()
        return forces, bent, missed, 0.5 * float((forces * forces).sum()) + float(wrench @ v)

    forces, bent, missed, value = projected(v)
    for _ in range(LEAST_STEPS):
        worst = np.abs(missed).max()
        if worst <= 1e-12 * max(1.0, np.abs(forces).max()):
            return forces, False
        curvature = np.einsum("mki,kij,nkj->mn", rows, bent, rows)
        change = np.linalg.solve(curvature + max(1e-3 * worst, 1e-13) * np.eye(len(v)), missed)
        for part in 0.5 ** np.arange(12):
            tried = projected(v - part * change)
            if tried[3] <= value + 1e-14 * abs(value):
                break
        v, (forces, bent, missed, value) = v - part * change, tried
    return None, False


# From here on kernels, which numba compiles (`problem.Kernel`).


class Case(NamedTuple):
    """One case, and the motions kept of it: motions (most, m + 1), the last entry the energy, and forces (most, 3k)."""

    columns: Floats
    inverse: Floats
    friction: float
    wrench: Floats
    motions: Floats
    forces: Floats


def motion_rows(
    columns: Floats, inverse: Floats, friction: Floats, wrench: Floats, most: int
) -> tuple[Integers, Floats, Floats]:
    """The motions of n cases other than rest: how many (n,), accelerations (n, most, m + 1), forces (n, most, 3k).

    columns: (n, m, 3k) wrenches of unit local forces; inverse: (n, m, m) of mass and inertia; wrench: (n, m). With
    m = 3 all, with m = 6 those found, in the order of energy, which is the last entry of the accelerations.
    """
    count, m, width = columns.shape
    reached = np.zeros(count, dtype=np.int64)
    motions, forces = np.zeros((count, most, m + 1)), np.zeros((count, most, width))
    for i in range(count):
        case = Case(columns[i], inverse[i], friction[i], wrench[i], motions[i], forces[i])
        if m == 3:
            reached[i] = _planar(case)
        else:
            reached[i] = _search(case)
    return reached, motions, forces


def _search(case: Case) -> int:
    """Motions by Newton's method from no force, sliding without friction, and each contact alone; returns how many."""
    width = case.columns.shape[1]
    gained = case.inverse @ case.columns
    gain, b = case.columns.T @ gained, case.wrench @ gained
    step, onto = np.empty(width), np.empty((width, width))
    for j in range(width):
        k = j - j % 3
        step[j] = 3.0 / (gain[k, k] + gain[k + 1, k + 1] + gain[k + 2, k + 2])
    for j in range(width):
        onto[j] = -gain[j] * step
        onto[j, j] += 1.0
    starts, offset = np.zeros((width // 3 + 2 + PARTS, width)), -step * b
    first = width // 3 + 2
    solutions = newton(onto, offset, 0.0, starts[:1], STEPS, STEPS)
    if len(solutions) > 0:
        way = b + gain @ solutions[0]
        for j in range(0, width, 3):
            _rub(solutions[0, j], way, case.friction, starts[1], j)
    for j in range(0, width, 3):
        _rub(abs(b[j]) * step[j], b, case.friction, starts[2 + j // 3], j)
    solutions = newton(onto, offset, case.friction, starts[:first], STEPS, STEPS)
    if len(solutions) == 0:
        path = starts[:1]
        for part in range(PARTS):
            friction = 0.1 * (part + 1) * case.friction
            reach = newton(onto, offset, friction, path, STEPS, STEPS)
            path = reach if len(reach) > 0 else path
            starts[first + part] = path[0]
        solutions = newton(onto, offset, case.friction, starts, STEPS, PATIENCE)
    count = 0
    for i in range(len(solutions)):
        count = _keep(case, solutions[i], count)
    return count


def _rub(pressure: float, way: Floats, friction: float, force: Floats, j: int) -> None:
    """Fill in, at the contact of entry j, a pressure with friction in full against an acceleration."""
    speed = max(math.hypot(way[j + 1], way[j + 2]), 1e-300)
    force[j] = pressure
    force[j + 1] = -friction * pressure * way[j + 1] / speed
    force[j + 2] = -friction * pressure * way[j + 2] / speed


def _keep(case: Case, force: Floats, count: int) -> int:
    """Put the motion under forces (3k,) among the `count` kept, in the order of energy, unless it is there."""
    whole, m = case.wrench.copy(), len(case.wrench)
    for i in range(m):
        whole[i] += dot(case.columns[i], force)
    acceleration = case.inverse @ whole
    energy, same = dot(acceleration, whole), SAME * length(case.inverse @ case.wrench)
    for i in range(count):
        if largest(case.motions[i, :m] - acceleration) <= same:
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
    """All motions other than rest of a case in 2-D; returns how many."""
    k, count = case.columns.shape[1] // 3, 0
    cosine = 1.0 / math.hypot(1.0, case.friction)
    normal, tangent = case.columns[:, ::3].T.copy(), case.columns[:, 1::3].T.copy()
    edges = np.empty((2 * k, 3))  # those toward the first tangent, then those against it
    edges[:k] = cosine * (normal + case.friction * tangent)
    edges[k:] = cosine * (normal - case.friction * tangent)
    free, along = case.inverse @ case.wrench, np.empty(3)
    zero = NEARLY * length(free)
    if _opens(normal, free, zero):
        count = _put(case, 0, 0.0, 0, 0.0, count)
    for e in range(2 * k):
        push = case.inverse @ edges[e]
        gained = dot(normal[e % k], push)
        if abs(gained) > NEARLY:
            factor = -dot(normal[e % k], free) / gained
            push *= factor
            push += free
            slip = dot(tangent[e % k], push) if e >= k else -dot(tangent[e % k], push)
            if factor >= 0.0 and slip >= -zero and _opens(normal, push, zero):
                count = _put(case, e, factor, e, 0.0, count)
    for i in range(k):
        for j in range(i, k):
            _cross(normal[i], tangent[i] if i == j else normal[j], along)
            size = length(along)
            for way in (1.0, -1.0):
                along *= way / max(size, NEARLY)
                size = 1.0
                if length(along) > 0.5 and _opens(normal, along, NEARLY):
                    count = _along(case, along, normal, tangent, edges, count)
    return count


def _opens(normal: Floats, y: Floats, zero: float) -> bool:
    """Whether an acceleration (3,) leads into no contact."""
    for i in range(len(normal)):  # noqa: SIM110 (numba has no generators here)
        if dot(normal[i], y) < -zero:
            return False
    return True


def _along(
    case: Case, along: Floats, normal: Floats, tangent: Floats, edges: Floats, count: int
) -> int:
    """Keep the motions a along, a > 0, at which contacts stay: a M along = wrench + b one edge + c another."""
    k, inertial = len(normal), along.copy()
    inertial[2] /= case.inverse[2, 2]
    both, turned, zero = np.empty(3), np.empty(3), NEARLY * length(case.inverse @ case.wrench)
    allowed = np.zeros(2 * k)
    for i in range(k):
        slip = dot(tangent[i], along)
        allowed[i] = dot(normal[i], along) <= NEARLY and slip <= NEARLY
        allowed[k + i] = dot(normal[i], along) <= NEARLY and slip >= -NEARLY
    for p in range(2 * k):
        for q in range(p + 1, 2 * k):
            if allowed[p] * allowed[q] == 0.0:
                continue
            _cross(edges[p], edges[q], both)
            volume, size = dot(both, inertial), dot(both, both)
            if abs(volume) <= NEARLY * length(inertial) * math.sqrt(size):
                continue
            a = dot(both, case.wrench) / volume
            left = a * inertial - case.wrench
            _cross(left, edges[q], turned)
            b = dot(turned, both) / size
            _cross(edges[p], left, turned)
            c = dot(turned, both) / size
            if a > zero and b >= -NEARLY and c >= -NEARLY:
                count = _put(case, p, b, q, c, count)
    return count


def _put(case: Case, p: int, b: float, q: int, c: float, count: int) -> int:
    """Keep the motion under forces on two edges."""
    force = np.zeros(case.columns.shape[1])
    k, cosine = len(force) // 3, 1.0 / math.hypot(1.0, case.friction)
    for edge, factor in ((p, b), (q, c)):
        force[3 * (edge % k)] += cosine * factor
        side = case.friction * (1.0 if edge < k else -1.0)
        force[3 * (edge % k) + 1] += side * cosine * factor
    return _keep(case, force, count)


def _cross(a: Floats, b: Floats, out: Floats) -> None:
    """Fill in the vector product."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


MOTIONS = Kernel(motion_rows)
