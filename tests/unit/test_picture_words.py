"""Words on pictures: nothing over anything else, nothing cut."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from incipient.geometry.space.beds import Plane
from incipient.geometry.space.grains import Sphere
from incipient.pictures import style
from incipient.pictures.drawing import Sight, render
from incipient.pictures.sheet import load_rows, sheet, write_numbers

LONG = "A scanned pebble on a random bed of spheres, with bed.slope=3.0, with contact.friction=0.35, with bed.seed=4"


def boxes(figure: Figure) -> list:
    """Where each text of a figure stands, in pixels."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    axes_titles = [title for axes in figure.axes for title in (axes.title, axes._left_title)]
    written = [text for text in (*figure.texts, *axes_titles) if text.get_text()]
    return [(text.get_text(), text.get_window_extent(renderer)) for text in written]


def test_names_and_numbers_of_a_case_in_space_do_not_overlap() -> None:
    """Numbers as of a light grain: each component takes eight letters."""
    with style.applied():
        figure, axes = sheet("The grain stays at rest.", "So does the paper's.", LONG)
        small = np.array([-1.234e-5, 2.345e-5, -3.456e-5])
        write_numbers(
            axes,
            [load_rows({"flow": small, "weight": small}, small, "[scene units]", planar=False)],
        )
        found = boxes(figure)
    column = [(words, box) for words, box in found if box.x0 > axes.bbox.x1]
    assert len(column) == 8
    for number, (words, box) in enumerate(column):
        for other, (more, another) in enumerate(column):
            assert number == other or not box.overlaps(another), f"{words} over {more}"
    assert all(box.x1 <= figure.bbox.x1 for _, box in found)


@pytest.mark.parametrize("view", [(0.0, 4.0, 0.0, 2.0), (0.0, 1.0, 0.0, 1.0)])
def test_titles_are_wrapped_not_cut(view: style.View) -> None:
    with style.applied():
        figure, (axes,) = style.panels([view], LONG)
        figure.draw_without_rendering()
        ((title, box), *_) = boxes(figure)
    assert title.replace("\n", " ") == LONG and "\n" in title
    assert (
        box.x0 >= 0.0
        and box.x1 <= figure.bbox.x1
        and box.y1 <= figure.bbox.y1
        and box.y0 > axes.bbox.y1
    )


def test_the_subject_of_a_verdict_is_not_cut() -> None:
    with style.applied():
        figure, axes = sheet("The grain stays at rest.", "", LONG)
        words = axes.get_title(loc="left")
        (_, told), *_, (_, box) = boxes(figure)
    assert words.replace("\n", " ") == LONG and box.y1 < told.y0


def test_the_bed_of_a_grain_in_space_is_drawn() -> None:
    """Of a plane a disc of radius 1 is drawn: pi sin(17 degrees)/7.5 = 0.12 of it, a fifth behind the grain."""
    surface = Sphere(1.0).surface(0.1)
    points = surface.points + np.array([0.0, 0.0, 0.5])
    sight = Sight.of(np.array([0.2, 0.0, 0.0]), np.array([0.0, 0.0, -1.0]), np.empty((0, 3)))
    shown = {}
    for bed in (None, Plane((0.0, 0.0), 0.0)):
        axes = Figure().add_subplot(xlim=(-1.5, 1.5), ylim=(-1.0, 1.5))
        render(axes, sight, points, surface.triangles, bed)
        image = axes.images[0].get_array()
        shown[bed is None] = float((image.min(axis=2) < 250).mean())
    assert 0.08 < shown[False] - shown[True] < 0.12


def test_marks_stand_where_the_rendering_has_what_they_mark() -> None:
    """A small sphere's image is about the place that the sight gives its centre, to a hundredth of the picture."""
    centre, surface = np.array([0.3, -0.2, 0.7]), Sphere(0.2).surface(0.02)
    sight = Sight.of(np.array([0.5, 0.1, 0.0]), np.array([0.1, 0.0, -1.0]), np.empty((0, 3)))
    axes = Figure().add_subplot(xlim=(-1.0, 2.0), ylim=(-0.5, 1.5))
    render(axes, sight, surface.points + centre, surface.triangles, None)
    dark = np.argwhere(np.asarray(axes.images[0].get_array()).min(axis=2) < 250)
    rows, columns = axes.images[0].get_array().shape[:2]
    down, across = (dark.min(axis=0) + dark.max(axis=0) + 1) / 2
    place = -1.0 + 3.0 * across / columns, 1.5 - 2.0 * down / rows
    assert sight(centre) == pytest.approx(place, abs=0.02)


@pytest.mark.parametrize("title", [r"$\frac{$", "costs $5 and $6", "one $ alone", "a_1^2"])
def test_a_title_is_shown_as_it_is_written(tmp_path: Path, title: str) -> None:
    """Two $ make a formula for matplotlib, which fails or is set in italics; only powers of ten shall be one."""
    with style.applied():
        figure = Figure()
        figure.suptitle(title)
        axes = figure.add_subplot(title=title, xscale="log", xlabel=title)
        axes.plot([1, 2], ["$a$", "b"], label=title)
        axes.legend()
        style.save(figure, tmp_path / "x.png")
    texts = [text for text in figure.findobj(Text) if text.get_text() in (title, "$a$")]
    assert len(texts) >= 4 and not any(text.get_parse_math() for text in texts)
    axes.set_xlim(1.0, 1e3)
    powers = [label for label in axes.get_xticklabels() if "10^" in label.get_text()]
    assert powers and all(label.get_parse_math() for label in powers)
