"""Loads of the coarse runs that estimates need: each made once, while there is something left to spend."""

from __future__ import annotations

import re
from collections.abc import Callable

from ..errors import ConvergenceError, IncipientError, MeshError
from ..results.errorbars import Loads
from ..scene import Scene

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
