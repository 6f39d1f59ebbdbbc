//! Every message of a bad input, as people see it.

use std::fmt::Write as _;
use std::sync::Arc;

use arrow::array::{Int64Array, TimestampNanosecondArray};
use helio_io::{IoError, TimeRange, load_angles, load_present, load_suns, parse_step, parse_time};

use crate::files::{FIELD, Folder, LAYOUT, floats, texts};

/// Messages of one group, in order.
#[derive(Default)]
struct Messages(String);

impl Messages {
    fn add<T>(&mut self, title: &str, folder: &Folder, result: Result<T, IoError>) {
        let Err(error) = result else {
            panic!("{title}: was accepted");
        };
        let message = folder.redact(&error);
        writeln!(self.0, "# {title}\n{message}\n").unwrap();
    }

    fn field(&mut self, title: &str, folder: Folder) {
        let result = folder.load();
        self.add(title, &folder, result);
    }

    /// The field with edits and more text behind it.
    fn toml(&mut self, title: &str, edits: &[(&str, &str)], more: &str) {
        self.field(title, Folder::of_field().edited(edits, more));
    }

    /// The field with another layout.
    fn layout(&mut self, title: &str, layout: impl AsRef<[u8]>) {
        self.field(title, Folder::of_field().with("layout.csv", layout));
    }

    fn show(self, name: &str) {
        let mut settings = insta::Settings::clone_current();
        settings.set_snapshot_path("../snapshots");
        settings.set_prepend_module_to_snapshot(false);
        settings.set_omit_expression(true);
        settings.bind(|| insta::assert_snapshot!(name, self.0));
    }
}

#[test]
fn toml_syntax_and_files() {
    let mut m = Messages::default();
    m.field("missing file", Folder::new());
    let folder = Folder::new();
    std::fs::create_dir(folder.path("field.toml")).unwrap();
    m.field("folder instead of a file", folder);
    m.field("empty file", Folder::new().with("field.toml", ""));
    m.field(
        "not UTF-8",
        Folder::new().with("field.toml", b"[site]\nname = \"J\xFClich\"\n"),
    );
    m.field(
        "UTF-16",
        Folder::new().with("field.toml", b"\xFF\xFE[\0s\0i\0"),
    );
    m.toml(
        "broken: no value",
        &[("latitude_deg = 40.0", "latitude_deg =")],
        "",
    );
    m.toml("broken: no closing quote", &[("\"Test\"", "\"Test")], "");
    m.toml(
        "broken: no closing bracket",
        &[("[0.0, 0.0, 100.0]", "[0.0, 0.0, 100.0")],
        "",
    );
    m.toml(
        "broken: key twice",
        &[("longitude_deg", "latitude_deg")],
        "",
    );
    m.toml("broken: table twice", &[], "[site]\n");
    m.toml("broken: decimal comma", &[("40.0", "40,0")], "");
    m.toml("no heliostats", &[("[heliostats]", "[other]")], "");
    m.field(
        "no heliostats at all",
        Folder::new().with("field.toml", "[targets]\n"),
    );
    m.show("toml_syntax_and_files");
}

#[test]
fn toml_keys_and_values() {
    let mut m = Messages::default();
    m.toml("unknown table", &[("[site]", "[sight]")], "");
    m.toml(
        "unknown key, nearly right",
        &[("latitude_deg", "lattitude_deg")],
        "",
    );
    m.toml(
        "unknown key, unit forgotten",
        &[("longitude_deg", "longitude")],
        "",
    );
    m.toml(
        "unknown key, nothing near",
        &[("longitude_deg = 94.4", "colour = \"blue\"")],
        "",
    );
    let huge = format!("{} = 1", "k".repeat(5000));
    m.toml("unknown key, huge", &[("longitude_deg = 94.4", &huge)], "");
    m.toml("missing key", &[("longitude_deg = 94.4\n", "")], "");
    m.toml("missing table key", &[("table = \"layout.csv\"\n", "")], "");
    m.toml("text for a number", &[("40.0", "\"40 N\"")], "");
    m.toml("number for text", &[("\"Test\"", "5")], "");
    m.toml("truth for a number", &[("1100", "true")], "");
    m.toml("table for a number", &[("1100", "{ m = 1100 }")], "");
    m.toml(
        "number for a table",
        &[("[site]", "site = 5\n[targets.s]\ncentre_enu_m=[0,0,0]\n#")],
        "",
    );
    m.toml("latitude out of range", &[("40.0", "140.0")], "");
    m.toml("longitude out of range", &[("94.4", "-265.6")], "");
    m.toml("tilt out of range", &[], "pedestal_tilt_deg = 200\n");
    m.toml("mirror tilt out of range", &[], "mirror_tilt_deg = -85\n");
    m.toml("sag out of range", &[], "axis2_sag_deg = 3\n");
    m.toml(
        "eccentricity out of range",
        &[],
        "axis2_eccentricity_deg = -3\n",
    );
    m.toml("NaN", &[("40.0", "nan")], "");
    m.toml("infinity", &[("1100", "-inf")], "");
    m.toml(
        "pressure in pascals",
        &[(
            "elevation_m = 1100",
            "elevation_m = 1100\npressure_hpa = 101325",
        )],
        "",
    );
    m.toml(
        "limits the wrong way round",
        &[],
        "axis1_min_deg = 90\naxis1_max_deg = -90\n",
    );
    m.show("toml_keys_and_values");
}

#[test]
fn toml_targets_and_references() {
    let mut m = Messages::default();
    m.toml(
        "point of two numbers",
        &[("[0.0, 0.0, 100.0]", "[0.0, 100.0]")],
        "",
    );
    m.toml(
        "point with text",
        &[("[0.0, 0.0, 100.0]", "[0.0, \"up\", 100.0]")],
        "",
    );
    m.toml(
        "point with infinity",
        &[("[0.0, 0.0, 100.0]", "[0.0, inf, 100.0]")],
        "",
    );
    m.toml(
        "point in millimetres",
        &[("[0.0, 0.0, 100.0]", "[0.0, 0.0, 1e8]")],
        "",
    );
    m.toml(
        "normal without length",
        &[("[0.0, 1.0, 0.0]", "[0.0, 0.0, 0.0]")],
        "",
    );
    m.toml(
        "width without normal",
        &[("normal_enu = [0.0, 1.0, 0.0]\n", "")],
        "",
    );
    m.toml("plane without height", &[("height_m = 6.0\n", "")], "");
    m.toml(
        "right along the normal",
        &[("height_m = 6.0", "height_m = 6.0\nright_enu = [0, 2, 0]")],
        "",
    );
    let huge = format!("[targets.{}]", "t".repeat(300));
    m.toml("huge target name", &[("[targets.white]", &huge)], "");
    m.toml(
        "unknown target, nearly right",
        &[("\"receiver\"", "\"reciever\"")],
        "",
    );
    m.toml(
        "unknown target, nothing near",
        &[("\"receiver\"", "\"moon\"")],
        "",
    );
    m.toml("unknown mode", &[], "mode = \"azimuth_elevation\"\n");
    m.toml("unknown mode, nothing near", &[], "mode = \"dish\"\n");
    m.toml(
        "pitch-roll without its axis",
        &[],
        "mode = \"pitch-roll\"\n",
    );
    m.toml(
        "axis azimuth for another mode",
        &[],
        "axis_azimuth_deg = 90\n",
    );
    let no_site = FIELD.split_once("[targets.receiver]").unwrap().0;
    m.toml(
        "polar without a site",
        &[(no_site, "")],
        "mode = \"polar\"\n",
    );
    m.toml("table does not exist", &[("layout.csv", "layouts.csv")], "");
    m.toml("table is a folder", &[("layout.csv", ".")], "");
    m.toml(
        "calibration does not exist",
        &[],
        "calibration = \"none.csv\"\n",
    );
    m.show("toml_targets_and_references");
}

#[test]
fn foreign_columns() {
    let mut m = Messages::default();
    m.toml(
        "our name unknown",
        &[],
        "[heliostats.columns]\neast = \"X\"\n",
    );
    m.toml(
        "their name unknown",
        &[],
        "[heliostats.columns]\neast_m = \"East_m\"\n",
    );
    m.toml(
        "their name a number",
        &[],
        "[heliostats.columns]\neast_m = 2\n",
    );
    m.toml(
        "ignored column unknown",
        &[],
        "ignore = [\"Focal Length\"]\n",
    );
    m.toml("ignore is no list", &[], "ignore = \"x\"\n");
    let columns = "[heliostats.columns]\neast_m = \"id\"\nnorth_m = \"id\"\n";
    m.toml("one column for two", &[], columns);
    let folder = || Folder::of_field().with("layout.csv", "id,east_m,X,north_m,up_m\nA,1,2,3,4\n");
    let columns = "[heliostats.columns]\neast_m = \"X\"\n";
    m.field("two columns for one", folder().edited(&[], columns));
    m.field("column left over", folder());
    m.field(
        "value of a renamed column",
        Folder::of_field()
            .with("layout.csv", "id,X,north_m,up_m\nA,far,3,4\n")
            .edited(&[], columns),
    );
    m.show("foreign_columns");
}

#[test]
fn heliostat_tables() {
    let mut m = Messages::default();
    m.layout("empty file", "");
    m.layout("header only", "id,east_m,north_m,up_m\n");
    m.layout(
        "ragged row, short",
        LAYOUT.replace("A2,20,80,4", "A2,20,80"),
    );
    m.layout(
        "ragged row, long, after a blank line",
        LAYOUT.replace("A2,20,80,4", "\n\nA2,20,80,4,5"),
    );
    m.layout("semicolons", LAYOUT.replace(',', ";"));
    m.layout("unknown column", LAYOUT.replace("east_m", "easting"));
    m.layout("unit forgotten", LAYOUT.replace("up_m", "up"));
    m.layout("missing column", "id,east_m,north_m\nA1,1,2\n");
    m.layout("column twice", LAYOUT.replace("north_m", "east_m"));
    m.layout(
        "column without a name",
        ",id,east_m,north_m,up_m\n0,A1,1,2,3\n",
    );
    m.layout(
        "huge column name",
        LAYOUT.replace("up_m", &"u".repeat(10_000)),
    );
    m.layout(
        "not UTF-8",
        b"id,east_m,north_m,up_m\nA1,1,2,3\nH\xF6he,1,2,3\n",
    );
    m.layout("text for a number", LAYOUT.replace("20", "twenty"));
    m.layout("empty cell that must be there", LAYOUT.replace("20", ""));
    m.layout("NaN", LAYOUT.replace("4.5", "NaN"));
    m.layout("infinity", LAYOUT.replace("30", "-inf"));
    m.layout("out of range", LAYOUT.replace("30", "3e9"));
    m.layout("duplicate id", LAYOUT.replace("A3", "A1"));
    m.layout("empty id", LAYOUT.replace("A2", "  "));
    m.layout("huge id", LAYOUT.replace("A2", &"A".repeat(257)));
    m.layout("id with a line end", LAYOUT.replace("A2", "\"A\n2\""));
    m.layout(
        "row after a cell of two lines",
        LAYOUT.replace("A2,20", "\"A\n2\",x"),
    );
    m.layout(
        "unknown target",
        "id,east_m,north_m,up_m,aim\nA1,1,2,3,whit\n",
    );
    m.layout(
        "aim point lacks a part",
        "id,east_m,north_m,up_m,aim_east_m,aim_north_m,aim_up_m\nA1,1,2,3,4,,6\n",
    );
    m.layout(
        "two aims",
        "id,east_m,north_m,up_m,aim,aim_east_m,aim_north_m,aim_up_m\nA1,1,2,3,white,4,5,6\n",
    );
    m.field(
        "no aim",
        Folder::of_field().edited(&[("aim = \"receiver\"\n", "")], ""),
    );
    m.layout(
        "error out of range",
        "id,east_m,north_m,up_m,mirror_tilt_deg\nA1,1,2,3,95\n",
    );
    m.layout(
        "limits against the default",
        "id,east_m,north_m,up_m,axis2_min_deg,axis2_max_deg\nA1,1,2,3,20,10\n",
    );
    m.layout(
        "Parquet by its beginning only",
        b"PAR1 and then something else",
    );
    let named = |contents: &[u8]| {
        let edit = [("layout.csv", "layout.parquet")];
        Folder::of_field()
            .edited(&edit, "")
            .with("layout.parquet", contents)
    };
    m.field("Parquet by its name only", named(LAYOUT.as_bytes()));
    let parquet = |up: arrow::array::ArrayRef, id: arrow::array::ArrayRef| {
        let columns = vec![
            ("id", id),
            ("east_m", floats(&[1.0, 2.0])),
            ("north_m", floats(&[1.0, 2.0])),
            ("up_m", up),
        ];
        Folder::of_field()
            .edited(&[("layout.csv", "layout.parquet")], "")
            .with_parquet("layout.parquet", columns)
    };
    let ids = || texts(&["A1", "A2"]);
    m.field("Parquet: NaN", parquet(floats(&[1.0, f64::NAN]), ids()));
    m.field(
        "Parquet: duplicate id",
        parquet(floats(&[1.0, 2.0]), texts(&["A1", "A1"])),
    );
    m.field(
        "Parquet: text for a number",
        parquet(texts(&["1", "2"]), ids()),
    );
    m.field(
        "Parquet: null",
        parquet(Arc::new(Int64Array::from(vec![Some(1), None])), ids()),
    );
    m.field(
        "Parquet: fractional id",
        parquet(floats(&[1.0, 2.0]), floats(&[1.0, 2.0])),
    );
    m.field(
        "Parquet: no rows",
        Folder::of_field()
            .edited(&[("layout.csv", "layout.parquet")], "")
            .with_parquet(
                "layout.parquet",
                vec![("id", texts(&[])), ("east_m", floats(&[]))],
            ),
    );
    m.show("heliostat_tables");
}

#[test]
fn drives() {
    let mut m = Messages::default();
    let axis = |text: &str| format!("[heliostats.drive.axis1]\n{text}\n");
    m.toml("no type", &[], &axis("steps_per_deg = 1000"));
    m.toml("unknown type", &[], &axis("type = \"encodr\""));
    m.toml(
        "unknown axis",
        &[],
        "[heliostats.drive.axis3]\ntype = \"encoder\"\n",
    );
    m.toml("missing number", &[], &axis("type = \"encoder\""));
    m.toml(
        "number of another type",
        &[],
        &axis("type = \"encoder\"\nsteps_per_deg = 1\narm_a_m = 1"),
    );
    m.toml(
        "sign 2",
        &[],
        &axis("type = \"encoder\"\nsteps_per_deg = 1\nsign = 2"),
    );
    m.toml(
        "ratio zero",
        &[],
        &axis("type = \"encoder\"\nsteps_per_deg = 0"),
    );
    m.toml(
        "empty range",
        &[],
        &axis("type = \"encoder\"\nsteps_per_deg = 1\nmin_steps = 5\nmax_steps = 5"),
    );
    let triangle = "type = \"triangle\"\noffset_m = 0.3\npivot_radius_m = 0.3\ninitial_angle_rad = 0\n\
        initial_stroke_length_m = 0.8\nincrement_steps_per_m = 1000\nclockwise_axis_movement = true";
    m.toml("triangle does not close", &[], &axis(triangle));
    let encoder = "type = \"encoder\"\nsteps_per_deg = 1\nmin_steps = 10\nmax_steps = 20";
    m.toml(
        "out of the drive's reach",
        &[],
        &format!("axis1_max_deg = 5\n{}", axis(encoder)),
    );
    let screw = "type = \"screw\"\narm_a_m = 0.4\narm_b_m = 0.5\nbracket_deg = 17\nmin_steps = 0\n";
    m.toml(
        "screw without steps in a metre",
        &[],
        &axis(&format!("{screw}zero_length_m = 0.2")),
    );
    m.toml(
        "screw in millimetres",
        &[],
        &axis(&format!("{screw}zero_length_m = 200\nsteps_per_m = 1000")),
    );
    m.toml(
        "triangle that its steps never close",
        &[],
        &axis(&triangle.replace("0.8", "0.5"))
            .replace("clock", "max_increment_steps = -600\nclock"),
    );
    m.toml(
        "stops apart from the steps",
        &[],
        &axis(&triangle.replace("0.8", "0.3")).replace(
            "clock",
            "min_increment_steps = 0\nmax_increment_steps = 100\nmin_movement_angle_rad = 2\nclock",
        ),
    );
    m.toml("one stop of axis 2", &[], "axis2_min_deg = 0\n");
    m.toml("the other stop of axis 2", &[], "axis2_max_deg = 90\n");
    m.field(
        "one stop of axis 2 in a row",
        Folder::of_field().edited(&[], "axis2_min_deg = 0\n").with(
            "layout.csv",
            "id,east_m,north_m,up_m,axis2_max_deg\nA1,10,80,4,90\nA2,20,80,4,\n",
        ),
    );
    let table = |text: &str| {
        Folder::of_field()
            .edited(&[], "drives = \"drives.csv\"\n")
            .with("drives.csv", text)
    };
    m.field(
        "drives: unknown column",
        table("id,axis,type,steps_per_degree\nA1,1,encoder,5\n"),
    );
    m.field(
        "drives: axis 3",
        table("id,axis,type,steps_per_deg\nA1,3,encoder,5\n"),
    );
    m.field(
        "drives: unknown type",
        table("id,axis,type,steps_per_deg\nA1,1,hydraulic,5\n"),
    );
    m.field("drives: no type", table("id,axis,steps_per_deg\nA1,1,5\n"));
    m.field(
        "drives: number of another type",
        table("id,axis,type,steps_per_deg,arm_a_m\nA1,1,encoder,5,1\n"),
    );
    m.field(
        "drives: row twice",
        table("id,axis,type,steps_per_deg\nA1,1,encoder,5\nA1,1,encoder,5\n"),
    );
    m.field(
        "drives: a heliostat without a row",
        table("id,axis,type,steps_per_deg\nA1,1,encoder,5\nA3,1,encoder,5\n"),
    );
    m.field(
        "drives: nobody of this field",
        table("id,axis,type,steps_per_deg\nZ,1,encoder,5\n"),
    );
    m.field("drives: stops the wrong way round", table(
        "heliostat,axis,type,clockwise_axis_movement,increment_steps_per_m,offset_m,pivot_radius_m,\
        initial_stroke_length_m,initial_angle_rad,min_movement_angle_rad,max_movement_angle_rad\n\
        A1,1,linear,0,1000,0.3,0.3,0.1,0,1,0\n"));
    m.show("drives");
}

#[test]
fn calibrations() {
    let mut m = Messages::default();
    let table = |text: &str| {
        Folder::of_field()
            .edited(&[], "calibration = \"cal.csv\"\n")
            .with("cal.csv", text)
    };
    m.field("unknown column", table("id,mirror_tilt\nA1,0.1\n"));
    m.field("no errors", table("id,set\nA1,1\n"));
    m.field("out of range", table("id,mirror_tilt_deg\nA1,90\n"));
    m.field("twice", table("id,mirror_tilt_deg\nA1,0.1\nA1,0.2\n"));
    m.field(
        "set twice",
        table("id,set,mirror_tilt_deg\nA1,am,0.1\nA1,am,0.2\n"),
    );
    m.field(
        "sets both valid",
        table("id,set,mirror_tilt_deg\nA1,am,0.1\nA1,pm,0.2\n"),
    );
    m.field("hours overlap", table(
        "id,set,mirror_tilt_deg,hour_angle_from_deg,hour_angle_to_deg\nA1,am,0.1,,20\nA1,pm,0.2,-20,\n"));
    m.field(
        "hours backward",
        table("id,mirror_tilt_deg,hour_angle_from_deg,hour_angle_to_deg\nA1,0.1,20,-20\n"),
    );
    m.field(
        "time without an offset",
        table("id,mirror_tilt_deg,valid_from\nA1,0.1,2026-01-01T00:00:00\n"),
    );
    m.field(
        "dates backward",
        table(
            "id,mirror_tilt_deg,valid_from,valid_to\nA1,0.1,2026-01-02T00:00Z,2026-01-01T00:00Z\n",
        ),
    );
    m.field(
        "nobody of this field",
        table("id,mirror_tilt_deg\nB1,0.1\n"),
    );
    let times = Arc::new(TimestampNanosecondArray::from(vec![0]));
    let columns = vec![
        ("id", texts(&["A1"])),
        ("mirror_tilt_deg", floats(&[0.1])),
        ("valid_from", times as _),
    ];
    m.field(
        "Parquet: time without an offset",
        Folder::of_field()
            .edited(&[], "calibration = \"cal.parquet\"\n")
            .with_parquet("cal.parquet", columns),
    );
    m.show("calibrations");
}

#[test]
fn small_tables() {
    let mut m = Messages::default();
    let mut suns = |title: &str, text: &str| {
        let folder = Folder::new().with("suns.csv", text);
        let result = load_suns(&folder.path("suns.csv"));
        m.add(title, &folder, result);
    };
    suns(
        "suns: azimuth from south",
        "sun_azimuth_south_deg,sun_elevation_deg\n10,20\n",
    );
    suns(
        "suns: elevation out of range",
        "azimuth_deg,elevation_deg\n10,20\n10,95\n",
    );
    suns("suns: missing column", "azimuth_deg\n10\n");
    suns(
        "suns: both names",
        "azimuth_deg,sun_azimuth_deg,elevation_deg\n1,2,3\n",
    );
    suns("suns: empty cell", "azimuth_deg,elevation_deg\n10,\n");
    let loaded = Folder::of_field().load().unwrap();
    let mut present = |title: &str, text: &str| {
        let folder = Folder::new().with("now.csv", text);
        let result = load_present(&folder.path("now.csv"), &loaded.field);
        m.add(title, &folder, result);
    };
    present(
        "present: unknown heliostat",
        "id,axis1_deg,axis2_deg\nA11,1,2\n",
    );
    present("present: one angle only", "id,axis1_deg,axis2_deg\nA1,1,\n");
    present("present: missing column", "id,axis1_deg\nA1,1\n");
    present(
        "present: id twice",
        "id,azimuth_deg,elevation_deg\nA1,1,2\nA1,1,2\n",
    );
    present("present: JSON", "[{\"id\": \"A1\"}]\n");
    present("present: JSON lines", "{\"id\": \"A1\"}\n");
    let mut angles = |title: &str, text: &str| {
        let folder = Folder::new().with("angles.csv", text);
        let result = load_angles(&folder.path("angles.csv"), &loaded);
        m.add(title, &folder, result);
    };
    angles("angles: none", "id\nA1\n");
    angles("angles: empty", "id,azimuth_deg,elevation_deg\nA1,,\n");
    angles(
        "angles: steps without a drive",
        "id,axis1_steps,axis2_steps\nA1,1,2\n",
    );
    angles(
        "angles: one sun angle",
        "id,axis1_deg,axis2_deg,sun_azimuth_deg\nA1,1,2,3\n",
    );
    angles(
        "angles: time without an offset",
        "id,axis1_deg,axis2_deg,time\nA1,1,2,2026-06-21 12:00\n",
    );
    angles(
        "angles: no time",
        "id,axis1_deg,axis2_deg,time\nA1,1,2,2026-06-21T12:00Z\nA2,1,2,\n",
    );
    m.show("small_tables");
}

#[test]
fn times() {
    let mut m = Messages::default();
    let folder = Folder::new();
    for text in [
        "2026-06-21T12:00:00",
        "2026-06-21 12:00",
        "2026-06-21",
        "noon",
        "",
        "2026-02-30T12:00:00Z",
        "2026-06-21T12:00:00+99:00",
        "1600-01-01T00:00:00Z",
        "1782043200",
    ] {
        m.add(&format!("time {text:?}"), &folder, parse_time(text));
    }
    for text in ["10", "ten seconds", "-10s", "0s", "1 day", "99999999999h"] {
        m.add(&format!("step {text:?}"), &folder, parse_step(text));
    }
    m.add(
        "range backward",
        &folder,
        TimeRange::parse("2026-06-21T12:00Z", "2026-06-21T11:00Z", "10s"),
    );
    m.show("times");
}
