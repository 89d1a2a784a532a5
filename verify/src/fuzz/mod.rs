//! Fuzzing on a stable compiler: the inputs of a corpus and random edits of them must neither panic nor take long.
//!
//! Inputs with a new outcome are kept and edited further, so that a run digs into what it finds. Failing inputs are
//! written to the corpus, which every later run replays first.

mod edits;

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use fastrand::Rng;

/// Time limit of one input.
const PATIENCE: Duration = Duration::from_secs(20);
/// Inputs are cut to this many bytes.
const LONGEST: usize = 4096;

/// File in the corpus that holds the running input, in case it ends the process.
const CURRENT: &str = "fuzz-input";
/// File in the corpus that lists inputs in other folders: one path per line, relative to the corpus.
const LINKS: &str = "links";

/// Limit of a run.
#[derive(Clone, Copy, Debug)]
pub enum Budget {
    /// Number of edited inputs.
    Inputs(u64),
    /// Run time.
    Time(Duration),
}

/// Statistics of a run without findings.
#[derive(Clone, Copy, Debug)]
pub struct Summary {
    /// Inputs of the corpus.
    pub corpus: usize,
    /// Edited inputs.
    pub edited: u64,
    /// Number of different outcomes.
    pub outcomes: usize,
}

/// An input that fails.
#[derive(Debug, thiserror::Error)]
#[error("{why}; the input is kept as {}", .input.display())]
pub struct Finding {
    /// Description of the failure.
    pub why: String,
    /// Path of the input.
    pub input: PathBuf,
}

/// Runs every input of a corpus, then edited ones. `run` returns a text that tells outcomes apart, such as the message
/// of an error. `words` are pieces of text that edits insert.
///
/// An input that overflows the stack ends the process; the file `fuzz-input` in the corpus contains it.
///
/// # Errors
/// Returns a [`Finding`] if an input panics or takes longer than 20 seconds, or an error if the corpus cannot be read
/// or written.
///
/// ```
/// use verify::fuzz::{Budget, fuzz};
///
/// let corpus = std::env::temp_dir().join("verify-fuzz-example");
/// std::fs::create_dir_all(&corpus)?;
/// std::fs::write(corpus.join("number"), "1.5")?;
/// let parse = |text: &str| text.trim().parse::<f64>().map_or_else(|error| error.to_string(), |_| "a number".into());
/// let summary = fuzz(&corpus, &["e", "-", "."], Budget::Inputs(100), 1, parse)?;
/// assert!(summary.corpus == 1 && summary.outcomes >= 2);
/// # std::fs::remove_dir_all(&corpus)?;
/// # Ok::<(), anyhow::Error>(())
/// ```
pub fn fuzz(
    corpus: &Path,
    words: &[&str],
    budget: Budget,
    seed: u64,
    run: impl Fn(&str) -> String,
) -> anyhow::Result<Summary> {
    let mut inputs = read(corpus)?;
    anyhow::ensure!(!inputs.is_empty(), "{} contains no input", corpus.display());
    let mut fuzzer = Fuzzer { corpus, run, outcomes: BTreeSet::new() };
    for input in &inputs {
        fuzzer.try_input(input)?;
    }
    let (of_corpus, start) = (inputs.len(), Instant::now());
    let mut random = Rng::with_seed(seed);
    let mut edited = 0;
    while match budget {
        Budget::Inputs(count) => edited < count,
        Budget::Time(time) => start.elapsed() < time,
    } {
        let input = edits::edited(&inputs, words, LONGEST, &mut random);
        if fuzzer.try_input(&input)? {
            inputs.push(input);
        }
        edited += 1;
    }
    std::fs::remove_file(fuzzer.current()).context("cannot remove the file of the input that ran last")?;
    Ok(Summary { corpus: of_corpus, edited, outcomes: fuzzer.outcomes.len() })
}

struct Fuzzer<'a, F> {
    corpus: &'a Path,
    run: F,
    outcomes: BTreeSet<u64>,
}

impl<F: Fn(&str) -> String> Fuzzer<'_, F> {
    /// Path of the running input, in case it ends the process.
    fn current(&self) -> PathBuf {
        self.corpus.join(CURRENT)
    }

    /// Runs an input. Returns whether its outcome is new.
    fn try_input(&mut self, input: &str) -> anyhow::Result<bool> {
        let current = self.current();
        std::fs::write(&current, input).with_context(|| format!("cannot write {}", current.display()))?;
        let start = Instant::now();
        let outcome = catch_unwind(AssertUnwindSafe(|| (self.run)(input)));
        let taken = start.elapsed();
        let why = match &outcome {
            Err(panic) => format!("a panic: {}", message(panic.as_ref())),
            Ok(_) if taken > PATIENCE => format!("{taken:.1?} for {} bytes", input.len()),
            Ok(outcome) => return Ok(self.outcomes.insert(hash(&without_names(outcome)))),
        };
        let kept = self.corpus.join(format!("found-{:016x}", hash(input)));
        std::fs::write(&kept, input).with_context(|| format!("cannot write {}", kept.display()))?;
        Err(Finding { why, input: kept }.into())
    }
}

fn read(corpus: &Path) -> anyhow::Result<Vec<String>> {
    let reading = || format!("cannot read {}", corpus.display());
    let mut files = Vec::new();
    for entry in std::fs::read_dir(corpus).with_context(reading)? {
        files.push(entry.with_context(reading)?.path());
    }
    files.sort();
    let mut inputs = Vec::new();
    for path in files.iter().filter(|path| path.is_file()) {
        match path.file_name().and_then(|name| name.to_str()) {
            Some(CURRENT) => {}
            Some(LINKS) => {
                for line in read_file(path)?.lines() {
                    inputs.push(read_file(&corpus.join(line))?);
                }
            }
            _ => inputs.push(read_file(path)?),
        }
    }
    Ok(inputs)
}

fn read_file(path: &Path) -> anyhow::Result<String> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Removes the numbers and the quoted text, which make each message different.
fn without_names(outcome: &str) -> String {
    let unquoted = outcome.split(['`', '"']).step_by(2).collect::<String>();
    unquoted.chars().filter(|c| !c.is_numeric()).take(400).collect()
}

fn hash(text: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    text.hash(&mut hasher);
    hasher.finish()
}

fn message(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_found_kept_and_replayed() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("one"), "x = 1").unwrap();
        let run = |text: &str| {
            assert!(!text.contains("=="), "two in a row");
            String::new()
        };
        let finding = fuzz(folder.path(), &["="], Budget::Inputs(5000), 1, run).unwrap_err();
        let finding = finding.downcast::<Finding>().unwrap();
        assert!(finding.why.contains("two in a row"), "{finding}");
        assert!(std::fs::read_to_string(&finding.input).unwrap().contains("=="));
        assert!(fuzz(folder.path(), &["="], Budget::Inputs(0), 1, run).is_err());
    }

    #[test]
    fn a_corpus_may_link_inputs_of_other_folders() {
        let folder = tempfile::tempdir().unwrap();
        let corpus = folder.path().join("corpus");
        std::fs::create_dir(&corpus).unwrap();
        std::fs::write(corpus.join(LINKS), "../elsewhere\n").unwrap();
        std::fs::write(corpus.join("own"), "own").unwrap();
        std::fs::write(folder.path().join("elsewhere"), "linked").unwrap();
        assert_eq!(read(&corpus).unwrap(), ["linked", "own"]);
        let links = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("command/corpus/files").join(LINKS);
        assert!(std::fs::read_to_string(links).unwrap().contains("errata.energy"));
        read(&std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("command/corpus/files")).unwrap();
    }

    #[test]
    fn a_corpus_must_hold_something() {
        let folder = tempfile::tempdir().unwrap();
        let error = fuzz(folder.path(), &[], Budget::Inputs(1), 1, |_| String::new()).unwrap_err();
        assert!(error.to_string().contains("no input"), "{error}");
    }
}
