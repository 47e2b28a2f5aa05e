"""`incipient entrainment`: what it writes and says, on two ranks as on one, and what it refuses."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from test_released import POCKET

import incipient
import incipient.sweep
from incipient.pictures.charts import searches
from incipient.scene import loads
from incipient.sweep.table import rows

# A disc that settles between half-discs, on large cells, with pictures.
SCENE = (
    POCKET.format(gravity=10.0)
    .replace("x = 3.5\ndensity = 1.5", "x = 3.5\nsettle = true\ndensity = 2.65")
    .replace("error_bars = false", "mesh_size = 3.0")
    .replace("fields = false", "pictures = true")
)
LOGNORMAL = SCENE + "[gusts]\nintensity = 0.3\nmicroscale = 1.0\nintegral_time = 4.0\n"
# Weakest gusts like those of a disc in its pocket; a steady flow of 2.4 moves this one.
GUSTS = {
    "static": 2.4,
    "points": [
        {"duration": 0.5, "strength": 6.87, "error": 0.2},
        {"duration": 4.0, "strength": 2.58, "error": 0.1},
    ],
}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "scene.toml").write_text(LOGNORMAL)
    (tmp_path / "gusts").mkdir()
    (tmp_path / "gusts" / "gusts.json").write_text(json.dumps(GUSTS))
    (tmp_path / "flume.csv").write_text("shields,probability\n0.003,0.01\n0.005,0.1\n")
    (tmp_path / "percent.csv").write_text("shields,percent\n0.003,50\n")
    return tmp_path / "scene.toml"


@pytest.mark.slow
def test_what_is_found_is_said_written_drawn_and_reported(command, scene: Path) -> None:
    options = ("--gusts", "gusts", "--data", "flume.csv", "--strengths", "0.5", "1", "2")
    done = command("entrainment", scene, "--out", "out", *options)
    assert done.returncode == 0, done.stderr
    for said in (
        "steady flow         moves the grain",
        "of them long enough",
        "Rice 1945",
        "added mass",
    ):
        assert said in done.stdout
    out = scene.parent / "out"
    stored = json.loads((out / "entrainment.json").read_text())
    assert [one["probability"] for one in stored["quantiles"]] == [0.001, 0.01, 0.05, 0.5]
    assert stored["data"] == [[0.003, 0.01], [0.005, 0.1]]
    with (out / "entrainment.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["strength"]) for row in rows] == [0.5, 1.0, 2.0]
    # Gusts that last long enough are fewer than those that are strong enough for an instant.
    last = rows[-1]
    assert 0.0 < float(last["lasting"]) < float(last["rate"])
    assert float(last["lasting_low"]) <= float(last["lasting"]) <= float(last["lasting_high"])
    with Image.open(out / "entrainment.png") as image:
        assert image.format == "PNG"
    (axes,) = searches.entrainment(stored, out).axes
    drawn = axes.lines[0].get_xydata()
    assert drawn == pytest.approx(
        np.array([[p["shields"], p["probability"]] for p in stored["curve"]])
    )
    assert any(line.get_xydata().tolist() == stored["data"] for line in axes.lines)
    page = incipient.report(out).read_text()
    assert "probability at an instant" in page and "moves the grain from Shields number" in page


@pytest.mark.slow
def test_two_ranks_find_the_same(command, scene: Path) -> None:
    numbers = []
    for ranks in (1, 2):
        out = scene.parent / f"ranks_{ranks}"
        options = ("--set", "output.pictures=false", "--set", "numerics.error_bars=false")
        done = command("entrainment", scene, "--out", out, *options, ranks=ranks)
        assert done.returncode == 0, done.stderr
        stored = json.loads((out / "entrainment.json").read_text())
        numbers.append([one["shields"] for one in stored["quantiles"]])
        assert all(one["error"] is None for one in stored["quantiles"])
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--set", "gusts.intensity=-1"), "gusts.intensity"),
        (("--probabilities", "2"), "probabilities: give one or more, each between 0 and 1"),
        (("--strengths", "0"), "strengths: give numbers from 1e-06 to 1e+06"),
        (
            ("--data", "percent.csv"),
            "percent.csv has the Shields number 0.003 with the probability 50",
        ),
        (
            ("--gusts", "nowhere"),
            "--gusts: nowhere/gusts.json cannot be read (No such file or directory); give the directory",
        ),
        (("--data", "nowhere.csv"), "nowhere.csv cannot be read"),
        (("--set", 'gusts.intensity="model"'), 'gusts.intensity: "model" needs a turbulence model'),
        (("--set", "flow.kind=still"), "flow"),
    ],
)
def test_bad_input_is_one_line(command, scene: Path, options: tuple[str, ...], said: str) -> None:
    done = command("entrainment", scene, "--out", "out", *options)
    assert done.returncode not in (0, 70)
    assert said in done.stderr and len(done.stderr.strip().splitlines()) == 1


@pytest.mark.slow
def test_a_sweep_of_intensities(tmp_path: Path) -> None:
    coarse = loads(SCENE + "[gusts]\nintensity = 0.3\n")
    path = tmp_path / "sweep.sqlite"
    incipient.sweep.run(coarse, path, {"gusts.intensity": [0.1, 0.3]}, do="entrainment", jobs=1)
    weak, strong = rows(path)
    assert (weak["gusts.intensity"], strong["gusts.intensity"]) == (0.1, 0.3)
    assert weak["shields"] == pytest.approx(strong["shields"], rel=1e-9)
    assert weak["probability"] < strong["probability"] and "rate" not in weak
    # Levels of lognormal factors, exp(z s - s^2/2): 1.2549 at intensity 0.1 and 1.8962 at 0.3, exceeded with 1%.
    ratio = weak["shields_at_0.01"] / strong["shields_at_0.01"]
    assert ratio == pytest.approx(1.8962 / 1.2549, rel=1e-3)
    assert weak["shields_at_0.01_low"] < weak["shields_at_0.01"] < weak["shields_at_0.01_high"]


@pytest.mark.slow
def test_a_measured_series(command, scene: Path) -> None:
    times = [0.25 * k for k in range(4000)]
    rows = (f"{t},{2.0 + 0.5 * math.sin(t) + 0.3 * math.sin(math.sqrt(2.0) * t)}" for t in times)
    (scene.parent / "velocity.csv").write_text("\n".join(("time,velocity", *rows)))
    measured = SCENE + '[gusts]\nlaw = "measured"\nfile = "velocity.csv"\n'
    scene.write_text(measured.replace("pictures = true", "pictures = false"))
    done = command("entrainment", scene, "--out", "out", "--probabilities", "0.05", "0.5")
    assert done.returncode == 0, done.stderr
    assert "follows the series" in done.stdout and "length of the record" in done.stdout


@pytest.mark.slow
def test_gusts_that_were_counted(command, scene: Path) -> None:
    """A hundred gusts of strengths 1.02 to 3 for half a unit of time each, in 500: their shares at the threshold."""
    rows = (f"{1.0 + 0.02 * k},0.5" for k in range(1, 101))
    (scene.parent / "gusts.csv").write_text("\n".join(("strength,duration", *rows)))
    counted = SCENE + '[gusts]\nlaw = "events"\nrecord = 500.0\nfile = "gusts.csv"\n'
    scene.write_text(counted.replace("pictures = true", "pictures = false"))
    done = command("entrainment", scene, "--out", "out", "--probabilities", "0.01", "0.05")
    assert done.returncode == 0, done.stderr
    assert "those counted" in done.stdout and "length of the record" in done.stdout
    stored = json.loads((scene.parent / "out" / "entrainment.json").read_text())
    critical = stored["threshold"]["factor"]
    above = sum(1.0 + 0.02 * k > critical for k in range(1, 101))
    assert stored["scene"]["probability"] == pytest.approx(above * 0.5 / 500.0)
    assert stored["scene"]["rate"] == pytest.approx(above / 500.0)
    # Ten gusts are above 2.8, a hundredth of the time.
    assert stored["quantiles"][0]["strength"] == pytest.approx(critical / 2.82, rel=1e-6)
