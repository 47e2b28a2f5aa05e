"""A disc that meets a flat bed, slides, rolls and comes to rest in a fluid: convergence with steps and cells."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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
    """When it first touched, how long it slid, and where it came to rest."""

    touched: float
    slid: float
    rested: float

    @classmethod
    def to(cls, directory: Path, step: float, mesh_size: float = 2.0) -> Came:
        """What a run with steps and cells finds."""
        incipient.run(loads(SCENE.format(step=step, mesh_size=mesh_size)), directory)
        names = ("time", "step", "contacts", "slip", "x")
        time, length, contacts, slip, x = (history_of(directory)[name] for name in names)
        return cls(float(time[contacts > 0][0]), float((slip * length).sum()), float(x[-1]))


@pytest.mark.slow
def test_contact_slip_and_rest_converge_with_the_step(tmp_path: Path) -> None:
    """To first order: halving the step halves what is left. When written 0.28, 0.26, 0.25 for the first contact.

    A contact closes within a step, and is told at the end of it.
    """
    coarse, half, quarter = (Came.to(tmp_path / f"{step}", step) for step in (0.04, 0.02, 0.01))
    assert quarter.touched - 1e-9 <= half.touched <= quarter.touched + 0.02 + 1e-9
    assert half.touched - 1e-9 <= coarse.touched <= half.touched + 0.04 + 1e-9
    for name in ("slid", "rested"):
        before, after = (
            abs(getattr(one, name) - getattr(other, name))
            for one, other in ((coarse, half), (half, quarter))
        )
        assert after < 0.55 * before  # 0.51 and 0.50 when written
    assert (quarter.slid, quarter.rested) == pytest.approx((0.0394, 2.734), rel=2e-3)
