//! A rectangle of triangles with stretch and bending: points, tilts of the normals at edges, and ghosts beyond the
//! border.

use std::collections::BTreeMap;

use energy_dsl::energy;
use energy_elements::{Gravity, MidEdgeShell, StVK};
use energy_solve::{
    KindSolver, MixedBody, MixedNewton, MixedNewtonOptions, MixedNewtonReport, MixedSystem, MixedTerm, UnknownKind,
};

use crate::geometry::{add_scaled, cross, dot, norm, subtract};
use crate::validate::ValidateError;

pub(super) type Vector = energy_dsl::Vector3<f64>;

energy! {
    /// Springs along the axes that hold a point at c.
    energy Hold(x: Point; k: Vec3[N/m], c: Vec3[m]) {
        (k.x * (x.x - c.x)^2 + k.y * (x.y - c.y)^2 + k.z * (x.z - c.z)^2) / 2
    }

    /// A spring that keeps g at the mirror image of x in the plane through p with the unit normal n.
    energy Mirror(x, g: Point; k: Scalar[N/m], n: Vec3[1], p: Vec3[m]) {
        k / 2 * norm_squared(g - x + 2 * dot(n, x - p) * n)
    }
}

/// A sheet of an isotropic material.
#[derive(Clone, Copy, Debug)]
pub(super) struct Material {
    /// Young's modulus times thickness, in N/m.
    pub(super) stretching: f64,
    /// Bending stiffness D, in J.
    pub(super) bending: f64,
    pub(super) poisson_ratio: f64,
}

/// A rectangular grid of cells with two triangles each.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    pub(super) cells: [usize; 2],
    pub(super) size: [f64; 2],
    /// Rest positions of the points, from which the rest lengths of the triangles follow.
    pub(super) rest: Vec<Vector>,
    triangles: Vec<[usize; 3]>,
    /// The edges in order, each with its triangles and the corners opposite to it.
    edges: BTreeMap<[usize; 2], Vec<(usize, usize)>>,
}

/// How the sheet is held and loaded.
#[derive(Clone, Debug, Default)]
pub(super) struct Support {
    /// Points that are fixed.
    pub(super) fixed: Vec<usize>,
    /// Whether the normals on the border are fixed, too.
    pub(super) clamped: bool,
    /// Springs on points along the axes, in N/m.
    pub(super) held: Vec<(usize, Vector)>,
    /// Force per area, in Pa.
    pub(super) load: Vector,
    /// Natural curvature in all directions, in 1/m, next to that of the points at rest.
    pub(super) curvature: f64,
}

impl Grid {
    /// Creates a grid whose points are placed by their two coordinates.
    pub(super) fn new(cells: [usize; 2], size: [f64; 2], place: impl Fn([f64; 2]) -> Vector) -> Self {
        let across = cells[1] + 1;
        let mut rest = Vec::new();
        for i in 0..=cells[0] {
            for j in 0..across {
                rest.push(place([size[0] * i as f64 / cells[0] as f64, size[1] * j as f64 / cells[1] as f64]));
            }
        }
        let mut triangles = Vec::new();
        for i in 0..cells[0] {
            for j in 0..cells[1] {
                let [a, b, c, d] = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)].map(|(i, j)| i * across + j);
                // Diagonals change their direction from cell to cell, so that the mesh has no handedness.
                let own = if (i + j) % 2 == 0 { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] };
                triangles.extend(own);
            }
        }
        let mut edges: BTreeMap<[usize; 2], Vec<(usize, usize)>> = BTreeMap::new();
        for (number, corners) in triangles.iter().enumerate() {
            for side in 0..3 {
                let (from, to) = (corners[(side + 1) % 3], corners[(side + 2) % 3]);
                edges.entry([from.min(to), from.max(to)]).or_default().push((number, corners[side]));
            }
        }
        Self { cells, size, rest, triangles, edges }
    }

    /// Returns the number of the point of a cell's first corner.
    pub(super) fn point(&self, i: usize, j: usize) -> usize {
        i * (self.cells[1] + 1) + j
    }

    /// Returns the points on the border.
    pub(super) fn border(&self) -> Vec<usize> {
        let [n, m] = self.cells;
        let all = (0..=n).flat_map(|i| (0..=m).map(move |j| (i, j)));
        all.filter(|&(i, j)| i == 0 || j == 0 || i == n || j == m).map(|(i, j)| self.point(i, j)).collect()
    }

    /// Returns the border's edges with the corner of each that is inside, in order: ghosts are their mirror images.
    fn border_edges(&self) -> Vec<([usize; 2], usize)> {
        let own = self.edges.iter().filter(|(_, sides)| sides.len() == 1);
        own.map(|(edge, sides)| (*edge, sides[0].1)).collect()
    }

    /// Returns the mirror image of a corner at an edge, and the normal of the mirror.
    fn mirrored(&self, edge: [usize; 2], corner: usize) -> (Vector, Vector) {
        let [a, b, c] = [edge[0], edge[1], corner].map(|point| self.rest[point]);
        let along = unit(subtract(b, a));
        let from = subtract(c, a);
        let normal = unit(add_scaled(from, -dot(from, along), along));
        let height = dot(from, normal);
        (add_scaled(c, -2.0 * height, normal), normal)
    }

    /// Finds the equilibrium from a start, by Newton's method.
    pub(super) fn settle(
        &self,
        material: Material,
        support: &Support,
        start: &[Vector],
    ) -> Result<(Vec<Vector>, MixedNewtonReport), ValidateError> {
        let (points, edges, ghosts) = (self.rest.len(), self.edges.len(), self.border_edges());
        let kinds: Vec<UnknownKind> = std::iter::repeat_n(UnknownKind::Vector3, points)
            .chain(std::iter::repeat_n(UnknownKind::Scalar, edges))
            .chain(std::iter::repeat_n(UnknownKind::Vector3, ghosts.len()))
            .collect();
        let ghost = |number: usize| points + edges + number;
        let mut fixed = support.fixed.clone();
        if support.clamped {
            let is_border = self.edges.values().enumerate().filter(|(_, sides)| sides.len() == 1);
            fixed.extend(is_border.map(|(edge, _)| points + edge));
        } else {
            // The tilt at a free border takes up any angle to a ghost, which feels no force.
            fixed.extend((0..ghosts.len()).map(ghost));
        }
        let spacing = self.size[0] / self.cells[0] as f64;
        let body = MixedBody::new(&kinds, spacing).with_fixed(&fixed)?;
        let mut terms = self.elements(material, support.curvature)?;
        terms.extend(self.supports(support, material.bending)?);
        let mut system = MixedSystem::new(body, terms)?;
        let mut u: Vec<f64> = start.as_flattened().to_vec();
        u.resize(3 * points + edges, 0.0);
        for &(edge, corner) in &ghosts {
            u.extend(self.mirrored(edge, corner).0);
        }
        let solver = KindSolver::Band(energy_solve::BandOrder::Narrowest);
        let options = MixedNewtonOptions::new(1e-7 * spacing).with_stride(20.0 * spacing);
        let (u, report) = MixedNewton::new(&system, &solver, options).minimise(&mut system, &u)?;
        Ok((u[..3 * points].as_chunks::<3>().0.to_vec(), report))
    }

    /// Returns the terms of stretch and bending.
    fn elements(&self, material: Material, curvature: f64) -> Result<Vec<MixedTerm>, ValidateError> {
        let Material { stretching, bending, poisson_ratio } = material;
        let lambda = stretching * poisson_ratio / (1.0 - poisson_ratio * poisson_ratio);
        let mu = 0.5 * stretching / (1.0 + poisson_ratio);
        let ghosts = self.border_edges();
        let (points, edges) = (self.rest.len(), self.edges.len());
        let numbers: BTreeMap<[usize; 2], usize> = self.edges.keys().enumerate().map(|(n, edge)| (*edge, n)).collect();
        let (mut shells, mut membranes, mut stencils) = (Vec::new(), Vec::new(), Vec::new());
        for (number, &corners) in self.triangles.iter().enumerate() {
            let (mut far, mut far_at, mut tilts, mut signs) = ([0; 3], [[0.0; 3]; 3], [0; 3], [1.0; 3]);
            for side in 0..3 {
                let (from, to) = (corners[(side + 1) % 3], corners[(side + 2) % 3]);
                let edge = [from.min(to), from.max(to)];
                tilts[side] = points + numbers[&edge];
                let others = &self.edges[&edge];
                (far[side], far_at[side]) = match others.iter().find(|(other, _)| *other != number) {
                    Some(&(_, corner)) => (corner, self.rest[corner]),
                    None => {
                        let place = ghosts.iter().position(|(at, _)| *at == edge).unwrap_or(0);
                        (points + edges + place, self.mirrored(edge, corners[side]).0)
                    }
                };
                signs[side] = if others[0].0 == number { 1.0 } else { -1.0 };
            }
            let at = corners.map(|point| self.rest[point]);
            let flat = flattened(at);
            let natural = natural_curvature(at, far_at, flat);
            let [u0, u1, u2] = flat;
            let [k11, k12, k22] = [natural[0] + curvature, natural[1], natural[2] + curvature];
            let [s0, s1, s2] = signs;
            shells.push(MidEdgeShell::new(u0, u1, u2, bending, poisson_ratio, s0, s1, s2, k11, k12, k22)?);
            membranes.push(StVK::new(u0, u1, u2, lambda, mu)?);
            let [a, b, c] = corners;
            let ([y0, y1, y2], [tilt0, tilt1, tilt2]) = (far, tilts);
            stencils.push([a, b, c, y0, y1, y2, tilt0, tilt1, tilt2]);
        }
        Ok(vec![
            MixedTerm::of_points("membrane", membranes, &self.triangles)?,
            MixedTerm::new("bending", shells, &stencils)?,
        ])
    }

    /// Returns the terms of loads, springs and mirrored ghosts.
    fn supports(&self, support: &Support, bending: f64) -> Result<Vec<MixedTerm>, ValidateError> {
        let mut forces = vec![[0.0; 3]; self.rest.len()];
        for &corners in &self.triangles {
            let share = area(corners.map(|point| self.rest[point])) / 3.0;
            for corner in corners {
                (0..3).for_each(|axis| forces[corner][axis] += share * support.load[axis]);
            }
        }
        let loads = forces.into_iter().map(|force| Gravity::new(1.0, force)).collect();
        let loaded: Vec<[usize; 1]> = (0..self.rest.len()).map(|point| [point]).collect();
        let hold = |&(point, k): &(usize, Vector)| Hold::new(k, self.rest[point]);
        let held: Vec<[usize; 1]> = support.held.iter().map(|&(point, _)| [point]).collect();
        let (mut mirrors, mut pairs) = (Vec::new(), Vec::new());
        if support.clamped {
            let spacing = self.size[0] / self.cells[0] as f64;
            for (number, (edge, corner)) in self.border_edges().into_iter().enumerate() {
                let (_, normal) = self.mirrored(edge, corner);
                mirrors.push(Mirror::new(1e6 * bending / (spacing * spacing), normal, self.rest[edge[0]]));
                pairs.push([corner, self.rest.len() + self.edges.len() + number]);
            }
        }
        Ok(vec![
            MixedTerm::of_points("load", loads, &loaded)?,
            MixedTerm::of_points("springs", support.held.iter().map(hold).collect(), &held)?,
            MixedTerm::of_points("mirrors", mirrors, &pairs)?,
        ])
    }
}

/// Returns the corners of a triangle in its plane.
fn flattened([a, b, c]: [Vector; 3]) -> [[f64; 2]; 3] {
    let (d, e) = (subtract(b, a), subtract(c, a));
    let length = norm(d);
    [[0.0; 2], [length, 0.0], [dot(d, e) / length, norm(cross(d, e)) / length]]
}

/// Returns κ11, κ12 and κ22 that the mid-edge normals have at rest, without tilts.
fn natural_curvature(at: [Vector; 3], far: [Vector; 3], flat: [[f64; 2]; 3]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for side in 0..3 {
        let (next, last) = ((side + 1) % 3, (side + 2) % 3);
        let edge = [flat[last][0] - flat[next][0], flat[last][1] - flat[next][1]];
        let weight = 0.5 * dihedral(at[side], far[side], at[next], at[last]) / (area(at) * edge[0].hypot(edge[1]));
        let normal = [-edge[1], edge[0]];
        let products = [normal[0] * normal[0], normal[0] * normal[1], normal[1] * normal[1]];
        sum.iter_mut().zip(products).for_each(|(sum, product)| *sum += weight * product);
    }
    sum
}

/// Returns the angle between the triangles a c d and b c d, 0 if they are flat.
fn dihedral(a: Vector, b: Vector, c: Vector, d: Vector) -> f64 {
    let edge = subtract(d, c);
    let first = cross(edge, subtract(a, c));
    let second = cross(subtract(b, c), edge);
    dot(cross(first, second), unit(edge)).atan2(dot(first, second))
}

fn area([a, b, c]: [Vector; 3]) -> f64 {
    0.5 * norm(cross(subtract(b, a), subtract(c, a)))
}

fn unit(v: Vector) -> Vector {
    let length = norm(v);
    v.map(|x| x / length)
}
