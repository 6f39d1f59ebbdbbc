"""Does any page of a built site load something from elsewhere? Links that a reader follows are no matter."""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from pathlib import Path

_ELSEWHERE = re.compile(r"\s*(https?:)?//", re.IGNORECASE)
_IN_CSS = re.compile(r"(?:url\(\s*|@import\s+)[\"']?((?:https?:)?//[^\"')\s]+)", re.IGNORECASE)


class _Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        loads = [given[name] for name in ("src", "srcset", "data", "poster") if name in given]
        if tag == "link" and given.get("rel") not in ("canonical", "next", "prev"):
            loads.append(given.get("href", ""))
        if given.get("data-md-component") == "source":
            loads.append(given.get("href", "https://api.github.com"))  # the theme asks it for its stars
        self.found += [f"{tag} {place}" for place in loads if _ELSEWHERE.match(place)]
        self.found += [f"{tag} style {place}" for place in _IN_CSS.findall(given.get("style", ""))]


def loaded_from_elsewhere(site: Path) -> list[str]:
    """What pages and style sheets load by an address with a host."""
    found = []
    for path in sorted(site.rglob("*.html")):
        page = _Page()
        page.feed(path.read_text(encoding="utf-8"))
        found += [f"{path.relative_to(site)}: {place}" for place in page.found]
    for path in sorted(site.rglob("*.css")):
        places = _IN_CSS.findall(path.read_text(encoding="utf-8"))
        found += [f"{path.relative_to(site)}: {place}" for place in places]
    return found


if __name__ == "__main__":
    pages = list(Path(sys.argv[1]).rglob("*.html"))
    found = loaded_from_elsewhere(Path(sys.argv[1]))
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(bool(found) or not pages)
