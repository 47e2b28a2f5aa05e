"""Plane regions meshed with triangles, curved along their boundaries, with layers along walls."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, depth_first_order

from incipient.arrays import Floats, Integers, Point, planar_cross, unit, unordered_keys
from incipient.errors import MeshError
from incipient.geometry.plane.curves import Arc, Curve, Line, Spline

from .layers import MOST_TRIALS, NO_ROOM, Columns, evened, stacked_by_diagonals
from .regions import GRID, Frame, Region
from .session import generate, gmsh, set_background, view_field
from .simplices import Simplices, kind_of, measures
from .sizes import Near, SizeField, Sizes, WallLayers

# Factor about their centroids for triangles of an earlier mesh, where they say how fine the next is
ENLARGED = 1.3
# Rounds: a side made straight can leave too little room to the cell on its other side
MOST_STRAIGHTENED = 3
ATTEMPTS, LESS = 4, 0.6  # at layers between which there is a mesh, each thinner
# Largest thickness of all layers at a point of a wall, over the radius of the largest circle that touches it there and
# reaches beyond no other wall.
ROOM = 0.6
EVENNESS = 0.4  # by which thickness changes along a wall at most, over the length of edges
THINNEST = 0.5  # of the first layer as wanted: where there is no more room, there are no layers
FAN = np.radians(30.0)  # turn between the columns of cells around a corner that protrudes, at most
SKEWEST = 0.5  # cosine between a column and the normal of an edge, at the least taken into account
# Cosine between a normal and the direction of another point, below which they are on one line
CLOSE = 1e-6


def meshed_region(region: Region, sizes: Sizes, order: int) -> Simplices:
    """The mesh of a region with cells of an order, made in the current gmsh model. Raises MeshError."""
    if sizes.layers is not None and order not in (1, 2):
        raise MeshError(
            f"cells in layers are of order 1 or 2, not {order}: change numerics.geometry_order"
        )
    frame = region.frame
    curves = _draw(region, frame)
    _set_sizes(sizes, curves, frame)
    if sizes.layers is None:
        generate(2)
        gmsh.model.mesh.setOrder(order)
        mesh = Simplices.read(curves, 2, order)
        mesh = mesh if order == 1 else _without_folds(mesh, order)
    else:
        generate(1)
        gmsh.model.mesh.setOrder(2)
        mesh = _layered(Boundary.read(curves), sizes, frame, order)
    mesh = mesh.used()
    return replace(mesh, points=frame.scene(mesh.points))


class _Pen:
    def __init__(self, frame: Frame, tolerance: float):
        self.frame, self.tolerance = frame, tolerance
        self.points: dict[tuple[int, ...], int] = {}

    def point(self, x: Point) -> int:
        place = self.frame.local(np.array(x))
        key = tuple(np.round(place / self.tolerance).astype(int).tolist())
        if key not in self.points:
            self.points[key] = self._lone(x)
        return self.points[key]

    def _lone(self, x: Point | Floats) -> int:
        return int(gmsh.model.geo.addPoint(*self.frame.local(np.asarray(x)).tolist(), 0.0))

    def curve(self, curve: Curve) -> int:
        geo = gmsh.model.geo
        start, end = self.point(curve.start), self.point(curve.end)
        if isinstance(curve, Line):
            return int(geo.addLine(start, end))
        if isinstance(curve, Arc):
            centre = self._lone(curve.centre)
            if curve.major is None:
                return int(geo.addCircleArc(start, centre, end))
            return int(geo.addEllipseArc(start, centre, self._lone(curve.major), end))
        if isinstance(curve, Spline):
            return int(geo.addSpline([start, *map(self._lone, curve.points[1:-1]), end]))
        raise MeshError(
            f"a curve of kind {type(curve).__name__} cannot be drawn; use lines, arcs or splines"
        )


def _draw(region: Region, frame: Frame) -> dict[str, list[int]]:
    left, right = region.bottom[0].start, region.bottom[-1].end
    pen = _Pen(frame, tolerance=max(1e-9 * abs(right[0] - left[0]) / frame.length, GRID))
    upper_left, upper_right = (left[0], region.top), (right[0], region.top)
    around = (right, upper_right, upper_left, left)
    sides = [region.bottom, *((Line(*ends),) for ends in pairwise(around))]
    curves: dict[str, list[int]] = {}
    for name, side in (*zip(region.sides, sides, strict=True), *region.standing.items()):
        curves.setdefault(name, []).extend(pen.curve(curve) for curve in side)
    geo = gmsh.model.geo
    loops = [geo.addCurveLoop([tag for tags in curves.values() for tag in tags], reorient=True)]
    for name, outline in region.holes.items():
        curves[name] = [pen.curve(curve) for curve in outline]
        loops.append(geo.addCurveLoop(curves[name]))
    geo.addPlaneSurface(loops)
    geo.synchronize()
    return curves


def _set_sizes(sizes: Sizes, curves: dict[str, list[int]], frame: Frame) -> None:
    fields = gmsh.model.mesh.field
    parts = [_near_field(near, curves, frame) for near in sizes.near]
    if sizes.field is not None:
        parts.append(_adapted_field(sizes.field, frame))
    whole = fields.add("MathEval")
    fields.setString(whole, "F", repr(frame.size(sizes.far)))
    least = fields.add("Min")
    fields.setNumbers(least, "FieldsList", [whole, *parts])
    set_background(least)


def _near_field(near: Near, curves: dict[str, list[int]], frame: Frame) -> int:
    fields = gmsh.model.mesh.field
    size = fields.add("MathEval")
    if near.points:
        expression, *others = (_distance_to(point, frame) for point in near.points)
        for other in others:
            expression = f"Min({expression},{other})"
    else:
        distance, tags = fields.add("Distance"), curves[near.boundary]
        fields.setNumbers(distance, "CurvesList", tags)
        # Enough points on the longest curve that the distance to them is that to the curve
        boxes = np.array([gmsh.model.getBoundingBox(1, tag) for tag in tags])
        longest = np.linalg.norm(boxes[:, 3:] - boxes[:, :3], axis=1).max()
        samples = int(np.clip(3 * longest / frame.size(near.size), 20, 2000))
        try:
            fields.setNumber(distance, "Sampling", samples)
        except Exception:  # its name until gmsh 4.9
            fields.setNumber(distance, "NumPointsPerCurve", samples)
        expression = f"F{distance}"
    at_feature, away = repr(frame.size(near.size)), near.away
    if away is not None:
        grown = f"{away.growth!r}*{_distance_to(away.point, frame)}"
        at_feature = f"Max({at_feature},Min({frame.size(away.largest)!r},{grown}))"
    fields.setString(size, "F", f"{at_feature}+{near.growth!r}*({expression})")
    return int(size)


def _distance_to(point: tuple[float, ...], frame: Frame) -> str:
    x, y = frame.local(np.array(point[:2])).tolist()
    return f"Sqrt((x-({x!r}))^2+(y-({y!r}))^2)"


def _adapted_field(wanted: SizeField, frame: Frame) -> int:
    corners = ((wanted.points - frame.origin) / frame.length)[wanted.triangles]
    values = (wanted.sizes / frame.length)[wanted.triangles]
    corners = corners + (ENLARGED - 1.0) * (corners - corners.mean(axis=1, keepdims=True))
    shifted = values + (ENLARGED - 1.0) * (values - values.mean(axis=1, keepdims=True))
    shifted = np.maximum(shifted, values.min(axis=1, keepdims=True))
    heights = np.zeros_like(values)
    return view_field("ST", np.hstack([corners[:, :, 0], corners[:, :, 1], heights, shifted]))


def _without_folds(mesh: Simplices, order: int) -> Simplices:
    """The mesh with straight cells in the cusps of a bed, where curved sides would fold them.

    Raises MeshError if cells fold at another boundary, where the true surface matters, or still fold.
    """
    kind, points, cells = kind_of(2, order), mesh.points.copy(), mesh.cells
    nodes = np.reshape(gmsh.model.mesh.getElementProperties(kind)[4], (cells.shape[1], 2))
    weights = np.column_stack([1.0 - nodes.sum(axis=1), nodes])  # of the corners at a cell's nodes
    at = np.column_stack([nodes, np.zeros(len(nodes))]).ravel()
    table = gmsh.model.mesh.getBasisFunctions(kind, at, "GradLagrange")[1]
    slopes = np.reshape(table, (len(nodes), len(nodes), 3)).transpose(2, 0, 1)
    on_grain = mesh.sides.get("body", np.empty(0, dtype=np.int64))
    elsewhere = np.concatenate([s.ravel() for name, s in mesh.sides.items() if name != "bed"])
    for _ in range(MOST_STRAIGHTENED):
        by_s, by_t = (slope @ points[cells] for slope in slopes[:2])
        senses = planar_cross(by_s, by_t)
        senses *= np.sign(np.median(senses))
        folded = cells[senses.min(axis=1) <= 0.0]
        if not len(folded):
            return replace(mesh, points=points)
        # Corners stay: where the domain ends in a cusp of the bed, one of them lies on that end.
        if np.isin(folded, on_grain).any() or np.isin(folded[:, 3:], elsewhere).any():
            break
        points[folded[:, 3:]] = weights[3:] @ points[folded[:, :3]]
    raise MeshError(
        f"cells of order {order} fold over on a curved boundary: use a smaller numerics.mesh_size "
        "or numerics.geometry_order = 1"
    )


@dataclass(frozen=True, eq=False)
class Boundary:
    """The boundary of a region in edges: one closed loop after another, the fluid on the left.

    points (n, 2), edges (m, 2) and their middles (m, 2) on the curves, names (m,) of their boundaries
    """

    points: Floats
    edges: Integers
    middles: Floats
    names: np.ndarray

    @classmethod
    def read(cls, curves: dict[str, list[int]]) -> Boundary:
        mesh = Simplices.read(curves, 2, 2)
        rows = np.concatenate([*mesh.sides.values()])
        names = np.repeat([*mesh.sides], [len(part) for part in mesh.sides.values()])
        edges, count = _around(mesh.points, rows[:, :2]), len(mesh.points)
        keys = unordered_keys(rows[:, :2], count)
        order = np.argsort(keys)
        order = order[np.searchsorted(keys[order], unordered_keys(edges, count))]
        return cls(mesh.points, edges, mesh.points[rows[order, 2]], names[order])

    def at(self, name: str) -> Integers:
        return np.flatnonzero(self.names == name)


def _around(points: Floats, edges: Integers) -> Integers:
    graph = csr_matrix((np.ones(len(edges)), edges.T), shape=(len(points), len(points)))
    label = connected_components(graph, directed=False)[1]
    _, first = np.unique(label[edges[:, 0]], return_index=True)
    loops = [
        depth_first_order(graph, start, directed=False, return_predecessors=False)
        for start in edges[np.sort(first), 0]
    ]
    ends = [np.column_stack([loop, np.roll(loop, -1)]) for loop in loops]
    areas = [float(planar_cross(*points[pairs.T]).sum()) for pairs in ends]
    outer = int(np.argmax(np.abs(areas)))
    inwards = [(area > 0.0) == (number == outer) for number, area in enumerate(areas)]
    return np.concatenate(
        [pairs if left else pairs[::-1, ::-1] for pairs, left in zip(ends, inwards, strict=True)]
    )


@dataclass(frozen=True, eq=False)
class Stand:
    """Positions of layer columns on a boundary, several on a corner that protrudes.

    foot (n,):       point of the boundary
    direction (n, 2): into the fluid; longer than one where a column is not normal to its wall
    first (n,):      thickness of the first layer
    most (n,):       total thickness at which layers are as thick as cells beyond
    pairs (k, 2):    neighbouring columns, those at the start of an edge first
    edges (k,):      the edge between the two, of a corner that after it
    ends (m, 2):     columns along sides without layers, and that edge there
    """

    foot: Integers
    direction: Floats
    first: Floats
    most: Floats
    pairs: Integers
    edges: Integers
    ends: Integers

    @classmethod
    def on(cls, boundary: Boundary, layers: WallLayers) -> Stand:
        edges, points = boundary.edges, boundary.points
        along = points[edges[:, 1]] - points[edges[:, 0]]
        lengths = np.linalg.norm(along, axis=1)
        along = along / lengths[:, None]
        normals = np.column_stack([-along[:, 1], along[:, 0]])
        first = np.array([layers.first.get(name, 0.0) for name in boundary.names])
        before = np.empty(len(points), dtype=np.int64)
        before[edges[:, 1]] = np.arange(len(edges))
        columns = list[tuple[int, Floats, float, float]]()
        pairs, ends = list[tuple[int, int, int]](), list[tuple[int, int]]()
        # Columns at the start, and at the end, of an edge
        at_start, at_end = np.full(len(edges), -1), np.full(len(edges), -1)
        for after, point in enumerate(edges[:, 0].tolist()):
            ahead, number = int(before[point]), len(columns)
            walls = [k for k in (ahead, after) if first[k]]
            if not walls:
                continue
            if len(walls) == 1:
                side = after if walls[0] == ahead else ahead
                onwards = along[side] if side == after else -along[side]
                directions = [onwards / max(float(onwards @ normals[walls[0]]), SKEWEST)]
                ends.append((number, side))
            else:
                directions = _fan(normals[ahead], _turn(along[ahead], along[after]))
            thin, size = float(first[walls].min()), float(lengths[walls].mean())
            most = max((layers.growth * size - thin) / (layers.growth - 1.0), thin)
            columns += [(point, direction, thin, most) for direction in directions]
            pairs += [(a, b, after) for a, b in pairwise(range(number, len(columns)))]
            at_end[ahead], at_start[after] = number, len(columns) - 1
        pairs += [(at_start[k], at_end[k], k) for k in np.flatnonzero(first)]
        foot, direction, thin_ones, most_of_each = map(np.array, zip(*columns, strict=True))
        of_edges = np.array(pairs)
        return cls(
            *(foot, direction, thin_ones, most_of_each, of_edges[:, :2], of_edges[:, 2]),
            np.array(ends, dtype=np.int64).reshape(-1, 2),
        )

    def room(self, boundary: Boundary, share: float) -> Floats:
        """Largest total thickness (n,) of the layers, slowly varying along walls; 0 without space."""
        # Sides along which columns stand are no obstacles to them.
        obstacles = ~np.isin(boundary.names, boundary.names[self.ends[:, 1]])
        of_obstacles = boundary.points[np.unique(boundary.edges[obstacles])]
        places = np.concatenate([of_obstacles, boundary.middles[obstacles]])
        feet, lengths = boundary.points[self.foot], np.linalg.norm(self.direction, axis=1)
        thickness = self.most.copy()
        for k, (x, normal) in enumerate(zip(feet, unit(self.direction), strict=True)):
            square, height = ((places - x) ** 2).sum(axis=1), (places - x) @ normal
            there = height > CLOSE * np.sqrt(square)
            radius = (0.5 * square[there] / height[there]).min(initial=np.inf)
            thickness[k] = min(thickness[k], share * radius / lengths[k])
        apart = np.linalg.norm(feet[self.pairs[:, 0]] - feet[self.pairs[:, 1]], axis=1)
        thickness = evened(thickness, self.pairs, EVENNESS * apart)
        return np.where(thickness < THINNEST * self.first, 0.0, thickness)

    def columns(
        self, boundary: Boundary, thickness: Floats, layers: WallLayers
    ) -> tuple[Columns, Integers]:
        """Layers as thick as given, thinner where cells would be inside out, and these cells."""
        for _ in range(MOST_TRIALS):
            columns = Columns.standing(
                boundary.points, self.foot, self.direction, thickness, self.first, layers
            )
            cells = stacked_by_diagonals(columns.points, columns.rows[self.pairs])
            folded = cells[measures(columns.points, cells) <= 0.0]
            if not len(folded):
                return columns, cells
            touched = np.isin(columns.rows, folded).any(axis=1)
            thickness = np.where(touched, LESS * thickness, thickness)
        raise MeshError(NO_ROOM)


def _turn(before: Floats, after: Floats) -> float:
    return float(np.arctan2(planar_cross(before, after), before @ after))


def _fan(normal: Floats, turn: float) -> list[Floats]:
    parts = int(np.ceil(-turn / FAN - 1e-9)) if turn < -FAN else 0
    angles = turn * np.arange(parts + 1) / parts if parts else np.array([0.5 * turn])
    c, s = np.cos(angles), np.sin(angles)
    directions = np.column_stack([c * normal[0] - s * normal[1], s * normal[0] + c * normal[1]])
    return list(directions if parts else directions / max(c[0], SKEWEST))


def _layered(boundary: Boundary, sizes: Sizes, frame: Frame, order: int) -> Simplices:
    assert sizes.layers is not None
    first = {name: frame.size(thickness) for name, thickness in sizes.layers.first.items()}
    layers, share = replace(sizes.layers, first=first), ROOM
    stand = Stand.on(boundary, layers)
    for attempt in range(ATTEMPTS):
        columns, cells = stand.columns(boundary, stand.room(boundary, share), layers)
        gmsh.clear()
        try:
            mesh = _filled(boundary, stand, columns, cells, sizes, frame)
            break
        except MeshError:
            if attempt == ATTEMPTS - 1:
                raise
        share *= LESS
    if order == 1:
        return mesh
    mesh = mesh.of_order(2)
    walls = [name for name in mesh.sides if name in first]
    middles = np.concatenate([mesh.sides[name][:, 2] for name in walls])
    places = np.concatenate([boundary.middles[boundary.at(name)] for name in walls])
    return mesh.curved(middles, places, None, *columns.by_point(len(mesh.points)))[0]


def _filled(
    boundary: Boundary, stand: Stand, columns: Columns, cells: Integers, sizes: Sizes, frame: Frame
) -> Simplices:
    walls = set(boundary.names[stand.edges])
    lines = _lines(boundary, stand, columns, walls)
    geo, curves = gmsh.model.geo, dict[str, list[int]]()
    starts = sorted({start for _, start, _ in lines})
    tags = {k: geo.addPoint(*columns.points[k], 0.0) for k in starts}
    drawn = [geo.addLine(tags[start], tags[end]) for _, start, end in lines]
    for (name, *_), line in zip(lines, drawn, strict=True):
        curves.setdefault(name, []).append(line)
        if name in walls:
            geo.mesh.setTransfiniteCurve(line, 2)
    geo.addPlaneSurface(geo.addCurveLoops(drawn))
    geo.synchronize()
    _set_sizes(sizes, curves, frame)
    generate(2)
    free = Simplices.read(curves, 2)
    row = len(columns.points) + np.arange(len(free.points))
    for point, tag in tags.items():
        row[int(gmsh.model.mesh.getNodes(0, tag)[0][0])] = point
    points, between = np.concatenate([columns.points, free.points]), row[free.cells]
    inside_out = measures(points, between) < 0.0
    between[inside_out] = between[inside_out][:, [0, 2, 1]]
    sides = {name: [row[part]] for name, part in free.sides.items() if name not in walls}
    for column, edge in stand.ends:
        ends = np.column_stack([columns.rows[column, :-1], columns.rows[column, 1:]])
        sides[boundary.names[edge]].append(ends[ends[:, 1] > ends[:, 0]])
    sides |= {name: [boundary.edges[boundary.at(name)]] for name in sorted(walls)}
    named = {str(name): np.concatenate(parts) for name, parts in sides.items()}
    return Simplices(points, np.concatenate([cells, between]), named)


def _lines(
    boundary: Boundary, stand: Stand, columns: Columns, walls: set[str]
) -> list[tuple[str, int, int]]:
    tops = columns.rows[:, -1].tolist()
    top = dict(zip(stand.foot.tolist(), tops, strict=True))
    lines = [
        (boundary.names[edge], tops[a], tops[b])
        for (a, b), edge in zip(stand.pairs.tolist(), stand.edges, strict=True)
    ]
    for name, run in groupby(range(len(boundary.edges)), lambda k: boundary.names[k]):
        if name not in walls:
            edges = boundary.edges[list(run)]
            start, end = int(edges[0, 0]), int(edges[-1, 1])
            lines.append((name, top.get(start, start), top.get(end, end)))
    return [line for line in lines if line[1] != line[2]]
