//! Maps of a deformed mirror: a table, and a file for ParaView.

use std::io::{self, Write};

use super::{Deformed, SlopeErrors};
use crate::mesh::Mirror;

/// Writes one row per face as CSV: `element, facet, x_m, y_m, z_m` (centroid under load), `normal_x,
/// normal_y, normal_z` (under load), `area_m2, slope_error_rad, slope_error_1_rad, slope_error_2_rad,
/// moved_m, status`. Numbers of a row whose status is not ok are empty.
///
/// Numbers read back to the same double.
///
/// # Errors
/// What `out` says.
pub fn write_csv(
    out: &mut impl Write,
    deformed: &Deformed,
    slopes: &SlopeErrors,
) -> io::Result<()> {
    writeln!(
        out,
        "element,facet,x_m,y_m,z_m,normal_x,normal_y,normal_z,area_m2,slope_error_rad,\
         slope_error_1_rad,slope_error_2_rad,moved_m,status"
    )?;
    for (row, loaded) in deformed.loaded().iter().enumerate() {
        let facet = deformed.ideal()[row].mirror();
        write!(out, "{},{facet}", deformed.element_ids()[row])?;
        if let Some(loaded) = loaded {
            for x in loaded.centroid_m().into_iter().chain(loaded.normal()) {
                write!(out, ",{x:?}")?;
            }
            let columns = [slopes.total_rad(), slopes.first_rad(), slopes.second_rad()];
            write!(out, ",{:?}", loaded.area_m2())?;
            for column in columns {
                write!(out, ",{:?}", column[row])?;
            }
            write!(out, ",{:?}", slopes.moved_m()[row])?;
        } else {
            write!(out, ",,,,,,,,,,,")?;
        }
        writeln!(out, ",{}", deformed.status()[row].word())?;
    }
    Ok(())
}

/// Writes the mirror as a legacy VTK file (text) for ParaView and the like: the faces without load, the
/// displacements as vectors `displacement_m` of the points (to warp by), and per face `element`, `facet`,
/// `slope_error_rad`, `slope_error_1_rad`, `slope_error_2_rad` and `moved_m`; NaN where there is none.
///
/// # Errors
/// What `out` says.
pub fn write_vtk(out: &mut impl Write, mirror: &Mirror, slopes: &SlopeErrors) -> io::Result<()> {
    let faces = mirror.faces();
    writeln!(
        out,
        "# vtk DataFile Version 3.0\nslope errors of a mirror, metres and radians\nASCII\n\
         DATASET POLYDATA\nPOINTS {} double",
        mirror.position_m().len()
    )?;
    for [x, y, z] in mirror.position_m() {
        writeln!(out, "{x:?} {y:?} {z:?}")?;
    }
    let numbers: usize = faces.iter().map(|face| 1 + face.corners().len()).sum();
    writeln!(out, "POLYGONS {} {numbers}", faces.len())?;
    for face in faces {
        write!(out, "{}", face.corners().len())?;
        for node in face.corners() {
            write!(out, " {node}")?;
        }
        writeln!(out)?;
    }
    if let Some(by_m) = mirror.displacement_m() {
        writeln!(out, "POINT_DATA {}", by_m.len())?;
        writeln!(out, "VECTORS displacement_m double")?;
        for [x, y, z] in by_m {
            writeln!(out, "{} {} {}", number(*x), number(*y), number(*z))?;
        }
    }
    writeln!(out, "CELL_DATA {}", faces.len())?;
    writeln!(out, "SCALARS element long 1\nLOOKUP_TABLE default")?;
    for face in faces {
        writeln!(out, "{}", face.element())?;
    }
    writeln!(out, "SCALARS facet long 1\nLOOKUP_TABLE default")?;
    for face in faces {
        writeln!(out, "{}", face.facet())?;
    }
    for (name, column) in [
        ("slope_error_rad", slopes.total_rad()),
        ("slope_error_1_rad", slopes.first_rad()),
        ("slope_error_2_rad", slopes.second_rad()),
        ("moved_m", slopes.moved_m()),
    ] {
        writeln!(out, "SCALARS {name} double 1\nLOOKUP_TABLE default")?;
        for value in column {
            writeln!(out, "{}", number(*value))?;
        }
    }
    Ok(())
}

/// Reads back to the same double; NaN as VTK writes it.
fn number(value: f64) -> String {
    if value.is_nan() {
        "nan".to_owned()
    } else {
        format!("{value:?}")
    }
}
