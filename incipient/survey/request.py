"""The request of a survey: the bed, the flow past it, which grains, and how many full runs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ..contact.friction import FrictionCone
from ..scene.section import NotNegative, Pair, Positive, PositivePair, Rule, Section, Title, key

_BOTH = 'give both spread and sizes = "uniform" or "lognormal", or neither'


class Deposited(Section):
    """Spheres dropped one by one at random places, which roll until they rest."""

    rules = (
        Rule("spread", lambda s: s.sizes != "equal" and not s.spread, "is needed by unequal sizes", _BOTH),
        Rule("spread", lambda s: s.sizes == "equal" and s.spread, "is read only for unequal sizes", _BOTH),
    )  # fmt: skip

    kind: Literal["deposited"] = key("Source of the grains", "deposited")
    number: int = key("Number of spheres", ge=4, le=100_000)
    length: Positive = key("Period in x [length]")
    width: Positive = key("Period in y [length]")
    diameter: Positive = key("Diameter of the spheres, the median of unequal ones [length]", 1.0)
    sizes: Literal["equal", "uniform", "lognormal"] = key("Distribution of the diameters", "equal")
    spread: NotNegative = key(
        "Uniform: half of the range over the diameter; lognormal: geometric standard deviation less one [-]",
        0.0,
        lt=1,
    )
    tries: int = key(
        "Places tried for each sphere, of which the lowest is taken: more give a more level bed",
        1,
        ge=1,
        le=1000,
    )
    seed: int = key("Seed of positions and diameters", 0, ge=0, le=2**31)


class MeasuredSpheres(Section):
    """Spheres from a table."""

    kind: Literal["spheres"] = key("Source of the grains", "spheres")
    file: str = key("CSV file with a row x, y, z, diameter for each sphere")


class MeasuredEllipsoids(Section):
    """Ellipsoids fitted to a point cloud (G3Point), represented by spheres of equal volume."""

    kind: Literal["ellipsoids"] = key("Source of the grains", "ellipsoids")
    file: str = key(
        "CSV file with columns Xc, Yc, Zc, Dmax, Dmed, Dmin among others, as of G3Point's table"
    )


class LabelledHeights(Section):
    """A height map with labelled grains, represented by spheres of equal area in plan."""

    kind: Literal["labels"] = key("Source of the grains", "labels")
    heights: str = key("PNG, TIFF, .npy or .asc file of heights")
    labels: str = key("PNG, TIFF or .npy file of as many integers: one for each grain, 0 for none")
    cell: PositivePair = key("Spacing of the heights in x and y [length]")
    relief: float = key("Factor on the heights; of images: from black to white [length]", 1.0)
    offset: Pair = key("x, y of the first height [length]", (0.0, 0.0))


BedOfGrains = Deposited | MeasuredSpheres | MeasuredEllipsoids | LabelledHeights


class FlowPast(Section):
    """The flow past the bed, and the resistance of grains."""

    azimuth: float = key("Direction of the flow, from x towards y [degrees]", 0.0)
    galileo: Positive | None = key(
        "Galileo number sqrt((s - 1) g d^3)/nu of the median grain; default: creeping flow [-]",
        None,
    )
    friction: NotNegative = key("Coefficient of static friction [-]", 0.5)
    cohesion: NotNegative = key(
        "Largest pull of each contact over the submerged weight of the median grain [-]", 0.0
    )

    def law(self, size: float, weight: float) -> FrictionCone:
        return FrictionCone.of(self.friction, weight * self.cohesion / size**3)


class Surveyed(Section):
    """Selection of the surveyed grains."""

    visible: NotNegative = key(
        "Fraction of a grain visible from above from which on it counts as exposed [-]", 0.5, le=1
    )
    most: int | None = key("Number of exposed grains, drawn at random; default: all", None, ge=1)
    seed: int = key("Seed of that choice", 0, ge=0, le=2**31)


class Runs(Section):
    """Full runs of the flow past some of the grains."""

    number: int = key("Number of grains with a full run", 0, ge=0)
    mesh_size: Positive = key("Factor on the size of all cells of these runs [-]", 2.2)
    order: int = key("Order of the velocity, 2 or 3", 2, ge=2, le=3)
    gap: Positive = key("Gap that represents contact in the flow [grain sizes]", 0.02, le=0.1)
    meshed_bed: Positive = key(
        "Factor on the radius about the grain within which the bedforms are meshed [-]", 0.6
    )
    domain: Positive = key(
        "Length and width of the domain, twice its height [grain sizes]", 10.0, ge=6
    )
    with_error_bars: int = key(
        "Number of these runs with error estimates, which are applied to all", 2, ge=0
    )
    seed: int = key("Seed of the emulator's draws", 0, ge=0)


class Survey(Section):
    """A survey of a bed of grains."""

    title: Title = key("Title of the survey", "")
    bed: Annotated[BedOfGrains, Field(discriminator="kind")] = key("The grains of the bed")
    flow: FlowPast = key("The flow past the bed", FlowPast())
    grains: Surveyed = key("Selection of the surveyed grains", Surveyed())
    runs: Runs = key("Full runs of the flow past some of the grains", Runs())
