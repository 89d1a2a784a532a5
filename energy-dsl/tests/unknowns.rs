//! Generated code of elements with unknowns other than points, and with states. Block tapes of the same text have the
//! same bits; the audit proves that these are right.

use energy_compiler::Interpreted;
use energy_dsl::{
    Element, FieldKind, Inputs, MixedConstraint, MixedForce, MixedPotential, Packed, PackedMixed, Potential, Residual,
    StateSensitivity, Stateful, Stored, triangle_index,
};

energy_dsl::energy! {
    /// Twist between two edges.
    energy Twisting(a, b: Scalar[rad]; C: Scalar[J]) = "C/2 (a − b)²";

    /// A pressure in a closed mesh, by triangle.
    energy Gas(x0, x1, x2: Point, shared p: Scalar[Pa]) { p * dot(x0, cross(x1, x2)) / 6 }

    /// Points of two bodies that meet.
    energy BallJoint(a, b: Motion; k: Scalar[N/m], r, s: Vec3[m]) {
        k / 2 * norm_squared(transform(a, r) - transform(b, s))
    }

    /// Points of a plane, and an angle with a root.
    energy Plane(x0, x1, x2: Point2, t: Scalar; k: Scalar) {
        k * det(columns(x1 - x0, x2 - x0))^2 + norm(x1 - x0) * sin(t)
    }

    /// A point of a body that stays where it is.
    constraint Anchor(a: Motion, y: Point; r: Vec3[m]) { transform(a, r) - y }

    /// A drag on a body.
    force Thrust(x: Point, q: Rotation, v: Velocity, w: Velocity; r: Vec3, c: Scalar) {
        let t = rotate(q, r);
        [-c * v + t, -c * w + cross(t, x)]
    }

    /// Alignment of two vectors.
    residual Align(q: Rotation, s: Scalar; a, b: Vec3) { s * rotate(q, a) - b }

    /// A closed ring around a point, of any of three lengths.
    energy Ring(x: Point, ring: [Point; 3..=5]; w: [Scalar; len(ring)]) {
        sum(i in 0..len(ring), w[i] * norm_squared(cross(ring[i] - x, ring[(i + 1) % len(ring)] - x)))
    }

    /// A spring that yields, with its rest length from the rest shape.
    energy PlasticSpring(x, y: Point; state e: Scalar[m]; rest L: Scalar[m]; k: Scalar[N/m], Y: Scalar[N]) {
        rest { let length = L; }
        let trial = norm(x - y) - length - e;
        let f = k * trial;
        next { e = if abs(f) > Y { e + trial - sign(f) * Y / k } else { e }; }
        k / 2 * trial^2
    }

    /// A spring that creeps, and begins at the length of its rest shape.
    energy Creeping(x, y: Point; rest u, v: Vec3; state l: Scalar[m] = L, n: [Scalar[1]; 2] = [0, 1]; k: Scalar[N/m]) {
        rest { let L = norm(u - v); }
        let e = norm(x - y) - l;
        next { l = l + e / 10; n = [n[1], n[0] + 1]; }
        k / 2 * e^2 + 0 * L * n[0] * k * e
    }

    /// Names that look like those of generated code, and vectors in the state.
    constraint Remembered(x, y: Point; state t0, t1: Vec3) {
        next { t0 = unit(x - y) + 0.5 * t0; t1 = t0; }
        dot(t0 + t1, x - y) - 1
    }
}

/// Numbers of moderate size that no symmetry spares. Rotations get unit length.
fn inputs_of(declaration: &energy_dsl::Declaration, seed: usize) -> [Vec<f64>; 4] {
    let number = |i: usize| ((i + 1) as f64 * 1.7 + seed as f64 * 0.61).sin() * 1.3 + 0.1;
    let numbers = |from: usize, count: usize| (from..from + count).map(number).collect::<Vec<f64>>();
    let mut unknowns = Vec::new();
    for field in declaration.points.iter() {
        let mut own = numbers(unknowns.len(), field.size);
        if field.kind == FieldKind::Rotation {
            let length = own.iter().map(|x| x * x).sum::<f64>().sqrt();
            own.iter_mut().for_each(|x| *x /= length);
        }
        unknowns.extend(own);
    }
    let implied = if declaration.kind == energy_dsl::Kind::Constraint { 2 } else { 0 };
    let size = |fields: &[energy_dsl::Field]| fields.iter().map(|field| field.size).sum::<usize>();
    let parameters = size(&declaration.parameters) + implied + size(&declaration.state);
    [numbers(20, parameters), numbers(40, size(&declaration.rest)), unknowns, numbers(60, declaration.increments())]
}

/// Compares all blocks of generated code with those of a block tape.
pub(crate) fn check<E: Element>() {
    let declaration = E::DECLARATION;
    let tape = Interpreted::from_source(&declaration.source).unwrap().pop().unwrap();
    assert_eq!(tape.declaration().points, declaration.points);
    for seed in 0..20 {
        let [parameters, rest, positions, velocities] = inputs_of(declaration, seed);
        let inputs = Inputs { parameters: &parameters, rest: &rest, positions: &positions, velocities: &velocities };
        let (code, tape) = (E::evaluate::<f64>(&inputs).unwrap(), tape.evaluate(&inputs).unwrap());
        assert_eq!(code.blocks.len(), tape.blocks.len(), "{}", declaration.name);
        for ((name, a), (other, b)) in code.blocks.iter().zip(&tape.blocks) {
            let bits = |numbers: &[f64]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!((name, bits(a)), (other, bits(b)), "{}, seed {seed}", declaration.name);
        }
        assert!(!code.flags[0].any(), "{}, seed {seed}", declaration.name);
    }
}

#[test]
fn tapes_have_the_bits_of_generated_code() {
    check::<Twisting<f64>>();
    check::<Gas<f64>>();
    check::<BallJoint<f64>>();
    check::<Plane<f64>>();
    check::<Anchor<f64>>();
    check::<Thrust<f64>>();
    check::<Align<f64>>();
    check::<Ring3<f64>>();
    check::<Ring5<f64>>();
    check::<PlasticSpring<f64>>();
    check::<Remembered<f64>>();
    check::<Creeping<f64>>();
}

#[test]
fn declarations_say_how_unknowns_move() {
    let gas = Gas::<f64>::DECLARATION;
    assert!(gas.is_mixed() && gas.points[3].shared && !gas.points[0].shared);
    assert_eq!((gas.unknowns(), gas.increments()), (10, 10));
    let joint = BallJoint::<f64>::DECLARATION;
    let kinds: Vec<_> = joint.points.iter().map(|field| (&*field.name, field.kind, field.increments())).collect();
    assert_eq!(
        kinds,
        [
            ("a.position", FieldKind::Point, 3),
            ("a.rotation", FieldKind::Rotation, 3),
            ("b.position", FieldKind::Point, 3),
            ("b.rotation", FieldKind::Rotation, 3)
        ]
    );
    assert_eq!((joint.unknowns(), joint.increments()), (14, 12));
    assert!(!Ring4::<f64>::DECLARATION.is_mixed() && !PlasticSpring::<f64>::DECLARATION.is_mixed());
}

/// A body turned by δ has the energy that its derivatives say.
#[test]
fn rotations_move_by_increments() {
    let joint = BallJoint::<f64>::new(2.0, [1.0, 0.0, 0.0], [0.0; 3]);
    // Both bodies at the origin; the first one is turned by a quarter about z.
    let half = 0.5_f64.sqrt();
    let u = [0.0, 0.0, 0.0, half, 0.0, 0.0, half, 3.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    let at = joint.hessian(&u);
    // The arm points along y, its end is (−3, 0, 0) away, so the torque is 2 (0, 1, 0) × (−3, 0, 0) = (0, 0, 6).
    assert!((at.value - 9.0).abs() < 1e-14);
    assert!((at.gradient[5] - 6.0).abs() < 1e-14 && at.gradient[3].abs() < 1e-14, "{:?}", at.gradient);
    let product = joint.hessian_vector(&u, &std::array::from_fn(|i| f64::from(u8::from(i == 5))));
    assert!((product.product[5] - at.hessian[triangle_index(12, 5, 5)]).abs() < 1e-13);
}

/// The state is read and written number by number, and `next` computes the new one.
#[test]
fn plastic_flow_is_a_state() {
    let mut spring = PlasticSpring::<f64>::new(1.0, 10.0, 0.5, 0.0).unwrap();
    let stretched = [0.0, 0.0, 0.0, 1.2, 0.0, 0.0];
    let next = spring.next(&stretched);
    // A force of 2 N is above the limit of 0.5 N: all but 0.05 m becomes permanent.
    assert!((next.state[0] - 0.15).abs() < 1e-15 && !next.flags.any());
    spring.set_state(&next.state);
    assert_eq!(spring.state(), next.state);
    assert!((spring.gradient(&[[0.0; 3], [1.2, 0.0, 0.0]]).gradient[1][0] - 0.5).abs() < 1e-14);
    let jacobians = spring.next_jacobians(&stretched);
    assert_eq!((jacobians.by_unknowns.len(), jacobians.by_state), (6, [1.0]));
    assert!((spring.state_jacobian(&stretched).by_state[3] + 10.0).abs() < 1e-13);
}

/// A state can begin at rest: `at_rest` computes it from the rest shape and the parameters.
#[test]
fn states_begin_at_rest() {
    let spring = Creeping::<f64>::at_rest([0.0; 3], [3.0, 0.0, 4.0], 2.0).unwrap();
    assert_eq!(spring.state(), [5.0, 0.0, 1.0]);
    let next = spring.next(&[0.0, 0.0, 0.0, 6.0, 0.0, 0.0]);
    assert_eq!(next.state, [5.1, 1.0, 1.0]);
    assert_eq!(spring.value(&[[0.0; 3], [6.0, 0.0, 0.0]]).value, 1.0);
}

#[test]
fn kinds_have_their_traits() {
    fn potential<E: MixedPotential<f64, Upper = [f64; N]>, const N: usize>() {}
    fn constraint<E: MixedConstraint<f64, Rows = [f64; 3], Jacobian = [f64; 27]>>() {}
    fn force<E: MixedForce<f64, Square = [f64; 36]>>() {}
    fn residual<E: Residual<f64, Unknowns = [f64; 5], Jacobian = [f64; 12]>>() {}
    fn packed<E: PackedMixed<f64>>() -> usize {
        <E as Stored<f64>>::NUMBERS
    }
    potential::<Twisting, 3>();
    potential::<Plane, 28>();
    constraint::<Anchor>();
    force::<Thrust>();
    residual::<Align>();
    assert_eq!((packed::<BallJoint>(), packed::<Gas>()), (7, 0));
}

/// Elements in lanes have the bits of single ones.
#[test]
fn lanes_have_the_bits_of_scalars() {
    const COUNT: usize = 37;
    let number = |i: usize| (1.0 + i as f64).sin();
    let planes: Vec<Plane> = (0..COUNT).map(|i| Plane::new(0.7 + number(i) / 2.0)).collect();
    let unknowns: Vec<f64> = (0..COUNT + 6).map(number).collect();
    let stencils: Vec<[u32; 7]> =
        (0..COUNT).map(|i| std::array::from_fn(|place| u32::try_from(i + place).unwrap())).collect();
    let (mut energies, mut gradients, mut hessians) = ([0.0; COUNT], [0.0; 7 * COUNT], [0.0; 28 * COUNT]);
    let packed = Packed::new(&planes, &stencils);
    let flagged = packed.mixed_hessians(0..COUNT, &unknowns, &mut energies, &mut gradients, &mut hessians).unwrap();
    assert!(flagged.is_empty());
    for (i, plane) in planes.iter().enumerate() {
        let at = plane.hessian(&std::array::from_fn(|place| unknowns[i + place]));
        let bits = |numbers: &[f64]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(energies[i].to_bits(), at.value.to_bits());
        assert_eq!(bits(&gradients[7 * i..7 * i + 7]), bits(&at.gradient));
        assert_eq!(bits(&hessians[28 * i..28 * i + 28]), bits(&at.hessian));
    }
}
