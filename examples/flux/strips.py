#!/usr/bin/env python3
"""Makes the model of a cantilever with its eight mirror strips for CalculiX, and solves it if asked.

The concentrator is the folded plate of Yan et al. (2022), doi 10.3788/AOS202242.2022001: strips from 150 mm
off axis outward, each tilted so that vertical light falls from one edge of a receiver 200 mm wide at
1000 mm to the other. In the experiment each strip sits on one ceramic pad on a cantilever; a load of 9.5 kg
hangs at the end, and the platform leans by 17.8 degrees.

What the paper does not say is chosen here and stated: one of the two parallel beams of a side with half of the
load (--beams 1 for all of it); a steel tube of 20 x 20 x 2 mm that follows the strips, clamped at its inner end; strips 180 mm wide along
x; pads 20 x 20 x 12 mm of alumina. Frame: x across the beam, y outward along it, z to the sun.

    python3 strips.py --out strips.inp            writes the model (millimetres, newtons, tonnes)
    python3 strips.py --out strips.inp --solve    and runs ccx on it, which writes strips.frd

Needs Python 3.10 and nothing else; --solve needs CalculiX (Debian: calculix-ccx).
"""

from __future__ import annotations

import argparse
import math
import pathlib
import subprocess
from collections.abc import Callable, Sequence
from itertools import pairwise

# The concentrator, in mm (Yan 2022 section 3.1 and figure 3).
START = 150.0
RECEIVER_HALF_WIDTH = 100.0
RECEIVER_HEIGHT = 1000.0
STRIPS = 8
GLASS_THICKNESS = 4.0
LEAN_DEG = 17.8
LOAD_KG = 9.5
# Chosen here.
GAP = 2.0
GLASS_WIDTH = 180.0
PAD_HEIGHT = 12.0
TUBE = 20.0
WALL = 2.0
GRAVITY = 9810.0  # mm/s2

# Young's modulus in MPa, Poisson's ratio, density in t/mm3.
MATERIALS = {
    "GLASS": (70e3, 0.23, 2.5e-9),
    "PAD": (300e3, 0.22, 3.8e-9),
    "BEAM": (206e3, 0.3, 7.85e-9),
}

Point = tuple[float, float, float]
Plane = tuple[float, float]


def strip_edges() -> list[Plane]:
    """Edges of the strips as (y, z), from the inside out."""
    edges = [(START, 0.0)]
    for _ in range(STRIPS):
        y, z = edges[-1]
        # The ray at the inner edge goes to the receiver's far edge; the strip halves that angle.
        dy, dz = -RECEIVER_HALF_WIDTH - y, RECEIVER_HEIGHT - z
        length = math.hypot(dy, dz)
        dy, dz = dy / length, dz / length
        ny, nz = dy, dz + 1.0
        length = math.hypot(ny, nz)
        ty, tz = nz / length, -ny / length
        # The parallel ray at the outer edge goes to the near edge.
        s = (RECEIVER_HALF_WIDTH - y - dy * (RECEIVER_HEIGHT - z) / dz) / (ty - dy * tz / dz)
        edges.append((y + s * ty, z + s * tz))
    return edges


def split(stations: Sequence[float], parts: Sequence[int]) -> list[float]:
    """Stations with every interval cut into equal parts."""
    out = [stations[0]]
    for start, end, count in zip(stations[:-1], stations[1:], parts, strict=True):
        out += [start + (end - start) * k / count for k in range(1, count + 1)]
    return out


class Model:
    """Nodes and brick elements, linear or quadratic, with nodes shared where they coincide."""

    def __init__(self, quadratic: bool) -> None:
        self.quadratic = quadratic
        self.nodes: dict[tuple[int, int, int], int] = {}
        self.points: list[Point] = []
        self.elements: dict[str, list[list[int]]] = {name: [] for name in MATERIALS}

    def node(self, at: Point) -> int:
        """The number of the node at a point, to a tenth of a micrometre."""
        key = (round(at[0] * 1e4), round(at[1] * 1e4), round(at[2] * 1e4))
        if key not in self.nodes:
            self.points.append(at)
            self.nodes[key] = len(self.points)
        return self.nodes[key]

    def brick(self, group: str, corners: Sequence[Point]) -> None:
        """An element: four corners below, counterclockwise as seen from above, and the four above them."""
        points = list(corners)
        if self.quadratic:
            ring = [(0, 1), (1, 2), (2, 3), (3, 0)]
            edges = ring + [(a + 4, b + 4) for a, b in ring] + [(k, k + 4) for k in range(4)]
            for a, b in edges:
                first, second = points[a], points[b]
                points.append(
                    (
                        (first[0] + second[0]) / 2,
                        (first[1] + second[1]) / 2,
                        (first[2] + second[2]) / 2,
                    )
                )
        self.elements[group].append([self.node(point) for point in points])

    def block(
        self,
        group: str,
        xs: Sequence[float],
        columns: int,
        depths: Sequence[float],
        place: Callable[[int, float], Plane],
        keep: Callable[[int, int], bool] = lambda i, k: True,
    ) -> None:
        """Bricks over x, over columns along the strip and over depths below the mirror (falling)."""
        for i, (x0, x1) in enumerate(pairwise(xs)):
            for j in range(columns):
                for k, (low, high) in enumerate(pairwise(depths)):
                    if not keep(i, k):
                        continue
                    corners: list[Point] = []
                    for depth in (low, high):
                        (y0, z0), (y1, z1) = place(j, depth), place(j + 1, depth)
                        corners += [(x0, y0, z0), (x1, y0, z0), (x1, y1, z1), (x0, y1, z1)]
                    self.brick(group, corners)


def build(refine: int, quadratic: bool, glass_thickness: float) -> tuple[Model, list[int], list[int]]:
    """The model, and the nodes of its clamped and of its free end."""
    edges = strip_edges()
    tangents = []
    for (y0, z0), (y1, z1) in pairwise(edges):
        length = math.hypot(y1 - y0, z1 - z0)
        tangents.append(((y1 - y0) / length, (z1 - z0) / length))

    def vertex(k: int, depth: float) -> Plane:
        """An edge of the strips laid below the mirror, mitred between two strips."""
        ta, tb = tangents[max(k - 1, 0)], tangents[min(k, STRIPS - 1)]
        ny, nz = -(ta[1] + tb[1]), ta[0] + tb[0]
        scale = depth / (1.0 + ta[0] * tb[0] + ta[1] * tb[1])
        return (edges[k][0] - scale * ny, edges[k][1] - scale * nz)

    model = Model(quadratic)
    half, inner = TUBE / 2, TUBE / 2 - WALL
    bottom = glass_thickness + PAD_HEIGHT + TUBE
    glass_depths = [glass_thickness, 0.0]
    pad_depths = split([glass_thickness + PAD_HEIGHT, glass_thickness], [refine])
    beam_depths = split([bottom, bottom - WALL, bottom - TUBE + WALL, bottom - TUBE], [1, refine, 1])
    beam_xs = split([-half, -inner, inner, half], [1, refine, 1])
    wing = 2 * refine
    hollow = range(1, 1 + refine)
    glass_xs = split(
        [-GLASS_WIDTH / 2, -half, -inner, inner, half, GLASS_WIDTH / 2], [wing, 1, refine, 1, wing]
    )
    for strip in range(STRIPS):
        (y0, z0), (y1, z1) = edges[strip], edges[strip + 1]
        ty, tz = tangents[strip]
        length = math.hypot(y1 - y0, z1 - z0)
        middle = length / 2
        pad = [middle - half, middle + half]

        def square(
            along: Sequence[float], y0: float = y0, z0: float = z0, ty: float = ty, tz: float = tz
        ) -> Callable[[int, float], Plane]:
            """Places square to the strip."""
            return lambda j, depth: (
                y0 + along[j] * ty + depth * tz,
                z0 + along[j] * tz - depth * ty,
            )

        glass = split([GAP / 2, *pad, length - GAP / 2], [wing, refine, wing])
        model.block("GLASS", glass_xs, len(glass) - 1, glass_depths, square(glass))
        under = split(pad, [refine])
        model.block("PAD", beam_xs, len(under) - 1, pad_depths, square(under))

        def mitred(j: int, depth: float, strip: int = strip, on: Sequence[float] = pad) -> Plane:
            """Places on the beam: between its mitred ends and the edges of the pad, which are square."""
            stations = [vertex(strip, depth), square(on)(0, depth), square(on)(1, depth)]
            stations.append(vertex(strip + 1, depth))
            parts = (wing, refine, wing)
            for ((ya, za), (yb, zb)), count in zip(pairwise(stations), parts, strict=True):
                if j <= count:
                    return (ya + (yb - ya) * j / count, za + (zb - za) * j / count)
                j -= count
            raise AssertionError("a column beyond the strip")

        model.block(
            "BEAM",
            beam_xs,
            2 * wing + refine,
            beam_depths,
            mitred,
            lambda i, k: not (i in hollow and k in hollow),
        )

    def section(k: int) -> list[int]:
        """Nodes of the beam at its inner or outer end."""
        (y0, z0), (y1, z1) = vertex(k, bottom), vertex(k, bottom - TUBE)
        length = math.hypot(y1 - y0, z1 - z0)
        of_beam = {n for nodes in model.elements["BEAM"] for n in nodes}
        out = []
        for number in sorted(of_beam):
            _, y, z = model.points[number - 1]
            along = ((y - y0) * (y1 - y0) + (z - z0) * (z1 - z0)) / length
            off = abs((y - y0) * (z1 - z0) - (z - z0) * (y1 - y0)) / length
            if off < 1e-4 and -1e-4 < along < length + 1e-4:
                out.append(number)
        return out

    return model, section(0), section(STRIPS)


def listed(numbers: Sequence[int]) -> str:
    """Numbers, up to twelve on a line."""
    rows = [numbers[k : k + 12] for k in range(0, len(numbers), 12)]
    return ",\n".join(", ".join(str(n) for n in row) for row in rows)


def write(model: Model, clamped: list[int], free: list[int], load_kg: float, title: str) -> str:
    """The text of the input file."""
    lean = math.radians(LEAN_DEG)
    down = (math.sin(lean), 0.0, -math.cos(lean))
    out = [f"** {title}", "** Made by examples/flux/strips.py; millimetres, newtons, tonnes.", "*NODE"]
    for number, (x, y, z) in enumerate(model.points, 1):
        out.append(f"{number},{x:.7g},{y:.7g},{z:.7g}")
    kind = "C3D20R" if model.quadratic else "C3D8I"
    number = 0
    for group, elements in model.elements.items():
        out.append(f"*ELEMENT, TYPE={kind}, ELSET={group}")
        for nodes in elements:
            number += 1
            out.append(listed([number, *nodes]))
    for group, (young, poisson, density) in MATERIALS.items():
        out += [f"*MATERIAL, NAME={group}", "*ELASTIC", f"{young},{poisson}"]
        out += ["*DENSITY", f"{density}", f"*SOLID SECTION, ELSET={group}, MATERIAL={group}"]
    out += ["** The reflecting side: the upper face of every glass element.", "*SURFACE, NAME=MIRROR"]
    out += ["GLASS, S2", "*NSET, NSET=CLAMPED", listed(clamped), "*NSET, NSET=TIP", listed(free)]
    out += ["*BOUNDARY", "CLAMPED, 1, 3", "*STEP", "*STATIC", "*DLOAD"]
    for group in model.elements:
        out.append(f"{group}, GRAV, {GRAVITY}, {down[0]:.9f}, {down[1]:.9f}, {down[2]:.9f}")
    # Newtons are kilograms times metres per square second.
    force = load_kg * 1e-3 * GRAVITY / len(free)
    out.append("*CLOAD")
    for axis, part in ((1, down[0]), (3, down[2])):
        out.append(f"TIP, {axis}, {force * part:.9g}")
    out += ["*NODE FILE", "U", "*END STEP", ""]
    return "\n".join(out)


def main() -> None:
    """Writes the model and solves it if asked."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("strips.inp"))
    parser.add_argument("--refine", type=int, default=1, help="cuts every element by so many")
    parser.add_argument("--linear", action="store_true", help="8 nodes instead of 20 per element")
    parser.add_argument("--load-kg", type=float, default=LOAD_KG, help="hung at the end")
    parser.add_argument("--beams", type=int, default=2, help="beams that share the load")
    parser.add_argument("--glass-mm", type=float, default=GLASS_THICKNESS, help="its thickness")
    parser.add_argument("--solve", action="store_true", help="run ccx on the model")
    options = parser.parse_args()
    model, clamped, free = build(options.refine, not options.linear, options.glass_mm)
    load_kg = options.load_kg / options.beams
    title = f"A cantilever with {STRIPS} mirror strips, {load_kg} kg at its end"
    options.out.write_text(write(model, clamped, free, load_kg, title), encoding="ascii")
    count = sum(len(elements) for elements in model.elements.values())
    print(f"{options.out}: {len(model.points)} nodes, {count} elements")
    if options.solve:
        stem = options.out.with_suffix("")
        subprocess.run(["ccx", stem.name], cwd=stem.parent, check=True)


if __name__ == "__main__":
    main()
