"""Peer: numba, the reduced form as an explicit parallel loop over the rows."""

from __future__ import annotations

import math

import numba
import numpy as np

import common


@numba.njit(parallel=True, fastmath=False, error_model="numpy", cache=True)
def track(
    sun_east: float,
    sun_north: float,
    sun_up: float,
    target_east: common.Floats,
    target_north: common.Floats,
    target_up: common.Floats,
    two_slants: common.Floats,
    tilt_north: common.Floats,
    tilt_east: common.Floats,
    tilt_w: common.Floats,
    sec_tau1: common.Floats,
    tan_tau1_sin_mu: common.Floats,
    tan_tau1: common.Floats,
    sin_mu_sec_tau1: common.Floats,
    azimuth_reference_rad: common.Floats,
    elevation_reference_rad: common.Floats,
    axis1_min_rad: common.Floats,
    axis1_max_rad: common.Floats,
    axis2_min_rad: common.Floats,
    axis2_max_rad: common.Floats,
    azimuth_rad: common.Floats,
    elevation_rad: common.Floats,
    incidence_rad: common.Floats,
    status: np.ndarray,
) -> None:
    for i in numba.prange(len(status)):
        t1, t2, t3 = target_north[i], target_east[i], target_up[i]
        cos_two_theta = sun_north * t1 + sun_east * t2 + sun_up * t3
        sin_squared = 0.5 - 0.5 * cos_two_theta
        cos_theta = math.sqrt(0.5 + 0.5 * cos_two_theta)
        # (9): ratio = C / (2L/Hz C - cos(theta)), C = sqrt(1 - ratio^2 sin(theta)^2), from C = 1
        slants = two_slants[i]
        ratio = 1.0 / (slants - cos_theta)
        cos_tau = math.sqrt(1.0 - ratio * ratio * sin_squared)
        ratio = cos_tau / (slants * cos_tau - cos_theta)
        cos_tau = math.sqrt(1.0 - ratio * ratio * sin_squared)
        ratio = cos_tau / (slants * cos_tau - cos_theta)
        cos_incidence = cos_tau * cos_theta - ratio * sin_squared
        # (16): n = (along - across) s + (along + across) t
        sun_part = 0.5 * (cos_tau / cos_theta - ratio)
        target_part = sun_part + ratio
        n1 = sun_part * sun_north + target_part * t1
        n2 = sun_part * sun_east + target_part * t2
        n3 = sun_part * sun_up + target_part * t3
        # c = A n
        p, q, w = tilt_north[i], tilt_east[i], tilt_w[i]
        tilt = p * n1 + q * n2
        lift = n3 + w * tilt
        c1 = n1 - p * lift
        c2 = n2 - q * lift
        c3 = n3 * (1.0 - w * (p * p + q * q)) + tilt
        # (22)-(27)
        d2 = sin_mu_sec_tau1[i] - tan_tau1[i] * c3
        d1_squared = c1 * c1 + c2 * c2 - d2 * d2
        d1 = math.sqrt(max(d1_squared, 0.0))
        elevation = math.atan2(c3 * sec_tau1[i] - tan_tau1_sin_mu[i], d1) + elevation_reference_rad[i]
        azimuth = math.atan2(c2 * d1 - c1 * d2, c1 * d1 + c2 * d2) + azimuth_reference_rad[i]
        if azimuth < 0.0:
            azimuth += common.TWO_PI
        if azimuth >= common.TWO_PI:
            azimuth -= common.TWO_PI
        if not cos_incidence > common.MIN_COS_INCIDENCE:
            code = common.SUN_OPPOSES_AIM
        elif d1_squared < 0.0:
            code = common.UNREACHABLE
        elif (
            azimuth < axis1_min_rad[i]
            or azimuth > axis1_max_rad[i]
            or elevation < axis2_min_rad[i]
            or elevation > axis2_max_rad[i]
        ):
            code = common.OUTSIDE_LIMITS
        else:
            code = common.OK
        status[i] = code
        azimuth_rad[i] = azimuth if code == common.OK else math.nan
        elevation_rad[i] = elevation if code == common.OK else math.nan
        incidence_rad[i] = 0.5 * math.acos(cos_two_theta) if code == common.OK else math.nan


def main() -> None:
    arguments = common.parse_arguments(__doc__ or "")
    numba.set_num_threads(arguments.threads)
    columns, sun = common.read_field(arguments.input)
    constants = tuple(common.prepare(columns).values())
    n = len(columns["east_m"])
    answers = common.empty_answers(n)
    common.report(
        "numba_reduced", numba.__version__, arguments, n, lambda: track(*sun, *constants, *answers), lambda: answers
    )


if __name__ == "__main__":
    main()
