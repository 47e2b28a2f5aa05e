"""The numbers of the hard cases as a text, results/stress.md."""

from __future__ import annotations

from hard_map import Point

HEAD = """# Hard cases

How far steps, meshes, masses and scene files can be pushed before a run stops. One that cannot continue stops with a
named error, and keeps the last good state, from which `incipient resume` continues after a remedy. `make stress` runs
all of this and writes this text ({minutes} min, {machine}); `tests/stability` has some of each, with bounds.

"""
MAP = """## Solvable steps of a body

![Exact coupling and naive iteration over mass ratio, step, Reynolds number and gap](../docs/figures/stress_map.png)

A disc of diameter 0.3 in a driven cavity of side 1 whose lid starts at once with speed 1. Where not on the axis: step
0.05, Re = 10, middle of the cavity. Three steps, none of which may be shortened.

- Above: the exact coupling in use, at most 12 corrections. It solves {exact} of {points} points, and fails where a
  light disc goes half its diameter in one step; a run shortens such a step.
- Below: forces and velocities passed back and forth, at most 40. They solve {naive}.

"""
SOURCES = {
    "Bodies without mass, with a million times the fluid's": (
        "A disc in the driven cavity, Re = 10; mass and inertia relative to the fluid's. Orders in time: "
        "`tests/convergence/test_coupling.py`."
    ),
    "Steady cavity on coarse cells": (
        "P2-P1, cells alike, plain and stabilised. Largest error of the "
        "three extrema on the centrelines, at Re 1000 against Botella & Peyret (1998), at Re 10,000 against a graded "
        "P4-P3 mesh (good to 0.2%)."
    ),
    "Impulsive start of the lid": (
        "P2-P1, 12 cells a side, ten steps, Re = 10,000, lid speed 1. At CFL 100 (step times lid speed over cell) "
        "plain elements reach speeds of 25."
    ),
    "Near contact": (
        "Stokes flow around a cylinder moving near a wall (gap in diameters), in a box of 20 x 10 diameters: error "
        "of force or torque against the exact solution of Jeffrey & Onishi (1981), Q. J. Mech. Appl. Math. "
        "34, 129."
    ),
    "A new mesh every few steps": "An ellipse carried round a box, 20 steps, compared with the run on one mesh.",
    "Stopped in the middle and resumed": (
        "`incipient run`, then `incipient resume` with the remedy, compared with a run that had it from the start. "
        "An ellipse in a driven cavity; the last case is a cavity at Re = 10,000 on 14 cells a side."
    ),
    "Friction 0 and infinite, degenerate contacts": (
        "A disc of weight 1 and radius 1 under a force of 0.1 and a couple of -0.02."
    ),
    "Extreme domains": "Poiseuille flow lies in the elements' space: only round-off may be left.",
    "Scene files at random": (
        "Valid scenes with up to three keys changed, some also meshed or run on coarse cells. Each has 60 s."
    ),
}
# Sections of which one line is enough where all of their cases end alike.
IN_A_LINE = {
    "Tiny and huge steps": "three steps of a massless disc at CFL 0.01, 1 and 1000, halved where they do not converge",
    "Stiff couples": "a disc without mass or inertia on torsional springs of stiffness 1 and 1e9",
    "Badly shaped meshes": "a cavity at Re 1000, vertices moved by 0, 0.5 and 0.9 of what folds the worst cell",
    "Violent mesh motion": ("100 steps of 0.1, the mesh moved at random in each"),
}


def page(
    sections: dict[str, list[tuple[str, str, str]]],
    points: list[Point],
    seconds: float,
    machine: str,
) -> str:
    """The whole text."""
    solved = {
        exact: sum(p.corrections is not None for p in points if p.exact is exact)
        for exact in (True, False)
    }
    text = HEAD.format(minutes=f"{seconds / 60:.0f}", machine=machine)
    text += MAP.format(points=len(points) // 2, exact=solved[True], naive=solved[False])
    brief = {
        title: rows[0][2]
        for title, rows in sections.items()
        if title in IN_A_LINE and len({outcome for *_, outcome in rows}) == 1
    }
    whole = [_section(title, rows) for title, rows in sections.items() if title not in brief]
    lines = [f"- {title}: {IN_A_LINE[title]}: {outcome}" for title, outcome in brief.items()]
    return text + "\n".join([*whole, "## Also run", "", *lines, ""])


def _section(title: str, rows: list[tuple[str, str, str]]) -> str:
    said, outcomes = SOURCES.get(title) or f"{IN_A_LINE[title]}.", {outcome for *_, outcome in rows}
    lines = [f"- {case}: {found}; {outcome}" for case, found, outcome in _gathered(_folded(rows))]
    if len(outcomes) == 1:
        common = outcomes.pop()
        said, lines = (
            f"{said} All cases: {common}.",
            [line.removesuffix(f"; {common}") for line in lines],
        )
    return "\n".join([f"## {title}", "", said, "", *lines, ""])


def _gathered(rows: list[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    """Rows in which those that differ only in the first part of their case are one."""
    firsts: dict[tuple[str, str, str], list[str]] = {}
    for case, found, outcome in rows:
        first, _, rest = case.rpartition(", ")
        firsts.setdefault((rest, found, outcome), []).append(first)
    return [
        (", ".join(filter(None, ["; ".join(dict.fromkeys(known)), rest])), found, outcome)
        for (rest, found, outcome), known in firsts.items()
    ]


def _folded(rows: list[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    """Rows in which neighbours that differ only in the last part of their case are one."""
    folded = [rows[0]]
    for case, found, outcome in rows[1:]:
        known, *same = folded[-1]
        if same == [found, outcome] and known.rpartition(", ")[0] == case.rpartition(", ")[0] != "":
            folded[-1] = (
                f"{known}; {case.rpartition(', ')[2].removeprefix('friction ')}",
                found,
                outcome,
            )
        else:
            folded.append((case, found, outcome))
    return folded
