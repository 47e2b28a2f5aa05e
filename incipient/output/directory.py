"""The directory a run leaves behind: resolved scene, history, fields for ParaView, result, readable at any moment."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files import append_row, reported, write_json
from ..parallel import collectively
from ..plan import Plan
from ..result import Result
from ..scene import Scene

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..domain import Domain
    from ..threshold import Threshold
    from .xdmf import FieldSeries, SurfaceSeries

# What an earlier run into the same directory may have left and this one may not write again.
PICTURES = ("flow", "pressure", "vorticity", "traction", "verdict", "profiles", "mesh", "threshold")
DATA = (
    "result.json",
    "history.csv",
    "fields.xdmf",
    "fields.h5",
    "surface.xdmf",
    "surface.h5",
    "threshold.json",
)
LEFTOVERS = (*DATA, *(f"{name}.png" for name in PICTURES))


class ResultDirectory:
    """Records a run in a directory (see `incipient.simulation.Recorder`). Every method is collective.

    Raises:
        OutputError: on all ranks, when something cannot be written.
    """

    def __init__(self, path: Path, comm: MPI.Comm):
        self.path, self.comm = path, comm
        self._series: FieldSeries | None = None
        self._surface: SurfaceSeries | None = None
        with collectively(comm):
            if comm.rank == 0:
                self._prepare()

    def _prepare(self) -> None:
        with reported(self.path):
            self.path.mkdir(parents=True, exist_ok=True)
            for name in LEFTOVERS:
                (self.path / name).unlink(missing_ok=True)

    def begin(self, scene: Scene, plan: Plan, domain: Domain) -> None:
        """Write the resolved scene; open the field series if fields are wanted."""
        from ..scene import save

        self._output = scene.output
        with collectively(self.comm):
            if self.comm.rank == 0:
                save(scene, self.path / "scene.toml")
        if not scene.output.fields:
            return
        from .xdmf import FieldSeries, SurfaceSeries

        self._series = FieldSeries(self.path / "fields", domain.mesh, self.comm)
        if "body" in domain.names:
            facets = domain.facets_of("body")
            self._surface = SurfaceSeries(self.path / "surface", domain.mesh, facets, self.comm)

    def wants_fields(self, number: int, last: bool) -> bool:
        """At the end, and every so many steps if the scene says so."""
        every = self._output.every
        return self._series is not None and (last or (every > 0 and number % every == 0))

    def step(self, row: dict[str, Any]) -> None:
        """Append to history.csv."""
        with collectively(self.comm):
            if self.comm.rank == 0:
                append_row(self.path / "history.csv", row)

    def remeshed(self, domain: Domain) -> None:
        """Go on with the XDMF series on another mesh."""
        if self._series is not None:
            self._series.remeshed(domain.mesh)
        if self._surface is not None:
            self._surface.remeshed(domain.mesh, domain.facets_of("body"))

    def fields(self, time: float, fields: dict[str, Any], traction: Any) -> None:
        """Append to the XDMF series."""
        if self._series is not None:
            self._series.write(time, fields)
        if self._surface is not None and traction is not None:
            self._surface.write(time, {"traction": traction})

    def finish(self, result: Result) -> None:
        """Write result.json."""
        with collectively(self.comm):
            if self.comm.rank == 0:
                write_json(self.path / "result.json", result.to_dict())


def write_threshold(path: Path, scene: Scene, threshold: Threshold, comm: MPI.Comm) -> None:
    """Write threshold.json and the resolved scene into a directory, made if it is not there. Collective.

    Raises:
        OutputError: on all ranks, when something cannot be written.
    """
    from ..scene import save

    with collectively(comm):
        if comm.rank == 0:
            with reported(path):
                path.mkdir(parents=True, exist_ok=True)
            save(scene, path / "scene.toml")
            write_json(path / "threshold.json", threshold.to_dict())
