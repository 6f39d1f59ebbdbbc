"""The calibration of some heliostats by scipy.optimize.least_squares, one after the other.

``scipy_calibration.py --input CAMPAIGNS [--method lm|trf] [--heliostats N] [--repeat R] [--output ANSWERS]``

The same residuals and the same start as helio-rs, in NumPy over all observations of a heliostat; everything else
is SciPy's default: derivatives by two-point differences, its own tolerances. Reading, sines and cosines of the
encoder angles and the start are not timed.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.optimize import least_squares

Floats = NDArray[np.float64]
COLUMNS = 17


class Heliostat(NamedTuple):
    """Along the mount's axes; one row per observation."""

    offset_m: float
    start: Floats
    sun: Floats
    axis1: Floats
    axis2: Floats
    plane: Floats
    centre_m: Floats
    spot_m: Floats


def read(path: Path, most: int) -> list[Heliostat]:
    raw = path.read_bytes()
    count, observations = np.frombuffer(raw, "<u8", 2)
    table = np.frombuffer(raw, "<f8", offset=16).reshape(int(count), 3 + COLUMNS * int(observations))
    heliostats = []
    for row in table[:most]:
        rows = row[3:].reshape(-1, COLUMNS)
        start = np.array([0.0, 0.0, row[1], 0.0, row[2], 0.0])
        turned = [np.stack([np.cos(rows[:, k]), np.sin(rows[:, k])]) for k in (3, 4)]
        plane = rows[:, 5:14].reshape(-1, 3, 3)
        heliostats.append(
            Heliostat(float(row[0]), start, rows[:, :3], turned[0], turned[1], plane, rows[:, 14], rows[:, 15:])
        )
    return heliostats


def residuals(x: Floats, h: Heliostat) -> Floats:
    a, b, gamma0, tau1, alpha0, mu = x
    square = a * a + b * b
    psi = np.sqrt(square)
    k = np.sinc(psi / np.pi)
    half = np.sinc(psi / (2 * np.pi))
    f = 0.5 * half * half
    tilt = np.array(
        [[1 - f * a * a, -f * a * b, -k * a], [-f * a * b, 1 - f * b * b, -k * b], [k * a, k * b, 1 - f * square]]
    )
    cos_gamma = h.axis1[0] * np.cos(gamma0) + h.axis1[1] * np.sin(gamma0)
    sin_gamma = h.axis1[1] * np.cos(gamma0) - h.axis1[0] * np.sin(gamma0)
    cos_alpha = h.axis2[0] * np.cos(alpha0) + h.axis2[1] * np.sin(alpha0)
    sin_alpha = h.axis2[1] * np.cos(alpha0) - h.axis2[0] * np.sin(alpha0)
    d0 = np.cos(mu) * cos_alpha
    d1 = np.cos(tau1) * np.sin(mu) - np.sin(tau1) * np.cos(mu) * sin_alpha
    d2 = np.sin(tau1) * np.sin(mu) + np.cos(tau1) * np.cos(mu) * sin_alpha
    normal = np.stack([cos_gamma * d0 - sin_gamma * d1, sin_gamma * d0 + cos_gamma * d1, d2], axis=1) @ tilt
    beam = 2 * np.sum(h.sun * normal, axis=1)[:, None] * normal - h.sun
    facing = np.sum(h.plane[:, 2] * beam, axis=1)
    way = (h.centre_m - h.offset_m * np.sum(h.plane[:, 2] * normal, axis=1)) / facing
    spot = h.offset_m * normal + way[:, None] * beam
    on_plane = np.einsum("ijk,ik->ij", h.plane[:, :2], spot)
    return np.ravel(on_plane - h.spot_m)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--input", type=Path, required=True, metavar="CAMPAIGNS")
    parser.add_argument("--method", choices=("lm", "trf"), default="lm")
    parser.add_argument("--heliostats", type=int, default=24)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--output", type=Path)
    arguments = parser.parse_args()
    heliostats = read(arguments.input, arguments.heliostats)
    seconds = []
    found: list[Any] = []
    for _ in range(arguments.repeat):
        begin = time.perf_counter()
        found = [least_squares(residuals, h.start, method=arguments.method, args=(h,)) for h in heliostats]
        seconds.append(time.perf_counter() - begin)
    if arguments.output is not None:
        rows = [np.append(fit.x, 2 * fit.cost) for fit in found]
        arguments.output.write_bytes(np.array(rows, "<f8").tobytes())
    per_fit = sorted(1e9 * s / len(heliostats) for s in seconds)
    line = {
        "peer": f"scipy_{arguments.method}",
        "version": scipy.__version__,
        "heliostats": len(heliostats),
        "observations": len(heliostats[0].sun),
        "threads": 1,
        "ns_per_fit": {"minimum": per_fit[0], "median": per_fit[len(per_fit) // 2]},
    }
    print(json.dumps(line))


if __name__ == "__main__":
    main()
