use std::path::Path;

use anyhow::Context;

use crate::check::expected;
use crate::sample::Sample;
use crate::subject::Subject;

/// Writes the inputs of the textbook formula of all elements, and the library's results, as little-endian doubles,
/// element by element: `K1.inputs` and `K1.expected`, and so on.
///
/// # Errors
/// When the folder or a file cannot be written.
pub fn write_inputs<K: Subject>(folder: &Path, samples: &[Sample]) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let inputs = samples.iter().flat_map(|sample| &sample.textbook).copied();
    let results = expected::<K>(samples).concat();
    for (what, bytes) in [("inputs", bytes(inputs)), ("expected", bytes(results.into_iter()))] {
        let path = folder.join(format!("{}.{what}", K::KEY));
        energy_cli::write_file(&path, &bytes)?;
    }
    Ok(())
}

fn bytes(numbers: impl Iterator<Item = f64>) -> Vec<u8> {
    numbers.flat_map(f64::to_le_bytes).collect()
}
