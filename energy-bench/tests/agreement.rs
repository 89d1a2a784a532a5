//! All contenders compute the same, and generated gradients are exact near rest.

use energy_bench::agreement::agreement;
use energy_bench::kernels::{HairBendKernel, HingeKernel, PointToPlaneKernel, SpringKernel, StVKKernel};
use energy_bench::near_rest::NearRest;
use energy_bench::{Source, Subject, samples};

/// A multiple of every number of lanes.
const ELEMENTS: usize = 320;

fn check_agreement<K: Subject>() {
    let difference = agreement::<K>(&samples::<K>(ELEMENTS)).unwrap_or_else(|difference| panic!("{difference}"));
    assert!(difference > 0.0, "different code rounds differently: was anything compared?");
}

#[test]
fn springs_agree() {
    check_agreement::<SpringKernel>();
}

#[test]
fn hair_bends_agree() {
    check_agreement::<HairBendKernel>();
}

#[test]
fn hinges_agree() {
    check_agreement::<HingeKernel>();
}

#[test]
fn membranes_agree() {
    check_agreement::<StVKKernel>();
}

#[test]
fn points_to_planes_agree() {
    check_agreement::<PointToPlaneKernel>();
}

fn check_near_rest<K: Subject>() {
    let errors = NearRest::new::<K>(&samples::<K>(16)).expect("the kernel has a rest shape").errors::<K>();
    let error = |source| errors.iter().find(|error| error.source == source).expect("it is measured").roundoffs;
    assert!(error(Source::Generated) <= 12.0, "{errors:?}");
    let others = [Source::HandDerived, Source::NumDual].map(error);
    assert!(others.into_iter().all(|error| error > 1e3), "other formulas cancel digits here: {errors:?}");
}

#[test]
fn nearly_relaxed_springs_are_exact() {
    check_near_rest::<SpringKernel>();
}

#[test]
fn nearly_straight_hair_is_exact() {
    check_near_rest::<HairBendKernel>();
}

#[test]
fn nearly_flat_hinges_are_exact() {
    check_near_rest::<HingeKernel>();
}
