"""Arrays of every kind in, arrays of their own out."""

from __future__ import annotations

import gc
import pickle
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest

import helio_py as hp
from conftest import random_field, same_bits

LAYOUTS: dict[str, Callable[[Any], Any]] = {
    "contiguous": np.ascontiguousarray,
    "strided": lambda a: np.repeat(a, 2, axis=0)[::2],
    "reversed": lambda a: a[::-1].copy()[::-1],
    "fortran": np.asfortranarray,
    "read-only": lambda a: (a.setflags(write=False), a)[1],
    "misaligned": lambda a: np.frombuffer(b"." + a.tobytes(), dtype=a.dtype, offset=1).reshape(a.shape),
    "big-endian": lambda a: a.astype(a.dtype.newbyteorder(">")),
    "list": lambda a: a.tolist(),
    "tuple": lambda a: tuple(map(tuple, a.tolist())) if a.ndim > 1 else tuple(a.tolist()),
}
DTYPES = ["float64", "float32", "float16", "int64", "int32", "uint8"]


@pytest.mark.parametrize("n", [0, 1, 2, 7, 100])
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_dtype_and_layout_gives_what_plain_float64_gives(layout: str, dtype: str, n: int) -> None:
    rng = np.random.default_rng(n)
    position = rng.integers(10, 120, (n, 3)).astype(dtype)
    suns = np.ones((2, 3)).astype(dtype)
    plain = hp.Field(position.astype(float), [0, 0, 200])
    field = hp.Field(LAYOUTS[layout](position.copy()) if n else position, [0, 0, 200])
    want = hp.track(plain, suns[0].astype(float), suns[1].astype(float))
    got = hp.track(field, LAYOUTS[layout](suns[0].copy()), LAYOUTS[layout](suns[1].copy()))
    assert got.shape == got.azimuth_rad.shape == got.status.shape == (3, n)
    assert same_bits(got, want)
    angles = [LAYOUTS[layout](np.asarray(a).astype(dtype)) if n else a for a in (want.azimuth_rad, want.elevation_rad)]
    plain_angles = [np.asarray(a).astype(dtype).astype(float) for a in (want.azimuth_rad, want.elevation_rad)]
    normals = hp.forward(field, *angles)
    assert normals.shape == (3, n, 3)
    assert normals.tobytes() == hp.forward(plain, *plain_angles).tobytes()


@pytest.mark.parametrize("n", [0, 1, 2, 9])
def test_shapes_follow_the_question(n: int) -> None:
    field = random_field(n)
    assert len(field) == n
    assert field.position_enu_m.shape == (n, 3)
    one = hp.track(field, 3.0, 0.8)
    assert one.shape == one.azimuth_rad.shape == (n,)
    for m in (0, 1, 3):
        many = hp.track(field, np.full(m, 3.0), np.full(m, 0.8))
        assert many.shape == many.elevation_rad.shape == (m, n)
        assert hp.forward(field, many.azimuth_rad, many.elevation_rad).shape == (m, n, 3)
        if m:
            assert many.azimuth_rad[-1].tobytes() == one.azimuth_rad.tobytes()


def test_scalars_of_every_kind_are_one_sun() -> None:
    field = random_field(3)
    want = hp.track(field, 3.0, 0.5)
    scalars: list[tuple[Any, Any]] = [
        (3, 0.5),
        (np.float64(3), np.float64(0.5)),
        (np.float32(3), np.float16(0.5)),
        (np.array(3), np.array(0.5)),
        (np.int8(3), 0.5),
    ]
    for three, half in scalars:
        got = hp.track(field, three, half)
        assert got.shape == (3,)
        assert same_bits(got, want)


def test_contiguous_float64_is_read_where_it_lies() -> None:
    from helio_py import _native

    array = np.array([[2.0, 3.0], [4.0, 5.0]])
    read_only = array.view()
    read_only.setflags(write=False)
    for there in (array, array[1], read_only, array.ravel(), np.array(3.0), np.zeros((1, 3)).T):
        assert _native._address_read(there) == there.ctypes.data
    for copied in (array.T, array[:, 0], array.astype(np.float32), array.astype(">f8")):
        assert _native._address_read(copied) != copied.ctypes.data


def test_outputs_live_as_long_as_anybody_looks() -> None:
    field = random_field(1000)
    want = hp.track(field, 3.0, 0.8).azimuth_rad.copy()
    kept = [hp.track(field, 3.0, 0.8).azimuth_rad for _ in range(20)]
    gc.collect()
    for _ in range(20):
        hp.track(field, 1.0, 0.2)
    assert all(array.tobytes() == want.tobytes() for array in kept)
    assert not any(np.shares_memory(a, b) for a in kept for b in kept if a is not b)


def test_outputs_are_writable_and_writing_does_no_harm() -> None:
    field = random_field(50)
    want = hp.track(field, 3.0, 0.8)
    out = hp.track(field, 3.0, 0.8)
    out.azimuth_rad[:] = 7.0
    out.limit_excess_rad[:] = 7.0
    out.status[:] = 200
    again = hp.track(field, 3.0, 0.8, out=out)
    assert again is out
    assert same_bits(again, want)
    # Nor to what later takes the same memory.
    out.limit_excess_rad[:] = 7.0
    out.status[:] = 200
    del out, again
    assert same_bits(hp.track(field, 3.0, 0.8), want)


def test_out_is_written_over_in_place() -> None:
    field = random_field(10)
    out = hp.track(field, 1.0, 0.2)
    azimuth = out.azimuth_rad
    hp.track(field, 3.0, 0.8, out=out)
    assert azimuth.tobytes() == hp.track(field, 3.0, 0.8).azimuth_rad.tobytes()
    for other in (random_field(11), random_field(0)):
        with pytest.raises(hp.ShapeError, match=r"^out: expected shape \(\d+,\), got \(10,\)$"):
            hp.track(other, 3.0, 0.8, out=out)
    with pytest.raises(hp.ShapeError, match=r"^out: expected shape \(1, 10\), got \(10,\)$"):
        hp.track(field, [3.0], [0.8], out=out)


def test_series_are_columns() -> None:
    field = random_field(4)
    want = hp.track(field, np.array([3.0, 3.1]), np.array([0.8, 0.7]))
    for series in (pd.Series, pl.Series):
        assert same_bits(hp.track(field, series([3.0, 3.1]), series([0.8, 0.7])), want)


REFUSED: dict[str, Any] = {
    "text": "3.0",
    "bytes": b"3",
    "none": None,
    "dict": {"a": 1},
    "bool": np.array([True, False]),
    "complex": np.array([1 + 2j, 3]),
    "object": np.array([1.0, None], dtype=object),
    "texts": ["1", "2"],
    "ragged": [[1.0], [1.0, 2.0]],
    "time": np.array(["2026-01-01"], dtype="datetime64[s]"),
    "record": np.zeros(2, dtype=[("a", float)]),
    "masked": np.ma.masked_array([1.0, 2.0], mask=[True, False]),
    "long double": np.zeros(2, dtype=np.longdouble),
    "thing": object(),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_anything_else_is_refused_by_name(kind: str) -> None:
    field = random_field(2)
    value = REFUSED[kind]
    calls: dict[str, Callable[[], Any]] = {
        "sun_azimuth_rad": lambda: hp.track(field, value, 0.5),
        "sun_elevation_rad": lambda: hp.track(field, 0.5, value),
        "azimuth_rad": lambda: hp.forward(field, value, [0.5, 0.5]),
        "position_enu_m": lambda: hp.Field(value, [0, 0, 1]),
        "mirror_offset_m": lambda: hp.Field([[0, 0, 0]], [0, 0, 1], mirror_offset_m=value),
        "latitude_deg": lambda: hp.sun_position("2026-01-01T00:00Z", value, 0.0),
        "angle_rad": lambda: hp.Drive.encoder(1.0).steps(value),
    }
    for name, call in calls.items():
        with pytest.raises(hp.DataTypeError, match=f"^{name}: expected real numbers, got ") as caught:
            call()
        assert caught.value.field == name
        assert isinstance(caught.value, TypeError)


def test_wrong_shapes_are_value_errors_that_name_the_argument() -> None:
    field = random_field(3)
    calls: list[tuple[str, Callable[[], Any]]] = [
        (r"sun_elevation_rad: expected shape \(2,\) as .*, got \(3,\)", lambda: hp.track(field, [1.0] * 2, [1.0] * 3)),
        (r"sun_azimuth_rad: expected shape \(\) or \(m,\), got \(1, 1\)", lambda: hp.track(field, [[1.0]], [[1.0]])),
        (r"azimuth_rad: expected shape \(3,\) or \(m, 3\), got \(2,\)", lambda: hp.forward(field, [1.0] * 2, [1.0] * 2)),
        (r"elevation_rad: expected shape \(3,\)", lambda: hp.forward(field, [1.0] * 3, [1.0] * 2)),
        (r"position_enu_m: expected shape \(n, 3\) \(east, north, up\), got \(3,\)", lambda: hp.Field([0, 0, 0], [0, 0, 1])),
        (r"aim_enu_m: expected shape \(3,\) or \(1, 3\)", lambda: hp.Field([[0, 0, 0]], [0, 0])),
        (r"mirror_tilt_rad: expected shape \(\) or \(1,\), got \(2,\)", lambda: hp.Field([[0, 0, 0]], [0, 0, 1], mirror_tilt_rad=[0, 0])),
        (r"ids: expected shape \(1,\), got \(2,\)", lambda: hp.Field([[0, 0, 0]], [0, 0, 1], ids=["a", "b"])),
        (r"present axis2_rad: expected shape \(3,\), got \(1,\)", lambda: hp.track(field, 1.0, 1.0, present=([0] * 3, [0]))),
        (r"times: expected shape \(\) as the suns have, got \(1,\)", lambda: hp.track(field, 1.0, 1.0, times=["2026-01-01T00:00Z"])),
    ]  # fmt: skip
    for message, call in calls:
        with pytest.raises(hp.ShapeError, match=f"^{message}") as caught:
            call()
        assert isinstance(caught.value, ValueError)
        assert isinstance(caught.value, hp.HelioError)


def test_answers_and_fields_survive_pickling(example: hp.Field) -> None:
    for field in (random_field(5), example, hp.Field(np.zeros((0, 3)), [0, 0, 1], mode="polar", latitude_rad=0.5)):
        again = pickle.loads(pickle.dumps(field))
        assert again.ids == field.ids
        for suns in ((3.0, 0.8), ([3.0, 2.0], [0.8, -0.1])):
            want = hp.track(field, *suns)
            assert same_bits(hp.track(again, *suns), want)
            assert same_bits(pickle.loads(pickle.dumps(want)), want)


def test_nothing_holds_on_to_a_field() -> None:
    class Marked(list[float]):
        pass

    numbers = Marked([0.1, 0.2])
    alive = weakref.ref(numbers)
    field = hp.Field([[0, 0, 0], [9, 9, 0]], [0, 0, 50], mirror_offset_m=numbers)
    del numbers
    assert alive() is None
    assert len(field) == 2
