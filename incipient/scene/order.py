"""The order of the velocity where the scene leaves it open: what the program's own measurements recommend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from .model import SceneSections

AnyScene = TypeVar("AnyScene", bound=SceneSections)


@dataclass(frozen=True)
class Order:
    """The order of the velocity, and in words why it was chosen; no words where the scene gives it."""

    number: int
    reason: str = ""


def order_of(scene: SceneSections) -> Order:
    """The scene's own order, or the one to take (docs/numerics.md says by which measurements). Not collective."""
    asked = scene.numerics.order
    if asked != "auto":
        return Order(asked)
    if scene.gdim == 3 and scene.numerics.accuracy is None and scene.body is not None and creeps(scene):
        return Order(3, "in creeping flow in space it errs far less than order 2, from which it is found")
    if is_driven_box(scene):
        return Order(4, "in a driven box in space it errs far less than order 2 for the same time")
    if scene.gdim == 3:
        return Order(
            2, "the scene lies in space, where higher orders take long but for creeping flow past a grain"
        )
    if scene.body is not None and scene.body.moves:
        return Order(2, "the grain moves, and the mesh with it")
    if scene.numerics.accuracy is not None and not scene.is_turbulent:
        return Order(2, "a higher one is taken where it is expected to need fewer unknowns")
    return Order(3, "in the plane, where nothing moves, it errs far less than order 2 for the same time")


def is_driven_box(scene: SceneSections) -> bool:
    """Whether the scene is steady flow in a box in space that holds nothing. Not collective."""
    return scene.gdim == 3 and scene.time is None and scene.is_empty_box and scene.flow.kind != "still"


def creeps(scene: SceneSections) -> bool:
    """Whether the flow is steady and without inertia for certain. Not collective."""
    return scene.time is None and (not scene.fluid.inertia or scene.effects.inertia is False)


def with_order(scene: AnyScene, number: int) -> AnyScene:
    """The scene with a given order. Not collective."""
    return scene.model_copy(update={"numerics": scene.numerics.model_copy(update={"order": number})})
