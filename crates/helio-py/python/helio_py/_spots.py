"""``find_spot`` and ``find_spots``: camera frames into places on the target."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from helio_py._checked import array as checked_array
from helio_py._checked import number, of, path, several, text, texts, whole, wrong_value
from helio_py._errors import DataTypeError, ShapeError
from helio_py._frames import clock, times_of, video
from helio_py._native import _find_raw_spots, _find_spots, _frame_files, _write_table
from helio_py._progress import reporter
from helio_py._tables import ABSENT, Column, checked_kind, given_back
from helio_py._toml import path_and_text

if TYPE_CHECKING:
    from os import PathLike

    from numpy.typing import ArrayLike, NDArray

    _Target = str | PathLike[str] | Mapping[str, Any]


class Spot(NamedTuple):
    """What a camera's frame shows of the target. Numbers that there are not are NaN, whole ones None."""

    #: "ok", "empty", "cut", "saturated", "ambiguous", "unclear", "no_target"; "unreadable" for a file that is no picture.
    status: str
    #: Centre on the target, right of its centre as the camera sees it [m].
    u_m: float
    #: Below its centre [m].
    v_m: float
    #: One standard deviation of either [m].
    sigma_m: float
    #: Where that is in the frame, right of the middle of its first pixel [px].
    x_px: float
    #: Below it [px].
    y_px: float
    #: Row of the standard's centre, as its (A.4) has it but counted from 0; `y_px` of the robust method.
    row: float
    #: Its column.
    column: float
    #: Gray value from which on a pixel belongs to the spot.
    threshold: int | None
    #: Pixels of the spot.
    area_px: int | None
    #: Side of the standard's window [px].
    window_px: int | None
    #: What else is to be known, such as "cut" or "corner_hidden".
    flags: tuple[str, ...]
    #: Why the target was not found, or the file is no picture.
    reason: str
    #: The file, or what the frame was called.
    file: str
    #: Corners of the target as (x, y), from the upper left clockwise, shape (4, 2) [px]; NaN where it was not found.
    corners_px: NDArray[np.float64]
    #: Covariance of the centre on the target, shape (2, 2) [m²].
    covariance_m2: NDArray[np.float64]


class Spots:
    """Spots of n frames in columns, in their order.

    Made by ``find_spots``. ``spots[k]`` is the `Spot` of a frame; ``calibrate`` and ``accuracy`` take the whole.
    """

    def __init__(self, found: dict[str, Any]) -> None:
        """Of what the native part found; not for users."""
        self._table_columns: list[Column] = found["table"]
        self._columns = {name: cells for name, _, cells in self._table_columns}
        self._corners_px: NDArray[np.float64] = found["corners_px"]
        self._covariance_m2: NDArray[np.float64] = found["covariance_m2"]
        self._warnings: list[str] = found.get("warnings", [])

    def __len__(self) -> int:
        return len(self._columns["file"])

    def __repr__(self) -> str:
        ok = self.status.count("ok")
        return f"<Spots of {len(self)} frames: {ok} ok, {len(self) - ok} not>"

    def __getitem__(self, frame: int) -> Spot:
        cells = self._columns

        def number(name: str) -> float:
            return float(cells[name][frame])

        def whole(name: str) -> int | None:
            number = int(cells[name][frame])
            return None if number == ABSENT else number

        return Spot(
            status=cells["status"][frame],
            u_m=number("u_m"),
            v_m=number("v_m"),
            sigma_m=number("sigma_m"),
            x_px=number("x_px"),
            y_px=number("y_px"),
            row=number("row"),
            column=number("column"),
            threshold=whole("threshold"),
            area_px=whole("area_px"),
            window_px=whole("window_px"),
            flags=tuple(cells["flags"][frame].split()),
            reason=cells["reason"][frame],
            file=cells["file"][frame],
            corners_px=self._corners_px[frame].copy(),
            covariance_m2=self._covariance_m2[frame].copy(),
        )

    def __iter__(self) -> Iterator[Spot]:
        return (self[frame] for frame in range(len(self)))

    @property
    def file(self) -> list[str]:
        """File of each frame, or what it was called."""
        return list(self._columns["file"])

    @property
    def status(self) -> list[str]:
        """Word for what became of each frame; see ``Spot``."""
        return list(self._columns["status"])

    @property
    def reason(self) -> list[str]:
        """Why a target was not found or a file is no picture; empty for all others."""
        return list(self._columns["reason"])

    @property
    def flags(self) -> list[tuple[str, ...]]:
        """What else is to be known of each frame, in words."""
        return [tuple(words.split()) for words in self._columns["flags"]]

    @property
    def time(self) -> NDArray[np.datetime64] | None:
        """When each frame was taken, UTC; None where no times were given."""
        times = self._columns.get("time")
        return None if times is None else times.view("datetime64[ns]").copy()

    @property
    def u_m(self) -> NDArray[np.float64]:
        """Centres on the target, right of its centre as the camera sees it [m], shape (n,)."""
        return np.array(self._columns["u_m"])

    @property
    def v_m(self) -> NDArray[np.float64]:
        """Centres on the target, below its centre [m]."""
        return np.array(self._columns["v_m"])

    @property
    def sigma_m(self) -> NDArray[np.float64]:
        """One standard deviation of either [m]."""
        return np.array(self._columns["sigma_m"])

    @property
    def x_px(self) -> NDArray[np.float64]:
        """Where the centres are in the frames, right of the middle of the first pixel [px]."""
        return np.array(self._columns["x_px"])

    @property
    def y_px(self) -> NDArray[np.float64]:
        """Below it [px]."""
        return np.array(self._columns["y_px"])

    @property
    def corners_px(self) -> NDArray[np.float64]:
        """Corners of the target in each frame as (x, y), from the upper left clockwise, shape (n, 4, 2) [px]."""
        return self._corners_px.copy()

    @property
    def covariance_m2(self) -> NDArray[np.float64]:
        """Covariance of each centre on the target, shape (n, 2, 2) [m²]."""
        return self._covariance_m2.copy()

    @property
    def warnings(self) -> list[str]:
        """Things worth saying about the frames that stop nothing: files named twice, numbers that are left out."""
        return list(self._warnings)

    def to_table(self, kind: str = "dict") -> Any:
        """The table that ``helio-rs spot`` writes, as "dict" (of arrays), "pandas", "polars" or "pyarrow"."""
        return given_back(self._table_columns, checked_kind(kind))

    def write(self, path: str | PathLike[str]) -> None:
        """Writes that table; .csv, .parquet, .json or .jsonl."""
        _write_table(path, self._table_columns)


def _picture(image: Any, what: str) -> NDArray[Any]:
    """Gray values or colours of 8 or 16 bit, contiguous and in the machine's order of bytes."""
    array = checked_array(what, image)
    if array.dtype.kind != "u" or array.dtype.itemsize > 2:
        error = DataTypeError(f"{what}: expected gray values of uint8 or uint16, got dtype {array.dtype}")
        error.field = what
        raise error
    if not (array.ndim == 2 or (array.ndim == 3 and array.shape[2] == 3)) or not array.size:
        shape = ShapeError(f"{what}: expected shape (rows, columns) or (rows, columns, 3), got {array.shape}")
        shape.field = what
        raise shape
    return np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))


def _frames(images: Any) -> tuple[list[Any], list[str], list[str]]:
    """Paths and arrays, what they are called, and what is to be said of them."""
    if isinstance(images, (str, os.PathLike)):
        images = [images]
    if isinstance(images, np.ndarray) and images.ndim not in (3, 4):
        raise of(
            ShapeError(
                f"images: expected shape (frames, rows, columns) or (frames, rows, columns, 3), got {images.shape};"
                " find_spot takes a single frame"
            ),
            "images",
        )
    if isinstance(images, (bytes, Mapping)) or not isinstance(images, (np.ndarray, Iterable)):
        error = DataTypeError(f"images: expected paths or arrays, got {type(images).__name__}")
        error.field = "images"
        raise error
    frames = several("images", images, "paths or arrays")
    if frames and all(isinstance(frame, (str, os.PathLike)) for frame in frames):
        found, warning = _frame_files([path("images", frame) for frame in frames])
        return list(found), [os.fspath(path) for path in found], [] if warning is None else [warning]
    names = []
    for k, frame in enumerate(frames):
        if isinstance(frame, (str, os.PathLike)):
            names.append(path("images", frame))
        else:
            frames[k] = _picture(frame, f"images: frame {k}")
            names.append(f"frame {k}")
    return frames, names, []


def _expected(expected: Any) -> tuple[float, float, float | None] | None:
    if expected is None:
        return None
    numbers = [number("expected", one) for one in several("expected", expected, "u_m, v_m and perhaps sigma_m")]
    if len(numbers) not in (2, 3) or (len(numbers) == 3 and numbers[2] <= 0):
        raise wrong_value("expected", f"wanted u_m, v_m and perhaps a sigma_m above 0, got {numbers}")
    return numbers[0], numbers[1], numbers[2] if len(numbers) == 3 else None


def _asked(
    target: Any, method: str, threshold: str | None, expected: Any, white: int | None, overlay: Any = None
) -> dict[str, Any]:
    file, toml = path_and_text(target, "target", "target.toml")
    return {
        "path": file,
        "text": toml,
        "method": text("method", method),
        "threshold": None if threshold is None else text("threshold", threshold),
        "expected": _expected(expected),
        "white": None if white is None else whole("white", white, 1, 65_535),
        "overlay": None if overlay is None else path("overlay", overlay),
    }


def find_spot(
    image: ArrayLike | str | PathLike[str],
    target: _Target,
    *,
    method: str = "robust",
    threshold: str | None = None,
    expected: Sequence[float] | None = None,
    white: int | None = None,
) -> Spot:
    """Where the spot of a camera's frame is on the target.

    Parameters
    ----------
    image : array of shape (rows, columns) or (rows, columns, 3), or path
        Gray values or red, green and blue, uint8 or uint16; read where it lies if it is contiguous. Colours become gray
        as those of files do (BT.601). Or the path of a PNG, TIFF, PNM or JPEG.
    target : path or mapping
        A target.toml, or a mapping of its keys: `width_m`, `height_m` and, of a fixed camera, `corners_px` (upper left,
        upper right, lower right, lower left, as x, y); without these, `marks` are looked for.
    method : str, default "robust"
        Centre of mass of the light that the spot adds to the target; or "standard", appendix A of T/GRLM 02-2014.
    threshold : str, optional
        Of the standard: "otsu" (default), "triangle", "fixed:N" (a gray value) or "multi:N" (the brightest of N classes).
    expected : (u_m, v_m) or (u_m, v_m, sigma_m), optional
        Where the robust method may expect the spot [m]; ranks several spots of a frame.
    white : int, optional
        Gray value from which on the camera cannot tell more; 255 or 65535 unless given.

    Returns
    -------
    Spot
        A frame without target or spot is no error: its `status` says so, as of a file that is no picture. One that is not
        there, or cannot be read, is a FileError.

    Raises
    ------
    DataTypeError, ShapeError, OptionError, FileError, ImageError

    Notes
    -----
    The numbers of ``helio-rs spot`` to the last bit.

    Examples
    --------
    >>> import helio_py as hp
    >>> import numpy as np
    >>> y, x = np.mgrid[:120, :160]
    >>> gray = 60 + 120 * np.exp(-((x - 90) ** 2 + (y - 50) ** 2) / (2 * 8**2))
    >>> target = {"width_m": 8, "height_m": 6, "corners_px": [[0, 0], [159, 0], [159, 119], [0, 119]]}
    >>> spot = hp.find_spot(gray.round().astype(np.uint8), target)
    >>> spot.status, round(spot.x_px, 1), round(spot.y_px, 1)
    ('ok', 90.0, 50.0)
    """
    asked = _asked(target, method, threshold, expected, white)
    if isinstance(image, (str, os.PathLike)):
        file = path("image", image)
        return Spots(_find_spots([file], [file], None, asked, [], True, None))[0]
    return Spots(_find_spots([_picture(image, "image")], ["frame 0"], None, asked, [], True, None))[0]


def find_spots(
    images: Any,
    target: _Target,
    *,
    method: str = "robust",
    threshold: str | None = None,
    expected: Sequence[float] | None = None,
    white: int | None = None,
    times: Any | None = None,
    names: Sequence[str] | None = None,
    raw: str | None = None,
    start: Any | None = None,
    fps: float | None = None,
    numbered: bool = False,
    overlay: str | PathLike[str] | None = None,
    progress: Callable[[int, int], Any] | bool | None = None,
) -> Spots:
    """Where the spot of each of many frames is on the target.

    Parameters
    ----------
    images : sequence of arrays or paths, array, or path
        Frames as ``find_spot`` takes them; an array of shape (n, rows, columns) or (n, rows, columns, 3); or what
        ``helio-rs spot`` takes: files, folders, patterns such as "run/*.png", "@LIST". A file that is no picture or not
        there keeps its place as "unreadable"; one that is named twice is taken once. With `raw` a path, bytes (whatever has a buffer of them, such as mmap), or
        a file opened for bytes, such as the standard output of ffmpeg.
    target, method, threshold, expected, white
        As for ``find_spot``.
    times : array of shape (n,), optional
        When each frame was taken, with zone; ``accuracy`` wants them.
    names : sequence of str, optional
        What frames are called in place of their path or "frame k"; ``calibrate`` joins observations by them.
    raw : str, optional
        Raw gray video, its frames "WIDTHxHEIGHT" of 8 bit or "WIDTHxHEIGHT:gray16le", as ffmpeg's ``-f rawvideo
        -pix_fmt gray`` writes it.
    start, fps : time and float, optional
        When the first frame was taken and how many a second, in place of `times`: each frame, read or not, by its place.
    numbered : bool, default False
        Times by the numbers in what frames are called instead (the last digits before the suffix; the first frame is at
        `start`), so that frames which are missing shift none.
    overlay : path, optional
        Folder for a picture of each frame with marks, threshold, window and centre drawn in; made if it does not exist.
        Pictures of an earlier run are replaced, files of others refused. ``plot.spot_overlay`` draws for matplotlib.
    progress : callable or True, optional
        Called with the numbers of frames done and of all (of a stream of those read so far); True for a bar of tqdm.

    Returns
    -------
    Spots

    Raises
    ------
    DataTypeError, ShapeError, OptionError, TimeError, FileError, ImageError

    Notes
    -----
    The numbers of ``helio-rs spot`` to the last bit, whatever the number of threads (``RAYON_NUM_THREADS``). Ctrl-C ends
    it after the frames at hand.

    Examples
    --------
    >>> import helio_py as hp
    >>> import numpy as np
    >>> y, x = np.mgrid[:120, :160]
    >>> frames = [60 + 120 * np.exp(-((x - at) ** 2 + (y - 50) ** 2) / (2 * 8**2)) for at in (80, 90)]
    >>> target = {"width_m": 8, "height_m": 6, "corners_px": [[0, 0], [159, 0], [159, 119], [0, 119]]}
    >>> spots = hp.find_spots(np.round(frames).astype(np.uint8), target)
    >>> spots
    <Spots of 2 frames: 2 ok, 0 not>
    >>> (spots.u_m[1] - spots.u_m[0]).round(2)
    np.float64(0.5)
    """
    asked = _asked(target, method, threshold, expected, white, overlay)
    taken = clock(start, fps, numbered, times)
    if raw is not None:
        return _of_video(images, text("raw", raw), taken, asked, progress, names=names, times=times, numbered=numbered)
    frames, called, warnings = _frames(images)
    of_files = all(isinstance(frame, os.PathLike) for frame in frames)
    if names is not None:
        called = texts("names", names)
        if len(called) != len(frames):
            raise of(ShapeError(f"names: expected shape ({len(frames)},), got ({len(called)},)"), "names")
    known = called if of_files or names is not None else []
    stamps, more = times_of(len(frames), known, taken, numbered, times)
    # A frame of an array that nobody named has a picture by its place, as one of a video.
    pictures = called if known or not all(isinstance(frame, np.ndarray) for frame in frames) else []
    with reporter(progress, "frames") as report:
        found = _find_spots(frames, called, stamps, asked, pictures, False, report)
    return Spots(found | {"warnings": warnings + more})


def _of_video(
    images: Any,
    raw: str,
    taken: tuple[int, float] | None,
    asked: dict[str, Any],
    progress: Callable[[int, int], Any] | bool | None,
    **given: Any,
) -> Spots:
    for name, why in _NOT_OF_VIDEO.items():
        if given[name] is not None and given[name] is not False:
            raise wrong_value(name, f"with raw: {why}")
    with reporter(progress, "frames") as report:
        return Spots(_find_raw_spots(video(images), raw, taken, asked, report))


_NOT_OF_VIDEO = {
    "names": "frames of a video have none but their places",
    "times": "nobody knows before how many frames there are; wanted start and fps",
    "numbered": "frames of raw video come one after another",
}
