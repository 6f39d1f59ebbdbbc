"""Measures helio-py beside the Rust kernel and the peers that Python has, in one run; prints Markdown.

    python benches/run_python.py [--rounds R] [--work DIR] [--quick] [--write]

Calls of ``track`` on fields of 100 to 100,000 heliostats: the kernel, helio-py and every peer run in every round, the
fastest of each counts, and a peer counts only where its answers agree. Then what the import takes beyond NumPy's, and a
day of 12,000 heliostats every ten seconds. The wheel is built from this clone. ``--write`` replaces the block of
docs/python-speed.md. The exit status is 1 if a bar is missed.
"""

from __future__ import annotations

import argparse
import datetime
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import run

Line = dict[str, Any]
PAGE = run.ROOT / "docs" / "python-speed.md"
BEGIN, END = "<!-- python-speed:begin -->", "<!-- python-speed:end -->"
SIZES = (100, 1_000, 12_000, 100_000)
KERNEL = "Rust kernel"
OURS = {
    "helio_py fresh": "helio-py",
    "helio_py out": "helio-py, `out=`",
    "helio_py arrays": "helio-py, all four arrays taken",
}
PEERS = {
    "NumPy, reduced form": "numpy_reduced",
    "NumPy, as printed": "numpy_printed",
    "numba": "numba_reduced",
    "JAX": "jax_reduced",
}
AGREE_RAD = 1e-12
MS_OF_IMPORT = 30.0
MAKING_WHEELS = "maturin==1.16.0"


class Bar(NamedTuple):
    what: str
    found: float
    bar: float
    unit: str

    @property
    def missed(self) -> bool:
        return not self.found <= self.bar


def install(plan: run.Plan) -> None:
    """The wheel of this clone, into the peers' environment."""
    run.run("cargo", "build", "--release", "--quiet", "-p", "helio-bench")
    run.say("building the wheel")
    wheels = plan.work / "wheels"
    for old in wheels.glob("*.whl"):
        old.unlink()
    pip = (plan.python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")
    run.run(*pip, MAKING_WHEELS)
    manifest = str(run.ROOT / "crates" / "helio-py" / "Cargo.toml")
    maturin = (plan.python, "-m", "maturin", "build", "--release", "--locked", "--quiet")
    run.run(*maturin, "--interpreter", plan.python, "--manifest-path", manifest, "--out", str(wheels))
    run.run(*pip, "--force-reinstall", "--no-deps", *(str(wheel) for wheel in wheels.glob("*.whl")))


def fields(plan: run.Plan) -> dict[int, Path]:
    found = {}
    for n in SIZES:
        path = found[n] = plan.work / f"python_{n}.f64"
        make = (plan.python, str(run.PEERS / "make_field.py"), "--n", str(n), "--seed", str(run.SEED + n))
        run.run(*make, "--kind", "operating", "--output", str(path))
    return found


def microseconds(line: Line) -> float:
    found = line.get("us_per_call")
    return float(line["ns_per_heliostat"]["minimum"] * line["n"] / 1000 if found is None else found)


def calls(plan: run.Plan) -> dict[str, dict[int, float]]:
    """Microseconds of a call, by who and how many heliostats."""
    scripts = {name: (plan.python, str(run.PEERS / f"{script}.py")) for name, script in PEERS.items()}
    commands = {KERNEL: (plan.program("kernel"),), "": (plan.python, str(run.PEERS / "helio_python.py")), **scripts}
    best: dict[str, dict[int, float]] = {}
    inputs = fields(plan)
    for number in range(plan.rounds):
        run.say(f"calls, round {number + 1} of {plan.rounds}, load {os.getloadavg()[0]:.2f}")
        for n, field in inputs.items():
            answers: dict[str, str] = {}
            for name, command in commands.items():
                path = str(plan.work / f"answers_python_{len(answers)}.bin")
                repeat = plan.repeat_native if name == KERNEL else plan.repeat_python
                write = ("--output", path) if number == 0 else ()
                answers[path] = name or "helio-py"
                for line in run.run_lines(*command, "--input", str(field), "--repeat", str(repeat), *write):
                    row = name or OURS[line["peer"]]
                    found = best.setdefault(row, {})
                    found[n] = min(microseconds(line), found.get(n, math.inf))
            if number == 0:
                check(plan, field, answers)
    return best


def check(plan: run.Plan, field: Path, answers: dict[str, str]) -> None:
    """Holds the answers for one field to an evaluation in extended precision."""
    compare = (plan.python, str(run.PEERS / "compare.py"), "--input", str(field), *answers)
    done = subprocess.run(compare, stdout=subprocess.PIPE, text=True, env=run.ENVIRONMENT, check=False)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    for line, name in zip(lines, answers.values(), strict=True):
        if not line["agrees"]:
            raise SystemExit(f"{name}: answers for {field.name} differ from extended precision: {line}")
    for path in answers:
        Path(path).unlink()


def calls_table(best: dict[str, dict[int, float]]) -> tuple[list[str], list[Bar]]:
    fresh, reused = (best[OURS[name]] for name in ("helio_py fresh", "helio_py out"))
    rows = [[name, *(run.figure(us[n]) for n in SIZES)] for name, us in best.items()]
    peers = {n: min(best[name][n] for name in PEERS) for n in SIZES}
    rows.append(["the fastest peer over `out=`", *(run.figure(peers[n] / reused[n]) for n in SIZES)])
    bars = [
        Bar("a call on 100 heliostats", fresh[100], 1.5, "µs"),
        Bar("the same with `out=`", reused[100], 0.8, "µs"),
    ]
    bars += [Bar(f"over the kernel, n = {n:,}", reused[n] / best[KERNEL][n], 1.05, "times") for n in SIZES[2:]]
    return run.markdown(["µs per call", *(f"n = {n:,}" for n in SIZES)], rows), bars


IMPORT = "import time; import numpy; start = time.perf_counter(); import helio_py; print(1e3 * (time.perf_counter() - start))"


def importing(plan: run.Plan) -> list[float]:
    """Milliseconds that `import helio_py` takes after `import numpy`, each in an interpreter of its own."""
    found = []
    for _ in range(3 * plan.repeat_native):
        command = (plan.python, "-c", IMPORT)
        done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
        found.append(float(done.stdout))
    return sorted(found)


def day(plan: run.Plan) -> str:
    run.say("a day of 12,000 heliostats")
    (line,) = run.run_lines(plan.python, str(run.PEERS / "helio_python_day.py"))
    rate = line["rows"] / line["seconds"] / 1e6
    return (
        f"A day: {line['rows']:,} rows, {line['ok']:,} of them with the sun up and an answer, in {line['seconds']:.2f} s "
        f"({rate:.0f} million rows a second), {line['memory_mib']} MiB at most."
    )


def bars_table(bars: list[Bar]) -> list[str]:
    def told(bar: Bar) -> list[str]:
        return [bar.what, f"{bar.found:.3g} {bar.unit}", f"{bar.bar:g}", "missed" if bar.missed else "met"]

    return run.markdown(["bar", "measured", "at most", ""], [told(bar) for bar in bars])


def report(plan: run.Plan) -> tuple[str, list[Bar]]:
    table, bars = calls_table(calls(plan))
    milliseconds = importing(plan)
    bars.append(Bar("`import helio_py` after `import numpy`", milliseconds[len(milliseconds) // 2], MS_OF_IMPORT, "ms"))
    now = datetime.datetime.now(datetime.UTC)
    versions = "import sys, numpy, numba, jax; print(sys.version.split()[0], numpy.__version__, numba.__version__, jax.__version__)"
    done = subprocess.run((plan.python, "-c", versions), check=True, stdout=subprocess.PIPE, text=True)
    python, numpy, numba, jax = done.stdout.split()
    about = (
        f"{now:%Y-%m-%d}, {run.processor()}, {os.cpu_count()} cores; Python {python}, NumPy {numpy}, numba {numba}, JAX {jax}; "
        f"fastest of {plan.rounds} round{'s' if plan.rounds > 1 else ''}."
    )
    spread = f"Import, median of {len(milliseconds)}: {milliseconds[0]:.1f} to {milliseconds[-1]:.1f} ms."
    parts = [about, "\n".join(table), "\n".join(bars_table(bars)), spread, day(plan)]
    return "\n\n".join(parts), bars


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, default=run.ROOT / "target" / "bench")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="one round, few repeats: to see that it works")
    parser.add_argument("--write", action="store_true", help="replace the tables of docs/python-speed.md")
    arguments = parser.parse_args()
    if arguments.write:
        if arguments.quick:
            parser.error("--write wants a whole run, not --quick")
        # before minutes of measuring
        run.split_readme(BEGIN, END, PAGE)
    plan = run.Plan(
        arguments.work.resolve(), 1 if arguments.quick else arguments.rounds, 3 if arguments.quick else 15, 5
    )
    plan.work.mkdir(parents=True, exist_ok=True)
    run.ENVIRONMENT.update(OMP_NUM_THREADS="1", NUMBA_NUM_THREADS="1", NUMBA_CACHE_DIR=str(plan.work / "numba"))
    run.make_environment(plan)
    install(plan)
    text, bars = report(plan)
    print(text)
    if arguments.write:
        run.write_readme(f"\n{text}\n\n", BEGIN, END, PAGE)
    sys.exit(1 if any(bar.missed for bar in bars) else 0)


if __name__ == "__main__":
    main()
