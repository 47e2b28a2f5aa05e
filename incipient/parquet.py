"""Parquet files, which take an optional library."""

from __future__ import annotations

from collections.abc import Collection
from importlib import import_module
from pathlib import Path
from typing import Any

from .errors import MissingError, SceneError, shortened
from .input_files import reading


def pyarrow(extra: str = "parquet") -> Any:
    """The library pyarrow with its module `parquet`; raises MissingError, which names the extra that brings it."""
    try:
        import_module("pyarrow.parquet")
        return import_module("pyarrow")
    except ImportError as error:
        raise MissingError(
            f"pyarrow cannot be used ({error}): pip install 'incipient[{extra}]'"
        ) from None


def file_of_numbers(path: Path, besides: Collection[str] = ()) -> Any:
    """A ParquetFile whose columns are numbers, except those of the names `besides`.

    Raises:
        SceneError: it cannot be read, or a column has another type: times and truth values are not converted, as
            their units are not known here.
        MissingError: pyarrow is not installed.
    """
    arrow = pyarrow()
    with reading(path, "give a Parquet file of numbers"):
        file = arrow.parquet.ParquetFile(path)
        kinds = arrow.types
        for column in file.schema_arrow:
            of_numbers = (kinds.is_integer, kinds.is_floating, kinds.is_decimal, kinds.is_null)
            if column.name not in besides and not any(known(column.type) for known in of_numbers):
                what = f"column {shortened(column.name)} is of type {shortened(column.type)}"
                raise SceneError(f"{path}: {what}; save it as floating-point numbers")
    return file
