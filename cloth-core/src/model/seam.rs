use std::collections::BTreeSet;

use energy_dsl::Vector3;

use super::UnknownPart;
use crate::geometry::{norm, subtract};
use crate::scene::Seam;

/// A seam that is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum SeamError {
    /// A garment does not exist.
    #[error("seams[{seam}]: {0}", .error)]
    Name {
        /// Index of the seam, from 0.
        seam: usize,
        error: UnknownPart,
    },
    /// Both or neither of `pairs` and `within` are given.
    #[error("seams[{seam}]: expected either `pairs` or `within`")]
    Choice {
        /// Index of the seam, from 0.
        seam: usize,
    },
    /// The vertex does not exist.
    #[error(
        "seams[{seam}]: {garment} has no vertex {vertex}; it has {vertices} (0 to {})",
        .vertices.saturating_sub(1)
    )]
    NoSuchVertex {
        /// Index of the seam, from 0.
        seam: usize,
        garment: String,
        vertex: usize,
        vertices: usize,
    },
    /// A vertex is joined to itself.
    #[error("seams[{seam}]: vertex {vertex} of {garment} is joined to itself")]
    Itself {
        /// Index of the seam, from 0.
        seam: usize,
        garment: String,
        vertex: usize,
    },
    /// No two edges are within the distance.
    #[error(
        "seams[{seam}]: no edges of {} and {} come within {within} m at the start; \
         the nearest are {nearest:.3e} m apart",
        .garments[0], .garments[1]
    )]
    OutOfReach {
        /// Index of the seam, from 0.
        seam: usize,
        /// The names of the two garments.
        garments: [String; 2],
        /// The distance given, in m.
        within: f64,
        /// The smallest distance between edges, in m.
        nearest: f64,
    },
}

/// A part joined by a seam.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side<'a> {
    /// Initial positions of its vertices, in m.
    pub start: &'a [Vector3<f64>],
    /// Its boundary vertices.
    pub edge: &'a [usize],
}

/// Returns the pairs of vertices that a seam joins, numbered within their parts.
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
