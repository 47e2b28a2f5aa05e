"""The impulses at contacts over time steps beside Siconos's, which solves the same laws by methods of its own.

The problems are those that random grains pose on random beds (test_random_releases.py): v = W r + q, r the impulses in
the friction cones, v the velocities at the contacts at the end of the step. Friction may allow several impulses; then
Siconos's own measure of error judges ours.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np
import pytest
from test_random_releases import followed

from incipient.body import contact_motion
from incipient.contact.impulses import contact_impulses

numerics = pytest.importorskip("siconos.numerics")

RELEASES = 40
SAME = 1e-6  # velocities nearer than this, relative to those without contacts, agree
TOLERANCE, ITERATIONS = 1e-11, 50_000


@dataclass(frozen=True, eq=False)
class Problem:
    """What a step asks: velocities gained by impulses, velocities without any, coefficients; and our impulses."""

    gain: np.ndarray  # (3k, 3k)
    free: np.ndarray  # (3k,)
    friction: np.ndarray  # (k,)
    found: np.ndarray  # (k, 3)

    def posed(self):
        """Siconos's object."""
        return numerics.FrictionContactProblem(
            3, len(self.friction), np.asfortranarray(self.gain), self.free, self.friction
        )

    def solved(self) -> np.ndarray | None:
        """The velocities (3k,) that Siconos finds, None where it gives up."""
        for solver in ("NSGS", "NSN_AC"):
            options = numerics.SolverOptions(getattr(numerics, f"SICONOS_FRICTION_3D_{solver}"))
            options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = ITERATIONS
            options.dparam[numerics.SICONOS_DPARAM_TOL] = TOLERANCE
            local, velocity = np.zeros(len(self.free)), np.zeros(len(self.free))
            if numerics.fc3d_driver(self.posed(), local, velocity, options) == 0:
                return self.free + self.gain @ local
        return None

    def error(self) -> float:
        """Siconos's measure of how far our impulses are from a solution, relative to the free velocities."""
        local, size = self.found.ravel().copy(), float(np.linalg.norm(self.free))
        options = numerics.SolverOptions(numerics.SICONOS_FRICTION_3D_NSGS)
        return numerics.fc3d_compute_error(
            self.posed(), local, np.zeros_like(local), TOLERANCE, options, size
        )[1]


def problems(monkeypatch: pytest.MonkeyPatch) -> list[Problem]:
    """One problem with contacts that press from each of the random releases: the last."""
    asked: list[Problem] = []

    def recorded(gain, free, friction):
        """The impulses, and the problem noted."""
        found = contact_impulses(gain, free, friction)
        if found.any():
            asked.append(Problem(gain.copy(), free.copy(), np.array(friction), found.copy()))
        return found

    monkeypatch.setattr(contact_motion, "contact_impulses", recorded)
    kept = []
    for seed in range(RELEASES):
        asked.clear()
        followed(5000 + seed, seed % 5 != 0)
        kept.extend(asked[:: max(1, len(asked) // 10)])
    return kept


@pytest.mark.slow
def test_the_impulses_of_random_steps_beside_siconos(monkeypatch, capsys):
    outcomes, worst, wrong = Counter(), 0.0, 0.0
    for one in problems(monkeypatch):
        wrong = max(wrong, one.error())
        theirs = one.solved()
        if theirs is None:
            outcomes["not solved by Siconos"] += 1
            continue
        away = (
            np.abs(one.free + one.gain @ one.found.ravel() - theirs).max() / np.abs(one.free).max()
        )
        outcomes["agreed" if away <= SAME else "another"] += 1
        worst = max(worst, away if away <= SAME else 0.0)
    with capsys.disabled():
        print(
            f"\n{dict(outcomes)}, largest difference {worst:.1e}, error of ours by Siconos {wrong:.1e}"
        )
    assert wrong < 1e-8
    assert outcomes["agreed"] >= 0.99 * outcomes.total()
