"""How good corrected loads and their error bars are: scenes beside runs with a tenth of their errors.

The true loads of a scene are those of a run with an eighth of its gap, a domain four times as large (in space 1.5
times) and smaller cells, corrected itself. An error bar is right where the corrected load is within it; it is useful
where it is much smaller than the bar of the load as computed.

Cost:    an hour; the scenes in the plane alone four minutes.
Run:     python benchmarks/calibration.py [a part of the scenes' names]
Results: benchmarks/calibration.json and, from all that it has, the table "calibration"
"""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI
from tables import publish, read_json, table, write_json

import incipient
from incipient.accuracy.coarse_runs import changed, farther
from incipient.accuracy.terms import has_no_far_sides, no_gap
from incipient.errors import IncipientError
from incipient.results.errorbars import ErrorBars
from incipient.results.result import Result
from incipient.scene import Scene, loads

STORED = Path(__file__).parent / "calibration.json"
CLOSER, LARGER = (
    0.125,
    {2: 4.0, 3: 1.5},
)  # gap and domain of the true loads, over those of the scene
SMALLEST_GAP = 1e-4
CELLS = {
    2: 0.7,
    3: 0.75,
}  # numerics.mesh_size of the true loads, over that of the scene, by the dimension
HEADS = ("scenes", "runs", "error as computed", "error corrected", "its bar", "error over bar")
# The last kind that a scene's name has a word of.
KINDS = {
    "2-D, flat bed or channel": ("disc", "ellipse", "square"),
    "2-D, pocket or trough": ("pocket", "trough", "rut"),
    "2-D, uniform flow": ("uniform flow",),
    "2-D, unsteady": ("t = 4",),
    "3-D": ("sphere", "ellipsoid"),
}

PLANE = """
[domain]
length = 24.0
height = 20.0
[fluid]
reynolds = 20.0
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "disc"
diameter = 1.0
x = 12.0
density = 2.65
[gravity]
acceleration = 20.0
[bed]
kind = "flat"
[contact]
friction = 0.5
"""
SPACE = (
    PLANE.replace("24.0", "24.0\nwidth = 16.0")
    .replace("disc", "sphere")
    .replace("20.0\n[fluid]", "12.0\n[fluid]")
)
IN_STREAM = "flow={kind='uniform'}"  # away from any bed
HALF_DISCS = (
    "bed={kind='half-discs', radius=0.5, spacing=1.2, offset=1.0}",
    "body.settle=true",
    "body.x=11.6",
)
# Of order two, and half of it is computed: its nearly true loads else take 20 GB.
SPHERES = (
    "bed={kind='spheres', arrangement='square', radius=0.5, spacing=1.0, offset=[12.0, 8.5]}",
    "body.settle=true",
    "body.x=12.5",
    "contact.gap=0.02",
    "domain.length=12",
    "domain.width=8",
    "domain.height=6",
    "domain.origin=[6.5, 4.0, 0.0]",
    "numerics.order=2",
)

TROUGH = ("bed={kind='sinusoidal', amplitude=0.15, wavelength=1.5}",)
RUT = (
    "bed={kind='polyline', points=[[0, 0], [10.5, 0], [11.5, -0.5], [12.5, -0.5], [13, 0], [30, 0]]}",
)
BODY = "x=12.0, density=2.65, settle=true"
BODIES = {
    "ellipse": f"body={{shape='ellipse', semi_axes=[0.7, 0.4], angle=20, {BODY}}}",
    "rectangle": f"body={{shape='rectangle', width=1.0, height=0.6, corner_radius=0.1, {BODY}}}",
    "polygon": f"body={{shape='polygon', vertices=[[0, 0], [1, 0.1], [1.1, 0.7], [0.5, 1], [-0.1, 0.5]], {BODY}}}",
    "superellipse": f"body={{shape='superellipse', semi_axes=[0.6, 0.45], exponent=4, angle=5, {BODY}}}",
    "star": f"body={{shape='star', radius=0.5, cosines=[0, 0, 0.08], sines=[0, 0.03], {BODY}}}",
}

# What each scene has other than a disc, or a sphere, on a flat bed in shear flow at Re 20.
SCENES: dict[str, tuple[str, ...]] = {
    "disc": (),
    "disc, Stokes flow": ("fluid.inertia=false",),
    "disc, Re 60": ("fluid.reynolds=60",),
    "disc, Re 100": ("fluid.reynolds=100",),
    "disc, domain 12 x 6": ("domain.length=12", "domain.height=6", "body.x=5"),
    "disc, gap 0.002": ("contact.gap=0.002",),
    "disc, gap 0.03": ("contact.gap=0.03",),
    "disc, large cells": ("numerics.mesh_size=3",),
    "disc, order 2": ("numerics.order=2",),
    "disc in a channel": ("flow={kind='poiseuille', velocity=1.0}", "domain.height=4"),
    "disc in an open channel": ("flow={kind='open-channel', velocity=1.0}", "domain.height=4"),
    "disc in uniform flow": (IN_STREAM, "body.centre=[9.0, 10.0]"),
    "disc in uniform flow, 8 x 4": (
        IN_STREAM,
        "domain.length=8",
        "domain.height=4",
        "body.centre=[3.0, 2.0]",
    ),
    "disc in uniform flow, Re 40": (IN_STREAM, "body.centre=[9.0, 10.0]", "fluid.reynolds=40"),
    "ellipse": ("body={shape='ellipse', semi_axes=[0.7, 0.4], x=12.0, density=2.65}",),
    "ellipse, Stokes flow": (
        "body={shape='ellipse', semi_axes=[0.7, 0.4], x=12.0, density=2.65}",
        "fluid.inertia=false",
    ),
    "square": ("body={shape='rectangle', width=0.8, height=0.8, x=12.0, density=2.65}",),
    "disc on a slope": ("bed={kind='inclined', slope=0.1}",),
    "disc in a pocket": HALF_DISCS,
    "disc in a pocket, Stokes flow": (*HALF_DISCS, "fluid.inertia=false"),
    "disc in a pocket, Re 60": (*HALF_DISCS, "fluid.reynolds=60"),
    "disc in a trough": (
        "bed={kind='sinusoidal', amplitude=0.1, wavelength=2.0}",
        "body.settle=true",
    ),
    **{f"{name} in a trough": (body, *TROUGH) for name, body in BODIES.items()},
    **{f"{name} in a rut": (body, *RUT) for name, body in BODIES.items()},
    **{f"{name} in a pocket": (body, HALF_DISCS[0]) for name, body in BODIES.items()},
    "disc, started at once, t = 4": ("time={end=4.0, step=0.1, start='stokes'}",),
    "disc, in time from steady flow, t = 4": ("time={end=4.0, step=0.2, start='steady'}",),
    "sphere, Stokes flow": ("fluid.inertia=false",),
    "sphere": (),
    "sphere, Re 100": ("fluid.reynolds=100",),
    "sphere, large cells": ("numerics.mesh_size=2", "fluid.inertia=false"),
    "sphere in uniform flow, Re 20": (IN_STREAM, "body.centre=[9.0, 8.0, 6.0]"),
    "sphere in uniform flow, Re 100": (
        IN_STREAM,
        "body.centre=[9.0, 8.0, 6.0]",
        "fluid.reynolds=100",
    ),
    "ellipsoid": ("body={shape='ellipsoid', semi_axes=[0.6, 0.5, 0.4], x=12.0, density=2.65}",),
    "sphere in a pocket": (*SPHERES, "fluid.inertia=false"),
    "sphere in a channel": ("flow={kind='poiseuille', velocity=1.0}", "domain.height=3"),
}


def scene_of(name: str) -> Scene:
    """The scene of a name."""
    text = SPACE if name.startswith(("sphere", "ellipsoid")) else PLANE
    if IN_STREAM in SCENES[name]:
        text = text.split("[gravity]")[0].replace("x = 12.0\n", "")
    return loads(text, overrides=(*SCENES[name], "output.fields=false"), name=name)


def nearly_true(scene: Scene) -> Scene:
    """The scene with its errors much smaller, as far as it has them."""
    numerics = {"mesh_size": CELLS[scene.gdim] * min(scene.numerics.mesh_size, 1.0)}
    if scene.gdim == 2:
        numerics["order"] = 3
    finer = changed(scene, numerics=numerics)
    if not no_gap(scene) and scene.contact is not None:
        finer = changed(finer, contact={"gap": max(CLOSER * scene.contact.gap, SMALLEST_GAP)})
    if not has_no_far_sides(scene):
        finer = farther(finer, LARGER[scene.gdim])
    if scene.time is not None:
        finer = changed(finer, time={"step": 0.5 * scene.time.step})
    return finer


@dataclass(frozen=True)
class Row:
    """Relative errors of the force, or of the couple over force times size, and their bars."""

    name: str
    computed: float
    computed_bar: float
    corrected: float
    corrected_bar: float
    apart: float

    @property
    def within(self) -> bool:
        """Whether the corrected load is as near to the true one as its bar says, component by component."""
        return self.apart <= 1.0

    @property
    def kind(self) -> str:
        """Which of `KINDS` it is of."""
        return [kind for kind, words in KINDS.items() if any(word in self.name for word in words)][
            -1
        ]

    def text(self) -> str:
        """The row for the screen."""
        errors = (self.computed, self.computed_bar, self.corrected, self.corrected_bar)
        return f"{self.name}: {', '.join(f'{100 * one:.2g}%' for one in errors)}; {self.apart:.2f}"


def row_of(name: str) -> Row:
    """The row of a scene."""
    scene = scene_of(name)
    return compared(
        name, *(incipient.run(one, comm=MPI.COMM_SELF) for one in (scene, nearly_true(scene)))
    )


def compared(name: str, result: Result, true: Result) -> Row:
    """The force of a run beside the nearly true one."""
    bars, better = _bars(result), _bars(true)
    assert result.force is not None and true.force is not None
    size = float(np.linalg.norm(true.force.flow))
    plain = sum(term.uncorrected.force for term in bars.terms if term.name != "interaction")
    error = np.abs(result.force.flow - true.force.flow)
    apart = np.max(error / np.maximum(bars.total.force + better.total.force, 1e-9 * size))
    of_plain = np.linalg.norm(result.force.computed - true.force.flow)
    lengths = (
        of_plain,
        np.linalg.norm(plain),
        np.linalg.norm(error),
        np.linalg.norm(bars.total.force),
    )
    return Row(name, *(float(one) / size for one in lengths), float(apart))


def _bars(result: Result) -> ErrorBars:
    assert result.error_bars is not None
    if result.error_bars.failed:
        print(f"  not computed: {result.error_bars.failed}")
    return result.error_bars


def text_of(rows: list[Row]) -> str:
    """The table of all scenes, and what it comes to."""
    ratio = float(np.median([row.corrected_bar / row.computed_bar for row in rows]))
    within = sum(row.within for row in rows)
    alone = sum(row.corrected <= row.corrected_bar for row in rows)
    summary = (
        f"{within} of {len(rows)} corrected forces differ from the finer runs' by less than both bars together, "
        f"{alone} by less than their own bars. The median ratio of bars with and without corrections is {ratio:.2f}."
    )
    kinds = {kind: [row for row in rows if row.kind == kind] for kind in KINDS}
    cells = [_cells(kind, some) for kind, some in kinds.items() if some]
    return f"{table(HEADS, cells)}\n\n{summary}"


def _cells(kind: str, rows: list[Row]) -> list[str]:
    """A row of the table: medians, and the largest in brackets."""
    columns = [
        [getattr(row, name) for row in rows] for name in ("computed", "corrected", "corrected_bar")
    ]
    cells = [f"{100 * np.median(column):.2g}% ({100 * max(column):.2g}%)" for column in columns]
    return [kind, str(len(rows)), *cells, f"{max(row.apart for row in rows):.2f}"]


def main(wanted: list[str]) -> int:
    """Run the scenes whose names have one of the words wanted, or all, and renew the page after each."""
    stored = {row["name"]: Row(**row) for row in read_json(STORED, [])}
    for name in SCENES:
        if wanted and not any(word in name for word in wanted):
            continue
        try:
            stored[name] = row_of(name)
        except IncipientError as error:
            print(f"{name}: {error}", flush=True)
            continue
        print(stored[name].text(), flush=True)
        rows = [stored[one] for one in SCENES if one in stored]
        write_json(STORED, [asdict(row) for row in rows])
        publish("calibration", text_of(rows))
    return 0 if all(row.within for row in stored.values()) else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
