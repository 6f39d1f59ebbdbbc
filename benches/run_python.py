"""One call of ``track`` from Python beside the Rust kernel and the peers that Python has, as Markdown.

Everything runs in this one run, one after another, several rounds; the fastest of each counts. Rust's kernel is
``cargo build --release -p helio-bench`` (``--kernel`` names another), helio-py must be installed where this runs,
NumPy too; numba and JAX (peers/requirements.txt) are measured where they are installed, and named where they are
not. A peer counts only where its answers agree.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "peers"))

import common  # noqa: E402

PEERS = {"NumPy, reduced": "numpy_reduced", "NumPy, as printed": "numpy_printed", "numba": "numba_reduced"}
PEERS["JAX"] = "jax_reduced"
NEEDS = {"numba_reduced": "numba", "jax_reduced": "jax"}
AGREE_RAD = 1e-9


def measured(command: list[str]) -> list[tuple[str, float]]:
    """Names and microseconds per call of what a peer printed."""
    environment = dict(os.environ, OMP_NUM_THREADS="1", NUMBA_NUM_THREADS="1")
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)}: {done.stderr.strip()[-500:]}")
    found = []
    for line in done.stdout.splitlines():
        said = json.loads(line)
        us = said.get("us_per_call")
        if us is None:
            us = said["ns_per_heliostat"]["minimum"] * said["n"] / 1000
        found.append((str(said["peer"]), float(us)))
    return found


def agrees(answers: Path, reference: Path) -> bool:
    """Whether two answers have the same status, and angles within ``AGREE_RAD``."""
    got, want = common.read_answers(answers), common.read_answers(reference)
    ok = want.status == common.OK
    pairs = ((got.azimuth_rad, want.azimuth_rad), (got.elevation_rad, want.elevation_rad))
    near = all(np.abs((a - b)[ok]).max(initial=0.0) < AGREE_RAD for a, b in pairs)
    return bool(near and np.array_equal(got.status == common.OK, ok))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    target = Path(os.environ.get("CARGO_TARGET_DIR", HERE.parent / "target"))
    parser.add_argument("--kernel", type=Path, default=target / "release" / "kernel")
    parser.add_argument("--n", type=int, nargs="+", default=[100, 1000, 12_000, 100_000])
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()

    peers = {name: [sys.executable, str(HERE / "peers" / f"{file}.py")] for name, file in PEERS.items()}
    missing = [name for name, file in PEERS.items() if file in NEEDS and not importlib.util.find_spec(NEEDS[file])]
    for name in missing:
        del peers[name]
    commands = {"Rust kernel": [str(arguments.kernel)], **peers}
    commands["helio-py"] = [sys.executable, str(HERE / "peers" / "helio_python.py")]
    table: dict[str, dict[int, float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for n in arguments.n:
            field = Path(folder) / f"{n}.f64"
            common.write_field(field, n, seed=7)
            for current in range(arguments.rounds):
                for name, command in commands.items():
                    out = Path(folder) / f"{name.replace(' ', '-')}.bin"
                    flags = ["--input", str(field), "--repeat", "5"]
                    for peer, us in measured([*command, *flags, *(["--output", str(out)] if current == 0 else [])]):
                        row = name if name != "helio-py" else peer
                        best = table.setdefault(row, {})
                        best[n] = min(us, best.get(n, us))
                    if current == 0 and not agrees(out, Path(folder) / "Rust-kernel.bin"):
                        raise SystemExit(f"{name}: answers for {n} heliostats differ from the kernel's")
    print("| µs per call, one thread where n < 49,152 | " + " | ".join(f"n = {n:,}" for n in arguments.n) + " |")
    print("|---|" + "---|" * len(arguments.n))
    for name, times in table.items():
        print(f"| {name} | " + " | ".join(f"{times[n]:.2f}" for n in arguments.n) + " |")
    if missing:
        print(f"\nNot installed, and not measured: {', '.join(missing)}.")


if __name__ == "__main__":
    main()
