"""Peer: sun positions by pvlib's SPA, with NumPy or (``--numba``) compiled.

The same instants, site and air as ``src/bin/sun.rs``. Answer file: azimuth, apparent and geometric
elevation [rad] as float64 columns.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

import numpy as np

import common

FROM_UNIX_S = 1_767_225_600
STEP_S = 10
LATITUDE_RAD, LONGITUDE_RAD, ELEVATION_M = 0.888_607, 0.111_488, 87.0
PRESSURE_HPA, TEMPERATURE_C, DELTA_T_S = 1003.0, 12.0, 69.2
REFRACTION_AT_HORIZON_DEG = 0.5667


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--numba", action="store_true")
    parser.add_argument("--n", type=int, default=100_000)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--output", type=Path, metavar="ANSWERS.bin")
    arguments = parser.parse_args()
    # pvlib reads this when it is imported
    os.environ["PVLIB_USE_NUMBA"] = "1" if arguments.numba else "0"
    import pvlib

    unix_s = FROM_UNIX_S + STEP_S * np.arange(arguments.n, dtype=np.float64)

    def positions() -> list[common.Floats]:
        answer: list[common.Floats] = pvlib.spa.solar_position(
            unix_s,
            float(np.degrees(LATITUDE_RAD)),
            float(np.degrees(LONGITUDE_RAD)),
            ELEVATION_M,
            PRESSURE_HPA,
            TEMPERATURE_C,
            DELTA_T_S,
            REFRACTION_AT_HORIZON_DEG,
            numthreads=arguments.threads,
        )
        return answer

    if arguments.output is not None:
        _, _, apparent, geometric, azimuth, *_ = positions()
        with arguments.output.open("wb") as file:
            for column in (azimuth, apparent, geometric):
                file.write(np.radians(column).astype("<f8").tobytes())
    minimum, median = common.time_call(positions, arguments.repeat)
    line = {
        "peer": "pvlib_numba" if arguments.numba else "pvlib_numpy",
        "version": pvlib.__version__,
        "n": arguments.n,
        "threads": arguments.threads,
        "ns_per_instant": {"minimum": minimum / arguments.n * 1e9, "median": median / arguments.n * 1e9},
    }
    print(json.dumps(line))


if __name__ == "__main__":
    main()
