"""The weakest gusts that move a disc out of its pocket, between their limits: a figure.

Physics: demos/scenes/leaving_pocket.toml on coarse cells; for each duration the critical strength, and the same gust
         past the grain held in its place (what the flow gives).
Limits:  long gusts: the steady flow that begins to move it. Short ones: the impulse that lifts it over the saddle,
         without fluid and with the added mass of a cylinder at a wall.
Cost:    a quarter of an hour of processor time; what is in the results is not computed again.
Run:     python benchmarks/gust_curve.py [--report]
Results: benchmarks/gust_curve.json, docs/figures/gust_curve.webp; --report makes it from the first
"""

from __future__ import annotations

import argparse
import io
import json
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import incipient
from incipient.arrays import Floats
from incipient.parallel import world
from incipient.scene import Scene, load
from incipient.setup.setup import Setup
from incipient.thresholds.gusts import GustSearch

ROOT = Path(__file__).parents[1]
SCENE = ROOT / "demos/scenes/leaving_pocket.toml"
STORE = ROOT / "benchmarks/gust_curve.json"
FIGURE = ROOT / "docs/figures/gust_curve.webp"
DURATIONS = (4.0, 2.0, 1.0, 0.5, 0.25)
STEADY = (1.0, 2.0, 4.0, 8.0)  # strengths of steady flows past the grain held in its place
STRONGEST = 40.0  # strength to which that force is continued
COARSE = [
    "numerics.mesh_size=2",
    "time.step=0.1",
    "output.fields=false",
    "output.every=0",
    "time.end=6",
]
# Added mass over that of the fluid displaced: a cylinder that touches a wall (pi^2/3 - 1, potential flow).
AT_WALL = math.pi**2 / 3.0 - 1.0
FLOW, PUSH, INK = "#2166ac", "#b2182b", "#333333"
STYLE = {"font.size": 9, "axes.linewidth": 0.7, "legend.frameon": False, "legend.fontsize": 8}

Found = dict[str, Any]


@dataclass(frozen=True)
class Pocket:
    """A disc that rests at a gap on two half-discs, and rolls over the next one.

    radius: the disc's; reach: from the centre of the half-disc to its own; sine, cosine: of the angle of that to the
    vertical; height: of its centre; mass; weight: in the fluid; displaced: mass of the fluid in its place; speed: of
    the flow at its centre
    """

    radius: float
    reach: float
    sine: float
    cosine: float
    height: float
    mass: float
    weight: float
    displaced: float
    speed: float

    @classmethod
    def of(cls, one: Scene) -> Pocket:
        """The pocket of a scene, whose half-discs stand on the base line."""
        setup, bed = Setup(one), one.bed
        grain, placement = setup.scene.grain, setup.stance.placement
        assert grain is not None and placement is not None and one.density is not None
        x, y = placement.centre
        away = bed.spacing * math.ceil(x / bed.spacing) - x  # type: ignore[union-attr]
        reach, displaced = math.hypot(away, y), grain.volume
        speed = setup.base_flow.velocity(np.array([[x], [y], [0.0]]), 0.0)[0, 0]
        weight = (one.density - 1.0) * displaced * float(np.linalg.norm(one.gravity_vector))
        return cls(
            *(
                0.5 * grain.size,
                reach,
                away / reach,
                y / reach,
                y,
                one.density * displaced,
                weight,
                displaced,
            ),
            float(speed),
        )

    @property
    def time(self) -> float:
        """The unit of durations, sqrt(mass x size/weight)."""
        return math.sqrt(2.0 * self.mass * self.radius / self.weight)

    @property
    def inertia(self) -> float:
        """Of rolling about the half-disc without fluid, over mass times reach squared."""
        return 1.5

    @property
    def inertia_in_fluid(self) -> float:
        """The same with the added mass of a cylinder at a wall."""
        return self.inertia + AT_WALL * self.displaced / self.mass

    def duration(self, force: float, after: float, inertia: float) -> float:
        """How long a horizontal force acts until the grain has the speed to reach the saddle under the one after it.

        inertia (reach x mass) x psi'' = weight sin(psi) - force cos(psi), from rest
        """
        top = math.atan2(after, self.weight)

        def lacks(t: float, at: Floats) -> float:
            """Kinetic energy less what the way to the saddle takes."""
            uphill = self.weight * (math.cos(top) - math.cos(at[0])) - after * (
                math.sin(at[0]) - math.sin(top)
            )
            return 0.5 * inertia * self.mass * self.reach * at[1] ** 2 - uphill

        def turns(t: float, at: Floats) -> list[float]:
            """The rates of angle and velocity."""
            return [at[1], (self.weight * math.sin(at[0]) - force * math.cos(at[0])) / own]

        own = inertia * self.mass * self.reach
        lacks.terminal, lacks.direction = True, 1.0  # type: ignore[attr-defined]
        start = [math.atan2(self.sine, self.cosine), 0.0]
        solved = solve_ivp(turns, (0.0, 1e3), start, events=lacks, rtol=1e-9, atol=1e-12)
        return float(solved.t_events[0][0])

    def limit(self, after: float, inertia: float) -> float:
        """The impulse of a short force that takes the grain over the saddle under the one after it."""
        top = math.atan2(after, self.weight)
        uphill = self.weight * (math.cos(top) - self.cosine) - after * (self.sine - math.sin(top))
        return math.sqrt(2.0 * inertia * self.mass * self.reach * uphill) / self.cosine


# -- runs -------------------------------------------------------------------------------------------


def scene(settings: list[str]) -> Scene:
    """The demo's scene on coarse cells, with other settings."""
    return load(SCENE, [*COARSE, *settings])


def gust(strength: float, duration: float) -> list[str]:
    """Settings of a gust."""
    step = min(0.1, duration / 20)
    return [f"flow.gust.strength={strength}", f"flow.gust.duration={duration}", f"time.step={step}"]


def history_of(one: Scene) -> dict[str, Floats]:
    """The columns of numbers of a run."""
    with tempfile.TemporaryDirectory() as place:
        incipient.run(one, place)
        table = np.genfromtxt(
            Path(place) / "history.csv", delimiter=",", names=True, dtype=None, encoding=None
        )
    return {name: table[name] for name in table.dtype.names}


def held(one: Scene) -> Scene:
    """The same grain held where it rests."""
    plain = one.model_dump(exclude_unset=True)
    plain["body"]["motion"], plain["contact"] = "fixed", {"friction": plain["contact"]["friction"]}
    plain["time"] = {key: value for key, value in plain["time"].items() if key != "until"}
    return Scene(**plain)


def steady(strength: float) -> Scene:
    """The grain held in a steady flow as much faster, of the same viscosity."""
    plain = held(scene([])).model_dump(exclude_unset=True)
    del plain["time"], plain["flow"]["gust"]
    plain["flow"]["rate"] *= strength
    plain["fluid"]["reynolds"] *= strength
    return Scene(**plain)


def driving(pocket: Pocket, force: Floats, couple: float | Floats) -> Any:
    """The horizontal force through the centre that turns the grain about the next half-disc as much as a load does."""
    along = force[0] * pocket.cosine + force[1] * pocket.sine - couple / pocket.radius
    return along / pocket.cosine


def measured(pocket: Pocket, duration: float, stays: float, leaves: float) -> Found:
    """The critical gust of a duration, and the impulse that it gives a grain that is held."""
    one = held(scene([*gust(math.sqrt(stays * leaves), duration), f"time.end={0.5 + duration}"]))
    still = history_of(one)
    length = np.diff(still["time"], prepend=0.0)
    load = driving(pocket, np.array([still["force_x"], still["force_y"]]), still["torque"])
    blown = still["time"] > one.flow.gust.start + 1e-9  # type: ignore[union-attr]
    impulse = float((load * length)[blown].sum())
    return {"duration": duration, "held": stays, "leaves": leaves, "impulse": impulse}


def compute() -> Found:
    """All that is not in the store yet."""
    found: Found = json.loads(STORE.read_text()) if STORE.exists() else {"steady": [], "gusts": []}
    search, pocket = GustSearch(scene([]), world()), Pocket.of(scene([]))
    if "static" not in found:
        found["static"] = search.steady_threshold().factor
        keep(found)
    for strength in STEADY[len(found["steady"]) :]:
        result = incipient.run(steady(strength))
        assert result.force is not None and result.torque is not None
        load = driving(pocket, result.force.flow, float(result.torque.flow[2]))
        found["steady"].append([strength, float(load)])
        keep(found)
    for duration in DURATIONS[len(found["gusts"]) :]:
        lowest = found["gusts"][-1]["held"] if found["gusts"] else found["static"]
        weakest = search.bracketed(duration, lowest, 1.4 * lowest)
        found["gusts"].append(measured(pocket, duration, weakest.held, weakest.leaves))
        keep(found)
    return found


def keep(found: Found) -> None:
    """Write the results so far."""
    STORE.write_text(json.dumps(found, indent=1) + "\n")


# -- what is shown ----------------------------------------------------------------------------------


def curve(found: Found, pocket: Pocket, inertia: float) -> Floats:
    """Strengths, durations and impulses (3, n) that take the grain over the saddle without resistance of the fluid."""
    law = force_law(found)
    above = np.geomspace(1e-6, STRONGEST, 100)
    asked = crossing(found, pocket) * (1.0 + above)
    pushes, after = np.exp(law(np.log(asked))), found["steady"][0][1]
    lasts = [pocket.duration(force, after, inertia) for force in pushes]
    return np.array([asked, lasts, pushes * lasts])


def crossing(found: Found, pocket: Pocket) -> float:
    """The strength of the steady flow that just turns the grain about the half-disc."""
    law, needed = force_law(found), math.log(pocket.weight * pocket.sine / pocket.cosine)
    return math.exp(brentq(lambda strength: law(strength) - needed, 0.0, math.log(STRONGEST)))


def force_law(found: Found) -> np.polynomial.Polynomial:
    """The logarithm of the force on the held grain by that of the strength: a parabola through the steady flows."""
    strengths, forces = np.log(np.array(found["steady"]).T)
    return np.polynomial.Polynomial.fit(strengths, forces, 2)


def drawn(found: Found, pocket: Pocket) -> Figure:
    """Strength against duration, and the impulse that a held grain gets."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    points = sorted(found["gusts"], key=lambda one: one["duration"])
    lasts, low, high, impulses = (
        np.array([one[name] for one in points])
        for name in ("duration", "held", "leaves", "impulse")
    )
    lines = (
        (pocket.inertia, "without fluid", "--"),
        (pocket.inertia_in_fluid, "with added mass at a wall", "-"),
    )
    unit = pocket.mass * pocket.weight * 2.0 * pocket.radius
    for inertia, name, dashes in lines:
        strengths, times, given = curve(found, pocket, inertia)
        left.plot(times, strengths, dashes, color=INK, linewidth=1.0, label=name)
        right.plot(
            times / pocket.time,
            given / math.sqrt(unit),
            dashes,
            color=INK,
            linewidth=1.0,
            label=name,
        )
        limit = pocket.limit(found["steady"][0][1], inertia)
        right.axhline(limit / math.sqrt(unit), color=INK, linewidth=0.6, linestyle=":")
    mean = np.sqrt(low * high)
    left.errorbar(
        lasts,
        mean,
        [mean - low, high - mean],
        fmt="o",
        color=FLOW,
        markersize=4,
        capsize=2,
        label="computed",
    )
    left.axhline(found["static"], color=PUSH, linewidth=1.0, label="threshold of steady flow")
    right.plot(
        lasts / pocket.time,
        impulses / math.sqrt(unit),
        "o",
        color=FLOW,
        markersize=4,
        label="computed",
    )
    left.set(
        xlabel="duration of the gust times the shear rate [-]",
        ylabel="gust strength [-]",
        xscale="log",
        yscale="log",
    )
    right.set(
        xlabel="duration of the gust over $\\sqrt{mD/W}$",
        ylabel="impulse on the fixed grain over $\\sqrt{mWD}$",
        xscale="log",
        yscale="log",
    )
    left.set_xlim(0.5 * lasts[0], 2.5 * lasts[-1])
    right.set_xlim(0.5 * lasts[0] / pocket.time, 2.5 * lasts[-1] / pocket.time)
    left.set_ylim(0.9 * found["static"], 3.0 * mean.max())
    right.set_ylim(0.25, 6.0 * float(np.max(impulses)) / math.sqrt(unit))
    for axes in (left, right):
        _quiet(axes)
    return figure


def _quiet(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend()


def report(found: Found) -> None:
    """Write the figure."""
    pocket = Pocket.of(scene([]))
    with rc_context(STYLE):
        held_image = io.BytesIO()
        drawn(found, pocket).savefig(held_image, dpi=160)
    FIGURE.parent.mkdir(parents=True, exist_ok=True)
    with Image.open(held_image) as image:
        image.convert("RGB").save(FIGURE, "WEBP", quality=85)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--report", action="store_true", help="the figure from the stored results")
    report(json.loads(STORE.read_text()) if parser.parse_args().report else compute())
