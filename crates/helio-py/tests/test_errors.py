"""What is refused, by which class, in which words."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helio_py as hp

HERE = [[0.0, 0.0, 0.0]]
AIM = [0.0, 90.0, 30.0]


def field() -> hp.Field:
    return hp.Field(HERE, AIM, ids=["A1"])


CALLS: list[tuple[type[hp.HelioError], str, dict[str, Any], Callable[[], Any]]] = [
    (
        hp.FieldValueError,
        "heliostat A1: mirror_tilt_rad must be within ±1.4 rad (80°), got 2",
        {"id": "A1", "field": "mirror_tilt_rad", "value": 2.0},
        lambda: hp.Field(HERE, AIM, ids=["A1"], mirror_tilt_rad=2.0),
    ),
    (
        hp.FieldValueError,
        "heliostat 0: aim_up_m must be finite and within ±1e9, got NaN",
        {"id": "0", "field": "aim_up_m"},
        lambda: hp.Field(HERE, [0, 0, np.nan]),
    ),
    (
        hp.DuplicateIdError,
        "heliostat A: the id stands twice, in rows 0 and 1 (counted from 0)",
        {"id": "A", "row": 1},
        lambda: hp.Field([[0, 0, 0], [9, 0, 0]], AIM, ids=["A", "A"]),
    ),
    (
        hp.EmptyLimitsError,
        "heliostat 0: axis2 limits are empty: from 1 rad to 0.5 rad",
        {"id": "0", "field": "axis2"},
        lambda: hp.Field(HERE, AIM, axis2_min_rad=1.0, axis2_max_rad=0.5),
    ),
    (
        hp.UnknownNameError,
        "mirror_offset: no such quantity of a heliostat; known are mirror_offset_m, ",
        {"field": "mirror_offset"},
        lambda: hp.Field(HERE, AIM, **{"mirror_offset": 0.1}),  # type: ignore[arg-type]
    ),
    (
        hp.OptionError,
        "mode: wanted azimuth-elevation, spinning-elevation, pitch-roll or polar, got `altaz`",
        {"field": "mode"},
        lambda: hp.Field(HERE, AIM, mode="altaz"),
    ),
    (
        hp.OptionError,
        "latitude_rad: mode polar needs it",
        {"field": "latitude_rad"},
        lambda: hp.Field(HERE, AIM, mode="polar"),
    ),
    (
        hp.OptionError,
        "offset: wanted exact, approximate, iterated:N or none, got `good`",
        {"field": "offset"},
        lambda: hp.track(field(), 1.0, 1.0, "good"),
    ),
    (
        hp.OptionError,
        "offset: iterated: wants a number of iterations in 1..=64, such as iterated:2, got `iterated:0`",
        {"field": "offset"},
        lambda: hp.track(field(), 1.0, 1.0, "iterated:0"),
    ),
    (
        hp.SunDirectionError,
        "sun 1 (counted from 0) must be a direction, but its angles were not finite",
        {"row": 1},
        lambda: hp.track(field(), [1.0, np.nan], [1.0, 1.0]),
    ),
    (
        hp.SunDirectionError,
        "sun_elevation_rad: sun 0 (counted from 0) must be within ±π/2 rad (±90°), got 60",
        {"row": 0, "field": "sun_elevation_rad", "value": 60.0},
        lambda: hp.track(field(), 180.0, 60.0),
    ),
    (
        hp.SunDirectionError,
        "sun_elevation_rad: sun 1 (counted from 0) must be within ±π/2 rad (±90°), got -12",
        {"row": 1, "field": "sun_elevation_rad", "value": -12.0},
        lambda: hp.predict(field(), [[1.0]] * 2, [[1.0]] * 2, [3.0, 3.0], [0.8, -12]),
    ),
    (
        hp.DataTypeError,
        "sun_azimuth_rad: expected real numbers, got list of text",
        {"field": "sun_azimuth_rad"},
        lambda: hp.track(field(), ["3.0", "3.1"], [0.8, 0.8]),
    ),
    (
        hp.AngleError,
        "elevation_rad: row 2 must be finite and within ±100000 rad, got inf",
        {"row": 2, "field": "elevation_rad", "value": np.inf},
        lambda: hp.forward(field(), [[1.0]] * 3, [[1.0], [1.0], [np.inf]]),
    ),
    (
        hp.SunError,
        "sun position: latitude_rad must be within ±π/2 (±90°), got 1.58",
        {"field": "latitude_rad"},
        lambda: hp.sun_position("2026-01-01T00:00Z", 91.0, 0.0),
    ),
    (
        hp.SunError,
        "sun position: delta_t_s must be within ±8000 s, got inf",
        {"field": "delta_t_s"},
        lambda: hp.sun_position(np.zeros(0, "datetime64[s]"), 1.0, 0.0, delta_t_s=np.inf),
    ),
    (
        hp.DriveError,
        "drive: sign must be 1 or -1, got 0",
        {"field": "sign", "value": 0.0},
        lambda: hp.Drive.encoder(1.0, sign=0.0),
    ),
    (
        hp.MissingError,
        "there is no [site], which the sun's position at a time needs",
        {},
        lambda: field().sun_position("2026-01-01T00:00Z"),
    ),
    (
        hp.DataTypeError,
        "field: expected a Field, got <class 'int'>",
        {"field": "field"},
        lambda: hp.track(7, 1.0, 1.0),  # type: ignore[arg-type]
    ),
    (
        hp.DataTypeError,
        "out: expected a Tracking, got <class 'dict'>",
        {"field": "out"},
        lambda: hp.track(field(), 1.0, 1.0, out={}),  # type: ignore[arg-type]
    ),
]


@pytest.mark.parametrize(("kind", "message", "attributes", "call"), CALLS, ids=[c[1][:40] for c in CALLS])
def test_each_case_has_its_class_its_message_and_its_attributes(
    kind: type[hp.HelioError], message: str, attributes: dict[str, Any], call: Callable[[], Any]
) -> None:
    with pytest.raises(hp.HelioError) as caught:
        call()
    assert type(caught.value) is kind
    assert str(caught.value).startswith(message), str(caught.value)
    for name, value in attributes.items():
        assert getattr(caught.value, name) == value, name
    again = pickle.loads(pickle.dumps(caught.value))
    assert type(again) is kind
    assert str(again) == str(caught.value)
    assert repr(vars(again)) == repr(vars(caught.value))


def test_files_are_refused_with_their_place(tmp_path: Path) -> None:
    toml, layout = tmp_path / "field.toml", tmp_path / "layout.csv"
    text = '[heliostats]\ntable = "layout.csv"\n'
    head = "id,east_m,north_m,up_m,aim_east_m,aim_north_m,aim_up_m\n"

    def refused(toml_text: str, layout_text: str) -> hp.FileError:
        toml.write_text(toml_text)
        layout.write_text(layout_text)
        with pytest.raises(hp.FileError) as caught:
            hp.Field.from_toml(toml)
        return caught.value

    error = refused(text + "mirror_ofset_m = 0.2\n", head)
    assert isinstance(error, hp.UnknownNameError)
    assert "did you mean `mirror_offset_m`?" in str(error)
    assert (error.path, error.line, error.column) == (toml, 3, 1)
    error = refused(text, head + "A,1,2,3,0,0,9\nB,1,x,3,0,0,9\n")
    assert isinstance(error, hp.FileValueError)
    assert (error.path, error.line, error.id, error.field) == (layout, 3, "B", "north_m")
    assert isinstance(refused("[heliostats\n", head), hp.FileSyntaxError)
    assert isinstance(refused("", head), hp.MissingError)
    assert isinstance(refused(text, head + "A,1,2,3,0,0,9\nA,1,2,3,0,0,9\n"), hp.DuplicateNameError)
    with pytest.raises(hp.FileUnreadableError, match="cannot be read") as caught:
        hp.Field.from_toml(str(tmp_path / "nowhere.toml"))
    assert isinstance(caught.value, OSError)
    assert caught.value.path == tmp_path / "nowhere.toml"


def test_a_changed_file_is_not_what_was_pickled(tmp_path: Path) -> None:
    toml, layout = tmp_path / "field.toml", tmp_path / "layout.csv"
    toml.write_text('[heliostats]\ntable = "layout.csv"\n')
    layout.write_text("id,east_m,north_m,up_m,aim_east_m,aim_north_m,aim_up_m\nA,1,2,3,0,0,9\n")
    kept = pickle.dumps(hp.Field.from_toml(toml))
    assert pickle.loads(kept).ids == ["A"]
    layout.write_text(layout.read_text() + "B,4,2,3,0,0,9\n")
    with pytest.raises(hp.ConflictError, match="has changed since this field was pickled"):
        pickle.loads(kept)


def test_a_panic_is_an_ordinary_exception(capfd: pytest.CaptureFixture[str]) -> None:
    from helio_py import _native

    with pytest.raises(hp.InternalError, match="please report it: index out of bounds"):
        _native._panic()
    assert "panicked at" in capfd.readouterr().err
    assert issubclass(hp.InternalError, Exception)


def test_every_public_exception_is_a_helio_error() -> None:
    classes = [getattr(hp, name) for name in hp.__all__ if name.endswith("Error")]
    assert len(classes) > 20
    assert all(issubclass(cls, hp.HelioError) and cls.__doc__ for cls in classes)
