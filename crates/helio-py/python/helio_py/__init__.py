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

import typing as _typing
import warnings as _warnings

from helio_py._accuracy import Accuracy, AccuracyFigure, accuracy
from helio_py._begin import FieldCheck, init, schema
from helio_py._calibrate import Calibration, calibrate
from helio_py._campaign import SimulatedCampaign, simulate_campaign
from helio_py._correct import Corrected, Verified, correct, verify
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
    FluxError,
    HelioError,
    ImageError,
    InternalError,
    MeshError,
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
from helio_py._flux import CameraFlux, FluxAccount, SlopeErrors, TargetMap, flux
from helio_py._images import SimulatedImages, simulate_images
from helio_py._joint import JointCalibration
from helio_py._native import Drive, Field, Flux, Tracking, __version__, _optimised, forward, sun_position, track
from helio_py._predict import Prediction, predict
from helio_py._simulate import SimulatedObservations, simulate_field, simulate_observations
from helio_py._spots import Spot, Spots, find_spot, find_spots
from helio_py._status import Status, status_words
from helio_py._sun import SunPosition

# Records of others: read by modules that nothing else needs, imported where they are first asked for.
if _typing.TYPE_CHECKING:
    from helio_py import plot as plot
    from helio_py._paint import Paint, convert_paint


if not _typing.TYPE_CHECKING:  # a type checker is to know of names that are none

    def __getattr__(name: str) -> object:
        if name in ("Paint", "convert_paint"):
            from helio_py import _paint

            return getattr(_paint, name)
        if name == "plot":
            import importlib

            return importlib.import_module("helio_py.plot")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__, "plot"})


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
__all__ += [
    "CameraFlux",
    "Flux",
    "FluxAccount",
    "FluxError",
    "ImageError",
    "MeshError",
    "SlopeErrors",
    "TargetMap",
    "flux",
]
__all__ += ["Corrected", "Verified", "correct", "verify"]
__all__ += ["JointCalibration"]
__all__ += ["Paint", "convert_paint"]
__all__ += ["SimulatedObservations", "simulate_field", "simulate_observations"]
__all__ += ["Accuracy", "AccuracyFigure", "Spot", "Spots", "accuracy", "find_spot", "find_spots"]
__all__ += ["SimulatedCampaign", "SimulatedImages", "simulate_campaign", "simulate_images"]
__all__ += ["FieldCheck", "init", "schema"]
