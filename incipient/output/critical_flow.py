"""Searches of the critical flow, which leave threshold.json and the resolved scene in a directory if one is named."""

from __future__ import annotations

from pathlib import Path

from ..files import make_directory, write_json
from ..interrupt import one_at_a_time
from ..parallel import Comm, collectively, world
from ..progress import Silent
from ..scene import Scene
from ..scene.file import dumps
from ..thresholds.critical import find_threshold
from ..thresholds.outcome import Threshold
from .lock import locked
from .ownership import OTHERS, place_scene


@one_at_a_time
def threshold(
    scene: Scene,
    directory: Path | str | None = None,
    comm: Comm | None = None,
    voice: Silent | None = None,
) -> Threshold:
    """Find the flow at which a scene's grain first moves as it grows from rest. Collective over `comm`.

    Args:
        scene: a grain that rests on a bed, in a steady flow.
        directory: where to write threshold.json and the resolved scene; None writes nothing. The critical flow is
            written as soon as it is known, before its error bars are.
        voice: reports every solved flow; default: none.

    Raises:
        IncipientError: on all ranks, one line; the threshold without error bars stays in the directory.
    """
    comm = comm or world()
    if directory is None:
        return find_threshold(scene, comm, voice)
    path = Path(directory)

    def keep(found: Threshold) -> Path:
        write_threshold(path, scene, found, comm)
        return path

    with locked(path, comm, make=True):
        found = find_threshold(scene, comm, voice, keep)
        keep(found)
    return found


def write_threshold(path: Path, scene: Scene, threshold: Threshold, comm: Comm) -> None:
    """Write threshold.json and the resolved scene into a directory, made if need be. Collective; raises OutputError.

    Results of another scene there move to a numbered neighbour.
    """
    with collectively(comm):
        if comm.rank == 0:
            make_directory(path)
            place_scene(path, dumps(scene), OTHERS["threshold"])
            write_json(path / "threshold.json", threshold.to_dict())
