"""Grains on a bed and on one another: the force at a contact of two grains acts on both, equal and opposite.

The wrenches of B grains, one after another, have 6 B components; otherwise the problem is that of one grain.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from incipient.arrays import Booleans, Floats, Integers
from incipient.contact.acceleration import (
    MODES,
    ContactState,
    Mode,
    ReleaseProblem,
    inertia_faults,
    inverses,
    possible_motions,
    states_and_modes,
)
from incipient.contact.friction import FrictionCone, Law
from incipient.contact.problem import (
    TINY,
    ContactProblem,
    Load,
    contact_frames,
    require_outward,
    unit_wrenches,
)
from incipient.contact.safety import SafetyFactor, SafetyStatus, safety_of
from incipient.errors import ConvergenceError, SceneError
from incipient.geometry.contacts import Contacts, shares

BEYOND = 1e-3  # relative excess over the critical load at which the motion is computed


@dataclass(frozen=True, eq=False)
class Interface:
    """Contacts of a grain, with normals out of it, and another grain, or None: the bed."""

    grain: int
    other: int | None
    contacts: Contacts
    law: Law


@dataclass(frozen=True, eq=False)
class PileProblem(ContactProblem):
    """One case of B grains; `arms` are those of the first grain of each contact.

    `ends` (1, 6 B, k, 3): wrenches on all grains of unit local forces; `shear` (k, 3): units of
    local forces, in which all contacts have the largest coefficient of friction; `signs` (B, k): 1
    for the first grain of each contact, -1 for the other one.
    """

    ends: Floats
    shear: Floats
    signs: Floats

    @classmethod
    def of_grains(cls, loads: Sequence[Load], interfaces: Sequence[Interface]) -> "PileProblem":
        """Build the problem; raises SceneError."""
        tables = [face.contacts for face in interfaces]
        laws = [FrictionCone.of(face.law) for face in interfaces]
        counts, pairs = list(map(len, tables)), [(face.grain, face.other) for face in interfaces]
        numbers = [(law.bounded, law.cohesion) for law in laws]
        friction, cohesion = np.repeat(np.array(numbers, dtype=float), counts, axis=0).T
        grains, others = np.repeat(np.array(pairs, dtype=float), counts, axis=0).T  # NaN: the bed
        points = np.concatenate([table.points for table in tables])
        normals = np.concatenate([table.normals for table in tables])
        parts = [shares(table.points, table.normals, table.areas) for table in tables]
        pull = cohesion * np.concatenate(parts)
        # (B, k): 1 where the force acts on the grain, -1 where its opposite does.
        signs = np.array([1.0 * (grains == b) - (others == b) for b in range(len(loads))])
        arms = np.array([points - load.centre for load in loads])
        for number, (arm, sign) in enumerate(zip(arms, signs, strict=True)):
            if not sign.any():
                raise SceneError(f"pile: grain {number} has no contact; give one or leave it out")
            require_outward(arm[sign != 0.0], (sign[:, None] * normals)[sign != 0.0])
        reach = float((np.linalg.norm(arms, axis=2) * np.abs(signs)).max()) or 1.0
        frames = contact_frames(-normals[None], None)
        wrenches_of = unit_wrenches(
            arms / reach, np.broadcast_to(frames, (len(arms), *frames.shape[1:]))
        )
        ends = (wrenches_of * signs[:, None, :, None]).reshape(1, -1, *arms.shape[1:])
        units = np.array([1.0, 1.0, 1.0, reach, reach, reach])
        wrenches = np.concatenate([load.wrenches / units for load in loads], axis=1)[None]
        wrenches[0, 1] -= ends[0, :, :, 0] @ pull
        shear = np.ones((len(points), 3))
        shear[:, 1:] = (friction / (friction.max() or 1.0))[:, None]
        return cls(
            arms[signs.argmax(axis=0), np.arange(len(points))][None] / reach,
            -normals[None],
            np.array([reach]),
            wrenches,
            FrictionCone.of(float(friction.max())).rows(1),
            np.asarray(pull, dtype=float)[None],
            None,
            np.arange(len(points)),
            np.ones(len(points)),
            ends,
            shear,
            signs,
        )

    @property
    def basis(self) -> Floats:
        return self.ends * self.shear

    def forces(self, local: Floats) -> Floats:
        """Forces (k, 3) on the first grain of each contact."""
        return super().forces(local * self.shear)


@dataclass(frozen=True, eq=False)
class PileMotion:
    """Motion under weight and `factor` times the flow's load.

    `modes`: of each grain, "rest", "carried" or a label of `Mode`; accelerations (B, 3); contact
    forces (k, 3) act on the first grain of each contact. `several`: other motions are possible.
    """

    factor: float
    modes: tuple[str, ...]
    acceleration: Floats
    angular_acceleration: Floats
    contact_forces: Floats
    contact_states: tuple[ContactState, ...]
    several: bool


@dataclass(frozen=True, eq=False)
class PileVerdict:
    """Safety factor of the pile, with one multiple of the flow's loads on all grains, and its first motion.

    `motion` begins just above the safety factor, or is that under the actual load if the weights
    alone are not held; None if nothing moves, or if `unsolved`.
    """

    safety: SafetyFactor
    motion: PileMotion | None
    unsolved: str = ""

    @property
    def moves(self) -> bool:
        """Whether a grain begins to move under the actual load."""
        return not self.safety.held

    @property
    def first(self) -> tuple[int, ...]:
        """The grains that begin to move first."""
        modes = () if self.motion is None else self.motion.modes
        return tuple(b for b, mode in enumerate(modes) if mode != Mode.REST.label)


def judge_pile(
    loads: Sequence[Load],
    interfaces: Sequence[Interface],
    masses: Sequence[float],
    inertias: Sequence[Floats],
) -> PileVerdict:
    """Judge grains that rest on a bed and on one another; inertias (3, 3) are about their centres.

    Raises SceneError for a grain without contacts, invalid normals, friction, mass or inertia, and
    ConvergenceError if the safety factor is not solved.
    """
    mass, inertia = np.array(masses, dtype=float), np.array(inertias, dtype=float)
    for fault, where in inertia_faults(mass, inertia).items():
        if where.any():
            raise SceneError(f"pile: grain {int(where.argmax())}: {fault}")
    problem = PileProblem.of_grains(loads, interfaces)
    safety = safety_of(problem)
    factor = _factor_of_motion(safety)
    if math.isinf(factor) or (safety.held and factor == 1.0):
        return PileVerdict(safety, None)
    count, each = len(mass), np.arange(len(mass))
    inverse = np.zeros((count, 6, count, 6))
    inverse[each, :, each] = (
        inverses(mass, inertia, problem.reach) * (mass[0] / mass)[:, None, None]
    )
    size = (1, 6 * count, 6 * count)
    case = ReleaseProblem.of(problem, inverse.reshape(size), mass[:1], factor)
    try:
        return PileVerdict(safety, _motion(case, problem, factor))
    except ConvergenceError as error:
        return PileVerdict(safety, None, str(error))


def _factor_of_motion(safety: SafetyFactor) -> float:
    flow, weight = safety.problem.sizes[0]
    return {
        SafetyStatus.UNHELD: 1.0,
        SafetyStatus.HELD_BY_FLOW: 1.0,
        SafetyStatus.NO_FLOW: math.inf,
        SafetyStatus.NO_RESERVE: BEYOND * weight / max(flow, TINY),
    }.get(safety.status, (1.0 + BEYOND) * safety.value)


def _motion(case: ReleaseProblem, problem: PileProblem, factor: float) -> PileMotion:
    accelerations, forces, _ = possible_motions(case, False)
    if len(accelerations) == 0:
        raise ConvergenceError("which grain moves first: the accelerations did not converge")
    # Smaller accelerations, relative to the largest, are zero.
    zero = 1e-5 * np.abs(accelerations[:1]).max(axis=1, keepdims=True)
    first = np.where(np.abs(accelerations[0]) > zero[0], accelerations[0], 0.0).reshape(-1, 6)
    at = np.tensordot(first.ravel(), problem.ends, axes=(0, 1)).reshape(1, -1, 3)
    modes, kinds = zip(
        *(
            _mode(at, problem.inward, motion, sign != 0.0, zero)
            for motion, sign in zip(first, problem.signs, strict=True)
        ),
        strict=True,
    )
    states = tuple(ContactState)
    unit = case.acceleration_unit[0] * first
    return PileMotion(
        factor,
        modes,
        unit[:, :3],
        unit[:, 3:] / problem.reach,
        problem.forces(case.force_unit[0] * forces[0]),
        tuple(states[kinds[grain][k]] for k, grain in enumerate(problem.signs.argmax(axis=0))),
        len(accelerations) > 1,
    )


def _mode(
    at: Floats, inward: Floats, motion: Floats, mine: Booleans, zero: Floats
) -> tuple[str, Integers]:
    """Mode of a grain of acceleration (6,) and states (k,) from relative accelerations (1, k, 3) of contacts."""
    turning = motion[None, 3:]
    kinds = states_and_modes(at, inward, turning, zero, zero)[0][0]
    if not motion.any():
        return Mode.REST.label, kinds
    # Where a grain that does not turn carries another, that contact does not tell its motion.
    telling = mine & (turning.any() | (kinds > 0))
    if not telling.any():
        return "carried", kinds  # by its neighbours, without slip or rotation
    place = states_and_modes(at[:, telling], inward[:, telling], turning, zero, zero)[1][0]
    return MODES[place].label, kinds
