"""Pictures of a finished run, drawn off screen from its directory: no X server is needed.

matplotlib paints the quadratic cells, subdivided, with their curved boundaries; pyvista shows the mesh.
"""

from __future__ import annotations

from pathlib import Path


def draw(directory: Path) -> list[Path]:
    """Draw all pictures that a run's results allow, as PNG files beside them. Not collective.

    Always flow, pressure, vorticity and mesh; with a grain the traction on it and the verdict; for a box the
    velocity profiles on both centrelines.

    Raises:
        OutputError: when a result or a field is missing or damaged, or a picture cannot be written.
    """
    from ..files import reported
    from . import cells, flow, grain, style
    from .record import read

    run = read(directory)
    makers = {"flow": flow.speed, "pressure": flow.pressure, "vorticity": flow.vorticity}
    if run.surface is not None:
        makers |= {"traction": grain.traction, "verdict": grain.verdict}
    if run.setting("domain", "kind") == "box":
        makers["profiles"] = flow.profiles
    written = []
    with style.applied():
        for name, make in makers.items():
            path = directory / f"{name}.png"
            with reported(path):
                make(run).savefig(path, dpi=style.DOTS_PER_INCH, pil_kwargs={"compress_level": 3})
            written.append(path)
    path = directory / "mesh.png"
    with reported(path):
        cells.picture(run, path)
    return [*written, path]
