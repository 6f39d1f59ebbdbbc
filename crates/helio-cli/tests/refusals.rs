//! Bad input of every kind: what is said about it, and that nothing is left behind.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use common::{DRIVES, FIELD, Folder, HELIOSTATS, NOON};

/// One bad input: files beside the good ones, and arguments.
struct Case<'a> {
    what: &'a str,
    files: Vec<(&'a str, Vec<u8>)>,
    args: Vec<&'a str>,
}

/// `track` at noon with one file replaced.
fn with<'a>(what: &'a str, name: &'a str, contents: impl Into<Vec<u8>>) -> Case<'a> {
    let args = [&["track", "--field", "field.toml"], NOON].concat();
    Case {
        what,
        files: vec![(name, contents.into())],
        args,
    }
}

/// `track` at noon with a piece of field.toml replaced.
fn toml<'a>(what: &'a str, from: &str, to: &str) -> Case<'a> {
    assert!(FIELD.contains(from), "{from}");
    with(what, "field.toml", FIELD.replacen(from, to, 1))
}

/// `track` at noon with more lines at the end of field.toml.
fn toml_and<'a>(what: &'a str, more: &str) -> Case<'a> {
    with(what, "field.toml", format!("{FIELD}{more}"))
}

/// `track` at noon with a piece of the heliostat table replaced.
fn table<'a>(what: &'a str, from: &str, to: &str) -> Case<'a> {
    assert!(HELIOSTATS.contains(from), "{from}");
    with(what, "heliostats.csv", HELIOSTATS.replacen(from, to, 1))
}

/// `track` with these arguments.
fn track<'a>(what: &'a str, more: &[&'a str]) -> Case<'a> {
    any(what, &[&["track", "--field", "field.toml"], more].concat())
}

/// `track` at noon with these arguments.
fn noon<'a>(what: &'a str, more: &[&'a str]) -> Case<'a> {
    track(what, &[NOON, more].concat())
}

/// Any arguments.
fn any<'a>(what: &'a str, args: &[&'a str]) -> Case<'a> {
    Case {
        what,
        files: Vec::new(),
        args: args.to_vec(),
    }
}

impl<'a> Case<'a> {
    fn and(mut self, name: &'a str, contents: impl Into<Vec<u8>>) -> Self {
        self.files.push((name, contents.into()));
        self
    }

    fn args(mut self, args: &[&'a str]) -> Self {
        self.args = args.to_vec();
        self
    }
}

/// Runs each case in a folder of its own and compares what it says with the snapshot.
fn refused(kind: &str, cases: Vec<Case<'_>>) {
    let mut said = String::new();
    for case in cases {
        let folder = Folder::new();
        for (name, contents) in &case.files {
            folder.write(name, contents);
        }
        let before = folder.contents();
        let run = folder.run(&case.args);
        let stderr = run.stderr();
        assert_eq!(run.code(), 2, "{}: {stderr}", case.what);
        assert_eq!(run.stdout(), "", "{}", case.what);
        assert!(stderr.contains("error: "), "{}: {stderr}", case.what);
        for word in ["panicked", "RUST_BACKTRACE", "unwrap", "src/"] {
            assert!(!stderr.contains(word), "{}: {stderr}", case.what);
        }
        assert!(
            folder.contents() == before,
            "{}: something was left behind",
            case.what
        );
        let args = case.args.join(" ");
        said.push_str(&format!(
            "## {}\n$ helio-rs {args}\n{}\n\n",
            case.what,
            stderr.trim_end()
        ));
    }
    insta::with_settings!({ omit_expression => true, prepend_module_to_snapshot => false }, {
        insta::assert_snapshot!(kind, said);
    });
}

const CALIBRATED: &str = "calibration = \"calibration.csv\"\n";

#[test]
fn missing_files() {
    refused(
        "missing_files",
        vec![
            any(
                "field.toml does not exist",
                &["track", "--field", "nowhere.toml"],
            ),
            any("field.toml is a folder", &["check", "--field", "."]),
            toml(
                "the table does not exist",
                "heliostats.csv",
                "heliostat.csv",
            ),
            toml("the table is a folder", "heliostats.csv", "."),
            toml_and("the calibration does not exist", CALIBRATED),
            toml_and("the drives do not exist", "drives = \"drives.csv\"\n"),
            track("suns do not exist", &["--suns", "suns.csv"]),
            noon(
                "the present angles do not exist",
                &["--present", "present.csv"],
            ),
            any(
                "angles do not exist",
                &["predict", "--field", "field.toml", "--angles", "angles.csv"],
            ),
        ],
    );
}

#[test]
fn broken_toml() {
    refused(
        "broken_toml",
        vec![
            toml("unclosed string", "\"heliostats.csv\"", "\"heliostats.csv"),
            toml("unclosed table", "[site]", "[site"),
            toml("no value", "elevation_m = 20.0", "elevation_m ="),
            toml(
                "a key twice",
                "elevation_m = 20.0",
                "elevation_m = 20.0\nelevation_m = 30.0",
            ),
            with(
                "not UTF-8",
                "field.toml",
                b"[site]\nname = \"J\xfclich\"\n".as_slice(),
            ),
            with("an empty file", "field.toml", ""),
            with("a table instead", "field.toml", HELIOSTATS),
        ],
    );
}

#[test]
fn unknown_keys() {
    refused(
        "unknown_keys",
        vec![
            toml("a key of the site", "latitude_deg", "latitude"),
            toml(
                "a key of the heliostats",
                "mirror_offset_m",
                "mirror_ofset_m",
            ),
            toml("a section", "[site]", "[sites]"),
            toml("a key of a target", "centre_enu_m", "center_enu_m"),
            toml_and(
                "a key of a drive",
                &DRIVES.replace("steps_per_deg", "steps_per_degree"),
            ),
            toml_and("an axis", "[heliostats.drive.axis3]\ntype = \"encoder\"\n"),
            table("a column", "up_m", "height_m"),
            table("one column more", "up_m\n", "up_m,colour\n"),
        ],
    );
}

#[test]
fn wrong_types() {
    refused(
        "wrong_types",
        vec![
            toml("text for a number", "37.4", "\"37.4\""),
            toml("two numbers for three", "[0.0, 0.0, 120.0]", "[0.0, 120.0]"),
            toml(
                "text among numbers",
                "[0.0, 0.0, 120.0]",
                "[0.0, \"0\", 120.0]",
            ),
            toml("a number for text", "\"receiver\"", "3"),
            with(
                "a list for a table",
                "field.toml",
                format!(
                    "site = [37.4, -6.25]\n{}",
                    &FIELD[FIELD.find("[targets").unwrap()..]
                ),
            ),
            toml_and("a word that is none of those", "mode = \"alt-azimuth\"\n"),
            toml_and("a list of texts", "ignore = \"colour\"\n"),
            table("text for a number in the table", "110.0", "far"),
            table("a comma for a point", "110.0", "\"110,0\""),
        ],
    );
}

#[test]
fn out_of_range() {
    refused(
        "out_of_range",
        vec![
            toml("a latitude", "37.4", "95.0"),
            toml("a longitude", "-6.25", "187.0"),
            toml(
                "a site above all mountains",
                "elevation_m = 20.0",
                "elevation_m = 20000.0",
            ),
            toml(
                "a mirror offset",
                "mirror_offset_m = 0.2",
                "mirror_offset_m = 1e6",
            ),
            toml("a target without width", "width_m = 12.0", "width_m = 0.0"),
            toml_and(
                "an axis far from square",
                "axis_nonorthogonality_deg = 85.0\n",
            ),
            toml_and("a tilt upside down", "pedestal_tilt_deg = 180.0\n"),
            table("a pivot beyond the earth", "240.0", "2.4e9"),
            track(
                "a sun azimuth",
                &["--sun-azimuth-deg", "400", "--sun-elevation-deg", "40"],
            ),
            track(
                "a sun elevation",
                &["--sun-azimuth-deg", "180", "--sun-elevation-deg", "91"],
            ),
            track("a sun of a table", &["--suns", "suns.csv"])
                .and("suns.csv", "azimuth_deg,elevation_deg\n180,45\n180,95\n"),
            noon("no threads", &["--threads", "0"]),
        ],
    );
}

#[test]
fn not_finite() {
    refused(
        "not_finite",
        vec![
            table("NaN in the table", "110.0", "NaN"),
            table("inf in the table", "110.0", "-inf"),
            toml("nan in the TOML", "37.4", "nan"),
            toml("inf in the TOML", "120.0]", "inf]"),
            track("NaN among suns", &["--suns", "suns.csv"])
                .and("suns.csv", "azimuth_deg,elevation_deg\n180,NaN\n"),
            track(
                "NaN as a sun",
                &["--sun-azimuth-deg", "NaN", "--sun-elevation-deg", "40"],
            ),
            noon("inf among present angles", &["--present", "present.csv"])
                .and("present.csv", "id,axis1_deg,axis2_deg\nA1,inf,40\n"),
        ],
    );
}

#[test]
fn ids() {
    let long = "x".repeat(100_000);
    refused(
        "ids",
        vec![
            table("an id twice", "A2", "A1"),
            table("an empty id", "A2", ""),
            table("a huge id", "A2", &long),
            toml("a huge name of the table", "heliostats.csv", &long),
            toml(
                "a huge name of a target",
                "aim = \"receiver\"",
                &format!("aim = \"{long}\""),
            ),
            toml("a huge key", "mirror_offset_m", &long),
        ],
    );
}

#[test]
fn empty_tables() {
    refused(
        "empty_tables",
        vec![
            with("no table in the file", "heliostats.csv", ""),
            with("blank lines only", "heliostats.csv", "\n\n"),
            with(
                "a heading only",
                "heliostats.csv",
                "id,east_m,north_m,up_m\n",
            ),
            track("no suns", &["--suns", "suns.csv"])
                .and("suns.csv", "azimuth_deg,elevation_deg\n"),
            any(
                "no angles",
                &["predict", "--field", "field.toml", "--angles", "angles.csv"],
            )
            .and("angles.csv", "time,id,azimuth_deg,elevation_deg\n"),
        ],
    );
}

#[test]
fn ragged_tables() {
    refused(
        "ragged_tables",
        vec![
            table("a cell too few", "A2,0.5,110.0,3.0", "A2,0.5,110.0"),
            table("a cell too many", "A2,0.5,110.0,3.0", "A2,0.5,110.0,3.0,1"),
            table("an open quote", "\"B, 3\"", "\"B, 3"),
            table("a column missing", "north_m", "aim_north_m"),
            table("a column twice", "north_m", "east_m"),
            table("an empty number", "110.0", ""),
            with(
                "not UTF-8",
                "heliostats.csv",
                b"id,east_m,north_m,up_m\nA\xff,1,2,3\n".as_slice(),
            ),
            toml("not Parquet", "heliostats.csv", "heliostats.parquet")
                .and("heliostats.parquet", "PAR1 and so on"),
        ],
    );
}

#[test]
fn times() {
    refused(
        "times",
        vec![
            track("no offset", &["--time", "2026-06-21T12:00:00"]),
            track("a date only", &["--time", "2026-06-21"]),
            track("no time at all", &["--time", "noon"]),
            track("a thirteenth month", &["--time", "2026-13-01T12:00:00Z"]),
            track("too late a year", &["--time", "3026-06-21T12:00:00Z"]),
            track(
                "backwards",
                &[
                    "--from",
                    "2026-06-21T12:00Z",
                    "--to",
                    "2026-06-21T11:00Z",
                    "--step",
                    "1min",
                ],
            ),
            any(
                "no offset in a table",
                &["predict", "--field", "field.toml", "--angles", "angles.csv"],
            )
            .and(
                "angles.csv",
                "time,id,axis1_deg,axis2_deg\n2026-06-21T12:00:00,A1,170,40\n",
            ),
        ],
    );
}

#[test]
fn steps() {
    let range = |step| {
        [
            "--from",
            "2026-06-21T11:00Z",
            "--to",
            "2026-06-21T12:00Z",
            "--step",
            step,
        ]
    };
    refused(
        "steps",
        vec![
            track("no unit", &range("10")),
            track("zero", &range("0s")),
            track("negative", &range("-10s")),
            track("days", &range("1d")),
            track("nonsense", &range("often")),
        ],
    );
}

#[test]
fn unwritable_outputs() {
    refused(
        "unwritable_outputs",
        vec![
            noon("no such folder", &["--out", "there/angles.csv"]),
            noon("a folder", &["--out", ".", "--format", "csv"]),
            noon("a file as a folder", &["--out", "field.toml/angles.csv"]),
            noon("the table that is read", &["--out", "heliostats.csv"]),
            noon(
                "the field that is read",
                &["--out", "field.toml", "--format", "csv"],
            ),
            noon("an unknown suffix", &["--out", "angles.xlsx"]),
            noon("an unknown format", &["--format", "xlsx"]),
            noon(
                "a plot in the place of the rows",
                &["--out", "f.svg", "--format", "csv", "--plot", "./f.svg"],
            ),
            noon("a plot in no folder", &["--plot", "there/field.svg"]),
            noon("a plot of another kind", &["--plot", "field.png"]),
        ],
    );
}

#[cfg(target_os = "linux")]
#[test]
fn full_outputs() {
    let range = [
        "--from",
        "2026-06-21T00:00Z",
        "--to",
        "2026-06-22T00:00Z",
        "--step",
        "1s",
    ];
    refused(
        "full_outputs",
        vec![
            noon("CSV", &["-q", "--out", "/dev/full"]),
            noon(
                "Parquet",
                &["-q", "--out", "/dev/full", "--format", "parquet"],
            ),
            noon("JSON", &["-q", "--out", "/dev/full", "--format", "json"]),
            noon(
                "JSON lines",
                &["-q", "--out", "/dev/full", "--format", "jsonl"],
            ),
            track(
                "many rows of CSV",
                &[&range[..], &["-q", "--out", "/dev/full"]].concat(),
            ),
            track(
                "many rows of Parquet",
                &[
                    &range[..],
                    &["-q", "--out", "/dev/full", "--format", "parquet"],
                ]
                .concat(),
            ),
        ],
    );
}

#[test]
fn options() {
    let range = ["--from", "2026-06-21T11:00Z", "--to", "2026-06-21T12:00Z"];
    refused(
        "options",
        vec![
            any("an unknown verb", &["trak", "--field", "field.toml"]),
            any("no field", &["track"]),
            track("an unknown option", &["--tiem", "2026-06-21T12:00Z"]),
            track("an azimuth alone", &["--sun-azimuth-deg", "180"]),
            track("a range without step", &range),
            track("a step without range", &["--step", "10s"]),
            noon(
                "a time and a range",
                &[&range[..], &["--step", "10s"]].concat(),
            ),
            track(
                "two kinds of suns",
                &[
                    "--suns",
                    "s.csv",
                    "--sun-azimuth-deg",
                    "180",
                    "--sun-elevation-deg",
                    "45",
                ],
            ),
            noon("a colour without plot", &["--plot-colour", "status"]),
            noon(
                "an unknown colour",
                &["--plot", "field.svg", "--plot-colour", "red"],
            ),
            any("no number of heliostats", &["simulate", "field"]),
            any(
                "a field of none",
                &["simulate", "field", "--heliostats", "0"],
            ),
        ],
    );
}

#[test]
fn unknown_names() {
    refused(
        "unknown_names",
        vec![
            toml(
                "a default target",
                "aim = \"receiver\"",
                "aim = \"reciever\"",
            ),
            with(
                "a target in the table",
                "heliostats.csv",
                "id,east_m,north_m,up_m,aim\nA1,0,100,3,receiver\nA2,9,100,3,tower\n",
            ),
            noon(
                "a heliostat of the plot",
                &["--plot", "f.svg", "--plot-heliostats", "A1,C7"],
            ),
            noon(
                "a heliostat that stands somewhere",
                &["--present", "present.csv"],
            )
            .and(
                "present.csv",
                "id,axis1_deg,axis2_deg\nA1,170,40\nA3,170,40\n",
            ),
            any(
                "a heliostat to predict",
                &["predict", "--field", "field.toml", "--angles", "angles.csv"],
            )
            .and("angles.csv", "id,axis1_deg,axis2_deg\nZ9,170,40\n"),
            toml_and("a foreign column", "[heliostats.columns]\nid = \"Name\"\n"),
        ],
    );
}

#[test]
fn offsets() {
    refused(
        "offsets",
        vec![
            noon("an unknown form", &["--offset", "fast"]),
            noon("no iterations", &["--offset", "iterated:0"]),
            noon(
                "a number of iterations that is none",
                &["--offset", "iterated:two"],
            ),
            noon("too many iterations", &["--offset", "iterated:1000"]),
        ],
    );
}

#[test]
fn things_that_do_not_fit() {
    let site = "[site]\nname = \"Test\"\nlatitude_deg = 37.4\nlongitude_deg = -6.25\n\
                elevation_m = 20.0\n";
    refused(
        "things_that_do_not_fit",
        vec![
            toml("a time without a site", site, ""),
            toml_and(
                "a polar mount by its azimuth",
                "mode = \"polar\"\naxis_azimuth_deg = 90.0\n",
            ),
            toml_and("a pitch-roll mount without", "mode = \"pitch-roll\"\n"),
            toml_and(
                "empty limits",
                "axis1_min_deg = 90.0\naxis1_max_deg = -90.0\n",
            ),
            toml_and("no heliostats without aim", "")
                .and("field.toml", FIELD.replace("aim = \"receiver\"\n", "")),
            noon("half a present position", &["--present", "present.csv"])
                .and("present.csv", "id,axis1_deg,axis2_deg\nA1,170,\n"),
            noon("a present position twice", &["--present", "present.csv"]).and(
                "present.csv",
                "id,axis1_deg,axis2_deg\nA1,170,40\nA1,171,40\n",
            ),
            noon(
                "present angles without a column",
                &["--present", "present.csv"],
            )
            .and("present.csv", "id,axis1_deg\nA1,170\n"),
            toml("no target's normal", "[0.0, 1.0, -0.3]", "[0.0, 0.0, 0.0]"),
            toml("half a plane", "width_m = 12.0\n", ""),
        ],
    );
}

#[test]
fn drives() {
    let predict = ["predict", "--field", "field.toml", "--angles", "angles.csv"];
    refused(
        "drives",
        vec![
            toml_and("no steps in a degree", &DRIVES.replace("1000.0", "0.0")),
            toml_and("no type", &DRIVES.replace("type = \"encoder\"\n", "")),
            toml_and("an unknown type", &DRIVES.replace("encoder", "hydraulic")),
            toml_and(
                "a number missing",
                "[heliostats.drive.axis1]\ntype = \"encoder\"\n",
            ),
            toml_and(
                "a screw that closes no triangle",
                "[heliostats.drive.axis2]\ntype = \"triangle\"\noffset_m = 0.3\npivot_radius_m = 0.3\n\
                 initial_stroke_length_m = 0.9\ninitial_angle_rad = 0.0\n\
                 increment_steps_per_m = 1000\nclockwise_axis_movement = 0\n",
            ),
            any("steps without a drive", &predict).and(
                "angles.csv",
                "id,axis1_steps,axis2_steps\nA1,170000,40000\n",
            ),
            any("neither angles nor steps", &predict).and("angles.csv", "id,time\nA1,\n"),
        ],
    );
}

#[test]
fn init_does_not_replace() {
    refused(
        "init_does_not_replace",
        vec![
            any("a field is there", &["init", "."]),
            any("a file has the folder's name", &["init", "heliostats.csv"]),
        ],
    );
}

const SEEN: &str = "heliostat_id,time,axis1_deg,axis2_deg,target,u_m,v_m,sigma_m\n\
                    A1,2026-06-21T12:00:00Z,170,40,receiver,0.5,-0.2,0.02\n\
                    A2,2026-06-21T12:00:00Z,171,41,receiver,0.1,0.2,0.02\n";

/// A spot by its components and as a point: on line 2 the same to a millimetre, on line 3 not.
const TWICE: &str = "id,time,axis1_deg,axis2_deg,u_m,v_m,spot_east_m,spot_north_m,spot_up_m\n\
                     A1,2026-06-21T12:00:00Z,170,40,0.5,-0.2,-0.5,0.057,120.192\n\
                     A2,2026-06-21T12:00:00Z,171,41,0.1,0.2,0.3,-0.057,119.808\n";

/// `calibrate` with these arguments and good observations.
fn calibrate<'a>(what: &'a str, more: &[&'a str]) -> Case<'a> {
    let args = [
        "calibrate",
        "--field",
        "field.toml",
        "--observations",
        "seen.csv",
    ];
    any(what, &[&args, more].concat()).and("seen.csv", SEEN)
}

/// `calibrate` with a piece of the observations replaced.
fn observed<'a>(what: &'a str, from: &str, to: &str) -> Case<'a> {
    assert!(SEEN.contains(from), "{from}");
    calibrate(what, &[]).and("seen.csv", SEEN.replacen(from, to, 1))
}

#[test]
fn observations() {
    refused(
        "observations",
        vec![
            any(
                "observations do not exist",
                &[
                    "calibrate",
                    "--field",
                    "field.toml",
                    "--observations",
                    "seen.csv",
                ],
            ),
            calibrate("observations are a folder", &[])
                .and("field.toml", FIELD)
                .args(&["calibrate", "--field", "field.toml", "--observations", "."]),
            observed("a heliostat not in the field", "A2,", "A22,"),
            observed("a target that nobody knows", "receiver", "reciever"),
            observed("no number", ",0.5,", ",NaN,"),
            observed("infinite", ",0.5,", ",-inf,"),
            observed("text for a number", ",170,", ",south,"),
            observed("steps for degrees", ",170,", ",170000,"),
            observed("a time without an offset", "12:00:00Z", "12:00:00"),
            observed("a ragged row", ",0.2,0.02", ",0.2"),
            observed("a sigma of zero", "0.02", "0"),
            calibrate("a sigma for some only", &[]).and(
                "seen.csv",
                format!("{SEEN}A1,2026-06-21T13:00:00Z,175,40,receiver,0.5,-0.2,\n"),
            ),
            calibrate("two spots that differ", &[]).and("seen.csv", TWICE),
            observed("a column too many", "sigma_m", "noise"),
            observed("a column too few", "axis2_deg", "record_id"),
            observed("sun azimuths from south", "time", "sun_azimuth_south_deg"),
            observed("only at night", "T12:00:00Z,170", "T02:00:00Z,170")
                .and("seen.csv", SEEN.replace("T12", "T02")),
            toml_and(
                "an unknown key of [observations]",
                "[observations]\ncolumn = 1\n",
            ),
        ],
    );
}

#[test]
fn calibration_options() {
    refused(
        "calibration_options",
        vec![
            calibrate("an unknown solver", &["--solver", "levenberg"]),
            calibrate("an unknown residual", &["--residual", "angle"]),
            calibrate("an unknown loss", &["--robust", "tukey"]),
            calibrate("sets", &["--sets", "3"]),
            calibrate("an unknown parameter to hold", &["--hold", "tilt"]),
            calibrate(
                "everything held",
                &[
                    "--hold",
                    "pedestal_tilt,axis_nonorthogonality,mirror_tilt,azimuth_reference,elevation_reference",
                ],
            ),
            calibrate(
                "held and fitted",
                &["--fit-mirror-offset", "--hold", "mirror_offset"],
            ),
            calibrate("a prior without a mean", &["--prior", "mirror_tilt=0.1"]),
            calibrate("a prior of nothing", &["--prior", "0:0.1"]),
            calibrate("a prior without width", &["--prior", "mirror_tilt=0:0"]),
            calibrate(
                "a prior that is no number",
                &["--prior", "mirror_tilt=0:NaN"],
            ),
            calibrate("a tilt known to lean", &["--prior", "pedestal_tilt=1:0.1"]),
            calibrate(
                "a prior of what is held",
                &["--hold", "mirror_tilt", "--prior", "mirror_tilt=0:0.1"],
            ),
            calibrate(
                "two priors of one parameter",
                &[
                    "--prior",
                    "mirror_tilt_deg=0:0.1",
                    "--prior",
                    "mirror_tilt=1:0.1",
                ],
            ),
            calibrate("two tables in one stream", &["--rejected", "-"]),
            calibrate(
                "two tables in one stream by another name",
                &["--out", "-", "--rejected", "/dev/stdout"],
            ),
            calibrate(
                "rejected records and proposals in one stream",
                &[
                    "--plan",
                    "3",
                    "--plan-date",
                    "2026-06-21",
                    "--out",
                    "c.csv",
                    "--rejected",
                    "-",
                    "--plan-out",
                    "-",
                ],
            ),
            calibrate("resume without a file", &["--resume"]),
            calibrate("a report of another kind", &["--report", "page.pdf"]),
            calibrate(
                "one file for two",
                &["--out", "c.csv", "--rejected", "c.csv"],
            ),
            // These are refused before anything is fitted; the observations are too few for that.
            calibrate("an output in no folder", &["--out", "no/c.csv"]),
            calibrate(
                "an output that is a folder",
                &["--out", ".", "--format", "csv"],
            ),
            calibrate("rejected records in no folder", &["--rejected", "no/r.csv"]),
            calibrate("rejected records for a folder", &["--rejected", "."]),
            calibrate(
                "rejected records of another kind",
                &["--rejected", "r.xlsx"],
            ),
            calibrate(
                "a plan in no folder",
                &[
                    "--plan",
                    "3",
                    "--plan-date",
                    "2026-06-21",
                    "--plan-out",
                    "no/p.csv",
                ],
            ),
            calibrate(
                "a plan for a folder",
                &[
                    "--plan",
                    "3",
                    "--plan-date",
                    "2026-06-21",
                    "--plan-out",
                    ".",
                ],
            ),
            calibrate("a report in no folder", &["--report", "no/page.html"]),
            calibrate("a report below a file", &["--report", "seen.csv/page.html"]),
            calibrate("observations replaced", &["--out", "seen.csv"]),
            calibrate("the field replaced", &["--rejected", "heliostats.csv"]),
            calibrate("an unknown suffix", &["--out", "c.xlsx"]),
            calibrate("a plan without a day", &["--plan", "3"]),
            calibrate(
                "a plan for no day",
                &["--plan", "3", "--plan-date", "tomorrow"],
            ),
            calibrate("no earlier calibration", &["--compare", "old.csv"]),
            calibrate(
                "an earlier calibration that is none",
                &["--compare", "seen.csv"],
            ),
            calibrate(
                "an earlier calibration by the hour without a place",
                &["--compare", "old.csv"],
            )
            .and(
                "field.toml",
                FIELD
                    .split_once("[targets")
                    .map_or("", |(_, rest)| rest)
                    .replacen(".receiver", "[targets.receiver", 1),
            )
            .and(
                "old.csv",
                "id,set,mirror_tilt_deg,hour_angle_to_deg\nA1,morning,0.1,0\n",
            ),
            calibrate("finished parts of something else", &["--out", "c.csv"])
                .and("c.csv.part", "id,set\n"),
            calibrate(
                "finished parts that are none",
                &["--out", "c.csv", "--resume"],
            )
            .and("c.csv.part", "id,set\n"),
            any(
                "simulated hours",
                &[
                    "simulate",
                    "observations",
                    "--field",
                    "field.toml",
                    "--hours",
                    "15-9",
                ],
            ),
            any(
                "a simulated jump",
                &[
                    "simulate",
                    "observations",
                    "--field",
                    "field.toml",
                    "--jump",
                    "2026-01-01,1",
                ],
            ),
            any(
                "an unknown heliostat",
                &[
                    "simulate",
                    "observations",
                    "--field",
                    "field.toml",
                    "--ids",
                    "A9",
                ],
            ),
            any(
                "an unknown target",
                &[
                    "simulate",
                    "observations",
                    "--field",
                    "field.toml",
                    "--target",
                    "white",
                ],
            ),
            any(
                "no sun that high",
                &[
                    "simulate",
                    "observations",
                    "--field",
                    "field.toml",
                    "--min-sun-elevation-deg",
                    "85",
                ],
            ),
        ],
    );
}
