"""Peer: Mitsuba 3, a renderer, on a scene of `flux_scene`: an independent map, held against that of helio-flux.

    python flux_mitsuba.py SCENE.json [--rays N] [--seed S]

Light starts evenly on a window square to the sun, before all mirrors; where it falls, what stands in its way, how it is
reflected and where it ends are Mitsuba's: its meshes, its Embree, its conductors (a rough one with a Beckmann
distribution of roughness √2 σ has normals whose slopes are Gaussian with σ per axis), its rectangle and cylinder with
their surface coordinates. A mirror's back absorbs.

Prints a line of JSON. ``chi_squared`` is over the bins that expect 50 rays or more; the account's parts are told in
standard errors. Mitsuba's wheels compile for the processor with the library of LLVM 16 or later (Debian: libllvm19).
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

mi.set_variant("llvm_ad_rgb")

CHUNK = 1 << 22
# How far along its own way a reflected ray starts: off the mirror by more than singles round at 100 m, and not aside.
AHEAD_M = 2e-3
LEAST_EXPECTED = 50.0


def mirrors(scene: dict[str, Any]) -> Any:
    """All facets as one mesh of triangles."""
    corners = [np.array(c) for c in scene["corners_m"]]
    points = np.concatenate(corners)
    faces, first = [], 0
    for c in corners:
        faces += [(first, first + k, first + k + 1) for k in range(1, len(c) - 1)]
        first += len(c)
    slope = scene["slope_rms_rad"]
    surface: dict[str, Any] = {"type": "conductor", "material": "none"}
    if slope > 0.0:
        alpha = math.sqrt(2) * slope
        surface = {"type": "roughconductor", "material": "none", "distribution": "beckmann", "alpha": alpha}
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(surface)
    mesh = mi.Mesh("mirrors", len(points), len(faces), props=properties)
    parts = mi.traverse(mesh)
    parts["vertex_positions"] = points.astype(np.float32).ravel()
    parts["faces"] = np.array(faces, np.uint32).ravel()
    parts.update()
    return mesh


def receiver(scene: dict[str, Any]) -> Any:
    """The shape whose surface coordinates are columns and, from below, rows."""
    r = scene["receiver"]
    pose = np.eye(4)
    if r["kind"] == "plane":
        half = 0.5 * r["side_m"]
        pose[:3, 0], pose[:3, 1] = half * np.array(r["right"]), -half * np.array(r["down"])
        pose[:3, 2], pose[:3, 3] = r["normal"], r["centre_m"]
        return mi.load_dict({"type": "rectangle", "to_world": mi.ScalarTransform4f(pose)})
    axis, zero = np.array(r["axis"]), np.array(r["zero"])
    pose[:3, 1] = np.cross(axis, zero)
    pose[:3, 0], pose[:3, 2], pose[:3, 3] = np.cross(pose[:3, 1], axis), axis, r["base_m"]
    ends = {"p0": [0.0, 0.0, 0.0], "p1": [0.0, 0.0, r["height_m"]], "radius": r["radius_m"]}
    return mi.load_dict({"type": "cylinder", "to_world": mi.ScalarTransform4f(pose), **ends})


class Window:
    """A rectangle square to the sun through which all the light comes that mirrors can get."""

    def __init__(self, scene: dict[str, Any]) -> None:
        points = np.concatenate([np.array(c) for c in scene["corners_m"]])
        self.sun = np.array(scene["sun"])
        helper = np.eye(3)[np.argmin(np.abs(self.sun))]
        self.x = np.cross(helper, self.sun)
        self.x /= np.linalg.norm(self.x)
        self.y = np.cross(self.sun, self.x)
        along = points @ self.sun
        self.up_m = along.max() + 1.0
        margin_m = 1.1 * math.tan(scene["half_angle_rad"]) * (self.up_m - along.min())
        self.low = np.array([(points @ axis).min() - margin_m for axis in (self.x, self.y)])
        self.size = np.array([(points @ axis).max() + margin_m for axis in (self.x, self.y)]) - self.low

    def area_m2(self) -> float:
        return float(self.size[0] * self.size[1])

    def rays(self, sampler: Any, half_angle_rad: float) -> Any:
        x, y, sun = (mi.Vector3f(*map(float, v)) for v in (self.x, self.y, self.sun))
        place = sampler.next_2d()
        corner = mi.Point3f(*map(float, self.low[0] * self.x + self.low[1] * self.y + self.up_m * self.sun))
        origin = corner + float(self.size[0]) * place.x * x + float(self.size[1]) * place.y * y
        # The sun's disc, seen in its tangent plane: even in solid angle but for its square, 2e-5.
        disc = math.tan(half_angle_rad) * mi.warp.square_to_uniform_disk_concentric(sampler.next_2d())
        return mi.Ray3f(origin, dr.normalize(-sun + disc.x * x + disc.y * y))


def trace(scene: dict[str, Any], rays: int, seed: int) -> tuple[NDArray[np.float64], dict[str, float]]:
    """Rays in every bin, and what became of the others."""
    window, grid = Window(scene), scene["receiver"]
    mesh, target = mirrors(scene), receiver(scene)
    only_mirrors = mi.load_dict({"type": "scene", "mirrors": mesh})
    everything = mi.load_dict({"type": "scene", "mirrors": mesh, "receiver": target})
    columns, rows = grid["columns"], grid["rows"]
    counts = np.zeros(columns * rows)
    parts = dict.fromkeys(("reflected", "blocked", "received"), 0.0)
    sampler = mi.load_dict({"type": "independent"})
    for number in range(-(-rays // CHUNK)):
        sampler.seed(seed + number, CHUNK)
        first = only_mirrors.ray_intersect(window.rays(sampler, scene["half_angle_rad"]))
        context = mi.BSDFContext()
        turned, weight = first.bsdf().sample(context, first, sampler.next_1d(), sampler.next_2d(), first.is_valid())
        lit = first.is_valid() & (first.wi.z > 0.0)
        power = dr.select(lit, weight.x, 0.0)
        out = first.to_world(turned.wo)
        second = everything.ray_intersect(mi.Ray3f(first.p + AHEAD_M * out, out), lit & (power > 0.0))
        met = second.is_valid()
        at_receiver = met & (second.shape == mi.ShapePtr(target))
        received = at_receiver & (second.wi.z > 0.0)
        column = dr.minimum(mi.UInt32(second.uv.x * columns), columns - 1)
        row = dr.minimum(mi.UInt32((1.0 - second.uv.y) * rows), rows - 1)
        bins = dr.zeros(mi.Float, columns * rows)
        dr.scatter_reduce(dr.ReduceOp.Add, bins, power, row * columns + column, received)
        counts += np.array(bins)
        for name, which in (("reflected", lit), ("blocked", met & ~at_receiver), ("received", received)):
            parts[name] += float(dr.sum(dr.select(which, power, 0.0))[0])
    return counts, parts


def compare(counts: NDArray[np.float64], wanted: NDArray[np.float64]) -> dict[str, Any]:
    use = wanted >= LEAST_EXPECTED
    apart = (counts[use] - wanted[use]) / np.sqrt(wanted[use])
    return {
        "bins": int(use.sum()),
        "chi_squared_per_bin": float((apart**2).mean()),
        "standard_error": math.sqrt(2.0 / use.sum()),
        "worst": float(np.abs(apart).max()),
        "rays_per_bin": float(wanted[use].mean()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--rays", type=int, default=1 << 27)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    scene = json.loads(arguments.scene.read_text())
    begin = time.perf_counter()
    counts, parts = trace(scene, arguments.rays, arguments.seed)
    seconds = time.perf_counter() - begin
    rays = -(-arguments.rays // CHUNK) * CHUNK
    per_w = rays / (scene["dni_w_m2"] * Window(scene).area_m2())
    wanted = {
        "reflected": scene["incoming_w"] - scene["shaded_w"],
        "blocked": scene["blocked_w"],
        "received": scene["received_w"],
    }
    line = {
        "peer": "mitsuba",
        "version": mi.__version__,
        "scene": scene["scene"],
        "rays": rays,
        "seconds": seconds,
        "shaded_part": scene["shaded_w"] / scene["incoming_w"],
        "blocked_part": scene["blocked_w"] / scene["incoming_w"],
        **{
            f"{name}_standard_errors": (parts[name] - per_w * w) / math.sqrt(max(per_w * w, 1.0))
            for name, w in wanted.items()
        },
        **compare(counts, per_w * np.array(scene["power_w"])),
    }
    if scene["power_by_integral_w"] is not None:
        line["integral"] = compare(counts, per_w * np.array(scene["power_by_integral_w"]))
    print(json.dumps(line))


if __name__ == "__main__":
    main()
