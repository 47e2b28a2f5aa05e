"""The Reynolds number above which a flow computed as laminar may be turbulent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..setup.setup import Setup

# From about this Reynolds number on the turbulence of a channel sustains itself. Between walls, of mean
# velocity and height: 4/3 of 965, of half the height and the greatest velocity (Gomé, Tuckerman & Barkley
# 2020, Phys. Rev. Fluids 5, 083905; experiments: about 1000, Orszag & Kells 1980, J. Fluid Mech. 96, 159). In
# shear, of the velocity on top and the height: 4 times 324, of half of each (Duguet, Schlatter & Henningson
# 2010, J. Fluid Mech. 650, 119).
TURBULENT = 1300.0
# The boundary layer of a uniform flow on a smooth plate, of the flow's velocity and the length of the plate
# (Schlichting & Gersten 2017, Boundary-Layer Theory, section 15.1: 3.5e5 to 1e6, by the disturbances in the flow).
TURBULENT_LAYER = 5e5
# Stokes' boundary layer over a smooth bed, of its thickness and the largest velocity: bursts at each reversal from here
# on (in pipes: Hino, Sawamoto & Takasu 1976, J. Fluid Mech. 75, 193).
TURBULENT_STOKES_LAYER = 550.0
REMEDY = (
    "in a channel without a grain, or with one of u* d/nu above 300, set effects.turbulence = true, "
    'else take a mean profile, flow.kind = "log-law"'
)


@dataclass(frozen=True)
class Transition:
    """A Reynolds number above that of turbulence.

    number: its name; value: the number; least: critical value; where: in what flows
    """

    number: str
    value: float
    least: float
    where: str

    def text(self, place: str = "") -> str:
        return f"{self.number} {self.value:.4g}{place}: {self.where} may be turbulent from {self.least:g} on"


def transition(setup: Setup, faster: float = 1.0) -> Transition | None:
    """The Reynolds number at which a scene's flow, faster by a factor, may be turbulent, or None.

    A top that moves with the flow represents endless flow, whose depth is not the height of the domain; a uniform flow
    over a bed still has a boundary layer. The mean profile of a turbulent flow does not apply.
    """
    scene = setup.scene
    domain, kind = scene.domain, scene.flow.kind
    if domain.kind != "channel" or kind == "log-law" or scene.is_averaged:
        return None
    along = faster * scene.reference_velocity * domain.length / scene.viscosity
    if kind == "uniform" and scene.bed is not None and along > TURBULENT_LAYER:
        return Transition("Re of the length", along, TURBULENT_LAYER, "boundary layers")
    if scene.flow.oscillates:
        of_layer = faster * scene.flow.numbers(1.0, scene.viscosity)["Re_delta"]
        if of_layer > TURBULENT_STOKES_LAYER:
            return Transition("Re_delta", of_layer, TURBULENT_STOKES_LAYER, "Stokes layers")
    reynolds, least = faster * setup.numbers.flow_reynolds, turbulent_from(scene.flow)
    if scene.top == "stream" or reynolds <= least:
        return None
    return Transition("flow Re", reynolds, least, "channels")


def turbulent_from(flow: Any) -> float:
    """Flow Reynolds number above which a channel may be turbulent; an open channel is half a closed one."""
    return 0.5 * TURBULENT if flow.wall_below else TURBULENT
