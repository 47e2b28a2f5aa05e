"""Pictures and animations of made-up runs in which a grain moves (see moving_run.py)."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from images import assert_is_a_picture
from matplotlib.collections import LineCollection
from matplotlib.patches import Polygon
from matplotlib.text import Text
from moving_run import PERIOD, SCENE, course, write_history, write_texts
from PIL import Image

from incipient.cli import main
from incipient.errors import OutputError
from incipient.files import MARK
from incipient.output.series_file import SeriesFile
from incipient.pictures import film as films
from incipient.pictures import style, trajectory
from incipient.pictures.apart import animate_apart, draw_apart
from incipient.pictures.history import read_history
from incipient.scene import loads

STEPS = 10


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The directory of a run with a series of fields."""
    directory = tmp_path_factory.mktemp("moving")
    environment = os.environ | {
        "PYTHONPATH": str(Path(__file__).parents[1]),
        "OMP_NUM_THREADS": "1",
    }
    command = [
        sys.executable,
        str(Path(__file__).with_name("moving_run.py")),
        str(directory),
        str(STEPS),
    ]
    process = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert process.returncode == 0, process.stderr
    return directory


@pytest.fixture
def texts(tmp_path):
    """A directory with scene, result and history only."""
    write_texts(tmp_path)
    write_history(tmp_path / "history.csv", np.linspace(0.0, PERIOD, 51)[1:], remeshed=[1.02, 3.0])
    return tmp_path


def drawn(scene_text, history):
    scene = loads(scene_text)
    with style.applied():
        return trajectory.figure(scene, history.started(scene.placement), scene.title)


def quantities(figure):
    """The axes of position and rates in their order."""
    return [axes for k in "012345" for axes in figure.axes if axes.get_label() == k]


# -- pictures ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_all_pictures_of_a_grain_that_moves(run):
    written = draw_apart(run).paths
    names = ["trajectory", "flow", "pressure", "vorticity", "traction", "mesh"]
    assert [path.stem for path in written] == names
    for path in written:
        assert_is_a_picture(path)


def test_path_outlines_and_quantities(texts):
    history = read_history(texts / "history.csv")
    figure = drawn(SCENE, history)
    axes, panels = figure.axes[0], quantities(figure)
    (path,) = [c for c in axes.collections if isinstance(c, LineCollection)]
    assert np.allclose(path.get_segments()[0][0], (4.4, 2.0))  # where the scene has it at time zero
    assert np.allclose(path.get_segments()[-1][-1], course([PERIOD])[0, :2])
    outlines = [artist for artist in axes.get_children() if isinstance(artist, Polygon)]
    assert 8 <= len(outlines) <= 22
    extents = [np.ptp(outline.get_xy(), axis=0) for outline in outlines]
    spokes = [line for line in axes.lines if line.get_marker() == "o"]
    drawn_in_order = axes.get_children()
    for outline, spoke in zip(outlines, spokes, strict=True):  # a grain does not hide its spoke
        assert outline.get_zorder() == spoke.get_zorder()
        assert drawn_in_order.index(outline) < drawn_in_order.index(spoke)
    assert any(np.allclose(e, (1.0, 0.5), atol=1e-3) for e in extents)  # at first it lies
    assert any(np.allclose(e, (0.5, 1.0), atol=1e-3) for e in extents)  # after 5/4 turns it stands
    titles = [panel.get_title(loc="left") for panel in panels]
    assert [title.partition(" [")[0] for title in titles] == [
        "x", "y", "angle", "velocity x", "velocity y", "spin",
    ]  # fmt: skip
    assert all(title.endswith("]") for title in titles)


def test_curves_are_those_of_the_history(texts):
    figure = drawn(SCENE, read_history(texts / "history.csv"))
    times = np.linspace(0.0, PERIOD, 51)[1:]
    expected = course(times).T.copy()
    expected[2] = np.degrees(expected[2])
    for panel, values in zip(quantities(figure), expected, strict=True):
        (line,) = [line for line in panel.lines if len(line.get_xdata()) > 2]
        assert np.allclose(line.get_xdata()[1:], times)
        assert np.allclose(line.get_ydata()[1:], values, atol=1e-9)
        assert len([line for line in panel.lines if line.get_linestyle() == ":"]) == 2  # new meshes


DOMAIN = 'kind = "box"\nlength = 6.0\nheight = 4.0'
SHAPES = {
    "broad": SCENE,
    "tall": SCENE.replace(DOMAIN, 'kind = "box"\nlength = 6.0\nheight = 24.0'),
    "large": SCENE.replace(DOMAIN, 'kind = "box"\nlength = 20.0\nheight = 20.0'),
    "bed": SCENE.replace(DOMAIN, "length = 20.0\nheight = 4.0").replace(
        '"lid"', '"shear"\n[bed]\nkind = "sinusoidal"\namplitude = 0.2\nwavelength = 2.0'
    ),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_no_text_lies_on_another(shape, texts):
    figure = drawn(SHAPES[shape], read_history(texts / "history.csv"))
    figure.draw_without_rendering()
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts_shown(figure)]
    assert len(boxes) > 50
    for (one, first), (other, second) in combinations(boxes, 2):
        assert not first.padded(-1).overlaps(second.padded(-1)), (one, other)
    across, up = figure.get_size_inches() * figure.dpi
    for one, box in boxes:
        assert min(box.x0, box.y0, across - box.x1, up - box.y1) >= 0, one
    assert len([axes for axes in figure.axes if "Path" in axes.get_title(loc="left")]) == 1


def texts_shown(figure):
    """All but the labels of ticks beyond the axes' ends, which matplotlib keeps and does not draw."""
    axes = [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
    hidden = set()
    for k, axis in enumerate(axes):
        low, high = sorted(axis.get_view_interval())
        ticks = axis.get_ticklabels() + axis.get_ticklabels(minor=True)
        hidden |= {id(t) for t in ticks if not low <= t.get_position()[k % 2] <= high}
    return [
        text
        for text in figure.findobj(Text)
        if text.get_visible() and text.get_text().strip() and id(text) not in hidden
    ]


def test_a_grain_that_hardly_moves_is_not_shown_as_trembling(texts):
    times = np.linspace(0.0, 1.0, 11)[1:]
    write_history(texts / "history.csv", times)
    history = read_history(texts / "history.csv")
    history.columns["x"][:] = 4.4 + 1e-15 * np.arange(10)
    figure = drawn(SCENE, history)
    panel = next(axes for axes in figure.axes if axes.get_title(loc="left").startswith("x ["))
    assert np.ptp(panel.get_ylim()) > 1e-3


def test_a_long_history_is_drawn_in_few_pieces(texts):
    write_history(texts / "history.csv", np.linspace(0.0, 20 * PERIOD, 20_001)[1:])
    history = read_history(texts / "history.csv")
    assert len(history.times) == 20_000
    figure = drawn(SCENE, history)
    (path,) = [c for c in figure.axes[0].collections if isinstance(c, LineCollection)]
    assert 1000 < len(path.get_segments()) < 5000


# -- the history ---------------------------------------------------------------------------------------------


def test_remeshings_and_places_between_rows(texts):
    history = read_history(texts / "history.csv")
    assert np.allclose(history.remeshings, [1.1, 3.1])
    between = history.at(0.15)
    ends = course([0.1, 0.2])
    assert np.allclose((*between.centre, between.angle), ends[:, :3].mean(axis=0))


def test_headings_may_have_units_and_the_last_row_may_be_incomplete(texts):
    path = texts / "history.csv"
    path.write_text(path.read_text().replace("time,", "time [scene units],", 1) + "5.1,0.05,3")
    assert len(read_history(path).times) == 50


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (None, r"cannot be read \(No such file"),
        ("", "holds no time"),
        ("time,drag\n1,2\n", "holds no x"),
        ("time,x,y,angle\n", "holds no place"),
        ("time,x,y,angle\n1,2\n1,2,3,4\n1\n", "cannot be read"),
        ("time,x,y,angle\n1,2,3,left\n", "cannot be read"),
        ("time,x,y,angle\n1,2,3,\n", "holds no place"),
    ],
)
def test_a_damaged_history_is_named(text, complaint, texts):
    path = texts / "history.csv"
    path.unlink() if text is None else path.write_text(text)
    with pytest.raises(OutputError, match=rf"history\.csv: {complaint}.*; "):
        read_history(path)


# -- animations ----------------------------------------------------------------------------------------------


def assert_is_an_animation(path):
    """A small GIF with a frame for each step, a white margin, and a grain that moves."""
    image = Image.open(path)
    assert image.format == "GIF" and image.n_frames == STEPS
    assert 400 < image.width < 1000 and 300 < image.height < 1000
    assert path.stat().st_size < STEPS * 25_000  # 200 frames: 5 MB
    frames = []
    for number in range(STEPS):
        image.seek(number)
        frames.append(np.asarray(image.convert("RGB")).astype(int))
    assert all((frame[:3] == 255).all() for frame in frames)
    for one, other in pairwise(frames):
        assert np.mean((one != other).any(axis=2)) > 0.005  # the grain moves


@pytest.mark.slow
def test_a_gif_has_a_frame_for_each_step(run):
    path = animate_apart(run, None, "velocity")
    assert path == run / "velocity.gif"
    assert_is_an_animation(path)


def test_the_grain_is_where_its_mesh_is(run):
    indices, moments = films._frames(run / "fields")
    film = films._Film(run, films.FIELDS["velocity"], indices, moments)
    for number in (0, STEPS // 2, STEPS - 1):
        film.show(number)
        (axes, *_) = film.figure.axes
        body = min(
            (p for p in axes.patches if isinstance(p, Polygon)), key=lambda p: np.ptp(p.get_xy())
        )
        expected = course([moments[number]])[0]
        middle = (body.get_xy().max(axis=0) + body.get_xy().min(axis=0)) / 2
        assert np.allclose(middle, expected[:2], atol=5e-3)
        (spoke,) = [line for line in axes.lines if line.get_marker() == "o"]
        way = axes.lines[-1]
        assert np.allclose(way.get_xydata()[-1], expected[:2], atol=5e-3)
        assert np.allclose(
            np.diff(spoke.get_xydata(), axis=0), 0.5 * rotated(expected[2]), atol=3e-2
        )
        assert f"t = {moments[number]:.2f}" in axes.get_title(loc="left")


def rotated(angle):
    return np.array([[np.cos(angle), np.sin(angle)]])


def write_series(directory, times):
    file = SeriesFile(directory / "fields", "Triangle_6")
    points = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    file.begin()
    zero, still = np.zeros(6), np.zeros((6, 3))
    mesh = {"topology": np.arange(6)[None], "geometry": np.column_stack([points, zero])}
    for number, time in enumerate(times):
        values = {"velocity": still, "pressure": zero, "vorticity": zero}
        file.add_step(time, values, {} if number else mesh)


def test_of_many_steps_those_evenly_spaced_in_time_are_shown(tmp_path, monkeypatch):
    monkeypatch.setattr(films, "_MOST_FRAMES", 20)
    times = np.concatenate([np.linspace(0, 0.01, 10), np.linspace(0.04, 1.0, 25)])
    write_series(tmp_path, times)
    indices, moments = films._frames(tmp_path / "fields")
    assert 15 < len(indices) <= 20
    assert (moments[0], moments[-1]) == (0.0, 1.0)
    assert np.diff(moments).max() < 0.1
    assert np.array_equal(moments, times[indices])


def test_fluid_at_rest_is_animated(texts):
    """Of a flow without any difference there is no range of colours to choose."""
    write_series(texts, [0.0, 1.0])
    for field in films.FIELDS:
        assert Image.open(films.animate(texts, None, field)).n_frames == 2


def test_an_mp4_is_written_with_ffmpeg(run, tmp_path):
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed")
    path = animate_apart(run, tmp_path / "flow.mp4", "vorticity")
    assert path.read_bytes()[4:8] == b"ftyp"
    assert sorted(tmp_path.iterdir()) == [tmp_path / MARK, path]


@pytest.mark.slow
def test_show_animates(run, command, tmp_path):
    done = command("show", run, "--animate", "--out", tmp_path / "w.gif", "--field", "vorticity")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{tmp_path / 'w.gif'}\n", "")
    assert_is_an_animation(tmp_path / "w.gif")


def test_the_directory_may_come_after_the_options(run, command):
    done = command("show", "--animate", "--field", "pressure", "--out", run / "p.gif", run)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{run / 'p.gif'}\n", "")
    assert_is_an_animation(run / "p.gif")


def test_what_cannot_be_animated_is_named_with_the_remedy(run, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    single, folder = tmp_path / "single", tmp_path / "folder.gif"
    for made in (single, folder):
        made.mkdir()
    write_series(single, [1.0])
    cases = {
        (
            single,
            None,
        ): "fields: holds a single step; run the scene with [time] and --set output.every=1",
        (tmp_path, None): "fields: holds no fields; run the scene with output.fields = true",
        (run, "x.avi"): "x.avi: is not a name for an animation; let it end in .gif or .mp4",
        (
            run,
            "x.mp4",
        ): "x.mp4: MP4 needs ffmpeg, which is not installed; install it or write a .gif",
        (
            run,
            "absent/x.gif",
        ): "x.gif: cannot be written: no such file or directory; make the directory first",
        (
            run,
            "folder.gif",
        ): "folder.gif: cannot be written: is a directory; a directory has the name of the file",
    }
    for (directory, name), complaint in cases.items():
        with pytest.raises(OutputError, match=re.escape(complaint)):
            films.animate(directory, name and tmp_path / name)
    assert {path.name for path in tmp_path.iterdir()} == {MARK, "single", "folder.gif"}


@pytest.mark.parametrize(
    ("options", "code", "complaint"),
    [
        (
            ["--animate"],
            5,
            "no animation: nothing/fields: holds no fields; run the scene with output.fields = true",
        ),
        (["--field", "pressure"], 2, "--field: needs --animate; add it"),
        (["--out", "flow.gif"], 2, "--out: needs --animate; add it"),
        (["--animate", "flow.gif"], 2, "unrecognized arguments: flow.gif; see incipient --help"),
    ],
)
def test_show_says_what_is_wrong_in_one_line(
    options, code, complaint, capsys, monkeypatch, tmp_path
):
    (tmp_path / "nothing").mkdir()
    (tmp_path / "nothing" / "result.json").write_text("{}")
    monkeypatch.chdir(tmp_path)
    assert main(["show", "nothing", *options]) == code
    assert capsys.readouterr() == ("", f"incipient: {complaint}\n")
