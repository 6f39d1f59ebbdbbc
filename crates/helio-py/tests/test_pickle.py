"""What researchers send to other processes arrives as it was, to the last bit."""

from __future__ import annotations

import concurrent.futures as futures
import copy
import multiprocessing as mp
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import helio_py as hp
from conftest import random_field, same_bits

NODES = [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]]
FACES = [[0, 1, 2, -1], [0, 2, 3, -1]]
MOVED: list[list[float]] = [[0, 0, 0], [0, 0, 0.005], [0, 0, 0], [0, 0, 0]]
PLANE: dict[str, Any] = {
    "shape": "plane",
    "centre_m": [0.1, 0, 10],
    "facing": [0.1, 0, -1],
    "width_m": 2.0,
    "height_m": 2.0,
}
ROUND: dict[str, Any] = {
    "shape": "cylinder",
    "base_m": [-1, 0.1, 10],
    "axis": [1, 0.1, 0],
    "radius_m": 0.5,
    "height_m": 2.0,
}
CONE: dict[str, Any] = {"shape": "cone", "base_m": [-1, 0.1, 10], "axis": [1, 0.1, 0.2], "height_m": 2.0}
CONE |= {"base_radius_m": 0.5, "end_radius_m": 0.1}


def flux(receiver: dict[str, Any] = PLANE, method: Any = "elements", **more: Any) -> hp.Flux:
    more = {"displacements": MOVED} | more
    grid = {"rows": 8, "columns": 6}
    return hp.flux(mesh=NODES, elements=FACES, scene={"receiver": receiver | grid}, method=method, rays=20_000, **more)


def of_a_field() -> hp.Flux:
    scene = {"mirror": {"width_m": 3, "height_m": 2}, "receiver": ROUND | {"base_m": [-1, 0, 119]}}
    return hp.flux(field=random_field(30), scene=scene, sun_azimuth_rad=3.0, sun_elevation_rad=0.8, rays=20_000)


def flux_on_a_mesh(folder: Path) -> hp.Flux:
    path = folder / "screen.vtk"
    path.write_text(
        "# vtk DataFile Version 3.0\nscreen\nASCII\nDATASET POLYDATA\nPOINTS 4 double\n-1 -1 10\n1 -1 10\n1 1 10\n-1 1 10.1\n"
        "POLYGONS 2 8\n3 0 2 1\n3 0 3 2\n"
    )
    receiver = {"shape": "mesh", "file": str(path), "facing": [0, 0, -1], "unit": "m"}
    return hp.flux(mesh=NODES, elements=FACES, displacements=MOVED, scene={"receiver": receiver}, rays=20_000)


def same_flux(one: hp.Flux, other: hp.Flux, folder: Path) -> None:
    for name in ("flux_w_m2", "area_m2", "u_m", "v_m", "centre_m"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    for name in ("account", "dni_w_m2", "warnings", "shape", "peak_bin", "mean_w_m2"):
        assert getattr(one, name) == getattr(other, name), name
    assert repr(one) == repr(other)
    assert list(one.to_table()) == list(other.to_table())
    assert (one.status is None) == (other.status is None)
    if one.status is not None and other.status is not None:
        assert one.status.tobytes() == other.status.tobytes()
    assert (one.slopes is None) == (other.slopes is None)
    written = [("write", "map.vtk"), ("write", "map.csv")]
    if one.slopes is not None and other.slopes is not None:
        assert repr(one.slopes) == repr(other.slopes)
        written += [("write_slopes", "slopes.vtk"), ("write_slopes", "slopes.csv")]
    for how, name in written:
        paths = folder / f"one-{name}", folder / f"other-{name}"
        for path, flux in zip(paths, (one, other), strict=True):
            getattr(flux, how)(path)
        assert paths[0].read_bytes() == paths[1].read_bytes(), name


FLUXES: dict[str, Callable[[], hp.Flux]] = {
    "plane": flux,
    "cylinder": lambda: flux(ROUND),
    "cone": lambda: flux(CONE),
    "pose": lambda: flux(method="pose"),
    "rigid": lambda: flux(method="rigid"),
    "unloaded": lambda: flux(method="unloaded"),
    "no load": lambda: flux(displacements=None),
    "a node without a displacement": lambda: flux(displacements=[*MOVED[:3], [np.nan] * 3]),
    "field": of_a_field,
}


@pytest.mark.parametrize("kind", FLUXES)
@pytest.mark.parametrize("protocol", [2, pickle.HIGHEST_PROTOCOL])
def test_a_flux_is_the_same_after_the_journey(kind: str, protocol: int, tmp_path: Path) -> None:
    one = FLUXES[kind]()
    again = pickle.loads(pickle.dumps(one, protocol))
    same_flux(one, again, tmp_path)
    same_flux(one, pickle.loads(pickle.dumps(again)), tmp_path)


def test_a_receiver_of_triangles_travels_too(tmp_path: Path) -> None:
    one = flux_on_a_mesh(tmp_path)
    (tmp_path / "screen.vtk").unlink()  # nothing is read again
    same_flux(one, pickle.loads(pickle.dumps(one)), tmp_path)


def test_the_loaded_strips_travel(root: Path, tmp_path: Path) -> None:
    folder = root / "examples" / "flux"
    files = {"mesh": folder / "strips.inp", "displacements": folder / "strips.frd", "scene": folder / "strips.toml"}
    one = hp.flux(**files, rays=20_000)  # type: ignore[call-overload]
    same_flux(one, pickle.loads(pickle.dumps(one)), tmp_path)


def test_a_damaged_pickle_is_refused() -> None:
    again, (kept,) = flux().__reduce__()
    assert again(kept).shape == (8, 6)
    changes: list[tuple[str, Any, str]] = [
        ("version", "0.0.1", r"pickled by helio_py 0\.0\.1"),
        ("shape", "dish", "shape"),
        ("receiver", kept["receiver"][1:], "sixteen"),
        ("receiver", kept["receiver"] + 1e-3 * (np.arange(16) == 4), "square unit vectors"),
        ("flux_w_m2", kept["flux_w_m2"][1:], "as many numbers as the receiver has bins"),
    ]
    slopes = kept["slopes"]
    for name, value in (
        ("corners", slopes["corners"] + np.uint32(100)),
        ("corners", slopes["corners"][1:]),
        ("counts", slopes["counts"] + np.uint8(9)),
        ("counts", slopes["counts"] * np.uint8(0)),
        ("position_m", slopes["position_m"][1:]),
        ("position_m", slopes["position_m"] * 0.0),
        ("displacement_m", slopes["displacement_m"][3:]),
        ("method", "bent"),
        ("axis", (0.0, 0.0, 0.0)),
    ):
        changes.append(("slopes", slopes | {name: value}, "."))
    for name, value, message in changes:
        with pytest.raises(hp.HelioError, match=message) as caught:
            again(kept | {name: value})
        assert not isinstance(caught.value, hp.InternalError), name


def things(root: Path) -> dict[str, Any]:
    """One of everything that a call returns."""
    field = random_field(40)
    files = hp.Field.from_toml(root / "examples" / "field.toml")
    tracking = hp.track(field, [3.0, 3.1], [0.8, -0.1])
    down, right = np.mgrid[:60, :80]
    frames = [60 + 100 * np.exp(-((right - at) ** 2 + (down - 30) ** 2) / 50) for at in (30, 40, 45)]
    target = {"width_m": 8, "height_m": 6, "corners_px": [[0, 0], [79, 0], [79, 59], [0, 59]]}
    times = np.datetime64("2026-06-20T08:00:00") + np.arange(3)
    spots = hp.find_spots(np.round(frames).astype(np.uint8), target, times=times)
    joint = hp.calibrate(files, root / "examples" / "observations.csv", joint=True, leftovers=True)
    return {
        "corrected": hp.correct(files, hp.track(files, 3.0, 0.8), joint),
        "verified": hp.verify(field, tracking, [3.0, 3.1], [0.8, -0.1]),
        "field": field,
        "field of files": files,
        "drive": hp.Drive.encoder(1000.0),
        "tracking": tracking,
        "prediction": hp.predict(field, tracking.azimuth_rad, tracking.elevation_rad, [3.0, 3.1], [0.8, -0.1]),
        "sun": hp.sun_position("2026-06-21T12:00:00Z", 37.4, -6.25),
        "suns": hp.sun_position(times, 37.4, -6.25),
        "calibration": hp.calibrate(files, root / "examples" / "observations.csv"),
        "spots": spots,
        "spot": spots[0],
        "accuracy": hp.accuracy(spots, slant_m=120.0),
        "images": hp.simulate_images(frames=2, size=(60, 40), observations=None, bits=16, distortion=0.05),
        "campaign": hp.simulate_campaign(minutes=1, frames_per_s=2),
        "check": files.check("2026-06-21T12:00:00Z"),
        "flux": flux(),
        "account": flux().account,
        "slopes": flux().slopes,
        "camera": hp.flux(camera=np.round(frames[0]).astype(np.uint8), gauge=(30, 30, 4000)),
    }


def text(thing: Any) -> str:
    """All that there is to see of a thing."""
    if isinstance(thing, np.ndarray):
        return f"{thing.dtype}{thing.shape}{thing.tobytes().hex()}"
    if isinstance(thing, (dict, list, tuple)):
        cells = thing.items() if isinstance(thing, dict) else thing
        return f"{type(thing).__name__}[{', '.join(text(cell) for cell in cells)}]"
    if type(thing).__module__.startswith("helio_py"):
        names = [name for name in dir(thing) if not name.startswith("_")]
        seen = {name: value for name in names if not callable(value := getattr(thing, name))}
        return f"{thing!r} {text(seen)}"
    return repr(thing)


@pytest.fixture(scope="module")
def all_things(root: Path) -> dict[str, Any]:
    return things(root)


def test_everything_is_pickled_and_copied(all_things: dict[str, Any]) -> None:
    for name, thing in all_things.items():
        want = text(thing)
        for again in (pickle.loads(pickle.dumps(thing)), copy.copy(thing), copy.deepcopy(thing)):
            assert type(again) is type(thing), name
            assert text(again) == want, name
    # Of what can be written over a copy is another; what cannot change is its own copy.
    tracking = all_things["tracking"]
    other = copy.deepcopy(tracking)
    other.azimuth_rad[:] = 0.0
    assert tracking.azimuth_rad.any()
    for name in ("field", "field of files", "flux"):
        assert copy.copy(all_things[name]) is copy.deepcopy(all_things[name]) is all_things[name]


def seen(thing: Any) -> tuple[Any, str]:
    return thing, text(thing)


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_everything_goes_through_a_pool_of_processes_and_back(method: str, all_things: dict[str, Any]) -> None:
    if method not in mp.get_all_start_methods():
        pytest.skip(f"no {method} on this system")
    with futures.ProcessPoolExecutor(2, mp_context=mp.get_context(method)) as pool:
        found = list(pool.map(seen, all_things.values(), timeout=120))
    for (name, thing), (back, there) in zip(all_things.items(), found, strict=True):
        assert there == text(back) == text(thing), name


def failing(field: hp.Field) -> None:
    hp.track(field, [3.0], [np.nan])


def test_errors_come_back_whole() -> None:
    with (
        futures.ProcessPoolExecutor(1, mp_context=mp.get_context("spawn")) as pool,
        pytest.raises(hp.SunDirectionError) as caught,
    ):
        pool.submit(failing, random_field(2)).result(timeout=60)
    assert caught.value.row == 0


def test_the_applied_field_travels(root: Path, all_things: dict[str, Any]) -> None:
    applied = all_things["calibration"].apply(all_things["field of files"])
    again = pickle.loads(pickle.dumps(applied))
    assert same_bits(hp.track(again, 3.0, 0.8), hp.track(applied, 3.0, 0.8))


def test_a_campaign_is_made_again_from_its_seed(root: Path) -> None:
    field = hp.Field.from_toml(root / "examples/field.toml")
    seen = hp.simulate_observations(field, heliostats=3, count=8, seed=5, random_errors=True)
    there = pickle.loads(pickle.dumps(seen))
    for name, cells in seen.observations.items():
        assert np.asarray(there.observations[name]).tobytes() == np.asarray(cells).tobytes(), name
    assert there.truth["mirror_tilt_rad"].tobytes() == seen.truth["mirror_tilt_rad"].tobytes()
    assert copy.deepcopy(seen) is seen
