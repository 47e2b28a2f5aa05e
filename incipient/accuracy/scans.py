"""What the resolution of a scan changes: the grain, held as coarser copies of it or of its bed would be.

A grain rests on a few points, each on some facet of its scan, and the facet's tilt gives the direction in which it is
held there. Other scans of a pebble put their facets elsewhere. How far their safety factors are apart is seen from
copies with half the resolution, which come to rest on the bed and bear the same load; the largest ratio counts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ConvergenceError, SceneError
from ..geometry.coarser import coarser_heights, coarser_outline, coarser_surface
from ..geometry.space.surfaces import Surface
from ..results.errorbars import Term
from ..results.loads import Couples, Forces
from ..scene import Scene
from .coarse_runs import changed

if TYPE_CHECKING:
    from ..contact.verdict import Exact

SCAN = "scan"
# How much longer the edges of copies are, one each, which puts their facets elsewhere, too. In all of 24 scans of the
# pebble of demos/scenes, in 320 and 1280 facets, the ratio covers what finer scans change (tests/unit/test_scans.py).
COARSER = (1.8, 2.0, 2.2)
FEWEST = (
    2  # copies that have to come to rest: of so little resolution a grain may balance on a corner
)
TRACED = 32  # points of an outline, or rows and columns of a bed, from which on they are a scan


def is_scanned(scene: Scene) -> bool:
    """Whether the scene's grain or bed is a scan, of which there may be coarser copies. Not collective."""
    return _is_traced(scene.body) or _is_traced(scene.bed)


def of_scans(scene: Scene, force: Forces, couple: Couples) -> Term:
    """The term of the scans' resolution, for a grain that is judged. Not collective.

    Raises:
        ConvergenceError: fewer than two coarser copies come to rest.
        MeshError: a copy cannot be triangulated.
    """
    found: list[Exact] = []
    why = ""
    for copy in range(len(COARSER)):
        try:
            found.append(_judged(coarser_copy(scene, copy), force, couple))
        except SceneError as error:
            why = str(error)
    if len(found) < FEWEST:
        raise ConvergenceError(f"copies of half its resolution do not come to rest: {why}")
    own = _judged(scene, force, couple).safety.value
    factors = [one.safety.value for one in found]
    ratio = max(_ratio(own, factor) for factor in factors)
    said = ", ".join(f"{factor:.4g}" for factor in factors)
    how = f"copies of half its resolution hold the load with safety factors {said}"
    labels = tuple(dict.fromkeys(one.label for one in found))
    return Term(SCAN, np.zeros(3), np.zeros(3), how, ratio=ratio, modes=labels)


def _judged(scene: Scene, force: Forces, couple: Couples) -> Exact:
    """What mechanics say of a load on the scene's grain."""
    from ..contact.verdict import judged  # which loads linear programs, slowly
    from ..evaluation.contact_verdict import find_contacts, load_of, mass_and_inertia

    assert scene.contact is not None and scene.body is not None
    load, inert = (
        load_of(scene.placement, force, couple),
        mass_and_inertia(scene.body, scene.placement),
    )
    return judged(load, find_contacts(scene), scene.contact.friction, inert)


def coarser_copy(scene: Scene, copy: int) -> Scene:
    """The scene with grain and bed scanned less finely, copies counted from 0. Not collective."""
    sections: dict[str, dict[str, Any]] = {"numerics": {"error_bars": False}}
    if _is_traced(scene.body):
        sections["body"] = _coarser_body(scene, copy)
    if _is_traced(scene.bed):
        sections["bed"] = _coarser_bed(scene, copy)
    if scene.gdim == 3:
        sections["domain"] = {"symmetric": False}  # copies are not, and are not meshed
    return changed(scene, **sections)


def _is_traced(section: Any) -> bool:
    """Whether a section, of the grain or of the bed, has a shape that was scanned or traced."""
    kind = getattr(section, "shape", None) or getattr(section, "kind", None)
    if kind in ("polygon", "polyline"):
        return len(section.vertices if kind == "polygon" else section.points) >= TRACED
    if hasattr(section, "heights"):
        return bool(min(np.shape(section.heights)) >= TRACED)
    return kind == "mesh"


def _coarser_body(scene: Scene, copy: int) -> dict[str, Any]:
    """The keys that a coarser copy of the grain changes."""
    body: Any = scene.body
    if body.shape == "polygon":
        return {"vertices": coarser_outline(np.array(body.vertices), copy, closed=True).tolist()}
    found = coarser_surface(Surface(scene.grain.vertices, scene.grain.triangles), COARSER[copy])
    return {"vertices": found.points.tolist(), "triangles": found.triangles.tolist(), "size": None}


def _coarser_bed(scene: Scene, copy: int) -> dict[str, Any]:
    """The keys that a coarser copy of the bed changes."""
    bed: Any = scene.bed
    if bed.kind == "polyline":
        return {"points": coarser_outline(np.array(bed.points), copy, closed=False).tolist()}
    return {"heights": coarser_heights(np.array(bed.heights), copy).tolist()}


def _ratio(one: float, other: float) -> float:
    """The larger of two safety factors over the smaller; infinite where one alone is zero or infinite."""
    if one == other:
        return 1.0
    low, high = sorted((one, other))
    return high / low if low > 0.0 and np.isfinite(high) else float("inf")
