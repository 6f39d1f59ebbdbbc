"""Simulation: the command line's numbers for the same seed."""

from __future__ import annotations

import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import helio_py as hp


def run(command_line: str, *arguments: Any) -> None:
    done = subprocess.run([command_line, "simulate", *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("layout", ["radial-staggered", "fermat-spiral"])
def test_layouts_are_the_command_line_s(layout: str, command_line: str, tmp_path: Path) -> None:
    out = tmp_path / "layout.parquet"
    more = ["--tower-height-m", "90", "--mirror-width-m", "8", "--pivot-height-m", "4"]
    run(command_line, "field", "--heliostats", 1234, "--layout", layout, *more, "--out", out)
    ours = hp.simulate_field(1234, layout, tower_height_m=90, mirror_width_m=8, pivot_height_m=4)
    table = pq.read_table(out)
    assert ours["id"] == table["id"].to_pylist()
    for name in ("east_m", "north_m", "up_m"):
        assert ours[name].tobytes() == table[name].to_numpy().tobytes()


CAMPAIGNS: list[tuple[list[str], dict[str, Any]]] = [
    ([], {}),
    (["--count", "7", "--seed", "42", "--random-errors"], {"count": 7, "seed": 42, "random_errors": True}),
    (
        [
            "--ids",
            "H001,H040",
            "--count",
            "30",
            "--outliers",
            "0.1",
            "--wrong-heliostat",
            "0.1",
            "--days",
            "3",
            "--hours",
            "9-15",
        ],
        {"ids": ["H001", "H040"], "count": 30, "outliers": 0.1, "wrong_heliostat": 0.1, "days": 3, "hours": (9, 15)},
    ),
    (
        ["--jump", "2025-06-01T00:00:00Z,3,-2", "--noise-mrad", "0", "--min-sun-elevation-deg", "25", "--steps"],
        {"jumps": [("2025-06-01T00:00:00Z", 3, -2)], "noise_mrad": 0.0, "min_sun_elevation_deg": 25, "steps": True},
    ),
    (
        ["--from", "2026-01-02T00:00:00Z", "--to", "2026-01-03T00:00:00Z"],
        {"from_time": np.datetime64("2026-01-02"), "to_time": "2026-01-03T00:00:00Z"},
    ),
]


@pytest.mark.parametrize(("typed", "asked"), CAMPAIGNS)
def test_campaigns_are_the_command_line_s(
    typed: list[str], asked: dict[str, Any], command_line: str, root: Path, example: hp.Field, tmp_path: Path
) -> None:
    if "ids" not in asked:
        typed, asked = [*typed, "--heliostats", "5"], {**asked, "heliostats": 5}
    field = root / "examples" / "field.toml"
    out, truth = tmp_path / "seen.csv", tmp_path / "truth.csv"
    run(command_line, "observations", "--field", field, *typed, "--out", out, "--truth", truth)
    seen = hp.simulate_observations(example, **asked)
    seen.write(tmp_path / "again.csv")
    seen.write_truth(tmp_path / "true.csv")
    assert (tmp_path / "again.csv").read_text() == out.read_text()
    assert (tmp_path / "true.csv").read_text() == truth.read_text()
    table = seen.observations
    assert table["time"].dtype == "datetime64[ns]"
    assert len(seen) == len(table["heliostat_id"]) == len(table["u_m"])
    assert ("axis1_steps" in table) == ("steps" in asked)
    assert seen.unseen == []


def test_the_truth_explains_what_was_seen(example: hp.Field, root: Path) -> None:
    """Without noise, a beam off the true mount's normal at the recorded angles meets the target where the spot is."""
    tomllib = pytest.importorskip("tomllib")  # of Python 3.11 and later
    seen = hp.simulate_observations(example, ids=["H040"], count=5, noise_mrad=0.0, random_errors=True)
    row = example.row_of("H040")
    assert row is not None
    truth = {name: column for name, column in seen.truth.items() if name != "id"}
    assert seen.truth["id"] == ["H040"]
    mount = hp.Field(
        example.position_enu_m[[row]], example.aim_enu_m[row], mirror_offset_m=example.mirror_offset_m[[row]], **truth
    )
    table = seen.observations
    sun = example.sun_position(table["time"])
    angles = [np.radians(table[name])[:, None] for name in ("axis1_deg", "axis2_deg")]
    normals = hp.forward(mount, angles[0], angles[1])[:, 0]
    up = np.sin(sun.elevation_rad)
    level = np.cos(sun.elevation_rad)
    suns = np.column_stack([level * np.sin(sun.azimuth_rad), level * np.cos(sun.azimuth_rad), up])
    targets = tomllib.loads((root / "examples" / "field.toml").read_text())["targets"]
    for k, name in enumerate(table["target"]):
        facing = np.array(targets[name]["normal_enu"], dtype=float)
        facing /= np.linalg.norm(facing)
        right = np.cross([0.0, 0.0, 1.0], facing)
        right /= np.linalg.norm(right)
        down = np.cross(right, facing)
        beam = 2 * (suns[k] @ normals[k]) * normals[k] - suns[k]
        mirror = mount.position_enu_m[0] + mount.mirror_offset_m[0] * normals[k]
        to_plane = np.array(targets[name]["centre_enu_m"]) - mirror
        from_centre = beam * (to_plane @ facing) / (beam @ facing) - to_plane
        np.testing.assert_allclose(
            [from_centre @ right, from_centre @ down], [table["u_m"][k], table["v_m"][k]], atol=1e-9
        )


@pytest.mark.parametrize(
    ("asked", "error", "said"),
    [
        ({"ids": ["H9999"]}, hp.OptionError, "H9999"),
        ({"targets": ["nowhere"]}, hp.OptionError, "nowhere"),
        ({"heliostats": 0}, hp.OptionError, "heliostats"),
        ({"count": 1.5}, hp.DataTypeError, "count"),
        ({"outliers": 2.0}, hp.OptionError, "outliers"),
        ({"hours": (15, 9)}, hp.OptionError, "hours"),
        ({"from_time": "2025-01-01T00:00:00"}, hp.TimeError, "2025"),
        ({"heliostats": 1, "ids": ["H001"]}, hp.OptionError, "ids"),
        ({"noise_mrad": "much"}, hp.DataTypeError, "noise_mrad"),
    ],
)
def test_wrong_calls_are_refused(asked: dict[str, Any], error: type[Exception], said: str, example: hp.Field) -> None:
    with pytest.raises(error, match=said):
        hp.simulate_observations(example, **asked)


def test_fields_without_files_cannot_be_observed() -> None:
    with pytest.raises(hp.MissingError, match=r"Field\.from_toml"):
        hp.simulate_observations(hp.Field([[0, 50, 5]], [0, 0, 50]))
    with pytest.raises(hp.OptionError, match="layout"):
        hp.simulate_field(10, "square")
    with pytest.raises(hp.OptionError, match="heliostats"):
        hp.simulate_field(0)


def test_progress_counts_heliostats(example: hp.Field) -> None:
    told: list[tuple[int, int]] = []
    hp.simulate_observations(example, heliostats=20, count=3, progress=lambda done, of: told.append((done, of)))
    assert told[-1] == (20, 20)


@pytest.mark.parametrize("more", ["count=3000", "count=2000, hours=(11, 13)", "heliostats=1, count=300_000"])
def test_a_signal_ends_a_campaign(root: Path, more: str) -> None:
    script = textwrap.dedent(
        f"""
        import os, signal, threading, time
        import helio_py as hp

        field = hp.Field.from_toml("examples/field.toml")
        sent = []

        def interrupt():
            sent.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)

        threading.Timer(0.3, interrupt).start()
        try:
            hp.simulate_observations(field, {more})
        except KeyboardInterrupt:
            print("stopped")
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=root)
    assert done.stdout == "stopped\n", done.stderr


def test_a_campaign_ends_when_its_progress_raises(root: Path) -> None:
    field = hp.Field.from_toml(root / "examples/field.toml")
    told = []

    def progress(done: int, of: int) -> None:
        told.append((done, of))
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        hp.simulate_observations(field, count=3000, progress=progress)
    assert len(told) == 1
    assert told[0][0] < told[0][1]


def test_observations_go_back_as_tables_of_every_kind(root: Path) -> None:
    field = hp.Field.from_toml(root / "examples/field.toml")
    seen = hp.simulate_observations(field, heliostats=3, count=12)
    wanted = hp.calibrate(field, seen.observations)
    for kind in ("dict", "pandas", "polars", "pyarrow"):
        found = hp.calibrate(field, seen.to_table(kind))
        assert found.mirror_tilt_rad.tobytes() == wanted.mirror_tilt_rad.tobytes(), kind
