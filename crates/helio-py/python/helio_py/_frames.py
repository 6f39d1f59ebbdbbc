"""Where frames come from and when they were taken: arguments of ``find_spots``."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from helio_py._checked import flag, number, of, path, wrong_type, wrong_value
from helio_py._errors import ShapeError
from helio_py._native import _frame_times


def video(images: Any) -> Any:
    """Raw video as a path, an array of its bytes, or an object to read them from."""
    wanted = "with raw a path, bytes or a file opened for bytes"
    if isinstance(images, (str, os.PathLike)):
        return path("images", images)
    try:
        view = None if isinstance(images, np.ma.MaskedArray) else memoryview(images)
    except TypeError:
        view = None
    if view is not None:
        if view.format not in ("B", "b", "c") or not view.c_contiguous:
            raise wrong_type("images", wanted, images)
        return np.frombuffer(view, np.uint8) if view.nbytes else np.zeros(0, np.uint8)
    if not callable(getattr(images, "read", None)):
        raise wrong_type("images", wanted, images)
    return images


def clock(start: Any, fps: Any, numbered: Any, times: Any) -> tuple[int, float] | None:
    """When the first frame was taken, and how many came a second."""
    numbered = flag("numbered", numbered)
    if start is None and fps is None:
        if numbered:
            raise wrong_value("numbered", "wants start and fps")
        return None
    if start is None or fps is None:
        missing, there = ("start", "fps") if start is None else ("fps", "start")
        raise wrong_value(missing, f"wanted with {there}: the times of frames want both")
    if times is not None:
        raise wrong_value("times", "with start and fps: one of both says when frames were taken")
    from helio_py._times import instant  # which brings more of NumPy with it than most calls want

    return instant("start", start), number("fps", fps, 1e-6, 1e6, "frames per second")


def times_of(
    frames: int, called: list[str] | None, given: tuple[int, float] | None, numbered: bool, times: Any
) -> tuple[list[int] | None, list[str]]:
    """When each of some frames was taken, if that is told; and what is to be said of it."""
    if given is not None:
        found, warning = _frame_times(called or [], frames, *given, numbered)
        return found, [] if warning is None else [warning]
    if times is None:
        return None, []
    from helio_py._times import unix_ns

    stamps = unix_ns(times)
    if stamps.shape != (frames,):
        raise of(ShapeError(f"times: expected shape ({frames},), got {stamps.shape}"), "times")
    return stamps.tolist(), []
