//! Instructions under Valgrind, of 160 elements: `cargo bench -p energy-bench --bench instructions --features
//! instructions`. It needs Valgrind and gungraun-runner of gungraun's version. Valgrind has no AVX-512, so AVX2 is the
//! best level it sees.

#![allow(missing_docs)]

use energy_bench::contenders::{Contender, contenders};
use energy_bench::kernels::{HairBendKernel, HingeKernel, PointToPlaneKernel, SpringKernel, StVKKernel};
use energy_bench::{Subject, Work, samples};
use energy_dsl::LevelName::Avx2;
use gungraun::prelude::*;

const ELEMENTS: usize = 160;

const LIBRARY: Contender = Contender::LibraryScalar(Avx2);
const HAND: Contender = Contender::HandScalar(Avx2);
const LIBRARY_LANES: Contender = Contender::LibraryLanes(Avx2);
const HAND_LANES: Contender = Contender::HandLanes(Avx2);

/// The work of a contender. It has run once: what is counted is not the first call's.
fn work<K: Subject>(of: Contender) -> Work {
    let mut all = contenders::<K>(&samples::<K>(ELEMENTS));
    let place = all.iter().position(|(contender, _)| *contender == of).expect("this machine has AVX2");
    let mut work = all.swap_remove(place).1;
    work();
    work
}

#[library_benchmark]
#[benches::k1_spring(args = [LIBRARY, HAND, LIBRARY_LANES, HAND_LANES, Contender::Dual], setup = work::<SpringKernel>)]
#[benches::k2_hair_bend(
    args = [LIBRARY, HAND, LIBRARY_LANES, HAND_LANES, Contender::Dual],
    setup = work::<HairBendKernel>
)]
#[benches::k3_hinge(args = [LIBRARY, HAND, LIBRARY_LANES, HAND_LANES, Contender::Dual], setup = work::<HingeKernel>)]
#[benches::k4_stvk(args = [LIBRARY, HAND, LIBRARY_LANES, HAND_LANES, Contender::Dual], setup = work::<StVKKernel>)]
#[benches::k5_point_to_plane(
    args = [LIBRARY, HAND, LIBRARY_LANES, HAND_LANES, Contender::Dual],
    setup = work::<PointToPlaneKernel>
)]
fn instructions(mut work: Work) -> Work {
    work();
    work
}

library_benchmark_group!(name = kernels, benchmarks = [instructions]);
main!(library_benchmark_groups = kernels);
