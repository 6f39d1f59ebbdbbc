"""A field as one: as the command line's, followed, kept, watched and stopped."""

from __future__ import annotations

import csv
import pickle
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
import pytest

import helio_py as hp
from conftest import ROOT, same_bits

FIELD = ROOT / "examples" / "field.toml"


class Records(NamedTuple):
    """Tables of the same heliostats: those before a day, those of the time after it, those after that."""

    before: Path
    later: Path
    last: Path


def table_of(path: Path) -> dict[str, Any]:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    texts = ("heliostat_id", "time", "target")
    return {name: [row[name] if name in texts else float(row[name]) for row in rows] for name in rows[0]}


@pytest.fixture(scope="module")
def records(example: hp.Field, tmp_path_factory: pytest.TempPathFactory) -> Records:
    folder = tmp_path_factory.mktemp("records")
    simulated = hp.simulate_observations(
        example, heliostats=30, count=16, outliers=0.03, outlier_mrad=15, random_errors=True, seed=4
    )
    simulated.write(folder / "all.csv")
    with (folder / "all.csv").open() as file:
        rows = list(csv.DictReader(file))
    parts = Records(*(folder / f"{name}.csv" for name in Records._fields))
    for path, begin, end in zip(parts, ("", "2025-09", "2025-11"), ("2025-09", "2025-11", "3"), strict=True):
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(row for row in rows if begin <= row["time"] < end)
    return parts


@pytest.fixture(scope="module")
def joint(example: hp.Field, records: Records) -> hp.JointCalibration:
    return hp.calibrate(example, records.before, joint=True, leftovers=True, plan=(2, "2026-03-21"))


def run(command_line: str, folder: Path, *typed: str | Path) -> None:
    line = [command_line, "calibrate", "--field", FIELD, "-q", *typed]
    done = subprocess.run(line, capture_output=True, text=True, check=False, cwd=folder)
    assert done.returncode in (0, 1), done.stderr


def same_tables(found: hp.JointCalibration, folder: Path, kinds: str) -> None:
    for kind in kinds.split():
        ours = folder / f"ours-{kind}.csv"
        found.write(ours, kind)
        assert ours.read_bytes() == (folder / f"{kind}.csv").read_bytes(), kind


def test_the_command_line_writes_the_same_bytes(
    command_line: str, example: hp.Field, records: Records, joint: hp.JointCalibration, tmp_path: Path
) -> None:
    outputs = [
        "--out",
        "calibration.csv",
        "--rejected",
        "rejected.csv",
        "--causes",
        "causes.csv",
        "--steps",
        "steps.csv",
    ]
    more = ["--leftovers", "leftovers.csv", "--plan", "2", "--plan-date", "2026-03-21", "--plan-out", "plan.csv"]
    run(
        command_line, tmp_path, "--joint", "--observations", records.before, *outputs, *more, "--state", "state.parquet"
    )
    same_tables(joint, tmp_path, "calibration rejected causes steps leftovers plan")
    assert joint.state == (tmp_path / "state.parquet").read_bytes()

    # Each goes on from the other's state, again and again, from a file and from memory.
    theirs = tmp_path / "state.parquet"
    first = hp.calibrate(example, records.later, update=theirs)
    assert theirs.read_bytes() == joint.state  # as it was
    run(command_line, tmp_path, "--update", "state.parquet", "--observations", records.later, *outputs)
    same_tables(first, tmp_path, "calibration rejected causes steps")
    assert theirs.read_bytes() == first.state
    second = hp.calibrate(example, records.last, update=first, state=theirs, ahead_days=3)
    assert theirs.read_bytes() == second.state
    theirs.write_bytes(first.state)
    run(command_line, tmp_path, "--update", theirs, "--ahead", "3", "--observations", records.last, *outputs)
    same_tables(second, tmp_path, "calibration rejected causes steps")
    assert theirs.read_bytes() == second.state


@pytest.mark.parametrize(
    ("typed", "keywords"),
    [
        ("--keep-all --no-jumps", {"keep_all": True, "no_jumps": True}),
        ("--ahead 10 --max-year-pointing-mrad 0.8", {"ahead_days": 10, "max_year_pointing_mrad": 0.8}),
    ],
)
def test_options_are_the_command_line_s(
    typed: str, keywords: dict[str, Any], command_line: str, example: hp.Field, records: Records, tmp_path: Path
) -> None:
    run(command_line, tmp_path, "--joint", "--observations", records.before, "--out", "calibration.csv", *typed.split())
    same_tables(hp.calibrate(example, records.before, joint=True, **keywords), tmp_path, "calibration")


def test_what_it_holds(joint: hp.JointCalibration, example: hp.Field, records: Records) -> None:
    k = len(example)
    assert joint.ids == example.ids
    table = joint.to_table()
    assert np.array_equal(joint.foretold_mrad, table["foretold_mrad"], equal_nan=True)
    assert np.allclose(1e3 * joint.zero_rad[:, 1], table["axis2_zero_mrad"], equal_nan=True)
    assert joint.zero_sigma_rad.shape == (k, 2)
    assert joint.covariance.shape == (k, 7, 7)
    steps = joint.to_table("steps")
    assert len(steps["id"]) == len(table_of(records.before)["time"])
    assert (steps["kind"] == "outlier").sum() == (joint.to_table("rejected")["reason"] == "outlier").sum() > 0
    assert joint.converged
    assert not joint.field_is_off
    assert set(joint.noise) == {"beam_mrad", "spot_m", "sun_path_s"}
    assert len(joint.wander["slow_mrad"]) == 2
    assert joint.leftovers is not None
    # Those that face a target.
    assert {"H001", "H002"} < set(joint.to_table("plan")["id"]) <= set(example.ids)
    # 0.5 mrad were simulated, whatever of it is taken for which kind of scatter.
    assert np.sqrt(np.nanmean(joint.beam_rms_mrad[joint.observations > 8] ** 2)) == pytest.approx(0.7, abs=0.25)
    assert not same_bits(hp.track(joint.apply(example), 3.0, 0.8), hp.track(example, 3.0, 0.8))
    again = pickle.loads(pickle.dumps(joint))
    assert (again.state, repr(again)) == (joint.state, repr(joint))


@pytest.mark.parametrize("kind", [pd.DataFrame, pl.DataFrame, pa.table, dict])
def test_tables_of_every_kind(kind: Any, example: hp.Field, records: Records) -> None:
    begun = hp.calibrate(example, kind(table_of(records.before)), joint=True)
    followed = hp.calibrate(example, kind(table_of(records.later)), update=bytearray(begun.state))
    assert isinstance(followed.to_table("steps"), pa.Table if kind is pa.table else kind)
    files = hp.calibrate(example, records.later, update=hp.calibrate(example, records.before, joint=True))
    assert files.state == followed.state
    assert files.covariance.tobytes() == followed.covariance.tobytes()


CALLS: list[tuple[type[hp.HelioError], str, str | None, dict[str, Any]]] = [
    (hp.OptionError, "solver: with joint: the field as one is filtered", "solver", {"joint": True, "solver": "gauss-newton"}),
    (hp.OptionError, "hold: with joint: ", "hold", {"joint": True, "hold": "mirror_tilt"}),
    (hp.OptionError, "sets: with update: ", "sets", {"update": b"", "sets": 2}),
    (hp.OptionError, "keep_all: with update: a state goes on as the joint that began it", "keep_all", {"update": b"", "keep_all": True}),
    (hp.OptionError, "joint: with update", "joint", {"update": b"", "joint": True}),
    (hp.OptionError, "leftovers: with update", "leftovers", {"update": b"", "leftovers": True}),
    (hp.OptionError, "state: is of the field as one", "state", {"state": "s.parquet"}),
    (hp.OptionError, "ahead_days: is of the field as one", "ahead_days", {"ahead_days": 3}),
    (hp.OptionError, "ahead_days: wanted 0 to 366 days, got -1", "ahead_days", {"joint": True, "ahead_days": -1}),
    (hp.OptionError, "plan: wanted 1 to 1000 observations, got 0", "plan", {"joint": True, "plan": (0, "2026-06-21")}),
    (hp.OptionError, "plan: 2026-13-01: wanted a day, such as 2026-06-21", "plan", {"joint": True, "plan": (1, "2026-13-01")}),
    (hp.DataTypeError, "plan: expected a number and a day", "plan", {"joint": True, "plan": 3}),
    (hp.DataTypeError, "update: expected a path, bytes or a JointCalibration, got int", "update", {"update": 3}),
    (hp.DataTypeError, "state: expected a path, got int", "state", {"joint": True, "state": 3}),
    (hp.FileUnreadableError, "nowhere.parquet", "update", {"update": "nowhere.parquet"}),
    (hp.ConflictError, "state: it is no state of a followed field", "update", {"update": b"PAR2"}),
]  # fmt: skip


@pytest.mark.parametrize(("error", "message", "named", "keywords"), CALLS)
def test_wrong_calls_are_named(
    error: type[hp.HelioError],
    message: str,
    named: str | None,
    keywords: dict[str, Any],
    example: hp.Field,
    records: Records,
) -> None:
    with pytest.raises(error, match=f"^{message}") as caught:
        hp.calibrate(example, records.before, **keywords)
    assert caught.value.field == named


def test_states_and_records_that_will_not_do(
    joint: hp.JointCalibration, example: hp.Field, records: Records, tmp_path: Path
) -> None:
    damaged = bytearray(joint.state)
    damaged[len(damaged) // 2] ^= 1
    with pytest.raises(hp.ConflictError, match="not as it was written") as broken:
        hp.calibrate(example, records.later, update=damaged)
    assert broken.value.field == "update"
    with pytest.raises(hp.OptionError, match="taken in already") as again:
        hp.calibrate(example, records.before, update=joint)
    assert again.value.field == "observations"
    timeless = {name: cells for name, cells in table_of(records.later).items() if name != "time"}
    timeless |= {
        "sun_azimuth_deg": [180.0] * len(timeless["target"]),
        "sun_elevation_deg": [40.0] * len(timeless["target"]),
    }
    with pytest.raises(hp.OptionError, match=r"have no time .* and joint needs times") as caught:
        hp.calibrate(example, timeless, joint=True)
    assert caught.value.field == "observations"
    with pytest.raises(hp.OptionError, match="this call reads it"):
        hp.calibrate(example, records.later, update=joint, state=records.later)
    with pytest.raises(hp.FileError) as not_written:
        hp.calibrate(example, records.later, update=joint, state=tmp_path / "none" / "s.parquet")
    assert not_written.value.field == "state"
    with pytest.raises(hp.MissingError, match=r"Field\.from_toml"):
        hp.calibrate(hp.Field([[0, 0, 0]], [0, 0, 1]), records.before, joint=True)
    with pytest.raises(hp.OptionError, match=r"^kind: wanted calibration, rejected, causes or steps, got `plan`"):
        hp.calibrate(example, records.later, update=joint).to_table("plan")


def test_progress_is_told_and_may_end_it(joint: hp.JointCalibration, example: hp.Field, records: Records) -> None:
    told: list[tuple[int, int]] = []
    hp.calibrate(example, records.later, update=joint, progress=lambda done, of: told.append((done, of)))
    assert told[-1][0] == told[-1][1] > 0

    def enough(_done: int, _of: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        hp.calibrate(example, records.before, joint=True, progress=enough)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
@pytest.mark.parametrize("after_s", [0.2, 0.6, 1.2])
def test_ctrl_c_ends_it(after_s: float, tmp_path: Path) -> None:
    # 3,000 heliostats with 100 records each, and leftovers: many seconds.
    script = textwrap.dedent(
        f"""
        import pathlib, signal, time
        import helio_py as hp
        folder = pathlib.Path({str(tmp_path)!r})
        (folder / "layout.csv").write_text(
            "id,east_m,north_m,up_m\\n" + "".join(f"H{{k}},{{(k % 60) * 9 - 270}},{{90 + k // 60 * 9}},6\\n" for k in range(3000))
        )
        text = pathlib.Path({str(FIELD)!r}).read_text()
        (folder / "field.toml").write_text(text.replace('"heliostats.csv"', '"layout.csv"'))
        field = hp.Field.from_toml(folder / "field.toml")
        hp.simulate_observations(field, count=100, random_errors=True).write(folder / "seen.csv")
        begun = []
        def told(done, of):
            if not begun:
                begun.append(time.monotonic())
                signal.setitimer(signal.ITIMER_REAL, {after_s})
        def stop(*_):
            begun.append(time.monotonic())
            raise KeyboardInterrupt
        signal.signal(signal.SIGALRM, stop)
        try:
            hp.calibrate(field, folder / "seen.csv", joint=True, leftovers=True, progress=told)
        except KeyboardInterrupt:
            print("stopped")
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=300)
    assert done.stdout == "stopped\n", done.stderr


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_no_record_is_taken_in_twice(seed: int, root: Path) -> None:
    """A wrong spot a month after the others, given again, would agree with itself and be believed as a jump."""
    field = hp.Field.from_toml(root / "examples/field.toml")
    options: dict[str, Any] = {
        "heliostats": 60,
        "count": 12,
        "outliers": 0.05,
        "outlier_mrad": 15.0,
        "random_errors": True,
    }
    seen = hp.simulate_observations(field, seed=seed, **options).to_table("pandas").sort_values("time")
    before = seen.time < seen.time.quantile(0.7)
    known = hp.calibrate(field, seen[before], joint=True)
    with pytest.raises(hp.OptionError, match="taken in already"):
        hp.calibrate(field, seen[before], update=known)
    known = hp.calibrate(field, seen[~before], update=known)
    with pytest.raises(hp.OptionError, match="taken in already"):
        hp.calibrate(field, seen[~before], update=known)
    # the whole again too, from a file as well
    with pytest.raises(hp.OptionError, match="taken in already"):
        hp.calibrate(field, seen, update=known.state)
