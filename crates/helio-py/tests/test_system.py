"""Threads, processes, signals, memory, import."""

from __future__ import annotations

import concurrent.futures as futures
import gc
import multiprocessing as mp
import os
import signal
import subprocess
import sys
import textwrap
import threading
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import helio_py as hp
from conftest import random_field, same_bits

# Enough rows that the work is shared among threads.
MANY = 60_000


def digest(seed: int) -> bytes:
    """What a process computes of a field that needs several threads, and of the sun."""
    tracking = hp.track(random_field(MANY, seed), 3.0, 0.8)
    times = np.datetime64("2026-06-21", "s") + np.arange(50_000)
    sun = hp.sun_position(times, 37.4, -6.25)
    return tracking.azimuth_rad[::997].tobytes() + np.ravel(sun.azimuth_rad)[::997].tobytes()


# Python 3.12 and later warn of any fork beside threads; this is about such forks.
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
def test_children_of_every_kind_compute_the_same(method: str) -> None:
    if method not in mp.get_all_start_methods():
        pytest.skip(f"no {method} on this system")
    want = [digest(seed) for seed in (1, 2)]  # threads have run in this process now
    with futures.ProcessPoolExecutor(2, mp_context=mp.get_context(method)) as pool:
        assert list(pool.map(digest, (1, 2), timeout=60)) == want
    # and still run in it
    assert digest(1) == want[0]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_a_child_of_a_child_of_a_fork_computes_too() -> None:
    want = digest(3)
    pid = os.fork()
    if pid == 0:
        good = digest(3) == want
        grandchild = os.fork()
        if grandchild == 0:
            os._exit(0 if digest(3) == want else 1)
        _, status = os.waitpid(grandchild, 0)
        os._exit(0 if good and status == 0 else 1)
    _, status = os.waitpid(pid, 0)
    assert status == 0


def test_eight_threads_at_once_get_what_one_gets() -> None:
    fields = [random_field(n, n) for n in (1, 100, 5000, MANY)]
    suns = [(2.0 + 0.1 * k, 0.3 + 0.1 * k) for k in range(4)]
    want = {(f, s): hp.track(fields[f], *suns[s]) for f in range(4) for s in range(4)}

    def work(seed: int) -> int:
        rng = np.random.default_rng(seed)
        out = hp.track(fields[1], *suns[0])
        for _ in range(60):
            f, s = (int(k) for k in rng.integers(0, 4, 2))
            assert same_bits(hp.track(fields[f], *suns[s]), want[f, s])
            assert same_bits(hp.track(fields[1], *suns[s], out=out), want[1, s])
        return seed

    with futures.ThreadPoolExecutor(8) as pool:
        assert list(pool.map(work, range(8))) == list(range(8))


def test_two_calls_never_write_to_one_answer() -> None:
    field = random_field(MANY)
    suns = np.full(60, 3.0), np.full(60, 0.8)
    want = hp.track(field, *suns)
    out = hp.track(field, *suns)
    refused = []

    def work() -> None:
        for _ in range(10):
            try:
                hp.track(field, *suns, out=out)
            except hp.BusyError:
                refused.append(1)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert refused  # so the interpreter was free while a call computed
    assert same_bits(out, want)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
def test_a_signal_stops_a_long_call_in_the_middle() -> None:
    # An answer that is part new, part old shows that the call itself was stopped, not what came after it.
    script = textwrap.dedent(
        """
        import signal
        import numpy as np
        import helio_py as hp
        field = hp.Field(np.random.default_rng(0).uniform(10, 900, (1000, 3)), [0, 0, 2000], mirror_offset_m=0.3)
        low, high = (np.full(8000, 3.0), np.full(8000, 0.5)), (np.full(8000, 3.0), np.full(8000, 0.8))
        out = hp.track(field, *low)
        before, after = (hp.track(field, *(a[:1] for a in suns), "iterated:64").azimuth_rad[0] for suns in (low, high))
        hp.track(field, *low, "iterated:64", out=out)
        signal.signal(signal.SIGALRM, signal.default_int_handler)
        signal.setitimer(signal.ITIMER_REAL, 0.02)
        try:
            hp.track(field, *high, "iterated:64", out=out, continuous=True)
        except KeyboardInterrupt:
            assert np.array_equal(out.azimuth_rad[0], after)
            assert np.array_equal(out.azimuth_rad[-1], before)
            print("stopped in the middle")
        assert np.array_equal(hp.track(field, *high, "iterated:64", out=out).azimuth_rad[-1], after)
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.stdout == "stopped in the middle\n", done.stderr


def test_memory_is_flat_over_many_calls() -> None:
    field = random_field(20)
    out = hp.track(field, 3.0, 0.8)
    azimuth, elevation = out.azimuth_rad.copy(), out.elevation_rad.copy()
    sun = np.array([3.0, 3.1])
    tracked = [field, out, azimuth, sun]

    def calls(count: int) -> None:
        for _ in range(count):
            hp.track(field, 3.0, 0.8, out=out)
            tracking = hp.track(field, sun, sun - 2.4)
            _ = tracking.azimuth_rad, tracking.status, tracking.limit_excess_rad
            hp.forward(field, azimuth, elevation)
            with pytest.raises(hp.ShapeError):
                hp.track(field, sun, 0.8)

    def resident_kb() -> int:
        status = Path("/proc/self/status")
        if not status.exists():
            return 0
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmRSS"))
        return int(line.split()[1])

    calls(2000)
    gc.collect()
    counts = [sys.getrefcount(thing) for thing in tracked]
    before_kb = resident_kb()
    tracemalloc.start()
    calls(100)
    gc.collect()
    first, _ = tracemalloc.get_traced_memory()
    calls(1000)
    gc.collect()
    last, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    calls(100_000 // 4)
    gc.collect()
    assert [sys.getrefcount(thing) for thing in tracked] == counts
    assert last - first < 20_000
    assert resident_kb() - before_kb < 4_000


def test_nothing_but_numpy_is_imported() -> None:
    script = "import sys, numpy; before = set(sys.modules); import helio_py; print(*sorted(set(sys.modules) - before))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    new = {name.partition(".")[0] for name in done.stdout.split()}
    assert new <= {"helio_py", "__future__"}, new


def test_present_angles_lead_the_shortest_way() -> None:
    # Two turns of room: the answer is that next to where the axis stands.
    field = hp.Field(
        [[0, 0, 0]], [0, 100, 30], axis1_min_rad=-13, axis1_max_rad=13, axis2_min_rad=-0.5, axis2_max_rad=1.6
    )
    free = hp.track(field, 3.0, 0.8)
    for turns in (-1, 0, 1):
        want = free.azimuth_rad + 2 * np.pi * turns
        got = hp.track(field, 3.0, 0.8, present=(want + 0.3, free.elevation_rad))
        assert abs(got.azimuth_rad - want) < 1e-12
        again = hp.track(field, 3.01, 0.8, present=got)
        assert abs(again.azimuth_rad - want) < 0.1
        # The caller's present may be the memory that is written over.
        assert same_bits(hp.track(field, 3.01, 0.8, present=(got.azimuth_rad, got.elevation_rad), out=got), again)
