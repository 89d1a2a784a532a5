//! Instruction counts under Valgrind, for 160 elements: `cargo bench --manifest-path energy-bench/Cargo.toml --bench
//! instructions --features instructions`.
//!
//! It needs Valgrind and the gungraun-runner of gungraun's version. Valgrind does not support AVX-512: AVX2 is the best
//! level.

#![allow(missing_docs)]

use energy_bench::contenders::{Contender, contenders};
use energy_bench::kernels::{HairBendKernel, HingeKernel, PointToPlaneKernel, SpringKernel, StVKKernel};
use energy_bench::{Subject, Work, samples};
use energy_dsl::LevelName::Avx2;
use gungraun::prelude::*;

const ELEMENTS: usize = 160;

const GENERATED: Contender = Contender::GeneratedScalar(Avx2);
const HAND: Contender = Contender::HandScalar(Avx2);
const GENERATED_LANES: Contender = Contender::GeneratedLanes(Avx2);
const HAND_LANES: Contender = Contender::HandLanes(Avx2);

/// Returns the work of a contender after one warm-up run.
fn work<K: Subject>(wanted: Contender) -> Work {
    let mut all = contenders::<K>(&samples::<K>(ELEMENTS));
    let index = all.iter().position(|(contender, _)| *contender == wanted).expect("this machine has AVX2");
    let mut work = all.swap_remove(index).1;
    work();
    work
}

#[library_benchmark]
#[benches::k1_spring(
    args = [GENERATED, HAND, GENERATED_LANES, HAND_LANES, Contender::Dual],
    setup = work::<SpringKernel>
)]
#[benches::k2_hair_bend(
    args = [GENERATED, HAND, GENERATED_LANES, HAND_LANES, Contender::Dual],
    setup = work::<HairBendKernel>
)]
#[benches::k3_hinge(
    args = [GENERATED, HAND, GENERATED_LANES, HAND_LANES, Contender::Dual],
    setup = work::<HingeKernel>
)]
#[benches::k4_stvk(args = [GENERATED, HAND, GENERATED_LANES, HAND_LANES, Contender::Dual], setup = work::<StVKKernel>)]
#[benches::k5_point_to_plane(
    args = [GENERATED, HAND, GENERATED_LANES, HAND_LANES, Contender::Dual],
    setup = work::<PointToPlaneKernel>
)]
fn instructions(mut work: Work) -> Work {
    work();
    work
}

library_benchmark_group!(name = kernels, benchmarks = [instructions]);
main!(library_benchmark_groups = kernels);
