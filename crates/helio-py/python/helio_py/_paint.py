"""PAINT records into a field and its observations.

PAINT (Phipps et al., Nature Energy 2026, doi 10.1038/s41560-026-02070-1) publishes the heliostats of the solar tower
in Jülich: geodetic places, kinematics with linear actuators, and for each calibration picture motor steps, sun and the
spot's centre as a geodetic point. Its conventions and ours stand side by side in the manual, "From ARTIST and PAINT".
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from helio_py._checked import path, several, text, wrong_type, wrong_value
from helio_py._native import _convert_paint
from helio_py._progress import reporter

FilePath: TypeAlias = str | os.PathLike[str]


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
    progress: Callable[[int, int], Any] | bool | None = None,
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
        Folder for field.toml, heliostats.csv, drives.csv and observations.csv; made if it is not there. What an earlier
        conversion wrote there is replaced, unless it was changed since; files of others are not.
    heliostats : mapping, optional
        With a mapping of records: the heliostat-properties.json of each heliostat.
    centroid : str, default "HeliOS"
        Which of the published centres is the spot: "HeliOS" or "UTIS".
    aim : str, optional
        Target that the heliostats aim at in field.toml; by default the first by name.
    progress : callable or True, optional
        Called with the numbers of files read and of all; True for a bar of tqdm.

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
    The files of ``helio-rs convert paint`` to the last byte. Geodetic coordinates become east, north, up of the plant's point by the full rotation (WGS 84). Azimuths of PAINT count
    from south, east positive: ours are 180° less those. The mount is `pitch-roll` with the first axis to the east; the first
    actuator's angle grows as the mirror tips to the south, ours the other way, hence its sign of -1.
    """
    asked: dict[str, Any] = {
        "tower": path("tower", tower),
        "folder": None,
        "heliostats": {},
        "records": {},
        "out": path("out", out),
        "centroid": text("centroid", centroid),
        "aim": None if aim is None else text("aim", aim),
    }
    if isinstance(records, Mapping):
        asked |= _named(records, heliostats)
    elif heliostats is not None:
        raise wrong_value("heliostats", "it goes with a mapping of records; of a folder they are found in it")
    else:
        asked["folder"] = path("records", records)
    with reporter(progress, "files") as report:
        found = _convert_paint(asked, report)
    return Paint(**found)


def _named(records: Mapping[str, Iterable[FilePath]], heliostats: Mapping[str, FilePath] | None) -> dict[str, Any]:
    """Files that are named one by one."""
    if heliostats is None:
        raise wrong_value("heliostats", "a mapping of records wants the heliostat-properties.json of each heliostat")
    if not isinstance(heliostats, Mapping):
        raise wrong_type("heliostats", "a mapping of names to paths", heliostats)
    return {
        "heliostats": {text("heliostats", name): path("heliostats", file) for name, file in heliostats.items()},
        "records": {
            text("records", name): [path("records", file) for file in several("records", files, "paths")]
            for name, files in records.items()
        },
    }
