"""Whether the cells are too coarse for the convection: decided from the scene, and measured on a flow.

The Reynolds number of a cell is P = V h/(k nu): V the scene's reference velocity, h the size of the largest cells, away
from everything, k the order of the velocity, nu the viscosity. Below the bound plain Taylor-Hood elements err
less, above it those stabilised by `forms.terms.grad_div`, if the plain ones have a solution at all
(docs/contribute/defaults.md).
Steady 3-D flow is upwinded instead, `forms.terms.streamline_upwind`: the block preconditioner needs that
where cells are coarse.
"""

from dataclasses import dataclass

import numpy as np

from .flow_setup import Setup

# Reynolds number of cells from which on convection is stabilised.
COARSE = 50.0
PLACES = 9  # in each direction, at which the base flow is sampled


@dataclass(frozen=True)
class Stabilisation:
    """Whether convection is stabilised, why, and the Reynolds number of the largest cells (zero: no convection).

    `upwind` says that it is by streamline upwinding, in cells with a Peclet number above one.
    """

    present: bool
    reason: str
    cell_reynolds: float
    upwind: bool = False

    def text(self) -> str:
        """One line for a reader."""
        return f"convection {'stabilised' if self.present else 'not stabilised'}: {self.reason}"


NO_CONVECTION = Stabilisation(False, "there is none", 0.0)


def stabilisation_of(setup: Setup, inertia: bool, speed: float = 1.0) -> Stabilisation:
    """Decide from the scene, its flow `speed` times as fast, and whether it has inertia. Not collective."""
    if not inertia:
        return NO_CONVECTION
    number, option = speed * cell_reynolds(setup), setup.scene.numerics.stabilisation
    reynolds_text = f"the Reynolds number of cells, V h/(k nu), is {number:.3g}"
    if upwinds(setup):
        return Stabilisation(
            True, f"streamline upwinding of steady 3-D flow; {reynolds_text}", number, True
        )
    if option == "auto" and _stretches_cells(setup):
        return Stabilisation(False, f"cells are stretched along walls; {reynolds_text}", number)
    if option != "auto":
        return Stabilisation(
            option == "on", f'numerics.stabilisation = "{option}"; {reynolds_text}', number
        )
    bound = f"{reynolds_text}, {'above' if number > COARSE else 'not above'} {COARSE:g}"
    return Stabilisation(number > COARSE, bound, number)


def _stretches_cells(setup: Setup) -> bool:
    """Whether cells are so thin along walls that grad-div makes the flow alternate from one to the next.

    In channels oscillations grow downstream until no flow converges; along boundary layers it is the pressure.
    """
    if not setup.is_averaged or not setup.walls.is_resolved:
        return False
    walls = setup.walls
    return walls.plane or (bool(walls.asked.profile) and setup.geometry.grain is None)


def upwinds(setup: Setup) -> bool:
    """Whether a flow with inertia is upwinded along its streamlines. Not collective.

    In a box with a grid that does harm, and the block preconditioner does not converge there.
    """
    scene = setup.scene
    option = scene.numerics.stabilisation
    return (
        scene.gdim == 3
        and scene.time is None
        and (option == "on" or (option == "auto" and not scene.is_empty_box))
    )


def cell_reynolds(setup: Setup) -> float:
    """V h/(k nu) of the largest cells, estimated without a mesh. Not collective."""
    cells, base_flow = setup.far_cells, setup.base_flow
    size = setup.scene.numerics.mesh_size * cells.largest
    return float(base_flow.mean_speed * size / (cells.order * base_flow.viscosity))


def largest_peclet(setup: Setup) -> float:
    """|c| h/(2 k nu) of the largest cells of a 3-D scene in its fastest base flow. Not collective."""
    cells, base_flow = setup.far_cells, setup.base_flow
    points = setup.geometry.domain.grid(PLACES, PLACES, PLACES).T
    fastest = float(np.linalg.norm(base_flow.velocity(points, 0.0), axis=0).max())
    size = setup.scene.numerics.mesh_size * cells.largest_in_space(cells.order) / cells.order
    return 0.5 * fastest * size / float(base_flow.viscosity)
