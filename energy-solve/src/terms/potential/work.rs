use energy_dsl::{Declaration, Lane, Level, Mask, Number, Vector3, triangle_index};

use super::pack_energies::PackEnergies;
use super::waiting::Waiting;
use crate::terms::curvature::{Curvature, Hinges, Orthonormal, Projection, change_dense, is_semi_definite};
use crate::terms::linearisation::Linearisation;
use crate::terms::scatter::{Lanes, TriangleBuffer, VectorBuffer, points_of_triangle};
use crate::terms::scatter_map::ScatterMaps;

/// Returns the first `count` lanes of a mask as bits.
#[inline(always)]
pub(super) fn lanes_in(mask: impl Mask, count: usize) -> u32 {
    mask.bits() & (u32::MAX >> (32 - count))
}

/// Counts the lanes whose element has its first vertex among the `count` vertices from `first` on, so that each element
/// counts for one share only.
#[inline(always)]
fn count_owned(lanes: u32, vertices: &[u32], first: usize, count: usize) -> u64 {
    if lanes == 0 {
        return 0;
    }
    let owned = |lane: &usize| (vertices[*lane] as usize).wrapping_sub(first) < count;
    (0..vertices.len()).filter(|lane| lanes >> lane & 1 == 1).filter(owned).count() as u64
}

/// Evaluates Σ U.
pub(super) struct Values<'a> {
    energies: PackEnergies<'a>,
    pub(super) flagged: u64,
}

impl<'a> Values<'a> {
    pub(super) fn new(energies: PackEnergies<'a>) -> Self {
        Self { energies, flagged: 0 }
    }
}

impl Values<'_> {
    /// Notes U of each lane.
    #[inline(always)]
    pub(super) fn add<V: Lane<f64>>(&mut self, lanes: &Lanes<'_>, value: V, flagged: u32) {
        self.energies.note(lanes, value);
        self.flagged += u64::from(flagged.count_ones());
    }
}

/// f ← f − ∇U for the vertices from `first_vertex` on.
pub(super) struct Gradients<'a> {
    force: &'a mut [Vector3<f64>],
    first_vertex: usize,
    buffer: VectorBuffer,
    energies: PackEnergies<'a>,
    pub(super) flagged: u64,
}

impl<'a> Gradients<'a> {
    pub(super) fn new(
        arity: usize,
        force: &'a mut [Vector3<f64>],
        first_vertex: usize,
        energies: PackEnergies<'a>,
    ) -> Self {
        Self { force, first_vertex, buffer: VectorBuffer::new(arity), energies, flagged: 0 }
    }
}

impl Gradients<'_> {
    /// Subtracts the gradients of all lanes from the forces.
    #[inline(always)]
    pub(super) fn add<V: Lane<f64>>(&mut self, lanes: &Lanes<'_>, value: V, gradient: &[Vector3<V>], flagged: u32) {
        self.energies.note(lanes, value);
        self.buffer.subtract(lanes, gradient, self.first_vertex, self.force);
        self.flagged += count_owned(flagged, lanes.vertices(0), self.first_vertex, self.force.len());
    }
}

/// Energy and derivatives of the elements in lanes, in terms of points.
pub(super) struct Expanded<'a, V> {
    pub(super) value: V,
    pub(super) gradient: &'a [Vector3<V>],
    pub(super) triangle: &'a mut [[Vector3<V>; 3]],
}

/// f ← f − ∇U and A ← A − α ∇²U for the vertices and blocks from `first_vertex` and `first_block` on.
pub(super) struct Hessians<'a, 'b> {
    sum: &'a mut Linearisation<'b>,
    first_vertex: usize,
    first_block: usize,
    velocities: &'a [Vector3<f64>],
    maps: &'a ScatterMaps,
    orthonormal: Option<&'a Orthonormal>,
    vectors: VectorBuffer,
    triangles: TriangleBuffer,
    pub(super) waiting: Waiting,
    energies: PackEnergies<'a>,
    pub(super) flagged: u64,
    pub(super) projected: u64,
}

impl<'a, 'b> Hessians<'a, 'b> {
    pub(super) fn new(
        arity: usize,
        sum: &'a mut Linearisation<'b>,
        (first_vertex, first_block): (usize, usize),
        velocities: &'a [Vector3<f64>],
        maps: &'a ScatterMaps,
        orthonormal: Option<&'a Orthonormal>,
        energies: PackEnergies<'a>,
    ) -> Self {
        Self {
            sum,
            first_vertex,
            first_block,
            velocities,
            maps,
            orthonormal,
            vectors: VectorBuffer::new(arity),
            triangles: TriangleBuffer::new(arity),
            waiting: Waiting::default(),
            energies,
            flagged: 0,
            projected: 0,
        }
    }
}

impl<'a> Hessians<'a, '_> {
    /// Returns how Hessians are made positive semi-definite before they are expanded to points; `None` if they are not.
    pub(super) fn projection(&self, declaration: &Declaration) -> Option<Projection<'a>> {
        let vectors = declaration.reduced_vectors.len();
        let curvature = self.sum.curvature;
        let orthonormal = self.orthonormal.filter(|_| curvature != Curvature::Exact)?;
        let known = if vectors <= 2 { vectors } else { 0 };
        Some(Projection { curvature, orthonormal, n: 3 * vectors, vectors: known })
    }

    /// Projects Hessians of functions of a dihedral angle, if that is asked for, and looks at those of all lanes.
    #[inline(always)]
    pub(super) fn examine<L: Level>(
        &self,
        declaration: &Declaration,
        lanes: &Lanes<'_>,
        (gradient, hessian): (&[L::F64], &mut [L::F64]),
        n: usize,
        points: &[Vector3<L::F64>],
    ) -> Examined {
        let curvature = self.sum.curvature;
        let mut examined = Examined { open: u32::MAX >> (32 - lanes.count), changed: 0 };
        if self.orthonormal.is_none() || curvature == Curvature::Exact {
            return Examined { open: 0, ..examined };
        }
        if let Some(of) = declaration.dihedral {
            let vectors = hinge_vectors::<L>(of, points);
            let lanes = L::F64::dispatch(Hinges { curvature, vectors, gradient, upper: &mut *hessian });
            examined.changed = lanes.changed & examined.open;
            examined.open &= !lanes.treated;
            if examined.open == 0 {
                return examined;
            }
        }
        examined.open &= (!is_semi_definite(hessian, n)).bits();
        examined
    }

    /// Adds the results of all lanes, in terms of points. `projected` marks the changed lanes; `scratch` has two
    /// vectors per point.
    #[inline(always)]
    pub(super) fn add<V: Lane<f64>>(
        &mut self,
        lanes: &Lanes<'_>,
        Expanded { value, gradient, triangle }: Expanded<'_, V>,
        (flagged, mut projected): (u32, u32),
        scratch: [&mut [Vector3<V>]; 2],
    ) {
        if self.orthonormal.is_none() && self.sum.curvature != Curvature::Exact {
            projected = change_one_by_one(triangle, lanes.count, self.sum.curvature);
        }
        self.energies.note(lanes, value);
        self.vectors.subtract(lanes, gradient, self.first_vertex, self.sum.force);
        if let Some(product) = &mut self.sum.stiffness_times_velocity {
            let first_vertex = self.first_vertex;
            subtract_product(lanes, triangle, self.velocities, scratch, &mut self.vectors, first_vertex, product);
        }
        let (scale, elements) = (V::splat(-self.sum.weights.position), (lanes.first, lanes.count));
        let matrix = (self.first_block, &mut self.sum.matrix);
        self.triangles.scatter(self.maps, elements, scale, triangle, matrix);
        let (vertices, first, count) = (lanes.vertices(0), self.first_vertex, self.sum.force.len());
        self.flagged += count_owned(flagged, vertices, first, count);
        self.projected += count_owned(projected, vertices, first, count);
    }
}

/// Known properties of the Hessians in lanes, as bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Examined {
    /// Lanes with an indefinite Hessian.
    pub(super) open: u32,
    /// Lanes that were changed.
    pub(super) changed: u32,
}

/// Returns the difference vectors x₄ − x₃, x₁ − x₃ and x₂ − x₃ of a hinge.
#[inline(always)]
fn hinge_vectors<L: Level>([x1, x2, x3, x4]: [usize; 4], points: &[Vector3<L::F64>]) -> [Vector3<L::F64>; 3] {
    let mut vectors = [points[x4], points[x1], points[x2]];
    for vector in &mut vectors {
        for axis in 0..3 {
            vector[axis] = vector[axis] - points[x3][axis];
        }
    }
    vectors
}

/// Returns the one or two difference vectors of an element; zeros if it has more.
#[inline(always)]
pub(super) fn difference_vectors<L: Level>(
    declaration: &Declaration,
    points: &[Vector3<L::F64>],
) -> [Vector3<L::F64>; 2] {
    let mut vectors = [[L::F64::splat(0.0); 3]; 2];
    if declaration.reduced_vectors.len() > 2 {
        return vectors;
    }
    for (vector, terms) in vectors.iter_mut().zip(&*declaration.reduced_vectors) {
        for &(point, weight) in &**terms {
            for axis in 0..3 {
                vector[axis] = vector[axis] + L::F64::splat(weight) * points[point][axis];
            }
        }
    }
    vectors
}

/// Subtracts ∇²U v.
#[inline(always)]
fn subtract_product<V: Lane<f64>>(
    lanes: &Lanes<'_>,
    triangle: &[[Vector3<V>; 3]],
    velocities: &[Vector3<f64>],
    [v, sums]: [&mut [Vector3<V>]; 2],
    buffer: &mut VectorBuffer,
    first_vertex: usize,
    product: &mut [Vector3<f64>],
) {
    let n = v.len();
    let zero = [V::splat(0.0); 3];
    for point in 0..n {
        v[point] = V::gather(velocities, lanes.all_vertices(point));
        sums[point] = zero;
    }
    for i in 0..n {
        for j in i..n {
            let block = &triangle[triangle_index(n, i, j)];
            for row in 0..3 {
                for column in 0..3 {
                    sums[i][row] = sums[i][row] + block[row][column] * v[j][column];
                    if i != j {
                        sums[j][column] = sums[j][column] + block[row][column] * v[i][row];
                    }
                }
            }
        }
    }
    buffer.subtract(lanes, sums, first_vertex, product);
}

/// Fallback for elements whose coordinates are not independent differences of points. Returns a bit mask of the changed
/// lanes.
#[inline(never)]
fn change_one_by_one<V: Lane<f64>>(triangle: &mut [[Vector3<V>; 3]], count: usize, curvature: Curvature) -> u32 {
    let points = points_of_triangle(triangle.len());
    let mut changed = 0;
    for lane in 0..count {
        let mut one: Vec<_> =
            triangle.iter().map(|block| block.map(|row| row.map(|entry| entry.extract(lane)))).collect();
        if change_dense(&mut one, points, curvature) {
            changed |= 1 << lane;
            for (block, new) in triangle.iter_mut().flatten().flatten().zip(one.iter().flatten().flatten()) {
                let old = *block;
                *block = V::from_fn(|other| if other == lane { *new } else { old.extract(other) });
            }
        }
    }
    changed
}
