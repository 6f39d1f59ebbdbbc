"""Whatever an argument is, a call answers or raises a ``HelioError``: nothing of Python's own, nothing of NumPy's, no panic."""

from __future__ import annotations

import datetime as dt
import decimal
import io
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helio_py as hp


class Raises:
    """Raises at whatever is asked of it."""

    def __float__(self) -> float:
        raise ZeroDivisionError("float")

    def __index__(self) -> int:
        raise ZeroDivisionError("index")

    def __len__(self) -> int:
        raise ZeroDivisionError("len")

    def __iter__(self) -> Iterator[int]:
        raise ZeroDivisionError("iter")

    def __fspath__(self) -> str:
        raise ZeroDivisionError("fspath")

    def __array__(self, *given: Any, **more: Any) -> Any:
        raise ZeroDivisionError("array")

    def __arrow_c_stream__(self, *given: Any, **more: Any) -> Any:
        raise ZeroDivisionError("stream")


WITHIN_ITSELF: dict[str, Any] = {}
WITHIN_ITSELF["sun"] = WITHIN_ITSELF

ODD: dict[str, Any] = {
    "within itself": WITHIN_ITSELF,
    "none": None,
    "true": True,
    "minus": -1,
    "zero": 0,
    "huge": 10**400,
    "wide": 2**63,
    "half": 1.5,
    "nan": float("nan"),
    "inf": float("inf"),
    "complex": 1j,
    "text": "x",
    "empty text": "",
    "nul": "a\0b",
    "surrogate": "\ud800",
    "bytes": b"x",
    "list": [1, 2, 3],
    "empty list": [],
    "ragged": [[1, 2], [3]],
    "texts": ["a", "b"],
    "nested": {"a": {"b": [1, {}]}},
    "set": {1, 2},
    "dict": {},
    "object": object(),
    "class": int,
    "call": print,
    "generator": (k for k in range(3)),
    "decimal": decimal.Decimal(1),
    "naive": dt.datetime(2026, 6, 21, 12),
    "date": dt.date(2026, 6, 21),
    "nat": np.datetime64("NaT"),
    "array": np.arange(6.0).reshape(2, 3),
    "objects": np.array([None, 1], dtype=object),
    "swapped": np.arange(3.0).astype(">f8"),
    "record": np.zeros(2, dtype=[("a", "f8")]),
    "masked": np.ma.masked_array([1.0, 2.0], mask=[True, False]),
    "masked bytes": np.ma.masked_array(np.zeros((4, 4), np.uint8), mask=True),
    "stream": io.BytesIO(b"x"),
    "missing": Path("no/such/file.toml"),
    "folder": Path(),
    "raises": Raises(),
    "exception": ValueError,
}

SCENE = "examples/flux/tower.toml"
NOON = "2026-06-21T12:00:00+02:00"
TARGET = {"width_m": 8.0, "height_m": 6.0, "corners_px": [[0, 0], [79, 0], [79, 59], [0, 59]]}


def frame() -> Any:
    y, x = np.mgrid[:60, :80]
    return np.round(60 + 120 * np.exp(-((x - 40) ** 2 + (y - 30) ** 2) / 50)).astype(np.uint8)


def calls(tmp_path: Path) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Every public call with arguments that are right, as few as make it quick."""
    field = hp.Field.from_toml("examples/field.toml")
    small = hp.Field([[0, 90, 6], [40, 90, 6]], [0, 0, 120])
    seen = hp.simulate_observations(field, heliostats=2, count=12)
    calibration = hp.calibrate(field, seen.observations)
    flux = hp.flux(field=field, time=NOON, scene=SCENE, rays=2000)
    tracking = hp.track(small, 3.0, 0.8)
    joint = hp.calibrate(field, seen.observations, joint=True, leftovers=True)
    whole = hp.track(field, 3.0, 0.8)
    corrected = hp.correct(field, whole, joint)
    verified = hp.verify(small, tracking, 3.0, 0.8)
    landed = hp.predict(small, tracking.azimuth_rad, tracking.elevation_rad, 3.0, 0.8)
    angles = tracking.azimuth_rad, tracking.elevation_rad
    frames = [frame()] * 3
    times = np.datetime64("2026-06-20T08:00:00") + np.arange(3)
    spots = hp.find_spots(frames, TARGET, times=times)
    weather = {
        "time": times,
        "wind_m_s": np.full(3, 4.0),
        "dni_w_m2": np.full(3, 800.0),
        "air_temperature_c": np.full(3, 20.0),
    }
    report = hp.accuracy(spots, slant_m=100.0, weather=weather)
    images = hp.simulate_images(frames=1, size=(40, 30))
    campaign = hp.simulate_campaign(minutes=1, frames_per_s=2)
    encoder = hp.Drive.encoder(1000.0)
    sun = {"sun_azimuth_rad": 3.0, "sun_elevation_rad": 0.8}
    none = dict.fromkeys
    return {
        "Field": (hp.Field, {"position_enu_m": [[0, 90, 6]], "aim_enu_m": [0, 0, 120], **none(
            ("ids", "mode", "mirror_offset_m", "pedestal_tilt_rad", "axis1_min_rad", "aim", "axis_azimuth_rad",
             "latitude_rad", "site", "targets", "drives"))}),
        "Field of a site": (lambda **site: hp.Field([[0, 90, 6]], [0, 0, 120], site=site), {
            "latitude_deg": 37.4, "longitude_deg": -6.25, "elevation_m": 20, **none(
            ("name", "pressure_hpa", "temperature_c", "delta_t_s", "ut1_utc_s"))}),
        "Field of targets": (lambda **target: hp.Field([[0, 90, 6]], aim="board", targets={"board": target}), {
            "centre_enu_m": [0, 8, 70], "normal_enu": [0, 1, 0], "width_m": 14, "height_m": 12, "right_enu": None}),
        "Field.from_toml": (hp.Field.from_toml, {"path": "examples/field.toml"}),
        "Field.row_of": (field.row_of, {"id": "H001"}),
        "Field.sun_position": (field.sun_position, {"times": NOON}),
        "track": (hp.track, {"field": small, **sun, "offset": "exact", "continuous": False, **none(
            ("out", "present", "times"))}),
        "forward": (hp.forward, {"field": small, "azimuth_rad": angles[0], "elevation_rad": angles[1]}),
        "predict": (hp.predict, {"field": field, "azimuth_rad": np.ones(500), "elevation_rad": np.ones(500), **sun}),
        "correct": (hp.correct, {"field": field, "tracking": whole, "leftovers": joint, "progress": None}),
        "Corrected.to_table": (corrected.to_table, {"field": field, "kind": "dict", "times": NOON}),
        "verify": (hp.verify, {"field": small, "tracking": tracking, **sun, "times": None}),
        "Verified.to_table": (verified.to_table, {"field": small, "tracking": tracking, "kind": "dict", **sun}),
        "Prediction.to_table": (landed.to_table, {"field": small, "kind": "dict", **sun}),
        "sun_position": (hp.sun_position, {"times": NOON, "latitude_deg": 37.4, "longitude_deg": -6.25, **none(
            ("elevation_m", "pressure_hpa", "temperature_c", "delta_t_s", "ut1_utc_s"))}),
        "status_words": (hp.status_words, {"status": [0]}),
        "Drive.encoder": (hp.Drive.encoder, {"steps_per_rad": 1e3, "zero_steps": 0.0, "sign": 1.0, **none(
            ("min_steps", "max_steps"))}),
        "Drive.screw": (hp.Drive.screw, {"arm_a_m": 1.0, "arm_b_m": 1.0, "bracket_rad": 1.0, "zero_length_m": 0.1,
            "steps_per_m": 1.0, "sign": 1.0, **none(("min_steps", "max_steps"))}),
        "Drive.triangle": (hp.Drive.triangle, {"offset_m": 0.34, "pivot_radius_m": 0.34, "initial_angle_rad": 0.0,
            "initial_stroke_length_m": 0.075, "steps_per_m": 1e5, "clockwise": False, "sign": 1.0, **none(
            ("min_steps", "max_steps"))}),
        "Drive.steps": (encoder.steps, {"angle_rad": 1.0}),
        "Drive.angle_rad": (encoder.angle_rad, {"steps": 1.0}),
        "calibrate": (hp.calibrate, {"field": field, "observations": seen.observations, "solver": "hartley-meyer",
            "residual": "components", **none(("robust", "hold", "prior", "sets", "spots", "progress", "plan", "compare",
            "report"))}),
        "calibrate joint": (hp.calibrate, {"field": field, "observations": seen.observations, "joint": True,
            "leftovers": False, "keep_all": False, **none(("update", "state", "ahead_days", "plan", "compare",
            "report"))}),
        "calibrate beside": (hp.calibrate, {"field": field, "observations": seen.observations, "plan": (1, "2026-06-21"),
            "compare": calibration, "report": tmp_path / "c.html"}),
        "Calibration.apply": (calibration.apply, {"field": field}),
        "Calibration.to_table": (calibration.to_table, {"kind": "calibration"}),
        "Calibration.write": (calibration.write, {"path": tmp_path / "c.csv"}),
        "simulate_field": (hp.simulate_field, {"heliostats": 3, "layout": "fermat-spiral", "tower_height_m": 99.0}),
        "simulate_observations": (hp.simulate_observations, {"field": field, "heliostats": 1, "count": 2, "seed": 1,
            "from_time": NOON, "to_time": "2027-01-01T00:00:00Z", "hours": (0, 24), "noise_mrad": 0.5, "outliers": 0.0,
            "jumps": (), "random_errors": False, "steps": False, **none(("targets", "days", "progress"))}),
        "simulate_images": (hp.simulate_images, {"out": tmp_path / "images", "frames": 1, "size": (40, 30), "bits": 8,
            "seed": 1, "width_m": 8.0, "height_m": 7.0, "marks": "four-corners", "shape": "facets", "beam_m": 0.6,
            "find_marks": False, **dict.fromkeys(("peak", "daylight", "gradient", "shadow", "texture", "noise", "turn_deg",
            "tilt_deg", "roll_deg", "distortion", "second", "stray"), 0.1), **none(("empty_every", "progress"))}),
        "simulate_images in memory": (hp.simulate_images, {"frames": 2, "size": (40, 30)}),
        "simulate_images of observations": (hp.simulate_images, {"observations": seen.observations, "size": (40, 30)}),
        "SimulatedImages.to_table": (images.to_table, {"kind": "dict", "of": "truth"}),
        "simulate_campaign": (hp.simulate_campaign, {"seed": 1, "minutes": 1, "frames_per_s": 2, "slant_m": 100.0,
            "calm_mrad": 0.5, "gust_mrad": 1.0, "memory_s": 0.3, "empty": 0.0}),
        "SimulatedCampaign.to_table": (campaign.to_table, {"kind": "dict", "of": "spots"}),
        "SimulatedCampaign.write_spots": (campaign.write_spots, {"path": tmp_path / "cs.csv"}),
        "SimulatedCampaign.write_weather": (campaign.write_weather, {"path": tmp_path / "cw.csv"}),
        "init": (hp.init, {"folder": tmp_path / "new", "force": True}),
        "schema": (hp.schema, {"of": "field"}),
        "Field.check": (field.check, {"time": NOON, "progress": None}),
        "find_spot": (hp.find_spot, {"image": frame(), "target": TARGET, "method": "robust", **none(
            ("threshold", "expected", "white"))}),
        "find_spots": (hp.find_spots, {"images": frames, "target": TARGET, "numbered": False, **none(("times", "names",
            "raw", "start", "fps", "overlay", "progress"))}),
        "find_spots of video": (hp.find_spots, {"images": frame().tobytes(), "target": TARGET, "raw": "80x60",
            "start": NOON, "fps": 1.0, "overlay": tmp_path / "seen", "progress": None}),
        "Spots.to_table": (spots.to_table, {"kind": "dict"}),
        "Spots.write": (spots.write, {"path": tmp_path / "s.csv"}),
        "accuracy": (hp.accuracy, {"spots": spots, "slant_m": 100.0, "weather": weather, "aim_m": (0, 0), "accept": (),
            "confidence": 0.9, **none(("heliostat_at_deg", "limits", "campaign"))}),
        "Accuracy.write": (report.write, {"path": tmp_path / "r.json"}),
        "flux": (hp.flux, {"field": field, "scene": SCENE, "time": NOON, "rays": 2000, **none(
            ("dni_w_m2", "half_angle_mrad", "seed", "progress"))}),
        "flux mesh": (hp.flux, {"mesh": "examples/flux/strips.inp", "scene": "examples/flux/strips.toml", "rays": 2000,
            "displacements": "examples/flux/strips.frd"}),
        "flux arrays": (hp.flux, {"mesh": [[0, 0, 0], [1, 0, 0], [0, 1, 0.0]], "elements": [[0, 1, 2]], "rays": 2000,
            "displacements": np.zeros((3, 3)), "method": "elements", "scene": "examples/flux/strips.toml"}),
        "flux camera": (hp.flux, {"camera": frame(), "gauge": (40, 30, 1e5), "dark": 1.0, **none(("white", "target"))}),
        "Flux.to_table": (flux.to_table, {"kind": "dict"}),
        "Tracking.to_table": (tracking.to_table, {"field": small, "kind": "dict", "times": NOON}),
        "predict of a table": (hp.predict, {"field": field, "azimuth_rad": {"id": ["H001"], "time": [NOON],
            "azimuth_deg": [100.0], "elevation_deg": [50.0]}, "kind": None}),
        "Flux.write": (flux.write, {"path": tmp_path / "f.csv"}),
        "convert_paint": (hp.convert_paint, {"tower": "tower.json", "records": {}, "out": tmp_path,
            **none(("heliostats", "aim", "progress"))}),
        "convert_paint of a folder": (hp.convert_paint, {"tower": "examples/paint/tower.json",
            "records": "examples/paint", "out": tmp_path / "plant", "centroid": "UTIS", **none(("aim", "progress"))}),
    }  # fmt: skip


def test_wrong_arguments_are_refused_by_our_own_errors(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(root / "examples", tmp_path / "examples")  # an odd value may be a fine name for a file to write
    monkeypatch.chdir(tmp_path)
    wrong, tried = [], 0
    for name, (call, right) in calls(tmp_path).items():
        for argument in right:
            for what, odd in ODD.items():
                tried += 1
                try:
                    call(**{**right, argument: odd})
                except hp.HelioError:
                    pass
                except Exception as error:
                    # what a caller's own object raised is the caller's
                    if isinstance(odd, Raises) or (argument == "progress" and callable(odd)):
                        continue
                    wrong.append(f"{name}({argument}={what}): {type(error).__name__}: {error}")
    assert not wrong, f"{len(wrong)} of {tried}:\n" + "\n".join(wrong)


def test_what_cannot_be_written_is_an_error_of_ours(
    root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(root / "examples", tmp_path / "examples")  # an odd value may be a fine name for a file to write
    monkeypatch.chdir(tmp_path)
    writers = {name: call for name, (call, _) in calls(tmp_path).items() if name.endswith(".write")}
    assert len(writers) == 4
    for name, write in writers.items():
        for suffix in ("csv", "json", "html") if name == "Accuracy.write" else ("csv", "json"):
            with pytest.raises(hp.FileError, match=f"no/such/x.{suffix}: cannot be written"):
                write(path=tmp_path / f"no/such/x.{suffix}")
