"""Free surface; a rigid lid neglects a rise of Fr^2/2 of the depth (Bernoulli's equation)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from ...planning.effects import Decision
from ...results.left_out import Omission
from ...setup.setup import Setup
from ..effect import Solved
from ..run_part import Stage

if TYPE_CHECKING:
    from ...restart import Checkpoint
    from .part import MovingSurface


def moving_surface(setup: Setup, stage: Stage, kept: Checkpoint | None) -> MovingSurface | None:
    """The part of a free surface, or None. Collective."""
    if not setup.scene.has_surface:
        return None
    from .part import MovingSurface

    return MovingSurface(setup, stage)


def without_free_surface(solved: Solved, decision: Decision) -> Iterator[Omission]:
    """Rise of a surface by the pressure under a rigid lid, relative to the depth."""
    if decision.expected is None:
        return
    scene = solved.run.scene
    from .lid import rise_under_lid

    rise = rise_under_lid(solved.run) / Setup(scene).base_flow.depth
    may_be = scene.domain.kind == "box" or scene.flow.below_surface
    remedy = (
        'domain.top = "free-surface"' if may_be and not scene.is_averaged else "a deeper channel"
    )
    if rise > 1.0:
        how = f"the pressure under the lid is that of {rise:.2g} depths, as after an impulse"
        yield Omission(decision.name, None, how, True, remedy)
        return
    how = "of the depth, from the pressure under the lid over gravity"
    yield Omission(decision.name, rise, how, False, remedy)
