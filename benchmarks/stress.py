"""Hard cases: run them all, write results/stress.md and the map docs/figures/stress_map.png.

Run: make stress, or PYTHONPATH=tests:tests/stability .venv/bin/python benchmarks/stress.py
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random

import machine
import numpy as np
import stress_map
import stress_text
from contacts import degenerate_contacts
from domains import SIDES, curved_box
from energy import energies, thrown
from hard import (
    MOTIONS,
    exact_wall_force,
    extrema,
    in_cavity,
    poiseuille_error,
    ride,
    set_off,
    sprung,
    steady_cavity,
    steady_lid,
    wall_force,
)
from hard_map import points
from hard_resumed import rows as resumed_rows
from random_scenes import NOWHERE, fate, scene_text
from remeshed import remeshed_run

from incipient.fluid import FlowModel, Fluid, Prescribed, no_slip, solve_steady

ROOT = Path(__file__).parents[1]
Row = tuple[str, str, str]  # the case, what was found, what that means
SCENE_FILES = 5000
FINEST_CAVITY = (-0.45920, 0.46495, -0.58224)
BOTELLA_PEYRET = (-0.3885698, 0.3769447, -0.5270771)


def bodies() -> Iterator[Row]:
    """Density ratios from none to a million; no inertia; no mass but inertia."""
    for mass, moment in ((0, 0), (1, 1), (1e6, 1e6), (1, 0), (0, 1)):
        with in_cavity(mass, moment) as found:
            told = ride(found, 0.05, 8)
        case = f"mass {mass:g}, inertia {moment:g}"
        yield case, f"speed {told.speed:.3g}, corrections {told.corrections}", told.ended


def steady_cavities() -> Iterator[Row]:
    """Coarse cells, plain and stabilised."""
    cases = [(1e3, 8), (1e3, 16), (1e3, 24), (1e3, 32), (1e4, 16), (1e4, 32), (1e4, 48)]
    for reynolds, n in cases:
        plain, stabilised = (_steady_cavity(reynolds, n, kind) for kind in (False, True))
        yield f"Re {reynolds:g}, {n} cells a side", f"plain {plain}", f"stabilised {stabilised}"


def _steady_cavity(reynolds: float, n: int, stabilised: bool) -> str:
    found = steady_cavity(reynolds, n, stabilisation=stabilised)
    if found.share < 1.0:
        return f"stops: no solution beyond Re {found.share * reynolds:.4g}"
    exact = BOTELLA_PEYRET if reynolds == 1e3 else FINEST_CAVITY
    error = np.abs(np.array(found.extrema) / exact - 1).max()
    return f"{100 * error:.2g}%"


def impulsive_cavities() -> Iterator[Row]:
    """Lid set off at once at Re = 10,000 on 12 cells a side; ten steps."""
    kinds = {
        "plain": FlowModel(unsteady=True),
        "stabilised": FlowModel(unsteady=True, stabilisation=True),
        "stabilised and extrapolated": FlowModel(
            unsteady=True, convection="extrapolated", stabilisation=True
        ),
    }
    for courant in (0.01, 1.0, 100.0, 1000.0):
        for name, model in kinds.items():
            if name == "plain" and courant > 1.0:
                continue  # minutes of ever shorter steps until it stops by name
            speed, ended = set_off(1e4, 12, courant / 12, 10, model)
            yield f"{name}, CFL {courant:g}", f"largest speed {speed:.3g}", ended


def near_contact() -> Iterator[Row]:
    """Lubrication, against the exact solution."""
    gaps = (1e-1, 1e-2, 1e-3, 1e-4)
    for motion in MOTIONS:
        errors = [wall_force(motion, gap) / exact_wall_force(motion, gap) - 1 for gap in gaps]
        found = "; ".join(f"{100 * error:.2g}%" for error in errors)
        yield (
            f"cylinder {motion}, gap {'; '.join(f'{gap:g}' for gap in gaps)}",
            f"error {found}",
            "completed",
        )


def long_steps() -> Iterator[Row]:
    """A massless disc in steps from tiny to huge; cells of 0.08."""
    for courant in (0.01, 1.0, 1000.0):
        with in_cavity(0.0) as found:
            told = ride(found, 0.08 * courant, 3)
        yield f"massless disc, CFL {courant:g}", f"largest speed {told.speed:.3g}", told.ended


def stiff_couples() -> Iterator[Row]:
    for stiffness in (1.0, 1e9):
        told = sprung(stiffness, 0.05)
        found = f"angle {told.readings[-1, 5]:.4g}, corrections {told.corrections}"
        yield f"stiffness {stiffness:g}", found, told.ended


def new_meshes() -> Iterator[Row]:
    usual = remeshed_run(0.35)
    for below in (0.97, 0.995):
        told = remeshed_run(below)
        moved = np.linalg.norm(np.subtract(told.place, usual.place)) / told.size
        found = (
            f"{told.count} new meshes in 20 steps; place differs by {100 * moved:.2g}% of the grain"
        )
        yield f"remesh_below = {below:g}", found, f"largest change of energy {told.energy:.1e}"


def bad_meshes() -> Iterator[Row]:
    """Vertices thrown at random: the error against that on the mesh as it was."""
    exact = BOTELLA_PEYRET
    for throw in (0.0, 0.5, 0.9):
        lid = Prescribed("top", steady_lid)
        domain = curved_box(2, 24, 1)
        motion = thrown(domain.mesh, 24, 1)
        places = motion.places()
        domain.mesh.geometry.x[:] += throw * (places - domain.mesh.geometry.x)
        with Fluid(domain, FlowModel(), [lid, *(no_slip(s) for s in SIDES[:3])], 1000.0) as fluid:
            solve_steady(fluid, 1e-8, first_share=0.2)
            error = np.abs(np.array(extrema(fluid)) / exact - 1).max()
        yield (
            f"cells thrown by {throw:g}",
            f"error {100 * error:.2g}%",
            "completed",
        )


def long_domains() -> Iterator[Row]:
    for length, height, columns, rows in ((100, 1, 40, 4), (1e4, 1, 10, 4), (0.01, 1, 4, 40)):
        error = poiseuille_error(length, height, columns, rows)
        yield f"channel {length:g} x {height:g}", f"error {error:.1e}", "exact to round-off"


def moved_meshes() -> Iterator[Row]:
    """The energy on a mesh that moves at random, fewer steps, with and without stabilisation."""
    for stabilised in (False, True):
        model = FlowModel(
            unsteady=True,
            convection="extrapolated",
            moving_mesh=True,
            stabilisation=stabilised,
        )
        kinetic, _ = energies(1e6, model, 1, 0.1, 100)
        factor = (kinetic[1:] / kinetic[:-1]).max()
        case = f"energy-stable form{', stabilised' if stabilised else ''}"
        yield (
            case,
            f"largest factor of a step {factor:.4f}",
            "energy never grows" if factor <= 1 else "grows",
        )


def stopped_and_resumed() -> Iterator[Row]:
    """Whole runs that stop by name, go on from their checkpoint with a remedy, and come where the uncut run comes."""
    with tempfile.TemporaryDirectory() as directory:
        yield from resumed_rows(Path(directory))


def files_at_random() -> Iterator[Row]:
    """Scene files around valid ones: each is planned, meshed or run, or refused in one line."""
    counts, failed = Counter[str](), dict[int, str]()
    for seed in range(SCENE_FILES):
        try:
            counts[fate(scene_text(Random(seed)), NOWHERE, mesh=seed % 4 == 0)] += 1
        except Exception as error:
            failed[seed] = f"{type(error).__name__}: {error}"
    for end, count in counts.most_common():
        yield (
            f"{end}",
            f"{count} of {SCENE_FILES} scene files",
            "completed" if "refused" not in end else "one line",
        )
    for number, end in failed.items():
        yield f"scene file {number}", end, "a defect of the program"
    yield "hangs, tracebacks, results that are not numbers", str(len(failed)), "must be none"


CASES: dict[str, Callable[[], Iterator[Row]]] = {
    "Bodies without mass, with a million times the fluid's": bodies,
    "Steady cavity on coarse cells": steady_cavities,
    "Impulsive start of the lid": impulsive_cavities,
    "Near contact": near_contact,
    "Tiny and huge steps": long_steps,
    "Stiff couples": stiff_couples,
    "A new mesh every few steps": new_meshes,
    "Stopped in the middle and resumed": stopped_and_resumed,
    "Friction 0 and infinite, degenerate contacts": degenerate_contacts,
    "Badly shaped meshes": bad_meshes,
    "Extreme domains": long_domains,
    "Violent mesh motion": moved_meshes,
    "Scene files at random": files_at_random,
}


def main() -> int:
    began, sections = time.perf_counter(), {}
    for title, case in CASES.items():
        sections[title] = list(case())
        for row in sections[title]:
            print(*row, sep=" | ", flush=True)
    found = list(points())
    stress_map.draw(found, ROOT / "docs/figures/stress_map.png")
    seconds = time.perf_counter() - began
    (ROOT / "results/stress.md").write_text(
        stress_text.page(sections, found, seconds, machine.describe()["processor"])
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
