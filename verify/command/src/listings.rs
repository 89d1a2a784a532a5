use std::path::Path;

use anyhow::Context;
use energy_cli::Notice;
use energy_compiler::{Budget, Listing};

/// The largest `.energy` file, in bytes.
const LARGEST_TEXT: u64 = 16 << 20;

/// Compiles an element of the catalogue, or the declarations of an `.energy` file, for printing.
///
/// # Errors
/// If the element or the file does not exist, or the file has errors.
pub fn listings(name: &str) -> anyhow::Result<Vec<Listing>> {
    if Path::new(name).extension().is_some_and(|extension| extension == "energy") {
        let text =
            energy_files::read_text(Path::new(name), LARGEST_TEXT).with_context(|| format!("cannot read {name}"))?;
        let _notice = Notice::of(format!("compiling {name} …"));
        let all = Listing::from_file_within(&text, name, &Budget::default().trusting());
        let all = all.map_err(|errors| anyhow::anyhow!("{errors}"))?;
        anyhow::ensure!(!all.is_empty(), "{name} contains no declaration");
        return Ok(all);
    }
    Listing::from_source(&catalogue_source(name)?).map_err(|errors| anyhow::anyhow!("{name}:{errors}"))
}

/// Returns the text of an element of the catalogue.
///
/// # Errors
/// If the element does not exist.
pub fn catalogue_source(name: &str) -> anyhow::Result<String> {
    let all = || crate::catalogue::elements().iter().chain(crate::catalogue::mixed());
    let names = || all().map(|e| &*e.declaration.name).collect::<Vec<_>>().join(", ");
    let entry =
        crate::catalogue::find(name).with_context(|| format!("there is no element `{name}`; there are {}", names()))?;
    Ok(entry.declaration.source.clone().into_owned())
}
