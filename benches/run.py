"""Measures helio-rs against its peers in one run and prints the tables as Markdown.

    python benches/run.py [--only tracking|calibration] [--quick] [--rounds R] [--work DIR] [--write-readme]

Builds the Rust programs and the C peers (``CC`` chooses the compiler), makes a virtual environment from
``peers/requirements.txt`` and the input fields, all in ``--work``. Every peer runs in every round, and
the minimum over the rounds counts, so that others on the machine disturb less. Answers are checked
against an evaluation in extended precision; a peer whose answers differ by more than 1e-12 rad, or in a
status, is left out and named, and the exit status is 1. In ``--work``, ``results.json`` keeps everything
and ``speed.md`` the tables.
"""

from __future__ import annotations

import argparse
import array
import datetime
import json
import math
import os
import platform
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import run_calibration

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
PEERS = HERE / "peers"
README = ROOT / "README.md"
BEGIN, END = "<!-- speed:begin -->", "<!-- speed:end -->"

SIZES = (1_000, 12_000, 100_000, 1_000_000)
SEED = 20150901
THREADS = tuple(t for t in (1, 2) if t <= (os.cpu_count() or 1))

C_FLAGS = ("-std=gnu11", "-O3", "-march=native", "-fopenmp", "-Wall", "-Wextra")
# Enough for libmvec to be used; the rest of -ffast-math gains nothing measurable and gives up NaN.
C_KERNEL_FLAGS = ("-fno-math-errno", "-fno-trapping-math", "-mprefer-vector-width=512")

# What one heliostat moves: 13 constants and 3 answers of 8 bytes, 4 limits of 4 bytes and a status byte.
BYTES_PER_HELIOSTAT = (13 + 3) * 8 + 4 * 4 + 1
# What eight heliostats cost: instructions counted by stepping through the AVX-512 kernel. Multiply-adds are
# multiplications too, others are additions, comparisons, minima, conversions and bit operations; loads and stores
# not counted.
SQUARE_ROOTS, DIVISIONS, MULTIPLY_ADDS, OTHERS = 4, 2, 97, 64

OFFSET_FORMS = ("none", "iterated:1", "iterated:2", "approximate", "exact")
SUN_TOLERANCE_DEG = 2e-6  # pvlib keeps time in one double


class Peer(NamedTuple):
    """A program that times one field, prints a JSON line and writes its answers if asked to."""

    name: str
    title: str
    command: tuple[str, ...]
    threads: tuple[int, ...]
    native: bool


class Input(NamedTuple):
    name: str
    n: int
    kind: str
    timed: bool


INPUTS = (
    *(Input(str(n), n, "operating", True) for n in SIZES),
    Input("outside", 12_000, "outside", True),
    Input("edge", 20_000, "edge", False),
)


@dataclass
class Plan:
    """What to run, and how often."""

    work: Path
    rounds: int
    repeat_native: int
    repeat_python: int
    peers: list[Peer] = field(default_factory=list)

    def input_path(self, which: Input) -> Path:
        return self.work / f"field_{which.name}.f64"

    def program(self, name: str) -> str:
        return str(Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / name)

    @property
    def python(self) -> str:
        return str(self.work / "venv" / "bin" / "python")


# --- making ready --------------------------------------------------------------------------------


def run(*command: str) -> None:
    subprocess.run(command, check=True, cwd=ROOT)


def run_lines(*command: str) -> list[dict[str, Any]]:
    """Runs a program that prints a JSON object per line."""
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT)
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


ENVIRONMENT = dict(os.environ, PYTHONDONTWRITEBYTECODE="1")


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def make_environment(plan: Plan) -> None:
    wanted = (PEERS / "requirements.txt").read_text()
    stamp = plan.work / "venv" / "requirements.txt"
    if stamp.exists() and stamp.read_text() == wanted:
        return
    say("making the peers' environment")
    run(sys.executable, "-m", "venv", str(plan.work / "venv"))
    run(plan.python, "-m", "pip", "install", "--quiet", "-r", str(PEERS / "requirements.txt"))
    stamp.write_text(wanted)


def build(plan: Plan) -> None:
    run("cargo", "build", "--release", "--quiet", "-p", "helio-bench")
    compiler = os.environ.get("CC", "cc")
    c_peer, limits = str(plan.work / "c_reduced"), str(plan.work / "machine_limits")
    run(compiler, *C_FLAGS, *C_KERNEL_FLAGS, str(PEERS / "c_reduced.c"), "-o", c_peer, "-lmvec", "-lm")
    run(compiler, *C_FLAGS, str(PEERS / "machine_limits.c"), "-o", limits)

    def script(name: str) -> tuple[str, ...]:
        return (plan.python, str(PEERS / f"{name}.py"))

    def c_variant(name: str) -> tuple[str, ...]:
        return (c_peer, "--variant", name)

    plan.peers = [
        Peer("helio_rs", "**helio-rs**", (plan.program("kernel"),), THREADS, True),
        Peer("c_reduced_split", "C, libmvec, in blocks (the best C)", c_variant("split"), THREADS, True),
        Peer("c_reduced_loop", "C, libmvec, one `omp simd` loop", c_variant("loop"), THREADS, True),
        Peer("rust_scalar", "Rust, plain scalar loop", (plan.program("scalar"),), (1,), True),
        Peer("jax_reduced", "JAX", script("jax_reduced"), THREADS, False),
        Peer("numba_reduced", "numba, parallel", script("numba_reduced"), THREADS, False),
        Peer("numpy_reduced", "NumPy, reduced form", script("numpy_reduced"), (1,), False),
        Peer("numpy_printed", "NumPy, formula as printed", script("numpy_printed"), (1,), False),
    ]


def make_inputs(plan: Plan) -> None:
    # Fields of another generator must not stay.
    stamp = plan.work / "fields.txt"
    wanted = (PEERS / "common.py").read_text()
    keep = stamp.exists() and stamp.read_text() == wanted
    for which in INPUTS:
        path = plan.input_path(which)
        if not (keep and path.exists()):
            size, seed = str(which.n), str(SEED + which.n)
            make = (str(PEERS / "make_field.py"), "--n", size, "--seed", seed, "--kind", which.kind)
            run(plan.python, *make, "--output", str(path))
    stamp.write_text(wanted)


# --- measuring -----------------------------------------------------------------------------------

Key = tuple[str, str, int]  # peer, input, threads


@dataclass
class Measured:
    """Everything of one run."""

    timings: dict[Key, dict[str, Any]] = field(default_factory=dict)
    agreement: list[dict[str, Any]] = field(default_factory=list)
    excluded: set[str] = field(default_factory=set)
    limits: dict[int, dict[str, Any]] = field(default_factory=dict)
    offsets: dict[str, dict[str, float]] = field(default_factory=dict)
    sun: dict[str, dict[str, Any]] = field(default_factory=dict)
    loads: list[float] = field(default_factory=list)

    def ns(self, peer: str, which: str | int, threads: int = 1) -> float:
        line = self.timings.get((peer, str(which), threads))
        if line is None or peer in self.excluded:
            return math.nan
        return float(line["ns_per_heliostat"]["minimum"])


def keep_best(best: dict[Any, dict[str, Any]], key: Any, line: dict[str, Any], what: str) -> None:
    if key not in best or line[what]["minimum"] < best[key][what]["minimum"]:
        best[key] = line


def time_peer(plan: Plan, measured: Measured, peer: Peer, which: Input, output: bool = False) -> None:
    repeat = plan.repeat_native if peer.native else plan.repeat_python
    for threads in peer.threads:
        command = [*peer.command, "--input", str(plan.input_path(which)), "--threads", str(threads)]
        command += ["--repeat", str(repeat if which.timed else 1)]
        if output:
            command += ["--output", str(answers_path(plan, peer, which, threads))]
        load = os.getloadavg()[0]
        measured.loads.append(load)
        line = run_lines(*command)[-1] | {"input": which.name, "load_average": load}
        if which.timed:
            keep_best(measured.timings, (peer.name, which.name, threads), line, "ns_per_heliostat")


def answers_path(plan: Plan, peer: Peer, which: Input, threads: int) -> Path:
    return plan.work / f"answers_{peer.name}_{which.name}_{threads}.bin"


def check_answers(plan: Plan, measured: Measured) -> None:
    """Holds the answers of the first round to an evaluation in extended precision."""
    for which in INPUTS:
        paths = {
            str(path): (peer.name, threads)
            for peer in plan.peers
            for threads in peer.threads
            if (path := answers_path(plan, peer, which, threads)).exists()
        }
        compare = (plan.python, str(PEERS / "compare.py"), "--input", str(plan.input_path(which)), *paths)
        # Its exit status says whether all agree; the lines say which do not.
        done = subprocess.run(compare, stdout=subprocess.PIPE, text=True, env=ENVIRONMENT, check=False)
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        if len(lines) != len(paths):
            raise SystemExit(f"comparing the answers for field {which.name} failed")
        for (answers, (peer_name, threads)), line in zip(paths.items(), lines, strict=True):
            measured.agreement.append(line | {"peer": peer_name, "input": which.name, "threads": threads})
            Path(answers).unlink()
            if not line["agrees"]:
                measured.excluded.add(peer_name)
                say(f"{peer_name} disagrees on field {which.name}: {line}")


def measure_limits(plan: Plan, measured: Measured) -> None:
    """Bandwidths and throughputs, the better of all measurements."""
    for threads in THREADS:
        new = run_lines(str(plan.work / "machine_limits"), "--threads", str(threads))[-1]
        old = measured.limits.setdefault(threads, new)
        for level, value in new["read_gb_per_s"].items():
            old["read_gb_per_s"][level] = max(value, old["read_gb_per_s"][level])
        for what, value in new["ns_per_8_doubles"].items():
            old["ns_per_8_doubles"][what] = min(value, old["ns_per_8_doubles"][what])
        copy = "streaming_copy_gb_per_s"
        old[copy] = max(new[copy], old[copy])


def read_doubles(path: Path, count: int) -> array.array[float]:
    values = array.array("d")
    values.frombytes(path.read_bytes()[: 8 * count])
    if sys.byteorder == "big":
        values.byteswap()
    return values


def measure_offsets(plan: Plan, measured: Measured, first: bool) -> None:
    """The offset forms of Shen 2016's table 1: time, and greatest difference of the axes from exact."""
    which = next(i for i in INPUTS if i.name == "12000")
    answers: dict[str, array.array[float]] = {}
    for form in OFFSET_FORMS:
        command = [plan.program("kernel"), "--input", str(plan.input_path(which)), "--offset", form]
        path = plan.work / "answers_offset.bin"
        line = run_lines(*command, "--repeat", str(plan.repeat_native), "--output", str(path))[-1]
        entry = measured.offsets.setdefault(form, {"ns": math.inf})
        entry["ns"] = min(entry["ns"], line["ns_per_heliostat"]["minimum"])
        if first:
            answers[form] = read_doubles(path, 2 * which.n)
        path.unlink()
    for form, angles in answers.items():
        exact = answers["exact"]
        greatest = 0.0
        for row in range(which.n):
            turn = abs(angles[row] - exact[row])
            rise = abs(angles[which.n + row] - exact[which.n + row])
            # what counts of the azimuth is how far it moves the normal, roughly
            turn = min(turn, math.tau - turn) * abs(math.cos(exact[which.n + row]))
            greatest = max(greatest, turn, rise)
        measured.offsets[form]["greatest_difference_deg"] = math.degrees(greatest)


def measure_sun(plan: Plan, measured: Measured, first: bool) -> None:
    ours, theirs = plan.work / "answers_sun.bin", plan.work / "answers_pvlib.bin"
    for line in run_lines(plan.program("sun"), "--repeat", str(plan.repeat_native), "--output", str(ours)):
        name = f"{line['what']} {line['n']}" if "n" in line else line["what"]
        keep_best(measured.sun, name, line, "ns" if "ns" in line else "ns_per_instant")
    for numba in (False, True):
        for threads in THREADS if numba else (1,):
            command = [plan.python, str(PEERS / "sun_pvlib.py"), "--threads", str(threads)]
            command += ["--repeat", str(max(plan.repeat_python // 2, 1)), "--output", str(theirs)]
            line = run_lines(*command, *(["--numba"] if numba else []))[-1]
            if first:
                far = line["greatest_difference_deg"] = sun_difference_deg(ours, theirs, line["n"])
                if not far <= SUN_TOLERANCE_DEG:
                    measured.excluded.add(line["peer"])
                    say(f"{line['peer']} disagrees on sun positions: {far:.1e} deg")
            else:
                key = f"{line['peer']} {threads}"
                line["greatest_difference_deg"] = measured.sun[key]["greatest_difference_deg"]
            keep_best(measured.sun, f"{line['peer']} {threads}", line, "ns_per_instant")


def sun_difference_deg(ours: Path, theirs: Path, n: int) -> float:
    """Greatest difference of azimuth and geometric elevation; where the air bends, definitions differ near the horizon."""
    a, b = read_doubles(ours, 3 * n), read_doubles(theirs, 3 * n)
    turns = (abs(a[i] - b[i]) for i in range(n))
    azimuth = max(min(turn, math.tau - turn) for turn in turns)
    return math.degrees(max(azimuth, max(abs(a[i] - b[i]) for i in range(2 * n, 3 * n))))


def measure(plan: Plan) -> Measured:
    measured = Measured()
    measure_limits(plan, measured)
    for peer in plan.peers:
        for which in INPUTS:
            if not which.timed:
                time_peer(plan, measured, peer, which, output=True)
    for index in range(plan.rounds):
        say(f"round {index + 1} of {plan.rounds}, load {os.getloadavg()[0]:.2f}")
        for which in (i for i in INPUTS if i.timed):
            for peer in plan.peers:
                time_peer(plan, measured, peer, which, output=index == 0)
            # Short runs meet more quiet moments: the native programs a second time.
            for peer in (p for p in plan.peers if p.native):
                time_peer(plan, measured, peer, which)
        measure_offsets(plan, measured, first=index == 0)
        measure_sun(plan, measured, first=index == 0)
    measure_limits(plan, measured)
    check_answers(plan, measured)
    return measured


# --- the machine's bound -------------------------------------------------------------------------


def cache_bytes(level: int) -> int:
    for index in Path("/sys/devices/system/cpu/cpu0/cache").glob("index*"):
        if (index / "level").read_text().strip() == str(level) and (
            index / "type"
        ).read_text().strip() != "Instruction":
            text = (index / "size").read_text().strip()
            return int(text.rstrip("KMG")) << {"K": 10, "M": 20, "G": 30}.get(text[-1], 0)
    return 0


def memory_level(n: int, threads: int) -> str:
    data = n * BYTES_PER_HELIOSTAT
    if data <= threads * cache_bytes(1):
        return "l1"
    if data <= threads * cache_bytes(2):
        return "l2"
    return "l3" if data <= cache_bytes(3) else "memory"


class Bound(NamedTuple):
    """Least nanoseconds per heliostat that each part of the machine allows."""

    level: str
    parts: dict[str, float]

    @property
    def ns(self) -> float:
        return max(self.parts.values())

    @property
    def by(self) -> str:
        return max(self.parts, key=lambda part: self.parts[part])


def bound(limits: dict[str, Any], n: int, threads: int) -> Bound:
    level = memory_level(n, threads)
    bandwidth = limits["read_gb_per_s"][level]
    if level == "memory":
        bandwidth = max(bandwidth, limits["streaming_copy_gb_per_s"])
    cost = limits["ns_per_8_doubles"]
    place = {"l1": "L1", "l2": "L2", "l3": "L3", "memory": "memory"}[level]
    parts = {
        place: BYTES_PER_HELIOSTAT / bandwidth,
        "divider": (SQUARE_ROOTS * cost["sqrt"] + DIVISIONS * cost["divide"]) / 8,
        "multiply-adds": MULTIPLY_ADDS * cost["fma"] / 8,
        "all vector units": (MULTIPLY_ADDS + OTHERS) * cost["mixed"] / 8,
    }
    return Bound(level, parts)


# --- Markdown ------------------------------------------------------------------------------------


def figure(value: float) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:.0f}"


def markdown(head: list[str], rows: list[list[str]]) -> list[str]:
    line = "|" + "|".join([" :--- "] + [" ---: "] * (len(head) - 1)) + "|"
    return ["| " + " | ".join(head) + " |", line, *("| " + " | ".join(row) + " |" for row in rows)]


def sizes_head(first: str) -> list[str]:
    return [first, *(f"{n:,}" for n in SIZES), "12,000, 1 % outside limits"]


def with_threads(one: float, two: float) -> str:
    return figure(one) + (f" ({figure(two)})" if math.isfinite(two) else "")


def best_c(m: Measured, which: str | int, threads: int = 1) -> float:
    return min(m.ns("c_reduced_split", which, threads), m.ns("c_reduced_loop", which, threads))


def ratio_rows(m: Measured) -> list[tuple[str, dict[str, float]]]:
    """How many times faster than each peer, or than itself on one thread."""
    names = [which.name for which in INPUTS if which.timed]

    def over(peer: str, threads: int = 1) -> dict[str, float]:
        return {name: m.ns(peer, name, threads) / m.ns("helio_rs", name, threads) for name in names}

    python = {
        name: min((m.ns(p, name, t) for p in ("jax_reduced", "numba_reduced") for t in THREADS), default=math.nan)
        / m.ns("helio_rs", name)
        for name in names
    }
    rows = [
        ("the best C", {name: best_c(m, name) / m.ns("helio_rs", name) for name in names}),
        ("C, one `omp simd` loop", over("c_reduced_loop")),
        ("plain scalar Rust", over("rust_scalar")),
        ("JAX or numba, the faster, either number of threads", python),
        ("NumPy, reduced form", over("numpy_reduced")),
        ("NumPy, as printed", over("numpy_printed")),
    ]
    if 2 in THREADS:
        both = {name: best_c(m, name, 2) / m.ns("helio_rs", name, 2) for name in names}
        own = {name: m.ns("helio_rs", name) / m.ns("helio_rs", name, 2) for name in names}
        rows += [("the best C, both on two threads", both), ("itself on one thread, by two", own)]
    return rows


def field_tables(plan: Plan, m: Measured) -> list[str]:
    names = [which.name for which in INPUTS if which.timed]
    rows = []
    for peer in plan.peers:
        cells = [with_threads(m.ns(peer.name, name), m.ns(peer.name, name, 2)) for name in names]
        rows.append([peer.title, *cells])
    sizes = [which.n for which in INPUTS if which.timed]
    bounds = {t: [bound(m.limits[t], n, t) for n in sizes] for t in THREADS}
    two = bounds.get(2, [])
    cells = [with_threads(b.ns, two[i].ns if two else math.nan) for i, b in enumerate(bounds[1])]
    rows.append(["the machine's bound", *cells])
    rows.append(["set by", *(b.by for b in bounds[1])])
    reached = [b.ns / m.ns("helio_rs", name) for b, name in zip(bounds[1], names, strict=True)]
    rows.append(["of it reached", *(f"{share:.0%}" for share in reached)])
    lines = ["Nanoseconds per heliostat on one thread (on two):", ""]
    lines += markdown(sizes_head("field of"), rows)
    lines += ["", "helio-rs is so many times as fast as, on one thread:", ""]
    lines += markdown(sizes_head("field of"), [[title, *(figure(r[n]) for n in names)] for title, r in ratio_rows(m)])
    return lines


def offset_table(m: Measured) -> list[str]:
    none = m.offsets["none"]["ns"]
    rows = []
    for form in OFFSET_FORMS:
        entry = m.offsets[form]
        share = f"{entry['ns'] / none:.2f}"
        rows.append([f"`{form}`", figure(entry["ns"]), share, f"{entry['greatest_difference_deg']:.1e}"])
    head = ["offset form", "ns per heliostat", "ratio to `none`", "greatest difference from exact [deg]"]
    return ["Offset forms, 12,000 heliostats, one thread:", "", *markdown(head, rows)]


def sun_table(m: Measured) -> list[str]:
    ours = m.sun["bulk sorted 100000"]
    rows = []

    def add(title: str, key: str, difference: str) -> None:
        if key in m.sun and key.split()[0] not in m.excluded:
            ns = m.sun[key]["ns_per_instant"]["minimum"]
            ratio = ns / ours["ns_per_instant"]["minimum"]
            far = m.sun[key].get(difference)
            rows.append([title, figure(ns), figure(ratio), "-" if far is None else f"{far:.1e}"])

    from_direct = "greatest_difference_from_direct_deg"
    add("**helio-rs**, in order of time, 100,000", "bulk sorted 100000", from_direct)
    add("helio-rs, in order of time, 1,000", "bulk sorted 1000", from_direct)
    add("helio-rs, in random order over a year, 100,000", "bulk random 100000", from_direct)
    add("helio-rs, one at a time", "bulk sorted 1", from_direct)
    add("direct SPA (`solar-positioning`, split Julian date)", "direct", from_direct)
    add("pvlib, numba", "pvlib_numba 1", "greatest_difference_deg")
    add("pvlib, numba, two threads", "pvlib_numba 2", "greatest_difference_deg")
    add("pvlib, NumPy", "pvlib_numpy 1", "greatest_difference_deg")
    head = ["sun positions", "ns per instant", "ratio", "greatest difference [deg]"]
    made = " and ".join(
        f"{m.sun[f'making a {span}']['ns']['minimum'] / 1e6:.2f} ms for a {span}" for span in ("day", "year")
    )
    return [
        "From integer nanoseconds to azimuth and both elevations, one thread; differences of helio-rs from direct SPA,",
        f"of pvlib (which keeps time in one double) from helio-rs. Making the ephemeris takes {made}.",
        "",
        *markdown(head, rows),
    ]


def bars(m: Measured) -> list[str]:
    """Each figure that is aimed at, and what came out."""
    ratios = dict(ratio_rows(m))
    aims = [("the best C", n, 2.3) for n in SIZES[:3]]
    aims += [("NumPy, reduced form", n, 7.0 if n == 12_000 else 13.0) for n in SIZES[:3]]
    aims += [("NumPy, as printed", n, 50.0) for n in SIZES[:3]]
    aims += [("the best C", 1_000_000, 1.7)]
    if 2 in THREADS:
        aims += [("itself on one thread, by two", n, 1.8) for n in SIZES[2:]]
    rows = []
    for title, n, aim in aims:
        got = ratios[title][str(n)]
        rows.append([title, f"{n:,}", f"{aim:g}", figure(got), "met" if got >= aim else "missed"])
    for order in ("sorted", "random"):
        entry = m.sun[f"bulk {order} 100000"]
        ns, far = entry["ns_per_instant"]["minimum"], entry["greatest_difference_from_direct_deg"]
        rows.append([f"sun, {order} [ns]", "100,000", "20", figure(ns), "met" if ns <= 20 else "missed"])
        verdict = "met" if far <= 1e-8 else "missed"
        rows.append([f"sun, {order}, difference [deg]", "100,000", "1e-8", f"{far:.1e}", verdict])
    return markdown(["aim", "of", "wanted", "measured", ""], rows)


def processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if not cpuinfo.exists():
        return platform.processor() or platform.machine()
    about: dict[str, str] = {}
    for line in cpuinfo.read_text().splitlines():
        name, colon, value = line.partition(":")
        if colon:
            about.setdefault(name.strip(), value.strip())
    family = f" (family {about['cpu family']}, model {about['model']})" if "cpu family" in about else ""
    return about.get("model name", platform.machine()) + family


def machine_line(plan: Plan, m: Measured) -> str:
    versions = {line["peer"]: line["version"] for line in m.timings.values()}
    c = versions["c_reduced_split"].split()[0]
    rustc = subprocess.run(["rustc", "--version"], stdout=subprocess.PIPE, text=True, check=True).stdout.split()[1]
    now = datetime.datetime.now(datetime.UTC)
    pvlib = m.sun["pvlib_numba 1"]["version"]
    return (
        f"{now:%Y-%m-%d}, {processor()}, {os.cpu_count()} cores; Rust {rustc} ({versions['helio_rs'].split()[-1]}), "
        f"gcc {c} `-O3 -march=native` with libmvec, NumPy {versions['numpy_reduced']}, "
        f"numba {versions['numba_reduced']}, JAX {versions['jax_reduced']}, pvlib {pvlib}; "
        f"minimum over {plan.rounds} round{'s' if plan.rounds > 1 else ''}, load average {min(m.loads):.2f} to {max(m.loads):.2f}."
    )


def limits_line(m: Measured) -> str:
    texts = []
    for threads, limits in m.limits.items():
        read, cost = limits["read_gb_per_s"], limits["ns_per_8_doubles"]
        texts.append(
            f"{threads} thread{'s' if threads > 1 else ''}: read L2 {read['l2']:.0f}, L3 {read['l3']:.0f}, "
            f"memory {read['memory']:.0f} GB/s (copy {limits['streaming_copy_gb_per_s']:.0f}); 8 doubles: "
            f"multiply-add {cost['fma']:.3f}, any {cost['mixed']:.3f}, divide {cost['divide']:.2f}, "
            f"square root {cost['sqrt']:.2f} ns"
        )
    return (
        f"Bound: {BYTES_PER_HELIOSTAT} bytes per heliostat; {SQUARE_ROOTS} square roots, {DIVISIONS} divisions, "
        f"{MULTIPLY_ADDS} multiply-adds and {OTHERS} other vector instructions per eight. " + ". ".join(texts) + "."
    )


def report(plan: Plan, m: Measured) -> str:
    worst = max(max(r[f"{a}_rad"] for a in ("azimuth", "elevation", "incidence")) for r in m.agreement)
    agreed = sum(1 for r in m.agreement if r["agrees"])
    conditions = (
        "Exact offset, all six errors, limits, incidence and status; prepared field, output reused. "
        f"{agreed} of {len(m.agreement)} answer sets agree with extended precision to 1e-12 rad "
        f"(greatest difference {worst:.1e} rad). {limits_line(m)}"
    )
    lines = [
        machine_line(plan, m),
        "",
        *field_tables(plan, m),
        "",
        conditions,
        "",
        *offset_table(m),
        "",
        *sun_table(m),
    ]
    return "\n".join(lines) + "\n"


def split_readme(begin: str = BEGIN, end: str = END, page: Path = README) -> tuple[str, str]:
    """What stands before a table, and after it."""
    text = page.read_text() if page.exists() else ""
    head, found_begin, rest = text.partition(begin)
    _, found_end, tail = rest.partition(end)
    if not (found_begin and found_end):
        raise SystemExit(f"{page.name}: expected the markers {begin} and {end}")
    return head, tail


def write_readme(text: str, begin: str = BEGIN, end: str = END, page: Path = README) -> None:
    head, tail = split_readme(begin, end, page)
    page.write_text(f"{head}{begin}\n{text}{end}{tail}")


def calibration(plan: Plan, quick: bool, write: bool) -> bool:
    """Measures the calibration; true if every peer found the same optimum."""
    run("cargo", "build", "--release", "--quiet", "-p", "helio-bench")
    tools = run_calibration.Tools(
        plan.work, PEERS, plan.program("calibration"), plan.python, THREADS, run, run_lines, say
    )
    run_calibration.build(tools)
    measured = run_calibration.measure(tools, plan.rounds, plan.repeat_native, large=not quick)
    rustc = subprocess.run(["rustc", "--version"], stdout=subprocess.PIPE, text=True, check=True).stdout.split()[1]
    now = datetime.datetime.now(datetime.UTC)
    version = measured.versions["helio_rs"].split()[-1]
    machine = f"{now:%Y-%m-%d}, {processor()}, {os.cpu_count()} cores; Rust {rustc} ({version})"
    text = run_calibration.report(measured, machine, plan.rounds)
    (plan.work / "calibration.md").write_text(text)
    print(text)
    print("\n".join(run_calibration.bars(measured)))
    if write:
        write_readme(text, run_calibration.BEGIN, run_calibration.END)
    return not measured.excluded


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, default=ROOT / "target" / "bench", metavar="DIR")
    parser.add_argument("--quick", action="store_true", help="one round, few repeats: to see that it works")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--write-readme", action="store_true", help="replace the README's table")
    parser.add_argument("--only", choices=("tracking", "calibration"), help="one part alone")
    arguments = parser.parse_args()

    if arguments.write_readme and arguments.quick:
        parser.error("--quick gives no figures worth keeping: not with --write-readme")
    if arguments.write_readme:
        # before minutes of measuring
        if arguments.only != "calibration":
            split_readme()
        if arguments.only != "tracking":
            split_readme(run_calibration.BEGIN, run_calibration.END)
    quick: bool = arguments.quick
    plan = Plan(
        work=arguments.work.resolve(),
        rounds=1 if quick else arguments.rounds,
        repeat_native=3 if quick else 15,
        repeat_python=1 if quick else 5,
    )
    plan.work.mkdir(parents=True, exist_ok=True)
    ENVIRONMENT["NUMBA_CACHE_DIR"] = str(plan.work / "numba")
    make_environment(plan)
    agreed = arguments.only == "tracking" or calibration(plan, quick, arguments.write_readme)
    if arguments.only == "calibration":
        sys.exit(0 if agreed else 1)
    build(plan)
    make_inputs(plan)
    measured = measure(plan)

    text = report(plan, measured)
    results = {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "processor": processor(),
        "processors": os.cpu_count(),
        "python": platform.python_version(),
        "c_flags": " ".join([*C_FLAGS, *C_KERNEL_FLAGS]),
        "rounds": plan.rounds,
        "load_average": [min(measured.loads), max(measured.loads)],
        "machine_limits": list(measured.limits.values()),
        "bounds": [
            {"n": n, "threads": t, "level": b.level, "ns_per_heliostat": b.parts}
            for t in THREADS
            for n in SIZES
            if (b := bound(measured.limits[t], n, t))
        ],
        "agreement": measured.agreement,
        "excluded": sorted(measured.excluded),
        "timings": list(measured.timings.values()),
        "offsets": measured.offsets,
        "sun": measured.sun,
    }
    (plan.work / "results.json").write_text(json.dumps(results, indent=1) + "\n")
    (plan.work / "speed.md").write_text(text)
    print(text)
    print("\n".join(bars(measured)))
    if arguments.write_readme:
        write_readme(text)
    sys.exit(1 if measured.excluded or not agreed else 0)


if __name__ == "__main__":
    main()
