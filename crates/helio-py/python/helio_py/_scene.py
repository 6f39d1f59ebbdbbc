"""Scenes of flux: a scene.toml, or its keys as a mapping."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from helio_py._errors import DataTypeError, OptionError


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
        return {"path": "scene", "text": _toml(scene), **asked}
    if isinstance(scene, (str, os.PathLike)):
        return {"path": os.fspath(scene), "text": None, **asked}
    found = "nothing" if scene is None else type(scene).__name__
    raise _wrong("scene", f"expected the path of a scene.toml or a mapping of its tables, got {found}")


def _wrong(what: str, message: str) -> DataTypeError:
    error = DataTypeError(f"{what}: {message}")
    error.field = what
    return error


def _toml(scene: Mapping[Any, Any]) -> str:
    lines = []
    for name, table in scene.items():
        if not isinstance(table, Mapping):
            raise _wrong(f"scene {name}", f"expected a mapping of keys, got {type(table).__name__}")
        lines.append(f"[{_key(name)}]")
        for key, value in table.items():
            lines.append(f"{_key(key)} = {_value(f'scene {name}.{key}', value)}")
    return "\n".join(lines) + "\n"


def _key(name: Any) -> str:
    if not isinstance(name, str):
        raise _wrong("scene", f"expected names of keys, got {type(name).__name__}")
    return name if name.replace("_", "").isalnum() and name.isascii() else _text(name)


def _value(what: str, value: Any) -> str:
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, (int, float)):
        return repr(value)  # reads back as the same number
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(what, one) for one in value) + "]"
    raise _wrong(what, f"expected a number, a text or a list of them, got {type(value).__name__}")


def _text(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
