"""The main job, a grain on a bed: first and later runs, convergence with the mesh, the order and the closing gap."""

from __future__ import annotations

from typing import Any

import callers
from measure import Session
from tables import Row, mebibytes, seconds, small

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
    session.say(f"first run: {first.get('error') or seconds(first['wall']) + ' s'}")
    (later,) = session.compare([callers.incipient(session, SCENE, "later runs", AS_IT_IS)])
    pictures = session.once(
        callers.incipient(
            session, SCENE, "later run with pictures", {**AS_IT_IS, "output.pictures": True}
        )
    )
    refined = [_kept(session.once(_refined(session, *case))) for case in _refinements()]
    closing = [_kept(session.once(_closing(session, gap))) for gap in GAPS]
    session.say("refinements and gaps done")
    return {"runs": [first, later, pictures], "refined": refined, "gaps": closing}


def _refinements() -> list[tuple[int, float]]:
    return [*((order, size) for order in ORDERS for size in SIZES), FINEST]


def _refined(session: Session, order: int, size: float) -> Any:
    settings = {"numerics.order": order, "numerics.mesh_size": size}
    return callers.incipient(
        session, SCENE, f"P{order}-P{order - 1}, mesh_size = {size:g}", settings
    )


def _closing(session: Session, gap: float) -> Any:
    return callers.incipient(session, SCENE, f"{gap:g}", {**GAP_SETTINGS, "contact.gap": gap})


def _kept(row: Row) -> Row:
    """These ran once, some with forms to compile: their times say nothing."""
    return {
        key: row[key]
        for key in row
        if key not in ("wall", "cpu", "wall_of_each_run", "stages", "settings")
    }


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    runs = [
        f"- {row['name']}: {seconds(row['wall'])} s, {seconds(row['cpu'])} s, {mebibytes(row['peak_mib'])} MiB"
        for row in data["runs"]
        if "error" not in row
    ]
    listed, fine = "\n".join(runs), data["refined"][-1]
    refined = [
        f"{small(_distance(r, fine))} in {r['name'].split(',')[0]}"
        for r in data["refined"][: -1 : len(SIZES)]
    ]
    return f"""### A grain on a bed: the main job

`incipient run demos/scenes/{SCENE}.toml` with error bars; wall time, CPU time, memory:

{listed}

Error of force and torque with mesh_size = {SIZES[0]:g}, over the force, against the finest mesh
({fine["name"]}): {", ".join(refined)}.

{_verdict_on_gap(data["gaps"])}"""


def _vector(row: Row) -> list[float]:
    return [*row["force"][:2], row["couple"]]


def _distance(row: Row, fine: Row) -> float:
    scale = max(abs(value) for value in _vector(fine))
    return max(abs(a - b) for a, b in zip(_vector(row), _vector(fine), strict=True)) / scale


def limits(rows: list[Row]) -> list[float]:
    """Force and couple at contact, continued linearly from the two smallest gaps."""
    (near, far), (gap_near, gap_far) = (rows[-1], rows[-2]), (GAPS[-1], GAPS[-2])
    pairs = zip(_vector(near), _vector(far), strict=True)
    return [a - gap_near * (b - a) / (gap_far - gap_near) for a, b in pairs]


def _verdict_on_gap(rows: list[Row]) -> str:
    end = limits(rows)
    default = _vector(rows[GAPS.index(0.01)])
    error = max(abs(a - b) for a, b in zip(default, end, strict=True)) / max(map(abs, end))
    return (
        f"With the default gap of 0.01 the load differs from that at contact by {100 * error:.1f}%."
    )
