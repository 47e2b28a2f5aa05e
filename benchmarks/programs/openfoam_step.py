"""OpenFOAM's simpleFoam on a backward-facing step between walls: its case written, run, and read.

The standard k-epsilon model with standard wall functions (nutkWallFunction, epsilonWallFunction, kqRWallFunction),
SIMPLEC, convection by linearUpwind, of k and epsilon by limitedLinear, on graded quadrilaterals whose height at
walls is the same on all meshes. Debian's package `openfoam` (1912) does. Lengths are over the height of the step,
velocities over the reference one.
"""

import os
import re
import resource
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

CONFIGURATION = "/usr/share/openfoam"
AHEAD, BEHIND, ABOVE = 4.0, 30.0, 8.0  # of the step
AT_WALL = 0.06  # height of cells at walls: their centres lie where incipient's law of the wall is taken
ITERATIONS = 6000
TOLERANCE = 1e-5  # of SIMPLE's initial residuals
AT_FIRST = 0.01  # k and epsilon everywhere; from those of the free stream SIMPLE diverges


@dataclass(frozen=True)
class Inflow:
    """Rows (n, 4) of height above the upper floor, speed, k and epsilon."""

    rows: np.ndarray
    viscosity: float


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
    return all(shutil.which(name) for name in ("simpleFoam", "blockMesh"))


def solve(directory: Path, inflow: Inflow, size: float) -> Found:
    """Write, mesh and run a case with cells of a size at walls and step.

    Raises:
        RuntimeError: SIMPLE has not converged.
    """
    for name, text in _case(inflow, size).items():
        (directory / name).parent.mkdir(parents=True, exist_ok=True)
        (directory / name).write_text(text, encoding="utf-8")
    _run(directory, "blockMesh")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    log = _run(directory, "simpleFoam")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if "SIMPLE solution converged" not in log:
        raise RuntimeError(f"SIMPLE has not converged in {ITERATIONS} iterations")
    iterations = int(re.findall(r"solution converged in (\d+) iterations", log)[-1])
    said = _run(directory, "simpleFoam", "-postProcess", "-latestTime", "-func", "wallShearStress")
    said += _run(directory, "simpleFoam", "-postProcess", "-latestTime", "-func", "yPlus")
    low, high = re.findall(r"patch lower y\+ : min = ([\d.e+-]+), max = ([\d.e+-]+)", said)[-1]
    owners = (directory / "constant/polyMesh/owner").read_text(encoding="utf-8")
    return Found(
        int(re.search(r"nCells:\s*(\d+)", owners)[1]),  # type: ignore[index]
        _reattachment(directory, str(iterations)),
        (float(low), float(high)),
        iterations,
        after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
    )


def _run(directory: Path, *words: str) -> str:
    environment = os.environ | {"WM_PROJECT_DIR": CONFIGURATION, "FOAM_SIGFPE": "false"}
    done = subprocess.run(words, cwd=directory, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{words[0]} failed: {done.stderr[-500:] or done.stdout[-500:]}")
    return done.stdout


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
    count = length / first if ratio == 1.0 else 1 + np.log(ratio) / np.log((length - first) / (length - last))
    return max(1, round(count)), ratio


def _grading(parts: list[tuple[float, float, float]]) -> tuple[int, str]:
    """Cells and blockMesh's grading of an edge in parts of (length, first size, last size)."""
    found = [(length, *_cells(length, first, last)) for length, first, last in parts]
    return sum(n for _, n, _ in found), "(" + " ".join(f"({le} {n} {r})" for le, n, r in found) + ")"


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
        blocks.append(f"hex ({corners}) ({across[0]} {up[0]} 1) simpleGrading ({across[1]} {up[1]} 1)")

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
        f"{name} {{ type {kind}; faces ({' '.join(faces)}); }}" for name, (kind, faces) in patches.items()
    )
    return (
        _header("dictionary", "blockMeshDict")
        + f"scale 1;\nvertices ({' '.join(f'({x} {y} {z})' for x, y, z in points)});\n"
        + f"blocks ({chr(10).join(blocks)});\nedges ();\n"
        + f"boundary (\n{told}\n);\ndefaultPatch {{ name sides; type empty; }}\nmergePatchPairs ();\n"
    )


def _header(kind: str, name: str) -> str:
    return f"FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n"


def _field(name: str, kind: str, dimensions: str, inside: str, patches: dict[str, str]) -> str:
    told = "\n".join(f"{patch} {{ {text} }}" for patch, text in patches.items())
    return (
        _header(f"vol{kind}Field", name) + f"dimensions {dimensions};\ninternalField uniform {inside};\n"
        f"boundaryField {{\n{told}\nsides {{ type empty; }}\n}}\n"
    )


def _at_inlet(inflow: Inflow, column: int) -> str:
    values = [f"{row[column]:.8g}" for row in inflow.rows]
    told = [f"({v} 0 0)" for v in values] if column == 1 else values
    rows = " ".join(f"({height + 1.0:.8g} {v})" for height, v in zip(inflow.rows[:, 0], told, strict=True))
    return f"type fixedProfile; profile table ({rows}); direction (0 1 0); origin 0;"


def _case(inflow: Inflow, size: float) -> dict[str, str]:
    """The files of the case by their names."""
    walls = ("lower", "floor", "upper")
    free = "type zeroGradient;"
    k = epsilon = AT_FIRST

    def on_walls(text: str) -> dict[str, str]:
        return dict.fromkeys(walls, text)

    nut = "type calculated; value uniform 0;"
    return {
        "system/blockMeshDict": _mesh(size),
        "system/controlDict": _header("dictionary", "controlDict")
        + f"application simpleFoam; startFrom startTime; startTime 0; stopAt endTime; endTime {ITERATIONS}; deltaT 1;\n"
        f"writeControl timeStep; writeInterval {ITERATIONS}; writePrecision 10; timePrecision 8;\n",
        "system/fvSchemes": _header("dictionary", "fvSchemes")
        + "ddtSchemes { default steadyState; }\ngradSchemes { default Gauss linear; }\n"
        "divSchemes { default none; div(phi,U) bounded Gauss linearUpwind grad(U);\n"
        "div(phi,k) bounded Gauss limitedLinear 1; div(phi,epsilon) bounded Gauss limitedLinear 1;\n"
        "div((nuEff*dev2(T(grad(U))))) Gauss linear; }\n"
        "laplacianSchemes { default Gauss linear corrected; }\ninterpolationSchemes { default linear; }\n"
        "snGradSchemes { default corrected; }\nwallDist { method meshWave; }\n",
        "system/fvSolution": _header("dictionary", "fvSolution")
        + "solvers { p { solver GAMG; smoother GaussSeidel; tolerance 1e-9; relTol 0.05; }\n"
        '"(U|k|epsilon)" { solver smoothSolver; smoother symGaussSeidel; tolerance 1e-10; relTol 0.1; } }\n'
        "SIMPLE { consistent yes; nNonOrthogonalCorrectors 0;\n"
        f'residualControl {{ p {TOLERANCE:g}; U {TOLERANCE:g}; "(k|epsilon)" {TOLERANCE:g}; }} }}\n'
        'relaxationFactors { equations { U 0.9; "(k|epsilon)" 0.8; } }\n',
        "constant/transportProperties": _header("dictionary", "transportProperties")
        + f"transportModel Newtonian; nu {inflow.viscosity:.10g};\n",
        "constant/turbulenceProperties": _header("dictionary", "turbulenceProperties")
        + "simulationType RAS; RAS { RASModel kEpsilon; turbulence on; printCoeffs on; }\n",
        "0/U": _field(
            *("U", "Vector", "[0 1 -1 0 0 0 0]", "(1 0 0)"),
            {"inlet": _at_inlet(inflow, 1), "outlet": free, **on_walls("type noSlip;")},
        ),
        "0/p": _field(
            *("p", "Scalar", "[0 2 -2 0 0 0 0]", "0"),
            {"inlet": free, "outlet": "type fixedValue; value uniform 0;", **on_walls(free)},
        ),
        "0/k": _field(
            *("k", "Scalar", "[0 2 -2 0 0 0 0]", f"{k:.6g}"),
            {
                "inlet": _at_inlet(inflow, 2),
                "outlet": free,
                **on_walls(f"type kqRWallFunction; value uniform {k:.6g};"),
            },
        ),
        "0/epsilon": _field(
            *("epsilon", "Scalar", "[0 2 -3 0 0 0 0]", f"{epsilon:.6g}"),
            {
                "inlet": _at_inlet(inflow, 3),
                "outlet": free,
                **on_walls(f"type epsilonWallFunction; value uniform {epsilon:.6g};"),
            },
        ),
        "0/nut": _field(
            *("nut", "Scalar", "[0 2 -1 0 0 0 0]", "0"),
            {"inlet": nut, "outlet": nut, **on_walls("type nutkWallFunction; value uniform 0;")},
        ),
    }
