"""What ``sun_position`` returns."""

from __future__ import annotations

from typing import Any, NamedTuple


class SunPosition(NamedTuple):
    """Where the sun stands, each column of the shape of the times; numbers for a single time."""

    #: Azimuth [rad], clockwise from north, in [0, 2π).
    azimuth_rad: Any
    #: Apparent elevation [rad]: the centre as seen through the air, what ``track`` takes.
    elevation_rad: Any
    #: Elevation of the centre without air [rad].
    geometric_elevation_rad: Any
