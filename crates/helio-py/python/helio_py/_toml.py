"""Mappings as the text of the TOML file that would say the same."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from helio_py._checked import path
from helio_py._errors import DataTypeError


def path_and_text(value: Any, what: str, of: str) -> tuple[str, str | None]:
    """The path of a file, or of a mapping a name for messages and the text of such a file; ``of`` is its usual name."""
    if isinstance(value, Mapping):
        return what, toml_of(value, what)
    if isinstance(value, (str, os.PathLike)):
        return path(what, value), None
    found = "nothing" if value is None else type(value).__name__
    raise wrong(what, f"expected the path of a {of} or a mapping of its keys, got {found}")


def surroundings(site: Any, targets: Any) -> str:
    """What a field.toml would say of the site and the targets of a field."""
    text = ""
    if site is not None:
        if not isinstance(site, Mapping):
            raise wrong("site", f"expected a mapping of the keys of [site], got {type(site).__name__}")
        text += f"[site]\n{toml_of(site, 'site')}"
    if targets is not None:
        if not isinstance(targets, Mapping):
            raise wrong("targets", f"expected names and mappings of their keys, got {type(targets).__name__}")
        for name, target in targets.items():
            if not isinstance(target, Mapping):
                raise wrong("targets", f"{name}: expected a mapping of keys, got {type(target).__name__}")
            text += f"[targets.{_key(name, 'targets')}]\n{toml_of(target, f'targets {name}')}"
    return text


def wrong(what: str, message: str) -> DataTypeError:
    """An argument that is not what is wanted; behind its name may stand what of it."""
    error = DataTypeError(f"{what}: {message}")
    error.field = what.partition(" ")[0]
    return error


def toml_of(table: Mapping[Any, Any], what: str) -> str:
    """The text of a file that says what a mapping says."""
    try:
        return toml_text(table, what)
    except RecursionError:
        raise wrong(what, "expected the keys of a file, got a mapping within itself") from None


def toml_text(table: Mapping[Any, Any], what: str, section: str = "") -> str:
    """Keys first, then tables, however deep."""
    lines, tables = [], []
    for name, value in table.items():
        key = _key(name, what)
        if isinstance(value, Mapping):
            inner = f"{section}.{key}" if section else key
            tables.append(f"[{inner}]\n{toml_text(value, what, inner)}")
        elif value is not None:
            dotted = f"{section}.{key}" if section else key
            lines.append(f"{key} = {_value(f'{what} {dotted}', value)}\n")
    return "".join(lines + tables)


def _key(name: Any, what: str) -> str:
    if not isinstance(name, str):
        raise wrong(what, f"expected names of keys, got {type(name).__name__}")
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
    raise wrong(what, f"expected a number, a text or a list of them, got {type(value).__name__}")


def _text(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
