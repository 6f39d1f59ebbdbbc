"""What became of a row."""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

import numpy as np

from helio_py._checked import array, of, wrong_value
from helio_py._errors import DataTypeError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class Status(enum.IntEnum):
    """Why a row has, or does not have, an answer: the numbers of every status column."""

    #: The row's numbers are valid.
    OK = 0
    #: No axis angles point the mirror there: the normal lies in a blind cone about the fixed axis.
    UNREACHABLE = 1
    #: Neither solution lies within the axis limits.
    OUTSIDE_LIMITS = 2
    #: The apparent centre of the sun is below the horizon.
    SUN_BELOW_HORIZON = 3
    #: The sun stands opposite the aim: the mirror would be seen edge-on or from behind.
    SUN_OPPOSES_AIM = 4
    #: The aim point is no farther from the pivot than the mirror's centre.
    AIM_AT_PIVOT = 5
    #: The reflected ray does not meet the front of the target plane.
    MISSES_TARGET = 6

    @property
    def word(self) -> str:
        """The word in files and on the command line."""
        return self.name.lower()


_WORDS = np.array([status.word for status in Status])


def status_words(status: ArrayLike) -> NDArray[np.str_]:
    """Words of status numbers, of the same shape.

    Examples
    --------
    >>> import helio_py as hp
    >>> hp.status_words([0, 3]).tolist()
    ['ok', 'sun_below_horizon']
    """
    codes = array("status", status)
    if codes.dtype.kind not in "iu":
        raise of(DataTypeError(f"status: expected whole numbers, got dtype {codes.dtype}"), "status")
    if codes.size and not (codes.min() >= 0 and codes.max() < len(_WORDS)):
        raise wrong_value("status", f"numbers are 0 to {len(_WORDS) - 1}, got {codes.min()} to {codes.max()}")
    return np.asarray(_WORDS[codes])
