"""Turbulent channels that tests share."""

from incipient.scene import (
    Disc,
    Domain,
    Effects,
    Flat,
    Fluid,
    OpenChannel,
    Scene,
)

CHANNEL = {
    "domain": Domain(length=20, height=1),
    "fluid": Fluid(reynolds=11000, scale="flow"),
    "flow": OpenChannel(),
    "effects": Effects(turbulence=True),
}


def channel(**changes):
    return Scene(**{**CHANNEL, **changes})


def grain(diameter, reynolds=2e5):
    return channel(
        fluid=Fluid(reynolds=reynolds, scale="flow"), body=Disc(diameter=diameter, x=4), bed=Flat()
    )
