"""PAINT records into a field and its observations.

PAINT (Phipps et al., Nature Energy 2026, doi 10.1038/s41560-026-02070-1) publishes the heliostats of the solar tower
in Jülich: geodetic places, kinematics with linear actuators, and for each calibration picture motor steps, sun and the
spot's centre as a geodetic point. Its conventions and ours stand side by side in the manual, "From ARTIST and PAINT".
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helio_py._checked import path as checked_path
from helio_py._checked import several, text, wrong_type, wrong_value
from helio_py._errors import (
    ConflictError,
    FileSyntaxError,
    FileUnreadableError,
    FileValueError,
    MissingError,
)

FilePath: TypeAlias = str | os.PathLike[str]

_PROPERTIES = "-heliostat-properties.json"
_RECORD = "-calibration-properties.json"
#: Spots of the published revision that lies on the surveyed planes are off them by rounding alone.
_OFF_PLANE_M = 0.02
# WGS 84.
_A_M = 6378137.0
_F = 1 / 298.257223563


@dataclass(frozen=True, eq=False)
class Paint:
    """What `convert_paint` made of PAINT records."""

    #: The field.toml, for `Field.from_toml` and the command line.
    field_toml: Path
    #: The table of observations, for `calibrate`.
    observations_csv: Path
    #: Heliostats converted.
    heliostats: list[str]
    #: Records converted.
    records: int
    #: How far each record's spot lies before the plane of its target [m]; the published revision that lies on the
    #: planes has some millimetres.
    off_plane_m: NDArray[np.float64]
    #: Records left aside, with the reason.
    left_aside: list[tuple[Path, str]] = field(default_factory=list)
    #: Things worth saying that stopped nothing.
    warnings: list[str] = field(default_factory=list)


def convert_paint(
    tower: FilePath,
    records: FilePath | Mapping[str, Iterable[FilePath]],
    out: FilePath,
    *,
    heliostats: Mapping[str, FilePath] | None = None,
    centroid: str = "HeliOS",
    aim: str | None = None,
) -> Paint:
    """Turns PAINT records into a field.toml with its tables and a table of observations.

    Parameters
    ----------
    tower : path
        The tower-measurements.json: targets become those of the field by their four corners, the plant's point becomes
        the origin and the site.
    records : path or mapping
        A folder in PAINT's own order (``AA39/Calibration/…-calibration-properties.json`` and
        ``AA39/Properties/AA39-heliostat-properties.json``), or the calibration records of each heliostat by its name.
    out : path
        Folder for field.toml, heliostats.csv, drives.csv and observations.csv; made if it is not there.
    heliostats : mapping, optional
        With a mapping of records: the heliostat-properties.json of each heliostat.
    centroid : str, default "HeliOS"
        Which of the published centres is the spot: "HeliOS" or "UTIS".
    aim : str, optional
        Target that the heliostats aim at in field.toml; by default the first.

    Returns
    -------
    Paint
        Where the files are, how far spots lie off their planes, and which records were left aside: those without a sun
        (PAINT has published revisions without), without this centroid, or on a target without a plane.

    Raises
    ------
    FileError, OptionError

    Notes
    -----
    Geodetic coordinates become east, north, up of the plant's point by the full rotation (WGS 84). Azimuths of PAINT count
    from south, east positive: ours are 180° less those. The mount is `pitch-roll` with the first axis to the east; the first
    actuator's angle grows as the mirror tips to the south, ours the other way, hence its sign of -1.
    """
    if text("centroid", centroid) not in ("HeliOS", "UTIS"):
        raise wrong_value("centroid", f"wanted HeliOS or UTIS, got `{centroid}`")
    aim = None if aim is None else text("aim", aim)
    out = checked_path("out", out)
    properties, found = _files(records, heliostats)
    origin, targets, warnings = _tower(Path(checked_path("tower", tower)))
    if aim is not None and aim not in targets:
        raise wrong_value("aim", f"no plane target `{aim}` in {tower}; known are {', '.join(sorted(targets))}")
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unreadable(folder, error) from None
    layout, drives = [], []
    for name, path in properties.items():
        row, actuators = _heliostat(name, path, origin)
        layout.append(row)
        drives += actuators
    rows, off_plane, left_aside = _observations(found, origin, targets, centroid)
    files = {
        "heliostats.csv": layout,
        "drives.csv": drives,
        "observations.csv": rows,
    }
    for name, table in files.items():
        _write_csv(folder / name, table, _HEADINGS[name])
    field_toml = folder / "field.toml"
    _write(field_toml, _toml(origin, targets, aim or next(iter(targets))))
    off = np.array(off_plane)
    far = int(np.count_nonzero(np.abs(off) > _OFF_PLANE_M))
    if far:
        warnings.append(
            f"{far} of {len(off)} spots lie more than {100 * _OFF_PLANE_M:.0f} cm off the plane of their target: revisions of "
            "PAINT records differ by constant shifts of up to 1.6 m, and those on the planes are the right ones"
        )
    if left_aside:
        warnings.append(f"{len(left_aside)} records left aside, first {left_aside[0][0].name}: {left_aside[0][1]}")
    return Paint(
        field_toml,
        folder / "observations.csv",
        list(properties),
        len(rows),
        off,
        left_aside=left_aside,
        warnings=warnings,
    )


def _unreadable(path: Path, error: OSError) -> FileUnreadableError:
    failure = FileUnreadableError(f"{path}: {error.strerror or error}")
    failure.path = path
    return failure


def _read(path: Path) -> dict[str, Any]:
    try:
        text = path.read_bytes()
    except OSError as error:
        raise _unreadable(path, error) from None
    try:
        found = json.loads(text)
    except ValueError as error:
        failure = FileSyntaxError(f"{path}: no JSON: {error}")
        failure.path, failure.line = path, getattr(error, "lineno", None)
        raise failure from None
    if not isinstance(found, dict):
        failure = FileSyntaxError(f"{path}: expected an object, got {type(found).__name__}")
        failure.path = path
        raise failure
    return found


def _get(path: Path, record: Any, *keys: str) -> Any:
    for depth, key in enumerate(keys):
        if not isinstance(record, dict) or key not in record:
            failure = MissingError(f"{path}: there is no `{'.'.join(keys[: depth + 1])}`")
            failure.path, failure.field = path, ".".join(keys)
            raise failure
        record = record[key]
    return record


def _numbers(path: Path, what: str, value: Any, count: int | None) -> list[float]:
    """Finite numbers: so many, or a single one for None."""
    values = value if isinstance(value, list) else [value]
    good = all(isinstance(v, (int, float)) and not isinstance(v, bool) and np.isfinite(v) for v in values)
    if not good or len(values) != (count or 1) or isinstance(value, list) != (count is not None):
        wanted = "a finite number" if count is None else f"{count} finite numbers"
        failure = FileValueError(f"{path}: {what}: wanted {wanted}, got {value!r}")
        failure.path, failure.field = path, what
        raise failure
    return [float(v) for v in values]


def _files(
    records: FilePath | Mapping[str, Iterable[FilePath]], heliostats: Mapping[str, FilePath] | None
) -> tuple[dict[str, Path], dict[str, list[Path]]]:
    """Properties and records of each heliostat, both in the order of names."""
    if isinstance(records, Mapping):
        if heliostats is None:
            raise wrong_value(
                "heliostats", "a mapping of records wants the heliostat-properties.json of each heliostat"
            )
        if not isinstance(heliostats, Mapping):
            raise wrong_type("heliostats", "a mapping of names to paths", heliostats)
        for name in records:
            if name not in heliostats:
                raise wrong_value("heliostats", f"there is none for `{name}`, which has records")
        properties = {
            text("heliostats", name): Path(checked_path("heliostats", path)) for name, path in heliostats.items()
        }
        properties = dict(sorted(properties.items()))
        return properties, {
            name: [Path(checked_path("records", path)) for path in several("records", records.get(name, ()), "paths")]
            for name in properties
        }
    if heliostats is not None:
        raise wrong_value("heliostats", "it goes with a mapping of records; of a folder they are found in it")
    folder = Path(checked_path("records", records))
    properties = {
        path.name.removesuffix(_PROPERTIES): path for path in sorted(folder.glob(f"*/Properties/*{_PROPERTIES}"))
    }
    if not properties:
        failure = MissingError(f"{folder}: there is no */Properties/*{_PROPERTIES}")
        failure.path = folder
        raise failure
    return properties, {
        name: sorted(folder.glob(f"{name}/Calibration/*{_RECORD}"), key=lambda path: (len(path.name), path.name))
        for name in properties
    }


@dataclass(frozen=True)
class _Origin:
    """The plant's point: what is 0, 0, 0."""

    latitude_deg: float
    longitude_deg: float
    height_m: float

    def enu_m(self, geodetic: ArrayLike) -> NDArray[np.float64]:
        """East, north, up [m] of points as latitude, longitude [deg] and height [m], of shape (..., 3)."""
        latitude, longitude = np.radians([self.latitude_deg, self.longitude_deg])
        here = _earth_centred_m([self.latitude_deg, self.longitude_deg, self.height_m])
        away = _earth_centred_m(geodetic) - here
        s, c, t, d = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
        turn = np.array([[-t, d, 0.0], [-s * d, -s * t, c], [c * d, c * t, s]])
        return np.asarray(away @ turn.T)


def _earth_centred_m(geodetic: ArrayLike) -> NDArray[np.float64]:
    points = np.asarray(geodetic, dtype=np.float64)
    latitude, longitude, height = np.radians(points[..., 0]), np.radians(points[..., 1]), points[..., 2]
    square = _F * (2 - _F)
    radius = _A_M / np.sqrt(1 - square * np.sin(latitude) ** 2)
    across = (radius + height) * np.cos(latitude)
    return np.stack(
        [
            across * np.cos(longitude),
            across * np.sin(longitude),
            (radius * (1 - square) + height) * np.sin(latitude),
        ],
        axis=-1,
    )


@dataclass(frozen=True)
class _Plane:
    centre_m: NDArray[np.float64]
    normal: NDArray[np.float64]
    right: NDArray[np.float64]
    width_m: float
    height_m: float


def _tower(path: Path) -> tuple[_Origin, dict[str, _Plane], list[str]]:
    tower = _read(path)
    place = _get(path, tower, "power_plant_properties", "coordinates")
    origin = _Origin(*_numbers(path, "power_plant_properties.coordinates", place, 3))
    targets, warnings = {}, []
    for name, target in tower.items():
        if name == "power_plant_properties":
            continue
        if not isinstance(target, dict) or target.get("type") != "planar":
            warnings.append(f"{name} is no plane, and no target of the field")
            continue
        points = [
            _numbers(path, f"{name}.{corner}", _get(path, target, "coordinates", corner), 3)
            for corner in ("upper_left", "upper_right", "lower_right", "lower_left")
        ]
        facing = _numbers(path, f"{name}.normal_vector", _get(path, target, "normal_vector"), 3)
        targets[name] = _plane(path, name, origin.enu_m(points), np.array(facing))
    if not targets:
        failure = MissingError(f"{path}: there is no planar target")
        failure.path = path
        raise failure
    return origin, targets, warnings


def _plane(path: Path, name: str, corners: NDArray[np.float64], facing: NDArray[np.float64]) -> _Plane:
    """The plane through the middle of four corners (upper left, upper right, lower right, lower left)."""
    across = (corners[1] - corners[0] + corners[2] - corners[3]) / 2
    down = (corners[3] - corners[0] + corners[2] - corners[1]) / 2
    right = across / np.linalg.norm(across)
    # Square to it; the corners make no exact rectangle.
    normal = np.cross(down, right)
    normal /= np.linalg.norm(normal)
    if not normal @ facing > 0:
        failure = ConflictError(f"{path}: {name}: its corners run the other way round than its normal_vector wants")
        failure.path, failure.field = path, name
        raise failure
    size = (float(np.linalg.norm(across)), float(np.linalg.norm(down)))
    return _Plane(corners.mean(axis=0), normal, right, *size)


_ACTUATOR = {
    "clockwise_axis_movement": "clockwise_axis_movement",
    "increment": "increment_steps_per_m",
    "offset": "offset_m",
    "pivot_radius": "pivot_radius_m",
    "initial_stroke_length": "initial_stroke_length_m",
    "initial_angle": "initial_angle_rad",
    "min_increment": "min_increment_steps",
    "max_increment": "max_increment_steps",
    "min_movement_angle": "min_movement_angle_rad",
    "max_movement_angle": "max_movement_angle_rad",
}

_HEADINGS = {
    "heliostats.csv": ["id", "east_m", "north_m", "up_m", "mirror_offset_m"],
    "drives.csv": ["id", "axis", "type", "sign", *_ACTUATOR.values()],
    "observations.csv": [
        "heliostat_id",
        "record_id",
        "sun_azimuth_deg",
        "sun_elevation_deg",
        "axis1_steps",
        "axis2_steps",
        "target",
        "spot_east_m",
        "spot_north_m",
        "spot_up_m",
    ],
}

#: Translations between the joints that ours has no place for.
_JOINTS = [f"joint_translation_{axis}_{joint}" for joint in (1, 2) for axis in "enu"]
_JOINTS += ["concentrator_translation_e", "concentrator_translation_u"]


def _heliostat(name: str, path: Path, origin: _Origin) -> tuple[list[Any], list[list[Any]]]:
    found = _read(path)
    place = origin.enu_m(_numbers(path, "heliostat_position", _get(path, found, "heliostat_position"), 3))
    kinematics = _get(path, found, "kinematics_properties")
    for key in _JOINTS:
        if _numbers(path, key, kinematics.get(key, 0.0), None) != [0.0]:
            failure = ConflictError(
                f"{path}: {key} is {kinematics[key]} m; here axes cross and mirrors stand on their normal"
            )
            failure.path, failure.field, failure.id = path, key, name
            raise failure
    # The mirror looks north at rest in PAINT's frame, so that its normal is the second component.
    offset = _numbers(path, "concentrator_translation_n", _get(path, kinematics, "concentrator_translation_n"), None)
    actuators = _get(path, kinematics, "actuators")
    if not isinstance(actuators, list) or len(actuators) != 2:
        two = FileValueError(f"{path}: kinematics_properties.actuators: wanted two, got {actuators!r}")
        two.path, two.field, two.id = path, "kinematics_properties.actuators", name
        raise two
    drives: list[list[Any]] = []
    for axis, actuator in enumerate(actuators, start=1):
        if _get(path, actuator, "type_axis") != "linear":
            kind = FileValueError(f"{path}: actuator {axis}: wanted type_axis linear, got {actuator['type_axis']!r}")
            kind.path, kind.field, kind.id = path, "type_axis", name
            raise kind
        numbers = [_numbers(path, key, _get(path, actuator, key), None)[0] for key in _ACTUATOR]
        numbers[0] = int(numbers[0])
        drives.append([name, axis, "triangle", -1 if axis == 1 else 1, *numbers])
    return [name, *place.tolist(), *offset], drives


def _observations(
    records: Mapping[str, Iterable[Path]], origin: _Origin, targets: Mapping[str, _Plane], centroid: str
) -> tuple[list[list[Any]], list[float], list[tuple[Path, str]]]:
    rows: list[list[Any]] = []
    off_plane: list[float] = []
    left_aside: list[tuple[Path, str]] = []
    for name, paths in records.items():
        for path in paths:
            record = _read(path)
            spots = _get(path, record, "focal_spot")
            target = _get(path, record, "target_name")
            if record.get("sun_azimuth") is None or record.get("sun_elevation") is None:
                left_aside.append((path, "no sun"))
            elif not isinstance(spots, dict) or spots.get(centroid) is None:
                left_aside.append((path, f"no centroid of {centroid}"))
            elif target not in targets:
                left_aside.append((path, f"target `{target}` is no plane of the tower"))
            else:
                spot = origin.enu_m(_numbers(path, f"focal_spot.{centroid}", spots[centroid], 3))
                plane = targets[target]
                off_plane.append(float((spot - plane.centre_m) @ plane.normal))
                rows.append(_row(name, path, record, target, spot))
    return rows, off_plane, left_aside


def _row(name: str, path: Path, record: dict[str, Any], target: str, spot: NDArray[np.float64]) -> list[Any]:
    azimuth = _numbers(path, "sun_azimuth", record["sun_azimuth"], None)[0]
    elevation = _numbers(path, "sun_elevation", record["sun_elevation"], None)[0]
    motors = _get(path, record, "motor_position")
    steps = []
    for key, early in (
        ("axis_1_motor_position", "Axis1MotorPosition"),
        ("axis_2_motor_position", "Axis2MotorPosition"),
    ):
        # Early records have the names of the plant's data base.
        name_there = early if isinstance(motors, dict) and early in motors else key
        steps += _numbers(path, name_there, _get(path, record, "motor_position", name_there), None)
    number = path.name.removesuffix(_RECORD)
    # From south, east positive, to north, clockwise.
    return [name, number, 180.0 - azimuth, elevation, *steps, target, *spot.tolist()]


def _write_csv(path: Path, rows: list[list[Any]], headings: list[str]) -> None:
    lines: list[str] = []

    class _Lines:
        def write(self, line: str) -> None:
            lines.append(line)

    writer = csv.writer(_Lines(), lineterminator="\n")
    writer.writerow(headings)
    writer.writerows(rows)  # floats as repr, which reads back as the same number
    _write(path, "".join(lines))


def _write(path: Path, text: str) -> None:
    """Whole or not at all."""
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        raise _unreadable(path, error) from None


def _toml(origin: _Origin, targets: Mapping[str, _Plane], aim: str) -> str:
    lines = [
        "# From PAINT records (https://paint-database.org), by helio_py.convert_paint.",
        "[site]",
        f"latitude_deg = {origin.latitude_deg!r}",
        f"longitude_deg = {origin.longitude_deg!r}",
        f"elevation_m = {origin.height_m!r}",
    ]
    for name, plane in targets.items():
        lines += [
            "",
            f"[targets.{name}]",
            f"centre_enu_m = {plane.centre_m.tolist()}",
            f"normal_enu = {plane.normal.tolist()}",
            f"right_enu = {plane.right.tolist()}",
            f"width_m = {plane.width_m!r}",
            f"height_m = {plane.height_m!r}",
        ]
    lines += [
        "",
        "[heliostats]",
        'table = "heliostats.csv"',
        'drives = "drives.csv"',
        f'aim = "{aim}"',
        'mode = "pitch-roll"',
        "axis_azimuth_deg = 90",
    ]
    return "\n".join(lines) + "\n"
