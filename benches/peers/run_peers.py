"""Builds and runs every peer, checks that they agree, and writes ``results.json``.

    python run_peers.py --work DIR [--rounds 3] [--results FILE]

Inputs, programs and answers go to ``--work``. On a machine that others use too, more rounds help:
the minimum over all rounds is reported. Agreement is checked on every size and on a field full of
edge cases, against an evaluation in extended precision.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import common
import compare

HERE = Path(__file__).resolve().parent
SIZES = (1_000, 12_000, 100_000, 1_000_000)
EDGE_SIZE = 20_000
SEED = 20150901

C_FLAGS = ("-std=gnu11", "-O3", "-march=native", "-fopenmp", "-Wall", "-Wextra")
# Enough for libmvec to be used; the rest of -ffast-math gains nothing measurable and gives up NaN.
C_KERNEL_FLAGS = ("-fno-math-errno", "-fno-trapping-math", "-mprefer-vector-width=512")


class Peer(NamedTuple):
    name: str
    command: tuple[str, ...]
    threads: tuple[int, ...]


def build(work: Path) -> tuple[Path, Path]:
    """Compiles the C peer and the measurement of the machine; ``CC`` chooses the compiler."""
    compiler = os.environ.get("CC", "cc")
    peer, limits = work / "c_reduced", work / "machine_limits"
    source = str(HERE / "c_reduced.c")
    subprocess.run([compiler, *C_FLAGS, *C_KERNEL_FLAGS, source, "-o", str(peer), "-lmvec", "-lm"], check=True)
    subprocess.run([compiler, *C_FLAGS, str(HERE / "machine_limits.c"), "-o", str(limits)], check=True)
    return peer, limits


def all_peers(c_peer: Path) -> list[Peer]:
    def script(name: str) -> tuple[str, ...]:
        return (sys.executable, str(HERE / f"{name}.py"))

    return [
        Peer("numpy_printed", script("numpy_printed"), (1,)),
        Peer("numpy_reduced", script("numpy_reduced"), (1,)),
        Peer("numba_reduced", script("numba_reduced"), (1, 2)),
        Peer("jax_reduced", script("jax_reduced"), (1, 2)),
        Peer("c_reduced_loop", (str(c_peer), "--variant", "loop"), (1, 2)),
        Peer("c_reduced_split", (str(c_peer), "--variant", "split"), (1, 2)),
    ]


def make_inputs(work: Path, sizes: list[int]) -> dict[str, Path]:
    inputs = {}
    for n in sizes:
        inputs[str(n)] = work / f"field_{n}.f64"
        if not inputs[str(n)].exists():
            common.write_field(inputs[str(n)], n, SEED + n)
    inputs["edge"] = work / "field_edge.f64"
    if not inputs["edge"].exists():
        common.write_field(inputs["edge"], EDGE_SIZE, SEED, edge=True)
    return inputs


def run_json(command: list[str]) -> dict[str, Any]:
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    line: dict[str, Any] = json.loads(done.stdout.strip().splitlines()[-1])
    return line


def processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def check_agreement(peers: list[Peer], inputs: dict[str, Path], work: Path) -> list[dict[str, Any]]:
    rows = []
    for field, path in inputs.items():
        reference = compare.extended_reference(path)
        for peer in peers:
            answers = work / f"{peer.name}_{field}.bin"
            run_json([*peer.command, "--input", str(path), "--repeat", "1", "--output", str(answers)])
            differences = compare.largest_differences(reference, common.read_answers(answers))
            answers.unlink()
            rows.append({"peer": peer.name, "field": field, "agrees": compare.agrees(differences), **differences})
            if not rows[-1]["agrees"]:
                print(f"{peer.name} disagrees on {field}: {differences}", file=sys.stderr)
    return rows


def time_peers(
    peers: list[Peer], inputs: dict[str, Path], sizes: list[int], repeat: int, rounds: int
) -> list[dict[str, Any]]:
    best: dict[tuple[str, int, int], dict[str, Any]] = {}
    for _ in range(rounds):
        for n in sizes:
            for peer in peers:
                for threads in peer.threads:
                    if threads > (os.cpu_count() or 1):
                        continue
                    options = ["--input", str(inputs[str(n)]), "--threads", str(threads), "--repeat", str(repeat)]
                    load = os.getloadavg()[0]
                    line = run_json([*peer.command, *options]) | {"load_average": load}
                    key = (peer.name, n, threads)
                    if key not in best or (
                        line["ns_per_heliostat"]["minimum"] < best[key]["ns_per_heliostat"]["minimum"]
                    ):
                        best[key] = line
    return list(best.values())


def print_table(timings: list[dict[str, Any]], sizes: list[int]) -> None:
    print("\nns per heliostat, minimum".ljust(30) + "threads".rjust(8) + "".join(f"{n:>10}" for n in sizes))
    rows: dict[tuple[str, int], dict[int, float]] = {}
    for line in timings:
        rows.setdefault((line["peer"], line["threads"]), {})[line["n"]] = line["ns_per_heliostat"]["minimum"]
    for (peer, threads), cells in rows.items():
        print(f"{peer:<29}{threads:>8}" + "".join(f"{cells[n]:>10.2f}" for n in sizes))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, required=True, metavar="DIR")
    parser.add_argument("--results", type=Path, metavar="FILE", help="default: results.json in --work")
    parser.add_argument("--sizes", type=int, nargs="+", default=list(SIZES), metavar="N")
    parser.add_argument("--peers", nargs="+", metavar="NAME", help="default: all")
    parser.add_argument("--repeat", type=int, default=11)
    parser.add_argument("--rounds", type=int, default=1)
    arguments = parser.parse_args()

    work: Path = arguments.work
    work.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("PYTHONDONTWRITEBYTECODE", "1")
    c_peer, limits = build(work)
    peers = [peer for peer in all_peers(c_peer) if arguments.peers is None or peer.name in arguments.peers]
    inputs = make_inputs(work, arguments.sizes)
    agreement = check_agreement(peers, inputs, work)
    thread_counts = [threads for threads in (1, 2) if threads <= (os.cpu_count() or 1)]
    machine_limits = [run_json([str(limits), "--threads", str(threads)]) for threads in thread_counts]
    timings = time_peers(peers, inputs, arguments.sizes, arguments.repeat, arguments.rounds)
    results = {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "processor": processor(),
        "processors": os.cpu_count(),
        "python": platform.python_version(),
        "c_flags": " ".join([*C_FLAGS, *C_KERNEL_FLAGS]),
        "machine_limits": machine_limits,
        "agreement": agreement,
        "timings": timings,
    }
    path = arguments.results or work / "results.json"
    path.write_text(json.dumps(results, indent=1) + "\n")
    for line in machine_limits:
        print(json.dumps(line))
    print_table(timings, arguments.sizes)
    worst = max((max(r["azimuth_rad"], r["elevation_rad"], r["incidence_rad"]) for r in agreement), default=0.0)
    failed = [r for r in agreement if not r["agrees"]]
    print(f"\nagreement: {len(agreement) - len(failed)} of {len(agreement)}; largest difference {worst:.1e} rad")
    print(f"results: {path}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
