"""Small domains that several tests use: unit boxes, a ring, boxes with a hole; all drawn by gmsh, all named.

gmsh is that of the package: its own import would take interrupts away from pytest, and from what tests raise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from mpi4py import MPI  # first: PyPI's dolfinx finds its MPI only then

# isort: split
import dolfinx
import numpy as np
import ufl
from floating import box_around

from incipient import compat
from incipient.arrays import Point
from incipient.geometry.placement import Placement
from incipient.geometry.plane.curves import Line
from incipient.geometry.plane.grains import Rectangle
from incipient.mesh.domain import Domain, build
from incipient.meshes import Grid, graded_ends
from incipient.meshes.model import meshed
from incipient.meshes.session import gmsh, session
from incipient.meshes.simplices import Simplices


def rectangle(
    origin: Point, length: float, height: float, columns: int, rows: int, grading: float = 1.0
) -> Grid:
    """A grid of a rectangle with sides "left", "right", "bottom" and "top"."""
    extents = tuple((low, low + side) for low, side in zip(origin, (length, height), strict=True))
    return Grid(extents, (graded_ends(columns, grading), graded_ends(rows, grading)), SIDES[:4])


SIDES = ("left", "right", "bottom", "top", "front", "back")


def unit_box(gdim: int, n: int, comm: MPI.Comm = MPI.COMM_WORLD) -> Domain:
    """The unit square or cube with n cells along a side; boundaries `SIDES[: 2 * gdim]`."""
    return curved_box(gdim, n, 1, comm)


def named_by_planes(mesh: Any, planes: Mapping[str, tuple[int, float]], rest: str = "") -> Domain:
    """Boundaries named by the axis and the place of the plane in which they lie; what is left is the `rest`."""
    facets, dimension = compat.exterior_facets(mesh), mesh.topology.dim - 1
    tags = np.full(len(facets), len(planes) + 1, dtype=np.int32)
    for tag, (axis, place) in enumerate(planes.values(), start=1):
        there = dolfinx.mesh.locate_entities_boundary(
            mesh, dimension, lambda x, axis=axis, place=place: np.isclose(x[axis], place, atol=1e-9)
        )
        tags[np.isin(facets, there)] = tag
    names = {name: tag for tag, name in enumerate((*planes, *filter(None, [rest])), start=1)}
    order = np.argsort(facets)
    tagged = facets[order].astype(np.int32), tags[order]
    return Domain(mesh, dolfinx.mesh.meshtags(mesh, dimension, *tagged), names)


def curved_box(gdim: int, n: int, order: int, comm: MPI.Comm = MPI.COMM_WORLD) -> Domain:
    """The unit square or cube in cells of a geometric order; boundaries as in `unit_box`.

    Straight cells have parallel diagonals in 3-D, others such that lead inwards: waves converge faster on these.
    """
    ends = (graded_ends(n, 1.0),) * gdim
    grid = Grid(((0.0, 1.0),) * gdim, ends, SIDES[: 2 * gdim], parallel=order == 1)
    return build(comm, partial(meshed, grid, order=order))


def bent_box(gdim: int, n: int, order: int) -> Any:
    """A mesh of the unit box bent by polynomials of the order of its cells: the same domain for every n."""
    mesh = curved_box(gdim, n, order).mesh
    x, y = mesh.geometry.x[:, :2].T.copy()
    mesh.geometry.x[:, 0] += 0.2 * y**order
    mesh.geometry.x[:, 1] += 0.3 * x ** (order - 1) * y
    if gdim == 3:
        mesh.geometry.x[:, 2] += 0.2 * x * mesh.geometry.x[:, 2]
    return mesh


def square_in_box(
    size: float, cell: float, order: int = 1, comm: MPI.Comm = MPI.COMM_WORLD
) -> Domain:
    """The box (0, 2) x (0, 1) less a square ("body") of a size about (0.8, 0.55), with straight sides."""
    return box_around(
        Rectangle(size, size),
        Placement((0.8, 0.55)),
        cell=cell / 2,
        far=cell,
        high=(2.0, 1.0),
        order=order,
        comm=comm,
    )


def integral(domain: Domain, integrand: Any) -> float:
    """The integral over all ranks. Collective."""
    return float(domain.comm.allreduce(dolfinx.fem.assemble_scalar(compat.form(integrand))))


def measures(domain: Domain) -> dict[str, float]:
    """The area or volume of a domain (of no name), and what each of its boundaries measures. Collective."""
    one = dolfinx.fem.Constant(domain.mesh, 1.0)
    forms = {name: one * domain.measure(name)(degree=6) for name in domain.names}
    forms[""] = one * ufl.dx(domain=domain.mesh, degree=8)
    return {name: integral(domain, form) for name, form in forms.items()}


def square_outline(centre: tuple[float, float], size: float) -> tuple[Line, ...]:
    """Counter-clockwise sides of a square."""
    corners = np.array(centre) + 0.5 * size * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    ends = [(float(x), float(y)) for x, y in corners]
    return tuple(Line(ends[k], ends[(k + 1) % 4]) for k in range(4))


def ring(
    inner: float, outer: float, around: int, order: int, comm: MPI.Comm = MPI.COMM_WORLD
) -> Domain:
    """The ring between two circles about the origin, `around` cells round each; boundaries "inner", "outer"."""
    return build(comm, partial(_ring_model, (inner, outer), around, order))


def ball_in_box(cell: float, comm: MPI.Comm = MPI.COMM_WORLD) -> Domain:
    """The box (0, 1.5) x (0, 1) x (0, 1) less a ball ("body") of radius 1/4 about (0.6, 0.5, 0.5), quadratic cells."""
    return build(comm, partial(_ball_in_box_model, cell))


def drawn(boundaries: dict[str, list[int]], dimension: int, order: int) -> Simplices:
    """The cells of what has been drawn, with its boundaries."""
    gmsh.model.mesh.generate(dimension)
    gmsh.model.mesh.setOrder(order)
    return Simplices.read(boundaries, dimension, order).used()


def square_without_a_name(unnamed: int) -> Simplices:
    """The unit square of which the last sides have no name."""
    square = meshed(rectangle((0.0, 0.0), 1.0, 1.0, 2, 2))
    return replace(square, sides=dict([*square.sides.items()][: 4 - unnamed]))


def spoilt(error: Exception) -> Simplices:
    """A drawing that fails."""
    raise error


def _ring_model(radii: tuple[float, float], around: int, order: int) -> Simplices:
    with session():
        geo, loops, curves = gmsh.model.geo, [], {}
        centre = geo.addPoint(0, 0, 0)
        for name, radius in zip(("inner", "outer"), radii, strict=True):
            quarters = [(radius, 0), (0, radius), (-radius, 0), (0, -radius)]
            points = [geo.addPoint(*quarter, 0) for quarter in quarters]
            curves[name] = [
                geo.addCircleArc(points[k], centre, points[(k + 1) % 4]) for k in range(4)
            ]
            loops.append(geo.addCurveLoop(curves[name]))
            for curve in curves[name]:
                geo.mesh.setTransfiniteCurve(curve, around // 4 + 1)
        geo.addPlaneSurface([loops[1], loops[0]])
        geo.synchronize()
        return drawn(curves, 2, order)


def _ball_in_box_model(cell: float) -> Simplices:
    with session():
        model = gmsh.model
        box, ball = model.occ.addBox(0, 0, 0, 1.5, 1, 1), model.occ.addSphere(0.6, 0.5, 0.5, 0.25)
        model.occ.cut([(3, box)], [(3, ball)])
        model.occ.synchronize()
        boundaries: dict[str, list[int]] = {"outer": [], "body": []}
        for _, tag in model.getEntities(2):
            boundaries["body" if model.getType(2, tag) == "Sphere" else "outer"].append(tag)
        model.mesh.setSize(model.getEntities(0), cell)
        ends = model.getBoundary([(2, tag) for tag in boundaries["body"]], recursive=True)
        model.mesh.setSize(ends, cell / 2)
        made = drawn(boundaries, 3, 2)
        kinds, _, _ = model.mesh.getElements(3)
        corners_and_middles = model.mesh.getElementProperties(kinds[0])[4]
        senses = model.mesh.getJacobians(kinds[0], corners_and_middles)[1]
        assert senses.min() * senses.max() > 0, "cells fold over: take another size"
        return made
