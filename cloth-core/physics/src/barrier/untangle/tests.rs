use std::f64::consts::PI;

use fastrand::Rng;

use super::*;
use crate::barrier::BarrierContact;
use crate::collision::{CollisionMesh, Exclusions, crossings};

const THICKNESS: f64 = 1e-3;
const GAP: f64 = 2e-3;

/// Random numbers.
struct Random(Rng);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.f64()
    }
}

#[derive(Default)]
struct Sheets {
    x: Vec<Vector3<f64>>,
    triangles: Vec<[usize; 3]>,
}

impl Sheets {
    /// Adds a square of n × n cells of size h, mapped from the plane.
    fn add(&mut self, n: usize, h: f64, map: impl Fn([f64; 2]) -> Vector3<f64>) {
        let first = self.x.len();
        let at = |i: usize, j: usize| first + i * (n + 1) + j;
        for i in 0..=n {
            for j in 0..=n {
                self.x.push(map([h * (i as f64 - 0.5 * n as f64), h * (j as f64 - 0.5 * n as f64)]));
            }
        }
        for i in 0..n {
            for j in 0..n {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
                let halves = if (i + j) % 2 == 0 { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] };
                self.triangles.extend(halves);
            }
        }
    }

    fn participants(&self) -> Participants {
        let vertices = self.x.len();
        Participants {
            mesh: CollisionMesh::new(vertices, &self.triangles, &[], &[]),
            is_free: vec![true; vertices],
            radii: vec![0.5 * THICKNESS; vertices],
            gaps: vec![GAP; vertices],
            obstacles: Vec::new(),
            exclusions: Exclusions::default(),
            with_itself: true,
        }
    }
}

/// Starts that cross themselves by up to twice the thickness.
fn random_start(random: &mut Random) -> Sheets {
    let mut sheets = Sheets::default();
    let (h, n) = (random.between(5e-3, 2e-2), random.0.usize(6..10));
    let [a, b, c, turn] = [PI, 2.0 * PI, 2.0 * PI, PI].map(|most| random.between(0.0, most));
    let (waves, size) = (random.between(0.5, 2.0) * PI / (h * n as f64), h * n as f64);
    match random.0.usize(..4) {
        // Two sheets, one of which sags through the other.
        0 => {
            let depth = random.between(0.1, 2.0) * THICKNESS;
            sheets.add(n, h, |[u, v]| [u, v, 0.0]);
            let (sine, cosine) = turn.sin_cos();
            let height = random.between(1.0, 4.0) * THICKNESS;
            sheets.add(n, 1.1 * h, |[u, v]| {
                let sag = (waves * u + a).cos() * (waves * v + b).cos();
                [cosine * u - sine * v, sine * u + cosine * v, height - (height + depth) * sag * sag]
            });
        }
        // Two sheets whose vertices lie on either side of each other, without any order.
        1 => {
            let mut heights: Vec<f64> =
                (0..2 * (n + 1) * (n + 1)).map(|_| random.between(-THICKNESS, THICKNESS)).collect();
            for shift in [0.0, 0.3 * h] {
                let own = std::cell::RefCell::new(heights.split_off(heights.len() - (n + 1) * (n + 1)));
                sheets.add(n, h, |[u, v]| [u + shift, v + 0.7 * shift, own.borrow_mut().pop().unwrap()]);
            }
        }
        // A sheet folded on itself, whose upper layer sags through the lower one.
        2 => {
            let radius = random.between(1.0, 3.0) * THICKNESS;
            let depth = random.between(0.1, 2.0) * THICKNESS;
            let around = PI * radius;
            sheets.add(2 * n, h, |[u, v]| {
                let past = u - 0.5 * around;
                if u < -0.5 * around {
                    [u + 0.5 * around, v, 0.0]
                } else if past < 0.0 {
                    let angle = (u + 0.5 * around) / radius;
                    [radius * angle.sin(), v, radius * (1.0 - angle.cos())]
                } else {
                    let sag = ((past / (0.8 * size)).min(1.0) * PI).sin().powi(2) * (waves * v + c).cos().powi(2);
                    [-past, v, 2.0 * radius - (2.0 * radius + depth) * sag]
                }
            });
        }
        // Three layers.
        _ => {
            for layer in 0..3 {
                let [lift, phase] = [f64::from(layer) * 2.0 * THICKNESS, a * f64::from(layer)];
                let depth = random.between(1.0, 2.0) * THICKNESS;
                sheets.add(n, h * (1.0 + 0.07 * f64::from(layer)), |[u, v]| {
                    [u, v, lift + depth * (waves * u + phase).sin() * (waves * v + b).cos()]
                });
            }
        }
    }
    sheets
}

#[test]
fn shallow_crossings_are_repaired() {
    let mut random = Random(Rng::with_seed(7));
    let (mut repaired, mut crossed) = (0, 0);
    const STARTS: usize = 100;
    while crossed < STARTS {
        let sheets = random_start(&mut random);
        let participants = sheets.participants();
        if crossings(&participants.mesh, &sheets.x).is_empty() {
            continue;
        }
        crossed += 1;
        // Sometimes the first quarter of all vertices is pinned.
        let pinned = if crossed % 4 == 0 { sheets.x.len() / 4 } else { 0 };
        let is_movable: Vec<bool> = (0..sheets.x.len()).map(|vertex| vertex >= pinned).collect();
        let untangling = Untangling { participants: &participants, solids: &[], is_movable };
        let Some(x) = untangling.repair(&sheets.x) else { continue };
        assert_eq!(crossings(&participants.mesh, &x), []);
        assert_eq!(x[..pinned], sheets.x[..pinned]);
        assert_eq!(untangling.repair(&x).as_ref(), Some(&x), "a start without fault stays as it is");
        BarrierContact::among(participants, &x).unwrap_or_else(|error| panic!("{error}"));
        repaired += 1;
    }
    assert!(repaired >= 95 * STARTS / 100, "{repaired} of {STARTS}");
}
