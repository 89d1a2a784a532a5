use energy_dsl::{Declaration, Kind};

use verify::sample::{Sample, Sampler, has_points};

/// Inputs on the way to a singularity.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Name of the singularity.
    pub name: &'static str,
    /// Distance from the singularity, and the input.
    pub inputs: Vec<(f64, Sample)>,
}

/// Points of an axis-aligned configuration, so that tiny distances are exact doubles.
type Place = fn(f64) -> Vec<[f64; 3]>;

const ONE: &[(&str, Place)] = &[("at the origin", |t| vec![[t, 0.0, 0.0]])];
const TWO: &[(&str, Place)] = &[
    ("coincident points", |t| vec![[0.5, 0.25, 1.0], [0.5, 0.25, 1.0 + t]]),
    ("coincident points at the origin", |t| vec![[t, -2.0 * t, 0.5 * t], [0.0, 0.0, 0.0]]),
];
const THREE: &[(&str, Place)] = &[
    ("straight", |t| vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, t, 0.0]]),
    ("folded back", |t| vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, t, 0.0]]),
    ("coincident points", |t| vec![[t, 0.0, 0.0], [0.0, 0.0, 0.0], [0.25, 1.0, 0.5]]),
    ("needle", |t| vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, t, 0.5 * t]]),
];
const FOUR: &[(&str, Place)] = &[
    ("flat", |t| vec![[1.0, 0.25, t], [-0.75, 0.5, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    ("folded", |t| vec![[1.0, 0.25, t], [0.75, 0.5, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    ("folded from below", |t| vec![[1.0, 0.25, -t], [0.75, 0.5, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    ("needle", |t| vec![[t, 0.25, 0.5 * t], [-0.75, 0.5, 0.25], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    ("short edge", |t| vec![[1.0, 0.25, 0.5], [-0.75, 0.5, 0.25], [0.0, 0.0, 0.0], [0.0, t, 0.0]]),
];

/// Returns the sweeps that fit a declaration of points: towards coincidence, straightness, flatness, folds and needles,
/// to the smallest and largest scales, far from the origin, and to its rest state. The first sweeps end at the
/// singularity itself.
#[must_use]
pub fn sweeps(declaration: &Declaration) -> Vec<Sweep> {
    if !has_points(declaration) {
        return Vec::new();
    }
    let places = match declaration.points.len() {
        1 => ONE,
        2 => TWO,
        3 => THREE,
        4 => FOUR,
        _ => &[],
    };
    // Parameters and rest shape are those of one ordinary input.
    let ordinary = Sampler::new(declaration, 7).sample();
    let with = |points: Vec<[f64; 3]>| Sample { positions: points.concat(), ..ordinary.clone() };
    let mut list: Vec<Sweep> = places
        .iter()
        .map(|(name, place)| Sweep { name, inputs: small().map(|t| (t, with(place(t)))).collect() })
        .collect();
    let Some((_, generic)) = places.first() else { return list };
    let generic = generic(0.5).concat();
    let scaled = |scale: f64| {
        let by = |numbers: &[f64]| numbers.iter().map(|x| x * scale).collect();
        Sample { positions: by(&generic), rest: by(&ordinary.rest), ..ordinary.clone() }
    };
    list.push(Sweep { name: "scale", inputs: (-14..=14).map(|k| power(10 * k)).map(|s| (s, scaled(s))).collect() });
    let moved = |by: f64| Sample { positions: generic.iter().map(|x| x + by).collect(), ..ordinary.clone() };
    list.push(Sweep { name: "far from the origin", inputs: (0..=12).map(power).map(|d| (d, moved(d))).collect() });
    list.extend(at_rest(declaration, &ordinary));
    list
}

/// Sweeps towards the rest shape, or a rest length if a parameter is one.
fn at_rest(declaration: &Declaration, ordinary: &Sample) -> Option<Sweep> {
    let inputs: Vec<(f64, Sample)> =
        if let Some((dimension, count)) = declaration.rest_points().filter(|&(_, n)| n == declaration.points.len()) {
            // Halves of integers keep sums with powers of two exact.
            let rest: Vec<f64> = [0.0, 0.0, 1.0, 0.0, 0.5, 1.5].into_iter().cycle().take(3 * dimension).collect();
            if (dimension, count) != (2, 3) {
                return None;
            }
            let positions = |t: f64| {
                let stretch = 1.0 + t;
                rest.chunks(2).flat_map(|p| [stretch * p[0], p[1], 0.0]).collect()
            };
            small()
                .filter(|&t| t == 0.0 || t > 1e-16)
                .map(|t| (t, Sample { positions: positions(t), rest: rest.clone(), ..ordinary.clone() }))
                .collect()
        } else {
            let mut number = 0;
            let length = declaration.parameters.iter().find_map(|field| {
                number += field.size;
                (field.unit == "m" && field.size == 1).then_some(number - 1)
            })?;
            if declaration.points.len() != 2 {
                return None;
            }
            let sample = |t: f64| {
                let mut sample = ordinary.clone();
                sample.positions = vec![0.0, 0.0, 0.0, 3.0, 4.0, 0.0];
                sample.parameters[length] = 5.0 * (1.0 + t);
                sample
            };
            small().filter(|&t| t == 0.0 || t > 1e-16).map(|t| (t, sample(t))).collect()
        };
    debug_assert!(matches!(declaration.kind, Kind::Energy | Kind::Constraint | Kind::Force));
    Some(Sweep { name: "rest", inputs })
}

/// From 0.1 to 1e-300 and 0: every decade where doubles lose digits, then every forty.
fn small() -> impl Iterator<Item = f64> {
    (1..20).chain((20..=300).step_by(40)).map(|k| power(-k)).chain([0.0])
}

fn power(exponent: i32) -> f64 {
    10.0_f64.powi(exponent)
}
