"""Times of Python, NumPy, pandas, polars and Arrow as nanoseconds of Unix time.

Nothing is imported that the caller has not: what a value is shows by the module it comes from.
"""

from __future__ import annotations

import datetime as dt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from helio_py._errors import DataTypeError, HelioError, ShapeError, TimeError
from helio_py._native import _parse_time

_NAIVE = "a time without a zone is refused; give it one (UTC, if it is that)"
_EPOCH = dt.datetime(1970, 1, 1, tzinfo=dt.timezone.utc)
_MICROSECOND = dt.timedelta(microseconds=1)
_RANGE = "it must lie between the years 1678 and 2262"


def _time_error(message: str, row: int | None = None) -> TimeError:
    where = "times" if row is None else f"times: row {row}"
    error = TimeError(f"{where}: {message}")
    error.field, error.row = "times", row
    return error


def unix_ns(times: Any) -> NDArray[np.int64]:
    """Nanoseconds of Unix time, contiguous, of the shape of ``times``.

    Raises ``TimeError`` for naive times, no times and times outside 1678 to 2262, ``DataTypeError`` for what is
    no time at all.
    """
    package = type(times).__module__.partition(".")[0]
    if isinstance(times, np.ma.MaskedArray):
        raise _no_time("a masked array, whose mask would be lost")
    if isinstance(times, (np.ndarray, np.datetime64)):
        return _of_numpy(np.asarray(times))
    if isinstance(times, dt.datetime):  # pandas' Timestamp too
        return np.asarray(_of_datetime(times, None), dtype=np.int64)
    if isinstance(times, str):
        return np.asarray(_of_text(times), dtype=np.int64)
    if package == "pandas":
        return _of_pandas(times)
    if package == "polars":
        return _of_polars(times)
    if package == "pyarrow":
        return _of_arrow(times)
    if isinstance(times, (list, tuple)):
        return _of_sequence(times)
    raise _no_time(type(times).__name__)


def instant(what: str, time: Any) -> int:
    """Nanoseconds of Unix time of one instant, which an argument is."""
    try:
        found = unix_ns(time)
    except HelioError as error:
        error.args = (str(error).replace("times: ", f"{what}: ", 1),)
        error.field = what
        raise
    if found.ndim:
        refused = ShapeError(f"{what}: expected one instant, got an array of shape {found.shape}")
        refused.field = what
        raise refused
    return int(found)


def _of_text(text: str) -> int:
    try:
        return _parse_time(text)
    except TimeError as error:
        error.field = "times"
        raise


def _no_time(found: str) -> DataTypeError:
    error = DataTypeError(f"times: expected datetime64, datetime or text with a zone, or an array of them, got {found}")
    error.field = "times"
    return error


def _of_numpy(times: NDArray[Any]) -> NDArray[np.int64]:
    """datetime64, which is UTC by its definition here; or an array of objects."""
    if times.dtype.kind == "O":
        flat = _of_sequence(times.ravel().tolist())
        return flat.reshape(times.shape)
    if times.dtype.kind != "M" or np.datetime_data(times.dtype)[0] == "generic":
        raise _no_time(f"an array of dtype {times.dtype}")
    missing = np.isnat(times)
    if missing.any():
        raise _time_error("no time (NaT)", int(np.argmax(missing.ravel())) if times.ndim else None)
    ns = times.astype("datetime64[ns]")
    # NumPy overflows without a word.
    wrong = ns.astype(times.dtype) != times
    if times.dtype != ns.dtype and np.datetime_data(times.dtype)[0] in ("ps", "fs", "as"):
        wrong = np.zeros(times.shape, dtype=bool)  # finer than a nanosecond is cut off
    if wrong.any():
        raise _time_error(_RANGE, int(np.argmax(wrong.ravel())) if times.ndim else None)
    return np.array(ns.view(np.int64), dtype=np.int64, order="C")


def _of_datetime(time: dt.datetime, row: int | None) -> int:
    if time != time:  # pandas' NaT is a datetime
        raise _time_error("no time (NaT)", row)
    if time.tzinfo is None or time.utcoffset() is None:
        raise _time_error(f"{time.isoformat()}: {_NAIVE}", row)
    value = (time - _EPOCH) // _MICROSECOND * 1000 + int(getattr(time, "nanosecond", 0))
    if not -(2**63) <= value < 2**63:
        raise _time_error(f"{time.isoformat()}: {_RANGE}", row)
    return value


def _of_sequence(times: list[Any] | tuple[Any, ...]) -> NDArray[np.int64]:
    found = np.empty(len(times), dtype=np.int64)
    for row, time in enumerate(times):
        if isinstance(time, dt.datetime):
            found[row] = _of_datetime(time, row)
        elif isinstance(time, str):
            try:
                found[row] = _parse_time(time)
            except TimeError as error:
                raise _time_error(str(error), row) from None
        elif isinstance(time, np.datetime64):
            found[row] = _of_numpy(np.asarray(time))
        else:
            raise _no_time(f"{type(time).__name__} in row {row}")
    return found


def _of_pandas(times: Any) -> NDArray[np.int64]:
    """A Series or DatetimeIndex with a zone."""
    dtype = getattr(times, "dtype", None)
    if dtype is None or getattr(dtype, "kind", None) != "M":
        if dtype is not None and str(dtype) in ("object", "str", "string"):
            return _of_sequence(list(times))
        raise _no_time(f"{type(times).__name__} of dtype {dtype}")
    zone = getattr(dtype, "tz", None) or getattr(getattr(dtype, "pyarrow_dtype", None), "tz", None)
    if zone is None:
        raise _time_error(_NAIVE)
    index = times.dt if hasattr(times, "dt") else times
    return _of_numpy(np.asarray(index.tz_convert("UTC").to_numpy(dtype="datetime64[ns]")))


def _of_polars(times: Any) -> NDArray[np.int64]:
    """A Series of Datetime with a zone, or of text."""
    dtype: Any = getattr(times, "dtype", None)
    if str(dtype) == "String":
        return _of_sequence(times.to_list())
    if not str(dtype).startswith("Datetime"):
        raise _no_time(f"{type(times).__name__} of dtype {dtype}")
    if dtype.time_zone is None:
        raise _time_error(_NAIVE)
    if times.null_count():
        raise _time_error("no time (null)", int(times.is_null().arg_max()))
    unit = times.dtype.time_unit
    return _of_numpy(times.to_physical().to_numpy().astype(f"datetime64[{unit}]"))


def _of_arrow(times: Any) -> NDArray[np.int64]:
    """An array of timestamps with a zone."""
    kind: Any = getattr(times, "type", None)
    unit = getattr(kind, "unit", None)
    if unit is None or not str(kind).startswith("timestamp"):
        raise _no_time(f"{type(times).__name__} of type {kind}")
    if kind.tz is None:
        raise _time_error(_NAIVE)
    if times.null_count:
        raise _time_error("no time (null)", times.is_null().to_pylist().index(True))
    return _of_numpy(times.to_numpy(zero_copy_only=False).astype(f"datetime64[{unit}]"))
