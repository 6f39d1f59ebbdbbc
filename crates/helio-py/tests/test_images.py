"""Simulated camera frames: the command line's files, byte for byte, and what is found in them."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helio_py as hp


def typed(command_line: str, *arguments: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [command_line, "simulate", "images", *map(str, arguments)], capture_output=True, text=True, check=False
    )


def held(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def spoken(asked: dict[str, Any]) -> list[str]:
    """Keywords as the command line has them."""
    words = []
    for name, value in asked.items():
        option = "--" + name.replace("_", "-")
        if value is True:
            words.append(option)
        else:
            words += [f"{option}={value[0]}x{value[1]}" if name == "size" else f"{option}={value}"]
    return words


SETS: list[dict[str, Any]] = [
    {"frames": 2},
    {"frames": 3, "size": (160, 120), "seed": 2**64 - 1, "bits": 16, "noise": 0.0},
    {
        "frames": 4,
        "size": (201, 150),
        "shape": "facets",
        "shadow": 0.3,
        "distortion": 0.1,
        "turn_deg": 20,
        "tilt_deg": -10.5,
        "roll_deg": 5,
        "second": 0.3,
        "stray": 0.4,
        "empty_every": 2,
        "find_marks": True,
        "marks": "two-panel-upper",
        "seed": 9,
    },
    {
        "frames": 2,
        "size": (120, 90),
        "shape": "flat-top",
        "marks": "two-panel-lower",
        "width_m": 4.5,
        "height_m": 6,
        "beam_m": 0.4,
        "peak": 0.8,
        "daylight": 0.2,
        "gradient": 0.5,
        "texture": 0,
        "distortion": -0.2,
    },
    {"frames": 1, "size": (120, 90), "shape": "ellipse", "empty_every": 1},
]


@pytest.mark.parametrize("asked", SETS)
def test_folders_are_the_command_line_s(asked: dict[str, Any], command_line: str, tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "deep" / "other"
    done = typed(command_line, "--out", one, *spoken(asked))
    assert done.returncode == 0, done.stderr
    images = hp.simulate_images(other, **asked)
    assert held(other) == held(one)
    assert images.folder == other
    assert images.frames is None
    assert [path.name for path in images.files] == images.names == sorted(n for n in held(one) if n.endswith("png"))
    assert len(images) == asked["frames"]


@pytest.mark.parametrize("asked", SETS)
def test_frames_in_memory_are_those_of_the_files(asked: dict[str, Any], tmp_path: Path) -> None:
    image = pytest.importorskip("matplotlib.image")
    inside, outside = hp.simulate_images(**asked), hp.simulate_images(tmp_path, **asked)
    frames = inside.frames
    assert frames is not None
    width, height = asked.get("size", (768, 576))
    assert frames.shape == (len(inside), height, width)
    assert frames.dtype == (np.uint16 if asked.get("bits") == 16 else np.uint8)
    assert frames.flags.c_contiguous
    assert frames.flags.writeable
    for frame, path in zip(frames, outside.files, strict=True):
        # of a PNG the reader gives shares of white
        white = 65535 if frame.dtype == np.uint16 else 255
        np.testing.assert_array_equal(np.round(image.imread(path) * white), frame)
    assert inside.folder is None
    assert inside.files == []
    assert (inside.names, inside.target) == (outside.names, outside.target)
    for name, cells in inside.truth.items():
        assert cells.tobytes() == outside.truth[name].tobytes(), name


@pytest.mark.parametrize("asked", SETS)
def test_the_target_says_what_its_file_says(asked: dict[str, Any], tmp_path: Path) -> None:
    tomllib = pytest.importorskip("tomllib")  # of Python 3.11 and later
    images = hp.simulate_images(tmp_path, **asked)
    assert images.target == tomllib.loads((tmp_path / "target.toml").read_text())
    of_file = hp.find_spots(images.files, tmp_path / "target.toml")
    of_mapping = hp.find_spots(images.files, images.target)
    for name, cells in of_file.to_table().items():
        assert cells.tobytes() == of_mapping.to_table()[name].tobytes(), name
    images.target["width_m"] = 1.0  # a copy
    assert images.target["width_m"] == asked.get("width_m", 8.0)


def test_the_truth_is_the_table_written(tmp_path: Path) -> None:
    csv = pytest.importorskip("pyarrow.csv")
    images = hp.simulate_images(tmp_path, frames=5, size=(120, 90), empty_every=2, second=0.2)
    written = csv.read_csv(tmp_path / "truth.csv").to_pydict()
    assert images.to_table("pyarrow").to_pydict() == written
    assert images.to_table("polars").to_dict(as_series=False) == written
    for name, cells in images.to_table("pandas").items():
        np.testing.assert_array_equal(cells, images.truth[name])
        assert [None if cell != cell else cell for cell in cells.tolist()] == written[name]
    assert list(np.isnan(images.truth["u_m"])) == [False, True, False, True, False]


def test_observations_are_photographed_as_on_the_command_line(
    command_line: str, example: hp.Field, tmp_path: Path
) -> None:
    seen = hp.simulate_observations(example, heliostats=2, count=3, noise_mrad=0.2)
    path = tmp_path / "seen.csv"
    seen.write(path)
    one = tmp_path / "one"
    done = typed(command_line, "--out", one, "--observations", path, "--size", "100x80", "--seed", "3")
    assert done.returncode == 0, done.stderr
    tables = {kind: seen.to_table(kind) for kind in ("dict", "pandas", "polars", "pyarrow")}
    for kind, table in {"path": path, "object": seen, "observations": seen.observations, **tables}.items():
        images = hp.simulate_images(tmp_path / kind, observations=table, size=(100, 80), seed=3)
        assert held(tmp_path / kind) == held(one), kind
        log = images.log
        assert log is not None
        assert list(log["file"]) == images.names
        assert not {"u_m", "v_m", "sigma_m"} & set(log)
    inside = hp.simulate_images(observations=seen, size=(100, 80), seed=3)
    assert inside.to_table("pandas", of="log")["heliostat_id"].tolist() == seen.observations["heliostat_id"]
    np.testing.assert_array_equal(inside.truth["u_m"], seen.observations["u_m"])
    with pytest.raises(hp.OptionError, match="frames: it stands beside observations"):
        hp.simulate_images(observations=seen, frames=3)
    with pytest.raises(hp.OptionError, match="empty_every: it stands beside observations"):
        hp.simulate_images(observations=seen, empty_every=3)
    with pytest.raises(hp.MissingError, match="v_m"):
        hp.simulate_images(observations={"heliostat_id": ["H001"], "u_m": [1.0]})
    # what the command line refuses of a file
    seen.write(tmp_path / "seen.parquet")
    done = typed(command_line, "--out", tmp_path / "no", "--observations", tmp_path / "seen.parquet")
    with pytest.raises(hp.ConflictError, match="a Parquet table; wanted CSV") as caught:
        hp.simulate_images(tmp_path / "no", observations=tmp_path / "seen.parquet")
    assert done.stderr == f"error: {caught.value}\n"
    with pytest.raises(hp.OptionError, match="there is no log"):
        hp.simulate_images(frames=1, size=(40, 30)).to_table(of="log")


def test_folders_of_others_are_refused_and_one_s_own_are_replaced(command_line: str, tmp_path: Path) -> None:
    size: dict[str, Any] = {"size": (60, 40)}
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    hp.simulate_images(ours, frames=4, **size)
    assert typed(command_line, "--out", theirs, "--frames", 4, "--size", "60x40").returncode == 0
    # each goes on where the other left: fewer frames, and nothing of the earlier ones is left
    done = typed(command_line, "--out", ours, "--frames", 2, "--size", "60x40", "--seed", 2)
    assert done.returncode == 0, done.stderr
    hp.simulate_images(theirs, frames=2, seed=2, **size)
    assert held(ours) == held(theirs)
    assert sorted(held(ours)) == ["000001.png", "000002.png", "target.toml", "truth.csv"]
    # frames of somebody else beyond the earlier ones
    for folder in (ours, theirs):
        (folder / "000003.png").write_bytes(b"mine")
    before = held(ours)
    for spoilt in ("000003.png", "truth.csv", "target.toml"):
        if spoilt != "000003.png":
            with (ours / spoilt).open("a") as file:
                file.write("# mine\n")
            before = held(ours)
        with pytest.raises(hp.ConflictError, match=f"out: .*ours holds {spoilt}, which simulate images") as caught:
            hp.simulate_images(ours, frames=3, **size)
        assert (caught.value.field, caught.value.path) == ("out", ours)
        done = typed(command_line, "--out", ours, "--frames", 3, "--size", "60x40")
        assert (done.returncode, done.stderr) == (2, f"error: --{caught.value}\n")
        assert held(ours) == before
    with pytest.raises(hp.FileError, match="000003"):
        hp.simulate_images(ours / "000003.png" / "in a file", frames=1, **size)


@pytest.mark.parametrize(
    ("asked", "error", "field"),
    [
        ({"frames": 0}, hp.OptionError, "frames"),
        ({"frames": 1.5}, hp.DataTypeError, "frames"),
        ({"size": (0, 10)}, hp.OptionError, "size"),
        ({"size": (10, 10, 10)}, hp.ShapeError, "size"),
        ({"size": "768x576"}, hp.DataTypeError, "size"),
        ({"size": (65_535, 65_535)}, hp.OptionError, "size"),
        ({"frames": 100_000}, hp.OptionError, "frames"),
        ({"bits": 12}, hp.OptionError, "bits"),
        ({"marks": "crosses"}, hp.OptionError, "marks"),
        ({"shape": "square"}, hp.OptionError, "shape"),
        ({"shape": 3}, hp.DataTypeError, "shape"),
        ({"peak": -0.1}, hp.OptionError, "peak"),
        ({"noise": 1.5}, hp.OptionError, "noise"),
        ({"turn_deg": 61}, hp.OptionError, "turn_deg"),
        ({"distortion": 0.6}, hp.OptionError, "distortion"),
        ({"empty_every": 0}, hp.OptionError, "empty_every"),
        ({"find_marks": 1}, hp.DataTypeError, "find_marks"),
        ({"observations": 5}, hp.DataTypeError, "observations"),
        ({"out": 5}, hp.DataTypeError, "out"),
        ({"progress": 5}, hp.DataTypeError, "progress"),
    ],
)
def test_wrong_calls_are_refused(asked: dict[str, Any], error: type[hp.HelioError], field: str) -> None:
    with pytest.raises(error, match=field) as caught:
        hp.simulate_images(**asked)
    assert caught.value.field == field


def test_progress_counts_frames(tmp_path: Path) -> None:
    for out in (None, tmp_path):
        told: list[tuple[int, int]] = []
        hp.simulate_images(out, frames=7, size=(60, 40), progress=lambda done, of: told.append((done, of)))  # noqa: B023
        assert told[-1] == (7, 7)


def test_it_ends_when_its_progress_raises(tmp_path: Path) -> None:
    def progress(done: int, of: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        hp.simulate_images(tmp_path / "run", frames=100_000, progress=progress)
    time.sleep(0.5)  # what was in the middle of a frame
    left = held(tmp_path / "run")
    assert len(left) < 1000
    assert not {"truth.csv", "target.toml"} & set(left)


@pytest.mark.parametrize("more", ["frames=3000", "'run', frames=100_000", "frames=1, size=(9000, 9000)"])
def test_a_signal_ends_it(more: str, tmp_path: Path) -> None:
    script = textwrap.dedent(
        f"""
        import os, signal, threading, time
        import helio_py as hp

        signal.signal(signal.SIGINT, signal.default_int_handler)
        sent = []

        def interrupt():
            sent.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)

        threading.Timer(0.5, interrupt).start()
        try:
            hp.simulate_images({more})
        except KeyboardInterrupt:
            print("stopped", time.perf_counter() - sent[0], flush=True)
        os._exit(0)
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.stdout.startswith("stopped "), done.stderr


def test_frames_are_found_where_they_truly_are(tmp_path: Path) -> None:
    """From frames to misses against the truth, in memory and by the files."""
    images = hp.simulate_images(tmp_path, frames=20, seed=4, turn_deg=15, shadow=0.2)
    inside = hp.simulate_images(frames=20, seed=4, turn_deg=15, shadow=0.2)
    of_files = hp.find_spots(images.files, images.target, names=images.names)
    of_array = hp.find_spots(inside.frames, inside.target, names=inside.names)
    for name, cells in of_files.to_table().items():
        assert cells.tobytes() == of_array.to_table()[name].tobytes(), name
    assert set(of_array.status) == {"ok"}
    truth = inside.truth
    misses_m = np.hypot(of_array.u_m - truth["on_target_u_m"], of_array.v_m - truth["on_target_v_m"])
    assert misses_m.max() < 0.02  # a pixel is 17 mm
    np.testing.assert_allclose(of_array.x_px, truth["x_px"], atol=1.0)


def test_photographed_observations_calibrate(example: hp.Field) -> None:
    seen = hp.simulate_observations(example, ids=["H001", "H120"], count=25, random_errors=True, noise_mrad=0.0)
    kept = (abs(seen.observations["u_m"]) < 4.0) & (abs(seen.observations["v_m"]) < 3.0)
    observations = {name: np.asarray(cells)[kept] for name, cells in seen.observations.items()}
    images = hp.simulate_images(observations=observations, width_m=14.0, height_m=12.0, size=(400, 300))
    spots = hp.find_spots(images.frames, images.target, names=images.names)
    calibration = hp.calibrate(example, images.log, spots=spots)
    assert calibration.ids == ["H001", "H120"]
    assert (calibration.beam_rms_mrad < 0.5).all()
