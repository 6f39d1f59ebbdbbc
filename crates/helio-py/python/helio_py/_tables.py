"""Tables of every kind: pandas, polars, pyarrow and whatever else hands out an Arrow stream, dicts of columns, paths.

Inside, a table is a list of columns, each a tuple ``(name, holds, cells)``: ``holds`` is "text" (a list of str or
None), "numbers" (float64, NaN where there is none), "whole" or "times" (int64, nanoseconds of Unix time; the least
number where there is none).
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from helio_py._checked import of, path
from helio_py._errors import DataTypeError, HelioError, OptionError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import NDArray

Column = tuple[str, str, Any]

#: What stands for a whole number or a time that is not there.
ABSENT = -(2**63)


def kind_of(value: Any) -> str:
    """The kind of table that goes back where this one was given: "pandas", "polars", "pyarrow" or "dict"."""
    package = type(value).__module__.partition(".")[0]
    return package if package in ("pandas", "polars", "pyarrow") else "dict"


def taken(value: Any, what: str) -> Any:
    """A path as text, the capsule of an Arrow stream, or a list of columns."""
    if isinstance(value, (str, os.PathLike)):
        return path(what, value)
    if isinstance(value, dict):
        return [_column(name, cells, what) for name, cells in _of_one_length(value, what).items()]
    if hasattr(value, "_table_columns"):  # of this package
        return value._table_columns
    if hasattr(value, "__arrow_c_stream__"):
        try:
            return _with_typed_columns(value).__arrow_c_stream__()
        except ImportError:  # pandas without pyarrow
            return taken({str(name): value[name] for name in value.columns}, what)
        except HelioError:
            raise
        except Exception as cause:  # two columns of one name, cells of several kinds: pandas and Arrow say it their way
            reason = f"{what}: {type(value).__name__} hands out no Arrow table: {cause}"
            raise of(DataTypeError(reason), what) from cause
    error = DataTypeError(
        f"{what}: expected a table (pandas, polars, pyarrow, a dict of columns or a path), got {type(value).__name__}"
    )
    error.field = what
    raise error


def _with_typed_columns(value: Any) -> Any:
    """Columns of polars that hold nothing at all, made text: as they are its stream is not one that others read."""
    if kind_of(value) != "polars" or not hasattr(value, "schema"):
        return value
    library = importlib.import_module("polars")
    empty = [name for name, holds in value.schema.items() if holds == library.Null]
    return value.with_columns(library.col(empty).cast(library.String)) if empty else value


def _of_one_length(columns: dict[Any, Any], what: str) -> dict[str, Any]:
    lengths = {}
    for name, cells in columns.items():
        if not isinstance(name, str):
            raise DataTypeError(f"{what}: names of columns are str, got {type(name).__name__}")
        if isinstance(cells, (str, bytes)) or not hasattr(cells, "__len__"):
            error = DataTypeError(f"{what}: column {name}: expected an array or a list, got {type(cells).__name__}")
            error.field = name
            raise error
        lengths[name] = len(cells)
    if len(set(lengths.values())) > 1:
        first, *others = lengths
        other = next(name for name in others if lengths[name] != lengths[first])
        error_ = ShapeError(
            f"{what}: column {other}: expected {lengths[first]} rows as column {first} has, got {lengths[other]}"
        )
        error_.field = other
        raise error_
    return columns


def _column(name: str, cells: Any, what: str) -> Column:
    array = np.asarray(cells)
    refused = DataTypeError(f"{what}: column {name}: expected text, numbers or times, got dtype {array.dtype}")
    refused.field = name
    if array.ndim != 1:
        error = ShapeError(f"{what}: column {name}: expected shape (n,), got {array.shape}")
        error.field = name
        raise error
    kind = array.dtype.kind
    if isinstance(cells, np.ma.MaskedArray):
        pairs = zip(np.ma.getmaskarray(cells), array, strict=True)
        return _objects(name, [None if masked else cell for masked, cell in pairs], refused, what)
    if kind == "f":
        return name, "numbers", np.ascontiguousarray(array, dtype=np.float64)
    if kind in "iu":
        if kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
            raise of(OptionError(f"{what}: column {name}: {array.max()} is beyond 2^63"), name)
        return name, "whole", np.ascontiguousarray(array, dtype=np.int64)
    if kind == "M":
        return name, "times", _times(array, name, what)
    if kind in "UT":
        return name, "text", array.tolist()
    if kind != "O":
        raise refused
    return _objects(name, cells, refused, what)


def _objects(name: str, cells: Any, refused: DataTypeError, what: str) -> Column:
    """Of Python's own objects, those that are not there being None or NaN."""
    there = [None if cell is None or cell != cell else cell for cell in cells]  # NaN, NaT
    some = [cell for cell in there if cell is not None]
    if all(isinstance(cell, str) for cell in some):
        return name, "text", there
    if all(isinstance(cell, (int, float, np.number)) for cell in some):
        return name, "numbers", np.array([np.nan if cell is None else float(cell) for cell in there])
    if all(hasattr(cell, "utcoffset") or isinstance(cell, np.datetime64) for cell in some):
        times = np.full(len(there), ABSENT, dtype=np.int64)
        rows = [row for row, cell in enumerate(there) if cell is not None]
        times[rows] = _times(some, name, what)
        return name, "times", times
    raise refused


def _times(cells: Any, name: str, what: str) -> NDArray[np.int64]:
    from helio_py._times import unix_ns  # which brings more of NumPy with it than most calls want

    try:
        if isinstance(cells, np.ndarray) and cells.dtype.kind == "M":
            absent = np.isnat(cells)
            times = unix_ns(np.where(absent, np.datetime64(0, "s"), cells))
            return np.where(absent, ABSENT, times)
        return unix_ns(cells)
    except HelioError as error:
        error.args = (f"{what}: column {name}: {error}",)
        error.field = name
        raise


def checked_kind(kind: Any) -> str:
    """A kind of table that somebody asks for by name."""
    kinds = ("dict", "pandas", "polars", "pyarrow")
    if not isinstance(kind, str) or kind not in kinds:
        error = OptionError(f"kind: wanted {', '.join(kinds[:-1])} or {kinds[-1]}, got `{kind}`")
        error.field = "kind"
        raise error
    return kind


def given_back(columns: list[Column], kind: str) -> Any:
    """A table of a kind."""
    if kind == "dict":
        return {name: _numpy(holds, cells) for name, holds, cells in columns}
    library = importlib.import_module(kind)
    if kind == "pandas":
        return library.DataFrame({name: _pandas(library, holds, cells) for name, holds, cells in columns})
    table = {name: _arrow_like(library, kind, holds, cells) for name, holds, cells in columns}
    return library.table(table) if kind == "pyarrow" else library.DataFrame(table)


def _numpy(holds: str, cells: Any) -> NDArray[Any]:
    if holds == "text":
        return np.array(["" if cell is None else cell for cell in cells], dtype=str)
    if holds == "whole" and (cells == ABSENT).any():
        return np.where(cells == ABSENT, np.nan, cells.astype(np.float64))
    if holds == "times":
        return cells.view("datetime64[ns]").copy()
    return cells.copy()


def _listed(holds: str, cells: Any) -> list[Any]:
    if holds == "text":
        return [cell or None for cell in cells]
    if holds == "numbers":
        return [cell if cell == cell else None for cell in cells.tolist()]
    return [None if cell == ABSENT else cell for cell in cells.tolist()]


def _pandas(pandas: Any, holds: str, cells: Any) -> Any:
    if holds == "text":
        return pandas.Series(_listed(holds, cells), dtype="object" if not cells else None)
    if holds == "times":
        return pandas.Series(pandas.DatetimeIndex(_numpy(holds, cells)).tz_localize("UTC"))
    if holds == "whole" and (cells == ABSENT).any():
        return pandas.array(_listed(holds, cells), dtype="Int64")
    return cells.copy()


def _arrow_like(library: Any, kind: str, holds: str, cells: Any) -> Any:
    listed = _listed(holds, cells)
    if kind == "pyarrow":
        types = {
            "text": library.string(),
            "numbers": library.float64(),
            "whole": library.int64(),
            "times": library.timestamp("ns", tz="UTC"),
        }
        return library.array(listed, type=types[holds])
    if holds == "times":
        return library.Series(listed, dtype=library.Int64).cast(library.Datetime("ns", "UTC"))
    types = {"text": library.String, "numbers": library.Float64, "whole": library.Int64}
    return library.Series(listed, dtype=types[holds])
