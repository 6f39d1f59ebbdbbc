"""What long calls are told to say how far they are."""

from __future__ import annotations

import importlib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from helio_py._checked import wrong_type, wrong_value

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
        try:
            tqdm = importlib.import_module("tqdm.auto").tqdm  # only where it is asked for
        except ImportError:
            raise wrong_value("progress", "True wants tqdm, which is not installed: pip install tqdm") from None
        with tqdm(unit=what, unit_scale=True) as bar:

            def report(done: int, all_: int) -> None:
                bar.total = all_
                bar.update(done - bar.n)

            yield report
    elif callable(progress):
        yield progress
    else:
        raise wrong_type("progress", "a callable, True or None", progress)
