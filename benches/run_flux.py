"""Measures rays of a flat facet against numba in one run, and a field's flux map after it; prints Markdown.

    python benches/run_flux.py [--rounds R] [--work DIR]

A facet of 7 m by 6 m, a screen of 15 m by 15 m with 64 by 64 bins, 100 m away. helio-rs and every way of numba run in
every round, and the most rays of a call count. The exit status is 1 if the flux in the middle differs by 0.2 %: three
standard errors of numba's random rays.
"""

from __future__ import annotations

import argparse
import datetime
import os
import sys
from pathlib import Path
from typing import Any

import run

Key = tuple[str, int]  # peer, threads
WAYS: tuple[tuple[str, ...], ...] = ((), ("--fastmath",))


def measure(plan: run.Plan) -> tuple[dict[Key, dict[str, Any]], list[float]]:
    best: dict[Key, dict[str, Any]] = {}
    loads = []
    for number in range(plan.rounds):
        loads.append(os.getloadavg()[0])
        run.say(f"flux, round {number + 1} of {plan.rounds}, load {loads[-1]:.2f}")
        lines = []
        for threads in (1, 2):
            lines += run.run_lines(plan.program("flux"), "--threads", str(threads))
        for way in WAYS:
            lines += run.run_lines(plan.python, str(run.PEERS / "flux_numba.py"), *way)
        for line in lines:
            key = (line["peer"], line["threads"])
            if key not in best or line["mrays_per_s"] > best[key]["mrays_per_s"]:
                best[key] = line
    return best, loads


def table(best: dict[Key, dict[str, Any]]) -> str:
    numba = max(line["mrays_per_s"] for (peer, _), line in best.items() if peer != "helio_rs")
    rows = ["| | threads | million rays per second | over the best numba, one thread |", "|---|---|---|---|"]
    for (peer, threads), line in best.items():
        rate = line["mrays_per_s"]
        rows.append(f"| {peer} | {threads} | {rate:.1f} | {rate / numba:.1f} |")
        if "mrays_per_s_with_set" in line:
            rate = line["mrays_per_s_with_set"]
            rows.append(f"| {peer}, its rays made anew for each call | {threads} | {rate:.1f} | {rate / numba:.1f} |")
    return "\n".join(rows)


def fields(plan: run.Plan) -> str:
    rows = [
        "| 12,000 heliostats, 240,000 facets, two threads | rays | seconds | rms error, of the peak | worst bin |",
        "|---|---|---|---|---|",
    ]
    for rays in (20_000_000, 200_000_000):
        for line in run.run_lines(plan.program("flux_field"), "--rays", str(rays)):
            rows.append(
                f"| {line['receiver']} | {line['rays']:.1e} | {line['seconds']:.2f} | "
                f"{line['rms_of_peak']:.1e} | {line['worst_of_peak']:.1e} |"
            )
    return "\n".join(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, default=run.ROOT / "target" / "bench")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    plan = run.Plan(arguments.work.resolve(), arguments.rounds, 20, 5)
    plan.work.mkdir(parents=True, exist_ok=True)
    run.make_environment(plan)
    run.run("cargo", "build", "--release", "--quiet", "-p", "helio-bench")
    best, loads = measure(plan)
    numba = best["numba", 1]
    print(
        f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d}, {run.processor()}, {os.cpu_count()} cores; numba {numba['version']}; "
        f"most of {arguments.rounds} rounds, load average {min(loads):.2f} to {max(loads):.2f}.\n\n{table(best)}\n\n{fields(plan)}"
    )
    middle = best["helio_rs", 1]["middle"]
    wrong = [line for line in best.values() if abs(line["middle"] / middle - 1.0) > 2e-3]
    print("\n".join(map(str, wrong)), file=sys.stderr)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
