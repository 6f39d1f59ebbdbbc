"""Scenes of flux: a scene.toml, or its keys as a mapping."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from helio_py._checked import number, path, whole
from helio_py._toml import toml_of, wrong


def scene_asked(
    scene: Any, dni_w_m2: float | None, half_angle_mrad: float | None, rays: int | None, seed: int | None
) -> dict[str, Any]:
    """What the native part wants of a scene; a mapping goes as the text that a file would have."""
    most = 2**63 - 1
    asked: dict[str, Any] = {
        "dni_w_m2": None if dni_w_m2 is None else number("dni_w_m2", dni_w_m2),
        "half_angle_mrad": None if half_angle_mrad is None else number("half_angle_mrad", half_angle_mrad),
        "rays": None if rays is None else whole("rays", rays, 1, most),
        "seed": None if seed is None else whole("seed", seed, 0, most),
    }
    if isinstance(scene, Mapping):
        for name, table in scene.items():
            if not isinstance(table, Mapping):
                raise wrong(f"scene {name}", f"expected a mapping of keys, got {type(table).__name__}")
        return {"path": "scene", "text": toml_of(scene, "scene"), **asked}
    if isinstance(scene, (str, os.PathLike)):
        return {"path": path("scene", scene), "text": None, **asked}
    found = "nothing" if scene is None else type(scene).__name__
    raise wrong("scene", f"expected the path of a scene.toml or a mapping of its tables, got {found}")
