"""Answers as tables of every kind, and the command line's files read back by other libraries."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from PIL import Image

import helio_py as hp
from conftest import random_field

TIMES = ["2026-06-21T06:00:00Z", "2026-06-21T12:00:00Z", "2026-06-21T23:00:00Z"]
KINDS: dict[str, Any] = {"dict": dict, "pandas": pd.DataFrame, "polars": pl.DataFrame, "pyarrow": pa.Table}


def run(*typed: Any) -> None:
    done = subprocess.run([*map(str, typed), "-q"], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr


def same(ours: dict[str, Any], theirs: pa.Table) -> None:
    """To the last bit, in the same order of columns."""
    assert list(ours) == theirs.column_names
    for name, column in ours.items():
        their = theirs[name].combine_chunks()
        if column.dtype.kind == "U":
            assert column.tolist() == [cell or "" for cell in their.to_pylist()], name
        elif column.dtype.kind == "M":
            assert column.astype(np.int64).tolist() == their.cast(pa.int64()).to_pylist(), name
        else:
            want = their.to_numpy(zero_copy_only=False).astype(np.float64)
            assert column.astype(np.float64).tobytes() == want.tobytes(), name


def driven(folder: Path) -> Path:
    """A field with a drive on either axis, limits, and a calibration of the hour."""
    (folder / "layout.csv").write_text("id,east_m,north_m,up_m\nA,10,80,4\nB,-30,90,4\nC,0,95,4\n")
    (folder / "calibration.csv").write_text(
        "id,set,pedestal_tilt_deg,pedestal_tilt_azimuth_deg,azimuth_reference_deg,valid_from,valid_to,"
        "hour_angle_from_deg,hour_angle_to_deg\nA,am,0.5,20,1,,,-180,0\nA,pm,0.1,200,-1,,,0,180\n"
    )
    drive = 'type = "encoder"\nsteps_per_deg = 1000\n'
    (folder / "field.toml").write_text(
        "[site]\nlatitude_deg = 37.4\nlongitude_deg = -6.25\nelevation_m = 20\n[targets.board]\ncentre_enu_m = [0, 0, 60]\n"
        "normal_enu = [0, 1, 0]\nwidth_m = 8\nheight_m = 8\n"
        '[heliostats]\ntable = "layout.csv"\naim = "board"\nmirror_offset_m = 0.2\ncalibration = "calibration.csv"\n'
        f"axis1_min_deg = 0\naxis1_max_deg = 190\naxis2_min_deg = 0\naxis2_max_deg = 90\n[heliostats.drive.axis1]\n{drive}[heliostats.drive.axis2]\n{drive}"
    )
    return folder / "field.toml"


@pytest.mark.parametrize("sun", ["times", "angles"])
def test_tracking_and_prediction_are_the_command_line_s_tables(sun: str, command_line: str, tmp_path: Path) -> None:
    path = driven(tmp_path)
    field = hp.Field.from_toml(path)
    tracked, landed = tmp_path / "tracked.parquet", tmp_path / "landed.parquet"
    if sun == "times":
        typed = ["--from", "2026-06-21T06:00:00Z", "--to", "2026-06-21T23:00:00Z", "--step", "1h"]
        times = np.datetime64("2026-06-21T06:00:00") + 3600 * np.arange(18)
        at = field.sun_position(times)
        suns = (at.azimuth_rad, at.elevation_rad)
        asked: dict[str, Any] = {"times": times}
    else:
        table = tmp_path / "suns.csv"
        table.write_text("azimuth_deg,elevation_deg\n110.3,20\n180,70.1\n250.7,30\n10,-5\n")
        typed = ["--suns", str(table)]
        suns = (np.radians([110.3, 180, 250.7, 10]), np.radians([20, 70.1, 30, -5.0]))
        asked = {"sun_azimuth_rad": suns[0], "sun_elevation_rad": suns[1]}
    run(command_line, "track", "--field", path, *typed, "--out", tracked)
    tracking = hp.track(field, *suns, times=asked.get("times"))
    table = pq.read_table(tracked)
    same(tracking.to_table(field, **asked), table)
    words = set(table["status"].to_pylist())
    assert {"ok", "sun_below_horizon", "outside_limits"} <= words
    run(command_line, "predict", "--field", path, "--angles", tracked, "--out", landed)
    want = pq.read_table(landed)
    same(hp.predict(field, table, kind="dict"), want)
    # In any order of rows, a heliostat's row twice: row by row the same numbers.
    rng = np.random.default_rng(0)
    ok = table.filter(pa.compute.equal(table["status"], "ok"))
    mixed = rng.integers(0, len(ok), 3 * len(ok))
    again = hp.predict(field, ok.take(mixed), kind="dict")
    for name in ("u_m", "v_m", "up_m", "beam_error_mrad"):
        first = want.filter(pa.compute.equal(want["status"], "ok")) if len(want) != len(ok) else want
        assert again[name].tobytes() == first[name].to_numpy()[mixed].tobytes(), name
    # The arrays' own table has the rows without angles, too.
    at_all = hp.predict(field, tracking.azimuth_rad, tracking.elevation_rad, *suns, times=asked.get("times"))
    whole = at_all.to_table(field, **asked)
    assert list(whole) == want.column_names
    there = np.array(table["status"].to_pylist()) == "ok"
    quantised = np.isin(whole["status"], ["ok"])
    assert (quantised == there).all()
    assert np.abs(whole["u_m"][there] - want["u_m"].to_numpy()).max() < 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_table_comes_back(kind: str, example: hp.Field) -> None:
    suns = {"sun_azimuth_rad": np.array([3.0, 3.1]), "sun_elevation_rad": np.array([0.8, 0.7])}
    tracking = hp.track(example, suns["sun_azimuth_rad"], suns["sun_elevation_rad"])
    table: Any = tracking.to_table(example, kind, times=None, **suns)
    assert isinstance(table, KINDS[kind])
    n = 2 * len(example)
    assert [len(table["id"]), len(table["azimuth_deg"])] == [n, n]
    landed: Any = hp.predict(example, table)  # the kind of the one given
    assert isinstance(landed, KINDS[kind])
    assert len(landed["u_m"]) == n
    assert np.nanmax(np.abs(np.asarray(landed["beam_error_mrad"]))) < 1e-6
    scene = {"receiver": {"shape": "plane", "centre_m": [0, 0, 10], "facing": [0, 0, -1], "width_m": 2, "height_m": 2}}
    nodes = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    flux = hp.flux(mesh=nodes, elements=[[0, 1, 2]], scene=scene, rays=1000)
    bins: Any = flux.to_table(kind)
    assert isinstance(bins, KINDS[kind])
    assert np.asarray(bins["flux_w_m2"]).tobytes() == flux.flux_w_m2.tobytes()


def test_one_sun_and_fields_of_arrays() -> None:
    field = random_field(3)
    tracking = hp.track(field, 3.0, 0.8)
    table = tracking.to_table(field, sun_azimuth_rad=3.0, sun_elevation_rad=0.8)
    assert table["id"].tolist() == ["0", "1", "2"]
    assert "axis1_steps" not in table
    timed = tracking.to_table(field, times="2026-06-21T12:00:00Z")
    assert timed["time"].tolist() == [np.datetime64("2026-06-21T12:00:00", "ns").astype(int)] * 3
    landed = hp.predict(field, tracking.azimuth_rad, tracking.elevation_rad, 3.0, 0.8)
    assert landed.to_table(field, sun_azimuth_rad=3.0, sun_elevation_rad=0.8)["u_m"].tobytes() == landed.u_m.tobytes()


def test_wrong_calls_are_named(example: hp.Field) -> None:
    field = random_field(3)
    tracking = hp.track(field, 3.0, 0.8)
    with pytest.raises(hp.OptionError, match="which sun its rows are of"):
        tracking.to_table(field)
    with pytest.raises(hp.OptionError, match="which sun its rows are of"):
        tracking.to_table(field, times=TIMES[0], sun_azimuth_rad=1.0, sun_elevation_rad=1.0)
    with pytest.raises(hp.ShapeError, match=r"times: expected shape \(\), got \(3,\)"):
        tracking.to_table(field, times=TIMES)
    with pytest.raises(hp.ShapeError, match=r"field: expected shape \(3,\)"):
        tracking.to_table(example, times=TIMES[0])
    with pytest.raises(hp.OptionError, match="kind: wanted dict"):
        tracking.to_table(field, "excel", times=TIMES[0])
    with pytest.raises(hp.MissingError, match=r"column `axis1_deg` \(or `azimuth_deg`\) is missing"):
        hp.predict(field, {"id": [field.ids[0]]})
    row: dict[str, Any] = {"id": [example.ids[0]], "azimuth_deg": [180.0], "elevation_deg": [45.0]}
    with pytest.raises(hp.OptionError, match="wants a column time"):
        hp.predict(example, row)
    with pytest.raises(hp.UnknownNameError, match="unknown heliostat"):
        hp.predict(example, row | {"id": ["nobody"], "time": [TIMES[0]]})
    with pytest.raises(hp.OptionError, match=r"^kind: it is of a table of angles"):
        hp.predict(field, tracking.azimuth_rad, tracking.elevation_rad, 3.0, 0.8, kind="pandas")  # type: ignore[call-overload]


READERS: dict[str, Callable[[Path], Any]] = {
    "pandas": pd.read_csv,
    "pandas by pyarrow": lambda path: pd.read_csv(path, dtype_backend="pyarrow"),
    "pandas to a dict": lambda path: {name: cells.to_numpy() for name, cells in pd.read_csv(path).items()},
    "polars": pl.read_csv,
    "polars with times": lambda path: pl.read_csv(path, try_parse_dates=True),
    "pyarrow": pyarrow.csv.read_csv,
}


@pytest.mark.parametrize("reader", READERS)
def test_spots_of_the_command_line_are_read_by_anybody(reader: str, command_line: str, tmp_path: Path) -> None:
    down, right = np.mgrid[:60, :80]
    for k in range(6):
        gray = 60 + 100 * np.exp(-((right - 40 - k % 3) ** 2 + (down - 30) ** 2) / 50)
        Image.fromarray(gray.round().astype(np.uint8)).save(tmp_path / f"2026-06-20T08-00-0{k}Z.png")
    target = tmp_path / "target.toml"
    target.write_text("width_m = 8\nheight_m = 6\ncorners_px = [[0, 0], [79, 0], [79, 59], [0, 59]]\n")
    spots = tmp_path / "spots.csv"
    frames = sorted(tmp_path.glob("*.png"))
    run(
        command_line, "spot", *frames, "--target", target, "--out", spots, "--start", "2026-06-20T08:00:00Z", "--fps", 1
    )
    table = READERS[reader](spots)
    want = hp.accuracy(spots, slant_m=120.0)
    got = hp.accuracy(table, slant_m=120.0)
    assert got.to_dict()["figures"] == want.to_dict()["figures"]
    assert want.counts == {"ok": 6}


@pytest.mark.parametrize("reader", READERS)
def test_observations_of_the_command_line_are_read_by_anybody(reader: str, example: hp.Field, root: Path) -> None:
    path = root / "examples" / "observations.csv"
    want = hp.calibrate(example, path)
    got = hp.calibrate(example, READERS[reader](path))
    assert got.covariance.tobytes() == want.covariance.tobytes()


@pytest.mark.parametrize("empty", [np.nan, None])
def test_columns_without_anything_are_empty_text(empty: Any) -> None:
    times = ["2026-06-20T08:00:00Z", "2026-06-20T08:00:01Z"]
    spots: dict[str, Any] = {
        "file": ["a", "b"],
        "time": times,
        "u_m": [0.1, 0.2],
        "v_m": [0.0, 0.1],
        "status": ["ok", "ok"],
    }
    want = hp.accuracy(spots, slant_m=100.0).to_dict()["figures"]
    more = spots | {"flags": [empty, empty], "reason": np.array([np.nan, np.nan])}
    for table in (more, pd.DataFrame(more), pl.DataFrame(more), pa.table(more)):
        assert hp.accuracy(table, slant_m=100.0).to_dict()["figures"] == want
    # One that has numbers is still none of text.
    with pytest.raises(hp.FileValueError, match="flags"):
        hp.accuracy(spots | {"flags": [np.nan, 1.5]}, slant_m=100.0)
