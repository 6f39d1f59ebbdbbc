"""What can go wrong, each case a class of its own under ``HelioError``.

Messages are those of the Rust libraries and of the command line: who, what was found, what was wanted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


class HelioError(Exception):
    """Every failure of this package. What is not known of a case is None."""

    #: Name of the heliostat.
    id: str | None = None
    #: Row, counted from 0 in arrays, from 1 in tables.
    row: int | None = None
    #: The argument, quantity, or column of a table.
    field: str | None = None
    #: The number that was found.
    value: float | None = None


class ShapeError(HelioError, ValueError):
    """An array of another shape than wanted."""


class DataTypeError(HelioError, TypeError):
    """An argument that cannot be read as what is wanted: no real numbers, no field, no text."""


class OptionError(HelioError, ValueError):
    """A word or number that is none of those an option knows."""


class FieldError(HelioError, ValueError):
    """A field that cannot be built."""


class FieldValueError(FieldError):
    """A number of a heliostat that is not finite or out of range."""


class DuplicateIdError(FieldError):
    """Two heliostats of one name."""


class EmptyLimitsError(FieldError):
    """A lower axis limit above the upper one."""


class NoSuchRowError(FieldError, IndexError):
    """A row that the field does not have."""


class TrackError(HelioError, ValueError):
    """A wrong call of ``track`` or ``forward``."""


class AngleError(TrackError):
    """An axis angle that is infinite or so large that it has no precision left."""


class SunDirectionError(TrackError):
    """A sun whose angles are not finite."""


class SunError(HelioError, ValueError):
    """A site or clock for which no position of the sun can be computed."""


class TimeError(HelioError, ValueError):
    """A time that is none, has no zone, or lies outside the years 1678 to 2262."""


class DriveError(HelioError, ValueError):
    """A drive whose numbers describe no mechanism."""


class FileError(HelioError, ValueError):
    """A file that cannot be used."""

    #: The file.
    path: Path | None = None
    #: Line of a text file, counted from 1.
    line: int | None = None
    #: Column of a text file in characters, counted from 1.
    column: int | None = None


class FileUnreadableError(FileError, OSError):
    """A file that cannot be opened or read."""


class FileSyntaxError(FileError):
    """A file that breaks the rules of its own format."""


class FileValueError(FileError):
    """A value of a file that is of the wrong kind or out of range."""


class UnknownNameError(FileError):
    """A key, column, target or quantity that nobody knows."""


class MissingError(FileError):
    """A key, column or table that must be there and is not."""


class DuplicateNameError(FileError):
    """A name that stands twice in a file."""


class ConflictError(FileError):
    """Things that are right one by one but not together."""


class FluxError(HelioError, ValueError):
    """Mirrors, light or a receiver of which no flux can be computed."""


class MeshError(FluxError):
    """A mesh that is none, or has no such mirror, or one whose deformation cannot be told."""


class ImageError(HelioError, ValueError):
    """A picture that cannot be read, or does not show what it should."""


class CalibrationError(HelioError, ValueError):
    """Observations or options of which no calibration can be made."""


class BusyError(HelioError, RuntimeError):
    """An answer that another thread's call is writing to."""


class OutOfMemoryError(HelioError, MemoryError):
    """An answer larger than the memory there is."""


class InternalError(HelioError, RuntimeError):
    """A fault of helio-rs itself. Please report it."""
