"""Campaigns for ``accuracy``, a field to start from, schemas, and what is said of a field: the command line's words."""

from __future__ import annotations

import doctest
import inspect
import json
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helio_py as hp
from conftest import random_field


def run(command_line: str, *arguments: Any, cwd: Path | None = None) -> str:
    done = subprocess.run(
        [command_line, *map(str, arguments)], capture_output=True, encoding="utf-8", check=False, cwd=cwd
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


CAMPAIGNS: list[dict[str, Any]] = [
    {"minutes": 2},
    {"minutes": 1, "seed": 42, "frames_per_s": 7, "empty": 0.1},
    {"minutes": 3, "frames_per_s": 1, "slant_m": 55.5, "calm_mrad": 0, "gust_mrad": 2.5, "memory_s": 0},
]


@pytest.mark.parametrize("suffix", ["csv", "parquet", "json", "jsonl"])
@pytest.mark.parametrize("asked", CAMPAIGNS)
def test_campaigns_are_the_command_line_s(
    asked: dict[str, Any], suffix: str, command_line: str, tmp_path: Path
) -> None:
    spots, weather = tmp_path / f"s.{suffix}", tmp_path / f"w.{suffix}"
    options = [f"--{name.replace('_', '-')}={value}" for name, value in asked.items()]
    run(command_line, "simulate", "campaign", "--spots", spots, "--weather", weather, *options)
    campaign = hp.simulate_campaign(**asked)
    campaign.write_spots(tmp_path / f"s2.{suffix}")
    campaign.write_weather(tmp_path / f"w2.{suffix}")
    assert (tmp_path / f"s2.{suffix}").read_bytes() == spots.read_bytes()
    assert (tmp_path / f"w2.{suffix}").read_bytes() == weather.read_bytes()
    assert len(campaign) == 60 * asked["minutes"] * asked.get("frames_per_s", 15)


def test_accuracy_takes_tables_of_every_kind(command_line: str, tmp_path: Path) -> None:
    campaign = hp.simulate_campaign(minutes=20, frames_per_s=4, empty=0.05)
    wanted = hp.accuracy(campaign.spots, weather=campaign.weather, slant_m=100.0).to_dict()
    assert wanted["verdict"] in ("qualified", "not qualified", "not enough data")
    counted = wanted["frames"]["ok"]
    assert 0.9 * 4800 < counted < 0.98 * 4800  # one in twenty has no spot
    # Bias is the campaign's own, to the root of the frames that are independent of one another.
    assert abs(wanted["figures"]["bias"]["mrad"] - np.hypot(0.2, 0.1)) < 0.15
    for kind in ("dict", "pandas", "polars", "pyarrow"):
        report = hp.accuracy(
            campaign.to_table(kind), weather=campaign.to_table(kind, of="weather"), slant_m=100.0
        ).to_dict()
        assert {name: report[name] for name in report if name != "files"} == {
            name: wanted[name] for name in wanted if name != "files"
        }, kind
    spots, weather = tmp_path / "s.csv", tmp_path / "w.csv"
    campaign.write_spots(spots)
    campaign.write_weather(weather)
    printed = subprocess.run(
        [command_line, "accuracy", "--spots", spots, "--weather", weather, "--slant-m", "100", "-q"],
        capture_output=True,
        text=True,
        check=False,
    )
    found = json.loads(printed.stdout)
    assert found["figures"] == wanted["figures"]


@pytest.mark.parametrize(
    ("asked", "error", "field"),
    [
        ({"minutes": 0}, hp.OptionError, "minutes"),
        ({"minutes": 10_000, "frames_per_s": 1000}, hp.OptionError, "minutes"),
        ({"frames_per_s": 1001}, hp.OptionError, "frames_per_s"),
        ({"frames_per_s": 0.5}, hp.DataTypeError, "frames_per_s"),
        ({"slant_m": 0}, hp.OptionError, "slant_m"),
        ({"empty": 1.1}, hp.OptionError, "empty"),
        ({"memory_s": -1}, hp.OptionError, "memory_s"),
        ({"seed": -1}, hp.OptionError, "seed"),
    ],
)
def test_wrong_campaigns_are_refused(asked: dict[str, Any], error: type[hp.HelioError], field: str) -> None:
    with pytest.raises(error, match=field) as caught:
        hp.simulate_campaign(**asked)
    assert caught.value.field == field


def test_wrong_tables_and_files_of_a_campaign_are_refused(tmp_path: Path) -> None:
    campaign = hp.simulate_campaign(minutes=1, frames_per_s=1)
    with pytest.raises(hp.OptionError, match="of: wanted spots or weather"):
        campaign.to_table(of="wind")
    with pytest.raises(hp.OptionError, match="kind"):
        campaign.to_table("excel")
    with pytest.raises(hp.OptionError, match="suffix"):
        campaign.write_spots(tmp_path / "s.xlsx")


def test_a_field_begins_as_on_the_command_line(command_line: str, tmp_path: Path) -> None:
    run(command_line, "init", tmp_path / "one")
    path = hp.init(tmp_path / "deep" / "other")
    assert path == tmp_path / "deep" / "other" / "field.toml"
    for name in ("field.toml", "heliostats.csv"):
        assert path.with_name(name).read_bytes() == (tmp_path / "one" / name).read_bytes()
    assert sorted(p.name for p in path.parent.iterdir()) == ["field.toml", "heliostats.csv"]
    assert len(hp.Field.from_toml(path)) == 500
    path.write_text("mine")
    for there in ("field.toml", "heliostats.csv"):
        with pytest.raises(hp.ConflictError, match=f"{there}: is there already; force=True") as caught:
            hp.init(path.parent)
        assert (caught.value.field, caught.value.path) == ("folder", path.with_name(there))
        path.unlink(missing_ok=True)
    assert hp.init(path.parent, force=True) == path
    assert path.read_bytes() == (tmp_path / "one" / "field.toml").read_bytes()
    with pytest.raises(hp.FileError, match="the folder cannot be made: there is a file of that name") as wrong:
        hp.init(path)
    assert wrong.value.field == "folder"
    with pytest.raises(hp.DataTypeError, match="force"):
        hp.init(tmp_path, 1)  # type: ignore[arg-type]


@pytest.mark.parametrize("of", ["field", "target", "scene"])
def test_schemas_are_those_printed(of: str, command_line: str) -> None:
    assert hp.schema(of) == json.loads(run(command_line, "schema", of))


def test_a_wrong_schema_is_refused() -> None:
    assert hp.schema() == hp.schema("field")
    with pytest.raises(hp.OptionError, match="of: wanted field, target or scene, got `flux`"):
        hp.schema("flux")


def without_now(text: str) -> list[str]:
    """The lines but that of the clock."""
    return [line for line in text.splitlines() if not line.startswith("sun now")]


def fields(root: Path, folder: Path) -> list[Path]:
    """Fields that differ in what there is to say."""
    (folder / "h.csv").write_text("id,east_m,north_m,up_m\nA1,0,100,5\nA2,10,-100,5\nA3,20,150,5\n")
    target = "centre_enu_m = [0, 0, 50]\nnormal_enu = [0, 1, 0]\nwidth_m = 8\nheight_m = 7\n"
    limits = (
        "axis1_min_deg = 100\naxis1_max_deg = 190\naxis2_min_deg = 0\naxis2_max_deg = 60\npedestal_tilt_deg = 0.1\n"
    )
    texts = [
        '[targets.t]\ncentre_enu_m = [0, 0, 50]\n[heliostats]\ntable = "h.csv"\naim = "t"\n',
        f'[targets.t]\n{target}[heliostats]\ntable = "h.csv"\naim = "t"\n{limits}axis1_sag_deg = 0.01\n',
        f"[site]\nlatitude_deg = -23.5\nlongitude_deg = 15\nelevation_m = 900\n[targets.t]\n{target}[heliostats]\n"
        f'table = "h.csv"\naim = "t"\n{limits}',
    ]
    for number, text in enumerate(texts):
        (folder / f"{number}.toml").write_text(text)
    return [root / "examples" / "field.toml", *(folder / f"{number}.toml" for number in range(len(texts)))]


def test_what_is_said_of_a_field_is_what_is_printed(command_line: str, root: Path, tmp_path: Path) -> None:
    for path in fields(root, tmp_path):
        printed = run(command_line, "check", "--field", path)
        field = hp.Field.from_toml(path)
        check = field.check()
        assert without_now(str(check)) == without_now(printed), path
        assert check.text == str(check)
        assert check.lines == check.text.splitlines()
        assert sum(check.counts.values()) == check.suns * len(field)
        assert ("sun now" in check.text) == ("sun now" in printed)
    assert check.never or check.sometimes
    assert not set(check.never) & set(check.sometimes)
    # a file named from where one stands is named so
    printed = run(command_line, "check", "--field", "0.toml", cwd=tmp_path)
    script = "import sys, helio_py as hp; sys.stdout.reconfigure(encoding='utf-8')\n"
    script += "print(hp.Field.from_toml('0.toml').check(), end='')"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, encoding="utf-8", cwd=tmp_path, check=True
    )
    assert done.stdout == printed


def test_now_is_the_time_given(example: hp.Field) -> None:
    at = "2026-06-21T12:00:00Z"
    sun = example.sun_position(at)
    (line,) = [line for line in example.check(at).lines if line.startswith("sun now")]
    azimuth, elevation, geometric = (
        f"{np.degrees(angle):.3f}°" for angle in (sun.azimuth_rad, sun.elevation_rad, sun.geometric_elevation_rad)
    )
    assert line.split()[2] == f"{at}:"
    assert [word for word in line.replace(",", "").split() if "°" in word] == [azimuth, elevation, geometric]
    assert example.check(np.datetime64("2026-06-21T12:00:00")).text == example.check(at).text


def test_who_never_reaches_the_aim_is_who_cannot_track(root: Path, tmp_path: Path) -> None:
    """Counted again from ``track`` at the suns that the words tell of."""
    field = hp.Field.from_toml(fields(root, tmp_path)[3])
    times = np.datetime64("2026-01-01", "s") + np.add.outer(
        np.arange(37) * np.timedelta64(10, "D"), np.arange(48) * np.timedelta64(30, "m")
    )
    sun = field.sun_position(times.ravel().astype("datetime64[s]"))
    up = np.asarray(sun.elevation_rad) > 0
    tracking = hp.track(field, np.asarray(sun.azimuth_rad)[up], np.asarray(sun.elevation_rad)[up])
    check = field.check()
    words, counts = np.unique(tracking.status_words, return_counts=True)
    assert check.counts == dict(zip(words.tolist(), counts.tolist(), strict=True))
    worked = (tracking.status == hp.Status.OK).sum(axis=0)
    assert check.never == [id for id, count in zip(field.ids, worked, strict=True) if count == 0]
    assert check.sometimes == [id for id, count in zip(field.ids, worked, strict=True) if 0 < count < check.suns]


def test_a_field_of_columns_is_checked_too(example: hp.Field) -> None:
    bare = random_field(3).check("2026-06-21T12:00:00Z")
    assert str(bare).startswith("files          none: columns of no file\nsite           none")
    given: dict[str, Any] = {"ids": example.ids, "aim": example.aim, "site": example.site, "targets": example.targets}
    given |= {"drives": example.drives, "mirror_offset_m": example.mirror_offset_m}
    given |= {f"axis{k}_{end}_rad": getattr(example, f"axis{k}_{end}_rad") for k in (1, 2) for end in ("min", "max")}
    checks = [field.check("2026-06-21T12:00:00Z") for field in (example, hp.Field(example.position_enu_m, **given))]
    files, columns = (str(check).partition("\n") for check in checks)
    assert files[2] == columns[2] and files[0] != columns[0]


def test_wrong_checks_are_refused(example: hp.Field) -> None:
    with pytest.raises(hp.OptionError, match="time: wanted one instant"):
        example.check(np.array(["2026-06-21"], dtype="datetime64[s]"))
    with pytest.raises(hp.TimeError, match="no offset from UTC"):
        example.check("2026-06-21T12:00:00")


def test_the_example_of_check_runs(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root)
    text = inspect.getdoc(hp.Field.check)
    assert text
    example = doctest.DocTestParser().get_doctest(text, {}, "check", None, None)
    assert doctest.DocTestRunner().run(example) == (0, 3)


def test_progress_counts_suns_and_a_signal_ends_it(example: hp.Field, root: Path) -> None:
    told: list[tuple[int, int]] = []
    check = example.check(progress=lambda done, of: told.append((done, of)))
    assert told[-1] == (check.suns, check.suns)
    script = textwrap.dedent(
        """
        import os, signal, tempfile, threading
        from pathlib import Path
        import numpy as np
        import helio_py as hp

        signal.signal(signal.SIGINT, signal.default_int_handler)
        path = hp.init(tempfile.mkdtemp())
        at = np.arange(400_000)
        rows = "".join(f"H{k},{k % 700 * 12},{k // 700 * 12 + 90},5\\n" for k in at)
        path.with_name("heliostats.csv").write_text("id,east_m,north_m,up_m\\n" + rows)
        field = hp.Field.from_toml(path)
        threading.Timer(0.1, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        try:
            field.check()
        except KeyboardInterrupt:
            print("stopped")
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=root)
    assert done.stdout == "stopped\n", done.stderr
