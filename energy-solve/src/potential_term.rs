use std::fmt::Debug;

use energy_dsl::{
    Array, BLOCK, Batch, BatchWork, Block, Declaration, Lane, Level, Mask, Number, Packed, PackedPotential, Potential,
    ReducedPotential, Vector3, for_each_batch, triangle_index,
};

use crate::active::{active_elements, points_of};
use crate::counts::Tally;
use crate::curvature::{Curvature, Indefinite, MOST_NUMBERS, Orthonormal, change_dense, is_semi_definite};
use crate::dofs::DofMap;
use crate::list::ElementList;
use crate::pattern::{Pattern, Storage, index};
use crate::places::Places;
use crate::term::{Character, Linearisation, Quantity, State, Stencils, Term};

/// A term with f = −∇U: never dependent on velocity, always with symmetric Jacobians.
///
/// Elements are evaluated many at once, over lanes. Everything is summed up in the order of the elements: results do not depend on
/// how many there are at once.
#[derive(Clone, Debug)]
pub struct PotentialTerm<E> {
    list: ElementList<E>,
    /// The indices of the elements that are evaluated.
    active: Vec<usize>,
    packed: Packed<E>,
    places: Places,
    orthonormal: Option<Orthonormal>,
}

impl<E: PackedPotential<f64>> PotentialTerm<E> {
    /// The sum of the potentials of a list. Hessians that the declaration proves zero (gravity's) are never evaluated.
    #[must_use]
    pub fn new(list: ElementList<E>) -> Self {
        let packed = Packed::from_fn(0, list.arity(), |element| &list.elements()[element], |_, _| 0);
        let orthonormal = Orthonormal::new(E::DECLARATION);
        Self { list, active: Vec::new(), packed, places: Places::default(), orthonormal }
    }

    fn tally(&self, flagged: u64) -> Tally {
        let evaluated = self.active.len() as u64;
        Tally { evaluated, skipped: self.list.elements().len() as u64 - evaluated, flagged, projected: 0 }
    }
}

impl<E: PackedPotential<f64> + Debug> Term for PotentialTerm<E> {
    fn name(&self) -> &str {
        self.list.name()
    }

    fn declaration(&self) -> &'static Declaration {
        E::DECLARATION
    }

    fn character(&self) -> Character {
        let Declaration { quadratic, curved, .. } = *E::DECLARATION;
        Character { symmetric: true, velocity_dependent: false, quadratic, curved }
    }

    fn stencils(&self) -> Stencils<'_> {
        self.list.stencils()
    }

    fn place(&mut self, dofs: &DofMap, pattern: &Pattern) {
        let n = self.list.arity();
        self.active = active_elements(self.list.stencils(), dofs);
        self.packed = Packed::from_fn(
            self.active.len(),
            n,
            |number| &self.list.elements()[self.active[number]],
            |number, point| index(self.list.stencil(self.active[number])[point]),
        );
        if self.character().curved {
            let mut pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect();
            if pattern.storage() == Storage::Whole {
                pairs.extend((0..n).flat_map(|i| (i + 1..n).map(move |j| (j, i))));
            }
            self.places = Places::new(&self.active, self.list.stencils(), &pairs, dofs, pattern);
        }
    }

    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        let mut values = Values { sums: [0.0; BLOCK], flagged: 0 };
        for_each_batch(&self.packed, x, &mut values);
        Some((values.sums.iter().sum(), self.tally(values.flagged)))
    }

    fn element_energies(&self, x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        let value = |number: usize| self.list.elements()[number].value(&points_of(self.list.stencil(number), x)).value;
        Some(self.active.iter().map(|&number| (number, value(number))).collect())
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        let mut gradients = Gradients { force, rows: vec![0.0; 3 * self.list.arity() * BLOCK], flagged: 0 };
        for_each_batch(&self.packed, state.x, &mut gradients);
        self.tally(gradients.flagged)
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let n = self.list.arity();
        let numbers = 3 * n + 9 * n * (n + 1) / 2;
        let mut hessians = Hessians {
            sum,
            velocities: state.v,
            places: &self.places,
            orthonormal: self.orthonormal.as_ref(),
            rows: vec![0.0; numbers * BLOCK],
            numbers: vec![0.0; MOST_NUMBERS * BLOCK],
            flagged: 0,
            projected: 0,
        };
        for_each_batch(&self.packed, state.x, &mut hessians);
        let projected = hessians.projected;
        Tally { projected, ..self.tally(hessians.flagged) }
    }

    fn find_non_finite(&self, quantity: Quantity, state: State<'_>) -> Option<usize> {
        let is_finite = |element: &&usize| {
            let result = self.list.elements()[**element].gradient(&points_of(self.list.stencil(**element), state.x));
            match quantity {
                Quantity::Energy => result.value.is_finite(),
                Quantity::Force => result.gradient.as_ref().as_flattened().iter().all(|number| number.is_finite()),
            }
        };
        self.active.iter().find(|element| !is_finite(element)).copied()
    }
}

/// How many of the first lanes a mask holds in.
#[inline(always)]
fn lanes_in(mask: impl Mask, count: usize) -> u64 {
    u64::from((mask.bits() & (u32::MAX >> (32 - count))).count_ones())
}

/// Σ U, as one sum for each place in a block, so that it is the same for any number of lanes.
struct Values {
    sums: [f64; BLOCK],
    flagged: u64,
}

impl<E: PackedPotential<f64>> BatchWork<E> for Values {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let result = batch.element.value_at::<L>(batch.points);
        let sums = &mut self.sums[batch.first % BLOCK..][..batch.count];
        let sum = L::F64::load_ragged(sums) + result.value;
        sum.store_ragged(sums);
        let flags = result.flags.degenerate | result.flags.kink;
        self.flagged += lanes_in(flags, batch.count);
    }
}

/// f ← f − ∇U.
struct Gradients<'a> {
    force: &'a mut [Vector3<f64>],
    rows: Vec<f64>,
    flagged: u64,
}

impl<E: PackedPotential<f64>> BatchWork<E> for Gradients<'_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let result = batch.element.gradient_at::<L>(batch.points);
        let gradient = result.gradient.as_ref();
        scatter_vectors::<E, L>(&batch, gradient, &mut self.rows, self.force);
        self.flagged += lanes_in(result.flags.degenerate | result.flags.kink, batch.count);
    }
}

/// Subtracts vectors of the elements' points.
#[inline(always)]
fn scatter_vectors<E: PackedPotential<f64>, L: Level>(
    batch: &Batch<'_, E, L::F64>,
    vectors: &[Vector3<L::F64>],
    rows: &mut [f64],
    all: &mut [Vector3<f64>],
) {
    let stride = 3 * vectors.len();
    L::F64::store_transposed(vectors.as_flattened(), batch.count, rows, stride);
    for lane in 0..batch.count {
        let row = &rows[lane * stride..][..stride];
        for point in 0..vectors.len() {
            let vector = &mut all[batch.vertices(point)[lane] as usize];
            for axis in 0..3 {
                vector[axis] -= row[3 * point + axis];
            }
        }
    }
}

/// f ← f − ∇U and A ← A − α ∇²U.
struct Hessians<'a, 'b> {
    sum: &'a mut Linearisation<'b>,
    velocities: &'a [Vector3<f64>],
    places: &'a Places,
    orthonormal: Option<&'a Orthonormal>,
    rows: Vec<f64>,
    /// What [`Indefinite`] needs.
    numbers: Vec<f64>,
    flagged: u64,
    projected: u64,
}

impl<E: PackedPotential<f64>> BatchWork<E> for Hessians<'_, '_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let mut reduced = batch.element.reduced_hessian_at::<L>(batch.points);
        let exact = self.sum.curvature == Curvature::Exact;
        if let Some(orthonormal) = self.orthonormal
            && !exact
        {
            let n = <<E::Wide<L::F64> as ReducedPotential<L::F64>>::Coordinates as Array<L::F64>>::LEN;
            let hessian = reduced.hessian.as_mut();
            let open = (!is_semi_definite(hessian, n)).bits() & (u32::MAX >> (32 - batch.count));
            if open != 0 {
                let changed = self.change_indefinite::<E, L>(orthonormal, hessian, open, batch.points.as_ref());
                self.projected += u64::from(changed.count_ones());
            }
        }
        let mut result = <E::Wide<L::F64> as ReducedPotential<L::F64>>::expand::<{ u32::MAX }>(&reduced);
        if self.orthonormal.is_none() && !exact {
            self.projected += change_one_by_one(result.hessian.as_mut(), batch.count, self.sum.curvature);
        }
        scatter_vectors::<E, L>(&batch, result.gradient.as_ref(), &mut self.rows, self.sum.force);
        if let Some(product) = &mut self.sum.stiffness_times_velocity {
            subtract_product::<E, L>(&batch, result.hessian.as_ref(), self.velocities, &mut self.rows, product);
        }
        self.turn::<L>(batch.first, result.hessian.as_mut());
        self.scatter::<L>(batch.first, batch.count, result.hessian.as_ref());
        self.flagged += lanes_in(result.flags.degenerate | result.flags.kink, batch.count);
    }
}

impl Hessians<'_, '_> {
    /// Changes the curvature of Hessians some of which are indefinite; returns as bits which changed.
    #[inline(always)]
    fn change_indefinite<E: PackedPotential<f64>, L: Level>(
        &mut self,
        orthonormal: &Orthonormal,
        hessian: &mut [L::F64],
        open: u32,
        points: &[Vector3<L::F64>],
    ) -> u32 {
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let vectors = E::DECLARATION.reduced_vectors.len();
        let known = if vectors <= 2 { difference_vectors::<E, L>(points) } else { [[L::F64::splat(0.0); 3]; 2] };
        for (number, stored) in hessian.iter().chain(known.as_flattened()).zip(self.numbers.chunks_exact_mut(lanes)) {
            number.store(stored);
        }
        let indefinite = Indefinite {
            n: 3 * vectors,
            curvature: self.sum.curvature,
            orthonormal,
            vectors: if vectors <= 2 { vectors } else { 0 },
            open,
            numbers: &mut self.numbers,
        };
        let changed = indefinite.change(L::NAME);
        for (number, stored) in hessian.iter_mut().zip(self.numbers.chunks_exact(lanes)) {
            *number = L::F64::load(stored);
        }
        changed
    }

    /// Turns the blocks (i, j) that are stored as (j, i).
    #[inline(always)]
    fn turn<L: Level>(&self, first: usize, triangle: &mut [[Vector3<L::F64>; 3]]) {
        for pair in 0..triangle.len() {
            let bits = self.places.turned(first, pair);
            if bits != 0 {
                let turned = <L::F64 as Number>::Mask::from_bits(bits);
                let block = &mut triangle[pair];
                for (i, j) in [(0, 1), (0, 2), (1, 2)] {
                    let (upper, lower) = (block[i][j], block[j][i]);
                    block[i][j] = L::F64::select(turned, lower, upper);
                    block[j][i] = L::F64::select(turned, upper, lower);
                }
            }
        }
    }

    /// Subtracts α times the blocks from those of the matrix.
    #[inline(always)]
    fn scatter<L: Level>(&mut self, first: usize, count: usize, triangle: &[[Vector3<L::F64>; 3]]) {
        let stride = 9 * triangle.len();
        L::F64::store_transposed(triangle.as_flattened().as_flattened(), count, &mut self.rows, stride);
        let weight = -self.sum.weights.position;
        for lane in 0..count {
            let slots = self.places.of(first + lane);
            let blocks = self.rows[lane * stride..][..stride].as_chunks::<9>().0;
            for pair in 0..triangle.len() {
                let block = self.sum.matrix[slots[pair] as usize].as_flattened_mut();
                add_block::<L>(block, weight, &blocks[pair]);
            }
            if slots.len() > triangle.len() {
                add_mirrored(&slots[triangle.len()..], blocks, weight, self.sum.matrix);
            }
        }
    }
}

/// B ← B + s A, as many entries at once as there are lanes.
#[inline(always)]
fn add_block<L: Level>(sum: &mut [f64], scale: f64, block: &[f64; 9]) {
    let lanes = <L::F64 as Lane<f64>>::LANES;
    let wide = 9 / lanes * lanes;
    for entry in (0..wide).step_by(lanes) {
        let place = &mut sum[entry..entry + lanes];
        (L::F64::load(place) + L::F64::splat(scale) * L::F64::load(&block[entry..])).store(place);
    }
    for entry in wide..9 {
        sum[entry] += scale * block[entry];
    }
}

/// Adds the blocks below the diagonal, where other terms make the matrix one that is not symmetric.
#[inline(never)]
fn add_mirrored(slots: &[u32], triangle: &[[f64; 9]], weight: f64, matrix: &mut [Block<f64>]) {
    let n = points_of_triangle(triangle.len());
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| triangle_index(n, i, j)));
    for (&slot, pair) in slots.iter().zip(pairs) {
        for row in 0..3 {
            for column in 0..3 {
                matrix[slot as usize][row][column] += weight * triangle[pair][3 * column + row];
            }
        }
    }
}

/// The one or two difference vectors of an element.
#[inline(always)]
fn difference_vectors<E: PackedPotential<f64>, L: Level>(points: &[Vector3<L::F64>]) -> [Vector3<L::F64>; 2] {
    let mut vectors = [[L::F64::splat(0.0); 3]; 2];
    for (vector, terms) in vectors.iter_mut().zip(E::DECLARATION.reduced_vectors) {
        for &(point, added) in *terms {
            for axis in 0..3 {
                let part = points[point][axis];
                vector[axis] = if added { vector[axis] + part } else { vector[axis] - part };
            }
        }
    }
    vectors
}

/// Subtracts ∇²U v.
#[inline(always)]
fn subtract_product<E: PackedPotential<f64>, L: Level>(
    batch: &Batch<'_, E, L::F64>,
    triangle: &[[Vector3<L::F64>; 3]],
    velocities: &[Vector3<f64>],
    rows: &mut [f64],
    product: &mut [Vector3<f64>],
) {
    let n = batch.points.as_ref().len();
    let zero = [L::F64::splat(0.0); 3];
    let (mut v, mut sums) = (*batch.points, *batch.points);
    for point in 0..n {
        v.as_mut()[point] = L::F64::gather(velocities, batch.vertices(point));
        sums.as_mut()[point] = zero;
    }
    let (v, sums) = (v.as_ref(), sums.as_mut());
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
    scatter_vectors::<E, L>(batch, sums, rows, product);
}

/// The way of elements with many coordinates. Returns how many changed.
#[inline(never)]
fn change_one_by_one<V: Lane<f64>>(triangle: &mut [[Vector3<V>; 3]], count: usize, curvature: Curvature) -> u64 {
    let points = points_of_triangle(triangle.len());
    let mut changed = 0;
    for lane in 0..count {
        let mut one: Vec<_> =
            triangle.iter().map(|block| block.map(|row| row.map(|entry| entry.extract(lane)))).collect();
        if change_dense(&mut one, points, curvature) {
            changed += 1;
            for (block, new) in triangle.iter_mut().flatten().flatten().zip(one.iter().flatten().flatten()) {
                let old = *block;
                *block = V::from_fn(|other| if other == lane { *new } else { old.extract(other) });
            }
        }
    }
    changed
}

/// n, of n (n + 1)/2 blocks.
fn points_of_triangle(blocks: usize) -> usize {
    (1..).find(|n| n * (n + 1) / 2 >= blocks).expect("there is such a number")
}
