use super::file::File;

/// Returns the JSON schema of scene files, for editors that complete and check TOML.
///
/// ```
/// let schema = cloth_scene::schema();
/// assert_eq!(schema["properties"]["dt"]["type"], "number");
/// assert!(schema["properties"]["gravity"]["description"].as_str().unwrap().contains("m/s²"));
/// ```
#[must_use]
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(File).to_value()
}
