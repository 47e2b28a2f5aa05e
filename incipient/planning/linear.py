"""The method for the flow's linear systems, and why: decided from the scene."""

from dataclasses import dataclass

from .flow_setup import Setup
from .stabilisation import largest_peclet, upwinds

LOWEST_ORDER = 2
DEAR = "an LU factorisation in 3-D would take much time and memory"

# Peclet number |c| h/(2 k nu) of the largest cells up to which the block preconditioner converges without upwinding
# (docs/contribute/defaults.md).
RESOLVED = 25.0


@dataclass(frozen=True)
class Method:
    """The choice of the linear solver."""

    name: str  # one of `fluid.solvers.SOLVERS`, or "two-level"
    reason: str  # in words

    def text(self) -> str:
        """One line of the plan."""
        return f"linear systems by a {self.name} method: {self.reason}"


def method_of(setup: Setup, slow: bool, unsteady: bool) -> Method:
    """The method for a scene, and whether its flow is one of Stokes, or has a rate of change. Not collective."""
    scene = setup.scene
    if scene.gdim == 2:
        why = "in 2-D an LU factorisation takes little memory, and serves several iterations and time steps"
        return Method("direct", why)
    if slow and scene.time is None and setup.order.number > LOWEST_ORDER:
        why = "order 2 by a block preconditioner, then the higher order without a matrix: Stokes flow needs no more"
        return Method("two-level", why)
    if slow:
        return Method("block", f"{DEAR}; Stokes flow needs none")
    if unsteady:
        return Method("block", f"{DEAR}; time steps need none")
    if scene.is_empty_box:
        why = "the block preconditioner does not converge in a closed box"
        return Method("direct", f"{why}; an LU factorisation takes much time and memory")
    if upwinds(setup) and setup.is_averaged:
        return Method("block", "factors of the flow, of low rank, then those of its turbulence")
    if upwinds(setup):
        return Method("block", f"{DEAR}; with upwinding none is needed")
    if scene.time is None and largest_peclet(setup) <= RESOLVED:
        return Method("block", f"{DEAR}; the cells resolve the flow's convection")
    return Method(
        "direct",
        "the flow is not upwinded; an LU factorisation in 3-D takes much time and memory",
    )
