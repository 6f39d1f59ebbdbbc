"""Spots in frames: where they are, as the command line's, in arrays of every kind, watched and stopped."""

from __future__ import annotations

import concurrent.futures as futures
import csv
import gc
import multiprocessing as mp
import pickle
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from numpy.typing import NDArray
from PIL import Image

import helio_py as hp
from helio_py import _native

ROWS, COLUMNS = 120, 160
TARGET: dict[str, Any] = {
    "width_m": 8,
    "height_m": 6,
    "corners_px": [[0, 0], [159, 0], [159, 119], [0, 119]],
}
#: Metres a pixel: the corners are the middles of the outermost pixels.
SCALE = 8 / 159


def frame(x: float = 90.0, y: float = 50.0, top: float = 120.0) -> NDArray[np.uint8]:
    down, right = np.mgrid[:ROWS, :COLUMNS]
    gray = 60 + top * np.exp(-((right - x) ** 2 + (down - y) ** 2) / (2 * 8**2))
    return gray.round().astype(np.uint8)


def same(one: hp.Spot, other: hp.Spot) -> bool:
    """To the last bit, whatever they are called."""
    plain = [(s.corners_px.tobytes(), s.covariance_m2.tobytes(), repr(s[:13])) for s in (one, other)]
    return plain[0] == plain[1]


@pytest.mark.parametrize("method", ["robust", "standard"])
@pytest.mark.parametrize("place", [(90.0, 50.0), (60.25, 70.5)])
def test_it_is_where_it_was_put(method: str, place: tuple[float, float]) -> None:
    x, y = place
    spot = hp.find_spot(frame(x, y), TARGET, method=method)
    assert spot.status == "ok"
    near = 0.1 if method == "robust" else 1.0  # the standard goes by whole windows
    assert abs(spot.x_px - x) < near
    assert abs(spot.y_px - y) < near
    assert spot.u_m == pytest.approx((spot.x_px - 79.5) * SCALE, abs=1e-9)
    assert spot.v_m == pytest.approx((spot.y_px - 59.5) * 6 / 119, abs=1e-9)
    assert spot.flags == ("corners_given",)
    assert spot.corners_px.tolist() == TARGET["corners_px"]
    if method == "robust":
        assert spot.sigma_m**2 == pytest.approx(np.trace(spot.covariance_m2) / 2)


def test_an_even_target_is_empty_and_a_white_one_unclear() -> None:
    empty = hp.find_spot(np.full((ROWS, COLUMNS), 90, np.uint8), TARGET)
    assert empty.status == "empty"
    assert np.isnan([empty.u_m, empty.v_m, empty.x_px, empty.sigma_m]).all()
    assert empty.threshold is None
    assert hp.find_spot(np.full((ROWS, COLUMNS), 255, np.uint8), TARGET).status == "unclear"


def test_without_corners_marks_are_looked_for() -> None:
    spot = hp.find_spot(frame(), {"width_m": 8, "height_m": 6})
    assert spot.status == "no_target"
    assert spot.reason
    assert np.isnan(spot.corners_px).all()


def test_every_layout_gives_the_same(tmp_path: Path) -> None:
    gray = frame()
    want = hp.find_spot(gray, TARGET)
    Image.fromarray(gray).save(tmp_path / "gray.png")
    read_only = gray.copy()
    read_only.flags.writeable = False
    target = tmp_path / "target.toml"
    target.write_text("width_m = 8\nheight_m = 6\ncorners_px = [[0, 0], [159, 0], [159, 119], [0, 119]]\n")
    for image in (
        np.asfortranarray(gray),
        np.repeat(gray, 2, 1)[:, ::2],
        read_only,
        tmp_path / "gray.png",
        list(gray),
    ):
        assert same(hp.find_spot(image, target), want)
    assert same(hp.find_spot(np.dstack([gray] * 3), TARGET), want)
    deep = gray.astype(np.uint16)
    want16 = hp.find_spot(deep, TARGET, white=255)
    assert want16.x_px == pytest.approx(want.x_px, abs=0.05)
    assert same(hp.find_spot(deep.astype(">u2"), TARGET, white=255), want16)
    assert same(hp.find_spot(np.dstack([deep] * 3), TARGET, white=255), want16)


def test_colours_become_gray_by_bt_601() -> None:
    rng = np.random.default_rng(3)
    red, green = frame(), frame(88, 51)
    colours = np.dstack([red, green, rng.integers(0, 80, red.shape).astype(np.uint8)])
    weights = np.array([299, 587, 114])
    gray = ((colours.astype(np.int64) @ weights + 500) // 1000).astype(np.uint8)
    assert same(hp.find_spot(colours, TARGET), hp.find_spot(gray, TARGET))


def test_contiguous_pixels_are_read_where_they_lie() -> None:
    from helio_py._spots import _picture

    for image in (frame(), frame().astype(np.uint16), np.dstack([frame()] * 3)):
        assert _native._pixels_read(_picture(image, "image")) == image.ctypes.data


def test_many_are_as_one_by_one(tmp_path: Path) -> None:
    places = [(60 + 5 * k, 40 + 4 * k) for k in range(8)]
    stack = np.array([frame(*place) for place in places])
    times = np.datetime64("2026-06-20T08:00:00") + np.arange(8)
    spots = hp.find_spots(stack, TARGET, times=times, names=[f"f{k}.png" for k in range(8)])
    assert len(spots) == 8
    assert spots.time is not None
    assert (spots.time == times).all()
    assert spots.file[3] == "f3.png"
    for k, spot in enumerate(spots):
        assert same(spot, hp.find_spot(stack[k], TARGET))
    assert spots.u_m.tolist() == [spot.u_m for spot in spots]
    assert spots.corners_px.shape == (8, 4, 2)
    # Paths, arrays and files that are none, in their order.
    Image.fromarray(stack[2]).save(tmp_path / "2.png")
    (tmp_path / "none.png").write_text("nothing")
    mixed = hp.find_spots([stack[1], tmp_path / "2.png", tmp_path / "none.png", tmp_path / "missing.png"], TARGET)
    assert same(mixed[0], spots[1])
    assert same(mixed[1], spots[2])
    assert mixed.status[2:] == ["unreadable", "unreadable"]
    assert "not an image" in mixed.reason[2]
    assert mixed.time is None
    none = hp.find_spots([], TARGET)
    assert len(none) == 0
    assert none.corners_px.shape == (0, 4, 2)


def test_tables_of_every_kind() -> None:
    spots = hp.find_spots(
        np.array([frame(), frame(80)]), TARGET, times=["2026-06-20T08:00:00Z", "2026-06-20T08:00:01Z"]
    )
    table = spots.to_table()
    assert list(table) == ["file", "time", "threshold", "area_px", "window_px", "row", "column",
                           "x_px", "y_px", "u_m", "v_m", "sigma_m", "flags", "status", "reason"]  # fmt: skip
    arrow = spots.to_table("pyarrow")
    assert isinstance(arrow, pa.Table)
    assert arrow["u_m"].to_pylist() == spots.u_m.tolist()
    with pytest.raises(hp.OptionError, match=r"^kind: wanted dict, pandas"):
        spots.to_table("numpy")
    again = pickle.loads(pickle.dumps(spots))
    assert same(again[1], spots[1])


@pytest.mark.parametrize(
    ("made", "typed", "keywords"),
    [
        ("--frames 5 --seed 4 --shadow 0.3", [], {}),
        ("--frames 4 --seed 5 --bits 16 --shape facets", ["--method", "standard", "--threshold", "triangle"],
         {"method": "standard", "threshold": "triangle"}),
        ("--frames 4 --seed 6 --find-marks --turn-deg 10 --roll-deg 2", ["--expected", "0.5,-0.25"], {"expected": (0.5, -0.25)}),
        ("--frames 4 --seed 7 --empty-every 2 --distortion -0.1", ["--white", "200"], {"white": 200}),
    ],
)  # fmt: skip
def test_the_command_line_writes_the_same_table(
    made: str, typed: list[str], keywords: dict[str, Any], command_line: str, tmp_path: Path
) -> None:
    def run(*words: str) -> None:
        done = subprocess.run([command_line, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode in (0, 1), done.stderr

    run("simulate", "images", "--out", "f", "-q", *made.split())
    (tmp_path / "f" / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    run("spot", "f", "--target", "f/target.toml", "--out", "cli.csv", "-q", *typed)
    found = hp.find_spots(tmp_path / "f", tmp_path / "f" / "target.toml", **keywords)
    found.write(tmp_path / "ours.csv")
    with (tmp_path / "cli.csv").open() as one, (tmp_path / "ours.csv").open() as other:
        theirs, ours = list(csv.DictReader(one)), list(csv.DictReader(other))
    assert [{**row, "file": Path(row["file"]).name} for row in ours] == [
        {**row, "file": Path(row["file"]).name} for row in theirs
    ]
    # Arrays of the same pixels.
    for k, path in enumerate(found.file[:-1]):
        with Image.open(path) as image:
            pixels = np.array(image)
        if pixels.dtype == np.int32:
            pixels = pixels.astype(np.uint16)
        assert same(hp.find_spot(pixels, tmp_path / "f" / "target.toml", **keywords), found[k])


WRONG: list[tuple[type[hp.HelioError], str, dict[str, Any]]] = [
    (hp.DataTypeError, "image: expected gray values of uint8 or uint16, got dtype float64", {"image": frame() / 255}),
    (hp.DataTypeError, "image: expected gray values of uint8 or uint16, got dtype bool", {"image": frame() > 90}),
    (hp.ShapeError, r"image: expected shape \(rows, columns\) or \(rows, columns, 3\), got \(120, 160, 4\)", {"image": np.dstack([frame()] * 4)}),
    (hp.ShapeError, "image: expected shape", {"image": np.zeros((0, 5), np.uint8)}),
    (hp.DataTypeError, "target: expected the path of a target.toml or a mapping of its keys, got int", {"target": 3}),
    (hp.UnknownNameError, "corner_px", {"target": {"width_m": 8, "height_m": 6, "corner_px": []}}),
    (hp.MissingError, "height_m is missing", {"target": {"width_m": 8}}),
    (hp.FileUnreadableError, "nowhere.toml", {"target": "nowhere.toml"}),
    (hp.OptionError, "method: wanted robust or standard, got `best`", {"method": "best"}),
    (hp.OptionError, "threshold: it is for the method standard", {"threshold": "otsu"}),
    (hp.OptionError, "threshold: wanted otsu, .* got `multi:9`", {"threshold": "multi:9", "method": "standard"}),
    (hp.OptionError, "expected: it is for the method robust", {"expected": (0, 0), "method": "standard"}),
    (hp.OptionError, "expected: wanted u_m, v_m", {"expected": (0, 0, -1)}),
    (hp.OptionError, "white: wanted 1 to 65535, got 0", {"white": 0}),
    (hp.DataTypeError, "method: expected str", {"method": 3}),
]  # fmt: skip


@pytest.mark.parametrize(("error", "message", "wrong"), WRONG)
def test_wrong_calls_are_named(error: type[hp.HelioError], message: str, wrong: dict[str, Any]) -> None:
    asked: dict[str, Any] = {"image": frame(), "target": TARGET, **wrong}
    with pytest.raises(error, match=message):
        hp.find_spot(**asked)


def test_wrong_calls_of_many_are_named() -> None:
    two = np.array([frame(), frame()])
    with pytest.raises(hp.ShapeError, match=r"^times: expected shape \(2,\)"):
        hp.find_spots(two, TARGET, times=["2026-06-20T08:00:00Z"])
    with pytest.raises(hp.TimeError):
        hp.find_spots(two, TARGET, times=["2026-06-20T08:00:00"] * 2)
    with pytest.raises(hp.ShapeError, match=r"^names: expected shape \(2,\)"):
        hp.find_spots(two, TARGET, names=["a"])
    with pytest.raises(hp.ShapeError, match="find_spot takes a single frame"):
        hp.find_spots(frame(), TARGET)
    with pytest.raises(hp.DataTypeError, match=r"^images: frame 1: expected gray values"):
        hp.find_spots([frame(), frame() / 2], TARGET)
    with pytest.raises(hp.DataTypeError, match=r"^images: expected paths or arrays, got int"):
        hp.find_spots(3, TARGET)
    with pytest.raises(hp.FileError, match="no file matches"):
        hp.find_spots("nowhere/*.png", TARGET)


def test_progress_is_told_and_may_end_it() -> None:
    stack = np.array([frame()] * 12)
    told: list[tuple[int, int]] = []
    hp.find_spots(stack, TARGET, progress=lambda done, of: told.append((done, of)))
    assert told[-1] == (12, 12)
    assert told == sorted(told)

    def enough(_done: int, _of: int) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        hp.find_spots(stack, TARGET, progress=enough)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
def test_ctrl_c_ends_it_early() -> None:
    script = """
import signal
import numpy as np, helio_py as hp
stack = np.full((4000, 240, 320), 60, np.uint8)
stack[:, 100:140, 100:160] += 90
begun = []
def told(done, of):
    if done:
        begun.append(done)
        if len(begun) == 1:
            signal.raise_signal(signal.SIGINT)
target = {"width_m": 8, "height_m": 6, "corners_px": [[0, 0], [319, 0], [319, 239], [0, 239]]}
try:
    hp.find_spots(stack, target, progress=told)
except KeyboardInterrupt:
    print("stopped", begun[-1] < 4000)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=300)
    assert done.stdout == "stopped True\n", done.stderr


def digest(_: int) -> bytes:
    return hp.find_spots([frame(), frame(70)], TARGET).u_m.tobytes()


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_children_of_every_kind_find_the_same(method: str) -> None:
    if method not in mp.get_all_start_methods():
        pytest.skip(f"no {method} on this system")
    want = digest(0)
    with futures.ProcessPoolExecutor(2, mp_context=mp.get_context(method)) as pool:
        assert list(pool.map(digest, range(2), timeout=120)) == [want] * 2


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="Linux's own")
def test_memory_is_flat_over_many_calls() -> None:
    gray, colours, stack = frame(), np.dstack([frame()] * 3), np.array([frame()] * 3)

    def calls(count: int) -> None:
        for _ in range(count):
            hp.find_spot(gray, TARGET)
            hp.find_spot(colours, TARGET, method="standard")
            hp.find_spots(stack, TARGET).to_table()
            with pytest.raises(hp.DataTypeError):
                hp.find_spot(gray / 2, TARGET)

    def resident_kb() -> int:
        lines = Path("/proc/self/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("VmRSS")).split()[1])

    calls(60)
    gc.collect()
    counts = [sys.getrefcount(thing) for thing in (gray, colours, stack, TARGET)]
    before_kb = resident_kb()
    calls(300)
    gc.collect()
    assert [sys.getrefcount(thing) for thing in (gray, colours, stack, TARGET)] == counts
    assert resident_kb() - before_kb < 8_000
