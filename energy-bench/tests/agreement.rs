//! Hand-derived code, dual numbers and the library compute the same, at every level and width of this machine.

use energy_bench::check::agreement;
use energy_bench::kernels::{HairBendKernel, HingeKernel, PointToPlaneKernel, SpringKernel, StVKKernel};
use energy_bench::{Subject, samples};

/// A multiple of every number of lanes.
const ELEMENTS: usize = 320;

fn check<K: Subject>() {
    let difference = agreement::<K>(&samples::<K>(ELEMENTS)).unwrap_or_else(|difference| panic!("{difference}"));
    assert!(difference > 0.0, "different code rounds differently: was anything compared?");
}

#[test]
fn springs_agree() {
    check::<SpringKernel>();
}

#[test]
fn hair_bends_agree() {
    check::<HairBendKernel>();
}

#[test]
fn hinges_agree() {
    check::<HingeKernel>();
}

#[test]
fn membranes_agree() {
    check::<StVKKernel>();
}

#[test]
fn points_to_planes_agree() {
    check::<PointToPlaneKernel>();
}
