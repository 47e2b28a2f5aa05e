"""The mesh that follows what moves: a grain, a free surface."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ..planning.effects import Decision, EffectName
from ..planning.flow_setup import Setup
from ..planning.numbers import Numbers
from ..planning.plan import Plan
from .effect import Effect

if TYPE_CHECKING:
    from ..fluid import FlowModel


class MovingMeshEffect(Effect):
    """The motion of the mesh; what moves it are parts of other effects."""

    name = EffectName.MOVING_MESH

    def decide(self, setup: Setup, numbers: Numbers) -> Decision:
        """Present with a grain that moves or a free surface."""
        scene = setup.scene
        there, forced = scene.moves or scene.has_surface, scene.effects.moving_mesh != "auto"
        return Decision(self.name, there, _reason(setup), forced)

    def terms(self, model: FlowModel, setup: Setup, plan: Plan, unsteady: bool) -> FlowModel:
        """The velocity of the mesh, which convection is relative to."""
        return replace(model, moving_mesh=unsteady)


def _reason(setup: Setup) -> str:
    scene = setup.scene
    if scene.has_surface and not scene.moves:
        return "the mesh rises and falls with the free surface"
    if not scene.moves:
        return "nothing moves"
    if scene.body is not None and scene.body.shape in ("disc", "sphere"):
        return f"the mesh follows the grain; it need not turn with a {scene.body.shape}"
    return "the mesh follows the grain"
