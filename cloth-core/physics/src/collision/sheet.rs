use energy_dsl::Vector3;

use super::CollisionMesh;
use super::rectangle::PlanePoint;
use crate::geometry::{add_scaled, cross, dot, norm, subtract};

/// A connected part of a mesh, projected on a plane at the start. Features are given by their numbers in the mesh's
/// lists.
#[derive(Debug, Default)]
pub(super) struct Sheet {
    pub points: Vec<usize>,
    pub triangles: Vec<usize>,
    pub edges: Vec<usize>,
}

impl Sheet {
    /// Returns the connected parts of the cloth and hair of a mesh.
    pub fn all(mesh: &CollisionMesh) -> Vec<Self> {
        let part = parts(mesh);
        let mut sheets: Vec<Self> = Vec::new();
        sheets.resize_with(part.iter().max().map_or(0, |last| last + 1), Self::default);
        let [points, triangles, edges] = mesh.own_features();
        let of = |vertex: u32| part[vertex as usize];
        (0..points).for_each(|point| sheets[of(mesh.points()[point])].points.push(point));
        (0..triangles).for_each(|triangle| sheets[of(mesh.triangles()[triangle][0])].triangles.push(triangle));
        (0..edges).for_each(|edge| sheets[of(mesh.edges()[edge][0])].edges.push(edge));
        // A vertex without edges is not a point.
        sheets.retain(|sheet| !sheet.edges.is_empty());
        sheets
    }

    /// Projects the vertices of the sheet on a plane across its mean normal, with an outer edge along the first axis.
    pub fn project(&self, mesh: &CollisionMesh, x: &[Vector3<f64>], points: &mut [PlanePoint]) {
        let at = |vertex: u32| x[vertex as usize];
        let normal = self.triangles.iter().fold([0.0; 3], |sum, &triangle| {
            let [a, b, c] = mesh.triangles()[triangle].map(at);
            add_scaled(sum, 1.0, cross(subtract(b, a), subtract(c, a)))
        });
        let is_outer = |edge: &&usize| mesh.apexes(**edge).len() == 1;
        let outer = self.edges.iter().find(is_outer).unwrap_or(&self.edges[0]);
        let [origin, end] = mesh.edges()[*outer].map(at);
        let across = cross(normal, subtract(end, origin));
        let axes = [cross(across, normal), across].map(|axis| axis.map(|component| component / norm(axis)));
        // Hair and closed surfaces have no mean normal. Any plane will do for them.
        let is_plane = axes.as_flattened().iter().all(|component| component.is_finite());
        let axes = if is_plane { axes } else { [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
        for vertex in self.points.iter().map(|&point| mesh.points()[point] as usize) {
            points[vertex] = axes.map(|axis| dot(subtract(x[vertex], origin), axis));
        }
    }
}

/// Returns the number of the connected part that each vertex of cloth and hair belongs to.
fn parts(mesh: &CollisionMesh) -> Vec<usize> {
    const NONE: usize = usize::MAX;
    let mut part = vec![NONE; mesh.own_vertices()];
    let mut count = 0;
    for start in 0..part.len() {
        if part[start] != NONE {
            continue;
        }
        let mut waiting = vec![start];
        while let Some(vertex) = waiting.pop() {
            if part[vertex] == NONE {
                part[vertex] = count;
                waiting.extend(mesh.neighbours(energy_solve::index(vertex)).iter().map(|next| *next as usize));
            }
        }
        count += 1;
    }
    part
}
