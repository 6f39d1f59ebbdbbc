use helio_flux::Canting;

use super::*;
use crate::load_field;

const PLANE: &str = "[receiver]\nshape = \"plane\"\ncentre_m = [0, 0, 1]\nfacing = [0, 0, -1]\nwidth_m = 0.2\n\
                     height_m = 0.4\n";

const FIELD: &str = "[targets.board]\ncentre_enu_m = [0, 0, 60]\nnormal_enu = [0, 1, 0]\nwidth_m = 8\nheight_m = 6\n\
                     [targets.point]\ncentre_enu_m = [0, 0, 70]\n[heliostats]\ntable = \"h.csv\"\naim = \"board\"\n\
                     mirror_offset_m = 0\n";

fn folder(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), text).unwrap();
    std::fs::write(folder.path().join("field.toml"), FIELD).unwrap();
    let table = "id,east_m,north_m,up_m\nA1,10,80,4\n";
    std::fs::write(folder.path().join("h.csv"), table).unwrap();
    folder
}

fn of_mesh(text: &str) -> Result<FluxScene, String> {
    let folder = folder(text);
    load_scene(&folder.path().join("s.toml"), SceneOf::Mesh).map_err(|error| {
        let error = error.to_string();
        error.replace(&format!("{}/", folder.path().display()), "")
    })
}

fn of_field(text: &str) -> Result<FluxScene, String> {
    let folder = folder(text);
    let field = load_field(&folder.path().join("field.toml")).unwrap();
    load_scene(&folder.path().join("s.toml"), SceneOf::Field(&field)).map_err(|error| {
        let error = error.to_string();
        error.replace(&format!("{}/", folder.path().display()), "")
    })
}

#[test]
fn a_scene_of_a_mesh() {
    let scene = of_mesh(&format!(
        "[sun]\ntoward = [0, 0, 2]\nshape = \"gaussian\"\nsigma_mrad = 2.5\ndni_w_m2 = 822\n[mirror]\n\
         reflectivity = 0.87\nslope_error_mrad = 1.5\nspecularity_mrad = 0.4\nsurface = \"MIRROR\"\nunit = \"mm\"\n\
         {PLANE}rows = 40\ncolumns = 20\n[rays]\ncount = 1e6\nseed = 3\n"
    ))
    .unwrap();
    assert_eq!(scene.sun.form, SunForm::Gaussian(0.0025));
    assert_eq!(scene.sun.toward, Some([0.0, 0.0, 2.0]));
    assert_eq!(scene.mirror.part, MirrorPart::Surface("MIRROR".into()));
    assert_eq!(scene.mirror.unit.map(SceneUnit::metres), Some(0.001));
    assert_eq!((scene.rays.count, scene.rays.seed), (1_000_000, 3));
    let Receiver::Plane(plane) = &scene.receiver else {
        panic!("no plane");
    };
    // A camera below that looks up: x to its right.
    assert_eq!(
        (plane.right(), plane.size_m()),
        ([1.0, 0.0, 0.0], [0.2, 0.4])
    );
    assert_eq!((plane.rows(), plane.columns()), (40, 20));
}

#[test]
fn a_scene_of_a_field_with_one_of_its_targets() {
    let scene = of_field(
        "[mirror]\nwidth_m = 11\nheight_m = 10\ncolumns = 4\nrows = 5\ngap_m = 0.02\ncanting = \"to-aim\"\n\
         reflectivity = 0.9\n[receiver]\nshape = \"target\"\ntarget = \"board\"\nrows = 6\ncolumns = 8\n",
    )
    .unwrap();
    let mirror = scene.mirror.heliostat.unwrap();
    assert_eq!(
        (mirror.columns, mirror.rows, mirror.canting),
        (4, 5, Canting::ToAim)
    );
    assert_eq!(mirror.reflectivity, 0.9);
    let Receiver::Plane(plane) = &scene.receiver else {
        panic!("no plane");
    };
    // Faces north: a camera there has west to its right.
    assert_eq!(
        (plane.normal(), plane.right()),
        ([0.0, 1.0, 0.0], [-1.0, 0.0, 0.0])
    );
    assert!((scene.receiver.bin_area_m2(0) - 1.0).abs() < 1e-12);
}

#[test]
fn round_receivers() {
    let scene = of_mesh(
        "[receiver]\nshape = \"cylinder\"\nbase_m = [0, 0, 50]\nradius_m = 3\nheight_m = 8\n",
    );
    let area_m2 = scene.unwrap().receiver.area_m2();
    assert!((area_m2 - 2.0 * std::f64::consts::PI * 3.0 * 8.0).abs() < 1e-9);
    let scene = of_mesh(
        "[receiver]\nshape = \"cone\"\nbase_m = [0, 0, 0]\naxis = [0, 1, 0]\nbase_radius_m = 3\nend_radius_m = 0\n\
         height_m = 4\n",
    );
    let area_m2 = scene.unwrap().receiver.area_m2();
    assert!((area_m2 - std::f64::consts::PI * 3.0 * 5.0).abs() < 1e-9);
}

#[test]
fn a_receiver_of_triangles() {
    let folder = folder(
        "[receiver]\nshape = \"mesh\"\nfile = \"r.inp\"\nfacing = [0, 0, 1]\nunit = \"cm\"\n",
    );
    let inp = "*NODE\n1,0,0,0\n2,100,0,0\n3,100,100,0\n4,0,100,0\n*ELEMENT,TYPE=S4\n1,1,4,3,2\n";
    std::fs::write(folder.path().join("r.inp"), inp).unwrap();
    let scene = load_scene(&folder.path().join("s.toml"), SceneOf::Mesh).unwrap();
    assert_eq!((scene.receiver.bins(), scene.files.len()), (2, 2));
    assert!((scene.receiver.area_m2() - 1.0).abs() < 1e-12);
    // Wound the other way round in the file, and turned to where it is lit.
    assert_eq!(scene.receiver.bin_normal(0), [0.0, 0.0, 1.0]);
}

#[test]
fn a_method_by_an_error() {
    let scene = of_mesh(&format!("{PLANE}[rays]\nmethod = \"auto\"\nseed = 7\n")).unwrap();
    assert_eq!((scene.rays.method, scene.rays.seed), (SceneMethod::Auto, 7));
    assert_eq!(scene.rays.error, 0.01);
    let closer = of_mesh(&format!("{PLANE}[rays]\nmethod = \"auto\"\nerror = 2e-3\n")).unwrap();
    assert_eq!(closer.rays.error, 2e-3);
    for (method, key) in [
        ("auto", "count = 5"),
        ("auto", "points = 2"),
        ("trace", "error = 0.1"),
        ("convolve", "error = 0.1"),
    ] {
        let refused = of_mesh(&format!("{PLANE}[rays]\nmethod = \"{method}\"\n{key}\n"));
        assert!(
            refused.unwrap_err().contains(" is of method = "),
            "{method} {key}"
        );
    }
}

#[test]
fn what_is_wrong_is_shown_with_its_place() {
    let field = |mirror: &str, receiver: &str| {
        of_field(&format!(
            "[mirror]\nwidth_m = 3\nheight_m = 2\n{mirror}\n{receiver}"
        ))
        .unwrap_err()
    };
    let wrong = [
        of_mesh(&format!("{PLANE}[suns]\n")).unwrap_err(),
        of_mesh(&format!("{PLANE}[sun]\nhalf_angle = 4.65\n")).unwrap_err(),
        of_mesh(&format!("{PLANE}[sun]\nhalf_angle_mrad = -4.65\n")).unwrap_err(),
        of_mesh(&format!("{PLANE}[sun]\nshape = \"pilbox\"\n")).unwrap_err(),
        of_mesh(&format!("{PLANE}[sun]\nshape = \"buie\"\n")).unwrap_err(),
        of_mesh(&format!(
            "{PLANE}[sun]\nshape = \"buie\"\nhalf_angle_mrad = 4\n"
        ))
        .unwrap_err(),
        of_mesh(&format!("{PLANE}[sun]\ntoward = [0, 0, 0]\n")).unwrap_err(),
        of_mesh(&format!("{PLANE}[sun]\ntoward = [0, 0]\n")).unwrap_err(),
        of_mesh("[sun]\n").unwrap_err(),
        of_mesh("[receiver]\nshape = \"plane\"\n").unwrap_err(),
        of_mesh(&format!("{PLANE}right = [0, 0, 2]\n")).unwrap_err(),
        of_mesh(&format!("{PLANE}radius_m = 2\n")).unwrap_err(),
        of_mesh(&format!("{PLANE}rows = 3.5\n")).unwrap_err(),
        of_mesh(&format!("{PLANE}rows = 5000\ncolumns = 5000\n")).unwrap_err(),
        of_mesh("[receiver]\nshape = \"target\"\ntarget = \"board\"\n").unwrap_err(),
        of_mesh("[receiver]\nshape = \"mesh\"\nfile = \"none.inp\"\nfacing = [0, 0, 1]\n")
            .unwrap_err(),
        of_mesh(&format!("{PLANE}[mirror]\nwidth_m = 2\n")).unwrap_err(),
        of_mesh(&format!(
            "{PLANE}[mirror]\nsurface = \"A\"\nnode_set = \"B\"\n"
        ))
        .unwrap_err(),
        of_mesh(&format!("{PLANE}[rays]\nmethod = \"convolve\"\nseed = 1\n")).unwrap_err(),
        of_field(PLANE).unwrap_err(),
        of_field(&format!(
            "{PLANE}[sun]\ntoward = [0, 0, 1]\n[mirror]\nwidth_m = 1\nheight_m = 1\n"
        ))
        .unwrap_err(),
        field("surface = \"A\"", PLANE),
        field("focal_length_m = 80", PLANE),
        field("", "[receiver]\nshape = \"target\"\ntarget = \"bord\"\n"),
        field("", "[receiver]\nshape = \"target\"\ntarget = \"point\"\n"),
    ];
    insta::assert_snapshot!(wrong.join("\n\n"));
}

// The mirror itself refuses wider ones, and would not say on which line they stand.
#[test]
fn heliostats_of_a_kilometre_are_refused_on_their_line() {
    let of = |width_m: &str| {
        of_field(&format!(
            "[mirror]\nwidth_m = {width_m}\nheight_m = 2\n{PLANE}"
        ))
    };
    assert!(of("1000").is_ok());
    let error = of("1000.5").unwrap_err();
    assert!(
        error.contains("s.toml:2:") && error.contains("1000"),
        "{error}"
    );
}
