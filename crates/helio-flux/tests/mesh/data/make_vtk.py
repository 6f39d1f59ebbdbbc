"""Makes the VTK files of this folder with VTK's own writers and meshio's.

    pip install vtk==9.7.2 meshio==5.3.5 && python3 make_vtk.py

One mesh in many coats: a quadrilateral, a triangle, a hexahedron, a wedge as VTK orders it, a quadratic
quadrilateral and a line, over 30 points; vectors "displacement" of u = (0.1, 0, 0.01 x), cell labels "part"
of 0 1 2 2 1 0; and two polygons with a line as polygon data.
"""

import pathlib

import meshio
import vtk

HERE = pathlib.Path(__file__).parent / "vtk"
HERE.mkdir(exist_ok=True)
CELLS = [
    (vtk.VTK_QUAD, [0, 1, 2, 3]),
    (vtk.VTK_TRIANGLE, [1, 4, 2]),
    (vtk.VTK_HEXAHEDRON, [5, 6, 7, 8, 9, 10, 11, 12]),
    (vtk.VTK_WEDGE, [13, 15, 14, 16, 18, 17]),
    (vtk.VTK_QUADRATIC_QUAD, [19, 20, 21, 22, 23, 24, 25, 26]),
    (vtk.VTK_LINE, [27, 28]),
]
POINTS: list[tuple[float, float, float]] = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0.25)]
POINTS += [(x + 5, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
POINTS += [(x + 8, y, z) for z in (0, 0.5) for x, y in ((0, 0), (1, 0), (0, 1))]
POINTS += [(x + 11, y, 0) for x, y in ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))]
POINTS += [(14, 0, 0), (15, 0, 0), (16, 1 / 3, 0)]


def data(of: vtk.vtkDataSet, points: int, labels: list[int]) -> None:
    """Gives a data set its arrays."""
    moved = vtk.vtkDoubleArray()
    moved.SetName("displacement")
    moved.SetNumberOfComponents(3)
    for x, _, _ in POINTS[:points]:
        moved.InsertNextTuple((0.1, 0.0, 0.01 * x))
    of.GetPointData().AddArray(moved)
    part = vtk.vtkIntArray()
    part.SetName("part")
    for label in labels:
        part.InsertNextValue(label)
    of.GetCellData().AddArray(part)


grid = vtk.vtkUnstructuredGrid()
points = vtk.vtkPoints()
points.SetDataTypeToDouble()
for point in POINTS:
    points.InsertNextPoint(point)
grid.SetPoints(points)
for kind, ids in CELLS:
    grid.InsertNextCell(kind, len(ids), ids)
data(grid, len(POINTS), [0, 1, 2, 2, 1, 0])

polygons = vtk.vtkPolyData()
polygons.SetPoints(points)
cells, lines = vtk.vtkCellArray(), vtk.vtkCellArray()
for ids in ([0, 1, 2, 3], [1, 4, 2]):
    cells.InsertNextCell(len(ids), ids)
lines.InsertNextCell(2, [27, 28])
polygons.SetPolys(cells)
polygons.SetLines(lines)
data(polygons, len(POINTS), [7, 5, 6])

for version in (42, 51):
    for binary in (False, True):
        for name, of, writer in (
            ("grid", grid, vtk.vtkUnstructuredGridWriter()),
            ("polygons", polygons, vtk.vtkPolyDataWriter()),
        ):
            writer.SetInputData(of)
            writer.SetFileVersion(version)
            if binary:
                writer.SetFileTypeToBinary()
            else:
                writer.SetFileTypeToASCII()
            writer.SetFileName(str(HERE / f"{name}-{version}{'-binary' if binary else ''}.vtk"))
            writer.Write()

for mode, packed, raw, wide, big in (
    ("Ascii", None, False, False, False),
    ("Binary", None, False, False, False),
    ("Binary", "ZLib", False, True, True),
    ("Appended", None, True, True, False),
    ("Appended", "ZLib", True, False, False),
    ("Appended", "ZLib", False, True, False),
    ("Appended", "LZ4", False, True, False),
):
    for name, of, writer, ending in (
        ("grid", grid, vtk.vtkXMLUnstructuredGridWriter(), "vtu"),
        ("polygons", polygons, vtk.vtkXMLPolyDataWriter(), "vtp"),
    ):
        writer.SetInputData(of)
        getattr(writer, f"SetDataModeTo{mode}")()
        getattr(writer, f"SetCompressorTypeTo{packed}")()
        writer.SetEncodeAppendedData(not raw)
        writer.SetHeaderTypeToUInt64() if wide else writer.SetHeaderTypeToUInt32()
        writer.SetByteOrderToBigEndian() if big else writer.SetByteOrderToLittleEndian()
        writer.SetBlockSize(64)
        words = [name, mode.lower(), (packed or "plain").lower(), *(["raw"] if raw else [])]
        writer.SetFileName(str(HERE / ("-".join(words) + "." + ending)))
        writer.Write()

# meshio orders wedges as Gmsh does and writes them so.
for name, options in (
    ("meshio.vtk", {"binary": True}),
    ("meshio-ascii.vtk", {"binary": False}),
    ("meshio.vtu", {"compression": "zlib"}),
    ("meshio-plain.vtu", {"compression": None}),
):
    mesh = meshio.Mesh(
        POINTS[:13],
        [("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 2]]), ("hexahedron", [list(range(5, 13))])],
        point_data={"displacement": [[0.1, 0.0, 0.01 * x] for x, _, _ in POINTS[:13]]},
        cell_data={"part": [[0], [1], [2]]},
    )
    mesh.write(HERE / name, **options)
