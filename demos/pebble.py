"""A scanned pebble on a bed of spheres, in creeping shear: does the verdict depend on how finely it was scanned?

Scaling: spheres of the bed of diameter 2, pebble 1.25 x 0.96 x 0.72, density of the fluid and shear rate 1, Re 0.05.
Cost:    two minutes of processor time on one core; the error bars of the first scan's flow serve the others.
Run:     mpirun -n 2 python demos/pebble.py [FACETS ...] [--set KEY=VALUE]
Results: results/pebble_FACETS, the scans beside it; `incipient show results/pebble_1280`; docs/validation/laminar.md
"""

import argparse
from pathlib import Path

from mpi4py import MPI
from scenes.scanned_pebble import scan

import incipient
from incipient.contact.safety import safety_factor
from incipient.setup.setup import Setup
from incipient.simulation.loads import load_of

SCENE, RANK = Path(__file__).parent / "scenes/pebble.toml", MPI.COMM_WORLD.rank
SAID = (
    "{} facets: {}, safety factor {:.3f}, its bars {:.3f} to {:.3f}; on other scans {:.3f}, {:.3f}"
)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("facets", nargs="*", type=int, default=[320, 1280, 5120])
    parser.add_argument("--set", action="append", default=[])
    given, low, high, bars, options = parser.parse_args(), 0.0, float("inf"), (1.0, 1.0), []
    for facets in given.facets:
        files = [
            scan(f"results/pebble_{facets}_{turn}.stl", facets, turn, RANK == 0)
            for turn in range(3)
        ]
        scenes = [
            incipient.load(SCENE, given.set + options + [file], MPI.COMM_WORLD) for file in files
        ]
        result, options = (
            incipient.run(scenes[0], f"results/pebble_{facets}"),
            ["numerics.error_bars=false"],
        )
        if RANK == 0:
            # The same load on other scans of the pebble, whose facets are elsewhere.
            loads = [load_of(scenes[0], result.load, scene.placement) for scene in scenes[1:]]
            held_by = [(Setup(scene).contacts, scene.contact.friction) for scene in scenes[1:]]
            others = [
                safety_factor(load, *by).value for load, by in zip(loads, held_by, strict=True)
            ]
            found = [result.verdict["safety_factor"], *others]
            if result.error_bars and (bar := result.error_bars.safety):
                bars = bar.low / bar.value, bar.high / bar.value
            low, high = max(low, bars[0] * min(found)), min(high, bars[1] * max(found))
            mode, ends = result.verdict["mode"], [bar * found[0] for bar in bars]
            print(SAID.format(facets, mode, found[0], *ends, *found[1:]), flush=True)
    if RANK == 0:
        print("all agree" if low <= high else f"they do not agree, by {low - high:.3f}")
