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
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from pictures import FIGURES, drawn, plain
from runs import run_with_history
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from tables import ROOT, Row, read_json, write_json

import incipient
from incipient.arrays import Floats
from incipient.parallel import world
from incipient.pictures import style
from incipient.scene import Scene, load
from incipient.setup.setup import Setup
from incipient.thresholds.gusts import GustSearch

SCENE = ROOT / "demos/scenes/leaving_pocket.toml"
STORE = ROOT / "benchmarks/gust_curve.json"
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


@dataclass(frozen=True)
class Pocket:
    """A disc that rests at a gap on two half-discs, and rolls over the next one.

    radius: the disc's; reach: from the centre of the half-disc to its own; sine, cosine: of the angle of that to the
    vertical; mass; weight: in the fluid; displaced: mass of the fluid in its place
    """

    radius: float
    reach: float
    sine: float
    cosine: float
    mass: float
    weight: float
    displaced: float

    @classmethod
    def of(cls, scene: Scene) -> Pocket:
        """The pocket of a scene, whose half-discs stand on the base line."""
        setup, bed = Setup(scene), scene.bed
        grain, placement = setup.scene.grain, setup.stance.placement
        assert placement is not None and scene.density is not None
        x, y = placement.centre
        away = bed.spacing * math.ceil(x / bed.spacing) - x
        reach, displaced = math.hypot(away, y), grain.volume
        gravity = float(np.linalg.norm(scene.gravity_vector))
        return cls(
            radius=0.5 * grain.size,
            reach=reach,
            sine=away / reach,
            cosine=y / reach,
            mass=scene.density * displaced,
            weight=(scene.density - 1.0) * displaced * gravity,
            displaced=displaced,
        )

    @property
    def time(self) -> float:
        """The unit of durations, sqrt(mass x size/weight)."""
        return math.sqrt(2.0 * self.mass * self.radius / self.weight)

    @property
    def impulse(self) -> float:
        """The unit of impulses, sqrt(mass x weight x size)."""
        return math.sqrt(2.0 * self.mass * self.weight * self.radius)

    @property
    def inertias(self) -> dict[str, float]:
        """Of rolling about the half-disc, over mass times reach squared."""
        in_fluid = 1.5 + AT_WALL * self.displaced / self.mass
        return {"without fluid": 1.5, "with added mass at a wall": in_fluid}

    def uphill(self, after: float, sine: float, cosine: float) -> float:
        """Work that the way to the saddle takes under a horizontal force, from an angle to the vertical."""
        top = math.atan2(after, self.weight)
        return self.weight * (math.cos(top) - cosine) - after * (sine - math.sin(top))

    def duration(self, force: float, after: float, inertia: float) -> float:
        """How long a horizontal force acts until the grain has the speed to reach the saddle under the one after it.

        inertia (reach x mass) x psi'' = weight sin(psi) - force cos(psi), from rest
        """
        turning = inertia * self.mass * self.reach

        def lacks(t: float, at: Floats) -> float:
            """Kinetic energy less what the way to the saddle takes."""
            return 0.5 * turning * at[1] ** 2 - self.uphill(after, math.sin(at[0]), math.cos(at[0]))

        def turns(t: float, at: Floats) -> list[float]:
            """The rates of angle and velocity."""
            return [at[1], (self.weight * math.sin(at[0]) - force * math.cos(at[0])) / turning]

        lacks.terminal, lacks.direction = True, 1.0  # type: ignore[attr-defined]
        start = [math.atan2(self.sine, self.cosine), 0.0]
        solved = solve_ivp(turns, (0.0, 1e3), start, events=lacks, rtol=1e-9, atol=1e-12)
        return float(solved.t_events[0][0])

    def limit(self, after: float, inertia: float) -> float:
        """The impulse of a short force that takes the grain over the saddle under the one after it."""
        energy = self.uphill(after, self.sine, self.cosine)
        return math.sqrt(2.0 * inertia * self.mass * self.reach * energy) / self.cosine

    def driving(self, force_x: Any, force_y: Any, couple: Any) -> Any:
        """The horizontal force through the centre that turns the grain about the next half-disc as much as a load."""
        along = force_x * self.cosine + force_y * self.sine - couple / self.radius
        return along / self.cosine


# -- runs -------------------------------------------------------------------------------------------


def scene(settings: list[str]) -> Scene:
    """The demo's scene on coarse cells, with other settings."""
    return load(SCENE, [*COARSE, *settings])


def at_rest(moving: Scene) -> dict[str, Any]:
    """The keys of the same grain held where it rests."""
    keys = moving.model_dump(exclude_unset=True)
    keys["body"]["motion"], keys["contact"] = "fixed", {"friction": keys["contact"]["friction"]}
    keys["time"].pop("until", None)
    return keys


def steady(strength: float) -> Scene:
    """The grain held in a steady flow as much faster, of the same viscosity."""
    keys = at_rest(scene([]))
    del keys["time"], keys["flow"]["gust"]
    keys["flow"]["rate"] *= strength
    keys["fluid"]["reynolds"] *= strength
    return Scene(**keys)


def impulse(pocket: Pocket, strength: float, duration: float) -> float:
    """What a gust gives a grain that is held."""
    settings = [f"flow.gust.strength={strength}", f"flow.gust.duration={duration}"]
    settings += [f"time.step={min(0.1, duration / 20)}", f"time.end={0.5 + duration}"]
    fixed = Scene(**at_rest(scene(settings)))
    rows = run_with_history(fixed)[1]
    time, force_x, force_y, torque = (
        np.array([row[name] for row in rows]) for name in ("time", "force_x", "force_y", "torque")
    )
    blown = time > fixed.flow.gust.start + 1e-9
    load = pocket.driving(force_x, force_y, torque)
    return float((load * np.diff(time, prepend=0.0))[blown].sum())


def compute() -> Row:
    """All that is not in the store yet."""
    results: Row = read_json(STORE, {"steady": [], "gusts": []})
    search, pocket = GustSearch(scene([]), world()), Pocket.of(scene([]))
    if "static" not in results:
        results["static"] = search.steady_threshold().factor
        write_json(STORE, results)
    for strength in STEADY[len(results["steady"]) :]:
        result = incipient.run(steady(strength))
        assert result.force is not None and result.torque is not None
        load = pocket.driving(*result.force.flow[:2], result.torque.flow[2])
        results["steady"].append([strength, float(load)])
        write_json(STORE, results)
    for duration in DURATIONS[len(results["gusts"]) :]:
        lowest = results["gusts"][-1]["held"] if results["gusts"] else results["static"]
        weakest = search.bracketed(duration, lowest, 1.4 * lowest)
        ends = {"held": weakest.held, "leaves": weakest.leaves}
        of_fixed = impulse(pocket, math.sqrt(weakest.held * weakest.leaves), duration)
        results["gusts"].append({"duration": duration, **ends, "impulse": of_fixed})
        write_json(STORE, results)
    return results


# -- what is shown ----------------------------------------------------------------------------------


def curve(results: Row, pocket: Pocket, inertia: float) -> Floats:
    """Strengths, durations and impulses (3, n) that take the grain over the saddle without resistance of the fluid."""
    # The logarithm of the force on the fixed grain by that of the strength: a parabola through the steady flows.
    law = np.polynomial.Polynomial.fit(*np.log(np.array(results["steady"]).T), 2)
    needed = math.log(pocket.weight * pocket.sine / pocket.cosine)
    # The strength of the steady flow that just turns the grain about the half-disc.
    crossing = math.exp(brentq(lambda at: law(at) - needed, 0.0, math.log(STRONGEST)))
    strengths = crossing * (1.0 + np.geomspace(1e-6, STRONGEST, 100))
    pushes, after = np.exp(law(np.log(strengths))), results["steady"][0][1]
    durations = [pocket.duration(push, after, inertia) for push in pushes]
    return np.array([strengths, durations, pushes * durations])


def draw(results: Row, panels: np.ndarray) -> None:
    """Strength against duration, and the impulse that a grain gets that is held."""
    pocket, (left, right) = Pocket.of(scene([])), panels[0]
    for (name, inertia), dashes in zip(pocket.inertias.items(), ("--", "-"), strict=True):
        look = {"linestyle": dashes, "color": style.INK, "linewidth": 1.0, "label": name}
        strengths, times, impulses = curve(results, pocket, inertia)
        left.plot(times, strengths, **look)
        right.plot(times / pocket.time, impulses / pocket.impulse, **look)
        limit = pocket.limit(results["steady"][0][1], inertia) / pocket.impulse
        right.axhline(limit, color=style.INK, linewidth=0.6, linestyle=":")
    points = sorted(results["gusts"], key=lambda point: point["duration"])
    times, low, high, impulses = (
        np.array([point[name] for point in points])
        for name in ("duration", "held", "leaves", "impulse")
    )
    mean, impulses = np.sqrt(low * high), impulses / pocket.impulse
    computed = {"color": style.FLOW, "markersize": 4, "label": "computed"}
    left.errorbar(times, mean, [mean - low, high - mean], fmt="o", capsize=2, **computed)
    left.axhline(results["static"], color=style.PUSH, lw=1.0, label="threshold of steady flow")
    right.plot(times / pocket.time, impulses, "o", **computed)
    for axes, unit in ((left, 1.0), (right, pocket.time)):
        ends = np.array([0.5 * times[0], 2.5 * times[-1]]) / unit
        axes.set(xscale="log", yscale="log", xlim=ends)
    left.set(
        xlabel="duration of the gust times the shear rate [-]",
        ylabel="gust strength [-]",
        ylim=(0.9 * results["static"], 3.0 * mean.max()),
    )
    right.set(
        xlabel="duration of the gust over $\\sqrt{mD/W}$",
        ylabel="impulse on the fixed grain over $\\sqrt{mWD}$",
        ylim=(0.25, 6.0 * impulses.max()),
    )
    plain(panels)
    left.legend()
    right.legend()


def main() -> None:
    """Compute what is missing unless told not to, and draw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--report", action="store_true", help="the figure from the stored results")
    results = read_json(STORE) if parser.parse_args().report else compute()
    with drawn(FIGURES / "gust_curve.webp", (9.0, 4.2), columns=2) as (_, panels):
        draw(results, panels)


if __name__ == "__main__":
    main()
