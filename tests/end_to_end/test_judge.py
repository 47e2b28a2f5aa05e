"""`incipient judge` on the demo cases, and both criteria in the result of a scene."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import incipient
from incipient.cli import main
from incipient.errors import OutputError
from incipient.files import MARK
from incipient.judging.case import Case, judge_case
from incipient.scene.mass import mass_and_inertia

ROOT = Path(__file__).parents[2]
CASES = ROOT / "demos" / "cases"

# Statics, as the head of each file says.
SAFETY_FACTORS = {
    "block_on_incline": (0.5 * np.cos(np.radians(20)) - np.sin(np.radians(20))) / 0.1,
    "disc_in_pocket": 0.25 / (0.3 * 0.5 * np.cos(np.radians(30)) + 0.04),
    "sphere_on_three_spheres": 0.5 / (2 * np.sqrt(3)) / (0.2 * 0.5 * np.sqrt(2 / 3) + 0.037010),
}


@pytest.mark.parametrize("name", sorted(path.stem for path in CASES.glob("*.toml")))
def test_demo_cases(name: str, tmp_path: Path, capsys: Any) -> None:
    """Judged as statics say; `--out` alone writes next to the case."""
    case = tmp_path / f"{name}.toml"
    case.write_text((CASES / case.name).read_text())
    few = ["--set", "errors.samples=50"] if "[errors]" in case.read_text() else []
    assert main(["judge", str(case), "--out", "--log-level", "error", *few]) == 0
    stored = json.loads((tmp_path / "judgement.json").read_text())
    verdict, factor = stored["verdict"], SAFETY_FACTORS[name]
    assert verdict["safety_factor"] == pytest.approx(factor, rel=1e-5) and not verdict["moves"]
    assert set(verdict["judges"]) == {"criteria", "equilibrium"}
    assert (tmp_path / "judgement.png").read_bytes().startswith(b"\x89PNG")
    written = {MARK, case.name, "judgement.json", "judgement.png"}
    assert {path.name for path in tmp_path.iterdir()} == written
    said = capsys.readouterr().out
    title, exact, paper, *_ = said.splitlines()
    assert title == stored["title"] and paper.startswith("By the paper's criteria ")
    assert exact == (
        f"The grain stays at rest, safety factor {factor:.4g}: "
        "that multiple of the flow's load could still be held."
    )
    assert f"numbers             {tmp_path / 'judgement.json'}\npictures  " in said
    chances = stored["probabilities"]
    assert (chances is None) == (not few)
    if few:
        assert sum(one["value"] for one in chances["equilibrium"].values()) == pytest.approx(1.0)
        assert (chances["samples"], chances["most"]) == (50, "flow_force x")
        assert "With the standard errors given it moves with a probability of" in said


def test_beyond_the_threshold_the_disc_pivots(capsys: Any) -> None:
    changes = ["--set", "load.flow_force=[0.6, 0.0]", "--set", "errors.samples=10"]
    assert main(["judge", str(CASES / "disc_in_pocket.toml"), *changes]) == 0
    said = capsys.readouterr().out
    # 0.25 / (0.6 0.5 cos 30 + 0.04) = 0.8339.
    assert "The grain begins to move (pivoting), safety factor 0.8339" in said
    assert "they differ: " in said


def test_bad_input_is_one_line_and_writes_nothing(tmp_path: Path, capsys: Any) -> None:
    out, override = tmp_path / "results", "contacts.normals=[[0, 1], [0, 1]]"
    order = ["judge", str(CASES / "block_on_incline.toml"), "--out", str(out)]
    assert main([*order, "--set", override]) == 2
    said, error = capsys.readouterr()
    assert said == "" and not out.exists() and error.count("\n") == 1
    assert error.startswith(f"incipient: --set {override}: contacts.normals[0]: points into the")


def test_a_picture_that_cannot_be_drawn_is_one_line(
    tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("incipient.pictures.apart.sys.executable", "/bin/false")
    order = ["judge", str(CASES / "block_on_incline.toml"), "--out", str(tmp_path)]
    assert main(order) == OutputError.exit_code
    error = capsys.readouterr().err
    why = "not drawn: the drawing ended with code 1; the other results are complete, draw again"
    assert error.startswith(f"incipient: {why}") and error.count("\n") == 1
    assert (tmp_path / "judgement.json").exists()


def test_a_scene_and_its_loads_as_a_case_have_one_verdict(tmp_path: Path) -> None:
    """The loads and contacts of a result, written as a case, give both criteria's answers of the scene."""
    scene = incipient.load(
        ROOT / "demos" / "scenes" / "grain_on_bed.toml",
        ["numerics.mesh_size=3", "output.fields=false", "output.pictures=false"],
    )
    text = incipient.run(scene, tmp_path).text()
    stored = json.loads((tmp_path / "result.json").read_text())
    verdict, force, couple = stored["verdict"], stored["force"], stored["torque"]
    weight = np.add(force["weight"], force["buoyancy"])
    contacts, (mass, inertia) = stored["contacts"], mass_and_inertia(scene.body, scene.placement)
    case = Case(
        load={
            "weight": weight[:2],
            "flow_force": force["flow"][:2],
            "flow_couple": couple["flow"][2],
            "centre": stored["grain"]["centre"],
        },
        contacts={
            "points": [contact["point"][:2] for contact in contacts],
            "normals": [contact["normal"][:2] for contact in contacts],
            "friction": scene.contact.friction,
        },
        grain={"mass": mass, "inertia": inertia[2, 2]},
    )
    judged = judge_case(case)["verdict"]
    factor = verdict["safety_factor"]
    assert judged["safety_factor"] == pytest.approx(factor, rel=1e-9)
    assert (judged["mode"], judged["moves"]) == (verdict["mode"], verdict["moves"])
    assert judged["moves"] == (factor < 1.0)
    modes = [one["judges"]["criteria"]["mode"] for one in (judged, verdict)]
    assert modes[0] == modes[1]
    # Contact forces shown balance the weight and that multiple of the flow's force.
    forces = verdict["judges"]["equilibrium"]["safety"]["contact_forces"]
    acting = weight + factor * np.array(force["flow"])
    assert np.sum(forces, axis=0) == pytest.approx(-acting, abs=1e-8)
    lines = text.splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("verdict             the "))
    assert lines[first + 1].strip().startswith("by the paper's criteria ")
