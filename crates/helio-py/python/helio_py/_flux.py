"""``flux``: the irradiance that mirrors give a receiver."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np

from helio_py._checked import array, number, of, several, text, whole, wrong_type
from helio_py._checked import path as checked_path
from helio_py._errors import DataTypeError, OptionError, ShapeError
from helio_py._native import Field, Flux, _flux_camera, _flux_field, _flux_mesh
from helio_py._progress import reporter
from helio_py._scene import scene_asked

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Literal, TypeAlias

    from numpy.typing import ArrayLike, NDArray

    _FilePath: TypeAlias = str | os.PathLike[str]
    _Progress: TypeAlias = Callable[[int, int], Any] | bool | None
    _SceneLike: TypeAlias = _FilePath | Mapping[str, Mapping[str, Any]]
    _Method: TypeAlias = Literal["elements", "pose", "rigid", "unloaded"]


class FluxAccount(NamedTuple):
    """Where the light went [W]: incoming = shaded + reflection loss + blocked + spilled + received, to rounding."""

    #: Direct irradiance times the area of the mirrors that the sun sees the reflecting side of.
    mirror_w: float
    #: Direct irradiance times their apertures: less the loss by the cosine.
    incoming_w: float
    #: Kept from the mirrors by other mirrors.
    shaded_w: float
    #: Fell on a mirror and was not reflected.
    reflection_loss_w: float
    #: Was reflected and fell on another mirror.
    blocked_w: float
    #: Was reflected and missed the receiver.
    spilled_w: float
    #: Fell on the receiver.
    received_w: float
    #: Rays traced; 0 for a convolution.
    rays: int
    #: Elements of mirrors whose reflecting side is turned away from the sun.
    turned_away: int

    @property
    def cosine_loss_w(self) -> float:
        """What is lost because mirrors do not face the sun."""
        return self.mirror_w - self.incoming_w

    @property
    def efficiency(self) -> float:
        """Received of `mirror_w`; 0 if there is none."""
        return self.received_w / self.mirror_w if self.mirror_w > 0 else 0.0


class SlopeErrors(NamedTuple):
    """How far the load turns each face of a mesh's mirror: columns of a row a face; NaN where `status` is not ok.

    The total is the angle between the normals without and with the load (Yan 2022 eq. 5); first and second are the lean
    of the loaded normal along the scene's axis and across it. Means are weighted by area.
    """

    #: Number of the element in the mesh; of arrays its row, from 0.
    element: NDArray[np.uint64]
    #: Area without load [m²].
    area_m2: NDArray[np.float64]
    #: Angle between the normals [rad].
    total_rad: NDArray[np.float64]
    #: Lean along the axis [rad].
    first_rad: NDArray[np.float64]
    #: Lean across the axis [rad].
    second_rad: NDArray[np.float64]
    #: How far the middle of the face moved [m].
    moved_m: NDArray[np.float64]
    #: ok, no_displacement, no_pose or collapsed.
    status: list[str]
    #: Root mean square of the total by area [rad].
    rms_rad: float
    #: The same along the axis [rad].
    rms_first_rad: float
    #: The same across the axis [rad].
    rms_second_rad: float


class TargetMap(NamedTuple):
    """The flux on a target as a picture shows it, in bins of the target; NaN where it is not seen.

    Rows run down from the target's upper edge, columns right from its left edge, as the camera sees it.
    """

    #: Irradiance [W/m²], of shape (rows, columns).
    flux_w_m2: NDArray[np.float64]
    #: Right of the target's centre [m], of the same shape.
    u_m: NDArray[np.float64]
    #: Below it [m].
    v_m: NDArray[np.float64]
    #: Area of a bin [m²].
    bin_area_m2: float
    #: Power on the bins that are seen [W].
    power_w: float
    #: Their mean irradiance [W/m²].
    mean_w_m2: float

    @property
    def peak_w_m2(self) -> float:
        """The greatest irradiance [W/m²]."""
        return float(np.nanmax(self.flux_w_m2))


class CameraFlux(NamedTuple):
    """A picture in W/m²: what `flux` makes of a camera's frame and one reading of a gauge."""

    #: Irradiance of the pixels [W/m²], of the picture's shape, rows from the top.
    flux_w_m2: NDArray[np.float64]
    #: Pixels that are full: there was at least as much as stands there.
    full: NDArray[np.bool_]
    #: Irradiance of one gray value [W/m²].
    w_m2_per_gray: float
    #: Gray value without light.
    dark_gray: float
    #: Gray value from which on a pixel is full.
    white_gray: float
    #: The flux in metres on the target, where one was given.
    target: TargetMap | None = None

    @property
    def peak_w_m2(self) -> float:
        """The greatest irradiance [W/m²]: on the target where there is one, else of the pixels."""
        return float(self.flux_w_m2.max()) if self.target is None else self.target.peak_w_m2


@overload
def flux(
    *,
    mesh: _FilePath | ArrayLike,
    scene: _SceneLike,
    elements: _FilePath | ArrayLike | None = None,
    displacements: _FilePath | ArrayLike | None = None,
    step: int | None = None,
    vectors: str | None = None,
    method: _Method = "elements",
    unit: str | None = None,
    surface: str | None = None,
    element_set: str | None = None,
    dni_w_m2: float | None = None,
    half_angle_mrad: float | None = None,
    rays: int | None = None,
    seed: int | None = None,
    progress: _Progress = None,
) -> Flux: ...
@overload
def flux(
    *,
    field: Field,
    scene: _SceneLike,
    time: Any | None = None,
    sun_azimuth_rad: float | None = None,
    sun_elevation_rad: float | None = None,
    dni_w_m2: float | None = None,
    half_angle_mrad: float | None = None,
    rays: int | None = None,
    seed: int | None = None,
    progress: _Progress = None,
) -> Flux: ...
@overload
def flux(
    *,
    camera: _FilePath | ArrayLike,
    gauge: Sequence[float],
    dark: float = 0.0,
    white: float | None = None,
    target: _FilePath | None = None,
) -> CameraFlux: ...
def flux(
    *,
    mesh: Any = None,
    field: Any = None,
    camera: Any = None,
    scene: Any = None,
    progress: _Progress = None,
    dni_w_m2: float | None = None,
    half_angle_mrad: float | None = None,
    rays: int | None = None,
    seed: int | None = None,
    **more: Any,
) -> Flux | CameraFlux:
    """Irradiance on a receiver: of a loaded structure, of a field as it tracks, or from a camera's picture.

    The numbers are those of ``helio-rs flux`` to the last bit. Exactly one of `mesh`, `field` and `camera` says what
    the mirrors are.

    Parameters
    ----------
    mesh : path or array of shape (n, 3)
        The model of a structure (CalculiX and Abaqus .inp, .frd, Gmsh .msh, .vtk, .vtu, .vtp, a .csv of nodes), or
        places of nodes [m].
    field : Field
        The heliostats, that track the sun of `time` or of the two angles; they shade and block each other.
    camera : path or array of shape (rows, columns)
        A frame of the receiver. uint8 and uint16 arrays are full at their greatest number; others need `white`.
    scene : path or mapping
        The scene.toml, or its tables as a mapping of mappings with the same keys, for `mesh` and `field`: sun, mirror,
        receiver, rays. `helio-rs schema scene` and the manual's page on files list the keys.
    progress : callable or True, optional
        Called with rays (or bins) done and in all; True for a bar of tqdm.
    dni_w_m2, half_angle_mrad, rays, seed : optional
        Instead of the scene's: direct normal irradiance [W/m²], half angle of the sun's disc [mrad], number and seed of
        rays.
    elements : path or array of shape (m, 3) or (m, 4), optional
        With a .csv of nodes the table of elements; with an array of nodes the rows of each shell's nodes, from 0, in
        order round it. -1 in the last place makes a triangle of a row of four.
    displacements : path or array of shape (n, 3), optional
        What the solver says of the nodes; of arrays [m].
    step, vectors, unit, surface, element_set : optional
        Of a mesh in files: step of an .frd, name of the vectors, unit of its lengths (m, cm, mm, in), and which part
        is the mirror.
    method : str, default "elements"
        Which deformed mirror is lit: every face where its nodes go ("elements", Yan 2022 eq. 1 to 4), every facet as
        three points move ("pose", section 2.1) or as all of its nodes do ("rigid"), or none of it ("unloaded").
    time : optional
        When the sun is seen, as for `Field.sun_position`.
    sun_azimuth_rad, sun_elevation_rad : float, optional
        Where the sun is seen [rad], instead of a time.
    gauge : (x_px, y_px, flux_w_m2) or (x_px, y_px, flux_w_m2, radius_px)
        What a heat-flux gauge reads [W/m²] and where the picture shows its sensor: right and down from the middle of
        the first pixel [px].
    dark, white : float, optional
        Gray values without light and from which on the camera cannot tell more.
    target : path, optional
        The target.toml of the receiver in the picture.

    Returns
    -------
    Flux
        For `mesh` and `field`: `flux_w_m2` of shape (rows, columns), bin centres, `account`, `slopes` or `status`.
    CameraFlux
        For `camera`.

    Raises
    ------
    FluxError, MeshError, ImageError, FileError, OptionError, ShapeError, DataTypeError

    Notes
    -----
    The interpreter is free for other threads meanwhile, Ctrl-C ends the call, and the same input gives the same bits on
    any number of threads.

    Examples
    --------
    A mirror of one square metre, one of its corners pushed up by 5 mm, and the spot it makes ten metres above it:

    >>> import helio_py as hp
    >>> nodes = [[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]]
    >>> flux = hp.flux(
    ...     mesh=nodes,
    ...     elements=[[0, 1, 2, -1], [0, 2, 3, -1]],
    ...     displacements=[[0, 0, 0], [0, 0, 0.005], [0, 0, 0], [0, 0, 0]],
    ...     scene={
    ...         "sun": {"dni_w_m2": 800.0},
    ...         "mirror": {"reflectivity": 0.9},
    ...         "receiver": {
    ...             "shape": "plane", "centre_m": [0, 0, 10], "facing": [0, 0, -1],
    ...             "width_m": 2.0, "height_m": 2.0, "rows": 20, "columns": 20,
    ...         },
    ...     },
    ...     rays=100_000,
    ... )
    >>> flux.shape, round(flux.account.received_w, 1), (flux.slopes.total_rad * 1e3).round(2).tolist()
    ((20, 20), 720.0, [7.07, 0.0])
    """
    given = [name for name, value in (("mesh", mesh), ("field", field), ("camera", camera)) if value is not None]
    if len(given) != 1:
        found = " and ".join(given) or "none"
        raise OptionError(f"flux: wanted one of mesh, field and camera, got {found}")
    known = _OPTIONS[given[0]]
    for name in more:
        if name not in known:
            raise _misplaced(name, given[0])
    if given[0] == "camera":
        typed = {"scene": scene, "dni_w_m2": dni_w_m2, "half_angle_mrad": half_angle_mrad, "rays": rays, "seed": seed}
        for name, value in typed.items():
            if value is not None:
                raise _option(name, "it is of mesh and field, not of camera")
        return _of_camera(camera, **more)
    asked = scene_asked(scene, dni_w_m2, half_angle_mrad, rays, seed)
    with reporter(progress, " rays") as report:
        if given[0] == "mesh":
            return _of_mesh(mesh, asked, report, **more)
        return _of_field(field, asked, report, **more)


_OPTIONS = {
    "mesh": ("elements", "displacements", "step", "vectors", "method", "unit", "surface", "element_set"),
    "field": ("time", "sun_azimuth_rad", "sun_elevation_rad"),
    "camera": ("gauge", "dark", "white", "target"),
}


def _option(name: str, message: str) -> OptionError:
    error = OptionError(f"{name}: {message}")
    error.field = name
    return error


def _misplaced(name: str, given: str) -> Exception:
    for other, options in _OPTIONS.items():
        if name in options:
            return _option(name, f"it is of {other}, not of {given}")
    return TypeError(f"flux() got an unexpected keyword argument '{name}'")


def _is_path(value: Any) -> bool:
    return isinstance(value, (str, os.PathLike))


def _of_mesh(
    mesh: Any,
    scene: dict[str, Any],
    report: Callable[[int, int], Any] | None,
    *,
    elements: Any = None,
    displacements: Any = None,
    step: int | None = None,
    vectors: str | None = None,
    method: str = "elements",
    unit: str | None = None,
    surface: str | None = None,
    element_set: str | None = None,
) -> Flux:
    if surface is not None and element_set is not None:
        raise _option("element_set", "it stands beside surface; wanted one")
    files = _is_path(mesh)
    asked = {
        "model": checked_path("mesh", mesh) if files else None,
        "elements": None,
        "displacements": None,
        "step": None if step is None else whole("step", step, 0, 2**31 - 1),
        "method": text("method", method),
    }
    words = (("vectors", vectors), ("unit", unit), ("surface", surface), ("element_set", element_set))
    asked.update({name: None if word is None else text(name, word) for name, word in words})
    if files:
        for name, path in (("elements", elements), ("displacements", displacements)):
            if path is not None:
                if not _is_path(path):
                    raise wrong_type(name, "a path beside the path of a mesh", path)
                asked[name] = checked_path(name, path)
        return _flux_mesh(asked, None, [], None, scene, report)
    for name in ("step", "vectors", "unit", "surface", "element_set"):
        if asked[name] is not None:
            raise _option(name, "it is of a mesh in files; arrays are metres, and all of them is mirror")
    if elements is None:
        raise _option("elements", "a mesh of arrays wants the nodes of each element")
    return _flux_mesh(asked, mesh, _corners(elements), displacements, scene, report)


def _corners(elements: Any) -> list[list[int]]:
    """Rows of nodes of each shell."""
    shells = array("elements", elements)
    if shells.ndim != 2 or shells.shape[1] not in (3, 4):
        raise of(ShapeError(f"elements: expected shape (m, 3) or (m, 4), got {shells.shape}"), "elements")
    if shells.dtype.kind not in "iu":
        raise _type("elements", f"expected whole numbers, got dtype {shells.dtype}")
    corners = []
    for row, nodes in enumerate(shells.tolist()):
        kept = nodes[:3] if len(nodes) == 4 and nodes[3] == -1 else nodes
        if min(kept) < 0:
            below = OptionError(f"elements: row {row}: nodes are counted from 0, got {nodes}")
            below.field, below.row = "elements", row
            raise below
        corners.append(kept)
    return corners


def _type(name: str, message: str) -> DataTypeError:
    error = DataTypeError(f"{name}: {message}")
    error.field = name
    return error


def _of_field(
    field: Any,
    scene: dict[str, Any],
    report: Callable[[int, int], Any] | None,
    *,
    time: Any | None = None,
    sun_azimuth_rad: float | None = None,
    sun_elevation_rad: float | None = None,
) -> Flux:
    angles = [sun_azimuth_rad, sun_elevation_rad]
    if not isinstance(field, Field):
        raise _type("field", f"expected a Field, got {type(field).__name__}")
    if angles.count(None) == 1 or (time is None) == (sun_azimuth_rad is None):
        raise _option("time", "wanted a time, or sun_azimuth_rad and sun_elevation_rad, and not both")
    at = None
    if time is not None:
        from helio_py._times import instant  # which imports more than a package should by itself

        at = instant("time", time)
        sun = field.sun_position(time)
        angles = [sun.azimuth_rad, sun.elevation_rad]
    numbers = [number("sun_azimuth_rad", angles[0]), number("sun_elevation_rad", angles[1])]
    return _flux_field(field, scene, numbers[0], numbers[1], at, report)


def _of_camera(
    camera: Any, *, gauge: Any = None, dark: float = 0.0, white: float | None = None, target: Any = None
) -> CameraFlux:
    if gauge is None:
        raise _option("gauge", "a picture wants the reading of a gauge: (x_px, y_px, flux_w_m2)")
    reading = [number("gauge", one) for one in several("gauge", gauge, "(x_px, y_px, flux_w_m2)")]
    if len(reading) not in (3, 4):
        error = ShapeError(f"gauge: expected (x_px, y_px, flux_w_m2) or with radius_px, got {len(reading)} numbers")
        error.field = "gauge"
        raise error
    path, gray = (checked_path("camera", camera), None) if _is_path(camera) else (None, array("camera", camera))
    if gray is not None and white is None:
        if gray.dtype not in (np.uint8, np.uint16):
            raise _option("white", f"an array of dtype {gray.dtype} does not say from which gray value on it is full")
        white = float(np.iinfo(gray.dtype).max)
    reading += [0.0] * (4 - len(reading))
    dark = number("dark", dark)
    white = None if white is None else number("white", white)
    target = None if target is None else checked_path("target", target)
    flux_w_m2, full, per_gray, dark_gray, white_gray, seen = _flux_camera(path, gray, white, reading, dark, target)
    seen = None if seen is None else TargetMap(*seen)
    return CameraFlux(flux_w_m2, full, per_gray, dark_gray, white_gray, seen)
