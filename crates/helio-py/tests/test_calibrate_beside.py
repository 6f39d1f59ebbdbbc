"""What a calibration is asked beside its table: the next observations, what changed, a page; as the command line's."""

from __future__ import annotations

import csv
import datetime as dt
import pickle
import re
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import helio_py as hp
from conftest import ROOT

FIELD, SEEN = ROOT / "examples" / "field.toml", ROOT / "examples" / "observations.csv"
#: Both ways of calibrating.
WAYS: list[tuple[list[str], dict[str, Any]]] = [([], {}), (["--joint"], {"joint": True})]
both_ways = pytest.mark.parametrize(("typed", "keywords"), WAYS, ids=["one by one", "as one"])


@pytest.fixture(scope="module")
def earlier(example: hp.Field, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibration that the others are compared with: by another loss."""
    path = tmp_path_factory.mktemp("earlier") / "earlier.csv"
    hp.calibrate(example, SEEN, robust="cauchy").write(path)
    return path


def said(command_line: str, *typed: str | Path, observations: Path = SEEN) -> list[str]:
    """What the command line says."""
    line = [command_line, "calibrate", "--field", FIELD, "--observations", observations, *typed]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    return done.stderr.splitlines()


def of_changes(lines: list[str]) -> list[str]:
    return [line for line in lines if line.startswith("compared: ") or ": changed by " in line]


def columns_of(path: Path) -> dict[str, Any]:
    with path.open() as file:
        rows = list(csv.DictReader(file))
    texts = ("heliostat_id", "time", "target")
    return {name: [row[name] if name in texts else float(row[name]) for row in rows] for name in rows[0]}


def without_time(page: Path) -> str:
    """A page but for when it was made."""
    text, times = re.subn(r"20\d\d-\d\d-\d\dT\d\d:\d\d:\d\dZ", "", page.read_text(), count=1)
    assert times == 1
    return text


class Parsed(HTMLParser):
    """What a page is made of: its elements, those that are open, and whatever it would fetch."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.counts: dict[str, int] = {}
        self.open: list[str] = []
        self.fetched: list[str] = []
        self.text = ""
        self.feed(page.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.counts[tag] = self.counts.get(tag, 0) + 1
        if tag not in ("meta", "br", "hr", "img", "link", "input", "col"):
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href") and value is not None and not value.startswith(("#", "data:")):
                self.fetched.append(value)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.counts[tag] = self.counts.get(tag, 0) + 1

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.mark.parametrize("day", ["2026-06-21", dt.date(2026, 6, 21)])
@both_ways
def test_the_next_observations_are_the_command_line_s(
    typed: list[str], keywords: dict[str, Any], day: Any, command_line: str, example: hp.Field, tmp_path: Path
) -> None:
    theirs, ours = tmp_path / "cli.csv", tmp_path / "ours.csv"
    plan: list[str | Path] = ["--plan", "3", "--plan-date", "2026-06-21", "--plan-out", theirs]
    said(command_line, *plan, *typed, "--out", tmp_path / "calibration.csv")
    found = hp.calibrate(example, SEEN, plan=(3, day), **keywords)
    found.write(ours, "plan")
    assert ours.read_bytes() == theirs.read_bytes()
    table = found.to_table("plan")
    assert set(np.unique(table["id"], return_counts=True)[1]) == {3}
    assert (table["year_pointing_after_mrad"] <= table["year_pointing_before_mrad"]).all()
    # of that day, from the site's midnight by the sun to the next
    assert (abs(table["time"] - np.datetime64("2026-06-21T12:25")) < np.timedelta64(12, "h")).all()


@both_ways
def test_changes_are_told_as_the_command_line_tells_them(
    typed: list[str], keywords: dict[str, Any], command_line: str, example: hp.Field, earlier: Path, tmp_path: Path
) -> None:
    lines = said(command_line, "--compare", earlier, "--out", tmp_path / "calibration.csv", *typed)
    found = hp.calibrate(example, SEEN, compare=earlier, **keywords)
    assert found.changes == of_changes(lines)
    assert len(found.changes) >= 5
    table = found.to_table("changes")
    assert list(table) == ["id", "beam_mrad", "chi_square", "degrees_of_freedom", "pairs", "significant", "why"]
    assert (np.diff(table["beam_mrad"]) <= 0).all()
    one_by_one = [line for line in found.changes if ": changed by " in line]
    for sentence, one, mrad, chi, freedom in zip(
        one_by_one, table["id"], table["beam_mrad"], table["chi_square"], table["degrees_of_freedom"], strict=True
    ):
        assert sentence.startswith(f"{one}: changed by {mrad:.3f} mrad")
        assert f"(chi-square {chi:.1f} on {freedom})" in sentence
    again = pickle.loads(pickle.dumps(found))
    assert again.changes == found.changes
    assert hp.calibrate(example, SEEN, **keywords).changes == []


@pytest.mark.parametrize("kind", ["path", "calibration", "joint", "dict", "pandas", "polars", "pyarrow"])
def test_whatever_kind_the_earlier_one_is(kind: str, example: hp.Field, earlier: Path, tmp_path: Path) -> None:
    give: dict[str, Callable[[], Any]] = {
        "path": lambda: str(earlier),
        "calibration": lambda: hp.calibrate(example, SEEN, robust="cauchy"),
        "joint": lambda: hp.calibrate(example, SEEN, joint=True),
        "dict": lambda: hp.calibrate(example, SEEN, robust="cauchy").to_table(),
        "pandas": lambda: pd.read_csv(earlier),
        "polars": lambda: pl.read_csv(earlier),
        "pyarrow": lambda: hp.calibrate(example, pa.table(columns_of(SEEN)), robust="cauchy").to_table(),
    }
    compared = give[kind]()
    found = hp.calibrate(example, SEEN, compare=compared)
    if kind == "joint":
        earlier = tmp_path / "joint.csv"
        compared.write(earlier)
    assert found.changes == hp.calibrate(example, SEEN, compare=earlier).changes
    assert len(found.to_table("changes")["id"]) == len(found)


def test_changes_are_what_was_changed(example: hp.Field) -> None:
    """Errors turned by hand, and what that turns by the geometry of mirrors."""
    calibration = hp.calibrate(example, SEEN)
    same = hp.calibrate(example, SEEN, compare=calibration).to_table("changes")
    assert (same["beam_mrad"] == 0).all()
    assert (same["chi_square"] == 0).all()
    assert set(same["significant"]) == {"no"}
    # A mirror turned by 5 mrad turns its beam by 10 where the turn is square to the plane of incidence, else by less.
    table = {name: cells.copy() for name, cells in calibration.to_table().items()}
    table["elevation_reference_deg"][1] += np.degrees(5e-3)
    judged = hp.calibrate(example, SEEN, compare=table).to_table("changes")
    assert judged["id"][0] == calibration.ids[1]
    assert 7 < judged["beam_mrad"][0] <= 10.001
    assert (judged["beam_mrad"][1:] == 0).all()
    assert judged["significant"].tolist() == ["yes", "no", "no", "no"]
    # Chi-square of a step in terms of both covariances, or of the one that there is.
    step, covariance = np.array([0, 0, 0, 0, 5e-3, 0]), calibration.covariance[1][:6, :6]
    want = step @ np.linalg.solve(covariance, step)
    assert judged["chi_square"][0] == pytest.approx(want / 2, rel=1e-6)
    assert judged["degrees_of_freedom"][0] == 6
    del table["covariance"]
    judged = hp.calibrate(example, SEEN, compare=table).to_table("changes")
    assert judged["chi_square"][0] == pytest.approx(want, rel=1e-6)
    # Heliostats that only one of both knows are counted.
    fewer = {name: cells[1:] for name, cells in calibration.to_table().items()}
    fewer["id"] = np.append(fewer["id"][:-1], "H002")
    told = hp.calibrate(example, SEEN, compare=fewer).changes
    assert "compared: 2 heliostats without an earlier calibration" in told
    assert "compared: 1 heliostat with an earlier calibration and no new one" in told


@both_ways
def test_pages_are_the_command_line_s(
    typed: list[str], keywords: dict[str, Any], command_line: str, example: hp.Field, earlier: Path, tmp_path: Path
) -> None:
    theirs, ours = tmp_path / "cli.html", tmp_path / "ours.HTM"
    known: list[str | Path] = ["--state", tmp_path / "s.parquet"] if typed else []
    said(command_line, "--report", theirs, "--compare", earlier, "--out", tmp_path / "c.csv", *typed, *known)
    found: hp.Calibration = hp.calibrate(example, SEEN, report=ours, compare=earlier, **keywords)
    assert without_time(ours) == without_time(theirs)
    page = Parsed(ours)
    assert page.open == []
    assert page.fetched == []
    assert page.counts["svg"] > 3
    assert all(sentence in page.text for sentence in found.changes)
    if isinstance(found, hp.JointCalibration):
        new = tmp_path / "new.csv"
        hp.simulate_observations(
            example, heliostats=3, count=3, from_time="2026-01-02T00:00:00Z", to_time="2026-01-03T00:00:00Z"
        ).write(new)
        more: list[str | Path] = ["--update", tmp_path / "s.parquet", "--report", theirs, "--out", tmp_path / "c.csv"]
        said(command_line, *more, observations=new)
        hp.calibrate(example, new, update=found, report=ours)
        assert without_time(ours) == without_time(theirs)


def test_the_page_of_tables_in_memory_differs_by_their_names_only(example: hp.Field, tmp_path: Path) -> None:
    of_file, of_memory = tmp_path / "file.html", tmp_path / "memory.html"
    hp.calibrate(example, SEEN, report=of_file)
    hp.calibrate(example, columns_of(SEEN), report=of_memory)
    named = r"<tr><th>observations(, SHA-256)?</th><td>.*?</td></tr>"
    pages = [re.sub(named, "", without_time(page)) for page in (of_file, of_memory)]
    # records have a line in a file, and a row in a table
    lined = re.sub(r"\bline (\d+)\b", lambda found: f"row {int(found[1]) - 1}", pages[0])
    assert lined == pages[1] != pages[0]


def test_sets_over_the_day_are_told_as_the_command_line_tells_them(
    command_line: str, example: hp.Field, tmp_path: Path
) -> None:
    lines = said(command_line, "--sets", "auto", "--out", tmp_path / "calibration.csv")
    table = hp.calibrate(example, SEEN, sets="auto").to_table("choices")
    want = [line.split(": sets over the day: ") for line in lines if "sets over the day" in line]
    assert len(want) == 4
    for one, words in want:
        rows = np.flatnonzero(table["id"] == one)
        told = "; ".join(
            f"{table['sets'][k]} {table['beam_rms_mrad'][k]:.2f} mrad ({table['unseen_rms_mrad'][k]:.2f} on days left out)"
            + (", taken" if table["taken"][k] else "")
            for k in rows
        )
        assert told == words


def test_what_heliostats_are_like_is_told_as_the_command_line_tells_it(
    command_line: str, example: hp.Field, tmp_path: Path
) -> None:
    lines = said(command_line, "--joint", "--out", tmp_path / "calibration.csv")
    told = next(line for line in lines if line.startswith("heliostats of this field [mrad]: "))
    found = hp.calibrate(example, SEEN, joint=True).of_field
    assert set(found) - {"pedestal_tilt1_rad", "pedestal_tilt2_rad"} < set(hp.calibrate(example, SEEN).sigma)
    numbers = re.findall(r" ([+-][\d.]+) ± ([\d.]+)", told)
    assert [(f"{1e3 * mean:+.1f}", f"{1e3 * spread:.1f}") for mean, spread in found.values()] == numbers


def test_a_prior_beside_records_of_unknown_noise_is_remarked(example: hp.Field) -> None:
    seen = {name: cells for name, cells in columns_of(SEEN).items() if name != "sigma_m"}
    found = hp.calibrate(example, seen, prior={"mirror_tilt": (0, 0.1)})
    assert any(warning.startswith("prior without sigma_m: ") for warning in found.warnings)
    assert hp.calibrate(example, seen).warnings == []


CALLS: list[tuple[type[hp.HelioError], str, str | None, dict[str, Any]]] = [
    (hp.OptionError, "plan: wanted 1 to 1000 observations, got 0", "plan", {"plan": (0, "2026-06-21")}),
    (hp.OptionError, "plan: 2026-13-01: wanted a day, such as 2026-06-21", "plan", {"plan": (1, "2026-13-01")}),
    (hp.DataTypeError, "plan: expected a day, such as '2026-06-21' or a datetime.date, got datetime", "plan",
     {"plan": (1, dt.datetime(2026, 6, 21, 12))}),
    (hp.DataTypeError, "plan: expected str, got int", "plan", {"plan": (1, 20260621)}),
    (hp.DataTypeError, "compare: expected a table", "compare", {"compare": 3}),
    (hp.FileUnreadableError, r"nowhere\.csv", None, {"compare": "nowhere.csv"}),
    (hp.UnknownNameError, r"compare: .*`u_m`", "u_m", {"compare": {"id": ["H001"], "u_m": [0.0]}}),
    (hp.MissingError, r"compare: .*`pedestal_tilt_deg`", "pedestal_tilt_deg", {"compare": {"id": ["H001"]}}),
    (hp.OptionError, r"report: page\.txt: wanted a name that ends in \.html", "report", {"report": "page.txt"}),
    (hp.OptionError, "report: page: wanted", "report", {"report": "page"}),
    (hp.DataTypeError, "report: expected a path, got int", "report", {"report": 3}),
    (hp.FileError, r"no/such/page\.html: cannot be written", None, {"report": "no/such/page.html"}),
]  # fmt: skip


@pytest.mark.parametrize("joint", [False, True])
@pytest.mark.parametrize(("error", "message", "named", "keywords"), CALLS)
def test_wrong_options_are_named(
    error: type[hp.HelioError],
    message: str,
    named: str | None,
    keywords: dict[str, Any],
    joint: bool,
    example: hp.Field,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error, match=f"^{message}") as caught:
        hp.calibrate(example, SEEN, **{**keywords, "joint": joint})
    assert caught.value.field == named
    assert list(tmp_path.iterdir()) == []


def test_no_page_takes_the_place_of_what_is_read_or_written(
    example: hp.Field, earlier: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # What is read is read whatever its name.
    compared, seen = tmp_path / "earlier.html", tmp_path / "seen.html"
    compared.write_bytes(earlier.read_bytes())
    seen.write_bytes(SEEN.read_bytes())
    monkeypatch.chdir(tmp_path)
    reads: list[dict[str, Any]] = [
        {"observations": seen, "report": seen},
        {"compare": compared, "report": "earlier.html"},
    ]
    for read in reads:
        for joint in (False, True):
            with pytest.raises(hp.OptionError, match=r"^report: .*this call reads it; name another file") as caught:
                hp.calibrate(example, **{"observations": SEEN, "joint": joint, **read})
            assert caught.value.field == "report"
    # Two names of one file that is not there yet.
    with pytest.raises(hp.OptionError, match=r"^report: .*: state names it too"):
        hp.calibrate(example, SEEN, joint=True, state=tmp_path / "one.html", report="one.html")
    Path("state.html").write_bytes(hp.calibrate(example, SEEN, joint=True).state)
    with pytest.raises(hp.OptionError, match=r"^report: .*: update names it too"):
        hp.calibrate(example, SEEN, update="state.html", report=tmp_path / "state.html")
    assert compared.read_bytes() == earlier.read_bytes()


def test_a_page_replaces_another_whole_or_not_at_all(example: hp.Field, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("as it was")

    def enough(_done: int, _of: int) -> None:
        assert page.read_text() == "as it was"
        raise RuntimeError("enough")

    for joint in (False, True):
        keywords: dict[str, Any] = {"joint": joint, "report": page}
        with pytest.raises(RuntimeError, match="enough"):
            hp.calibrate(example, SEEN, **keywords, progress=enough)
        with pytest.raises(hp.OptionError, match=r"^plan: tomorrow: wanted a day"):
            hp.calibrate(example, SEEN, **keywords, plan=(3, "tomorrow"))
        assert page.read_text() == "as it was"
        assert list(tmp_path.iterdir()) == [page]
    hp.calibrate(example, SEEN, report=page)
    assert page.read_text().startswith("<!DOCTYPE html>")


def test_sets_by_the_hour_need_a_site(example: hp.Field, root: Path, tmp_path: Path) -> None:
    text = (root / "examples" / "field.toml").read_text()
    (tmp_path / "heliostats.csv").write_bytes((root / "examples" / "heliostats.csv").read_bytes())
    site = text[text.index("[site]") : text.index("[", text.index("[site]") + 1)]
    (tmp_path / "field.toml").write_text(text.replace(site, ""))
    field = hp.Field.from_toml(tmp_path / "field.toml")
    seen = {name: cells for name, cells in columns_of(SEEN).items() if name != "time"}
    sun = example.sun_position(columns_of(SEEN)["time"])
    seen |= {
        "sun_azimuth_deg": np.degrees(sun.azimuth_rad),
        "sun_elevation_deg": np.degrees(sun.elevation_rad),
    }
    by_hour = hp.calibrate(example, SEEN, sets=2)
    by_hour.write(tmp_path / "hours.csv")
    why = "its sets change with the hour angle of the sun, which needs the latitude from .site."
    with pytest.raises(hp.OptionError, match=f"^compare: {why}") as caught:
        hp.calibrate(field, seen, compare=by_hour)
    assert caught.value.field == "compare"
    with pytest.raises(hp.OptionError, match=rf"^compare: .*hours\.csv: {why}"):
        hp.calibrate(field, seen, compare=tmp_path / "hours.csv")
    # Those of one set are compared at the suns of the records.
    assert hp.calibrate(field, seen, compare=hp.calibrate(field, seen)).changes[0].startswith("compared: 4 heliostats")
    with pytest.raises(hp.OptionError, match=r"^plan: there is no .site."):
        hp.calibrate(field, seen, plan=(1, "2026-06-21"))


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers of POSIX")
@pytest.mark.parametrize("way", ["joint=True", "plan=(40, '2026-06-21')"])
def test_ctrl_c_leaves_no_page(way: str, tmp_path: Path) -> None:
    # 1,500 heliostats: seconds, whichever part of it the signal comes into.
    script = textwrap.dedent(
        f"""
        import pathlib, signal
        import helio_py as hp
        folder = pathlib.Path({str(tmp_path)!r})
        (folder / "layout.csv").write_text(
            "id,east_m,north_m,up_m\\n" + "".join(f"H{{k}},{{(k % 60) * 9 - 270}},{{90 + k // 60 * 9}},6\\n" for k in range(1500))
        )
        text = pathlib.Path({str(FIELD)!r}).read_text()
        (folder / "field.toml").write_text(text.replace('"heliostats.csv"', '"layout.csv"'))
        field = hp.Field.from_toml(folder / "field.toml")
        hp.simulate_observations(field, count=40, random_errors=True).write(folder / "seen.csv")
        begun = []
        def told(done, of):
            if done == of and not begun:  # what is beside the calibration comes now
                begun.append(True)
                signal.raise_signal(signal.SIGINT)
        before = sorted(folder.iterdir())
        try:
            hp.calibrate(field, folder / "seen.csv", report=folder / "page.html", {way}, progress=told)
        except KeyboardInterrupt:
            print("stopped", sorted(folder.iterdir()) == before)
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=300)
    assert done.stdout == "stopped True\n", done.stderr


def test_what_changed_against_a_table_of_ones_own(example: hp.Field) -> None:
    """Columns without a cell, such as the times of a calibration that always holds, are of any type in pandas."""
    earlier = hp.calibrate(example, ROOT / "examples/observations.csv")
    want = hp.calibrate(example, ROOT / "examples/observations.csv", robust="huber", compare=earlier)
    found = hp.calibrate(
        example, ROOT / "examples/observations.csv", robust="huber", compare=pd.DataFrame(earlier.to_table())
    )
    assert found.changes == want.changes
