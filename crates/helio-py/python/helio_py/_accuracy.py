"""``accuracy``: a tracking-accuracy campaign judged by a guideline."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from helio_py._checked import number, pair, texts
from helio_py._checked import path as checked_path
from helio_py._native import _accuracy, _write_table, _write_text
from helio_py._tables import checked_kind, given_back
from helio_py._toml import path_and_text

if TYPE_CHECKING:
    from os import PathLike


class AccuracyFigure(NamedTuple):
    """A figure with one standard deviation from each cause [mrad]; None is what was not stated, or nobody knows."""

    #: The figure.
    mrad: float
    #: Of all causes together.
    sigma_mrad: float | None
    #: Because frames are few.
    sigma_sampling_mrad: float | None
    #: Of the distance.
    sigma_slant_mrad: float | None
    #: Of the pixel scale.
    sigma_pixel_scale_mrad: float | None
    #: Of the survey of the target.
    sigma_survey_mrad: float | None
    #: Of the centres of spots.
    sigma_centre_mrad: float | None


class Accuracy:
    """A judged campaign: the numbers of ``helio-rs accuracy``, and its page.

    Made by ``accuracy``.
    """

    def __init__(self, judged: Any) -> None:
        """Of what the native part found; not for users."""

        self._judged = judged
        self._html: str | None = None
        self._json: str = judged.json()
        self._found: dict[str, Any] = _parsed(self._json)
        self._frames = judged.frames()
        self._warnings: list[str] = self._found["warnings"]
        differ = judged.methods_differ()
        if differ is not None:
            self._warnings = [
                f"the spots are of the method {differ[1]}, though the campaign states {differ[0]}",
                *self._warnings,
            ]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_judged": None, "_html": self.to_html()}

    def __repr__(self) -> str:
        counted, frames = self.counts.get("ok", 0), len(self._frames[0][2])
        return f"<Accuracy: {self.verdict}; {counted} of {frames} frames counted>"

    @property
    def verdict(self) -> str:
        """The word: "qualified", "not qualified" or "not enough data"."""
        return str(self._found["verdict"])

    @property
    def printed_rule(self) -> str | None:
        """What the rule as printed says, which knows no intervals; None where it says nothing."""
        return self._found["printed_rule"]

    def _figure(self, name: str) -> AccuracyFigure | None:
        figures = self._found["figures"]
        return None if figures is None else AccuracyFigure(**figures[name])

    @property
    def accuracy(self) -> AccuracyFigure | None:
        """Root mean square error about the aim point (clause 3.2); None where no frame counts."""
        return self._figure("accuracy")

    @property
    def precision(self) -> AccuracyFigure | None:
        """The same about the mean spot (clause 3.3)."""
        return self._figure("precision")

    @property
    def bias(self) -> AccuracyFigure | None:
        """Of the mean spot: accuracy² = precision² + bias²."""
        return self._figure("bias")

    @property
    def shares(self) -> list[dict[str, Any]]:
        """For each wind speed of a limit, the share of frames within the angle, its interval and what that means."""
        return list(self._found["shares"])

    @property
    def histogram(self) -> list[dict[str, Any]]:
        """The same for all bins of wind speed."""
        return list(self._found["histogram"])

    @property
    def counts(self) -> dict[str, int]:
        """Frames by what became of them: "ok" were counted, others left out for the reason named."""
        return dict(self._found["frames"])

    @property
    def clauses(self) -> list[dict[str, Any]]:
        """The standard clause by clause: `clause`, `title`, `outcome`, `found`."""
        return list(self._found["clauses"])

    @property
    def warnings(self) -> list[str]:
        """What a reader must know."""
        return list(self._warnings)

    def to_dict(self) -> dict[str, Any]:
        """Everything, as ``helio-rs accuracy --out`` writes it."""
        return _parsed(self._json)

    def to_table(self, kind: str = "dict") -> Any:
        """Every frame with its error [mrad], wind and status, as "dict" (of arrays), "pandas", "polars" or "pyarrow"."""
        return given_back(self._frames, checked_kind(kind))

    def to_html(self) -> str:
        """The page to look at and to sign, which needs nothing from outside."""
        if self._html is None:
            self._html = self._judged.html()
        return self._html

    def _repr_html_(self) -> str:
        figures = [(name, getattr(self, name)) for name in ("accuracy", "precision", "bias")]
        rows = "".join(f"<tr><td>{name}</td><td>{of.mrad:.3f} mrad</td></tr>" for name, of in figures if of is not None)
        return f"<p>Tracking accuracy: <b>{self.verdict}</b></p><table>{rows}</table>"

    def write(self, path: str | PathLike[str]) -> None:
        """Writes the page (.html), everything (.json), or the table of frames (.csv, .parquet, .jsonl).

        The file appears whole or not at all."""
        to = checked_path("path", path)
        if to.lower().endswith((".html", ".htm")):
            _write_text(to, self.to_html())
        elif to.lower().endswith(".json"):
            _write_text(to, self._json + "\n")
        else:
            _write_table(to, self._frames)


def _parsed(text: str) -> dict[str, Any]:
    import json  # not at import, which is to be quick

    found: dict[str, Any] = json.loads(text)
    return found


def accuracy(
    spots: Any,
    *,
    slant_m: float,
    weather: Any | None = None,
    aim_m: Sequence[float] = (0.0, 0.0),
    heliostat_at_deg: Sequence[float] | None = None,
    limits: str | PathLike[str] | Mapping[str, Any] | None = None,
    campaign: str | PathLike[str] | Mapping[str, Any] | None = None,
    accept: str | Iterable[str] = (),
    bin_half_width_m_s: float = 1.0,
    histogram_step_m_s: float = 1.0,
    confidence: float = 0.95,
    weather_gap_s: float = 60.0,
) -> Accuracy:
    """How accurately a heliostat tracks: the report of T/GRLM 02-2014 from a campaign of spots and the weather.

    Parameters
    ----------
    spots : Spots or table
        With times; what ``find_spots`` gives, or a table with its columns `file`, `time`, `u_m`, `v_m`, `sigma_m`,
        `status`: pandas, polars, pyarrow, a dict of columns or the path of a CSV or Parquet file.
    slant_m : float
        Distance from the heliostat's centre of rotation to the aim point [m].
    weather : table, optional
        Columns `time`, `wind_m_s` (or `wind_half_height_m_s`, `wind_full_height_m_s`, `wind_above_m_s`), `dni_w_m2`,
        `air_temperature_c`. Without it there is neither wind nor verdict.
    aim_m : (u_m, v_m), default (0, 0)
        Aim point on the target, right and down of its centre [m].
    heliostat_at_deg : (right, below), optional
        Where the heliostat stands as seen from the aim point [degrees from the target's normal].
    limits : path or mapping, optional
        Limits of another guideline, as the TOML that ``helio-rs accuracy --limits`` reads.
    campaign : path or mapping, optional
        What is to be said of laboratory, instruments and their uncertainty, as TOML.
    accept : str or sequence of str, optional
        Statuses besides "ok" whose spots count: "cut", "saturated", "ambiguous".
    bin_half_width_m_s : float, default 1
        Frames within so much of a limit's wind are judged by it [m/s].
    histogram_step_m_s : float, default 1
        Width of the bins of all wind speeds [m/s].
    confidence : float, default 0.95
        How often intervals hold the truth.
    weather_gap_s : float, default 60
        Longest time between weather rows that frames between them may use [s].

    Returns
    -------
    Accuracy

    Raises
    ------
    FileError, DataTypeError, ShapeError, OptionError, MissingError

    Notes
    -----
    The numbers of ``helio-rs accuracy`` on the same tables to the last bit.

    Examples
    --------
    >>> import helio_py as hp
    >>> import numpy as np
    >>> times = np.arange("2026-06-20T08:00", "2026-06-20T08:01", dtype="datetime64[s]")
    >>> spots = {
    ...     "file": [f"{k}.png" for k in range(60)], "time": times, "status": ["ok"] * 60,
    ...     "u_m": np.tile([0.1, -0.1], 30), "v_m": np.zeros(60),
    ... }
    >>> weather = {"time": times, "wind_m_s": np.full(60, 4.0), "dni_w_m2": np.full(60, 800.0),
    ...            "air_temperature_c": np.full(60, 20.0)}
    >>> report = hp.accuracy(spots, weather=weather, slant_m=100.0)
    >>> report.verdict, round(report.accuracy.mrad, 6), round(report.bias.mrad, 6)
    ('not enough data', 1.0, 0.0)
    """
    words = texts("accept", [accept] if isinstance(accept, str) else accept)
    asked = {
        "slant_m": number("slant_m", slant_m),
        "aim_m": list(pair("aim_m", aim_m)),
        "heliostat_at_deg": None if heliostat_at_deg is None else list(pair("heliostat_at_deg", heliostat_at_deg)),
        "limits": None if limits is None else path_and_text(limits, "limits", "limits.toml"),
        "campaign": None if campaign is None else path_and_text(campaign, "campaign", "campaign.toml"),
        "bin_half_width_m_s": number("bin_half_width_m_s", bin_half_width_m_s),
        "histogram_step_m_s": number("histogram_step_m_s", histogram_step_m_s),
        "confidence": number("confidence", confidence),
        "weather_gap_s": number("weather_gap_s", weather_gap_s),
        "accept": words,
    }
    return Accuracy(_accuracy(spots, weather, asked))
