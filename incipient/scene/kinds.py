"""All grains and all beds that a scene, or a case, may have, in 2-D and in 3-D."""

from typing import Annotated

from pydantic import Field

from .shapes import PlaneBed, PlaneBody
from .solids import SolidBody
from .terrains import TerrainBed

Body = Annotated[PlaneBody | SolidBody, Field(discriminator="shape")]
Bed = Annotated[PlaneBed | TerrainBed, Field(discriminator="kind")]
