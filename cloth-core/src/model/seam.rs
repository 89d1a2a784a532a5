use std::collections::BTreeSet;

use energy_dsl::Vector3;

use super::UnknownPart;
use crate::geometry::{norm, subtract};
use crate::scene::Seam;

/// A seam that joins nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SeamError {
    /// No such part.
    #[error("seams[{seam}]: {0}", .error)]
    Name {
        /// Which seam, from 0.
        seam: usize,
        /// What is wrong.
        error: UnknownPart,
    },
    /// Neither or both ways to choose vertices.
    #[error("seams[{seam}]: give either `pairs` or `within`")]
    Choice {
        /// Which seam, from 0.
        seam: usize,
    },
    /// No such vertex.
    #[error("seams[{seam}]: {garment} has no vertex {vertex}; it has {vertices} (0 to {})", .vertices.saturating_sub(1))]
    NoSuchVertex {
        /// Which seam, from 0.
        seam: usize,
        /// The garment.
        garment: String,
        /// The vertex it names.
        vertex: usize,
        /// The number of vertices.
        vertices: usize,
    },
    /// A vertex joined to itself.
    #[error("seams[{seam}]: vertex {vertex} of {garment} is joined to itself")]
    Itself {
        /// Which seam, from 0.
        seam: usize,
        /// The garment.
        garment: String,
        /// The vertex.
        vertex: usize,
    },
    /// Nothing within reach.
    #[error("seams[{seam}]: no edges of {} and {} come within {within} m at the start; the nearest are {nearest:.3e} m apart", .garments[0], .garments[1])]
    OutOfReach {
        /// Which seam, from 0.
        seam: usize,
        /// The two.
        garments: [String; 2],
        /// As given, in m.
        within: f64,
        /// How far they are apart, in m.
        nearest: f64,
    },
}

/// One end of a seam: a part of the scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side<'a> {
    /// Its vertices at the start.
    pub start: &'a [Vector3<f64>],
    /// Those on its edge.
    pub edge: &'a [usize],
}

/// The pairs of vertices that it joins, each counted within its part.
pub(super) fn joined(description: &Seam, seam: usize, sides: [Side<'_>; 2]) -> Result<Vec<[usize; 2]>, SeamError> {
    let same = description.garments[0] == description.garments[1];
    let pairs = match (&description.pairs, description.within) {
        (Some(pairs), None) => pairs.clone(),
        (None, Some(within)) => nearby(description, seam, sides, within, same)?,
        _ => return Err(SeamError::Choice { seam }),
    };
    for pair in &pairs {
        for (side, &vertex) in pair.iter().enumerate() {
            let (vertices, garment) = (sides[side].start.len(), description.garments[side].clone());
            if vertex >= vertices {
                return Err(SeamError::NoSuchVertex { seam, garment, vertex, vertices });
            }
        }
        if same && pair[0] == pair[1] {
            return Err(SeamError::Itself { seam, garment: description.garments[0].clone(), vertex: pair[0] });
        }
    }
    Ok(pairs)
}

fn nearby(
    description: &Seam,
    seam: usize,
    [first, second]: [Side<'_>; 2],
    within: f64,
    same: bool,
) -> Result<Vec<[usize; 2]>, SeamError> {
    let (mut pairs, mut nearest) = (BTreeSet::new(), f64::INFINITY);
    for &p in first.edge {
        let distance = |q: usize| norm(subtract(first.start[p], second.start[q]));
        let others = second.edge.iter().copied().filter(|&q| !same || q != p);
        let Some(q) = others.min_by(|&a, &b| distance(a).total_cmp(&distance(b))) else { continue };
        nearest = nearest.min(distance(q));
        if distance(q) <= within {
            pairs.insert([p, q]);
        }
    }
    if pairs.is_empty() {
        return Err(SeamError::OutOfReach { seam, garments: description.garments.clone(), within, nearest });
    }
    Ok(pairs.into_iter().collect())
}
