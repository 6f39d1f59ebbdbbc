"""Measures the method of T/GRLM 02-2014 on gray frames against OpenCV in one run, and `robust` after it; prints Markdown.

    python benches/run_spots.py [--rounds R] [--repeat N] [--work DIR] [--write-readme]

The standard's method on one thread. Frames are synthetic; where HELIO_DATA names the folder of shared data, its gray camera frames and one crop
too. helio-rs and every way of OpenCV run in every round, and the least time of a call counts. A peer whose threshold or
area differs, or that finds a greater window sum, is named, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import datetime
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import run

VARIANTS = ("box", "box32", "integral")
BEGIN, END = "<!-- spot-speed:begin -->", "<!-- spot-speed:end -->"
SAME = ("threshold", "area_px", "window_px")

Key = tuple[str, str, bool]  # peer, frame, from the file


def frames_of(plan: run.Plan) -> list[Path]:
    """The synthetic ones first, and the folder of each."""
    synthetic = plan.work / "frames"
    run.run(plan.python, str(run.PEERS / "make_frames.py"), "--output", str(synthetic))
    folders = [synthetic]
    shared = os.environ.get("HELIO_DATA")
    if shared:
        recorded = plan.work / "frames_recorded"
        recorded.mkdir(exist_ok=True)
        folders.append(recorded)
        juelich = Path(shared) / "juelich"
        crops = sorted((juelich / "crops").glob("*-cropped.png"))[:1]
        for path in [*sorted((juelich / "frames").glob("*-gray.png")), *crops]:
            (recorded / path.name).write_bytes(path.read_bytes())
    return folders


def measure(plan: run.Plan, folders: list[Path], repeat: int) -> tuple[dict[Key, dict[str, Any]], list[float]]:
    best: dict[Key, dict[str, Any]] = {}
    loads = []
    for number in range(plan.rounds):
        loads.append(os.getloadavg()[0])
        run.say(f"spots, round {number + 1} of {plan.rounds}, load {loads[-1]:.2f}")
        for folder in folders:
            files = [str(path) for path in sorted(folder.glob("*.png"))]
            for decode in (False, True):
                times = ("--repeat", str(max(repeat // 4, 1) if decode else repeat))
                from_file = ("--decode", "true") if decode else ()
                lines = run.run_lines(plan.program("spots"), "--frames", str(folder), *times, *from_file)
                for variant in VARIANTS:
                    peer = (plan.python, str(run.PEERS / "spot_opencv.py"), "--variant", variant, *times)
                    lines += run.run_lines(*peer, *from_file[:1], *files)
                for line in lines:
                    run.keep_best(best, (line["peer"], line["frame"], decode), line, "ms_per_frame")
    return best, loads


def disagreements(best: dict[Key, dict[str, Any]]) -> list[str]:
    found = []
    for (peer, frame, decode), line in best.items():
        ours = best["helio_rs", frame, decode]
        # Windows at row or column 0 of the printed range are outside OpenCV's: its greatest sum may be less. Sums in single
        # precision stand on a grid of 2^-23 of their size, so that the greatest may be another's, rounded up.
        same = all(line[name] == ours[name] for name in SAME)
        rounding = ours["window_sum"] * 2.0**-23 if peer == "opencv_box32" else 0.0
        if not same or line["window_sum"] > ours["window_sum"] + rounding:
            found.append(f"{peer}, {frame}: {line}, helio-rs: {ours}")
    return found


def table(best: dict[Key, dict[str, Any]]) -> str:
    rows = [
        "| frame | helio-rs, ms | best OpenCV, ms | ratio | file to spot: helio-rs | OpenCV | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    for frame in dict.fromkeys(key[1] for key in best):
        cells = [frame.removesuffix(".png")]
        for decode in (False, True):
            ours = best["helio_rs", frame, decode]["ms_per_frame"]["minimum"]
            theirs, way = math.inf, ""
            for variant in VARIANTS:
                line = best[f"opencv_{variant}", frame, decode]
                if line["ms_per_frame"]["minimum"] < theirs:
                    theirs, way = line["ms_per_frame"]["minimum"], variant
            named = f"{theirs:.3f}" if decode else f"{theirs:.3f} ({way})"
            cells += [f"{ours:.3f}", named, f"{theirs / ours:.2f}"]
        rows.append("| " + " | ".join(cells) + " |")
    return "\n".join(rows)


def robust(plan: run.Plan) -> str:
    """A table of frames per second, which the program writes itself."""
    command = [str(plan.program("robust_speed")), "3"]
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, default=run.ROOT / "target" / "bench")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--repeat", type=int, default=200, help="calls in a round")
    parser.add_argument("--write-readme", action="store_true", help="replace the README's table")
    arguments = parser.parse_args()
    if arguments.write_readme:
        # before minutes of measuring
        run.split_readme(BEGIN, END)
    plan = run.Plan(arguments.work.resolve(), arguments.rounds, arguments.repeat, arguments.repeat)
    plan.work.mkdir(parents=True, exist_ok=True)
    run.make_environment(plan)
    run.run("cargo", "build", "--release", "--quiet", "-p", "helio-bench")
    best, loads = measure(plan, frames_of(plan), arguments.repeat)
    version = next(line["version"] for line in best.values() if "version" in line)
    text = "\n".join(
        [
            f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d}, {run.processor()}, {os.cpu_count()} cores; OpenCV {version}; "
            f"least time of {arguments.rounds} rounds, load average {min(loads):.2f} to {max(loads):.2f}.",
            "",
            "`standard` (threshold by Otsu, area, window sums, greatest) and the fastest way of OpenCV to the same window, one thread:",
            "",
            table(best),
            "",
            "`robust` with marks and homography, from memory:",
            "",
            robust(plan),
        ]
    )
    print(text)
    wrong = disagreements(best)
    print("\n".join(wrong), file=sys.stderr)
    if arguments.write_readme and not wrong:
        run.write_readme(f"{text}\n", BEGIN, END)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
