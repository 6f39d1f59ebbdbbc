"""Peer: numba, rays of one flat facet onto a plane, a random ray at a time.

A mirror of 7 m by 6 m in the origin faces the sun in the zenith; a screen of 15 m by 15 m faces it from
100 m above, with 64 by 64 bins. The sun is a disc of 4.65 mrad half angle. ``--fastmath`` allows what C calls
-ffast-math.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

BINS, WIDTH_M, DISTANCE_M, HALF_ANGLE_RAD = 64, 15.0, 100.0, 4.65e-3


# numba's own generator is its fastest: a Generator passed in takes a fifth longer.
# ruff: noqa: NPY002


def kernel(rays: int, seed: int, bins: int, counts: NDArray[np.int64]) -> None:
    np.random.seed(seed)
    sin_squared = math.sin(HALF_ANGLE_RAD) ** 2
    per_m = bins / WIDTH_M
    for _ in range(rays):
        x = 7.0 * (np.random.random() - 0.5)
        y = 6.0 * (np.random.random() - 0.5)
        sine = math.sqrt(np.random.random() * sin_squared)
        angle = 2.0 * math.pi * np.random.random()
        dx, dy = sine * math.cos(angle), sine * math.sin(angle)
        dz = math.sqrt(1.0 - sine * sine)
        # the sun's ray (-dx, -dy, -dz), mirrored in the normal (0, 0, 1)
        way = DISTANCE_M / dz
        column = math.floor((x - dx * way + 0.5 * WIDTH_M) * per_m)
        row = math.floor((y - dy * way + 0.5 * WIDTH_M) * per_m)
        if 0 <= column < bins and 0 <= row < bins:
            counts[row, column] += 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rays", type=int, default=500_000)
    parser.add_argument("--repeat", type=int, default=40)
    parser.add_argument("--fastmath", action="store_true")
    arguments = parser.parse_args()
    trace: Any = numba.njit(kernel, fastmath=arguments.fastmath)
    counts = np.zeros((BINS, BINS), np.int64)
    trace(1000, 0, BINS, counts)
    seconds = []
    counts[:] = 0
    for number in range(arguments.repeat):
        begin = time.perf_counter()
        trace(arguments.rays, number, BINS, counts)
        seconds.append(time.perf_counter() - begin)
    rays = arguments.rays * arguments.repeat
    line = {
        "peer": "numba_fastmath" if arguments.fastmath else "numba",
        "version": numba.__version__,
        "threads": 1,
        "mrays_per_s": arguments.rays / min(seconds) / 1e6,
        "middle": float(counts[24:40, 24:40].mean()) / rays,
        "received": int(counts.sum()) / rays,
    }
    print(json.dumps(line))


if __name__ == "__main__":
    main()
