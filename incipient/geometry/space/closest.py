"""Where a grain in space comes close to its bed: all local minima of the distance, and lowering onto the bed.

Smooth grains are minimised over their surface from samples of it; grains with cores (flat faces, round parts)
over every triangle of the core. Both by Newton's method with the second derivatives of the bed's distance.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from incipient.arrays import Floats
from incipient.errors import SceneError
from incipient.geometry.placement import Placement
from incipient.geometry.space.nearest import Triangles, nearest_on_triangles
from incipient.geometry.space.pieces import Graph, Pieces, Sight
from incipient.geometry.space.solid import Core, Solid, frame_of
from incipient.geometry.space.surfaces import Surface, refined
from incipient.geometry.space.terrain import SmoothTerrain, Terrain
from incipient.geometry.space.triangles import least_on_triangles

SAMPLES, SAMPLES_PER_FEATURE = (
    24.0,
    6.0,
)  # along the grain's size and along the bed's smallest feature
STEEPEST = 0.02  # vertical component of a normal that lowering still counts on


@dataclass(frozen=True, eq=False)
class DistanceMinima:
    """Places where the distance of a placed grain from the bed is least, k of them."""

    gaps: Floats  # distances (k,), negative where the grain is in the bed
    points: Floats  # on the grain (k, 3); `normals` (k, 3) are the bed's there, into the fluid
    normals: Floats
    anchors: (
        Floats  # the points of the core, or of the surface without a core, in the body frame (k, 3)
    )
    # Which core (-1: none), which triangle of it (negative: corner or edge, see `SpatialProximity`) and which of the
    # pieces of the bed, (k, 3)
    origin: np.ndarray
    pieces: Pieces

    def __len__(self) -> int:
        return len(self.gaps)

    def only(self, which: np.ndarray) -> "DistanceMinima":
        """Some of the minima, by a mask or by indices."""
        gaps, points, normals = self.gaps[which], self.points[which], self.normals[which]
        return DistanceMinima(
            gaps, points, normals, self.anchors[which], self.origin[which], self.pieces
        )


def _cut(core: Core, spacing: float) -> Core:
    """A core with smaller triangles; round ones are sampled instead."""
    if core.radius > 0.0:
        return core
    fine = refined(Surface(core.points, core.triangles), spacing)
    return Core(fine.points, fine.triangles)


def _together(parts: list[DistanceMinima]) -> DistanceMinima:
    """The minima of several tables in one."""
    gaps, points, normals, anchors, origin = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("gaps", "points", "normals", "anchors", "origin")
    )
    return DistanceMinima(gaps, points, normals, anchors, origin, parts[0].pieces)


@dataclass(frozen=True, eq=False)
class SpatialProximity:
    """A grain and a bed in space, prepared for questions about many placements.

    Parts of a core are numbered: its triangles from 0 on; corner i of n is -1 - i, edge j is -1 - n - j.
    """

    grain: Solid
    bed: Terrain

    @property
    def size(self) -> float:
        """The grain's size."""
        return self.grain.size

    @cached_property
    def spacing(self) -> float:
        """The distance of samples on the grain's surface."""
        return float(min(self.size / SAMPLES, self.bed.feature / SAMPLES_PER_FEATURE))

    @cached_property
    def _samples(self) -> Surface:
        return self.grain.surface(self.spacing)

    @cached_property
    def _neighbours(self) -> np.ndarray:
        """The samples next to each sample (n, most), filled up with itself."""
        edges = self._samples.edges
        both = np.vstack([edges, edges[:, ::-1]])
        both = both[np.argsort(both[:, 0], kind="stable")]
        count = len(self._samples.points)
        degree = np.bincount(both[:, 0], minlength=count)
        table = np.tile(np.arange(count)[:, None], (1, max(int(degree.max(initial=0)), 1)))
        place = np.arange(len(both)) - np.repeat(np.cumsum(degree) - degree, degree)
        table[both[:, 0], place] = both[:, 1]
        return table

    @cached_property
    def cores(self) -> tuple[Core, ...]:
        """The grain's cores, on smooth beds cut finely enough that a triangle sees no two crests."""
        if not isinstance(self.bed, SmoothTerrain):
            return self.grain.cores
        return tuple(_cut(core, 0.5 * self.bed.feature) for core in self.grain.cores)

    @cached_property
    def _corners(self) -> tuple[np.ndarray, ...]:
        """Which points of each core are corners of the grain's own core, not of its finer triangles."""
        found = []
        for fine, coarse in zip(self.cores, self.grain.cores, strict=True):
            scale = 1e-7 * self.size
            own = {tuple(row) for row in np.round(coarse.points / scale).astype(int).tolist()}
            mine = np.round(fine.points / scale).astype(int).tolist()
            found.append(np.array([tuple(row) in own for row in mine]))
        return tuple(found)

    @cached_property
    def _edges(self) -> tuple[np.ndarray, ...]:
        """The ends of the edges of the grain's own cores, (e, 2 ends, 3) in the body frame."""
        found = []
        for core in self.grain.cores:
            edges = Surface(core.points, core.triangles).edges
            found.append(core.points[edges[edges[:, 0] != edges[:, 1]]])
        return tuple(found)

    def minima(self, placement: Placement, within: float) -> DistanceMinima:
        """All minima whose gap is at most `within` (a length): over the surface, or over each triangle of cores.

        A minimum over a triangle need not be one over the surface (see `locally_least`). Exact to round-off
        as long as different ones are farther apart than the samples.
        """
        pieces = self.bed.pieces(placement.centre[:2], self.size + max(within, 0.0))
        parts = [self._core_minima(placement, pieces, k, within) for k in range(len(self.cores))]
        if not parts:
            starts, which = self._valleys(placement, pieces, within)
            parts = [self._descended(placement, pieces, starts, which)]
        found = _together(parts)
        return found.only(found.gaps <= within)

    def tracked(self, placement: Placement, old: DistanceMinima) -> DistanceMinima:
        """The minima `old` followed to another placement close by."""
        pieces = old.pieces
        parts = [old.only(np.empty(0, dtype=int))]
        points = placement.to_scene(old.anchors)
        for k in np.unique(old.origin[:, 0]):
            mine = old.origin[:, 0] == k
            pieces_of = old.origin[mine, 2]
            if k < 0:
                parts.append(self._descended(placement, pieces, points[mine], pieces_of))
            else:
                parts.append(self._tracked_on_core(placement, old.only(mine), int(k)))
        return _together(parts)

    def _tracked_on_core(self, placement: Placement, old: DistanceMinima, k: int) -> DistanceMinima:
        """The lowest of the minima over the triangles around each old one; corners and edges stay what they are."""
        core = self.cores[k]
        fixed, free = np.flatnonzero(old.origin[:, 1] < 0), np.flatnonzero(old.origin[:, 1] >= 0)
        row, triangle = core.search.near(old.anchors[free], 0.1 * self.spacing)
        row = free[row]
        row, triangle = (
            np.concatenate([row, fixed]),
            np.concatenate([triangle, old.origin[fixed, 1]]),
        )
        start = placement.to_scene(
            nearest_on_triangles(old.anchors[row], self._spanned(k, triangle))
        )
        feet = (placement.to_scene(old.anchors[row]) - core.radius * old.normals[row])[:, :2]
        found = self._on_core(placement, old.pieces, k, triangle, old.origin[row, 2], start, feet)
        order = np.lexsort([found.gaps, row])
        return found.only(order[np.unique(row[order], return_index=True)[1]])

    def _valleys(
        self, placement: Placement, pieces: Pieces, within: float
    ) -> tuple[Floats, np.ndarray]:
        """Sampled points (m, 3) nearer to a piece (m,) than the samples around them."""
        points = placement.to_scene(self._samples.points)
        rough = pieces.rough(points)
        rough_bound = within + self._samples.spacing
        close = np.flatnonzero(rough.min(axis=1, initial=np.inf) <= rough_bound)
        starts, which = [np.empty(0, dtype=int)], [np.empty(0, dtype=int)]
        for piece in close:
            near = np.flatnonzero(rough[piece] <= rough_bound)
            lowest = rough[piece][self._neighbours[near]].min(axis=1)
            valley = near[rough[piece][near] <= lowest]
            starts.append(valley)
            which.append(np.full(len(valley), piece))
        return points[np.concatenate(starts)], np.concatenate(which)

    def _descended(
        self, placement: Placement, pieces: Pieces, points: Floats, which: np.ndarray
    ) -> DistanceMinima:
        """Minima over a smooth grain's surface from points (m, 3) near it, in distance from pieces (m,)."""
        points = placement.to_scene(self.grain.project(placement.to_body(points)))
        sight = pieces.sight(points, which, points[:, :2])
        for _ in range(30):
            tangents, step = self._newton_step(placement, points, sight)
            moved = np.zeros(len(points))
            for _ in range(5):
                trial = points + np.einsum("nik,nk->ni", tangents, step)
                trial = placement.to_scene(self.grain.project(placement.to_body(trial)))
                seen = pieces.sight(trial, which, sight.feet[:, :2])
                lower = seen.gaps <= sight.gaps + 1e-16 * self.size
                moved = np.maximum(
                    moved, np.where(lower, np.abs(step).max(axis=1, initial=0.0), 0.0)
                )
                points = np.where(lower[:, None], trial, points)
                sight = _chosen(lower, seen, sight)
                step = np.where(lower[:, None], 0.0, 0.25 * step)
                if lower.all():
                    break
            if moved.max(initial=0.0) <= 1e-12 * self.size:
                break
        origin = np.column_stack([np.full((len(which), 2), -1), which]).astype(int)
        return DistanceMinima(
            sight.gaps, points, sight.normals, placement.to_body(points), origin, pieces
        )

    def _newton_step(
        self, placement: Placement, points: Floats, sight: Sight
    ) -> tuple[Floats, Floats]:
        """Tangents (n, 3, 2) of the grain and the step along them (n, 2) towards the least distance."""
        outward = self._outward(placement, points)
        tangents = np.stack(frame_of(outward), axis=2)
        h = 1e-5 * self.size
        # All at once: (ahead or behind, 2 tangents, n, 3).
        shifts = np.multiply.outer([h, -h], np.moveaxis(tangents, 2, 0))
        around = self._outward(placement, (points + shifts).reshape(-1, 3)).reshape(shifts.shape)
        ahead, behind = np.moveaxis(around, 1, 3)
        curvature = np.swapaxes(tangents, 1, 2) @ (ahead - behind) / (2.0 * h)
        facing = -(outward * sight.normals).sum(axis=1)[:, None, None]
        bent = np.swapaxes(tangents, 1, 2) @ sight.bends @ tangents + facing * curvature
        values, vectors = np.linalg.eigh(0.5 * (bent + np.swapaxes(bent, 1, 2)))
        values = np.maximum(np.abs(values), 1e-4 / self.size)
        slope = np.einsum("nik,ni->nk", tangents, sight.normals)
        step = -np.einsum("nij,nj->ni", vectors, np.einsum("nji,nj->ni", vectors, slope) / values)
        length = np.linalg.norm(step, axis=1, keepdims=True)
        return tangents, step * np.minimum(1.0, self.spacing / np.maximum(length, 1e-300))

    def _outward(self, placement: Placement, x: Floats) -> Floats:
        """The placed grain's unit normals (n, 3) at points (n, 3) of the scene."""
        return self.grain.normal(placement.to_body(x)) @ placement.rotation.T

    def _core_minima(
        self, placement: Placement, pieces: Pieces, k: int, within: float
    ) -> DistanceMinima:
        """Minima over the triangles of a core, and all its corners where they are close."""
        core = self.cores[k]
        points = placement.to_scene(core.points)
        bound = within + core.radius
        curved = isinstance(pieces, Graph)
        rough = pieces.rough(points) - (0.5 * self.spacing if curved else 0.0)
        # Balls are met by triangles as well as by corners; single points are no triangles.
        wanted = pieces.flat | curved | (len(points) == 1)
        piece, vertex = np.nonzero((rough <= bound) & wanted[:, None] & self._corners[k])
        tables = [(-1 - vertex, piece, points[vertex], points[vertex, :2])]
        if curved:
            tables.append(self._edges_near(placement, pieces, k, bound))
        if isinstance(pieces, Graph) and core.radius > 0.0:
            tables.append(self._round_starts(placement, pieces, k, within))
        else:
            tables.append(self._triangles_near(pieces, points[core.triangles], bound))
        columns = [np.concatenate(column) for column in zip(*tables, strict=True)]
        return self._on_core(placement, pieces, k, *columns)

    def _edges_near(
        self, placement: Placement, pieces: Pieces, k: int, bound: float
    ) -> tuple[np.ndarray, np.ndarray, Floats, Floats]:
        """Starts along the edges of a core that are close to a smooth bed: where one lies across a crest."""
        edges = self._edges[k]
        lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
        counts = np.maximum(np.ceil(2.0 * lengths / self.bed.feature), 1).astype(int)
        edge = np.repeat(np.arange(len(edges)), counts)
        place = (
            np.concatenate([np.arange(n) for n in counts]) if len(counts) else np.empty(0)
        ) + 0.5
        s = (place / counts[edge])[:, None]
        starts = placement.to_scene((1.0 - s) * edges[edge, 0] + s * edges[edge, 1])
        slack = (0.5 * lengths / counts)[edge] + 0.5 * self.spacing
        near = np.flatnonzero(pieces.rough(starts)[0] - slack <= bound)
        number = -1 - len(self.cores[k].points) - edge[near]
        return number, np.zeros(len(near), dtype=int), starts[near], starts[near, :2]

    def _triangles_near(
        self, pieces: Pieces, corners: Floats, bound: float
    ) -> tuple[np.ndarray, np.ndarray, Floats, Floats]:
        """Triangles and pieces that are not flat and may be within a bound, with starting points."""
        middle = corners.mean(axis=1)
        reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        slack = reach + (reach + 0.5 * self.spacing if isinstance(pieces, Graph) else 0.0)
        proper = reach > 0.0
        close = (pieces.rough(middle) - slack <= bound) & proper & ~pieces.flat[:, None]
        piece, triangle = np.nonzero(close)
        return triangle, piece, middle[triangle], middle[triangle, :2]

    def _round_starts(
        self, placement: Placement, pieces: Pieces, k: int, within: float
    ) -> tuple[np.ndarray, np.ndarray, Floats, Floats]:
        """Starts on a smooth bed: where samples of the round surface are lowest, and the triangles below them."""
        core = self.cores[k]
        starts, _ = self._valleys(placement, pieces, within)
        corners = placement.to_scene(core.points)[core.triangles]
        nearest = nearest_on_triangles(starts[:, None], corners)
        apart = np.linalg.norm(nearest - starts[:, None], axis=2)
        mine = np.abs(apart.min(axis=1, initial=np.inf) - core.radius) <= 1e-6 * self.size
        # The minimum may lie on a triangle next to that below the sample.
        beside = apart <= apart.min(axis=1, keepdims=True, initial=np.inf) + self.spacing
        sample, triangle = np.nonzero(beside & mine[:, None])
        return (
            triangle,
            np.zeros(len(sample), dtype=int),
            nearest[sample, triangle],
            starts[sample, :2],
        )

    def _on_core(
        self,
        placement: Placement,
        pieces: Pieces,
        k: int,
        triangle: np.ndarray,
        piece: np.ndarray,
        start: Floats,
        near: Floats,
    ) -> DistanceMinima:
        """Minima over triangles, corners and edges (m,) of a core in distance from pieces (m,)."""
        core = self.cores[k]
        corners = placement.to_scene(self._spanned(k, triangle))
        points, sight = least_on_triangles(pieces, corners, piece, start, near, self.size)
        origin = np.column_stack([np.full(len(piece), k), triangle, piece]).astype(int)
        surface = points - core.radius * sight.normals
        return DistanceMinima(
            sight.gaps - core.radius,
            surface,
            sight.normals,
            placement.to_body(points),
            origin,
            pieces,
        )

    def _spanned(self, k: int, triangle: np.ndarray) -> Floats:
        """The corners (m, 3, 3) of triangles of a core, in the body frame; those of corners and edges repeat."""
        core = self.cores[k]
        corners = core.points[core.triangles[np.maximum(triangle, 0)]]
        single = (triangle < 0) & (triangle >= -len(core.points))
        corners[single] = core.points[-1 - triangle[single]][:, None]
        along = triangle < -len(core.points)
        corners[along] = self._edges[k][-1 - len(core.points) - triangle[along]][:, [0, 1, 1]]
        return corners

    def locally_least(
        self,
        placement: Placement,
        minima: DistanceMinima,
        corners: bool = False,
        slack: float = 0.0,
    ) -> DistanceMinima:
        """The `minima` that are local minima over the whole surface, each once; on request all corners, too.

        Points whose neighbourhood is lower by no more than `slack` (a length) count as minima.
        """
        slack = max(slack, 1e-9 * self.size)
        keep = np.ones(len(minima), dtype=bool)
        for k in range(len(self.cores)):
            mine = np.flatnonzero(minima.origin[:, 0] == k)
            # The distance grows from there into all triangles that meet there; normals are those in the body.
            anchors, normals = minima.anchors[mine], minima.normals[mine] @ placement.rotation
            keep[mine] = _grows(self.cores[k].search, anchors, normals, slack)
        if len(self.cores) > 1:
            keep &= self.grain.level(placement.to_body(minima.points)) >= -1e-9 * self.size
        if corners:
            keep |= self._is_corner(placement, minima)
        return _distinct(minima.only(keep), 1e-6 * self.size)

    def _is_corner(self, placement: Placement, minima: DistanceMinima) -> np.ndarray:
        """Which minima are corners of the grain, or minima along an edge of it."""
        found = (minima.origin[:, 0] >= 0) & (minima.origin[:, 1] < 0)
        for k in range(len(self.cores)):
            mine = found & (minima.origin[:, 0] == k)
            corners = placement.to_scene(self._spanned(k, minima.origin[mine, 1]))
            rise = ((corners[:, 1] - corners[:, 0]) * minima.normals[mine]).sum(axis=1)
            found[mine] = np.abs(rise) <= 1e-6 * self.size
        return found

    def lowered(self, placement: Placement) -> Placement:
        """The placement, lowered (or raised) vertically until the grain touches the bed, to round-off."""
        samples = placement.to_scene(self._samples.points)
        drop = samples[:, 2] - self.bed.height(samples[:, :2])
        placement = placement.raised(-float(drop.min()))
        minima = self.minima(placement, self._samples.spacing)
        for _ in range(60):
            if len(minima) == 0:
                raise SceneError("the grain finds no bed below it; move it over the bed")
            lift = float((-minima.gaps / np.maximum(minima.normals[:, 2], STEEPEST)).max())
            placement = placement.raised(lift)
            if abs(lift) <= 4e-15 * self.size:
                break
            minima = self.tracked(placement, minima)
        return placement

    def clearance(self, placement: Placement) -> tuple[float, Floats, Floats]:
        """The least gap, and the points (3,) on grain and bed where it occurs; see `rest.clearance`."""
        drop = max(placement.centre[2] - self.lowered(placement).centre[2], 0.0)
        minima, reach = self.minima(placement, drop + 1e-9 * self.size), self.size
        while not len(
            minima
        ):  # next to a bed that overhangs it the grain is nearer than its way down says
            minima, reach = self.minima(placement, reach), 2.0 * reach
        k = int(np.argmin(minima.gaps))
        gap, point = float(minima.gaps[k]), minima.points[k]
        return gap, point, point - gap * minima.normals[k]


def _grows(search: Triangles, anchors: Floats, normals: Floats, slack: float) -> np.ndarray:
    """Whether from anchors (m, 3) no triangle that meets there falls by more than `slack`."""
    size = float(np.abs(search.corners).max())
    row, triangle = search.near(anchors, 1e-9 * size)
    corners = search.corners[triangle]
    nearest = nearest_on_triangles(anchors[row], corners)
    beside = np.linalg.norm(nearest - anchors[row], axis=1) <= 1e-9 * size
    away = corners - anchors[row, None]
    falls = ((away * normals[row, None]).sum(axis=2) < -slack).any(axis=1)
    least = np.ones(len(anchors), dtype=bool)
    least[row[beside & falls]] = False
    return least


def _chosen(which: np.ndarray, yes: Sight, no: Sight) -> Sight:
    """Rows of one sight or the other."""
    return Sight(
        np.where(which, yes.gaps, no.gaps),
        np.where(which[:, None], yes.feet, no.feet),
        np.where(which[:, None], yes.normals, no.normals),
        np.where(which[:, None, None], yes.bends, no.bends),
    )


def _distinct(minima: DistanceMinima, tolerance: float) -> DistanceMinima:
    """The minima without those that repeat a lower one: the same point and the same normal."""
    from scipy.spatial import cKDTree

    keep = np.ones(len(minima), dtype=bool)
    if len(minima) > 1:
        lowest = np.argsort(minima.gaps, kind="stable")
        points, normals = minima.points[lowest], minima.normals[lowest]
        pairs = np.sort(
            cKDTree(points).query_pairs(tolerance, p=np.inf, output_type="ndarray"), axis=1
        )
        same = np.abs(normals[pairs[:, 0]] - normals[pairs[:, 1]]).max(axis=1, initial=0.0) <= 1e-4
        for i, j in pairs[same][np.argsort(pairs[same][:, 0], kind="stable")].tolist():
            keep[lowest[j]] &= not keep[lowest[i]]
    return minima.only(keep)
