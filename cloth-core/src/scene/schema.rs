use super::file::File;

/// The JSON schema of scene files, for editors that complete and check TOML by one.
///
/// ```
/// let schema = cloth_core::scene::schema();
/// assert_eq!(schema["properties"]["dt"]["type"], "number");
/// assert!(schema["properties"]["gravity"]["description"].as_str().unwrap().contains("m/s²"));
/// ```
#[must_use]
pub fn schema() -> serde_json::Value {
    schemars::schema_for!(File).to_value()
}
