"""``predict``: where beams land."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, overload

from helio_py._errors import OptionError
from helio_py._native import Field, _angles, _landed_table, _predict, _predict_rows

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray


class Prediction(NamedTuple):
    """Where beams land, each column of shape (n,) for the sun of two numbers, (m, n) for m suns.

    Numbers of a row whose status is not ok are NaN.
    """

    #: On the target's plane, right of its centre as a camera facing it sees it [m].
    u_m: NDArray[np.float64]
    #: Below its centre [m].
    v_m: NDArray[np.float64]
    #: The spot in the world, with a last axis of east, north, up [m].
    point_enu_m: NDArray[np.float64]
    #: Angle at the mirror's centre between the beam and the heliostat's aim [rad].
    beam_error_rad: NDArray[np.float64]
    #: What became of each row: uint8 numbers of ``Status``.
    status: NDArray[np.uint8]

    def to_table(
        self,
        field: Field,
        kind: str = "dict",
        *,
        times: Any | None = None,
        sun_azimuth_rad: ArrayLike | None = None,
        sun_elevation_rad: ArrayLike | None = None,
    ) -> Any:
        """The table that ``helio-rs predict`` writes, a row for each sun and heliostat, sun by sun.

        Columns `time` (or `sun_azimuth_deg, sun_elevation_deg`), `id, u_m, v_m, east_m, north_m, up_m, beam_error_mrad,
        status`; as "dict" (of arrays), "pandas", "polars" or "pyarrow". `field` and the suns are those of the call: one
        of `times` and the two angles says which suns the rows are of.
        """
        return _landed_table(field, list(self), kind, times, sun_azimuth_rad, sun_elevation_rad, None)


@overload
def predict(
    field: Field,
    azimuth_rad: ArrayLike,
    elevation_rad: ArrayLike,
    sun_azimuth_rad: ArrayLike,
    sun_elevation_rad: ArrayLike,
    *,
    times: Any | None = None,
) -> Prediction: ...
@overload
def predict(
    field: Field,
    azimuth_rad: Any,
    elevation_rad: None = None,
    sun_azimuth_rad: None = None,
    sun_elevation_rad: None = None,
    *,
    times: None = None,
    kind: str | None = None,
) -> Any: ...
def predict(
    field: Field,
    azimuth_rad: Any,
    elevation_rad: Any = None,
    sun_azimuth_rad: Any = None,
    sun_elevation_rad: Any = None,
    *,
    times: Any | None = None,
    kind: str | None = None,
) -> Any:
    """Where the beam of each heliostat lands on its target, from axis angles.

    Shading and blocking are not computed. A heliostat that aims at a mere point has the plane through it that faces
    the heliostat, its right edge level.

    Parameters
    ----------
    field : Field
        The heliostats, n of them.
    azimuth_rad, elevation_rad : array of shape (n,) or (m, n)
        Encoder angles of both axes [rad], as ``track`` gives them; NaN where there is none.
    sun_azimuth_rad, sun_elevation_rad : float or array of shape (m,)
        Where the sun is seen [rad], as for ``track``.
    times : optional
        When each sun is seen, of the suns' shape. Only a calibration that changes with the date looks at it.
    kind : str, optional
        With a table of angles in the place of `azimuth_rad`, and nothing beside it: which kind of table is wanted back.
        By default the kind of the one given.

    Returns
    -------
    Prediction or table
        Statuses are ``OK``, ``SUN_BELOW_HORIZON`` and ``MISSES_TARGET`` (also of rows without angles).

    Raises
    ------
    ShapeError, DataTypeError, AngleError, SunDirectionError, TimeError

    Notes
    -----
    A table of angles has the columns that ``helio-rs predict --angles`` takes, such as a Tracking's table has: `id`,
    `azimuth_deg, elevation_deg` (or `axis1_steps, axis2_steps`), and `time` or `sun_azimuth_deg, sun_elevation_deg`. Rows
    come back in its order, those without angles left aside.

    Guo 2015 eqs. (30) to (36); the numbers of ``helio-rs predict`` to the last bit.

    Examples
    --------
    >>> import helio_py as hp
    >>> field = hp.Field([[0.0, 100.0, 0.0]], [0.0, 0.0, 80.0], mirror_offset_m=0.2)
    >>> tracking = hp.track(field, 3.0, 0.8)
    >>> landed = hp.predict(field, tracking.azimuth_rad, tracking.elevation_rad, 3.0, 0.8)
    >>> abs(landed.beam_error_rad) < 1e-9
    array([ True])
    """
    if all(given is None for given in (elevation_rad, sun_azimuth_rad, sun_elevation_rad, times)):
        return _of_table(field, azimuth_rad, kind)
    if kind is not None:
        raise _refused("kind", "it is of a table of angles; a Prediction has to_table")
    return Prediction(*_predict(field, azimuth_rad, elevation_rad, sun_azimuth_rad, sun_elevation_rad, times))


def _refused(name: str, message: str) -> OptionError:
    error = OptionError(f"{name}: {message}")
    error.field = name
    return error


def _of_table(field: Field, angles: Any, kind: str | None) -> Any:
    """Row by row; rows of one sun that follow each other are predicted at once."""
    from helio_py._tables import checked_kind, kind_of

    wanted = kind_of(angles) if kind is None else checked_kind(kind)
    read = _angles(field, angles)
    heliostats, times = read["heliostat"].tolist(), read.get("unix_ns")
    moment: list[Any]
    if times is not None:
        stamps = times.view("datetime64[ns]")
        sun = field.sun_position(stamps)
        suns = [sun.azimuth_rad, sun.elevation_rad]
        moment = [stamps, None, None]
    elif "sun_azimuth_rad" in read:
        suns = [read["sun_azimuth_rad"], read["sun_elevation_rad"]]
        moment = [None, *suns]
    else:
        raise _refused("azimuth_rad", "a table of angles wants a column time, or sun_azimuth_deg and sun_elevation_deg")
    axes = [read["azimuth_rad"], read["elevation_rad"]]
    landed = _predict_rows(field, heliostats, axes, suns, None if times is None else times.tolist())
    return _landed_table(field, landed, wanted, moment[0], moment[1], moment[2], heliostats)
