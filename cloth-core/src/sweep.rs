//! Sweeps: runs of a scene with all combinations of values for some of its keys.

use std::path::Path;

use energy_files::excerpt;
use toml::{Table, Value};

use crate::run::Checkpoint;
use crate::scene::Scene;

/// A table of values that is not a sweep of a scene.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum SweepError {
    /// The table is malformed. Lines count from 1.
    #[error("line {line}: {message}")]
    Malformed { line: usize, message: String },
    /// A value is not a list.
    #[error("{}: expected a list of values, got {}", excerpt(.key), excerpt(.found))]
    NotAList { key: String, found: String },
    /// There are more combinations than [`MOST_RUNS`].
    #[error("expected at most {MOST_RUNS} runs, got all combinations of {lists}")]
    TooMany { lists: String },
    /// The scenes of all runs are larger than memory should be.
    #[error("expected scenes of at most {LARGEST_SCENES} bytes in all runs; give shorter values, or fewer")]
    TooLarge,
    /// A key leads to a place that the scene does not have.
    #[error("{}: {reason}", excerpt(.key))]
    Place { key: String, reason: String },
    /// A scene cannot be written as TOML.
    #[error(transparent)]
    Unwritable(#[from] toml::ser::Error),
}

/// The largest number of runs.
pub const MOST_RUNS: usize = 10_000;
/// The largest size of their scenes together, in bytes. All are in memory.
const LARGEST_SCENES: usize = 64 << 20;

/// Lists of values for the keys of a scene.
///
/// ```
/// use cloth_core::sweep::Grid;
/// let grid = Grid::parse("fabric.density = [0.1, 0.2]\ndt = [0.01]")?;
/// let scene = "dt = 0.02\n[fabric]\ndensity = 0.3".parse()?;
/// let choices = grid.choices(&scene, "scene.toml".as_ref())?;
/// assert_eq!((grid.keys().count(), choices.len()), (2, 2));
/// assert!(choices[1].text.contains("density = 0.2"));
/// # Ok::<(), anyhow::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Grid(Vec<(String, Vec<Value>)>);

/// One run of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Values of the parameters, in the order of their keys.
    pub values: Vec<Value>,
    /// Text of the scene.
    pub text: String,
    /// Name of the folder: a hash of everything that the run reads. The same run continues in the same folder. After an
    /// edit of a mesh, no earlier result counts.
    pub name: String,
}

impl Grid {
    /// Parses a table of lists. Nested tables are paths of keys.
    ///
    /// # Errors
    /// Returns an error if the text is not TOML, or a value is not a list.
    pub fn parse(text: &str) -> Result<Self, SweepError> {
        let mut lists = Vec::new();
        let malformed = |error: toml::de::Error| {
            let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
            SweepError::Malformed {
                line: before.matches('\n').count() + 1,
                message: excerpt(error.message()).into_owned(),
            }
        };
        flatten("", &text.parse().map_err(malformed)?, &mut lists)?;
        Ok(Self(lists))
    }

    /// Paths of the keys, such as `fabric.density`.
    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|(key, _)| key.as_str())
    }

    /// Returns all combinations of values; the last key varies fastest. `path` is that of the scene.
    ///
    /// # Errors
    /// Returns an error if there are more than [`MOST_RUNS`], or the scene has no place for a value.
    pub fn choices(&self, scene: &Table, path: &Path) -> Result<Vec<Choice>, SweepError> {
        let count = self.0.iter().try_fold(1_usize, |count, (_, values)| count.checked_mul(values.len()));
        if count.is_none_or(|count| count > MOST_RUNS) {
            let lists = self.0.iter().map(|(key, values)| format!("{} of {key}", values.len())).collect::<Vec<_>>();
            return Err(SweepError::TooMany { lists: excerpt(&lists.join(", ")).to_string() });
        }
        let mut size = 0;
        let choice = |number: usize| {
            let values = self.values(number);
            let mut scene = scene.clone();
            for (key, value) in self.keys().zip(&values) {
                set(&mut scene, key, value)?;
            }
            let text = toml::to_string(&scene)?;
            size += text.len();
            if size > LARGEST_SCENES {
                return Err(SweepError::TooLarge);
            }
            let name = format!("{:016x}", identity(&text, path));
            Ok(Choice { values, text, name })
        };
        (0..count.unwrap_or(0)).map(choice).collect()
    }

    /// Returns the combination of values with this number. The last key varies fastest.
    fn values(&self, mut number: usize) -> Vec<Value> {
        let mut values: Vec<Value> = Vec::with_capacity(self.0.len());
        for (_, list) in self.0.iter().rev() {
            values.push(list[number % list.len()].clone());
            number /= list.len();
        }
        values.reverse();
        values
    }
}

/// Lists the keys of nested tables as paths, `fabric.density`, with their values.
fn flatten(prefix: &str, table: &Table, lists: &mut Vec<(String, Vec<Value>)>) -> Result<(), SweepError> {
    for (key, value) in table {
        let path = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
        match value {
            Value::Table(table) => flatten(&path, table, lists)?,
            Value::Array(values) => lists.push((path, values.clone())),
            other => return Err(SweepError::NotAList { key: path, found: other.to_string() }),
        }
    }
    Ok(())
}

/// Sets the value at a path, `obstacles.0.friction`. Numbers are places in lists; missing tables are created.
fn set(scene: &mut Table, path: &str, value: &Value) -> Result<(), SweepError> {
    let error = |reason: String| SweepError::Place { key: path.to_owned(), reason };
    let (tables, last) = path.rsplit_once('.').map_or((None, path), |(tables, last)| (Some(tables), last));
    let mut table = scene;
    let mut keys = tables.into_iter().flat_map(|tables| tables.split('.'));
    while let Some(key) = keys.next() {
        let mut entry = table.entry(key).or_insert_with(|| Table::new().into());
        if let Value::Array(list) = entry {
            let place = keys.next().and_then(|place| place.parse::<usize>().ok());
            let message = format!("expected one of the {} places of `{}`, counted from 0", list.len(), excerpt(key));
            entry = place.and_then(|place| list.get_mut(place)).ok_or_else(|| error(message))?;
        }
        let Value::Table(next) = entry else {
            return Err(error(format!("`{}` is not a table of the scene", excerpt(key))));
        };
        table = next;
    }
    table.insert(last.to_owned(), value.clone());
    Ok(())
}

/// Returns a hash of what a run reads: the version of the program, the text of its scene, and the meshes and materials
/// that the scene names. An invalid scene contributes no files.
fn identity(text: &str, path: &Path) -> u64 {
    let version = format!("{}, checkpoints {}\n", env!("CARGO_PKG_VERSION"), Checkpoint::VERSION);
    let files = Scene::parse(text, path).map_or_else(|_| Vec::new(), |scene| scene.input_files());
    let start = [version.as_bytes(), text.as_bytes()].into_iter().fold(FNV_OFFSET, fnv1a);
    files.iter().fold(start, |hash, file| match std::fs::read(file) {
        Ok(contents) => fnv1a(fnv1a(hash, &contents.len().to_le_bytes()), &contents),
        Err(_) => fnv1a(hash, b"unreadable"),
    })
}

/// The start of the hash FNV-1a.
const FNV_OFFSET: u64 = 0xcbf2_9ce4_8422_2325;

/// Continues the hash FNV-1a with some bytes.
fn fnv1a(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_table_does_not_become_large_scenes() {
        let table = format!("title = [\"{}\"]\ndt = {:?}", "x".repeat(100_000), vec![0.1; 9999]);
        let error = Grid::parse(&table).unwrap().choices(&Table::new(), "scene.toml".as_ref()).unwrap_err();
        assert!(matches!(error, SweepError::TooLarge), "{error}");
    }
}
