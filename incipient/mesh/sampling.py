"""Location of points in the cells of a mesh, values of fields there, and extrema along lines, on any ranks.

Reference coordinates alone decide, by Newton's method in curved cells: a neighbour is never taken for the right cell.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import dolfinx
import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from .. import compat
from ..arrays import Floats, Integers
from ..geometry.triangles import tree
from .domain import shape_functions, with_first

if TYPE_CHECKING:
    from ..fluid import Fluid
    from ..scene import Domain

# Barycentric coordinates down to this count as inside.
INSIDE = -1e-9
POINTS = 20_000  # dealt with at a time, which limits the memory taken
NEAR = 32  # candidates for the nearest cell, by the distance of their centres


@dataclass(frozen=True)
class Places:
    """Cells of one rank that hold points, or are nearest to them.

    cells:     (n,) local numbers, -1: none
    reference: (n, gdim) coordinates in the reference cell, outside of it where the cell does not hold the point
    distances: (n,) from the cell, zero inside, infinite without a cell; in skew cells somewhat too large
    """

    cells: Integers
    reference: Floats
    distances: Floats

    @property
    def located(self) -> NDArray[np.bool_]:
        return self.cells >= 0

    def at(self, rows: Any) -> Places:
        return Places(self.cells[rows], self.reference[rows], self.distances[rows])

    def within(self, reach: float) -> Places:
        """The places, those farther out of their cells in barycentric coordinates moved to near points of these."""
        coordinates = with_first(self.reference)
        far = coordinates.min(axis=1) < -reach
        near = np.where(far[:, None], _clipped(coordinates)[:, 1:], self.reference)
        return replace(self, reference=near)


class Locator:
    """Finds points in the cells that this rank owns, simplices of any order, on the present mesh."""

    def __init__(self, mesh: Any):
        self.gdim = int(mesh.geometry.dim)
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        self._nodes: Floats = mesh.geometry.x[compat.geometry_dofs(mesh)[:owned], : self.gdim]
        self._element = shape_functions(mesh)
        vertices = self._nodes[:, : self.gdim + 1]
        self._origins = vertices[:, 0]
        self._inverses = _inverses((vertices[:, 1:] - vertices[:, :1]).transpose(0, 2, 1))
        self._middles = vertices.mean(axis=1)
        slopes = np.concatenate(
            [-self._inverses.sum(axis=1, keepdims=True), self._inverses], axis=1
        )
        products = slopes @ slopes.transpose(0, 2, 1)
        # How barycentric coordinates change on the way straight to the face where one of them vanishes.
        self._ways = products / np.einsum("cii->ci", products)[..., None]
        # By how much coordinates of points of a curved cell are off those of a straight one, with 3.1 for the Lebesgue
        # constant of equispaced nodes: 3.02 of order three in tetrahedra.
        coordinates = self._straight(self._nodes, np.arange(len(self._nodes))[:, None])
        bends = np.abs(coordinates - with_first(self._element.points)).max(axis=(1, 2)) * 3.1
        self._least = 10 * INSIDE - bends
        radii = np.linalg.norm(vertices - self._middles[:, None], axis=2).max(axis=1)
        self._radii = (1.0 + (self.gdim + 1) * bends) * radii

    def inside(self, points: Floats) -> Places:
        """A cell that holds each of the points (n, at least gdim)."""
        return self._in_parts(points, self._inside)

    def nearest(self, points: Floats) -> Places:
        """The cell nearest to each of the points (n, at least gdim), assumed outside of all cells.

        Among the `NEAR` cells with the nearest centres. Where the cell's map has no inverse, a near point of the cell
        counts.
        """
        return self._in_parts(points, self._nearest)

    def _in_parts(self, points: Floats, look: Callable[[Floats], Places]) -> Places:
        points = np.asarray(points, dtype=float)[:, : self.gdim]
        parts = [look(points[k : k + POINTS]) for k in range(0, max(len(points), 1), POINTS)]
        fields = [vars(part).values() for part in parts]
        return Places(*map(np.concatenate, zip(*fields, strict=True)))

    def _inside(self, points: Floats) -> Places:
        low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
        reach = self._radii[:, None] * (1 - 10 * INSIDE)
        near = np.flatnonzero(
            ((self._middles + reach >= low) & (self._middles - reach <= high)).all(axis=1)
        )
        held = tree(points).query_ball_point(
            self._middles[near], reach[near, 0], return_sorted=False
        )
        rows = np.concatenate([np.empty(0), *held]).astype(np.int64)
        cells = np.repeat(near, [len(some) for some in held])
        kept = (self._straight(points[rows], cells) >= self._least[cells, None]).all(axis=1)
        places = self._best(points, rows[kept], cells[kept])
        out = places.distances > 0.0
        places.cells[out], places.distances[out] = -1, np.inf
        return places

    @cached_property
    def _tree(self) -> Any:
        return tree(self._middles)

    def _nearest(self, points: Floats) -> Places:
        count = min(NEAR, len(self._nodes))
        cells = self._tree.query(points, [*range(1, count + 1)])[1] if count else np.empty(0, int)
        return self._best(points, np.repeat(np.arange(len(points)), count), cells.ravel())

    def _best(self, points: Floats, rows: Integers, cells: Integers) -> Places:
        """Of pairs of points and cells the nearest cell of each point, of several the one that is left least."""
        targets, count = points[rows], len(points)
        start = np.nan_to_num(self._straight(targets, cells))
        reference, good = self._pulled_back(targets, cells, start[:, 1:])
        coordinates = np.where(good[:, None], with_first(reference), _clipped(start))
        # Straight to the face that the point is farthest beyond, then towards the middle.
        face = coordinates.argmin(axis=1)
        depths = coordinates[np.arange(len(rows)), face]
        near = _clipped(coordinates - np.minimum(depths, 0.0)[:, None] * self._ways[cells, face])
        outside = np.maximum(-depths, 0.0) * self._radii[cells]
        distances = np.linalg.norm(self._mapped(near[:, 1:], cells) - targets, axis=1)
        # Of cells as near that wins outside of which the point lies least; distances from flat cells are NaN.
        distances = np.nan_to_num(distances + 1e-12 * outside, nan=np.inf)
        distances[good & (depths >= INSIDE)] = 0.0
        order = np.lexsort((depths, -distances))  # so that the nearest is written last
        places = Places(np.full(count, -1), np.zeros((count, self.gdim)), np.full(count, np.inf))
        for kept, values in zip(
            vars(places).values(), (cells, coordinates[:, 1:], distances), strict=True
        ):
            kept[rows[order]] = values[order]
        return places

    def _straight(self, points: Floats, cells: Integers) -> Floats:
        return with_first(
            np.einsum("...kg,...g->...k", self._inverses[cells], points - self._origins[cells])
        )

    def _mapped(self, reference: Floats, cells: Integers) -> Floats:
        table = self._element.tabulate(0, reference)[0, :, :, 0]
        return np.asarray(np.einsum("pn,png->pg", table, self._nodes[cells]))

    def _pulled_back(
        self, points: Floats, cells: Integers, start: Floats
    ) -> tuple[Floats, NDArray[np.bool_]]:
        reference, good = start.copy(), np.ones(len(points), dtype=bool)
        if self._element.degree == 1:
            return reference, good
        left = np.arange(len(points))
        for _ in range(30 if len(points) else 0):
            table = self._element.tabulate(1, reference[left])[..., 0].transpose(1, 0, 2)
            table = table @ self._nodes[cells[left]]
            jacobians, misfit = table[:, 1:].transpose(0, 2, 1), table[:, 0] - points[left]
            steps = np.einsum("pkg,pg->pk", _inverses(jacobians), misfit)
            lengths = np.linalg.norm(steps, axis=1)
            # No step longer than the cell: far out the map may bend back.
            reference[left] -= steps / np.maximum(lengths, 1.0)[:, None]
            left = left[~(lengths < 1e-9)]
            if not len(left):
                break
        good = np.isfinite(reference).all(axis=1)
        good[left] = False
        return reference, good


class Samples:
    """Values at points that every rank knows, by the rank whose cell is nearest. Every method is collective.

    Args:
        places: this rank's places of the points, as of a `Locator`.

    Attributes:
        distances: (n,) from the nearest rank's cell, infinite where there is none.
    """

    def __init__(self, comm: MPI.Comm, places: Places):
        of_ranks = np.array(comm.allgather(places.distances))
        self.distances, self._comm = of_ranks.min(axis=0), comm
        self._rows = np.flatnonzero((of_ranks.argmin(axis=0) == comm.rank) & places.located)
        self._places = places.at(self._rows)

    def values(self, function: Any) -> Floats:
        """Values (n, components) of a scalar or vector function with ghosts up to date; NaN without a cell."""
        values = np.zeros((len(self.distances), function.function_space.dofmap.index_map_bs))
        values[self._rows] = evaluate(function, self._places)
        self._comm.Allreduce(MPI.IN_PLACE, values)
        values[np.isinf(self.distances)] = np.nan
        return values


def sample(function: Any, points: np.ndarray) -> np.ndarray:
    """Values (n, components) of a dolfinx function at points (n, gdim or 3), on every rank. Collective.

    NaN outside the mesh.
    """
    mesh = function.function_space.mesh
    return Samples(mesh.comm, Locator(mesh).inside(points)).values(function)


@dataclass(frozen=True)
class Extremum:
    """An extreme value and its coordinate along the line."""

    value: float
    position: float


def extremum(
    function: Any,
    component: int,
    line: Callable[[np.ndarray], np.ndarray],
    between: Sequence[float],
    sign: int,
) -> Extremum:
    """Largest (sign = 1) or smallest (sign = -1) value of a component along a line. Collective.

    `line` maps parameters (n,) to points (n, gdim); the best of 400 samples is refined three times.
    """
    low, high = between
    for _ in range(4):
        s = np.linspace(low, high, 401)
        values = sample(function, line(s))[:, component]
        best = int(np.nanargmax(sign * values))
        low, high = s[max(best - 1, 0)], s[min(best + 1, 400)]
    return Extremum(float(values[best]), float(s[best]))


def cells_between(mesh: Any, start: Sequence[float], end: Sequence[float]) -> int:
    """Number of cells that a straight line crosses. Collective."""
    s = np.linspace(0.0, 1.0, 201)[:, None]
    points = (1 - s) * np.asarray(start) + s * np.asarray(end)
    places = Locator(mesh).inside(points)
    return int(mesh.comm.allreduce(len(np.unique(places.cells[places.located]))))


def centrelines(domain: Domain, fluid: Fluid) -> dict[str, Extremum]:
    """Extrema on the centrelines of a box, of the component across each (upright: the first). Collective."""
    up = domain.gdim - 1
    centre = np.array([*domain.entrance[:-1], domain.bottom + 0.5 * domain.height])
    centre[0] += 0.5 * domain.length

    def along(axis: int) -> Callable[[np.ndarray], np.ndarray]:
        direction = np.eye(domain.gdim)[axis]
        return lambda s: centre + (s - centre[axis])[:, None] * direction

    upright, level = (domain.bottom, domain.ceiling), (domain.left, domain.right)
    upward = f"v{up + 1}"
    return {
        "minimum of v1": extremum(fluid.velocity, 0, along(up), upright, sign=-1),
        f"maximum of {upward}": extremum(fluid.velocity, up, along(0), level, sign=1),
        f"minimum of {upward}": extremum(fluid.velocity, up, along(0), level, sign=-1),
    }


def evaluate(function: Any, places: Places) -> Floats:
    """Values (n, components) of a scalar or vector function at places in this rank's cells.

    Outside of its cell the function's polynomial is extrapolated. Ghosts must be up to date.
    """
    space = function.function_space
    block = space.dofmap.index_map_bs
    nodes = function.x.array.reshape(-1, block)[compat.cell_dofs(space)[places.cells]]
    return np.asarray(np.einsum("pn,pnb->pb", compat.tabulate(space, places.reference), nodes))


def _inverses(matrices: Floats) -> Floats:
    singular = ~(np.abs(np.linalg.det(matrices)) > 0.0)
    inverses = np.linalg.inv(
        np.where(singular[:, None, None], np.eye(matrices.shape[-1]), matrices)
    )
    inverses[singular] = np.nan
    return np.asarray(inverses)


def _clipped(coordinates: Floats) -> Floats:
    kept = np.maximum(coordinates, 0.0)
    return np.asarray(kept / kept.sum(axis=-1, keepdims=True))


class Transfer:
    """Evaluation of functions on a present mesh at points that may differ from rank to rank.

    Every method is collective. A point outside the mesh takes the extrapolated polynomial of the nearest cell: nodes of
    a remeshed curved boundary lie off the old mesh by a fraction of a cell.

    Args:
        mesh: of simplices, straight or curved.
        points: (n, gdim or 3) of this rank.
        reach: largest extrapolation out of a cell, in barycentric coordinates; farther out a point takes the value at
            a near point of the cell, as in interstices that coarse cells fill differently on each mesh.

    Attributes:
        outside: number of points of all ranks in no cell.
        farthest: their largest distance from their cell.
    """

    def __init__(self, mesh: Any, points: Floats, reach: float = np.inf):
        comm, locator = mesh.comm, Locator(mesh)
        parts = comm.allgather(np.asarray(points, dtype=float)[:, : mesh.geometry.dim])
        every, start = np.concatenate(parts), sum(map(len, parts[: comm.rank]))
        self._mine = slice(start, start + len(points))
        self._within = Samples(comm, locator.inside(every))
        self._lost = np.flatnonzero(np.isinf(self._within.distances))
        self._beyond = Samples(comm, locator.nearest(every[self._lost]).within(reach))
        self.outside = len(self._lost)
        self.farthest = float(self._beyond.distances.max(initial=0.0))

    def values(self, function: Any) -> Floats:
        """Values (n, components) at this rank's points.

        The function is scalar or vector, in a Lagrange space of any order, its ghosts up to date.
        """
        values = self._within.values(function)
        values[self._lost] = self._beyond.values(function)
        return values[self._mine]

    def of_state(self, space: Any, state: Floats) -> Floats:
        """Values (n, components) of the function of a space with nodal values `state` (local unknowns,)."""
        function = dolfinx.fem.Function(space)
        function.x.array[:] = state
        return self.values(function)


def transferred(
    states: Sequence[Floats], space: Any, new_space: Any, reach: float = 0.0
) -> list[Floats]:
    """States (local unknowns,) of a space at the nodes of a space on another mesh, as by `Transfer`. Collective."""
    transfer = Transfer(space.mesh, new_space.tabulate_dof_coordinates(), reach)
    return [transfer.of_state(space, state).ravel() for state in states]
