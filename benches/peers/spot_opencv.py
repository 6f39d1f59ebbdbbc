"""The method of T/GRLM 02-2014 by OpenCV: threshold by Otsu, area, window sums, arg max.

``spot_opencv.py --variant box|box32|integral [--decode] [--repeat R] FRAME...``

``box`` sums windows with boxFilter, in integers where the sums fit, and finds the maximum with minMaxLoc; ``box32`` the
same in single precision; ``integral`` takes differences of an integral image. The window has as many pixels as
helio-rs': all printed cases pad with zeros. One thread. With ``--decode`` the time begins with reading the PNG file.
Prints a line of JSON for each frame: milliseconds, and the threshold, area and greatest window sum found.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

Gray = NDArray[np.uint8]


class Spot(NamedTuple):
    """Threshold as (A.1) has it, kept pixels, greatest window sum and the first window's upper left pixel."""

    threshold: int
    area_px: int
    window_px: int
    window_sum: int
    row: int
    column: int


def window_of(area_px: int, shorter: int) -> int:
    """Pixels of a side of the window of (A.3)."""
    squared = area_px if area_px < shorter * shorter else (shorter - 1) ** 2
    after = math.isqrt(squared // 4)
    return 2 * after + (1 if 4 * after * after == squared else 2)


class Peer:
    """Keeps its pictures from call to call, as helio-rs keeps its scratch memory."""

    def __init__(self, variant: str) -> None:
        self.variant = variant
        self.kept: Gray | None = None
        self.sums: NDArray[Any] | None = None
        self.rows: NDArray[Any] | None = None

    def find(self, gray: Gray) -> Spot:
        threshold, kept = cv2.threshold(gray, 0, 0, cv2.THRESH_TOZERO | cv2.THRESH_OTSU, dst=self.kept)
        self.kept = kept
        area_px = cv2.countNonZero(kept)
        n = window_of(area_px, min(gray.shape))
        if self.variant == "integral":
            corners = self.sums = cv2.integral(kept, sum=self.sums, sdepth=cv2.CV_32S)
            self.rows = cv2.subtract(corners[n:], corners[:-n], dst=self.rows)
            inside = cv2.subtract(self.rows[:, n:], self.rows[:, :-n])
        else:
            depth = cv2.CV_32S if self.variant == "box" else cv2.CV_32F
            border = cv2.BORDER_CONSTANT
            self.sums = cv2.boxFilter(kept, depth, (n, n), dst=self.sums, normalize=False, borderType=border)
            # The windows that lie inside: all of the printed ones but those that reach row or column 0.
            before, after = n // 2, (n - 1) // 2
            inside = self.sums[before : gray.shape[0] - after, before : gray.shape[1] - after]
        _, greatest, _, at = cv2.minMaxLoc(inside)
        return Spot(int(threshold) + 1, area_px, n, int(greatest), at[1], at[0])


def read(path: Path) -> Gray:
    gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if gray is None:
        raise SystemExit(f"{path}: cannot be read")
    return np.asarray(gray, np.uint8)


def milliseconds(work: Callable[[], object], repeat: int) -> dict[str, float]:
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - begin))
    times.sort()
    return {"minimum": times[0], "median": times[len(times) // 2]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--variant", choices=("box", "box32", "integral"), default="box")
    parser.add_argument("--decode", action="store_true")
    parser.add_argument("--repeat", type=int, default=100)
    parser.add_argument("frames", type=Path, nargs="+", metavar="FRAME")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    for path in arguments.frames:
        gray = read(path)
        find = Peer(arguments.variant).find
        spot = find(gray)
        work = partial(find, gray)
        if arguments.decode:
            work = partial(lambda find, path: find(read(path)), find, path)
        line = {
            "peer": f"opencv_{arguments.variant}",
            "version": cv2.__version__,
            "frame": path.name,
            "decode": arguments.decode,
            "ms_per_frame": milliseconds(work, arguments.repeat),
            **spot._asdict(),
        }
        print(json.dumps(line))


if __name__ == "__main__":
    main()
