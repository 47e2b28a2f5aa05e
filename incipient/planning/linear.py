"""The method for the flow's linear systems, and why: decided from the scene."""

from __future__ import annotations

from dataclasses import dataclass

from ..scene import Scene
from .stabilisation import upwinds


@dataclass(frozen=True)
class Method:
    """How the linear systems are solved.

    name:   one of `fluid.solvers.SOLVERS`
    reason: in words
    """

    name: str
    reason: str

    def text(self) -> str:
        """One line of the plan."""
        return f"linear systems by a {self.name} method: {self.reason}"


def method_of(scene: Scene, slow: bool) -> Method:
    """The method for a scene, and whether its flow is one of Stokes, without inertia and rate. Not collective."""
    if scene.gdim == 3 and slow:
        return Method("block", "in space factors would take much time and memory; Stokes flow needs none")
    if upwinds(scene):
        return Method(
            "block", "in space factors would take much time and memory; upwinding makes them needless"
        )
    if scene.gdim == 3:
        return Method(
            "direct",
            "the flow is not upwinded or changes in time; in space its factors take much time and memory",
        )
    reason = (
        "in two dimensions factors take little memory, and they serve for several iterations and time steps"
    )
    return Method("direct", reason)
