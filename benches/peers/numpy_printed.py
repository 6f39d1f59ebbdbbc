"""Peer: NumPy, the formula as printed: (4), (8), (9), (16), (22)-(24), (27) of Guo et al. 2015."""

from __future__ import annotations

import numpy as np

import common


def prepare_printed(columns: common.Columns) -> common.Columns:
    """Constants of (19): the tilt matrix A, and sines and cosines of tau1 and mu."""
    north, east, up = columns["north_m"], columns["east_m"], columns["up_m"]
    slant_m = np.sqrt(north * north + east * east + up * up)
    cos_a, sin_a = np.cos(columns["pedestal_tilt_azimuth_rad"]), np.sin(columns["pedestal_tilt_azimuth_rad"])
    cos_t, sin_t = np.cos(columns["pedestal_tilt_rad"]), np.sin(columns["pedestal_tilt_rad"])
    return columns | {
        "slant_m": slant_m,
        "target_north": north / slant_m,
        "target_east": east / slant_m,
        "target_up": up / slant_m,
        "a11": cos_a * cos_t * cos_a + sin_a * sin_a,
        "a12": cos_a * cos_t * sin_a - sin_a * cos_a,
        "a13": -cos_a * sin_t,
        "a21": sin_a * cos_t * cos_a - cos_a * sin_a,
        "a22": sin_a * cos_t * sin_a + cos_a * cos_a,
        "a23": -sin_a * sin_t,
        "a31": sin_t * cos_a,
        "a32": sin_t * sin_a,
        "a33": cos_t,
        "sin_tau1": np.sin(columns["axis_nonorthogonality_rad"]),
        "cos_tau1": np.cos(columns["axis_nonorthogonality_rad"]),
        "sin_mu": np.sin(columns["mirror_tilt_rad"]),
        "cos_mu": np.cos(columns["mirror_tilt_rad"]),
    }


def track(k: common.Columns, sun: common.Sun) -> common.Answers:
    t1, t2, t3 = k["target_north"], k["target_east"], k["target_up"]
    s1, s2, s3 = sun.north, sun.east, sun.up

    theta = 0.5 * np.arccos(s1 * t1 + s2 * t2 + s3 * t3)  # (4)
    sin_theta, cos_theta = np.sin(theta), np.cos(theta)
    offset_m, slant_m = k["mirror_offset_m"], k["slant_m"]
    tau = np.arcsin(offset_m * sin_theta / (2.0 * slant_m - offset_m * cos_theta))  # (8)
    for _ in range(2):  # Newton on (9)
        value = slant_m / offset_m * np.sin(2.0 * tau) - np.sin(theta + tau)
        slope = 2.0 * slant_m / offset_m * np.cos(2.0 * tau) - np.cos(theta + tau)
        tau = tau - value / slope
    along = np.cos(tau) / cos_theta / 2.0  # (16)
    across = np.sin(tau) / sin_theta / 2.0
    n1 = along * (s1 + t1) + across * (t1 - s1)
    n2 = along * (s2 + t2) + across * (t2 - s2)
    n3 = along * (s3 + t3) + across * (t3 - s3)

    c1 = k["a11"] * n1 + k["a12"] * n2 + k["a13"] * n3
    c2 = k["a21"] * n1 + k["a22"] * n2 + k["a23"] * n3
    c3 = k["a31"] * n1 + k["a32"] * n2 + k["a33"] * n3
    sin_alpha = (c3 - k["sin_tau1"] * k["sin_mu"]) / (k["cos_tau1"] * k["cos_mu"])
    alpha = np.arcsin(sin_alpha)  # (22)
    d2 = k["cos_tau1"] * k["sin_mu"] - k["sin_tau1"] * k["cos_mu"] * sin_alpha  # (24)
    level_squared = c1 * c1 + c2 * c2
    d1_squared = level_squared - d2 * d2
    d1 = np.sqrt(d1_squared)  # (23)
    gamma = np.arccos((c1 * d1 + c2 * d2) / level_squared)  # (27)
    gamma = np.where(c2 * d1 - c1 * d2 >= 0.0, gamma, common.TWO_PI - gamma)

    azimuth = np.mod(gamma + k["azimuth_reference_rad"], common.TWO_PI)
    elevation = alpha + k["elevation_reference_rad"]
    outside = (
        (azimuth < k["axis1_min_rad"])
        | (azimuth > k["axis1_max_rad"])
        | (elevation < k["axis2_min_rad"])
        | (elevation > k["axis2_max_rad"])
    )
    cos_incidence = s1 * n1 + s2 * n2 + s3 * n3
    status = np.where(outside, np.uint8(common.OUTSIDE_LIMITS), np.uint8(common.OK))
    status[d1_squared < 0.0] = common.UNREACHABLE
    status[~(cos_incidence > common.MIN_COS_INCIDENCE)] = common.SUN_OPPOSES_AIM
    bad = status != common.OK
    azimuth[bad] = np.nan
    elevation[bad] = np.nan
    theta[bad] = np.nan
    return common.Answers(azimuth, elevation, theta, status)


def main() -> None:
    arguments = common.parse_arguments(__doc__ or "")
    if arguments.threads != 1:
        raise SystemExit("numpy_printed: one thread only")
    columns, sun = common.read_field(arguments.input)
    constants = prepare_printed(columns)
    np.seterr(invalid="ignore", divide="ignore")
    common.report(
        "numpy_printed",
        np.__version__,
        arguments,
        len(columns["east_m"]),
        lambda: track(constants, sun),
        lambda: track(constants, sun),
    )


if __name__ == "__main__":
    main()
