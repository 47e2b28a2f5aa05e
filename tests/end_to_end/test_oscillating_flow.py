"""A disc in a pocket in a flow to and fro: it rolls without sliding, once the torques about its next contact say so.

As measured and computed by van Overveld, Mazzuoli, Uhlmann, Clercx & Duran-Matute (2026, J. Fluid Mech. 1027, A12) for
a bead: just above the threshold it rolls without sliding, and the threshold is where the torques of the instantaneous
load balance, that of the pressure gradient among them, by which it comes before the largest velocity.
"""

from __future__ import annotations

import csv
import math
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from test_released import POCKET

import incipient
from incipient.planning.flow_setup import Setup
from incipient.results.result import Result
from incipient.scene import Scene, loads

PERIOD, STRENGTH, BESIDE = 1.0, 2.0, 0.5  # BESIDE: of the centre from those of the half-discs


def scene(motion: str, gravity: float) -> Scene:
    """The disc, held or released, in a shear that is a sine of time."""
    points = [
        [t, STRENGTH * math.sin(2.0 * math.pi * t / PERIOD)]
        for t in np.linspace(0.0, 2.0, 161).tolist()
    ]
    plain = loads(POCKET.format(gravity=gravity)).model_dump(exclude_unset=True)
    plain["fluid"]["reynolds"], plain["contact"]["friction"], plain["numerics"]["mesh_size"] = (
        4.0,
        1.0,
        2.0,
    )
    plain["body"] |= {"density": 2.0, "motion": motion}
    plain["flow"]["gust"] = {"shape": "points", "points": points}
    return Scene(**plain, time={"end": 1.25, "step": 0.025})


def history(one: Scene) -> tuple[Result, dict[str, list[str]]]:
    """A run and its columns."""
    with TemporaryDirectory() as place:
        result = incipient.run(one, Path(place) / "run")
        with (Path(place) / "run/history.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
    return result, {name: [row[name] for row in rows] for name in rows[0]}


@cache
def threshold() -> tuple[float, float]:
    """The largest gravity at which the torque of the flow about a half-disc outweighs that of the weight, and when.

    That of the held grain: about the half-disc ahead and the one behind.
    """
    held = scene("fixed", 10.0)
    _, found = history(held)
    time, along, up, couple = (
        np.array([float(one) for one in found[name]])
        for name in ("time", "force_x", "force_y", "torque")
    )
    placement = Setup(held).geometry.stance.placement
    assert placement is not None
    reach = math.hypot(BESIDE, placement.centre[1])
    sine, cosine = BESIDE / reach, placement.centre[1] / reach
    turning = [
        (way * along * cosine + up * sine - way * couple / 0.5) / sine for way in (1.0, -1.0)
    ]
    whole, submerged = np.maximum(*turning), math.pi / 4.0
    return float(whole.max()) / submerged, float(time[int(np.argmax(whole))])


def test_the_torques_are_largest_before_the_velocity_is() -> None:
    """By a seventh of the period: 0.6 when written, for 0.75."""
    _, when = threshold()
    assert 0.05 < 0.75 - when < 0.2


@pytest.mark.slow
@pytest.mark.parametrize(("share", "moves"), [(1.03, False), (0.97, True)])
def test_a_disc_in_a_flow_to_and_fro_rolls_from_where_the_torques_say(
    share: float, moves: bool
) -> None:
    """It rolls to and fro at its contact, without slip."""
    gravity, when = threshold()
    result, found = history(scene("released", share * gravity))
    assert result.trajectory is not None
    first = result.trajectory["on_bed"]["first_motion"]
    assert (first is not None) == moves
    assert set(found["mode"]) == ({"rest", "rolling"} if moves else {"rest"})
    assert max(map(float, found["slip"])) < 1e-9
    assert not moves or first == pytest.approx(when, abs=0.05)
