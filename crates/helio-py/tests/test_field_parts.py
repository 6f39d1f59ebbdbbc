"""Fields made of columns with a site, targets and drives: all that a field read from files is."""

from __future__ import annotations

import copy
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helio_py as hp
from conftest import same_bits

ROOT = Path(__file__).parents[3]
SEEN = ROOT / "examples" / "observations.csv"
BOARD = {"centre_enu_m": [0, 8, 70], "normal_enu": [0, 1, 0], "width_m": 14, "height_m": 12}
SITE = {"latitude_deg": 37.4, "longitude_deg": -6.25, "elevation_m": 20}
COLUMNS = (
    *("mirror_offset_m", "pedestal_tilt_rad", "pedestal_tilt_azimuth_rad", "axis_nonorthogonality_rad"),
    *("mirror_tilt_rad", "azimuth_reference_rad", "elevation_reference_rad", "axis1_sag_rad", "axis2_sag_rad"),
    *("axis2_eccentricity_rad", "axis1_min_rad", "axis1_max_rad", "axis2_min_rad", "axis2_max_rad"),
)


def as_columns(field: hp.Field, **instead: Any) -> hp.Field:
    """The same field from what it says of itself."""
    given: dict[str, Any] = {name: getattr(field, name) for name in COLUMNS}
    given |= {"ids": field.ids, "aim": field.aim, "site": field.site, "targets": field.targets, "drives": field.drives}
    return hp.Field(field.position_enu_m, **(given | instead))


@pytest.fixture(scope="module")
def columns(example: hp.Field) -> hp.Field:
    return as_columns(example)


def test_a_field_says_all_that_it_is_made_of(example: hp.Field, columns: hp.Field) -> None:
    assert columns.files == [] and example.files
    assert (columns.site, columns.targets, columns.aim) == (example.site, example.targets, example.aim)
    assert columns.site is not None and columns.site["latitude_deg"] == 37.4
    assert set(columns.aim) == {"receiver"} and set(columns.targets) == {"receiver", "board-north", "board-south"}
    assert columns.drives == example.drives
    for name in COLUMNS:
        assert getattr(columns, name).tobytes() == getattr(example, name).tobytes(), name
    assert hp.Field([[0, 1, 2]], [0, 0, 9]).aim == [None]
    assert hp.Field([[0, 1, 2]], [0, 0, 9]).site is None


def test_it_tracks_and_predicts_as_the_files_do(example: hp.Field, columns: hp.Field) -> None:
    times = np.array(["2026-03-20T09:00", "2026-06-21T12:00"], dtype="datetime64[ns]")
    stamps = [f"{time}Z" for time in times]
    sun, same_sun = example.sun_position(stamps), columns.sun_position(stamps)
    assert sun.azimuth_rad.tobytes() == same_sun.azimuth_rad.tobytes()
    tracking = hp.track(example, *sun[:2])
    assert same_bits(tracking, hp.track(columns, *sun[:2]))
    assert tracking.to_table(example, times=stamps)["axis1_steps"].tobytes() == (
        hp.track(columns, *sun[:2]).to_table(columns, times=stamps)["axis1_steps"].tobytes()
    )
    angles = tracking.azimuth_rad, tracking.elevation_rad
    landed_on, same = (hp.predict(of, *angles, *sun[:2]) for of in (example, columns))
    assert landed_on.beam_error_rad.tobytes() == same.beam_error_rad.tobytes()
    assert (landed_on.u_m.tobytes(), landed_on.v_m.tobytes()) == (same.u_m.tobytes(), same.v_m.tobytes())
    table = tracking.to_table(example, times=stamps)
    landed, again = hp.predict(example, table), hp.predict(columns, table)
    assert all(np.array_equal(landed[name], again[name], equal_nan=name.endswith(("_m", "_mrad"))) for name in landed)


def test_it_is_simulated_and_calibrated_as_the_files_are(example: hp.Field, columns: hp.Field) -> None:
    asked: dict[str, Any] = {"heliostats": 3, "count": 20, "seed": 4, "random_errors": True}
    seen = hp.simulate_observations(columns, **asked).to_table()
    assert all(
        np.array_equal(seen[name], cells)
        for name, cells in hp.simulate_observations(example, **asked).to_table().items()
    )
    for options in ({}, {"sets": 2}, {"joint": True}):
        want, found = (hp.calibrate(field, SEEN, **options).to_table() for field in (example, columns))
        assert list(want) == list(found)
        other = {name for name in want if list(map(repr, want[name])) != list(map(repr, found[name]))}
        # what it was made from is no file, and says so by another sum
        assert other == {"field_hash"}, options


@pytest.mark.parametrize("options", [{}, {"sets": 2}])
def test_a_calibration_takes_its_place_in_columns(
    example: hp.Field, columns: hp.Field, options: dict[str, Any]
) -> None:
    calibration = hp.calibrate(example, SEEN, **options)
    files, applied = calibration.apply(example), calibration.apply(columns)
    sun = columns.sun_position("2026-06-21T09:00Z")
    want = hp.track(files, *sun[:2])
    assert same_bits(hp.track(applied, *sun[:2]), want)
    assert not same_bits(hp.track(columns, *sun[:2]), want)
    for again in (pickle.loads(pickle.dumps(applied)), copy.deepcopy(applied)):
        assert same_bits(hp.track(again, *sun[:2]), want)
    # one in the place of another, not on top of it
    assert same_bits(hp.track(calibration.apply(applied), *sun[:2]), want)


def test_what_is_beside_a_calibration_is_the_same(example: hp.Field, columns: hp.Field, tmp_path: Path) -> None:
    earlier = hp.calibrate(example, SEEN)
    made = []
    for field in (example, columns):
        page = tmp_path / "page.html"
        found = hp.calibrate(field, SEEN, robust="huber", plan=(2, "2026-06-21"), compare=earlier, report=page)
        made.append((found.changes, repr(found.to_table("plan")), repr(found.to_table("changes"))))
        assert ("columns of no file" in page.read_text()) == (field is columns)
    assert made[0] == made[1]


def test_it_survives_pickling_to_the_last_bit(columns: hp.Field) -> None:
    odd = as_columns(columns, site={**SITE, "latitude_deg": 0.1 + 0.2}, axis1_min_rad=-1.0)
    again = pickle.loads(pickle.dumps(odd))
    at = ["2026-06-21T09:00Z"]
    assert again.sun_position(at).azimuth_rad.tobytes() == odd.sun_position(at).azimuth_rad.tobytes()
    assert (again.site, again.targets, again.aim, again.drives) == (odd.site, odd.targets, odd.aim, odd.drives)
    assert again.axis1_min_rad.tobytes() == odd.axis1_min_rad.tobytes()
    assert hp.calibrate(again, SEEN).to_table()["field_hash"][0] == hp.calibrate(odd, SEEN).to_table()["field_hash"][0]


def test_what_it_is_made_from_is_told_apart(columns: hp.Field) -> None:
    fields = [columns, as_columns(columns, mirror_offset_m=0.31), as_columns(columns, site={**SITE, "elevation_m": 21})]
    sums = {hp.calibrate(field, SEEN).to_table()["field_hash"][0] for field in fields}
    assert len(sums) == len(fields)


def test_drives_narrow_the_limits(columns: hp.Field) -> None:
    drive = hp.Drive.encoder(1000.0, min_steps=-500.0, max_steps=1500.0)
    field = hp.Field([[0, 90, 6], [30, 90, 6]], [0, 0, 90], axis1_max_rad=1.0, drives=(drive, None))
    assert field.axis1_min_rad.tolist() == [-0.5, -0.5] and field.axis1_max_rad.tolist() == [1.0, 1.0]
    assert field.drives == [(drive, None)] * 2
    assert field.steps([0.25, 0.5], [0.0, 0.0])[0].tolist() == [250.0, 500.0]
    each = hp.Field([[0, 90, 6], [30, 90, 6]], [0, 0, 90], drives=[(None, None), (drive, drive)])
    assert each.axis1_min_rad.tolist() == [-np.inf, -0.5]
    with pytest.raises(hp.ConflictError, match=r"heliostat `1`: axis 1 cannot move") as caught:
        hp.Field(
            [[0, 90, 6], [30, 90, 6]], [0, 0, 90], axis1_min_rad=[0.0, 2.0], axis1_max_rad=3.0, drives=(drive, None)
        )
    assert caught.value.id == "1"


def test_a_polar_mount_takes_the_latitude_of_its_site() -> None:
    polar = hp.Field([[0, 90, 6]], [0, 0, 90], mode="polar", site=SITE)
    assert polar.latitude_rad == np.radians(37.4)
    assert pickle.loads(pickle.dumps(polar)).latitude_rad == polar.latitude_rad
    own = hp.Field([[0, 90, 6]], [0, 0, 90], mode="polar", latitude_rad=0.5, site=SITE)
    assert own.latitude_rad == 0.5


def test_a_field_between_processes_keeps_a_changing_mapping_out() -> None:
    site = dict(SITE)
    field = hp.Field([[0, 90, 6]], [0, 0, 90], site=site)
    site["latitude_deg"] = -10.0
    assert field.site is not None and field.site["latitude_deg"] == 37.4
    field.site["latitude_deg"] = 1.0
    assert field.site["latitude_deg"] == 37.4


WRONG: list[tuple[dict[str, Any], type[hp.HelioError], str]] = [
    ({}, hp.MissingError, "aim_enu_m: what the heliostats aim at is missing"),
    ({"aim": "board"}, hp.UnknownNameError, "aim: unknown target `board`; there are none: give `targets`"),
    ({"aim": "bord", "targets": {"board": BOARD}}, hp.UnknownNameError, "aim: unknown target `bord`; known are board"),
    ({"aim": ["board", "x"], "targets": {"board": BOARD}}, hp.ShapeError, "aim: expected shape (1,), got (2,)"),
    ({"aim": [3], "targets": {"board": BOARD}}, hp.DataTypeError, "aim: row 0 must be a str"),
    ({"aim": 3, "targets": {"board": BOARD}}, hp.DataTypeError, "aim: expected a sequence of str"),
    ({"aim": "board", "aim_enu_m": [0, 0, 9], "targets": {"board": BOARD}}, hp.OptionError, "aim: it stands beside"),
    ({"aim_enu_m": [0, 0, 9], "site": 3}, hp.DataTypeError, "site: expected a mapping of the keys of [site], got int"),
    ({"aim_enu_m": [0, 0, 9], "site": {"latitude_deg": 1.0}}, hp.MissingError, "site.longitude_deg is missing"),
    ({"aim_enu_m": [0, 0, 9], "site": {**SITE, "latitude_deg": 97}}, hp.FileValueError, "site.latitude_deg"),
    ({"aim_enu_m": [0, 0, 9], "site": {**SITE, "latitude_deg": np.nan}}, hp.FileValueError, "site.latitude_deg"),
    ({"aim_enu_m": [0, 0, 9], "site": {**SITE, "latitude_rad": 1.0}}, hp.UnknownNameError, "latitude_deg"),
    ({"aim_enu_m": [0, 0, 9], "site": {**SITE, "elevation_m": "high"}}, hp.FileValueError, "site.elevation_m"),
    (
        {"aim_enu_m": [0, 0, 9], "site": {**SITE, "elevation_m": object()}},
        hp.DataTypeError,
        "site elevation_m: expected a number",
    ),
    ({"aim_enu_m": [0, 0, 9], "targets": [BOARD]}, hp.DataTypeError, "targets: expected names and mappings"),
    ({"aim_enu_m": [0, 0, 9], "targets": {"board": 3}}, hp.DataTypeError, "targets: board: expected a mapping of keys"),
    ({"aim_enu_m": [0, 0, 9], "targets": {"b": {}}}, hp.MissingError, "targets.b.centre_enu_m is missing"),
    ({"aim_enu_m": [0, 0, 9], "targets": {"b": {**BOARD, "normal_enu": [0, 0, 0]}}}, hp.ConflictError, "no length"),
    ({"aim_enu_m": [0, 0, 9], "targets": {3: BOARD}}, hp.DataTypeError, "targets: expected names of keys, got int"),
    ({"aim_enu_m": [0, 0, 9], "drives": 3}, hp.DataTypeError, "drives: expected a pair of Drive or None"),
    ({"aim_enu_m": [0, 0, 9], "drives": [(None, 3)]}, hp.DataTypeError, "drives: expected a pair"),
    ({"aim_enu_m": [0, 0, 9], "drives": [(None, None)] * 2}, hp.ShapeError, "drives: expected shape (1,), got (2,)"),
]


@pytest.mark.parametrize(("given", "error", "message"), WRONG)
def test_wrong_surroundings_are_named(given: dict[str, Any], error: type[hp.HelioError], message: str) -> None:
    with pytest.raises(error, match=re.escape(message)) as caught:
        hp.Field([[0, 50, 5]], **given)
    assert caught.value.field is not None
    assert caught.value.field.partition(".")[0] in given or error in (hp.MissingError, hp.UnknownNameError)


def test_what_is_missing_is_said(columns: hp.Field) -> None:
    bare = hp.Field(columns.position_enu_m, columns.aim_enu_m, ids=columns.ids)
    for call in (hp.calibrate, lambda field, seen: hp.simulate_observations(field)):
        with pytest.raises(
            hp.MissingError, match=r"give it `targets` and `site`, or read it from files: Field\.from_toml"
        ):
            call(bare, SEEN)
    placeless = as_columns(columns, site=None)
    with pytest.raises(hp.MissingError, match=r"\[site\]"):
        hp.calibrate(placeless, SEEN)
    with pytest.raises(hp.HelioError, match=r"\[site\]"):
        hp.calibrate(placeless, SEEN, joint=True)
    point = as_columns(columns, targets={**columns.targets, "board-north": {"centre_enu_m": [0, 8, 70]}})
    with pytest.raises(hp.ConflictError, match="is a mere point"):
        hp.calibrate(point, SEEN)
