"""The method for the flow's linear systems, and why: decided from the scene."""

from __future__ import annotations

from dataclasses import dataclass

from .flow_setup import Setup
from .stabilisation import largest_peclet, upwinds

LOWEST_ORDER = 2
FEW_CELLS = 5000  # up to which steady flow with eddies takes factors in space (docs/scaling.md)

# Peclet number |c| h/(2 k nu) of the largest cells up to which blocks do without upwinding (docs/scaling.md).
RESOLVED = 25.0


@dataclass(frozen=True)
class Method:
    """How the linear systems are solved.

    name:   one of `fluid.solvers.SOLVERS`, or "two-level"
    reason: in words
    """

    name: str
    reason: str

    def text(self) -> str:
        """One line of the plan."""
        return f"linear systems by a {self.name} method: {self.reason}"


def method_of(setup: Setup, slow: bool, unsteady: bool) -> Method:
    """The method for a scene, and whether its flow is one of Stokes, or has a rate of change. Not collective."""
    scene = setup.scene
    if scene.gdim == 2:
        return Method(
            "direct",
            "in two dimensions factors take little memory, and they serve for several iterations and time steps",
        )
    if slow and scene.time is None and setup.order.number > LOWEST_ORDER:
        return Method(
            "two-level",
            "order 2 by blocks, and from there the higher one without a matrix: Stokes flow needs no more",
        )
    dear = "in space factors would take much time and memory"
    if slow:
        return Method("block", f"{dear}; Stokes flow needs none")
    if unsteady and scene.is_turbulent:
        return Method(
            "direct", "steps in time with eddies were not tried otherwise; factors take much memory"
        )
    if unsteady:
        return Method("block", f"{dear}; steps in time need none")
    if scene.is_empty_box:
        return Method("direct", "in a closed box blocks do not converge; factors take much time and memory")
    if upwinds(setup) and scene.is_turbulent:
        return Method("block", f"{dear}; on {FEW_CELLS} cells or less, where they are faster, they are taken")
    if upwinds(setup):
        return Method("block", f"{dear}; upwinding makes them needless")
    if scene.time is None and largest_peclet(setup) <= RESOLVED:
        return Method("block", f"{dear}; cells are fine enough for the flow's convection")
    return Method("direct", "the flow is not upwinded; in space its factors take much time and memory")
