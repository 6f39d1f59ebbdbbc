"""Arrays that are not contiguous float64 yet."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from helio_py._errors import DataTypeError

_WANTED = "expected real numbers"


def _refused(what: str, found: str) -> DataTypeError:
    error = DataTypeError(f"{what}: {_WANTED}, got {found}")
    error.field = what
    return error


def real_numbers(value: Any, what: str) -> NDArray[np.float64]:
    """A contiguous float64 array of anything that holds plain real numbers; ``what`` names it in messages."""
    if isinstance(value, np.ma.MaskedArray):
        raise _refused(what, "a masked array, whose mask would be lost; fill it first")
    if value is None or isinstance(value, (str, bytes, dict, set, frozenset)):
        raise _refused(what, type(value).__name__)
    try:
        array = np.asarray(value)
    except Exception as error:  # a foreign __array__ may raise anything
        raise _refused(what, f"{type(value).__name__}, of which NumPy says: {error}") from error
    # No bool, complex, text, time, record or object; no long double, which would lose digits unasked.
    if array.dtype.kind not in "fiu" or array.dtype.itemsize > 8:
        if array.size == 0 and isinstance(value, (list, tuple)):
            return np.zeros(array.shape)
        text = array.dtype.kind in "UST"
        raise _refused(what, f"{type(value).__name__} of " + ("text" if text else f"dtype {array.dtype}"))
    # Not ascontiguousarray, which makes one number an array of one.
    return np.array(array, dtype=np.float64, order="C", copy=True, subok=False)
