"""helio-py, three ways: a fresh answer, an earlier one written over, and a fresh one with its four arrays.

Prints a line of JSON for each, in microseconds per call.
"""

from __future__ import annotations

import json
import timeit
from typing import Any

import helio_py as hp
import numpy as np

import common

CALLS = {
    "fresh": "track(field, azimuth, elevation)",
    "out": "track(field, azimuth, elevation, out=out)",
    "arrays": "t = track(field, azimuth, elevation); t.azimuth_rad, t.elevation_rad, t.incidence_rad, t.status",
}


def main() -> None:
    arguments = common.parse_arguments(__doc__ or "")
    columns, _ = common.read_field(arguments.input)
    about = json.loads(common.sidecar_of(arguments.input).read_text())
    aim = np.c_[columns.pop("east_m"), columns.pop("north_m"), columns.pop("up_m")]
    given: dict[str, Any] = dict(columns)
    field = hp.Field(np.zeros_like(aim), aim, **given)
    names: dict[str, Any] = {
        "track": hp.track,
        "field": field,
        "azimuth": about["sun_azimuth_rad"],
        "elevation": about["sun_elevation_rad"],
    }
    names["out"] = out = hp.track(field, names["azimuth"], names["elevation"])
    if arguments.output is not None:
        answers = common.Answers(out.azimuth_rad, out.elevation_rad, out.incidence_rad, out.status)
        common.write_answers(arguments.output, answers)
    for name, statement in CALLS.items():
        timer = timeit.Timer(statement, globals=names)
        loops, _ = timer.autorange()
        seconds = min(timer.repeat(arguments.repeat, max(1, loops // 10))) / max(1, loops // 10)
        line = {"peer": f"helio_py {name}", "version": hp.__version__, "n": len(field), "us_per_call": seconds * 1e6}
        print(json.dumps(line))


if __name__ == "__main__":
    main()
