"""What stands on a page of results: cells, vectors, numbers in SI units."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import incipient
from incipient.effects.turbulence import TurbulenceEffect
from incipient.errors import OutputError
from incipient.evaluation.si_units import in_si
from incipient.reporting.page import (
    Bounded,
    Cell,
    Erring,
    PageTable,
    Picture,
    Settings,
    cell,
    look,
)
from incipient.reporting.units import of_si

SCENE = Path(__file__).parents[2] / "demos/scenes/grain_on_bed.toml"


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
def test_a_cell_has_its_number_in_full(value: Cell, shown: str) -> None:
    assert cell(value) == shown


def test_long_texts_have_wide_columns() -> None:
    assert [look(value) for value in ("short", "x" * 40, 1.0, True)] == ["", "long", "number", ""]


def test_short_lists_of_settings_stand_on_a_line() -> None:
    made = Settings("x = [\n    1.0,\n    2.0,\n]\ny = [\n    [\n        1,\n    ],\n]\n").compact
    assert made == "x = [1.0, 2.0]\ny = [\n    [1],\n]\n"


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
    (made,) = of_si(in_si(scene))
    (block,) = made.blocks
    assert isinstance(block, PageTable)
    told = {row[0]: row[1:] for row in block.rows}
    assert told["nominal diameter"] == (pytest.approx(1e-3), "m")
    assert told["stress on the bed"] == (pytest.approx(5e-3), "Pa")
    assert told["shear velocity"] == (pytest.approx(5e-6**0.5), "m/s")
    assert told["one unit of time of the scene"] == (pytest.approx(0.2), "s")
    assert of_si(None) == ()


def test_walls_where_their_law_does_not_hold_are_reported_with_the_remedy() -> None:
    stored = {
        "applicable": False,
        "suitable_distance": 0.1,
        "plane": False,
        "outside": 0.25,
        "backward": [[1.0, 2.0]],
    }
    assert TurbulenceEffect().findings({}) is None
    found = TurbulenceEffect().findings({"turbulence": stored})
    assert found is not None
    assert found.sentence.endswith("does NOT hold; give turbulence.wall_distance = 0.1.")
    assert [value for _, value in found.rows] == [0.25, (1.0, 2.0)]


@pytest.mark.parametrize("content", [b"no picture", b"\x89PNG\r\n\x1a\n\0\0", b""])
def test_what_is_no_picture_is_named(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "flow.png").write_bytes(content)
    with pytest.raises(OutputError, match=r"flow\.png: cannot be read as a picture; remove it"):
        assert Picture(tmp_path / "flow.png", "The flow").uri


def test_a_page_does_not_replace_a_result(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("{}")
    with pytest.raises(OutputError, match=r"result\.json: is no name for this file; .* \.html"):
        incipient.report(tmp_path, tmp_path / "result.json")
    (tmp_path / "mine.html").write_text("mine")
    with pytest.raises(OutputError, match=r"mine\.html: was not written by incipient"):
        incipient.report(tmp_path, tmp_path / "mine.html")
    assert (tmp_path / "mine.html").read_text() == "mine"
