"""Scenes: what a user asks for, checked and complete. Built from these classes, or read by `incipient.scene.file`."""

from .file import dumps, example, load, loads, save, schema
from .model import *  # noqa: F403
from .model import __all__ as _models

__all__ = [*_models, "dumps", "example", "load", "loads", "save", "schema"]
