"""Many loads at once against the judge of single cases, and series of loads in time."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import message

from incipient import cli
from incipient.contact.batch import Loads, judge_batch
from incipient.contact.problem import ContactProblem
from incipient.contact.safety import forces_that_balance
from incipient.contact.verdict import judged
from incipient.geometry.contacts import Contacts
from incipient.simulation.judge_case import load_case
from incipient.simulation.judge_series import judge_series, read_columns

CASES = Path(__file__).parents[2] / "demos" / "cases"
INERT = (1.0, 0.4 * np.eye(3))
IN_SPACE = {"near": 1e-9, "above": 1e-7}
PLANE, COUPLE = np.array([1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


def assert_as_one_by_one(
    loads: Loads,
    contacts: Contacts,
    friction: float,
    inert: Any = INERT,
    near: float = 1e-11,
    above: float = 0.0,
) -> Any:
    """The same modes, and factors as near; one that is larger by up to a part `above` must be balanced.

    There the single judge has stopped below the largest.
    """
    batch = judge_batch(loads, contacts, friction, inert)
    exact = [judged(loads.load(number), contacts, friction, inert) for number in range(len(loads))]
    assert [batch.labels[mode] for mode in batch.modes] == [one.label for one in exact]
    assert batch.held.tolist() == [not one.moves for one in exact]
    factors = np.array([one.safety.value for one in exact])
    better = (
        np.isfinite(factors)
        & (batch.factors > (1.0 + near) * factors)
        & (batch.factors < (1.0 + above) * factors)
    )
    assert batch.factors[~better] == pytest.approx(factors[~better], rel=near, abs=near)
    for number in np.flatnonzero(better).tolist():
        load = loads.load(number)
        problem = ContactProblem.of(load, contacts, friction)
        wrench, _ = problem.wrench(batch.factors[number])
        assert forces_that_balance(problem, wrench) is not None
    return batch


@pytest.mark.parametrize("count", [1, 2, 3, 4])
@pytest.mark.parametrize(
    "seed", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow)]
)
def test_random_cases_in_the_plane(count: int, seed: int) -> None:
    """Contacts anywhere below the centre with normals up to 0.4 radians off: wedged, jammed or lifting grains too."""
    rng = np.random.default_rng([seed, count])
    places = rng.uniform(-np.pi, 0.0, count)
    normals = places + rng.uniform(-0.4, 0.4, count)
    points, ways = (np.stack([np.cos(a), np.sin(a), 0.0 * a], axis=1) for a in (places, normals))
    noise = rng.standard_normal((2, 60, 3))
    loads = Loads(
        noise[0] * PLANE, 0.5 * noise[1] * COUPLE, np.array([0.2, -1.0, 0.0]), np.zeros(3)
    )
    batch = assert_as_one_by_one(loads, Contacts(points, ways), float(rng.uniform(0.1, 1.0)))
    assert batch.alone == 0


@pytest.mark.parametrize("name", ["disc_in_pocket", "block_on_incline"])
def test_loads_on_the_boundary_and_none_at_all(name: str) -> None:
    """Loads at, and to round-off at, the critical one, twice the same, along the weight, and no load."""
    case = load_case(CASES / f"{name}.toml")
    load, contacts, friction = case.to_load(), case.to_contacts(), case.contacts.friction
    factor = judged(load, contacts, friction).safety.value
    shares = np.array([0.0, 0.5, 1.0, 1.0 + 1e-9, 1.0 + 1e-3, 2.0])[:, None] * factor
    force = np.vstack(
        [shares * load.flow_force, [load.weight, -0.5 * load.weight, -2.0 * load.weight]]
    )
    couple = np.vstack([shares * load.flow_couple, np.zeros((3, 3))])
    assert_as_one_by_one(
        Loads(force, couple, load.weight, load.centre), contacts, friction, case.mass_and_inertia()
    )


def test_loads_in_space_and_without_inertia() -> None:
    case = load_case(CASES / "sphere_on_three_spheres.toml")
    load, rng = case.to_load(), np.random.default_rng(3)
    force = load.flow_force + 0.5 * np.abs(load.weight).max() * rng.standard_normal((6, 3))
    loads = Loads(force, np.tile(load.flow_couple, (6, 1)), load.weight, load.centre)
    for inert in (case.mass_and_inertia(), None):
        batch = assert_as_one_by_one(loads, case.to_contacts(), case.contacts.friction, inert)
        assert batch.alone == 0
    flat = Contacts(
        np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]]), np.array([[0.0, -1.0, 0.0]] * 2)
    )
    plane = Loads(
        rng.standard_normal((20, 3)) * PLANE,
        np.zeros((20, 3)),
        np.array([0.0, -1.0, 0.0]),
        np.zeros(3),
    )
    assert {"rest", "moves"} == {
        batch.labels[mode]
        for batch in [assert_as_one_by_one(plane, flat, 0.5, None)]
        for mode in batch.modes
    }


def random_grain(seed: int) -> tuple[Contacts, float, np.random.Generator]:
    """Three to six contacts anywhere below the centre, with normals up to 0.4 off, and friction from 0.2 to 0.8."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((int(rng.integers(3, 7)), 3)) - [0.0, 0.0, 1.5]
    points /= np.linalg.norm(points, axis=1)[:, None]
    normals = points + 0.4 * rng.uniform(-1.0, 1.0, points.shape)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return Contacts(points, normals), float(rng.uniform(0.2, 0.8)), rng


@pytest.mark.parametrize(
    "seed", [0, 1, 2, 3, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(4, 60))]
)
def test_many_loads_in_space(seed: int) -> None:
    """Sideways and upwards, from weak to several times the weight; safety factors to what Clarabel leaves."""
    contacts, friction, rng = random_grain(seed)
    sizes = 10.0 ** rng.uniform(-1.0, 0.5, (140, 1))
    force, couple = (
        sizes * rng.standard_normal((140, 3)),
        0.3 * sizes * rng.standard_normal((140, 3)),
    )
    loads = Loads(force, couple, np.array([0.1, 0.0, -1.0]), np.zeros(3))
    inertia = np.diag([0.3, 0.4, 0.5])
    assert_as_one_by_one(loads, contacts, friction, (1.0, inertia), **IN_SPACE)


def test_loads_in_space_on_the_boundary_and_with_weights_that_vary() -> None:
    """At the critical load and to 1e-9, 1e-6 and 1e-3 of it on both sides; no load; then weights each of its own."""
    case = load_case(CASES / "sphere_on_three_spheres.toml")
    load, contacts, friction = case.to_load(), case.to_contacts(), case.contacts.friction
    factor = judged(load, contacts, friction).safety.value
    away = np.array(
        [0.0, *(sign * 10.0**power for sign in (-1, 1) for power in (-9, -6, -3)), -1.0]
    )
    shares = np.tile(factor * (1.0 + away), 14)[:, None]
    loads = Loads(shares * load.flow_force, shares * load.flow_couple, load.weight, load.centre)
    batch = assert_as_one_by_one(loads, contacts, friction, case.mass_and_inertia(), **IN_SPACE)
    assert 0 < batch.alone < len(loads)
    rng = np.random.default_rng(5)
    weight = load.weight * rng.uniform(0.5, 2.0, (120, 1))
    varied = Loads(
        np.tile(load.flow_force, (120, 1)), np.tile(load.flow_couple, (120, 1)), weight, load.centre
    )
    assert assert_as_one_by_one(varied, contacts, friction, None, **IN_SPACE).alone < 10


ALONE = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in OTHERS:
            raise ModuleNotFoundError(name, name=name)
OTHERS = set("pydantic tomli_w trimesh rich matplotlib PIL numba clarabel mpi4py dolfinx gmsh".split())
sys.meta_path.insert(0, Absent())
import numpy as np
from incipient.contact import Contacts
from incipient.contact.batch import Loads, judge_batch
contacts = Contacts(np.array([[0.0, 0.0, -1.0]]), np.array([[0.0, 0.0, -1.0]]))
force = np.array([[0.25, 0.0, 0.0], [0.0, 0.0, 2.0]])
batch = judge_batch(Loads(force, 0.0 * force, [0.0, 0.0, -1.0], np.zeros(3)), contacts, 0.5, (1.0, np.eye(3)))
print(*(batch.labels[mode] for mode in batch.modes))
"""


def test_numpy_and_scipy_are_enough() -> None:
    """A point under the centre holds no push along the ground without turning; a lift twice the weight lifts."""
    done = subprocess.run(
        [sys.executable, "-c", ALONE], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[-1] == "lifting" and done.stdout.split()[0] != "rest"


def test_wrong_loads_are_refused() -> None:
    good, none = np.zeros((2, 3)), np.zeros(3)
    assert "give (n, 3)" in message(lambda: Loads(none, none, none, none))
    assert "couple is not 2 rows" in message(lambda: Loads(good, np.zeros((3, 3)), none, none))
    assert "force is not 2 rows" in message(lambda: Loads(good + np.nan, good, none, none))


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
