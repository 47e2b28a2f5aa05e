"""Half a sphere of diameter one above a plane in shear u = z, symmetric about y = 0: a mesh for solvers in space."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gmsh
import numpy as np

from incipient.fluid import Condition, Open, Prescribed, Slip, no_slip
from incipient.meshes.simplices import Simplices

RADIUS = 0.5
GROWTH = 0.22  # of the cells, with the distance from the sphere
ACROSS = 0.8  # size of a cell in the gap below the sphere, relative to the gap there
QUADRATIC = 11  # gmsh's name of a tetrahedron of ten nodes, the last six on its edges
EDGES = ((0, 1), (1, 2), (2, 0), (3, 0), (3, 2), (3, 1))
# By the outward normal of the box's sides.
SIDES = {
    "inflow": (-1, 0, 0),
    "outflow": (1, 0, 0),
    "symmetry": (0, -1, 0),
    "aside": (0, 1, 0),
    "bed": (0, 0, -1),
    "top": (0, 0, 1),
}


def conditions() -> list[Condition]:
    """Shear enters and holds at the top, leaves freely; no flow through the planes along the stream."""

    def shear(x: np.ndarray, t: float) -> np.ndarray:
        return np.vstack([x[2], 0 * x[0], 0 * x[0]])

    sides = [Open("outflow"), Slip("aside", axis=1), Slip("symmetry", axis=1)]
    driven = [Prescribed(name, shear) for name in ("inflow", "top")]
    return [*sides, *driven, no_slip("bed"), no_slip("body")]


@contextmanager
def half_sphere(size: float, gap: float = 0.01, away: float = 10.0) -> Iterator[Any]:
    """The meshed gmsh model in quadratic cells: `size` of those at the sphere, sides `away` diameters from it."""
    with _session() as model:
        height = RADIUS + gap
        box = model.occ.addBox(-away, 0, 0, 2 * away, away, away)
        ball = model.occ.addSphere(0, 0, height, RADIUS)
        model.occ.cut([(3, box)], [(3, ball)])
        model.occ.synchronize()
        for name, members in _boundaries(away).items():
            model.setPhysicalName(2, model.addPhysicalGroup(2, members), name)
        model.addPhysicalGroup(3, [tag for _, tag in model.getEntities(3)])
        _set_sizes(model, size, gap, height)
        model.mesh.generate(3)
        model.mesh.setOrder(2)
        _unfold(model)
        yield model


def from_file(path: Path) -> Simplices:
    """A mesh made before."""
    with _session() as model:
        gmsh.open(str(path))
        groups = [tag for _, tag in model.getPhysicalGroups(2)]
        sides = {
            model.getPhysicalName(2, tag): model.getEntitiesForPhysicalGroup(2, tag)
            for tag in groups
        }
        return Simplices.read(sides, 3, 2).used()


@contextmanager
def _session() -> Iterator[Any]:
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        yield gmsh.model
    finally:
        gmsh.finalize()


def _boundaries(away: float) -> dict[str, list[int]]:
    """Tags of the surfaces by name: the sphere, and the sides of the box by where their middle is."""
    middle, half = np.array([0.0, away / 2, away / 2]), np.array([away, away / 2, away / 2])
    found: dict[str, list[int]] = {"body": [], **{name: [] for name in SIDES}}
    for _, tag in gmsh.model.getEntities(2):
        if gmsh.model.getType(2, tag) == "Sphere":
            found["body"].append(tag)
            continue
        place = (np.array(gmsh.model.occ.getCenterOfMass(2, tag)) - middle) / half
        side = max(SIDES, key=lambda name: float(np.dot(SIDES[name], place)))
        found[side].append(tag)
    return found


def _set_sizes(model: Any, size: float, gap: float, height: float) -> None:
    """Sizes grow with the distance from the sphere; below it they follow the width of the gap."""
    fields = model.mesh.field
    distance = f"(sqrt(x*x+y*y+(z-{height})*(z-{height}))-{RADIUS})"
    below = f"({RADIUS**2}-x*x-y*y)"
    width = f"({height}-sqrt(({below}+abs{below})/2))"
    beside, above = f"(abs{below}-{below})", f"abs(z-{width})"
    # Off the gap the second one is no less than the first.
    formulae = (f"{size}+{GROWTH}*abs{distance}", f"{ACROSS}*{width}+{GROWTH}*({above}+{beside})")
    for tag, formula in enumerate(formulae, start=1):
        fields.add("MathEval", tag)
        fields.setString(tag, "F", formula)
    fields.add("Min", 3)
    fields.setNumbers(3, "FieldsList", [1, 2])
    fields.setAsBackgroundMesh(3)
    for option in ("FromPoints", "ExtendFromBoundary", "FromCurvature"):
        gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)


def _unfold(model: Any) -> None:
    """Straighten the edges of quadratic cells that fold over. Raises ValueError where that does not help."""
    places = model.mesh.getElementProperties(QUADRATIC)[4]
    for _ in range(5):
        senses = model.mesh.getJacobians(QUADRATIC, places)[1].reshape(-1, len(places) // 3)
        folded = (senses * np.sign(senses.sum())).min(axis=1) <= 0
        if not folded.any():
            return
        cells = model.mesh.getElementsByType(QUADRATIC)[1].reshape(-1, 10)[folded]
        for cell in cells:
            points = np.array([model.mesh.getNode(node)[0] for node in cell])
            for node, (one, other) in zip(cell[4:], EDGES, strict=True):
                model.mesh.setNode(node, (points[one] + points[other]) / 2, [])
    raise ValueError("cells fold over: take another size")
