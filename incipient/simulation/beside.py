"""Coarse runs for the error bars of a steady flow: in parallel with the run, on its mesh where that serves."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

from ..parallel import Comm
from ..results.errorbars import Loads
from ..scene import Scene
from .state import Run

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
