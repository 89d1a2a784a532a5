//! Assembly of the two parts of a plate's Hessian.

use energy_dsl::{BLOCK, Batch, BatchWork, Block, Kernel, Lane, Level, Number, Potential, Vector3};
use energy_elements::ArcAngle;
use energy_solve::{Linearisation, Precision};

use super::term::{Angles, PlateTerm, Row};

/// Number of entries in the upper triangle of ∇²θ.
const HESSIAN: usize = 90;

/// Adds −Σ m ∇²θ to the matrix, and its product with v.
pub(super) struct CurvedPart<'a, 'b> {
    of: &'a PlateTerm,
    moments: &'a [f64],
    v: &'a [Vector3<f64>],
    sum: &'a mut Linearisation<'b>,
    rows: [f64; HESSIAN * BLOCK],
}

impl BatchWork<ArcAngle> for CurvedPart<'_, '_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, ArcAngle, L::F64>) {
        let result = batch.element.hessian_at::<L>(batch.points);
        let numbers = result.hessian.as_flattened().as_flattened();
        L::F64::store_transposed(numbers, batch.count, &mut self.rows, HESSIAN);
        for lane in 0..batch.count {
            self.add(batch.first + lane, lane);
        }
    }
}

impl<'a, 'b> CurvedPart<'a, 'b> {
    pub(super) fn new(
        of: &'a PlateTerm,
        moments: &'a [f64],
        v: &'a [Vector3<f64>],
        sum: &'a mut Linearisation<'b>,
    ) -> Self {
        Self { of, moments, v, sum, rows: [0.0; HESSIAN * BLOCK] }
    }

    /// Adds the contribution of one hinge, whose Hessian is in row `row`.
    fn add(&mut self, number: usize, row: usize) {
        let hinge = self.of.needed[number];
        let weight = -self.moments[hinge];
        let triangle: [Block<f64>; 10] =
            std::array::from_fn(|pair| block_of(&self.rows[HESSIAN * row + 9 * pair..][..9]));
        self.of.hinge_places.add(number, weight * self.sum.weights.position, &triangle, &mut self.sum.matrix);
        let Some(product) = &mut self.sum.stiffness_times_velocity else { return };
        let vertices = self.of.hinges[hinge];
        let pairs = (0..4).flat_map(|i| (i..4).map(move |j| (i, j)));
        for ((i, j), block) in pairs.zip(&triangle) {
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
        let mut rows: Vec<Row> = Vec::new();
        for (&patch, places) in of.active.iter().zip(&of.places) {
            of.patches[patch].gradients(&angles.gradients, &mut rows);
            let (mut pair, mut mirrored) = (0, 0);
            for i in 0..rows.len() {
                for j in i..rows.len() {
                    let block = outer_product::<L>(s, &rows[i], &rows[j]);
                    add_rows(&mut matrix[places.slots[pair] as usize], &block);
                    if i != j && mirrored < places.mirrored.len() {
                        let block = outer_product::<L>(s, &rows[j], &rows[i]);
                        add_rows(&mut matrix[places.mirrored[mirrored] as usize], &block);
                        mirrored += 1;
                    }
                    pair += 1;
                }
            }
        }
    }
}

/// Returns s Σ aₖ bₖᵀ by rows. The last column is padding.
#[inline(always)]
fn outer_product<L: Level>(s: f64, a: &Row, b: &Row) -> Row {
    let mut product = [[0.0; 4]; 3];
    for k in 0..3 {
        for row in 0..3 {
            for column in 0..4 {
                product[row][column] = Number::mul_add::<L>(s * a[k][row], b[k][column], product[row][column]);
            }
        }
    }
    product
}

/// A ← A + B.
#[inline(always)]
fn add_rows<T: Precision>(sum: &mut Block<T>, block: &Row) {
    for row in 0..3 {
        for column in 0..3 {
            sum[row][column] = sum[row][column] + T::from_f64(block[row][column]);
        }
    }
}
