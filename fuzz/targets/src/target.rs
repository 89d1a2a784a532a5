use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// The longest time that an input may take.
pub const PATIENCE: Duration = Duration::from_secs(5);
/// The longest message, in bytes, besides what it quotes of the input. Programs cut messages at 16,000 characters.
const LONGEST_MESSAGE: usize = 4000;

/// A reader to test with edited inputs.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Name of the program and of the folders of seeds and regressions.
    pub name: &'static str,
    /// Pieces of text that the reader knows.
    pub words: &'static [&'static str],
    /// Files and folders in the repository that are seeds, too: paths from its root.
    pub(crate) shared: &'static [&'static str],
    /// Makes seeds that cannot be files: they depend on the version of a program.
    pub(crate) made: fn() -> Vec<Vec<u8>>,
    /// Reads an input and checks the result. The folder is empty, or has files of other inputs under the same names.
    pub(crate) read: fn(&[u8], &Path) -> Result<(), String>,
}

thread_local! {
    static FOLDER: tempfile::TempDir = tempfile::tempdir().expect("the folder of temporary files can be written to");
}

impl Target {
    /// Reads an input. Returns the message of an error.
    ///
    /// # Errors
    /// If the reader refuses the input.
    ///
    /// # Panics
    /// If the reader panics, runs for more than [`PATIENCE`], or writes a message that is 4000 bytes longer than the
    /// input.
    pub fn run(&self, input: &[u8]) -> Result<(), String> {
        let start = now();
        let outcome = FOLDER.with(|folder| (self.read)(input, folder.path()));
        let taken = now() - start;
        assert!(taken < PATIENCE, "{taken:.1?} for {} bytes", input.len());
        if let Err(message) = &outcome {
            assert!(message.len() <= LONGEST_MESSAGE + input.len(), "a message of {} bytes", message.len());
        }
        outcome
    }

    /// Returns the seeds: files, shared files, and those that are made.
    #[must_use]
    pub fn seeds(&self) -> Vec<Vec<u8>> {
        let shared = self.shared.iter().flat_map(|path| files(&repository().join(path)));
        let own = files(&fuzz().join("seeds").join(self.name));
        own.into_iter().chain(shared).map(|path| read(&path)).chain((self.made)()).collect()
    }

    /// Returns the inputs that have failed once, with their paths.
    #[must_use]
    pub fn regressions(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let files = files(&fuzz().join("regressions").join(self.name));
        files.into_iter().map(|path| (path.clone(), read(&path))).collect()
    }
}

/// Returns the time that this thread has run, without what other processes took; else the time of the clock.
fn now() -> Duration {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let nanoseconds = || -> Option<u64> {
        let schedule = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        schedule.split_whitespace().next()?.parse().ok()
    };
    nanoseconds().map_or_else(|| START.elapsed(), Duration::from_nanos)
}

/// The root of the repository.
pub(crate) fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn fuzz() -> PathBuf {
    repository().join("fuzz")
}

fn read(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Returns a file, or the files in a folder, sorted.
fn files(path: &Path) -> Vec<PathBuf> {
    let Ok(entries) = path.read_dir() else { return path.is_file().then(|| path.to_owned()).into_iter().collect() };
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|file| file.is_file());
    files.sort();
    files
}

/// Returns an error with its causes.
pub(crate) fn message(error: impl std::error::Error) -> String {
    let mut message = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        message.push_str(&format!(": {error}"));
        cause = error.source();
    }
    message
}

/// Returns an input as text, as the readers do.
pub(crate) fn text(input: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(input).map_err(|error| error.to_string())
}
