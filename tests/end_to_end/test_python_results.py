"""What a result gives to a program: the flow at points, the traction as arrays, one line for a reader."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from scenes import message

import incipient
from incipient.mesh.sampling import sample
from incipient.results.result import Result
from incipient.scene import example, loads

COARSE = ("numerics.mesh_size=4", "numerics.error_bars=false", "output.fields=false")


@pytest.fixture(scope="module")
def found() -> Result:
    return incipient.run(loads(example(), overrides=COARSE), comm=MPI.COMM_SELF)


def test_the_flow_at_points_and_none_outside(found: Result) -> None:
    """Far above the grain the flow is the given shear, v = (y, 0) above the bed's crest at y = 0."""
    centre = found.grain["centre"][:2]
    far, within, below = [1.0, 10.0], centre, [5.0, -1.0]
    above, *none = found.at([far, within, below])
    assert none == [None, None]
    assert above.velocity == pytest.approx([10.0, 0.0], abs=0.05)
    assert above.velocity == pytest.approx(sample(found.velocity, np.array([far]))[0])
    (single,) = found.at(far)
    assert single.pressure == above.pressure
    assert "give an array (n, 2)" in message(lambda: found.at([1.0, 2.0, 3.0]))


def test_tractions_add_up_to_the_force(found: Result) -> None:
    """The integral over the disc by the trapezoidal rule in the angle; the force is that of the residual."""
    points, vectors = found.traction.points, found.traction.vectors
    arms = points - found.grain["computed_centre"][:2]
    angles = np.arctan2(*arms.T[::-1])
    order = np.argsort(angles)
    radius, wide = (
        np.linalg.norm(arms, axis=1).mean(),
        np.append(angles[order], angles[order][0] + 2.0 * np.pi),
    )
    mean = 0.5 * (vectors[order] + np.roll(vectors[order], -1, axis=0))
    force = radius * (np.diff(wide)[:, None] * mean).sum(axis=0)
    assert np.linalg.norm(arms, axis=1) == pytest.approx(radius, rel=1e-3)
    assert force == pytest.approx(found.force.flow[:2], abs=0.05 * np.linalg.norm(found.force.flow))


def test_a_result_is_one_short_line(found: Result) -> None:
    line = repr(found)
    assert "\n" not in line and len(line) < 300
    assert (
        line.startswith("<Result: ") and found.verdict["mode"] in line and "safety factor" in line
    )
