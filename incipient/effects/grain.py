"""What it changes to leave gravity on the grain or its contact with the bed out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import spatial
from ..planning.effects import Decision
from ..results.left_out import Omission
from .effect import Solved


def without_gravity(solved: Solved, decision: Decision) -> Iterator[Omission]:
    """The submerged weight over the load, where the scene leaves gravity out."""
    scene, force = solved.run.scene, solved.force
    if not decision.forced or scene.gravity is None or scene.grain is None or force is None:
        return
    excess = (scene.mass or 0.0) - scene.grain.volume
    change = excess * scene.gravity.acceleration * spatial(scene.gravity_direction)
    relative = float(np.linalg.norm(change)) / max(float(np.linalg.norm(force.flow)), 1e-300)
    how, remedy = "weight and buoyancy, exact", 'set effects.gravity = "auto"'
    yield Omission(decision.name, relative, how, False, remedy, change, np.zeros(3))


def without_contact(solved: Solved, decision: Decision) -> Iterator[Omission]:
    """The missing verdict, where the scene leaves contact out."""
    if decision.forced:
        yield Omission(decision.name, None, "without it there is no verdict", False)
