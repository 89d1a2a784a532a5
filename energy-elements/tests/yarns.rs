//! The yarn law: the numbers of testers, smooth joints, and convexity.

use energy_dsl::Potential;
use energy_elements::YarnMembrane;

const REST: [[f64; 2]; 3] = [[0.1, 0.0], [1.0, 0.25], [0.0, 0.75]];

/// One direction: k, a, b, m, c, w.
#[derive(Clone, Copy)]
struct Direction([f64; 6]);

impl Direction {
    /// The tension f′(ε), from its definition.
    fn tension(self, e: f64) -> f64 {
        let Self([k, a, b, m, c, w]) = self;
        let curve = |e: f64| k * e + a * e.powi(3) + b * e.powi(5);
        let squeezed = |e: f64| k * e + (k - c) / (2.0 * w) * e * e;
        match e {
            e if e > m => curve(m) + (k + 3.0 * a * m * m + 5.0 * b * m.powi(4)) * (e - m),
            e if e >= 0.0 => curve(e),
            e if e >= -w => squeezed(e),
            e => squeezed(-w) + c * (e + w),
        }
    }
}

fn element(u: Direction, v: Direction, coupling: f64, shear: [f64; 4]) -> YarnMembrane {
    let ([u0, u1, u2], Direction(p), Direction(q), s) = (REST, u, v, shear);
    let [ku, au, bu, mu, cu, wu] = p;
    let [kv, av, bv, mv, cv, wv] = q;
    YarnMembrane::new(u0, u1, u2, ku, au, bu, mu, cu, wu, kv, av, bv, mv, cv, wv, coupling, s[0], s[1], s[2], s[3])
        .unwrap()
}

fn area() -> f64 {
    let [[ax, ay], [bx, by], [cx, cy]] = REST;
    0.5 * ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
}

/// The triangle whose yarns have these strains, with the sine of the angle of shear.
fn at(e_u: f64, e_v: f64, sine: f64) -> [[f64; 3]; 3] {
    let cosine = (1.0 - sine * sine).sqrt();
    REST.map(|[x, y]| [(1.0 + e_u) * x + (1.0 + e_v) * sine * y, (1.0 + e_v) * cosine * y, 0.0])
}

/// The energy per area.
fn density(element: &YarnMembrane, e_u: f64, e_v: f64, sine: f64) -> f64 {
    element.value(&at(e_u, e_v, sine)).value / area()
}

/// The KES numbers LT = 0.75, EMT = 0.08, 490.3 N/m; and a knit that buckles.
fn shirting() -> Direction {
    let (lt, load, emt): (f64, f64, f64) = (0.75, 490.3, 0.08);
    let k = (2.0 * lt - 1.0) * load / emt;
    Direction([k, 2.0 * (1.0 - lt) * load / emt.powi(3), 0.0, emt, 0.2 * k, 0.01])
}
const KNIT: Direction = Direction([50.0, 20.0, 300.0, 0.5, 5.0, 0.02]);

#[test]
fn the_tension_is_the_curve_of_the_tester() {
    let membrane = element(shirting(), KNIT, 20.0, [30.0, 100.0, 50.0, 0.14]);
    for (number, direction) in [shirting(), KNIT].into_iter().enumerate() {
        for e in [-0.3, -0.02, -0.005, 1e-4, 0.03, 0.08, 0.2, 0.6] {
            // With the other direction held at its length.
            let energy =
                |e: f64| if number == 0 { density(&membrane, e, 0.0, 0.0) } else { density(&membrane, 0.0, e, 0.0) };
            let h = 1e-5;
            let tension = (energy(e + h) - energy(e - h)) / (2.0 * h);
            assert!((tension - direction.tension(e)).abs() < 1e-5 * direction.tension(1.0), "{number} {e}: {tension}");
        }
    }
    // KES: 490.3 N/m at EMT, and the work LT/2 · F · EMT until there.
    assert!((shirting().tension(0.08) - 490.3).abs() < 1e-9);
    assert!((density(&membrane, 0.08, 0.0, 0.0) - 0.5 * 0.75 * 490.3 * 0.08).abs() < 1e-9);
}

#[test]
fn the_shear_force_is_that_of_the_tester() {
    let [k, a, b, m] = [30.0, 100.0, 50.0, 0.14];
    let membrane = element(shirting(), KNIT, 20.0, [k, a, b, m]);
    let curve = |s: f64| 0.5 * k * s * s + 0.25 * a * s.powi(4) + b / 6.0 * s.powi(6);
    let slope = k + 3.0 * a * m * m + 5.0 * b * m.powi(4);
    let force = k * m + a * m.powi(3) + b * m.powi(5);
    for sine in [-0.5_f64, -0.14, -0.05, 0.0, 0.1, 0.14, 0.3] {
        let t = (sine.abs() - m).max(0.0);
        let exact = curve(sine.abs().min(m)) + force * t + 0.5 * slope * t * t;
        let found = density(&membrane, 0.0, 0.0, sine);
        assert!((found - exact).abs() < 1e-12 * (1.0 + exact), "{sine}: {found} {exact}");
    }
}

#[test]
fn second_derivatives_join_without_a_jump() {
    let membrane = element(shirting(), KNIT, 20.0, [30.0, 100.0, 50.0, 0.14]);
    let joints = [
        (0.0, 0.1, 0.02),
        (0.08, 0.1, 0.02),
        (-0.01, 0.1, 0.02),
        (0.03, 0.0, 0.02),
        (0.03, 0.5, 0.02),
        (0.03, -0.02, 0.02),
    ];
    for (e_u, e_v, sine) in joints {
        let hessian = |shift: f64| membrane.hessian(&at(e_u + shift, e_v + shift, sine));
        let (below, above) = (hessian(-1e-9), hessian(1e-9));
        let [below, above] = [below, above].map(|one| one.hessian.as_flattened().as_flattened().to_vec());
        let largest = above.iter().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
        for (one, other) in below.iter().zip(&above) {
            assert!((one - other).abs() < 1e-4 * largest, "{e_u} {e_v}: {one} {other}");
        }
    }
}

#[test]
fn the_energy_is_convex_in_strains_and_shear() {
    let shirting = shirting();
    let (Direction([k_u, .., c_u, _]), Direction([k_v, .., c_v, _])) = (shirting, KNIT);
    let bound = (k_u.min(c_u) * k_v.min(c_v)).sqrt();
    let draw = |seed: u32| f64::from(seed.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24);
    // The largest lack of convexity at midpoints; s = (1 + ε_u)(1 + ε_v) sin γ is the third variable.
    let lack = |coupling: f64| {
        let membrane = element(shirting, KNIT, coupling, [30.0, 100.0, 50.0, 0.14]);
        let energy = |[e_u, e_v, s]: [f64; 3]| density(&membrane, e_u, e_v, s / ((1.0 + e_u) * (1.0 + e_v)));
        let state = |seed: u32| [0, 1, 2].map(|axis| 0.6 * draw(3 * seed + axis) - [0.3, 0.3, 0.15][axis as usize]);
        // Pairs of states near each other and far apart.
        let one = |seed: u32| {
            let (a, other) = (state(2 * seed), state(2 * seed + 1));
            let near = if seed.is_multiple_of(2) { 1.0 } else { 0.05 };
            let b = [0, 1, 2].map(|axis| a[axis] + near * (other[axis] - a[axis]));
            let middle = [0, 1, 2].map(|axis| 0.5 * (a[axis] + b[axis]));
            energy(middle) - 0.5 * (energy(a) + energy(b))
        };
        (0..100_000).map(one).fold(f64::NEG_INFINITY, f64::max)
    };
    assert!(lack(0.999 * bound) < 1e-12, "{}", lack(0.999 * bound));
    assert!(lack(1.5 * bound) > 1e-5, "a larger coupling is not convex: {}", lack(1.5 * bound));
}
