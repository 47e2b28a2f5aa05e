"""Interface of a physical effect for planning, runs and results."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..planning.effects import Decision, EffectName
from ..planning.plan import Plan
from ..results.left_out import Omission
from ..results.loads import Forces, Torques
from ..results.quantity import OutputQuantity
from ..setup.setup import Setup
from .run_part import RunPart, Solving, Stage

if TYPE_CHECKING:
    from ..fluid import FlowModel
    from ..restart.checkpoint import Checkpoint


@dataclass(frozen=True, eq=False)
class Solved:
    """Computed flow with omitted effects; loads and verdict may be missing."""

    run: Solving
    force: Forces | None
    torque: Torques | None
    verdict: dict[str, Any] | None


@dataclass(frozen=True)
class Effect:
    """What one physical effect adds to a run, by default nothing; `planning.effects` decides on it.

    quantities:   output quantities of a run with the effect
    terms:        the flow model with the effect's terms, of the unsteady flow or its steady start
    part_in_time: unknowns that move the mesh of an unsteady flow, from the start or a checkpoint, or None; collective
    left_out:     estimated changes by the omitted effect; collective
    """

    name: EffectName
    quantities: tuple[OutputQuantity, ...] = ()
    terms: Callable[[FlowModel, Setup, Plan, bool], FlowModel] = lambda model, *others: model
    part_in_time: Callable[[Setup, Stage, Checkpoint | None], RunPart | None] = lambda *others: None
    left_out: Callable[[Solved, Decision], Iterator[Omission]] = lambda *others: iter(())
