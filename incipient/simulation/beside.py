"""Coarse runs for the error bars of a steady flow: in parallel with the run, on its mesh where that serves."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from ..parallel import Comm
from ..results.errorbars import Loads
from ..scene import Scene
from .build import prepared
from .state import Run
from .steady import loads_at

if TYPE_CHECKING:
    from .moved_mesh import MovedMesh

Scenes = Callable[[Scene], list[Scene]]
ByItself = Callable[[Scene, Comm, float], Loads]


class Beside:
    """Loads in scenes that differ from that of a solved run by their gap or domain; callable. Collective.

    In 3-D one mesh, moved, serves for all of them, or for none: new ones would differ by their errors as well, and
    take most of the time. Where it does not serve each scene is run by itself.

    Args:
        run: solved; its mesh is as it was whenever a call ends.
        coarse: the scenes of the coarse runs of a scene.
        by_itself: runs a scene on a mesh of its own, at a speed.
        speed: of the flow whose loads are asked for, over the scene's.
    """

    def __init__(self, run: Run, coarse: Scenes, by_itself: ByItself, speed: float = 1.0):
        self._run, self._coarse, self._by_itself, self._speed = run, coarse, by_itself, speed

    def serves(self, key: str) -> bool:
        """Whether the run's mesh, moved, serves for a scene, given by its JSON. Collective."""
        return key in self._meshes

    def __call__(self, scene: Scene) -> Loads:
        """Force and torque in a scene. Collective."""
        moved = self._meshes.get(scene.model_dump_json())
        if moved is None:
            return self._by_itself(scene, self._run.comm, self._speed)
        return moved.loads(self._speed)

    @cached_property
    def _meshes(self) -> dict[str, MovedMesh]:
        """The mesh moved to every scene of a coarse run, by its JSON; none if it does not serve for one."""
        run = self._run
        steady_in_space = run.scene.gdim == 3 and run.scene.time is None
        if not steady_in_space or run.setup.is_averaged or run.layout.placement is None:
            return {}
        from .moved_mesh import moved_meshes

        return moved_meshes(run, self._coarse(run.scene))


class InTurn:
    """Loads of coarse runs of one scene after the other, without a parallel run; a context, callable. Collective.

    In steady 3-D flow the first of those that differ by gap or domain alone has a mesh, which moves for the rest.
    `by_itself` runs a scene on a mesh of its own, at a speed; `prepare` gives the run of a scene that has a mesh, None:
    as the scene says.
    """

    def __init__(
        self,
        comm: Comm,
        coarse: Scenes,
        by_itself: ByItself,
        prepare: Callable[[Scene], AbstractContextManager[Run]] | None = None,
    ):
        self._comm, self._coarse, self._by_itself = comm, coarse, by_itself
        self._prepare = prepare or partial(prepared, comm=comm)
        self._open = ExitStack()
        self._beside: Beside | None = None
        self._run: Run | None = None

    def __enter__(self) -> InTurn:
        return self

    def __exit__(self, *exception: Any) -> None:
        # The fluid has to see the exception: to free it is collective, and after a defect of one rank hangs the others.
        self._open.__exit__(*exception)

    def __call__(self, scene: Scene) -> Loads:
        """Force and torque in a scene. Collective."""
        if scene.gdim != 3 or scene.time is not None or scene.is_averaged or scene.body is None:
            return self._by_itself(scene, self._comm, 1.0)
        key = scene.model_dump_json()
        if self._beside is None or not self._beside.serves(key):
            self._run = self._beside = None  # also if the next run fails
            self._open.close()
            run = self._open.enter_context(self._prepare(scene))
            force, torque = loads_at(run, 1.0)
            self._run, self._beside = run, Beside(run, self._coarse, self._by_itself)
            if not self._beside.serves(key):  # nor for others, each of which has a mesh of its own
                return Loads(force.flow, torque.flow)
        return self._beside(scene)

    def handed_over(self, wanted: Scene) -> tuple[Run, ExitStack] | None:
        """The solved run of a scene and what frees it, if it is the last that had a mesh. Not collective."""
        if self._run is None or self._run.scene != wanted:
            return None
        run, self._run, self._beside = self._run, None, None
        return run, self._open.pop_all()
