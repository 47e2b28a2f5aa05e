"""A film that goes once round the grain of a run in space.

It shows the bed, the traction on the grain, streamlines that come towards it, and, where the grain was judged, the
contact forces in their cones.
"""

from __future__ import annotations

from pathlib import Path
from textwrap import shorten, wrap
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ...errors import OutputError
from ...scene import Scene
from .. import style
from ..flow.section import tetrahedra
from ..record import StoredRun, read
from ..style import FLOW, GROUND
from ..verdict.judged import judged
from ..verdict.solid import Stage, bed_around, empty_stage, frame_of, within
from ..verdict.space import QUADRATIC_TRIANGLE, last_colour, placed_surface, whole_surface
from . import film_file
from .film_file import DOTS, Frames

_FRAMES, _RATE = 60, 12  # and per second
_PIXELS = (620, 520)
_LETTERS = 110  # of a line
_RAISED, _FIRST = (
    24.0,
    -66.0,
)  # of the camera: above the horizontal; at first, 0 being downstream; degrees
# Lengths in grain sizes.
_SEEN, _REACH = 1.2, 1.45  # half the height of the picture; radius of what is shown
_STEP = 0.025  # between the points of the bed
_BESIDE, _ABOVE = 0.7, 0.7  # where streamlines come from, relative to the grain's centre
_LINES, _TUBE = (7, 5), 0.007  # across and upwards; radius
_THROUGH = {"grain": 0.5, "bed": 0.6}  # opacities: contacts are seen through both


def turn(directory: Path, target: Path | None = None) -> Path:
    """Make the film of a run, by default DIRECTORY/turntable.gif; returns the file written. Not collective.

    Raises:
        OutputError: for a run in the plane or without a grain, without ffmpeg for an MP4, or when it cannot be written.
    """
    path = target or directory / "turntable.gif"
    film_file.check(path)
    run = read(directory)
    if not run.in_space or run.surface is None:
        why = "a turntable shows a grain in space; this run has none"
        raise OutputError(f"{directory}: {why}: use --animate")
    with style.applied():
        film_file.write(_Turntable(run), path, _RATE)
    return path


class _Turntable(Frames):
    """A figure with the rendering from one side after the other, and the colours of the traction."""

    count = _FRAMES

    def __init__(self, run: StoredRun):
        self._run, self._scene = run, Scene(**run.scene)
        self._centre = np.array(run.value("grain", "computed_centre"), dtype=float)
        self._size = float(run.value("grain", "size"))
        self._points, self._cells, self._traction = whole_surface(run)
        self._norm = Normalize(0.0, last_colour(np.linalg.norm(self._traction, axis=1)))
        self._pyvista, self._plotter = empty_stage(_PIXELS)
        self._fill()
        self.figure = self._laid_out()

    def show(self, number: int) -> None:
        """Look from another side."""
        turned, raised = np.radians([_FIRST + 360.0 * number / self.count, _RAISED])
        towards = [np.cos(raised) * np.cos(turned), np.cos(raised) * np.sin(turned), np.sin(raised)]
        camera = self._plotter.camera
        camera.parallel_projection = True
        camera.focal_point, camera.up = self._centre, (0.0, 0.0, 1.0)
        camera.position = self._centre + 12.0 * self._size * np.array(towards)
        camera.parallel_scale = _SEEN * self._size
        self._plotter.reset_camera_clipping_range()
        self._plotter.render()
        self._shown.set_data(self._plotter.screenshot(return_img=True))

    def _laid_out(self) -> Figure:
        across, up = (pixels / DOTS for pixels in _PIXELS)
        width, height = across + 1.0, up + 0.75
        figure = Figure(figsize=(width, height), dpi=DOTS)
        sentence = (self._run.result.get("verdict") or {}).get("sentence", "")
        lines = [
            shorten(self._run.headline, _LETTERS),
            *wrap(sentence.partition(";")[0], _LETTERS)[:2],
        ]
        figure.text(0.15 / width, 1 - 0.12 / height, "\n".join(lines), fontsize=9, va="top")
        axes = figure.add_axes((0.0, 0.0, across / width, up / height))
        axes.set_axis_off()
        self._shown = axes.imshow(np.full((*_PIXELS[::-1], 3), 255, dtype=np.uint8), aspect="auto")
        bar = figure.add_axes((across / width, 0.15, 0.14 / width, 0.6))
        figure.colorbar(ScalarMappable(self._norm, "magma"), cax=bar, extend="max")
        bar.set_ylabel("traction on the grain [scene units]")
        return figure

    def _fill(self) -> None:
        self._show_bed()
        self._show_grain()
        for line in self._streamlines():
            self._plotter.add_mesh(line.tube(radius=_TUBE * self._size), color=FLOW)
        verdict = self._run.result.get("verdict")
        if verdict is not None:
            case = judged(verdict, self._run.directory / "result.json")
            points, _ = placed_surface(self._scene.grain, self._scene.placement)
            Stage(self._pyvista, self._plotter, frame_of(case, points)).contacts(case)

    def _show_grain(self) -> None:
        surface = self._pyvista.UnstructuredGrid({QUADRATIC_TRIANGLE: self._cells}, self._points)
        surface["size"] = np.linalg.norm(self._traction, axis=1)
        drawn = surface.extract_surface(nonlinear_subdivision=2, algorithm="dataset_surface")
        # Halves become one, all facing out.
        drawn = drawn.clean(tolerance=1e-7).compute_normals(auto_orient_normals=True)
        self._plotter.add_mesh(
            drawn, scalars="size", cmap="magma", clim=(0.0, self._norm.vmax), show_scalar_bar=False,
            smooth_shading=True, opacity=_THROUGH["grain"], culling="back",
        )  # fmt: skip

    def _show_bed(self) -> None:
        bed = self._scene.bed_shape
        if bed is None:
            return
        around = bed_around(
            self._pyvista, bed, self._centre, _REACH * self._size, _STEP * self._size
        )
        looks = {"smooth_shading": True, "ambient": 0.25, "opacity": _THROUGH["bed"]}
        self._plotter.add_mesh(around, color=GROUND, **looks)

    def _streamlines(self) -> list[Any]:
        """Through points upstream of the grain, in a scene of which half was computed with their mirror images."""
        found = within(self._traced(self._seeds()), self._centre, _REACH * self._size)
        if found.n_points == 0:
            return []
        if not self._run.halved:
            return [found]
        return [found, found.reflect((0.0, 1.0, 0.0), point=(0.0, self._run.middle, 0.0))]

    def _seeds(self) -> np.ndarray:
        """(n, 3) a rectangle of points upstream, those in the fluid."""
        beside = np.linspace(-_BESIDE, _BESIDE, _LINES[0]) * self._size
        if self._run.halved:
            beside = np.abs(beside[: (_LINES[0] + 1) // 2]) + 1e-4 * self._size
        above = np.linspace(-_ABOVE, _ABOVE, _LINES[1]) * self._size
        y, z = (
            one.ravel() for one in np.meshgrid(self._centre[1] + beside, self._centre[2] + above)
        )
        points = np.column_stack([np.full(y.size, self._centre[0] - _REACH * self._size), y, z])
        bed = self._scene.bed_shape
        low = self._scene.domain.bottom if bed is None else bed.height(points[:, :2])
        return points[points[:, 2] > low + 0.05 * self._size]

    def _traced(self, seeds: np.ndarray) -> Any:
        x, _, z = self._centre
        reach = 1.2 * _REACH * self._size
        near = tetrahedra(self._run, (x - reach, x + reach, z - reach, z + reach), ["velocity"])
        return near.streamlines_from_source(
            self._pyvista.PolyData(seeds), vectors="velocity", integration_direction="forward",
            max_length=2.2 * reach, max_step_length=0.25,
        )  # fmt: skip
