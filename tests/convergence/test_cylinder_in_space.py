"""Lift on a cylinder across a square channel, a thousandth of its drag, on cells that are their own mirror image."""

from __future__ import annotations

from typing import Any

import gmsh
import numpy as np
import pytest
from domains import drawn
from mpi4py import MPI

from incipient import compat
from incipient.coupled.tractions import TractionProbe
from incipient.fluid import FlowModel, Fluid, Open, Prescribed, Slip, no_slip
from incipient.mesh.domain import Domain
from incipient.meshes.session import session
from incipient.meshes.simplices import Simplices

# isort: split
import dolfinx

# Metres: benchmark 3D-1Z of Schaefer & Turek (1996), the height measured from the cylinder's axis.
LENGTH, WIDTH, DIAMETER, BEHIND, BELOW, ABOVE = 2.5, 0.41, 0.1, 0.5, 0.2, 0.21
HEIGHT, MEAN, VISCOSITY = BELOW + ABOVE, 0.2, 1e-3
MIRRORED = 0.1  # up to this distance from the axis cells above and below are mirror images, farther off nearly so
PLANES = {"inflow": (0, 0.0), "outflow": (0, LENGTH), "symmetry": (1, 0.0), "aside": (1, WIDTH / 2)}
PLANES |= {"bottom": (2, -BELOW), "top": (2, ABOVE)}
GROWTH, LARGEST = 0.2, 0.05


def upper_quarter(size: float) -> Simplices:
    """Cells of order two above the axis on one side of the middle, `size` at the cylinder."""
    with session():
        model = gmsh.model
        box = model.occ.addBox(0, 0, 0, LENGTH, WIDTH / 2, ABOVE)
        rod = model.occ.addCylinder(BEHIND, 0, 0, 0, WIDTH / 2, 0, DIAMETER / 2)
        model.occ.cut([(3, box)], [(3, rod)])
        model.occ.synchronize()
        from_axis = f"sqrt((x-{BEHIND})*(x-{BEHIND})+z*z)"
        model.mesh.field.add("MathEval", 1)
        model.mesh.field.setString(
            1, "F", f"min({LARGEST}, {size}+{GROWTH}*({from_axis}-{DIAMETER / 2}))"
        )
        model.mesh.field.setAsBackgroundMesh(1)
        for option in ("FromPoints", "ExtendFromBoundary", "FromCurvature"):
            gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)
        return drawn({}, 3, 2)


def mirrored_channel(size: float) -> Domain:
    """Half of the channel: the cells above the axis and their mirror image, which is flatter far from the cylinder."""
    above = upper_quarter(size)
    nodes, cells = above.points, above.cells[:, compat.gmsh_order(3, 10)]
    depth = nodes[:, 2]
    flatter = np.minimum(depth, MIRRORED) + np.maximum(depth - MIRRORED, 0) * (BELOW - MIRRORED) / (
        ABOVE - MIRRORED
    )
    below = np.column_stack([nodes[:, :2], -flatter])
    own = depth > 1e-9  # the others lie in the plane through the axis and belong to both
    number = np.arange(len(nodes))
    number[own] = len(nodes) + np.arange(own.sum())
    mesh = compat.create_mesh(
        MPI.COMM_WORLD,
        np.vstack([cells, number[cells]]).astype(np.int64),
        np.vstack([nodes, below[own]]),
        2,
    )
    return _named(mesh)


def _named(mesh: Any) -> Domain:
    """Boundaries by the planes in which they lie; what is left is the cylinder."""
    facets = compat.exterior_facets(mesh)
    tags = np.full(len(facets), len(PLANES) + 1, dtype=np.int32)
    for tag, (axis, place) in enumerate(PLANES.values(), start=1):
        there = dolfinx.mesh.locate_entities_boundary(
            mesh, 2, lambda x, axis=axis, place=place: np.isclose(x[axis], place, atol=1e-9)
        )
        tags[np.isin(facets, there)] = tag
    names = {name: tag for tag, name in enumerate((*PLANES, "body"), start=1)}
    order = np.argsort(facets)
    return Domain(
        mesh, dolfinx.mesh.meshtags(mesh, 2, facets[order].astype(np.int32), tags[order]), names
    )


def coefficients(size: float, order: int = 2) -> tuple[float, float, int]:
    """Drag and lift coefficients, and the number of unknowns."""

    def stream(x: np.ndarray, t: float) -> np.ndarray:
        across, up = WIDTH / 2 - x[1], x[2] + BELOW
        speed = 16 * 0.45 * across * (WIDTH - across) * up * (HEIGHT - up) / HEIGHT**4
        return np.vstack([speed, 0 * speed, 0 * speed])

    walls = [no_slip(name) for name in ("aside", "bottom", "top", "body")]
    conditions = [Open("outflow"), Slip("symmetry", axis=1), Prescribed("inflow", stream), *walls]
    model = FlowModel(order=order, solver="block")
    with Fluid(mirrored_channel(size), model, conditions, 1 / VISCOSITY) as fluid:
        assert fluid.solve(1e-7).converged
        force = TractionProbe(fluid, "body", (BEHIND, 0.0, 0.0)).resultant().force
        drag, _, lift = 2 * force / (MEAN**2 * DIAMETER * HEIGHT)
        return float(drag), float(lift), fluid.space.unknowns


@pytest.mark.slow
def test_drag_and_lift_of_a_cylinder_across_a_channel() -> None:
    """C_D = 6.18533 and C_L = 0.009401 by Bayraktar, Mierka & Turek (2012): to 0.1% and 1%; found 0.03% and 0.75%."""
    drag, lift, _ = coefficients(0.05 * DIAMETER)
    assert drag == pytest.approx(6.18533, rel=1e-3)
    assert lift == pytest.approx(0.009401, rel=1e-2)
