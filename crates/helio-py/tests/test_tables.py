"""Tables of every kind in, the same kind out."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import helio_py as hp

NUMBERS = ("axis1_deg", "axis2_deg", "u_m", "v_m", "sigma_m")


@pytest.fixture(scope="module")
def columns(root: Path) -> dict[str, list[Any]]:
    """The example's observations of three heliostats, as text and floats."""
    with (root / "examples" / "observations.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["heliostat_id"] in ("H001", "H040", "H120")]
    assert rows
    return {name: [float(row[name]) if name in NUMBERS else row[name] for row in rows] for name in rows[0]}


def zoned(columns: dict[str, list[Any]]) -> pd.DataFrame:
    frame = pd.DataFrame(columns)
    frame["time"] = pd.to_datetime(frame["time"], utc=True).dt.tz_convert("Europe/Madrid")
    return frame


KINDS: dict[str, tuple[type, Callable[[dict[str, list[Any]]], Any]]] = {
    "dict of lists": (dict, lambda c: c),
    "dict of arrays": (dict, lambda c: {name: np.array(cells) for name, cells in c.items()}),
    "dict with datetime64": (
        dict,
        lambda c: {**c, "time": np.array([t.removesuffix("Z") for t in c["time"]], dtype="datetime64[s]")},
    ),
    "dict with datetime": (dict, lambda c: {**c, "time": list(pd.to_datetime(c["time"]).to_pydatetime())}),
    "dict with float32 ids": (dict, lambda c: {**c, "sigma_m": np.array(c["sigma_m"])}),
    "pandas": (pd.DataFrame, zoned),
    "pandas with an index": (pd.DataFrame, lambda c: zoned(c).iloc[::-1].iloc[::-1].set_index("time")),
    "pandas sliced": (pd.DataFrame, lambda c: zoned(c).loc[lambda f: f["u_m"] < 1e9]),
    "polars": (pl.DataFrame, lambda c: pl.DataFrame(c)),
    "polars with zone": (
        pl.DataFrame,
        lambda c: pl.DataFrame(c).with_columns(pl.col("time").str.to_datetime(time_zone="UTC").dt.convert_time_zone("Asia/Tokyo")),
    ),
    "pyarrow": (pa.Table, lambda c: pa.table(c)),
    "pyarrow in pieces": (pa.Table, lambda c: pa.concat_tables([pa.table(c).slice(0, 7), pa.table(c).slice(7)])),
    "pyarrow dictionary": (pa.Table, lambda c: pa.table({**c, "target": pa.array(c["target"]).dictionary_encode()})),
}  # fmt: skip


def cells(table: Any, name: str) -> list[Any]:
    return list(table[name].to_pylist() if isinstance(table, pa.Table) else table[name])


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_gives_the_numbers_of_the_file(
    kind: str, columns: dict[str, list[Any]], example: hp.Field, tmp_path: Path
) -> None:
    path = tmp_path / "observations.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
    want = hp.calibrate(example, path)
    returned, make = KINDS[kind]
    got = hp.calibrate(example, make(columns))
    assert got.ids == want.ids == ["H001", "H040", "H120"]
    assert got.covariance.tobytes() == want.covariance.tobytes()
    assert got.mirror_tilt_rad.tobytes() == want.mirror_tilt_rad.tobytes()
    assert isinstance(want.to_table(), dict)
    for name in ("calibration", "rejected", "residuals"):
        table, plain = got.to_table(name), want.to_table(name)
        assert isinstance(table, returned)
        assert list(table.columns if isinstance(table, pd.DataFrame) else plain) == list(plain)
    assert [float(v) for v in cells(got.to_table(), "beam_rms_mrad")] == want.beam_rms_mrad.tolist()


def test_a_table_given_back_is_taken_again(columns: dict[str, list[Any]], example: hp.Field, tmp_path: Path) -> None:
    tables = [hp.calibrate(example, make(columns)).to_table() for _, make in KINDS.values()]
    first = None
    for table in tables:
        first = first or table
        assert cells(table, "id") == cells(first, "id")
        assert [str(s) for s in cells(table, "status")] == [str(s) for s in cells(first, "status")]
        # Absent text is no text, absent times are no times.
        assert not any(cell for cell in cells(table, "why") if cell == cell and cell is not None)


REFUSED: list[tuple[type[hp.HelioError], str, dict[str, Any]]] = [
    (hp.UnknownNameError, "observations: unknown column `colour`", {"colour": [1]}),
    (hp.FileValueError, "observations: row 1: heliostat `H001`: column `u_m` must be a number", {"u_m": ["wide"]}),
    (hp.TimeError, "observations: row 1: heliostat `H001`: column `time`.*no offset", {"time": ["2026-06-21T10:00:00"]}),
    (hp.FileValueError, "time without a zone", {"time": pd.Series(pd.to_datetime(["2026-06-21T10:00:00"]))}),
    (hp.ShapeError, "observations: column u_m: expected 1 rows as column heliostat_id has, got 2", {"u_m": [1.0, 2.0]}),
    (hp.DataTypeError, "observations: column u_m: expected text, numbers or times, got dtype complex", {"u_m": [1j]}),
    (hp.DataTypeError, "observations: column u_m: expected an array or a list, got float", {"u_m": 1.0}),
    (hp.UnknownNameError, "observations: row 1: column `heliostat_id`: unknown heliostat `H999`", {"heliostat_id": ["H999"]}),
]  # fmt: skip


@pytest.mark.parametrize(("error", "message", "change"), REFUSED)
def test_what_is_wrong_is_named(
    error: type[hp.HelioError], message: str, change: dict[str, Any], columns: dict[str, list[Any]], example: hp.Field
) -> None:
    one = {name: cells[:1] for name, cells in columns.items()} | change
    table = pd.DataFrame(one) if isinstance(next(iter(change.values())), pd.Series) else one
    with pytest.raises(error, match=message):
        hp.calibrate(example, table)


@pytest.mark.parametrize("value", [None, 3, [1, 2], b"x", np.zeros(3)])
def test_no_table_is_refused(value: Any, example: hp.Field) -> None:
    with pytest.raises(hp.DataTypeError, match="observations: expected a table") as caught:
        hp.calibrate(example, value)
    assert caught.value.field == "observations"


def test_missing_numbers_are_absent(columns: dict[str, list[Any]], example: hp.Field) -> None:
    columns = {**columns, "u_m": [np.nan, *columns["u_m"][1:]], "v_m": [np.nan, *columns["v_m"][1:]]}
    for table in (
        columns,
        pd.DataFrame(columns),
        pl.DataFrame(columns).with_columns(pl.col("u_m", "v_m").fill_nan(None)),
    ):
        rejected = hp.calibrate(example, table).to_table("rejected")
        assert "no_spot" in cells(rejected, "reason")


def test_masked_cells_of_a_column_are_cells_that_are_not_there(root: Path) -> None:
    field = hp.Field.from_toml(root / "examples/field.toml")
    seen = hp.simulate_observations(field, heliostats=1, count=12)
    masked = {"record_id": np.ma.masked_array([f"r{k}" for k in range(12)], mask=[True] + [False] * 11)}
    masked["sigma_m"] = np.ma.masked_array(np.full(12, 0.01), mask=True)
    masked["axis1_deg"] = np.ma.masked_array(seen.observations["axis1_deg"], mask=False)
    masked["time"] = np.ma.masked_array(seen.observations["time"], mask=False)
    without = {name: cells for name, cells in seen.observations.items() if name != "sigma_m"}
    wanted = hp.calibrate(field, without)
    found = hp.calibrate(field, without | masked)
    assert found.mirror_tilt_rad.tobytes() == wanted.mirror_tilt_rad.tobytes()
    assert hp.calibrate(field, seen).ids == wanted.ids
    # a masked whole number too
    with pytest.raises(hp.HelioError, match="axis1_deg"):
        hp.calibrate(field, without | {"axis1_deg": np.ma.masked_array(np.arange(12), mask=[True] * 12)})
    with pytest.raises(hp.OptionError, match=r"beyond 2\^63"):
        hp.calibrate(field, without | {"axis1_deg": np.full(12, 2**64 - 100, dtype=np.uint64)})


def test_tables_of_rows_refuse_suns_in_degrees(root: Path) -> None:
    field = hp.Field.from_toml(root / "examples/field.toml")
    tracking = hp.track(field, [3.0, 3.1], [0.8, 0.9])
    with pytest.raises(hp.SunDirectionError, match="sun 0 "):
        tracking.to_table(field, sun_azimuth_rad=[180.0, 170.0], sun_elevation_rad=[60.0, 40.0])
