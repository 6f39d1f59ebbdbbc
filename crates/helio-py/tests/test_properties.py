"""True for any field and sun."""

from __future__ import annotations

import math
from pathlib import Path
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


EXAMPLE = Path(__file__).parents[3] / "examples/field.toml"


@settings(max_examples=15, deadline=None, derandomize=True, database=None)
@given(st.integers(0, 2**32), st.sampled_from(["hartley-meyer", "gauss-newton"]))
def test_spots_without_noise_tell_the_true_errors(seed: int, solver: str) -> None:
    field = hp.Field.from_toml(EXAMPLE)
    seen = hp.simulate_observations(field, heliostats=2, count=15, seed=seed, noise_mrad=0.0, random_errors=True)
    found = hp.calibrate(field, seen.observations, solver=solver)
    assert found.ids == list(seen.truth["id"])
    for name in ("axis_nonorthogonality_rad", "mirror_tilt_rad", "azimuth_reference_rad", "elevation_reference_rad"):
        assert np.allclose(getattr(found, name), seen.truth[name], rtol=0, atol=1e-9), name
    one, other = (
        thing["pedestal_tilt_rad"] * np.exp(1j * thing["pedestal_tilt_azimuth_rad"])
        for thing in ({name: getattr(found, name) for name in seen.truth if name != "id"}, seen.truth)
    )
    assert np.allclose(one, other, rtol=0, atol=1e-9)


@settings(max_examples=10, deadline=None, derandomize=True, database=None)
@given(st.permutations(range(30)))
def test_the_order_of_records_changes_nothing(order: list[int]) -> None:
    field = hp.Field.from_toml(EXAMPLE)
    seen = hp.simulate_observations(field, heliostats=2, count=15, seed=3).observations
    wanted = hp.calibrate(field, seen)
    found = hp.calibrate(field, {name: np.asarray(cells)[order] for name, cells in seen.items()})
    rows = [found.ids.index(name) for name in wanted.ids]
    assert np.allclose(found.mirror_tilt_rad[rows], wanted.mirror_tilt_rad, rtol=0, atol=1e-10)
    assert np.allclose(found.sigma["mirror_tilt_rad"][rows], wanted.sigma["mirror_tilt_rad"], rtol=1e-6)


@settings(max_examples=25, deadline=None, derandomize=True, database=None)
@given(st.integers(-15, 15), st.integers(-10, 10), st.sampled_from(["robust", "standard"]))
def test_a_frame_moved_by_whole_pixels_moves_its_spot_by_as_many(right: int, down: int, method: str) -> None:
    target = {"width_m": 8.0, "height_m": 6.0, "corners_px": [[0, 0], [159, 0], [159, 119], [0, 119]]}
    y, x = np.mgrid[:120, :160]

    def frame(column: int, row: int) -> Any:
        light = 120 * np.exp(-((x - column) ** 2 + (y - row) ** 2) / (2 * 7.3**2))
        return np.round(60 + light).astype(np.uint8)

    at, moved = (hp.find_spot(frame(80 + r, 60 + d), target, method=method) for r, d in ((0, 0), (right, down)))
    assert (at.status, moved.status) == ("ok", "ok")
    # of a pixel: the fitted light of the target is not the same everywhere in the robust method
    within = 1e-9 if method == "standard" else 0.02
    assert abs(moved.x_px - at.x_px - right) < within
    assert abs(moved.y_px - at.y_px - down) < within
