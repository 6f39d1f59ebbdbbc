"""Peer: JAX on the CPU, the reduced form jitted in float64.

XLA keeps one pool of threads a process, made at first use; ``--threads`` restricts the process to
that many processors before it.
"""

from __future__ import annotations

import os
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import common

jax.config.update("jax_platforms", "cpu")
jax.config.update("jax_enable_x64", True)


@jax.jit
def track(k: dict[str, jax.Array], sun: common.Sun) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    t1, t2, t3 = k["target_north"], k["target_east"], k["target_up"]
    cos_two_theta = sun.north * t1 + sun.east * t2 + sun.up * t3
    sin_squared = 0.5 - 0.5 * cos_two_theta
    cos_theta = jnp.sqrt(0.5 + 0.5 * cos_two_theta)
    # (9): ratio = C / (2L/Hz C - cos(theta)), C = sqrt(1 - ratio^2 sin(theta)^2), from C = 1
    cos_tau: Any = 1.0
    ratio = 1.0 / (k["two_slants"] - cos_theta)
    for _ in range(2):
        cos_tau = jnp.sqrt(1.0 - ratio * ratio * sin_squared)
        ratio = cos_tau / (k["two_slants"] * cos_tau - cos_theta)
    cos_incidence = cos_tau * cos_theta - ratio * sin_squared
    # (16): n = (along - across) s + (along + across) t
    sun_part = 0.5 * (cos_tau / cos_theta - ratio)
    target_part = sun_part + ratio
    n1 = sun_part * sun.north + target_part * t1
    n2 = sun_part * sun.east + target_part * t2
    n3 = sun_part * sun.up + target_part * t3
    # c = A n
    p, q, w = k["tilt_north"], k["tilt_east"], k["tilt_w"]
    tilt = p * n1 + q * n2
    lift = n3 + w * tilt
    c1, c2 = n1 - p * lift, n2 - q * lift
    c3 = n3 * (1.0 - w * (p * p + q * q)) + tilt
    # (22)-(27)
    d2 = k["sin_mu_sec_tau1"] - k["tan_tau1"] * c3
    d1_squared = c1 * c1 + c2 * c2 - d2 * d2
    d1 = jnp.sqrt(jnp.maximum(d1_squared, 0.0))
    elevation = jnp.arctan2(c3 * k["sec_tau1"] - k["tan_tau1_sin_mu"], d1) + k["elevation_reference_rad"]
    azimuth = jnp.arctan2(c2 * d1 - c1 * d2, c1 * d1 + c2 * d2) + k["azimuth_reference_rad"]
    azimuth = jnp.where(azimuth < 0.0, azimuth + common.TWO_PI, azimuth)
    azimuth = jnp.where(azimuth >= common.TWO_PI, azimuth - common.TWO_PI, azimuth)
    outside = (
        (azimuth < k["axis1_min_rad"])
        | (azimuth > k["axis1_max_rad"])
        | (elevation < k["axis2_min_rad"])
        | (elevation > k["axis2_max_rad"])
    )
    status = jnp.where(outside, jnp.uint8(common.OUTSIDE_LIMITS), jnp.uint8(common.OK))
    status = jnp.where(d1_squared < 0.0, jnp.uint8(common.UNREACHABLE), status)
    status = jnp.where(cos_incidence > common.MIN_COS_INCIDENCE, status, jnp.uint8(common.SUN_OPPOSES_AIM))
    bad = status != common.OK
    incidence = jnp.arctan2(jnp.sqrt(sin_squared), cos_theta)
    return (
        jnp.where(bad, jnp.nan, azimuth),
        jnp.where(bad, jnp.nan, elevation),
        jnp.where(bad, jnp.nan, incidence),
        status,
    )


def main() -> None:
    arguments = common.parse_arguments(__doc__ or "")
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: arguments.threads])
    columns, sun = common.read_field(arguments.input)
    constants = {name: jnp.asarray(column) for name, column in common.prepare(columns).items()}
    common.report(
        "jax_reduced",
        jax.__version__,
        arguments,
        len(columns["east_m"]),
        lambda: jax.block_until_ready(track(constants, sun)),
        lambda: common.Answers(*(np.asarray(column) for column in track(constants, sun))),
    )


if __name__ == "__main__":
    main()
