"""Figures of fields, angles, calibrations, spots, accuracy and flux, with matplotlib.

The only module of the package that imports matplotlib, and only where it is imported itself: ``pip install
helio-py[plot]`` or ``pip install matplotlib``. Every function draws into ``ax``, or into new axes of a figure of its own,
and returns the Axes. Angles are drawn in degrees or milliradians, lengths in metres; where both directions are
metres, they have one scale.
"""

try:
    import matplotlib as _matplotlib  # noqa: F401
except ImportError as _error:  # pragma: no cover
    raise ImportError("helio_py.plot draws with matplotlib: pip install matplotlib") from _error

from helio_py.plot._calibration import calibration_arrows, calibration_residuals
from helio_py.plot._field import day_angles, field_map
from helio_py.plot._flux import flux_map
from helio_py.plot._spots import accuracy, spot_overlay

__all__ = [
    "accuracy",
    "calibration_arrows",
    "calibration_residuals",
    "day_angles",
    "field_map",
    "flux_map",
    "spot_overlay",
]
