"""Spots in frames and about their aim."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Ellipse, Polygon

from helio_py._errors import ShapeError
from helio_py.plot._axes import COLOURS, column_of, on_axes, on_target

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike


def spot_overlay(
    image: ArrayLike,
    column_px: ArrayLike,
    row_px: ArrayLike,
    *,
    corners_px: ArrayLike | None = None,
    reference_px: ArrayLike | None = None,
    labels: Iterable[str] | None = None,
    sigma_px: ArrayLike | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """A camera's frame with the spots that were found in it.

    Parameters
    ----------
    image : array of shape (rows, columns) or (rows, columns, 3)
        The frame.
    column_px, row_px : float or array of shape (n,)
        Where spots are: right and down from the middle of the first pixel [px]. NaN draws nothing.
    corners_px : array of shape (4, 2), optional
        Corners of the target as (column, row), in order round it.
    reference_px : array of shape (n, 2), optional
        Where somebody else found the spots, as (column, row).
    labels : iterable of str, optional
        A word for each spot.
    sigma_px : float or array of shape (n,), optional
        Standard deviation of each spot's place [px], drawn as a circle of twice that.
    title : str, optional
        Title of the axes.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    picture = np.asarray(image)
    if picture.ndim not in (2, 3):
        raise ShapeError(f"image: expected shape (rows, columns) or (rows, columns, 3), got {picture.shape}")
    column, row = np.atleast_1d(column_px).astype(float), np.atleast_1d(row_px).astype(float)
    if column.shape != row.shape or column.ndim != 1:
        raise ShapeError(f"row_px: expected shape {column.shape} as column_px has, got {row.shape}")
    ax = on_axes(ax)
    ax.imshow(picture, cmap="gray", interpolation="nearest")
    if corners_px is not None:
        ax.add_patch(Polygon(np.asarray(corners_px, dtype=float), fill=False, color="#56B4E9", lw=1.2))
    if reference_px is not None:
        reference = np.atleast_2d(np.asarray(reference_px, dtype=float))
        ax.plot(reference[:, 0], reference[:, 1], "x", ms=9, mew=1.6, color="#E69F00", label="reference")
    found = np.isfinite(column) & np.isfinite(row)
    if found.any():
        ax.plot(column[found], row[found], "+", ms=13, mew=1.8, color="#FF3B30", label="spot")
    if sigma_px is not None:
        sigma = np.broadcast_to(np.asarray(sigma_px, dtype=float), column.shape)
        for at, down, size in zip(column[found], row[found], sigma[found], strict=True):
            ax.add_patch(Ellipse((at, down), 4 * size, 4 * size, fill=False, color="#FF3B30", lw=1.0))
    for word, at, down in zip(labels or (), column, row, strict=False):
        if np.isfinite(at) and np.isfinite(down):
            style: dict[str, Any] = {"color": "#FF3B30", "fontsize": "small"}
            ax.annotate(word, (at, down), textcoords="offset points", xytext=(8, 8), **style)
    count = int(np.count_nonzero(found))
    words = f"{count} spot" + ("s" if count != 1 else "")
    ax.set(xlabel="column (px)", ylabel="row (px)", title=words if title is None else title)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="upper right", fontsize="small")
    return ax


def accuracy(
    u_m: ArrayLike,
    v_m: ArrayLike,
    *,
    slant_m: float | None = None,
    aim_m: tuple[float, float] = (0.0, 0.0),
    size_m: tuple[float, float] | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Spots about the aim point, with the circles of tracking accuracy and precision.

    Accuracy is the root mean square distance from the aim point, precision that from the mean spot (T/GRLM 02-2014).

    Parameters
    ----------
    u_m, v_m : array of shape (n,)
        Spots: right and down from the target's centre [m]. Rows with NaN are left out.
    slant_m : float, optional
        Distance from pivot to target [m], for milliradians in the legend.
    aim_m : (float, float), default (0, 0)
        The aim point [m].
    size_m : (width, height), optional
        Of the target [m], to draw its outline.
    title : str, optional
        Title of the axes.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    u, v = column_of(u_m, "u_m"), column_of(v_m, "v_m", len(np.asarray(u_m)))
    known = np.isfinite(u) & np.isfinite(v)
    u, v = u[known], v[known]
    ax = on_axes(ax)
    ax.plot(u, v, ".", ms=3, color=COLOURS[0], alpha=0.5, label=f"{len(u):,} spots")
    ax.plot(*aim_m, "+", ms=12, mew=1.5, color="black", label="aim point")
    circles: list[Any] = []
    if len(u):
        mean = (float(u.mean()), float(v.mean()))
        ax.plot(*mean, "x", ms=8, mew=1.5, color=COLOURS[1], label="mean spot")
        for centre, colour, word in ((aim_m, "black", "accuracy"), (mean, COLOURS[1], "precision")):
            radius = float(np.sqrt(np.mean((u - centre[0]) ** 2 + (v - centre[1]) ** 2)))
            said = f"{1e3 * radius:.1f} mm" if slant_m is None else f"{1e3 * radius / slant_m:.2f} mrad"
            ax.add_patch(Circle(centre, radius, fill=False, color=colour, lw=1.3))
            circles.append(Line2D([], [], ls="none", marker="o", ms=9, mfc="none", mec=colour, label=f"{word} {said}"))
    on_target(ax, size_m)
    ax.autoscale_view()
    ax.set_title("Tracking accuracy" if title is None else title)
    ax.legend(handles=[*ax.get_legend_handles_labels()[0], *circles], loc="best", fontsize="small")
    return ax
