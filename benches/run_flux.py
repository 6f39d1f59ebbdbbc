"""Measures rays, fields, meshes and both ways to a map in one run, and holds maps against Mitsuba's; prints Markdown.

    python benches/run_flux.py [--rounds R] [--work DIR] [--quick] [--write]

Rays: a facet of 7 m by 6 m, a screen of 15 m by 15 m with 64 by 64 bins, 100 m away; helio-rs and every way of numba run
in every round, and the most rays of a call count. Meshes are read by meshio too. Mitsuba traces three scenes by means of
its own. ``--write`` replaces the block of docs/flux-speed.md and the figures beside it. The exit status is 1 if the flux
in the middle differs from numba's by 0.2 % (three standard errors of its random rays), or a map from Mitsuba's by more
than chance.
"""

from __future__ import annotations

import argparse
import datetime
import itertools
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import run

Line = dict[str, Any]
Key = tuple[str, int]  # peer, threads
WAYS: tuple[tuple[str, ...], ...] = ((), ("--fastmath",))
PAGE = run.ROOT / "docs" / "flux-speed.md"
FIGURES = run.ROOT / "docs" / "figures"
BEGIN, END = "<!-- flux-speed:begin -->", "<!-- flux-speed:end -->"
# Triangles across a mesh: 39,204 of them, and ten times as many.
ACROSS = (198, 626)
SCENES = {
    "plate": "folded plate of Yan 2022, 16 strips, onto a plane",
    "field": "30 canted heliostats under a low sun, onto a plane",
    "round": "the same with slope errors of 2 mrad, onto a cylinder",
}
BARS = (40.0, 1.8, 10.0)  # over numba, two threads over one, seconds for a field


def measure(plan: run.Plan) -> tuple[dict[Key, Line], list[float]]:
    best: dict[Key, Line] = {}
    loads = []
    for number in range(plan.rounds):
        loads.append(os.getloadavg()[0])
        run.say(f"rays, round {number + 1} of {plan.rounds}, load {loads[-1]:.2f}")
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


def rays_table(best: dict[Key, Line]) -> str:
    numba = max(line["mrays_per_s"] for (peer, _), line in best.items() if peer != "helio_rs")
    rows = ["| | threads | million rays per second | over the best numba, one thread |", "|---|---|---|---|"]
    for (peer, threads), line in best.items():
        rate = line["mrays_per_s"]
        rows.append(f"| {peer} | {threads} | {rate:.1f} | {rate / numba:.1f} |")
        if "mrays_per_s_with_set" in line:
            rate = line["mrays_per_s_with_set"]
            rows.append(f"| {peer}, its rays made anew for each call | {threads} | {rate:.1f} | {rate / numba:.1f} |")
    one, two = (best["helio_rs", threads]["mrays_per_s"] for threads in (1, 2))
    over = f"One thread over numba: {one / numba:.1f} (bar {BARS[0]:.0f})."
    return "\n".join([*rows, "", f"{over} Two threads over one: {two / one:.2f} (bar {BARS[1]})."])


def fields_table(plan: run.Plan, quick: bool) -> str:
    rows = [
        "| 12,000 heliostats, 240,000 facets, two threads | | seconds | rms error, of the peak | worst bin |",
        "|---|---|---|---|---|",
    ]
    seconds: dict[str, list[float]] = {"rms_of_peak": [], "worst_of_peak": []}
    for rays in (20_000_000,) if quick else (20_000_000, 200_000_000):
        # By convolution once: it takes a hundred times as long.
        convolve = ("--convolve", "1") if not quick and rays == 20_000_000 else ()
        run.say(f"field, {rays:.0e} rays")
        for line in run.run_lines(plan.program("flux_field"), "--rays", str(rays), *convolve):
            is_rays = line["way"] == "rays"
            for of, fewest in seconds.items():
                if is_rays and line[of] < 0.01:
                    fewest.append(line["seconds"])
            how = f"{line['rays']:.1e} rays" if is_rays else "convolution, no shading"
            rows.append(
                f"| {line['receiver']} | {how} | "
                f"{line['seconds']:.2f} | {line['rms_of_peak']:.1e} | {line['worst_of_peak']:.1e} |"
            )
    least = {of: f"{min(fewest):.2f} s" if fewest else "not reached" for of, fewest in seconds.items()}
    bar = f"(bar {BARS[2]:.0f} s)"
    to = f"To 1 % of the peak, root mean square: {least['rms_of_peak']} {bar}; in every bin: {least['worst_of_peak']}."
    return "\n".join([*rows, "", to])


def meshes_table(plan: run.Plan, quick: bool) -> str:
    rows = [
        "| triangles | model | read | meshio | result read | faces found and turned | both methods | rays | traced | "
        "10⁶ rays/s | memory | meshio's |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    program = plan.program("flux_mesh")
    for across in ACROSS:
        run.say(f"mesh, {across} across")
        rays = str(1 << 22 if quick else 1 << 26)
        run.run(program, "--across", str(across), "--write", str(plan.work))
        meshio = (plan.python, str(run.PEERS / "mesh_meshio.py"), str(plan.work / "mesh.inp"), "--repeat", "3")
        (theirs,) = run.run_lines(*meshio)
        (ours,) = run.run_lines(program, "--across", str(across), "--repeat", "5", "--rays", rays)
        if theirs["triangles"] != ours["triangles"]:
            raise SystemExit(f"meshio reads {theirs['triangles']} triangles, helio-rs {ours['triangles']}")
        times = [
            f"{1e3 * ours['model_s']:.1f} ms",
            f"{1e3 * theirs['model_s']:.0f} ms",
            *(f"{1e3 * ours[name]:.1f} ms" for name in ("result_s", "mirror_s", "both_methods_s")),
        ]
        rows.append(
            f"| {ours['triangles']:,} | {ours['model_mb']:.1f} MB | {' | '.join(times)} | {ours['rays']:.1e} | "
            f"{ours['trace_s']:.3f} s | {ours['mrays_per_s']:.0f} | {ours['memory_mib']} MiB | {theirs['memory_mib']} MiB |"
        )
    return "\n".join(rows)


def errors(plan: run.Plan, quick: bool) -> list[Line]:
    run.say("error against time")
    most = ("--most-rays", str(1 << 22 if quick else 1 << 28), "--repeat", "1" if quick else "3")
    return run.run_lines(plan.program("flux_error"), "--threads", "2", *most)


def time_to(error: float, rays: list[Line]) -> float:
    """Seconds that rays take to an error: along straight lines between logarithms; beyond them along the later half's."""
    pairs = itertools.pairwise(rays)
    later = (rays[len(rays) // 2 - 1], rays[-1])
    before, after = next((pair for pair in pairs if pair[1]["rms_of_peak"] <= error), later)
    fall = math.log(before["rms_of_peak"] / after["rms_of_peak"])
    share = math.log(before["rms_of_peak"] / error) / fall
    return float(before["seconds"] * (after["seconds"] / before["seconds"]) ** share)


def crossover_table(lines: list[Line]) -> str:
    rows = [
        "| scene | elements | points a bin | error | convolution | rays to that error | rays over convolution | even at |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for scene, elements in dict.fromkeys((line["scene"], line["elements"]) for line in lines):
        of = [line for line in lines if (line["scene"], line["elements"]) == (scene, elements)]
        rays = sorted((line for line in of if line["way"] == "rays"), key=lambda line: int(line["rays"]))
        for line in of:
            if line["way"] != "convolution":
                continue
            error, ours = line["rms_of_peak"], line["seconds"]
            theirs = time_to(error, rays)
            mark = "about " if error < rays[-1]["rms_of_peak"] else ""
            rows.append(
                f"| {scene} | {elements:,} | {line['count']}² | {error:.1e} | {1e3 * ours:.2f} ms | "
                f"{mark}{1e3 * theirs:.1f} ms | {theirs / ours:.2g} | {elements * theirs / ours:.2g} elements |"
            )
    return "\n".join(rows)


def maps(plan: run.Plan, quick: bool) -> tuple[str, list[str]]:
    """Maps of other scenes by Mitsuba; what differs by more than chance."""
    rows = [
        "| scene | Mitsuba's rays | bins | rays a bin | χ² a bin | worst bin | reflected | blocked | received | shaded, blocked |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    wrong, version = [], ""
    # Ours are so many more that chance is Mitsuba's alone.
    for scene, title in SCENES.items():
        run.say(f"Mitsuba: {scene}")
        path = plan.work / f"flux_{scene}.json"
        made = subprocess.run(
            [plan.program("flux_scene"), "--scene", scene, "--rays", str(1 << (27 if quick else 30))],
            stdout=subprocess.PIPE,
            check=True,
        )
        path.write_bytes(made.stdout)
        rays = str(1 << (23 if quick else 25))
        (line,) = run.run_lines(plan.python, str(run.PEERS / "flux_mitsuba.py"), str(path), "--rays", rays)
        version = line["version"]
        parts = [line[f"{name}_standard_errors"] for name in ("reflected", "blocked", "received")]
        shares = f"{100 * line['shaded_part']:.1f} %, {100 * line['blocked_part']:.1f} %"
        for name, found in ((title, line), ("the same, by convolution", line.get("integral"))):
            if found is None:
                continue
            told = [f"{x:+.1f} s.e." for x in parts] + [shares] if found is line else [""] * 4
            rows.append(
                f"| {name} | {line['rays']:.1e} | {found['bins']} | {found['rays_per_bin']:.0f} | "
                f"{found['chi_squared_per_bin']:.3f} ± {found['standard_error']:.3f} | {found['worst']:.1f} s.e. | "
                f"{' | '.join(told)} |"
            )
            far = abs(found["chi_squared_per_bin"] - 1.0) > 5.0 * found["standard_error"] or found["worst"] > 5.5
            if far or max(map(abs, parts)) > 5.0:
                wrong.append(f"{name}: {found}")
    return f"Mitsuba {version}.\n\n" + "\n".join(rows), wrong


def report(plan: run.Plan, quick: bool, write: bool) -> tuple[str, list[str]]:
    best, loads = measure(plan)
    numba = best["numba", 1]
    middle = best["helio_rs", 1]["middle"]
    wrong = [str(line) for line in best.values() if abs(line["middle"] / middle - 1.0) > 2e-3]
    lines = errors(plan, quick)
    (plan.work / "flux_error.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in lines))
    folder = FIGURES if write else plan.work
    run.run(plan.program("flux_plot"), "--lines", str(plan.work / "flux_error.jsonl"), "--out", str(folder))
    fields, meshes = fields_table(plan, quick), meshes_table(plan, quick)
    independent, far = maps(plan, quick)
    today = f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d}"
    machine = f"{today}, {run.processor()}, {os.cpu_count()} cores; numba {numba['version']}"
    parts = [
        f"{machine}; most of {plan.rounds} rounds, load average {min(loads):.2f} to {max(loads):.2f}.",
        "## Rays",
        rays_table(best),
        "## A field",
        fields,
        "## Meshes",
        meshes,
        "## Rays or convolution",
        crossover_table(lines),
        "## Against another ray tracer",
        independent,
    ]
    return "\n\n".join(parts) + "\n", wrong + far


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, default=run.ROOT / "target" / "bench")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="one round, few rays: to see that it works")
    parser.add_argument("--write", action="store_true", help="replace the tables and figures of docs/flux-speed.md")
    arguments = parser.parse_args()
    if arguments.write:
        if arguments.quick:
            parser.error("--write wants a whole run, not --quick")
        # before minutes of measuring
        run.split_readme(BEGIN, END, PAGE)
    rounds = 1 if arguments.quick else arguments.rounds
    plan = run.Plan(arguments.work.resolve(), rounds, 20, 5)
    plan.work.mkdir(parents=True, exist_ok=True)
    run.make_environment(plan)
    run.run("cargo", "build", "--release", "--quiet", "-p", "helio-bench")
    text, wrong = report(plan, arguments.quick, arguments.write)
    print(text)
    print("\n".join(wrong), file=sys.stderr)
    if arguments.write and not wrong:
        run.write_readme(f"\n{text}\n", BEGIN, END, PAGE)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
