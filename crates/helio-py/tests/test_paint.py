"""`convert_paint`: real records against what others made of them, and records made wrong."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helio_py as hp


@pytest.fixture(scope="module")
def juelich() -> Path:
    found = os.environ.get("HELIO_DATA")
    if not found:
        pytest.skip("no recorded data: set HELIO_DATA")
    return Path(found) / "juelich"


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def converted(juelich: Path, tmp_path_factory: pytest.TempPathFactory) -> hp.Paint:
    heliostats = {
        path.name.partition("-")[0]: path for path in (juelich / "calibration").glob("*-heliostat-properties.json")
    }
    records: dict[str, list[Path]] = {}
    for row in rows(juelich / "spots.csv"):
        path = juelich / "records" / f"{row['image_id']}-calibration-properties.json"
        if row["heliostat"] in heliostats and path.exists():
            records.setdefault(row["heliostat"], []).append(path)
    return hp.convert_paint(
        juelich / "tower-measurements.json", records, tmp_path_factory.mktemp("paint"), heliostats=heliostats
    )


def test_places_and_planes_are_those_of_proj(converted: hp.Paint, juelich: Path) -> None:
    field = hp.Field.from_toml(converted.field_toml)
    surveyed = {row["heliostat"]: row for row in rows(juelich / "calibration" / "heliostats.csv")}
    assert len(field) == len(converted.heliostats) == 12
    for name, place in zip(field.ids, field.position_enu_m, strict=True):
        want = [float(surveyed[name][axis]) for axis in ("east_m", "north_m", "up_m")]
        np.testing.assert_allclose(place, want, rtol=0, atol=0.6e-4)  # as many digits as the table has
        assert field.mirror_offset_m[field.row_of(name)] == 0.175
    text = converted.field_toml.read_text()
    for name, plane in json.loads((juelich / "target_planes.json").read_text()).items():
        section = text.partition(f"[targets.{name}]")[2].partition("\n\n")[0]
        found = dict(line.split(" = ") for line in section.strip().splitlines())
        for ours, theirs in (
            ("centre_enu_m", "centre_enu_m"),
            ("normal_enu", "normal_to_camera_enu"),
            ("right_enu", "right_unit_enu"),
            ("width_m", "width_m"),
            ("height_m", "height_m"),
        ):
            np.testing.assert_allclose(json.loads(found[ours]), plane[theirs], rtol=0, atol=0.6e-4)


def test_spots_are_those_of_the_reduced_table(converted: hp.Paint, juelich: Path) -> None:
    reduced = {row["image_id"]: row for row in rows(juelich / "spots.csv") if row["heliostat"] == "AA39"}
    seen = rows(converted.observations_csv)
    assert converted.records == len(seen) == 10
    compared = 0
    for row in seen:
        want = reduced[row["record_id"]]
        assert float(row["sun_azimuth_deg"]) == 180.0 - float(want["sun_azimuth_south_deg"])
        assert float(row["sun_elevation_deg"]) == float(want["sun_elevation_deg"])
        assert [float(row[f"axis{k}_steps"]) for k in (1, 2)] == [float(want[f"axis{k}_steps"]) for k in (1, 2)]
        if want["record_revision"] == "C":
            compared += 1
            for axis in "enu":
                ours = float(row["spot_" + {"e": "east", "n": "north", "u": "up"}[axis] + "_m"])
                assert ours == pytest.approx(float(want[f"helios_{axis}_m"]), abs=1e-4)
    assert compared == 4


def test_revisions_off_the_planes_are_named(converted: hp.Paint) -> None:
    assert np.count_nonzero(np.abs(converted.off_plane_m) > 0.02) == 1
    assert any("1 of 10 spots lie more than 2 cm off" in word for word in converted.warnings)
    assert any("receiver" in word for word in converted.warnings)
    assert {reason for _, reason in converted.left_aside} == {"no sun"}
    assert len(converted.left_aside) == 60


def test_steps_become_the_angles_of_the_published_law(converted: hp.Paint, juelich: Path) -> None:
    field = hp.Field.from_toml(converted.field_toml)
    row = field.row_of("AA39")
    assert row is not None
    recorded = rows(juelich / "calibration" / "AA39.csv")
    steps = np.full((2, len(recorded), len(field)), np.nan)
    for axis in (0, 1):
        steps[axis, :, row] = [float(one[f"axis{axis + 1}_steps"]) for one in recorded]
    axis1, axis2 = field.angles_rad(steps[0], steps[1])
    # The fixed axis lies east-west: gamma = -t1, alpha = t2.
    want = np.array([[float(one["axis1_angle_deg"]), float(one["axis2_angle_deg"])] for one in recorded])
    np.testing.assert_allclose(np.degrees(axis1[:, row]), -want[:, 0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.degrees(axis2[:, row]), want[:, 1], rtol=0, atol=1e-6)


def test_the_mirror_stands_where_it_throws_the_beam(converted: hp.Paint) -> None:
    """From steps to the normal, against the one that halves sun and spot: apart by no more than an uncalibrated mount."""
    field = hp.Field.from_toml(converted.field_toml)
    row = field.row_of("AA39")
    assert row is not None
    seen = rows(converted.observations_csv)
    apart = []
    for record in seen:
        steps = np.full((2, len(field)), np.nan)
        steps[:, row] = [float(record["axis1_steps"]), float(record["axis2_steps"])]
        angles = field.angles_rad(steps[0], steps[1])
        normal = hp.forward(field, *angles)[row]
        azimuth, elevation = np.radians([float(record["sun_azimuth_deg"]), float(record["sun_elevation_deg"])])
        sun = [np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)]
        mirror = field.position_enu_m[row] + 0.175 * normal
        spot = np.array([float(record[f"spot_{axis}_m"]) for axis in ("east", "north", "up")])
        beam = (spot - mirror) / np.linalg.norm(spot - mirror)
        halving = (sun + beam) / np.linalg.norm(sun + beam)
        apart.append(np.arccos(np.clip(normal @ halving, -1, 1)))
    # A beam error of 29 mrad (README of the data) is half as much of the normal; a wrong sign would be a radian.
    assert np.sqrt(np.mean(np.square(apart))) < 0.03


def test_utis_centroids_are_others(juelich: Path, converted: hp.Paint, tmp_path: Path) -> None:
    folder = tmp_path / "plant" / "AA39"
    (folder / "Properties").mkdir(parents=True)
    (folder / "Calibration").mkdir()
    shutil.copy(juelich / "calibration" / "AA39-heliostat-properties.json", folder / "Properties")
    for row in rows(converted.observations_csv):
        shutil.copy(juelich / "records" / f"{row['record_id']}-calibration-properties.json", folder / "Calibration")
    tower = juelich / "tower-measurements.json"
    helios = hp.convert_paint(tower, tmp_path / "plant", tmp_path / "helios", aim="multi_focus_tower")
    utis = hp.convert_paint(tower, tmp_path / "plant", tmp_path / "utis", centroid="UTIS")
    assert 'aim = "multi_focus_tower"' in helios.field_toml.read_text()
    assert helios.heliostats == utis.heliostats == ["AA39"]
    as_mapping = [row for row in rows(converted.observations_csv) if row["heliostat_id"] == "AA39"]
    assert sorted(map(str, rows(helios.observations_csv))) == sorted(map(str, as_mapping))
    up = np.array([[float(row["spot_up_m"]) for row in rows(one.observations_csv)] for one in (helios, utis)])
    assert 0 < np.max(np.abs(up[0] - up[1])) < 0.3


TOWER = {
    "power_plant_properties": {"ID": "X", "coordinates": [50.9, 6.4, 87.0]},
    "north": {
        "type": "planar",
        "normal_vector": [0, 1, 0],
        "coordinates": {
            "upper_left": [50.9, 6.40001, 100.0],
            "upper_right": [50.9, 6.39999, 100.0],
            "lower_left": [50.9, 6.40001, 90.0],
            "lower_right": [50.9, 6.39999, 90.0],
        },
    },
}
ACTUATOR = {
    "type_axis": "linear",
    "clockwise_axis_movement": 0,
    "increment": 154166.6667,
    "offset": 0.335,
    "pivot_radius": 0.338,
    "initial_stroke_length": 0.0765,
    "initial_angle": 0.0,
    "min_increment": 0,
    "max_increment": 69000,
    "min_movement_angle": 0.0,
    "max_movement_angle": 1.57,
}


def heliostat() -> dict[str, Any]:
    kinematics = {"actuators": [dict(ACTUATOR), dict(ACTUATOR)], "concentrator_translation_n": 0.175}
    return {"heliostat_position": [50.901, 6.4, 88.0], "kinematics_properties": kinematics}


def record() -> dict[str, Any]:
    return {
        "motor_position": {"axis_1_motor_position": 20000, "axis_2_motor_position": 40000},
        "target_name": "north",
        "sun_elevation": 40.0,
        "sun_azimuth": -10.0,
        "focal_spot": {"HeliOS": [50.9, 6.4, 95.0]},
    }


def convert(folder: Path, tower: Any, properties: Any, found: Any, **more: Any) -> hp.Paint:
    files = {"tower.json": tower, "h.json": properties, "1-calibration-properties.json": found}
    for name, content in files.items():
        (folder / name).write_text(content if isinstance(content, str) else json.dumps(content))
    return hp.convert_paint(
        folder / "tower.json",
        {"H1": [folder / "1-calibration-properties.json"]},
        folder / "out",
        heliostats={"H1": folder / "h.json"},
        **more,
    )


def test_files_are_those_of_the_command_line(command_line: str, root: Path, tmp_path: Path) -> None:
    records = root / "examples" / "paint"
    for centroid in ("HeliOS", "UTIS"):
        theirs, ours = tmp_path / f"theirs-{centroid}", tmp_path / f"ours-{centroid}"
        args = ["--tower", records / "tower.json", "--records", records, "--out", theirs, "--centroid", centroid]
        subprocess.run([command_line, "convert", "paint", *map(str, args)], check=True, capture_output=True)
        made = hp.convert_paint(records / "tower.json", records, ours, centroid=centroid)
        assert (made.records, made.heliostats) == (24, ["A1", "A2"])
        names = sorted(path.name for path in theirs.iterdir())
        assert names == ["drives.csv", "field.toml", "heliostats.csv", "observations.csv"]
        for name in names:
            assert (theirs / name).read_bytes() == (ours / name).read_bytes(), name


def test_files_are_counted(root: Path, tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    records = root / "examples" / "paint"
    hp.convert_paint(records / "tower.json", records, tmp_path, progress=lambda done, of: told.append((done, of)))
    assert all(of == 26 and done <= of for done, of in told)


def test_files_of_others_are_not_replaced(tmp_path: Path) -> None:
    made = convert(tmp_path, TOWER, heliostat(), record())
    before = made.field_toml.read_bytes()
    assert convert(tmp_path, TOWER, heliostat(), record()).field_toml.read_bytes() == before
    made.field_toml.write_text(before.decode() + "# mine\n")
    with pytest.raises(hp.ConflictError, match="changed since"):
        convert(tmp_path, TOWER, heliostat(), record())
    assert made.field_toml.read_text().endswith("# mine\n")


def test_a_plant_made_up_is_converted(tmp_path: Path) -> None:
    made = convert(tmp_path, TOWER, heliostat(), record())
    field = hp.Field.from_toml(made.field_toml)
    assert field.ids == ["H1"]
    # A thousandth of a degree of latitude is 111 m.
    np.testing.assert_allclose(field.position_enu_m, [[0.0, 111.25, 1.0]], atol=0.05)
    [seen] = rows(made.observations_csv)
    assert (seen["sun_azimuth_deg"], seen["record_id"]) == ("190.0", "1")
    assert float(seen["spot_up_m"]) == pytest.approx(8.0, abs=1e-6)
    assert not made.left_aside


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"sun_azimuth": None}, "no sun"),
        ({"focal_spot": {"UTIS": [50.9, 6.4, 95.0]}}, "no centroid of HeliOS"),
        ({"target_name": "receiver"}, "no plane"),
    ],
)
def test_records_that_say_too_little_are_left_aside(change: dict[str, Any], reason: str, tmp_path: Path) -> None:
    made = convert(tmp_path, TOWER, heliostat(), {**record(), **change})
    assert made.records == 0
    assert reason in made.left_aside[0][1]
    assert rows(made.observations_csv) == []


@pytest.mark.parametrize(
    ("which", "change", "error", "said"),
    [
        ("record", "{", hp.FileSyntaxError, "not valid JSON"),
        ("record", "[]", hp.FileSyntaxError, "object"),
        ("record", {"motor_position": {}}, hp.MissingError, "axis_1_motor_position"),
        ("record", {"focal_spot": {"HeliOS": [50.9, None, 95.0]}}, hp.FileValueError, "focal_spot.HeliOS"),
        ("record", {"sun_elevation": "high"}, hp.FileValueError, "sun_elevation"),
        ("heliostat", {"heliostat_position": [1.0]}, hp.FileValueError, "heliostat_position"),
        ("heliostat", {"kinematics_properties": {}}, hp.MissingError, "concentrator_translation_n"),
        (
            "heliostat",
            {"kinematics_properties": {"joint_translation_n_1": 0.1}},
            hp.ConflictError,
            "joint_translation_n_1",
        ),
        ("tower", {"north": {"type": "cylinder"}}, hp.MissingError, "planar"),
        ("tower", {"power_plant_properties": {}}, hp.MissingError, "coordinates"),
    ],
)
def test_wrong_files_are_named(which: str, change: Any, error: type[Exception], said: str, tmp_path: Path) -> None:
    parts: dict[str, Any] = {"tower": dict(TOWER), "heliostat": heliostat(), "record": record()}
    parts[which] = change if isinstance(change, str) else {**parts[which], **change}
    with pytest.raises(error, match=said) as caught:
        convert(tmp_path, parts["tower"], parts["heliostat"], parts["record"])
    assert isinstance(caught.value, hp.FileError)
    assert caught.value.path is not None


def test_wrong_calls_are_refused(tmp_path: Path) -> None:
    with pytest.raises(hp.OptionError, match="centroid"):
        convert(tmp_path, TOWER, heliostat(), record(), centroid="Otsu")
    with pytest.raises(hp.OptionError, match="aim"):
        convert(tmp_path, TOWER, heliostat(), record(), aim="south")
    with pytest.raises(hp.MissingError):
        hp.convert_paint(tmp_path / "tower.json", tmp_path, tmp_path / "out")
    with pytest.raises(hp.OptionError, match="heliostats"):
        hp.convert_paint(tmp_path / "tower.json", {"H1": []}, tmp_path / "out")
