"""Domains whose far sides are farther away, and channels with a free surface whose ends are."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scene import Scene, Surface
from ..scene.expression import Expression


def longer_channel(scene: Scene, factor: float) -> dict[str, dict[str, Any]]:
    """What is other in a channel with a free surface that is `factor` times as long. Not collective.

    Where the inflow changes in time the right end moves away, and its sponge becomes longer: waves are to come in at
    the same place. Else the inflow moves away, by whole periods of the bed: where a stream has the still level is given
    by the scene, and on a level bed friction makes its depth another one upstream of another place.
    """
    surface, domain = scene.surface or Surface(), scene.domain
    more = (factor - 1.0) * domain.length
    if surface.wave is not None or "t" in Expression(surface.inflow).variables:
        sponge = {"surface": {"sponge": factor * surface.sponge}} if surface.sponge > 0.0 else {}
        return {"domain": {"length": domain.length + more}, **sponge}
    period = getattr(scene.bed, "wavelength", None) or getattr(scene.bed, "spacing", None)
    before = more if period is None else float(period * np.ceil(more / period))
    origin = (domain.origin[0] - before, *domain.origin[1:])
    return {"domain": {"length": domain.length + before, "origin": origin}}


def has_free_lower_side(scene: Scene) -> bool:
    """Whether the flow is endless downwards, too. Shear is not, it begins there. Not collective."""
    return scene.bed is None and scene.top == "stream" and scene.flow.kind in ("uniform", "expression")
