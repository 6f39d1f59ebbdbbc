"""Corrections by pose and the way back of beams: as the command line's."""

from __future__ import annotations

import pickle
import re
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import helio_py as hp
from conftest import ROOT, random_field
from test_rows import driven, same

SUNS = np.radians([100.0, 130, 180, 220, 250, 10]), np.radians([25.0, 45, 60, 50, 30, -5])


class Left(NamedTuple):
    """A folder with field.toml, calibrated by cal.csv, and left.csv; and the calibration that found them."""

    folder: Path
    found: hp.JointCalibration


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> Left:
    """Readings hold what no angle explains: 0.6 mrad by pose."""
    folder = tmp_path_factory.mktemp("left")
    text = (ROOT / "examples" / "field.toml").read_text()
    (folder / "heliostats.csv").write_text((ROOT / "examples" / "heliostats.csv").read_text())
    (folder / "plain.toml").write_text(text)
    field = hp.Field.from_toml(folder / "plain.toml")
    seen = hp.simulate_observations(field, heliostats=20, count=80, noise_mrad=0.4, random_errors=True, seed=5)
    seen.write(folder / "seen.csv")
    table = pd.read_csv(folder / "seen.csv")
    one, two = np.radians(table["axis1_deg"]), np.radians(table["axis2_deg"])
    phase = table["heliostat_id"].map(lambda name: sum(name.encode()))
    table["axis1_deg"] += np.degrees(0.6e-3 * np.sin(4 * one + phase) * np.cos(3 * two + phase))
    table["axis2_deg"] += np.degrees(0.6e-3 * np.cos(4 * one + 2 * phase) * np.sin(5 * two + phase))
    found = hp.calibrate(field, table, joint=True, leftovers=True)
    assert found.leftovers is not None
    assert found.leftovers["admitted"]
    found.write(folder / "cal.csv")
    found.write(folder / "left.csv", "leftovers")
    (folder / "field.toml").write_text(text.replace("[heliostats]", '[heliostats]\ncalibration = "cal.csv"', 1))
    np.savetxt(folder / "suns.csv", np.degrees(SUNS).T, "%.17g", ",", header="azimuth_deg,elevation_deg", comments="")
    return Left(folder, found)


def run(command_line: str, folder: Path, *typed: Any) -> str:
    line = [command_line, "track", "--field", folder / "field.toml", "--suns", folder / "suns.csv", *typed]
    done = subprocess.run(list(map(str, line)), capture_output=True, text=True, check=False, cwd=folder)
    assert done.returncode in (0, 1), done.stderr
    return done.stderr


def test_the_command_line_s_rows(command_line: str, left: Left) -> None:
    run(command_line, left.folder, "--leftovers", "left.csv", "--out", "a.parquet")
    run(command_line, left.folder, "--leftovers", "left.csv", "--verify", "--out", "b.parquet")
    field = hp.Field.from_toml(left.folder / "field.toml")
    tracking = hp.track(field, *SUNS)
    corrected = hp.correct(field, tracking, left.folder / "left.csv")
    asked: dict[str, Any] = {"sun_azimuth_rad": SUNS[0], "sun_elevation_rad": SUNS[1]}
    same(corrected.to_table(field, **asked), pq.read_table(left.folder / "a.parquet"))
    verified = hp.verify(field, corrected, *SUNS)
    same(verified.to_table(field, corrected, **asked), pq.read_table(left.folder / "b.parquet"))
    assert corrected.warnings == []

    # What they are: corrections of a tenth of a milliradian of heliostats that were seen, none of others.
    assert corrected.azimuth_rad.shape == corrected.sigma_axis2_rad.shape == tracking.shape
    known = np.isin(field.ids, left.found.to_table("leftovers")["id"])
    ok = tracking.status == hp.Status.OK
    assert np.array_equal(corrected.status, tracking.status)
    assert np.isnan(corrected.leftover_axis1_rad[:, ~known]).all()
    some = corrected.leftover_axis1_rad[:, known][ok[:, known]]
    assert 1e-4 < np.sqrt((some**2).mean()) < 1e-3
    added = corrected.azimuth_rad - tracking.azimuth_rad
    assert np.allclose(added[:, known][ok[:, known]], some, atol=1e-15, rtol=0)
    assert (corrected.azimuth_rad[:, ~known][ok[:, ~known]] == tracking.azimuth_rad[:, ~known][ok[:, ~known]]).all()
    assert np.isnan(corrected.azimuth_rad[~ok]).all()
    # Half a step of a thousandth of a degree of either axis, and a mirror that turns a beam by twice as much.
    assert 0 < verified.beam_error_rad[ok].max() < 2 * np.hypot(1, 1) * np.radians(0.5e-3)
    assert corrected.axis1_rad is corrected.azimuth_rad
    assert set(corrected.status_words.ravel()) == {"ok", "sun_below_horizon"}


@pytest.mark.parametrize("kind", ["found", "dict", "pandas", "polars", "pyarrow", "parquet"])
def test_leftovers_of_every_kind(kind: str, left: Left) -> None:
    field = left.found.apply(hp.Field.from_toml(left.folder / "plain.toml"))
    tracking = hp.track(field, 3.0, 0.8)
    want = hp.correct(field, tracking, left.folder / "left.csv")
    table = pd.read_csv(left.folder / "left.csv")
    given: Any = {
        "found": left.found,
        "dict": {name: cells.tolist() for name, cells in table.items()},
        "pandas": table,
        "polars": pl.DataFrame({name: cells.tolist() for name, cells in table.items()}),
        "pyarrow": pa.Table.from_pandas(table),
        "parquet": left.folder / "left.parquet",
    }[kind]
    left.found.write(left.folder / "left.parquet", "leftovers")
    got = hp.correct(field, tracking, given)
    assert [column.tobytes() for column in got[:-1]] == [column.tobytes() for column in want[:-1]]
    assert got.azimuth_rad.shape == (500,)
    assert got.warnings == []
    again = pickle.loads(pickle.dumps(got))
    assert again.azimuth_rad.tobytes() == want.azimuth_rad.tobytes()


def test_another_calibration_is_warned_of_and_one_of_the_hour_refused(
    left: Left, example: hp.Field, tmp_path: Path
) -> None:
    tracking = hp.track(example, 3.0, 0.8)
    corrected = hp.correct(example, tracking, left.folder / "left.csv")
    assert len(corrected.warnings) == 1
    said = (
        r"left.*: \d+ heliostats are now of another calibration than these leftovers were written for \(first `H001`\)"
    )
    assert re.search(said, corrected.warnings[0])
    assert re.match(said, hp.correct(example, tracking, left.found).warnings[0])
    changing = hp.Field.from_toml(driven(tmp_path))
    with pytest.raises(
        hp.ConflictError, match=r"left\.csv belongs to one calibration, and that of the field"
    ) as caught:
        hp.correct(changing, hp.track(changing, 3.0, 0.8), left.folder / "left.csv")
    assert caught.value.field == "leftovers"


def test_corrections_end_where_drives_do(command_line: str, left: Left, tmp_path: Path) -> None:
    for name in ("cal.csv", "left.csv", "heliostats.csv", "suns.csv"):
        (tmp_path / name).write_text((left.folder / name).read_text())
    field = hp.Field.from_toml(left.folder / "field.toml")
    plain = hp.track(field, *SUNS)
    corrected = hp.correct(field, plain, left.folder / "left.csv")
    # A drive that ends between an angle and its correction.
    up = np.nanargmax(corrected.leftover_axis2_rad)
    between = (plain.elevation_rad.ravel()[up] + corrected.elevation_rad.ravel()[up]) / 2
    steps = int(np.degrees(between) * 1000)
    text = (left.folder / "field.toml").read_text()
    drive = 'type = "encoder"\nsteps_per_deg = 1000\n'
    drives = f"[heliostats.drive.axis1]\n{drive}[heliostats.drive.axis2]\n{drive}max_steps = {steps}\n"
    (tmp_path / "field.toml").write_text(text[: text.index("[heliostats.drive")] + drives)
    run(command_line, tmp_path, "--leftovers", "left.csv", "--verify", "--out", "b.parquet")
    field = hp.Field.from_toml(tmp_path / "field.toml")
    corrected = hp.correct(field, hp.track(field, *SUNS), tmp_path / "left.csv")
    assert corrected.elevation_rad.ravel()[up] == pytest.approx(np.radians(steps / 1000), abs=1e-15)
    verified = hp.verify(field, corrected, *SUNS)
    asked: dict[str, Any] = {"sun_azimuth_rad": SUNS[0], "sun_elevation_rad": SUNS[1]}
    same(verified.to_table(field, corrected, **asked), pq.read_table(tmp_path / "b.parquet"))
    assert {"ok", "outside_limits"} <= set(corrected.status_words.ravel())


@pytest.mark.parametrize("offset", ["exact", "none"])
@pytest.mark.parametrize("sun", ["times", "angles"])
def test_beams_back_are_the_command_line_s(sun: str, offset: str, command_line: str, tmp_path: Path) -> None:
    """With drives, limits and a calibration of the hour."""
    path = driven(tmp_path)
    field = hp.Field.from_toml(path)
    if sun == "times":
        typed = ["--from", "2026-06-21T06:00:00Z", "--to", "2026-06-21T23:00:00Z", "--step", "1h"]
        times = np.datetime64("2026-06-21T06:00:00") + 3600 * np.arange(18)
        at = field.sun_position(times)
        suns = (at.azimuth_rad, at.elevation_rad)
        asked: dict[str, Any] = {"times": times}
    else:
        np.savetxt(
            tmp_path / "s.csv", np.degrees(SUNS).T, "%.17g", ",", header="azimuth_deg,elevation_deg", comments=""
        )
        typed, suns = ["--suns", str(tmp_path / "s.csv")], SUNS
        asked = {"sun_azimuth_rad": SUNS[0], "sun_elevation_rad": SUNS[1]}
    out = tmp_path / "verified.parquet"
    line = [command_line, "track", "--field", path, *typed, "--verify", "--offset", offset, "--out", out, "-q"]
    done = subprocess.run(list(map(str, line)), capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    tracking = hp.track(field, *suns, offset, times=asked.get("times"))
    verified = hp.verify(field, tracking, *suns, times=asked.get("times"))
    same(verified.to_table(field, tracking, **asked), pq.read_table(out))
    ok = verified.status == hp.Status.OK
    assert ok.any()
    assert np.array_equal(np.isnan(verified.beam_error_rad), ~ok)
    # Half a step of a thousandth of a degree, on either axis, and a mirror that turns a beam by twice as much.
    most = 2 * np.hypot(1, 1) * np.radians(0.5e-3)
    assert (verified.beam_error_rad[ok].max() < most) == (offset == "exact")


def test_a_field_of_columns_has_no_drives_between() -> None:
    field = random_field(40)
    exact = hp.verify(field, hp.track(field, 3.0, 0.8), 3.0, 0.8)
    assert exact.beam_error_rad.shape == (40,)
    assert exact.beam_error_rad.max() < 1e-9
    # An angle that is off by so much turns the beam by at most twice as much; the same as predicted.
    tracking = hp.track(field, [2.9, 3.0], [0.7, 0.8], "none")
    verified = hp.verify(field, tracking, [2.9, 3.0], [0.7, 0.8])
    landed = hp.predict(field, tracking.azimuth_rad, tracking.elevation_rad, [2.9, 3.0], [0.7, 0.8])
    assert verified.beam_error_rad.tobytes() == landed.beam_error_rad.tobytes()
    assert verified.beam_error_rad.max() > 1e-4
    table = verified.to_table(field, tracking, "pandas", sun_azimuth_rad=[2.9, 3.0], sun_elevation_rad=[0.7, 0.8])
    assert isinstance(table, pd.DataFrame)
    assert np.allclose(table["beam_error_mrad"], 1e3 * verified.beam_error_rad.ravel(), rtol=1e-15)
    none = hp.verify(field, hp.track(field, [], []), [], [])
    assert none.beam_error_rad.shape == (0, 40)
    again = pickle.loads(pickle.dumps(verified))
    assert again.status.tobytes() == verified.status.tobytes()


def test_beams_that_miss_are_told(tmp_path: Path) -> None:
    path = driven(tmp_path)
    path.write_text(path.read_text().replace("normal_enu = [0, 1, 0]", "normal_enu = [0, -1, 0]"))
    field = hp.Field.from_toml(path)
    tracking = hp.track(field, 3.0, 0.8)
    verified = hp.verify(field, tracking, 3.0, 0.8)
    was_ok = tracking.status == hp.Status.OK
    assert was_ok.any()
    assert (verified.status[was_ok] == hp.Status.MISSES_TARGET).all()
    table = verified.to_table(field, tracking, sun_azimuth_rad=3.0, sun_elevation_rad=0.8)
    assert np.isnan(table["beam_error_mrad"][was_ok]).all()
    assert np.isnan(table["limit_excess_deg"][was_ok]).all()


def test_wrong_calls_are_named(left: Left, example: hp.Field) -> None:
    field = random_field(3)
    tracking, two = hp.track(field, 3.0, 0.8), hp.track(field, [3.0, 3.1], [0.8, 0.8])
    path = left.folder / "left.csv"
    calls: list[tuple[type[hp.HelioError], str, str | None, Any]] = [
        (hp.DataTypeError, "tracking: expected a Tracking, got tuple", "tracking", lambda: hp.correct(field, (1, 2), path)),  # type: ignore[arg-type]
        (hp.DataTypeError, "tracking: expected a Tracking or a Corrected, got nothing", "tracking", lambda: hp.verify(field, None, 3.0, 0.8)),  # type: ignore[arg-type]
        (hp.DataTypeError, "leftovers: expected a table", "leftovers", lambda: hp.correct(field, tracking, 3)),
        (hp.FileUnreadableError, "nowhere.csv", "leftovers", lambda: hp.correct(field, tracking, "nowhere.csv")),
        (hp.UnknownNameError, "unknown heliostat `H", None, lambda: hp.correct(field, tracking, path)),
        (hp.ShapeError, r"tracking: expected shape \(500,\) or \(m, 500\), got \(3,\)", "tracking", lambda: hp.correct(example, tracking, path)),
        (hp.ShapeError, r"tracking: expected shape \(3,\), got \(2, 3\)", "tracking", lambda: hp.verify(field, two, 3.0, 0.8)),
        (hp.ShapeError, r"tracking: expected shape \(1, 3\), got \(2, 3\)", "tracking", lambda: hp.verify(field, two, [3.0], [0.8])),
        (hp.ShapeError, r"field: expected shape", "field", lambda: hp.verify(field, two, [3.0, 3.1], [0.8, 0.8]).to_table(example, two)),
        (hp.SunDirectionError, "sun_elevation_rad: sun 0", "sun_elevation_rad", lambda: hp.verify(field, tracking, 3.0, 80)),
    ]  # fmt: skip
    for error, message, named, call in calls:
        with pytest.raises(error, match=message) as caught:
            call()
        if named:
            assert caught.value.field == named
    without = hp.calibrate(example, left.folder / "seen.csv", joint=True)
    with pytest.raises(hp.OptionError, match=r"^leftovers: this calibration looked for none"):
        hp.correct(example, hp.track(example, 3.0, 0.8), without)


def test_progress_is_told_and_may_end_it(left: Left) -> None:
    field = hp.Field.from_toml(left.folder / "field.toml")
    tracking = hp.track(field, np.linspace(2.0, 4.0, 200), np.full(200, 0.8))
    told: list[tuple[int, int]] = []
    hp.correct(field, tracking, left.found, progress=lambda done, of: told.append((done, of)))
    assert told[-1] == (100_000, 100_000)

    def enough(_done: int, _of: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        hp.correct(field, tracking, left.found, progress=enough)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
@pytest.mark.parametrize(
    "call", ["hp.correct(field, tracking, folder / 'left.csv')", "hp.verify(field, tracking, *suns)"]
)
def test_ctrl_c_ends_it(call: str, left: Left) -> None:
    # A million rows, over and over.
    script = textwrap.dedent(
        f"""
        import pathlib, signal, time
        import numpy as np, helio_py as hp
        folder = pathlib.Path({str(left.folder)!r})
        field = hp.Field.from_toml(folder / "field.toml")
        suns = np.linspace(2.0, 4.0, 2000), np.full(2000, 0.8)
        tracking = hp.track(field, *suns)
        begun = []
        def stop(*_):
            begun.append(time.monotonic())
            raise KeyboardInterrupt
        signal.signal(signal.SIGALRM, stop)
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        try:
            while True:
                {call}
        except KeyboardInterrupt:
            print("stopped")
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=120)
    assert done.stdout == "stopped\n", done.stderr
