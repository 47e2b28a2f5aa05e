"""A grain on a bed in shear, to be changed, and what a wrong scene is told."""

import pytest

from incipient.errors import SceneError
from incipient.scene import (
    Disc,
    Domain,
    Flat,
    Fluid,
    Scene,
    Shear,
)

FLOW_SCALE = Fluid(reynolds=100, scale="flow")
GRAIN_SCALE = Fluid(reynolds=20, scale="grain")
CHANNEL = Domain(length=12, height=6)
BOX = Domain(kind="box", length=1, height=1)
DISC = Disc(diameter=1, x=4)
GRAIN_ON_BED = {"domain": CHANNEL, "fluid": GRAIN_SCALE, "flow": Shear(), "body": DISC, "bed": Flat()}


def scene(**changes):
    return Scene(**{**GRAIN_ON_BED, **changes})


def message(build) -> str:
    with pytest.raises(SceneError) as caught:
        build()
    text = str(caught.value)
    assert "\n" not in text
    return text
