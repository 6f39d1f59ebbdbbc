//! JSON Schema of `field.toml`, `target.toml` and `scene.toml`.

use serde_json::{Map, Value, json};

use crate::keys::{self, Key, Kind};

/// JSON Schema (draft 2020-12) of `field.toml`, for editors that complete and check TOML by one.
///
/// It is made from the same list of keys that the parser asks, so that both know the same names.
///
/// ```
/// let schema = helio_io::schema();
/// let latitude = &schema["properties"]["site"]["properties"]["latitude_deg"];
/// assert_eq!(latitude["maximum"], 90.0);
/// ```
#[must_use]
pub fn schema() -> Value {
    of_file(
        keys::FILE,
        "field.toml of helio-rs",
        "A heliostat field: where it lies, what can be aimed at, and its heliostats. \
         Metres east, north, up; degrees clockwise from north and up from the horizon.",
    )
}

/// The same of `target.toml`.
///
/// ```
/// let schema = helio_io::target_schema();
/// assert_eq!(schema["required"], serde_json::json!(["width_m", "height_m"]));
/// ```
#[must_use]
pub fn target_schema() -> Value {
    of_file(
        keys::TARGET_FILE,
        "target.toml of helio-rs",
        "A target in the pictures of a camera: its size, and where its corners are or what marks them.",
    )
}

/// The same of `scene.toml`.
///
/// ```
/// let schema = helio_io::scene_schema();
/// assert_eq!(schema["properties"]["sun"]["properties"]["dni_w_m2"]["minimum"], 0.0);
/// ```
#[must_use]
pub fn scene_schema() -> Value {
    of_file(
        crate::scene::keys::SCENE_FILE,
        "scene.toml of helio-rs",
        "What mirrors are lit by and what they light: sun, mirrors' optics, receiver and rays. Metres in the frame of \
         the structure's model, or east, north, up for a field.",
    )
}

fn of_file(known: &[&Key], title: &str, about: &str) -> Value {
    let mut schema = object(known);
    schema.insert(
        "$schema".into(),
        json!("https://json-schema.org/draft/2020-12/schema"),
    );
    schema.insert("title".into(), json!(title));
    schema.insert("description".into(), json!(about));
    Value::Object(schema)
}

fn object(known: &[&Key]) -> Map<String, Value> {
    let properties: Map<String, Value> = known
        .iter()
        .map(|key| (key.name.to_string(), property(key)))
        .collect();
    let required: Vec<&str> = known
        .iter()
        .filter(|key| key.required)
        .map(|key| key.name)
        .collect();
    let mut object = Map::new();
    object.insert("type".into(), json!("object"));
    object.insert("properties".into(), Value::Object(properties));
    if !required.is_empty() {
        object.insert("required".into(), json!(required));
    }
    object.insert("additionalProperties".into(), json!(false));
    object
}

fn property(key: &Key) -> Value {
    let mut property = match &key.kind {
        Kind::Text => fields(json!({ "type": "string" })),
        Kind::Word(words) => fields(json!({ "type": "string", "enum": words })),
        Kind::Number(min, max) => {
            fields(json!({ "type": "number", "minimum": min, "maximum": max }))
        }
        Kind::YesNo => fields(json!({ "enum": [0, 1, false, true] })),
        Kind::OneOf(values) => fields(json!({ "enum": values })),
        Kind::Time => fields(json!({ "type": "string", "format": "date-time" })),
        Kind::Enu | Kind::Vector => fields(json!({
            "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3
        })),
        Kind::Corners => fields(json!({
            "type": "array", "minItems": 4, "maxItems": 4, "items": {
                "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2
            }
        })),
        Kind::Texts => fields(json!({ "type": "array", "items": { "type": "string" } })),
        Kind::Table(known) => object(known),
        Kind::Named(known) => fields(json!({
            "type": "object", "additionalProperties": object(known)
        })),
        Kind::Renames(known) => {
            let properties: Map<String, Value> = known
                .iter()
                .map(|key| (key.name.to_string(), json!({ "type": "string" })))
                .collect();
            fields(json!({
                "type": "object", "properties": properties, "additionalProperties": false
            }))
        }
    };
    property.insert("description".into(), json!(key.about));
    Value::Object(property)
}

fn fields(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(fields) => fields,
        _ => Map::new(),
    }
}
