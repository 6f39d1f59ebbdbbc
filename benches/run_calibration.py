"""The calibration of a whole field against its peers; a part of run.py, which see."""

from __future__ import annotations

import array
import math
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

BEGIN, END = "<!-- calibration-speed:begin -->", "<!-- calibration-speed:end -->"

HELIOSTATS = {12: 10_000, 50: 10_000, 200: 10_000}
PEER_HELIOSTATS = 1_000
LARGE = (100_000, 200)
# Nine digits of the least sum of squares; of so many of a hundred heliostats, or the peer does not count.
AGREEMENT = 1e-9
LEAST_AGREEING = 98.0
PER_FIT = 7  # six angles and the sum of squares

CXX_FLAGS = ("-std=c++17", "-O3", "-march=native", "-Wall", "-Wextra", "-Wno-maybe-uninitialized", "-pthread")
EIGEN = ("-isystem", "/usr/include/eigen3")

RunLines = Callable[..., list[dict[str, Any]]]


class Tools(NamedTuple):
    """What run.py lends."""

    work: Path
    peers: Path
    program: str
    python: str
    threads: tuple[int, ...]
    run: Callable[..., None]
    run_lines: RunLines
    say: Callable[[str], None]


class Agreement(NamedTuple):
    """Of a peer's least sums of squares with ours."""

    percent: float
    greatest: float
    higher_percent: float

    @property
    def counts(self) -> bool:
        return self.percent >= LEAST_AGREEING


@dataclass
class Measured:
    """Nanoseconds per fit by (peer, observations, threads), and how far each peer's least S is from ours."""

    ns: dict[tuple[str, int, int], float] = field(default_factory=dict)
    difference: dict[tuple[str, int], Agreement] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    loads: list[float] = field(default_factory=list)
    excluded: set[tuple[str, int]] = field(default_factory=set)


def build(tools: Tools) -> None:
    compiler = os.environ.get("CXX", "c++")
    source, program = str(tools.peers / "tinysolver.cpp"), str(tools.work / "tinysolver")
    tools.run(compiler, *CXX_FLAGS, *EIGEN, source, "-o", program)


def sums_of_squares(path: Path) -> list[float]:
    values = array.array("d")
    values.frombytes(path.read_bytes())
    if sys.byteorder == "big":
        values.byteswap()
    return list(values[PER_FIT - 1 :: PER_FIT])


def note(measured: Measured, name: str, observations: int, line: dict[str, Any]) -> None:
    key = (name, observations, line["threads"])
    measured.ns[key] = min(line["ns_per_fit"]["minimum"], measured.ns.get(key, math.inf))
    measured.versions[name] = line["version"]
    measured.loads.append(os.getloadavg()[0])


def compare(measured: Measured, name: str, observations: int, ours: list[float], answers: Path) -> None:
    theirs = sums_of_squares(answers)
    apart = [t / o - 1.0 for t, o in zip(theirs, ours, strict=False)]
    share = 100.0 / len(apart)
    agreement = Agreement(
        share * sum(abs(x) <= AGREEMENT for x in apart),
        max(abs(x) for x in apart),
        share * sum(x > AGREEMENT for x in apart),
    )
    measured.difference[name, observations] = agreement
    if not agreement.counts:
        measured.excluded.add((name, observations))


def measure(tools: Tools, rounds: int, repeat: int, large: bool) -> Measured:
    measured = Measured()
    campaigns, answers, own = (tools.work / f"calibration_{what}.f64" for what in ("input", "answers", "own"))
    tiny = str(tools.work / "tinysolver")
    scipy = (tools.python, str(tools.peers / "scipy_calibration.py"))
    for number in range(rounds):
        tools.say(f"calibration, round {number + 1} of {rounds}, load {os.getloadavg()[0]:.2f}")
        for observations, heliostats in HELIOSTATS.items():
            some = (tools.program, "--observations", str(observations), "--repeat", str(repeat))
            small = ("--heliostats", str(PEER_HELIOSTATS), "--campaigns", str(campaigns), "--output", str(own))
            note(measured, "helio_rs_1000", observations, tools.run_lines(*some, *small)[-1])
            ours = sums_of_squares(own)
            for threads in tools.threads:
                whole = (*some, "--heliostats", str(heliostats), "--threads", str(threads))
                note(measured, "helio_rs", observations, tools.run_lines(*whole)[-1])
                with_covariance = tools.run_lines(*whole, "--covariance", "true")[-1]
                note(measured, "helio_rs_covariance", observations, with_covariance)
            peer_repeat = str(max(repeat // 2, 1))
            common = ("--input", str(campaigns), "--output", str(answers))
            for variant in ("scanned", "printed", "reduced"):
                for threads in tools.threads:
                    peer = (tiny, *common, "--variant", variant, "--threads", str(threads), "--repeat", peer_repeat)
                    note(measured, f"tinysolver_{variant}", observations, tools.run_lines(*peer)[-1])
                compare(measured, f"tinysolver_{variant}", observations, ours, answers)
            for method in ("lm", "trf"):
                fitted = (*scipy, *common, "--method", method, "--repeat", "1" if number else "2")
                note(measured, f"scipy_{method}", observations, tools.run_lines(*fitted)[-1])
                compare(measured, f"scipy_{method}", observations, ours, answers)
    if large:
        heliostats, observations = LARGE
        command = (tools.program, "--heliostats", str(heliostats), "--observations", str(observations))
        line = tools.run_lines(*command, "--threads", "0", "--repeat", "1")[-1]
        note(measured, "large", observations, line)
    for path in (campaigns, answers, own):
        path.unlink(missing_ok=True)
    return measured


# --- Markdown ------------------------------------------------------------------------------------

TITLES = {
    "helio_rs": "**helio-rs**, 10,000 heliostats",
    "helio_rs_covariance": "helio-rs, 10,000 heliostats, with covariance",
    "helio_rs_1000": "helio-rs, 1,000 heliostats",
    "tinysolver_scanned": "Ceres TinySolver, derivatives as printed, cold start by a scan",
    "tinysolver_printed": "the same, given helio-rs' closed-form start",
    "tinysolver_reduced": "the same, given helio-rs' reduced derivatives too",
    "scipy_lm": "SciPy `least_squares`, `lm`, two-point",
    "scipy_trf": "SciPy `least_squares`, defaults (`trf`, two-point)",
}


def microseconds(ns: float) -> str:
    us = ns / 1e3
    return "-" if not math.isfinite(us) else f"{us:.2f}" if us < 10 else f"{us:.1f}" if us < 100 else f"{us:.0f}"


def report(m: Measured, machine: str, rounds: int) -> str:
    gcc, scipy = m.versions["tinysolver_printed"].split()[0], m.versions["scipy_lm"]
    load = f"load average {min(m.loads):.2f} to {max(m.loads):.2f}"
    lines = [
        f"{machine}; gcc {gcc} `-O3 -march=native`, Debian's Ceres, SciPy {scipy}; minimum over {rounds} rounds, {load}.",
        "",
        "Microseconds per fit of six angles from a cold start, one thread (two):",
        "",
        "| observations of each | " + " | ".join(str(n) for n in HELIOSTATS) + " |",
        "| :--- |" + " ---: |" * len(HELIOSTATS),
    ]
    for name, title in TITLES.items():
        cells = []
        for observations in HELIOSTATS:
            one = m.ns.get((name, observations, 1), math.nan)
            two = m.ns.get((name, observations, 2), math.nan)
            cell = microseconds(one) + (f" ({microseconds(two)})" if math.isfinite(two) else "")
            cells.append("other optima" if (name, observations) in m.excluded else cell)
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    lines += ["", "helio-rs is so many times as fast as, on one thread, 10,000 heliostats:", ""]
    lines += ["| | " + " | ".join(str(n) for n in HELIOSTATS) + " | least S the same to 9 digits |"]
    lines += ["| :--- |" + " ---: |" * (len(HELIOSTATS) + 1)]
    for name, title in TITLES.items():
        if name.startswith("helio"):
            continue
        ratios = [m.ns[name, n, 1] / m.ns["helio_rs", n, 1] for n in HELIOSTATS]
        cells = [
            "-" if (name, n) in m.excluded else f"{ratio:.1f}" for n, ratio in zip(HELIOSTATS, ratios, strict=True)
        ]
        same = ", ".join(f"{m.difference[name, n].percent:.1f} %" for n in HELIOSTATS)
        lines.append(f"| {title} | " + " | ".join(cells) + f" | {same} |")
    if ("helio_rs", 50, 2) in m.ns:
        ratios = [m.ns["helio_rs", n, 1] / m.ns["helio_rs", n, 2] for n in HELIOSTATS]
        lines.append("| itself on one thread, by two | " + " | ".join(f"{r:.2f}" for r in ratios) + " | same bits |")
    for key, ns in m.ns.items():
        if key[0] == "large":
            heliostats, observations = LARGE
            seconds = ns * heliostats / 1e9
            lines += ["", f"{heliostats:,} heliostats of {observations} observations, all threads: {seconds:.2f} s."]
    return "\n".join(lines) + "\n"


def bars(m: Measured) -> list[str]:
    """Each figure that is aimed at, and what came out."""
    ours = m.ns["helio_rs", 50, 1]
    peers = ("scipy_lm", "scipy_trf")
    aims = [
        ("TinySolver from its own cold start", m.ns["tinysolver_scanned", 50, 1] / ours, 20.0),
        ("TinySolver, given our start", m.ns["tinysolver_printed", 50, 1] / ours, 20.0),
        ("SciPy, the faster", min(m.ns[peer, 50, 1] for peer in peers) / ours, 1000.0),
        ("ms for 10,000 x 50, one thread", ours * 10_000 / 1e6, -25.0),
        ("covariance, share of the time more", m.ns["helio_rs_covariance", 50, 1] / ours - 1.0, -0.2),
    ]
    if ("helio_rs", 50, 2) in m.ns:
        aims.append(("itself on one thread, by two", ours / m.ns["helio_rs", 50, 2], 1.8))
    rows = []
    for title, got, aim in aims:
        met = got >= aim if aim > 0 else got <= -aim
        rows.append(f"| {title} | {abs(aim):g} | {got:.3g} | {'met' if met else 'missed'} |")
    return ["| calibration | wanted | measured | |", "| :--- | ---: | ---: | :--- |", *rows]
