"""``correct`` and ``verify``: set-points with what is left by pose, and their beams followed back to the target."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from helio_py._checked import wrong_type, wrong_value
from helio_py._joint import JointCalibration
from helio_py._native import Tracking, _correct, _tracked_table, _verify
from helio_py._progress import reporter
from helio_py._status import status_words

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from helio_py._native import Field


class Corrected(NamedTuple):
    """Axis angles with what a joint calibration left by pose, each column of the shape of the tracking.

    Made by ``correct``. Angles of a row whose status is not ok are NaN, and so are corrections where none is known.
    """

    #: Encoder angle of the first axis, corrected [rad].
    azimuth_rad: NDArray[np.float64]
    #: Encoder angle of the second axis, corrected [rad].
    elevation_rad: NDArray[np.float64]
    #: Half the angle between sun and aim [rad], as the tracking has it.
    incidence_rad: NDArray[np.float64]
    #: How far the better solution lies outside the axis limits [rad], as the tracking has it.
    limit_excess_rad: NDArray[np.float64]
    #: What became of each row: uint8 numbers of ``Status``.
    status: NDArray[np.uint8]
    #: What was added to the first angle [rad].
    leftover_axis1_rad: NDArray[np.float64]
    #: What was added to the second angle [rad].
    leftover_axis2_rad: NDArray[np.float64]
    #: One standard deviation of what is still wrong with the first angle [rad].
    sigma_axis1_rad: NDArray[np.float64]
    #: One standard deviation of what is still wrong with the second angle [rad].
    sigma_axis2_rad: NDArray[np.float64]
    #: Things worth saying that stop nothing: heliostats of another calibration than the one corrected.
    warnings: list[str]

    @property
    def axis1_rad(self) -> NDArray[np.float64]:
        """The neutral name of `azimuth_rad`."""
        return self.azimuth_rad

    @property
    def axis2_rad(self) -> NDArray[np.float64]:
        """The neutral name of `elevation_rad`."""
        return self.elevation_rad

    @property
    def status_words(self) -> NDArray[np.str_]:
        """The words of `status`, as files and the command line have them."""
        return status_words(self.status)

    def to_table(
        self,
        field: Field,
        kind: str = "dict",
        *,
        times: Any | None = None,
        sun_azimuth_rad: ArrayLike | None = None,
        sun_elevation_rad: ArrayLike | None = None,
    ) -> Any:
        """The table that ``helio-rs track --leftovers`` writes, a row for each sun and heliostat, sun by sun.

        The columns of ``Tracking.to_table`` and, before `status`, `leftover_axis1_mrad, leftover_axis2_mrad,
        sigma_axis1_mrad, sigma_axis2_mrad`. `field` and the suns are those that were tracked: one of `times` and the two
        angles says which suns the rows are of.
        """
        columns = [*_angles(self), *_corrections(self)]
        suns = (times, sun_azimuth_rad, sun_elevation_rad)
        return _tracked_table(field, columns, self.status, (True, False), kind, *suns)


class Verified(NamedTuple):
    """What became of beams that were followed back, each column of the shape of the tracking. Made by ``verify``."""

    #: Angle at the mirror's centre between the beam and the heliostat's aim [rad]; NaN where the status is not ok.
    beam_error_rad: NDArray[np.float64]
    #: What became of each row: uint8 numbers of ``Status``.
    status: NDArray[np.uint8]

    def to_table(
        self,
        field: Field,
        tracking: Tracking | Corrected,
        kind: str = "dict",
        *,
        times: Any | None = None,
        sun_azimuth_rad: ArrayLike | None = None,
        sun_elevation_rad: ArrayLike | None = None,
    ) -> Any:
        """The table that ``helio-rs track --verify`` writes: the tracking's with `beam_error_mrad`, and these statuses.

        `field`, `tracking` and the suns are those that were verified.
        """
        tracking = _tracked(tracking)
        azimuth, elevation, incidence, excess = _angles(tracking)
        if tracking.status.shape == self.status.shape:
            # By how much such a row is outside is not known: its angles are inside.
            excess = np.where(tracking.status == self.status, excess, np.nan)
        corrections = _corrections(tracking) if isinstance(tracking, Corrected) else []
        columns = [azimuth, elevation, incidence, excess, *corrections, self.beam_error_rad]
        suns = (times, sun_azimuth_rad, sun_elevation_rad)
        return _tracked_table(field, columns, self.status, (bool(corrections), True), kind, *suns)


def _angles(tracking: Tracking | Corrected) -> list[NDArray[np.float64]]:
    return [tracking.azimuth_rad, tracking.elevation_rad, tracking.incidence_rad, tracking.limit_excess_rad]


def _corrections(tracking: Corrected) -> list[NDArray[np.float64]]:
    left = [tracking.leftover_axis1_rad, tracking.leftover_axis2_rad]
    return [*left, tracking.sigma_axis1_rad, tracking.sigma_axis2_rad]


def _tracked(tracking: Any) -> Tracking | Corrected:
    if not isinstance(tracking, (Tracking, Corrected)):
        raise wrong_type("tracking", "a Tracking or a Corrected", tracking)
    return tracking


def correct(
    field: Field,
    tracking: Tracking,
    leftovers: Any,
    *,
    progress: Callable[[int, int], Any] | bool | None = None,
) -> Corrected:
    """Axis angles corrected by what a joint calibration left by pose.

    Parameters
    ----------
    field : Field
        The heliostats that were tracked, n of them, with the calibration that the leftovers were written along with.
    tracking : Tracking
        Their axis angles, of shape (n,) or (m, n).
    leftovers : JointCalibration, table or path
        What ``calibrate(..., joint=True, leftovers=True)`` found, its table "leftovers" of any kind, or the file that
        ``helio-rs calibrate --joint --leftovers`` wrote. Read at every call: give many suns at once.
    progress : callable or True, optional
        Called with the numbers of rows done and of all; True for a bar of tqdm.

    Returns
    -------
    Corrected
        A heliostat without a row in the table keeps its angles. A correction ends at the limits of its axis, which are
        those of its drive too.

    Raises
    ------
    DataTypeError, ShapeError, FileError, OptionError
        ConflictError, a FileError, for a field whose calibration changes with the hour or the date: leftovers
        belong to one.

    Notes
    -----
    The manual's page "Leftovers by pose" has the model. The numbers of ``helio-rs track --leftovers`` to the last bit.
    Where heliostats have another calibration now, `warnings` says so.

    Examples
    --------
    >>> import helio_py as hp
    >>> field = hp.Field.from_toml("examples/field.toml")
    >>> seen = hp.simulate_observations(field, heliostats=8, count=20, random_errors=True, seed=4)
    >>> found = hp.calibrate(field, seen.observations, joint=True, leftovers=True)
    >>> field = found.apply(field)
    >>> corrected = hp.correct(field, hp.track(field, 3.0, 0.8), found)
    >>> corrected.azimuth_rad.shape, float(corrected.leftover_axis1_rad[0])  # nothing was left
    ((500,), 0.0)
    """
    if not isinstance(tracking, Tracking):
        raise wrong_type("tracking", "a Tracking", tracking)
    if isinstance(leftovers, JointCalibration):
        if leftovers.leftovers is None:
            raise wrong_value(
                "leftovers", "this calibration looked for none: calibrate(..., joint=True, leftovers=True)"
            )
        leftovers = SimpleNamespace(_table_columns=leftovers._table("leftovers"))  # as it is, with texts of some 30 kB
    with reporter(progress, "rows") as report:
        found = _correct(field, _angles(tracking), tracking.status, leftovers, report)
    return Corrected(**found)


def verify(
    field: Field,
    tracking: Tracking | Corrected,
    sun_azimuth_rad: ArrayLike,
    sun_elevation_rad: ArrayLike,
    *,
    times: Any | None = None,
) -> Verified:
    """Follows each beam back to the target: through whole motor steps where there is a drive, then forward.

    Shading and blocking are not computed.

    Parameters
    ----------
    field : Field
        The heliostats that were tracked, n of them.
    tracking : Tracking or Corrected
        Their axis angles, of shape (n,) or (m, n). Corrections by pose are taken out again: followed back through the
        mount's angles alone, they would look like errors.
    sun_azimuth_rad, sun_elevation_rad : float or array of shape (m,)
        Where the sun is seen [rad], as ``track`` was given it.
    times : optional
        When each sun is seen, of the suns' shape. Only a calibration that changes with the date looks at it.

    Returns
    -------
    Verified
        Statuses are those of the tracking, but ``MISSES_TARGET`` where a beam does not meet the plane of its target, and
        ``OUTSIDE_LIMITS`` where the whole step nearest to an end of a drive lies beyond it.

    Raises
    ------
    DataTypeError, ShapeError, SunDirectionError, TimeError, AngleError

    Notes
    -----
    The numbers of ``helio-rs track --verify`` to the last bit. Angles of axes without a
    drive are followed back as they are.

    Examples
    --------
    >>> import helio_py as hp
    >>> field = hp.Field([[0.0, 100.0, 0.0]], [0.0, 0.0, 80.0], mirror_offset_m=0.2)
    >>> verified = hp.verify(field, hp.track(field, 3.0, 0.8, offset="none"), 3.0, 0.8)
    >>> (1e3 * verified.beam_error_rad).round(1), verified.status  # mrad that the offset is worth
    (array([0.1]), array([0], dtype=uint8))
    """
    tracking = _tracked(tracking)
    columns = _angles(tracking)[:2]
    if isinstance(tracking, Corrected):
        columns += _corrections(tracking)[:2]
    return Verified(*_verify(field, columns, tracking.status, sun_azimuth_rad, sun_elevation_rad, times))
