"""Compares answer files row by row: angles to a tolerance, statuses exactly.

``compare.py --reference REFERENCE.bin ANSWERS.bin ...`` takes any peer's answers as reference;
``compare.py --input FIELD.f64 ANSWERS.bin ...`` evaluates the field in extended precision (80 bits
where the platform has them). Azimuth differences are taken on the circle and weighted with the
cosine of the elevation, since near face up the azimuth itself is ill determined.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np

import common

TOLERANCE_RAD = 1e-12


def extended_reference(path: Path) -> common.Answers:
    about = json.loads(common.sidecar_of(path).read_text())
    columns, _ = common.read_field(path)
    sun = (about["sun_azimuth_rad"], about["sun_elevation_rad"])
    return common.evaluate_plain(columns, sun, np.longdouble).answers


def largest_differences(reference: common.Answers, answers: common.Answers) -> dict[str, float]:
    """Largest absolute difference of each angle [rad], and how many statuses or NaNs differ."""
    if reference.status.shape != answers.status.shape:
        raise SystemExit(f"expected {len(reference.status)} rows, got {len(answers.status)}")
    ok = (reference.status == common.OK) & (answers.status == common.OK)
    turn = np.abs(answers.azimuth_rad - reference.azimuth_rad)[ok]
    turn = np.minimum(turn, common.TWO_PI - turn) * np.abs(np.cos(reference.elevation_rad[ok]))
    finite = np.isfinite(np.stack(answers[:3]))
    return {
        "azimuth_rad": float(turn.max(initial=0.0)),
        "elevation_rad": float(np.abs(answers.elevation_rad - reference.elevation_rad)[ok].max(initial=0.0)),
        "incidence_rad": float(np.abs(answers.incidence_rad - reference.incidence_rad)[ok].max(initial=0.0)),
        "statuses": int(np.count_nonzero(reference.status != answers.status)),
        "misplaced_nans": int(np.count_nonzero(finite != (answers.status == common.OK))),
    }


def agrees(differences: dict[str, float], tolerance_rad: float = TOLERANCE_RAD) -> bool:
    angles = ("azimuth_rad", "elevation_rad", "incidence_rad")
    close = all(differences[name] <= tolerance_rad for name in angles)
    return close and differences["statuses"] == 0 and differences["misplaced_nans"] == 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    against = parser.add_mutually_exclusive_group(required=True)
    against.add_argument("--reference", type=Path, metavar="REFERENCE.bin")
    against.add_argument("--input", type=Path, metavar="FIELD.f64")
    parser.add_argument("--tolerance-rad", type=float, default=TOLERANCE_RAD)
    parser.add_argument("answers", type=Path, nargs="+", metavar="ANSWERS.bin")
    arguments = parser.parse_args()
    if arguments.reference is not None:
        reference = common.read_answers(arguments.reference)
    else:
        reference = extended_reference(arguments.input)
    failed = False
    for path in arguments.answers:
        differences = largest_differences(reference, common.read_answers(path))
        good = agrees(differences, arguments.tolerance_rad)
        failed |= not good
        print(json.dumps({"answers": path.name, "agrees": good, **differences}))
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
