"""``simulate_images``: synthetic camera frames of a target, with their truth."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

from helio_py._checked import flag, number, of, path, several, text, whole, wrong_value
from helio_py._errors import ShapeError
from helio_py._native import _simulate_images
from helio_py._progress import reporter
from helio_py._tables import Column, checked_kind, given_back

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray


class SimulatedImages:
    """Simulated camera frames: where they are, what is true of them, and the target that they show.

    Made by ``simulate_images``.
    """

    def __init__(self, made: dict[str, Any], folder: Path | None) -> None:
        """Of what the native part made; not for users."""
        self._truth: list[Column] = made["truth"]
        self._log: list[Column] = made["log"]
        self._names: list[str] = made["names"]
        self._frames: NDArray[np.uint8] | NDArray[np.uint16] | None = made["frames"]
        self._target: dict[str, Any] = made["target"]
        self._folder = folder

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        size = f"{self._target['frame_width_px']}x{self._target['frame_height_px']}"
        where = "in memory" if self._folder is None else f"in {os.fspath(self._folder)}"
        return f"<{len(self)} simulated frame{'' if len(self) == 1 else 's'} of {size} pixels {where}>"

    @property
    def frames(self) -> NDArray[np.uint8] | NDArray[np.uint16] | None:
        """Gray values of shape (n, rows, columns), uint8 or uint16 by `bits`; None where they were written to a folder."""
        return self._frames

    @property
    def names(self) -> list[str]:
        """What the frames are called in the tables: "000001.png" and so on."""
        return list(self._names)

    @property
    def folder(self) -> Path | None:
        """The folder; None without one."""
        return self._folder

    @property
    def files(self) -> list[Path]:
        """Files of the frames; none without a folder."""
        return [] if self._folder is None else [self._folder / name for name in self._names]

    @property
    def target(self) -> dict[str, Any]:
        """The keys of the frames' target.toml, as ``find_spots`` takes them."""
        import copy  # not at import, which is to be quick

        return copy.deepcopy(self._target)

    @property
    def truth(self) -> dict[str, Any]:
        """Where the spots truly are: columns `file`; `u_m, v_m`, centre of mass of the whole beam [m], right and down of the
        target's centre; `x_px, y_px`, where that is in the frame; `share_on_target` of its light; `on_target_u_m,
        on_target_v_m`, centre of mass of the light that falls on the target [m]. NaN in frames without a beam."""
        return self.to_table()

    @property
    def log(self) -> dict[str, Any] | None:
        """The observations given, with the names of the frames in place of the spots: what ``calibrate`` takes beside
        `spots`. None without them."""
        return self.to_table(of="log") if self._log else None

    def to_table(self, kind: str = "dict", *, of: str = "truth") -> Any:
        """The truth, or with ``of="log"`` that log, as "dict" (of arrays), "pandas", "polars" or "pyarrow"."""
        if not isinstance(of, str) or of not in ("truth", "log"):
            raise wrong_value("of", f"wanted truth or log, got `{of}`")
        if of == "log" and not self._log:
            raise wrong_value("of", "there is no log: the frames are of no observations")
        return given_back(self._log if of == "log" else self._truth, checked_kind(kind))


def simulate_images(
    out: str | os.PathLike[str] | None = None,
    *,
    frames: int | None = None,
    observations: Any | None = None,
    seed: int = 1,
    size: Sequence[int] = (768, 576),
    bits: int = 8,
    width_m: float = 8.0,
    height_m: float = 7.0,
    marks: str = "four-corners",
    shape: str = "gaussian",
    beam_m: float = 0.6,
    peak: float = 0.35,
    daylight: float = 0.5,
    gradient: float = 0.0,
    shadow: float = 0.0,
    texture: float = 0.01,
    noise: float = 0.005,
    turn_deg: float = 0.0,
    tilt_deg: float = 0.0,
    roll_deg: float = 0.0,
    distortion: float = 0.0,
    second: float = 0.0,
    stray: float = 0.0,
    empty_every: int | None = None,
    find_marks: bool = False,
    progress: Callable[[int, int], Any] | bool | None = None,
) -> SimulatedImages:
    """Synthetic camera frames of a target with a spot on it, and where the spot truly is.

    Places are drawn at random over the middle of the target. The same arguments give the same frames as ``helio-rs simulate
    images``, to the last bit; in a folder the same files, byte for byte.

    Parameters
    ----------
    out : path, optional
        Folder for 000001.png, …, truth.csv, target.toml and, of observations, log.csv; made if it does not exist. What an
        earlier call wrote there is replaced; a folder with files that no such call wrote, or that were changed since, is
        refused. Without it the frames stay in memory, at most 4 GiB of them.
    frames : int, optional
        How many, from 1 to 1,000,000; by default 10.
    observations : table, optional
        Observations whose spots are to be seen, a frame each: pandas, polars, pyarrow, a dict of columns, what
        ``simulate_observations`` gives, or the path of a CSV file.
    seed : int, default 1
        Of all random numbers.
    size : (width, height), default (768, 576)
        Pixels in a row, and rows.
    bits : int, default 8
        Of a gray value; or 16.
    width_m, height_m : float, default 8 and 7
        Of the target [m].
    marks : str, default "four-corners"
        Marks of the target; or "two-panel-upper", "two-panel-lower".
    shape : str, default "gaussian"
        Of the beam; or "ellipse" (twice as long as wide, slanting), "flat-top", "facets" (sixteen images that do not quite
        meet).
    beam_m : float, default 0.6
        Standard deviation of the beam, or radius of a flat top [m].
    peak : float, default 0.35
        What the beam's brightest place adds [parts of white].
    daylight : float, default 0.5
        On the target [parts of white].
    gradient : float, default 0
        Relative change of the daylight over the width of the target.
    shadow : float, default 0
        Share of the daylight that a shadow with a slanting edge takes.
    texture : float, default 0.01
        Relative depth of the fabric's folds.
    noise : float, default 0.005
        Standard deviation of the noise of a pixel [parts of white].
    turn_deg, tilt_deg : float, default 0
        How far the camera stands to the left and below, as angles at the target [deg].
    roll_deg : float, default 0
        How far the picture is turned clockwise [deg].
    distortion : float, default 0
        Radial distortion k1 of the lens, whose focal length is the picture's width.
    second : float, default 0
        A second beam, with so much of the light of the first.
    stray : float, default 0
        Stray light beyond the right edge [parts of white at its brightest].
    empty_every : int, optional
        Every so many-th frame has no beam.
    find_marks : bool, default False
        Leave the corners out of the target, so that marks are looked for.
    progress : callable or True, optional
        Called with the numbers of frames done and of all; True for a bar of tqdm.

    Returns
    -------
    SimulatedImages

    Raises
    ------
    OptionError, DataTypeError, ShapeError, ConflictError, FileError

    Notes
    -----
    Ctrl-C ends it. Of a folder there are then some frames, but nothing that tells of them.

    Examples
    --------
    >>> import helio_py as hp
    >>> import numpy as np
    >>> images = hp.simulate_images(frames=3, size=(160, 120), seed=7)
    >>> images.frames.shape, images.frames.dtype
    ((3, 120, 160), dtype('uint8'))
    >>> spots = hp.find_spots(images.frames, images.target, names=images.names)
    >>> bool(np.hypot(spots.u_m - images.truth["u_m"], spots.v_m - images.truth["v_m"]).max() < 0.02)
    True
    """
    if observations is not None:
        for name, given in (("frames", frames), ("empty_every", empty_every)):
            if given is not None:
                raise wrong_value(name, "it stands beside observations, which have a frame each; wanted one")
    asked: dict[str, Any] = {
        "frames": 10 if frames is None else whole("frames", frames, 1, 1_000_000),
        "seed": whole("seed", seed, 0, 2**64 - 1),
        "size": _size(size),
        "bits": _bits(bits),
        "width_m": number("width_m", width_m, 0.01, 10_000.0, "metres"),
        "height_m": number("height_m", height_m, 0.01, 10_000.0, "metres"),
        "marks": text("marks", marks),
        "shape": text("shape", shape),
        "beam_m": number("beam_m", beam_m, 0.01, 10_000.0, "metres"),
        "empty_every": None if empty_every is None else whole("empty_every", empty_every, 1, 2**32 - 1),
        "find_marks": flag("find_marks", find_marks),
    }
    for name, value in (("peak", peak), ("daylight", daylight), ("second", second), ("stray", stray)):
        asked[name] = number(name, value, 0.0, 1e3, "parts of white")
    for name, value in (("gradient", gradient), ("shadow", shadow), ("texture", texture), ("noise", noise)):
        asked[name] = number(name, value, 0.0, 1.0, "parts of one")
    for name, value in (("turn_deg", turn_deg), ("tilt_deg", tilt_deg), ("roll_deg", roll_deg)):
        asked[name] = number(name, value, -60.0, 60.0, "degrees")
    asked["distortion"] = number("distortion", distortion, -0.5, 0.5, "")
    folder = None
    if out is not None:
        from pathlib import Path  # not at import, which is to be quick

        folder = Path(path("out", out))
    with reporter(progress, "frames") as report:
        return SimulatedImages(_simulate_images(observations, asked, folder, report), folder)


def _size(size: Any) -> list[int]:
    sides = several("size", size, "width and height in pixels")
    if len(sides) != 2:
        raise of(ShapeError(f"size: expected shape (2,), got ({len(sides)},)"), "size")
    return [whole("size", side, 1, 65_535) for side in sides]


def _bits(bits: Any) -> int:
    found = whole("bits", bits, 8, 16)
    if found not in (8, 16):
        raise wrong_value("bits", f"wanted 8 or 16, got {found}")
    return found
