use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use energy_cli::{Notice, print};
use energy_compiler::{Budget, Interpreted, Origin, SourceFile, origin, sources};

use super::language::{Language, Numbers};

/// The largest file that may be overwritten, in bytes.
const LARGEST: u64 = 256 << 20;

/// Writes elements as C, C++, CUDA or Warp: a folder that needs nothing else, and compiles to the bits of the Rust library.
///
/// Each element gets its value and exact derivatives, those of single vertices too, and loops over many elements.
/// README.md in the folder says how to compile it. For Warp, the folder has one Python module, `energies.py`.
#[derive(Args)]
pub struct Emit {
    /// Elements of the catalogue, and files of declarations (`.energy`).
    #[arg(required = true)]
    names: Vec<String>,
    /// The language to write.
    #[arg(long, value_enum, default_value = "c")]
    lang: Language,
    /// The precision of all numbers.
    #[arg(long, value_enum, default_value = "f64")]
    precision: Numbers,
    /// The folder to write. It may exist; only files that were generated, and not changed since, are overwritten.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Overwrite generated files that were changed since.
    #[arg(long)]
    force: bool,
}

impl Emit {
    pub fn run(self) -> anyhow::Result<bool> {
        let mut elements = Vec::new();
        for name in &self.names {
            elements.extend(declarations(name)?);
        }
        let files = sources(&elements, self.lang.target(), self.precision.list())?;
        let written = write(&self.output, &files, self.force)?;
        let folder = self.output.display();
        print(&format!(
            "{} elements in {} files in {folder}, {written} of them new or changed\n",
            elements.len(),
            files.len()
        ))?;
        Ok(true)
    }
}

/// Compiles an element of the catalogue or a file.
pub(super) fn declarations(name: &str) -> anyhow::Result<Vec<Interpreted>> {
    let path = Path::new(name);
    let (text, file) = if path.extension().is_some_and(|extension| extension == "energy") {
        let text = energy_files::read_text(path, LARGEST).with_context(|| format!("cannot read {name}"))?;
        (text, name)
    } else {
        (verify_command::catalogue_source(name)?, name)
    };
    let _notice = Notice::of(format!("compiling {name} …"));
    let all = Interpreted::from_file_with_vertices(&text, file, &Budget::default().trusting())
        .map_err(|errors| anyhow::anyhow!("{errors}"))?;
    anyhow::ensure!(!all.is_empty(), "{name} contains no declaration");
    Ok(all)
}

/// Writes all files, or none if one of them would replace a file that was not generated. Returns how many are new or
/// differ from those that were there.
fn write(folder: &Path, files: &[SourceFile], force: bool) -> anyhow::Result<usize> {
    let mut problems = String::new();
    let mut changed = Vec::new();
    for file in files {
        let path = folder.join(&file.name);
        if !path.exists() {
            changed.push(file);
            continue;
        }
        let known = energy_files::read_text(&path, LARGEST).map(|text| (origin(&text), text == file.text));
        match known {
            Ok((_, true)) => {}
            Ok((Origin::Generated, false)) => changed.push(file),
            Ok((Origin::Changed, false)) if force => changed.push(file),
            Ok((Origin::Changed, false)) => {
                let _ =
                    writeln!(problems, "  {} was changed since it was generated (--force overwrites it)", file.name);
            }
            Ok((Origin::Foreign, false)) | Err(_) => {
                let _ = writeln!(problems, "  {} was not generated; move it, or choose another folder", file.name);
            }
        }
    }
    anyhow::ensure!(problems.is_empty(), "nothing was written to {}:\n{}", folder.display(), problems.trim_end());
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    for file in &changed {
        energy_files::write_whole(&folder.join(&file.name), file.text.as_bytes())
            .with_context(|| format!("cannot write {} in {}", file.name, folder.display()))?;
    }
    Ok(changed.len())
}
