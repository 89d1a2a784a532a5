//! Sums of the derivatives of patches. The kernels are compiled for each SIMD level.

use energy_dsl::{Block, Kernel, Level, Vector3};
use energy_solve::{Curvature, Precision, State, change_dense};

use super::law::{Response, Strain};
use super::symmetric::with_eigenvalues;
use super::term::NodalMembrane;
use crate::fabric::patch_blocks::{BlocksFrom, GROUP, Right, Row, converted};
use crate::geometry::dot;

/// Returns the mean strains of patches.
pub(super) struct Strains<'a> {
    pub of: &'a NodalMembrane,
    /// Indices of the patches.
    pub patches: &'a [usize],
    pub x: &'a [Vector3<f64>],
}

impl Kernel for Strains<'_> {
    type Output = Vec<Strain>;

    #[inline(always)]
    fn run<L: Level>(self) -> Vec<Strain> {
        let mut strains = vec![[0.0; 3]; self.patches.len()];
        for (strain, &patch) in strains.iter_mut().zip(self.patches) {
            *strain = self.of.patches.get(patch).strain(self.x);
        }
        strains
    }
}

/// A patch among the active ones, and its response.
pub(super) type Found = (usize, Response);

/// Consecutive vertices of a sum.
pub(super) struct Sums<'a> {
    /// The first vertex.
    pub first: usize,
    pub vectors: &'a mut [Vector3<f64>],
}

/// Subtracts Σ S : ∂Ē/∂x.
pub(super) struct Forces<'a> {
    pub of: &'a NodalMembrane,
    pub found: &'a [Found],
    pub x: &'a [Vector3<f64>],
    pub force: Sums<'a>,
}

impl Kernel for Forces<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { of, found, x, mut force } = self;
        let mut rows = Vec::new();
        for (number, response) in found {
            let patch = of.patches.get(of.active[*number]);
            rows.clear();
            patch.append_gradients(x, &mut rows);
            subtract_gradient(&rows, patch.vertices, &response.stress, &mut force);
        }
    }
}

#[inline(always)]
fn subtract_gradient(rows: &[Row<f64>], vertices: &[usize], stress: &Strain, sums: &mut Sums<'_>) {
    for (row, &vertex) in rows.iter().zip(vertices) {
        let Some(force) = sums.vectors.get_mut(vertex.wrapping_sub(sums.first)) else { continue };
        for axis in 0..3 {
            force[axis] -= stress[0] * row[0][axis] + stress[1] * row[1][axis] + stress[2] * row[2][axis];
        }
    }
}

/// Subtracts Σ S : ∂Ē/∂x, and adds `scale` times the Hessian, Σ ∂Ē/∂xᵀ (∂S/∂E) ∂Ē/∂x + S : ∂²Ē/∂x².
pub(super) struct Hessians<'a, T> {
    pub of: &'a NodalMembrane,
    pub found: &'a [Found],
    pub x: &'a [Vector3<f64>],
    pub scale: f64,
    pub curvature: Curvature,
    pub force: Sums<'a>,
    /// The first block of the matrix.
    pub first: usize,
    pub matrix: &'a mut [Block<T>],
}

impl<T: Precision> Kernel for Hessians<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { of, found, x, scale, curvature, mut force, first, matrix } = self;
        let mut to = BlocksFrom { first, blocks: matrix };
        let (mut rows, mut lefts, mut rights) = (Vec::<Row<f64>>::new(), Vec::<Row<T>>::new(), Vec::<Right<T>>::new());
        let mut multiples = Vec::<T>::new();
        for group in found.chunks(GROUP) {
            rows.clear();
            multiples.clear();
            group.iter().for_each(|(number, _)| of.patches.get(of.active[*number]).append_gradients(x, &mut rows));
            lefts.resize(rows.len(), [[T::from_f64(0.0); 4]; 3]);
            rights.resize(rows.len(), Right::zeros());
            let mut first = 0;
            for (number, response) in group {
                let patch = of.patches.get(of.active[*number]);
                let own = first..first + patch.vertices.len();
                first = own.end;
                subtract_gradient(&rows[own.clone()], patch.vertices, &response.stress, &mut force);
                let (moduli, stress) = match curvature {
                    Curvature::Exact => (response.moduli, response.stress),
                    _ => changed(response, curvature),
                };
                let [uu, vv, uv] = stress;
                patch.append_stress_stiffness(&[scale * uu, scale * vv, scale * uv], &mut multiples);
                for ((left, right), row) in lefts[own.clone()].iter_mut().zip(&mut rights[own.clone()]).zip(&rows[own])
                {
                    *left = converted(row);
                    // `black_box` keeps LLVM from vectorising this loop with scatters.
                    *std::hint::black_box(right) = Right::of(&times::<L, T>(&moduli, left));
                }
            }
            let (mut first, mut multiples) = (0, &multiples[..]);
            for (number, _) in group {
                let slots = of.slots.get(*number);
                let (of_pairs, of_others) = multiples.split_at(slots.pairs());
                let own = first..first + of.patches.get(of.active[*number]).vertices.len();
                first = own.end;
                let factors = (T::from_f64(scale), &lefts[own.clone()], &rights[own]);
                slots.add::<L, T>(factors, Some(of_pairs), &mut to);
                multiples = of_others;
            }
        }
    }
}

/// Returns (∂S/∂E) ∂Ē/∂x of a vertex.
#[inline(always)]
fn times<L: Level, T: Precision>(moduli: &[[f64; 3]; 3], row: &Row<T>) -> Row<T> {
    let mut product = [[T::from_f64(0.0); 4]; 3];
    for k in 0..3 {
        let [a, b, c] = [T::from_f64(moduli[k][0]), T::from_f64(moduli[k][1]), T::from_f64(moduli[k][2])];
        for axis in 0..4 {
            product[k][axis] = c.mul_add::<L>(row[2][axis], b.mul_add::<L>(row[1][axis], a * row[0][axis]));
        }
    }
    product
}

/// Returns moduli and stress with eigenvalues treated as `curvature` says. Either part of the Hessian is then positive
/// semi-definite, since S : form is Σ ⅓ A_T ∇Nᵢ·S ∇Nⱼ.
fn changed(response: &Response, curvature: Curvature) -> ([[f64; 3]; 3], Strain) {
    let mut moduli = [response.moduli];
    if !is_definite(&moduli[0]) {
        change_dense(&mut moduli, 1, curvature);
    }
    let [uu, vv, uv] = response.stress;
    let treated = |eigenvalue: f64| match curvature {
        Curvature::Exact => eigenvalue,
        Curvature::Clamped => eigenvalue.max(0.0),
        Curvature::Absolute => eigenvalue.abs(),
    };
    (moduli[0], with_eigenvalues([uu, vv, uv], treated))
}

/// Whether Cholesky's factorisation of a matrix has positive pivots.
fn is_definite(&[[a, b, c], [_, d, e], [_, _, f]]: &[[f64; 3]; 3]) -> bool {
    let (p, q) = (b / a, c / a);
    let (second, mixed) = (d - p * b, e - p * c);
    a > 0.0 && second > 0.0 && f - q * c - mixed / second * mixed > 0.0
}

/// Subtracts the product of the exact Hessian with the velocities.
pub(super) fn subtract_product(of: &NodalMembrane, found: &[Found], state: State<'_>, mut product: Sums<'_>) {
    let mut rows = Vec::new();
    for (number, response) in found {
        let patch = of.patches.get(of.active[*number]);
        rows.clear();
        patch.append_gradients(state.x, &mut rows);
        let moved = |(row, &vertex): (&Row<f64>, &usize)| row.map(|[x, y, z, _]| dot([x, y, z], state.v[vertex]));
        let rates = rows.iter().zip(patch.vertices).map(moved);
        let rate = rates.fold([0.0; 3], |sum: [f64; 3], one| std::array::from_fn(|k| sum[k] + one[k]));
        subtract_gradient(&rows, patch.vertices, &response.moduli.map(|row| dot(row, rate)), &mut product);
        // The second part has the form of a gradient, at the velocities.
        rows.clear();
        patch.append_gradients(state.v, &mut rows);
        subtract_gradient(&rows, patch.vertices, &response.stress, &mut product);
    }
}
