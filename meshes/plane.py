"""Plane regions meshed with triangles, curved along their boundaries, with layers along walls."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from incipient.arrays import Floats, Point, planar_cross
from incipient.errors import MeshError
from incipient.geometry.plane.curves import Arc, Curve, Line, Spline

from .layers import with_layers
from .regions import GRID, Frame, Near, Region, SizeField, Sizes, WallLayers
from .session import generate, gmsh, set_background, view_field
from .simplices import Simplices, kind_of

# Factor about their centroids for triangles of an earlier mesh, where they say how fine the next is
ENLARGED = 1.3


def meshed_region(region: Region, sizes: Sizes, order: int) -> Simplices:
    """The mesh of a region with cells of an order, made in the current gmsh model. Raises MeshError."""
    if sizes.layers is not None and order not in (1, 2):
        raise MeshError(
            f"cells in layers are of order 1 or 2, not {order}: change numerics.geometry_order"
        )
    frame = region.frame
    curves = _draw(region, frame)
    _set_sizes(sizes, curves, frame)
    generate(2)
    gmsh.model.mesh.setOrder(order if sizes.layers is None else 2)
    mesh = Simplices.read(curves, 2, order if sizes.layers is None else 2)
    if sizes.layers is not None:
        first = {name: frame.size(size) for name, size in sizes.layers.first.items()}
        mesh = _layered(mesh, replace(sizes.layers, first=first), order)
    elif order > 1:
        mesh = _without_folds(mesh, order)
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
    # A side made straight can leave too little room to the cell on its other side.
    for _ in range(3):
        by_s, by_t = (slope @ points[cells] for slope in slopes[:2])
        senses = planar_cross(by_s, by_t)
        senses *= np.sign(np.median(senses))
        folded = cells[senses.min(axis=1) <= 0.0]
        if not len(folded):
            return replace(mesh, points=points)
        straight = weights[3:] @ points[folded[:, :3]]
        moves = np.abs(straight - points[folded[:, 3:]]).max(axis=2) > GRID
        # Where the domain ends in a cusp of the bed, nodes lie on that end, which is straight.
        if np.isin(folded, on_grain).any() or (np.isin(folded[:, 3:], elsewhere) & moves).any():
            break
        points[folded[:, 3:]] = straight
    raise MeshError(
        f"cells of order {order} fold over on a curved boundary: use a smaller numerics.mesh_size "
        "or numerics.geometry_order = 1"
    )


def _layered(curved: Simplices, layers: WallLayers, order: int) -> Simplices:
    straight = Simplices(
        curved.points,
        curved.cells[:, :3],
        {name: part[:, :2] for name, part in curved.sides.items()},
    )
    mesh, columns = with_layers(straight.used(), layers)
    if order == 1:
        return mesh
    mesh, walls = mesh.of_order(2), [name for name in mesh.sides if name in layers.first]
    middles = np.concatenate([mesh.sides[name][:, 2] for name in walls])
    places = curved.points[np.concatenate([curved.sides[name][:, 2] for name in walls])]
    return mesh.curved(middles, places, None, *columns.by_point(len(mesh.points)))[0]
