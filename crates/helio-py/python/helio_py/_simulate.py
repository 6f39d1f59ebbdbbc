"""Synthetic fields and campaigns of observations, for tests and for planning."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from helio_py._checked import flag, number, of, pair, several, text, texts, whole, wrong_type, wrong_value
from helio_py._errors import ShapeError
from helio_py._native import Field, _simulate_field, _simulate_observations
from helio_py._progress import reporter
from helio_py._tables import Column, checked_kind, given_back

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Sequence

    from helio_py._native import _Campaign


def simulate_field(
    heliostats: int,
    layout: str = "radial-staggered",
    *,
    tower_height_m: float = 120.0,
    mirror_width_m: float = 11.0,
    mirror_height_m: float = 10.0,
    pivot_height_m: float = 6.0,
) -> dict[str, Any]:
    """A generated layout: a table of heliostats around a tower at the origin.

    No two heliostats are closer than they can turn. The same arguments give the same field as ``helio-rs simulate
    field``, to the last bit.

    Parameters
    ----------
    heliostats : int
        How many, from 1 to 100,000,000.
    layout : str, default "radial-staggered"
        Or "fermat-spiral".
    tower_height_m : float, default 120
        Height of the target above the pivots [m].
    mirror_width_m, mirror_height_m : float, default 11 and 10
        Of a mirror [m].
    pivot_height_m : float, default 6
        Of the pivots above the ground [m].

    Returns
    -------
    dict
        Columns `id` (list of str), `east_m`, `north_m`, `up_m`: pivots, whole millimetres.

    Raises
    ------
    OptionError

    Examples
    --------
    >>> import numpy as np
    >>> import helio_py as hp
    >>> layout = hp.simulate_field(1000)
    >>> pivots = np.column_stack([layout["east_m"], layout["north_m"], layout["up_m"]])
    >>> hp.Field(pivots, [0, 0, 126], ids=layout["id"])
    <Field of 1000 heliostats, azimuth-elevation>
    """
    count = whole("heliostats", heliostats, 1, 100_000_000)
    measures = {
        "tower_height_m": tower_height_m,
        "mirror_width_m": mirror_width_m,
        "mirror_height_m": mirror_height_m,
        "pivot_height_m": pivot_height_m,
    }
    numbers = [number(name, value, 0.01, 10_000.0, "metres") for name, value in measures.items()]
    return _simulate_field(count, text("layout", layout), *numbers)


def simulate_observations(
    field: Field,
    *,
    heliostats: int | None = None,
    ids: Sequence[str] | None = None,
    targets: Sequence[str] | None = None,
    count: int = 50,
    seed: int = 1,
    from_time: Any = "2025-01-01T00:00:00Z",
    to_time: Any = "2026-01-01T00:00:00Z",
    days: int | None = None,
    hours: tuple[float, float] = (0.0, 24.0),
    min_sun_elevation_deg: float = 10.0,
    noise_mrad: float = 0.5,
    outliers: float = 0.0,
    outlier_mrad: float = 10.0,
    wrong_heliostat: float = 0.0,
    wrong_target: float = 0.0,
    jumps: Iterable[tuple[Any, float, float]] = (),
    random_errors: bool = False,
    steps: bool = False,
    progress: Callable[[int, int], Any] | bool | None = None,
) -> SimulatedObservations:
    """What cameras see of a field's heliostats: observations with known truth, and whatever can be wrong with them.

    The same seed gives the same observations as ``helio-rs simulate observations``, to the last bit.

    Parameters
    ----------
    field : Field
        With a site, which the sun needs, and targets, on which spots are seen: read from files, or made with `site` and
        `targets`.
    heliostats : int, optional
        So many of them, evenly over the field; by default all.
    ids : sequence of str, optional
        These heliostats instead.
    targets : sequence of str, optional
        Targets to see spots on; by default all that have a plane.
    count : int, default 50
        Observations of each heliostat.
    seed : int, default 1
        Of all random numbers.
    from_time, to_time : optional
        No observation is earlier, all are earlier; times as for `sun_position`. By default the year 2025.
    days : int, optional
        On so many days only, chosen at random.
    hours : (float, float), default (0, 24)
        Local solar time, from and to [h].
    min_sun_elevation_deg : float, default 10
        Lowest sun [deg].
    noise_mrad : float, default 0.5
        One standard deviation of either component of the spot, as seen from the heliostat [mrad].
    outliers, outlier_mrad : float, default 0 and 10
        Share of observations whose spot is found in a wrong place, and by how much: from this to twice this [mrad].
    wrong_heliostat, wrong_target : float, default 0
        Share of observations that are a neighbour's, or name another target than the one lit.
    jumps : iterable of (time, float, float), optional
        Jumps of the encoder references: when, and of which size on both axes [mrad].
    random_errors : bool, default False
        Draw the true errors at random, some milliradians each, instead of taking the field's.
    steps : bool, default False
        Motor steps instead of angles.
    progress : callable or True, optional
        Called with heliostats done and in all; True for a bar of tqdm.

    Returns
    -------
    SimulatedObservations

    Raises
    ------
    OptionError, MissingError, DataTypeError, TimeError
    """
    if not isinstance(field, Field):
        raise wrong_type("field", "a Field", field)
    if heliostats is not None and ids is not None:
        raise wrong_value("ids", "it stands beside heliostats; wanted one")
    from_h, to_h = pair("hours", hours)
    if not 0.0 <= from_h < to_h <= 24.0:
        raise wrong_value("hours", f"wanted two hours of the day, the first one earlier, got {(from_h, to_h)}")
    asked = {
        "heliostats": None if heliostats is None else whole("heliostats", heliostats, 1, 2**32),
        "ids": None if ids is None else texts("ids", ids),
        "targets": None if targets is None else texts("targets", targets),
        "count": whole("count", count, 1, 1_000_000),
        "seed": whole("seed", seed, 0, 2**64 - 1),
        "from_unix_ns": _instant("from_time", from_time),
        "to_unix_ns": _instant("to_time", to_time),
        "days": None if days is None else whole("days", days, 1, 100_000),
        "hours": [from_h, to_h],
        "min_sun_elevation_deg": number("min_sun_elevation_deg", min_sun_elevation_deg, 0.0, 90.0, "degrees"),
        "noise_mrad": number("noise_mrad", noise_mrad, 0.0, 1e6, "milliradians"),
        "outliers": number("outliers", outliers, 0.0, 1.0, ""),
        "outlier_mrad": number("outlier_mrad", outlier_mrad, 0.0, 1e6, "milliradians"),
        "wrong_heliostat": number("wrong_heliostat", wrong_heliostat, 0.0, 1.0, ""),
        "wrong_target": number("wrong_target", wrong_target, 0.0, 1.0, ""),
        "jumps": [_jump(jump) for jump in several("jumps", jumps, "a sequence of (time, mrad, mrad)")],
        "random_errors": flag("random_errors", random_errors),
        "steps": flag("steps", steps),
    }
    with reporter(progress, " heliostats") as report:
        return SimulatedObservations(_simulate_observations(field, asked, report), (field, asked))


def _again(field: Field, asked: dict[str, Any]) -> SimulatedObservations:
    """The same campaign, from its seed: for pickle."""
    return SimulatedObservations(_simulate_observations(field, asked, None), (field, asked))


class SimulatedObservations:
    """A simulated campaign: what was seen, and the errors that were true."""

    def __init__(self, campaign: _Campaign, recipe: tuple[Field, dict[str, Any]]) -> None:
        """Of what the native part made, and how to make it again; not for users."""
        self._campaign = campaign
        self._recipe = recipe

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, self._recipe

    def __copy__(self) -> SimulatedObservations:
        return self

    def __deepcopy__(self, memo: Any) -> SimulatedObservations:
        return self

    @property
    def observations(self) -> dict[str, Any]:
        """Columns as an observations file has them: `heliostat_id, time` (datetime64[ns], UTC), `axis1_deg, axis2_deg` (or
        `axis1_steps, axis2_steps`), `target, u_m, v_m, sigma_m` (NaN without noise)."""
        table = self._campaign.observations()
        table["time"] = table["time"].view("datetime64[ns]")
        return table

    @property
    def _table_columns(self) -> list[Column]:
        table = self.observations
        holds = {"time": "times", "heliostat_id": "text", "target": "text"}
        return [
            (name, held, cells.view(np.int64) if held == "times" else cells)
            for name, cells in table.items()
            for held in (holds.get(name, "numbers"),)
        ]

    def to_table(self, kind: str = "dict") -> Any:
        """The same as "dict" (of arrays), "pandas", "polars" or "pyarrow", times with their zone: what `calibrate` takes."""
        return given_back(self._table_columns, checked_kind(kind))

    @property
    def truth(self) -> dict[str, Any]:
        """The true errors of the heliostats: `id` and the six errors of the mount [rad], by the names of `Field`."""
        return self._campaign.truth()

    @property
    def unseen(self) -> list[str]:
        """Heliostats that none of the targets faces, and that have no observations."""
        return self._campaign.unseen()

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the observations: .csv, .parquet, .json or .jsonl, as ``helio-rs calibrate`` reads them."""
        self._campaign.write(path, truth=False)

    def write_truth(self, path: str | os.PathLike[str]) -> None:
        """Writes the true errors as a calibration table, as ``helio-rs track`` reads it."""
        self._campaign.write(path, truth=True)

    def __len__(self) -> int:
        return len(self._campaign.observations()["time"])

    def __repr__(self) -> str:
        return f"<{len(self)} simulated observations>"


def _instant(name: str, time: Any) -> int:
    from helio_py._times import instant  # which imports more than a package should by itself

    return instant(name, time)


def _jump(jump: Any) -> tuple[int, float, float]:
    parts = several("jumps", jump, "(time, mrad, mrad)")
    if len(parts) != 3:
        raise of(ShapeError(f"jumps: expected (time, mrad, mrad), got {len(parts)} parts"), "jumps")
    return _instant("jumps", parts[0]), number("jumps", parts[1]), number("jumps", parts[2])
