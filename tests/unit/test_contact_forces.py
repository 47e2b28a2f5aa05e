"""Forces of contact of a moving grain as they are kept in contacts.csv and drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, Polygon

from incipient.errors import OutputError
from incipient.files import cut_after
from incipient.pictures.history import contact_forces
from incipient.scene import Scene, loads

SCENE = """
[domain]
length = 4.0
height = 2.0
[fluid]
reynolds = 10.0
scale = "grain"
[flow]
kind = "shear"
rate = 1.0
[bed]
kind = "flat"
[body]
shape = "disc"
diameter = 1.0
x = 2.0
density = 2.0
motion = "released"
[gravity]
acceleration = 1.0
[contact]
friction = 1.0
kinetic_friction = 0.5
[time]
end = 1.0
step = 0.1
"""
ROWS = """time,contact,x,y,normal_x,normal_y,force_x,force_y,slip
0.1,0,2.0,0.01,0.0,1.0,0.2,2.0,0.0
0.2,0,2.1,0.01,0.0,1.0,-0.5,1.0,0.3
0.2,1,2.4,0.01,0.0,1.0,0.0,0.0,0.0
"""


def scene() -> Scene:
    """A released disc."""
    return loads(SCENE)


def opening(cone: Polygon, point: tuple[float, float]) -> tuple[float, float]:
    """Least and largest direction [degrees] of a cone's corners from its point."""
    arms = cone.get_xy() - point
    arms = arms[np.linalg.norm(arms, axis=1) > 1e-9]
    directions = np.degrees(np.arctan2(*arms.T[::-1]))
    return directions.min(), directions.max()


def test_contacts_are_drawn_with_cones_of_their_friction_and_forces_to_one_scale(
    tmp_path: Path,
) -> None:
    """A contact that sticks has 45 degrees to either side, one that slides the arc tangent of 0.5."""
    (tmp_path / "contacts.csv").write_text(ROWS)
    found, axes = contact_forces(tmp_path, scene().contact), Figure().add_subplot()
    assert found is not None
    cone, arrow = found.draw(axes, 0.1, 1.0)
    assert isinstance(arrow, FancyArrowPatch)
    assert opening(cone, (2.0, 0.01)) == pytest.approx((45.0, 135.0))
    sliding, pushed, idle = found.draw(axes, 0.2, 1.0)
    half = np.degrees(np.arctan(0.5))
    assert opening(sliding, (2.1, 0.01)) == pytest.approx((90.0 - half, 90.0 + half))
    lengths = [np.linalg.norm(np.subtract(*one._posA_posB)) for one in (arrow, pushed)]
    assert lengths[1] / lengths[0] == pytest.approx(np.hypot(0.5, 1.0) / np.hypot(0.2, 2.0))
    assert opening(idle, (2.4, 0.01)) == pytest.approx((45.0, 135.0))
    assert found.draw(axes, 0.3, 1.0) == [] and len(found.draw(axes, 0.25, 1.0, 0.1)) == 3


def test_what_is_not_there_is_not_drawn_and_what_is_damaged_is_refused(tmp_path: Path) -> None:
    assert contact_forces(tmp_path, scene().contact) is None
    (tmp_path / "contacts.csv").write_text(ROWS.replace("2.4", "here"))
    with pytest.raises(OutputError, match=r"contacts\.csv: cannot be read"):
        contact_forces(tmp_path, scene().contact)


def test_a_resumed_run_drops_what_came_after_its_checkpoint(tmp_path: Path) -> None:
    path = tmp_path / "contacts.csv"
    path.write_text(ROWS + "0.3,0,2.")
    cut_after(path, 0.1)
    assert path.read_text().splitlines() == ROWS.splitlines()[:2]
    cut_after(tmp_path / "none.csv", 0.1)
