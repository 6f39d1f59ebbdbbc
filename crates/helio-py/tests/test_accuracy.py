"""Tracking accuracy: figures by hand, the command line's JSON, tables of every kind, the page."""

from __future__ import annotations

import json
import pickle
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.csv
import pytest
from numpy.typing import NDArray

import helio_py as hp

SECONDS = 600
TIMES = np.datetime64("2026-06-20T08:00:00") + np.arange(SECONDS)


def campaign(rng: np.random.Generator) -> tuple[dict[str, Any], dict[str, Any]]:
    spots = {
        "file": [f"{k}.png" for k in range(SECONDS)],
        "time": TIMES,
        "u_m": 0.1 + 0.2 * rng.standard_normal(SECONDS),
        "v_m": 0.15 * rng.standard_normal(SECONDS),
        "status": ["ok"] * SECONDS,
    }
    weather = {
        "time": TIMES,
        "wind_m_s": np.full(SECONDS, 4.0),
        "dni_w_m2": np.full(SECONDS, 820.0),
        "air_temperature_c": np.full(SECONDS, 21.0),
    }
    return spots, weather


@pytest.fixture
def made() -> tuple[dict[str, Any], dict[str, Any]]:
    return campaign(np.random.default_rng(1))


def rms(numbers: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(numbers**2)))


def test_figures_are_those_of_the_definitions(made: tuple[dict[str, Any], dict[str, Any]]) -> None:
    spots, weather = made
    report = hp.accuracy(spots, weather=weather, slant_m=120.0, aim_m=(0.05, -0.02))
    assert report.accuracy is not None
    assert report.precision is not None
    assert report.bias is not None
    du, dv = spots["u_m"] - 0.05, spots["v_m"] + 0.02
    assert report.accuracy.mrad == pytest.approx(1e3 * rms(np.hypot(du, dv)) / 120)
    mean = du.mean(), dv.mean()
    assert report.bias.mrad == pytest.approx(1e3 * np.hypot(*mean) / 120)
    assert report.precision.mrad == pytest.approx(1e3 * rms(np.hypot(du - mean[0], dv - mean[1])) / 120)
    table = report.to_table()
    assert table["eta_mrad"] == pytest.approx(1e3 * np.hypot(du, dv) / 120)
    within = (table["eta_mrad"] <= 3.5).mean()
    assert report.shares[0]["wind_m_s"] == 4
    assert report.shares[0]["share"] == pytest.approx(within)
    assert report.counts == {"ok": SECONDS}
    assert report.shares[0]["interval"][1] < report.shares[0]["limit"]
    assert report.verdict == "not qualified"
    assert repr(report) == "<Accuracy: not qualified; 600 of 600 frames counted>"


def test_without_weather_there_are_figures_and_no_verdict(made: tuple[dict[str, Any], dict[str, Any]]) -> None:
    report = hp.accuracy(made[0], slant_m=120.0)
    assert report.verdict == "not enough data"
    assert all(clause["clause"] for clause in report.clauses)


def test_spots_found_in_frames_are_taken() -> None:
    down, right = np.mgrid[:60, :80]
    frames = [60 + 100 * np.exp(-((right - 40 - k % 3) ** 2 + (down - 30) ** 2) / 50) for k in range(6)]
    target = {"width_m": 8, "height_m": 6, "corners_px": [[0, 0], [79, 0], [79, 59], [0, 59]]}
    spots = hp.find_spots(np.round(frames).astype(np.uint8), target, times=TIMES[:6])
    report = hp.accuracy(spots, slant_m=100.0)
    assert report.to_table()["u_m"].tolist() == spots.u_m.tolist()
    with pytest.raises(hp.MissingError, match=r"^spots: no row has a time"):
        hp.accuracy(hp.find_spots(np.round(frames).astype(np.uint8), target), slant_m=100.0)


WAYS: list[tuple[list[str], dict[str, Any]]] = [
    ([], {}),
    (["--aim", "0.1,-0.05", "--heliostat-at-deg", "20,5"], {"aim_m": (0.1, -0.05), "heliostat_at_deg": (20, 5)}),
    (["--confidence", "0.9", "--bin-half-width-m-s", "0.5", "--histogram-step-m-s", "2", "--weather-gap-s", "5",
      "--accept", "cut,ambiguous"],
     {"confidence": 0.9, "bin_half_width_m_s": 0.5, "histogram_step_m_s": 2, "weather_gap_s": 5,
      "accept": ["cut", "ambiguous"]}),
    (["--campaign", "campaign.toml"], {"campaign": "campaign.toml"}),
]  # fmt: skip


@pytest.mark.parametrize(("typed", "keywords"), WAYS)
def test_the_command_line_finds_the_same(
    typed: list[str],
    keywords: dict[str, Any],
    command_line: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("campaign.toml").write_text('laboratory = "L"\nnotes = ["n"]\n[heliostat]\nname = "H1"\nheight_m = 3.0\n')

    def run(*words: str) -> None:
        done = subprocess.run([command_line, *words], capture_output=True, text=True, check=False)
        assert done.returncode in (0, 1), done.stderr

    run("simulate", "campaign", "--minutes", "5", "--empty", "0.01", "--spots", "s.csv", "--weather", "w.csv", "-q")
    run("accuracy", "--spots", "s.csv", "--weather", "w.csv", "--slant-m", "100", "--out", "r.json",
        "--report", "r.html", "--frames", "f.csv", "-q", *typed)  # fmt: skip
    report = hp.accuracy("s.csv", weather="w.csv", slant_m=100, **keywords)
    report.write("ours.json")
    assert Path("ours.json").read_text() == Path("r.json").read_text()
    report.write("ours.csv")
    assert Path("ours.csv").read_bytes() == Path("f.csv").read_bytes()
    theirs = Path("r.html").read_text()
    ours = report.to_html()
    # All but the time at which each was made.
    assert len(ours) == len(theirs)
    assert sum(a != b for a, b in zip(ours, theirs, strict=True)) <= 10
    # Tables in memory say the same; only the names and hashes of files differ.
    for spots, weather in (
        (pd.read_csv("s.csv", dtype={"flags": str, "reason": str}), pd.read_csv("w.csv")),
        (pyarrow.csv.read_csv("s.csv"), pyarrow.csv.read_csv("w.csv")),
    ):
        again = hp.accuracy(spots, weather=weather, slant_m=100, **keywords).to_dict()
        assert {**again, "files": []} == {**json.loads(Path("r.json").read_text()), "files": []}


def test_limits_and_campaign_may_be_mappings(made: tuple[dict[str, Any], dict[str, Any]]) -> None:
    limits = {
        "name": "ours", "angle_mrad": 1.0, "least_dni_w_m2": 500, "coldest_air_c": -5, "warmest_air_c": 40,
        "wind_from_m_s": 0, "wind_to_m_s": 10, "camera_bits": 8, "camera_frames_per_s": 1, "camera_width_px": 100,
        "camera_height_px": 100, "shares": {"calm": {"wind_m_s": 4.0, "share": 0.5}},
    }  # fmt: skip
    about = {"laboratory": "Ours", "heliostat": {"name": "H7"}}
    report = hp.accuracy(made[0], weather=made[1], slant_m=120.0, limits=limits, campaign=about)
    found = report.to_dict()
    assert found["limits"]["name"] == "ours"
    assert found["campaign"]["heliostat"] == "H7"
    assert len(report.shares) == 1
    eta = report.to_table()["eta_mrad"]
    assert report.shares[0]["share"] == pytest.approx((eta <= 1.0).mean())
    assert "Tracking accuracy of heliostat H7" in report.to_html()


def test_it_survives_pickling(made: tuple[dict[str, Any], dict[str, Any]]) -> None:
    report = hp.accuracy(made[0], weather=made[1], slant_m=120.0)
    again = pickle.loads(pickle.dumps(report))
    assert again.to_dict() == report.to_dict()
    assert again.to_html() == report.to_html()
    assert (again.to_table()["eta_mrad"] == report.to_table()["eta_mrad"]).all()


WRONG: list[tuple[type[hp.HelioError], str, dict[str, Any]]] = [
    (hp.OptionError, "the distance of the heliostat must be above 0 m, got -1", {"slant_m": -1}),
    (hp.DataTypeError, "slant_m: expected a number, got 'far'", {"slant_m": "far"}),
    (hp.ShapeError, r"aim_m: expected shape \(2,\), got \(3,\)", {"aim_m": (1, 2, 3)}),
    (hp.DataTypeError, "aim_m: expected two numbers, got float", {"aim_m": 0.1}),
    (hp.OptionError, "slant_m: wanted a finite number, got nan", {"slant_m": float("nan")}),
    (hp.DataTypeError, "accept: expected a sequence of str, got int", {"accept": 5}),
    (hp.OptionError, "accept: wanted cut, saturated or ambiguous, got `empty`", {"accept": "empty"}),
    (hp.OptionError, "the confidence must be 0.5 to 0.9999", {"confidence": 1.5}),
    (hp.OptionError, "the aim point|aim_m", {"aim_m": (float("inf"), 0)}),
    (hp.OptionError, "the direction to the heliostat must be out of the target's face", {"heliostat_at_deg": (120, 0)}),
    (hp.OptionError, "half the width of a wind bin must be 0.01 to 20 m/s", {"bin_half_width_m_s": 0}),
    (hp.OptionError, "the width of the histogram's bins must be", {"histogram_step_m_s": 0}),
    (hp.OptionError, "the longest gap of the weather must be", {"weather_gap_s": -1}),
    (hp.MissingError, "limits: name is missing", {"limits": {}}),
    (hp.DataTypeError, "weather: expected a table", {"weather": 3}),
    (hp.UnknownNameError, "wind_speed", {"weather": {"time": TIMES, "wind_speed": np.zeros(SECONDS)}}),
    (hp.UnknownNameError, "labratory", {"campaign": {"labratory": "x"}}),
    (hp.FileUnreadableError, "nowhere.toml", {"limits": "nowhere.toml"}),
]


@pytest.mark.parametrize(("error", "message", "wrong"), WRONG)
def test_wrong_calls_are_named(
    error: type[hp.HelioError], message: str, wrong: dict[str, Any], made: tuple[dict[str, Any], dict[str, Any]]
) -> None:
    asked: dict[str, Any] = {"weather": made[1], "slant_m": 120.0, **wrong}
    with pytest.raises(error, match=message) as caught:
        hp.accuracy(made[0], **asked)
    named = caught.value.field
    assert named in {*wrong, "wind_speed", "labratory", "name"} or issubclass(error, hp.FileUnreadableError)
