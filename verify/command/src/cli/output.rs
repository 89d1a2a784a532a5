use std::path::{Path, PathBuf};

use anyhow::Context;
use comfy_table::{CellAlignment, Table, presets};
use energy_cli::write_file;

/// Writes a text, if a path is given.
pub fn write_text(path: Option<&Path>, text: impl FnOnce() -> String) -> anyhow::Result<()> {
    path.map_or(Ok(()), |path| write_file(path, text()))
}

/// Writes a report as JSON, if a path is given.
pub fn write_json(path: Option<&Path>, report: &impl serde::Serialize) -> anyhow::Result<()> {
    path.map_or(Ok(()), |path| write_file(path, serde_json::to_string_pretty(report)?))
}

/// Creates an output folder.
pub fn create_folder(folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))
}

/// Creates a table with right-aligned numeric columns.
pub fn table(headings: &[&str], numeric: &[usize]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING).set_header(headings);
    for &column in numeric {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// The reference data in this repository.
pub fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../data")
}

/// The reference records of potentials in this repository.
pub fn records() -> PathBuf {
    data().join("potentials")
}
