"""A flat plate by k-omega SST: friction on three meshes, beside two programs and the boundary-layer equations.

Cost:    about two minutes.
Run:     python benchmarks/turbulent_plate.py
Results: docs/figures/turbulent_plate.png, the table in docs/k_omega.md
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from tables import put

ROOT = Path(__file__).parents[1]
PAGE, FIGURE = ROOT / "docs/k_omega.md", ROOT / "docs/figures/turbulent_plate.png"
SCENE, TABLE = ROOT / "demos/scenes/flat_plate.toml", ROOT / "benchmarks/reference/k_omega_sst.csv"
BEGIN, END = "<!-- plate: begin -->", "<!-- plate: end -->"
MESH_SIZES = (2.0, 2.0**0.5, 1.0)
PLACE, REYNOLDS, STREAM = 0.970084, 5e6, (1.125 / 5e6, 125.0)

sys.path.insert(0, str(ROOT / "tests"))


def computed(mesh_size: float) -> tuple[np.ndarray, np.ndarray, int, float]:
    """x and C_f (n,) along the plate, unknowns of a component of the velocity, and seconds of processor time."""
    import incipient
    from incipient.scene.file import load

    scene = load(SCENE)
    changes = {"mesh_size": mesh_size, "error_bars": False}
    scene = scene.model_copy(update={"numerics": scene.numerics.model_copy(update=changes)})
    began = time.process_time()
    result = incipient.run(scene)
    seconds, walls = time.process_time() - began, result.turbulence
    assert walls is not None and result.velocity is not None
    unknowns = result.velocity.function_space.dofmap.index_map.size_global
    along = walls.along["bed"]
    return np.array(along["x"]), np.array(along["friction"]), unknowns, seconds


def table(found: list[tuple[str, str, float, str]], of_layer: float) -> str:
    """The table of the page."""
    rows = [
        line.split(",")
        for line in TABLE.read_text(encoding="utf-8").splitlines()
        if "flat plate" in line[:10]
    ]
    finest = max(rows, key=lambda row: int(row[2]))
    lines = [
        "| | unknowns a component | C_f | from CFL3D | time |",
        "| --- | --- | --- | --- | --- |",
    ]
    others = (
        ("CFL3D", finest[2], float(finest[3]), ""),
        ("FUN3D", finest[2], float(finest[4]), ""),
    )
    for name, unknowns, value, seconds in (
        *found,
        ("boundary-layer equations", "", of_layer, ""),
        *others,
    ):
        share = f"{100 * (value / float(finest[3]) - 1):+.1f}%" if name != "CFL3D" else ""
        lines.append(f"| {name} | {unknowns} | {value:.6f} | {share} | {seconds} |")
    return "\n".join(lines)


def draw(x: np.ndarray, friction: np.ndarray, layer: np.ndarray, value: float) -> None:
    """C_f over Re_x."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    reynolds = np.geomspace(1e3, 1e7, 300)
    figure, axes = plt.subplots(figsize=(7, 4.2), layout="constrained")
    axes.plot(reynolds, 0.664 / np.sqrt(reynolds), "k:", lw=1, label="Blasius")
    white = reynolds[reynolds > 2e5]
    axes.plot(
        white, 0.455 / np.log(0.06 * white) ** 2, "k--", lw=1, label="turbulent: White (2006)"
    )
    resolved = layer[
        :, REYNOLDS * layer[0] > 1.5e5
    ]  # its steps are too long for the laminar layer before
    axes.plot(
        REYNOLDS * resolved[0],
        resolved[1],
        "C1",
        lw=1,
        label="k-omega SST, boundary-layer equations",
    )
    axes.plot(REYNOLDS * x, friction, "C0", lw=1.5, label="incipient, k-omega SST")
    axes.plot(REYNOLDS * PLACE, value, "C3o", ms=5, label="CFL3D, k-omega SST")
    axes.set(
        xscale="log",
        yscale="log",
        xlim=(1e3, 1e7),
        ylim=(1.5e-3, 3e-2),
        xlabel="Re of x",
        ylabel="C_f",
    )
    axes.legend(frameon=False)
    figure.savefig(FIGURE, dpi=130)


def main() -> None:
    """Run, draw, write."""
    from boundary_layer import friction as of_layer

    found: list[Any] = []
    for mesh_size in MESH_SIZES:
        x, values, unknowns, seconds = computed(mesh_size)
        value = float(np.interp(PLACE, x, values))
        found.append(
            (f"incipient, `mesh_size` = {mesh_size:.3g}", str(unknowns), value, f"{seconds:.0f} s")
        )
        print(found[-1], flush=True)
    values_there = np.array([one[2] for one in found])
    first, second = np.diff(values_there)
    rest = second**2 / (first - second)
    found.append((f"incipient, extrapolated (± {rest:.1g})", "", values_there[-1] + rest, ""))
    layer = of_layer(1.0 / REYNOLDS, 2.0, *STREAM)
    at_place = float(np.interp(PLACE, *layer))
    draw(x, values, layer, 0.00269085)
    put(PAGE, table(found, at_place), BEGIN, END)


if __name__ == "__main__":
    main()
