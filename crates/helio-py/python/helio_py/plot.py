"""Figures of fields, angles, calibrations, spots, accuracy and flux, with matplotlib.

The only module of the package that imports matplotlib, and only where it is imported itself: ``pip install
helio-py[plot]`` or ``pip install matplotlib``. Every function draws into ``ax``, or into new axes of a figure of its own,
and returns the Axes. Angles are drawn in degrees or milliradians, lengths in metres; where both directions are
metres, they have one scale.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

try:
    import matplotlib.dates as mdates
    import matplotlib.pyplot as plt
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, Ellipse, Polygon, Rectangle
except ImportError as error:  # pragma: no cover
    raise ImportError("helio_py.plot draws with matplotlib: pip install matplotlib") from error

from helio_py._errors import OptionError, ShapeError
from helio_py._status import Status
from helio_py._times import unix_ns

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "accuracy",
    "calibration_arrows",
    "calibration_residuals",
    "day_angles",
    "field_map",
    "flux_map",
    "spot_overlay",
]

# Of a palette that people who tell colours apart badly tell apart (Okabe and Ito 2008).
_STATUS_COLOURS = ("#0072B2", "#D55E00", "#E69F00", "#999999", "#CC79A7", "#56B4E9", "#F0E442")


def _axes(ax: Axes | None, size: tuple[float, float] = (6.4, 4.8)) -> Axes:
    if ax is not None:
        return ax
    return plt.subplots(figsize=size, layout="constrained")[1]


def _column(values: ArrayLike, what: str, n: int | None = None) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1 or (n is not None and len(array) != n):
        wanted = "(n,)" if n is None else f"({n},)"
        error = ShapeError(f"{what}: expected shape {wanted}, got {array.shape}")
        error.field = what
        raise error
    return array


def _words(name: str) -> tuple[str, float]:
    """A column's name as people read it, with the unit, and what its numbers are multiplied by."""
    for suffix, unit, factor in (
        ("_rad", "mrad", 1e3),
        ("_mrad", "mrad", 1.0),
        ("_deg", "°", 1.0),
        ("_w_m2", "W/m²", 1.0),
        ("_m", "m", 1.0),
    ):
        if name.endswith(suffix):
            return f"{name.removesuffix(suffix).replace('_', ' ')} ({unit})", factor
    return name.replace("_", " "), 1.0


def field_map(
    field: Any,
    values: ArrayLike | str | None = None,
    *,
    label: str | None = None,
    title: str | None = None,
    cmap: str = "viridis",
    ax: Axes | None = None,
) -> Axes:
    """The heliostats of a field from above, coloured by any column.

    Parameters
    ----------
    field : Field or array of shape (n, 2) or (n, 3)
        The heliostats, or where they stand: east, north (and up) [m].
    values : array of shape (n,) or str, optional
        A number for each heliostat; whole numbers of one byte are a status. The name of a column of the field draws
        that one, angles in milliradians.
    label : str, optional
        What the numbers are, with their unit.
    title : str, optional
        Title of the axes.
    cmap : str, default "viridis"
        Colours of numbers.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import helio_py as hp
    >>> import helio_py.plot
    >>> field = hp.Field([[0, 90, 6], [40, 95, 6], [-40, 95, 6]], [0, 0, 120], mirror_offset_m=[0.2, 0.3, 0.4])
    >>> ax = hp.plot.field_map(field, "mirror_offset_m")
    >>> ax.get_xlabel(), ax.get_title()
    ('east (m)', '3 heliostats by mirror offset')
    """
    places = np.asarray(getattr(field, "position_enu_m", field), dtype=np.float64)
    if places.ndim != 2 or places.shape[1] not in (2, 3):
        raise ShapeError(f"field: expected a Field or shape (n, 2) or (n, 3), got {places.shape}")
    factor = 1.0
    if isinstance(values, str):
        if not hasattr(field, values):
            raise OptionError(f"values: the field has no column `{values}`")
        found_label, factor = _words(values)
        label, values = label or found_label, getattr(field, values)
    ax = _axes(ax)
    n = len(places)
    size = float(np.clip(4e4 / max(n, 1), 3.0, 60.0))
    east, north = places[:, 0], places[:, 1]
    what = f"{n:,} heliostat" + ("s" if n != 1 else "")
    if values is None:
        ax.scatter(east, north, s=size, color=_STATUS_COLOURS[0], linewidths=0)
    elif np.asarray(values).dtype == np.uint8:
        _by_status(ax, east, north, np.asarray(values), size)
        what += " by status"
    else:
        numbers = factor * _column(values, "values", n)
        drawn = ax.scatter(east, north, c=numbers, s=size, cmap=cmap, linewidths=0)
        ax.figure.colorbar(drawn, ax=ax, label=label or "")
        if label:
            what += f" by {label.partition(' (')[0]}"
    ax.plot(0.0, 0.0, marker="^", color="black", markersize=8, linestyle="none")
    ax.annotate("origin", (0.0, 0.0), textcoords="offset points", xytext=(7, -3), fontsize="small")
    ax.set(xlabel="east (m)", ylabel="north (m)", title=what if title is None else title)
    ax.set_aspect("equal", adjustable="datalim")
    return ax


def _by_status(
    ax: Axes, east: NDArray[np.float64], north: NDArray[np.float64], status: NDArray[np.uint8], size: float
) -> None:
    if status.shape != east.shape:
        raise ShapeError(f"values: expected shape {east.shape}, got {status.shape}")
    for code in np.unique(status):
        rows = status == code
        word = Status(int(code)).word.replace("_", " ")
        colour = _STATUS_COLOURS[int(code)]
        ax.scatter(
            east[rows], north[rows], s=size, color=colour, linewidths=0, label=f"{word} ({np.count_nonzero(rows):,})"
        )
    ax.legend(loc="best", fontsize="small", markerscale=float(np.sqrt(60.0 / size)))


def day_angles(
    times: Any,
    tracking: Any,
    *,
    rows: Sequence[int] | None = None,
    ids: Sequence[str] | None = None,
    title: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Axis angles over a day: axis 1 in full lines, axis 2 dashed, a colour for each heliostat.

    Parameters
    ----------
    times : array of shape (m,)
        Instants, as for `helio_py.sun_position`.
    tracking : Tracking or (array, array)
        Axis angles of shape (m, n) [rad].
    rows : sequence of int, optional
        Heliostats to draw; by default up to six spread over the field.
    ids : sequence of str, optional
        Names of all n heliostats; by default their rows.
    title : str, optional
        Title of the axes.
    ax : matplotlib Axes, optional
        Where to draw.

    Returns
    -------
    matplotlib Axes

    Notes
    -----
    Lines break where an axis turns past north, and where there is no answer.
    """
    at = unix_ns(times)
    angles = (tracking.axis1_rad, tracking.axis2_rad) if hasattr(tracking, "axis1_rad") else tuple(tracking)
    columns = [np.degrees(np.asarray(angle, dtype=np.float64)) for angle in angles]
    for column, what in zip(columns, ("axis 1", "axis 2"), strict=True):
        if column.ndim != 2 or at.ndim != 1 or len(column) != len(at):
            raise ShapeError(f"{what}: expected shape ({at.size}, n) as times have, got {column.shape}")
    n = columns[0].shape[1]
    if rows is None:
        rows = np.unique(np.linspace(0, n - 1, min(n, 6)).astype(int)).tolist() if n else []
    ax = _axes(ax)
    moments = at.astype("datetime64[ns]")
    for k, row in enumerate(rows):
        name = str(row) if ids is None else ids[row]
        ax.plot(*_broken(moments, columns[0][:, row]), color=f"C{k % 10}", label=name)
        ax.plot(moments, columns[1][:, row], color=f"C{k % 10}", linestyle="--")
    handles: list[Any] = [
        Line2D([], [], color="black", label="axis 1"),
        Line2D([], [], color="black", ls="--", label="axis 2"),
    ]
    handles += ax.get_legend_handles_labels()[0]
    ax.legend(handles=handles, loc="best", fontsize="small", ncols=2)
    _dated(ax)
    day = f", {np.datetime_as_string(moments[0], unit='D')}" if len(moments) else ""
    ax.set(xlabel="time (UTC)", ylabel="axis angle (°)", title=f"Axis angles{day}" if title is None else title)
    ax.grid(alpha=0.3)
    return ax


def _dated(ax: Axes) -> None:
    formatter: Any = mdates.ConciseDateFormatter
    ax.xaxis.set_major_formatter(formatter(ax.xaxis.get_major_locator()))


def _broken(moments: NDArray[Any], degrees: NDArray[np.float64]) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """With a break between two answers that are more than half a turn apart."""
    jumps = np.flatnonzero(np.abs(np.diff(degrees)) > 180.0) + 1
    return np.insert(moments, jumps, moments[jumps]), np.insert(degrees, jumps, np.nan)


def _target(ax: Axes, size_m: tuple[float, float] | None) -> None:
    """Axes of a target: u right and v down, as a camera facing it sees them."""
    if size_m is not None:
        width, height = size_m
        ax.add_patch(Rectangle((-width / 2, -height / 2), width, height, fill=False, color="grey", lw=1.0))
    ax.set(xlabel="u, right (m)", ylabel="v, down (m)")
    ax.set_aspect("equal", adjustable="datalim")
    if not ax.yaxis_inverted():
        ax.invert_yaxis()


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
        Records that the calibration does not use: drawn in another colour.
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
    u, v = _column(u_m, "u_m"), _column(v_m, "v_m")
    du, dv = _column(residual_u_m, "residual_u_m", len(u)), _column(residual_v_m, "residual_v_m", len(u))
    v = _column(v, "v_m", len(u))
    out = np.zeros(len(u), dtype=bool) if rejected is None else np.asarray(rejected, dtype=bool)
    longest = float(np.nanmax(np.hypot(du, dv)[~out], initial=0.0))
    if enlarged is None:
        spread = max(np.ptp(u), np.ptp(v), *(size_m or (0.0,))) if len(u) else 0.0
        enlarged = _round_down(0.1 * spread / longest) if longest > 0 and spread > 0 else 1.0
    ax = _axes(ax)
    for rows, colour, word in ((~out, _STATUS_COLOURS[0], "used"), (out, _STATUS_COLOURS[1], "rejected")):
        if not rows.any():
            continue
        ax.plot(u[rows], v[rows], ".", color=colour, ms=4, label=f"{word} ({np.count_nonzero(rows)})")
        arrows = (u[rows], v[rows], enlarged * du[rows], enlarged * dv[rows])
        ax.quiver(*arrows, color=colour, angles="xy", scale_units="xy", scale=1.0, width=0.003)
    _target(ax, size_m)
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
        What to draw them over: times, or numbers (with `xlabel`); by default the number of the record.
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
    residual = _column(residual_mrad, "residual_mrad")
    out = np.zeros(len(residual), dtype=bool) if rejected is None else np.asarray(rejected, dtype=bool)
    x, timed = _abscissa(against, len(residual))
    ax = _axes(ax)
    ax.plot(x[~out], residual[~out], "o", ms=4, color=_STATUS_COLOURS[0], label=f"used ({np.count_nonzero(~out)})")
    if out.any():
        ax.plot(x[out], residual[out], "x", ms=5, color=_STATUS_COLOURS[1], label=f"rejected ({np.count_nonzero(out)})")
    rms = float(np.sqrt(np.nanmean(residual[~out] ** 2))) if (~out).any() else np.nan
    ax.axhline(rms, color="black", lw=1.0, ls="--", label=f"rms {rms:.2f} mrad")
    if timed:
        _dated(ax)
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
        return _column(against, "against", n), False
    times = unix_ns(against)
    if times.shape != (n,):
        raise ShapeError(f"against: expected shape ({n},), got {times.shape}")
    return times.astype("datetime64[ns]"), True


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
    ax = _axes(ax)
    ax.imshow(picture, cmap="gray", interpolation="nearest")
    if corners_px is not None:
        ax.add_patch(Polygon(np.asarray(corners_px, dtype=float), fill=False, color="#56B4E9", lw=1.2))
    if reference_px is not None:
        reference = np.atleast_2d(np.asarray(reference_px, dtype=float))
        ax.plot(reference[:, 0], reference[:, 1], "x", ms=9, mew=1.6, color="#E69F00", label="reference")
    found = np.isfinite(column) & np.isfinite(row)
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
    u, v = _column(u_m, "u_m"), _column(v_m, "v_m", len(np.asarray(u_m)))
    known = np.isfinite(u) & np.isfinite(v)
    u, v = u[known], v[known]
    ax = _axes(ax)
    ax.plot(u, v, ".", ms=3, color=_STATUS_COLOURS[0], alpha=0.5, label=f"{len(u):,} spots")
    ax.plot(*aim_m, "+", ms=12, mew=1.5, color="black", label="aim point")
    circles: list[Any] = []
    if len(u):
        mean = (float(u.mean()), float(v.mean()))
        ax.plot(*mean, "x", ms=8, mew=1.5, color=_STATUS_COLOURS[1], label="mean spot")
        for centre, colour, word in ((aim_m, "black", "accuracy"), (mean, _STATUS_COLOURS[1], "precision")):
            radius = float(np.sqrt(np.mean((u - centre[0]) ** 2 + (v - centre[1]) ** 2)))
            said = f"{1e3 * radius:.1f} mm" if slant_m is None else f"{1e3 * radius / slant_m:.2f} mrad"
            ax.add_patch(Circle(centre, radius, fill=False, color=colour, lw=1.3))
            circles.append(Line2D([], [], ls="none", marker="o", ms=9, mfc="none", mec=colour, label=f"{word} {said}"))
    _target(ax, size_m)
    ax.autoscale_view()
    ax.set_title("Tracking accuracy" if title is None else title)
    ax.legend(handles=[*ax.get_legend_handles_labels()[0], *circles], loc="best", fontsize="small")
    return ax


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
    ax = _axes(ax)
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
        _target(ax, None)
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
