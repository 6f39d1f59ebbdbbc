"""Synthetic gray camera frames with a spot, as PNG files, for the spot benchmark.

``make_frames.py --output FOLDER [--seed S]`` writes ``768x576.png``, ``2688x1512.png`` and ``256x256.png``: a panel lit
unevenly, a bell-shaped spot on it, sensor noise.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

SIZES = ((768, 576), (2688, 1512), (256, 256))
SEED = 20140821


def frame(width: int, height: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    x = np.arange(width)[None, :]
    y = np.arange(height)[:, None]
    centre_x, centre_y = width * rng.uniform(0.4, 0.6), height * rng.uniform(0.4, 0.6)
    wide, high = 0.13 * height * rng.uniform(0.8, 1.2, 2)
    panel = 38.0 + 14.0 * x / width - 9.0 * y / height
    spot = 165.0 * np.exp(-0.5 * (((x - centre_x) / wide) ** 2 + ((y - centre_y) / high) ** 2))
    noise = rng.normal(0.0, 3.0, (height, width))
    return np.clip(np.rint(panel + spot + noise), 0, 255).astype(np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--seed", type=int, default=SEED)
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    for width, height in SIZES:
        rng = np.random.default_rng([arguments.seed, width, height])
        path = arguments.output / f"{width}x{height}.png"
        if not cv2.imwrite(str(path), frame(width, height, rng)):
            raise SystemExit(f"{path}: cannot be written")


if __name__ == "__main__":
    main()
