"""``simulate_campaign``: spots and weather for ``accuracy``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from helio_py._checked import number, whole, wrong_value
from helio_py._native import _simulate_campaign, _write_table
from helio_py._tables import Column, checked_kind, given_back

if TYPE_CHECKING:
    import os

#: Most frames of a campaign in memory: some four days of the default ones.
_MOST_FRAMES = 5_000_000


class SimulatedCampaign:
    """A simulated campaign: what a camera saw of a heliostat in the wind, and the weather.

    Made by ``simulate_campaign``.
    """

    def __init__(self, made: dict[str, Any]) -> None:
        """Of what the native part made; not for users."""
        self._spots: list[Column] = made["spots"]
        self._weather: list[Column] = made["weather"]

    def __len__(self) -> int:
        return len(self._spots[0][2])

    def __repr__(self) -> str:
        return f"<Simulated campaign of {len(self)} frames and {len(self._weather[0][2])} weather rows>"

    @property
    def spots(self) -> dict[str, Any]:
        """The spots, in the columns of ``Spots.to_table``: `file, time, …, u_m, v_m, sigma_m, flags, status, reason`."""
        return self.to_table()

    @property
    def weather(self) -> dict[str, Any]:
        """The weather record, a row a second: `time, wind_m_s, dni_w_m2, air_temperature_c`."""
        return self.to_table(of="weather")

    def to_table(self, kind: str = "dict", *, of: str = "spots") -> Any:
        """The spots, or with ``of="weather"`` that, as "dict" (of arrays), "pandas", "polars" or "pyarrow"."""
        if not isinstance(of, str) or of not in ("spots", "weather"):
            raise wrong_value("of", f"wanted spots or weather, got `{of}`")
        return given_back(self._spots if of == "spots" else self._weather, checked_kind(kind))

    def write_spots(self, path: str | os.PathLike[str]) -> None:
        """Writes the spots: .csv, .parquet, .json or .jsonl, as ``helio-rs accuracy`` reads them."""
        _write_table(path, self._spots)

    def write_weather(self, path: str | os.PathLike[str]) -> None:
        """Writes the weather record: .csv, .parquet, .json or .jsonl."""
        _write_table(path, self._weather)


def simulate_campaign(
    *,
    seed: int = 1,
    minutes: int = 60,
    frames_per_s: int = 15,
    slant_m: float = 100.0,
    calm_mrad: float = 0.5,
    gust_mrad: float = 1.0,
    memory_s: float = 0.3,
    empty: float = 0.0,
) -> SimulatedCampaign:
    """A synthetic campaign of tracking accuracy: what ``accuracy`` takes.

    The heliostat swings about its mean, the more the stronger the wind, which goes up and down between 0 and 15 m/s; the sky
    is clear. The same arguments give the same campaign as ``helio-rs simulate campaign``, to the last bit.

    Parameters
    ----------
    seed : int, default 1
        Of all random numbers.
    minutes : int, default 60
        How long, from 1 to 10,000; five million frames in all at most.
    frames_per_s : int, default 15
        Frames per second, from 1 to 1000.
    slant_m : float, default 100
        Distance of the heliostat [m].
    calm_mrad : float, default 0.5
        Swing of either component without wind, one standard deviation [mrad].
    gust_mrad : float, default 1
        What a wind of 10 m/s adds to it; grows with the wind's square [mrad].
    memory_s : float, default 0.3
        Time in which a swing is forgotten but for 1/e [s].
    empty : float, default 0
        Share of frames without a spot.

    Returns
    -------
    SimulatedCampaign

    Raises
    ------
    OptionError, DataTypeError

    Examples
    --------
    >>> import helio_py as hp
    >>> campaign = hp.simulate_campaign(minutes=20)
    >>> campaign
    <Simulated campaign of 18000 frames and 1202 weather rows>
    >>> report = hp.accuracy(campaign.spots, weather=campaign.weather, slant_m=100.0)
    >>> round(report.accuracy.mrad, 2), round(report.bias.mrad, 2)
    (2.02, 0.2)
    """
    long = whole("minutes", minutes, 1, 10_000)
    rate = whole("frames_per_s", frames_per_s, 1, 1000)
    if 60 * long * rate > _MOST_FRAMES:
        raise wrong_value("minutes", f"{60 * long * rate:,} frames at {rate} a second; wanted at most {_MOST_FRAMES:,}")
    asked = {
        "seed": whole("seed", seed, 0, 2**64 - 1),
        "minutes": long,
        "frames_per_s": rate,
        "slant_m": number("slant_m", slant_m, 0.01, 10_000.0, "metres"),
        "calm_mrad": number("calm_mrad", calm_mrad, 0.0, 1e6, "milliradians"),
        "gust_mrad": number("gust_mrad", gust_mrad, 0.0, 1e6, "milliradians"),
        "memory_s": number("memory_s", memory_s, 0.0, 86_400.0, "seconds"),
        "empty": number("empty", empty, 0.0, 1.0, ""),
    }
    return SimulatedCampaign(_simulate_campaign(asked))
