//! Criterion's statistics of one run over all elements: `cargo bench --manifest-path energy-bench/Cargo.toml --bench
//! kernels`.

#![allow(missing_docs)]

use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use energy_bench::contenders::contenders;
use energy_bench::{Subject, for_each_kernel, samples};

const ELEMENTS: usize = 1600;

fn kernel<K: Subject>(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group(format!("{} {}", K::KEY, K::TITLE));
    group.sample_size(10).warm_up_time(Duration::from_millis(100)).measurement_time(Duration::from_millis(300));
    group.throughput(Throughput::Elements(ELEMENTS as u64));
    for (contender, mut work) in contenders::<K>(&samples::<K>(ELEMENTS)) {
        group.bench_function(contender.to_string(), |bencher| bencher.iter(&mut work));
    }
    group.finish();
}

fn kernels(criterion: &mut Criterion) {
    macro_rules! each {
        ($kernel:ty) => {
            kernel::<$kernel>(criterion)
        };
    }
    for_each_kernel!(each);
}

criterion_group!(benches, kernels);
criterion_main!(benches);
