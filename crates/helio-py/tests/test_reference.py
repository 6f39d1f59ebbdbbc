"""Numbers from elsewhere: forty digits, the SPA report, and the command line."""

from __future__ import annotations

import csv
import io
import json
import math
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helio_py as hp

TOLERANCE_RAD = 1e-13


def reference(root: Path) -> list[dict[str, Any]]:
    cases = json.loads((root / "tests" / "reference" / "tracking.json").read_text())["cases"]
    assert len(cases) == 320
    return list(cases)


def field_of(case: dict[str, Any], over_the_top: bool) -> hp.Field:
    north, east, up = case["aim_neu_m"]
    alpha0 = math.radians(case["alpha0_deg"])
    options: dict[str, Any] = {"mode": case["mode"]}
    if case["mode"] == "pitch-roll":
        options["axis_azimuth_rad"] = math.radians(case["axis_azimuth_deg"])
    if case["mode"] == "polar":
        options["latitude_rad"] = math.radians(case["latitude_deg"])
    if over_the_top:
        # The half turn of axis 2 in which the direct solution does not lie.
        options["axis2_min_rad"] = alpha0 + math.pi / 2
        options["axis2_max_rad"] = alpha0 + 3 * math.pi / 2
    return hp.Field(
        [[0.0, 0.0, 0.0]],
        [east, north, up],
        mirror_offset_m=case["mirror_offset_m"],
        pedestal_tilt_rad=math.radians(case["psi_t_deg"]),
        pedestal_tilt_azimuth_rad=math.radians(case["psi_a_deg"]),
        axis_nonorthogonality_rad=math.radians(case["tau1_deg"]),
        mirror_tilt_rad=math.radians(case["mu_deg"]),
        azimuth_reference_rad=math.radians(case["gamma0_deg"]),
        elevation_reference_rad=alpha0,
        **options,
    )


def off_rad(got_rad: float, want_deg: float) -> float:
    turns = (math.degrees(got_rad) - want_deg) / 360
    return abs(math.radians(360 * (turns - round(turns))))


@pytest.mark.parametrize("dual", [False, True], ids=["direct", "over the top"])
@pytest.mark.parametrize("form", ["approximate", "exact"])
def test_all_cases_agree_with_forty_digits(root: Path, form: str, dual: bool) -> None:
    worst = dict.fromkeys(("elevation", "azimuth", "normal", "incidence"), 0.0)
    refused = 0
    for case in reference(root):
        key = {"approximate": "approx", "exact": "exact"}[form]
        want = case[key + ("_dual" if dual else "")]
        field = field_of(case, dual)
        sun = math.radians(case["sun_azimuth_deg"]), math.radians(case["sun_elevation_deg"])
        got = hp.track(field, *sun, form)
        if want is None:
            assert got.status[0] == hp.Status.UNREACHABLE
            assert np.isnan([got.azimuth_rad, got.elevation_rad, got.incidence_rad]).all()
            refused += 1
            continue
        assert got.status[0] == hp.Status.OK, case["kind"]
        level = abs(math.cos(math.radians(want["elevation_deg"] - case["alpha0_deg"])))
        north, east, up = case[f"normal_neu_{key}"]
        normal = hp.forward(field, got.azimuth_rad, got.elevation_rad)[0]
        seen = {
            "elevation": off_rad(got.elevation_rad[0], want["elevation_deg"]),
            "azimuth": off_rad(got.azimuth_rad[0], want["azimuth_deg"]) * level,
            "normal": float(np.linalg.norm(normal - [east, north, up])),
            "incidence": off_rad(got.incidence_rad[0], case["incidence_deg"]),
        }
        for name, value in seen.items():
            worst[name] = max(worst[name], value)
    assert refused == 18
    assert max(worst.values()) < TOLERANCE_RAD, worst


def test_the_report_s_example() -> None:
    # NREL/TP-560-34302 appendix A.5: Golden, Colorado.
    sun = hp.sun_position(
        "2003-10-17T12:30:30-07:00",
        39.742476,
        -105.1786,
        elevation_m=1830.14,
        pressure_hpa=820,
        temperature_c=11,
        delta_t_s=67,
    )
    assert abs(math.degrees(sun.azimuth_rad) - 194.34024) < 5e-6
    assert abs(90 - math.degrees(sun.elevation_rad) - 50.11162) < 5e-6


def run(command_line: str, *arguments: str) -> list[dict[str, str]]:
    done = subprocess.run([command_line, *arguments, "-q"], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    return list(csv.DictReader(io.StringIO(done.stdout)))


def column(rows: list[dict[str, str]], name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([float(row[name]) if row[name] else np.nan for row in rows])


def assert_as_written(tracking: hp.Tracking, field: hp.Field, rows: list[dict[str, str]]) -> None:
    """Equal to the last bit to what the command line wrote (a number that is read back is the same double)."""
    degrees = 180.0 / math.pi
    ok = tracking.status.ravel() == hp.Status.OK
    assert [row["status"] for row in rows] == tracking.status_words.ravel().tolist()
    for name in ("azimuth", "elevation", "incidence"):
        got = getattr(tracking, f"{name}_rad").ravel() * degrees
        want = column(rows, f"{name}_deg")
        assert np.array_equal(got, want, equal_nan=True), name
    if "axis1_steps" in rows[0]:
        steps = field.steps(tracking.azimuth_rad, tracking.elevation_rad)
        for number, got_steps in zip((1, 2), steps, strict=True):
            want = column(rows, f"axis{number}_steps")
            assert np.array_equal(np.rint(got_steps.ravel())[ok], want[ok])


@pytest.mark.parametrize("offset", ["exact", "approximate", "iterated:2", "none"])
def test_given_suns_are_tracked_as_by_the_command_line(
    command_line: str, root: Path, example: hp.Field, offset: str
) -> None:
    azimuth_deg, elevation_deg = 213.7, 31.25
    rows = run(
        command_line, "track", "--field", str(root / "examples" / "field.toml"), "--offset", offset,
        "--sun-azimuth-deg", str(azimuth_deg), "--sun-elevation-deg", str(elevation_deg),
    )  # fmt: skip
    radians = math.pi / 180.0
    tracking = hp.track(example, azimuth_deg * radians, elevation_deg * radians, offset)
    assert len(rows) == 500
    assert_as_written(tracking, example, rows)


@pytest.mark.parametrize("continuous", [False, True])
def test_a_day_is_tracked_as_by_the_command_line(
    command_line: str, root: Path, example: hp.Field, continuous: bool
) -> None:
    rows = run(
        command_line, "track", "--field", str(root / "examples" / "field.toml"), "--step", "37min",
        "--from", "2026-03-03T04:00:00Z", "--to", "2026-03-03T20:00:00Z", *(["--continuous"] * continuous),
    )  # fmt: skip
    times = np.arange("2026-03-03T04:00", "2026-03-03T20:01", np.timedelta64(37, "m"), dtype="datetime64[m]")
    sun = example.sun_position(times)
    tracking = hp.track(example, sun.azimuth_rad, sun.elevation_rad, continuous=continuous)
    assert {"ok", "sun_below_horizon"} <= set(tracking.status_words.ravel().tolist())
    assert_as_written(tracking, example, rows)


def test_a_calibration_of_the_hour_is_followed_as_by_the_command_line(
    command_line: str, root: Path, tmp_path: Path
) -> None:
    # Two sets by hour angle and one by date: the errors change from sun to sun.
    (tmp_path / "layout.csv").write_text("id,east_m,north_m,up_m\nA,10,80,4\nB,-30,90,4\nC,40,60,4\n")
    (tmp_path / "calibration.csv").write_text(
        "id,set,pedestal_tilt_deg,pedestal_tilt_azimuth_deg,azimuth_reference_deg,valid_from,valid_to,"
        "hour_angle_from_deg,hour_angle_to_deg\n"
        "A,am,0.5,20,1,,,-180,0\nA,pm,0.1,200,-1,,,0,180\n"
        "B,old,0.2,0,3,2026-01-01T00:00:00Z,2026-06-21T12:00:00Z,,\n"
        "B,new,0.4,90,-3,2026-06-21T12:00:00Z,2027-01-01T00:00:00Z,,\n"
    )
    (tmp_path / "field.toml").write_text(
        "[site]\nlatitude_deg = 37.4\nlongitude_deg = -6.25\nelevation_m = 20.0\n"
        "[targets.receiver]\ncentre_enu_m = [0, 0, 60]\n"
        '[heliostats]\ntable = "layout.csv"\naim = "receiver"\nmirror_offset_m = 0.2\n'
        'calibration = "calibration.csv"\n'
    )
    rows = run(
        command_line, "track", "--field", str(tmp_path / "field.toml"), "--step", "20min",
        "--from", "2026-06-21T08:00:00Z", "--to", "2026-06-21T18:00:00Z",
    )  # fmt: skip
    field = hp.Field.from_toml(tmp_path / "field.toml")
    times = np.arange("2026-06-21T08:00", "2026-06-21T18:01", np.timedelta64(20, "m"), dtype="datetime64[m]")
    sun = field.sun_position(times)
    tracking = hp.track(field, sun.azimuth_rad, sun.elevation_rad, times=times)
    assert_as_written(tracking, field, rows)
    undated = hp.track(field, sun.azimuth_rad, sun.elevation_rad)
    assert (undated.azimuth_rad != tracking.azimuth_rad).any()
