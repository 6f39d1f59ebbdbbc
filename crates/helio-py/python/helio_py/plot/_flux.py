"""Irradiance on receivers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from helio_py._errors import OptionError, ShapeError
from helio_py.plot._axes import on_axes, on_target

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray


def flux_map(
    flux: Any,
    u_m: ArrayLike | None = None,
    v_m: ArrayLike | None = None,
    *,
    cmap: str = "inferno",
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Irradiance on a receiver laid flat, as a camera facing it sees it.

    Parameters
    ----------
    flux : Flux, TargetMap, CameraFlux or array of shape (rows, columns)
        The map, or its irradiance [W/m²].
    u_m, v_m : array of shape (rows, columns), optional
        With an array: middles of the bins [m], right and down.
    cmap : str, default "inferno"
        Colours.
    title : str, optional
        Title of the axes.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes

    Notes
    -----
    A cylinder or cone is unrolled: its right is the arc round it. On a cone rows have different lengths, and each
    bin is drawn where it is on its own row. A picture without a target is drawn in pixels.
    """
    flux = getattr(flux, "target", None) or flux
    values = np.asarray(getattr(flux, "flux_w_m2", flux), dtype=np.float64)
    u_m = getattr(flux, "u_m", u_m) if u_m is None else u_m
    v_m = getattr(flux, "v_m", v_m) if v_m is None else v_m
    if values.ndim != 2:
        raise ShapeError(f"flux: expected shape (rows, columns), got {values.shape}")
    ax = on_axes(ax)
    if u_m is None or v_m is None:
        drawn: Any = ax.imshow(values / 1e3, cmap=cmap, interpolation="nearest", vmin=0.0)
        ax.set(xlabel="column (px)", ylabel="row (px)")
    else:
        u, v = np.asarray(u_m, dtype=np.float64), np.asarray(v_m, dtype=np.float64)
        if u.shape != values.shape or v.shape != values.shape:
            raise ShapeError(f"u_m, v_m: expected shape {values.shape} as flux has, got {u.shape} and {v.shape}")
        if not (np.isfinite(u).all() and np.isfinite(v).all()):
            raise OptionError("flux: a receiver that is a mesh has no flat picture; write it as .vtk")
        drawn = ax.pcolormesh(_edges(u), _edges(v), values / 1e3, cmap=cmap, vmin=0.0, rasterized=True)
        on_target(ax, None)
        ax.set_aspect("equal", adjustable="box")
    ax.figure.colorbar(drawn, ax=ax, label="irradiance (kW/m²)")
    words = f"Flux, peak {np.nanmax(values) / 1e3:.3g} kW/m²" if np.isfinite(values).any() else "Flux"
    ax.set_title(words if title is None else title)
    return ax


def _edges(middle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners of bins from their middles, of shape (rows + 1, columns + 1)."""
    out = middle
    for axis in (0, 1):
        first, last = np.take(out, [0], axis=axis), np.take(out, [-1], axis=axis)
        if out.shape[axis] > 1:
            step0 = np.take(out, [1], axis=axis) - first
            step1 = last - np.take(out, [-2], axis=axis)
        else:
            # A single row or column is as wide as its neighbours in the other direction.
            step0 = step1 = np.full(first.shape, _one_step(middle))
        half = 0.5 * (np.take(out, range(1, out.shape[axis]), axis) + np.take(out, range(out.shape[axis] - 1), axis))
        out = np.concatenate([first - 0.5 * step0, half, last + 0.5 * step1], axis=axis)
    return out


def _one_step(middle: NDArray[np.float64]) -> float:
    steps = [np.abs(np.diff(middle, axis=axis)).max(initial=0.0) for axis in (0, 1)]
    return max(*steps) or 1.0
