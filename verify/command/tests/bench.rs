//! Run time and error of every way to a Hessian.

use verify_command::bench::{bench, markdown, plots};

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
    assert!(list.iter().all(|m| m.nanoseconds > 0.1));
    assert!(plots(&list).len() == 2 && markdown(&list).lines().count() == 2 + list.len());
    assert!(bench(&["Nothing".into()]).unwrap_err().contains("HairBend"));
}
