//! Run time and error of every way to a Hessian.

use verify_command::bench::{bench, markdown, plots};

/// With the step at which their errors are least, differences of a hinge have all the digits that they can have: a
/// fixed step left 1.1e-9 to central ones.
#[test]
fn differences_take_their_best_step_and_dual_numbers_one_evaluation() {
    let list = bench(&["HingeAngle".into()]).unwrap();
    let of = |method: &str| list.iter().find(|m| m.method == method).unwrap();
    assert!(of("central differences").error < 3e-10, "{:e}", of("central differences").error);
    assert!(of("Richardson's differences").error < 1e-11, "{:e}", of("Richardson's differences").error);
    // One value per pair of 12 coordinates took twenty times as long as Richardson's differences.
    assert!(of("num-dual").nanoseconds < 8.0 * of("Richardson's differences").nanoseconds);
    assert!(of("num-dual").error < 1e-13);
}

/// Checks the accuracy of each method, not its speed, and that the errors rank as expected.
#[test]
fn methods_agree_to_their_own_accuracy() {
    let list = bench(&["HairBend".into()]).unwrap();
    let error = |method: &str| list.iter().find(|m| m.method == method).unwrap().error;
    assert!((1e-12..1e-4).contains(&error("forward differences")));
    assert!(error("central differences") < error("forward differences"));
    assert!(error("Richardson's differences") < error("central differences"));
    assert!(error("complex step") < 1e-13 && error("num-dual") < 1e-11);
    assert!((1e-9..2e-5).contains(&error("generated, f32")) && error("generated, f64") < 1e-14);
    // Errors of multi-precision and of lanes are measured. Lanes have the bits of single elements.
    assert!((1e-100..1e-30).contains(&error("multi-precision, 30 digits")));
    assert_eq!(error("generated, f64 lanes"), error("generated, f64"));
    assert!(list.iter().all(|m| m.nanoseconds > 0.1));
    assert!(plots(&list).len() == 2 && markdown(&list).lines().count() == 2 + list.len());
    assert!(bench(&["Nothing".into()]).unwrap_err().contains("HairBend"));
}
