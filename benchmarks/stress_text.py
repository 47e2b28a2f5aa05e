"""The page docs/stress.md."""

from __future__ import annotations

from hard_map import Point

HEAD = """# Hard cases

`make stress` runs all of this and writes this page ({minutes} min, {machine}). A case that cannot be computed stops
with a named error. A run of the program then keeps the last good state as a checkpoint, from which `incipient resume`
continues after the cause is changed. `tests/stability` has the same cases with bounds, in smaller numbers.

"""
MAP = """## Solvable steps of a body

![Exact coupling and naive iteration over mass ratio, step, Reynolds number and gap](figures/stress_map.png)

A disc in a driven cavity whose lid starts at once; diameter 0.3, side and lid speed 1. Where not on the axis: step
0.05, Re = 10, middle of the cavity. Three steps, none of which may be shortened. Above: the program as it is, at most
12 corrections. Below: forces and velocities passed back and forth (`numerics.coupling = "naive"`, for comparison only),
at most 40 corrections, without relaxation. Of {points} points each, the exact coupling solves {exact}, the naive
iteration {naive}. The exact coupling fails where a light disc goes half its diameter in one step: runs shorten it.

"""
SOURCES = {
    "Bodies without mass, with a million times the fluid's": (
        "A disc in the driven cavity, Re = 10. Orders in time for all masses: "
        "`tests/convergence/test_coupling.py`."
    ),
    "Steady cavity on coarse cells": (
        "P2-P1, cells alike. Error: the largest of the three extrema on the centrelines, against Botella & Peyret "
        "(1998) at Re = 1000 and against a graded P4-P3 mesh of the program at Re = 10,000, which differs by 0.2% from "
        "one 1.4 times coarser. Stabilisation: [numerics.md](numerics.md#coarse-cells-and-convection)."
    ),
    "Lid set off at once": (
        "P2-P1, 12 cells a side, ten steps, Re = 10,000. CFL: step times lid speed over cell. The lid's speed is 1. "
        "Plain elements are left out at CFL 100 and more: their speeds reach 25, and ever shorter steps take minutes."
    ),
    "Near contact": (
        "Stokes flow around a cylinder in a box 20 diameters wide, 10 high, moving with unit speed (spin); the gap is "
        "in diameters. Exact for an endless wall: Jeffrey & Onishi (1981), Q. J. Mech. Appl. Math. 34, 129."
    ),
    "Tiny and huge steps": (
        "Three steps; they are halved where they do not converge. The mesh of this disc is not replaced."
    ),
    "Stiff couples": (
        "A disc without mass or inertia held by a torsional spring, step 0.05: the angle is couple (torque) over "
        "stiffness."
    ),
    "A new mesh every few steps": "An ellipse carried round a box, 20 steps, compared with the run on one mesh.",
    "Stopped in the middle and resumed": (
        "Whole runs: `incipient run`, then `incipient resume` with the remedy, compared with a run that had the remedy "
        "from the start. An ellipse of size 1 in a driven cavity of side 4; a cavity of side 1 at Re = 10,000 on 14 "
        "graded cells a side whose lid gets as fast as 20. The part before the stop keeps its coarse cells, or stays "
        "without stabilisation."
    ),
    "Friction 0 and infinite, degenerate contacts": (
        "A disc of weight 1 and radius 1 under a force of 0.1 and a couple of -0.02."
    ),
    "Badly shaped meshes": "24 cells a side, P2-P1; at 1 the worst cell nearly folds.",
    "Extreme domains": "Poiseuille flow lies in the elements' space: only round-off may be left.",
    "Scene files at random": (
        "Valid scenes with up to three keys changed: wrong types, zero, negative, huge, tiny and infinite numbers, "
        "keys of other scenes, broken text. Every twentieth that is a scene is meshed as well; every fiftieth is a "
        "valid one with unusual numbers and is run on coarse cells. Each has 60 s."
    ),
    "Violent mesh motion": (
        "Six cells a side, viscosity 1e-6, BDF1, step 0.1. More: [numerics.md](numerics.md#energy-on-moving-meshes)."
    ),
}


def page(
    sections: dict[str, list[tuple[str, str, str]]], points: list[Point], seconds: float, machine: str
) -> str:
    """The whole page."""
    solved = {
        exact: sum(p.corrections is not None for p in points if p.exact is exact) for exact in (True, False)
    }
    text = HEAD.format(minutes=f"{seconds / 60:.0f}", machine=machine)
    text += MAP.format(points=len(points) // 2, exact=solved[True], naive=solved[False])
    return text + "\n".join(_section(title, rows) for title, rows in sections.items())


def _section(title: str, rows: list[tuple[str, str, str]]) -> str:
    table = [
        "| case | result | outcome |",
        "| --- | --- | --- |",
        *(f"| {' | '.join(row)} |" for row in _folded(rows)),
    ]
    return "\n".join([f"## {title}", "", SOURCES.get(title, ""), "", *table, ""])


def _folded(rows: list[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    """Rows in which neighbours that differ only in the last part of their case are one."""
    folded = [rows[0]]
    for case, found, outcome in rows[1:]:
        known, *same = folded[-1]
        if same == [found, outcome] and known.rpartition(", ")[0] == case.rpartition(", ")[0] != "":
            folded[-1] = (f"{known}; {case.rpartition(', ')[2].removeprefix('friction ')}", found, outcome)
        else:
            folded.append((case, found, outcome))
    return folded
