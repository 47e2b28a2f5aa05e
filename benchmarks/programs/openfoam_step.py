"""OpenFOAM's simpleFoam on a backward-facing step between walls: its case written, run, and read.

Graded quadrilaterals whose height at walls is the same on all meshes. Lengths are over the height of the step,
velocities over the reference one.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import openfoam
from .openfoam import Inflow

AHEAD, BEHIND, ABOVE = 4.0, 30.0, 8.0  # of the step
AT_WALL = (
    0.06  # height of cells at walls: their centres lie where incipient's law of the wall is taken
)


@dataclass(frozen=True)
class Found:
    """Cells, where the flow reattaches, y+ of the lower wall's first cells, iterations, processor time in seconds."""

    cells: int
    reattachment: float
    y_plus: tuple[float, float]
    iterations: int
    seconds: float


def is_installed() -> bool:
    """Whether simpleFoam and blockMesh are there."""
    return openfoam.is_installed("blockMesh")


def solve(directory: Path, inflow: Inflow, size: float) -> Found:
    """Write, mesh and run a case with cells of a size at walls and step; inflow by heights above the upper floor.

    Raises:
        RuntimeError: SIMPLE has not converged.
    """
    for name, text in _case(inflow, size).items():
        (directory / name).parent.mkdir(parents=True, exist_ok=True)
        (directory / name).write_text(text, encoding="utf-8")
    openfoam.run(directory, "blockMesh")
    iterations, seconds = openfoam.solve(directory)
    said = openfoam.run(
        directory, "simpleFoam", "-postProcess", "-latestTime", "-func", "wallShearStress"
    )
    said += openfoam.run(directory, "simpleFoam", "-postProcess", "-latestTime", "-func", "yPlus")
    low, high = re.findall(r"patch lower y\+ : min = ([\d.e+-]+), max = ([\d.e+-]+)", said)[-1]
    owners = (directory / "constant/polyMesh/owner").read_text(encoding="utf-8")
    return Found(
        int(re.search(r"nCells:\s*(\d+)", owners)[1]),  # type: ignore[index]
        _reattachment(directory, str(iterations)),
        (float(low), float(high)),
        iterations,
        seconds,
    )


def _reattachment(directory: Path, time: str) -> float:
    """Where the shear stress on the lower floor changes its sign for the last time.

    simpleFoam's wallShearStress is that on the fluid: against the flow.
    """
    stress = (directory / time / "wallShearStress").read_text(encoding="utf-8")
    rows = re.search(r"floor\s*\{.*?\n\(\n(.*?)\n\)\n;", stress, re.S)
    assert rows is not None
    values = np.array(re.findall(r"^\((\S+) \S+ \S+\)", rows[1], re.M), dtype=float)
    edges = _abscissae(directory)
    x = 0.5 * (edges[1:] + edges[:-1])
    k = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))[-1]
    return float(x[k] - values[k] * (x[k + 1] - x[k]) / (values[k + 1] - values[k]))


def _abscissae(directory: Path) -> np.ndarray:
    """Of the points on the lower floor."""
    text = (directory / "constant/polyMesh/points").read_text(encoding="utf-8")
    points = np.array(re.findall(r"^\((\S+) (\S+) (\S+)\)", text, re.M), dtype=float)
    return np.unique(np.round(points[(np.abs(points[:, 1]) < 1e-9) & (points[:, 0] > -1e-9), 0], 9))


# -- the case ----------------------------------------------------------------------------------------


def _cells(length: float, first: float, last: float) -> tuple[int, float]:
    """How many cells in geometric progression from about `first` to `last` fill a length, and last over first."""
    ratio = last / first
    count = (
        length / first
        if ratio == 1.0
        else 1 + np.log(ratio) / np.log((length - first) / (length - last))
    )
    return max(1, round(count)), ratio


def _grading(parts: list[tuple[float, float, float]]) -> tuple[int, str]:
    """Cells and blockMesh's grading of an edge in parts of (length, first size, last size)."""
    found = [(length, *_cells(length, first, last)) for length, first, last in parts]
    return sum(n for _, n, _ in found), "(" + " ".join(
        f"({le} {n} {r})" for le, n, r in found
    ) + ")"


def _mesh(size: float) -> str:
    """Three blocks: ahead of the step, above it behind, and below that."""
    wall = (AT_WALL, AT_WALL, AT_WALL)
    ahead = _grading([(AHEAD, 3 * size, size)])
    behind = _grading([wall, (8.0 - AT_WALL, size, 2 * size), (BEHIND - 8.0, 2 * size, 12 * size)])
    rising, falling = (2.0 - AT_WALL, size, 3 * size), (1.5 - AT_WALL, 3 * size, size)
    upper = _grading([wall, rising, (ABOVE - 3.5, 3 * size, 3 * size), falling, wall])
    lower = _grading([wall, (1.0 - AT_WALL, size, size)])
    xs, ys = (-AHEAD, 0.0, BEHIND), (0.0, 1.0, 1.0 + ABOVE)
    points = [(x, y, z) for z in (0, 0.1) for y in ys for x in xs]
    blocks = []
    for i, j, across, up in ((0, 1, ahead, upper), (1, 1, behind, upper), (1, 0, behind, lower)):
        low = [3 * j + i, 3 * j + i + 1, 3 * j + i + 4, 3 * j + i + 3]
        corners = " ".join(str(k) for k in (*low, *(k + 9 for k in low)))
        blocks.append(
            f"hex ({corners}) ({across[0]} {up[0]} 1) simpleGrading ({across[1]} {up[1]} 1)"
        )

    def side(*pair: int) -> str:
        return f"({pair[0]} {pair[1]} {pair[1] + 9} {pair[0] + 9})"

    patches = {
        "inlet": ("patch", [side(3, 6)]),
        "outlet": ("patch", [side(2, 5), side(5, 8)]),
        "lower": ("wall", [side(3, 4), side(1, 4)]),
        "floor": ("wall", [side(1, 2)]),
        "upper": ("wall", [side(6, 7), side(7, 8)]),
    }
    told = "\n".join(
        f"{name} {{ type {kind}; faces ({' '.join(faces)}); }}"
        for name, (kind, faces) in patches.items()
    )
    return (
        openfoam.header("dictionary", "blockMeshDict")
        + f"scale 1;\nvertices ({' '.join(f'({x} {y} {z})' for x, y, z in points)});\n"
        + f"blocks ({chr(10).join(blocks)});\nedges ();\n"
        + f"boundary (\n{told}\n);\ndefaultPatch {{ name sides; type empty; }}\nmergePatchPairs ();\n"
    )


def _case(inflow: Inflow, size: float) -> dict[str, str]:
    """The files of the case by their names."""
    above_floor = Inflow(inflow.rows + np.array([1.0, 0.0, 0.0, 0.0]), inflow.viscosity)
    walls = ("lower", "floor", "upper")
    return {"system/blockMeshDict": _mesh(size)} | openfoam.case(
        above_floor, walls, (), "", openfoam.Schemes()
    )
