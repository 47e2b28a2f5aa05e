"""What stands on a page of results: cells, vectors, numbers in SI units; what is escaped and refused."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jinja2 import Environment
from PIL import Image

import incipient
from incipient.effects.moving_grain import PATH, FreeBodyEffect
from incipient.effects.turbulence import findings
from incipient.errors import OutputError
from incipient.pictures.apart import draw_apart
from incipient.pictures.record import parsed_json, scene_of
from incipient.reporting import part
from incipient.reporting.page import (
    TEMPLATES,
    Bounded,
    Erring,
    cell,
    compact,
    embedded,
    environment,
    look,
)
from incipient.reporting.results import _budget, _in_si, _rows
from incipient.results.kinds import KINDS
from incipient.results.quantity import put, screen_lines
from incipient.results.si import in_si

SCENE = Path(__file__).parents[2] / "demos/scenes/grain_on_bed.toml"
GUSTS = {
    "title": "<b>&</b>",
    "static": 2.5,
    "points": [
        {"duration": 1.0, "strength": 3.0, "error": 0.5, "held": 2.9, "leaves": 3.1}
        | {"impulse": 2.0, "runs": 7}
    ],
}


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (1.23456789, '<data value="1.23456789">1.23457</data>'),
        (-0.0, '<data value="-0.0">0</data>'),
        (math.inf, '<data value="inf">∞</data>'),
        (None, "–"),
        (True, "yes"),
        (7, '<data value="7">7</data>'),
        ("<b>", "&lt;b&gt;"),
        (
            Erring(2.0, 0.125),
            '<data value="2.0">2</data> <small>± <data value="0.125">1.2e−01</data></small>',
        ),
        (
            Bounded(1.5, 1.0, math.inf),
            '<data value="1.5">1.5</data> <small>(<data value="1.0">1</data> to <data value="inf">∞</data>)</small>',
        ),
        # A component lost in round-off is shown as zero, and kept in full for programs.
        ((1e-17, -1.0), '(<data value="1e-17">0</data>, <data value="-1.0">−1</data>)'),
    ],
)
def test_a_cell_has_its_number_in_full(value: Any, shown: str) -> None:
    assert cell(value) == shown
    if isinstance(value, float):
        assert cell(np.float64(value)) == shown


def test_long_texts_have_wide_columns() -> None:
    assert [look(value) for value in ("short", "x" * 40, 1.0, True)] == ["", "long", "number", ""]


def test_errors_of_loads_are_vectors_and_of_others_the_largest() -> None:
    """Of two terms the second is unknown in one component; fractions are of the norm of the force, 1."""
    one = {"name": "gap", "how": "x", "force": [0.3, 0.4, None], "torque": [0.0, 0.0, None]}
    one |= {"level": [0.1, 0.2], "parts": []}
    other = one | {"name": "domain", "torque": None}
    bars = {"terms": [one, other], "force": [0.6, 0.8, 0.0], "torque": [0.0, 0.0, 1.0]}
    heads, rows = _budget(True, bars | {"level": [0.2, 0.4]})
    assert heads[1:4] == ["of the force", "of the torque", "of elevations at the end"]
    assert rows[0][1] == (0.3, 0.4) and math.isnan(rows[0][2]) and rows[0][3:5] == [0.2, "50 %"]
    assert rows[1][2] == "" and [row[0] for row in rows] == ["gap", "domain", "all"]
    # The page has a column for whatever a term has errors of: the end of a path, the x of separation.
    moving = {"name": "time step", "how": "x", "force": None, "torque": None, "parts": []}
    moving |= {"place": [0.25, 0.5, 0.125], "separated": [2.0, 1.0]}
    bars = {"terms": [moving], "place": moving["place"], "separated": moving["separated"]}
    heads, (row,) = _budget(True, bars)
    assert heads[1:3] == ["of the end of the path, at most", "of x of separation, at most"]
    assert row[1:4] == [0.5, 2.0, "100 %"]


def test_short_lists_of_settings_stand_on_a_line() -> None:
    made = compact("x = [\n    1.0,\n    2.0,\n]\ny = [\n    [\n        1,\n    ],\n]\n")
    assert made == "x = [1.0, 2.0]\ny = [\n    [1],\n]\n"


def test_every_record_has_a_template_that_can_be_read() -> None:
    names = {f"{kind.name}.html" for kind in KINDS} | {"sweep.html", "page.html"}
    for path in TEMPLATES.glob("*.html"):
        Environment().parse(path.read_text(encoding="utf-8"))
        names.discard(path.name)
        assert not re.search(r"\bsafe\b", path.read_text()), "nothing is exempt from escaping"
    assert not names


def test_titles_paths_and_texts_are_escaped(tmp_path: Path) -> None:
    """In a directory and a scene with names that are HTML, and a picture that cannot be drawn."""
    directory = tmp_path / "<i>out<"
    directory.mkdir()
    (directory / "gusts.json").write_text(json.dumps(GUSTS))
    (directory / "scene.toml").write_text('title = "<b>&</b>"')
    page = incipient.report(directory).read_text()
    assert "<title>&lt;b&gt;&amp;&lt;/b&gt;</title>" in page
    assert "<b>" not in page and "<i>" not in page
    text, _ = part(directory / "gusts.json", f"missing: {directory}")
    assert "&lt;i&gt;out&lt;" in text and "<i>" not in text


def test_what_a_record_lacks_is_named(tmp_path: Path) -> None:
    record = tmp_path / "gusts.json"
    for name in ("static", "points"):
        record.write_text(json.dumps({key: value for key, value in GUSTS.items() if key != name}))
        with pytest.raises(OutputError, match=rf"gusts\.json: holds no {name}; compute it again"):
            part(record)


def test_numbers_in_si_units() -> None:
    """A grain of 1 mm in water in shear G = 5 1/s: the stress on the bed is rho nu G, its velocity sqrt(nu G)."""
    scene = incipient.load(
        SCENE,
        [
            "units={diameter=1e-3, shear_rate=5.0}",
            "fluid={scale='grain'}",
            "gravity={}",
            "body.density=2.65",
        ],
    )
    shown = environment(in_si=_in_si).get_template("numbers.html").module
    page = shown.si(in_si(scene))
    row = r'row">([^<]*)</th><td class="number"><data value="([^"]*)">[^<]*</data></td><td class="">([^<]*)<'
    told = {name: (float(value), unit) for name, value, unit in re.findall(row, page)}
    assert told["nominal diameter"] == (pytest.approx(1e-3), "m")
    assert told["stress on the bed"] == (pytest.approx(5e-3), "Pa")
    assert told["shear velocity"] == (pytest.approx(5e-6**0.5), "m/s")
    assert told["one unit of time of the scene"] == (pytest.approx(0.2), "s")
    assert not shown.si(None).strip()


def test_walls_are_reported_with_reverse_flow_and_what_has_not_converged() -> None:
    stored = {"least": 3.0, "largest": 71.25, "backward": [[1.0, 2.0]]}
    assert findings({}) is None
    for converged, words in ((True, "3 to 71.2."), (False, "loads are means, within 1.2%.")):
        told = stored | {"converged": converged, "spread": 0.012}
        found = findings({"turbulence": told})
        assert found is not None and found[0].endswith(words)
    assert [value for _, value in found[1]] == [(1.0, 2.0)]


def test_a_wide_picture_is_made_smaller(tmp_path: Path) -> None:
    Image.new("RGB", (2000, 10)).save(tmp_path / "flow.png")
    assert embedded(tmp_path / "flow.png").startswith("data:image/webp;base64,")


@pytest.mark.parametrize("content", [b"no picture", b"\x89PNG\r\n\x1a\n\0\0", b""])
def test_what_is_no_picture_is_named(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "flow.png").write_bytes(content)
    with pytest.raises(OutputError, match=r"flow\.png: cannot be read as a picture; remove it"):
        embedded(tmp_path / "flow.png")


def test_a_page_does_not_replace_a_result(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("{}")
    with pytest.raises(
        OutputError, match=r"result\.json: is not a valid name for this file; .* \.html"
    ):
        incipient.report(tmp_path, tmp_path / "result.json")
    (tmp_path / "mine.html").write_text("mine")
    with pytest.raises(OutputError, match=r"mine\.html: was not written by incipient"):
        incipient.report(tmp_path, tmp_path / "mine.html")
    assert (tmp_path / "mine.html").read_text() == "mine"


def test_a_directory_of_poses_is_shown_and_reported(tmp_path: Path) -> None:
    """Two thresholds of four poses, one of which has no rest; one run has failed."""
    stored = {"shields": [0.02, 0.05], "modes": {"rolling": 2}, "poses": 4, "refused": 1}
    record = json.dumps(stored | {"reason": "rolls away", "failed": 1})
    (tmp_path / "poses.json").write_text(record)
    page = incipient.report(tmp_path).read_text()
    assert (tmp_path / "poses.png").is_file() and "4 poses: 2 thresholds, failed runs: 1." in page
    assert "Poses without a rest: 1, the first: rolls away." in page
    assert '<th scope="row">median</th><td class="number"><data value="0.02">' in page


def test_results_of_an_earlier_version_are_read_or_refused_with_what_to_do(tmp_path: Path) -> None:
    """The torque was called couple; a scene may have a key that is retired."""
    (tmp_path / "result.json").write_text('{"couple": {"flow": [1]}, "terms": [{"couple": 2}]}')
    stored = parsed_json(tmp_path / "result.json")
    assert stored == {"torque": {"flow": [1]}, "terms": [{"torque": 2}]}
    text = SCENE.read_text().replace("[numerics]", "[numerics]\nform = 'advective'")
    (tmp_path / "scene.toml").write_text(text)
    with pytest.raises(
        OutputError, match=r"results of another version.*numerics\.form: .*leave it o"
    ):
        scene_of(tmp_path)
    (tmp_path / "threshold.json").write_text("{}")
    complaint = draw_apart(tmp_path).complaint
    assert complaint.endswith("show them with that version, or run the scene again, changed so")


def test_quantities_of_a_moving_grain_stand_on_screen_page_and_in_tables() -> None:
    """A disc that left its pocket: each number by its one description; coordinates with two decimals at least."""
    course = {"mode": "rolling", "first_motion": 0.5, "left_pocket": None, "force": [1.0, 2.0]}
    works = {"flow": 3.0, "gravity": -2.0, "friction": -0.25, "impact": 0.0}
    path: dict[str, Any] = {
        "ended": {"by": "out-of-pocket", "time": 2.35, "without_verdict": ""},
        "place": [350004.767, 0.5],
        "angle": -1.5,
        "velocity": [0.25, -0.125],
        "spin": -0.75,
        "interface_iterations": {"mean": 2.5, "most": 4},
        "remeshings": [{}, {}],
        "on_bed": course | {"works": works},
    }
    stored = {"scene": {"domain": {}}, "trajectory": path}
    for quantity in FreeBodyEffect.quantities:
        if quantity.derive is not None:
            put(stored, quantity.key, quantity.derive(stored))
    text = "\n".join(screen_lines(FreeBodyEffect.quantities, stored, details=True))
    for line in (
        "path                ended by out-of-pocket   at t = 2.35",
        "position            (350004.77, 0.5)   turned by [rad] -1.5",
        "velocity            (0.25, -0.125)   spin -0.75",
        "on its bed          mode at the end rolling   force of contact (1, 2)",
        "works               flow 3   gravity -2   friction -0.25   impact 0",
        "interface           iterations a step 2.5   at most 4   new meshes 2",
    ):
        assert line in text
    assert "interface" not in "\n".join(screen_lines(FreeBodyEffect.quantities, stored))
    columns = {k: v for q in FreeBodyEffect.quantities for k, v in q.columns(stored).items()}
    assert columns == {
        "ended": "out-of-pocket",
        "velocity_x": 0.25,
        "velocity_y": -0.125,
        "spin": -0.75,
        "does": "rolling",
        "first_motion": 0.5,
    }
    rows = dict(_rows(stored, FreeBodyEffect.quantities, PATH))
    assert rows["position [length]"] == path["place"] and rows["work of gravity [energy]"] == -2.0
    assert "left its pocket [time]" not in rows and rows["new meshes"] == 2
