"""Coarse runs for error bars, with coarser cells, longer steps or a larger domain."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..arrays import Floats
from ..errors import ConvergenceError, IncipientError, MeshError
from ..geometry.plane.beds import Flat
from ..planning.discretisation import order_of
from ..planning.meshing import is_resolved
from ..results.errorbars import Loads
from ..scene import Scene
from ..scene.expression import kinks
from ..scene.rules import FEWEST_STEPS as FEWEST_IN_GUST
from ..scene.sections import MESH_SIZES, ORDERS
from ..setup.setup import Setup

MODEL_MESH = 1.4  # least mesh_size of steady coarse runs for the terms of the model
FEWEST_STEPS = 8  # of coarse runs: long steps damp waves
# In a period of an oscillating flow: with 40, 20, 16 and 12 steps the drag of a disc on a bed errs by 0.7%, 2.8%, 4.3%
# and 1.2%, so that 12 no longer show the order (the scene of test_step_term_in_waves_against_finer_steps).
FEWEST_IN_PERIOD = 16
MODEL_ITERATION = 1e-6  # tolerance of the iterations in time: differences of 0.1% matter
# Factor on the domain for the domain's term; on a moved mesh in 2-D, where it costs nothing, and in turbulent flow over
# bedforms, where next to the grain inflow and outflow change the drag in opposite directions.
FARTHER, MUCH_FARTHER = 1.5, 2.0
# Range of the factor on the steps of a comparison, with at least FEWEST_STEPS if possible; otherwise shorter steps.
LONGER_STEP, LONGEST_STEP = 2.0, 4.0
LONGEST_FIRST = 8.0  # the same of the first run for an accuracy
# Factor on cells between compared meshes.
COARSER_MESH = 2.0**0.5
REMEDY = re.compile(r"; |: use ")  # begins the remedy in a message
Solve = Callable[[Scene], Loads]


def kept_runs(known: dict[str, Loads], spent: Callable[[], str], solve: Solve) -> Solve:
    """The loads of coarse runs, kept in `known` by the JSON of the scene; calls are collective.

    spent: reason why no further run may begin, or ""; with a reason calls raise IncipientError
    """

    def kept(scene: Scene) -> Loads:
        key = scene.model_dump_json()
        if key not in known:
            if reason := spent():
                raise IncipientError(reason)
            try:
                known[key] = solve(scene)
            except (ConvergenceError, MeshError) as error:
                # Its remedy refers to the coarse scene, not to the user's.
                why = REMEDY.split(str(error))[0]
                raise type(error)(f"{why}, in a run for comparison") from error
        return known[key]

    return kept


def on_coarser_mesh(scene: Scene) -> Scene:
    """The scene on a coarser mesh, without error bars."""
    size = min(COARSER_MESH * scene.numerics.mesh_size, MESH_SIZES[1])
    return changed(scene, numerics={"mesh_size": size, "error_bars": False})


def comparisons(scene: Scene) -> tuple[Scene, Scene]:
    """The unsteady scene with longer steps, and with these in elements of the next-higher order, on separate meshes.

    A coarser mesh replaces the higher order with wall layers (k and epsilon keep their order), at the highest order,
    and for an unresolved boundary layer of a grain. Without grain and wall layers the coarsest mesh and highest order
    are compared with the next-lower order.
    """
    assert scene.time is not None
    time = with_step(scene, ratio_of_steps(scene) * scene.time.step)
    longer = changed(scene, numerics={"error_bars": False}, time=time)
    if on_another_mesh(scene):
        return longer, on_coarser_mesh(longer)
    other = order_of(scene) + (1 if order_of(scene) < ORDERS[-1] else -1)
    return longer, changed(longer, numerics={"order": other})


def with_step(scene: Scene, step: float) -> dict[str, float]:
    """Keys of [time] with another step, and for adaptive steps a tolerance in proportion to their error."""
    assert scene.time is not None
    keys, ratio = {"step": step}, step / scene.time.step
    if scene.time.tolerance is not None:
        keys["tolerance"] = ratio ** (order_in_time(scene) + 1) * scene.time.tolerance
    return keys


def on_another_mesh(scene: Scene) -> bool:
    """Whether an unsteady flow is compared on a coarser mesh, not in another order.

    A higher order on the same cells does not resolve a boundary layer thinner than the cells.
    """
    if scene.is_averaged or scene.body is None:
        return scene.is_averaged
    return order_of(scene) == ORDERS[-1] or not is_resolved(Setup(scene))


def ratio_of_steps(scene: Scene) -> float:
    """Factor on the steps of a comparison; below 1 if longer steps miss a gust, a period or the end.

    Half of unresolved steps may err like these by chance: a quarter of them is compared.
    """
    assert scene.time is not None
    time = scene.time
    longest = min(time.end, longest_step(scene)) / time.step
    if longest < 1.0 - 1e-9:
        return 1.0 / LONGEST_STEP
    if longest < COARSER_MESH:
        return 1.0 / LONGER_STEP
    if time.tolerance is not None:
        return min(LONGER_STEP, longest)
    steps = time.end / time.step
    return float(min(np.clip(steps / FEWEST_STEPS, LONGER_STEP, LONGEST_STEP), longest))


def longest_step(scene: Scene) -> float:
    """The longest step that resolves the changes of the base flow and of a prescribed motion.

    Of formulas infinite above LONGEST_FIRST of the scene's.
    """
    assert scene.time is not None
    longest, gust = scene.flow.cycle / FEWEST_IN_PERIOD, getattr(scene.flow, "gust", None)
    if gust is not None and gust.shape != "points":
        longest = min(longest, gust.duration / FEWEST_IN_GUST)
    setup = Setup(scene)
    times = setup.instants(4)
    # The steps begin anew at kinks.
    at_kinks = np.searchsorted(times, np.sort(setup.times_of(kinks)))
    for velocities in setup.prescribed(times):
        longest = min(longest, times[1] * _most_intervals(np.split(velocities, at_kinks)))
    return longest


def _most_intervals(pieces: Sequence[Floats]) -> float:
    """Most intervals in a step whose second differences are those of FEWEST_IN_PERIOD steps of a sine.

    pieces: values (times, ...) between kinks
    """
    largest = 0.5 * np.ptp(np.concatenate(pieces), axis=0).max()
    most = (2.0 * np.pi / FEWEST_IN_PERIOD) ** 2 * largest * (1.0 + 1e-9)
    # Steps of a whole period would not see it.
    for number in range(1, 4 * int(LONGEST_FIRST) + 1):
        for piece in pieces:
            bend = piece[2 * number :] - 2.0 * piece[number:-number] + piece[: -2 * number]
            if np.abs(bend).max(initial=0.0) > most:
                return number - 1
    return np.inf


def order_in_time(scene: Scene) -> int:
    """Order of the time steps."""
    return 2 if scene.time is not None and scene.time.scheme == "bdf2" else 1


def farther(scene: Scene, factor: float = FARTHER) -> Scene:
    """The scene with inflow, outflow and sides farther away, at the same viscosity.

    Below a free surface only the end without prescribed data is moved.
    """
    domain, up, origin = scene.domain, scene.up, [*scene.domain.origin]
    more = (factor - 1.0) * domain.length
    if scene.surface is not None and scene.surface.wave is not None:
        # Waves enter at the same position: the right end is moved, with its sponge.
        longer = {"domain": {"length": domain.length + more}}
        sponge = {"surface": {"sponge": factor * scene.surface.sponge}}
        return changed(scene, **longer, **(sponge if scene.surface.sponge > 0.0 else {}))
    before = more if scene.has_surface else 0.5 * more
    period = getattr(scene.bed, "wavelength", None) or getattr(scene.bed, "spacing", None)
    if period is not None:  # the flow enters at the same height of the bed
        before = float(period * np.ceil(before / period))
    origin[0] -= before
    if scene.has_surface:
        # The still level is prescribed at the outflow; friction on a flat bed changes the depth upstream.
        return changed(scene, domain={"length": domain.length + before, "origin": tuple(origin)})
    changes: dict[str, Any] = {"length": domain.length + 2.0 * before}
    across = scene.body is not None and scene.body.shape == "cylinder"  # from side to side
    if domain.width is not None and scene.sides != "wall" and not across:
        changes["width"] = factor * domain.width
        origin[1] -= 0.5 * (factor - 1.0) * domain.width
    # Without a bed the flow is also unbounded below, and a top without shear is no channel surface; a shear flow begins
    # at the bottom.
    endless = scene.bed is None and scene.flow.unbounded
    if scene.top == "stream" or (endless and scene.top == "slip"):
        changes["height"] = factor * domain.height
        if endless:
            origin[up] -= 0.5 * (factor - 1.0) * domain.height
    larger = changed(scene, domain={**changes, "origin": tuple(origin)})
    if scene.fluid.scale == "grain":
        return larger
    # At the same viscosity the Reynolds number refers to a higher domain.
    return changed(
        larger, fluid={"reynolds": scene.fluid.reynolds * larger.viscosity / scene.viscosity}
    )


def coarse(scene: Scene, **sections: dict[str, Any]) -> Scene:
    """The scene of a coarse run for a modelling error."""
    accuracy = scene.numerics.accuracy if scene.numerics.accuracy_includes == "all" else None
    fine = scene.gdim == 2 and isinstance(accuracy, float) and accuracy < 0.005
    numerics: dict[str, Any] = {
        "order": 3 if fine else 2,
        "geometry_order": None,
        "error_bars": False,
        "mesh_size": max(MODEL_MESH if scene.time is None else 2.0, scene.numerics.mesh_size),
    }
    if scene.time is None:
        return changed(scene, numerics=numerics, **sections)
    tolerance = scene.numerics.tolerance
    numerics["tolerance"] = (
        MODEL_ITERATION if tolerance == "auto" else max(MODEL_ITERATION, tolerance)
    )
    if scene.body is not None and not scene.body.moves:
        # Without weight no verdict is computed in steps.
        sections["body"] = {"density": None, "mass": None, "inertia": None}
    time, longer = scene.time, 4.0 if scene.body is not None else 2.0  # steps
    most = min(time.end / FEWEST_STEPS, longest_step(scene))
    steps = {"step": min(longer * time.step, max(time.step, most))}
    if time.tolerance is not None:
        steps["tolerance"] = max(min(8.0 * time.tolerance, 0.1), time.tolerance)
    return changed(scene, numerics=numerics, time=steps, **sections)


def moves_mesh(scene: Scene) -> bool:
    """Whether the mesh of a run is moved to other gaps and domains: in 2-D over a flat bed, unless it is a search's."""
    if scene.time is not None or scene.is_averaged or scene.body is None:
        return False
    flat = isinstance(scene.bed_shape, Flat)
    return scene.gdim == 3 or (flat and scene.numerics.accuracy is None)


def is_coarse(scene: Scene) -> bool:
    """Whether a scene of steady flow is its own first coarse run, which is then omitted."""
    return coarse(scene) == changed(scene, numerics={"error_bars": False, "order": order_of(scene)})


def changed(scene: Scene, **sections: dict[str, Any]) -> Scene:
    """The scene with changed keys by section. Raises SceneError."""
    plain = scene.model_dump()
    following = {"body", "fluid", "flow", "gravity"} | (
        {"domain"} if scene.fluid.scale == "flow" else set()
    )
    if following & sections.keys():
        plain["units"] = None  # their consequences are already in the keys
    for name, keys in sections.items():
        before = plain[name] or {}
        kept = before if keys.get("kind", before.get("kind")) == before.get("kind") else {}
        plain[name] = {**kept, **keys}  # another kind has other keys
    return Scene(**plain)
