"""True for any field and sun."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import helio_py as hp

ANGLE = st.floats(-0.1, 0.1)
MODES = st.sampled_from(["azimuth-elevation", "spinning-elevation", "pitch-roll", "polar"])


@st.composite
def fields(draw: st.DrawFn) -> hp.Field:
    n = draw(st.integers(1, 5))
    mode = draw(MODES)
    every: dict[str, dict[str, Any]] = {
        "pitch-roll": {"axis_azimuth_rad": draw(st.floats(-3, 3))},
        "polar": {"latitude_rad": draw(st.floats(-1.2, 1.2))},
    }
    options = every.get(mode, {})

    def column(values: st.SearchStrategy[float]) -> list[float]:
        return draw(st.lists(values, min_size=n, max_size=n))

    metres = st.floats(-900, 900)
    return hp.Field(
        np.c_[column(metres), column(metres), column(st.floats(-20, 20))],
        [draw(metres), draw(metres), draw(st.floats(40, 250))],
        mirror_offset_m=column(st.floats(-0.6, 0.6)),
        pedestal_tilt_rad=column(ANGLE),
        pedestal_tilt_azimuth_rad=column(st.floats(-math.pi, math.pi)),
        axis_nonorthogonality_rad=column(ANGLE),
        mirror_tilt_rad=column(st.floats(-0.05, 0.05)),
        azimuth_reference_rad=column(st.floats(-3, 3)),
        elevation_reference_rad=column(st.floats(-3, 3)),
        mode=mode,
        **options,
    )


@settings(max_examples=150, deadline=None, derandomize=True, database=None)
@given(fields(), st.floats(-6.3, 6.3), st.floats(0.02, math.pi / 2))
def test_the_beam_of_tracked_angles_hits_the_aim(field: hp.Field, azimuth: float, elevation: float) -> None:
    tracking = hp.track(field, azimuth, elevation)
    normal = hp.forward(field, tracking.azimuth_rad, tracking.elevation_rad)
    sun = np.array(
        [math.cos(elevation) * math.sin(azimuth), math.cos(elevation) * math.cos(azimuth), math.sin(elevation)]
    )
    ok = tracking.status == hp.Status.OK
    assert np.isnan(normal).all(axis=1).tolist() == (~ok).tolist()
    assert np.isnan(tracking.azimuth_rad).tolist() == (~ok).tolist()
    for row in np.flatnonzero(ok):
        n = normal[row]
        cosine = sun @ n
        beam = 2 * cosine * n - sun
        to_aim = field.aim_enu_m[row] - (field.position_enu_m[row] + field.mirror_offset_m[row] * n)
        off_rad = np.linalg.norm(np.cross(beam, to_aim)) / np.linalg.norm(to_aim)
        assert beam @ to_aim > 0
        # Rounding of angles, more of it near the horizon of the mirror and for far positions.
        assert off_rad < 2e-13 / max(cosine, 1e-3), (row, off_rad, cosine)


@settings(max_examples=50, deadline=None, derandomize=True, database=None)
@given(fields(), st.lists(st.tuples(st.floats(-6.3, 6.3), st.floats(-0.5, 1.57)), max_size=6))
def test_many_suns_are_each_sun_alone(field: hp.Field, suns: list[tuple[float, float]]) -> None:
    together = hp.track(field, [a for a, _ in suns], [e for _, e in suns])
    for row, (azimuth, elevation) in enumerate(suns):
        alone = hp.track(field, azimuth, elevation)
        assert together.azimuth_rad[row].tobytes() == alone.azimuth_rad.tobytes()
        assert together.status[row].tobytes() == alone.status.tobytes()
        assert (alone.status == hp.Status.SUN_BELOW_HORIZON).all() == (elevation < 0)


@settings(max_examples=50, deadline=None, derandomize=True, database=None)
@given(
    st.lists(st.floats(0.05, 1.2), max_size=8),
    st.floats(0.2, 1.0), st.floats(0.2, 1.0), st.floats(0.0, 0.5), st.sampled_from([1.0, -1.0]),
)  # fmt: skip
def test_steps_lead_back_to_their_angles(angles: list[float], a: float, b: float, bracket: float, sign: float) -> None:
    angle_rad = sign * np.array(angles)
    for drive in (hp.Drive.encoder(1e5, zero_steps=-7.0, sign=sign), hp.Drive.screw(a, b, bracket, 0.1, sign=sign)):
        steps = drive.steps(angle_rad)
        assert steps.shape == angle_rad.shape
        # Beside its end a screw turns angles of 1e-8 into lengths of 1e-16.
        assert np.allclose(drive.angle_rad(steps), angle_rad, rtol=0, atol=1e-7)
    screw = hp.Drive.screw(a, b, bracket, 0.1, sign=sign)
    # Guo 2013: x + x0 = sqrt(a² + b² + 2ab cos(alpha + beta0))
    want = np.sqrt(a * a + b * b + 2 * a * b * np.cos(np.array(angles) + bracket)) - 0.1
    assert np.allclose(screw.steps(angle_rad), want, rtol=0, atol=1e-12)
    assert np.isnan(screw.steps(sign * 4.0))
