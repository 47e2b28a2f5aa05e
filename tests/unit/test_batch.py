"""Series of loads in time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import message

from incipient import cli
from incipient.simulation.judge_case import load_case
from incipient.simulation.judge_series import judge_series, read_columns

CASES = Path(__file__).parents[2] / "demos" / "cases"


def block(**columns: Any) -> dict[str, Any]:
    """A block of weight 1 on level ground with friction 0.5 in a push that comes and goes: it slides above 0.5."""
    time = np.linspace(0.0, 4.0, 4001)
    push = np.where((time >= 1.0) & (time < 2.0), 0.75, 0.25)
    return {"time": time, "force_x": push, "force_y": 0.0 * time, "couple": 0.0 * time, **columns}


BLOCK = """
[load]
weight = [0.0, -1.0]
flow_force = [0.25, 0.0]
flow_couple = 0.0
centre = [0.0, 0.5]
[contacts]
points = [[-2.0, 0.0], [2.0, 0.0]]
normals = [[0.0, -1.0], [0.0, -1.0]]
friction = 0.5
[grain]
mass = 1.0
inertia = 1.0
"""


def case_of(directory: Path) -> Path:
    path = directory / "block.toml"
    path.write_text(BLOCK)
    return path


def test_a_block_slides_while_it_is_pushed_too_hard(tmp_path: Path) -> None:
    """By Coulomb's law: it slides above a push of 0.5; for one unit of time 0.25 of 0.75 is more than can be held."""
    found = judge_series(load_case(case_of(tmp_path)), block())
    assert found.batch.factors[0] == pytest.approx(2.0) and found.batch.factors[
        1500
    ] == pytest.approx(2.0 / 3.0)
    assert found.shares == pytest.approx({"rest": 0.75, "sliding": 0.25})
    (event,) = found.events
    assert (event.start, event.mode) == (1.0, "sliding")
    assert (event.length, event.impulse, event.least) == pytest.approx((1.0, 0.25, 2.0 / 3.0))


def test_weight_and_friction_may_vary(tmp_path: Path) -> None:
    """Half the friction, or half the weight, halves what is held."""
    case, time = load_case(case_of(tmp_path)), block()["time"]
    halved = np.where(time < 2.0, 0.5, 0.25)
    found = judge_series(case, block(friction=halved))
    assert found.batch.factors[[0, -1]] == pytest.approx([2.0, 1.0])
    lighter = judge_series(case, block(weight_x=0.0 * time, weight_y=-2.0 * halved))
    assert lighter.batch.factors[[0, -1]] == pytest.approx([2.0, 1.0])


def test_couples_are_about_the_point_of_the_case(tmp_path: Path) -> None:
    """A push at the height of the ground does not tip: about that point its couple is zero."""
    text = BLOCK.replace("centre =", "about = [0.0, 0.0]\ncentre =").replace(
        "friction = 0.5", "friction = 9.0"
    )
    (tmp_path / "low.toml").write_text(text)
    columns = block(force_x=np.full(4001, 5.0))
    assert judge_series(load_case(tmp_path / "low.toml"), columns).shares == {"rest": 1.0}
    high = text.replace("about = [0.0, 0.0]", "about = [0.0, 1.0]")
    (tmp_path / "high.toml").write_text(high)
    assert judge_series(load_case(tmp_path / "high.toml"), columns).shares == {"pivoting": 1.0}


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"force_z": np.zeros(4001)}, "column force_z is not known"),
        ({"force_x": np.full(4001, np.nan)}, "force_x is not finite in sample 1"),
        ({"time": np.zeros(4001)}, "time does not grow"),
        ({"weight_x": np.zeros(4001)}, "some of the weight's columns are missing"),
        ({"friction": np.full(4001, -1.0)}, "friction is negative"),
    ],
)
def test_wrong_series_are_refused(columns: dict[str, Any], said: str, tmp_path: Path) -> None:
    case = load_case(case_of(tmp_path))
    assert said in message(lambda: judge_series(case, block(**columns)))


@pytest.mark.parametrize("letters", [5_000, 200_000])
def test_a_head_of_thousands_of_letters_is_refused_in_one_short_line(
    tmp_path: Path, letters: int
) -> None:
    path = tmp_path / "long.csv"
    path.write_text(f"time,force_x,force_y,couple,{'a' * letters}\n0,1,2,3,4\n")
    said = message(lambda: judge_series(load_case(case_of(tmp_path)), read_columns(path)))
    assert len(said) < 400 and (
        "is not known" in said or "its first row has more than 10000 letters" in said
    )


def test_the_command_judges_a_series(tmp_path: Path, capsys: Any) -> None:
    path, columns = tmp_path / "forces.csv", block()
    np.savetxt(
        path,
        np.array(list(columns.values())).T,
        delimiter=",",
        header=",".join(columns),
        comments="",
    )
    order = ["judge", str(case_of(tmp_path)), "--series", str(path), "--out", str(tmp_path / "out")]
    assert cli.main([*order, "--law", "U2"]) == 0
    said = capsys.readouterr().out
    assert "25.000% of the time" in said and "series.png" in said
    assert "probability at an instant 0.25" in said
    # A push of 0.5 is held: for a quarter of the time it is 0.75, else 0.25, and grows as the square of the velocity.
    assert f"probability 0.05  {np.sqrt(0.5 / 0.75):.4g} " in said
    assert f"probability 0.5   {np.sqrt(0.5 / 0.25):.4g} " in said
    stored = json.loads((tmp_path / "out" / "series.json").read_text())
    assert stored["events"][0]["impulse"] == pytest.approx(0.25)
    samples = (tmp_path / "out" / "series.csv").read_text().splitlines()
    assert len(samples) == 4002 and samples[1501].endswith("sliding")
    case = tmp_path / "without_load.toml"
    lines = case_of(tmp_path).read_text().splitlines(keepends=True)
    case.write_text("".join(one for one in lines if not one.startswith("flow_")))
    assert cli.main(["judge", str(case), "--series", str(path)]) == 0  # which it never reads
    assert "25.000% of the time" in capsys.readouterr().out
    case.write_text(case.read_text().replace("friction =", "# friction ="))
    assert cli.main(["judge", str(case), "--series", str(path)]) == 2
    said = capsys.readouterr().err
    assert f"{case}: contacts.friction: is missing" in said and "flow_force" not in said
    path.write_text("time,force_x\n1,x\n")
    assert cli.main(order) == 2 and "could not convert string 'x'" in capsys.readouterr().err
    path.write_text("time,force_x,force_x\n1,2,3\n")
    assert cli.main(order) == 2 and "two columns force_x" in capsys.readouterr().err
    assert cli.main([*order[:3], str(tmp_path / "absent.csv")]) == 2
    assert "cannot be read" in capsys.readouterr().err
