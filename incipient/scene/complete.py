"""A complete scene: its sections, free of contradictions between them."""

from __future__ import annotations

from functools import partial
from typing import Any

from pydantic import ValidationInfo, model_validator

from .messages import refusal
from .model import SceneSections
from .places import misplaced
from .rules import contradictions
from .scaling import scales_of, with_units
from .units import Scales


class Scene(SceneSections):
    """A complete scene. Raises SceneError, one line that names the key, why and the remedy."""

    @model_validator(mode="before")
    @classmethod
    def _in_units(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict) or data.get("units") is None:
            return data
        return with_units(data, partial(cls.model_validate, context=info.context))

    @model_validator(mode="after")
    def _free_of_contradictions(self) -> Scene:
        found = [*contradictions(self)] or misplaced(self)
        if found:
            raise refusal("Scene", found, between=True)
        return self

    @property
    def scales(self) -> Scales | None:
        """What the scene's units are in SI; None where it does not say."""
        return None if self.units is None else scales_of(self, self.units)
