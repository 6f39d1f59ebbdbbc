"""Peer: meshio, on the model that `flux_mesh --write` wrote; prints a line of JSON.

    python mesh_meshio.py DIR/mesh.inp [--repeat R]
"""

from __future__ import annotations

import argparse
import json
import resource
import time

import meshio


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("model")
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    least, triangles = float("inf"), 0
    for _ in range(options.repeat):
        start = time.perf_counter()
        mesh = meshio.read(options.model, file_format="abaqus")
        least = min(least, time.perf_counter() - start)
        triangles = sum(len(block.data) for block in mesh.cells)
    line = {
        "peer": "meshio",
        "version": meshio.__version__,
        "triangles": triangles,
        "model_s": round(least, 5),
        "memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }
    print(json.dumps(line))


if __name__ == "__main__":
    main()
