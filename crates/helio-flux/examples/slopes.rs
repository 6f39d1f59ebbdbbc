//! Slope errors of a loaded mirror by both methods, from a CalculiX model and its result.
//!
//! ```sh
//! cargo run --release -p helio-flux --example slopes -- MODEL.inp RESULT.frd METRES_PER_UNIT SURFACE [MAP.csv MAP.vtk]
//! ```
//!
//! The surface names the reflecting faces; the sun stands along z, and the second axis of the slopes
//! is y (as in Yan 2022, figure 10).
#![allow(clippy::print_stdout, reason = "it is a program")]

use std::env;
use std::error::Error;
use std::fs::{self, File};
use std::io::BufWriter;

use helio_flux::deform::{
    Deformed, PoseFit, SlopeErrors, reconstruct_poses, substitute_elements, write_csv, write_vtk,
};
use helio_flux::mesh::{MirrorOptions, Pick, ReadOptions, frd, inp};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [model, result, unit, surface, maps @ ..] = &arguments[..] else {
        return Err(
            "wanted: MODEL.inp RESULT.frd METRES_PER_UNIT SURFACE [MAP.csv MAP.vtk]".into(),
        );
    };
    let options = ReadOptions::in_units_of(unit.parse()?)?;
    let mut mesh = inp::mesh(model, &fs::read(model)?, &options)?;
    let moved = frd::displacements(result, &fs::read(result)?, frd::Step::Last, &options)?;
    let matched = mesh.displace(&moved);
    println!(
        "{} nodes, {} elements, {} nodes without displacement",
        mesh.node_ids().len(),
        mesh.len(),
        matched.without.len()
    );
    print!("{}", mesh.faults());
    let sun = MirrorOptions::toward([0.0, 0.0, 1.0])?;
    let mirror = mesh.mirror(&Pick::Surface(surface), &sun)?;
    println!("{} faces, {} facets", mirror.faces().len(), mirror.facets());
    let displacement = mirror.displacement_m().unwrap_or(&[]);
    let largest = |k: Option<usize>| {
        let size = |by: &[f64; 3]| match k {
            Some(k) => by[k].abs(),
            None => (by[0] * by[0] + by[1] * by[1] + by[2] * by[2]).sqrt(),
        };
        1e3 * displacement.iter().map(size).fold(0.0, f64::max)
    };
    println!(
        "largest displacement {:.3} mm (along x {:.3}, y {:.3}, z {:.3})",
        largest(None),
        largest(Some(0)),
        largest(Some(1)),
        largest(Some(2))
    );
    let elements = substitute_elements(&mirror)?;
    let slopes = report("element substitution", &elements)?;
    for (name, fit) in [
        ("pose from three points", PoseFit::ThreePoints),
        ("pose by least squares", PoseFit::LeastSquares),
    ] {
        let (rigid, poses) = reconstruct_poses(&mirror, fit)?;
        let of_pose = report(name, &rigid)?;
        let worst = poses.iter().map(|pose| pose.rms_m).fold(0.0, f64::max);
        let apart = (slopes.total_rad().iter().zip(of_pose.total_rad()))
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        println!(
            "    farthest facet from rigid {:.3} um rms; largest difference to elements {:.4} mrad",
            1e6 * worst,
            1e3 * apart
        );
    }
    if let [table, file] = maps {
        write_csv(
            &mut BufWriter::new(File::create(table)?),
            &elements,
            &slopes,
        )?;
        write_vtk(&mut BufWriter::new(File::create(file)?), &mirror, &slopes)?;
    }
    Ok(())
}

fn report(name: &str, deformed: &Deformed) -> Result<SlopeErrors, Box<dyn Error>> {
    let slopes = SlopeErrors::new(deformed, [1.0, 0.0, 0.0])?;
    let peak = |extreme: Option<helio_flux::deform::Extreme>| {
        extreme.map_or(f64::NAN, |extreme| 1e3 * extreme.value)
    };
    println!(
        "{name}: largest slope error {:.4} mrad (across the beam {:.4}, along it {:.4}); \
         rms by area {:.4} ({:.4}, {:.4})",
        peak(slopes.max()),
        peak(slopes.max_first()),
        peak(slopes.max_second()),
        1e3 * slopes.rms_rad(),
        1e3 * slopes.rms_first_rad(),
        1e3 * slopes.rms_second_rad()
    );
    Ok(slopes)
}
