"""What the figures share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib.dates as mdates
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

from helio_py._errors import ShapeError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

# Of a palette that people who tell colours apart badly tell apart (Okabe and Ito 2008).
COLOURS = ("#0072B2", "#D55E00", "#E69F00", "#999999", "#CC79A7", "#56B4E9", "#F0E442")


def on_axes(ax: Axes | None, size: tuple[float, float] = (6.4, 4.8)) -> Axes:
    if ax is not None:
        return ax
    return plt.subplots(figsize=size, layout="constrained")[1]


def column_of(values: ArrayLike, what: str, n: int | None = None) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1 or (n is not None and len(array) != n):
        wanted = "(n,)" if n is None else f"({n},)"
        error = ShapeError(f"{what}: expected shape {wanted}, got {array.shape}")
        error.field = what
        raise error
    return array


def dated(ax: Axes) -> None:
    formatter: Any = mdates.ConciseDateFormatter
    ax.xaxis.set_major_formatter(formatter(ax.xaxis.get_major_locator()))


def on_target(ax: Axes, size_m: tuple[float, float] | None) -> None:
    """Axes of a target: u right and v down, as a camera facing it sees them."""
    if size_m is not None:
        width, height = size_m
        ax.add_patch(Rectangle((-width / 2, -height / 2), width, height, fill=False, color="grey", lw=1.0))
    ax.set(xlabel="u, right (m)", ylabel="v, down (m)")
    ax.set_aspect("equal", adjustable="datalim")
    if not ax.yaxis_inverted():
        ax.invert_yaxis()
