"""The names of the sides of a scene's domain, by which mesh, conditions and results speak of them."""

from dataclasses import dataclass

from ..meshes import SYMMETRY
from ..scene import Domain


@dataclass(frozen=True)
class SideNames:
    """Names of the sides of a domain."""

    bottom: str  # "bed" where there is one
    right: str  # like `left` an end of the base flow
    top: str
    left: str
    across: tuple[str, ...] = ()  # in 3-D, at least and largest y; of half a domain only the latter

    @property
    def around(self) -> tuple[str, str, str, str]:
        """Names of bottom, right, top and left, counterclockwise."""
        return self.bottom, self.right, self.top, self.left

    @property
    def of_rectangle(self) -> tuple[str, ...]:
        """Names at the least and the largest x and height."""
        return self.left, self.right, self.bottom, self.top

    def of_box(self, half: bool) -> tuple[str, ...]:
        """Names at the least and the largest x, y and z; of half a domain y begins at the plane of symmetry."""
        return self.left, self.right, SYMMETRY if half else "right", "left", self.bottom, self.top


def side_names(domain: Domain, has_bed: bool, symmetric: bool) -> SideNames:
    """Names of the sides of a domain, of which half is meshed if it is `symmetric`. Not collective."""
    in_space = domain.width is not None
    right, left = ("downstream", "upstream") if in_space else ("right", "left")
    if domain.kind == "channel":
        right, left = "outflow", "inflow"
    across = () if not in_space else ("left",) if symmetric else ("right", "left")
    return SideNames("bed" if has_bed else "bottom", right, "top", left, across)
