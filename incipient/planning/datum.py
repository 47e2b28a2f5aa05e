"""The datum of the base flow: the height at which its profile starts, and why there."""

from dataclasses import dataclass

from .flow_setup import Setup


@dataclass(frozen=True)
class Datum:
    """The height at which the profile of a scene's flow starts, the same over the whole bed."""

    height: float  # y, in 3-D z, in the scene [length]
    reason: str  # what the height is of the bed, in words

    def text(self, axis: str) -> str:
        """One line of the plan; `axis` is the name of the coordinate that counts heights."""
        return f"datum {axis} = {self.height:g}: {self.reason}"


def datum_of(setup: Setup) -> Datum | None:
    """The datum of a flow of given profile over a bed; None for another flow, or without a bed. Not collective.

    A flow with wall layers enters at the bed's own height.
    """
    scene = setup.scene
    level = getattr(scene.flow, "datum", None)
    if level is None or scene.bed is None or scene.is_averaged:
        return None
    why = f"{_words(setup, level)}; the {scene.flow.kind} flow starts there"
    return Datum(setup.base_flow.datum, why)


def _words(setup: Setup, level: float | str) -> str:
    bed, scene = setup.geometry.bed, setup.scene
    assert bed is not None
    if setup.base_flow.effective:
        height = setup.base_flow.effective_height
        by_inertia = height.height - height.creeping
        share = f", of it {by_inertia:.2g} by inertia" if by_inertia > 0.0 else ""
        return f"the effective height of the bed, computed from its shape{share}"
    if level == "mean":
        return "the mean height of the bed"
    if not isinstance(level, str):
        return f"flow.datum = {level:g}"
    if bed.crest > setup.base_flow.datum:
        return (
            "the crests of the bed, which are as high in every third of the domain; "
            f"what is higher, up to {'xyz'[scene.up]} = {bed.crest:g}, does not count"
        )
    return "the crest of the bed"
