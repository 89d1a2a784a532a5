use std::fmt::Debug;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use energy_dsl::{
    Array, BLOCK, Batch, BatchWork, Declaration, Lane, Level, Mask, Number, Packed, PackedPotential, Potential,
    ReducedPotential, Vector3, WidePoints, for_each_batch_in, triangle_index,
};

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, Storage};
use crate::matrix::precision::Blocks;
use crate::terms::active::Active;
use crate::terms::counts::Tally;
use crate::terms::curvature::{Curvature, Indefinite, MOST_NUMBERS, Orthonormal, change_dense, is_semi_definite};
use crate::terms::element_list::ElementList;
use crate::terms::places::Places;
use crate::terms::scatter::{TriangleRoom, VectorRoom, points_of_triangle};
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, Divisible, Linearisation, Quantity, Share, State, Term};

/// A term with f = −∇U: never dependent on velocity, always with symmetric Jacobians.
///
/// Elements are evaluated many at once, over lanes. Everything is summed up in the order of the elements: results do not depend on
/// how many there are at once.
#[derive(Debug)]
pub struct PotentialTerm<E> {
    /// Without its elements, once they are packed, and without their stencils, if all are.
    list: ElementList<E>,
    /// How many elements there are.
    count: usize,
    active: Active,
    packed: Packed<E>,
    /// Where blocks go, and those below the diagonal, where all are stored.
    places: Places,
    mirrored: Places,
    orthonormal: Option<Orthonormal>,
    /// The elements that each share needs, in whole packs.
    shares: Vec<Vec<Range<usize>>>,
    /// U of each pack, where it was evaluated last. Shares that need the same pack find the same.
    energies: Vec<AtomicU64>,
}

/// Packs of a part of the energy.
const ENERGY_PART: usize = 256;

impl<E: PackedPotential<f64>> PotentialTerm<E> {
    /// The sum of the potentials of a list. Hessians that the declaration proves zero (gravity's) are never evaluated.
    #[must_use]
    pub fn new(list: ElementList<E>) -> Self {
        let packed = Packed::from_fn(0, list.arity(), |element| &list.elements()[element], |_, _| 0);
        let (count, orthonormal) = (list.elements().len(), Orthonormal::new(E::DECLARATION));
        Self {
            list,
            count,
            active: Active::default(),
            packed,
            places: Places::default(),
            mirrored: Places::default(),
            orthonormal,
            shares: Vec::new(),
            energies: Vec::new(),
        }
    }

    fn tally(&self, flagged: u64) -> Tally {
        let evaluated = self.active.len() as u64;
        Tally { evaluated, skipped: self.count as u64 - evaluated, flagged, projected: 0 }
    }

    /// What a share did. The first answers for all elements.
    fn tally_of(&self, share: &Share, flagged: u64) -> Tally {
        if share.number == 0 { self.tally(flagged) } else { Tally { flagged, ..Tally::default() } }
    }

    /// The stencils, from wherever they are.
    fn all_stencils(&self) -> Stencils<'_> {
        let packed = !self.packed.is_empty() && self.active.are_all();
        if packed {
            Stencils::in_lanes(self.count, self.list.arity(), self.packed.stencils())
        } else {
            self.list.stencils()
        }
    }

    /// The points of an element that is evaluated, by its number among them.
    fn points(&self, number: usize, x: &[Vector3<f64>]) -> WidePoints<E, f64> {
        let (stencils, element) = (self.all_stencils(), self.active.element(number));
        WidePoints::<E, f64>::from_fn(|point| x[stencils.vertex(element, point) as usize])
    }

    /// The packs of elements that have one of these vertices.
    fn packs_at(&self, vertices: &Range<usize>) -> Vec<Range<usize>> {
        let mut packs: Vec<Range<usize>> = Vec::new();
        let (stencils, inside) = (self.all_stencils(), |vertex: u32| vertices.contains(&(vertex as usize)));
        let needed = |number| stencils.stencil(self.active.element(number)).any(inside);
        for start in (0..self.active.len()).step_by(BLOCK) {
            let end = (start + BLOCK).min(self.active.len());
            if (start..end).any(needed) {
                match packs.last_mut() {
                    Some(last) if last.end == start => last.end = end,
                    _ => packs.push(start..end),
                }
            }
        }
        packs
    }

    /// Adds f of consecutive vertices; returns how many elements, of those whose first vertex is one of them, were flagged.
    fn forces(
        &self,
        packs: &[Range<usize>],
        first_vertex: usize,
        x: &[Vector3<f64>],
        force: &mut [Vector3<f64>],
    ) -> u64 {
        let room = VectorRoom::new(self.list.arity());
        let mut gradients = Gradients { force, first_vertex, room, energies: self.pack_energies(), flagged: 0 };
        for pack in packs {
            for_each_batch_in(&self.packed, pack.clone(), x, &mut gradients);
        }
        gradients.flagged
    }

    /// Adds f and its Jacobians of consecutive vertices and blocks; returns how many elements were flagged, and projected.
    fn linearisation(
        &self,
        packs: &[Range<usize>],
        (first_vertex, first_block): (usize, usize),
        state: State<'_>,
        sum: &mut Linearisation<'_>,
    ) -> (u64, u64) {
        let n = self.list.arity();
        let mut hessians = Hessians {
            sum,
            first_vertex,
            first_block,
            velocities: state.v,
            places: &self.places,
            mirrored: &self.mirrored,
            orthonormal: self.orthonormal.as_ref(),
            vectors: VectorRoom::new(n),
            triangles: TriangleRoom::new(n),
            numbers: vec![0.0; MOST_NUMBERS * BLOCK],
            energies: self.pack_energies(),
            flagged: 0,
            projected: 0,
        };
        for pack in packs {
            for_each_batch_in(&self.packed, pack.clone(), state.x, &mut hessians);
        }
        (hessians.flagged, hessians.projected)
    }

    /// Where energies are noted.
    fn pack_energies(&self) -> PackEnergies<'_> {
        PackEnergies { elements: self.active.len(), lanes: [0.0; BLOCK], found: &self.energies }
    }

    /// The energy of a part, from that of its packs.
    fn found_in(&self, part: usize) -> f64 {
        let packs = &self.energies[(part * ENERGY_PART).min(self.energies.len())..];
        packs.iter().take(ENERGY_PART).fold(0.0, |sum, energy| sum + f64::from_bits(energy.load(Relaxed)))
    }

    /// All elements.
    fn whole(&self) -> Range<usize> {
        0..self.active.len()
    }
}

impl<E: PackedPotential<f64> + Debug + Sync> Divisible for PotentialTerm<E> {
    fn energy_parts(&self) -> usize {
        // One at least, to say what was skipped.
        self.energies.len().div_ceil(ENERGY_PART).max(1)
    }

    fn energy_part(&self, part: usize, x: &[Vector3<f64>]) -> (f64, Tally) {
        let mut values = Values { energies: self.pack_energies(), flagged: 0 };
        let packs = part * ENERGY_PART..(part + 1) * ENERGY_PART;
        let elements = packs.start * BLOCK..(packs.end * BLOCK).min(self.active.len());
        for_each_batch_in(&self.packed, elements, x, &mut values);
        let flagged = values.flagged;
        let tally = if part == 0 { self.tally(flagged) } else { Tally { flagged, ..Tally::default() } };
        (self.found_in(part), tally)
    }

    fn add_force_of(&self, share: &Share, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.tally_of(share, self.forces(&self.shares[share.number], share.vertices.start, state.x, force))
    }

    fn add_linearisation_of(&self, share: &Share, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let first = (share.vertices.start, share.blocks.start);
        let (flagged, projected) = self.linearisation(&self.shares[share.number], first, state, sum);
        Tally { projected, ..self.tally_of(share, flagged) }
    }
}

impl<E: PackedPotential<f64> + Debug + Sync> Term for PotentialTerm<E> {
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
        self.all_stencils()
    }

    fn place(&mut self, dofs: &DofMap, pattern: &Pattern) {
        let n = self.list.arity();
        let elements = self.list.take_elements();
        assert_eq!(elements.len(), self.count, "{}: a term is placed once", self.list.name());
        self.active = Active::new(self.list.stencils(), dofs);
        let stencils = self.list.stencils();
        let vertex = |number: usize, point: usize| stencils.vertex(self.active.element(number), point);
        self.packed = Packed::from_fn(self.active.len(), n, |number| &elements[self.active.element(number)], vertex);
        if self.active.are_all() {
            self.list.forget_stencils();
        }
        self.energies = (0..self.active.len().div_ceil(BLOCK)).map(|_| AtomicU64::default()).collect();
        // Constant Jacobians are evaluated before there are many vectors: their places would be of use once, and take memory for good.
        if !self.character().quadratic {
            self.place_blocks(dofs, pattern);
        }
    }

    fn place_blocks(&mut self, dofs: &DofMap, pattern: &Pattern) {
        if !self.character().curved || !self.places.is_empty() {
            return;
        }
        let n = self.list.arity();
        let places = |pairs: &[_]| Places::new(&self.active, self.all_stencils(), pairs, dofs, pattern);
        let upper = places(&(0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect::<Vec<_>>());
        if pattern.storage() == Storage::Whole {
            self.mirrored = places(&(0..n).flat_map(|i| (i + 1..n).map(move |j| (j, i))).collect::<Vec<_>>());
        }
        self.places = upper;
    }

    fn forget_blocks(&mut self) {
        (self.places, self.mirrored) = (Places::default(), Places::default());
    }

    fn divide(&mut self, shares: &[Share]) {
        self.shares = shares.iter().map(|share| self.packs_at(&share.vertices)).collect();
    }

    fn divisible(&self) -> Option<&dyn Divisible> {
        Some(self)
    }

    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        let (mut sum, mut tally) = (0.0, Tally::default());
        for part in 0..self.energy_parts() {
            let (energy, of_part) = self.energy_part(part, x);
            sum += energy;
            tally += of_part;
        }
        Some((sum, tally))
    }

    fn energy_found(&self) -> Option<f64> {
        Some((0..self.energy_parts()).fold(0.0, |sum, part| sum + self.found_in(part)))
    }

    fn element_energies(&self, x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        let value = |number: usize| self.packed.element(number).value(&self.points(number, x)).value;
        Some(self.active.iter().enumerate().map(|(number, element)| (element, value(number))).collect())
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.tally(self.forces(&[self.whole()], 0, state.x, force))
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let (flagged, projected) = self.linearisation(&[self.whole()], (0, 0), state, sum);
        Tally { projected, ..self.tally(flagged) }
    }

    fn find_non_finite(&self, quantity: Quantity, state: State<'_>) -> Option<usize> {
        let is_finite = |number: usize| {
            let result = self.packed.element(number).gradient(&self.points(number, state.x));
            match quantity {
                Quantity::Energy => result.value.is_finite(),
                Quantity::Force => result.gradient.as_ref().as_flattened().iter().all(|number| number.is_finite()),
            }
        };
        (0..self.active.len()).find(|&number| !is_finite(number)).map(|number| self.active.element(number))
    }
}

/// In which of the first lanes a mask holds, as bits.
#[inline(always)]
fn lanes_in(mask: impl Mask, count: usize) -> u32 {
    mask.bits() & (u32::MAX >> (32 - count))
}

/// How many of these lanes belong to elements whose first vertex is one of `count` from `first` on: each element counts for one share.
#[inline(always)]
fn count_owned(lanes: u32, vertices: &[u32], first: usize, count: usize) -> u64 {
    if lanes == 0 {
        return 0;
    }
    let owned = |lane: &usize| (vertices[*lane] as usize).wrapping_sub(first) < count;
    (0..vertices.len()).filter(|lane| lanes >> lane & 1 == 1).filter(owned).count() as u64
}

/// Σ U of each pack, always summed up in the same way, so that it is the same for any number of lanes.
struct PackEnergies<'a> {
    /// How many elements there are.
    elements: usize,
    lanes: [f64; BLOCK],
    found: &'a [AtomicU64],
}

impl PackEnergies<'_> {
    #[inline(always)]
    fn note<E: PackedPotential<f64>, L: Level>(&mut self, batch: &Batch<'_, E, L::F64>, values: L::F64) {
        let place = batch.first % BLOCK;
        values.store(&mut self.lanes[place..]);
        let next = place + <L::F64 as Lane<f64>>::LANES;
        if next == BLOCK || batch.first + batch.count == self.elements {
            // What no element has written is left over from others.
            self.lanes[place + batch.count..].fill(0.0);
            let sum = in_pairs::<4, 2>(in_pairs::<8, 4>(in_pairs::<BLOCK, 8>(self.lanes)));
            self.found[batch.first / BLOCK].store((sum[0] + sum[1]).to_bits(), Relaxed);
        }
    }
}

/// Sums of numbers half of them apart.
#[inline(always)]
fn in_pairs<const ALL: usize, const HALF: usize>(numbers: [f64; ALL]) -> [f64; HALF] {
    let mut sums = [0.0; HALF];
    for place in 0..HALF {
        sums[place] = numbers[place] + numbers[place + HALF];
    }
    sums
}

/// Σ U.
struct Values<'a> {
    energies: PackEnergies<'a>,
    flagged: u64,
}

impl<E: PackedPotential<f64>> BatchWork<E> for Values<'_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let result = batch.element.value_at::<L>(batch.points);
        self.energies.note::<E, L>(&batch, result.value);
        let flags = result.flags.degenerate | result.flags.kink;
        self.flagged += u64::from(lanes_in(flags, batch.count).count_ones());
    }
}

/// f ← f − ∇U of the vertices from the first on.
struct Gradients<'a> {
    force: &'a mut [Vector3<f64>],
    first_vertex: usize,
    room: VectorRoom,
    energies: PackEnergies<'a>,
    flagged: u64,
}

impl<E: PackedPotential<f64>> BatchWork<E> for Gradients<'_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let result = batch.element.gradient_at::<L>(batch.points);
        let gradient = result.gradient.as_ref();
        self.energies.note::<E, L>(&batch, result.value);
        self.room.subtract::<E, L>(&batch, gradient, self.first_vertex, self.force);
        let flagged = lanes_in(result.flags.degenerate | result.flags.kink, batch.count);
        self.flagged += count_owned(flagged, batch.vertices(0), self.first_vertex, self.force.len());
    }
}

/// f ← f − ∇U and A ← A − α ∇²U of the vertices and blocks from the first on.
struct Hessians<'a, 'b> {
    sum: &'a mut Linearisation<'b>,
    first_vertex: usize,
    first_block: usize,
    velocities: &'a [Vector3<f64>],
    places: &'a Places,
    mirrored: &'a Places,
    orthonormal: Option<&'a Orthonormal>,
    vectors: VectorRoom,
    triangles: TriangleRoom,
    /// What [`Indefinite`] needs.
    numbers: Vec<f64>,
    energies: PackEnergies<'a>,
    flagged: u64,
    projected: u64,
}

impl<E: PackedPotential<f64>> BatchWork<E> for Hessians<'_, '_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let mut reduced = batch.element.reduced_hessian_at::<L>(batch.points);
        let exact = self.sum.curvature == Curvature::Exact;
        let mut projected = 0;
        if let Some(orthonormal) = self.orthonormal
            && !exact
        {
            let n = <<E::Wide<L::F64> as ReducedPotential<L::F64>>::Coordinates as Array<L::F64>>::LEN;
            let hessian = reduced.hessian.as_mut();
            let open = (!is_semi_definite(hessian, n)).bits() & (u32::MAX >> (32 - batch.count));
            if open != 0 {
                projected = self.change_indefinite::<E, L>(orthonormal, hessian, open, batch.points.as_ref());
            }
        }
        let mut result = <E::Wide<L::F64> as ReducedPotential<L::F64>>::expand::<{ u32::MAX }>(&reduced);
        if self.orthonormal.is_none() && !exact {
            projected = change_one_by_one(result.hessian.as_mut(), batch.count, self.sum.curvature);
        }
        self.energies.note::<E, L>(&batch, result.value);
        self.vectors.subtract::<E, L>(&batch, result.gradient.as_ref(), self.first_vertex, self.sum.force);
        if let Some(product) = &mut self.sum.stiffness_times_velocity {
            let first_vertex = self.first_vertex;
            let triangle = result.hessian.as_ref();
            subtract_product::<E, L>(&batch, triangle, self.velocities, &mut self.vectors, first_vertex, product);
        }
        self.turn::<L>(batch.first, result.hessian.as_mut());
        self.scatter::<L>(batch.first, batch.count, result.hessian.as_ref());
        let flagged = lanes_in(result.flags.degenerate | result.flags.kink, batch.count);
        let (vertices, first, count) = (batch.vertices(0), self.first_vertex, self.sum.force.len());
        self.flagged += count_owned(flagged, vertices, first, count);
        self.projected += count_owned(projected, vertices, first, count);
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
        self.triangles.fill::<L>(-self.sum.weights.position, triangle);
        let (pairs, elements) = (triangle.len(), first..first + count);
        let (slots, mirrored) = (self.places.of(elements.clone()), self.mirrored.of(elements));
        match &mut self.sum.matrix {
            Blocks::Single(matrix) => self.triangles.add_to(pairs, slots, mirrored, self.first_block, matrix),
            Blocks::Double(matrix) => self.triangles.add_to(pairs, slots, mirrored, self.first_block, matrix),
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
    room: &mut VectorRoom,
    first_vertex: usize,
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
    room.subtract::<E, L>(batch, sums, first_vertex, product);
}

/// The way of elements with many coordinates. Returns as bits which changed.
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
