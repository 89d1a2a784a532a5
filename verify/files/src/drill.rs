//! Drills of programs that write files: failures of single operations, full disks and kills.
//!
//! After each, files with final names must be whole, and another try must give the results of an undisturbed program,
//! bit by bit. This crate injects failures in builds with debug assertions, as the environment variable
//! `ENERGY_FAULT` says.
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use fastrand::Rng;

/// Work of a program that can be interrupted.
#[derive(Clone, Copy, Debug)]
pub struct Drill<'a> {
    /// Path of the program.
    pub program: &'a str,
    /// Folder in which it runs.
    pub folder: &'a Path,
    /// Returns the arguments that begin the work, or continue it if the output folder has a state.
    pub arguments: fn(&Path) -> Vec<String>,
    /// Returns the part of a file, given its path in the output folder, that does not depend on times. `None` for
    /// files that may differ or be missing, such as states.
    pub repeatable: fn(&Path, Vec<u8>) -> Option<Vec<u8>>,
}

/// The faults that a drill injects.
const FAULTS: [&str; 3] = ["fail", "full", "kill"];
/// The longest time that a program may take.
const PATIENCE: Duration = Duration::from_secs(120);

type Files = Vec<(PathBuf, Vec<u8>)>;

impl Drill<'_> {
    /// Injects a fault at each operation, and returns how many there were: a failure, a full disk and a kill in turn.
    /// With the environment variable `DRILL_ALL`, each operation has all three.
    ///
    /// # Panics
    /// If a fault goes unnoticed, leaves a damaged file, or keeps another try from completing the work.
    #[must_use]
    pub fn faults(&self) -> usize {
        let whole = self.undisturbed();
        let mut count = 0;
        for operation in 1.. {
            let mut is_reached = false;
            let own = FAULTS[operation % FAULTS.len()];
            for fault in FAULTS.into_iter().filter(|&fault| fault == own || std::env::var_os("DRILL_ALL").is_some()) {
                let case = format!("{fault}:{operation}");
                let parent = tempfile::tempdir_in(self.folder).expect("the folder can be written to");
                let output = parent.path().join("out");
                let (status, message) = self.run(&output, Some(&case));
                if !message.contains("fault at operation") {
                    assert!(status.success(), "{case}: {message}");
                    continue;
                }
                is_reached = true;
                count += 1;
                assert!(!message.contains("panicked"), "{case}: {message}");
                if fault == "kill" {
                    assert_eq!(status.code(), Some(137), "{case}: {message}");
                } else {
                    assert_eq!(status.code(), Some(1), "{case}: {message}");
                    // The file, by its path.
                    let told = message.lines().find(|line| line.contains("no storage space"));
                    assert!(told.is_some_and(|line| line.contains("/out")), "{case}: {message}");
                    assert_eq!(parts(&output), [] as [PathBuf; 0], "{case}");
                }
                self.assert_whole(&output, &whole, &case);
                self.complete(&output, &whole, &case);
            }
            if !is_reached {
                break;
            }
        }
        count
    }

    /// Kills the program at random times, also while it continues, until that many kills were made. Returns the number
    /// of works that were completed.
    ///
    /// # Panics
    /// If a kill leaves a damaged file, or keeps another try from completing the work.
    #[must_use]
    pub fn kills(&self, kills: usize, seed: u64) -> usize {
        let start = Instant::now();
        let whole = self.undisturbed();
        let longest = start.elapsed().mul_f64(1.2);
        let mut random = Rng::with_seed(seed);
        let (mut done, mut works) = (0, 0);
        while done < kills {
            let parent = tempfile::tempdir_in(self.folder).expect("the folder can be written to");
            let output = parent.path().join("out");
            while done < kills && self.is_killed(&output, longest.mul_f64(random.f64())) {
                done += 1;
                self.assert_whole(&output, &whole, &format!("kill {done} of seed {seed}"));
            }
            self.complete(&output, &whole, &format!("after kill {done} of seed {seed}"));
            works += 1;
        }
        works
    }

    /// Returns the results without any disturbance.
    fn undisturbed(&self) -> Files {
        let parent = tempfile::tempdir_in(self.folder).expect("the folder can be written to");
        let output = parent.path().join("out");
        let (status, message) = self.run(&output, None);
        assert!(status.success(), "{message}");
        self.results(&output)
    }

    fn command(&self, output: &Path) -> Command {
        let mut command = Command::new(self.program);
        command.args((self.arguments)(output)).current_dir(self.folder).stdin(Stdio::null());
        command
    }

    /// Runs the program to its end. Returns its status and its messages.
    fn run(&self, output: &Path, fault: Option<&str>) -> (ExitStatus, String) {
        let mut command = self.command(output);
        command.envs(fault.map(|fault| ("ENERGY_FAULT", fault)));
        let start = Instant::now();
        let ended = command.output().expect("the program can be started");
        assert!(start.elapsed() < PATIENCE, "it took {:?}", start.elapsed());
        (ended.status, String::from_utf8_lossy(&ended.stderr).into_owned())
    }

    /// Starts the program and kills it after a time. Returns whether it was killed.
    fn is_killed(&self, output: &Path, after: Duration) -> bool {
        let mut command = self.command(output);
        let mut child =
            command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program can be started");
        std::thread::sleep(after);
        // A program that has ended cannot be killed.
        let _ = child.kill();
        let status = child.wait().expect("the program was started");
        assert!(status.success() || status.code().is_none(), "{status} within {after:?}");
        !status.success()
    }

    /// Continues until the work is done, and compares its results.
    fn complete(&self, output: &Path, whole: &Files, case: &str) {
        let (status, message) = self.run(output, None);
        assert!(status.success(), "{case}, another try: {message}");
        let results = self.results(output);
        let names = |files: &Files| files.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>();
        assert_eq!(names(&results), names(whole), "{case}");
        self.assert_whole(output, whole, case);
        assert_eq!(parts(output), [] as [PathBuf; 0], "{case}, another try");
    }

    /// Asserts that every file with a final name is whole.
    fn assert_whole(&self, output: &Path, whole: &Files, case: &str) {
        for (path, contents) in self.results(output) {
            let Some((_, expected)) = whole.iter().find(|(other, _)| *other == path) else {
                panic!("{case}: {} is not a result", path.display());
            };
            assert!(contents == *expected, "{case}: {} differs", path.display());
        }
    }

    /// Returns the results in an output folder, sorted by path.
    fn results(&self, output: &Path) -> Files {
        let read = |path: PathBuf| {
            let contents = std::fs::read(output.join(&path)).expect("a file of the program can be read");
            (self.repeatable)(&path, contents).map(|contents| (path, contents))
        };
        files(output).into_iter().filter(|path| !is_part(path)).filter_map(read).collect()
    }
}

fn is_part(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".part-"))
}

/// Returns the unfinished files.
fn parts(output: &Path) -> Vec<PathBuf> {
    files(output).into_iter().filter(|path| is_part(path)).collect()
}

/// Returns the paths of all files below a folder, relative to it and sorted.
fn files(folder: &Path) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        // A folder that was not created yet has no files.
        for entry in next.read_dir().into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.push(path.strip_prefix(folder).expect("it is below").to_owned());
            }
        }
    }
    files.sort();
    files
}
