//! The linking number of both edges of a closed ribbon: it stays the same while the ribbon twists and writhes.

use energy_solve::{Inertia, KindSolver, MixedIntegrator, MixedNewtonOptions, MixedScheme, MixedState};

use super::ValidateError;
use super::rod::{Ends, Rod, Vector, ring, unit};
use crate::geometry::{cross, dot, subtract};

/// Returns Tw + Wr of a closed rod with a linking number of 1 after each of some steps, at its furthest from 1, and how
/// far the writhe changed.
///
/// The twist is the sum of the states of `RodTwist`, as the angles of a closed rod cancel. Tw + Wr of a closed polygon
/// is a whole number (Călugăreanu 1961), or here the number that was put in.
pub(super) fn drift(segments: usize, steps: usize) -> Result<[f64; 2], ValidateError> {
    // Less twist than a ring buckles at, so that it does not pass through itself.
    let put_in = 1.0;
    let points = ring(segments);
    let mut rod = Rod::new(points, [0.0, 0.0, 1.0], Ends::FreeRing(put_in * std::f64::consts::TAU), [1.0; 2], 1.0);
    rod.stretching = 1e3;
    let loaded = rod.at_rest()?;
    let spacing = std::f64::consts::TAU / segments as f64;
    let inertia: Vec<Inertia> =
        (0..2 * segments).map(|unknown| Inertia::Mass(spacing * if unknown % 2 == 0 { 1.0 } else { 0.01 })).collect();
    let mut state = MixedState::at_rest(&loaded.system, loaded.u);
    for point in 0..segments {
        // A push out of the plane.
        let along = point as f64 * spacing;
        state.rates[loaded.system.body().first_increment(2 * point) + 2] =
            0.3 * (2.0 * along).sin() + 0.1 * along.cos();
    }
    let (scheme, options) = (MixedScheme::ImplicitMidpoint, MixedNewtonOptions::new(1e-9));
    let mut integrator = MixedIntegrator::new(loaded.system, inertia, scheme, &KindSolver::Automatic, options)?;
    let (mut furthest, mut most_writhe) = (put_in, 0.0_f64);
    for _ in 0..steps {
        integrator.step(&mut state, 5e-3)?;
        let points: Vec<Vector> = (0..segments).map(|point| std::array::from_fn(|i| state.u[4 * point + i])).collect();
        // Two tangents and the twist between their frames are the state of each joint; only this term has one.
        let states = integrator.system().states().by_term.concat();
        let twist: f64 = states.chunks_exact(7).map(|joint| joint[6]).sum::<f64>() / std::f64::consts::TAU;
        let writhe = writhe(&points);
        most_writhe = most_writhe.max(writhe.abs());
        if (twist + writhe - put_in).abs() >= (furthest - put_in).abs() {
            furthest = twist + writhe;
        }
    }
    Ok([furthest, most_writhe])
}

/// Returns the writhe of a closed polygon: the mean over all views of the signs of its crossings. Two edges cross in
/// the views that a quadrilateral on the unit sphere contains (Klenin and Langowski 2000).
fn writhe(points: &[Vector]) -> f64 {
    let count = points.len();
    let mut area = 0.0;
    for i in 0..count {
        for j in i + 2..count {
            // The last edge and the first one are neighbours.
            if (j + 1) % count != i {
                let [a, b] = [points[i], points[(i + 1) % count]];
                let [c, d] = [points[j], points[(j + 1) % count]];
                let corners = [(a, c), (b, c), (b, d), (a, d)].map(|(from, to)| unit(subtract(to, from)));
                area +=
                    solid_angle(corners[0], corners[1], corners[2]) + solid_angle(corners[0], corners[2], corners[3]);
            }
        }
    }
    // Each pair counts twice.
    2.0 * area / (4.0 * std::f64::consts::PI)
}

/// Returns the area of the triangle of three unit vectors on the unit sphere.
fn solid_angle(a: Vector, b: Vector, c: Vector) -> f64 {
    2.0 * dot(a, cross(b, c)).atan2(1.0 + dot(a, b) + dot(b, c) + dot(c, a))
}
