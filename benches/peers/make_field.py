"""Writes a synthetic field: ``make_field.py --n N --seed SEED --kind operating|outside|edge --output FIELD.f64``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import get_args

import common


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--kind", choices=get_args(common.Kind), default="operating")
    parser.add_argument("--output", type=Path, required=True, metavar="FIELD.f64")
    arguments = parser.parse_args()
    common.write_field(arguments.output, arguments.n, arguments.seed, arguments.kind)


if __name__ == "__main__":
    main()
