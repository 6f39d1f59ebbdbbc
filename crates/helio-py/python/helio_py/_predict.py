"""``predict``: where beams land."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from helio_py._native import Field, _predict

if TYPE_CHECKING:
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


def predict(
    field: Field,
    azimuth_rad: ArrayLike,
    elevation_rad: ArrayLike,
    sun_azimuth_rad: ArrayLike,
    sun_elevation_rad: ArrayLike,
    *,
    times: Any | None = None,
) -> Prediction:
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

    Returns
    -------
    Prediction
        Statuses are ``OK``, ``SUN_BELOW_HORIZON`` and ``MISSES_TARGET`` (also of rows without angles).

    Raises
    ------
    ShapeError, DataTypeError, AngleError, SunDirectionError, TimeError

    Notes
    -----
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
    return Prediction(*_predict(field, azimuth_rad, elevation_rad, sun_azimuth_rad, sun_elevation_rad, times))
