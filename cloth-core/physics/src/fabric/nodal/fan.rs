//! The triangles around each vertex, in one frame.

use std::collections::HashMap;

use crate::mesh::{MaterialTriangle, TriangleMesh};

/// A corner of a triangle, seen from its vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    pub triangle: usize,
    /// Index of the corner in its triangle.
    pub corner: usize,
    /// Cosine and sine of the angle that turns the triangle's material coordinates into the frame of the fan.
    pub turn: [f64; 2],
}

/// Triangles around a vertex that are connected by edges. A vertex has several fans if triangles touch at it alone.
pub(super) type Fan = Vec<Corner>;

/// The longest fan: longer ones are divided, since their matrices grow with the square.
const MOST: usize = 16;

/// Returns the fans of all vertices. Fans of woven cloth share the frame of warp and weft; others take that
/// of their first triangle, carried from neighbour to neighbour across the edge between them.
pub(super) fn fans(mesh: &TriangleMesh, rest: &[MaterialTriangle], is_woven: bool) -> Vec<Fan> {
    let triangles = mesh.triangles();
    let mut around: Vec<Vec<Corner>> = vec![Vec::new(); mesh.vertices().len()];
    for (triangle, corners) in triangles.iter().enumerate() {
        for (corner, &vertex) in corners.iter().enumerate() {
            around[vertex].push(Corner { triangle, corner, turn: [1.0, 0.0] });
        }
    }
    let mut fans = Vec::new();
    for corners in around {
        for mut fan in connected(&corners, triangles) {
            if !is_woven {
                align(&mut fan, rest);
            }
            fans.extend(fan.chunks(MOST).map(<[Corner]>::to_vec));
        }
    }
    fans
}

/// Divides the corners at a vertex into fans: each corner is followed by the one across its last edge.
fn connected(corners: &[Corner], triangles: &[[usize; 3]]) -> Vec<Fan> {
    let end = |corner: &Corner, step: usize| triangles[corner.triangle][(corner.corner + step) % 3];
    let mut starting: HashMap<usize, Vec<usize>> = HashMap::new();
    for (number, corner) in corners.iter().enumerate() {
        starting.entry(end(corner, 1)).or_default().push(number);
    }
    // At an edge of three triangles or more, no neighbour is the right one.
    let next = |number: usize| match starting.get(&end(&corners[number], 2)).map(Vec::as_slice) {
        Some(&[next]) => Some(next),
        _ => None,
    };
    let mut has_predecessor = vec![0; corners.len()];
    (0..corners.len()).filter_map(next).for_each(|number| has_predecessor[number] += 1);
    let mut is_taken = vec![false; corners.len()];
    let mut fans = Vec::new();
    // Open fans begin at the corner without a predecessor, closed ones anywhere.
    let open = (0..corners.len()).filter(|&number| has_predecessor[number] != 1);
    for first in open.chain(0..corners.len()) {
        let (mut fan, mut here) = (Vec::new(), Some(first));
        while let Some(number) = here.filter(|&number| !is_taken[number]) {
            is_taken[number] = true;
            fan.push(corners[number]);
            here = next(number).filter(|&number| has_predecessor[number] == 1);
        }
        if !fan.is_empty() {
            fans.push(fan);
        }
    }
    fans
}

/// Turns each triangle such that the edge to its predecessor has the same direction in both.
fn align(fan: &mut Fan, rest: &[MaterialTriangle]) {
    let direction = |corner: &Corner, step: usize| -> [f64; 2] {
        let plane = rest[corner.triangle];
        let (from, to) = (plane[corner.corner], plane[(corner.corner + step) % 3]);
        let edge = [to[0] - from[0], to[1] - from[1]];
        let length = edge[0].hypot(edge[1]);
        edge.map(|component| component / length)
    };
    for number in 1..fan.len() {
        let (before, here) = (fan[number - 1], fan[number]);
        let [a, b] = rotated(before.turn, direction(&before, 2));
        let [c, d] = direction(&here, 1);
        // The rotation from (c, d) to (a, b).
        fan[number].turn = [a * c + b * d, b * c - a * d];
    }
}

/// Rotates a vector by an angle with this cosine and sine.
pub(super) fn rotated([cosine, sine]: [f64; 2], [u, v]: [f64; 2]) -> [f64; 2] {
    [cosine * u - sine * v, sine * u + cosine * v]
}
