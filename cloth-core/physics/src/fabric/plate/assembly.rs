//! Assembly of the two parts of a plate's Hessian.

use energy_dsl::{BLOCK, Batch, BatchWork, Block, Kernel, Lane, Level, Potential, Vector3};
use energy_elements::ArcAngle;
use energy_solve::{Linearisation, Precision, TriangleBuffer};

use super::patch::append_gradients;
use super::term::{Angles, PlateTerm};
use crate::fabric::patch_blocks::{BlocksFrom, GROUP, Right, Row, converted};

/// Number of entries in the upper triangle of ∇²θ.
const HESSIAN: usize = 90;

/// Adds −Σ m ∇²θ to the matrix, and its product with v.
pub(super) struct CurvedPart<'a, 'b> {
    of: &'a PlateTerm,
    moments: &'a [f64],
    v: &'a [Vector3<f64>],
    sum: &'a mut Linearisation<'b>,
    triangles: TriangleBuffer,
    rows: [f64; HESSIAN * BLOCK],
}

impl BatchWork<ArcAngle> for CurvedPart<'_, '_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, ArcAngle, L::F64>) {
        let mut result = batch.element.hessian_at::<L>(batch.points);
        let hinges = &self.of.needed[batch.first..][..batch.count];
        if self.sum.stiffness_times_velocity.is_some() {
            let numbers = result.hessian.as_flattened().as_flattened();
            L::F64::store_transposed(numbers, batch.count, &mut self.rows, HESSIAN);
            hinges.iter().enumerate().for_each(|(lane, &hinge)| self.add_product(hinge, lane));
        }
        let scale = -self.sum.weights.position;
        let weight = |lane: usize| hinges.get(lane).map_or(0.0, |&hinge| scale * self.moments[hinge]);
        let (weights, elements) = (L::F64::from_fn(weight), (batch.first, batch.count));
        let matrix = (0, &mut self.sum.matrix);
        self.triangles.scatter(&self.of.hinge_slots, elements, weights, &mut result.hessian, matrix);
    }
}

impl<'a, 'b> CurvedPart<'a, 'b> {
    pub(super) fn new(
        of: &'a PlateTerm,
        moments: &'a [f64],
        v: &'a [Vector3<f64>],
        sum: &'a mut Linearisation<'b>,
    ) -> Self {
        Self { of, moments, v, sum, triangles: TriangleBuffer::new(4), rows: [0.0; HESSIAN * BLOCK] }
    }

    /// Adds the product of one hinge, whose Hessian is in row `row`, with v.
    fn add_product(&mut self, hinge: usize, row: usize) {
        let Some(product) = &mut self.sum.stiffness_times_velocity else { return };
        let (weight, vertices) = (-self.moments[hinge], self.of.hinges[hinge]);
        let pairs = (0..4).flat_map(|i| (i..4).map(move |j| (i, j)));
        for (pair, (i, j)) in pairs.enumerate() {
            let block = block_of(&self.rows[HESSIAN * row + 9 * pair..][..9]);
            let block = block.map(|row| row.map(|entry| weight * entry));
            add_times(&mut product[vertices[i]], &block, &self.v[vertices[j]], false);
            if i != j {
                add_times(&mut product[vertices[j]], &block, &self.v[vertices[i]], true);
            }
        }
    }
}

/// Returns a block, given its entries by rows.
fn block_of(numbers: &[f64]) -> Block<f64> {
    std::array::from_fn(|row| std::array::from_fn(|column| numbers[3 * row + column]))
}

fn add_times(sum: &mut Vector3<f64>, block: &Block<f64>, v: &Vector3<f64>, transposed: bool) {
    for row in 0..3 {
        for column in 0..3 {
            sum[row] += if transposed { block[column][row] } else { block[row][column] } * v[column];
        }
    }
}

/// Returns the energy of each active patch, and adds ∂U/∂θ of each hinge if asked.
pub(super) struct Energies<'a> {
    pub(super) of: &'a PlateTerm,
    /// θ − θ̄ of each hinge.
    pub(super) angles: &'a [f64],
    pub(super) moments: Option<&'a mut [f64]>,
}

impl Kernel for Energies<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<L: Level>(self) -> Vec<f64> {
        let Self { of, angles, mut moments } = self;
        let mut energies = vec![0.0; of.active.len()];
        for (number, energy) in energies.iter_mut().enumerate() {
            let (found, [x, y, z]) = of.response::<L>(number, angles);
            *energy = found;
            let Some(moments) = &mut moments else { continue };
            for angle in of.angles.get(number) {
                moments[angle.hinge()] += angle.b[0] * x + angle.b[1] * y + angle.b[2] * z;
            }
        }
        energies
    }
}

/// Adds s Σ ∇r ∇rᵀ to the matrix.
pub(super) struct OuterProducts<'a, T> {
    pub(super) of: &'a PlateTerm,
    pub(super) angles: &'a Angles<'a>,
    pub(super) s: f64,
    pub(super) matrix: &'a mut [Block<T>],
}

impl<T: Precision> Kernel for OuterProducts<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { of, angles, s, matrix } = self;
        let s = T::from_f64(s);
        let mut gradients = vec![[[T::from_f64(0.0); 4]; 4]; angles.gradients.len()];
        for (single, gradient) in gradients.iter_mut().zip(&angles.gradients) {
            *single = converted(gradient);
        }
        let mut to = BlocksFrom { first: 0, blocks: matrix };
        let (mut rows, mut rights): (Vec<Row<T>>, Vec<Right<T>>) = (Vec::new(), Vec::new());
        for first in (0..of.active.len()).step_by(GROUP) {
            let group = first..(first + GROUP).min(of.active.len());
            rows.clear();
            for number in group.clone() {
                append_gradients::<L, T>(of.angles.get(number), of.vertices.get(number).len(), &gradients, &mut rows);
            }
            // Written in place: pushes would spill the registers.
            rights.resize(rows.len(), Right::zeros());
            for (right, row) in rights.iter_mut().zip(&rows) {
                // `black_box` keeps LLVM from vectorising this loop with scatters, which take longer than the rest.
                *std::hint::black_box(right) = Right::of(row);
            }
            let mut first = 0;
            for number in group {
                let own = first..first + of.vertices.get(number).len();
                first = own.end;
                of.patch_slots.get(number).add::<L, T>((s, &rows[own.clone()], &rights[own]), None, &mut to);
            }
        }
    }
}
