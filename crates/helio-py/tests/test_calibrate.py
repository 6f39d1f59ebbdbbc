"""Calibration: as the command line's, applied, pickled, watched and stopped."""

from __future__ import annotations

import concurrent.futures as futures
import csv
import gc
import multiprocessing as mp
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import helio_py as hp
from conftest import ROOT, same_bits

FIELD, SEEN = ROOT / "examples" / "field.toml", ROOT / "examples" / "observations.csv"


@pytest.fixture(scope="module")
def calibration(example: hp.Field) -> hp.Calibration:
    return hp.calibrate(example, SEEN)


WAYS: list[tuple[list[str], dict[str, Any]]] = [
    ([], {}),
    (["--solver", "gauss-newton"], {"solver": "gauss-newton"}),
    (["--residual", "distance"], {"residual": "distance"}),
    (["--residual", "beam", "--robust", "huber"], {"residual": "beam", "robust": "huber"}),
    (["--robust", "student-t", "--no-jumps"], {"robust": "student-t", "no_jumps": True}),
    (["--sets", "2"], {"sets": 2}),
    (["--hold", "mirror_tilt,axis_nonorthogonality"], {"hold": ["mirror_tilt", "axis_nonorthogonality"]}),
    (["--prior", "mirror_tilt=0:0.1", "--keep-all"], {"prior": {"mirror_tilt": (0, 0.1)}, "keep_all": True}),
    (["--fit-mirror-offset", "--max-year-pointing-mrad", "0.5"], {"fit_mirror_offset": True, "max_year_pointing_mrad": 0.5}),
]  # fmt: skip


@pytest.mark.parametrize(("typed", "keywords"), WAYS, ids=lambda way: " ".join(way) if isinstance(way, list) else "")
def test_the_command_line_writes_the_same_tables(
    typed: list[str], keywords: dict[str, Any], command_line: str, example: hp.Field, tmp_path: Path
) -> None:
    out, rejected = tmp_path / "cli.csv", tmp_path / "cli-rejected.csv"
    done = subprocess.run(
        [command_line, "calibrate", "--field", str(FIELD), "--observations", str(SEEN), "--out", str(out),
         "--rejected", str(rejected), "-q", *typed],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stderr
    found = hp.calibrate(example, SEEN, **keywords)
    for kind, theirs in (("calibration", out), ("rejected", rejected)):
        ours = tmp_path / f"ours-{kind}.csv"
        found.write(ours, kind)
        with ours.open() as one, theirs.open() as other:
            # What a hash of options is made of is the program's own affair.
            pairs = [[{**row, "options_hash": ""} for row in csv.DictReader(file)] for file in (one, other)]
        assert pairs[0] == pairs[1]


@pytest.mark.parametrize("joint", [False, True])
def test_a_time_beside_the_sun_s_angles_is_warned_of(joint: bool, example: hp.Field) -> None:
    table = pd.read_csv(SEEN)
    asked: dict[str, Any] = {"joint": joint}
    timed = hp.calibrate(example, table, **asked)
    sun = example.sun_position(table["time"].tolist())
    table["sun_azimuth_deg"] = np.degrees(sun.azimuth_rad) + 0.5
    table["sun_elevation_deg"] = np.degrees(sun.elevation_rad)
    both = hp.calibrate(example, table, **asked)
    said = "observations: records that state both a time and the sun's angles: "
    assert [said in warning for warning in both.warnings] == [True] + [False] * (len(both.warnings) - 1)
    assert f"{said}{len(table)} (first: " in both.warnings[0]
    assert not any(said in warning for warning in timed.warnings)
    # The angles are what counts.
    assert np.nanmedian(np.abs(both.azimuth_reference_rad - timed.azimuth_reference_rad)) > 1e-3


def test_columns_say_what_the_table_says(calibration: hp.Calibration, example: hp.Field) -> None:
    table = calibration.to_table()
    k = len(calibration)
    assert k == len(calibration.ids) == len(calibration.status) > 0
    assert np.array_equal(np.radians(table["mirror_tilt_deg"]), calibration.mirror_tilt_rad, equal_nan=True)
    assert calibration.covariance.shape == (k, 7, 7)
    for name, sigma in calibration.sigma.items():
        assert sigma.shape == (k,), name
    # The covariance's diagonal is the square of the standard deviations: the mirror's tilt is its sixth.
    assert calibration.covariance[:, 5, 5] ** 0.5 == pytest.approx(calibration.sigma["mirror_tilt_rad"])
    # Residuals are what the errors make of the records.
    residuals = calibration.to_table("residuals")
    assert len(residuals["u_m"]) == calibration.observations.sum() + calibration.rejected.sum()
    first = residuals["id"] == calibration.ids[0]
    kept = first & np.isfinite(residuals["beam_mrad"])
    assert np.sqrt(np.mean(residuals["beam_mrad"][kept] ** 2)) == pytest.approx(calibration.beam_rms_mrad[0])
    assert residuals["before_mrad"][kept].mean() > residuals["beam_mrad"][kept].mean()


def test_applied_is_as_read_from_the_written_table(
    calibration: hp.Calibration, example: hp.Field, tmp_path: Path, root: Path
) -> None:
    for name in ("heliostats.csv",):
        (tmp_path / name).write_bytes((root / "examples" / name).read_bytes())
    text = (root / "examples" / "field.toml").read_text()
    assert "\ncalibration" not in text
    calibration.write(tmp_path / "calibration.csv")
    (tmp_path / "field.toml").write_text(
        text.replace("[heliostats]\n", '[heliostats]\ncalibration = "calibration.csv"\n')
    )
    read = hp.Field.from_toml(tmp_path / "field.toml")
    applied = calibration.apply(example)
    want = hp.track(read, 3.0, 0.8)
    assert same_bits(hp.track(applied, 3.0, 0.8), want)
    assert not same_bits(hp.track(example, 3.0, 0.8), want)
    again = pickle.loads(pickle.dumps(applied))
    assert same_bits(hp.track(again, 3.0, 0.8), want)
    bare = hp.Field(example.position_enu_m, example.aim_enu_m, ids=example.ids, mirror_offset_m=example.mirror_offset_m)
    assert bool((calibration.apply(bare).mirror_tilt_rad == applied.mirror_tilt_rad).all())


def test_it_survives_pickling(calibration: hp.Calibration, example: hp.Field) -> None:
    again = pickle.loads(pickle.dumps(calibration))
    assert repr(again) == repr(calibration)
    assert again.covariance.tobytes() == calibration.covariance.tobytes()
    assert same_bits(hp.track(again.apply(example), 3.0, 0.8), hp.track(calibration.apply(example), 3.0, 0.8))


CALLS: list[tuple[type[hp.HelioError], str, str | None, dict[str, Any]]] = [
    (hp.OptionError, "solver: unknown word `newton`; known are hartley-meyer, gauss-newton", "solver", {"solver": "newton"}),
    (hp.OptionError, "sets: unknown word `3`; known are 1, 2, auto", "sets", {"sets": 3}),
    (hp.OptionError, "hold: unknown parameter `tilt`", "hold", {"hold": "tilt"}),
    (hp.OptionError, "prior: mirror_tilt=0.0:-1.0: the standard deviation must be above zero", "prior", {"prior": {"mirror_tilt": (0, -1)}}),
    (hp.OptionError, "hold: mirror_offset and fit_mirror_offset contradict", "hold", {"hold": "mirror_offset", "fit_mirror_offset": True}),
    (hp.DataTypeError, "prior: mirror_tilt: expected two numbers", "prior", {"prior": {"mirror_tilt": 3}}),
    (hp.DataTypeError, "hold: expected a sequence of str, got int", "hold", {"hold": 3}),
    (hp.DataTypeError, "progress: expected a callable", "progress", {"progress": 3}),
]  # fmt: skip


@pytest.mark.parametrize(("error", "message", "named", "keywords"), CALLS)
def test_wrong_options_are_named(
    error: type[hp.HelioError], message: str, named: str | None, keywords: dict[str, Any], example: hp.Field
) -> None:
    with pytest.raises(error, match=f"^{message}") as caught:
        hp.calibrate(example, SEEN, **keywords)
    assert caught.value.field == named


def test_fields_and_files_that_will_not_do(example: hp.Field, tmp_path: Path) -> None:
    with pytest.raises(hp.MissingError, match=r"Field\.from_toml"):
        hp.calibrate(hp.Field([[0, 0, 0]], [0, 0, 1]), SEEN)
    with pytest.raises(hp.FileUnreadableError, match=r"nowhere\.csv"):
        hp.calibrate(example, tmp_path / "nowhere.csv")
    with pytest.raises(hp.OptionError, match=r"^kind: wanted calibration, rejected or residuals, got `all`"):
        hp.calibrate(example, SEEN).to_table("all")


def test_progress_is_told_and_may_end_it(example: hp.Field) -> None:
    told: list[tuple[int, int]] = []
    found = hp.calibrate(example, SEEN, progress=lambda done, of: told.append((done, of)))
    heliostats = len(set(found.ids))
    assert told[-1] == (heliostats, heliostats)
    assert told == sorted(told)

    def enough(_done: int, _of: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        hp.calibrate(example, SEEN, progress=enough)


def digest(_: int) -> bytes:
    return hp.calibrate(hp.Field.from_toml(FIELD), SEEN).covariance.tobytes()


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_children_of_every_kind_find_the_same(method: str) -> None:
    if method not in mp.get_all_start_methods():
        pytest.skip(f"no {method} on this system")
    want = digest(0)
    with futures.ProcessPoolExecutor(2, mp_context=mp.get_context(method)) as pool:
        assert list(pool.map(digest, range(2), timeout=120)) == [want] * 2


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
def test_ctrl_c_ends_it_early() -> None:
    # A field of the same heliostat's records many times over takes many seconds.
    script = textwrap.dedent(
        f"""
        import csv, signal, tempfile, pathlib
        import helio_py as hp
        folder = pathlib.Path(tempfile.mkdtemp())
        (folder / "layout.csv").write_text("id,east_m,north_m,up_m\\n" + "".join(f"H{{k}},{{k * 8}},90,6\\n" for k in range(3000)))
        text = pathlib.Path({str(FIELD)!r}).read_text()
        (folder / "field.toml").write_text(text.replace('"heliostats.csv"', '"layout.csv"'))
        rows = [r for r in csv.DictReader(open({str(SEEN)!r})) if r["heliostat_id"] == "H001"]
        table = {{name: [r[name] if name in ("time", "target") else r[name] for r in rows] * 3000 for name in rows[0]}}
        table["heliostat_id"] = [f"H{{k}}" for k in range(3000) for _ in rows]
        for name in table:
            if name not in ("heliostat_id", "time", "target"):
                table[name] = [float(cell) for cell in table[name]]
        field = hp.Field.from_toml(folder / "field.toml")
        begun = []
        def told(done, of):
            if done and not begun:
                begun.append(done)
                signal.raise_signal(signal.SIGINT)
            if done:
                begun.append(done)
        try:
            hp.calibrate(field, table, progress=told)
        except KeyboardInterrupt:
            print("stopped", begun[-1] < 3000)
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=300)
    assert done.stdout == "stopped True\n", done.stderr


def test_the_interpreter_is_free_meanwhile(example: hp.Field) -> None:
    with futures.ThreadPoolExecutor(1) as pool:
        running = pool.submit(hp.calibrate, example, SEEN)
        turns = 0
        while not running.done():
            time.sleep(0)
            turns += 1
        assert turns > 0
        assert len(running.result()) > 0


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="Linux's own")
def test_memory_is_flat_over_many_calls(example: hp.Field) -> None:
    with SEEN.open() as file:
        rows = [row for row in csv.DictReader(file) if row["heliostat_id"] == "H001"]
    texts = ("heliostat_id", "time", "target")
    table = {name: [row[name] if name in texts else float(row[name]) for row in rows] for name in rows[0]}
    streamed = pa.table(table)
    tracking = hp.track(example, 3.0, 0.8)
    angles = tracking.azimuth_rad.copy(), tracking.elevation_rad.copy()

    def calls(count: int) -> None:
        for k in range(count):
            found = hp.calibrate(example, streamed if k % 2 else table)
            found.to_table("residuals")
            for _ in range(20):
                hp.predict(example, *angles, 3.0, 0.8)
            with pytest.raises(hp.ShapeError):
                hp.predict(example, angles[0][1:], angles[1], 3.0, 0.8)

    def resident_kb() -> int:
        lines = Path("/proc/self/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("VmRSS")).split()[1])

    calls(60)
    gc.collect()
    counts = [sys.getrefcount(thing) for thing in (example, table, streamed, *angles)]
    before_kb = resident_kb()
    calls(200)
    gc.collect()
    assert [sys.getrefcount(thing) for thing in (example, table, streamed, *angles)] == counts
    assert resident_kb() - before_kb < 8_000


def test_a_signal_does_not_wait_for_a_heliostat_of_many_records(root: Path) -> None:
    script = textwrap.dedent(
        """
        import os, signal, threading
        import helio_py as hp

        field = hp.Field.from_toml("examples/field.toml")
        seen = hp.simulate_observations(field, heliostats=1, count=20_000)
        calibrate = lambda **more: hp.calibrate(field, seen, sets="auto", robust="student-t", **more)
        threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        told = []
        try:
            calibrate(progress=lambda done, of: told.append(done))
        except KeyboardInterrupt:
            print("stopped", max(told))
        # what was left to itself harms nothing that comes after it
        print(hp.calibrate(field, "examples/observations.csv").status[0])
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=root)
    assert done.stdout == "stopped 0\nok\n", done.stderr
