from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from helio_py._begin import FieldCheck
from helio_py._flux import FluxAccount, SlopeErrors
from helio_py._sun import SunPosition

__version__: Final[str]
_optimised: Final[bool]
_simd_level: Final[str]

def _address_read(value: ArrayLike) -> int: ...
def _panic() -> None: ...
def _parse_time(text: str) -> int: ...
def track(
    field: Field,
    sun_azimuth_rad: ArrayLike,
    sun_elevation_rad: ArrayLike,
    offset: str = "exact",
    *,
    out: Tracking | None = None,
    present: tuple[ArrayLike, ArrayLike] | Tracking | None = None,
    continuous: bool = False,
    times: Any | None = None,
) -> Tracking: ...
def forward(field: Field, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> NDArray[np.float64]: ...
def sun_position(
    times: Any,
    latitude_deg: float,
    longitude_deg: float,
    *,
    elevation_m: float = 0.0,
    pressure_hpa: float | None = None,
    temperature_c: float | None = None,
    delta_t_s: float | None = None,
    ut1_utc_s: float = 0.0,
) -> SunPosition: ...
def _correct(
    field: Field,
    columns: list[Any],
    status: NDArray[np.uint8],
    leftovers: Any,
    progress: Callable[[int, int], Any] | None,
) -> dict[str, Any]: ...
def _verify(
    field: Field,
    columns: list[Any],
    status: NDArray[np.uint8],
    sun_azimuth_rad: ArrayLike,
    sun_elevation_rad: ArrayLike,
    times: Any | None,
) -> list[Any]: ...
def _tracked_table(
    field: Field,
    columns: list[Any],
    status: NDArray[np.uint8],
    parts: tuple[bool, bool],
    kind: str,
    times: Any | None,
    sun_azimuth_rad: ArrayLike | None,
    sun_elevation_rad: ArrayLike | None,
) -> Any: ...
def _predict(
    field: Field,
    azimuth_rad: ArrayLike,
    elevation_rad: ArrayLike,
    sun_azimuth_rad: ArrayLike,
    sun_elevation_rad: ArrayLike,
    times: Any | None,
) -> list[Any]: ...
def _predict_rows(
    field: Field,
    heliostat: list[int],
    angles: Sequence[NDArray[np.float64]],
    suns: Sequence[Any],
    unix_ns: list[int] | None,
) -> list[Any]: ...
def _landed_table(
    field: Field,
    landed: list[Any],
    kind: str,
    times: Any | None,
    sun_azimuth_rad: ArrayLike | None,
    sun_elevation_rad: ArrayLike | None,
    heliostats: list[int] | None,
) -> Any: ...
def _angles(field: Field, angles: Any) -> dict[str, NDArray[Any]]: ...
def _calibrate(
    field: Field,
    observations: Any,
    spots: Any | None,
    compare: Any | None,
    words: dict[str, Any],
    progress: Any | None,
) -> dict[str, Any]: ...
def _calibrate_joint(
    field: Field,
    observations: Any,
    spots: Any | None,
    compare: Any | None,
    words: dict[str, Any],
    progress: Callable[[int, int], Any] | None,
) -> dict[str, Any]: ...
def _write_table(path: str | PathLike[str], columns: list[tuple[str, str, Any]]) -> int: ...
def _write_text(path: str | PathLike[str], text: str) -> None: ...
def _find_spots(
    frames: list[Any],
    names: list[str],
    times: list[int] | None,
    asked: dict[str, Any],
    pictures: list[str],
    alone: bool,
    progress: Any | None,
) -> dict[str, Any]: ...
def _find_raw_spots(
    source: Any, raw: str, clock: tuple[int, float] | None, asked: dict[str, Any], progress: Any | None
) -> dict[str, Any]: ...
def _frame_files(paths: Sequence[str | PathLike[str]]) -> tuple[list[Path], str | None]: ...
def _frame_times(
    called: Sequence[str | PathLike[str]], frames: int, start_ns: int, fps: float, numbered: bool
) -> tuple[list[int], str | None]: ...
def _pixels_read(image: Any) -> int: ...
def _accuracy(spots: Any, weather: Any | None, words: dict[str, Any]) -> _Judged: ...

@final
class _Judged:
    def json(self) -> str: ...
    def frames(self) -> list[tuple[str, str, Any]]: ...
    def methods_differ(self) -> list[str] | None: ...
    def html(self) -> str: ...

@final
class Field:
    def __new__(
        cls,
        position_enu_m: ArrayLike,
        aim_enu_m: ArrayLike | None = None,
        *,
        aim: str | Sequence[str] | None = None,
        ids: Sequence[str] | None = None,
        mirror_offset_m: ArrayLike = 0.0,
        pedestal_tilt_rad: ArrayLike = 0.0,
        pedestal_tilt_azimuth_rad: ArrayLike = 0.0,
        axis_nonorthogonality_rad: ArrayLike = 0.0,
        mirror_tilt_rad: ArrayLike = 0.0,
        azimuth_reference_rad: ArrayLike = 0.0,
        elevation_reference_rad: ArrayLike = 0.0,
        axis1_sag_rad: ArrayLike = 0.0,
        axis2_sag_rad: ArrayLike = 0.0,
        axis2_eccentricity_rad: ArrayLike = 0.0,
        axis1_min_rad: ArrayLike | None = None,
        axis1_max_rad: ArrayLike | None = None,
        axis2_min_rad: ArrayLike | None = None,
        axis2_max_rad: ArrayLike | None = None,
        mode: str = "azimuth-elevation",
        axis_azimuth_rad: float | None = None,
        latitude_rad: float | None = None,
        site: Mapping[str, Any] | None = None,
        targets: Mapping[str, Mapping[str, Any]] | None = None,
        drives: tuple[Drive | None, Drive | None] | Sequence[tuple[Drive | None, Drive | None]] | None = None,
    ) -> Field: ...
    @staticmethod
    def from_toml(path: str | PathLike[str]) -> Field: ...
    def __len__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    @property
    def ids(self) -> list[str]: ...
    def row_of(self, id: str) -> int | None: ...
    @property
    def mode(self) -> str: ...
    @property
    def axis_azimuth_rad(self) -> float | None: ...
    @property
    def latitude_rad(self) -> float | None: ...
    @property
    def position_enu_m(self) -> NDArray[np.float64]: ...
    @property
    def aim_enu_m(self) -> NDArray[np.float64]: ...
    @property
    def mirror_offset_m(self) -> NDArray[np.float64]: ...
    @property
    def pedestal_tilt_rad(self) -> NDArray[np.float64]: ...
    @property
    def pedestal_tilt_azimuth_rad(self) -> NDArray[np.float64]: ...
    @property
    def axis_nonorthogonality_rad(self) -> NDArray[np.float64]: ...
    @property
    def mirror_tilt_rad(self) -> NDArray[np.float64]: ...
    @property
    def azimuth_reference_rad(self) -> NDArray[np.float64]: ...
    @property
    def elevation_reference_rad(self) -> NDArray[np.float64]: ...
    @property
    def axis1_sag_rad(self) -> NDArray[np.float64]: ...
    @property
    def axis2_sag_rad(self) -> NDArray[np.float64]: ...
    @property
    def axis2_eccentricity_rad(self) -> NDArray[np.float64]: ...
    @property
    def axis1_min_rad(self) -> NDArray[np.float64]: ...
    @property
    def axis1_max_rad(self) -> NDArray[np.float64]: ...
    @property
    def axis2_min_rad(self) -> NDArray[np.float64]: ...
    @property
    def axis2_max_rad(self) -> NDArray[np.float64]: ...
    @property
    def drives(self) -> list[tuple[Drive | None, Drive | None]]: ...
    @property
    def site(self) -> dict[str, Any] | None: ...
    @property
    def targets(self) -> dict[str, dict[str, Any]]: ...
    @property
    def aim(self) -> list[str | None]: ...
    def steps(
        self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def angles_rad(
        self, axis1_steps: ArrayLike, axis2_steps: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def sun_position(self, times: Any) -> SunPosition: ...
    def check(
        self, time: Any | None = None, *, progress: Callable[[int, int], Any] | bool | None = None
    ) -> FieldCheck: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def files(self) -> list[Path]: ...
    def __copy__(self) -> Field: ...
    def __deepcopy__(self, _memo: Any, /) -> Field: ...
    @staticmethod
    def _from_columns(
        arguments: dict[str, Any],
        surroundings: str = "",
        calibration: list[tuple[str, str, Any]] | None = None,
    ) -> Field: ...
    @staticmethod
    def _read_again(
        path: str | PathLike[str], hashes: Sequence[str], calibration: list[tuple[str, str, Any]] | None = None
    ) -> Field: ...
    def _calibrated(self, calibration: list[tuple[str, str, Any]]) -> Field: ...

@final
class Tracking:
    @property
    def azimuth_rad(self) -> NDArray[np.float64]: ...
    @property
    def elevation_rad(self) -> NDArray[np.float64]: ...
    @property
    def axis1_rad(self) -> NDArray[np.float64]: ...
    @property
    def axis2_rad(self) -> NDArray[np.float64]: ...
    @property
    def incidence_rad(self) -> NDArray[np.float64]: ...
    @property
    def limit_excess_rad(self) -> NDArray[np.float64]: ...
    @property
    def status(self) -> NDArray[np.uint8]: ...
    @property
    def status_words(self) -> NDArray[np.str_]: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    def to_table(
        self,
        field: Field,
        kind: str = "dict",
        *,
        times: Any | None = None,
        sun_azimuth_rad: ArrayLike | None = None,
        sun_elevation_rad: ArrayLike | None = None,
    ) -> Any: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    @staticmethod
    def _from_columns(
        azimuth_rad: ArrayLike,
        elevation_rad: ArrayLike,
        incidence_rad: ArrayLike,
        limit_excess_rad: ArrayLike,
        status: ArrayLike,
    ) -> Tracking: ...

@final
class Drive:
    @staticmethod
    def encoder(
        steps_per_rad: float,
        *,
        zero_steps: float = 0.0,
        sign: float = 1.0,
        min_steps: float | None = None,
        max_steps: float | None = None,
    ) -> Drive: ...
    @staticmethod
    def screw(
        arm_a_m: float,
        arm_b_m: float,
        bracket_rad: float,
        zero_length_m: float,
        *,
        steps_per_m: float = 1.0,
        sign: float = 1.0,
        min_steps: float | None = None,
        max_steps: float | None = None,
    ) -> Drive: ...
    @staticmethod
    def triangle(
        offset_m: float,
        pivot_radius_m: float,
        initial_stroke_length_m: float,
        initial_angle_rad: float,
        steps_per_m: float,
        *,
        clockwise: bool = False,
        sign: float = 1.0,
        min_steps: float | None = None,
        max_steps: float | None = None,
    ) -> Drive: ...
    def steps(self, angle_rad: ArrayLike) -> Any: ...
    def angle_rad(self, steps: ArrayLike) -> Any: ...
    def quantised_rad(self, angle_rad: ArrayLike) -> Any: ...
    @property
    def range_rad(self) -> tuple[float, float]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    @staticmethod
    def _from_numbers(numbers: Sequence[float]) -> Drive: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...

def _flux_mesh(
    asked: dict[str, Any],
    nodes: ArrayLike | None,
    corners: list[list[int]],
    displacements: ArrayLike | None,
    scene: dict[str, Any],
    progress: Callable[[int, int], Any] | None,
) -> Flux: ...
def _flux_field(
    field: Field,
    scene: dict[str, Any],
    sun_azimuth_rad: float,
    sun_elevation_rad: float,
    unix_ns: int | None,
    progress: Callable[[int, int], Any] | None,
) -> Flux: ...
def _flux_camera(
    path: str | PathLike[str] | None,
    gray: ArrayLike | None,
    white: float | None,
    gauge: list[float],
    dark: float,
    target: str | PathLike[str] | None,
) -> Any: ...

@final
class Flux:
    @property
    def flux_w_m2(self) -> NDArray[np.float64]: ...
    @property
    def shape(self) -> tuple[int, int]: ...
    @property
    def area_m2(self) -> NDArray[np.float64]: ...
    @property
    def u_m(self) -> NDArray[np.float64]: ...
    @property
    def v_m(self) -> NDArray[np.float64]: ...
    @property
    def centre_m(self) -> NDArray[np.float64]: ...
    @property
    def peak_w_m2(self) -> float: ...
    @property
    def peak_bin(self) -> tuple[int, int]: ...
    @property
    def mean_w_m2(self) -> float: ...
    @property
    def dni_w_m2(self) -> float: ...
    @property
    def account(self) -> FluxAccount: ...
    @property
    def status(self) -> NDArray[np.uint8] | None: ...
    @property
    def slopes(self) -> SlopeErrors | None: ...
    @property
    def warnings(self) -> list[str]: ...
    def to_table(self, kind: str = "dict") -> Any: ...
    def write(self, path: str | PathLike[str]) -> None: ...
    def write_slopes(self, path: str | PathLike[str]) -> None: ...
    def __copy__(self) -> Flux: ...
    def __deepcopy__(self, _memo: Any, /) -> Flux: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
    @staticmethod
    def _from_kept(kept: dict[str, Any]) -> Flux: ...

def _convert_paint(asked: dict[str, Any], progress: Callable[[int, int], Any] | None) -> dict[str, Any]: ...
def _simulate_field(
    heliostats: int,
    layout: str,
    tower_height_m: float,
    mirror_width_m: float,
    mirror_height_m: float,
    pivot_height_m: float,
) -> dict[str, Any]: ...
def _simulate_observations(
    field: Field, asked: dict[str, Any], progress: Callable[[int, int], Any] | None
) -> _Campaign: ...
def _simulate_images(
    observations: Any | None,
    asked: dict[str, Any],
    out: str | PathLike[str] | None,
    progress: Callable[[int, int], Any] | None,
) -> dict[str, Any]: ...
def _simulate_campaign(asked: dict[str, Any]) -> dict[str, Any]: ...
def _init(folder: str | PathLike[str], force: bool) -> Path: ...
def _schema(of: str) -> str: ...
def _check_field(field: Field, unix_ns: int | None, progress: Callable[[int, int], Any] | None) -> dict[str, Any]: ...

@final
class _Campaign:
    def observations(self) -> dict[str, Any]: ...
    def truth(self) -> dict[str, Any]: ...
    def unseen(self) -> list[str]: ...
    def write(self, path: str | PathLike[str], truth: bool) -> None: ...
