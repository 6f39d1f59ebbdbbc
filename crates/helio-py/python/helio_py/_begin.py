"""``init``, ``schema`` and what ``Field.check`` answers: how a field of files begins, and whether it can work."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from helio_py._checked import flag, path, text, wrong_value
from helio_py._native import Field, _check_field, _init, _schema
from helio_py._progress import reporter

if TYPE_CHECKING:
    import os
    from collections.abc import Callable
    from pathlib import Path


def init(folder: str | os.PathLike[str], force: bool = False) -> Path:
    """Writes a field to start from: field.toml and heliostats.csv, the same bytes as ``helio-rs init`` writes.

    Parameters
    ----------
    folder : path
        Where; made if it does not exist.
    force : bool, default False
        Replace files that are there.

    Returns
    -------
    Path
        The field.toml, for ``Field.from_toml``.

    Raises
    ------
    ConflictError
        Where one of the files is there already.
    FileError

    Examples
    --------
    >>> import tempfile
    >>> import helio_py as hp
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     hp.Field.from_toml(hp.init(folder))
    <Field of 500 heliostats, azimuth-elevation>
    """
    return _init(path("folder", folder), flag("force", force))


def schema(of: str = "field") -> dict[str, Any]:
    """JSON Schema of a kind of file, for editors that complete and check TOML by one.

    Parameters
    ----------
    of : str, default "field"
        For field.toml; or "target", "scene".

    Returns
    -------
    dict
        What ``helio-rs schema`` prints, parsed.

    Raises
    ------
    OptionError, DataTypeError

    Examples
    --------
    >>> import helio_py as hp
    >>> hp.schema()["properties"]["site"]["properties"]["latitude_deg"]["maximum"]
    90.0
    """
    printed = _schema(text("of", of))
    import json  # not at import, which is to be quick

    found: dict[str, Any] = json.loads(printed)
    return found


class FieldCheck:
    """What the files of a field say, and whether it can work.

    Made by ``Field.check``; printed it is what ``helio-rs check`` prints.
    """

    def __init__(self, found: dict[str, Any]) -> None:
        """Of what the native part found; not for users."""
        self._found = found

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        rows = sum(self.counts.values())
        return f"<FieldCheck: {self.counts['ok']} of {rows} rows ok over {self.suns} suns>"

    @property
    def text(self) -> str:
        """All of it, as the command line prints it."""
        return str(self._found["text"])

    @property
    def lines(self) -> list[str]:
        """The same line by line."""
        return self.text.splitlines()

    @property
    def suns(self) -> int:
        """Suns that every heliostat was tracked through."""
        return int(self._found["suns"])

    @property
    def counts(self) -> dict[str, int]:
        """Rows of each status, a row a sun and heliostat; by the words of ``status_words``."""
        return dict(self._found["counts"])

    @property
    def never(self) -> list[str]:
        """Heliostats that never reach their aim."""
        return list(self._found["never"])

    @property
    def sometimes(self) -> list[str]:
        """Heliostats that do so for some of the suns only."""
        return list(self._found["sometimes"])


def checked(field: Field, time: Any, progress: Callable[[int, int], Any] | bool | None) -> FieldCheck:
    """A field looked at, for ``Field.check``."""
    unix_ns = None
    if time is not None:
        from helio_py._times import unix_ns as of_times  # which imports more than a package should by itself

        at = of_times(time)
        if at.ndim:
            raise wrong_value("time", f"wanted one instant, got an array of shape {at.shape}")
        unix_ns = int(at)
    with reporter(progress, "suns") as report:
        return FieldCheck(_check_field(field, unix_ns, report))
