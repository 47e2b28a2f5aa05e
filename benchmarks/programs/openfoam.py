"""OpenFOAM's simpleFoam with the k-epsilon model and wall functions: what its cases have in common, and how it is run.

Standard constants and standard wall functions (nutkWallFunction, epsilonWallFunction, kqRWallFunction), SIMPLEC,
convection of k and epsilon by limitedLinear, of the velocity by linearUpwind where nothing else is asked for. Debian's
package `openfoam` (1912) does.
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
ITERATIONS = 6000
TOLERANCE = 1e-5  # of SIMPLE's initial residuals
AT_FIRST = 0.01  # k and epsilon everywhere; from those of the free stream SIMPLE diverges


@dataclass(frozen=True)
class Inflow:
    """Rows (n, 4) of height, speed, k and epsilon."""

    rows: np.ndarray
    viscosity: float


@dataclass(frozen=True)
class Schemes:
    """What differs between cases: correctors for cells that are not orthogonal, relaxation, and convection."""

    correctors: int = 0
    relaxation: tuple[float, float] = (0.9, 0.8)  # of the velocity; of k and epsilon
    convection: str = "linearUpwind grad(U)"  # of the velocity


def is_installed(*names: str) -> bool:
    """Whether simpleFoam and the programs of these names are there."""
    return all(shutil.which(name) for name in ("simpleFoam", *names))


def run(directory: Path, *words: str) -> str:
    """Run a program on a case; what it wrote to its output.

    Raises:
        RuntimeError: it has failed.
    """
    environment = os.environ | {"WM_PROJECT_DIR": CONFIGURATION, "FOAM_SIGFPE": "false"}
    done = subprocess.run(
        words, cwd=directory, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{words[0]} failed: {done.stderr[-500:] or done.stdout[-500:]}")
    return done.stdout


def solve(directory: Path) -> tuple[int, float]:
    """Run simpleFoam until it has converged: its iterations and its processor time in seconds.

    Raises:
        RuntimeError: SIMPLE has not converged.
    """
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    log = run(directory, "simpleFoam")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if "SIMPLE solution converged" not in log:
        raise RuntimeError(f"SIMPLE has not converged in {ITERATIONS} iterations")
    iterations = int(re.findall(r"solution converged in (\d+) iterations", log)[-1])
    return iterations, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def header(kind: str, name: str) -> str:
    """The head of a file."""
    return f"FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n"


def case(
    inflow: Inflow, walls: tuple[str, ...], lids: tuple[str, ...], law: str, schemes: Schemes
) -> dict[str, str]:
    """The files of a case but its mesh, by their names.

    The patches are "inlet", "outlet", walls, lids without friction, and the empty "sides"; `law` are the entries of
    nutkWallFunction that are not its defaults.
    """
    free = "type zeroGradient;"
    k = epsilon = AT_FIRST

    def on_walls(text: str, on_lids: str = free) -> dict[str, str]:
        return dict.fromkeys(walls, text) | dict.fromkeys(lids, on_lids)

    nut = "type calculated; value uniform 0;"
    return {
        "system/controlDict": header("dictionary", "controlDict")
        + f"application simpleFoam; startFrom startTime; startTime 0; stopAt endTime; endTime {ITERATIONS}; deltaT 1;\n"
        f"writeControl timeStep; writeInterval {ITERATIONS}; writePrecision 10; timePrecision 8;\n",
        "system/fvSchemes": header("dictionary", "fvSchemes")
        + "ddtSchemes { default steadyState; }\ngradSchemes { default Gauss linear; }\n"
        f"divSchemes {{ default none; div(phi,U) bounded Gauss {schemes.convection};\n"
        "div(phi,k) bounded Gauss limitedLinear 1; div(phi,epsilon) bounded Gauss limitedLinear 1;\n"
        "div((nuEff*dev2(T(grad(U))))) Gauss linear; }\n"
        "laplacianSchemes { default Gauss linear corrected; }\ninterpolationSchemes { default linear; }\n"
        "snGradSchemes { default corrected; }\nwallDist { method meshWave; }\n",
        "system/fvSolution": header("dictionary", "fvSolution")
        + "solvers { p { solver GAMG; smoother GaussSeidel; tolerance 1e-9; relTol 0.05; }\n"
        '"(U|k|epsilon)" { solver smoothSolver; smoother symGaussSeidel; tolerance 1e-10; relTol 0.1; } }\n'
        f"SIMPLE {{ consistent yes; nNonOrthogonalCorrectors {schemes.correctors};\n"
        f'residualControl {{ p {TOLERANCE:g}; U {TOLERANCE:g}; "(k|epsilon)" {TOLERANCE:g}; }} }}\n'
        f"relaxationFactors {{ equations {{ U {schemes.relaxation[0]}; "
        f'"(k|epsilon)" {schemes.relaxation[1]}; }} }}\n',
        "constant/transportProperties": header("dictionary", "transportProperties")
        + f"transportModel Newtonian; nu {inflow.viscosity:.10g};\n",
        "constant/turbulenceProperties": header("dictionary", "turbulenceProperties")
        + "simulationType RAS; RAS { RASModel kEpsilon; turbulence on; printCoeffs on; }\n",
        "0/U": _field(
            *("U", "Vector", "[0 1 -1 0 0 0 0]", "(1 0 0)"),
            {
                "inlet": _at_inlet(inflow, 1),
                "outlet": free,
                **on_walls("type noSlip;", "type slip;"),
            },
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
                **on_walls(f"type epsilonWallFunction; {law}value uniform {epsilon:.6g};"),
            },
        ),
        "0/nut": _field(
            *("nut", "Scalar", "[0 2 -1 0 0 0 0]", "0"),
            {
                "inlet": nut,
                "outlet": nut,
                **on_walls(f"type nutkWallFunction; {law}value uniform 0;", nut),
            },
        ),
    }


def _field(name: str, kind: str, dimensions: str, inside: str, patches: dict[str, str]) -> str:
    told = "\n".join(f"{patch} {{ {text} }}" for patch, text in patches.items())
    return (
        header(f"vol{kind}Field", name)
        + f"dimensions {dimensions};\ninternalField uniform {inside};\n"
        f"boundaryField {{\n{told}\nsides {{ type empty; }}\n}}\n"
    )


def _at_inlet(inflow: Inflow, column: int) -> str:
    values = [f"{row[column]:.8g}" for row in inflow.rows]
    told = [f"({v} 0 0)" for v in values] if column == 1 else values
    rows = " ".join(
        f"({height:.8g} {v})" for height, v in zip(inflow.rows[:, 0], told, strict=True)
    )
    return f"type fixedProfile; profile table ({rows}); direction (0 1 0); origin 0;"
