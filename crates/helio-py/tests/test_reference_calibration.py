"""The 24 campaigns of `tests/reference/calibration.json`, computed with forty digits elsewhere, by `calibrate`."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import helio_py as hp

#: As the tests in Rust have them.
OPTIMUM = 1e-9
ERRORS_RAD = math.radians(1e-6)

#: Names of the file and ours, those of the tilt left out.
NAMES = {
    "tau1": "axis_nonorthogonality_rad",
    "mu": "mirror_tilt_rad",
    "gamma0": "azimuth_reference_rad",
    "alpha0": "elevation_reference_rad",
}
#: Whatever a fit leaves is wanted: nothing set aside, one set, no gate.
PLAIN: dict[str, Any] = {"keep_all": True, "no_jumps": True, "max_year_pointing_mrad": 1e6}

Case = dict[str, Any]


def enu(neu: list[float]) -> list[float]:
    north, east, up = neu
    return [east, north, up]


@pytest.fixture(scope="module")
def cases(root: Path) -> list[Case]:
    found: list[Case] = json.loads((root / "tests" / "reference" / "calibration.json").read_text())["cases"]
    assert len(found) == 24
    return found


@pytest.fixture(scope="module")
def campaign(cases: list[Case], tmp_path_factory: pytest.TempPathFactory) -> tuple[hp.Field, dict[str, Any]]:
    """Each case is a heliostat of one field, with its own target; its observations are rows of one table."""
    folder = tmp_path_factory.mktemp("reference")
    targets, layout = [], ["id,east_m,north_m,up_m,mirror_offset_m,aim"]
    rows: dict[str, list[Any]] = {name: [] for name in ("heliostat_id", "target")}
    columns = {
        "sun_azimuth_deg": "sun_azimuth_deg",
        "sun_elevation_deg": "sun_elevation_deg",
        "axis1_deg": "azimuth_deg",
        "axis2_deg": "elevation_deg",
        "u_m": "u_m",
        "v_m": "v_m",
    }
    for number, case in enumerate(cases):
        normal, right = enu(case["target_normal_neu"]), enu(case["target_right_neu"])
        # The file states the third direction too.
        assert np.cross(right, normal) == pytest.approx(enu(case["target_down_neu"]), abs=1e-12)
        targets.append(
            f"[targets.t{number}]\ncentre_enu_m = {enu(case['target_centre_neu_m'])}\nnormal_enu = {normal}\n"
            f"right_enu = {right}\nwidth_m = 10\nheight_m = 10\n"
        )
        layout.append(f"c{number},0,0,0,{case['mirror_offset_m']!r},t{number}")
        for seen in case["observations"]:
            rows["heliostat_id"].append(f"c{number}")
            rows["target"].append(f"t{number}")
            for ours, theirs in columns.items():
                rows.setdefault(ours, []).append(seen[theirs])
    (folder / "layout.csv").write_text("\n".join(layout) + "\n")
    (folder / "field.toml").write_text("".join(targets) + '[heliostats]\ntable = "layout.csv"\n')
    return hp.Field.from_toml(folder / "field.toml"), rows


def sums_m2(found: hp.Calibration, count: int) -> NDArray[np.float64]:
    """Sum of squares of what each fit leaves on the target."""
    left = found.to_table("residuals")
    squares = (left["u_m"] - left["predicted_u_m"]) ** 2 + (left["v_m"] - left["predicted_v_m"]) ** 2
    return np.array([squares[left["id"] == f"c{number}"].sum() for number in range(count)])


def apart_rad(found: hp.Calibration, k: int, deg: dict[str, float]) -> float:
    """Largest difference, the tilt by its components."""
    tilt, toward = math.radians(deg["psi_t"]), math.radians(deg["psi_a"])
    ours, at = found.pedestal_tilt_rad[k], found.pedestal_tilt_azimuth_rad[k]
    parts = [ours * math.cos(at) - tilt * math.cos(toward), ours * math.sin(at) - tilt * math.sin(toward)]
    parts += [getattr(found, name)[k] - math.radians(deg[theirs]) for theirs, name in NAMES.items()]
    return max(abs(math.remainder(part, 2 * math.pi)) for part in parts)


@pytest.mark.parametrize("solver", ["hartley-meyer", "gauss-newton"])
def test_components_reach_every_optimum(
    solver: str, cases: list[Case], campaign: tuple[hp.Field, dict[str, Any]]
) -> None:
    found = hp.calibrate(*campaign, solver=solver, **PLAIN)
    assert found.ids == [f"c{number}" for number in range(24)]
    assert found.status == ["ok"] * 24, found.why
    for number, (case, sum_m2) in enumerate(zip(cases, sums_m2(found, 24), strict=True)):
        count = len(case["observations"])
        assert found.observations[number] == count
        assert sum_m2 <= case["best_fit"]["sum_squares_m2"] * (1 + OPTIMUM) + count * 1e-20, number
        assert apart_rad(found, number, case["best_fit"]["deg"]) < ERRORS_RAD, number
        if case["noise_mrad_per_axis"] == 0.0:
            assert apart_rad(found, number, case["true_deg"]) < ERRORS_RAD, number


@pytest.mark.parametrize("solver", ["hartley-meyer", "gauss-newton"])
def test_distances_reach_every_optimum_of_eight_or_more(
    solver: str, cases: list[Case], campaign: tuple[hp.Field, dict[str, Any]]
) -> None:
    found = hp.calibrate(*campaign, solver=solver, residual="distance", **PLAIN)
    tried = 0
    for number, (case, sum_m2) in enumerate(zip(cases, sums_m2(found, 24), strict=True)):
        count = len(case["observations"])
        if count < 8:
            continue
        tried += 1
        assert found.status[number] == "ok", found.why[number]
        assert sum_m2 <= case["best_fit"]["sum_squares_m2"] * (1 + OPTIMUM) + count * 1e-20, number
        if case["noise_mrad_per_axis"] == 0.0:
            assert apart_rad(found, number, case["true_deg"]) < ERRORS_RAD, number
    assert tried == 22


def test_of_true_errors_every_beam_lands_where_it_was_seen(cases: list[Case]) -> None:
    """The other way round: `forward` with the true errors, of the cases without noise."""
    tried = 0
    for case in cases:
        if case["noise_mrad_per_axis"] != 0.0:
            continue
        deg = case["true_deg"]
        errors: dict[str, Any] = {name: math.radians(deg[theirs]) for theirs, name in NAMES.items()}
        centre = np.array(enu(case["target_centre_neu_m"]))
        field = hp.Field(
            [[0.0, 0.0, 0.0]],
            centre,
            mirror_offset_m=case["mirror_offset_m"],
            pedestal_tilt_rad=math.radians(deg["psi_t"]),
            pedestal_tilt_azimuth_rad=math.radians(deg["psi_a"]),
            **errors,
        )
        normal, right, down = (np.array(enu(case[f"target_{name}_neu"])) for name in ("normal", "right", "down"))
        for seen in case["observations"]:
            azimuth, elevation = math.radians(seen["sun_azimuth_deg"]), math.radians(seen["sun_elevation_deg"])
            level = math.cos(elevation)
            sun = np.array([level * math.sin(azimuth), level * math.cos(azimuth), math.sin(elevation)])
            axes = [[math.radians(seen["azimuth_deg"])], [math.radians(seen["elevation_deg"])]]
            mirror = hp.forward(field, *axes)[0]
            beam = 2 * (sun @ mirror) * mirror - sun
            pivot = case["mirror_offset_m"] * mirror
            spot = pivot + beam * ((centre - pivot) @ normal) / (beam @ normal) - centre
            assert [spot @ right, spot @ down] == pytest.approx([seen["u_m"], seen["v_m"]], abs=2e-11)
            tried += 1
    assert tried > 200
