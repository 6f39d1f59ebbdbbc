"""What every Python peer shares: the synthetic field, the file formats, the clock and the command line.

Input file: raw little-endian float64, the columns of ``COLUMNS`` one after another, n values each.
Its sidecar (same name, suffix ``.json``) holds ``n``, ``seed``, ``sun_azimuth_rad`` and
``sun_elevation_rad``. Vectors are east-north-up by name, azimuths clockwise from north.

Answer file: azimuth, elevation and incidence [rad] as float64 columns, then one status byte a row.
Azimuth and elevation are encoder angles, the azimuth in [0, 2 pi); angles are NaN in rows that are
not ok. Equation numbers are those of Guo et al. 2015.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Columns: TypeAlias = dict[str, Floats]
Kind: TypeAlias = Literal["operating", "outside", "edge"]

COLUMNS = (
    "east_m",
    "north_m",
    "up_m",
    "mirror_offset_m",
    "pedestal_tilt_azimuth_rad",
    "pedestal_tilt_rad",
    "axis_nonorthogonality_rad",
    "mirror_tilt_rad",
    "azimuth_reference_rad",
    "elevation_reference_rad",
    "axis1_min_rad",
    "axis1_max_rad",
    "axis2_min_rad",
    "axis2_max_rad",
)

OK, UNREACHABLE, OUTSIDE_LIMITS, SUN_OPPOSES_AIM = 0, 1, 2, 4
MIN_COS_INCIDENCE = 1e-6
TWO_PI = 2.0 * np.pi

SUN_AZIMUTH_DEG, SUN_ELEVATION_DEG = 200.0, 45.0
NEAR_LIMIT_RAD = 1e-7
MIN_REPEAT_S = 0.02


class Sun(NamedTuple):
    """Unit vector toward the sun."""

    east: float
    north: float
    up: float

    @classmethod
    def from_angles(cls, azimuth_rad: float, elevation_rad: float) -> Sun:
        level = np.cos(elevation_rad)
        return cls(float(level * np.sin(azimuth_rad)), float(level * np.cos(azimuth_rad)), float(np.sin(elevation_rad)))


class Answers(NamedTuple):
    """One entry per heliostat, in the order of the input."""

    azimuth_rad: Floats
    elevation_rad: Floats
    incidence_rad: Floats
    status: NDArray[np.uint8]


def empty_answers(n: int) -> Answers:
    return Answers(np.empty(n), np.empty(n), np.empty(n), np.empty(n, np.uint8))


# --- files ---------------------------------------------------------------------------------------


def sidecar_of(path: Path) -> Path:
    return path.with_suffix(".json")


def read_field(path: Path) -> tuple[Columns, Sun]:
    about = json.loads(sidecar_of(path).read_text())
    table = np.fromfile(path, "<f8").reshape(len(COLUMNS), about["n"])
    columns = {name: np.array(row) for name, row in zip(COLUMNS, table, strict=True)}
    return columns, Sun.from_angles(about["sun_azimuth_rad"], about["sun_elevation_rad"])


def write_answers(path: Path, answers: Answers) -> None:
    with path.open("wb") as file:
        for column in answers[:3]:
            file.write(np.ascontiguousarray(column, "<f8").tobytes())
        file.write(np.ascontiguousarray(answers.status, np.uint8).tobytes())


def read_answers(path: Path) -> Answers:
    raw = path.read_bytes()
    n = len(raw) // 25
    angles = np.frombuffer(raw, "<f8", 3 * n).reshape(3, n)
    return Answers(angles[0], angles[1], angles[2], np.frombuffer(raw, np.uint8, n, 24 * n))


# --- the reduced form ----------------------------------------------------------------------------


def prepare(columns: Columns, dtype: type[np.floating[Any]] = np.float64) -> dict[str, NDArray[Any]]:
    """Constants of each heliostat for the reduced form: thirteen numbers besides the four limits.

    The tilt matrix is A = [[1 - w p^2, -w p q, -p], [-w p q, 1 - w q^2, -q], [p, q, cos]] in
    (north, east, up), with p, q the horizontal components of the tilted axis and w = 1/(1 + cos).
    """
    c = {name: column.astype(dtype) for name, column in columns.items()}
    slant_m = np.sqrt(c["east_m"] ** 2 + c["north_m"] ** 2 + c["up_m"] ** 2)
    tilt = np.sin(c["pedestal_tilt_rad"])
    cos_tau1 = np.cos(c["axis_nonorthogonality_rad"])
    sin_mu = np.sin(c["mirror_tilt_rad"])
    tan_tau1 = np.tan(c["axis_nonorthogonality_rad"])
    two_pi = 8 * np.arctan(dtype(1))
    return {
        "target_east": c["east_m"] / slant_m,
        "target_north": c["north_m"] / slant_m,
        "target_up": c["up_m"] / slant_m,
        "two_slants": 2 * slant_m / c["mirror_offset_m"],
        "tilt_north": tilt * np.cos(c["pedestal_tilt_azimuth_rad"]),
        "tilt_east": tilt * np.sin(c["pedestal_tilt_azimuth_rad"]),
        "tilt_w": 1 / (1 + np.cos(c["pedestal_tilt_rad"])),
        "sec_tau1": 1 / cos_tau1,
        "tan_tau1_sin_mu": tan_tau1 * sin_mu,
        "tan_tau1": tan_tau1,
        "sin_mu_sec_tau1": sin_mu / cos_tau1,
        "azimuth_reference_rad": np.mod(c["azimuth_reference_rad"], two_pi),
        "elevation_reference_rad": c["elevation_reference_rad"],
        "axis1_min_rad": c["axis1_min_rad"],
        "axis1_max_rad": c["axis1_max_rad"],
        "axis2_min_rad": c["axis2_min_rad"],
        "axis2_max_rad": c["axis2_max_rad"],
    }


class Plain(NamedTuple):
    """Answers of the plain evaluation, with the numbers that say how well conditioned a row is."""

    answers: Answers
    d1_squared: NDArray[Any]
    axis_azimuth_rad: NDArray[Any]


def evaluate_plain(
    columns: Columns,
    sun_angles_rad: tuple[float, float],
    dtype: type[np.floating[Any]] = np.float64,
    over_the_top: bool = False,
) -> Plain:
    """The reduced form written for reading; with ``np.longdouble`` it is the reference answer.

    Two solutions differ in the sign of d1: direct, and with the second axis over the top.
    """
    k = prepare(columns, dtype)
    sun_azimuth, sun_elevation = dtype(sun_angles_rad[0]), dtype(sun_angles_rad[1])
    sun_east = np.cos(sun_elevation) * np.sin(sun_azimuth)
    sun_north = np.cos(sun_elevation) * np.cos(sun_azimuth)
    sun_up = np.sin(sun_elevation)
    two_pi = 8 * np.arctan(dtype(1))

    plus = [sun_east + k["target_east"], sun_north + k["target_north"], sun_up + k["target_up"]]
    minus = [k["target_east"] - sun_east, k["target_north"] - sun_north, k["target_up"] - sun_up]
    cos_theta = np.sqrt(sum(x * x for x in plus)) / 2
    sin_theta = np.sqrt(sum(x * x for x in minus)) / 2
    cos_tau = np.ones_like(cos_theta)
    for _ in range(6):
        ratio = cos_tau / (k["two_slants"] * cos_tau - cos_theta)
        cos_tau = np.sqrt(1 - (ratio * sin_theta) ** 2)
    cos_incidence = cos_tau * cos_theta - ratio * sin_theta**2
    with np.errstate(divide="ignore", invalid="ignore"):
        east, north, up = (
            cos_tau / cos_theta * p / 2 + ratio * m / 2 for p, m in zip(plus, minus, strict=True)
        )  # (16)
    tilt = k["tilt_north"] * north + k["tilt_east"] * east
    lift = up + k["tilt_w"] * tilt
    c1, c2 = north - k["tilt_north"] * lift, east - k["tilt_east"] * lift
    cos_tilt = 1 - k["tilt_w"] * (k["tilt_north"] ** 2 + k["tilt_east"] ** 2)
    c3 = up * cos_tilt + tilt
    d2 = k["sin_mu_sec_tau1"] - k["tan_tau1"] * c3  # (24)
    d1_squared = c1 * c1 + c2 * c2 - d2 * d2  # (23)
    d1 = np.sqrt(np.maximum(d1_squared, 0)) * (-1 if over_the_top else 1)
    azimuth = np.arctan2(c2 * d1 - c1 * d2, c1 * d1 + c2 * d2)  # (25)-(27)
    elevation = np.arctan2(c3 * k["sec_tau1"] - k["tan_tau1_sin_mu"], d1) + k["elevation_reference_rad"]
    encoder = azimuth + k["azimuth_reference_rad"]
    encoder = np.where(encoder < 0, encoder + two_pi, encoder)
    encoder = np.where(encoder >= two_pi, encoder - two_pi, encoder)
    outside = (
        (encoder < k["axis1_min_rad"])
        | (encoder > k["axis1_max_rad"])
        | (elevation < k["axis2_min_rad"])
        | (elevation > k["axis2_max_rad"])
    )
    status = np.where(outside, OUTSIDE_LIMITS, OK)
    status = np.where(d1_squared < 0, UNREACHABLE, status)
    status = np.where(cos_incidence > MIN_COS_INCIDENCE, status, SUN_OPPOSES_AIM)
    bad = status != OK
    theta = np.arctan2(sin_theta, cos_theta)
    encoder, elevation, theta = (np.where(bad, np.nan, angle) for angle in (encoder, elevation, theta))
    return Plain(Answers(encoder, elevation, theta, status.astype(np.uint8)), d1_squared, azimuth)


# --- the field -----------------------------------------------------------------------------------


def _draw(rng: np.random.Generator, n: int, kind: Kind) -> Columns:
    bearing = np.where(rng.random(n) < 0.6, rng.normal(0.0, 0.7, n), rng.uniform(-np.pi, np.pi, n))
    distance = np.sqrt(rng.uniform(100.0**2, 1500.0**2, n))
    offset = rng.uniform(0.15, 0.4, n)
    level = np.stack([-distance * np.sin(bearing), -distance * np.cos(bearing), 200.0 - rng.uniform(3.0, 8.0, n)])
    near = rng.random(n) < 0.02
    scale = np.where(near, rng.uniform(15.0, 60.0, n) * offset / np.linalg.norm(level, axis=0), 1.0)
    aim = level * scale
    if kind == "edge":  # aim points nearly behind the mirror, which no tower field has
        toward_sun = np.array(Sun.from_angles(np.radians(SUN_AZIMUTH_DEG), np.radians(SUN_ELEVATION_DEG)))
        opposite = rng.random(n) < 0.1
        aim = np.where(opposite, -60.0 * offset * (toward_sun[:, None] + rng.normal(0.0, 0.02, (3, n))), aim)
    one_degree = np.radians(1.0)
    alpha0 = rng.uniform(-10.0, 10.0, n) * one_degree
    errors = 15.0 if kind == "edge" else 1.0
    narrow = 0.0 if kind == "operating" else 0.01
    narrow1, narrow2 = rng.random(n) < narrow, rng.random(n) < narrow
    start1 = rng.uniform(0.0, np.pi, n)
    return {
        "east_m": aim[0],
        "north_m": aim[1],
        "up_m": aim[2],
        "mirror_offset_m": offset,
        "pedestal_tilt_azimuth_rad": rng.uniform(0.0, TWO_PI, n),
        "pedestal_tilt_rad": np.where(
            rng.random(n) < 0.8, rng.uniform(0.0, 0.01, n), rng.uniform(0.0, errors * one_degree, n)
        ),
        "axis_nonorthogonality_rad": rng.uniform(-errors, errors, n) * one_degree,
        "mirror_tilt_rad": rng.uniform(-errors, errors, n) * one_degree,
        "azimuth_reference_rad": rng.uniform(-np.pi, np.pi, n),
        "elevation_reference_rad": alpha0,
        "axis1_min_rad": np.where(narrow1, start1, 0.0),
        "axis1_max_rad": np.where(narrow1, start1 + np.pi, TWO_PI),
        "axis2_min_rad": alpha0 - 10.0 * one_degree,
        "axis2_max_rad": alpha0 + np.where(narrow2, 40.0, 95.0) * one_degree,
    }


def _solutions(columns: Columns, sun: tuple[float, float]) -> tuple[Plain, NDArray[np.bool_], NDArray[np.bool_]]:
    """The answers; rows that come within ``NEAR_LIMIT_RAD`` of a limit; rows that the solution over the top serves.

    Peers know the direct solution only. A tracker that also turns over the top answers a row whose direct
    solution lies outside the limits and whose other one does not.
    """
    limits = {"axis1_min_rad": 0.0, "axis1_max_rad": TWO_PI, "axis2_min_rad": -np.inf, "axis2_max_rad": np.inf}
    free = columns | {name: np.full_like(columns["east_m"], limit) for name, limit in limits.items()}
    direct, other = evaluate_plain(free, sun).answers, evaluate_plain(free, sun, over_the_top=True).answers
    near = np.zeros(len(direct.status), np.bool_)
    within = other.status == OK
    for angle, other_angle, axis in (
        (direct.azimuth_rad, other.azimuth_rad, "axis1"),
        (direct.elevation_rad, other.elevation_rad, "axis2"),
    ):
        low, high = columns[f"{axis}_min_rad"], columns[f"{axis}_max_rad"]
        inside = np.zeros_like(near)
        for turn in (-TWO_PI, 0.0, TWO_PI):
            near |= np.abs(angle + turn - low) < NEAR_LIMIT_RAD
            near |= np.abs(angle + turn - high) < NEAR_LIMIT_RAD
            near |= np.abs(other_angle + turn - low) < NEAR_LIMIT_RAD
            near |= np.abs(other_angle + turn - high) < NEAR_LIMIT_RAD
            inside |= (other_angle + turn >= low) & (other_angle + turn <= high)
        within &= inside
    plain = evaluate_plain(columns, sun)
    return plain, near, within & (plain.answers.status == OUTSIDE_LIMITS)


def make_field(n: int, seed: int, kind: Kind = "operating") -> Columns:
    """A tower field, mostly north of the tower.

    ``operating``: every row has limits of its own and lies within them. ``outside``: about one row in a
    hundred lies outside its limits. ``edge``: full of statuses, for checking and not for timing.

    Rows where arccos or arcsin lose digits are drawn again, so that the printed formula can be held
    to the same tolerance as the others: incidence below 0.5 degrees, azimuth (before its encoder
    reference) within 3 mrad of 0 or 180 degrees, mirror within 5 mrad of face up or of unreachable,
    and grazing incidence (80 to 89.7 degrees, where the sun is about to oppose the aim). So are rows
    whose status rounding could decide, and those that only the solution over the top serves.
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    sun = (float(np.radians(SUN_AZIMUTH_DEG)), float(np.radians(SUN_ELEVATION_DEG)))
    columns = _draw(rng, n, kind)
    while True:
        plain, near, over_the_top = _solutions(columns, sun)
        aim = np.stack([columns["east_m"], columns["north_m"], columns["up_m"]])
        cos_two_theta = np.array(Sun.from_angles(*sun)) @ (aim / np.linalg.norm(aim, axis=0))
        theta_deg = np.degrees(0.5 * np.arccos(np.clip(cos_two_theta, -1, 1)))
        poor = (theta_deg < 0.5) | ((theta_deg > 80.0) & (theta_deg < 89.7))
        poor |= np.abs(np.sin(plain.axis_azimuth_rad)) < 3e-3
        poor |= np.abs(plain.d1_squared) < 2.5e-5
        poor |= near | over_the_top
        if kind == "operating":
            poor |= plain.answers.status != OK
        count = int(np.count_nonzero(poor))
        if count == 0:
            break
        fresh = _draw(rng, count, kind)
        for name, column in columns.items():
            column[poor] = fresh[name]
    if kind == "operating":  # a range of axis 1 for each heliostat, around where it is to point
        azimuth = plain.answers.azimuth_rad
        columns["axis1_min_rad"] = azimuth * rng.uniform(0.0, 0.9, n)
        columns["axis1_max_rad"] = TWO_PI - (TWO_PI - azimuth) * rng.uniform(0.0, 0.9, n)
    return columns


def write_field(path: Path, n: int, seed: int, kind: Kind = "operating") -> None:
    columns = make_field(n, seed, kind)
    with path.open("wb") as file:
        for name in COLUMNS:
            file.write(columns[name].astype("<f8").tobytes())
    about = {
        "n": n,
        "seed": seed,
        "kind": kind,
        "sun_azimuth_rad": float(np.radians(SUN_AZIMUTH_DEG)),
        "sun_elevation_rad": float(np.radians(SUN_ELEVATION_DEG)),
    }
    sidecar_of(path).write_text(json.dumps(about) + "\n")


# --- the clock and the command line --------------------------------------------------------------


def parse_arguments(description: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--input", type=Path, required=True, metavar="FILE")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeat", type=int, default=11)
    parser.add_argument("--output", type=Path, metavar="ANSWERS.bin")
    return parser.parse_args()


def time_call(call: Callable[[], object], repeat: int) -> tuple[float, float]:
    """Minimum and median seconds of one call; each repeat loops for at least ``MIN_REPEAT_S``."""
    call()
    loops = 1
    while True:
        start = time.perf_counter()
        for _ in range(loops):
            call()
        elapsed = time.perf_counter() - start
        if elapsed >= MIN_REPEAT_S:
            break
        loops = max(2 * loops, int(1.2 * loops * MIN_REPEAT_S / max(elapsed, 1e-9)))
    seconds = []
    for _ in range(repeat):
        start = time.perf_counter()
        for _ in range(loops):
            call()
        seconds.append((time.perf_counter() - start) / loops)
    return min(seconds), statistics.median(seconds)


def report(
    peer: str,
    version: str,
    arguments: argparse.Namespace,
    n: int,
    call: Callable[[], object],
    answers: Callable[[], Answers],
) -> None:
    """Times ``call``, prints the JSON line and writes the answers if asked to."""
    if arguments.output is not None:
        call()
        write_answers(arguments.output, answers())
    minimum, median = time_call(call, arguments.repeat)
    line = {
        "peer": peer,
        "version": version,
        "n": n,
        "threads": arguments.threads,
        "ns_per_heliostat": {"minimum": minimum / n * 1e9, "median": median / n * 1e9},
    }
    print(json.dumps(line))
