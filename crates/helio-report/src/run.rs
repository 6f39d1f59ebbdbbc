//! What every page of a calibration says of the run that it is of.

use helio_io::{LoadedField, Observations, Provenance};

/// What a page of a calibration says besides what the run found.
#[derive(Debug, Clone)]
pub struct AboutRun<'a> {
    /// How the calibration was made, as its table says it.
    pub provenance: &'a Provenance,
    /// When the page was made, as text; this crate has no clock.
    pub generated_utc: String,
    /// What changed against an earlier calibration, in sentences; nothing where there is none to compare with.
    pub changes: Vec<String>,
}

/// What people call the field.
pub(crate) fn site_name(loaded: &LoadedField) -> &str {
    let site = loaded.site.as_ref().and_then(|site| site.name.as_deref());
    site.unwrap_or("a heliostat field")
}

/// What a run was made from, and how.
pub(crate) fn facts(
    loaded: &LoadedField,
    observations: &Observations,
    p: &Provenance,
) -> Vec<(String, String)> {
    let files = loaded.files.iter().map(|path| path.display().to_string());
    let field = files.collect::<Vec<_>>().join(", ");
    let field = match field.is_empty() {
        true => "columns of no file".to_owned(),
        false => field,
    };
    [
        ("field", field),
        ("observations", observations.path.display().to_string()),
        ("solver", p.solver.clone()),
        ("residual", p.residual.clone()),
        ("robust loss", p.robust.clone()),
        ("field, SHA-256", p.field_hash.clone()),
        ("observations, SHA-256", p.observations_hash.clone()),
    ]
    .map(|(name, text)| (name.to_owned(), text))
    .to_vec()
}
