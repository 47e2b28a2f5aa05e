"""The critical flow on a mesh that is made for the law of the wall of that very flow.

Where the mesh ends, or how large its cells at walls are, goes with the distance of the law, which the flow changes: on
the mesh of a slower flow cells are too large for the thinner layer of a faster one. So a search from rest on the mesh
of the scene's own flow is followed by searches near its result, each on a mesh made for the critical flow before, until
its law's distance is that of its mesh to a tenth. How far the load then is from that on a mesh made for the critical
flow itself is a term of its error: meshes as fine differ by what they scatter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..errors import ConvergenceError
from ..planning.flow_setup import Setup
from ..simulation.build import prepared
from ..simulation.state import Accounts, Run
from .search import Found, OwnMesh, Search

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..progress import Silent
    from ..scene import Scene

CHANGED = 1.1  # ratio of the law's distance to that of the mesh, or its inverse, up to which the mesh serves
MOST_MESHES = 6
OTHER_MESH = "all on the mesh for the scene's own flow, whose cells are too large at the walls of these"

Concluded = TypeVar("Concluded")


def on_its_own_mesh(
    scene: Scene, comm: MPI.Comm, voice: Silent, conclude: Callable[[Run, Search, Found], Concluded]
) -> Concluded:
    """What `conclude` makes of the critical flow, on a mesh made for its law of the wall. Collective.

    Raises:
        ConvergenceError: no such flow was found within a few meshes, or near that of another mesh.
    """
    accounts, speed, known = Accounts(), 1.0, list[Found]()
    while not known or outgrown(scene, speed, known[-1].factor):
        if len(known) == MOST_MESHES:
            raise ConvergenceError(_differing(known))
        speed = known[-1].factor if known else 1.0
        voice.say(f"mesh for the law of the wall of flow x {speed:.4g}")
        with prepared(scene, comm, accounts, voice=voice, speed=speed) as run:
            search = Search(run)
            known.append(_after(known[-1], search) if known else search.from_rest())
            if not known[-1].is_critical:
                return conclude(run, search, _told_of_mesh(scene, known[-1]))
    found = known[-1]
    with prepared(scene, comm, accounts, voice=voice, speed=found.factor) as run:
        search = Search(run)
        try:
            load = search.load_at(found.factor)
        except ConvergenceError as error:
            raise ConvergenceError(
                f"{error}; the critical flow was {found.factor:.4g} times the scene's"
            ) from error
        apart = np.concatenate([load.flow_force, load.flow_couple])
        apart -= np.concatenate([found.load.flow_force, found.load.flow_couple])
        own = OwnMesh(np.abs(apart), search.trials[-1].safety_factor)
        return conclude(run, search, replace(found, own_mesh=own))


def _differing(known: list[Found]) -> str:
    factors = ", ".join(f"{found.factor:.4g}" for found in known)
    return (
        f"the critical flow differs from mesh to mesh, each made for the law of the wall of the one before: it is "
        f"{factors} times the scene's; use a smaller numerics.mesh_size"
    )


def outgrown(scene: Scene, made_for: float, factor: float) -> bool:
    """Whether a mesh made for one flow does not serve for another; both are factors of the scene's. Not collective."""
    one, other = (Setup(scene).faster(each).walls.distance for each in (made_for, factor))
    return max(one / other, other / one) > CHANGED


def _after(before: Found, search: Search) -> Found:
    """The critical flow near that of the mesh before, with the flows solved on all of them. Collective."""
    found = search.near(before)
    return replace(
        found, trials=(*before.trials, *found.trials), unsolved=(*before.unsolved, *found.unsolved)
    )


def _told_of_mesh(scene: Scene, found: Found) -> Found:
    """What there is no critical flow in, with the reason to doubt that where faster flows were solved."""
    fastest = max((trial.factor for trial in found.trials), default=1.0)
    if fastest <= 1.0 or not outgrown(scene, 1.0, fastest):
        return found
    return replace(found, reason=f"{found.reason}; {OTHER_MESH}")
