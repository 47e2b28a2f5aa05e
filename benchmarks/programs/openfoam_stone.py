"""OpenFOAM's simpleFoam around a stone on a bed below a lid without friction: its case written, run, and read.

The walls lie a distance beyond the outline of bed and stone that is given. Cells at walls are quadrilaterals twice as
high as that, whose centres lie on the outline, on all meshes; beyond them gmsh fills the channel with quadrilaterals
and some triangles.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import gmsh
import numpy as np

from . import openfoam
from .openfoam import Inflow, Schemes

WALLS = (
    "bed",
    "left",
    "stone",
    "right",
)  # of the outline: bed, lines that close the space at contacts, stone
THICKNESS = 0.1  # of the one layer of cells
FARTHEST = 3.0  # cells below the lid, over those at the stone
RELAXATION = (0.7, 0.5)
KINDS = {
    3: 6,
    4: 5,
}  # gmsh's numbers of prisms and hexahedra, by the corners of the cells that they stand on


@dataclass(frozen=True)
class Outline:
    """Where bed, lines and stone are, from the inflow to the outflow.

    points (n, 2), and for each of the n - 1 pieces between them the number of its wall in `WALLS`
    """

    points: np.ndarray
    walls: np.ndarray

    def beyond(self, distance: float) -> np.ndarray:
        """Points (n, 2) of the outline moved out of the flow, each piece by the distance; ends move along the sides."""
        along = np.diff(self.points, axis=0)
        outward = (
            np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
        )
        before, after = np.vstack([outward[:1], outward]), np.vstack([outward, outward[-1:]])
        both = (before + after) / (1.0 + (before * after).sum(axis=1, keepdims=True))
        both[[0, -1]] = [[0.0, 1.0 / outward[0, 1]], [0.0, 1.0 / outward[-1, 1]]]
        return np.asarray(self.points + distance * both)


@dataclass(frozen=True)
class Found:
    """What is found at the pieces (n,) of the outline, and what it took.

    pressure is that at the centres of cells, on the outline; friction (n, 2) the wall's stress on the flow next to it,
    reversed; y_plus that of the centres, from k
    """

    pressure: np.ndarray
    friction: np.ndarray
    y_plus: np.ndarray
    cells: int
    iterations: int
    seconds: float


def is_installed() -> bool:
    """Whether simpleFoam and gmshToFoam are there."""
    return openfoam.is_installed("gmshToFoam")


def solve(
    directory: Path,
    outline: Outline,
    height: float,
    inflow: Inflow,
    distance: float,
    law: tuple[float, float],
    convection: str,
) -> Found:
    """Write, mesh and run a case.

    `height` is that of the lid, `law` kappa and the constant of the logarithmic law, `convection` OpenFOAM's scheme for
    the velocity.

    Raises:
        RuntimeError: SIMPLE has not converged.
    """
    kappa, constant = law
    schemes = Schemes(1, RELAXATION, convection)
    entries = f"kappa {kappa:g}; E {np.exp(kappa * constant):.8g}; "
    for name, text in openfoam.case(inflow, WALLS, ("lid",), entries, schemes).items():
        (directory / name).parent.mkdir(parents=True, exist_ok=True)
        (directory / name).write_text(text, encoding="utf-8")
    wall = outline.beyond(distance)
    cells = _write_mesh(directory / "stone.msh", wall, outline, outline.beyond(-distance), height)
    openfoam.run(directory, "gmshToFoam", "stone.msh")
    name_kinds(directory / "constant/polyMesh/boundary")
    iterations, seconds = openfoam.solve(directory)
    openfoam.run(directory, "simpleFoam", "-postProcess", "-latestTime", "-func", "wallShearStress")
    read = read_walls(directory, str(iterations), wall, distance, inflow.viscosity)
    return Found(*read, cells, iterations, seconds)


# -- the mesh ----------------------------------------------------------------------------------------


def _filled(edge: np.ndarray, height: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """gmsh's cells between an edge (n, 2), whose points come first, and the lid: points (m, 2), corners of cells."""
    least = np.linalg.norm(np.diff(edge, axis=0), axis=1).min()
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.Algorithm", 6)
        occ, spacing = gmsh.model.geo, np.linalg.norm(np.diff(edge, axis=0), axis=1)
        sizes = np.maximum(np.append(spacing, spacing[-1]), np.append(spacing[0], spacing))
        far = FARTHEST * float(np.median(spacing))
        points = [
            occ.addPoint(x, y, 0.0, s)
            for (x, y), s in zip(edge.tolist(), sizes.tolist(), strict=True)
        ]
        corners = [occ.addPoint(edge[k, 0], height, 0.0, max(far, least)) for k in (-1, 0)]
        ring = [*points, *corners]
        lines = [occ.addLine(a, b) for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)]
        for line in lines[: len(edge) - 1]:
            occ.mesh.setTransfiniteCurve(line, 2)
        surface = occ.addPlaneSurface([occ.addCurveLoop(lines)])
        occ.synchronize()
        gmsh.model.mesh.setRecombine(2, surface)
        gmsh.model.mesh.generate(2)
        tags, places, _ = gmsh.model.mesh.getNodes()
        first = [int(gmsh.model.mesh.getNodes(0, point)[0][0]) for point in points]
        rest = sorted(set(map(int, tags)) - set(first))
        number = {tag: k for k, tag in enumerate([*first, *rest])}
        where = dict(zip(map(int, tags), places.reshape(-1, 3)[:, :2], strict=True))
        cells = []
        for kind, corner in ((2, 3), (3, 4)):
            _, nodes = gmsh.model.mesh.getElementsByType(kind)
            cells.append(np.array([number[int(node)] for node in nodes]).reshape(-1, corner))
        return np.array([where[tag] for tag in number]), cells
    finally:
        gmsh.finalize()


def _write_mesh(
    path: Path, wall: np.ndarray, outline: Outline, edge: np.ndarray, height: float
) -> int:
    """Write one layer of cells; how many there are."""
    points, (triangles, squares) = _filled(edge, height)
    n = len(wall)
    k = np.arange(n - 1)
    # points of the wall come first, those of the edge follow
    strip = np.column_stack([k, k + 1, n + k + 1, n + k])
    cells = [triangles + n, np.vstack([strip, squares + n])]
    return write_cells(path, np.vstack([wall, points]), cells, outline.walls, height)


def write_cells(
    path: Path, flat: np.ndarray, cells: list[np.ndarray], walls: np.ndarray, height: float
) -> int:
    """Write one layer of cells in gmsh's format 2.2; how many there are.

    The first points of `flat` (n, 2) are those of the wall, in order; `walls` (m,) numbers its pieces in `WALLS`;
    `cells` are the corners of triangles (k, 3) and of quadrilaterals (l, 4).
    """
    whole = len(flat)
    sides: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for group in cells:
        for cell in group.tolist():
            for a, b in zip(cell, [*cell[1:], cell[0]], strict=True):
                sides.setdefault((min(a, b), max(a, b)), []).append((a, b))
    names = ("fluid", *WALLS, "inlet", "outlet", "lid", "sides")
    elements: list[tuple[int, int, list[int]]] = []
    for (a, b), owners in sides.items():
        if len(owners) == 1:
            name = _side(flat[[a, b]], (a, b), walls, height)
            elements.append((3, names.index(name) + 1, [a, b, b + whole, a + whole]))
    for group in cells:
        for cell in group.tolist():
            face = 2 if len(cell) == 3 else 3
            upper = [c + whole for c in cell]
            elements += [
                (face, len(names), cell),
                (face, len(names), upper),
                (KINDS[len(cell)], 1, [*cell, *upper]),
            ]
    nodes = [(x, y, z) for z in (0.0, THICKNESS) for x, y in flat.tolist()]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'{2 if i else 3} {i + 1} "{name}"' for i, name in enumerate(names)]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(nodes))]
    lines += [f"{i + 1} {x:.12g} {y:.12g} {z:.12g}" for i, (x, y, z) in enumerate(nodes)]
    lines += ["$EndNodes", "$Elements", str(len(elements))]
    for i, (kind, group_tag, corners) in enumerate(elements):
        lines.append(
            f"{i + 1} {kind} 2 {group_tag} {group_tag} {' '.join(str(c + 1) for c in corners)}"
        )
    path.write_text("\n".join([*lines, "$EndElements", ""]), encoding="utf-8")
    return sum(map(len, cells))


def _side(ends: np.ndarray, numbers: tuple[int, int], walls: np.ndarray, height: float) -> str:
    """The patch of an edge that only one cell has."""
    if max(numbers) <= len(walls) and abs(numbers[0] - numbers[1]) == 1:
        return WALLS[walls[min(numbers)]]
    if np.abs(ends[:, 1] - height).max() < 1e-9:
        return "lid"
    return "inlet" if ends[:, 0].mean() < 1e-9 else "outlet"


def name_kinds(path: Path) -> None:
    """Make patches walls, and the sides empty."""
    text = path.read_text(encoding="utf-8")
    for name in (*WALLS, "sides"):
        kind = "wall" if name in WALLS else "empty"
        text = re.sub(
            rf"(\b{name}\s*\{{\s*type\s+)\w+;(\s*physicalType\s+\w+;)?", rf"\g<1>{kind};", text
        )
    path.write_text(text, encoding="utf-8")


# -- what is found -----------------------------------------------------------------------------------


def read_walls(
    directory: Path,
    time: str,
    wall: np.ndarray,
    distance: float,
    viscosity: float,
    names: tuple[str, ...] = WALLS,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pressure, friction and y+ at the pieces of the outline, which belong to walls of these names."""
    mesh = directory / "constant/polyMesh"
    points = _vectors((mesh / "points").read_text(encoding="utf-8"))
    faces = re.findall(r"^\d+\(([\d ]+)\)", (mesh / "faces").read_text(encoding="utf-8"), re.M)
    owners = _numbers((mesh / "owner").read_text(encoding="utf-8")).astype(int)
    pressure, k = (
        _numbers((directory / time / name).read_text(encoding="utf-8")) for name in ("p", "k")
    )
    stress = (directory / time / "wallShearStress").read_text(encoding="utf-8")
    middles = 0.5 * (wall[1:] + wall[:-1])
    found = np.full((len(middles), 4), np.nan)
    for name in names:
        count, start = map(
            int,
            re.search(  # type: ignore[union-attr]
                rf"\b{name}\s*\{{.*?nFaces\s+(\d+);\s*startFace\s+(\d+);",
                (mesh / "boundary").read_text(encoding="utf-8"),
                re.S,
            ).groups(),
        )
        rows = _vectors(re.search(rf"\b{name}\s*\{{(.*?)\}}", stress, re.S)[1])  # type: ignore[index]
        for i in range(count):
            centre = points[np.array(faces[start + i].split(), dtype=int), :2].mean(axis=0)
            piece = int(np.argmin(np.linalg.norm(middles - centre, axis=1)))
            cell = owners[start + i]
            found[piece] = pressure[cell], -rows[i, 0], -rows[i, 1], k[cell]
    assert np.isfinite(found).all()
    y_plus = 0.09**0.25 * np.sqrt(found[:, 3]) * distance / viscosity
    return found[:, 0], found[:, 1:3], y_plus


def _vectors(text: str) -> np.ndarray:
    return np.array(re.findall(r"\(([^()\s]+) ([^()\s]+) ([^()\s]+)\)", text), dtype=float)


def _numbers(text: str) -> np.ndarray:
    """The first list of numbers of a file, one a line."""
    return np.array(re.search(r"\n\(\n(.*?)\n\)", text, re.S)[1].split(), dtype=float)  # type: ignore[index]
