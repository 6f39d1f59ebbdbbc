"""What the tests share."""

from __future__ import annotations

import os
import shutil
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helio_py as hp

ROOT = Path(__file__).resolve().parents[3]

# A shell that runs the tests in the background has them ignore Ctrl-C, and Python leaves it so.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture(scope="session")
def example() -> hp.Field:
    """The field of the examples, read from its files."""
    return hp.Field.from_toml(ROOT / "examples" / "field.toml")


@pytest.fixture(scope="session")
def command_line() -> str:
    """The command line built from the same sources; named by HELIO_RS, or on the path."""
    found = os.environ.get("HELIO_RS") or shutil.which("helio-rs")
    if found is None:
        pytest.skip("no helio-rs: set HELIO_RS")
    return found


def random_field(n: int, seed: int = 0) -> hp.Field:
    """A field with an error of every kind."""
    rng = np.random.default_rng(seed)
    position = np.c_[rng.uniform(-600, 600, n), rng.uniform(30, 900, n), rng.uniform(-5, 5, n)]
    errors: dict[str, Any] = {
        name: rng.normal(0, 0.01, n)
        for name in (
            "pedestal_tilt_rad",
            "pedestal_tilt_azimuth_rad",
            "axis_nonorthogonality_rad",
            "mirror_tilt_rad",
            "azimuth_reference_rad",
            "elevation_reference_rad",
        )
    }
    return hp.Field(position, [0.0, 0.0, 120.0], mirror_offset_m=rng.uniform(0.1, 0.5, n), **errors)


def same_bits(a: hp.Tracking, b: hp.Tracking) -> bool:
    """Whether two answers are equal to the last bit, those of NaN included."""
    names = ("azimuth_rad", "elevation_rad", "incidence_rad", "limit_excess_rad", "status")
    return all(getattr(a, name).tobytes() == getattr(b, name).tobytes() for name in names)
