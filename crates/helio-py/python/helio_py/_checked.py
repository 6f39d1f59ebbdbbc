"""Arguments as what they have to be, or an error that names them."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from helio_py._errors import DataTypeError, OptionError, ShapeError

if TYPE_CHECKING:
    from numpy.typing import NDArray


def wrong_type(what: str, wanted: str, value: Any) -> DataTypeError:
    """An argument that is nothing like what is wanted."""
    found = "nothing" if value is None else type(value).__name__
    if isinstance(value, str) and len(value) < 40:
        found = repr(value)
    return of(DataTypeError(f"{what}: expected {wanted}, got {found}"), what)


def wrong_value(what: str, message: str) -> OptionError:
    """An argument of the right kind that is none of those allowed."""
    return of(OptionError(f"{what}: {message}"), what)


def of(error: Any, what: str) -> Any:
    """An error with the name of its argument."""
    error.field = what
    return error


def number(what: str, value: Any, least: float = -math.inf, most: float = math.inf, unit: str = "") -> float:
    """A real number, finite, within bounds."""
    value = _out_of_array(value)
    if not isinstance(value, (int, float, np.integer, np.floating)) or isinstance(value, bool):
        raise wrong_type(what, "a number", value)
    try:
        real = float(value)
    except OverflowError:
        real = math.inf
    if not (math.isfinite(real) and least <= real <= most):
        wanted = "a finite number"
        if not (math.isinf(least) and math.isinf(most)):
            wanted = f"{least:g} to {most:g} {unit}".rstrip()
        raise wrong_value(what, f"wanted {wanted}, got {value}")
    return real


def whole(what: str, value: Any, least: int, most: int) -> int:
    """A whole number within bounds."""
    value = _out_of_array(value)
    if not isinstance(value, (int, np.integer)) or isinstance(value, bool):
        raise wrong_type(what, "a whole number", value)
    if not least <= int(value) <= most:
        raise wrong_value(what, f"wanted {least} to {most}, got {value}")
    return int(value)


def flag(what: str, value: Any) -> bool:
    """True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise wrong_type(what, "True or False", value)
    return bool(value)


def text(what: str, value: Any) -> str:
    """A text."""
    if not isinstance(value, str):
        raise wrong_type(what, "str", value)
    try:
        value.encode()
    except UnicodeEncodeError as reason:  # half of a surrogate pair
        raise wrong_value(what, f"no text: {reason}") from None
    return value


def several(what: str, value: Any, wanted: str) -> list[Any]:
    """What can be gone through."""
    if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable):
        raise wrong_type(what, wanted, value)
    if isinstance(value, np.ndarray) and value.ndim == 0:
        raise wrong_type(what, wanted, value)
    return list(value)


def texts(what: str, value: Any) -> list[str]:
    """Several texts."""
    found = several(what, value, "a sequence of str")
    for one in found:
        if not isinstance(one, str):
            raise wrong_type(what, "a sequence of str", one)
    return [text(what, one) for one in found]


def pair(what: str, value: Any) -> tuple[float, float]:
    """Two numbers."""
    found = several(what, value, "two numbers")
    if len(found) != 2:
        raise of(ShapeError(f"{what}: expected shape (2,), got ({len(found)},)"), what)
    return number(what, found[0]), number(what, found[1])


def path(what: str, value: Any) -> str:
    """The path of a file."""
    if not isinstance(value, (str, os.PathLike)):
        raise wrong_type(what, "a path", value)
    try:
        found = os.fspath(value)
    except TypeError:
        found = None
    if not isinstance(found, str):
        raise wrong_type(what, "a path", found)
    try:
        os.fsencode(found)
    except UnicodeEncodeError as reason:
        raise wrong_value(what, f"no path: {reason}") from None
    return found


def array(what: str, value: Any) -> NDArray[Any]:
    """An array of whatever dtype, without a mask."""
    if isinstance(value, np.ma.MaskedArray):
        raise of(DataTypeError(f"{what}: expected an array, got a masked one, whose mask would be lost"), what)
    try:
        return np.asarray(value)
    except Exception as reason:  # a foreign __array__ may raise anything
        raise of(DataTypeError(f"{what}: no array can be made of {type(value).__name__}: {reason}"), what) from reason


def _out_of_array(value: Any) -> Any:
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value
