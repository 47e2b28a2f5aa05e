"""Discretisation and solution of a scene: order of the velocity, stabilisation, linear solver, tolerances.

The cell Reynolds number is P = V h/(k nu): mean speed V, size h of the largest cells, order k of the velocity.
Below a bound plain Taylor-Hood elements have smaller errors, above it those stabilised by `forms.terms.grad_div`
(docs/contribute/defaults.md). Steady 3-D flow is upwinded instead (`forms.terms.streamline_upwind`), which the block
preconditioner needs on coarse cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..scene import Scene
from ..setup.setup import Setup
from .effects import inertia


def by_order(second: float, third: float, fourth: float | None = None) -> dict[int, float]:
    """Values by the order of the velocity, linear in it unless a fourth is given."""
    return {2: second, 3: third, 4: 2.0 * third - second if fourth is None else fourth}


# Length, over the depth, of the zone in which a free surface comes in level; a cell at the least.
LEVEL = 0.25
# Largest cells by dimension and order of the velocity, over the domain's height; number along the shorter side of an
# empty box; the fewest there (docs/contribute/defaults.md).
FAR_CELL = {2: by_order(0.10, 0.15), 3: by_order(0.25, 0.45, 0.5)}
GRID_CELLS, FEWEST = {2: by_order(48, 32, 24), 3: by_order(16, 9, 6)}, {2: 4, 3: 2}

# Reynolds number of cells from which on convection is stabilised.
COARSE = 50.0
LOWEST_ORDER = 2
DEAR = "an LU factorisation in 3-D would take much time and memory"
# Peclet number |c| h/(2 k nu) of the largest cells up to which the block preconditioner converges without upwinding
# (docs/contribute/defaults.md).
RESOLVED = 5.0
# Tolerance of steady iterations without an error estimate: the error after Newton's method is then far less.
STEADY = 1e-6


def velocity_order(setup: Setup) -> tuple[int, str]:
    """The order of the velocity, and why it was chosen (docs/contribute/defaults.md); "" if given."""
    scene = setup.scene
    if scene.numerics.order != "auto":
        return scene.numerics.order, ""
    steady = scene.gdim == 3 and scene.time is None
    held = steady and scene.body is not None and scene.numerics.accuracy is None
    choices = (
        (
            held and not inertia(setup).present,
            3,
            "in creeping 3-D flow its error is far below that of order 2, from which it is computed",
        ),
        (
            steady and scene.is_empty_box and not scene.flow.at_rest,
            4,
            "in a driven 3-D box its error is far below that of order 2 for the same time",
        ),
        (
            scene.gdim == 3,
            2,
            "the scene is three-dimensional, where higher orders take long except in creeping flow past a grain",
        ),
        (scene.moves, 2, "the grain moves, and the mesh with it"),
        (
            True,
            3,
            "in 2-D, where nothing moves, its error is far below that of order 2 for the same time",
        ),
    )
    return next((number, why) for holds, number, why in choices if holds)


def order_of(scene: Scene) -> int:
    """The order of the velocity in a scene."""
    return velocity_order(Setup(scene))[0]


def with_order(scene: Scene, number: int) -> Scene:
    """The scene with a given order."""
    return scene.model_copy(
        update={"numerics": scene.numerics.model_copy(update={"order": number})}
    )


@dataclass(frozen=True)
class Stabilisation:
    """Whether convection is stabilised, why, and the Reynolds number of the largest cells (zero: no convection).

    `upwind`: by streamline upwinding, in cells with a Peclet number above one.
    """

    present: bool
    reason: str
    cell_reynolds: float
    upwind: bool = False


def stabilisation_of(setup: Setup, inert: bool, speed: float = 1.0) -> Stabilisation:
    """The stabilisation for a flow `speed` times the scene's; `inert`: whether it has inertia."""
    if not inert:
        return Stabilisation(False, "there is none", 0.0)
    scene, option, order = setup.scene, setup.scene.numerics.stabilisation, velocity_order(setup)[0]
    # Of the largest cells of a 2-D mesh, estimated without one.
    size = scene.numerics.mesh_size * far_cell(scene, order, 2)
    number = float(speed * setup.base_flow.mean_speed * size / (order * scene.viscosity))
    text = f"the Reynolds number of cells, V h/(k nu), is {number:.3g}"
    # Upwinding does harm in a box with a grid, and the block preconditioner does not converge.
    steady = scene.gdim == 3 and scene.time is None
    upwind = steady and option != "off" and (option == "on" or not scene.is_empty_box)
    # Where cells are so thin along walls, grad-div makes the flow alternate between them.
    thin = scene.is_averaged and setup.walls.is_resolved and scene.grain is None
    bound = f"{text}, {'above' if number > COARSE else 'not above'} {COARSE:g}"
    choices = (
        (upwind, True, f"streamline upwinding of steady 3-D flow; {text}"),
        (option != "auto", option == "on", f'numerics.stabilisation = "{option}"; {text}'),
        (thin, False, f"cells are stretched along walls; {text}"),
        (True, number > COARSE, bound),
    )
    present, reason = next((present, why) for holds, present, why in choices if holds)
    return Stabilisation(present, reason, number, upwind)


def far_cell(scene: Scene, order: int, gdim: int | None = None) -> float:
    """Size of the cells far from grain and bed for mesh_size = 1 [length], on average on the grid of an empty box."""
    smallest, gdim = min(scene.domain.sizes.values()), gdim or scene.gdim
    if scene.is_empty_box:
        # Boundary layers thin as Re^-1/2; the grading provides half of that.
        refined = max(1.0, (scene.fluid.reynolds / 1000.0) ** 0.25)
        return smallest / (GRID_CELLS[scene.gdim][order] * refined)
    size = FAR_CELL[gdim][order] * scene.domain.height
    return size if gdim == 2 else min(size, 0.5 * smallest)


def largest_peclet(setup: Setup) -> float:
    """|c| h/(2 k nu) of the largest cells of a 3-D scene in its fastest base flow."""
    order, base_flow, scene = velocity_order(setup)[0], setup.base_flow, setup.scene
    points = scene.domain.grid(9, 9, 9).T
    fastest = float(np.linalg.norm(base_flow.velocity(points, 0.0), axis=0).max())
    size = scene.numerics.mesh_size * far_cell(scene, order) / order
    return 0.5 * fastest * size / float(setup.scene.viscosity)


@dataclass(frozen=True)
class Method:
    """The choice of the linear solver."""

    name: str  # one of `fluid.solvers.SOLVERS`, or "two-level"
    reason: str  # in words


def method_of(setup: Setup, inert: bool, unsteady: bool, upwind: bool) -> Method:
    """The linear solver, for the effects and the stabilisation of a flow."""
    scene = setup.scene
    planar, steady = scene.gdim == 2, scene.time is None
    # Without upwinding, which only the scene can switch off there.
    plain = not planar and steady and scene.numerics.stabilisation == "off"
    choices = (
        (
            planar and scene.is_averaged and not unsteady,
            "direct",
            "LU factorisations of the flow and of its turbulence precondition GMRES for both",
        ),
        (
            planar,
            "direct",
            "in 2-D an LU factorisation takes little memory, and serves several iterations and time steps",
        ),
        (
            not inert and steady and velocity_order(setup)[0] > LOWEST_ORDER,
            "two-level",
            "order 2 by a block preconditioner, then the higher order without a matrix: Stokes flow needs no more",
        ),
        (not inert and not unsteady, "block", f"{DEAR}; Stokes flow needs none"),
        (unsteady, "block", f"{DEAR}; time steps need none"),
        (
            scene.is_empty_box,
            "direct",
            "the block preconditioner does not converge in a closed box; an LU factorisation takes much time and "
            "memory",
        ),
        (
            upwind and scene.is_averaged,
            "block",
            "factors of the flow, of low rank, then those of its turbulence",
        ),
        (upwind, "block", f"{DEAR}; with upwinding none is needed"),
        (
            plain and not scene.is_empty_box and largest_peclet(setup) <= RESOLVED,
            "block",
            f"{DEAR}; the cells resolve the flow's convection",
        ),
        (
            True,
            "direct",
            "the flow is not upwinded; an LU factorisation in 3-D takes much time and memory",
        ),
    )
    return next(Method(name, why) for holds, name, why in choices if holds)


def of_steady(option: float | Literal["auto"], two_levels: bool = False) -> float:
    """Tolerance of a steady flow, from `numerics.tolerance`; larger on two levels."""
    if option != "auto":
        return option
    # On two levels each Newton update is inexact, and the discretisation error of the loads is far larger.
    return 1e-5 if two_levels else STEADY


def of_turbulent(option: float | Literal["auto"], gdim: int) -> tuple[float, float]:
    """Tolerances of a steady turbulent flow and of its logarithms, from `numerics.tolerance`."""
    # Limiters of the k-omega model switch at single nodes.
    tolerance = 1e-4 if option == "auto" else option
    # In the wake of a sphere on a level bed at u* d/nu = 86 logarithms change by 1e-4 (root mean square) for ever, the
    # flow by 2e-5 and its loads, at changes of 4e-4, by 2e-5.
    return tolerance, (10.0 if gdim == 3 else 1.0) * tolerance
