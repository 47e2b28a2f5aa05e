"""Cells along a smooth bump in turbulent flow by k-omega SST: placed as friction needs them, and judged."""

import math

import numpy as np
import pytest

import incipient
from incipient.accuracy.coarse_runs import KeptRuns
from incipient.errors import ConvergenceError
from incipient.results.result import Result
from incipient.results.wall_report import MOST_COARSE
from incipient.scene import (
    Domain,
    Effects,
    Fluid,
    Numerics,
    OpenChannel,
    Output,
    Polyline,
    Scene,
    Turbulence,
)

X = [-3.0 + 0.15 * i for i in range(41)]
BUMP = tuple((x, 0.08 * math.cos(math.pi * x / 1.5) ** 2 if abs(x) < 0.7501 else 0.0) for x in X)
BEHIND_CREST = (
    0.00296  # C_f at x = 0.2 on cells 0.025 long; 0.00259 on those of 0.05, 0.00185 on those of 0.1
)


def over_bump(mesh_size: float) -> Result:
    """The flow over a bump 0.08 high and 1.5 long in a channel of depth one."""
    return incipient.run(
        Scene(
            domain=Domain(length=6.0, height=1.0, origin=(-3.0, 0.0)),
            fluid=Fluid(reynolds=40000.0, scale="flow"),
            flow=OpenChannel(),
            bed=Polyline(points=BUMP, smooth=True),
            effects=Effects(turbulence=True),
            turbulence=Turbulence(model="k-omega-sst"),
            numerics=Numerics(order=2, mesh_size=mesh_size, error_bars=False),
            output=Output(fields=False),
        )
    )


@pytest.mark.slow
def test_cells_along_a_bump_follow_its_friction():
    """With cells 0.1 long the friction behind the crest was 40% too small."""
    walls = over_bump(1.0).turbulence
    along = walls.along["bed"]  # at nodes 0.05 apart, between which friction halves
    assert np.interp(0.2, along["x"], along["friction"]) == pytest.approx(BEHIND_CREST, rel=0.15)
    assert walls.judged_along and walls.coarse_along < MOST_COARSE and not walls.doubt


@pytest.mark.slow
def test_cells_too_long_for_the_friction_along_a_bump_are_not_called_resolved():
    walls = over_bump(2.0).turbulence
    assert walls.coarse_along > MOST_COARSE
    assert "NOT RESOLVED" in walls.lines()[0] and "set numerics.mesh_size = 1;" in walls.doubt


def test_a_coarse_run_that_fails_does_not_advise_the_user_for_its_own_scene():
    def fails(scene: Scene) -> None:
        raise ConvergenceError("cells at walls are thick; use a smaller fluid.reynolds")

    domain = Domain(length=1.0, height=1.0)
    scene = Scene(domain=domain, fluid=Fluid(reynolds=1.0, scale="flow"), flow=OpenChannel())
    with pytest.raises(ConvergenceError) as told:
        KeptRuns({}, lambda: "", fails)(scene)
    assert str(told.value) == "cells at walls are thick, in a run for comparison"
