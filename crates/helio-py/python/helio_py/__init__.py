"""Heliostat fields of solar towers: where both drives of every mirror have to stand.

Whole arrays in, whole arrays out. World frame: right-handed east, north, up, in metres. Azimuth clockwise from
north, elevation up from the horizon; radians everywhere, unless a name ends in ``_deg``. The name says the unit.

A first look::

    import helio_py as hp

    field = hp.Field.from_toml("field.toml")
    sun = field.sun_position("2026-06-21T12:00:00+02:00")
    tracking = hp.track(field, sun.azimuth_rad, sun.elevation_rad)
    tracking.azimuth_rad, tracking.elevation_rad, tracking.status

Every failure is a ``HelioError``; a row that cannot be computed is none, it has a ``Status``.
"""

import warnings as _warnings

from helio_py._calibrate import Calibration, calibrate
from helio_py._errors import (
    AngleError,
    BusyError,
    CalibrationError,
    ConflictError,
    DataTypeError,
    DriveError,
    DuplicateIdError,
    DuplicateNameError,
    EmptyLimitsError,
    FieldError,
    FieldValueError,
    FileError,
    FileSyntaxError,
    FileUnreadableError,
    FileValueError,
    HelioError,
    InternalError,
    MissingError,
    NoSuchRowError,
    OptionError,
    OutOfMemoryError,
    ShapeError,
    SunDirectionError,
    SunError,
    TimeError,
    TrackError,
    UnknownNameError,
)
from helio_py._native import Drive, Field, Tracking, __version__, _optimised, forward, sun_position, track
from helio_py._predict import Prediction, predict
from helio_py._status import Status, status_words
from helio_py._sun import SunPosition

if not _optimised:
    _warnings.warn("helio_py was built without optimisation: it is right, and slow", RuntimeWarning, stacklevel=2)

__all__ = [
    "AngleError",
    "BusyError",
    "Calibration",
    "CalibrationError",
    "ConflictError",
    "DataTypeError",
    "Drive",
    "DriveError",
    "DuplicateIdError",
    "DuplicateNameError",
    "EmptyLimitsError",
    "Field",
    "FieldError",
    "FieldValueError",
    "FileError",
    "FileSyntaxError",
    "FileUnreadableError",
    "FileValueError",
    "HelioError",
    "InternalError",
    "MissingError",
    "NoSuchRowError",
    "OptionError",
    "OutOfMemoryError",
    "Prediction",
    "ShapeError",
    "Status",
    "SunDirectionError",
    "SunError",
    "SunPosition",
    "TimeError",
    "TrackError",
    "Tracking",
    "UnknownNameError",
    "__version__",
    "calibrate",
    "forward",
    "predict",
    "status_words",
    "sun_position",
    "track",
]
