"""A film of a run in space: the vertical plane through the grain, sampled on a regular grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.artist import Artist
from matplotlib.image import AxesImage

from ...errors import OutputError
from ...geometry.placement import Placement
from ...scene import Scene
from ..flow.section import VerticalSection, draw_outlines, section_of, views_of
from ..record import StoredRun, parsed_json
from ..style import View
from .film import ARROWS, Film

_POINTS = 320  # of the grid, along its longer side


class FilmInSpace(Film):
    """One field in the plane, the grain's silhouette, its way so far."""

    _upwards = "z"

    def _box(self) -> View:
        return views_of(self.run(0))[0]

    def run(self, number: int) -> StoredRun:
        """The step that a frame shows, with the grain where it is then."""
        run = self.stored(number)
        placement = self._placement(float(self.moments[number])) if run.scene.get("body") else None
        if placement is None:
            return run
        grain = {"computed_centre": placement.centre, "quaternion": placement.quaternion}
        return replace(run, result={"grain": grain | {"size": Scene(**run.scene).grain.size}})

    def _placement(self, time: float) -> Placement | None:
        """Where the grain is: by its history, else where the mesh was made for it, else where the scene puts it."""
        if self.history is not None:
            return self.history.at(time)
        try:
            grain = parsed_json(self.directory / "result.json")["grain"]
            return Placement(tuple(grain["computed_centre"]), quaternion=tuple(grain["quaternion"]))
        except (OutputError, KeyError, TypeError):  # the run goes on
            return Scene(**self.scene).placement

    def _shown(self, run: StoredRun, time: float) -> list[Artist]:
        names = {"velocity", "velocity" if self.field.name == "speed" else self.field.name}
        section = section_of(run, self.view, sorted(names), _POINTS)
        image = self._painted(section)
        drawn = [image, *draw_outlines(self.axes, section, image), *self.way(time)]
        if self.field.name == "speed":
            drawn.append(self._flow(section))
        return drawn

    def _painted(self, section: VerticalSection) -> AxesImage:
        values = self.field.of(section.fields)
        return self.axes.imshow(
            values, origin="lower", extent=section.view, cmap=self.colours,
            norm=self.norm, interpolation="bilinear", aspect="auto", zorder=1,
        )  # fmt: skip

    def _flow(self, section: VerticalSection) -> Artist:
        """The velocity within the plane on every so many points of the grid."""
        apart = max(1, max(section.inside.shape) // ARROWS)
        chosen = (slice(apart // 2, None, apart),) * 2
        rows, columns = np.nonzero(section.inside[chosen])
        places = np.column_stack([section.x[chosen[1]][columns], section.z[chosen[0]][rows]])
        velocities = section.fields["velocity"][chosen][rows, columns][:, [0, 2]]
        return self.arrows(places, velocities, apart * section.spacing)
