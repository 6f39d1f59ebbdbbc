//! The schema and the parser know the same keys.

use serde_json::Value;

use crate::files::Folder;

/// Every key of `field.toml`, used once.
const EVERYTHING: &str = r#"
[site]
name = "Test"
latitude_deg = 40.0
longitude_deg = 94.4
elevation_m = 1100
pressure_hpa = 890
temperature_c = 9.5
delta_t_s = 69.2
ut1_utc_s = 0.1

[targets.receiver]
centre_enu_m = [0.0, 0.0, 100.0]
normal_enu = [0, 1, 0]
width_m = 8
height_m = 6
right_enu = [-1, 0, 0.01]

[heliostats]
table = "layout.csv"
aim = "receiver"
calibration = "cal.csv"
drives = "drives.csv"
blend_deg = 4
ignore = ["note"]
up_offset_m = 1
mode = "pitch-roll"
axis_azimuth_deg = 90
mirror_offset_m = 0.1
pedestal_tilt_deg = 0.1
pedestal_tilt_azimuth_deg = 0.1
axis_nonorthogonality_deg = 0.1
mirror_tilt_deg = 0.1
azimuth_reference_deg = 0.1
elevation_reference_deg = 0.1
axis1_sag_deg = 0.1
axis2_sag_deg = 0.1
axis2_eccentricity_deg = 0.1
axis1_min_deg = -1000
axis1_max_deg = 1000
axis2_min_deg = -1000
axis2_max_deg = 1000

[heliostats.columns]
id = "Name"
east_m = "X"

[heliostats.drive.axis1]
sign = -1
[heliostats.drive.axis2]
type = "encoder"
steps_per_deg = 10
"#;

#[test]
fn a_file_of_everything_loads_and_fits_the_schema() {
    let loaded = Folder::new()
        .with("field.toml", EVERYTHING)
        .with("layout.csv", "Name,X,north_m,up_m,note\nA1,1,2,3,x\n")
        .with("cal.csv", "id,mirror_tilt_deg\nA1,0.2\n")
        .with("drives.csv", "id,axis,type,steps_per_deg\nA1,1,encoder,5\n")
        .load()
        .unwrap();
    assert_eq!(loaded.field.heliostats()[0].pivot.up, 4.0);
    let site = loaded.site.as_ref().unwrap();
    let weather = (
        site.pressure_hpa,
        site.temperature_c,
        site.delta_t_s,
        site.ut1_utc_s,
    );
    assert_eq!(weather, (Some(890.0), Some(9.5), Some(69.2), Some(0.1)));
    assert_eq!(loaded.files.len(), 4);
    let schema = helio_io::schema();
    let document = toml_edit::Document::parse(EVERYTHING).unwrap();
    fits(document.as_table(), &schema, "");
    // And nothing of [site], [targets], [heliostats] that EVERYTHING forgets.
    for (section, table) in [
        ("site", &schema["properties"]["site"]),
        (
            "targets.receiver",
            &schema["properties"]["targets"]["additionalProperties"],
        ),
        ("heliostats", &schema["properties"]["heliostats"]),
    ] {
        let mut item = document.as_item();
        for part in section.split('.') {
            item = &item[part];
        }
        for key in table["properties"].as_object().unwrap().keys() {
            assert!(
                item.get(key).is_some(),
                "{section}.{key} is in the schema, not in the test"
            );
        }
    }
}

/// Every key of a table stands in the schema.
fn fits(table: &dyn toml_edit::TableLike, schema: &Value, path: &str) {
    for (name, item) in table.iter() {
        let known = &schema["properties"][name];
        let known = if known.is_null() {
            &schema["additionalProperties"]
        } else {
            known
        };
        assert!(known.is_object(), "{path}.{name} is not in the schema");
        if let Some(inner) = item.as_table_like() {
            fits(inner, known, &format!("{path}.{name}"));
        }
    }
}

#[test]
fn the_parser_knows_every_key_of_the_schema_and_no_other() {
    fn walk(schema: &Value, path: &[String], found: &mut Vec<(Vec<String>, Value)>) {
        if let Some(properties) = schema["properties"].as_object() {
            for (name, property) in properties {
                let mut path = path.to_vec();
                path.push(name.clone());
                found.push((path.clone(), property.clone()));
                walk(property, &path, found);
            }
        }
        if schema["additionalProperties"].is_object() {
            let mut path = path.to_vec();
            path.push("some".into());
            walk(&schema["additionalProperties"], &path, found);
        }
    }
    let mut keys = Vec::new();
    walk(&helio_io::schema(), &[], &mut keys);
    assert!(keys.len() > 80, "{}", keys.len());
    let message = |path: &[String], value: &str| {
        let mut toml = format!("{} = {value}\n", path.join("."));
        if path[0] != "heliostats" || path.len() > 2 {
            toml += "heliostats.table = \"layout.csv\"\n";
        }
        let error = Folder::of_field()
            .with("field.toml", toml)
            .load()
            .unwrap_err();
        error.to_string()
    };
    for (path, property) in &keys {
        // A value that fits no key or a table that is empty: whatever is wrong with it, not its name.
        let value = if property["type"] == "object" {
            "{}"
        } else {
            "1979-05-27"
        };
        let known = message(path, value);
        assert!(!known.contains("unknown"), "{path:?}: {known}");
        let mut wrong = path.clone();
        wrong.last_mut().unwrap().push_str("_wrong");
        if wrong.first().is_some_and(|first| first == "targets") && wrong.len() == 2 {
            continue;
        }
        let unknown = message(&wrong, value);
        assert!(unknown.contains("unknown"), "{wrong:?}: {unknown}");
        assert!(
            property["description"]
                .as_str()
                .is_some_and(|text| text.len() > 4)
                || path.iter().any(|part| part == "columns"),
            "{path:?}"
        );
    }
}
