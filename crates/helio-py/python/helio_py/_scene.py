"""Scenes of flux: a scene.toml, or its keys as a mapping."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from helio_py._errors import OptionError
from helio_py._toml import toml_text, wrong


def scene_asked(
    scene: Any, dni_w_m2: float | None, half_angle_mrad: float | None, rays: int | None, seed: int | None
) -> dict[str, Any]:
    """What the native part wants of a scene; a mapping goes as the text that a file would have."""
    asked: dict[str, Any] = {
        "dni_w_m2": dni_w_m2,
        "half_angle_mrad": half_angle_mrad,
        "rays": rays,
        "seed": seed,
    }
    for name, least in (("rays", 1), ("seed", 0)):
        if asked[name] is not None and not least <= asked[name] < 2**63:
            error = OptionError(f"{name}: wanted a whole number of at least {least}, got {asked[name]}")
            error.field = name
            raise error
    if isinstance(scene, Mapping):
        for name, table in scene.items():
            if not isinstance(table, Mapping):
                raise wrong(f"scene {name}", f"expected a mapping of keys, got {type(table).__name__}")
        return {"path": "scene", "text": toml_text(scene, "scene"), **asked}
    if isinstance(scene, (str, os.PathLike)):
        return {"path": os.fspath(scene), "text": None, **asked}
    found = "nothing" if scene is None else type(scene).__name__
    raise wrong("scene", f"expected the path of a scene.toml or a mapping of its tables, got {found}")
