"""Makes the Gmsh files of this folder with Gmsh's own library, and what it says of them.

    pip install gmsh==4.15.2 && python3 make_gmsh.py

A roof of two flat mirrors of 2 m x 1 m (physical group "mirror"; the one at x > 0 is group "right" too), and
a solid box under it (physical group "foot"); a view "displacement" of u = (0, 0, 0.01 x). Once as triangles
and tetrahedra, once as second-order quadrilaterals and bricks; in versions 2.2 and 4.1, as text and binary.
"""

import pathlib

import gmsh

HERE = pathlib.Path(__file__).parent
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
lines = ["# Made by make_gmsh.py with Gmsh " + gmsh.option.getString("General.Version")]
lines += ["# file, group, elements, area in m2 or volume in m3 as Gmsh integrates it"]
for name, order in (("simple", 1), ("quadratic", 2)):
    gmsh.clear()
    gmsh.model.add(name)
    geo = gmsh.model.geo
    p = [
        geo.addPoint(x, y, z)
        for x, y, z in [(-2, 0, 2), (0, 0, 3), (2, 0, 2), (-2, 1, 2), (0, 1, 3), (2, 1, 2)]
    ]
    sides = []
    edges = {}
    for a, b in [(0, 1), (1, 4), (4, 3), (3, 0), (1, 2), (2, 5), (5, 4)]:
        edges[a, b] = geo.addLine(p[a], p[b])
    sides.append(
        geo.addPlaneSurface(
            [geo.addCurveLoop([edges[0, 1], edges[1, 4], edges[4, 3], edges[3, 0]])]
        )
    )
    sides.append(
        geo.addPlaneSurface(
            [geo.addCurveLoop([edges[1, 2], edges[2, 5], edges[5, 4], -edges[1, 4]])]
        )
    )
    corner = [geo.addPoint(x, y, 0) for x, y in [(-1, 0), (1, 0), (1, 1), (-1, 1)]]
    ring = [geo.addLine(corner[k], corner[(k + 1) % 4]) for k in range(4)]
    bottom = geo.addPlaneSurface([geo.addCurveLoop(ring)])
    swept = geo.extrude(
        [(2, bottom)], 0, 0, 0.5, numElements=[2] if order == 2 else [], recombine=order == 2
    )
    geo.synchronize()
    curves = [tag for _, tag in gmsh.model.getEntities(1)]
    for curve in curves:
        gmsh.model.mesh.setTransfiniteCurve(curve, 3)
    surfaces = [*sides, bottom]
    for surface in surfaces:
        gmsh.model.mesh.setTransfiniteSurface(surface)
        if order == 2:
            gmsh.model.mesh.setRecombine(2, surface)
    groups = {"mirror": (2, sides), "right": (2, sides[1:])}
    groups["foot"] = (3, [tag for dim, tag in swept if dim == 3])
    for group, (dim, tags) in groups.items():
        gmsh.model.addPhysicalGroup(dim, tags, name=group)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(order)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 0)
    tags, at, _ = gmsh.model.mesh.getNodes()
    view = gmsh.view.add("displacement")
    moved = [[0.0, 0.0, 0.01 * at[3 * k]] for k in range(len(tags))]
    gmsh.view.addModelData(view, 0, name, "NodeData", tags, moved)
    for version in (2.2, 4.1):
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            file = f"{name}-{version}{'-binary' if binary else ''}.msh"
            gmsh.option.setNumber("PostProcessing.SaveMesh", 1)
            gmsh.view.write(view, str(HERE / file))
    for group, (dim, entities) in groups.items():
        count, size = 0, 0.0
        for entity in entities:
            for of_kind in gmsh.model.mesh.getElements(dim, entity)[1]:
                count += len(of_kind)
                size += sum(gmsh.model.mesh.getElementQualities(of_kind, "volume"))
        lines.append(f"{name},{group},{count},{size:.12g}")
(HERE / "gmsh.csv").write_text("\n".join(lines) + "\n", encoding="ascii")
