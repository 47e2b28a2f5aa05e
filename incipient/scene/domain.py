"""The section [domain]."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from ..arrays import Floats
from .section import Choice, Positive, Rule, Section, key

Top = Literal["auto", "wall", "slip", "stream", "free-surface"]
Sides = Literal["slip", "stream", "wall"]
Corner = Annotated[tuple[float, ...], Field(strict=False, min_length=2, max_length=3)]


class Domain(Section):
    """The region that the fluid may fill."""

    rules = (
        Rule("{v}", lambda s: [k for k in ("sides", "symmetric") if s.width is None and getattr(s, k) is not None],
             "needs width, which is not given", "add domain.width or leave it out"),
        Rule("origin", lambda s: len(s.origin) < s.gdim, "has 2 items", "give three, as in [x, y, z]"),
        Rule("origin", lambda s: len(s.origin) > s.gdim, "has 3 items", "give two, as in [x, y]"),
    )  # fmt: skip

    kind: Literal["channel", "box"] = key(
        "Channel: inflow left, open outflow right; box: closed", "channel"
    )
    length: Positive = key("Extent along the flow [length]")
    height: Positive = key("Extent from the lower side to the top [length]")
    width: Positive | None = key(
        "Width of a 3-D scene, with z upwards [length]",
        None,
        examples=[20.0],
    )
    origin: Corner = key(
        "Lower left corner [length]; the bed's base line runs through it",
        (0.0, 0.0),
        validate_default=True,
    )
    top: Top = key(
        "Top; auto: from flow.kind; stream: moves with the base flow; free-surface: see [surface]",
        "auto",
    )
    sides: Sides | None = key(
        "Lateral boundaries; stream: move with the base flow; default: slip, of a box wall",
        None,
        examples=["slip"],
    )
    symmetric: Choice | None = key(
        "In 3-D: true computes half of a symmetric scene; default: if it is symmetric",
        None,
        examples=["auto"],
    )

    @field_validator("origin")
    @classmethod
    def _in_space(cls, value: tuple[float, ...], info: ValidationInfo) -> tuple[float, ...]:
        return (*value, 0.0) if info.data.get("width") and value == (0.0, 0.0) else value

    @property
    def gdim(self) -> int:
        return 2 if self.width is None else 3

    @property
    def up(self) -> int:
        return self.gdim - 1

    @property
    def spans(self) -> tuple[tuple[float, float], ...]:
        along = (self.left, self.right)
        return (along,) if self.width is None else (along, self.across)

    @property
    def left(self) -> float:
        return self.origin[0]

    @property
    def right(self) -> float:
        return self.origin[0] + self.length

    @property
    def bottom(self) -> float:
        return self.origin[-1]

    @property
    def ceiling(self) -> float:
        return self.origin[-1] + self.height

    @property
    def across(self) -> tuple[float, float]:
        assert self.width is not None
        return self.origin[1], self.origin[1] + self.width

    def grid(self, *counts: int) -> Floats:
        """Equidistant points (n, k) of the whole domain, with k counts along the flow, across and in height."""
        sides = (*self.spans, (self.bottom, self.ceiling))
        axes = [np.linspace(*ends, count) for ends, count in zip(sides, counts, strict=False)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))

    @property
    def middle(self) -> float:
        return 0.5 * sum(self.across)

    @property
    def entrance(self) -> tuple[float, ...]:
        return (self.left, *((self.middle,) if self.width is not None else ()), self.bottom)

    @property
    def sizes(self) -> dict[str, float]:
        """Extents by key, in the order of the coordinates."""
        across = {} if self.width is None else {"width": self.width}
        return {"length": self.length, **across, "height": self.height}

    @property
    def extents(self) -> tuple[float, ...]:
        return (*self.sizes.values(),)
