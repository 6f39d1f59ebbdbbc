//! Flux maps as tables.

use helio_flux::{FluxMap, Receiver};

use crate::IoError;
use crate::output::{Cells, Destination, Format, write_columns};

/// Writes a map as a table of a row a bin: `row, column, u_m, v_m`, the middle of the bin along `axes`, `area_m2,
/// flux_w_m2`. Places are metres; `u_m` and `v_m` are empty on a mesh. Answers the bytes written.
///
/// # Errors
/// [`IoError`] if it cannot be written.
///
/// ```
/// use helio_flux::Element;
/// use helio_io::output::{Destination, Format};
/// use helio_io::{SceneOf, scene_of_text, write_flux_map};
/// let text = "[receiver]\nshape = \"plane\"\ncentre_m = [0, 0, 5]\nfacing = [0, 0, -1]\nwidth_m = 2\nheight_m = 2";
/// let scene = scene_of_text("scene".as_ref(), text, SceneOf::Mesh)?;
/// let mirror = Element::triangle([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])?;
/// let map = scene.light(&[mirror], [0.0, 0.0, 1.0], 0, &|_, _| true)?.ok_or("stopped")?;
/// let path = tempfile::tempdir()?.keep().join("map.csv");
/// write_flux_map(Destination::File(path.clone()), Format::Csv, &scene.receiver, &map, ["x_m", "y_m", "z_m"])?;
/// assert!(std::fs::read_to_string(path)?.starts_with("row,column,u_m,v_m,x_m,y_m,z_m,area_m2,flux_w_m2\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_flux_map(
    destination: Destination,
    format: Format,
    receiver: &Receiver,
    map: &FluxMap,
    axes: [&str; 3],
) -> Result<u64, IoError> {
    let bins = 0..receiver.bins();
    let at = |of: &dyn Fn(usize) -> f64| -> Vec<f64> { bins.clone().map(of).collect() };
    let uv = |k: usize| at(&|bin| receiver.bin_uv_m(bin).map_or(f64::NAN, |uv| uv[k]));
    let point = |k: usize| at(&|bin| receiver.bin_centre_m(bin)[k]);
    let columns = receiver.columns();
    let whole = |of: &dyn Fn(usize) -> usize| -> Vec<Option<i64>> {
        let cell = |bin| i64::try_from(of(bin)).ok();
        bins.clone().map(cell).collect()
    };
    let cells = [
        ("row", Cells::Whole(&whole(&|bin| bin / columns))),
        ("column", Cells::Whole(&whole(&|bin| bin % columns))),
        ("u_m", Cells::Numbers(&uv(0))),
        ("v_m", Cells::Numbers(&uv(1))),
        (axes[0], Cells::Numbers(&point(0))),
        (axes[1], Cells::Numbers(&point(1))),
        (axes[2], Cells::Numbers(&point(2))),
        (
            "area_m2",
            Cells::Numbers(&at(&|bin| receiver.bin_area_m2(bin))),
        ),
        ("flux_w_m2", Cells::Numbers(map.irradiance_w_m2())),
    ];
    write_columns(destination, format, &cells)
}
