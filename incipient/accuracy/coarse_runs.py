"""The scenes of the coarse runs that errors are estimated by: coarser, in longer steps, and with sides farther away."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..planning.boundary_layer import is_resolved
from ..planning.flow_setup import Setup, order_of
from ..scene import Scene, Surface, Time
from ..scene.rules import FEWEST_STEPS as FEWEST_IN_GUST
from .waves import LONGER_STEP

# Coarse runs for the terms of the model: order, mesh_size at least; in time, how much longer the steps are, of which
# so many stay if the scene has as many, and how much larger the error of each may be where they adapt, up to a bound.
MODEL_ORDER, MODEL_MESH = 2, 1.4
# Where gap and domain are chosen to an accuracy below this, coarse runs in the plane are in elements of this order.
FINE_BELOW, FINE_ORDER = 0.005, 3
MODEL_MESH_IN_TIME, MODEL_STEP, FEWEST_STEPS = 2.0, 4.0, 8
MODEL_STEP_OF_WAVES = 2.0  # which longer steps damp
MODEL_TOLERANCE, LARGEST_TOLERANCE = 8.0, 0.1
MODEL_ITERATION = (
    1e-6  # tolerance of their iterations in time, where differences of a thousandth matter
)
FARTHER = 1.5  # how much larger the domain of the domain's term is
# The runs that tell of the discretisation in time: between which factors how much longer the steps are, so that there
# are FEWEST_STEPS if possible; and how much coarser the mesh, where there is no higher order than that of the run.
LONGEST_STEP = 4.0
SLIGHTLY_LONGER = (
    2.0**0.5
)  # steps that are longer by less tell little: then steps are compared with shorter ones
COARSER_MESH, HIGHEST_ORDER = 2.0**0.5, 4


def on_coarser_mesh(scene: Scene) -> Scene:
    """The scene on a coarser mesh, without error bars. Not collective."""
    size = min(COARSER_MESH * scene.numerics.mesh_size, 100.0)
    return changed(scene, numerics={"mesh_size": size, "error_bars": False})


def comparisons(scene: Scene) -> tuple[Scene, Scene]:
    """The scene in time with longer steps, and with these in elements of one order more, on a mesh of their own.

    With wall layers, where k and epsilon keep their order, for elements of the highest order, and where no cell
    resolves the boundary layer of a grain, these are compared with such on a coarser mesh. Where there is neither grain
    nor wall layers, and the mesh may be as coarse as it gets, the highest order is compared with one order less.
    Adaptive steps err more each.
    """
    assert scene.time is not None
    ratio = ratio_of_steps(scene)
    time = {"step": ratio * scene.time.step}
    if scene.time.tolerance is not None:
        time["tolerance"] = ratio ** (order_in_time(scene) + 1) * scene.time.tolerance
    longer = changed(scene, numerics={"error_bars": False}, time=time)
    if on_another_mesh(scene):
        return longer, on_coarser_mesh(longer)
    other = order_of(scene).number + (1 if order_of(scene).number < HIGHEST_ORDER else -1)
    return longer, changed(longer, numerics={"order": other})


def on_another_mesh(scene: Scene) -> bool:
    """Whether a flow in time is compared with one on a coarser mesh, not with one of another order. Not collective.

    A boundary layer that no cell resolves is as thin for elements of a higher order on the same cells.
    """
    if scene.is_averaged or scene.body is None:
        return scene.is_averaged
    return order_of(scene).number == HIGHEST_ORDER or not is_resolved(Setup(scene))


def ratio_of_steps(scene: Scene) -> float:
    """How much longer the steps of runs to compare with are; shorter where longer ones miss a gust or the end.

    Not collective.
    """
    assert scene.time is not None
    time = scene.time
    longest = min(time.end, _longest_in_gust(scene)) / time.step
    if longest < SLIGHTLY_LONGER:
        return 1.0 / LONGER_STEP
    if time.tolerance is not None:
        return min(LONGER_STEP, longest)
    steps = time.end / time.step
    return float(min(np.clip(steps / FEWEST_STEPS, LONGER_STEP, LONGEST_STEP), longest))


def _longest_in_gust(scene: Scene) -> float:
    """The longest step that a scene accepts for its gust; infinite without one."""
    gust = getattr(scene.flow, "gust", None)
    return math.inf if gust is None or gust.shape == "points" else gust.duration / FEWEST_IN_GUST


def order_in_time(scene: Scene) -> int:
    """Order of the time steps. Not collective."""
    return 2 if scene.time is not None and scene.time.scheme == "bdf2" else 1


def farther(scene: Scene, factor: float = FARTHER) -> Scene:
    """The scene with inflow, outflow and sides that move with the base flow farther away, at the same viscosity."""
    if scene.has_surface:
        return changed(scene, **longer_channel(scene, factor))
    domain, up = scene.domain, scene.up
    before = 0.5 * (factor - 1.0) * domain.length
    period = getattr(scene.bed, "wavelength", None) or getattr(scene.bed, "spacing", None)
    if period is not None:  # the flow enters at the same height of the bed
        before = period * np.ceil(before / period)
    origin = [*domain.origin]
    origin[0] -= before
    changes: dict[str, Any] = {"length": domain.length + 2.0 * before}
    across = scene.body is not None and scene.body.shape == "cylinder"  # from side to side
    if domain.width is not None and scene.sides != "wall" and not across:
        changes["width"] = factor * domain.width
        origin[1] -= 0.5 * (factor - 1.0) * domain.width
    # Without a bed the flow is endless downwards as well, and a top without shear is no surface of a channel. Shear is
    # not, it begins at the bottom.
    endless = scene.bed is None and scene.flow.kind in ("uniform", "expression")
    if scene.top == "stream" or (endless and scene.top == "slip"):
        changes["height"] = factor * domain.height
        if endless:
            origin[up] -= 0.5 * (factor - 1.0) * domain.height
    larger = changed(scene, domain={**changes, "origin": tuple(origin)})
    if scene.fluid.scale == "grain":
        return larger
    # The viscosity stays: the Reynolds number is that of a higher domain.
    return changed(
        larger, fluid={"reynolds": scene.fluid.reynolds * larger.viscosity / scene.viscosity}
    )


def coarse(scene: Scene, **sections: dict[str, Any]) -> Scene:
    """The scene as it is run for a term of the model."""
    accuracy = scene.numerics.accuracy if scene.numerics.accuracy_includes == "all" else None
    fine = scene.gdim == 2 and isinstance(accuracy, float) and accuracy < FINE_BELOW
    order = FINE_ORDER if fine else MODEL_ORDER
    numerics: dict[str, Any] = {"order": order, "geometry_order": None, "error_bars": False}
    if scene.time is None:
        numerics["mesh_size"] = max(MODEL_MESH, scene.numerics.mesh_size)
        return changed(scene, numerics=numerics, **sections)
    numerics["mesh_size"] = max(MODEL_MESH_IN_TIME, scene.numerics.mesh_size)
    asked = scene.numerics.tolerance
    numerics["tolerance"] = MODEL_ITERATION if asked == "auto" else max(MODEL_ITERATION, asked)
    if scene.body is not None and not scene.body.moves:
        # Without weight no step is judged.
        sections["body"] = {"density": None, "mass": None, "inertia": None}
    longer = MODEL_STEP if scene.body is not None else MODEL_STEP_OF_WAVES
    return changed(
        scene, numerics=numerics, time=_longer_steps(scene, scene.time, longer), **sections
    )


def is_coarse(scene: Scene) -> bool:
    """Whether a scene of steady flow is the first of its own coarse runs, which is then not made. Not collective."""
    return coarse(scene) == changed(
        scene, numerics={"error_bars": False, "order": order_of(scene).number}
    )


def _longer_steps(scene: Scene, time: Time, longer: float) -> dict[str, float]:
    """The steps of runs in time for terms of the model."""
    most = min(time.end / FEWEST_STEPS, _longest_in_gust(scene))
    found = {"step": min(longer * time.step, max(time.step, most))}
    if time.tolerance is not None:
        found["tolerance"] = max(
            min(MODEL_TOLERANCE * time.tolerance, LARGEST_TOLERANCE), time.tolerance
        )
    return found


def changed(scene: Scene, **sections: dict[str, Any]) -> Scene:
    """The scene with some keys of some sections changed, checked again; raises SceneError if it contradicts itself."""
    plain = scene.model_dump()
    following = {"body", "fluid", "flow", "gravity"} | (
        {"domain"} if scene.fluid.scale == "flow" else set()
    )
    if following & sections.keys():
        plain["units"] = None  # what followed from them is as changed now
    for name, keys in sections.items():
        before = plain[name] or {}
        kept = before if keys.get("kind", before.get("kind")) == before.get("kind") else {}
        plain[name] = {**kept, **keys}  # another kind has keys of its own
    return Scene(**plain)


def longer_channel(scene: Scene, factor: float) -> dict[str, dict[str, Any]]:
    """What is other in a channel with a free surface that is `factor` times as long. Not collective.

    Where a wave comes in the right end moves away, and its sponge becomes longer: waves are to come in at the same
    place. Else the inflow moves away, by whole periods of the bed: where a stream has the still level is given
    by the scene, and on a level bed friction makes its depth another one upstream of another place.
    """
    surface, domain = scene.surface or Surface(), scene.domain
    more = (factor - 1.0) * domain.length
    if surface.wave is not None:
        sponge = {"surface": {"sponge": factor * surface.sponge}} if surface.sponge > 0.0 else {}
        return {"domain": {"length": domain.length + more}, **sponge}
    period = getattr(scene.bed, "wavelength", None) or getattr(scene.bed, "spacing", None)
    before = more if period is None else float(period * np.ceil(more / period))
    origin = (domain.origin[0] - before, *domain.origin[1:])
    return {"domain": {"length": domain.length + before, "origin": origin}}
