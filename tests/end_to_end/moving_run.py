"""The directory of a made-up run: an ellipse carried round a box by a vortex, its mesh made anew nine times.

As a script: `moving_run.py DIRECTORY STEPS` writes it with dolfinx, in a process of its own. The flow is the
vortex alone, as if the ellipse were not there.
"""

from __future__ import annotations

import csv
import json
import sys
from functools import partial
from pathlib import Path

import numpy as np

LENGTH, HEIGHT, SEMI_AXES = 6.0, 4.0, (0.5, 0.25)
CENTRE, ORBIT, PERIOD, TURNS = (3.0, 2.0), (1.4, 0.8), 5.0, -1.25
SCENE = """
title = "An ellipse in a vortex"
[domain]
kind = "box"
length = 6.0
height = 4.0
[fluid]
reynolds = 10.0
scale = "flow"
[flow]
kind = "lid"
[body]
shape = "ellipse"
semi_axes = [0.5, 0.25]
centre = [4.4, 2.0]
motion = "free"
density = 1.0
[time]
end = 5.0
step = 0.05
[output]
every = 1
"""
RESULT = {
    "schema_version": 1,
    "title": "An ellipse in a vortex",
    "force": {"flow": [0.3, -0.1, 0.0], "buoyancy": [0, 0, 0], "weight": [0, 0, 0]},
    "torque": {"about": [4.4, 2.0, 0.0], "flow": [0, 0, 0.02]},
    "coefficients": {"drag": 1.0, "lift": 0.5, "moment": 0.1},
    "contacts": [],
    "grain": {"centre": [4.4, 2.0], "angle": 2 * np.pi * TURNS, "size": 1.0},
    "verdict": None,
}
COLUMNS = [
    "time",
    "step",
    "newton",
    "error",
    "x",
    "y",
    "angle",
    "velocity_x",
    "velocity_y",
    "spin",
    "force_x",
    "force_y",
    "torque",
    "interface",
    "interface_residual",
    "mesh_quality",
    "meshes",
    "energy_fluid",
    "energy_body",
    "dissipation",
    "power",
]


def course(times):
    """Columns x, y, angle and their rates at times (n,)."""
    t, rate = 2 * np.pi * np.asarray(times) / PERIOD, 2 * np.pi / PERIOD
    x, y = CENTRE[0] + ORBIT[0] * np.cos(t), CENTRE[1] - ORBIT[1] * np.sin(t)
    angle = TURNS * t + 0.3 * np.sin(2 * t)
    u, v = -ORBIT[0] * rate * np.sin(t), -ORBIT[1] * rate * np.cos(t)
    return np.column_stack([x, y, angle, u, v, rate * (TURNS + 0.6 * np.cos(2 * t))])


def write_history(path: Path, times, remeshed=()) -> None:
    """A history with all columns a run with a free body has."""
    with path.open("w", newline="") as stream:
        rows = csv.DictWriter(stream, COLUMNS, restval=0.0, lineterminator="\n")
        rows.writeheader()
        for time, moved in zip(times, course(times).tolist(), strict=True):
            row = dict(
                zip(("x", "y", "angle", "velocity_x", "velocity_y", "spin"), moved, strict=True)
            )
            meshes = 1 + sum(time > made for made in remeshed)
            rows.writerow({"time": time, "step": 0.05, "error": "", "meshes": meshes, **row})


def write_texts(directory: Path) -> None:
    """Scene and result."""
    (directory / "scene.toml").write_text(SCENE)
    (directory / "result.json").write_text(json.dumps(RESULT))


def vortex(x):
    """Velocity, pressure and vorticity of psi = -(sin(pi x/L) sin(pi y/H))^2, at rest on the walls, at (3, n)."""
    (a, b), (p, q) = (
        x[:2] * np.array([[np.pi / LENGTH], [np.pi / HEIGHT]]),
        (np.pi / LENGTH, np.pi / HEIGHT),
    )
    u, v = -q * np.sin(a) ** 2 * np.sin(2 * b), p * np.sin(2 * a) * np.sin(b) ** 2
    curl = 2 * p**2 * np.cos(2 * a) * np.sin(b) ** 2 + 2 * q**2 * np.sin(a) ** 2 * np.cos(2 * b)
    return np.array([u, v]), 0.5 * np.cos(a) * np.cos(b), curl


def placement(time):
    from incipient.geometry.placement import Placement

    x, y, angle = course([time])[0, :3]
    return Placement((x, y), angle)


def domain_at(time: float):
    """The box less the ellipse at a time."""
    from mpi4py import MPI

    from incipient.geometry.plane.curves import Line
    from incipient.geometry.plane.grains import Ellipse
    from incipient.mesh.domain import build
    from incipient.meshes import Near, Region, Sizes
    from incipient.meshes.model import meshed

    outline = tuple(curve.moved(placement(time)) for curve in Ellipse(SEMI_AXES).outline())
    floor = Line((0.0, 0.0), (LENGTH, 0.0))
    region = Region((floor,), HEIGHT, {"body": outline}, ("bottom", "right", "top", "left"))
    drawing = partial(meshed, region, Sizes(0.5, (Near(0.12, 0.3, boundary="body"),)), 2)
    return build(MPI.COMM_WORLD, drawing)


def write_fields(directory: Path, times, meshes: int) -> list[float]:
    """The series, on as many meshes; the times at which they were made."""
    from incipient import compat  # before dolfinx, as everywhere: it loads libraries in their order

    from dolfinx.fem import Function  # isort: skip
    from incipient.mesh.motion import MeshMotion, RigidDisplacement
    from incipient.output.xdmf import FieldSeries

    fields = surface = None
    parts = np.array_split(np.asarray(times), meshes)
    for part in parts:
        domain = domain_at(part[0])
        mesh, body = domain.mesh, domain.facets_of("body")
        motion = MeshMotion(domain)
        displacement = RigidDisplacement(domain, "body", placement(part[0]), turning=True)
        functions = [
            Function(compat.space(mesh, ("Lagrange", 2), shape)) for shape in ((2,), (), ())
        ]
        if fields is None:
            fields = FieldSeries(directory / "fields", mesh, mesh.comm)
            surface = FieldSeries(directory / "surface", mesh, mesh.comm, facets=body)
        else:
            fields.remeshed(mesh)
            surface.remeshed(mesh, body)
        for time in part:
            motion.move(displacement.at(placement(time)))
            for k, function in enumerate(functions):
                function.interpolate(lambda x, k=k: vortex(x)[k])
            fields.write(
                time, dict(zip(("velocity", "pressure", "vorticity"), functions, strict=True))
            )
            surface.write(time, {"traction": functions[0]})
    return [float(part[0]) for part in parts[1:]]


def write(directory: Path, steps: int) -> None:
    """The whole directory."""
    write_texts(directory)
    times = np.linspace(0.0, PERIOD, steps + 1)[1:]
    made = write_fields(directory, times, meshes=10)
    write_history(directory / "history.csv", np.linspace(0.0, PERIOD, 101)[1:], made)


if __name__ == "__main__":
    write(Path(sys.argv[1]), int(sys.argv[2]))
