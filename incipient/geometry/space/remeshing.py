"""Remeshing of a triangulated surface to given edge lengths: edges are split, collapsed and swapped.

After Botsch and Kobbelt (2004), with sizes that vary and points on the exact surface. Lengths and qualities are
rounded, so that round-off has no effect.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from incipient.arrays import Floats, unit
from incipient.geometry.triangles import (
    Surface,
    Topology,
    Triangles,
    renumbered,
    vector_areas,
)

GRID = 2.0**-32  # in the unit of the points: what is computed is rounded to its multiples
LONG, SHORT = (
    1.37,
    0.74,
)  # in units of the wanted size: edges that are split, and that are collapsed
FLAT = 1e-4  # of the square of its longest side: the area of a triangle that faces nowhere

SizeOf = Callable[[Floats], Floats]


def lowest_around(values: np.ndarray, edges: np.ndarray, count: int) -> Floats:
    """The least (count,) of the values (k,) of the edges at each point."""
    least = np.full(count, np.inf)
    for ends in edges.T:
        np.minimum.at(least, ends, values)
    return least


def summed(of: np.ndarray, values: Floats, count: int) -> Floats:
    """Sums (count,) or (count, d) of values (k,) or (k, d) by number (k,), in their order."""
    if values.ndim == 1:
        return np.asarray(np.bincount(of, values, count), dtype=np.float64)
    return np.column_stack([np.bincount(of, column, count) for column in values.T])


@dataclass(frozen=True, eq=False)
class Draft:
    """A first triangulation, which coordinates (n, 3) of points are held, whether edges are kept."""

    surface: Surface
    held: np.ndarray
    sharp: bool = False


class ExactSurface(ABC):
    """An exact surface, in a unit in which its extent is about one."""

    @abstractmethod
    def draft(self) -> Draft:
        """First triangles, of the right shape but not yet of the right size."""

    @abstractmethod
    def distance(self, x: Floats) -> Floats:
        """Distances (n,) of points (n, 3), those from a bed signed."""

    @abstractmethod
    def project(self, x: Floats, held: np.ndarray) -> Floats:
        """Points (n, 3) of the surface near points (n, 3); held coordinates (n, 3) stay."""


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Points (n, 3) with target lengths (n,), coordinates held (n, 3), fixed points (n,), sharp edges (k, 2).

    The points lie on an exact surface, or on `curves`: its sharp edges, as triangles without area.
    """

    exact: ExactSurface
    size: SizeOf
    curves: Triangles | None
    points: Floats
    sizes: Floats
    topology: Topology
    held: np.ndarray
    fixed: np.ndarray
    sharp: np.ndarray

    def projected(self, points: Floats, held: np.ndarray, on_curve: np.ndarray) -> Floats:
        on_curve = on_curve & (self.curves is not None)
        result = np.empty_like(points)
        if self.curves is not None:
            result[on_curve] = self.curves.nearest(points[on_curve], 0.0)[0]
        result[~on_curve] = self.exact.project(points[~on_curve], held[~on_curve])
        return np.asarray(np.round(result / GRID) * GRID)

    @property
    def triangles(self) -> np.ndarray:
        return self.topology.triangles

    @property
    def corners(self) -> Floats:
        return self.points[self.triangles]

    @cached_property
    def kept(self) -> np.ndarray:
        kept = self.topology.open.copy()
        kept[self.topology.number(self.sharp)] = True
        return kept

    @cached_property
    def on_curve(self) -> np.ndarray:
        return np.isin(np.arange(len(self.points)), self.topology.edges[self.kept])

    @cached_property
    def lengths(self) -> Floats:
        """Lengths (k,) of edges over the target there, to six digits."""
        edges = self.topology.edges
        first, second = self.points[edges].transpose(1, 0, 2)
        wanted = self.sizes[edges].mean(axis=1)
        return np.asarray(np.round(np.linalg.norm(first - second, axis=1) / wanted, 6))


def remeshed(exact: ExactSurface, size: SizeOf) -> Surface:
    """The surface triangulated with edges about as long as `size` says at points (n, 3)."""
    mesh = _begun(exact, size)
    points = mesh.projected(mesh.points, mesh.held, mesh.on_curve)
    mesh = replace(mesh, points=points, sizes=size(points))
    calm, before = 0, -1
    for _ in range(40):
        mesh = _collapsed(_split(mesh))
        mesh = _smoothed(_swapped(_swapped(_swapped(mesh))))
        count = len(mesh.triangles)
        calm = calm + 1 if abs(count - before) <= 0.01 * count else 0
        before = count
        if calm >= 4:  # the number of triangles has settled
            break
    for _ in range(3):
        mesh = _smoothed(_swapped(mesh))
    points = mesh.projected(mesh.points, mesh.held, mesh.on_curve)
    return Surface(points, mesh.triangles)


def _begun(exact: ExactSurface, size: SizeOf) -> SurfaceMesh:
    draft = exact.draft()
    surface, topology, count = draft.surface, draft.surface.topology, len(draft.surface.points)
    sharp = (
        topology.edges[_bent(surface, size) & ~topology.open] if draft.sharp else topology.edges[:0]
    )
    kept = np.vstack([sharp, topology.edges[topology.open]])
    meeting = np.bincount(kept.ravel(), minlength=count)
    fixed = (meeting > 0) & (meeting != 2) | (draft.held.sum(axis=1) > 1)
    curves = None
    if draft.sharp and len(kept):
        curves = Triangles(surface.points[kept[:, [0, 1, 1]]])
        along = unit(surface.points[kept[:, 1]] - surface.points[kept[:, 0]])
        total = summed(kept.T.ravel(), np.vstack([along, -along]), count)
        # Where a kept edge turns by more than 20 degrees a point stays. Opposite directions add up to nothing:
        # |sum| = 2 sin(turn/2).
        fixed |= (meeting == 2) & (np.linalg.norm(total, axis=1) > 2.0 * np.sin(np.radians(10.0)))
    sizes = np.ones(count)
    return SurfaceMesh(
        exact, size, curves, surface.points, sizes, topology, draft.held, fixed, sharp
    )


def _bent(surface: Surface, size: SizeOf) -> np.ndarray:
    areas = vector_areas(surface.corners)
    first, second = surface.topology.beside.T
    cosine = (unit(areas)[first] * unit(areas)[second]).sum(axis=1)
    ends = surface.points[surface.topology.edges]
    length = np.maximum(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), 1e-300)
    smaller = np.minimum(*(np.linalg.norm(areas[beside], axis=1) for beside in (first, second)))
    large = 2.0 * smaller / length > 0.5 * size(ends.mean(axis=1))
    # Facets that meet at 35 degrees keep their edge; at 3 degrees if neither is smaller than the cells.
    bent, faceted = np.cos(np.radians([35.0, 3.0]))
    return np.asarray((cosine < bent) | (large & (cosine < faceted)))


def _split(mesh: SurfaceMesh) -> SurfaceMesh:
    topology, long = mesh.topology, mesh.lengths > LONG
    if not long.any():
        return mesh
    middle = np.full(len(long), -1)
    middle[long] = len(mesh.points) + np.arange(long.sum())
    ends = topology.edges[long]
    # Held coordinates are shared only by the ends of the surface's own edges.
    held = mesh.held[ends].all(axis=1) & topology.open[long][:, None]
    middles = mesh.points[ends].mean(axis=1)
    places = mesh.projected(middles, held, mesh.kept[long])
    number = middle[topology.number(mesh.sharp)]
    cut = number >= 0
    halves = [np.column_stack([mesh.sharp[cut, end], number[cut]]) for end in (0, 1)]
    points = np.vstack([mesh.points, middles])
    target = np.vstack([mesh.points, places])
    mesh = replace(
        mesh,
        points=points,
        sizes=np.concatenate([mesh.sizes, mesh.size(places)]),
        topology=Topology(_divided(target, mesh.triangles, middle[topology.of_sides])),
        held=np.vstack([mesh.held, held]),
        fixed=np.append(mesh.fixed, np.zeros(len(places), dtype=bool)),
        sharp=np.vstack([mesh.sharp[~cut], *halves]),
    )
    return replace(mesh, points=_without_folds(mesh, target))


def _divided(points: Floats, triangles: np.ndarray, middles: np.ndarray) -> np.ndarray:
    cut, parts = middles >= 0, []
    number = cut.sum(axis=1)
    # Turned so that the first side, or all but the last one, is cut.
    first = np.where(number == 1, np.argmax(cut, axis=1), np.argmin(cut, axis=1) + 1)
    turn = (np.where((number == 1) | (number == 2), first, 0)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, turn, axis=1).T
    p, q, r = np.take_along_axis(middles, turn, axis=1).T
    across, other = (np.linalg.norm(points[u] - points[v], axis=1) for u, v in ((a, q), (p, c)))
    shorter = across < (1.0 + 1e-6) * other
    for which, cells in (
        (number == 0, [(a, b, c)]),
        (number == 1, [(a, p, c), (p, b, c)]),
        (number == 2, [(p, b, q)]),
        ((number == 2) & shorter, [(a, p, q), (a, q, c)]),
        ((number == 2) & ~shorter, [(a, p, c), (p, q, c)]),
        (number == 3, [(a, p, r), (p, b, q), (r, q, c), (p, q, r)]),
    ):
        parts += [np.column_stack(cell)[which] for cell in cells]
    return np.vstack(parts)


def _collapsed(mesh: SurfaceMesh) -> SurfaceMesh:
    for _ in range(6):
        candidates = _collapsible(mesh, np.flatnonzero(mesh.lengths < SHORT))
        before, mesh = mesh, _collapse_some(mesh, candidates) if len(candidates) else mesh
        if mesh is before:
            break
    return mesh


def _collapsible(mesh: SurfaceMesh, which: np.ndarray) -> np.ndarray:
    from scipy.sparse import coo_matrix

    edges, count = mesh.topology.edges, len(mesh.points)
    a, b = edges[which].T
    allowed = ~(mesh.fixed[a] & mesh.fixed[b])
    allowed &= mesh.kept[which] | ~(mesh.on_curve[a] & mesh.on_curve[b])
    near = edges[np.isin(edges, edges[which]).any(axis=1)]
    i, j = np.vstack([near, near[:, ::-1]]).T
    beside = coo_matrix((np.ones(len(i)), (i, j)), shape=(count, count)).tocsr()
    # Neighbours of both ends; more of them than triangles would be folded onto each other.
    common = np.asarray(beside[a].multiply(beside[b]).sum(axis=1)).ravel()
    return which[allowed & (common == np.where(mesh.topology.open[which], 1, 2))]


def _collapse_some(mesh: SurfaceMesh, candidates: np.ndarray) -> SurfaceMesh:
    edges, count = mesh.topology.edges, len(mesh.points)
    rank = np.argsort(np.argsort(mesh.lengths[candidates], kind="stable"))
    # No two whose ends are neighbours: then no triangle is touched by both.
    own = lowest_around(rank, edges[candidates], count)
    around = np.minimum(own, lowest_around(own[edges[:, 0]], edges[:, 1:], count))
    around = np.minimum(around, lowest_around(own[edges[:, 1]], edges[:, :1], count))
    chosen = candidates[rank <= around[edges[candidates]].min(axis=1)]
    a, b = edges[chosen].T
    rigid = 2 * mesh.fixed.astype(int) + mesh.on_curve
    stays, goes = np.where(rigid[b] > rigid[a], b, a), np.where(rigid[b] > rigid[a], a, b)
    same = rigid[a] == rigid[b]
    target, held = mesh.points[stays], mesh.held[stays[same]]
    middle = mesh.points[edges[chosen[same]]].mean(axis=1)
    target[same] = mesh.projected(middle, held, mesh.on_curve[stays[same]])
    good = ~_spoilt(mesh, stays, goes, target)
    stays, goes, target = stays[good], goes[good], target[good]
    if not len(goes):
        return mesh
    number, points, sizes = np.arange(count), mesh.points.copy(), mesh.sizes.copy()
    number[goes], points[stays], sizes[stays] = stays, target, mesh.size(target)
    triangles, sharp = number[mesh.triangles], number[mesh.sharp]
    used, triangles = renumbered(triangles)
    sharp = np.searchsorted(used, sharp[sharp[:, 0] != sharp[:, 1]]).reshape(-1, 2)
    tables = {"points": points, "sizes": sizes, "held": mesh.held, "fixed": mesh.fixed}
    kept = {name: table[used] for name, table in tables.items()}
    return replace(mesh, topology=Topology(triangles), sharp=sharp, **kept)


def _spoilt(mesh: SurfaceMesh, stays: np.ndarray, goes: np.ndarray, target: Floats) -> np.ndarray:
    """Mask (k,) of collapses that turn a triangle over (except to unfold it) or make an edge too long."""
    owner, moved = np.full(len(mesh.points), -1), mesh.points.copy()
    owner[stays] = owner[goes] = np.arange(len(stays))
    moved[stays] = moved[goes] = target
    touched = owner[mesh.triangles]
    of = touched.max(axis=1)
    around = of >= 0
    facing = summed(of[around], vector_areas(mesh.corners[around]), len(stays))
    remains = around & ((touched >= 0).sum(axis=1) == 1)
    triangles, of = mesh.triangles[remains], of[remains]
    corners, was = moved[triangles], mesh.points[triangles]
    longest, before = _longest(corners), _longest(was)
    too_long = longest > LONG * mesh.sizes[triangles].mean(axis=1) * (1.0 + 1e-6)
    # A triangle that faces as all around it do is unfolded, not folded.
    turned = _overturned(was, corners, 0.3)
    turned &= (unit(vector_areas(corners)) * unit(facing)[of]).sum(axis=1) < 0.5
    bad = np.zeros(len(stays), dtype=bool)
    bad[of[turned | (too_long & (longest > (1.0 + 1e-6) * before))]] = True
    return bad


def _longest(corners: Floats) -> Floats:
    return np.asarray(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1))


def _overturned(before: Floats, after: Floats, least: float) -> np.ndarray:
    old, new = vector_areas(before), vector_areas(after)
    proper = np.linalg.norm(old, axis=1) > FLAT * _longest(before) ** 2
    return np.asarray(proper & ((unit(old) * unit(new)).sum(axis=1) < least))


def _swapped(mesh: SurfaceMesh) -> SurfaceMesh:
    topology, free = mesh.topology, np.flatnonzero(~mesh.kept)
    (a, b), (c, d) = topology.edges[free].T, topology.opposite[free].T
    now = _roundness(mesh.points, *mesh.triangles.T)[topology.beside[free]].min(axis=1)
    then = np.minimum(_roundness(mesh.points, a, d, c), _roundness(mesh.points, d, b, c))
    gain = np.round(then - now, 6)
    rounder = gain > 1e-3
    free, now, gain, a, b, c, d = (table[rounder] for table in (free, now, gain, a, b, c, d))
    first, second = topology.beside[free].T
    # Seen from outside the first triangle has its edge from a to b or from b to a.
    corners = mesh.triangles[first]
    ordered = ((corners == a[:, None]) & (np.roll(corners, -1, axis=1) == b[:, None])).any(axis=1)
    a, b = np.where(ordered, a, b), np.where(ordered, b, a)
    new = np.stack([np.column_stack([a, d, c]), np.column_stack([d, b, c])])
    areas = vector_areas(mesh.corners)
    old = unit(areas[first] + areas[second])
    least = np.minimum(*((old * unit(vector_areas(mesh.points[t]))).sum(axis=1) for t in new))
    level = (least > 0.7) | (least > 0.0) & (now < 0.1)
    wanted = np.flatnonzero(level & (topology.number(np.column_stack([c, d])) < 0))
    pairs = topology.beside[free[wanted]]
    rank = np.argsort(np.argsort(-gain[wanted], kind="stable"))
    chosen = (rank[:, None] <= lowest_around(rank, pairs, len(mesh.triangles))[pairs]).all(axis=1)
    wanted = wanted[chosen]
    # Two swaps at one point could both make the same edge.
    ends = np.sort(np.column_stack([c, d])[wanted], axis=1)
    wanted = wanted[np.unique(ends, axis=0, return_index=True)[1]]
    triangles = mesh.triangles.copy()
    triangles[topology.beside[free[wanted]].T] = new[:, wanted]
    return replace(mesh, topology=Topology(triangles))


def _roundness(points: Floats, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> Floats:
    """The least angle's sine, nearly."""
    # Components first: sums over three neighbouring numbers take several times as long.
    places = np.ascontiguousarray(points.T)
    p, q, r = (places[:, corner] for corner in (a, b, c))
    u, v, w = q - p, r - p, r - q
    uu, vv, ww = ((side * side).sum(axis=0) for side in (u, v, w))
    twice = u[[1, 2, 0]] * v[[2, 0, 1]] - u[[2, 0, 1]] * v[[1, 2, 0]]
    longest = np.maximum(np.maximum(uu * vv, vv * ww), ww * uu)
    return np.asarray(np.sqrt((twice * twice).sum(axis=0) / np.maximum(longest, 1e-300)))


def _smoothed(mesh: SurfaceMesh) -> SurfaceMesh:
    of, wanted = mesh.triangles.T.ravel(), mesh.sizes[mesh.triangles].mean(axis=1)
    areas = vector_areas(mesh.corners)
    weight = np.linalg.norm(areas, axis=1) / wanted**3
    move = _towards(mesh, of, np.tile(weight, 3), np.tile(mesh.corners.mean(axis=1), (3, 1)))
    normal = unit(summed(of, np.tile(areas, (3, 1)), len(mesh.points)))
    move -= (move * normal).sum(axis=1)[:, None] * normal
    # Points of kept edges move along these, the nearer neighbour weighing more.
    lines = mesh.topology.edges[mesh.kept]
    ends = mesh.points[lines]
    length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    weight = length / mesh.sizes[lines].mean(axis=1) ** 2
    middle = np.tile(ends.mean(axis=1), (2, 1))
    along = _towards(mesh, lines.T.ravel(), np.tile(weight, 2), middle)
    move = np.where(mesh.on_curve[:, None], along, move)
    move[mesh.held] = 0.0
    free, target = ~mesh.fixed, mesh.points.copy()
    moved = mesh.points[free] + 0.7 * move[free]
    target[free] = mesh.projected(moved, mesh.held[free], mesh.on_curve[free])
    points = _without_folds(mesh, target)
    return replace(mesh, points=points, sizes=mesh.size(points))


def _towards(mesh: SurfaceMesh, of: np.ndarray, weights: Floats, places: Floats) -> Floats:
    total = summed(of, weights, len(mesh.points))
    pull = summed(of, weights[:, None] * places, len(mesh.points))
    return pull / np.maximum(total, 1e-300)[:, None] - mesh.points


def _without_folds(mesh: SurfaceMesh, target: Floats) -> Floats:
    was = mesh.corners
    for _ in range(5):
        folded = _overturned(was, target[mesh.triangles], 0.5)
        if not folded.any():
            return target
        back = np.unique(mesh.triangles[folded])
        target[back] = mesh.points[back]
    return mesh.points


def without_area(surface: Surface) -> np.ndarray:
    """The triangles (k,) that are lines or points."""
    a, b, c = surface.triangles.T
    return np.flatnonzero(_roundness(surface.points, a, b, c) < FLAT)
