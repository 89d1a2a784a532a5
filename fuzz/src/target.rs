//! The program of each target: libFuzzer feeds it with inputs, and the name of the program selects the target.

#![no_main]

use std::alloc::System;
use std::sync::LazyLock;

use cap::Cap;
use fuzz_targets::Target;

/// Memory of an input, in bytes: a limit, and a factor of the size of the input.
const MEMORY_LIMIT: usize = 300 << 20;
const MEMORY_FACTOR: usize = 20;

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

static TARGET: LazyLock<&Target> = LazyLock::new(|| fuzz_targets::target(env!("CARGO_BIN_NAME")));

libfuzzer_sys::fuzz_target!(|input: &[u8]| {
    let limit = MEMORY.allocated() + MEMORY_LIMIT + MEMORY_FACTOR * input.len();
    MEMORY.set_limit(limit).expect("the limit exceeds what is allocated");
    let _ = TARGET.run(input);
});
