"""Coarse runs for the error bars of a steady flow."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

from ..geometry.plane.beds import Flat
from ..parallel import Comm
from ..results.errorbars import Loads
from ..scene import Scene
from .state import Run

if TYPE_CHECKING:
    from .moved_mesh import MovedMesh

Scenes = Callable[[Scene], list[Scene]]
ByItself = Callable[[Scene, Comm, float], Loads]


def moves_mesh(scene: Scene) -> bool:
    """Whether the mesh of a run is moved to other gaps and domains: in 2-D over a flat bed, unless it is a search's."""
    if scene.time is not None or scene.is_averaged or scene.body is None:
        return False
    flat = scene.bed_shape is None or isinstance(scene.bed_shape, Flat)
    return scene.gdim == 3 or (flat and scene.numerics.accuracy is None)


class Beside:
    """Loads in scenes that differ from a solved run in gap or domain; callable. Collective.

    The moved mesh serves all scenes or none; otherwise each scene has its own run.

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
        if not moves_mesh(self._run.scene):
            return {}
        from .moved_mesh import moved_meshes

        return moved_meshes(self._run, self._coarse(self._run.scene))
