"""Peer: NumPy, the reduced form: half-angle square roots, no trigonometry for tau, arctan2 at the end.

Works in blocks small enough for the caches, in buffers made once; every ufunc writes to ``out``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import common

BLOCK = 8192  # rows: long enough to hide the cost of a call, and the scratch stays in 1 MiB of cache


class Block(NamedTuple):
    """Views of one run of rows: its constants, its part of the answers, the shared scratch."""

    constants: common.Columns
    answers: common.Answers
    floats: tuple[common.Floats, ...]
    flags: tuple[np.ndarray, np.ndarray]


def make_blocks(constants: common.Columns, answers: common.Answers, block: int = BLOCK) -> list[Block]:
    n = len(answers.status)
    floats = [np.empty(min(block, n)) for _ in range(10)]
    flags = [np.empty(min(block, n), bool) for _ in range(2)]
    blocks = []
    for start in range(0, n, block):
        rows = slice(start, min(start + block, n))
        size = rows.stop - start
        blocks.append(
            Block(
                {name: column[rows] for name, column in constants.items()},
                common.Answers(
                    answers.azimuth_rad[rows],
                    answers.elevation_rad[rows],
                    answers.incidence_rad[rows],
                    answers.status[rows],
                ),
                tuple(column[:size] for column in floats),
                (flags[0][:size], flags[1][:size]),
            )
        )
    return blocks


def track_block(block: Block, sun: common.Sun) -> None:
    k = block.constants
    azimuth, elevation, incidence, status = block.answers
    cos_theta, sin_squared, cos_tau, ratio, x, y, z, c1, c2, c3 = block.floats
    bad, flag = block.flags

    # s.t, and from it theta, cos(theta), sin(theta)^2
    np.multiply(k["target_east"], sun.east, out=x)
    np.multiply(k["target_north"], sun.north, out=y)
    np.add(x, y, out=x)
    np.multiply(k["target_up"], sun.up, out=y)
    np.add(x, y, out=x)
    np.multiply(x, 0.5, out=y)
    np.arccos(x, out=incidence)
    np.multiply(incidence, 0.5, out=incidence)
    np.subtract(0.5, y, out=sin_squared)
    np.add(0.5, y, out=y)
    np.sqrt(y, out=cos_theta)

    # (9): ratio = C / (2L/Hz C - cos(theta)), C = sqrt(1 - ratio^2 sin(theta)^2), from C = 1
    np.subtract(k["two_slants"], cos_theta, out=x)
    np.divide(1.0, x, out=ratio)
    for _ in range(2):
        np.multiply(ratio, ratio, out=x)
        np.multiply(x, sin_squared, out=x)
        np.subtract(1.0, x, out=x)
        np.sqrt(x, out=cos_tau)
        np.multiply(k["two_slants"], cos_tau, out=x)
        np.subtract(x, cos_theta, out=x)
        np.divide(cos_tau, x, out=ratio)
    np.multiply(cos_tau, cos_theta, out=x)
    np.multiply(ratio, sin_squared, out=sin_squared)
    np.subtract(x, sin_squared, out=x)  # s.n
    np.less_equal(x, common.MIN_COS_INCIDENCE, out=bad)
    status.fill(common.OK)
    any_opposes = bool(bad.any())
    if any_opposes:
        status[bad] = common.SUN_OPPOSES_AIM

    # (16): n = (along - across) s + (along + across) t
    np.divide(cos_tau, cos_theta, out=cos_tau)
    np.subtract(cos_tau, ratio, out=x)
    np.multiply(x, 0.5, out=x)
    np.add(x, ratio, out=y)
    np.multiply(x, sun.north, out=c1)
    np.multiply(x, sun.east, out=c2)
    np.multiply(x, sun.up, out=c3)
    for component, name in ((c1, "target_north"), (c2, "target_east"), (c3, "target_up")):
        np.multiply(y, k[name], out=x)
        np.add(component, x, out=component)

    # c = A n
    np.multiply(k["tilt_north"], c1, out=x)
    np.multiply(k["tilt_east"], c2, out=y)
    np.add(x, y, out=x)
    np.multiply(k["tilt_w"], x, out=y)
    np.add(y, c3, out=y)
    np.multiply(c3, k["cos_tilt"], out=c3)
    np.add(c3, x, out=c3)
    np.multiply(k["tilt_north"], y, out=x)
    np.subtract(c1, x, out=c1)
    np.multiply(k["tilt_east"], y, out=x)
    np.subtract(c2, x, out=c2)

    # (24), (23): y = d2, z = d1
    np.multiply(k["tan_tau1"], c3, out=y)
    np.subtract(k["sin_mu_sec_tau1"], y, out=y)
    np.multiply(c1, c1, out=z)
    np.multiply(c2, c2, out=x)
    np.add(z, x, out=z)
    np.multiply(y, y, out=x)
    np.subtract(z, x, out=z)
    np.less(z, 0.0, out=flag)
    any_unreachable = bool(flag.any())
    if any_unreachable:
        status[flag & ~bad] = common.UNREACHABLE
        np.logical_or(bad, flag, out=bad)
    np.sqrt(z, out=z)

    # elevation from (22)
    np.multiply(c3, k["sec_tau1"], out=c3)
    np.subtract(c3, k["tan_tau1_sin_mu"], out=c3)
    np.arctan2(c3, z, out=elevation)
    np.add(elevation, k["elevation_reference_rad"], out=elevation)

    # azimuth from (25) and (26), wrapped
    np.multiply(c1, z, out=x)
    np.multiply(c2, y, out=c3)
    np.add(x, c3, out=x)
    np.multiply(c2, z, out=c2)
    np.multiply(c1, y, out=c1)
    np.subtract(c2, c1, out=y)
    np.arctan2(y, x, out=azimuth)
    np.add(azimuth, k["azimuth_reference_rad"], out=azimuth)
    np.less(azimuth, 0.0, out=flag)
    np.multiply(flag, common.TWO_PI, out=x)
    np.add(azimuth, x, out=azimuth)
    np.greater_equal(azimuth, common.TWO_PI, out=flag)
    np.multiply(flag, common.TWO_PI, out=x)
    np.subtract(azimuth, x, out=azimuth)

    # the four limits; a clipped angle differs from itself only when it is outside
    np.maximum(azimuth, k["axis1_min_rad"], out=x)
    np.minimum(x, k["axis1_max_rad"], out=x)
    np.not_equal(x, azimuth, out=flag)
    np.maximum(elevation, k["axis2_min_rad"], out=y)
    np.minimum(y, k["axis2_max_rad"], out=y)
    if any_opposes or any_unreachable:
        outside = (flag | (y != elevation)) & ~bad
        status[outside] = common.OUTSIDE_LIMITS
        np.logical_or(bad, outside, out=bad)
    else:
        np.not_equal(y, elevation, out=bad)
        np.logical_or(bad, flag, out=bad)
        np.multiply(bad, np.uint8(common.OUTSIDE_LIMITS), out=status)
    for angle in (azimuth, elevation, incidence):
        np.copyto(angle, np.nan, where=bad)


def track(blocks: list[Block], sun: common.Sun) -> None:
    for block in blocks:
        track_block(block, sun)


def main() -> None:
    arguments = common.parse_arguments(__doc__ or "")
    if arguments.threads != 1:
        raise SystemExit("numpy_reduced: one thread only")
    columns, sun = common.read_field(arguments.input)
    constants = common.prepare(columns)
    constants["cos_tilt"] = np.cos(columns["pedestal_tilt_rad"])
    n = len(columns["east_m"])
    answers = common.empty_answers(n)
    blocks = make_blocks(constants, answers)
    np.seterr(invalid="ignore", divide="ignore")
    common.report("numpy_reduced", np.__version__, arguments, n, lambda: track(blocks, sun), lambda: answers)


if __name__ == "__main__":
    main()
