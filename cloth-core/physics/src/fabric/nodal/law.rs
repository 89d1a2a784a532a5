//! The law of a membrane as a function of the Green strain, from the declared energy of a triangle.
//!
//! A membrane's energy per area depends on the metric C = 1 + 2E alone. For a given E, a right-angled triangle is laid
//! into a plane. Its sides along warp and weft, per length at rest, are a = (p, 0) and b = (q, r) with C_uu = p²,
//! C_uv = p q, C_vv = q² + r². The element's derivatives with respect to w = (p, q, r) give stress S = ∂W/∂E and moduli
//! ∂S/∂E:
//!
//! g = Lᵀ S and H = Lᵀ (∂S/∂E) L + Σ S ∂²E/∂w², with L = ∂E/∂w = [[p, 0, 0], [0, q, r], [q, p, 0]]
//!
//! for E in the order (E_uu, E_vv, 2 E_uv).

use std::fmt::Debug;

use energy_dsl::{
    BLOCK, Batch, BatchWork, Declaration, Lane, Level, Packed, PackedPotential, Potential, RestError, Vector3,
    for_each_batch,
};
use energy_solve::index;

use crate::mesh::MaterialTriangle;

/// The Green strain along warp and weft: (E_uu, E_vv, 2 E_uv).
pub(super) type Strain = [f64; 3];

/// The derivatives to evaluate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// The energy alone.
    Value,
    /// Energy and stress.
    Gradient,
    /// Energy, stress and moduli.
    Hessian,
}

/// Energy, stress and moduli of a vertex, times its area. What was not asked for is zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Response {
    pub energy: f64,
    pub stress: [f64; 3],
    pub moduli: [[f64; 3]; 3],
}

/// Returns the sum of the energies.
pub(super) fn total_energy(responses: &[Response]) -> f64 {
    responses.iter().map(|response| response.energy).sum()
}

/// A membrane's energy as a function of strain, for one patch of cloth after the other.
pub(super) trait StrainLaw: Debug + Send + Sync {
    /// The declaration of the triangle.
    fn declaration(&self) -> &'static Declaration;
    /// Evaluates all patches at their strains. Returns the responses and the number of flagged patches.
    fn respond(&self, strains: &[Strain], order: Order) -> (Vec<Response>, u64);
    /// Returns the law of the patches with these indices.
    fn selected(&self, patches: &[usize]) -> Box<dyn StrainLaw>;
}

/// The law of a declared triangle.
#[derive(Debug)]
pub(super) struct TriangleLaw<E> {
    elements: Vec<E>,
    packed: Packed<E>,
    /// Length of the sides along warp and weft of each patch's triangle, in m.
    sides: Vec<f64>,
}

impl<E: PackedPotential<f64>> TriangleLaw<E> {
    /// Creates the law of patches with these areas, in m².
    pub fn new(areas: &[f64], element: &dyn Fn(MaterialTriangle) -> Result<E, RestError>) -> Result<Self, RestError> {
        let sides: Vec<f64> = areas.iter().map(|area| (2.0 * area).sqrt()).collect();
        let elements: Vec<E> =
            sides.iter().map(|&side| element([[0.0; 2], [side, 0.0], [0.0, side]])).collect::<Result<_, _>>()?;
        Ok(Self::of(elements, sides))
    }

    fn of(elements: Vec<E>, sides: Vec<f64>) -> Self {
        let point = |patch: usize, point: usize| index(3 * patch + point);
        let packed = Packed::from_fn(elements.len(), 3, |patch| &elements[patch], point);
        Self { elements, packed, sides }
    }
}

impl<E: PackedPotential<f64> + Debug + Send + Sync + 'static> StrainLaw for TriangleLaw<E> {
    fn declaration(&self) -> &'static Declaration {
        E::DECLARATION
    }

    fn respond(&self, strains: &[Strain], order: Order) -> (Vec<Response>, u64) {
        let factors: Vec<[f64; 3]> = strains.iter().map(metric_factor).collect();
        let mut points: Vec<Vector3<f64>> = Vec::with_capacity(3 * factors.len());
        for ([p, q, r], side) in factors.iter().zip(&self.sides) {
            points.extend([[0.0; 3], [side * p, 0.0, 0.0], [side * q, side * r, 0.0]]);
        }
        let mut work = Responses {
            order,
            factors: &factors,
            sides: &self.sides,
            all: vec![Response::default(); factors.len()],
            rows: [0.0; NUMBERS * BLOCK],
            flagged: 0,
        };
        for_each_batch(&self.packed, &points, &mut work);
        (work.all, work.flagged)
    }

    fn selected(&self, patches: &[usize]) -> Box<dyn StrainLaw> {
        let elements = patches.iter().map(|&patch| self.elements[patch]).collect();
        Box::new(Self::of(elements, patches.iter().map(|&patch| self.sides[patch]).collect()))
    }
}

/// Returns (p, q, r) with C_uu = p², C_uv = p q, C_vv = q² + r².
fn metric_factor(&[uu, vv, uv]: &Strain) -> [f64; 3] {
    let p = (1.0 + 2.0 * uu).sqrt();
    let q = uv / p;
    [p, q, (1.0 + 2.0 * vv - q * q).max(0.0).sqrt()]
}

/// Energy, gradient and Hessian with respect to w.
const NUMBERS: usize = 10;

struct Responses<'a> {
    order: Order,
    factors: &'a [[f64; 3]],
    sides: &'a [f64],
    all: Vec<Response>,
    rows: [f64; NUMBERS * BLOCK],
    flagged: u64,
}

impl<E: PackedPotential<f64>> BatchWork<E> for Responses<'_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let zero = L::F64::splat(0.0);
        let mut numbers = [zero; NUMBERS];
        let flags = match self.order {
            Order::Value => {
                let result = batch.element.value_at::<L>(batch.points);
                numbers[0] = result.value;
                result.flags
            }
            Order::Gradient => {
                let result = batch.element.gradient_at::<L>(batch.points);
                numbers[..4].copy_from_slice(&with_gradient(result.value, result.gradient.as_ref()));
                result.flags
            }
            Order::Hessian => {
                let result = batch.element.hessian_at::<L>(batch.points);
                numbers[..4].copy_from_slice(&with_gradient(result.value, result.gradient.as_ref()));
                // Blocks (1, 1), (1, 2) and (2, 2) of the triangle.
                let blocks = result.hessian.as_ref();
                let (of_p, mixed, of_b) = (&blocks[3], &blocks[4], &blocks[5]);
                numbers[4] = of_p[0][0];
                numbers[5] = mixed[0][0];
                numbers[6] = mixed[0][1];
                numbers[7] = of_b[0][0];
                numbers[8] = of_b[0][1];
                numbers[9] = of_b[1][1];
                result.flags
            }
        };
        L::F64::store_transposed(&numbers, batch.count, &mut self.rows, NUMBERS);
        for lane in 0..batch.count {
            let (patch, row) = (batch.first + lane, &self.rows[NUMBERS * lane..][..NUMBERS]);
            self.all[patch] = response(row, &self.factors[patch], self.sides[patch], self.order);
        }
        let lanes = energy_dsl::Mask::bits(flags.degenerate | flags.kink) & (u32::MAX >> (32 - batch.count));
        self.flagged += u64::from(lanes.count_ones());
    }
}

/// Returns the energy and the derivatives by the coordinates p, q and r of the triangle's corners.
#[inline(always)]
fn with_gradient<V: Copy>(value: V, gradient: &[[V; 3]]) -> [V; 4] {
    [value, gradient[1][0], gradient[2][0], gradient[2][1]]
}

/// Turns derivatives by corners into derivatives by strain.
#[inline(always)]
fn response(numbers: &[f64], &[p, q, r]: &[f64; 3], side: f64, order: Order) -> Response {
    if order == Order::Value {
        return Response { energy: numbers[0], ..Response::default() };
    }
    let [g_p, g_q, g_r] = [1, 2, 3].map(|number| side * numbers[number]);
    let s_vv = g_r / r;
    let s_uv = (g_q - q * s_vv) / p;
    let s_uu = (g_p - q * s_uv) / p;
    let first = Response { energy: numbers[0], stress: [s_uu, s_vv, s_uv], ..Response::default() };
    if order == Order::Gradient {
        return first;
    }
    let [pp, pq, pr, qq, qr, rr] = [4, 5, 6, 7, 8, 9].map(|number| side * side * numbers[number]);
    let h = [[pp - s_uu, pq - s_uv, pr], [pq - s_uv, qq - s_vv, qr], [pr, qr, rr - s_vv]];
    // Rows of L⁻¹: ∂(p, q, r)/∂E.
    let (per_p, per_r) = (1.0 / p, 1.0 / r);
    let inverse = [
        [per_p, 0.0, 0.0],
        [-q * per_p * per_p, 0.0, per_p],
        [q * q * per_p * per_p * per_r, per_r, -q * per_p * per_r],
    ];
    let mut moduli = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in i..3 {
            let mut sum = 0.0;
            for k in 0..3 {
                for l in 0..3 {
                    sum += inverse[k][i] * h[k][l] * inverse[l][j];
                }
            }
            (moduli[i][j], moduli[j][i]) = (sum, sum);
        }
    }
    Response { moduli, ..first }
}
