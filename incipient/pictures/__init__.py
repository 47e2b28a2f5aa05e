"""Pictures of what a directory holds, drawn off screen: no X server is needed.

matplotlib paints the quadratic cells, subdivided, with their curved boundaries, and judged grains in the plane;
pyvista shows the mesh, and judged grains in space.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .record import Run

    Maker = Callable[[Run], Figure]


def draw(directory: Path) -> list[Path]:
    """Draw all pictures that the results in a directory allow, as PNG files beside them. Not collective.

    A run (result.json): always flow, pressure, vorticity and mesh; with a grain the traction on it and the verdict,
    with one that moves its trajectory and the verdict if there is any; for a box in which nothing moves the velocity
    profiles on both centrelines. A threshold (threshold.json), a judged case (judgement.json), and
    a study of what accuracy costs (cost.json): one picture each.

    Raises:
        OutputError: when there is no result, when one is incomplete or damaged, or a picture cannot be written.
    """
    written = []
    names = ("judgement.json", "threshold.json", "cost.json")
    judged, found, studied = ((directory / name).exists() for name in names)
    if (directory / "result.json").exists() or not (judged or found or studied):
        written += _draw_run(directory)
    if found:
        from . import threshold

        written += threshold.draw(directory)
    if studied:
        from . import cost

        written += cost.draw(directory)
    if judged:
        from . import judgement

        written += judgement.draw(directory)
    return written


def _draw_run(directory: Path) -> list[Path]:
    from ..files import reported
    from . import cells, style
    from .record import read

    run = read(directory)
    written = []
    if run.moves:
        from . import trajectory

        written += trajectory.draw(directory, run.headline)
    with style.applied():
        for name, make in _makers(run).items():
            path = directory / f"{name}.png"
            with reported(path):
                make(run).savefig(path, dpi=style.DOTS_PER_INCH, pil_kwargs={"compress_level": 3})
            written.append(path)
    path = directory / "mesh.png"
    with reported(path):
        cells.picture(run, path)
    return [*written, path]


def _makers(run: Run) -> dict[str, Maker]:
    """What draws the pictures of a run's last fields, by the pictures' names."""
    from . import flow, grain

    makers: dict[str, Maker] = {"flow": flow.speed, "pressure": flow.pressure}
    makers["vorticity"] = flow.vorticity
    if run.surface is not None:
        makers["traction"] = grain.traction
    # A grain under way rests on nothing; where it has met the bed there is a verdict.
    if run.surface is not None and not (run.moves and run.result.get("verdict") is None):
        makers["verdict"] = grain.verdict
    if run.setting("domain", "kind") == "box" and not run.moves:
        makers["profiles"] = flow.profiles
    return makers
