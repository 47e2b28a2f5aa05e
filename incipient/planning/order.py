"""The order of the velocity where the scene leaves it open: what the program's own measurements recommend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..scene import Scene

if TYPE_CHECKING:
    from .flow_setup import Setup


@dataclass(frozen=True)
class VelocityOrder:
    """The order of the velocity, and in words why it was chosen; no words where the scene gives it."""

    number: int
    reason: str = ""


def velocity_order(setup: Setup) -> VelocityOrder:
    """The scene's own order, or the best in measurements (docs/contribute/defaults.md). Not collective."""
    scene = setup.scene
    order, steady = scene.numerics.order, scene.time is None
    if order != "auto":
        return VelocityOrder(order)
    if scene.gdim == 3:
        past_grain = steady and scene.numerics.accuracy is None and scene.body is not None
        if past_grain and not setup.inertia.present:
            why = "in creeping 3-D flow its error is far below that of order 2, from which it is computed"
            return VelocityOrder(3, why)
        if steady and scene.is_empty_box and scene.flow.kind != "still":
            why = "in a driven 3-D box its error is far below that of order 2 for the same time"
            return VelocityOrder(4, why)
        why = "the scene is three-dimensional, where higher orders take long except in creeping flow past a grain"
        return VelocityOrder(2, why)
    if scene.moves:
        return VelocityOrder(2, "the grain moves, and the mesh with it")
    if scene.numerics.accuracy is not None and not scene.is_averaged:
        return VelocityOrder(2, "a higher one is taken where it is expected to need fewer unknowns")
    why = "in 2-D, where nothing moves, its error is far below that of order 2 for the same time"
    return VelocityOrder(3, why)


def with_order(scene: Scene, number: int) -> Scene:
    """The scene with a given order. Not collective."""
    return scene.model_copy(
        update={"numerics": scene.numerics.model_copy(update={"order": number})}
    )
