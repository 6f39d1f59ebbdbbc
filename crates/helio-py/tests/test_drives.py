"""Drives through pickle, and as what they are equal to."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import helio_py as hp

DRIVES = [
    hp.Drive.encoder(57_295.8, zero_steps=500.0, sign=-1.0),
    hp.Drive.encoder(57_295.8, min_steps=0.0, max_steps=90_000.0),
    hp.Drive.screw(0.4, 0.5, 0.3, 0.2, steps_per_m=10_000.0, min_steps=0.0),
    hp.Drive.triangle(0.34, 0.338, 0.078, 0.7, 154_166.0, clockwise=True, max_steps=50_000.0),
]


@pytest.mark.parametrize("drive", DRIVES, ids=repr)
@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_a_drive_survives_pickling_to_the_last_bit(drive: hp.Drive, protocol: int) -> None:
    again = pickle.loads(pickle.dumps(drive, protocol))
    angles = np.linspace(-3.2, 3.2, 1001)
    assert again.steps(angles).tobytes() == drive.steps(angles).tobytes()
    assert again.range_rad == drive.range_rad
    assert again == drive
    assert hash(again) == hash(drive)


def test_drives_of_a_field_survive_too_and_others_differ(example: hp.Field) -> None:
    assert pickle.loads(pickle.dumps(example.drives)) == example.drives
    assert len(set(DRIVES)) == len(DRIVES)
    assert DRIVES[0] != "drive"


@pytest.mark.parametrize(
    ("numbers", "error"), [([1.0], hp.OptionError), ([0.0] * 10, hp.DriveError), ([-1.0] * 5, hp.DriveError)]
)
def test_numbers_that_make_no_drive_are_refused(numbers: list[float], error: type[hp.HelioError]) -> None:
    with pytest.raises(error):
        hp.Drive._from_numbers(numbers)
