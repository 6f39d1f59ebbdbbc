"""What a calibration leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from helio_py._errors import ShapeError
from helio_py._times import unix_ns
from helio_py.plot._axes import COLOURS, column_of, dated, on_axes, on_target

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray


def calibration_arrows(
    u_m: ArrayLike,
    v_m: ArrayLike,
    residual_u_m: ArrayLike,
    residual_v_m: ArrayLike,
    *,
    rejected: ArrayLike | None = None,
    enlarged: float | None = None,
    size_m: tuple[float, float] | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Spots on the target, each with an arrow of how far it is from where the calibration puts it.

    Parameters
    ----------
    u_m, v_m : array of shape (n,)
        Where the spots were seen: right and down from the target's centre [m].
    residual_u_m, residual_v_m : array of shape (n,)
        Seen less predicted [m].
    rejected : array of bool of shape (n,), optional
        Records that the calibration does not use: drawn in another colour. Those whose residual is NaN are too.
    enlarged : float, optional
        How many times as long as they are arrows are drawn; by default so that the longest is a tenth of the picture.
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
    u, v = column_of(u_m, "u_m"), column_of(v_m, "v_m")
    du, dv = column_of(residual_u_m, "residual_u_m", len(u)), column_of(residual_v_m, "residual_v_m", len(u))
    v = column_of(v, "v_m", len(u))
    out = np.zeros(len(u), dtype=bool) if rejected is None else np.asarray(rejected, dtype=bool)
    out = out | ~np.isfinite(du + dv)  # what has no prediction is not used
    longest = float(np.max(np.hypot(du, dv)[~out], initial=0.0))
    if enlarged is None:
        spread = max(np.ptp(u), np.ptp(v), *(size_m or (0.0,))) if len(u) else 0.0
        enlarged = _round_down(0.1 * spread / longest) if longest > 0 and spread > 0 else 1.0
    ax = on_axes(ax)
    for rows, colour, word in ((~out, COLOURS[0], "used"), (out, COLOURS[1], "rejected")):
        if not rows.any():
            continue
        ax.plot(u[rows], v[rows], ".", color=colour, ms=4, label=f"{word} ({np.count_nonzero(rows)})")
        arrows = (u[rows], v[rows], enlarged * du[rows], enlarged * dv[rows])
        ax.quiver(*arrows, color=colour, angles="xy", scale_units="xy", scale=1.0, width=0.003)
    on_target(ax, size_m)
    if len(u):
        # Arrows count too for what is in the picture.
        ax.update_datalim(np.c_[u[~out] + enlarged * du[~out], v[~out] + enlarged * dv[~out]])
        ax.autoscale_view()
        ax.legend(loc="best", fontsize="small")
    rms_m = float(np.sqrt(np.mean(du[~out] ** 2 + dv[~out] ** 2))) if (~out).any() else np.nan
    words = f"Residuals, {enlarged:g} times enlarged: rms {1e3 * rms_m:.1f} mm, longest {1e3 * longest:.1f} mm"
    ax.set_title(words if title is None else title)
    return ax


def _round_down(number: float) -> float:
    """To 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(number))
    return float(max(step for step in (1.0, 2.0, 5.0) if step * power <= number * (1 + 1e-12)) * power)


def calibration_residuals(
    residual_mrad: ArrayLike,
    against: Any | None = None,
    *,
    rejected: ArrayLike | None = None,
    xlabel: str | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """How far each record is from the calibration, and the root mean square of those used.

    Parameters
    ----------
    residual_mrad : array of shape (n,)
        Angle between predicted and seen beam [mrad].
    against : array of shape (n,), optional
        What to draw them over: times, or numbers (with `xlabel`); by default the number of the record. A record without
        one is not drawn, and counts in the root mean square.
    rejected : array of bool of shape (n,), optional
        Records that the calibration does not use.
    xlabel : str, optional
        What `against` is, with its unit.
    title : str, optional
        Title of the axes.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes
    """
    residual = column_of(residual_mrad, "residual_mrad")
    out = np.zeros(len(residual), dtype=bool) if rejected is None else np.asarray(rejected, dtype=bool)
    out = out | ~np.isfinite(residual)  # what has no prediction is not used
    x, timed = _abscissa(against, len(residual))
    ax = on_axes(ax)
    ax.plot(x[~out], residual[~out], "o", ms=4, color=COLOURS[0], label=f"used ({np.count_nonzero(~out)})")
    if out.any():
        ax.plot(x[out], residual[out], "x", ms=5, color=COLOURS[1], label=f"rejected ({np.count_nonzero(out)})")
    rms = float(np.sqrt(np.mean(residual[~out] ** 2))) if (~out).any() else np.nan
    ax.axhline(rms, color="black", lw=1.0, ls="--", label=f"rms {rms:.2f} mrad")
    if timed:
        dated(ax)
    ax.set_ylim(bottom=0.0)
    default = "time (UTC)" if timed else ("record" if against is None else "")
    ax.set(
        xlabel=xlabel or default, ylabel="residual of the beam (mrad)", title="Residuals" if title is None else title
    )
    ax.legend(loc="best", fontsize="small")
    ax.grid(alpha=0.3)
    return ax


def _abscissa(against: Any | None, n: int) -> tuple[NDArray[Any], bool]:
    if against is None:
        return np.arange(n), False
    kind = getattr(getattr(against, "dtype", None), "kind", None)
    if kind is None and len(against) and isinstance(against[0], (int, float, np.number)):
        kind = "f"
    if kind in ("f", "i", "u"):
        return column_of(against, "against", n), False
    # Records that state a sun need no time: None, NaN and NaT.
    there = [row for row, time in enumerate(against) if time is not None and time == time]
    if len(against) != n or len(there) == n:
        times = unix_ns(against)
        if times.shape != (n,):
            raise ShapeError(f"against: expected shape ({n},), got {times.shape}")
        return times.astype("datetime64[ns]"), True
    cells = list(against)
    moments = np.full(n, "NaT", dtype="datetime64[ns]")
    if there:
        moments[there] = unix_ns([cells[row] for row in there]).astype("datetime64[ns]")
    return moments, True
