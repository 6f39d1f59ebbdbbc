"""``calibrate`` and what it found."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from helio_py._asked import plan_of, priors_of, sets_of, words_of
from helio_py._checked import flag, number, text, wrong_type, wrong_value
from helio_py._checked import path as checked_path
from helio_py._native import Field, _calibrate, _write_table
from helio_py._progress import reporter
from helio_py._tables import Column, given_back, kind_of

if TYPE_CHECKING:
    from datetime import date
    from os import PathLike

    from numpy.typing import NDArray

    from helio_py._joint import JointCalibration

_ERRORS = (
    "pedestal_tilt_rad",
    "pedestal_tilt_azimuth_rad",
    "axis_nonorthogonality_rad",
    "mirror_tilt_rad",
    "azimuth_reference_rad",
    "elevation_reference_rad",
)
#: Options of heliostat by heliostat, as they are unless somebody says otherwise.
_USUAL: dict[str, Any] = {
    "solver": "hartley-meyer",
    "residual": "components",
    "robust": "none",
    "sets": "1",
    "fit_mirror_offset": False,
    "hold": [],
    "prior": [],
    "keep_all": False,
    "no_jumps": False,
}


class Calibration:
    """The errors of heliostats as observations tell them: k parameter sets, one for most heliostats.

    Made by ``calibrate``. A set whose status is not ok keeps its place and has NaN for its errors; ``why`` says what is
    wrong in words.
    """

    #: Tables that there may be.
    _tables: tuple[str, ...] = ("calibration", "rejected", "residuals", "choices", "plan", "changes")

    def __init__(self, found: dict[str, Any], kind: str) -> None:
        """Of what the native part found; not for users."""
        self._found = found
        self._kind = kind
        self._columns: dict[str, tuple[str, Any]] = {
            name: (holds, cells) for name, holds, cells in found["calibration"]
        }

    def _text(self, name: str) -> list[str]:
        return list(self._columns[name][1])

    def _numbers(self, name: str) -> NDArray[np.float64]:
        return np.array(self._columns[name][1], dtype=np.float64)

    def __len__(self) -> int:
        return len(self._columns["id"][1])

    def __repr__(self) -> str:
        ok = self.status.count("ok")
        return f"<Calibration of {len(self)} sets: {ok} ok, {len(self) - ok} not>"

    @property
    def ids(self) -> list[str]:
        """Heliostat of each set."""
        return self._text("id")

    @property
    def sets(self) -> list[str]:
        """Name of each set; empty where a heliostat has but one."""
        return self._text("set")

    @property
    def status(self) -> list[str]:
        """Word for what became of each set: "ok", or why there is no result."""
        return self._text("status")

    @property
    def why(self) -> list[str]:
        """The same in a sentence; empty for what is ok."""
        return self._text("why")

    def _error(self, number: int) -> NDArray[np.float64]:
        return np.ascontiguousarray(self._found["errors"][:, number])

    @property
    def pedestal_tilt_rad(self) -> NDArray[np.float64]:
        """Lean of the fixed axis [rad], shape (k,)."""
        return self._error(0)

    @property
    def pedestal_tilt_azimuth_rad(self) -> NDArray[np.float64]:
        """Where the fixed axis leans to [rad]."""
        return self._error(1)

    @property
    def axis_nonorthogonality_rad(self) -> NDArray[np.float64]:
        """Moving axis away from square to the fixed axis [rad]."""
        return self._error(2)

    @property
    def mirror_tilt_rad(self) -> NDArray[np.float64]:
        """Mirror plane away from parallel with the moving axis [rad]."""
        return self._error(3)

    @property
    def azimuth_reference_rad(self) -> NDArray[np.float64]:
        """Reference of the first axis' encoder [rad]."""
        return self._error(4)

    @property
    def elevation_reference_rad(self) -> NDArray[np.float64]:
        """Reference of the second axis' encoder [rad]."""
        return self._error(5)

    @property
    def mirror_offset_m(self) -> NDArray[np.float64]:
        """Pivot to mirror centre [m]; NaN where it was not fitted."""
        return np.array(self._found["mirror_offset_m"])

    @property
    def sigma(self) -> dict[str, NDArray[np.float64]]:
        """One standard deviation of each parameter, by its name [rad, m]; NaN where it was not fitted."""
        names = (*_ERRORS, "mirror_offset_m")
        return {name: np.ascontiguousarray(self._found["sigmas"][:, k]) for k, name in enumerate(names)}

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the fitted parameters, shape (k, 7, 7) [rad, m].

        In the order tilt along both of the mount's axes, azimuth reference, axis non-orthogonality, elevation
        reference, mirror tilt, mirror offset.
        """
        return np.array(self._found["covariance"])

    @property
    def rms_mrad(self) -> NDArray[np.float64]:
        """Root mean square of the residuals over the distance from pivot to target [mrad]."""
        return self._numbers("rms_mrad")

    @property
    def beam_rms_mrad(self) -> NDArray[np.float64]:
        """The same of the angle between beam and spot as seen from the mirror [mrad]."""
        return self._numbers("beam_rms_mrad")

    @property
    def year_pointing_mrad(self) -> NDArray[np.float64]:
        """How uncertain the pointing over the year is [mrad]."""
        return self._numbers("year_pointing_mrad")

    @property
    def observations(self) -> NDArray[np.int64]:
        """Records that each set is fitted to."""
        return np.array(self._columns["observations"][1])

    @property
    def rejected(self) -> NDArray[np.int64]:
        """Records set aside."""
        return np.array(self._columns["rejected"][1])

    @property
    def findings(self) -> list[tuple[str, str]]:
        """What else was found: heliostat and sentence."""
        return list(self._found["findings"])

    @property
    def warnings(self) -> list[str]:
        """Things worth saying about the observations, that stop nothing."""
        return list(self._found["warnings"])

    @property
    def changes(self) -> list[str]:
        """What changed against the calibration that `compare` named, in sentences; nothing without one.

        Of all heliostats together, then of each, the greatest change first. The same in numbers is the table "changes".
        """
        return list(self._found["changes_said"])

    @property
    def _table_columns(self) -> list[Column]:
        """What stands for it where a table is wanted."""
        return self._table("calibration")

    def _table(self, kind: str) -> list[Column]:
        known = [name for name in self._tables if name in self._found]
        if not isinstance(kind, str) or kind not in known:
            raise wrong_value("kind", f"wanted {', '.join(known[:-1])} or {known[-1]}, got `{kind}`")
        columns: list[Column] = self._found[kind]
        return columns

    def to_table(self, kind: str = "calibration") -> Any:
        """A table of the kind that the observations were given as; a dict of arrays for a dict or a path.

        Parameters
        ----------
        kind : str, default "calibration"
            "calibration", the table that ``helio-rs track`` reads; "rejected", the records set aside and why; or
            "residuals", for every record the spot seen (`u_m`, `v_m`), where its beam should have landed
            (`predicted_u_m`, `predicted_v_m`) and where by the errors of the field before (`before_u_m`,
            `before_v_m`), with the angles to both [mrad]; the prediction is NaN for a record that no calibration uses,
            one of "rejected".

            Where they were asked for also "plan", the next observations; "changes", by how far beams move against an
            earlier calibration over the year (`beam_mrad`), whether significantly (`significant`: "yes", "no", or
            "unknown" for the reason in `why`), and the test that says so; "choices", with `sets` other than 1, how
            well each number of sets over the day does, and which is taken.
        """
        return given_back(self._table(kind), self._kind)

    def write(self, path: str | PathLike[str], kind: str = "calibration") -> None:
        """Writes a table, as the command line does; .csv, .parquet, .json or .jsonl."""
        _write_table(path, self._table(kind))

    def apply(self, field: Field) -> Field:
        """The field with this calibration in the place of the one it has.

        As if `field.toml` named the written table: heliostats without a result keep what the layout states. Of a field
        read from files these must not have changed; of a field made of columns these are the layout.
        """
        if not isinstance(field, Field):
            raise wrong_type("field", "a Field", field)
        return field._calibrated(self._found["calibration"])


@overload
def calibrate(
    field: Field,
    observations: Any,
    *,
    spots: Any | None = None,
    solver: str = "hartley-meyer",
    residual: str = "components",
    robust: str = "none",
    sets: str | int = "1",
    fit_mirror_offset: bool = False,
    hold: str | Iterable[str] = (),
    prior: Mapping[str, tuple[float, float]] | Iterable[str] = (),
    keep_all: bool = False,
    no_jumps: bool = False,
    max_year_pointing_mrad: float | None = None,
    joint: Literal[True],
    update: str | PathLike[str] | bytes | bytearray | memoryview | JointCalibration | None = None,
    state: str | PathLike[str] | None = None,
    ahead_days: float | None = None,
    leftovers: bool = False,
    plan: tuple[int, str | date] | None = None,
    compare: Any | None = None,
    report: str | PathLike[str] | None = None,
    progress: Callable[[int, int], Any] | bool | None = None,
) -> JointCalibration: ...
@overload
def calibrate(
    field: Field,
    observations: Any,
    *,
    spots: Any | None = None,
    solver: str = "hartley-meyer",
    residual: str = "components",
    robust: str = "none",
    sets: str | int = "1",
    fit_mirror_offset: bool = False,
    hold: str | Iterable[str] = (),
    prior: Mapping[str, tuple[float, float]] | Iterable[str] = (),
    keep_all: bool = False,
    no_jumps: bool = False,
    max_year_pointing_mrad: float | None = None,
    joint: Literal[False] = False,
    update: str | PathLike[str] | bytes | bytearray | memoryview | JointCalibration,
    state: str | PathLike[str] | None = None,
    ahead_days: float | None = None,
    leftovers: bool = False,
    plan: tuple[int, str | date] | None = None,
    compare: Any | None = None,
    report: str | PathLike[str] | None = None,
    progress: Callable[[int, int], Any] | bool | None = None,
) -> JointCalibration: ...
@overload
def calibrate(
    field: Field,
    observations: Any,
    *,
    spots: Any | None = None,
    solver: str = "hartley-meyer",
    residual: str = "components",
    robust: str = "none",
    sets: str | int = "1",
    fit_mirror_offset: bool = False,
    hold: str | Iterable[str] = (),
    prior: Mapping[str, tuple[float, float]] | Iterable[str] = (),
    keep_all: bool = False,
    no_jumps: bool = False,
    max_year_pointing_mrad: float | None = None,
    joint: bool = False,
    update: None = None,
    state: str | PathLike[str] | None = None,
    ahead_days: float | None = None,
    leftovers: bool = False,
    plan: tuple[int, str | date] | None = None,
    compare: Any | None = None,
    report: str | PathLike[str] | None = None,
    progress: Callable[[int, int], Any] | bool | None = None,
) -> Calibration: ...
def calibrate(
    field: Field,
    observations: Any,
    *,
    spots: Any | None = None,
    solver: str = "hartley-meyer",
    residual: str = "components",
    robust: str = "none",
    sets: str | int = "1",
    fit_mirror_offset: bool = False,
    hold: str | Iterable[str] = (),
    prior: Mapping[str, tuple[float, float]] | Iterable[str] = (),
    keep_all: bool = False,
    no_jumps: bool = False,
    max_year_pointing_mrad: float | None = None,
    joint: bool = False,
    update: str | PathLike[str] | bytes | bytearray | memoryview | JointCalibration | None = None,
    state: str | PathLike[str] | None = None,
    ahead_days: float | None = None,
    leftovers: bool = False,
    plan: tuple[int, str | date] | None = None,
    compare: Any | None = None,
    report: str | PathLike[str] | None = None,
    progress: Callable[[int, int], Any] | bool | None = None,
) -> Calibration:
    """The angular errors of every heliostat from observations of its spot.

    Heliostat by heliostat, or with `joint` or `update` of the field as one: what heliostats share, how they differ, how
    their zero points move.

    Parameters
    ----------
    field : Field
        With the targets that observations name: read from files, or made with `targets` (and a `site`, where records
        have times and no sun).
    observations : table
        Columns `heliostat_id`, `time` (with zone) or `sun_azimuth_deg, sun_elevation_deg`, encoder angles
        `axis1_deg, axis2_deg` or motor steps `axis1_steps, axis2_steps`, `target`, the spot as `u_m, v_m` or
        `spot_east_m, spot_north_m, spot_up_m`, and optionally `sigma_m`. A pandas, polars or pyarrow table, anything
        else with ``__arrow_c_stream__``, a dict of columns, or the path of a CSV or Parquet file.
    spots : table, optional
        Spots of the frames that the observations name in a column `file`, as ``helio-rs spot`` writes them.
    solver : str, default "hartley-meyer"
        Or "gauss-newton" (Guo 2015).
    residual : str, default "components"
        What is made small: both components of each spot, their "distance" as in the paper, or those across the
        "beam".
    robust : str, default "none"
        How much large residuals count in the last fit: "none", "huber", "student-t" or "cauchy".
    sets : str or int, default 1
        Parameter sets over the day: 1, 2, or "auto" for as many as predict unseen days best.
    fit_mirror_offset : bool, default False
        Whether the mirror offset is a seventh parameter.
    hold : str or sequence of str, optional
        Parameters to keep as the field states them: "pedestal_tilt", "axis_nonorthogonality", "mirror_tilt",
        "azimuth_reference", "elevation_reference", "mirror_offset".
    prior : mapping, optional
        Mean and standard deviation of parameters by those names [degrees; metres for "mirror_offset"].
    keep_all : bool, default False
        Whether every record that is a number is kept.
    no_jumps : bool, default False
        Whether no jumps of the encoder references are looked for.
    max_year_pointing_mrad : float, optional
        Parameters whose predicted pointing over the year is more uncertain are refused; by default from 2 on, and of the
        field as one none.
    joint : bool, default False
        Whether the field is fitted as one: a row for every heliostat of the layout. Of the options above only `spots`,
        `keep_all`, `no_jumps` and `max_year_pointing_mrad` then make sense, and any other is refused.
    update : path, bytes or JointCalibration, optional
        A state into which new observations are taken: the file that `state` or ``helio-rs calibrate --state`` wrote, the
        `state` of a ``JointCalibration``, or that itself. It stays as it is, a file too: where the new one goes says
        `state`, which may be the same file.
    state : path, optional
        File for the state after `joint` or `update`.
    ahead_days : float, default 1
        Days after the last record of the field that the rows are for; of `joint` and `update`.
    leftovers : bool, default False
        Whether to look for what is left of the misses as a smooth function of the pose; of `joint`.
    plan : tuple, optional
        How many observations of each heliostat to propose, those that lower its predicted pointing uncertainty most, and
        for which day, as text or ``datetime.date``, such as ``(3, "2026-06-21")``: the table "plan".
    compare : table or Calibration, optional
        An earlier calibration, also as a file that ``helio-rs calibrate`` wrote: `changes` and the table "changes" say
        by how far beams move over the year, and whether significantly.
    report : path, optional
        File for a page to look at, which needs nothing from outside: before and after, residuals, parameters, rejected
        records; of the field as one what its heliostats share, how they differ and what was foretold. It ends in .html,
        and appears whole once everything else is found.
    progress : callable or True, optional
        Called with the numbers of heliostats done and of all; True for a bar of tqdm.

    Returns
    -------
    Calibration
        With `joint` or `update` a ``JointCalibration``.

    Raises
    ------
    FileError, OptionError, DataTypeError, MissingError, CalibrationError

    Notes
    -----
    The numbers of ``helio-rs calibrate`` on the same table to the last bit, its states, sentences and pages. Ctrl-C ends it
    within a second; a heliostat in the middle of its fit is left to itself.

    Examples
    --------
    >>> import helio_py as hp
    >>> field = hp.Field.from_toml("examples/field.toml")
    >>> calibration = hp.calibrate(field, "examples/observations.csv")
    >>> calibration.status[0]
    'ok'
    >>> calibrated = calibration.apply(field)
    >>> bool(calibrated.mirror_tilt_rad[0] == calibration.mirror_tilt_rad[0])
    True

    What to look at next, and what changed against an earlier calibration:

    >>> again = hp.calibrate(
    ...     field, "examples/observations.csv", robust="huber", plan=(3, "2026-06-21"), compare=calibration
    ... )
    >>> set(again.to_table("plan")["id"]) == set(calibration.ids)
    True
    >>> set(again.to_table("changes")["significant"].tolist())
    {'no'}
    >>> again.changes[1].startswith(again.to_table("changes")["id"][0])
    True

    The field as one, and new observations on top of what is known:

    >>> known = hp.calibrate(field, "examples/observations.csv", joint=True)
    >>> len(known) == len(field)
    True
    >>> try:
    ...     hp.calibrate(field, "examples/observations.csv", update=known.state)
    ... except hp.OptionError as error:
    ...     "taken in already" in str(error)
    True
    """
    words = {
        "solver": text("solver", solver),
        "residual": text("residual", residual),
        "robust": text("robust", robust),
        "sets": sets_of(sets),
        "fit_mirror_offset": flag("fit_mirror_offset", fit_mirror_offset),
        "hold": words_of("hold", hold),
        "prior": priors_of(prior),
        "keep_all": flag("keep_all", keep_all),
        "no_jumps": flag("no_jumps", no_jumps),
    }
    beside = {"plan": plan_of(plan), "report": None if report is None else checked_path("report", report)}
    most = None if max_year_pointing_mrad is None else number("max_year_pointing_mrad", max_year_pointing_mrad)
    if flag("joint", joint) or update is not None:
        from helio_py._joint import as_one

        asked = {
            "joint": joint,
            "update": update,
            "state": state,
            "keep_all": words["keep_all"],
            "no_jumps": words["no_jumps"],
            "ahead_days": ahead_days,
            "max_year_pointing_mrad": most,
            "leftovers": leftovers,
            **beside,
        }
        given = {name: value for name, value in words.items() if value != _USUAL[name]}
        return as_one(field, observations, spots, compare, given, asked, progress)
    for name, value in (
        ("state", state),
        ("ahead_days", ahead_days),
        ("leftovers", flag("leftovers", leftovers) or None),
    ):
        if value is not None:
            raise wrong_value(name, "is of the field as one; wanted joint=True or update beside it")
    asked = {**words, **beside, "max_year_pointing_mrad": 2.0 if most is None else most}
    with reporter(progress, "heliostats") as told:
        found = _calibrate(field, observations, spots, compare, asked, told)
    return Calibration(found, kind_of(observations))
