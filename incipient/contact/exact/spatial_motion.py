"""Incipient motions with circular friction cones: Coulomb's law as equations, solved by Newton's method.

Local contact forces f = (N, T) and accelerations A = (A_N, A_T) = D f + b of the grain at the contacts satisfy

    N = max(0, N - r A_N),     T = projection of T - r A_T on the disc of radius friction max(0, N - r A_N),

for any r > 0 (Alart and Curnier 1991): that is A_N >= 0, N >= 0, A_N N = 0, and friction that holds or opposes
the sliding in full. D = G^T mass^-1 G, b = G^T mass^-1 wrench. The equations are not convex, and Newton's
method may miss: it is then started from the convex problems whose fixed point Coulomb's law is
(`cones.associated`; Acary, Cadoux, Lemarechal and Malick 2011), and from random forces.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from incipient.arrays import Floats
from incipient.contact.exact import cones
from incipient.contact.exact.release import SAME, Candidate, Release
from incipient.contact.friction_law import FrictionLaw

STEPS = 14  # of Newton's method
PATIENCE = 300  # steps where the usual number did not do
FIXED_POINT_STEPS = 40
RANDOM_STARTS = 40
FEW = 12  # contacts up to which each is tried alone
SINGULAR = 1e-9  # singular values below it count as zero: several forces or accelerations near the one found


@dataclass(frozen=True, eq=False)
class Law:
    """Coulomb's law at the contacts."""

    compliance: Floats  # D (3k, 3k)
    free: Floats  # b (3k,)
    step: Floats  # r (k,)
    # (3k, 3k) and (3k,): f - r A is f onto + offset.
    onto: Floats
    offset: Floats
    friction: float


def coulomb(case: Release) -> Law:
    """The law at the contacts of a case, with r = 1 / mean diagonal of D at each contact."""
    step = 3.0 / case.compliance.diagonal().reshape(-1, 3).sum(axis=1)
    each = np.repeat(step, 3)
    onto = np.eye(len(each)) - case.compliance * each
    offset = -each * case.free_at_contacts
    return Law(
        case.compliance, case.free_at_contacts, step, onto, offset, case.grasp.law.coefficient
    )


def spatial_solutions(
    case: Release, law: Law, without_friction: Candidate, rest: bool
) -> list[Candidate]:
    """Solutions with different accelerations other than rest; `rest`: whether the load is held.

    From a few starts, and if none of them leads to a solution and the grain does not rest, from many more. Of
    a continuous family only those two found that accelerate least and most. Empty: none was found.
    """
    found: list[Candidate] = []
    for starts, steps in Search(case, law, without_friction).starts(rest):
        found = _different(case, newton(law, starts, steps), rest)
        if found or rest:
            break
    found = [replace(candidate, family=_is_family(law, candidate.local)) for candidate in found]
    found.sort(key=lambda candidate: case.energy(candidate.acceleration))
    within = [candidate for candidate in found if candidate.family]
    return [candidate for candidate in found if not candidate.family] + within[:1] + within[1:][-1:]


def _different(case: Release, forces: Floats, rest: bool) -> list[Candidate]:
    """One candidate for each of the different accelerations that forces (s, k, 3) give; none at `rest`."""
    pressed = forces.reshape(len(forces), 3 * len(case.grasp)) @ case.grasp.columns.T
    accelerations = (case.wrench + pressed) @ case.inverse
    left = np.arange(len(forces))
    if rest:
        left = left[np.abs(accelerations).max(axis=1) > SAME * case.scale]
    found = []
    while len(left):
        first = accelerations[left[0]]
        found.append(Candidate(first, forces[left[0]]))
        left = left[np.abs(accelerations[left] - first).max(axis=1) > SAME * case.scale]
    return found


@dataclass(frozen=True, eq=False)
class Search:
    """A case and the sets of forces (s, k, 3) from which Newton's method is started on it."""

    case: Release
    law: Law
    without_friction: Candidate

    def starts(self, rest: bool) -> Iterator[tuple[Floats, int]]:
        """Forces to start from: none, sliding without friction, one contact alone; then, with more patience, others.

        Each with the number of steps that Newton's method may take.
        """
        count = len(self.law.step)
        first = np.concatenate([np.zeros((1, count, 3)), self._sliding()[None], self._on_one()])
        yield first, STEPS
        if not rest:
            yield np.concatenate([first, self._growing()]), PATIENCE
            yield from ((starts, STEPS) for starts in self._fixed_point())
            random = np.random.default_rng(
                0
            )  # the same every time: an answer must not change between runs
            sizes = 10.0 ** random.uniform(-2.0, 1.0, (RANDOM_STARTS, 1, 1))
            yield sizes * random.normal(size=(RANDOM_STARTS, count, 3)), PATIENCE

    def _sliding(self) -> Floats:
        """The forces without friction, and full friction against the sliding there, (k, 3)."""
        way = self.case.at_contacts(self.without_friction.acceleration)
        return self._rubbed(self.without_friction.local[:, 0], way)

    def _on_one(self) -> Floats:
        """For each contact, if they are few, the force that would stop it and friction against it, (k, k, 3)."""
        total = len(self.law.step)
        some = np.arange(total if total <= FEW else 0)
        way = self.law.free.reshape(-1, 3)
        starts = np.zeros((len(some), total, 3))
        starts[some, some] = self._rubbed(np.abs(way[:, 0]) * self.law.step, way)[some]
        return starts

    def _rubbed(self, pressure: Floats, way: Floats) -> Floats:
        """Forces (k, 3) with friction in full against accelerations `way` (k, 3)."""
        size = np.maximum(np.hypot(way[:, 1], way[:, 2]), 1e-300)
        local = np.empty_like(way)
        local[:, 0] = pressure
        local[:, 1:] = (-self.law.friction * pressure / size)[:, None] * way[:, 1:]
        return local

    def _growing(self) -> Floats:
        """Forces at parts of the friction, each reached from the one before, the first from none: (s, k, 3)."""
        local = [self.without_friction.local]
        for part in np.linspace(0.1, 0.9, 9):
            local.extend(
                newton(replace(self.law, friction=part * self.law.friction), local[-1][None])
            )
        return np.array(local)

    def _fixed_point(self) -> Iterator[Floats]:
        """The forces (1, k, 3) of convex problems, each with the sliding of the one before."""
        held_by = self.case.grasp
        forces = cones.balance(held_by)
        rise = np.zeros(len(held_by))
        for _ in range(FIXED_POINT_STEPS):
            answer = cones.associated(forces, self.case.mass, self.case.wrench, rise)
            if answer is None:
                return
            yield (answer[1].reshape(-1, 3) * held_by.law.scaling)[None]
            way = self.case.at_contacts(answer[0])
            rise = held_by.law.scaling[1] * np.hypot(way[:, 1], way[:, 2])


def law_residual(law: Law, local: Floats) -> float:
    """How far forces (k, 3), with the accelerations they give, miss Coulomb's law as written above."""
    trial = (local.ravel() @ law.onto + law.offset).reshape(-1, 3)
    pressure = np.maximum(trial[:, 0], 0.0)
    held = FrictionLaw(law.friction).share(pressure, np.hypot(trial[:, 1], trial[:, 2]))
    projection = trial * held[:, None]
    projection[:, 0] = pressure
    return float(np.abs(local - projection).max())


def _is_family(law: Law, local: Floats) -> bool:
    """Whether the equations at a solution leave a direction open in which accelerations change."""
    from incipient.contact.exact import compiled  # as in `newton`

    derivative = compiled.coulomb_derivative(law.onto, law.offset, law.friction, local.ravel())
    if _certainly_regular(derivative):
        return False
    _, sizes, right = np.linalg.svd(derivative)
    open_ways = right[sizes <= SINGULAR * max(1.0, sizes[0])]
    return bool((np.abs(open_ways @ law.compliance) > 1e3 * SINGULAR).any())


def _certainly_regular(derivative: Floats) -> bool:
    """Whether the norms of a matrix and its inverse leave all singular values above those that count as zero."""
    try:
        inverse = np.linalg.inv(derivative).ravel()
    except np.linalg.LinAlgError:
        return False
    flat = derivative.ravel()
    return bool((inverse @ inverse) * max(1.0, flat @ flat) < (0.1 / SINGULAR) ** 2)


def newton(law: Law, starts: Floats, steps: int = STEPS) -> Floats:
    """The forces (s', k, 3) that solve the equations, by damped Newton steps from all starts (s, k, 3) at once.

    More than STEPS steps are made only if by then there is no solution.
    """
    from incipient.contact.exact import (
        compiled,
    )  # numba takes time to import, and most cases do without

    flat = starts.reshape(len(starts), -1)
    forces = compiled.coulomb_forces(law.onto, law.offset, law.friction, flat, STEPS, steps)
    return np.asarray(forces).reshape(-1, *starts.shape[1:])
