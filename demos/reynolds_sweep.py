"""The stability curve of a bead in its pocket: the flow that begins to move it, against its Reynolds number.

Scaling: half discs of the bed of diameter 1, the bead 0.6 to 1.3 times that; the viscosity follows from the Reynolds
         number, gravity stays the same. In space: a sphere in a pocket of spheres, at five Reynolds numbers.
Cost:    60 thresholds with error bars, three to five minutes on two cores; in space, on coarse cells in a small domain
         and without error bars, half a minute of processor time a case (finer by --set, see SMALL)
Run:     python demos/reynolds_sweep.py [plane | space] [--set KEY=VALUE] [--wall 8h]; on a cluster
         with --scheduler tcp://HOST:PORT, as docs/howto/cluster.md has it
Results: results/reynolds_sweep_plane.sqlite; `incipient table FILE`, `incipient show FILE`; all: docs/sweeps.md
"""

import argparse
from pathlib import Path

import incipient.sweep
from incipient.progress import telling

SCENES = Path(__file__).parent / "scenes"
SMALL = [
    *("numerics.mesh_size=5", "numerics.error_bars=false", "fluid.inertia=true"),
    *("domain.length=12", "domain.width=10", "domain.height=5", "domain.origin=[4, 5, 0]"),
]
STUDIES: dict[str, tuple[str, dict[str, str] | None, list[str]]] = {
    "plane": ("reynolds_sweep", None, []),  # as its section [sweep] says
    "space": ("sphere_in_pocket", {"fluid.reynolds": "log:0.1:30:5"}, SMALL),
}

if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("study", nargs="?", choices=STUDIES, default="plane")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--wall", help="end in time; call again to continue")
    parser.add_argument("--scheduler", help="of Dask")
    given = parser.parse_args()
    name, over, settings = STUDIES[given.study]
    scene, file = SCENES / f"{name}.toml", f"results/reynolds_sweep_{given.study}.sqlite"
    how = {"settings": [*settings, *given.set], "wall": given.wall, "scheduler": given.scheduler}
    with telling(0) as voice:
        done = incipient.sweep.run(scene, file, over, do="threshold", voice=voice, **how)
    counts = f"{done.done} thresholds computed, {done.failed} failed, {done.known} known before"
    print(f"{counts}: {file}")
