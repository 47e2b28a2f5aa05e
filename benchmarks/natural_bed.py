"""Pockets of random beds of equal spheres by geometry alone, and loads of the flow past some, for Shields' curve.

Geometry: the free grains (exposed, carrying no other) of four beds of 500 spheres, each in flows of four directions;
          all count alike. No flow is needed for their protrusions, shelter, contacts and pivot angles.
Loads:    full runs past grains of the first bed that are far from one another in these, as those of `incipient survey`:
          creeping shear, and with inertia below the mean profile of a turbulent stream (`flow.kind = "log-law"`), at
          several u* d/nu; `--turbulent`: by the k-omega SST model. Force over bed stress and d^2, couple and d^3: these
          do not depend on the grain's weight, so that a run holds for all Shields numbers at its u* d/nu.
Cost:     half an hour of one core, with --turbulent three to four minutes for each grain at u* d/nu = 30, more at
          larger ones; what is in the results is not computed again: delete them for that.
Run:      python benchmarks/natural_bed.py [--turbulent] [--jobs N] [--scheduler tcp://HOST:PORT] [--wall 2h]
Results:  results/natural_bed.sqlite, a sweep's file (docs/howto/sweeps.md), and benchmarks/natural_bed.csv
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import incipient.sweep
from incipient.arrays import Integers
from incipient.files import csv_text
from incipient.scene import Effects, Fluid, LogLaw, OpenChannel, Scene, Turbulence
from incipient.setup.base_flow import MeanProfile
from incipient.setup.setup import Setup
from incipient.survey.beds import Spheres, spheres_of
from incipient.survey.full_runs import COMPONENTS, scene_of
from incipient.survey.pockets import Pocket, Surface, exposed, pockets
from incipient.survey.request import Deposited, FlowPast, Runs, Survey, Surveyed
from incipient.survey.thresholds import designed, features_of
from incipient.turbulence.developed import developed

ROOT = Path(__file__).parents[1]
STORE, FILE = ROOT / "benchmarks/natural_bed.csv", ROOT / "results/natural_bed.sqlite"
SEEDS, AZIMUTHS = (1, 2, 3, 4), (0.0, 90.0, 180.0, 270.0)
FRICTION = 0.3  # as in demos/beds/random_spheres.toml
# u* d/nu, of creeping flow 0, and pockets with runs there.
LAMINAR = {0.0: 24, 10.0: 24, 3.0: 16, 30.0: 16}
TURBULENT, TURBULENT_COUNT = (30.0, 60.0, 100.0, 300.0, 1000.0), 11
ROUGHNESS = (
    1.0  # equivalent sand roughness of the bed, over which the mean profile or what enters is [d]
)
DEPTH = 5.0  # of turbulent flow [d]
# What runs leave open, looked at in some of them: each changes one number.
CHECKED, CHECKED_AT = 2, (0.0, 10.0)
CHECKS: dict[str, dict[str, float]] = {
    "gap": {"gap": 0.04},
    "cells": {"mesh_size": 1.6},
    "level ground": {"meshed_bed": 1.0},
    "domain": {"domain": 13.0},
}
COLUMNS = ("pocket", "shear_reynolds", "model", "check", "speed", *COMPONENTS, "seconds")


# -- geometry -----------------------------------------------------------------------------------------------


def bed(seed: int, tries: int = 8) -> Deposited:
    """One of the random beds."""
    return Deposited(number=500, length=14.0, width=14.0, tries=tries, seed=seed)


def free_grains(spheres: Spheres, azimuth: float, friction: float = FRICTION) -> Iterator[Pocket]:
    """The exposed grains of a bed that carry no other, in a flow of a direction [degrees]."""
    surface = Surface.of(spheres)
    numbers = exposed(spheres, surface, Surveyed())
    result = pockets(spheres, surface, numbers, FlowPast(azimuth=azimuth, friction=friction))
    return (one for one in result if not one.carries)


@cache
def first_bed() -> tuple[Spheres, list[Pocket]]:
    """The bed with runs, and its free grains in a flow along x."""
    spheres = spheres_of(bed(SEEDS[0]), ROOT)
    return spheres, list(free_grains(spheres, 0.0))


def spheres_of_tries(tries: int) -> Spheres:
    """The first bed made otherwise: each sphere dropped into the lowest of so many places."""
    return spheres_of(bed(SEEDS[0], tries), ROOT)


def sample() -> tuple[list[Pocket], Integers]:
    """All free grains of all beds in all directions, and which bed each is of: the natural bed, each counting alike."""
    result: list[Pocket] = []
    beds: list[int] = []
    for seed in SEEDS:
        spheres = first_bed()[0] if seed == SEEDS[0] else spheres_of(bed(seed), ROOT)
        for azimuth in AZIMUTHS:
            with_runs = seed == SEEDS[0] and not azimuth
            result += first_bed()[1] if with_runs else list(free_grains(spheres, azimuth))
        beds += [seed] * (len(result) - len(beds))
    return result, np.array(beds)


# -- runs ---------------------------------------------------------------------------------------------------


def chosen(count: int) -> list[Pocket]:
    """Grains of the first bed with runs, those far from one another first."""
    grains = first_bed()[1]
    features = np.array([features_of(one, 1.0, 1.0) for one in grains])
    return [grains[place] for place in designed(features, count)]


def scene(pocket: Pocket, shear_reynolds: float, turbulent: bool = False, check: str = "") -> Scene:
    """The scene of a run, in which d and, with inertia, u* are one."""
    asked = Survey(bed=bed(SEEDS[0]), runs=Runs(**CHECKS.get(check, {})))
    level = Surface.of(first_bed()[0]).level - float(pocket.centre[2])
    made = scene_of(pocket, level / pocket.diameter, asked, shear_reynolds or 1.0)
    model = "k-omega-sst" if turbulent else "laminar" if shear_reynolds else "creeping"
    row = {
        "pocket": pocket.number,
        "shear_reynolds": shear_reynolds,
        "model": model,
        "check": check,
    }
    title = {"title": title_of(row)}
    if not shear_reynolds:
        return made.model_copy(update=title)
    given: dict[str, Any] = made.model_dump() | title | {"effects": Effects(inertia=True)}
    given["fluid"] = Fluid(reynolds=shear_reynolds, scale="grain")
    given["flow"] = LogLaw(datum=made.flow.datum, roughness=ROUGHNESS)  # type: ignore[union-attr]
    if turbulent:
        datum = float(made.flow.datum)  # type: ignore[union-attr, arg-type]
        mean = mean_velocity(shear_reynolds)
        given["domain"] |= {"height": datum + DEPTH}
        given["fluid"] = Fluid(reynolds=shear_reynolds * mean, scale="grain")
        given["flow"] = OpenChannel(velocity=mean, datum=datum)
        given["effects"] = Effects(turbulence=True)
        given["turbulence"] = Turbulence(model="k-omega-sst", upstream_roughness=ROUGHNESS)
    return Scene.model_validate(given)


@cache
def mean_velocity(shear_reynolds: float) -> float:
    """Mean velocity over u* of an open channel over a rough bed, by the k-omega model."""
    return developed(DEPTH * shear_reynolds, ROUGHNESS / DEPTH).mean


def laminar_scenes() -> Iterator[list[Scene]]:
    """Scenes of laminar flow, those that matter most first, then the checks."""
    for level, count in LAMINAR.items():
        yield [scene(one, level) for one in chosen(count)]
    yield [
        scene(one, level, check=check)
        for check in CHECKS
        for level in CHECKED_AT
        for one in chosen(CHECKED)
    ]


def turbulent_scenes() -> Iterator[list[Scene]]:
    """Scenes with the k-omega model, those of a u* d/nu after the other."""
    for level in TURBULENT:
        yield [scene(one, level, turbulent=True) for one in chosen(LAMINAR[30.0])[:TURBULENT_COUNT]]


def compute(scenes: Sequence[Scene], means: dict[str, Any]) -> None:
    """Compute and store runs that are not stored yet; `means`: arguments of a sweep."""
    known = {title_of(row) for row in stored()}
    if lacking := [one for one in scenes if one.title not in known]:
        FILE.parent.mkdir(exist_ok=True)
        incipient.sweep.run(lacking, FILE, {"output.fields": [False]}, do="run", tries=1, **means)
        store(gathered())
    print(f"{len(stored())} runs in {STORE.relative_to(ROOT)}", flush=True)


def title_of(row: Mapping[str, Any]) -> str:
    """The title of the scene of a stored run."""
    return f"{row['pocket']:g}|{row['shear_reynolds']:g}|{row['model']}|{row['check']}"


def gathered() -> list[dict[str, Any]]:
    """Rows of the runs that are in the file and done."""
    result = []
    for row in incipient.sweep.rows(FILE):
        if row["status"] != "done":
            if row["reason"]:
                print(f"{row['source']}: {row['status']}, {row['reason']}")
            continue
        number, level, model, check = str(row["source"]).split("|")
        shear = float(level)
        if row.get("load_spread"):
            print(f"{row['source']}: not converged, loads within {row['load_spread']:.2g} of them")
        values = {name: f"{float(row.get(name, 0.0)):.5g}" for name in COMPONENTS}
        told = {"pocket": int(number), "shear_reynolds": shear, "model": model, "check": check}
        height = protrusion_of(int(number))
        speed = (
            top_speed(height, shear)
            if model != "k-omega-sst"
            else speed_entering(int(number), shear)
        )
        seconds = round(float(row["cpu"] or row["wall"]))
        result.append({**told, "speed": f"{speed:.5g}", **values, "seconds": seconds})
    return result


def speed_entering(number: int, shear_reynolds: float) -> float:
    """Velocity of the turbulent flow that enters, at the height of the top of a grain, in units of its scene."""
    pocket = next(one for one in first_bed()[1] if one.number == number)
    setup = Setup(scene(pocket, shear_reynolds, turbulent=True))
    top = np.array([setup.scene.body.centre[2] + 0.5])  # type: ignore[union-attr]
    at = setup.base_flow.column(setup.scene.domain.entrance, top)
    return float(setup.walls.inflow.velocity(at)[0, 0])


def protrusion_of(number: int) -> float:
    """Height of the top of a grain of the first bed above the bed's mean level."""
    return next(one.protrusion for one in first_bed()[1] if one.number == number)


def top_speed(height: float, shear_reynolds: float) -> float:
    """Mean velocity over u* at a height [d]; in creeping flow over u*^2 d/nu."""
    if not shear_reynolds:
        return height
    return float(
        MeanProfile(1.0, 1.0 / shear_reynolds, ROUGHNESS, 5.0).speed(np.array([height]))[0]
    )


def stored() -> list[dict[str, Any]]:
    """Rows of benchmarks/natural_bed.csv; none without it."""
    words = ("model", "check")
    return [
        {name: text if name in words else float(text) for name, text in row.items()}
        for row in _texts()
    ]


def _texts() -> list[dict[str, Any]]:
    """The same as they are written."""
    if not STORE.exists():
        return []
    with STORE.open() as file:
        return list(csv.DictReader(file))


def store(rows: Sequence[dict[str, Any]]) -> None:
    """Add rows to benchmarks/natural_bed.csv, in place of earlier ones of the same run."""

    def key(row: dict[str, Any]) -> tuple[str, str, float, int]:
        return (
            str(row["model"]),
            str(row["check"]),
            float(row["shear_reynolds"]),
            int(row["pocket"]),
        )

    known = {key(row): row for row in _texts()}
    known |= {key(row): dict(row) for row in rows}
    STORE.write_text(csv_text(COLUMNS, [known[one] for one in sorted(known)]))


def main() -> None:
    """Compute what is missing and store it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--turbulent", action="store_true", help="runs with the k-omega SST model")
    parser.add_argument("--jobs", type=int, help="runs at a time")
    parser.add_argument("--scheduler", help="tcp://HOST:PORT")
    parser.add_argument("--wall", help="time after which to stop, such as 2h")
    parser.add_argument("--limit", default="30m", help="time that a run may take")
    asked = parser.parse_args()
    means = {name: getattr(asked, name) for name in ("jobs", "scheduler", "wall", "limit")}
    for scenes in turbulent_scenes() if asked.turbulent else laminar_scenes():
        compute(scenes, means)


if __name__ == "__main__":
    main()
