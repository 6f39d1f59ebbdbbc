//! `flux` with meshes, results and scenes that are not as they should be: what is said, what counts, how it ends.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use common::{Folder, NOON, Run};
use serde_json::Value;

/// A sun in the zenith, and a board of 4 m by 4 m at 5 m that faces down.
const SCENE: &str = "[mirror]\nunit = \"m\"\n[receiver]\nshape = \"plane\"\ncentre_m = [0, 0, 5]\nfacing = [0, 0, -1]\n\
                     width_m = 4\nheight_m = 4\nrows = 8\ncolumns = 8\n[rays]\ncount = 100000\n";
/// A mirror of 1 m by 2 m in two squares.
const NODES: &str = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,2,0\n6,1,2,0\n";
const SQUARES: &str = "*ELEMENT,TYPE=S4\n1,1,2,3,4\n2,4,3,6,5\n";

fn folder(scene: &str, files: &[(&str, &str)]) -> Folder {
    let folder = Folder::empty();
    folder.write("scene.toml", scene);
    for (name, text) in files {
        folder.write(name, text);
    }
    folder
}

fn model() -> String {
    format!("{NODES}{SQUARES}")
}

fn flux(folder: &Folder, mesh: &str, more: &[&str]) -> Run {
    let args = ["flux", "--mesh", mesh, "--scene", "scene.toml"];
    folder.run(&[&args, more].concat())
}

/// What was found, by a run that ended with this status.
fn found(run: &Run, code: i32) -> Value {
    assert_eq!(run.code(), code, "{}", run.stderr());
    serde_json::from_str(&run.stdout()).unwrap()
}

fn at(value: &Value, path: &str) -> f64 {
    let found = value.pointer(path);
    found
        .and_then(Value::as_f64)
        .unwrap_or_else(|| panic!("{path}: {value}"))
}

/// To rounding of sums.
fn close(found: f64, wanted: f64) {
    assert!((found - wanted).abs() < 1e-9 * wanted, "{found} {wanted}");
}

/// A run that is refused, with nothing on standard output: its message.
fn refused(run: &Run) -> String {
    let found = (run.code(), run.stdout());
    assert_eq!(found, (2, String::new()), "{}", run.stderr());
    run.stderr()
}

fn says(run: &Run, wanted: &[&str]) {
    for wanted in wanted {
        assert!(run.stderr().contains(wanted), "{wanted}: {}", run.stderr());
    }
}

#[test]
fn two_parts_on_one_place_count_once() {
    let twins = "*NODE\n11,0,0,0\n12,1,0,0\n13,1,1,0\n14,0,1,0\n*ELEMENT,TYPE=S4,ELSET=UPPER\n7,11,12,13,14\n";
    let folder = folder(
        SCENE,
        &[("m.inp", &(model() + twins)), ("one.inp", &model())],
    );
    let run = flux(&folder, "m.inp", &[]);
    let both = found(&run, 1);
    says(
        &run,
        &["1 element on the same places as others, with nodes of its own, and left out: 7"],
    );
    assert_eq!(both["mesh"]["elements_coincident"]["count"], 1);
    assert_eq!(both["mesh"]["elements_coincident"]["first"][0], 7);
    let one = found(&flux(&folder, "one.inp", &[]), 0);
    close(at(&one, "/power/incoming_w"), 2000.0);
    assert_eq!(both["power"]["incoming_w"], one["power"]["incoming_w"]);
    // of a receiver too
    let board = "*NODE\n1,-2,-2,5\n2,2,-2,5\n3,0,3,5\n4,-2,-2,5\n5,2,-2,5\n6,0,3,5\n*ELEMENT,TYPE=S3\n1,1,2,3\n2,4,5,6\n";
    folder.write("board.inp", board);
    folder.write(
        "board.toml",
        "[mirror]\nunit = \"m\"\n[receiver]\nshape = \"mesh\"\nfile = \"board.inp\"\nunit = \"m\"\nfacing = [0, 0, -1]\n",
    );
    let run = folder.run(&["flux", "--mesh", "one.inp", "--scene", "board.toml"]);
    assert_eq!(found(&run, 0)["receiver"]["columns"], 1);
    says(
        &run,
        &[
            "board.inp: elements on the same places as others, with nodes of their own, are left out, 1 in all: 2",
        ],
    );
    // the other part alone is as good a mirror
    let alone = found(&flux(&folder, "m.inp", &["--element-set", "UPPER"]), 0);
    close(at(&alone, "/power/incoming_w"), 1000.0);
}

#[test]
fn a_receiver_that_is_lit_from_behind_is_said_to_be() {
    let turned = SCENE.replace("facing = [0, 0, -1]", "facing = [0, 0, 1]");
    let folder = folder(&turned, &[("m.inp", &model())]);
    let run = flux(&folder, "m.inp", &["--plot", "p.svg"]);
    let dark = found(&run, 1);
    says(
        &run,
        &[
            "lit from behind: of 2000.00 W reflected about 2000.00 W come to the back",
            "none of the 2000.00 W reflected arrives on the receiver\n",
            "no light on the 16.0000 m² of the receiver",
        ],
    );
    close(at(&dark, "/receiver/lit_from_behind_w"), 2000.0);
    assert_eq!(at(&dark, "/receiver/peak_flux_w_m2"), 0.0);
    for name in ["peak_row", "peak_column", "peak_u_v_m", "peak_at_m"] {
        assert!(dark["receiver"][name].is_null(), "{name}");
    }
    let figure = folder.read("p.svg");
    assert!(figure.contains("no light") && !figure.contains("peak"));
    // triangles that are lit on the other side
    let board = "*NODE\n1,-2,-2,5\n2,2,-2,5\n3,2,3,5\n4,-2,3,5\n*ELEMENT,TYPE=S4\n1,1,2,3,4\n";
    folder.write("board.inp", board);
    let mesh = |facing: &str| {
        format!(
            "[mirror]\nunit = \"m\"\n[receiver]\nshape = \"mesh\"\nfile = \"board.inp\"\nunit = \"m\"\nfacing = {facing}\n"
        )
    };
    folder.write("scene.toml", mesh("[0, 0, 1]"));
    let run = flux(&folder, "m.inp", &[]);
    close(at(&found(&run, 1), "/receiver/lit_from_behind_w"), 2000.0);
    folder.write("scene.toml", mesh("[0, 0, -1]"));
    let good = found(&flux(&folder, "m.inp", &[]), 0);
    assert_eq!(at(&good, "/receiver/lit_from_behind_w"), 0.0);
}

// A cone above the mirror, open below: its light comes in there, and has neither `facing` nor a normal.
#[test]
fn light_through_the_end_of_a_cone_is_told_as_such() {
    let scene = "[mirror]\nunit = \"m\"\n[receiver]\nshape = \"cone\"\nbase_m = [0, 0, 5]\naxis = [0, 0, 1]\n\
                 base_radius_m = 4\nend_radius_m = 0.1\nheight_m = 2\n[rays]\ncount = 10000\n";
    let run = flux(&folder(scene, &[("m.inp", &model())]), "m.inp", &[]);
    says(
        &run,
        &["come through its end, to its inside, which takes no light, and pass"],
    );
    assert!(!run.stderr().contains("facing"), "{}", run.stderr());
}

#[test]
fn a_seed_is_of_the_same_range_as_in_a_scene() {
    let folder = folder(SCENE, &[("m.inp", &model())]);
    for seed in ["-1", "9007199254740992", "1.5"] {
        let run = flux(&folder, "m.inp", &["--seed", seed]);
        says(
            &run,
            &["wanted a whole number from 0 to 9007199254740991 (2^53 - 1)"],
        );
    }
    found(&flux(&folder, "m.inp", &["--seed", "9007199254740991"]), 0);
}

#[test]
fn light_that_goes_elsewhere_is_no_quiet_zero() {
    for [from, to] in [
        ["centre_m = [0, 0, 5]", "centre_m = [0, 0, -5]"],
        ["[mirror]", "[sun]\ntoward = [0, 0, -1]\n[mirror]"],
        ["centre_m = [0, 0, 5]", "centre_m = [50, 0, 5]"],
    ] {
        let folder = folder(&SCENE.replace(from, to), &[("m.inp", &model())]);
        let run = flux(&folder, "m.inp", &[]);
        let dark = found(&run, 1);
        says(
            &run,
            &["none of the 2000.00 W reflected arrives on the receiver: mirrors send it beside"],
        );
        assert_eq!(at(&dark, "/receiver/lit_from_behind_w"), 0.0);
    }
}

// The board of the field looks north: a heliostat to its south lights its back.
#[test]
fn a_heliostat_behind_a_board_is_counted() {
    let folder = Folder::new();
    let flat = common::FIELD.replace("mirror_offset_m = 0.2", "mirror_offset_m = 0");
    folder.write("field.toml", flat);
    folder.write(
        "heliostats.csv",
        "id,east_m,north_m,up_m\nA1,-40,100,3\nA2,0.5,-150,3\n",
    );
    folder.write(
        "scene.toml",
        "[mirror]\nwidth_m = 3\nheight_m = 2\n[receiver]\nshape = \"target\"\ntarget = \"receiver\"\nrows = 6\n\
         columns = 6\n[rays]\ncount = 100000\n",
    );
    let args = ["flux", "--field", "field.toml", "--scene", "scene.toml"];
    let run = folder.run(&[&args[..], NOON, &["--plot", "p.svg"]].concat());
    let found = found(&run, 0);
    says(&run, &["the receiver is lit from behind: of "]);
    let (behind_w, spilled_w) = (
        at(&found, "/receiver/lit_from_behind_w"),
        at(&found, "/power/spilled_w"),
    );
    assert!(behind_w > 3000.0, "{behind_w}");
    assert!(
        (behind_w - spilled_w).abs() < 0.01 * spilled_w,
        "{behind_w} {spilled_w}"
    );
    // the figure's title says what it shows
    assert!(
        folder
            .read("p.svg")
            .contains(">Flux, sun at 2026-06-21T12:00:00Z")
    );
}

/// Displacements of the two squares: the outer edge rises by 10 mm.
const MOVED: &str =
    "node,ux_m,uy_m,uz_m\n1,0,0,0\n2,0,0,0\n3,0,0,0\n4,0,0,0\n5,0,0,0.01\n6,0,0,0.01\n";

#[test]
fn the_unloaded_mirror_has_no_slope_errors() {
    let folder = folder(SCENE, &[("m.inp", &model()), ("u.csv", MOVED)]);
    let with = |more: &[&str]| {
        flux(
            &folder,
            "m.inp",
            &[&["--displacements", "u.csv"], more].concat(),
        )
    };
    let bent = found(&with(&["--plot", "bent.html"]), 0);
    assert!(at(&bent, "/slope_errors/methods/0/largest_mrad") > 9.9);
    assert!(folder.read("bent.html").contains("Slope errors by method"));
    let run = with(&["--method", "unloaded", "--plot", "flat.html"]);
    let flat = found(&run, 0);
    assert!(flat["slope_errors"].is_null(), "{flat}");
    says(&run, &["--method unloaded: the mirror is as it was drawn"]);
    assert!(!run.stderr().contains("mrad rms"));
    assert!(!folder.read("flat.html").contains("Slope errors"));
    let said = refused(&with(&["--method", "unloaded", "--slopes", "s.csv"]));
    assert!(
        said.contains("with --method unloaded the mirror has no slope errors"),
        "{said}"
    );
}

#[test]
fn mirrors_of_any_size_have_digits() {
    let lengths = |factor: f64| {
        let node = |(k, (x, y)): (usize, (f64, f64))| {
            format!("{},{},{},0\n", k + 1, x * factor, y * factor)
        };
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let nodes: String = square.into_iter().enumerate().map(node).collect();
        format!("*NODE\n{nodes}*ELEMENT,TYPE=S4\n1,1,2,3,4\n")
    };
    for (factor, wanted) in [
        (2e-5, "400.00 nW fall on the mirrors = 0.00 shaded"),
        (2e-3, "4.0000 mW fall on the mirrors"),
        (2e5, "40.000 TW fall on the mirrors"),
    ] {
        let folder = folder(SCENE, &[("m.inp", &lengths(factor))]);
        says(&flux(&folder, "m.inp", &["--rays", "20000"]), &[wanted]);
    }
    // a receiver of a fifth of a millimetre: its area, and places on it
    let small = SCENE
        .replace("_m = 4", "_m = 2e-4")
        .replace("[0, 0, 5]", "[0, 0, 1e-3]");
    let folder = folder(&small, &[("m.inp", &lengths(2e-4))]);
    let run = flux(&folder, "m.inp", &[]);
    says(&run, &["over 0.0000000400 m²"]);
    let said = run.stderr();
    let place = said
        .split("at u ")
        .nth(1)
        .unwrap()
        .split(' ')
        .next()
        .unwrap();
    assert_eq!(
        place.trim_start_matches('-').len(),
        "0.0000125".len(),
        "{said}"
    );
}

#[test]
fn numbers_below_zero_are_refused_as_numbers() {
    let folder = folder(SCENE, &[("m.inp", &model())]);
    let picture = ["flux", "--camera", "f.pgm", "--gauge"];
    for (said, wanted) in [
        (
            refused(&flux(&folder, "m.inp", &["--dni-w-m2", "-5"])),
            "invalid value '-5' for '--dni-w-m2 <W/M2>': wanted a number of W/m² in 0..=1000000",
        ),
        (
            refused(&flux(&folder, "m.inp", &["--half-angle-mrad", "-1"])),
            "invalid value '-1' for '--half-angle-mrad <MRAD>': wanted a number of milliradians",
        ),
        (
            refused(&flux(&folder, "m.inp", &["--rays", "-7"])),
            "invalid value '-7' for '--rays <N>'",
        ),
        (
            refused(&folder.run(&[&picture[..], &["1,1,4174", "--dark", "-3"]].concat())),
            "invalid value '-3' for '--dark <GRAY>': wanted a number of gray values in 0..=65535",
        ),
        (
            refused(&folder.run(&[&picture[..], &["-1,1,4174"]].concat())),
            "wanted X,Y,W/M2 or X,Y,W/M2,RADIUS",
        ),
        (
            refused(&folder.run(&[&picture[..], &["1,1,4174", NOON[0], NOON[1]]].concat())),
            "--time is of --field; a picture wants no sun, and its direct irradiance is --dni-w-m2",
        ),
    ] {
        assert!(said.contains(wanted), "{wanted}: {said}");
    }
}

#[test]
fn too_many_bins_are_marked_where_they_are_written() {
    let many = SCENE.replace("rows = 8\ncolumns = 8", "rows = 8\ncolumns = 1048576");
    let folder = folder(&many, &[("m.inp", &model())]);
    let said = refused(&flux(&folder, "m.inp", &[]));
    assert!(
        said.contains("scene.toml:10:11: plane receiver: bins must be"),
        "{said}"
    );
    assert!(
        said.contains("10 | columns = 1048576\n     |           ^^^^^^^"),
        "{said}"
    );
}

#[test]
fn missing_nodes_between_corners_are_named() {
    let quadratic =
        "*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,.5,0,0\n5,.5,.5,0\n*ELEMENT,TYPE=S6\n1,1,2,3,4,5,6\n";
    let folder = folder(SCENE, &[("m.inp", quadratic)]);
    let run = flux(&folder, "m.inp", &[]);
    let found = found(&run, 0);
    says(
        &run,
        &["1 element with nodes between corners that the mesh does not have: 1 wants node 6"],
    );
    assert_eq!(found["mesh"]["faults"]["missing_mid_nodes"]["count"], 1);
    assert_eq!(found["mesh"]["faults"]["missing_mid_nodes"]["nodes"][0], 6);
    close(at(&found, "/power/incoming_w"), 500.0);
}

/// The nodes in this order as a `.vtu`, each with its displacement under this name.
fn vtu(order: [usize; 6], name: &str) -> String {
    let places = ["0 0 0", "1 0 0", "1 1 0", "0 1 0", "0 2 0", "1 2 0"];
    let by = ["0 0 0", "0 0 0", "0 0 0", "0 0 0", "0 0 .01", "0 0 .01"];
    let of = |all: [&str; 6]| order.map(|row| all[row]).join("\n");
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">\
         <UnstructuredGrid><Piece NumberOfPoints=\"6\" NumberOfCells=\"1\">\n<PointData>\
         <DataArray type=\"Float64\" Name=\"{name}\" NumberOfComponents=\"3\" format=\"ascii\">\n{}\n</DataArray></PointData>\n\
         <Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">\n{}\n</DataArray></Points>\n\
         <Cells><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">0 1 2</DataArray>\
         <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">3</DataArray>\
         <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">5</DataArray></Cells>\n\
         </Piece></UnstructuredGrid></VTKFile>\n",
        of(by),
        of(places)
    )
}

#[test]
fn points_without_numbers_are_matched_by_their_places() {
    let turned = vtu([5, 3, 0, 4, 2, 1], "displacement");
    let folder = folder(
        SCENE,
        &[("m.inp", &model()), ("u.csv", MOVED), ("u.vtu", &turned)],
    );
    let largest = |name: &str| {
        let run = flux(&folder, "m.inp", &["--displacements", name]);
        at(&found(&run, 0), "/slope_errors/methods/0/largest_mrad")
    };
    assert_eq!(largest("u.vtu"), largest("u.csv"));
    // 10 mm over 1 m
    assert!((largest("u.vtu") - 1e3 * 0.01_f64.atan()).abs() < 1e-9);
    // the same points 3 m away are those of another mesh
    folder.write(
        "far.vtu",
        turned
            .replace("1 2 0", "4 2 0")
            .replace("\n0 ", "\n3 ")
            .replace("\n1 ", "\n4 "),
    );
    let said = refused(&flux(&folder, "m.inp", &["--displacements", "far.vtu"]));
    assert!(said.contains("of that mesh, in its unit"), "{said}");
}

/// An `.frd` of the six nodes, which begin at `x`.
fn frd(x: f64) -> String {
    let at = [
        (0.0, 0.0),
        (1.0, 0.0),
        (1.0, 1.0),
        (0.0, 1.0),
        (0.0, 2.0),
        (1.0, 2.0),
    ];
    let e = |v: f64| {
        let text = format!("{v:.5E}");
        let (digits, power) = text.split_once('E').unwrap();
        let power: i32 = power.parse().unwrap();
        format!(
            "{:>12}",
            format!(
                "{digits}E{}{:02}",
                if power < 0 { '-' } else { '+' },
                power.abs()
            )
        )
    };
    let rows = |of: &dyn Fn(usize) -> [f64; 3]| -> String {
        let row = |k: usize| format!(" -1{:>10}{}\n", k + 1, of(k).map(e).concat());
        (0..6).map(row).collect()
    };
    let nodes = rows(&|k| [at[k].0 + x, at[k].1, 0.0]);
    let moved = rows(&|k| [0.0, 0.0, if k > 3 { 0.01 } else { 0.0 }]);
    format!(
        "    1C\n    2C                             6                                     1\n{nodes} -3\n\
         \x20 100CL  101 1.000000000           6                     0    1           1\n -4  DISP        4    1\n\
         {moved} -3\n 9999\n"
    )
}

#[test]
fn results_of_another_mesh_are_refused() {
    let folder = folder(
        SCENE,
        &[
            ("m.inp", &model()),
            ("same.frd", &frd(0.0)),
            ("other.frd", &frd(0.25)),
        ],
    );
    let run = flux(&folder, "m.inp", &["--displacements", "same.frd"]);
    assert!(at(&found(&run, 0), "/slope_errors/methods/0/largest_mrad") > 9.9);
    let said = refused(&flux(&folder, "m.inp", &["--displacements", "other.frd"]));
    let wanted = "node 1 is at [0.250000, 0.000000, 0.000000] m here and at [0.000000, 0.000000, 0.000000] m in the mesh";
    assert!(said.contains(wanted), "{said}");
}

#[test]
fn xml_that_ends_early_is_refused() {
    let whole = vtu([0, 1, 2, 3, 4, 5], "displacement");
    let folder = folder(SCENE, &[("m.inp", &model()), ("u.vtu", &whole)]);
    found(&flux(&folder, "m.inp", &["--displacements", "u.vtu"]), 0);
    for end in ["</VTKFile>", "</Piece>", "</PointData>"] {
        folder.write("cut.vtu", &whole[..whole.find(end).unwrap()]);
        for args in [vec!["--displacements", "cut.vtu"], vec![]] {
            let mesh = if args.is_empty() { "cut.vtu" } else { "m.inp" };
            let said = refused(&flux(&folder, mesh, &args));
            assert!(said.contains("cut.vtu"), "{end}: {said}");
        }
    }
}

#[test]
fn faces_of_solids_that_are_left_aside_are_counted() {
    // both sides of a ridge look up: of one body one patch counts
    let ridge = "*NODE\n1,0,0,0\n2,1,0,.2\n3,2,0,0\n4,0,1,0\n5,1,1,.2\n6,2,1,0\n*ELEMENT,TYPE=C3D6\n1,1,2,3,4,5,6\n\
                 *SURFACE,NAME=BOTH\n1,S3\n1,S4\n";
    let creased = SCENE.replace("[mirror]", "[mirror]\ncrease_deg = 10");
    let folder = folder(&creased, &[("m.inp", ridge)]);
    let run = flux(&folder, "m.inp", &[]);
    let one = found(&run, 1);
    says(
        &run,
        &[
            "1 outer face of solids turned to the sun left aside",
            "name the mirror by a surface",
        ],
    );
    assert_eq!(one["mesh"]["faces_left_aside"]["count"], 1);
    close(at(&one, "/power/incoming_w"), 1000.0);
    let both = found(&flux(&folder, "m.inp", &["--surface", "BOTH"]), 0);
    close(at(&both, "/power/incoming_w"), 2000.0);
}

#[test]
fn no_unit_is_guessed() {
    let bare = SCENE.replace("unit = \"m\"\n", "");
    let files = [
        ("m.inp", &*model()),
        ("u.vtu", &vtu([0, 1, 2, 3, 4, 5], "displacement")),
    ];
    let folder = folder(&bare, &files);
    for mesh in ["m.inp", "u.vtu"] {
        let said = refused(&flux(&folder, mesh, &[]));
        assert!(
            said.contains("the unit of its lengths is missing"),
            "{said}"
        );
        assert!(
            said.contains("`unit` (m, cm, mm or in) in [mirror] of the scene or --unit"),
            "{said}"
        );
    }
    let of = |unit: &str| {
        at(
            &found(&flux(&folder, "m.inp", &["--unit", unit]), 0),
            "/power/incoming_w",
        )
    };
    assert!((of("m") - 2000.0).abs() < 1e-9 && (of("mm") - 2e-3).abs() < 1e-12);
}

#[test]
fn half_a_mirror_lost_is_exit_status_1() {
    for (lost, fault) in [
        ("2,4,3,6,9", "missing_nodes"),
        ("2,4,3,3,4", "degenerate"),
        ("2,2,3,4,1", "duplicate"),
        ("2,4,6,3,5", "inverted"),
    ] {
        let folder = folder(SCENE, &[("m.inp", &model().replace("2,4,3,6,5", lost))]);
        let run = flux(&folder, "m.inp", &[]);
        let half = found(&run, 1);
        assert_eq!(half["mesh"]["faults"][fault]["first"][0], 2, "{fault}");
        assert_eq!(half["mesh"]["elements_without_a_face"]["first"][0], 2);
        close(at(&half, "/power/incoming_w"), 1000.0);
        says(
            &run,
            &["1 element of the mirror without a face of its own: 2"],
        );
    }
}

#[test]
fn vectors_of_unknown_names_are_named() {
    let folder = folder(
        SCENE,
        &[("u.vtu", &vtu([0, 1, 2, 3, 4, 5], "Verschiebung"))],
    );
    let run = flux(&folder, "u.vtu", &[]);
    let bare = found(&run, 0);
    assert!(bare["slope_errors"].is_null());
    says(
        &run,
        &[
            "vectors of its nodes are named [Verschiebung], and none is taken for displacements: --vectors NAME",
        ],
    );
    let named = found(&flux(&folder, "u.vtu", &["--vectors", "Verschiebung"]), 0);
    assert_eq!(at(&named, "/slope_errors/methods/0/largest_mrad"), 0.0);
    // and refused where they were asked for
    folder.write("m.inp", model());
    let said = refused(&flux(&folder, "m.inp", &["--displacements", "u.vtu"]));
    assert!(said.contains("its vectors are [Verschiebung]"), "{said}");
}
