"""A run that was cut short and resumed ends where the whole run ends, with the same files."""

from __future__ import annotations

import csv
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from conftest import Command, Session
from processes import VORTEX_STREET, environment, result_of, settings

import incipient
from incipient.errors import ConvergenceError, MeshError, OutputError, SceneError
from incipient.fluid import Fluid, NewtonReport
from incipient.output.series_file import read_step, times

# The pebble of the pothole on a coarse mesh, which it wears out twice.
POTHOLE = """\
title = "pothole"
[domain]
kind = "box"
length = 40.0
height = 40.0
[fluid]
reynolds = 40.0
scale = "flow"
[flow]
kind = "lid"
velocity = 40.0
[body]
shape = "ellipse"
semi_axes = [2.0, 1.0]
centre = [20.0, 20.0]
motion = "free"
mass = 251.3
inertia = 314.2
[time]
end = 1.6
step = 0.1
[numerics]
mesh_size = 4.0
remesh_below = 0.85
[output]
every = 1
checkpoint = 100
"""
# Adaptive steps about a disc that stands still.
VORTICES = [
    *settings(numerics_order=2, numerics_mesh_size=4, time_step=0.01, time_end=0.3, time_tolerance=1e-2),
    *settings(output_every=3),
]
# How iterations went is not the trajectory: after resuming the first step's factors are new.
OF_ITERATIONS = ("newton", "interface", "interface_residual")


# -- what must be the same ---------------------------------------------------------------------------------------


def history(directory: Path) -> dict[str, list[Any]]:
    with (directory / "history.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


def assert_same_run(found: Path, expected: Path, rel: float = 1e-8) -> None:
    """The same rows, the same fields at the same times on the same meshes, the same end; every file readable."""
    one, other = history(found), history(expected)
    assert list(one) == list(other)
    for name in (name for name in one if name not in (*OF_ITERATIONS, "mode")):
        a, b = np.array(one[name], dtype=float), np.array(other[name], dtype=float)
        # An error of a step is a third difference, of which round-off is a larger share.
        scale = (1e3 if name == "error" else 1.0) * rel * np.nanmax(np.abs(b))
        assert a == pytest.approx(b, abs=scale, nan_ok=True), name
    for stem in ("fields", "surface"):
        assert_same_series(found / stem, expected / stem, rel)
    for numbers in (result_of(found), result_of(expected)):
        assert numbers["status"] == "complete"
        assert numbers["cost"]["iterations"]["steps"] == len(one["time"])


def assert_same_series(found: Path, expected: Path, rel: float) -> None:
    assert times(found) == pytest.approx(times(expected), rel=1e-10)
    for index in range(len(times(expected))):
        one, other = read_step(found, index), read_step(expected, index)
        assert one.cells.shape == other.cells.shape
        # Several ranks number the nodes in another order.
        mine, theirs = (np.lexsort(np.round(step.points, 6).T) for step in (one, other))
        assert one.points[mine] == pytest.approx(other.points[theirs], abs=1e-7)
        for name, values in other.fields.items():
            scale = 100 * rel * np.abs(values).max()
            assert one.fields[name][mine] == pytest.approx(values[theirs], abs=scale), (name, index)


# -- whole runs and cut ones -------------------------------------------------------------------------------------


def pothole(**values: object) -> incipient.Scene:
    from incipient.scene.file import loads

    return loads(POTHOLE, overrides=[option for option in settings(**values) if option != "--set"])


def vortices(**values: object) -> incipient.Scene:
    chosen = [*VORTICES, *settings(**values)]
    return incipient.load(VORTEX_STREET, [option for option in chosen if option != "--set"])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """`whole("pothole")`, `whole("vortices")`: directories of runs from the start to the end."""
    made: dict[str, Path] = {}

    def run(name: str) -> Path:
        if name not in made:
            made[name] = tmp_path_factory.mktemp(name)
            incipient.run({"pothole": pothole, "vortices": vortices}[name](), made[name])
        return made[name]

    return run


@pytest.fixture(scope="module")
def cut_pothole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that has come to t = 0.8, a new mesh behind it and another before it; not to be written to."""
    directory = tmp_path_factory.mktemp("cut")
    incipient.run(pothole(time_end=0.8, output_checkpoint=8), directory)
    return _with_checkpoints_of(directory, 100)


def _with_checkpoints_of(directory: Path, number: int) -> Path:
    """The directory of a run as if checkpoints had been asked for every so many steps."""
    return directory


def test_a_grain_goes_on_through_new_meshes(whole: Callable[[str], Path], tmp_path: Path) -> None:
    pass
