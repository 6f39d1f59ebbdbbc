"""Times of every kind; naive ones refused."""

from __future__ import annotations

import datetime as dt
import math
import zoneinfo
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import helio_py as hp

SITE = (37.4, -6.25)
TEXTS = ["2026-06-21T12:00:00+02:00", "2026-12-21T09:30:00.123456Z"]
WANTED_NS = [1782036000_000000000, 1797845400_123456000]
MADRID = zoneinfo.ZoneInfo("Europe/Madrid")
AWARE = [
    dt.datetime(2026, 6, 21, 12, tzinfo=MADRID),
    dt.datetime(2026, 12, 21, 9, 30, 0, 123456, tzinfo=dt.timezone.utc),
]
UTC_NAIVE = np.array(["2026-06-21T10:00:00", "2026-12-21T09:30:00.123456"], dtype="datetime64[us]")

GOOD: dict[str, Any] = {
    "text": TEXTS,
    "datetime": AWARE,
    "mixed": (TEXTS[0], AWARE[1]),
    "datetime64[us]": UTC_NAIVE,
    "datetime64[ns]": UTC_NAIVE.astype("datetime64[ns]"),
    "datetime64 list": list(UTC_NAIVE),
    "objects": np.array(AWARE, dtype=object),
    "pandas index": pd.DatetimeIndex(UTC_NAIVE).tz_localize("UTC").tz_convert("Asia/Shanghai"),
    "pandas series": pd.Series(UTC_NAIVE).dt.tz_localize("UTC").dt.tz_convert("Europe/Madrid"),
    "pandas stamps": [pd.Timestamp(text) for text in TEXTS],
    "pandas text": pd.Series(TEXTS),
    "polars ms": pl.Series(AWARE).dt.cast_time_unit("us"),
    "polars zone": pl.Series(UTC_NAIVE).dt.replace_time_zone("UTC").dt.convert_time_zone("Asia/Tokyo"),
    "polars text": pl.Series(TEXTS),
    "pyarrow": pa.array(UTC_NAIVE).cast(pa.timestamp("us", tz="Europe/Madrid")),
    "pyarrow chunks": pa.chunked_array([pa.array(UTC_NAIVE).cast(pa.timestamp("ns", tz="UTC"))]),
}


@pytest.mark.parametrize("kind", GOOD)
def test_times_of_every_kind_are_the_same_instants(kind: str) -> None:
    from helio_py._times import unix_ns

    found = unix_ns(GOOD[kind])
    assert found.dtype == np.int64
    assert found.tolist() == WANTED_NS
    want = hp.sun_position(np.array(WANTED_NS, dtype="datetime64[ns]"), *SITE)
    got = hp.sun_position(GOOD[kind], *SITE)
    assert all(np.array_equal(a, b) for a, b in zip(got, want, strict=True))


def test_nanoseconds_are_kept() -> None:
    from helio_py._times import unix_ns

    assert unix_ns(pd.Timestamp("1970-01-01T00:00:00.000000123Z")) == 123
    assert unix_ns(pd.Timestamp("1969-12-31T23:59:59.999999877Z")) == -123
    assert unix_ns(pd.DatetimeIndex(["1970-01-01T00:00:00.000000123Z"])).tolist() == [123]
    assert unix_ns("1970-01-01T00:00:00.000000123Z") == 123


REFUSED: dict[str, tuple[type[hp.HelioError], str, Any]] = {
    "naive datetime": (hp.TimeError, "times: 2026-06-21T12:00:00: .*zone", dt.datetime(2026, 6, 21, 12)),
    "naive in a list": (hp.TimeError, "times: row 1: 2026.*zone", [AWARE[0], dt.datetime(2026, 6, 21, 12)]),
    "naive text": (hp.TimeError, "`2026-06-21T12:00:00` is not a usable time: it has no offset", "2026-06-21T12:00:00"),
    "naive index": (hp.TimeError, "times: .*zone", pd.DatetimeIndex(UTC_NAIVE)),
    "naive series": (hp.TimeError, "times: .*zone", pd.Series(UTC_NAIVE)),
    "naive polars": (hp.TimeError, "times: .*zone", pl.Series(UTC_NAIVE)),
    "naive pyarrow": (hp.TimeError, "times: .*zone", pa.array(UTC_NAIVE)),
    "nat": (hp.TimeError, r"times: row 1: no time \(NaT\)", np.array(["2026-01-01", "NaT"], "datetime64[s]")),
    "pandas nat": (hp.TimeError, "times: row 1: no time", pd.DatetimeIndex(["2026-01-01T00:00Z", None])),
    "polars null": (hp.TimeError, "times: row 1: no time", pl.Series([AWARE[0], None])),
    "too early": (hp.TimeError, "1678 and 2262", np.array(["1500-01-01"], "datetime64[D]")),
    "too late": (hp.TimeError, "1678 and 2262", dt.datetime(2500, 1, 1, tzinfo=dt.timezone.utc)),
    "words": (hp.TimeError, "`noon` is not a usable time", "noon"),
    "number": (hp.DataTypeError, "times: expected .*, got float", 1.75e9),
    "numbers": (hp.DataTypeError, "times: expected .*, got an array of dtype float64", np.array([1.75e9])),
    "date": (hp.DataTypeError, "times: expected .*, got date", dt.date(2026, 6, 21)),
    "none": (hp.DataTypeError, "times: expected .*, got NoneType", None),
    "numbers of pandas": (hp.DataTypeError, "times: expected .*, got Series", pd.Series([1.0])),
    "numbers of polars": (hp.DataTypeError, "times: expected .*, got Series", pl.Series([1.0])),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_anything_else_is_refused(kind: str) -> None:
    expected, message, value = REFUSED[kind]
    with pytest.raises(expected, match=message) as caught:
        hp.sun_position(value, *SITE)
    assert caught.value.field == "times"


@pytest.mark.parametrize("shape", [(), (0,), (1,), (6,), (2, 3)])
def test_suns_have_the_shape_of_their_times(shape: tuple[int, ...]) -> None:
    start = np.datetime64("2026-06-21T04:00")
    times = start + np.arange(math.prod(shape)).reshape(shape) * np.timedelta64(1, "h")
    sun = hp.sun_position(times, *SITE)
    for column in sun:
        assert np.shape(column) == shape
        if shape == ():
            assert isinstance(column, np.float64)
    if shape:
        for flat, time in enumerate(np.ravel(times)):
            assert hp.sun_position(time, *SITE).azimuth_rad == np.ravel(sun.azimuth_rad)[flat]


def test_a_field_s_sun_is_that_of_its_site(example: hp.Field) -> None:
    sun = example.sun_position(TEXTS)
    same = hp.sun_position(TEXTS, *SITE, elevation_m=20.0)
    assert all(np.array_equal(a, b) for a, b in zip(sun, same, strict=True))
