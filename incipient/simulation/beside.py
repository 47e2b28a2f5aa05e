"""Coarse runs for the error bars of a steady flow."""

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
    """Loads in scenes that differ from a solved run in gap or domain; callable. Collective.

    In 3-D the moved mesh serves all scenes or none; otherwise each scene has its own run.

    Args:
        run: solved; each call restores its mesh.
        by_itself: runs a scene on its own mesh, at a speed.
        speed: of the flow relative to the scene's.
    """

    def __init__(self, run: Run, coarse: Scenes, by_itself: ByItself, speed: float = 1.0):
        self._run, self._coarse, self._by_itself, self._speed = run, coarse, by_itself, speed

    def serves(self, key: str) -> bool:
        return key in self._meshes

    def __call__(self, scene: Scene) -> Loads:
        moved = self._meshes.get(scene.model_dump_json())
        if moved is None:
            return self._by_itself(scene, self._run.comm, self._speed)
        return moved.loads(self._speed)

    @cached_property
    def _meshes(self) -> dict[str, MovedMesh]:
        run = self._run
        steady_in_space = run.scene.gdim == 3 and run.scene.time is None
        if not steady_in_space or run.setup.is_averaged or run.layout.placement is None:
            return {}
        from .moved_mesh import moved_meshes

        return moved_meshes(run, self._coarse(run.scene))


class InTurn:
    """Loads of coarse runs in sequence; a context manager, callable. Collective.

    In steady 3-D flow the first scene is meshed, and its mesh moved for the others. `prepare` creates its run.
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
        # The exception keeps the collective destruction of the fluid from hanging after an error on one rank.
        self._open.__exit__(*exception)

    def __call__(self, scene: Scene) -> Loads:
        if scene.gdim != 3 or scene.time is not None or scene.is_averaged or scene.body is None:
            return self._by_itself(scene, self._comm, 1.0)
        key = scene.model_dump_json()
        if self._beside is None or not self._beside.serves(key):
            self._run = self._beside = None  # even if the next run fails
            self._open.close()
            run = self._open.enter_context(self._prepare(scene))
            force, torque = loads_at(run, 1.0)
            self._run, self._beside = run, Beside(run, self._coarse, self._by_itself)
            if not self._beside.serves(key):  # all other scenes have their own meshes
                return Loads(force.flow, torque.flow)
        return self._beside(scene)

    def handed_over(self, wanted: Scene) -> tuple[Run, ExitStack] | None:
        """The solved run of a scene and its exit stack, if it was meshed last."""
        if self._run is None or self._run.scene != wanted:
            return None
        run, self._run, self._beside = self._run, None, None
        return run, self._open.pop_all()
