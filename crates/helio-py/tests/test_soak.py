"""Eight threads at once, each calling whatever comes: every answer has the bits of one thread alone.

`HELIO_SOAK_S` is how long (3 seconds unless it is set); `HELIO_SOAK_S=60 pytest tests/test_soak.py -s` says what was done.
"""

from __future__ import annotations

import concurrent.futures as futures
import hashlib
import os
import pickle
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import helio_py as hp
from conftest import ROOT, random_field

THREADS = 8
SOAK_S = float(os.environ.get("HELIO_SOAK_S", "3"))

Call = Callable[[], bytes]


def bits(*arrays: Any) -> bytes:
    """What arrays hold, told apart to the last bit."""
    whole = hashlib.sha256()
    for array in arrays:
        whole.update(np.ascontiguousarray(array).tobytes())
    return whole.digest()


def of_tracking(tracking: hp.Tracking) -> bytes:
    return bits(
        tracking.azimuth_rad, tracking.elevation_rad, tracking.incidence_rad, tracking.limit_excess_rad, tracking.status
    )


def calls() -> dict[str, Call]:
    """Of every verb some, small and large: what they work on is shared by all threads."""
    example = hp.Field.from_toml(ROOT / "examples" / "field.toml")
    fields = {n: random_field(n, n) for n in (1, 100, 3_000, 60_000)}
    suns = np.linspace(2.0, 4.0, 37), np.linspace(0.3, 1.1, 37)
    angles = hp.track(fields[3_000], 3.0, 0.8)
    azimuth, elevation = angles.azimuth_rad.copy(), angles.elevation_rad.copy()
    times = np.datetime64("2026-06-21", "s") + 7 * np.arange(12_000)
    seen = hp.simulate_observations(example, ids=["H001", "H120"], count=12, random_errors=True, seed=3).observations
    down, right = np.mgrid[:96, :128]
    gray = 60 + 120 * np.exp(-((right - [[[50]], [[70]], [[61.5]]]) ** 2 + (down - 44) ** 2) / 128)
    frames = gray.round().astype(np.uint8)
    target = {"width_m": 8, "height_m": 6, "corners_px": [[0, 0], [127, 0], [127, 95], [0, 95]]}
    strips = ROOT / "examples" / "flux"
    scene: dict[str, Any] = {
        "sun": {"dni_w_m2": 822, "half_angle_mrad": 4.5379},
        "mirror": {"surface": "MIRROR", "unit": "mm", "reflectivity": 0.87},
        "receiver": {
            "shape": "plane", "centre_m": [0, 0, 1], "facing": [0, 0, -1], "right": [0, 1, 0],
            "width_m": 0.2, "height_m": 0.3, "rows": 30, "columns": 20,
        },
    }  # fmt: skip
    kept = threading.local()

    def again() -> bytes:
        # Every thread has an answer of its own that it writes over.
        kept.out = hp.track(fields[100], 3.0, 0.8, out=getattr(kept, "out", None))
        return of_tracking(kept.out)

    def calibrated() -> bytes:
        found = hp.calibrate(example, seen)
        return bits(found.covariance, found.mirror_tilt_rad, found.beam_rms_mrad) + " ".join(found.status).encode()

    def predicted() -> bytes:
        landed = hp.predict(fields[3_000], azimuth, elevation, 3.0, 0.8)
        return bits(landed.u_m, landed.v_m, landed.beam_error_rad, landed.status)

    def spot() -> bytes:
        found = hp.find_spots(frames, target)
        return bits(found.u_m, found.v_m, found.sigma_m, found.covariance_m2)

    def sunny() -> bytes:
        sun = hp.sun_position(times, 37.4, -6.25)
        return bits(sun.azimuth_rad, sun.elevation_rad)

    def flux() -> bytes:
        made = hp.flux(mesh=strips / "strips.inp", displacements=strips / "strips.frd", scene=scene, rays=20_000)
        return bits(made.flux_w_m2, made.peak_w_m2, made.account.received_w)

    made: dict[str, Call] = {
        f"track {n}": lambda field=field: of_tracking(hp.track(field, 2.5, 0.7))  # type: ignore[misc]
        for n, field in fields.items()
    }
    made["track 37 suns"] = lambda: of_tracking(hp.track(fields[3_000], *suns))
    made["track iterated"] = lambda: of_tracking(hp.track(fields[100], *suns, "iterated:2", continuous=True))
    made["track out="] = again
    made["forward"] = lambda: bits(hp.forward(fields[3_000], azimuth, elevation))
    made["predict"] = predicted
    made["sun_position"] = sunny
    made["calibrate"] = calibrated
    made["find_spots"] = spot
    made["flux"] = flux
    made["pickle"] = lambda: of_tracking(hp.track(pickle.loads(pickle.dumps(fields[100])), 2.0, 0.5))
    made["a refusal"] = refused
    return made


def refused() -> bytes:
    try:
        hp.track(random_field(3), [1.0, np.nan], [1.0, 1.0])
    except hp.SunDirectionError as error:
        return str(error).encode()
    return b"it was taken"


def test_eight_threads_for_a_while_get_what_one_gets() -> None:
    made = calls()
    names = list(made)
    want = {name: made[name]() for name in names}
    assert want["a refusal"] != b"it was taken"
    end = time.monotonic() + SOAK_S
    start = threading.Barrier(THREADS)

    def work(seed: int) -> Counter[str]:
        rng = np.random.default_rng(seed)
        start.wait()
        done: Counter[str] = Counter()
        while time.monotonic() < end or sum(done.values()) < 3 * len(names):
            # All of them first, each thread in another order.
            order = rng.permutation(names)
            for name in order:
                assert made[name]() == want[name], name
                done[str(name)] += 1
        return done

    begun = time.monotonic()
    with futures.ThreadPoolExecutor(THREADS) as pool:
        counts = list(pool.map(work, range(THREADS)))
    done = sum(counts, Counter())
    assert set(done) == set(names)
    assert min(done.values()) >= 3 * THREADS
    print(f"\n{sum(done.values()):,} calls of {THREADS} threads in {time.monotonic() - begun:.1f} s, all as of one:")
    print(*(f"  {name}: {count:,}" for name, count in sorted(done.items())), sep="\n")


def test_a_process_for_every_core_at_once_gets_the_same() -> None:
    here = str(Path(__file__).parent)
    script = (
        f"import sys; sys.path.insert(0, {here!r})\n"
        "import test_soak\n"
        "made = test_soak.calls()\n"
        "print(*(f'{name}: {made[name]().hex()}' for name in made), sep='\\n')\n"
    )
    running = [
        subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(max(2, os.cpu_count() or 2))
    ]
    made = calls()
    want = "".join(f"{name}: {made[name]().hex()}\n" for name in made)  # beside them
    for process in running:
        said, wrong = process.communicate(timeout=300)
        assert process.returncode == 0, wrong
        assert said == want
