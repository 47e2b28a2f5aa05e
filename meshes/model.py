"""gmsh models of regions and grids, meshed and with their boundaries named."""

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import byref, c_int, c_size_t, c_void_p
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from incipient.arrays import Floats, Point
from incipient.errors import MeshError
from incipient.geometry.plane.curves import Arc, Curve, Line, Spline
from incipient.interrupt import handlers_kept

from .region import GRID, Frame, Grid, Near, Place, Region, SizeField, Sizes, SolidGrid

with handlers_kept():  # at its import gmsh takes interrupts for itself
    import gmsh

ENLARGED = (
    1.3  # triangles of an earlier mesh about their centroids, where they say how fine the next is
)
MOST_STRAIGHTENED = (
    3  # times: a side made straight can leave too little room to the cell on its other side
)


@contextmanager
def region_model(region: Region, sizes: Sizes, order: int) -> Iterator[Any]:
    """Yield the gmsh model of a region meshed with triangles of an order. Not collective: one rank draws.

    Raises MeshError if gmsh finds no mesh, or curved cells fold over.
    """
    with session() as model:
        with complaints_as_errors():
            frame = Frame.of(region)
            curves = draw_region(region, frame)
            set_sizes(sizes, curves, frame)
            _mesh(order)
            _put_in_place(frame)
        yield model


@contextmanager
def grid_model(grid: Grid, order: int) -> Iterator[Any]:
    """Yield the gmsh model of a graded grid of triangles. Not collective: one rank draws."""
    with session() as model:
        with complaints_as_errors():
            frame = Frame(grid.origin, grid.height)
            _draw_grid(grid, frame)
            _mesh(order)
            _put_in_place(frame)
        yield model


@contextmanager
def solid_grid_model(grid: SolidGrid, order: int) -> Iterator[Any]:
    """Yield the gmsh model of a grid extruded across. Not collective: one rank draws."""
    with session() as model:
        with complaints_as_errors():
            frame = Frame(grid.grid.origin, grid.grid.height)
            _draw_solid_grid(grid, frame)
            generate(3)
            model.mesh.setOrder(order)
            _put_in_place(frame, across=grid.across[0])
        yield model


@contextmanager
def session() -> Iterator[Any]:
    """A quiet gmsh session of its own."""
    options = (
        {"interruptible": False}
        if "interruptible" in inspect.signature(gmsh.initialize).parameters
        else {}
    )
    with handlers_kept():
        gmsh.initialize(**options)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.logger.start()
        gmsh.model.add("incipient")
        yield gmsh.model
    finally:
        with handlers_kept():
            gmsh.finalize()


REMEDY = "use another numerics.mesh_size, and make thin parts and narrow passages wider"


@contextmanager
def complaints_as_errors() -> Iterator[None]:
    """Turn gmsh's complaints while drawing and meshing into MeshError; other errors are defects, and pass."""
    try:
        yield
    except Exception as error:
        if not _is_of_gmsh(error):
            raise
        reason = str(error) or type(error).__name__
        raise MeshError(f"the geometry could not be meshed: {reason}; {REMEDY}") from error


def _is_of_gmsh(error: Exception) -> bool:
    """Whether an error is gmsh's, which raises the base class of all others."""
    return type(error) is Exception


class _Pen:
    """Draws curves in a frame, joining those that share an end point."""

    def __init__(self, frame: Frame, tolerance: float):
        self.frame, self.tolerance = frame, tolerance
        self.points: dict[tuple[int, int], int] = {}

    def point(self, x: Point) -> int:
        """The tag of a point, drawn if there is none there yet."""
        place = self.frame.local(*x)
        key = (round(place[0] / self.tolerance), round(place[1] / self.tolerance))
        if key not in self.points:
            self.points[key] = gmsh.model.geo.addPoint(*place, 0.0)
        return self.points[key]

    def _lone(self, x: Point) -> int:
        """The tag of a point that no other curve shares."""
        return gmsh.model.geo.addPoint(*self.frame.local(*x), 0.0)

    def curve(self, curve: Curve) -> int:
        """The tag of the curve, drawn."""
        geo = gmsh.model.geo
        start, end = self.point(curve.start), self.point(curve.end)
        if isinstance(curve, Line):
            return geo.addLine(start, end)
        if isinstance(curve, Arc):
            centre = self._lone(curve.centre)
            if curve.major is None:
                return geo.addCircleArc(start, centre, end)
            return geo.addEllipseArc(start, centre, self._lone(curve.major), end)
        if isinstance(curve, Spline):
            inner = [self._lone((float(x), float(y))) for x, y in curve.points[1:-1]]
            return geo.addSpline([start, *inner, end])
        raise MeshError(
            f"a curve of kind {type(curve).__name__} cannot be drawn; use lines, arcs or splines"
        )


def draw_region(region: Region, frame: Frame) -> dict[str, list[int]]:
    """Draw, name the boundaries, and return the curves of each."""
    left, right = region.bottom[0].start, region.bottom[-1].end
    pen = _Pen(frame, tolerance=max(1e-9 * abs(right[0] - left[0]) / frame.length, GRID))
    upper_left, upper_right = (left[0], region.top), (right[0], region.top)
    sides = [
        region.bottom,
        (Line(right, upper_right),),
        (Line(upper_right, upper_left),),
        (Line(upper_left, left),),
    ]
    curves: dict[str, list[int]] = {}
    for name, side in zip(region.sides, sides, strict=True):
        curves.setdefault(name, []).extend(pen.curve(curve) for curve in side)
    for name, standing in region.standing.items():
        curves[name] = [pen.curve(curve) for curve in standing]
    outer = [
        tag for name in dict.fromkeys((*region.sides, *region.standing)) for tag in curves[name]
    ]
    loops = [gmsh.model.geo.addCurveLoop(outer, reorient=True)]
    for name, outline in region.holes.items():
        curves[name] = [pen.curve(curve) for curve in outline]
        loops.append(gmsh.model.geo.addCurveLoop(curves[name]))
    surface = gmsh.model.geo.addPlaneSurface(loops)
    gmsh.model.geo.synchronize()
    name_parts(2, surface, curves)
    return curves


def name_parts(dimension: int, fluid: int, boundary: dict[str, list[int]]) -> None:
    """Name the fluid, an entity of a dimension, and the parts of its boundary."""
    gmsh.model.addPhysicalGroup(dimension, [fluid], 1)
    gmsh.model.setPhysicalName(dimension, 1, "fluid")
    for tag, (name, members) in enumerate(boundary.items(), start=1):
        gmsh.model.addPhysicalGroup(dimension - 1, members, tag)
        gmsh.model.setPhysicalName(dimension - 1, tag, name)


def set_sizes(sizes: Sizes, curves: dict[str, list[int]], frame: Frame) -> None:
    """Let cells be as `sizes` says near curves by name, in a frame, and everywhere."""
    fields = gmsh.model.mesh.field
    parts = [_near_field(near, curves, frame) for near in sizes.near]
    if sizes.field is not None:
        points, lengths = (
            (sizes.field.points - frame.origin) / frame.length,
            sizes.field.sizes / frame.length,
        )
        parts.append(_adapted_field(replace(sizes.field, points=points, sizes=lengths)))
    whole = fields.add("MathEval")
    fields.setString(whole, "F", repr(frame.size(sizes.far)))
    least = fields.add("Min")
    fields.setNumbers(least, "FieldsList", [whole, *parts])
    set_background(least)


def set_background(field: int) -> None:
    """Take the sizes of cells from a field alone."""
    gmsh.model.mesh.field.setAsBackgroundMesh(field)
    for option in ("FromPoints", "ExtendFromBoundary", "FromCurvature"):
        _set_either(
            ("Mesh.MeshSize" + option, "Mesh.CharacteristicLength" + option),
            gmsh.option.setNumber,
            0,
        )


def view_field(kind: str, rows: Floats) -> int:
    """A field of sizes that are linear on triangles ("ST") or hexahedra ("SH"), as gmsh's views have them in rows."""
    view, fields = gmsh.view.add("sizes"), gmsh.model.mesh.field
    gmsh.view.addListData(view, kind, len(rows), rows.ravel())
    field = fields.add("PostView")
    fields.setNumber(field, "ViewTag", view)
    return int(field)


def _near_field(near: Near, curves: dict[str, list[int]], frame: Frame) -> int:
    """A field that grows linearly with the distance from the feature."""
    fields = gmsh.model.mesh.field
    size = fields.add("MathEval")
    if near.points:
        distances = [_distance_to(point, frame) for point in near.points]
        expression = distances[0]
        for other in distances[1:]:
            expression = f"Min({expression},{other})"
    else:
        distance = fields.add("Distance")
        _set_either(
            ("CurvesList", "EdgesList"), partial(fields.setNumbers, distance), curves[near.boundary]
        )
        samples = _samples(curves[near.boundary], frame.size(near.size))
        _set_either(("Sampling", "NumPointsPerCurve"), partial(fields.setNumber, distance), samples)
        expression = f"F{distance}"
    fields.setString(size, "F", f"{_size_at(near, frame)}+{near.growth!r}*({expression})")
    return size


def _distance_to(point: Place, frame: Frame) -> str:
    x, y = frame.local(point[0], point[1])
    return f"Sqrt((x-({x!r}))^2+(y-({y!r}))^2)"


def _size_at(near: Near, frame: Frame) -> str:
    """The size of cells at the feature itself."""
    away = near.away
    if away is None:
        return repr(frame.size(near.size))
    size, largest = frame.size(near.size), frame.size(away.largest)
    return f"Max({size!r},Min({largest!r},{away.growth!r}*{_distance_to(away.point, frame)}))"


def _adapted_field(wanted: SizeField) -> int:
    """The sizes wanted at the vertices of an earlier mesh; where that mesh does not reach there is no bound.

    Its triangles are enlarged, so that a curved boundary lies within them, and the sizes extrapolated.
    """
    corners, values = wanted.points[wanted.triangles], wanted.sizes[wanted.triangles]
    corners = corners + (ENLARGED - 1.0) * (corners - corners.mean(axis=1, keepdims=True))
    shifted = values + (ENLARGED - 1.0) * (values - values.mean(axis=1, keepdims=True))
    shifted = np.maximum(shifted, values.min(axis=1, keepdims=True))
    return view_field(
        "ST", np.hstack([corners[:, :, 0], corners[:, :, 1], np.zeros_like(values), shifted])
    )


def _samples(tags: list[int], size: float) -> int:
    """Enough points on the longest curve that the distance to them is that to the curve."""
    boxes = np.array([gmsh.model.getBoundingBox(1, tag) for tag in tags])
    longest = np.linalg.norm(boxes[:, 3:] - boxes[:, :3], axis=1).max()
    return int(np.clip(3 * longest / size, 20, 2000))


def _set_either(names: tuple[str, ...], put: Callable[[str, Any], None], value: Any) -> None:
    """Set the option under the first name this gmsh knows (they changed between 4.7 and 4.9)."""
    for name in names:
        try:
            put(name, value)
            return
        except Exception as error:
            if not _is_of_gmsh(error):
                raise
    raise MeshError(f"this gmsh knows none of the options {', '.join(names)}")


def _rectangle(grid: Grid, frame: Frame) -> tuple[list[tuple[int, str]], int]:
    """The lines of the sides, cut, in their order around with the sides' names, and what is between them."""
    length, geo = frame.size(grid.length), gmsh.model.geo
    corners = [(0.0, 0.0), (length, 0.0), (length, 1.0), (0.0, 1.0)]
    points = [geo.addPoint(*corner, 0.0) for corner in corners]
    stops = [[points[i], points[(i + 1) % 4]] for i in range(4)]
    for side, x, heights in ((1, length, grid.ends[:-1]), (3, 0.0, grid.ends[-2::-1])):
        stops[side][1:1] = [geo.addPoint(x, height, 0.0) for height in heights]
    for side, y, places in ((0, 0.0, grid.column_ends[:-1]), (2, 1.0, grid.column_ends[-2::-1])):
        stops[side][1:1] = [geo.addPoint(length * place, y, 0.0) for place in places]
    lines = [
        (geo.addLine(*ends), name)
        for name, along in zip(grid.sides, stops, strict=True)
        for ends in pairwise(along)
    ]
    name, number = grid.ahead
    lines[:number] = [(line, name) for line, _ in lines[:number]]
    upright, level = (
        [1] * len(grid.ends) or [grid.rows],
        [1] * len(grid.column_ends) or [grid.columns],
    )
    for (line, _), number in zip(lines, [*level, *upright] * 2, strict=True):
        geo.mesh.setTransfiniteCurve(line, number + 1, "Bump", grid.grading)
    surface = geo.addPlaneSurface([geo.addCurveLoop([line for line, _ in lines])])
    geo.mesh.setTransfiniteSurface(surface, "Alternate", points)
    return lines, surface


def _draw_solid_grid(grid: SolidGrid, frame: Frame) -> None:
    lines, surface = _rectangle(grid.grid, frame)
    geo, depth = gmsh.model.geo, frame.size(grid.across[1] - grid.across[0])
    made = geo.extrude(
        [(2, surface)], 0.0, 0.0, -depth, numElements=[1] * grid.layers, heights=list(grid.ends)
    )
    geo.synchronize()
    (_, far), (_, volume), *walls = made
    named: dict[str, list[int]] = {grid.sides[0]: [surface]}
    named.setdefault(grid.sides[1], []).append(far)
    for (_, name), (_, wall) in zip(lines, walls, strict=True):
        named.setdefault(name, []).append(wall)
    name_parts(3, volume, named)


def _draw_grid(grid: Grid, frame: Frame) -> None:
    lines, surface = _rectangle(grid, frame)
    curves: dict[str, list[int]] = {}
    for line, name in lines:
        curves.setdefault(name, []).append(line)
    gmsh.model.geo.synchronize()
    name_parts(2, surface, curves)


def _mesh(order: int) -> None:
    generate(2)
    gmsh.model.mesh.setOrder(order)
    kinds, _, _ = gmsh.model.mesh.getElements(2)
    if order > 1:
        _straighten_folded(kinds[0], order)


def generate(dimension: int) -> None:
    """Mesh what has been drawn. Raises MeshError if gmsh complains in its log, or makes no cells."""
    # Exceptions thrown from inside the mesher end the process: let it stop at its first error, and look.
    gmsh.option.setNumber("General.AbortOnError", 1)
    said = len(gmsh.logger.get())
    gmsh.model.mesh.generate(dimension)
    complaints = [line for line in gmsh.logger.get()[said:] if line.startswith("Error")]
    if complaints or len(gmsh.model.mesh.getElements(dimension)[0]) == 0:
        reason = complaints[0].removeprefix("Error: ") if complaints else "gmsh made no cells"
        raise MeshError(f"the geometry could not be meshed: {reason}; {REMEDY}")


def _put_in_place(frame: Frame, across: float | None = None) -> None:
    """Take the nodes of the mesh from the frame to the scene; in space x, z and -y are drawn, from a y on."""
    tags, places, _ = gmsh.model.mesh.getNodes()
    nodes = np.reshape(places, (-1, 3)) * frame.length
    nodes[:, :2] += frame.origin
    if across is not None:
        nodes = np.column_stack([nodes[:, 0], across - nodes[:, 2], nodes[:, 1]])
    # The library's own call: the Python function around it converts each number on its own.
    put, error, none = gmsh.lib.gmshModelMeshSetNode, c_int(), c_size_t(0)
    rows = nodes.ctypes.data
    for tag, row in zip(
        tags.tolist(), range(rows, rows + nodes.nbytes, nodes.strides[0]), strict=True
    ):
        put(c_size_t(tag), c_void_p(row), c_size_t(3), None, none, byref(error))
        if error.value:
            raise MeshError(f"gmsh could not move node {tag}")


def _straighten_folded(kind: int, order: int) -> None:
    """Give straight sides to cells in the cusps of a bed, where a curved side leaves no room.

    Raises MeshError if cells at the grain fold, or with a side on another boundary, where the true surface matters, or
    if others fold then.
    """
    _, _, _, count, local, _ = gmsh.model.mesh.getElementProperties(kind)
    places = np.reshape(local, (count, -1))
    corners = np.column_stack(
        [1.0 - places.sum(axis=1), places]
    )  # the weights of a cell's corners at its nodes
    grain, elsewhere = _nodes_on_curves("body"), _nodes_on_curves(other_than="bed")
    for _ in range(MOST_STRAIGHTENED):
        folded = _folded(kind, places)
        if not len(folded):
            return
        # Corners stay: where the domain ends in a cusp of the bed, one of them lies on that end.
        if np.isin(folded, grain).any() or np.isin(folded[:, 3:], elsewhere).any():
            break
        for cell in folded:
            points = np.array([gmsh.model.mesh.getNode(node)[0] for node in cell[:3]])
            for node, point in zip(cell[3:], corners[3:] @ points, strict=True):
                gmsh.model.mesh.setNode(node, point, [])
    raise MeshError(
        f"cells of order {order} fold over on a curved boundary: use a smaller numerics.mesh_size "
        "or numerics.geometry_order = 1"
    )


def _nodes_on_curves(name: str = "", other_than: str = "") -> np.ndarray:
    """Tags of the nodes on the boundary of a name, or on all but the one of another name."""
    found = [np.empty(0, dtype=np.uint64)]
    for dimension, group in gmsh.model.getPhysicalGroups(1):
        called = gmsh.model.getPhysicalName(dimension, group)
        if called == name if name else called != other_than:
            found.append(gmsh.model.mesh.getNodesForPhysicalGroup(dimension, group)[0])
    return np.concatenate(found)


def _folded(kind: int, places: np.ndarray) -> np.ndarray:
    """(cells, nodes of a cell) node tags of the cells whose map loses its sense at one of their nodes."""
    points = np.column_stack([places, np.zeros(len(places))])
    # The determinants gmsh gives for cells in the plane have lost their sign.
    jacobians = np.reshape(
        gmsh.model.mesh.getJacobians(kind, points.ravel())[0], (-1, len(places), 3, 3)
    )
    senses = np.linalg.det(jacobians[..., :2, :2])
    senses *= np.sign(np.median(senses))
    nodes = np.reshape(gmsh.model.mesh.getElementsByType(kind)[1], (-1, len(places)))
    return np.asarray(nodes[senses.min(axis=1) <= 0.0])
