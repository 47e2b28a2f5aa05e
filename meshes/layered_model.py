"""gmsh models of plane regions with layers of thin triangles along their walls."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np

from incipient.arrays import Floats, Integers, planar_cross
from incipient.errors import MeshError
from incipient.interrupt import handlers_kept

from .model import complaints_as_errors, draw_region, generate, session, set_sizes
from .plane_layers import ROOM, Boundary, Columns, Layered, columns_on, layers_on, room_at
from .region import Frame, Region, Sizes, WallLayers
from .triangles import Triangles, areas

with handlers_kept():  # at its import gmsh takes interrupts for itself
    import gmsh

ATTEMPTS, LESS = 4, 0.6  # at layers between which there is a mesh, each thinner
MOST_TRIALS = 40  # at layers whose cells are not inside out


@contextmanager
def layered_model(region: Region, sizes: Sizes, order: int) -> Iterator[Any]:
    """Yield the gmsh model of a region meshed with triangles of order 1 or 2 and layers along walls, as `sizes` says.

    Not collective: one rank draws.

    Raises:
        MeshError: gmsh finds no mesh, there is no room for the layers, or cells fold over.
    """
    if order not in (1, 2):
        raise MeshError(
            f"cells in layers are of order 1 or 2, not {order}: change numerics.geometry_order"
        )
    assert sizes.layers is not None
    with session() as model:
        with complaints_as_errors():
            frame = Frame.of(region)
            curves = draw_region(region, frame)
            set_sizes(sizes, curves, frame)
            generate(1)
            model.mesh.setOrder(2)
            boundary = Boundary.read(curves)
            made = _meshed(boundary, sizes, frame, order)
            gmsh.clear()
            replace(made, points=made.points * frame.length + frame.origin).put()
        yield model


def _meshed(boundary: Boundary, sizes: Sizes, frame: Frame, order: int) -> Triangles:
    """The mesh of a region in a frame: layers, as thick as there is room, and free triangles between them."""
    assert sizes.layers is not None
    layers = replace(
        sizes.layers, first={name: frame.size(one) for name, one in sizes.layers.first.items()}
    )
    columns = columns_on(boundary, layers)
    part = ROOM
    for attempt in range(ATTEMPTS):
        made = _sound(boundary, columns, room_at(boundary, columns, part), layers)
        gmsh.clear()
        try:
            found = _filled(boundary, columns, made, sizes, frame)
            break
        except MeshError:
            if attempt == ATTEMPTS - 1:
                raise
        part *= LESS
    curved = found if order == 1 else found.curved(*_shifts(boundary, columns, made))
    return curved.used()


def _sound(boundary: Boundary, columns: Columns, thickness: Floats, layers: WallLayers) -> Layered:
    """Layers as thick as given, thinner where cells would be inside out."""
    for _ in range(MOST_TRIALS):
        made = layers_on(boundary, columns, thickness, layers)
        wrong = made.cells[areas(made.points, made.cells) <= 0.0]
        if not len(wrong):
            return made
        thickness = np.where(np.isin(made.rows, wrong).any(axis=1), LESS * thickness, thickness)
    raise MeshError(
        "there is no room for layers of cells along the walls: use another numerics.mesh_size"
    )


def _filled(
    boundary: Boundary, columns: Columns, made: Layered, sizes: Sizes, frame: Frame
) -> Triangles:
    """Layers and, between them, free triangles, of order one."""
    walls = {boundary.names[k] for k in columns.edges if k >= 0}
    lines = _lines(boundary, columns, made, walls)
    geo, curves = gmsh.model.geo, dict[str, list[int]]()
    tags = {k: geo.addPoint(*made.points[k], 0.0) for k in sorted({start for _, start, _ in lines})}
    drawn = list[int]()
    for name, start, end in lines:
        drawn.append(geo.addLine(tags[start], tags[end]))
        curves.setdefault(name, []).append(drawn[-1])
        if name in walls:
            geo.mesh.setTransfiniteCurve(drawn[-1], 2)
    loops = sorted(_loops(lines), key=lambda loop: -_area(made.points[[lines[k][1] for k in loop]]))
    geo.addPlaneSurface([geo.addCurveLoop([drawn[k] for k in loop]) for loop in loops])
    geo.synchronize()
    set_sizes(sizes, curves, frame)
    generate(2)
    nodes, places, _ = gmsh.model.mesh.getNodes()
    row, count = np.full(int(nodes.max()) + 1, -1), len(made.points)
    for point, tag in tags.items():
        row[gmsh.model.mesh.getNodes(0, tag)[0].astype(np.int64)] = point
    fresh = nodes.astype(np.int64)[row[nodes.astype(np.int64)] < 0]
    row[fresh] = count + np.arange(len(fresh))
    points = np.empty((count + len(fresh), 2))
    points[row[nodes.astype(np.int64)]] = np.reshape(places, (-1, 3))[:, :2]
    points[:count] = made.points
    free = row[_of_kind(2, 3)]
    free = np.where(areas(points, free)[:, None] < 0.0, free[:, [0, 2, 1]], free)
    sides = {
        name: [row[_of_kind(1, 2, tag)] for tag in part]
        for name, part in curves.items()
        if name not in walls
    }
    for column, edge in columns.ends:
        rows = made.rows[column]
        sides[boundary.names[edge]].append(
            np.column_stack([rows[:-1], rows[1:]])[rows[1:] > rows[:-1]]
        )
    for name in sorted(walls):
        sides[name] = [
            boundary.edges[[k for k in columns.edges if k >= 0 and boundary.names[k] == name]]
        ]
    named = {name: np.concatenate(part) for name, part in sides.items()}
    return Triangles(points, np.concatenate([made.cells, free]), named)


def _lines(
    boundary: Boundary, columns: Columns, made: Layered, walls: set[str]
) -> list[tuple[str, int, int]]:
    """Name, start and end of the straight lines around what layers leave free; sides are one line each."""
    tops, top = made.tops, dict(zip(columns.foot.tolist(), made.tops.tolist(), strict=True))
    lines = [
        (boundary.names[edge if edge >= 0 else -1 - edge], int(tops[a]), int(tops[b]))
        for (a, b), edge in zip(columns.pairs, columns.edges, strict=True)
    ]
    for name, run in groupby(range(len(boundary.edges)), lambda k: boundary.names[k]):
        if name not in walls:
            edges = boundary.edges[list(run)]
            start, end = int(edges[0, 0]), int(edges[-1, 1])
            lines.append((name, top.get(start, start), top.get(end, end)))
    return [one for one in lines if one[1] != one[2]]


def _loops(lines: list[tuple[str, int, int]]) -> list[list[int]]:
    """The lines (numbers) in closed loops."""
    following, loops = {start: k for k, (_, start, _) in enumerate(lines)}, []
    while following:
        loop = [following.pop(next(iter(following)))]
        while (end := lines[loop[-1]][2]) in following:
            loop.append(following.pop(end))
        loops.append(loop)
    return loops


def _area(corners: Floats) -> float:
    """The area within a closed line."""
    return abs(float(planar_cross(corners, np.roll(corners, -1, axis=0)).sum()))


def _of_kind(kind: int, nodes: int, entity: int = -1) -> Integers:
    """Tags of the nodes (m, nodes) of gmsh's cells of a kind, of all entities or of one."""
    return np.asarray(
        gmsh.model.mesh.getElementsByType(kind, entity)[1].astype(np.int64).reshape(-1, nodes)
    )


def _shifts(boundary: Boundary, columns: Columns, made: Layered) -> tuple[Integers, Floats]:
    """Edges (k, 2) over curved edges of walls, and how far (k, 2) their middles are off: the less the farther."""
    chosen = columns.edges >= 0
    edges, pairs = columns.edges[chosen], columns.pairs[chosen]
    off = boundary.middles[edges] - boundary.points[boundary.edges[edges]].mean(axis=1)
    found, shifts = list[Integers](), list[Floats]()
    last = made.rows.shape[1] - 1
    for up, down in ((0, 0), (1, 0), (0, 1)):  # along a layer, and both diagonals
        for j in range(last + 1 - max(up, down)):
            a, b = pairs.T
            found.append(np.column_stack([made.rows[a, j + up], made.rows[b, j + down]]))
            shifts.append(0.5 * (made.share[a, j + up] + made.share[b, j + down])[:, None] * off)
    return np.concatenate(found), np.concatenate(shifts)
