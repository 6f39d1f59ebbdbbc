"""Frames of raw video, their times, and pictures of what was found: as the command line's."""

from __future__ import annotations

import concurrent.futures as futures
import datetime as dt
import io
import mmap
import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

import helio_py as hp
from conftest import random_field, same_bits
from test_spots import TARGET, frame, same

START = "2026-06-21T14:00:00+02:00"
PLACES = [(60 + 4 * k, 40 + 3 * k) for k in range(6)]


def stack(kind: Any = np.uint8) -> NDArray[Any]:
    gray = np.array([frame(*place) for place in PLACES]).astype(kind)
    return gray * kind(200) if kind is np.uint16 else gray


def target(folder: Path) -> Path:
    path = folder / "target.toml"
    path.write_text("width_m = 8\nheight_m = 6\ncorners_px = [[0, 0], [159, 0], [159, 119], [0, 119]]\n")
    return path


def run(command_line: str, folder: Path, *typed: Any, stdin: bytes | None = None) -> str:
    line = [command_line, "spot", *typed, "--target", "target.toml"]
    done = subprocess.run(list(map(str, line)), cwd=folder, capture_output=True, check=False, input=stdin)
    assert done.returncode in (0, 1), done.stderr
    return done.stderr.decode()


@pytest.mark.parametrize("method", ["robust", "standard"])
@pytest.mark.parametrize("bits", [8, 16])
def test_raw_video_is_the_command_line_s(bits: int, method: str, command_line: str, tmp_path: Path) -> None:
    frames = stack(np.uint8 if bits == 8 else np.uint16)
    bytes_ = frames.astype(frames.dtype.newbyteorder("<")).tobytes()
    short = bytes_ + bytes_[:100]  # the last frame ends early
    raw = "160x120" if bits == 8 else "160x120:gray16le"
    toml = target(tmp_path)
    (tmp_path / "video.raw").write_bytes(short)
    typed = ["--raw", raw, "--method", method, "--fps", 12.5, "--start", START, "--overlay", "theirs"]
    run(command_line, tmp_path, "-", *typed, "--out", "cli.csv", stdin=short)
    asked: dict[str, Any] = {"method": method, "raw": raw, "start": START, "fps": 12.5}
    spots = hp.find_spots(tmp_path / "video.raw", toml, overlay=tmp_path / "ours", **asked)
    spots.write(tmp_path / "ours.csv")
    assert (tmp_path / "ours.csv").read_bytes() == (tmp_path / "cli.csv").read_bytes()
    assert spots.status == ["ok"] * 6 + ["unreadable"]
    assert spots.reason[6] == f"frame 6, counted from 0: the stream ends after 100 of its {len(bytes_) // 6} bytes"
    pictures = sorted(path.name for path in (tmp_path / "theirs").iterdir())
    assert pictures == [f"frame-{k:06}.png" for k in range(6)]
    assert sorted(path.name for path in (tmp_path / "ours").iterdir()) == pictures
    for name in pictures:
        assert (tmp_path / "ours" / name).read_bytes() == (tmp_path / "theirs" / name).read_bytes(), name
    # The same frames as arrays.
    found = hp.find_spots(frames, toml, method=method, start=START, fps=12.5, overlay=tmp_path / "arrays")
    assert all(same(one, other) for one, other in zip(found, spots, strict=False))
    assert found.time is not None
    assert spots.time is not None
    assert (found.time == spots.time[:6]).all()
    for name in pictures:
        assert (tmp_path / "arrays" / name).read_bytes() == (tmp_path / "theirs" / name).read_bytes(), name


class Drip(io.RawIOBase):
    """Gives a few bytes at a time, as a pipe may."""

    def __init__(self, of: bytes) -> None:
        self._of = io.BytesIO(of)

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1, /) -> bytes:
        return self._of.read(min(size, 7001) if size >= 0 else size)


def test_raw_video_comes_from_anywhere(tmp_path: Path) -> None:
    bytes_ = stack().tobytes()
    path = tmp_path / "video.raw"
    path.write_bytes(bytes_)
    want = hp.find_spots(stack(), TARGET)
    told: list[int] = []
    child = subprocess.Popen(
        [sys.executable, "-c", f"import sys; sys.stdout.buffer.write(open({str(path)!r}, 'rb').read())"],
        stdout=subprocess.PIPE,
    )
    with path.open("rb") as file, path.open("rb") as mapped, child:
        sources: list[Any] = [
            str(path), path, bytes_, bytearray(bytes_), memoryview(bytes_), stack(), mmap.mmap(mapped.fileno(), 0, access=mmap.ACCESS_READ),
            np.frombuffer(bytes_, np.uint8), io.BytesIO(bytes_), file, Drip(bytes_), child.stdout,
        ]  # fmt: skip
        for source in sources:
            told.clear()
            found = hp.find_spots(source, TARGET, raw="160x120", progress=lambda done, _: told.append(done))
            assert found.file == [f"frame {k}" for k in range(6)]
            assert all(same(one, other) for one, other in zip(found, want, strict=True)), source
            assert told[-1] == 6
            assert found.time is None
            assert found.warnings == []


def test_wrong_video_is_named(tmp_path: Path) -> None:
    bytes_ = stack().tobytes()
    (tmp_path / "video.raw").write_bytes(bytes_)

    class Broken(io.BytesIO):
        def read(self, size: int | None = -1, /) -> bytes:
            if self.tell():
                raise ZeroDivisionError("broken")
            return super().read(100)

    with pytest.raises(ZeroDivisionError, match="broken"):
        hp.find_spots(Broken(bytes_), TARGET, raw="160x120")
    calls: list[tuple[type[hp.HelioError], str, str | None, Any, dict[str, Any]]] = [
        (hp.DataTypeError, "with raw a path, bytes or a file opened for bytes, got list", "images", [1], {}),
        (hp.DataTypeError, "with raw a path, bytes", "images", np.zeros(9), {}),
        (hp.DataTypeError, "expected a file opened for bytes, but its read gave str", "images", io.StringIO("x"), {}),
        (hp.ImageError, "no frame of video", "images", b"", {}),
        (hp.FileUnreadableError, "nowhere.raw", None, tmp_path / "nowhere.raw", {}),
        (hp.FileUnreadableError, "cannot be read", None, tmp_path, {}),
        (hp.OptionError, "raw: wanted WIDTHxHEIGHT in pixels, such as 768x576, got `160`", "raw", bytes_, {"raw": "160"}),
        (hp.OptionError, "raw: wanted gray8 or gray16le after the colon", "raw", bytes_, {"raw": "160x120:rgb24"}),
        (hp.OptionError, "raw: ", "raw", bytes_, {"raw": "65535x65535"}),
        (hp.DataTypeError, "raw: expected str", "raw", bytes_, {"raw": 3}),
        (hp.OptionError, "names: with raw", "names", bytes_, {"names": ["a"]}),
        (hp.OptionError, "times: with raw", "times", bytes_, {"times": [START]}),
        (hp.OptionError, "numbered: with raw", "numbered", bytes_, {"numbered": True, "start": START, "fps": 1}),
    ]  # fmt: skip
    for error, message, named, images, more in calls:
        with pytest.raises(error, match=message) as caught:
            hp.find_spots(images, TARGET, **{"raw": "160x120"} | more)
        assert caught.value.field == named, message


def write(folder: Path, names: list[str]) -> None:
    folder.mkdir()
    for name, gray in zip(names, stack(), strict=False):
        Image.fromarray(gray).save(folder / name)


@pytest.mark.parametrize("numbered", [False, True])
def test_times_are_the_command_line_s(numbered: bool, command_line: str, tmp_path: Path) -> None:
    write(tmp_path / "f", ["r1.png", "r2.png", "r4.png", "r5.png", "r6.png"])
    target(tmp_path)
    typed = ["f", "--start", START, "--fps", "3", "--out", "cli.csv", *(["--numbered"] if numbered else [])]
    said = run(command_line, tmp_path, *typed)
    spots = hp.find_spots(str(tmp_path / "f"), TARGET, start=START, fps=3, numbered=numbered)
    spots.write(tmp_path / "ours.csv")
    ours = (tmp_path / "ours.csv").read_text().replace(str(tmp_path) + os.sep, "")
    assert ours == (tmp_path / "cli.csv").read_text()
    assert spots.time is not None
    third = np.datetime64("2026-06-21T12:00:00", "ns") + round((3 if numbered else 2) / 3 * 1e9)
    assert spots.time[2] == third
    assert len(spots.warnings) == (not numbered)
    if not numbered:
        text = spots.warnings[0].replace(str(tmp_path) + os.sep, "")
        assert text.replace("numbered=True", "--numbered") in said.replace("\n", " ")
        assert "after f/r2.png comes f/r4.png" in text.replace(os.sep, "/")


def test_times_of_arrays_go_by_their_names() -> None:
    names = ["r1", "r2", "r4", "r5", "r6", "r9"]
    spots = hp.find_spots(
        stack(), TARGET, start=np.datetime64("2026-06-21T12:00:00"), fps=1, numbered=True, names=names
    )
    assert spots.time is not None
    assert ((spots.time - spots.time[0]) / np.timedelta64(1, "s")).tolist() == [0, 1, 3, 4, 5, 8]
    assert hp.find_spots(stack(), TARGET, start=START, fps=1).warnings == []
    assert len(hp.find_spots([], TARGET, start=START, fps=1, numbered=True)) == 0
    gap = hp.find_spots(stack(), TARGET, start=START, fps=1, names=names).warnings
    assert "after r2 comes r4 (2 such places)" in gap[0]
    calls: list[tuple[type[hp.HelioError], str, str, dict[str, Any]]] = [
        (hp.OptionError, "fps: wanted with start", "fps", {"start": START}),
        (hp.OptionError, "start: wanted with fps", "start", {"fps": 25}),
        (hp.OptionError, "fps: wanted 1e-06 to 1e", "fps", {"start": START, "fps": 0}),
        (hp.OptionError, "numbered: wants start and fps", "numbered", {"numbered": True}),
        (hp.OptionError, "times: with start and fps", "times", {"start": START, "fps": 1, "times": [START] * 6}),
        (hp.TimeError, "start: 2026-06-21T12:00:00: a time without a zone", "start", {"start": dt.datetime(2026, 6, 21, 12), "fps": 1}),
        (hp.ShapeError, "start: expected one instant", "start", {"start": [START], "fps": 1}),
        (hp.OptionError, "numbered: arrays have no names", "numbered", {"start": START, "fps": 1, "numbered": True}),
        (hp.OptionError, "numbered: x has no number in its name", "numbered", {"start": START, "fps": 1, "numbered": True, "names": ["r1", "x", "y", "z", "a", "b"]}),
        (hp.OptionError, "numbered: r1 comes after r2; wanted numbers that ascend", "numbered", {"start": START, "fps": 1, "numbered": True, "names": ["r2", "r1", "r3", "r4", "r5", "r6"]}),
        (hp.ShapeError, "names: expected shape", "names", {"names": ["a"]}),
        (hp.ShapeError, "times: expected shape", "times", {"times": [START]}),
    ]  # fmt: skip
    for error, message, named, more in calls:
        with pytest.raises(error, match=message) as caught:
            hp.find_spots(stack(), TARGET, **more)
        assert caught.value.field == named, message


@pytest.mark.parametrize("method", ["robust", "standard"])
def test_pictures_of_what_was_found_are_the_command_line_s(method: str, command_line: str, tmp_path: Path) -> None:
    made = "simulate images --frames 4 --seed 3 --shadow 0.3 --find-marks --out f -q"
    subprocess.run([command_line, *made.split()], cwd=tmp_path, check=True)
    (tmp_path / "f" / "broken.png").write_text("nothing")
    (tmp_path / "f" / "target.toml").rename(tmp_path / "target.toml")
    write(tmp_path / "g", ["000001.png", "colours.png"])
    with Image.open(tmp_path / "g" / "colours.png") as gray:
        Image.merge("RGB", [gray] * 3).save(tmp_path / "g" / "colours.png")
    run(command_line, tmp_path, "f", "g", "--method", method, "--overlay", "theirs", "--out", "cli.csv")
    folders = [tmp_path / "f", tmp_path / "g"]
    found = hp.find_spots(folders, tmp_path / "target.toml", method=method, overlay=tmp_path / "ours")
    assert found.status.count("ok") == 4
    pictures = sorted(path.name for path in (tmp_path / "theirs").iterdir())
    assert sorted(path.name for path in (tmp_path / "ours").iterdir()) == pictures
    assert len(pictures) == 6
    assert "000005-000001.png" in pictures  # a name that stands twice
    for name in pictures:
        assert (tmp_path / "ours" / name).read_bytes() == (tmp_path / "theirs" / name).read_bytes(), name
    # There is more on it than on the frame, and its centre is where it was found.
    with Image.open(tmp_path / "ours" / pictures[0]) as drawn:
        colours = np.array(drawn)
    red = np.argwhere((colours == [255, 30, 30]).all(2))
    assert np.abs(red.mean(0) - [found[0].y_px, found[0].x_px]).max() < 1.5


def test_pictures_never_replace_frames(tmp_path: Path) -> None:
    write(tmp_path / "f", ["1.png", "2.png"])
    before = (tmp_path / "f" / "1.png").read_bytes()
    with pytest.raises(hp.OptionError, match=r"^overlay: .*1\.png is a frame that this run reads") as caught:
        hp.find_spots(tmp_path / "f", TARGET, overlay=tmp_path / "f")
    assert caught.value.field == "overlay"
    assert (tmp_path / "f" / "1.png").read_bytes() == before
    with pytest.raises(hp.OptionError, match=r"^overlay: .* is a file; wanted a folder"):
        hp.find_spots(tmp_path / "f", TARGET, overlay=tmp_path / "f" / "1.png")
    with pytest.raises(hp.DataTypeError, match=r"^overlay: expected a path"):
        hp.find_spots(tmp_path / "f", TARGET, overlay=3)  # type: ignore[arg-type]
    # One that would take the place of something else ends it.
    (tmp_path / "seen" / "frame-000002.png").mkdir(parents=True)
    for images, raw in ((stack(), None), (stack().tobytes() * 20, "160x120")):
        with pytest.raises(hp.FileError, match=r"frame-000002\.png is there already, and spot did not draw it"):
            hp.find_spots(images, TARGET, raw=raw, overlay=tmp_path / "seen")
    hp.find_spots(stack()[:2], TARGET, names=["run/a.png", "run/b.png"], overlay=tmp_path / "named")
    assert sorted(path.name for path in (tmp_path / "named").iterdir()) == ["a.png", "b.png"]


def test_a_single_file_that_is_not_there_is_a_wrong_call(tmp_path: Path) -> None:
    with pytest.raises(hp.FileUnreadableError, match=r"missing\.png: cannot be read: no such file") as caught:
        hp.find_spot(tmp_path / "missing.png", TARGET)
    assert caught.value.path == tmp_path / "missing.png"
    with pytest.raises(hp.FileError, match="cannot be read"):
        hp.find_spot(tmp_path, TARGET)
    (tmp_path / "none.png").write_text("nothing")
    spot = hp.find_spot(tmp_path / "none.png", TARGET)
    assert spot.status == "unreadable"
    assert "not an image" in spot.reason
    # Among several each keeps its place.
    Image.fromarray(frame()).save(tmp_path / "1.png")
    several = hp.find_spots([tmp_path / "missing.png", tmp_path / "1.png"], TARGET)
    assert several.status == ["unreadable", "ok"]
    assert "no such file" in several.reason[0]
    twice = hp.find_spots([tmp_path / "1.png", tmp_path / "1.png"], TARGET)
    assert len(twice) == 1
    assert twice.warnings[0].startswith("1 file named more than once and taken once, first ")


def test_others_work_while_a_stream_is_waited_for() -> None:
    """Threads of the pool are for all."""
    read, write = os.pipe()
    bytes_ = stack().tobytes()
    field = random_field(500)
    suns = np.linspace(2.0, 4.0, 400), np.full(400, 0.8)
    want = hp.track(field, *suns)
    with futures.ThreadPoolExecutor(1) as other, os.fdopen(read, "rb") as stream:
        with os.fdopen(write, "wb") as begun:
            waiting = other.submit(hp.find_spots, stream, TARGET, raw="160x120")
            for part in range(0, len(bytes_), 30_000):
                begun.write(bytes_[part : part + 30_000])
                begun.flush()
                assert same_bits(hp.track(field, *suns), want)  # 200,000 rows, on all threads
            assert not waiting.done()
        found = waiting.result(timeout=60)
    assert found.status == ["ok"] * 6


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
@pytest.mark.parametrize("source", ["file", "pipe"])
def test_ctrl_c_does_not_wait_for_a_stream_that_stalls(source: str) -> None:
    script = textwrap.dedent(
        f"""
        import os, signal, sys, time
        import helio_py as hp
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        read, write = os.pipe()
        os.write(write, bytes(1000))  # and no more
        source = os.fdopen(read, "rb") if {source!r} == "file" else f"/dev/fd/{{read}}"
        begun = []
        def stop(*_):
            begun.append(time.monotonic())
            raise KeyboardInterrupt
        signal.signal(signal.SIGALRM, stop)
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        target = {TARGET!r}
        try:
            hp.find_spots(source, target, raw="160x120")
        except KeyboardInterrupt:
            print("stopped", flush=True)
        # What is left behind keeps nobody else from working.
        field = hp.Field([[0, 90, 6]] * 500, [0, 0, 120])
        hp.track(field, [3.0] * 400, [0.8] * 400)
        print("tracked", flush=True)
        os._exit(0)  # as the pipe is never closed
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=60)
    assert done.stdout == "stopped\ntracked\n", done.stderr
