"""Fields from above, and angles over the day."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.lines import Line2D

from helio_py._arrays import real_numbers
from helio_py._errors import OptionError, ShapeError
from helio_py._status import Status
from helio_py._times import unix_ns
from helio_py.plot._axes import COLOURS, column_of, dated, on_axes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray


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
    places = real_numbers(getattr(field, "position_enu_m", field), "field")
    if places.ndim != 2 or places.shape[1] not in (2, 3):
        raise ShapeError(f"field: expected a Field or shape (n, 2) or (n, 3), got {places.shape}")
    factor = 1.0
    if isinstance(values, str):
        if not hasattr(field, values):
            raise OptionError(f"values: the field has no column `{values}`")
        found_label, factor = _words(values)
        label, values = label or found_label, getattr(field, values)
    ax = on_axes(ax)
    n = len(places)
    size = float(np.clip(4e4 / max(n, 1), 3.0, 60.0))
    east, north = places[:, 0], places[:, 1]
    what = f"{n:,} heliostat" + ("s" if n != 1 else "")
    if values is None:
        ax.scatter(east, north, s=size, color=COLOURS[0], linewidths=0)
    elif np.asarray(values).dtype == np.uint8:
        _by_status(ax, east, north, np.asarray(values), size)
        what += " by status"
    else:
        numbers = factor * column_of(values, "values", n)
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
        colour = COLOURS[int(code)]
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
    ax = on_axes(ax)
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
    dated(ax)
    day = f", {np.datetime_as_string(moments[0], unit='D')}" if len(moments) else ""
    ax.set(xlabel="time (UTC)", ylabel="axis angle (°)", title=f"Axis angles{day}" if title is None else title)
    ax.grid(alpha=0.3)
    return ax


def _broken(moments: NDArray[Any], degrees: NDArray[np.float64]) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """With a break between two answers that are more than half a turn apart."""
    jumps = np.flatnonzero(np.abs(np.diff(degrees)) > 180.0) + 1
    return np.insert(moments, jumps, moments[jumps]), np.insert(degrees, jumps, np.nan)
