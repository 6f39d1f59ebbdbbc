"""A day of 12,000 heliostats every ten seconds by helio-py, in bounded memory; prints a line of JSON."""

from __future__ import annotations

import argparse
import json
import resource
import time

import helio_py as hp
import numpy as np

HELIOSTATS, SUNS_PER_CALL = 12_000, 6
SEVILLE = {"latitude_deg": 37.4, "longitude_deg": -6.25, "elevation_m": 20.0}


def field() -> hp.Field:
    """Rings around a tower."""
    rng = np.random.default_rng(12)
    radius_m = 100 + 900 * np.sqrt(rng.random(HELIOSTATS))
    turn_rad = 2 * np.pi * rng.random(HELIOSTATS)
    position_m = np.c_[radius_m * np.sin(turn_rad), radius_m * np.cos(turn_rad), np.full(HELIOSTATS, 5.0)]
    tilt_rad = rng.normal(0, 1e-3, (2, HELIOSTATS))
    return hp.Field(
        position_m, [0, 0, 180], mirror_offset_m=0.3, pedestal_tilt_rad=tilt_rad[0], mirror_tilt_rad=tilt_rad[1]
    )


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    heliostats = field()
    times = np.arange("2026-06-21T00:00:00", "2026-06-22T00:00:00", 10, dtype="datetime64[s]")
    start = time.perf_counter()
    sun = hp.sun_position(times, **SEVILLE)
    tracked = np.zeros(HELIOSTATS, np.int64)
    out: hp.Tracking | None = None
    for first in range(0, len(times), SUNS_PER_CALL):
        some = slice(first, first + SUNS_PER_CALL)
        out = hp.track(heliostats, sun.azimuth_rad[some], sun.elevation_rad[some], out=out)
        tracked += np.count_nonzero(out.status == hp.Status.OK, axis=0)
    seconds = time.perf_counter() - start
    rows, ok = len(times) * HELIOSTATS, int(tracked.sum())
    memory_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(json.dumps({"peer": "helio_py day", "rows": rows, "ok": ok, "seconds": seconds, "memory_mib": memory_mib}))


if __name__ == "__main__":
    main()
