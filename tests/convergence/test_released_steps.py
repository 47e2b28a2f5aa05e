"""A disc that meets a flat bed, slides, rolls and comes to rest in a fluid: convergence with steps and cells."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scenes import history_of

import incipient
from incipient.scene import loads

# It sinks by 2% of its size while it goes sideways, without turning. Its velocity falls by e in a time of 0.3.
SCENE = """
[domain]
kind = "box"
length = 6.0
height = 3.0
[fluid]
reynolds = 10.0
scale = "grain"
[flow]
kind = "still"
velocity = 1.0
[bed]
kind = "flat"
[body]
shape = "disc"
diameter = 1.0
centre = [2.5, 0.53]
motion = "free"
on_contact = "touch"
velocity = [1.0, -0.2]
density = 3.0
[gravity]
acceleration = 10.0
[contact]
friction = 0.1
[time]
end = 2.0
step = {step}
[numerics]
error_bars = false
mesh_size = {mesh_size}
tolerance = 1e-8
[output]
fields = false
"""


@dataclass(frozen=True)
class Came:
    """When it touched, its slip then, how long it slid, and where it came to rest."""

    touched: float
    slips: float
    slid: float
    rested: float

    @classmethod
    def to(cls, directory: Path, step: float, mesh_size: float = 2.0) -> Came:
        """What a run with steps and cells finds: a contact closes within a step, and slides for the rest of it."""
        incipient.run(loads(SCENE.format(step=step, mesh_size=mesh_size)), directory)
        names = ("time", "step", "contacts", "slip", "x", "y", "velocity_y")
        time, length, contacts, slip, x, y, falls = (history_of(directory)[name] for name in names)
        first = int(np.argmax(contacts > 0))
        above, speed = y[first - 1] - y[first], -0.5 * (falls[first - 2] + falls[first - 1])
        touched = float(time[first - 1] + above / speed)
        assert time[first - 1] <= touched <= time[first] + 1e-9
        length[first] = time[first] - touched
        slid = float((slip * length)[first:].sum())
        return cls(touched, float(slip[first]), slid, float(x[-1]))


@pytest.mark.slow
def test_contact_slip_and_rest_converge_with_the_step(tmp_path: Path) -> None:
    """To first order: a quarter of the step leaves a quarter of the error.

    Impulses know no time within a step. Friction that acts earlier by a part of a step shortens the slip by its
    speed times that part: what is left of it depends on where in its step the contact closes.
    """
    steps = (0.04, 0.01, 0.0025)
    coarse, fine, finest = (Came.to(tmp_path / f"{step}", step) for step in steps)
    for name in ("touched", "rested"):
        before, after = (
            abs(getattr(one, name) - getattr(other, name))
            for one, other in ((coarse, fine), (fine, finest))
        )
        assert after < 0.3 * before, name  # 0.26 and 0.28 when written
    for step, came in zip(steps, (coarse, fine), strict=False):
        assert abs(came.slid - finest.slid) < came.slips * step
    assert (finest.slid, finest.rested) == pytest.approx((0.0381, 2.7333), rel=2e-3)
