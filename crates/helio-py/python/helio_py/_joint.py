"""``calibrate`` of a field as one, and what it found."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from helio_py._calibrate import Calibration
from helio_py._checked import flag, number, path, wrong_type, wrong_value
from helio_py._native import _calibrate_joint
from helio_py._progress import reporter
from helio_py._tables import kind_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from helio_py._native import Field


class JointCalibration(Calibration):
    """A field calibrated as one: k rows, one for every heliostat of the layout.

    Made by ``calibrate`` with `joint` or `update`. Besides what a ``Calibration`` holds it knows what heliostats have in
    common, what became of every record, and the state from which new observations are followed.

    ``to_table`` and ``write`` know "calibration", "rejected", "causes" (what the field has in common), "steps" (for every
    record how it was foretold and what became of it), and where they were asked for "leftovers" (what ``helio-rs track
    --leftovers`` reads), "plan" (the next observations) and "changes" (against an earlier calibration).
    """

    _tables = ("calibration", "rejected", "causes", "steps", "leftovers", "plan", "changes")

    def __repr__(self) -> str:
        ok = self.status.count("ok")
        return f"<JointCalibration of {len(self)} heliostats: {ok} ok, {len(self) - ok} not>"

    @property
    def state(self) -> bytes:
        """All that is known of the field: what ``calibrate`` goes on from with `update`.

        The bytes of a file that ``helio-rs calibrate --state`` writes, to be kept wherever bytes are.
        """
        state: bytes = self._found["state"]
        return state

    @property
    def noise(self) -> dict[str, float]:
        """How records scatter: `beam_mrad` across the beam, `spot_m` on the target, `sun_path_s` along the sun's path."""
        return dict(self._found["noise"])

    @property
    def wander(self) -> dict[str, Any]:
        """How zero points wander: `slow_mrad` and `fast_mrad` of both axes, within `slow_days` and `fast_days`."""
        return dict(self._found["wander"])

    @property
    def of_field(self) -> dict[str, tuple[float, float]]:
        """What heliostats of this field are like: mean and standard deviation of each angle, by its name [rad]."""
        return dict(self._found["of_field"])

    @property
    def converged(self) -> bool:
        """Whether the search for noise and wander came to its end; True of an update, which does not search."""
        return bool(self._found["converged"])

    @property
    def field_is_off(self) -> bool:
        """Whether the field as a whole missed by far more than was expected, so that this should not be believed."""
        return bool(self._found["field_is_off"])

    @property
    def leftovers(self) -> dict[str, Any] | None:
        """What is left by pose, where it was looked for.

        Whether it is `admitted`, its `amplitude_mrad` of both axes, its `length_rad`, its `log_evidence`.
        """
        found = self._found.get("leftovers_found")
        return None if found is None else dict(found)

    @property
    def foretold_mrad(self) -> NDArray[np.float64]:
        """By how much each beam is expected to miss on the day that the rows are for [mrad]."""
        return np.ascontiguousarray(self._found["joint"][:, 0])

    @property
    def expected_mrad(self) -> NDArray[np.float64]:
        """What was expected of the misses that `beam_rms_mrad` counts [mrad]."""
        return np.ascontiguousarray(self._found["joint"][:, 1])

    @property
    def zero_rad(self) -> NDArray[np.float64]:
        """Zero points of both axes less those at rest, after the last record [rad], shape (k, 2)."""
        return np.ascontiguousarray(self._found["joint"][:, 2:4])

    @property
    def zero_sigma_rad(self) -> NDArray[np.float64]:
        """One standard deviation of them [rad], shape (k, 2)."""
        return np.ascontiguousarray(self._found["joint"][:, 4:6])

    @property
    def jumps(self) -> NDArray[np.int64]:
        """Jumps of zero points that are certain; 0 where there is no result."""
        jumps = self._columns["jumps"][1]
        return np.where(jumps < 0, 0, jumps)


def _state_of(update: Any) -> tuple[str, bytes | None]:
    """The name of a state for messages, and its bytes where it is no file."""
    if isinstance(update, JointCalibration):
        return "state", update.state
    if isinstance(update, (bytes, bytearray, memoryview)):
        return "state", bytes(update)
    if isinstance(update, (str, os.PathLike)):
        return path("update", update), None
    raise wrong_type("update", "a path, bytes or a JointCalibration", update)


def as_one(
    field: Field,
    observations: Any,
    spots: Any | None,
    compare: Any | None,
    given: dict[str, Any],
    words: dict[str, Any],
    progress: Callable[[int, int], Any] | bool | None,
) -> JointCalibration:
    """Calibrates a field as one; ``given`` are options of other fits that were not left as they are."""
    if words["joint"] and words["update"] is not None:
        raise wrong_value("joint", "with update: a state is begun by one and followed by the other")
    leftovers = flag("leftovers", words["leftovers"])
    if words["update"] is not None and leftovers:
        raise wrong_value("leftovers", "with update: what is left by pose is found by a joint fit only")
    state, ahead_days = words["state"], words["ahead_days"]
    asked = {
        "given": list(given),
        "keep_all": words["keep_all"],
        "no_jumps": words["no_jumps"],
        "ahead_days": 1.0 if ahead_days is None else number("ahead_days", ahead_days),
        "max_year_pointing_mrad": words["max_year_pointing_mrad"],
        "leftovers": leftovers,
        "plan": words["plan"],
        "report": words["report"],
        "update": None if words["update"] is None else _state_of(words["update"]),
        "state": None if state is None else path("state", state),
    }
    with reporter(progress, "heliostats") as told:
        found = _calibrate_joint(field, observations, spots, compare, asked, told)
    return JointCalibration(found, kind_of(observations))
