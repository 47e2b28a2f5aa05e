"""Coarse runs: their scenes, coarser, in longer steps, with sides farther away; their loads, each computed once."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import ConvergenceError, IncipientError, MeshError
from ..planning.boundary_layer import is_resolved
from ..planning.flow_setup import Setup, order_of
from ..results.errorbars import Loads
from ..scene import Scene
from ..scene.rules import FEWEST_STEPS as FEWEST_IN_GUST

# Coarse runs for the terms of the model: order and mesh_size, the latter at least; in time also how much longer steps
# are, which waves in long steps would be damped in, as long as there are so many.
MODEL_ORDER, MODEL_MESH, MODEL_MESH_IN_TIME = 2, 1.4, 2.0
MODEL_STEP, MODEL_STEP_OF_WAVES, FEWEST_STEPS = 4.0, 2.0, 8
# Where gap and domain are chosen to an accuracy below this, coarse runs in 2-D are in elements of this order.
FINE_BELOW, FINE_ORDER = 0.005, 3
MODEL_TOLERANCE, LARGEST_TOLERANCE = 8.0, 0.1  # of adaptive steps, over that of the scene; bound
MODEL_ITERATION = 1e-6  # tolerance of iterations in time: differences of a thousandth matter
FARTHER = 1.5  # how much larger the domain of the domain's term is
# Steps of the runs to compare with are longer by a factor in between, so that there are FEWEST_STEPS if possible.
LONGER_STEP, LONGEST_STEP = 2.0, 4.0
# Steps longer by less tell little: then steps are compared with shorter ones. Likewise cells.
COARSER_MESH, HIGHEST_ORDER = 2.0**0.5, 4
REMEDY = re.compile(r"; |: use ")  # where the advice of a message begins
Solve = Callable[[Scene], Loads]


class Spent(IncipientError):
    """What may be spent on estimates is used up."""


class KeptRuns:
    """Loads of coarse runs, each made once and kept by the JSON of its scene. Calling is collective.

    `known` are loads that are known already; those of runs are added. `spent` says why no run shall be begun any more,
    or nothing: then calling raises Spent.
    """

    def __init__(self, known: dict[str, Loads], spent: Callable[[], str], solve: Solve):
        self._known, self._spent, self._run = known, spent, solve

    def __call__(self, scene: Scene) -> Loads:
        """The loads of a scene, by a run if they are not known. Collective."""
        key = scene.model_dump_json()
        if key not in self._known:
            if reason := self._spent():
                raise Spent(reason)
            try:
                self._known[key] = self._run(scene)
            except (ConvergenceError, MeshError) as error:
                # Its advice is for the scene of the coarse run, not for that of the user.
                why = REMEDY.split(str(error))[0]
                raise type(error)(f"{why}, in a run to compare with") from error
        return self._known[key]


def on_coarser_mesh(scene: Scene) -> Scene:
    """The scene on a coarser mesh, without error bars. Not collective."""
    size = min(COARSER_MESH * scene.numerics.mesh_size, 100.0)
    return changed(scene, numerics={"mesh_size": size, "error_bars": False})


def comparisons(scene: Scene) -> tuple[Scene, Scene]:
    """The scene in time with longer steps, and with these in elements of the next-higher order, on a mesh of their own.

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
    if longest < COARSER_MESH:
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
    """The scene with inflow, outflow and sides that move with the base flow farther away, at the same viscosity.

    Below a free surface only the end moves away at which the scene prescribes nothing.
    """
    domain, up, origin = scene.domain, scene.up, [*scene.domain.origin]
    more = (factor - 1.0) * domain.length
    if scene.surface is not None and scene.surface.wave is not None:
        # Waves are to enter at the same place: the right end moves away, with its sponge.
        longer = {"domain": {"length": domain.length + more}}
        sponge = {"surface": {"sponge": factor * scene.surface.sponge}}
        return changed(scene, **longer, **(sponge if scene.surface.sponge > 0.0 else {}))
    before = more if scene.has_surface else 0.5 * more
    period = getattr(scene.bed, "wavelength", None) or getattr(scene.bed, "spacing", None)
    if period is not None:  # the flow enters at the same height of the bed
        before = float(period * np.ceil(before / period))
    origin[0] -= before
    if scene.has_surface:
        # The still level is given at the outflow: on a flat bed friction changes the depth from there upstream.
        return changed(scene, domain={"length": domain.length + before, "origin": tuple(origin)})
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
    tolerance = scene.numerics.tolerance
    numerics["tolerance"] = (
        MODEL_ITERATION if tolerance == "auto" else max(MODEL_ITERATION, tolerance)
    )
    if scene.body is not None and not scene.body.moves:
        # Without weight no step is judged.
        sections["body"] = {"density": None, "mass": None, "inertia": None}
    time, longer = scene.time, MODEL_STEP if scene.body is not None else MODEL_STEP_OF_WAVES
    most = min(time.end / FEWEST_STEPS, _longest_in_gust(scene))
    steps = {"step": min(longer * time.step, max(time.step, most))}
    if time.tolerance is not None:
        looser = min(MODEL_TOLERANCE * time.tolerance, LARGEST_TOLERANCE)
        steps["tolerance"] = max(looser, time.tolerance)
    return changed(scene, numerics=numerics, time=steps, **sections)


def is_coarse(scene: Scene) -> bool:
    """Whether a scene of steady flow is the first of its own coarse runs, which is then not made. Not collective."""
    return coarse(scene) == changed(
        scene, numerics={"error_bars": False, "order": order_of(scene).number}
    )


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
