"""What long calls are told to say how far they are."""

from __future__ import annotations

import importlib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from helio_py._errors import DataTypeError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@contextmanager
def reporter(
    progress: Callable[[int, int], Any] | bool | None, what: str
) -> Iterator[Callable[[int, int], Any] | None]:
    """A callable of (done, all), or None: what was given, or for True a bar of tqdm that counts ``what``."""
    if progress is None or progress is False:
        yield None
    elif progress is True:
        tqdm = importlib.import_module("tqdm.auto").tqdm  # only where it is asked for
        with tqdm(unit=what, unit_scale=True) as bar:

            def report(done: int, all_: int) -> None:
                bar.total = all_
                bar.update(done - bar.n)

            yield report
    elif callable(progress):
        yield progress
    else:
        error = DataTypeError(f"progress: expected a callable, True or None, got {type(progress).__name__}")
        error.field = "progress"
        raise error
