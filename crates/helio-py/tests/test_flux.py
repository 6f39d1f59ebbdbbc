"""`flux`: the command line's numbers, closed forms, and what is refused."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
import time
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

import helio_py as hp

SQUARE = [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]]


def scene(**more: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """A square of two metres, ten above the mirror and facing it."""
    receiver = {
        "shape": "plane",
        "centre_m": [0, 0, 10],
        "facing": [0, 0, -1],
        "width_m": 2.0,
        "height_m": 2.0,
        "rows": 20,
        "columns": 20,
    }
    return {"sun": {"dni_w_m2": 800.0}, "mirror": {"reflectivity": 0.9}, "receiver": receiver, **more}


def run(command_line: str, *arguments: Any) -> None:
    done = subprocess.run([command_line, "flux", *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr


@pytest.fixture(scope="module")
def strips(root: Path) -> dict[str, Path]:
    folder = root / "examples" / "flux"
    return {
        "mesh": folder / "strips.inp",
        "displacements": folder / "strips.frd",
        "scene": folder / "strips.toml",
    }


@pytest.mark.parametrize("method", ["elements", "pose", "rigid", "unloaded"])
def test_a_loaded_mesh_is_the_command_line_s_to_the_last_bit(
    method: Any, command_line: str, strips: dict[str, Path], tmp_path: Path
) -> None:
    out, slopes = tmp_path / "map.parquet", tmp_path / "slopes.csv"
    files = ["--mesh", strips["mesh"], "--displacements", strips["displacements"], "--scene", strips["scene"]]
    more = [] if method == "unloaded" else ["--slopes", slopes]
    summary = tmp_path / "found.json"
    run(command_line, *files, "--rays", 20_000, "--method", method, "--out", out, "--summary", summary, *more)
    flux = hp.flux(**strips, method=method, rays=20_000)  # type: ignore[call-overload]
    table = pq.read_table(out)
    ours = flux.to_table()
    assert list(ours) == table.column_names
    for name, column in ours.items():
        assert column.tobytes() == table[name].to_numpy().tobytes(), name
    assert flux.flux_w_m2.ravel().tobytes() == ours["flux_w_m2"].tobytes()
    assert flux.shape == flux.flux_w_m2.shape == flux.u_m.shape == flux.centre_m.shape[:2] == (60, 40)
    found = json.loads(summary.read_text())
    account = flux.account
    for name in ("incoming_w", "shaded_w", "reflection_loss_w", "blocked_w", "spilled_w", "received_w", "rays"):
        assert found["power"][name] == getattr(account, name)
    assert found["power"]["efficiency"] == account.efficiency
    assert found["receiver"]["peak_flux_w_m2"] == flux.peak_w_m2 == flux.flux_w_m2.max()
    assert found["receiver"]["mean_flux_w_m2"] == flux.mean_w_m2
    assert flux.peak_bin == (found["receiver"]["peak_row"], found["receiver"]["peak_column"])
    flux.write(tmp_path / "again.parquet")
    assert pq.read_table(tmp_path / "again.parquet").equals(table)
    if method == "unloaded":
        assert flux.slopes is None
        return
    flux.write_slopes(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_text() == slopes.read_text()
    assert flux.slopes is not None
    of = next(one for one in found["slope_errors"]["methods"] if one["method"] == method)
    assert of["rms_mrad"] == 1e3 * flux.slopes.rms_rad
    assert len(flux.slopes.element) == len(flux.slopes.status) == len(flux.slopes.total_rad)


@pytest.mark.parametrize("sun", ["time", "angles"])
def test_a_field_is_the_command_line_s_to_the_last_bit(
    sun: str, command_line: str, root: Path, example: hp.Field, tmp_path: Path
) -> None:
    out = tmp_path / "map.csv"
    if sun == "time":
        typed = ["--time", "2026-06-21T12:00:00+02:00"]
        asked: dict[str, Any] = {"time": "2026-06-21T12:00:00+02:00"}
    else:
        typed = ["--sun-azimuth-deg", "200", "--sun-elevation-deg", "35"]
        asked = {"sun_azimuth_rad": np.radians(200.0), "sun_elevation_rad": np.radians(35.0)}
    tower = root / "examples" / "flux" / "tower.toml"
    summary = ["--summary", tmp_path / "found.json"]
    run(
        command_line,
        "--field",
        root / "examples" / "field.toml",
        "--scene",
        tower,
        "--rays",
        100_000,
        *typed,
        "--out",
        out,
        *summary,
    )
    flux = hp.flux(field=example, scene=tower, rays=100_000, **asked)
    flux.write(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_text() == out.read_text()
    found = json.loads((tmp_path / "found.json").read_text())["power"]
    assert (found["shaded_w"], found["blocked_w"]) == (flux.account.shaded_w, flux.account.blocked_w)
    assert found["shaded_w"] + found["blocked_w"] > 0
    assert flux.status is not None
    assert len(flux.status) == len(example)
    assert flux.slopes is None
    flux.write(tmp_path / "map.vtk")
    run(
        command_line,
        "--field",
        root / "examples" / "field.toml",
        "--scene",
        tower,
        "--rays",
        100_000,
        *typed,
        "--out",
        out.with_suffix(".vtk"),
        *summary,
    )
    assert (tmp_path / "map.vtk").read_bytes() == out.with_suffix(".vtk").read_bytes()


def test_a_calibration_of_the_hour_is_followed_as_by_the_command_line(command_line: str, tmp_path: Path) -> None:
    (tmp_path / "layout.csv").write_text("id,east_m,north_m,up_m\nA,10,80,4\nB,-30,90,4\n")
    (tmp_path / "calibration.csv").write_text(
        "id,set,pedestal_tilt_deg,pedestal_tilt_azimuth_deg,azimuth_reference_deg,valid_from,valid_to,"
        "hour_angle_from_deg,hour_angle_to_deg\nA,am,0.5,20,1,,,-180,0\nA,pm,0.1,200,-1,,,0,180\n"
        "B,old,0.2,0,3,2026-01-01T00:00:00Z,2026-06-21T12:00:00Z,,\n"
    )
    (tmp_path / "field.toml").write_text(
        "[site]\nlatitude_deg = 37.4\nlongitude_deg = -6.25\nelevation_m = 20\n[targets.receiver]\ncentre_enu_m = [0, 0, 60]\n"
        "normal_enu = [0, 1, 0]\nwidth_m = 8\nheight_m = 8\n"
        '[heliostats]\ntable = "layout.csv"\naim = "receiver"\nmirror_offset_m = 0.2\ncalibration = "calibration.csv"\n'
    )
    scene_toml = tmp_path / "scene.toml"
    scene_toml.write_text('[mirror]\nwidth_m = 3\nheight_m = 2\n[receiver]\nshape = "target"\ntarget = "receiver"\n')
    field = hp.Field.from_toml(tmp_path / "field.toml")
    for time_text in ("2026-06-21T08:00:00Z", "2026-06-21T17:00:00Z"):
        out = tmp_path / "map.csv"
        typed = ["--field", tmp_path / "field.toml", "--scene", scene_toml, "--rays", 50_000, "--time", time_text]
        run(command_line, *typed, "--out", out, "--summary", tmp_path / "found.json")
        flux = hp.flux(field=field, scene=scene_toml, rays=50_000, time=time_text)
        flux.write(tmp_path / "again.csv")
        assert (tmp_path / "again.csv").read_text() == out.read_text()
        assert flux.account.received_w > 0


def test_a_picture_with_a_gauge_is_the_command_line_s(command_line: str, tmp_path: Path) -> None:
    rows, columns = np.mgrid[0:90, 0:120]
    beam = 20 + 200 * np.exp(-((columns - 61.3) ** 2 + (rows - 40.2) ** 2) / 300)
    gray = np.round(beam).astype(np.uint8)
    frame = tmp_path / "frame.pgm"
    frame.write_bytes(b"P5\n120 90\n255\n" + gray.tobytes())
    target = tmp_path / "target.toml"
    target.write_text("width_m = 4\nheight_m = 3\ncorners_px = [[10, 10], [110, 12], [108, 80], [12, 78]]\n")
    typed = ["--camera", frame, "--gauge", "60,40,5000,2", "--dark", "18"]
    run(command_line, *typed, "--out", tmp_path / "px.parquet", "--summary", tmp_path / "a.json")
    run(command_line, *typed, "--target", target, "--out", tmp_path / "bins.parquet", "--summary", tmp_path / "b.json")
    of_file = hp.flux(camera=frame, gauge=(60, 40, 5000, 2), dark=18, target=target)
    of_array = hp.flux(camera=gray, gauge=(60, 40, 5000, 2), dark=18, target=target)
    for flux in (of_file, of_array):
        pixels, bins = pq.read_table(tmp_path / "px.parquet"), pq.read_table(tmp_path / "bins.parquet")
        assert flux.flux_w_m2.shape == gray.shape
        assert flux.flux_w_m2.tobytes() == pixels["flux_w_m2"].to_numpy().tobytes()
        assert flux.target is not None
        for name in ("flux_w_m2", "u_m", "v_m"):
            assert getattr(flux.target, name).tobytes() == bins[name].to_numpy().tobytes()
        found = json.loads((tmp_path / "b.json").read_text())
        assert found["target"]["power_w"] == flux.target.power_w
        assert found["w_m2_per_gray"] == flux.w_m2_per_gray
        assert found["peak_flux_w_m2"] == flux.target.peak_w_m2 == flux.peak_w_m2
        assert found["full_pixels"] == np.count_nonzero(flux.full)


def test_all_the_light_of_a_mirror_arrives_and_the_account_adds_up() -> None:
    flux = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=4_000_000)
    account = flux.account
    assert account.mirror_w == pytest.approx(800.0, rel=1e-12)
    assert account.received_w == pytest.approx(720.0, rel=1e-9)
    parts = account.shaded_w + account.reflection_loss_w + account.blocked_w + account.spilled_w + account.received_w
    assert parts == pytest.approx(account.incoming_w, rel=1e-12)
    assert (flux.flux_w_m2 * flux.area_m2).sum() == pytest.approx(account.received_w, rel=1e-12)
    assert account.cosine_loss_w == pytest.approx(0.0, abs=1e-9)
    assert flux.mean_w_m2 == pytest.approx(account.received_w / 4.0, rel=1e-12)
    # Between what the sun's disc blurs, every point sees all of it: reflectivity times irradiance.
    inner = flux.flux_w_m2[8:12, 8:12]
    np.testing.assert_allclose(inner, 720.0, rtol=0.02)
    np.testing.assert_allclose(flux.centre_m[..., 2], 10.0)


def test_a_turned_mirror_turns_the_beam_by_twice_its_slope() -> None:
    slope = 0.01
    lift = [[0.0, 0.0, slope * x] for x, _, _ in SQUARE]
    flux = hp.flux(
        mesh=np.array(SQUARE), elements=np.array([[0, 1, 2, 3]]), displacements=lift, scene=scene(), rays=50_000
    )
    assert flux.slopes is not None
    assert flux.slopes.total_rad == pytest.approx([np.arctan(slope)], rel=1e-9)
    assert flux.slopes.rms_rad == pytest.approx(np.arctan(slope), rel=1e-9)
    weight = flux.flux_w_m2 * flux.area_m2
    at = (weight[..., None] * flux.centre_m).sum((0, 1)) / weight.sum()
    # The normal leans to -x by the slope; over ten metres the beam goes by the tangent of twice that.
    assert at[0] == pytest.approx(-10 * np.tan(2 * np.arctan(slope)), abs=2e-3)
    assert at[1] == pytest.approx(0.0, abs=2e-3)


def test_rays_and_convolution_agree() -> None:
    by_rays = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=400_000)
    by_integrals = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(rays={"method": "convolve"}))
    assert by_integrals.account.rays == 0
    difference = by_rays.flux_w_m2 - by_integrals.flux_w_m2
    assert np.sqrt(np.mean(difference**2)) < 0.02 * by_integrals.peak_w_m2


def test_scenes_as_mapping_and_as_file_are_one(strips: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(
        '[sun]\ndni_w_m2 = 800.0\n[mirror]\nreflectivity = 0.9\n[receiver]\nshape = "plane"\ncentre_m = [0, 0, 10]\n'
        "facing = [0, 0, -1]\nwidth_m = 2.0\nheight_m = 2.0\nrows = 20\ncolumns = 20\n"
    )
    of_file = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=path, rays=10_000)
    of_mapping = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=10_000)
    assert of_file.flux_w_m2.tobytes() == of_mapping.flux_w_m2.tobytes()
    with_numpy = scene()
    with_numpy["receiver"]["centre_m"] = np.array([0.0, 0.0, 10.0])
    with_numpy["receiver"]["rows"] = np.int64(20)
    again = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=with_numpy, rays=10_000)
    assert again.flux_w_m2.tobytes() == of_file.flux_w_m2.tobytes()


def test_a_field_of_columns_is_lit_like_one_of_files(example: hp.Field, root: Path) -> None:
    names = ["position_enu_m", "aim_enu_m", "mirror_offset_m", "pedestal_tilt_rad", "pedestal_tilt_azimuth_rad"]
    names += ["axis_nonorthogonality_rad", "mirror_tilt_rad", "azimuth_reference_rad", "elevation_reference_rad"]
    columns = hp.Field(**{name: getattr(example, name) for name in names})
    asked: dict[str, Any] = {"scene": root / "examples" / "flux" / "tower.toml", "rays": 30_000}
    asked |= {"sun_azimuth_rad": 3.0, "sun_elevation_rad": 0.9}
    one, other = hp.flux(field=example, **asked), hp.flux(field=columns, **asked)
    assert one.flux_w_m2.tobytes() == other.flux_w_m2.tobytes()


def test_triangles_of_mixed_meshes() -> None:
    quads = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=10_000)
    halves = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, -1], [0, 2, 3, -1]], scene=scene(), rays=10_000)
    assert quads.account.mirror_w == pytest.approx(halves.account.mirror_w, rel=1e-12)


REFUSED: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({}, hp.OptionError, "one of mesh, field and camera"),
    ({"mesh": SQUARE, "camera": "x.png"}, hp.OptionError, "mesh and camera"),
    ({"mesh": SQUARE, "scene": scene()}, hp.OptionError, "elements"),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 3]]}, hp.DataTypeError, "scene"),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": 3}, hp.DataTypeError, "scene"),
    (
        {"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": scene(), "time": "x"},
        hp.OptionError,
        "time: it is of field",
    ),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": scene(), "typo": 1}, TypeError, "typo"),
    ({"mesh": SQUARE, "elements": [[0, 1]], "scene": scene()}, hp.ShapeError, "elements"),
    ({"mesh": SQUARE, "elements": [[0.0, 1.0, 2.0]], "scene": scene()}, hp.DataTypeError, "elements"),
    ({"mesh": SQUARE, "elements": [[0, 1, -2, 3]], "scene": scene()}, hp.OptionError, "row 0"),
    ({"mesh": [[0, 0]], "elements": [[0, 1, 2]], "scene": scene()}, hp.ShapeError, "mesh"),
    (
        {"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": scene(), "displacements": [[0, 0, 0]]},
        hp.ShapeError,
        "displ",
    ),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 9]], "scene": scene()}, hp.MeshError, "element"),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": scene(), "method": "pose"}, hp.OptionError, "displacements"),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": scene(), "method": "none"}, hp.OptionError, "method"),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": scene(), "unit": "mm"}, hp.OptionError, "unit"),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": scene(), "rays": 0}, hp.OptionError, "rays"),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": scene(), "dni_w_m2": -5.0}, hp.FluxError, "-5"),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": scene(), "progress": 3}, hp.DataTypeError, "progress"),
    ({"mesh": "no.inp", "scene": scene()}, hp.FileUnreadableError, "no.inp"),
    ({"mesh": SQUARE, "elements": [[0, 1, 2, 3]], "scene": "no.toml"}, hp.FileUnreadableError, "no.toml"),
    ({"field": 3, "scene": scene(), "time": "2026-06-21T12:00Z"}, hp.DataTypeError, "field"),
    ({"camera": np.zeros((3, 3), np.uint8)}, hp.OptionError, "gauge"),
    ({"camera": np.zeros((3, 3), np.uint8), "gauge": (1, 1)}, hp.ShapeError, "gauge"),
    ({"camera": np.zeros((3, 3), np.uint8), "gauge": (1, 1, 500)}, hp.ImageError, "camera"),
    ({"camera": np.ones((3, 3)), "gauge": (1, 1, 500)}, hp.OptionError, "white"),
    ({"camera": np.ones((3, 3), np.uint8), "gauge": (1, 1, 500), "scene": scene()}, hp.OptionError, "scene"),
    ({"camera": np.ones(3, np.uint8), "gauge": (1, 1, 500)}, hp.ShapeError, "camera"),
]


@pytest.mark.parametrize(("asked", "error", "said"), REFUSED)
def test_wrong_calls_are_refused_by_name(asked: dict[str, Any], error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said) as caught:
        hp.flux(**asked)
    assert issubclass(error, TypeError) or isinstance(caught.value, hp.HelioError)


def test_what_is_wrong_in_a_mapping_is_named_by_its_key() -> None:
    wrong = scene()
    wrong["receiver"]["widht_m"] = wrong["receiver"].pop("width_m")
    with pytest.raises(hp.UnknownNameError, match="widht_m"):
        hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=wrong)
    wrong = scene()
    wrong["receiver"]["width_m"] = object()
    with pytest.raises(hp.DataTypeError, match=r"receiver\.width_m"):
        hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=wrong)
    target = scene(mirror={"width_m": 2.0, "height_m": 2.0})
    target["receiver"] = {"shape": "target", "target": "north"}
    field = hp.Field([[0, 50, 5]], [0, 0, 40])
    with pytest.raises(hp.ConflictError, match=r"field\.toml"):
        hp.flux(field=field, scene=target, sun_azimuth_rad=3.0, sun_elevation_rad=0.9)


def test_progress_is_told_and_its_failure_is_the_call_s() -> None:
    told: list[tuple[int, int]] = []
    hp.flux(
        mesh=SQUARE,
        elements=[[0, 1, 2, 3]],
        scene=scene(),
        rays=30_000_000,
        progress=lambda done, of: told.append((done, of)),
    )
    assert told[-1][0] == told[-1][1] >= 30_000_000
    assert [done for done, _ in told] == sorted(done for done, _ in told)

    def fails(done: int, of: int) -> None:
        raise KeyError("no more")

    with pytest.raises(KeyError, match="no more"):
        hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=10**11, progress=fails)


def test_ctrl_c_ends_a_long_call() -> None:
    started = threading.Event()

    def interrupt() -> None:
        started.wait(30)
        time.sleep(0.2)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        # Hours of work.
        hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=10**12, progress=lambda *_: started.set())
    thread.join()


def test_the_interpreter_is_free_meanwhile() -> None:
    """Another thread counts while rays are traced; it could not if the call kept the interpreter."""
    counted = 0
    stop = threading.Event()

    def count() -> None:
        nonlocal counted
        while not stop.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    seen: list[int] = []
    hp.flux(
        mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=20_000_000, progress=lambda *_: seen.append(counted)
    )
    stop.set()
    thread.join()
    assert counted > 3


def test_the_same_bits_from_several_threads_and_after_a_fork() -> None:
    def digest() -> bytes:
        return hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=100_000).flux_w_m2.tobytes()

    want = digest()
    found: list[bytes] = []
    threads = [threading.Thread(target=lambda: found.append(digest())) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [want] * 4


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_a_forked_child_traces_too() -> None:
    want = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=100_000).flux_w_m2.tobytes()
    pid = os.fork()
    if pid == 0:
        found = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=100_000).flux_w_m2.tobytes()
        os._exit(0 if found == want else 1)
    _, status = os.waitpid(pid, 0)
    assert status == 0


def test_memory_is_flat_over_many_calls() -> None:
    def call() -> None:
        flux = hp.flux(mesh=SQUARE, elements=[[0, 1, 2, 3]], scene=scene(), rays=100)
        assert flux.flux_w_m2.flags.writeable
        _ = flux.account, flux.to_table(), flux.slopes

    for _ in range(50):
        call()
    tracemalloc.start()
    for _ in range(20):
        call()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(500):
        call()
    after = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert after - before < 20_000


def test_a_file_cut_before_its_displacements_is_told_or_refused(command_line: str, tmp_path: Path) -> None:
    whole, cut = tmp_path / "whole.vtk", tmp_path / "cut.vtk"
    text = (
        "# vtk DataFile Version 3.0\nmirror\nASCII\nDATASET POLYDATA\nPOINTS 4 double\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
        "POLYGONS 1 5\n4 0 1 2 3\nPOINT_DATA 4\nVECTORS displacement double\n0 0 0\n0 0 0.01\n0 0 0.01\n0 0 0\n"
    )
    whole.write_text(text)
    cut.write_text(text[: text.index("POINT_DATA")])
    asked: dict[str, Any] = {"scene": scene(), "unit": "m", "rays": 1000}
    loaded = hp.flux(mesh=whole, **asked)
    assert loaded.slopes is not None
    assert loaded.warnings == []
    flux = hp.flux(mesh=cut, **asked)
    assert flux.slopes is None
    assert flux.warnings == [f"{cut} holds no displacements: the mirror is as it was drawn"]
    assert hp.flux(mesh=cut, method="unloaded", **asked).warnings == []
    refused: list[tuple[type[hp.HelioError], str, dict[str, Any]]] = [
        (hp.ConflictError, "cut.vtk: it holds no displacements of the nodes", {"displacements": cut}),
        (hp.ConflictError, "a vector of the nodes named `displacement` is missing", {"vectors": "displacement"}),
        (hp.OptionError, "pose wants displacements, and the mesh has none", {"method": "pose"}),
    ]
    for error, message, more in refused:
        with pytest.raises(error, match=message):
            hp.flux(mesh=cut, **more, **asked)
    by_other = hp.flux(mesh=cut, displacements=whole, **asked)
    assert by_other.flux_w_m2.tobytes() == loaded.flux_w_m2.tobytes()
    scene_toml = tmp_path / "scene.toml"
    scene_toml.write_text(
        '[receiver]\nshape = "plane"\ncentre_m = [0, 0, 5]\nfacing = [0, 0, -1]\nwidth_m = 4\nheight_m = 4\n'
    )
    typed = [command_line, "flux", "--mesh", str(cut), "--unit", "m", "--scene", str(scene_toml), "--rays", "1000"]
    for more_typed, code, message in (
        ([], 0, "note: no displacements given: the mirror is as it was drawn"),
        (["--displacements", str(cut)], 2, "it holds no displacements of the nodes"),
        (["--method", "rigid"], 2, "cut.vtk has none: give --displacements"),
        (["--slopes", str(tmp_path / "slopes.csv")], 2, "the mesh has no displacements"),
    ):
        done = subprocess.run([*typed, *more_typed], capture_output=True, text=True, check=False)
        assert (done.returncode, message in done.stderr) == (code, True), done.stderr
