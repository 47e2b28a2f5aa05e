"""Remeshing of a triangulated surface to the wanted edge lengths: edges are split, collapsed and swapped.

After Botsch and Kobbelt (2004), with sizes that vary; all points lie on the exact surface. Operations that do not touch
each other are done together; what is longer or better is told to a few digits, so that round-off decides nothing.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from incipient.arrays import Floats, unit
from incipient.geometry.space.surfaces import Surface, Triangles, vector_areas

GRID = 2.0**-32  # in the unit of the points: what is computed is rounded to its multiples
LONG, SHORT = (
    1.37,
    0.74,
)  # in units of the wanted size: edges that are split, and that are collapsed
ROUNDS, SETTLED = 40, 4  # most rounds, and rounds after the number of triangles has settled
# Cosines of the angles at which facets meet whose edge is kept: always, and where both are no smaller than the cells.
BENT, FACETED = np.cos(np.radians([35.0, 3.0]))
TURN = np.radians(20.0)  # of a kept edge at a point that then stays
TURNED = 0.3  # cosine between a triangle's normals before and after an operation that is still done
ALIGNED = 0.5  # cosine between a triangle's normal and that of all around it from which on it is not folded

FLAT = 1e-4  # of the square of its longest side: the area of a triangle that faces nowhere

SizeOf = Callable[[Floats], Floats]


class Topology:
    """Edges (k, 2) of triangles (m, 3), each once, its lower point first.

    of_sides (m, 3): the edge from each corner of a triangle to its next one.
    """

    def __init__(self, triangles: np.ndarray):
        self.triangles = triangles
        following = triangles[:, [1, 2, 0]]
        width = int(triangles.max(initial=0)) + 1
        low, high = np.minimum(triangles, following), np.maximum(triangles, following)
        keys = (low.astype(np.int64) * width + high).T.ravel()
        self._keys, self._first, inverse = np.unique(keys, return_index=True, return_inverse=True)
        self._width = width
        self.edges = np.column_stack(np.divmod(self._keys, width))
        self.of_sides = inverse.reshape(3, -1).T

    def number(self, pairs: np.ndarray) -> np.ndarray:
        """Which edge joins each of the pairs (n, 2) of points, -1 if none does."""
        low, high = pairs.min(axis=1), pairs.max(axis=1)
        key = low.astype(np.int64) * self._width + high
        place = np.minimum(np.searchsorted(self._keys, key), len(self._keys) - 1)
        return np.where((self._keys[place] == key) & (high < self._width), place, -1)

    @cached_property
    def beside(self) -> np.ndarray:
        """The two triangles (k, 2) at each edge; the second is -1 on the surface's own edge."""
        last = np.empty(len(self._keys), dtype=np.int64)
        last[self.of_sides.T.ravel()] = np.arange(self.of_sides.size)
        triangles = np.column_stack([self._first, last]) % max(len(self.triangles), 1)
        triangles[self._first == last, 1] = -1
        return triangles

    @cached_property
    def open(self) -> np.ndarray:
        """Whether each edge has a triangle on one side only, (k,)."""
        return np.asarray(self.beside[:, 1] < 0)

    @cached_property
    def opposite(self) -> np.ndarray:
        """The corners (k, 2) of the triangles beside each edge that are not on it; -1 where there is no triangle."""
        sums = self.triangles.sum(axis=1)
        return np.where(self.beside >= 0, sums[self.beside] - self.edges.sum(axis=1)[:, None], -1)


def lowest_around(values: Floats, edges: np.ndarray, count: int) -> Floats:
    """The least (count,) of the values (k,) of the edges at each point."""
    least = np.full(count, np.inf)
    for end in (0, 1):
        np.minimum.at(least, edges[:, end], values)
    return least


def summed(of: np.ndarray, values: Floats, count: int) -> Floats:
    """The sums (count,) or (count, d) of values (k,) or (k, d), each added to its own in their order."""
    if values.ndim == 1:
        return np.asarray(np.bincount(of, values, count), dtype=np.float64)
    return np.column_stack([np.bincount(of, column, count) for column in values.T])


@dataclass(frozen=True, eq=False)
class Draft:
    """A first triangulation: points, triangles, which coordinates (n, 3) of points are held, whether edges are kept."""

    surface: Surface
    held: np.ndarray
    sharp: bool = False


class ExactSurface(ABC):
    """A surface as it is exactly; points are in a unit in which its extent is about one."""

    @abstractmethod
    def draft(self) -> Draft:
        """First triangles, of the right shape but not yet of the right size."""

    @abstractmethod
    def project(self, x: Floats, held: np.ndarray) -> Floats:
        """Points (n, 3) of the surface near points (n, 3) close to it; coordinates that are held (n, 3) stay."""


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Points (n, 3), triangles with their edges, coordinates held (n, 3), points that stay (n,), sharp edges (k, 2).

    Sharp edges are kept, and the surface's own edge always is. `sizes` (n,) are the lengths wanted at the points.
    """

    points: Floats
    sizes: Floats
    topology: Topology
    held: np.ndarray
    fixed: np.ndarray
    sharp: np.ndarray

    @property
    def triangles(self) -> np.ndarray:
        """The points (m, 3) of each triangle."""
        return self.topology.triangles

    @property
    def normals(self) -> Floats:
        """Normals (m, 3) of the triangles, as long as their areas."""
        return vector_areas(self.points[self.triangles])


@dataclass(frozen=True, eq=False)
class Remesher:
    """What a surface is to become: where its points lie, and how long its edges are to be."""

    exact: ExactSurface
    size: SizeOf
    curves: Triangles | None  # the sharp edges, as triangles without area

    def projected(self, points: Floats, held: np.ndarray, on_curve: np.ndarray) -> Floats:
        """Points (n, 3) carried onto the surface, those on sharp edges onto these; rounded to the frame's grid."""
        result = np.empty_like(points)
        if self.curves is None:
            on_curve = np.zeros(len(points), dtype=bool)
        else:
            result[on_curve] = self.curves.nearest(points[on_curve], 0.0)[0]
        result[~on_curve] = self.exact.project(points[~on_curve], held[~on_curve])
        return np.asarray(np.round(result / GRID) * GRID)


def remeshed(exact: ExactSurface, draft: Draft, size: SizeOf) -> Surface:
    """The surface triangulated with edges about as long as `size` says at points (n, 3).

    Raises MeshError if the triangles do not settle.
    """
    mesh, curves = _begun(draft, size)
    task = Remesher(exact, size, curves)
    points = task.projected(mesh.points, mesh.held, _on_curves(mesh, _kept(mesh)))
    mesh = replace(mesh, points=points, sizes=size(points))
    calm, before = 0, -1
    for _ in range(ROUNDS):
        mesh = _split(task, mesh)
        mesh = _collapsed(task, mesh)
        for _ in range(3):
            mesh = _swapped(mesh)
        mesh = _smoothed(task, mesh)
        count = len(mesh.triangles)
        calm = calm + 1 if abs(count - before) <= 0.01 * count else 0
        before = count
        if calm >= SETTLED:
            break
    for _ in range(3):
        mesh = _smoothed(task, _swapped(mesh))
    return Surface(mesh.points, mesh.triangles)


def _begun(draft: Draft, size: SizeOf) -> tuple[SurfaceMesh, Triangles | None]:
    """The draft with its sharp edges found, and these as segments."""
    surface = draft.surface
    topology = Topology(surface.triangles)
    sharp = np.empty((0, 2), dtype=int)
    if draft.sharp:
        sharp = topology.edges[_bent(draft, topology, size) & ~topology.open]
    kept = np.vstack([sharp, topology.edges[topology.open]])
    count = len(surface.points)
    meeting = np.bincount(kept.ravel(), minlength=count)
    fixed = (meeting > 0) & (meeting != 2) | (draft.held.sum(axis=1) > 1)
    if draft.sharp:
        fixed |= (meeting == 2) & _turning(surface.points, kept, count)
    curves = Triangles(surface.points[kept[:, [0, 1, 1]]]) if draft.sharp and len(kept) else None
    sizes = np.ones(count)
    return SurfaceMesh(surface.points, sizes, topology, draft.held, fixed, sharp), curves


def _bent(draft: Draft, topology: Topology, size: SizeOf) -> np.ndarray:
    """Which edges (k,) are to be kept: those at which facets meet at an angle that the cells are to show."""
    surface = draft.surface
    areas = vector_areas(surface.corners)
    first, second = topology.beside.T
    cosine = (unit(areas)[first] * unit(areas)[second]).sum(axis=1)
    ends = surface.points[topology.edges]
    length = np.maximum(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), 1e-300)
    smaller = np.minimum(*(np.linalg.norm(areas[beside], axis=1) for beside in (first, second)))
    large = 2.0 * smaller / length > 0.5 * size(ends.mean(axis=1))
    return np.asarray((cosine < BENT) | (large & (cosine < FACETED)))


def _turning(points: Floats, kept: np.ndarray, count: int) -> np.ndarray:
    """Where (count,) two kept edges meet at an angle."""
    along = unit(points[kept[:, 1]] - points[kept[:, 0]])
    total = summed(kept.T.ravel(), np.vstack([along, -along]), count)
    # Opposite directions add up to nothing: |sum| = 2 sin(turn/2).
    return np.asarray(np.linalg.norm(total, axis=1) > 2.0 * np.sin(0.5 * TURN))


def _kept(mesh: SurfaceMesh) -> np.ndarray:
    """Which edges (k,) are sharp or the surface's own."""
    kept = mesh.topology.open.copy()
    if len(mesh.sharp):
        kept[mesh.topology.number(mesh.sharp)] = True
    return kept


def _on_curves(mesh: SurfaceMesh, kept: np.ndarray) -> np.ndarray:
    """Which points (n,) lie on kept edges (k,)."""
    on_it = np.zeros(len(mesh.points), dtype=bool)
    on_it[mesh.topology.edges[kept].ravel()] = True
    return on_it


def _lengths(mesh: SurfaceMesh, edges: np.ndarray) -> Floats:
    """The lengths (k,) of edges in units of the size wanted there, in six digits."""
    first, second = mesh.points[edges].transpose(1, 0, 2)
    return np.asarray(
        np.round(np.linalg.norm(first - second, axis=1) / mesh.sizes[edges].mean(axis=1), 6)
    )


def _split(task: Remesher, mesh: SurfaceMesh) -> SurfaceMesh:
    """Edges that are too long get a point in their middle; triangles are cut at such points."""
    topology = mesh.topology
    edges, kept = topology.edges, _kept(mesh)
    long = _lengths(mesh, edges) > LONG
    if not long.any():
        return mesh
    count, added = len(mesh.points), int(long.sum())
    middle = np.full(len(edges), -1)
    middle[long] = count + np.arange(added)
    ends = edges[long]
    held = mesh.held[ends].all(axis=1)
    # Held coordinates are shared only by the ends of the surface's own edges.
    held &= topology.open[long][:, None]
    places = task.projected(mesh.points[ends].mean(axis=1), held, kept[long])
    sharp = mesh.sharp
    if len(sharp):
        number = middle[topology.number(sharp)]
        cut = number >= 0
        halves = [np.column_stack([sharp[cut, end], number[cut]]) for end in (0, 1)]
        sharp = np.vstack([sharp[~cut], *halves])
    points = np.vstack([mesh.points, places])
    return SurfaceMesh(
        points,
        np.concatenate([mesh.sizes, task.size(places)]),
        Topology(_divided(points, mesh.triangles, middle[topology.of_sides])),
        np.vstack([mesh.held, held]),
        np.concatenate([mesh.fixed, np.zeros(added, dtype=bool)]),
        sharp,
    )


def _divided(points: Floats, triangles: np.ndarray, middles: np.ndarray) -> np.ndarray:
    """Triangles cut at the points in the middle of their sides (m, 3), -1 where there is none."""
    cut = middles >= 0
    number = cut.sum(axis=1)
    parts = [triangles[number == 0]]
    # Turned so that the first side, or all but the last one, is cut.
    item, first = number == 1, np.argmax(cut, axis=1)
    a, b, c, p = _turned(triangles, middles, item, first)[:4]
    parts += [np.column_stack([a, p, c]), np.column_stack([p, b, c])]
    two, whole = number == 2, np.argmin(cut, axis=1)
    a, b, c, p, q = _turned(triangles, middles, two, (whole + 1) % 3)[:5]
    parts.append(np.column_stack([p, b, q]))
    across, other = (
        np.linalg.norm(points[start] - points[end], axis=1) for start, end in ((a, q), (p, c))
    )
    shorter = across < (1.0 + 1e-6) * other
    parts += [np.column_stack([a, p, q])[shorter], np.column_stack([a, q, c])[shorter]]
    parts += [np.column_stack([a, p, c])[~shorter], np.column_stack([p, q, c])[~shorter]]
    three = number == 3
    (a, b, c), (p, q, r) = triangles[three].T, middles[three].T
    parts += [np.column_stack(t) for t in ((a, p, r), (p, b, q), (r, q, c), (p, q, r))]
    return np.vstack(parts)


def _turned(
    triangles: np.ndarray, middles: np.ndarray, which: np.ndarray, first: np.ndarray
) -> list[np.ndarray]:
    """Corners and middles of some triangles, six columns, each counted from its own first side."""
    rows, start = np.flatnonzero(which), first[which]
    columns = [(start + k) % 3 for k in range(3)]
    return [table[rows, column] for table in (triangles, middles) for column in columns]


def _collapsed(task: Remesher, mesh: SurfaceMesh) -> SurfaceMesh:
    """Edges that are too short become points, as long as no triangle turns over and none grows too long."""
    for _ in range(6):
        lengths = _lengths(mesh, mesh.topology.edges)
        short = np.flatnonzero(lengths < SHORT)
        if not len(short):
            return mesh
        kept = _kept(mesh)
        candidates = short[_collapsible(mesh, short, kept)]
        if not len(candidates):
            return mesh
        mesh, done = _collapse_some(task, mesh, kept, candidates, lengths[candidates])
        if not done:
            return mesh
    return mesh


def _collapsible(mesh: SurfaceMesh, which: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Which of some edges (k,) may vanish without changing what the surface, its sharp edges and its own edge are."""
    edges, count = mesh.topology.edges, len(mesh.points)
    on_curve = _on_curves(mesh, kept)
    a, b = edges[which].T
    allowed = ~(mesh.fixed[a] & mesh.fixed[b])
    allowed &= kept[which] | ~(on_curve[a] & on_curve[b])
    return allowed & (_common(edges, which, count) == np.where(mesh.topology.open[which], 1, 2))


def _common(edges: np.ndarray, which: np.ndarray, count: int) -> np.ndarray:
    """How many points are neighbours of both ends of each of some edges, (k,)."""
    from scipy.sparse import coo_matrix

    at_ends = np.zeros(count, dtype=bool)
    at_ends[edges[which]] = True
    near = edges[at_ends[edges].any(axis=1)]
    both = np.vstack([near, near[:, ::-1]])
    adjacency = coo_matrix(
        (np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(count, count)
    ).tocsr()
    a, b = edges[which].T
    return np.asarray(adjacency[a].multiply(adjacency[b]).sum(axis=1)).ravel()


def _collapse_some(
    task: Remesher, mesh: SurfaceMesh, kept: np.ndarray, candidates: np.ndarray, lengths: Floats
) -> tuple[SurfaceMesh, bool]:
    """Collapse the candidates (k,), of lengths (k,), that are shortest around; whether any was."""
    edges, count = mesh.topology.edges, len(mesh.points)
    rank = np.empty(len(candidates))
    rank[np.argsort(lengths, kind="stable")] = np.arange(len(candidates))
    # No two whose ends are neighbours: then no triangle is touched by both.
    own = lowest_around(rank, edges[candidates], count)
    around = own.copy()
    for end in (0, 1):
        lowest = own[edges[:, 1 - end]]
        beside = np.isfinite(lowest)
        np.minimum.at(around, edges[beside, end], lowest[beside])
    chosen = candidates[rank <= around[edges[candidates]].min(axis=1)]
    a, b = edges[chosen].T
    on_curve = _on_curves(mesh, kept)
    rigid = 2 * mesh.fixed.astype(int) + on_curve
    stays, goes = np.where(rigid[b] > rigid[a], b, a), np.where(rigid[b] > rigid[a], a, b)
    middle = mesh.points[edges[chosen]].mean(axis=1)
    same = rigid[a] == rigid[b]
    target = mesh.points[stays].copy()
    target[same] = task.projected(middle[same], mesh.held[stays[same]], on_curve[stays[same]])
    bad = _spoilt(mesh, stays, goes, target)
    stays, goes, target = stays[~bad], goes[~bad], target[~bad]
    if not len(goes):
        return mesh, False
    number = np.arange(count)
    number[goes] = stays
    points, sizes = mesh.points.copy(), mesh.sizes.copy()
    points[stays], sizes[stays] = target, task.size(target)
    return _renumbered(replace(mesh, points=points, sizes=sizes), number), True


def _spoilt(mesh: SurfaceMesh, stays: np.ndarray, goes: np.ndarray, target: Floats) -> np.ndarray:
    """Which collapses turn a triangle over or make an edge too long, (k,).

    A triangle that was folded itself may turn to where those around it face together, or folds would stay for good.
    """
    owner = np.full(len(mesh.points), -1)
    owner[stays] = owner[goes] = np.arange(len(stays))
    moved = mesh.points.copy()
    moved[stays] = moved[goes] = target
    touched = owner[mesh.triangles]
    of = touched.max(axis=1)
    around = of >= 0
    facing = summed(of[around], vector_areas(mesh.points[mesh.triangles[around]]), len(stays))
    remains = around & ((touched >= 0).sum(axis=1) == 1)
    triangles, of = mesh.triangles[remains], of[remains]
    corners, was = moved[triangles], mesh.points[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    too_long = longest > LONG * mesh.sizes[triangles].mean(axis=1) * (1.0 + 1e-6)
    longer = longest > (1.0 + 1e-6) * np.linalg.norm(was - np.roll(was, 1, axis=1), axis=2).max(
        axis=1
    )
    turned = _overturned(was, corners, TURNED)
    turned &= (unit(vector_areas(corners)) * unit(facing)[of]).sum(axis=1) < ALIGNED
    bad = np.zeros(len(stays), dtype=bool)
    bad[of[turned | (too_long & longer)]] = True
    return bad


def _overturned(before: Floats, after: Floats, least: float) -> np.ndarray:
    """Which triangles (m, 3 corners, 3) turn so far that the cosine is less; those that have no area yet may."""
    old, new = vector_areas(before), vector_areas(after)
    longest = np.linalg.norm(before - np.roll(before, 1, axis=1), axis=2).max(axis=1)
    proper = np.linalg.norm(old, axis=1) > FLAT * longest**2
    return np.asarray(proper & ((unit(old) * unit(new)).sum(axis=1) < least))


def _renumbered(mesh: SurfaceMesh, number: np.ndarray) -> SurfaceMesh:
    """The mesh with its points renumbered, without what has collapsed."""
    triangles, sharp = number[mesh.triangles], number[mesh.sharp]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    sharp = sharp[sharp[:, 0] != sharp[:, 1]]
    used, numbered = np.unique(triangles, return_inverse=True)
    return SurfaceMesh(
        mesh.points[used],
        mesh.sizes[used],
        Topology(numbered.reshape(-1, 3)),
        mesh.held[used],
        mesh.fixed[used],
        np.searchsorted(used, sharp).reshape(-1, 2),
    )


def _swapped(mesh: SurfaceMesh) -> SurfaceMesh:
    """Edges turned within the two triangles beside them where that makes these rounder."""
    topology = mesh.topology
    free = np.flatnonzero(~_kept(mesh))
    if not len(free):
        return mesh
    (a, b), (c, d) = topology.edges[free].T, topology.opposite[free].T
    own = _roundness(mesh.points, *mesh.triangles.T)
    now = own[topology.beside[free]].min(axis=1)
    then = np.minimum(_roundness(mesh.points, a, d, c), _roundness(mesh.points, d, b, c))
    gain = np.round(then - now, 6)
    rounder = np.flatnonzero(gain > 1e-3)
    free, now, gain = free[rounder], now[rounder], gain[rounder]
    a, b, c, d = (ends[rounder] for ends in (a, b, c, d))
    first, second = topology.beside[free].T
    # Seen from outside the first triangle has its edge from a to b or from b to a.
    corners = mesh.triangles[first]
    ordered = ((corners == a[:, None]) & (np.roll(corners, -1, axis=1) == b[:, None])).any(axis=1)
    a, b = np.where(ordered, a, b), np.where(ordered, b, a)
    old = unit(
        vector_areas(mesh.points[corners]) + vector_areas(mesh.points[mesh.triangles[second]])
    )
    new = [unit(vector_areas(mesh.points[np.column_stack(t)])) for t in ((a, d, c), (d, b, c))]
    least = np.minimum(*((old * n).sum(axis=1) for n in new))
    level = (least > 0.7) | (least > 0.0) & (now < 0.1)
    wanted = np.flatnonzero(level & (topology.number(np.column_stack([c, d])) < 0))
    if not len(wanted):
        return mesh
    first, second, gain = first[wanted], second[wanted], gain[wanted]
    a, b, c, d = (ends[wanted] for ends in (a, b, c, d))
    rank = np.empty(len(wanted))
    rank[np.argsort(-gain, kind="stable")] = np.arange(len(wanted))
    best = lowest_around(rank, np.column_stack([first, second]), len(mesh.triangles))
    chosen = np.flatnonzero((rank <= best[first]) & (rank <= best[second]))
    # Two swaps at one point could both make the same edge.
    pair = np.sort(np.column_stack([c, d]), axis=1)
    _, once = np.unique(pair[chosen], axis=0, return_index=True)
    chosen = chosen[once]
    triangles = mesh.triangles.copy()
    triangles[first[chosen]] = np.column_stack([a, d, c])[chosen]
    triangles[second[chosen]] = np.column_stack([d, b, c])[chosen]
    return replace(mesh, topology=Topology(triangles))


def _roundness(points: Floats, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> Floats:
    """The least angle's sine, nearly: area over the product of the two longest sides; 0 for needles and caps."""
    # Components first: sums over three neighbouring numbers take several times as long.
    places = np.ascontiguousarray(points.T)
    p, q, r = (places[:, corner] for corner in (a, b, c))
    u, v, w = q - p, r - p, r - q
    uu, vv, ww = ((side * side).sum(axis=0) for side in (u, v, w))
    twice = u[[1, 2, 0]] * v[[2, 0, 1]] - u[[2, 0, 1]] * v[[1, 2, 0]]
    longest = np.maximum(np.maximum(uu * vv, vv * ww), ww * uu)
    return np.asarray(np.sqrt((twice * twice).sum(axis=0) / np.maximum(longest, 1e-300)))


def _smoothed(task: Remesher, mesh: SurfaceMesh) -> SurfaceMesh:
    """Points moved along the surface towards the middle of what is around them, finer parts weighing more."""
    kept, count = _kept(mesh), len(mesh.points)
    corners = mesh.points[mesh.triangles]
    middle = corners.mean(axis=1)
    areas = mesh.normals
    weight = np.linalg.norm(areas, axis=1) / mesh.sizes[mesh.triangles].mean(axis=1) ** 3
    of = mesh.triangles.T.ravel()
    total = summed(of, np.tile(weight, 3), count)
    pull = summed(of, np.tile(weight[:, None] * middle, (3, 1)), count)
    normal = summed(of, np.tile(areas, (3, 1)), count)
    move = pull / np.maximum(total, 1e-300)[:, None] - mesh.points
    normal = unit(normal)
    move -= (move * normal).sum(axis=1)[:, None] * normal
    lines, on_curve = mesh.topology.edges[kept], _on_curves(mesh, kept)
    if len(lines):
        move[on_curve] = _along_curves(mesh, lines)[on_curve]
    move[mesh.fixed] = 0.0
    move[mesh.held] = 0.0
    free = ~mesh.fixed
    target = mesh.points.copy()
    target[free] = task.projected(
        mesh.points[free] + 0.7 * move[free], mesh.held[free], on_curve[free]
    )
    points = _without_folds(mesh, target)
    return replace(mesh, points=points, sizes=task.size(points))


def _along_curves(mesh: SurfaceMesh, lines: np.ndarray) -> Floats:
    """How points (n, 3) on kept edges move to the middle of both neighbours, the nearer one weighing more."""
    ends = mesh.points[lines]
    length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    weight = length / mesh.sizes[lines].mean(axis=1) ** 2
    count, of = len(mesh.points), lines.T.ravel()
    total = summed(of, np.tile(weight, 2), count)
    pull = summed(of, np.tile(weight[:, None] * ends.mean(axis=1), (2, 1)), count)
    return pull / np.maximum(total, 1e-300)[:, None] - mesh.points


def _without_folds(mesh: SurfaceMesh, target: Floats) -> Floats:
    """The points moved, but those of triangles that would turn over."""
    was = mesh.points[mesh.triangles]
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
