//! Sequences of points that are nearly straight, folded back, flat or coincident.

use super::{Extreme, dyadic};
use crate::sample::Sample;

/// Distances from the singularity.
const DISTANCES: [f64; 2] = [1.0 / (1 << 27) as f64, 1.0 / (1 << 13) as f64];

/// Returns inputs in which some consecutive points are nearly straight, folded back, in a plane or coincident. The
/// other points stay.
pub(super) fn sequences(ordinary: &Sample) -> Vec<Extreme> {
    let points: Vec<[f64; 3]> =
        ordinary.positions.chunks_exact(3).map(|p| [dyadic(p[0]), dyadic(p[1]), dyadic(p[2])]).collect();
    let count = points.len();
    let with = |changed: &[(usize, [f64; 3])]| {
        let mut points = points.clone();
        changed.iter().for_each(|&(number, point)| points[number] = point);
        Sample { positions: points.concat(), ..ordinary.clone() }
    };
    let mut list = Vec::new();
    for t in DISTANCES {
        let mut add = |name: &str, changed: &[(usize, [f64; 3])]| {
            list.push(Extreme::new(format!("{name}, at a distance of {t:.0e}"), with(changed)));
        };
        for k in 0..count.saturating_sub(2).min(3) {
            let [x, y, z] = points[k];
            let middle = [x + 1.0, y, z];
            add("where points are nearly folded back", &[(k + 1, middle), (k + 2, [x + 0.25, y + t, z])]);
            add("where points are nearly straight", &[(k + 1, middle), (k + 2, [x + 2.5, y + t, z])]);
        }
        if count == 4 {
            // The second triangle shares the edge of the last two points, or of the middle two.
            let hinge = |a: [f64; 3], b: [f64; 3], order: [usize; 4]| {
                let corners = [a, b, [0.0; 3], [0.0, 1.0, 0.0]];
                order.into_iter().zip(corners).collect::<Vec<_>>()
            };
            for order in [[0, 1, 2, 3], [0, 3, 1, 2]] {
                add("where points are nearly flat", &hinge([1.0, 0.25, t], [-0.75, 0.5, 0.0], order));
                add("where points are nearly folded", &hinge([1.0, 0.25, t], [0.75, 0.5, 0.0], order));
            }
        }
        if count >= 2 {
            let [x, y, z] = points[0];
            add("where points are nearly coincident", &[(1, [x, y + t, z])]);
        }
    }
    list
}
