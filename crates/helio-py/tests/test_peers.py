"""What the notes "From pvlib / ARTIST / OpenCSP" of the manual say of conventions."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import helio_py as hp


@pytest.mark.parametrize("name", ["from-pvlib", "from-opencsp", "python", "python-flux", "python-plot"])
def test_the_manual_s_examples_run(name: str, root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "python-plot":
        pytest.importorskip("matplotlib").use("Agg")
    (tmp_path / "examples").symlink_to(root / "examples")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (root / "docs" / f"{name}.md").read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    known: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, name, "exec"), known)


# pvlib itself asks pandas for what pandas is about to drop.
@pytest.mark.filterwarnings("ignore")
def test_the_sun_is_pvlib_s() -> None:
    pvlib = pytest.importorskip("pvlib")
    pd = pytest.importorskip("pandas")
    times = np.arange("2026-01-01", "2027-01-01", np.timedelta64(97, "m"), dtype="datetime64[m]")
    theirs = pvlib.solarposition.get_solarposition(pd.DatetimeIndex(times, tz="UTC"), 37.4, -6.25, altitude=20)
    ours = hp.sun_position(times, 37.4, -6.25, elevation_m=20, delta_t_s=67)
    np.testing.assert_allclose(np.degrees(ours.geometric_elevation_rad), theirs["elevation"], atol=2e-6)
    azimuth = np.degrees(ours.azimuth_rad) - theirs["azimuth"].to_numpy()
    assert np.abs((azimuth + 180) % 360 - 180).max() < 1e-5
    high = ours.elevation_rad > 0.02
    np.testing.assert_allclose(np.degrees(ours.elevation_rad)[high], theirs["apparent_elevation"][high], atol=2e-5)


def test_azimuths_from_south_are_ours_turned() -> None:
    """ARTIST 2.0.0, `azimuth_elevation_to_enu`: e = r sin a, n = -r cos a, u = sin h."""
    azimuth, elevation = np.radians(np.linspace(-180, 180, 37)), np.radians(np.linspace(1, 80, 37))
    theirs = np.column_stack(
        [np.cos(elevation) * np.sin(azimuth), -np.cos(elevation) * np.cos(azimuth), np.sin(elevation)]
    )
    north = np.pi - azimuth
    ours = np.column_stack([np.cos(elevation) * np.sin(north), np.cos(elevation) * np.cos(north), np.sin(elevation)])
    np.testing.assert_allclose(ours, theirs, atol=1e-15)


def test_normals_of_opencsp_are_those_without_offset() -> None:
    """`tracking_surface_normal_xyz` halves sun and aim from the origin; `HeliostatAzEl` reads its angles off the normal."""
    rng = np.random.default_rng(5)
    origins = np.column_stack([rng.uniform(-90, 90, 50), rng.uniform(40, 190, 50), rng.uniform(3, 6, 50)])
    aim = np.array([0.0, 8.8, 28.9])
    azimuth, elevation = 2.9, 0.8
    sun = np.array([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)])
    beam = aim - origins
    normal = sun + beam / np.linalg.norm(beam, axis=1, keepdims=True)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    theirs_el = np.arctan2(normal[:, 2], np.hypot(normal[:, 0], normal[:, 1]))
    theirs_az = np.pi / 2 - np.arctan2(normal[:, 1], normal[:, 0])
    field = hp.Field(origins, aim, mirror_offset_m=0.1778)
    ours = hp.track(field, azimuth, elevation, offset="none")
    np.testing.assert_allclose(ours.elevation_rad, theirs_el, atol=1e-12)
    np.testing.assert_allclose(np.cos(ours.azimuth_rad - theirs_az), 1.0, atol=1e-12)
    # What leaving the offset aside costs there.
    exact = hp.track(field, azimuth, elevation)
    assert 1e-4 < np.abs(exact.elevation_rad - ours.elevation_rad).max() < 5e-3
