"""The main job, a grain on a bed: first and later runs, convergence with the mesh, the order and the closing gap."""

from __future__ import annotations

from typing import Any

import callers
import numpy as np
from measure import Session
from tables import Row, seconds, small

ORDERS, SIZES = (2, 3, 4), (1.0, 0.5)
FINEST = (4, 0.3)
GAPS = (0.1, 0.03, 0.01, 0.003, 0.001)
AS_IT_IS = {"numerics.error_bars": True}  # what a user gets without options
GAP_SETTINGS = {"numerics.order": 3, "numerics.mesh_size": 0.5}
SCENE = "grain_on_bed"


def measure(session: Session) -> dict[str, Any]:
    """Rows of the first and later runs, of the refinements, of the gaps."""
    fresh = {"XDG_CACHE_HOME": str(session.directory())}
    first = session.once(
        callers.incipient(session, SCENE, "first run, no form compiled yet", AS_IT_IS), fresh
    )
    (later,) = session.compare([callers.incipient(session, SCENE, "later runs", AS_IT_IS)])
    drawing = {**AS_IT_IS, "output.pictures": True}
    pictures = session.once(callers.incipient(session, SCENE, "later run with pictures", drawing))
    refinements = [*((order, size) for order in ORDERS for size in SIZES), FINEST]
    refined = {
        f"P{order}-P{order - 1}, mesh_size = {size:g}": {
            "numerics.order": order,
            "numerics.mesh_size": size,
        }
        for order, size in refinements
    }
    closing = {f"{gap:g}": {**GAP_SETTINGS, "contact.gap": gap} for gap in GAPS}
    return {
        "runs": [first, later, pictures],
        "refined": _loads(session, refined),
        "gaps": _loads(session, closing),
    }


def _loads(session: Session, variants: dict[str, dict[str, Any]]) -> list[Row]:
    """Rows that ran once, some with forms to compile: without times, which say nothing."""
    rows = [
        session.once(callers.incipient(session, SCENE, name, settings))
        for name, settings in variants.items()
    ]
    times = ("wall", "cpu", "wall_of_each_run", "stages", "settings")
    return [{key: row[key] for key in row if key not in times} for row in rows]


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    runs = [
        f"- {row['name']}: {seconds(row['wall'])} s, {seconds(row['cpu'])} s, {row['peak_mib']:.0f} MiB"
        for row in data["runs"]
        if "error" not in row
    ]
    listed, fine = "\n".join(runs), data["refined"][-1]
    refined = [
        f"{small(_distance(_vector(r), _vector(fine)))} in {r['name'].split(',')[0]}"
        for r in data["refined"][: -1 : len(SIZES)]
    ]
    return f"""### A grain on a bed: the main job

`incipient run demos/scenes/{SCENE}.toml` with error bars; wall time, CPU time, memory:

{listed}

Error of force and torque with mesh_size = {SIZES[0]:g}, over the force, against the finest mesh
({fine["name"]}): {", ".join(refined)}.

{_verdict_on_gap(data["gaps"])}"""


def _vector(row: Row) -> np.ndarray:
    return np.array([*row["force"][:2], row["couple"]])


def _distance(load: np.ndarray, true: np.ndarray) -> float:
    """The largest difference over the largest component."""
    return float(abs(load - true).max() / abs(true).max())


def _verdict_on_gap(rows: list[Row]) -> str:
    *_, far, near = map(_vector, rows)
    # At contact, continued linearly from the two smallest gaps.
    at_contact = near - GAPS[-1] * (far - near) / (GAPS[-2] - GAPS[-1])
    error = 100 * _distance(_vector(rows[GAPS.index(0.01)]), at_contact)
    return f"With the default gap of 0.01 the load differs from that at contact by {error:.1f}%."
