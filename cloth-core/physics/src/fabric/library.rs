//! The library of fabrics, as tables for scene files. Each number has its source.

/// A fabric of the library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LibraryFabric {
    /// The name in scene files.
    pub name: &'static str,
    /// The table `[fabric]` of a scene file, with the source of each number as a comment.
    pub table: &'static str,
}

impl LibraryFabric {
    /// Returns one line that describes the fabric.
    #[must_use]
    pub fn title(&self) -> &'static str {
        self.table.lines().next().unwrap_or_default().trim_start_matches("# ").trim_end_matches('.')
    }
}

macro_rules! library {
    ($($name:literal),* $(,)?) => {
        &[$(LibraryFabric { name: $name, table: include_str!(concat!("tables/", $name, ".toml")) }),*]
    };
}

/// All fabrics of the library.
///
/// ```
/// use cloth_physics::fabric::LIBRARY;
/// let denim = LIBRARY.iter().find(|fabric| fabric.name == "denim").unwrap();
/// assert_eq!(denim.title(), "Denim: a heavy cotton twill");
/// assert!(denim.table.contains("[fabric.material.yarns]"));
/// ```
pub const LIBRARY: &[LibraryFabric] = library![
    "cotton-shirting",
    "denim",
    "stretch-denim",
    "wool-coating",
    "wool-suiting",
    "silk-satin",
    "canvas",
    "polyester-faille",
    "single-jersey",
    "velvet",
];

/// Names of earlier versions, and the fabrics that are most similar.
const REPLACED: [(&str, &str); 9] = [
    ("interlock", "single-jersey"),
    ("ribbon", "polyester-faille"),
    ("dots", "cotton-shirting"),
    ("ponte", "single-jersey"),
    ("rib", "single-jersey"),
    ("sweat", "single-jersey"),
    ("swim", "single-jersey"),
    ("jacket", "stretch-denim"),
    ("target", "canvas"),
];

/// A name that no fabric of the library has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown fabric `{name}`, {}", .replacement.map_or_else(
    || format!("expected a table or one of the fabrics {}", listed()),
    |new| format!(
        "which was removed, because its numbers had wrong factors and a licence for research only; the most similar \
         fabric is `{new}`"
    ),
))]
pub struct UnknownFabric {
    /// The unknown name.
    pub name: String,
    /// The most similar fabric, for a name of an earlier version; `None` for others.
    pub replacement: Option<&'static str>,
}

fn listed() -> String {
    LIBRARY.iter().map(|fabric| format!("`{}`", fabric.name)).collect::<Vec<_>>().join(", ")
}

/// Returns the fabric with a name.
///
/// # Errors
/// Returns an error that lists all names, or the fabric that replaces one of an earlier version.
///
/// ```
/// use cloth_physics::fabric::in_library;
/// assert_eq!(in_library("velvet").unwrap().title(), "Velvet");
/// assert_eq!(in_library("interlock").unwrap_err().replacement, Some("single-jersey"));
/// ```
pub fn in_library(name: &str) -> Result<&'static LibraryFabric, UnknownFabric> {
    let replacement = || REPLACED.iter().find(|(old, _)| *old == name).map(|(_, new)| *new);
    let found = LIBRARY.iter().find(|fabric| fabric.name == name);
    found.ok_or_else(|| UnknownFabric { name: name.to_owned(), replacement: replacement() })
}
