use energy_dsl::Vector3;
use energy_solve::Contact;

use super::active_set::ActivePart;
use super::friction::FrictionStiffness;
use super::rolling::rolling;
use crate::collision::{Closest, CollisionMesh, Pair};

/// Returns the stiffness of some pairs: of their barriers, on obstacles against rolling, and of friction. Those of a
/// pair follow each other. `rows` gives the rows of a pair's vertices in the matrix.
pub(super) fn contacts(
    active: &ActivePart<'_>,
    friction: &FrictionStiffness<'_>,
    mesh: &CollisionMesh,
    rows: impl Fn(&Pair) -> [u32; 4],
    x: &[Vector3<f64>],
) -> Vec<Contact> {
    let mut contacts = Vec::with_capacity(4 * active.len());
    // Friction also acts on pairs that have parted since the start of the step.
    let mut friction = friction.between(active.first, active.end).peekable();
    for (pair, closest, barrier) in active.iter() {
        while let Some((pair, one)) = friction.next_if(|(other, _)| *other < pair) {
            contacts.push(Contact { rows: rows(pair), ..one });
        }
        let rows = rows(pair);
        contacts.push(along_normal(rows, closest.weights, &closest, barrier.curvature));
        if mesh.obstacle_of(pair).is_some() {
            let is_free = |(row, weight): (&u32, &f64)| *row != Contact::FIXED && *weight != 0.0;
            let tilts = rolling(pair, &closest, x).filter(|weights| rows.iter().zip(weights).any(is_free));
            let stiffness = barrier.force * closest.distance;
            contacts.extend(tilts.map(|weights| along_normal(rows, weights, &closest, stiffness)));
        }
    }
    contacts.extend(friction.map(|(pair, one)| Contact { rows: rows(pair), ..one }));
    contacts
}

/// A stiffness against displacements along the normal of a pair.
fn along_normal(rows: [u32; 4], weights: [f64; 4], closest: &Closest, stiffness: f64) -> Contact {
    let n = closest.normal;
    Contact { rows, weights, block: n.map(|a| n.map(|b| stiffness * a * b)) }
}
