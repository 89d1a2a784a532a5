//! Results are bit-identical for one thread and two.

use cloth_core::bench::{Cloth, hang};
use cloth_core::physics::integrator::{Integrator, Newton};

#[test]
fn a_hanging_sheet_is_bit_identical_on_one_thread_and_two() {
    let fallen = |threads: usize| {
        let mut body = hang(Cloth::Cotton, 129).unwrap();
        body.system.set_threads(threads);
        let mut newton = Newton::default();
        let report = (0..2).map(|_| newton.step(&mut body, 0.01).unwrap().iterations).collect::<Vec<_>>();
        (body.x, body.v, report)
    };
    let (one, two) = (fallen(1), fallen(2));
    assert!(one == two, "iterations {:?} and {:?}", one.2, two.2);
    assert!(one.2.iter().all(|&iterations| iterations > 0));
}
