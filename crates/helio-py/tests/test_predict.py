"""Where beams land."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path

import numpy as np
import pytest

import helio_py as hp
from conftest import random_field


def test_tracked_beams_land_on_the_aim() -> None:
    field = random_field(50)
    azimuth, elevation = np.array([2.5, 3.0, 3.5]), np.array([0.4, 0.8, -0.1])
    tracking = hp.track(field, azimuth, elevation)
    landed = hp.predict(field, tracking.azimuth_rad, tracking.elevation_rad, azimuth, elevation)
    assert landed.u_m.shape == landed.status.shape == (3, 50)
    assert landed.point_enu_m.shape == (3, 50, 3)
    ok = landed.status == hp.Status.OK
    assert ok[:2].all()
    assert (landed.status[2] == hp.Status.SUN_BELOW_HORIZON).all()
    assert np.isnan(landed.u_m[~ok]).all()
    # Metres at some hundred metres, and the angle of that.
    assert np.abs(landed.point_enu_m[ok] - [0.0, 0.0, 120.0]).max() < 1e-7
    assert landed.beam_error_rad[ok].max() < 1e-9
    one = hp.predict(field, tracking.azimuth_rad[1], tracking.elevation_rad[1], 3.0, 0.8)
    assert one.u_m.tobytes() == landed.u_m[1].tobytes()


def test_a_turn_of_the_mirror_moves_the_beam_by_twice_as_much() -> None:
    # A mirror that looks north at the target, the sun behind the target: turned about the vertical by a little.
    field = hp.Field([[0.0, 0.0, 0.0]], [0.0, 100.0, 0.0])
    tracking = hp.track(field, 0.0, 0.0)
    turned = hp.predict(field, tracking.azimuth_rad + 1e-3, tracking.elevation_rad, 0.0, 0.0)
    assert abs(turned.point_enu_m[0, 0] - 100.0 * np.tan(2e-3)) < 1e-9
    # As a camera facing the plane from the heliostat sees it, east is to the right.
    assert abs(turned.u_m[0] - turned.point_enu_m[0, 0]) < 1e-12
    assert abs(turned.beam_error_rad[0] - 2e-3) < 1e-12


def test_no_angles_no_spot() -> None:
    field = random_field(3)
    tracking = hp.track(field, 3.0, 0.8)
    azimuth = tracking.azimuth_rad.copy()
    azimuth[1] = np.nan
    landed = hp.predict(field, azimuth, tracking.elevation_rad, 3.0, 0.8)
    assert landed.status.tolist() == [hp.Status.OK, hp.Status.MISSES_TARGET, hp.Status.OK]
    assert np.isnan(landed.u_m).tolist() == [False, True, False]


def test_what_is_wrong_is_named() -> None:
    field = random_field(3)
    with pytest.raises(hp.ShapeError, match=r"^azimuth_rad: expected shape \(3,\), got \(2,\)"):
        hp.predict(field, [0.0, 0.0], [0.0, 0.0], 3.0, 0.8)
    with pytest.raises(hp.ShapeError, match=r"^elevation_rad: expected shape \(1, 3\), got \(3,\)"):
        hp.predict(field, [[0.0] * 3], [0.0] * 3, [3.0], [0.8])
    with pytest.raises(hp.AngleError, match="elevation_rad"):
        hp.predict(field, [0.0] * 3, [0.0, np.inf, 0.0], 3.0, 0.8)
    with pytest.raises(hp.DataTypeError, match=r"^field: expected a Field"):
        hp.predict(3, [0.0], [0.0], 3.0, 0.8)  # type: ignore[call-overload]


def test_as_the_command_line_says_to_the_last_bit(
    command_line: str, root: Path, example: hp.Field, tmp_path: Path
) -> None:
    sun = (np.radians(170.0), np.radians(50.0))
    tracking = hp.track(example, *sun)
    azimuth_deg = np.round(np.degrees(tracking.azimuth_rad) + 0.05, 3)
    elevation_deg = np.round(np.degrees(tracking.elevation_rad), 3)
    angles = tmp_path / "angles.csv"
    rows = zip(example.ids, azimuth_deg.tolist(), elevation_deg.tolist(), strict=True)
    angles.write_text("id,axis1_deg,axis2_deg\n" + "".join(f"{i},{a!r},{e!r}\n" for i, a, e in rows))
    done = subprocess.run(
        [command_line, "predict", "--field", str(root / "examples/field.toml"), "--angles", str(angles),
         "--sun-azimuth-deg", "170", "--sun-elevation-deg", "50", "-q"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stderr
    written = list(csv.DictReader(done.stdout.splitlines()))
    landed = hp.predict(example, np.radians(azimuth_deg), np.radians(elevation_deg), *sun)
    columns = {"u_m": landed.u_m, "v_m": landed.v_m, "up_m": landed.point_enu_m[:, 2]}
    for name, column in columns.items():
        assert [float(row[name]) if row[name] else np.nan for row in written] == pytest.approx(
            column, abs=0, nan_ok=True
        )
    assert [row["status"] for row in written] == hp.status_words(landed.status).tolist()
