//! Every target replays its seeds and regressions, and reads edited inputs for a short time. `FUZZ_MINUTES=5` takes
//! longer, `FUZZ_SEED=2` makes other edits.

use std::alloc::System;
use std::collections::BTreeSet;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use cap::Cap;
use fastrand::Rng;
use fuzz_targets::{TARGETS, Target, edits::edited, target};

/// The limit of memory per input is in `fuzz/src/target.rs`; here, tests share the allocator.
#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, 4 << 30);

/// Edited inputs of a target, and the longest time for them.
const INPUTS: usize = 1000;
const TIME: Duration = Duration::from_secs(3);

fn variable(name: &str) -> Option<f64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{name} is not a number")))
}

/// Path of a kept input: the one that runs, in case it ends the process, or one that failed.
fn kept(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz");
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

fn run(target: &'static Target, input: &[u8]) -> Result<(), String> {
    let file = kept(target.name);
    std::fs::write(&file, input).unwrap();
    catch_unwind(|| target.run(input)).unwrap_or_else(|_| panic!("the input is kept as {}", file.display()))
}

/// Messages that differ in numbers and quoted text only are one outcome.
fn without_names(message: &str) -> String {
    let unquoted = message.split(['`', '"']).step_by(2).collect::<String>();
    unquoted.chars().filter(|character| !character.is_numeric()).take(400).collect()
}

fn fuzz(name: &str) {
    let target = target(name);
    let seeds = target.seeds();
    let accepted = seeds.iter().filter(|input| run(target, input).is_ok()).count();
    assert!(accepted > 0, "no seed is accepted");
    let mut inputs = seeds.clone();
    for (_, input) in target.regressions() {
        let _ = run(target, &input);
        inputs.push(input);
    }
    let mut random = Rng::with_seed(variable("FUZZ_SEED").map_or(1, |seed| seed as u64));
    let minutes = variable("FUZZ_MINUTES");
    let (time, most) = minutes.map_or((TIME, INPUTS), |minutes| (Duration::from_secs_f64(60.0 * minutes), usize::MAX));
    let (start, mut count, mut refused, mut outcomes) = (Instant::now(), 0, 0, BTreeSet::new());
    while count < most && start.elapsed() < time {
        let input = edited(if random.bool() { &seeds } else { &inputs }, target.words, &mut random);
        count += 1;
        if let Err(message) = run(target, &input) {
            refused += 1;
            // Inputs with a new outcome are edited further.
            if outcomes.insert(without_names(&message)) {
                inputs.push(input);
            }
        }
    }
    println!("{name}: {count} edited inputs, {refused} refused, {} different messages", outcomes.len());
    assert!(count < 100 || (refused > 0 && refused < count), "{refused} of {count} refused");
    std::fs::remove_file(kept(name)).unwrap();
}

macro_rules! tests {
    ($($name:ident)*) => {
        $(#[test] fn $name() { fuzz(stringify!($name)) })*

        #[test]
        fn every_target_has_a_test_and_a_program() {
            let names = TARGETS.map(|target| target.name);
            assert_eq!(names, [$(stringify!($name)),*]);
            let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../Cargo.toml");
            let manifest = std::fs::read_to_string(manifest).unwrap();
            for name in names {
                assert!(manifest.contains(&format!("{{ name = \"{name}\", ")), "fuzz/Cargo.toml has no {name}");
            }
        }
    };
}

tests! {
    arcsim body bvh camera checkpoint declarations depth_image formula glb gltf image_list joints material obj rig
    run_folder scene skeleton sweep track
}
