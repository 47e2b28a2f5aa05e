"""Turbulent channels that tests share, and what they look at in runs of grains that move there."""

import csv
import textwrap

import numpy as np
import pytest

import incipient
from incipient.scene import (
    Disc,
    Domain,
    Effects,
    Flat,
    Fluid,
    OpenChannel,
    Scene,
)

CHANNEL = {
    "domain": Domain(length=20, height=1),
    "fluid": Fluid(reynolds=11000, scale="flow"),
    "flow": OpenChannel(),
    "effects": Effects(turbulence=True),
}


def channel(**changes):
    return Scene(**{**CHANNEL, **changes})


def grain(diameter, reynolds=2e5):
    return channel(
        fluid=Fluid(reynolds=reynolds, scale="flow"), body=Disc(diameter=diameter, x=4), bed=Flat()
    )


def column(directory, name):
    """A column of a run's history."""
    with (directory / "history.csv").open(newline="") as file:
        return np.array([float(row[name]) for row in csv.DictReader(file)])


MOVING = """
    import incipient
    from mpi4py import MPI
    from incipient.scene.file import loads

    found = incipient.run(loads(open(NAME).read()))
    if MPI.COMM_WORLD.rank == 0:
        print(*map(repr, [*found.force.flow[:2].tolist(), *found.trajectory["velocity"].tolist()]))
        print(len(found.trajectory["remeshings"]))
"""


def ends_on_ranks(mpirun, path):
    """Load, velocity and number of new meshes at the end of a scene's run, on one rank and on two."""
    found = []
    for ranks in (1, 2):
        done = mpirun(ranks, textwrap.dedent(MOVING).replace("NAME", repr(str(path))))
        assert done.returncode == 0, done.stderr
        found.append([float(word) for word in done.stdout.split()])
    return found


def resumed_and_whole(until, ends, directory, names):
    """Columns of a run kept at the first of two ends and resumed to the last, and of the whole one, with new meshes."""
    whole = incipient.run(until(ends[1]), directory / "whole")
    incipient.run(until(ends[0]), directory / "cut")
    resumed = incipient.resume(directory / "cut", [f"time.end={ends[1]!r}"])
    assert len(whole.trajectory["remeshings"]) >= 3
    assert resumed.force.flow == pytest.approx(whole.force.flow, rel=1e-10, abs=1e-12)
    return [[column(directory / run, name) for name in names] for run in ("cut", "whole")]
