"""Whole runs of a grain that comes to the bottom: it is judged there and resumed from it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import result_of
from test_moving_grain import history_of

import incipient
from incipient.errors import SceneError
from incipient.scene import (
    Contact,
    Domain,
    Ellipse,
    Fluid,
    Gravity,
    Numerics,
    Output,
    Scene,
    Still,
    Time,
)

DENSITY, SEMI_AXES, GRAVITY, STEP = 3.0, (0.5, 0.35), 10.0, 0.04
AREA = np.pi * SEMI_AXES[0] * SEMI_AXES[1]


def sinking(end: float, **body: Any) -> Scene:
    """A heavy ellipse that sinks askew to the bottom of a box of fluid at rest, on a coarse mesh."""
    centre = (2.0, 0.6)
    return Scene(
        domain=Domain(kind="box", length=4.0, height=4.0),
        fluid=Fluid(reynolds=10.0, scale="grain"),
        flow=Still(),
        body=Ellipse(
            semi_axes=SEMI_AXES, centre=centre, angle=20, density=DENSITY, motion="free", **body
        ),
        gravity=Gravity(acceleration=GRAVITY),
        contact=Contact(friction=0.5, gap=0.05),
        time=Time(end=end, step=STEP),
        numerics=Numerics(
            mesh_size=3.0, error_bars=False, tolerance=1e-9, interface_tolerance=1e-9
        ),
        output=Output(fields=False),
    )


def test_momentum_is_balanced(tmp_path: Path) -> None:
    """m dV/dt = flow + weight, J dw/dt = torque of the flow, by the backward differences of the steps."""
    incipient.run(sinking(0.2), tmp_path)
    found, mass = history_of(tmp_path), DENSITY * AREA
    assert found["step"] == pytest.approx(STEP)
    force = np.array([found[f"force_{axis}"] for axis in "xy"])
    force[1] -= (mass - AREA) * GRAVITY
    inertia = mass * sum(a**2 for a in SEMI_AXES) / 4
    loads = np.vstack([force, found["torque"]])
    names = ("velocity_x", "velocity_y", "spin")
    velocities = np.array([np.r_[0.0, found[name]] for name in names])
    now, before, earlier = velocities[:, 2:], velocities[:, 1:-1], velocities[:, :-2]
    rates = (
        np.array([[mass], [mass], [inertia]]) * (1.5 * now - 2.0 * before + 0.5 * earlier) / STEP
    )
    missed, scale = np.abs(rates - loads[:, 1:]).max(axis=1), np.abs(loads).max()
    print(missed / scale)
    assert missed.max() < 1e-7 * scale  # 3e-9 when written; the flow is solved to 1e-9 of the load
    stored = result_of(tmp_path)
    assert stored["force"]["total"][:2] == pytest.approx(force[:, -1])
    assert stored["trajectory"]["ended"]["by"] == "time"


def test_contact_with_the_bottom_is_judged_and_the_run_resumed_from_it(tmp_path: Path) -> None:
    result = incipient.run(sinking(0.6), tmp_path)
    stored, rows = result_of(tmp_path), history_of(tmp_path)
    ended, verdict = stored["trajectory"]["ended"], stored["verdict"]
    assert (ended["by"], ended["nearest"], ended["without_verdict"]) == ("contact", "bottom", "")
    (contact,) = stored["contacts"]
    assert contact["point"][1] == pytest.approx(0.05) and contact["normal"] == pytest.approx(
        [0, -1, 0]
    )
    # One contact beside the centre: at rest there the weight alone would tip the ellipse over.
    assert verdict["moves"] and verdict["safety_factor"] == 0.0
    assert "at rest where it met the bottom" in result.text() and verdict["note"] in result.text()
    with pytest.raises(SceneError, match=r"set a smaller contact\.gap"):
        incipient.resume(tmp_path)
    with pytest.raises(SceneError, match=r"body\.on_contact"):
        incipient.resume(tmp_path, ["body.on_contact=bounce"])
    again = incipient.resume(tmp_path, ["contact.gap=0.01"])
    after = history_of(tmp_path)
    assert again.trajectory is not None and again.trajectory["ended"]["clearance"] < 0.03
    assert after["y"][: len(rows["y"])].tolist() == rows["y"].tolist()
    assert len(after["y"]) > len(rows["y"]) and after["y"][-1] < rows["y"][-1] - 0.01
    assert not (tmp_path / "checkpoint.h5").exists()
