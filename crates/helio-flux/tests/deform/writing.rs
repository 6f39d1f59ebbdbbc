//! Maps as files.

use helio_flux::deform::{SlopeErrors, substitute_elements, write_csv, write_vtk};

use crate::scene::{Of, grid, moved, upper};

#[test]
fn a_table_and_a_file_for_paraview() {
    let mesh = grid(
        [0.0, 2.0],
        [0.0, 1.0],
        [2, 1],
        Of::Quadrilaterals,
        |_, _| 0.0,
    );
    // The second cell tips by 1 in 100; of the last node nothing is known but in the second file.
    let by = |[x, _, _]: [f64; 3]| [0.0, 0.0, if x > 1.0 { 0.01 } else { 0.0 }];
    let whole = moved(mesh, by);
    let mut part = whole.displacement_m().unwrap().to_vec();
    part[0] = [f64::NAN; 3];
    let mut holed = whole.clone();
    holed.set_displacements_m(part).unwrap();
    let mirror = upper(&holed);
    let deformed = substitute_elements(&mirror).unwrap();
    let slopes = SlopeErrors::new(&deformed, [1.0, 0.0, 0.0]).unwrap();
    let mut table = Vec::new();
    write_csv(&mut table, &deformed, &slopes).unwrap();
    let table = String::from_utf8(table).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|l| l.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == 14));
    assert_eq!(rows[1][..3], ["1", "0", ""]);
    assert_eq!(rows[1][13], "no_displacement");
    assert_eq!((rows[2][13], rows[2][4]), ("ok", "0.005"));
    let slope: f64 = rows[2][9].parse().unwrap();
    assert_eq!(slope, slopes.total_rad()[1]);
    assert!((slope - 0.01_f64.atan()).abs() < 1e-15);
    let mut file = Vec::new();
    write_vtk(&mut file, &mirror, &slopes).unwrap();
    let file = String::from_utf8(file).unwrap();
    assert!(file.contains("POINTS 6 double\n0.0 0.0 0.0\n"));
    assert!(file.contains("POLYGONS 2 10\n4 0 2 3 1\n4 2 4 5 3\n"));
    assert!(file.contains("VECTORS displacement_m double\nnan nan nan\n0.0 0.0 0.0\n"));
    let map = format!("SCALARS slope_error_rad double 1\nLOOKUP_TABLE default\nnan\n{slope:?}\n");
    assert!(file.contains(&map));
}
