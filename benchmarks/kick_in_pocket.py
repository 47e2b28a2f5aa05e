"""The weakest kick that takes a disc out of its pocket in a fluid at rest: the table "kicks".

Physics: the disc of demos/scenes/leaving_pocket.toml in a closed box, set off at once as if it rolled over the next
         half-disc. Its added mass there is read off the force on it in a first instant of such a motion.
Limits:  without viscosity the kinetic energy, of mass and added mass, has to lift it to the saddle.
Cost:    half an hour of processor time; what is in the results is not computed again.
Run:     python benchmarks/kick_in_pocket.py [--report]
Results: benchmarks/kick_in_pocket.json, the table "kicks"; --report makes it from the first
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from gust_curve import ROOT, SCENE, Found, Pocket
from tables import publish

import incipient
from incipient.errors import IncipientError
from incipient.scene import Scene, load

STORE = ROOT / "benchmarks/kick_in_pocket.json"
# Reynolds number, gap over the size
CASES = ((10_000, 0.01), (1000, 0.01), (100, 0.01), (1000, 0.03), (1000, 0.1), (100, 0.1))
COARSE, WITHIN, GROWTH = (
    2.0,
    0.03,
    1.3,
)  # cells; brackets of the kick; steps until one takes the grain out
STEP, INSTANT, AT_ONCE = 0.02, 1e-4, 0.05  # first step over the others
LASTS = 2.0  # time in which a kicked grain is up or down again
SIZES = (1.0, 0.5)  # of cells, from which the added mass is extrapolated linearly


def scene(reynolds: float, gap: float, cells: float, body: Found, time: Found) -> Scene:
    """The pocket in a closed box, with the disc as it is asked for."""
    plain: dict[str, Any] = load(SCENE).model_dump(exclude_unset=True)
    held = {key: plain["body"][key] for key in ("shape", "diameter", "density")}
    return Scene(
        **{
            **{key: plain[key] for key in ("bed", "gravity")},
            "domain": plain["domain"] | {"kind": "box"},
            "flow": {"kind": "still", "velocity": 1.0},
            "fluid": {"reynolds": reynolds, "scale": "grain"},
            "body": held | body,
            "contact": {"friction": 10.0, "gap": gap},
            "time": time,
            "numerics": {"error_bars": False, "mesh_size": cells},
            "output": {"fields": False},
        }
    )


def pocket(gap: float) -> tuple[Pocket, tuple[float, float]]:
    """The pocket, and where the disc rests in it."""
    rests = load(SCENE, [f"contact.gap={gap}"])
    found = Pocket.of(rests)
    assert rests.bed is not None and rests.body is not None
    away = found.reach * found.sine
    x = math.ceil(rests.body.x / rests.bed.spacing) * rests.bed.spacing - away  # type: ignore[union-attr]
    return found, (x, found.height)


def history(one: Scene) -> dict[str, np.ndarray]:
    """Columns of numbers of a run, to where it came: a grain that falls back may spoil its mesh."""
    with tempfile.TemporaryDirectory() as place:
        try:
            incipient.run(one, place)
        except IncipientError as error:
            print(error, flush=True)
        table = np.genfromtxt(
            Path(place) / "history.csv", delimiter=",", names=True, dtype=None, encoding=None
        )
    return {name: np.atleast_1d(table[name]) for name in table.dtype.names}


def added_mass(gap: float) -> float:
    """Added mass over displaced of the disc that begins to roll over the next half-disc."""
    at, centre = pocket(gap)
    sizes, found = SIZES, []
    for size in sizes:
        course = [f"{at.cosine}*t", f"{at.sine}*t", f"{-1.0 / at.radius}*t"]
        body = {"centre": centre, "motion": "prescribed", "course": course}
        one = scene(10_000, 0.5 * gap, size, body, {"end": INSTANT, "step": INSTANT})
        forces = history(one)
        found.append(
            -(forces["force_x"][0] * at.cosine + forces["force_y"][0] * at.sine) / at.displaced
        )
    return float(found[1] - (found[0] - found[1]) / (sizes[0] - sizes[1]) * sizes[1])


def rises(reynolds: float, gap: float, kick: float) -> float:
    """The height that the disc reaches over that of the saddle, after a kick over the limit without viscosity."""
    at, centre = pocket(gap)
    own, heavier = at.inertia * at.mass, at.inertia * at.mass + ADDED[gap] * at.displaced
    lift = at.reach * (1.0 - at.cosine)
    speed = (
        kick * math.sqrt(2.0 * heavier * at.weight * lift) / own
    )  # before the fluid has taken its share
    body = {
        "centre": centre,
        "motion": "free",
        "on_contact": "touch",
        "velocity": (speed * at.cosine, speed * at.sine),
        "spin": -speed / at.radius,
    }
    time = {"end": LASTS, "step": STEP, "first_step": AT_ONCE, "until": "out-of-pocket"}
    return float((history(scene(reynolds, gap, COARSE, body, time))["y"].max() - centre[1]) / lift)


ADDED: dict[float, float] = {}


def compute() -> list[Found]:
    """All cases that are not in the store yet."""
    found: list[Found] = json.loads(STORE.read_text()) if STORE.exists() else []
    ADDED.update({one["gap"]: one["added"] for one in found})
    for reynolds, gap in CASES[len(found) :]:
        if gap not in ADDED:
            ADDED[gap] = added_mass(gap)
        at_limit = rises(reynolds, gap, 1.0)
        low, high = 1.0, GROWTH
        while rises(reynolds, gap, high) < 1.0 - 1e-4:
            low, high = high, GROWTH * high
        while high > (1.0 + WITHIN) * low:
            middle = math.sqrt(low * high)
            low, high = (
                (middle, high) if rises(reynolds, gap, middle) < 1.0 - 1e-4 else (low, middle)
            )
        found.append(
            {
                "reynolds": reynolds,
                "gap": gap,
                "added": ADDED[gap],
                "rises": at_limit,
                "stays": low,
                "leaves": high,
            }
        )
        print(found[-1], flush=True)
        STORE.write_text(json.dumps(found, indent=1) + "\n")
    return found


def table(found: list[Found]) -> list[str]:
    """The rows of the page."""
    rows = [
        "| Reynolds number | gap | added mass | limit without fluid, with added mass "
        "| rises at that limit to | critical impulse | work lost |",
        "| --: | --: | --: | --: | --: | --: | --: |",
    ]
    for one in found:
        at, _ = pocket(one["gap"])
        unit = math.sqrt(2.0 * at.mass * at.weight * at.radius)
        dry = (
            math.sqrt(2.0 * at.inertia * at.mass * at.weight * at.reach * (1.0 - at.cosine))
            / at.cosine
            / unit
        )
        wet = dry * math.sqrt(1.0 + one["added"] * at.displaced / (at.inertia * at.mass))
        kick = math.sqrt(one["stays"] * one["leaves"])
        rows.append(
            f"| {one['reynolds']} | {one['gap']:.0%} | {one['added']:.2f} | {dry:.3f}, {wet:.3f} "
            f"| {one['rises']:.0%} | {kick * wet:.2f} | {1.0 - kick**-2:.0%} |"
        )
    return rows


def written(found: list[Found]) -> None:
    """Put the table into the page."""
    publish("kicks", "\n".join(table(found)))


if __name__ == "__main__":
    written(json.loads(STORE.read_text()) if "--report" in sys.argv[1:] else compute())
