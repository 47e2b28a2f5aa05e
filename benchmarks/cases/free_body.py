"""A run with a free body: what share of its time goes into body, interface and mesh motion."""

from __future__ import annotations

from typing import Any

import callers
from measure import Session
from tables import Row, seconds

SCENE = "pothole_1"
SIZES = (1.0, 0.3)
OWN = ("interface", "mesh motion")  # of the coupling; the rest a fixed grain has as well
# So little way that the mesh stretches without a new one.
SETTINGS = {
    "time.step": 0.01,
    "time.end": 0.6,
    "numerics.remesh_below": 0.1,
    "output.fields": False,
}


def measure(session: Session) -> dict[str, Any]:
    """Rows of runs on a coarse and a fine mesh, with the share of the coupling in each round."""
    programs = [
        callers.incipient(
            session, SCENE, f"mesh_size = {size:g}", {**SETTINGS, "numerics.mesh_size": size}
        )
        for size in SIZES
    ]
    return {"rows": session.compare(programs)}


def share(row: Row) -> float:
    """The share of body, interface and mesh motion in the wall time, remeshing apart."""
    stages = row["stages"]
    return sum(stages.get(name, 0.0) for name in OWN) / (
        stages["total"] - stages.get("remeshing", 0.0)
    )


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    rows = "\n".join(_row(row) for row in data["rows"] if "error" not in row)
    return f"""### A free body

The first 60 steps of the pebble in the pothole (`demos/scenes/{SCENE}.toml`), without remeshing (`cost.wall_time` in
result.json). *Interface*: the body's equation of motion, and the derivative of the flow by its three motions:

{rows}"""


def _row(row: Row) -> str:
    parts = ", ".join(f"{name} {seconds(row['stages'][name])} s" for name in ("flow", *OWN))
    last = f"{100 * share(row):.0f}% for the last two"
    return f"- {row['unknowns']} unknowns: {seconds(row['wall'])} s, of which {parts}; {last}"
