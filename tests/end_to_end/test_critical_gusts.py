"""The weakest gusts that move a grain out of its pocket: searched, written, drawn, reported."""

from __future__ import annotations

import csv
import json
from functools import cache
from pathlib import Path

import pytest
from PIL import Image
from test_released import POCKET

import incipient
from incipient.errors import SceneError
from incipient.output.searches import GustCurve
from incipient.parallel import world
from incipient.pictures.charts import searches
from incipient.pictures.directory_pictures import draw
from incipient.scene import Scene, loads
from incipient.sweep.table import rows
from incipient.thresholds.gusts import WITHIN, CriticalGust, GustSearch


def scene(**changes: dict[str, object]) -> Scene:
    """A released disc in a pocket of half-discs; sections with other keys."""
    plain = loads(POCKET.format(gravity=10.0)).model_dump(exclude_unset=True)
    plain["body"]["motion"] = "released"
    plain["time"] = {"end": 1.0, "step": 0.1, "start": "steady"}
    for section, keys in changes.items():
        plain[section] = {**plain.get(section, {}), **keys}
    return Scene(**plain)


def test_gusts_rise_in_the_share_of_their_duration_that_the_scene_has() -> None:
    """A rise of 0.9 in a gust of 2 is one of 0.45 in a gust of 1."""
    gust = {"duration": 2.0, "rise": 0.9}
    found = GustSearch(scene(flow={"gust": gust}), world())._in_gust(3.0, 1.0)
    assert found.flow.gust.rise == pytest.approx(0.45)
    assert (found.flow.gust.duration, found.flow.gust.strength) == (1.0, 3.0)


def test_gusts_of_a_turbulent_flow_are_refused_at_once() -> None:
    plain = scene().model_dump(exclude_unset=True)
    turbulent = Scene(
        **{**plain, "effects": {"turbulence": True}, "flow": {"kind": "open-channel"}}
    )
    with pytest.raises(
        SceneError, match=r"effects\.turbulence: gusts are computed in laminar flow only"
    ):
        GustSearch(turbulent, world())


class Sharp(GustSearch):
    """A search whose grain leaves from a known impulse on."""

    def leaves(self, strength: float, duration: float) -> bool:
        self.runs += 1
        return (strength - 1.0) * duration >= 3.0


def test_the_search_brackets_what_it_is_after() -> None:
    """The weakest gust has (strength - 1) duration = 3."""
    search = Sharp(scene(), world())
    found = search.critical([0.5, 4.0])
    assert [one.duration for one in found] == [4.0, 0.5]
    for one in found:
        exact = 1.0 + 3.0 / one.duration
        assert one.held < exact <= one.leaves <= (1.0 + WITHIN) * one.held
        assert one.to_dict()["impulse"] == pytest.approx(3.0, rel=2 * WITHIN)
    assert sum(one.runs for one in found) == search.runs - 1


REFUSED = (
    (
        {"body": {"motion": "fixed"}, "time": {}},
        "body.motion: gusts are computed for a grain that rests",
    ),
    ({"bed": {"kind": "flat"}}, "bed.kind: a flat bed has no pocket"),
    (
        {"flow": {"gust": {"shape": "points", "points": [[0, 1], [1, 2]]}}},
        'flow.gust.shape: "points" has no duration',
    ),
)


@pytest.mark.parametrize(("changes", "says"), REFUSED)
def test_scenes_without_a_pocket_or_gusts_are_refused(
    changes: dict[str, dict[str, object]], says: str
) -> None:
    plain = scene().model_dump(exclude_unset=True)
    for section, keys in changes.items():
        plain[section] = keys if section == "bed" else {**plain[section], **keys}
    with pytest.raises(SceneError) as refused:
        GustSearch(Scene(**plain), world())
    assert says in str(refused.value)


def test_what_is_found_is_drawn_and_reported(tmp_path: Path) -> None:
    points = (
        CriticalGust(4.0, "top-hat", 2.5, 2.55, 0.05, 8),
        CriticalGust(1.0, "top-hat", 4.8, 4.9, None, 7),
    )
    curve = GustCurve(scene(), 1.6, points)
    (tmp_path / "gusts.json").write_text(json.dumps(curve.to_dict()))
    (axes,) = searches.gusts(curve.to_dict(), tmp_path).axes
    durations, strengths = axes.lines[0].get_data()
    assert durations.tolist() == [1.0, 4.0]
    assert strengths == pytest.approx([(4.8 * 4.9) ** 0.5, (2.5 * 2.55) ** 0.5])
    assert any(list(line.get_ydata()) == [1.6, 1.6] for line in axes.lines)
    with Image.open(draw(tmp_path)[0]) as image:
        assert image.format == "PNG"
    page = incipient.report(tmp_path).read_text()
    assert "1.6 times its strength" in page and "leaves at" in page
    assert "gust of 1          strength 4.85 +- not known in 7 runs" in curve.text()


@pytest.mark.slow
def test_a_disc_in_a_pocket_needs_a_stronger_gust_if_it_is_shorter(tmp_path: Path) -> None:
    """Above the steady threshold of the same scene; on default cells 4.87 and 2.59."""
    coarse = scene(numerics={"mesh_size": 1.5}, body={"density": 2.0})
    curve = incipient.gusts(coarse, [1.0, 4.0], tmp_path)
    long, short = (one.strength for one in curve.points)
    assert curve.static < long < short
    assert (long, short) == pytest.approx((2.59, 4.87), rel=0.05)
    with (tmp_path / "gusts.csv").open() as file:
        assert [float(row["duration"]) for row in csv.DictReader(file)] == [4.0, 1.0]


@cache
def threshold() -> float:
    """How many times faster a steady flow begins to move the disc of density 2, by `incipient threshold`."""
    return GustSearch(scene(body={"density": 2.0}), world()).static_strength()


@pytest.mark.slow
@pytest.mark.parametrize(("share", "leaves"), [(0.98, False), (1.02, True)])
def test_a_gust_without_end_moves_the_grain_from_its_threshold_on(
    share: float, leaves: bool
) -> None:
    """The strength is a share of the critical flow of the same grain held in a steady flow, 1.601 when written.

    Once it moves, the disc leaves: beside the bed the flow has more of a hold on it. In the plane the film that opens
    below it takes a time of 60, close to the threshold.
    """
    wide = scene(
        body={"density": 2.0},
        flow={"gust": {"duration": 400.0, "rise": 1.0, "strength": share * threshold()}},
        time={"end": 100.0, "step": 0.5, "until": "out-of-pocket"},
    )
    result = incipient.run(wide)
    assert result.trajectory is not None
    assert (result.trajectory["ended"]["by"] == "out-of-pocket") == leaves
    assert (result.trajectory["on_bed"]["mode"] == "rest") != leaves


def in_sweep(tmp_path: Path, do: str, over: dict[str, object]) -> list[dict[str, object]]:
    """Rows of a sweep of gusts on a coarse mesh."""
    gusty = scene(
        body={"density": 2.0},
        flow={"gust": {"start": 0.1, "duration": 2.0}},
        time={"end": 4.0, "step": 0.2, "until": "out-of-pocket"},
        numerics={"error_bars": False, "mesh_size": 3.0},
        output={"fields": False},
    )
    incipient.sweep.run(gusty, tmp_path / "sweep.sqlite", over, do=do, jobs=1)
    return rows(tmp_path / "sweep.sqlite")


@pytest.mark.slow
def test_a_sweep_varies_gusts_and_says_which_moved_the_grain_out(tmp_path: Path) -> None:
    """Columns of strength and duration, of when the grain moved and left, and of what ended the runs."""
    weak, strong = in_sweep(
        tmp_path, "run", {"flow.gust.strength": [1.2, 6.0], "flow.gust.duration": [2.0]}
    )
    assert (weak["flow.gust.strength"], strong["flow.gust.strength"]) == (1.2, 6.0)
    assert weak["flow.gust.duration"] == 2.0
    assert weak["ended"] == "in-pocket" and weak["does"] == "rest" and "left_pocket" not in weak
    assert strong["ended"] == "out-of-pocket" and strong["first_motion"] == 0.0  # in the first step
    assert 0.1 < strong["left_pocket"] < 4.0


@pytest.mark.slow
def test_a_sweep_searches_critical_gusts(tmp_path: Path) -> None:
    """A denser grain needs the stronger gust; each strength is bracketed to 2%."""
    light, dense = in_sweep(tmp_path, "gust", {"body.density": [2.0, 2.4]})
    for row in (light, dense):
        assert row["held"] < row["strength"] < row["leaves"] <= (1.0 + WITHIN) * row["held"]
    assert light["strength"] < dense["strength"]
