"""Kinds of grains and beds from outside the package, which scenes may have once they are registered."""

from typing import Annotated, Union

from pydantic import Field

from ..errors import SceneError
from .complete import Scene
from .messages import discriminator, tag, variants
from .section import Section


def register(section: type[Section]) -> None:
    """Lets scenes have another kind of grain or bed, as if it stood in `kinds` (docs/contribute/adding.md).

    Raises SceneError if its `shape` (of a grain) or `kind` (of a bed) does not have one value, or another section has
    it.
    """
    name = discriminator(section)
    field = Scene.model_fields["body" if name == "shape" else "bed"]
    known = variants(field.annotation)
    if name is None or tag(section) in map(tag, known):
        why = (
            f'{name} = "{tag(section)}" is used by another section'
            if name
            else "shape or kind is missing"
        )
        raise SceneError(f'{section.__name__}: {why}; give a key as in shape: Literal["stadium"]')
    field.annotation = Annotated[Union[(*known, section)], Field(discriminator=name)] | None  # type: ignore
    Scene.model_rebuild(force=True)
