"""`helio_py.plot`: what is drawn, on which axes, in which units."""

from __future__ import annotations

import inspect
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

import helio_py as hp

mpl.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from helio_py import plot


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    """No figure outlives its test."""
    yield
    plt.close("all")


def texts(ax: Axes) -> str:
    legend = ax.get_legend()
    words = [] if legend is None else [text.get_text() for text in legend.get_texts()]
    return "\n".join([ax.get_title(), ax.get_xlabel(), ax.get_ylabel(), *words])


def drawn(ax: Axes) -> Axes:
    """Drawn for real; matplotlib is lazy."""
    assert ax.figure is not None
    ax.figure.canvas.draw()
    return ax


def test_a_map_of_no_field_is_refused_by_name() -> None:
    with pytest.raises(hp.DataTypeError, match=r"^field: expected real numbers, got str"):
        plot.field_map("examples/field.toml")


def test_matplotlib_is_imported_only_here() -> None:
    code = "import sys, helio_py; assert 'matplotlib' not in sys.modules; import helio_py.plot; assert 'matplotlib' in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", plot.__all__)
def test_every_function_is_documented_and_takes_axes(name: str) -> None:
    function = getattr(plot, name)
    assert inspect.getdoc(function)
    assert inspect.signature(function).parameters["ax"].default is None


def test_field_map_colours_by_a_column(example: hp.Field) -> None:
    ax = drawn(plot.field_map(example, example.position_enu_m[:, 1], label="north (m)"))
    np.testing.assert_array_equal(ax.collections[0].get_offsets(), example.position_enu_m[:, :2])
    np.testing.assert_array_equal(ax.collections[0].get_array(), example.position_enu_m[:, 1])
    assert "east (m)" in texts(ax)
    assert "500 heliostats" in texts(ax)
    assert ax.get_aspect() == 1.0
    ax = drawn(plot.field_map(example, "pedestal_tilt_rad"))
    tilts: Any = ax.collections[0].get_array()
    np.testing.assert_allclose(tilts, 1e3 * example.pedestal_tilt_rad)
    assert ax.figure.axes[1].get_ylabel() == "pedestal tilt (mrad)"


def test_field_map_tells_statuses_apart(example: hp.Field) -> None:
    status = np.zeros(len(example), dtype=np.uint8)
    status[:7] = hp.Status.OUTSIDE_LIMITS
    ax = drawn(plot.field_map(example, status))
    assert "outside limits (7)" in texts(ax)
    assert "ok (493)" in texts(ax)


def test_axes_that_are_given_are_used(example: hp.Field) -> None:
    _, axes = plt.subplots(1, 2)
    assert plot.field_map(example, ax=axes[1]) is axes[1]
    assert not axes[0].has_data()
    assert plot.accuracy([0.0], [0.0], ax=axes[0]) is axes[0]


def test_day_angles_in_degrees_without_jumps(example: hp.Field) -> None:
    times = np.arange("2026-06-21T03:00", "2026-06-21T21:00", dtype="datetime64[m]")[::10]
    sun = example.sun_position(times)
    tracking = hp.track(example, sun.azimuth_rad, sun.elevation_rad)
    degrees = np.degrees(tracking.azimuth_rad)
    jumps = (np.abs(np.diff(degrees, axis=0)) > 180).sum(axis=0)
    past_north = int(np.argmax(jumps == 1))
    assert jumps[past_north] == 1
    ax = drawn(plot.day_angles(times, tracking, rows=[0, past_north], ids=example.ids))
    assert len(ax.lines) == 4
    y = np.asarray(ax.lines[1].get_ydata(), dtype=float)
    np.testing.assert_allclose(y, np.degrees(tracking.elevation_rad[:, 0]))
    azimuth = np.asarray(ax.lines[2].get_ydata(), dtype=float)
    assert np.nanmax(np.abs(np.diff(azimuth))) < 180
    assert len(azimuth) == len(times) + 1
    assert np.isnan(y).any()  # before sunrise
    assert "axis angle (°)" in texts(ax)
    assert "H001" in texts(ax)
    with pytest.raises(hp.ShapeError, match="axis 1"):
        plot.day_angles(times[:3], tracking)


def test_calibration_arrows_are_enlarged_and_point_down() -> None:
    rng = np.random.default_rng(1)
    u, v = rng.uniform(-3, 3, (2, 40))
    du, dv = rng.normal(0, 0.01, (2, 40))
    out = np.arange(40) == 3
    ax = drawn(plot.calibration_arrows(u, v, du, dv, rejected=out, enlarged=50, size_m=(8, 7)))
    assert ax.yaxis_inverted()
    arrows: Any = ax.collections[0]
    np.testing.assert_allclose(arrows.U, 50 * du[~out])
    np.testing.assert_allclose(arrows.V, 50 * dv[~out])
    rms = 1e3 * np.sqrt(np.mean(du[~out] ** 2 + dv[~out] ** 2))
    assert f"rms {rms:.1f} mm" in texts(ax)
    assert "rejected (1)" in texts(ax)
    assert "v, down (m)" in texts(ax)


def test_calibration_residuals_over_numbers_times_and_records() -> None:
    residual = np.array([0.5, 1.0, 2.0])
    assert "record" in texts(drawn(plot.calibration_residuals(residual)))
    times = np.array(["2026-01-01", "2026-01-02", "2026-01-03"], dtype="datetime64[D]")
    ax = drawn(plot.calibration_residuals(residual, times, rejected=[False, False, True]))
    assert "time (UTC)" in texts(ax)
    assert f"rms {np.sqrt(1.25 / 2):.2f} mrad" in texts(ax)
    assert "sun (°)" in texts(plot.calibration_residuals(residual, [10.0, 20.0, 30.0], xlabel="sun (°)"))


@pytest.mark.parametrize("kind", ["numpy", "pandas", "list"])
def test_a_record_without_a_time_is_not_drawn_and_counts(kind: str) -> None:
    residual = np.array([0.5, 1.0, 2.0])
    times: Any = np.array(["2026-01-01", "NaT", "2026-01-03"], dtype="datetime64[s]")
    if kind == "pandas":
        times = pd.Series(times, index=[7, 8, 9]).dt.tz_localize("UTC")
    elif kind == "list":
        times = ["2026-01-01T00:00:00Z", None, "2026-01-03T00:00:00Z"]
    ax = drawn(plot.calibration_residuals(residual, times))
    assert f"rms {np.sqrt(5.25 / 3):.2f} mrad" in texts(ax)
    x, y = np.asarray(ax.lines[0].get_xydata()).T
    assert np.isnan(x).tolist() == [False, True, False]
    assert y.tolist() == residual.tolist()
    with pytest.raises(hp.TimeError, match=r"offset|zone"):
        plot.calibration_residuals(residual, ["2026-01-01T00:00:00", None, "2026-01-03T00:00:00"])


def test_spot_overlay_marks_what_was_found() -> None:
    image = np.zeros((40, 60), dtype=np.uint8)
    ax = drawn(
        plot.spot_overlay(image, [10.0, np.nan], [20.0, np.nan], corners_px=[[5, 5], [50, 5], [50, 35], [5, 35]])
    )
    assert "1 spot" in texts(ax)
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), [[10.0, 20.0]])
    assert ax.yaxis_inverted()
    empty = drawn(plot.spot_overlay(image, np.nan, np.nan))
    assert "0 spots" in texts(empty)
    assert empty.get_legend() is None
    assert plot.spot_overlay(np.zeros((4, 4, 3)), 1.0, 2.0, sigma_px=0.5, labels=["A"]).texts[0].get_text() == "A"


def test_accuracy_circles_have_the_radii_of_the_standard() -> None:
    rng = np.random.default_rng(2)
    u, v = 0.1 + rng.normal(0, 0.05, (2, 500))
    u[7] = np.nan
    ax = drawn(plot.accuracy(u, v, slant_m=100.0, size_m=(2.0, 2.0)))
    known = np.isfinite(u)
    about_aim = np.sqrt(np.mean(u[known] ** 2 + v[known] ** 2))
    about_mean = np.sqrt(np.var(u[known]) + np.var(v[known]))
    radii = [patch.get_radius() for patch in ax.patches if isinstance(patch, Circle)]
    np.testing.assert_allclose(radii, [about_aim, about_mean], rtol=1e-12)
    assert f"accuracy {1e3 * about_aim / 100:.2f} mrad" in texts(ax)


def mesh_of(ax: Axes) -> NDArray[np.float64]:
    found: Any = ax.collections[0]
    return np.asarray(found.get_array())


def test_flux_map_in_metres_with_right_edges() -> None:
    u, v = np.meshgrid((np.arange(4) - 1.5) * 0.5, (np.arange(3) - 1.0) * 0.25)
    flux = np.arange(12.0).reshape(3, 4) * 1e3
    ax = drawn(plot.flux_map(SimpleNamespace(flux_w_m2=flux, u_m=u, v_m=v)))
    np.testing.assert_allclose(mesh_of(ax).ravel(), flux.ravel() / 1e3)
    quads: Any = ax.collections[0]
    corners = quads.get_coordinates()
    np.testing.assert_allclose(corners[0, 0], [-1.0, -0.375])
    np.testing.assert_allclose(corners[-1, -1], [1.0, 0.375])
    assert ax.yaxis_inverted()
    assert ax.get_aspect() == 1.0
    assert "peak 11 kW/m²" in texts(ax)
    assert ax.figure.axes[1].get_ylabel() == "irradiance (kW/m²)"
    np.testing.assert_allclose(mesh_of(plot.flux_map(flux, u, v)), mesh_of(ax))
    with pytest.raises(hp.OptionError, match="mesh"):
        plot.flux_map(SimpleNamespace(flux_w_m2=flux, u_m=np.full_like(u, np.nan), v_m=v))
    with pytest.raises(hp.ShapeError, match="u_m"):
        plot.flux_map(flux, u[:2], v)


def test_flux_map_of_what_flux_returns(root: Path, example: hp.Field) -> None:
    tower = root / "examples" / "flux" / "tower.toml"
    flux = hp.flux(field=example, scene=tower, sun_azimuth_rad=3.0, sun_elevation_rad=0.9, rays=20_000)
    ax = drawn(plot.flux_map(flux))
    assert mesh_of(ax).size == flux.flux_w_m2.size
    picture = hp.flux(camera=np.full((5, 6), 7, np.uint8), gauge=(1, 1, 700))
    assert "column (px)" in texts(drawn(plot.flux_map(picture)))
