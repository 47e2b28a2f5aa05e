"""Motion in contact beside Siconos."""

from collections import Counter
from dataclasses import dataclass
from enum import Enum
from types import SimpleNamespace

import numpy as np
import pytest
from random_contacts import Case, motion_misses, random_case
from test_random_releases import followed

from incipient.body import contact_motion
from incipient.contact.acceleration import IncipientMotion, Uniqueness, incipient_motion
from incipient.contact.impulses import contact_impulses

# Incipient accelerations beside Siconos, which solves the same laws by methods of its own.
#
# Siconos (Acary et al., INRIA; Debian's python3-siconos) has solvers for the frictional contact problem
# v = W r + q, r in the friction cones, v and r obeying Signorini's and Coulomb's laws. With W = H M^-1 H^T the
# Delassus matrix and q = H M^-1 load that is the incipient problem, v the accelerations at the contacts. Two
# solvers are asked: nonsmooth Gauss-Seidel (NSGS) and the nonsmooth Newton method of Alart and Curnier (NSN_AC).
#
# Mechanics may allow several motions, of which Siconos gives one. Then:
#
# - it must be among ours (AGREED); contact forces may differ where they are not determined, so accelerations count;
# - if not, it must obey the laws, by the check of random_contacts.py, and ours must not claim to be complete: ours is
#   a FAMILY of which only the ends found are listed, or ANOTHER motion was found by Siconos and not by our search;
# - Siconos may give up (UNSOLVED), or call solved what does not obey the laws (WRONG).
#
# Whatever Siconos finds, every solution of ours is put to its own measure of error.
# Cost: a quarter of a minute.


numerics = pytest.importorskip("siconos.numerics")

FIRST, COUNT = 2_000_000, 1000
SAME = 1e-6  # accelerations nearer than this, relative to those without contacts, agree
LAWFUL = 1e-6  # how far the laws may be missed by what Siconos calls solved
TOLERANCE, ITERATIONS = 1e-11, 50_000


class Outcome(Enum):
    """What became of the comparison of one case."""

    AGREED = "agreed"
    FAMILY = "another member of a continuous family"
    ANOTHER = "another motion, not among ours"
    UNSOLVED = "Siconos did not solve it"
    WRONG = "Siconos called solved what does not obey the laws"


@dataclass(frozen=True, eq=False)
class Problem:
    """A frictional contact problem v = W r + q, as Siconos sees it."""

    gain: np.ndarray  # (3k, 3k): W
    free: np.ndarray  # (3k,): q
    friction: np.ndarray  # (k,)

    def posed(self):
        """Siconos's object."""
        return numerics.FrictionContactProblem(
            3, len(self.friction), np.asfortranarray(self.gain), self.free, self.friction
        )

    def solved(self, solver: str) -> np.ndarray | None:
        """The forces (3k,) that Siconos finds, None where it gives up."""
        options = numerics.SolverOptions(getattr(numerics, f"SICONOS_FRICTION_3D_{solver}"))
        options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = ITERATIONS
        options.dparam[numerics.SICONOS_DPARAM_TOL] = TOLERANCE
        local, velocity = np.zeros(len(self.free)), np.zeros(len(self.free))
        code = numerics.fc3d_driver(self.posed(), local, velocity, options)
        return local if code == 0 else None

    def error_of(self, local: np.ndarray) -> float:
        """Siconos's own measure of how far forces (3k,) are from a solution, relative to q."""
        options = numerics.SolverOptions(numerics.SICONOS_FRICTION_3D_NSGS)
        size = float(np.linalg.norm(self.free))
        return numerics.fc3d_compute_error(
            self.posed(), local.copy(), np.zeros_like(local), TOLERANCE, options, size
        )[1]


@dataclass(frozen=True, eq=False)
class Release:
    """A case at the instant of release: local `frames` (k, 3, 3), inward normal first."""

    case: Case
    frames: np.ndarray
    rows: np.ndarray  # (3k, 6): accelerations at the contacts by those of the grain
    inverse: np.ndarray  # (6, 6): of mass and inertia
    load: np.ndarray

    @classmethod
    def of(cls, case: Case) -> "Release":
        arms, inward = case.contacts.points - case.load.centre, -case.contacts.normals
        first = np.array([np.linalg.svd(normal[None])[2][1] for normal in inward])
        frames = np.stack([inward, first, np.cross(inward, first)], axis=1)
        rows = np.concatenate([frames, np.cross(arms[:, None], frames)], axis=2).reshape(-1, 6)
        inverse = np.zeros((6, 6))
        inverse[:3, :3], inverse[3:, 3:] = np.eye(3) / case.mass, np.linalg.inv(case.inertia)
        force = case.load.flow_force + case.load.weight
        return cls(case, frames, rows, inverse, np.concatenate([force, case.load.flow_couple]))

    @property
    def free(self) -> np.ndarray:
        """The acceleration without contacts, (6,)."""
        return self.inverse @ self.load

    @property
    def problem(self) -> Problem:
        friction = np.full(len(self.frames), self.case.friction)
        return Problem(self.rows @ self.inverse @ self.rows.T, self.rows @ self.free, friction)

    def local(self, forces: np.ndarray) -> np.ndarray:
        """Contact forces (k, 3) in the local frames, (3k,)."""
        return (self.frames @ forces[:, :, None]).ravel()


def compared(release: Release, ours: IncipientMotion, solver: str) -> Outcome:
    """What became of a case, by how far Siconos's acceleration is from the nearest of ours."""
    local = release.problem.solved(solver)
    if local is None:
        return Outcome.UNSOLVED
    acceleration = release.free + release.inverse @ (release.rows.T @ local)
    forces = (local.reshape(-1, 1, 3) @ release.frames)[:, 0]
    size = np.abs(release.free).max()
    near = min(
        np.abs(np.append(one.acceleration, one.angular_acceleration) - acceleration).max() / size
        for one in ours.solutions
    )
    if near <= SAME:
        return Outcome.AGREED
    theirs = SimpleNamespace(
        acceleration=acceleration[:3], angular_acceleration=acceleration[3:], contact_forces=forces
    )
    # Relative to the load: what has run away to enormous forces is small beside these.
    beyond = max(1.0, np.abs(forces).max() / np.abs(release.load).max())
    if beyond * motion_misses(release.case, theirs) > LAWFUL:
        return Outcome.WRONG
    assert ours.uniqueness is not Uniqueness.ONLY
    return Outcome.FAMILY if ours.uniqueness is Uniqueness.FAMILY else Outcome.ANOTHER


@pytest.mark.slow
def test_a_thousand_cases_beside_siconos():
    """`pytest -rP` shows what became of the cases, by solver."""
    outcomes, explained = {"NSGS": Counter(), "NSN_AC": Counter()}, 0
    for seed in range(FIRST, FIRST + COUNT):
        case = random_case(seed)
        release = Release.of(case)
        ours = incipient_motion(case.load, case.contacts, case.friction, case.mass, case.inertia)
        for solution in ours.solutions:
            assert release.problem.error_of(release.local(solution.contact_forces)) < 1e-8, seed
        compared_by = {solver: compared(release, ours, solver) for solver in outcomes}
        for solver, outcome in compared_by.items():
            outcomes[solver][outcome] += 1
        explained += bool({Outcome.AGREED, Outcome.FAMILY} & {*compared_by.values()})
    print(outcomes)
    assert explained >= 0.985 * COUNT
    for count in outcomes.values():
        assert count[Outcome.AGREED] >= 0.95 * COUNT
        assert count[Outcome.ANOTHER] <= 0.015 * COUNT
        assert count[Outcome.WRONG] <= 0.002 * COUNT


# The impulses at contacts over time steps beside Siconos's, which solves the same laws by methods of its own.
#
# The problems are those that random grains pose on random beds (test_random_releases.py): v = W r + q, r the
# impulses in the friction cones, v the velocities at the contacts at the end of the step. Friction may allow
# several impulses; then Siconos's own measure of error judges ours.


RELEASES = 40


def problems(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Problem, np.ndarray]]:
    """Some problems of each random release with contacts that press, and our impulses (k, 3)."""
    asked: list[tuple[Problem, np.ndarray]] = []

    def recorded(gain, free, friction):
        """The impulses, and the problem noted."""
        result = contact_impulses(gain, free, friction)
        if result.any():
            asked.append((Problem(gain.copy(), free.copy(), np.array(friction)), result.copy()))
        return result

    monkeypatch.setattr(contact_motion, "contact_impulses", recorded)
    kept = []
    for seed in range(RELEASES):
        asked.clear()
        followed(5000 + seed, seed % 5 != 0)
        kept.extend(asked[:: max(1, len(asked) // 10)])
    return kept


@pytest.mark.slow
def test_the_impulses_of_random_steps_beside_siconos(monkeypatch):
    """`pytest -rP` shows what became of the steps, and by how much velocities differ."""
    outcomes, differences = Counter(), []
    for problem, result in problems(monkeypatch):
        assert problem.error_of(result.ravel()) < 1e-8
        answers = map(problem.solved, ("NSGS", "NSN_AC"))
        theirs = next((local for local in answers if local is not None), None)
        if theirs is None:
            outcomes["not solved by Siconos"] += 1
            continue
        velocities = problem.gain @ (result.ravel() - theirs)
        differences.append(np.abs(velocities).max() / np.abs(problem.free).max())
        outcomes["agreed" if differences[-1] <= SAME else "another"] += 1
    print(outcomes, sorted(differences)[-5:])
    assert outcomes["agreed"] >= 0.99 * outcomes.total()
