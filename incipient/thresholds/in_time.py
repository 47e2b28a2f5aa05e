"""The loads of an oscillating flow at the instant of its last period in which a grain is least safe."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Floats, spatial
from ..contact.safety import safety_factor
from ..errors import SceneError
from ..results.contact_verdict import load_of
from ..results.loads import Forces, Torques, named, named_torque
from ..scene import Scene
from ..simulation.loads import weights
from ..simulation.recorder import History
from ..simulation.simulate import solved
from ..simulation.state import Run

FEWEST_PERIODS = 3  # the first holds the transient of the start
PERIODIC = 0.05  # largest change of the loads from period to period, of the largest load


def largest_demand(run: Run, factor: float, start: float = 0.0) -> tuple[Forces, Torques]:
    """Loads in the scene's flow multiplied by a factor, when they demand most of the contacts. Collective.

    `start` is used by steady flows only. Raises SceneError if the flow does not become periodic.
    """
    scene, history = _faster(run.scene, factor), History()
    with solved(scene, run.comm, history, accounts=run.accounts):
        pass
    assert scene.placement is not None and scene.contact is not None and run.contacts is not None
    times = np.array([row["time"] for row in history.rows])
    forces, torques = _vectors(history.rows, scene.gdim)
    change = _change(times, np.hstack([forces, scene.grain.size * torques]), scene.flow.cycle)
    if change > PERIODIC:
        why = f"the loads of the last two periods differ by {change:.0%}"
        raise SceneError(f"time.end: {why}; use a later one")
    run.voice.say(f"flow x {factor:.6g}: the last two periods differ by {change:.1e}")
    last = np.flatnonzero(times > times[-1] - (1.0 - 1e-9) * scene.flow.cycle)
    (buoyancy, weight), centre = weights(scene), spatial(scene.placement.centre)
    loads = [
        (Forces(force, force, buoyancy, weight), Torques(torque, torque, centre))
        for force, torque in zip(forces[last], torques[last], strict=True)
    ]
    holds = run.contacts, scene.contact.law
    return min(loads, key=lambda one: safety_factor(load_of(scene.placement, *one), *holds).value)


def _faster(scene: Scene, factor: float) -> Scene:
    plain = scene.model_dump() | {"units": None}
    plain["flow"]["velocity"] *= factor
    plain["fluid"]["reynolds"] *= factor
    return Scene(**plain)


def _vectors(rows: list[dict[str, Any]], gdim: int) -> tuple[Floats, Floats]:
    parts = []
    for name, names in (("force", named), ("torque", named_torque)):
        columns = names(name, np.zeros(3), gdim)
        values = np.array([[row[column] for column in columns] for row in rows])
        whole = np.zeros((len(rows), 3))
        whole[:, [2] if values.shape[1] == 1 else slice(values.shape[1])] = values
        parts.append(whole)
    return parts[0], parts[1]


def _change(times: Floats, loads: Floats, period: float) -> float:
    last = times > times[-1] - period
    before = np.column_stack([np.interp(times[last] - period, times, one) for one in loads.T])
    return float(np.abs(loads[last] - before).max() / (np.abs(loads[last]).max() or 1.0))
