"""Parquet files, with an optional library."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from .errors import MissingError


def pyarrow(extra: str = "parquet") -> Any:
    """The library pyarrow with its module `parquet`. Raises MissingError with the extra to install."""
    try:
        import_module("pyarrow.parquet")
        return import_module("pyarrow")
    except ImportError as error:
        raise MissingError(
            f"pyarrow cannot be used ({error}): pip install 'incipient[{extra}]'"
        ) from None
