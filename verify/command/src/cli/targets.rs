use std::path::Path;

use anyhow::Context;
use energy_cli::Notice;
use verify::audit::{Target, targets_in};

/// Returns the elements with these names from the catalogue, or from a file if one is given. An empty list selects all.
pub fn targets(names: &[String], file: Option<&Path>) -> anyhow::Result<Vec<Target>> {
    let Some(file) = file else {
        if let Some(path) = names.iter().find(|name| name.ends_with(".energy")) {
            anyhow::bail!("{path} is a file, not the name of an element; give it as `--file {path}`");
        }
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        return targets_in(&verify_command::catalogue::all(), &names).map_err(anyhow::Error::msg);
    };
    let notice = Notice::of(format!("compiling {} …", file.display()));
    let all = Target::of_file(file)?;
    drop(notice);
    if let Some(unknown) = names.iter().find(|name| all.iter().all(|target| target.name() != *name)) {
        let known: Vec<&str> = all.iter().map(Target::name).collect();
        anyhow::bail!("{} does not declare {unknown}; it declares {}", file.display(), known.join(", "));
    }
    Ok(all.into_iter().filter(|target| names.is_empty() || names.iter().any(|name| name == target.name())).collect())
}

/// Returns the energy with this name, from the file or else from the catalogue.
pub fn energy_target(name: &str, file: Option<&Path>) -> anyhow::Result<Target> {
    let own = file.map(Target::of_file).transpose()?.unwrap_or_default();
    let found = own.into_iter().find(|target| target.name() == name);
    let found = found.or_else(|| verify_command::catalogue::find(name).map(Target::of_element));
    found.with_context(|| format!("neither the file nor the catalogue has an energy `{name}`"))
}
