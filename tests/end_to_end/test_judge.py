"""`incipient judge` on the demo cases, and both judges in the result of a scene."""

import json
from pathlib import Path

import numpy as np
import pytest

import incipient
from incipient.cli import main
from incipient.errors import OutputError
from incipient.files import MARK

ROOT = Path(__file__).parents[2]
CASES = ROOT / "demos" / "cases"

# Statics, as the head of each file says.
SAFETY_FACTORS = {
    "block_on_incline": (0.5 * np.cos(np.radians(20)) - np.sin(np.radians(20))) / 0.1,
    "disc_in_pocket": 0.25 / (0.3 * 0.5 * np.cos(np.radians(30)) + 0.04),
    "sphere_on_three_spheres": 0.5 / (2 * np.sqrt(3)) / (0.2 * 0.5 * np.sqrt(2 / 3) + 0.037010),
}


def judged(path, capsys, *options):
    """Exit code, what was printed, and what was said on the error stream."""
    code = main(["judge", str(path), *options])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.mark.parametrize("name", sorted(path.stem for path in CASES.glob("*.toml")))
def test_demo_cases(name, tmp_path, capsys):
    case = CASES / f"{name}.toml"
    few = ["--set", "errors.samples=50"] if "[errors]" in case.read_text() else []
    code, said, _ = judged(case, capsys, "--out", str(tmp_path), "--log-level", "error", *few)
    assert code == 0
    stored = json.loads((tmp_path / "judgement.json").read_text())
    verdict = stored["verdict"]
    assert verdict["safety_factor"] == pytest.approx(SAFETY_FACTORS[name], rel=1e-5)
    assert not verdict["moves"]
    assert set(verdict["judges"]) == {"criteria", "equilibrium"}
    picture = tmp_path / "judgement.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert said.splitlines()[-2:] == [
        f"numbers             {tmp_path / 'judgement.json'}",
        f"pictures            {tmp_path}/: {picture.name}",
    ]
    title, exact, paper, *_ = said.splitlines()
    assert title == stored["title"]
    assert exact == (
        f"The grain stays at rest, safety factor {SAFETY_FACTORS[name]:.4g}: "
        "that multiple of the flow's load could still be held."
    )
    assert paper.startswith("By the paper's criteria ")


def test_beyond_the_threshold_the_disc_pivots(capsys):
    override = "load.flow_force=[0.6, 0.0]"
    code, said, _ = judged(
        CASES / "disc_in_pocket.toml", capsys, "--set", override, "--set", "errors.samples=10"
    )
    assert code == 0
    # 0.25 / (0.6 0.5 cos 30 + 0.04) = 0.8339.
    assert "The grain begins to move (pivoting), safety factor 0.8339" in said
    assert "they differ: " in said


def test_probability_with_standard_errors(tmp_path, capsys):
    path = CASES / "disc_in_pocket.toml"
    _, said, _ = judged(
        path, capsys, "--set", "errors.samples=200", "--out", str(tmp_path / "a" / "b")
    )
    chances = json.loads((tmp_path / "a" / "b" / "judgement.json").read_text())["probabilities"]
    assert chances["samples"] == 200
    assert sum(chance["value"] for chance in chances["equilibrium"].values()) == pytest.approx(1.0)
    assert chances["most"] == "flow_force x"
    assert "With the standard errors given it moves with a probability of" in said


def test_out_without_a_directory_writes_next_to_the_case(tmp_path, capsys):
    case = tmp_path / "block.toml"
    case.write_text((CASES / "block_on_incline.toml").read_text())
    assert judged(case, capsys, "--out")[0] == 0
    assert {path.name for path in tmp_path.iterdir()} == {
        MARK,
        "block.toml",
        "judgement.json",
        "judgement.png",
    }


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("contacts.friction=-1", "contacts.friction: is -1"),
        ("contacts.normals=[[0, 1], [0, 1]]", "contacts.normals[0]: points into the grain"),
        ("contacts.points=[]", "contacts.points: has 0 items"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(override, message, tmp_path, capsys):
    out = tmp_path / "results"
    code, said, error = judged(
        CASES / "block_on_incline.toml", capsys, "--set", override, "--out", str(out)
    )
    assert not out.exists()
    assert (code, said) == (2, "")
    assert error.startswith(f"incipient: --set {override}: {message}")
    assert error.count("\n") == 1


def test_missing_weight_names_the_file(tmp_path, capsys):
    case = tmp_path / "block.toml"
    lines = (CASES / "block_on_incline.toml").read_text().splitlines()
    case.write_text("\n".join(line for line in lines if not line.startswith("weight")))
    code, _, error = judged(case, capsys)
    assert code == 2
    assert error.startswith(f"incipient: {case}: load.weight: is missing; add it")


def test_a_picture_that_cannot_be_drawn_is_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("incipient.pictures.apart.sys.executable", "/bin/false")
    code, _, error = judged(CASES / "block_on_incline.toml", capsys, "--out", str(tmp_path))
    assert code == OutputError.exit_code
    assert error.startswith(
        "incipient: not drawn: the drawing ended with code 1; the rest is there, draw again"
    )
    assert error.count("\n") == 1
    assert (tmp_path / "judgement.json").exists()  # the numbers are kept


def test_both_judges_in_the_result_of_a_scene(tmp_path):
    scene = incipient.load(
        ROOT / "demos" / "scenes" / "grain_on_bed.toml",
        ["numerics.mesh_size=3", "output.fields=false", "output.pictures=false"],
    )
    result = incipient.run(scene, tmp_path)
    verdict = json.loads((tmp_path / "result.json").read_text())["verdict"]
    assert set(verdict["judges"]) == {"criteria", "equilibrium"}
    assert isinstance(verdict["agreement"]["agree"], bool)
    assert verdict["moves"] == (verdict["mode"] != "rest")
    factor = verdict["safety_factor"]
    assert verdict["moves"] == (factor < 1.0)
    # Contact forces shown balance the weight and that multiple of the flow's force.
    safety = verdict["judges"]["equilibrium"]["safety"]
    stored = json.loads((tmp_path / "result.json").read_text())["force"]
    acting = (
        np.array(stored["weight"])
        + np.array(stored["buoyancy"])
        + factor * np.array(stored["flow"])
    )
    assert np.sum(safety["contact_forces"], axis=0) == pytest.approx(-acting, abs=1e-8)
    lines = result.text().splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith("verdict "))
    first, second = lines[at : at + 2]
    assert first.startswith("verdict             the grain ")
    assert second.strip().startswith("by the paper's criteria ")
