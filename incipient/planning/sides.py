"""The names of the sides of a scene's domain, by which mesh, conditions and results speak of them."""

from dataclasses import dataclass

from ..scene import Domain


@dataclass(frozen=True)
class SideNames:
    """Names of the sides of a domain.

    bottom, top: of the lower side, "bed" where there is one, and of the upper one
    left, right: of the ends of the base flow
    across:      in space, of the sides at least and largest y; of half a domain only the latter
    """

    bottom: str
    right: str
    top: str
    left: str
    across: tuple[str, ...] = ()

    @property
    def around(self) -> tuple[str, str, str, str]:
        """Names of bottom, right, top and left, counterclockwise."""
        return self.bottom, self.right, self.top, self.left


def side_names(domain: Domain, has_bed: bool, symmetric: bool) -> SideNames:
    """Names of the sides of a domain, of which half is meshed if it is `symmetric`. Not collective."""
    in_space = domain.width is not None
    right, left = ("downstream", "upstream") if in_space else ("right", "left")
    if domain.kind == "channel":
        right, left = "outflow", "inflow"
    across = () if not in_space else ("left",) if symmetric else ("right", "left")
    return SideNames("bed" if has_bed else "bottom", right, "top", left, across)
