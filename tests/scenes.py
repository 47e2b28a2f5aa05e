"""Scenes to be changed, published numbers, what runs leave, and what a wrong scene is told."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import incipient
from incipient.errors import SceneError
from incipient.scene import Disc, Domain, Flat, Fluid, Scene, Shear, Sphere, loads
from incipient.scene.file import example

# Where the files are that tests read.
ROOT = Path(__file__).parents[1]
SCENES, CASES = ROOT / "demos/scenes", ROOT / "demos/cases"
REFERENCE = ROOT / "tests/reference"

FLOW_SCALE = Fluid(reynolds=100, scale="flow")
GRAIN_SCALE = Fluid(reynolds=20, scale="grain")
CHANNEL = Domain(length=12, height=6)
BOX = Domain(kind="box", length=1, height=1)
DISC = Disc(diameter=1, x=4)
GRAIN_ON_BED = {
    "domain": CHANNEL,
    "fluid": GRAIN_SCALE,
    "flow": Shear(),
    "body": DISC,
    "bed": Flat(),
}
SPHERE_ON_PLANE = {
    "domain": Domain(length=12.0, width=8.0, height=6.0),
    "fluid": Fluid(reynolds=1.0, scale="grain"),
    "flow": Shear(),
    "body": Sphere(diameter=1.0, x=5.0),
    "bed": Flat(),
}

# Schaefer & Turek, Benchmark computations of laminar flow around a cylinder (1996); the digits of 2D-1 are those of
# G. Nabh, On high order methods for the stationary incompressible Navier-Stokes equations, Heidelberg 1998, as printed
# in public copies. The force is over V^2 L/2 = 0.2^2 0.1/2.
DFG_2D_1 = {"drag": 5.57953523384, "lift": 0.010618948146, "pressure difference": 0.11752016697}
FORCE_ON_CYLINDER = np.array([DFG_2D_1["drag"], DFG_2D_1["lift"]]) * 0.5 * 0.2**2 * 0.1
# Botella & Peyret, Benchmark spectral results on the lid-driven cavity flow, Comput. Fluids 27 (1998) 421, Re = 1000.
BOTELLA_PEYRET = {
    "minimum of v1": -0.3885698,
    "maximum of v2": 0.3769447,
    "minimum of v2": -0.5270771,
}

IN_PLANE = [0, 1, 5]  # of force and torque (6,)

# Half-discs with a disc between two of them, as overrides of the example.
POCKET = ("bed.kind=half-discs", "bed.radius=0.5", "bed.spacing=1.2", "bed.offset=1.0")
# The disc at rest in its pocket, in a domain that takes few cells.
SETTLED = (*POCKET, "domain.length=16", "domain.height=10", "body.x=7.6", "body.settle=true")
IN_STREAM = """
[domain]
length = 8.0
height = 4.0
[fluid]
reynolds = 20.0
scale = "grain"
[flow]
kind = "uniform"
[body]
shape = "disc"
diameter = 1.0
centre = [3.0, 2.0]
"""
# A tank at rest below a free surface.
TANK = """\
[domain]
kind = "box"
length = 1.0
height = 1.0
top = "free-surface"
[fluid]
reynolds = 100.0
scale = "flow"
[flow]
kind = "still"
[gravity]
acceleration = 1.0
"""
# An ellipse in a driven cavity, which carries it along below the lid.
CARRIED = """
[domain]
kind = "box"
length = 4.0
height = 4.0
[fluid]
reynolds = 20.0
scale = "flow"
[flow]
kind = "lid"
[body]
shape = "ellipse"
semi_axes = [0.5, 0.3]
centre = [1.2, 3.2]
density = 1.0
motion = "free"
[time]
end = 4.0
step = 0.1
start = "stokes"
[numerics]
mesh_size = 2.0
error_bars = false
[output]
fields = false
"""


def history_of(directory: Path, name: str = "history.csv") -> NDArray[Any]:
    """The rows of a run's history, or of another of its tables, columns by name."""
    options = {"names": True, "dtype": None, "encoding": "utf-8"}
    return np.atleast_1d(np.genfromtxt(directory / name, delimiter=",", **options))


def ran(scene: Scene, directory: Path) -> NDArray[Any]:
    """The history of a run that writes into a directory."""
    incipient.run(scene, directory)
    return history_of(directory)


def rows_of(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file, as text by the names of its columns; lines that begin with # are comments."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def scene(**changes):
    return Scene(**{**GRAIN_ON_BED, **changes})


def on_bed(*overrides: str) -> Scene:
    """The example, a disc on a flat bed in shear, with some keys changed."""
    return loads(example(), overrides=overrides)


def grain_on_bed() -> Scene:
    return on_bed()


def grain_in_pocket() -> Scene:
    """The example in 3-D, a sphere in a pocket of spheres."""
    return loads(example(in_space=True))


def sphere_on_plane(**changes):
    return Scene(**{**SPHERE_ON_PLANE, **changes})


def message(build, error: type[Exception] = SceneError) -> str:
    """The one line with which something is refused."""
    with pytest.raises(error) as caught:
        build()
    text = str(caught.value)
    assert "\n" not in text
    return text
