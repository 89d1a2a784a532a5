//! Conversions from and to nalgebra keep the order of points, rows and columns.

use energy_dsl::interop::{points_from, points_to, quaternion_from, quaternion_to};
use energy_dsl::{ForceLaw, Potential, Residual, energy};
use nalgebra::{DVector, Point3, UnitQuaternion, Vector3};

energy! {
    energy Skew(p, q: Point; k: Scalar[N/m]) { k * p.x * q.y + k * p.z * p.z }
    force Turn(_p: Point, v: Velocity; b: Scalar[kg/s]) { cross(v, vector(0, 0, b)) }
    residual Two(a, b: Scalar) { vector(a * b, a + 2.0 * b) }
}

#[test]
fn a_hessian_is_the_full_symmetric_matrix() {
    let x = points_from(&[Point3::new(1.0, 2.0, 3.0), Point3::new(4.0, 5.0, 6.0)]);
    let at = Skew::new(2.0).hessian(&x);
    let (gradient, hessian) = (at.gradient_vector(), at.hessian_matrix());
    assert_eq!(gradient, DVector::from_vec(vec![10.0, 0.0, 12.0, 0.0, 2.0, 0.0]));
    assert_eq!(Skew::new(2.0).gradient(&x).gradient_vector(), gradient);
    // ∂²U/∂p.x ∂q.y = k below and above the diagonal, ∂²U/∂p.z² = 2 k, the rest 0.
    assert_eq!((hessian[(0, 4)], hessian[(4, 0)], hessian[(2, 2)]), (2.0, 2.0, 4.0));
    assert_eq!(hessian.sum(), 8.0);
    let back: [Vector3<f64>; 2] = points_to(&at.gradient);
    assert_eq!(back[0], Vector3::new(10.0, 0.0, 12.0));
}

#[test]
fn jacobians_have_a_row_per_result() {
    let at = Two::new().jacobian(&[3.0, 5.0]);
    let jacobian = at.jacobian_matrix();
    assert_eq!(at.residual_vector().as_slice(), [15.0, 13.0]);
    assert_eq!((jacobian[(0, 0)], jacobian[(0, 1)], jacobian[(1, 0)], jacobian[(1, 1)]), (5.0, 3.0, 1.0, 2.0));

    let at = Turn::new(2.0).jacobians(&[[0.0; 3]], &[[0.0, 1.0, 0.0]]);
    assert_eq!(at.force_vector().as_slice(), [2.0, 0.0, 0.0]);
    assert_eq!((at.by_velocity_matrix()[(0, 1)], at.by_velocity_matrix()[(1, 0)]), (2.0, -2.0));
    assert_eq!(at.by_position_matrix().amax(), 0.0);
}

#[test]
fn a_quaternion_stores_w_first() {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 1.0_f64);
    let numbers = quaternion_from(&rotation);
    assert_eq!(numbers, [0.5_f64.cos(), 0.5_f64.sin(), 0.0, 0.0]);
    assert_eq!(quaternion_to(numbers), *rotation.quaternion());
}
