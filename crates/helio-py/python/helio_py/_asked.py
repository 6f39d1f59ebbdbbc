"""Options of ``calibrate`` in the words of the native part."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date, datetime
from typing import Any

from helio_py._checked import pair, several, text, texts, whole, wrong_type, wrong_value
from helio_py._errors import HelioError


def words_of(name: str, value: Any) -> list[str]:
    """One text or several."""
    return [text(name, value)] if isinstance(value, str) else texts(name, value)


def priors_of(prior: Any) -> list[str]:
    """What is known of parameters."""
    if not isinstance(prior, Mapping):
        return words_of("prior", prior)
    words = []
    for name, value in prior.items():
        try:
            mean, sigma = pair(f"prior: {name}", value)
        except HelioError as error:
            error.field = "prior"
            raise
        words.append(f"{text('prior', name)}={mean!r}:{sigma!r}")
    return words


def sets_of(sets: Any) -> str:
    """How many sets over the day."""
    return text("sets", sets) if isinstance(sets, str) else str(whole("sets", sets, 0, 2**63))


def plan_of(plan: Any) -> tuple[int, str] | None:
    """A number of observations and their day."""
    if plan is None:
        return None
    parts = several("plan", plan, "a number and a day, such as (3, '2026-06-21')")
    if len(parts) != 2:
        raise wrong_value("plan", f"wanted a number and a day, such as (3, '2026-06-21'), got {len(parts)} parts")
    count, day = parts
    if isinstance(day, datetime):
        # of which day it is depends on who asks: the proposals are of the day by the sun of the site
        raise wrong_type("plan", "a day, such as '2026-06-21' or a datetime.date", day)
    return whole("plan", count, 0, 2**32 - 1), day.isoformat() if isinstance(day, date) else text("plan", day)
