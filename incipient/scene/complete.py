"""A complete scene: its sections, free of contradictions between them."""

from __future__ import annotations

from functools import cached_property, partial
from typing import Any

from pydantic import ValidationInfo, model_validator

from ..errors import SceneError
from .checks import contradictions
from .datum import height_of_datum
from .messages import Problem, refusal, split
from .model import SceneSections
from .order import order_of
from .scaling import scales_of, with_units
from .symmetry import is_halved
from .units import Scales


class Scene(SceneSections):
    """A complete scene.

    Raises:
        SceneError: one line that names the key, why and the remedy.
    """

    @model_validator(mode="before")
    @classmethod
    def _in_units(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict) or data.get("units") is None:
            return data
        return with_units(data, partial(cls.model_validate, context=info.context))

    @model_validator(mode="after")
    def _free_of_contradictions(self) -> Scene:
        found = contradictions(self) or self._asymmetry()
        if found:
            raise refusal("Scene", found, between=True)
        return self

    @property
    def order(self) -> int:
        """Order of the velocity: what the scene says, or for "auto" what measurements recommend."""
        return order_of(self).number

    @cached_property
    def symmetric(self) -> bool:
        """Whether half of the scene is computed: what lies at one side of the middle of a domain in space.

        Raises SceneError if the scene is said to be its own mirror image and is not.
        """
        return is_halved(self)

    @cached_property
    def datum(self) -> float:
        """The height y at which the profile of the undisturbed flow starts; the same over the whole bed."""
        return height_of_datum(self)

    @property
    def scales(self) -> Scales | None:
        """What the scene's units are in SI; None where it does not say."""
        return None if self.units is None else scales_of(self, self.units)

    def _asymmetry(self) -> list[Problem]:
        """Why a scene that is said to be its own mirror image is not."""
        try:
            self.symmetric  # noqa: B018 - asked for what it raises
        except SceneError as error:
            why, remedy = split(str(error))
            return [Problem(("domain", "symmetric"), why.removeprefix("domain.symmetric: "), remedy)]
        return []
