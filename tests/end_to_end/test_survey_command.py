"""Surveys and judged cases as commands."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from PIL import Image
from scenes import CASES, SCENES, rows_of

import incipient
from incipient.cli import main
from incipient.files import MARK
from incipient.judging.case import Case, judge_case
from incipient.pictures import survey as chart
from incipient.scene.file import parse
from incipient.scene.grains import mass_and_inertia
from incipient.survey.beds import Spheres
from incipient.survey.full_runs import scene_of
from incipient.survey.pockets import Surface, pockets
from incipient.survey.request import FlowPast, Survey

# `incipient survey`: what it writes, draws and reports, what it refuses, and that nothing is computed twice.


BED = """
title = "A small bed"
[bed]
kind = "deposited"
number = 70
length = 6.0
width = 6.0
tries = 3
seed = 2
[flow]
friction = 0.3
azimuth = 30.0
"""
# Coarse runs in a small domain.
RUNS = "[runs]\nnumber = 10\nmesh_size = 3.0\ndomain = 6.0\nmeshed_bed = 0.4\ngap = 0.05\nwith_error_bars = 0\n"


@pytest.fixture
def bed(tmp_path: Path) -> Path:
    (tmp_path / "bed.toml").write_text(BED)
    return tmp_path / "bed.toml"


@pytest.mark.slow
def test_a_bed_without_runs(command, bed: Path) -> None:
    done = command("survey", bed, "--out", "out")
    out = bed.parent / "out"
    for said in (
        "70 grains",
        "carry no other",
        "Kirchner et al. 55.0",
        "none computed",
        "survey.png, survey.vtp",
    ):
        assert said in done.stdout
    stored, grains = json.loads((out / "survey.json").read_text()), rows_of(out / "grains.csv")
    assert len(grains) == stored["surveyed"] and len(rows_of(out / "spheres.csv")) == 70
    free = [one for one in grains if one["carries"] == "0"]
    assert len(free) == stored["free"] > 3 and all(
        0.0 < float(one["pivot"]) <= 90.0 for one in free
    )
    with Image.open(out / "survey.png") as image:
        assert image.format == "PNG"
    stored["request"]["flow"]["azimuth"] = 90.0
    on_bed, by_pivot, *_ = chart.figure(stored, out).axes
    assert on_bed.texts[0].get_text() == "flow" and on_bed.texts[0].xyann[1] > 1.0  # off the bed
    drawn = by_pivot.lines[0].get_xdata()
    # All grains are of the median size, to which pivot angles are reduced.
    assert drawn == pytest.approx(sorted(float(one["pivot"]) for one in free))
    balls = pyvista.read(out / "survey.vtp")
    spheres = rows_of(out / "spheres.csv")
    for number in (0, 69):
        points = balls.points[balls["number"] == number]
        middle = [float(spheres[number][name]) for name in "xyz"]
        assert np.linalg.norm(points - middle, axis=1) == pytest.approx(0.5, rel=1e-5)
    done = command("report", "out")
    page = (out / "report.html").read_text()
    assert "A small bed" in page and "Kirchner" in page


@pytest.mark.slow
def test_a_bed_with_runs(command, bed: Path) -> None:
    """Thresholds of all free grains and the emulator's errors; runs of another bed in the same file are not counted."""
    pytest.importorskip("sklearn")
    bed.write_text(BED + RUNS)
    out = bed.parent / "out"
    call = ["survey", bed, "--out", out, "--jobs", 1]
    done = command(*call, timeout=1800)
    for said in ("Shields number", "first to move", "the flow not estimated"):
        assert said in done.stdout
    stored = json.loads((out / "survey.json").read_text())
    runs = stored["emulator"]["runs"]
    assert runs >= 8 and len(stored["mobile"]) > 10  # a mesh as coarse as this may fail
    rows = [row for row in rows_of(out / "grains.csv") if row["shields"]]
    assert sum(row["loads"] == "run" for row in rows) == runs
    low, shields, high, stress = (
        np.array([float(row[name]) for row in rows])
        for name in ("shields_low", "shields", "shields_high", "stress")
    )
    assert (low <= shields).all() and (shields <= high).all()
    assert (np.diff(stress) >= 0.0).all()  # those that go first are at the front
    page = incipient.report(out).read_text()
    assert f"{runs} full runs" in page and "Critical Shields numbers" in page
    other = command(*call, "--set", "bed.seed=3", "--wall", "1s", timeout=600, code=130)
    assert "0 of 10 cases are finished" in other.stderr


@pytest.mark.slow
def test_the_bead_of_another_page_by_a_full_run() -> None:
    """An equal bead on a triangular layer that touches, in creeping shear from the crests: drag 7.01.

    That is of docs/validation/beads.csv, where the layer is of half-spheres on a plane and the bead lifted by its gap.
    """
    centres = np.array(
        [(np.sqrt(0.75) * i, j + 0.5 * (i % 2), 0.0) for i in range(12) for j in range(12)]
    )
    bead = centres[6 * 12 + 6] + [1.0 / np.sqrt(3.0), 0.0, np.sqrt(2.0 / 3.0)]
    period = np.array([12.0 * np.sqrt(0.75), 12.0])
    spheres = Spheres(np.vstack([centres, bead]), np.full(145, 0.5), period)
    (pocket,) = pockets(spheres, Surface.of(spheres), np.array([144]), FlowPast())
    runs = "[runs]\norder = 3\nmeshed_bed = 1.0\ndomain = 12.0\ngap = 0.01\n"
    asked = parse(Survey, BED + runs, ".", (), "bead.toml")
    result = incipient.run(scene_of(pocket, 0.5 - float(bead[2]), asked, 1.0))
    assert result.force.flow[0] == pytest.approx(7.01, rel=0.02)


# `incipient judge` on the demo cases, and both criteria in the result of a scene.


# Statics, as the head of each file says; of several grains in tests/stability/test_pile.py.
SAFETY_FACTORS = {
    "block_on_incline": (0.5 * np.cos(np.radians(20)) - np.sin(np.radians(20))) / 0.1,
    "disc_in_pocket": 0.25 / (0.3 * 0.5 * np.cos(np.radians(30)) + 0.04),
    "sphere_on_three_spheres": 0.5 / (2 * np.sqrt(3)) / (0.2 * 0.5 * np.sqrt(2 / 3) + 0.037010),
}


@pytest.mark.parametrize("name", SAFETY_FACTORS)
def test_demo_cases(name: str, tmp_path: Path, said_by: Any) -> None:
    """Judged as statics say; `--out` alone writes next to the case."""
    case = tmp_path / f"{name}.toml"
    case.write_text((CASES / case.name).read_text())
    few = ["--set", "errors.samples=50"] if "[errors]" in case.read_text() else []
    said = said_by("judge", case, "--out", "--log-level", "error", *few)
    stored = json.loads((tmp_path / "judgement.json").read_text())
    verdict, factor = stored["verdict"], SAFETY_FACTORS[name]
    assert verdict["safety_factor"] == pytest.approx(factor, rel=1e-5) and not verdict["moves"]
    assert (tmp_path / "judgement.png").read_bytes().startswith(b"\x89PNG")
    written = {MARK, case.name, "judgement.json", "judgement.png"}
    assert {path.name for path in tmp_path.iterdir()} == written
    assert f"The grain stays at rest, safety factor {factor:.4g}: that multiple of" in said
    assert "By the paper's criteria " in said
    if few:
        chances = stored["probabilities"]
        assert sum(one["value"] for one in chances["equilibrium"].values()) == pytest.approx(1.0)
        assert (chances["samples"], chances["most"]) == (50, "flow_force x")
        assert "With the standard errors given it moves with a probability of" in said


def test_beyond_the_threshold_the_disc_pivots(said_by: Any) -> None:
    changes = ["--set", "load.flow_force=[0.6, 0.0]", "--set", "errors.samples=10"]
    said = said_by("judge", CASES / "disc_in_pocket.toml", *changes)
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


def test_a_scene_and_its_loads_as_a_case_have_one_verdict(tmp_path: Path) -> None:
    """The loads and contacts of a result, written as a case, give both criteria's answers of the scene."""
    scene = incipient.load(
        SCENES / "grain_on_bed.toml",
        ["numerics.mesh_size=3", "output.fields=false", "output.pictures=false"],
    )
    incipient.run(scene, tmp_path)
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
    modes = [one["judges"]["criteria"]["mode"] for one in (judged, verdict)]
    assert modes[0] == modes[1] and judged["moves"] == (factor < 1.0)
    # Contact forces shown balance the weight and that multiple of the flow's force.
    forces = verdict["judges"]["equilibrium"]["safety"]["contact_forces"]
    acting = weight + factor * np.array(force["flow"])
    assert np.sum(forces, axis=0) == pytest.approx(-acting, abs=1e-8)
