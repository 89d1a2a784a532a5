use std::fmt::Debug;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use energy_dsl::{BLOCK, Declaration, Vector3};

use super::character;
use super::evaluated::Evaluated;
use super::pack_energies::PackEnergies;
use super::work::{Gradients, Hessians, Values};
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::terms::active::Active;
use crate::terms::counts::Tally;
use crate::terms::curvature::Orthonormal;
use crate::terms::linearisation::Linearisation;
use crate::terms::restriction::Restriction;
use crate::terms::scatter_map::ScatterMaps;
use crate::terms::share::{Divisible, Share};
use crate::terms::state::State;
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, PlacedTerm, Quantity, TermDescription};

/// Packs in one part of the energy.
const ENERGY_PART: usize = 256;

/// A [`PotentialTerm`](crate::PotentialTerm) within a system: the active elements, packed into lanes.
#[derive(Debug)]
pub(super) struct PlacedPotentialTerm<E> {
    name: String,
    /// Points of an element.
    arity: usize,
    /// The number of elements, inactive ones included.
    count: usize,
    /// All stencils; empty if every element is active, because the packs hold them too.
    vertices: Vec<u32>,
    active: Active,
    packed: E,
    maps: ScatterMaps,
    orthonormal: Option<Orthonormal>,
    /// The elements that each share needs, in whole packs.
    shares: Vec<Vec<Range<usize>>>,
    /// U of each pack at its last evaluation, as bits. Shares that evaluate the same pack write the same value.
    energies: Vec<AtomicU64>,
}

impl<E: Evaluated> PlacedPotentialTerm<E> {
    /// Creates the term of `count` elements with these `vertices`, whose active ones are `packed`.
    pub(super) fn new(
        name: String,
        (count, vertices): (usize, Vec<u32>),
        (active, packed): (Active, E),
        dofs: &DofMap,
        pattern: &Pattern,
    ) -> Self {
        let mut term = Self::with_maps(name, (count, vertices), (active, packed), ScatterMaps::default());
        if E::PACK == BLOCK && term.active.is_all() && term.active.len() > 0 {
            // The packs hold them too.
            term.vertices = Vec::new();
        }
        // Constant Jacobians are evaluated once: their maps are looked up then and freed afterwards.
        if !term.character().quadratic {
            term.place_blocks(dofs, pattern);
        }
        term
    }

    /// Creates the term from the maps of the blocks of its active elements.
    pub(super) fn with_maps(
        name: String,
        (count, vertices): (usize, Vec<u32>),
        (active, packed): (Active, E),
        maps: ScatterMaps,
    ) -> Self {
        let declaration = packed.declaration();
        let (arity, orthonormal) = (declaration.points.len(), Orthonormal::new(declaration));
        Self {
            name,
            arity,
            count,
            vertices,
            energies: (0..active.len().div_ceil(BLOCK)).map(|_| AtomicU64::default()).collect(),
            active,
            packed,
            maps,
            orthonormal,
            shares: Vec::new(),
        }
    }

    /// Returns the active elements with a chosen vertex.
    pub(super) fn restricted_to(&self, restriction: &Restriction<'_>) -> Self {
        let stencils = self.stencils();
        let numbers = restriction.remaining(self.active.iter(), stencils);
        let vertices = numbers.iter().flat_map(|&number| stencils.stencil(self.active.element(number))).collect();
        let (active, packed) = (Active::all(numbers.len()), self.packed.selected(&numbers));
        let maps = self.maps.restricted(&numbers, restriction);
        Self::with_maps(self.name.clone(), (numbers.len(), vertices), (active, packed), maps)
    }

    fn tally(&self, flagged: u64) -> Tally {
        let evaluated = self.active.len() as u64;
        Tally { evaluated, skipped: self.count as u64 - evaluated, flagged, projected: 0 }
    }

    /// Returns the tally of a share. The first share counts the evaluated and skipped elements of all.
    fn tally_of(&self, share: &Share, flagged: u64) -> Tally {
        if share.number == 0 { self.tally(flagged) } else { Tally { flagged, ..Tally::default() } }
    }

    /// Returns the packs with an element on one of these vertices, as ranges of elements.
    fn packs_at(&self, vertices: &Range<usize>) -> Vec<Range<usize>> {
        let mut packs: Vec<Range<usize>> = Vec::new();
        let (stencils, inside) = (self.stencils(), |vertex: u32| vertices.contains(&(vertex as usize)));
        let needed = |number| stencils.stencil(self.active.element(number)).any(inside);
        for start in (0..self.active.len()).step_by(E::PACK) {
            let end = (start + E::PACK).min(self.active.len());
            if (start..end).any(needed) {
                match packs.last_mut() {
                    Some(last) if last.end == start => last.end = end,
                    _ => packs.push(start..end),
                }
            }
        }
        packs
    }

    /// Adds f of consecutive vertices. Returns how many flagged elements have their first vertex among them.
    fn forces(
        &self,
        packs: &[Range<usize>],
        first_vertex: usize,
        x: &[Vector3<f64>],
        force: &mut [Vector3<f64>],
    ) -> u64 {
        let mut gradients = Gradients::new(self.arity, force, first_vertex, self.pack_energies());
        self.packed.gradients(packs, x, &mut gradients);
        gradients.flagged
    }

    /// Adds f and its Jacobians for consecutive vertices and blocks. Returns the numbers of flagged and of projected
    /// elements.
    fn linearisation(
        &self,
        packs: &[Range<usize>],
        first: (usize, usize),
        state: State<'_>,
        sum: &mut Linearisation<'_>,
    ) -> (u64, u64) {
        let (maps, orthonormal) = (&self.maps, self.orthonormal.as_ref());
        let mut hessians = Hessians::new(self.arity, sum, first, state.v, maps, orthonormal, self.pack_energies());
        self.packed.hessians(packs, state.x, &mut hessians);
        (hessians.flagged, hessians.projected)
    }

    fn pack_energies(&self) -> PackEnergies<'_> {
        PackEnergies::new(self.active.len(), &self.energies)
    }

    /// Returns the energy of a part at its last evaluation.
    fn found_in(&self, part: usize) -> f64 {
        let packs = &self.energies[(part * ENERGY_PART).min(self.energies.len())..];
        packs.iter().take(ENERGY_PART).fold(0.0, |sum, energy| sum + f64::from_bits(energy.load(Relaxed)))
    }

    /// The range of all active elements.
    fn all(&self) -> Range<usize> {
        0..self.active.len()
    }
}

impl<E: Evaluated> Divisible for PlacedPotentialTerm<E> {
    fn energy_parts(&self) -> usize {
        // At least one, which reports the skipped elements.
        self.energies.len().div_ceil(ENERGY_PART).max(1)
    }

    fn energy_part(&self, part: usize, x: &[Vector3<f64>]) -> (f64, Tally) {
        let mut values = Values::new(self.pack_energies());
        let packs = part * ENERGY_PART..(part + 1) * ENERGY_PART;
        let elements = packs.start * BLOCK..(packs.end * BLOCK).min(self.active.len());
        self.packed.values(&[elements], x, &mut values);
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

impl<E: Evaluated> TermDescription for PlacedPotentialTerm<E> {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &Declaration {
        self.packed.declaration()
    }

    fn character(&self) -> Character {
        character(self.packed.declaration())
    }

    fn stencils(&self) -> Stencils<'_> {
        if self.vertices.is_empty() {
            Stencils::in_lanes(self.count, self.arity, self.packed.stencils())
        } else {
            Stencils::new(self.arity, &self.vertices)
        }
    }
}

impl<E: Evaluated> PlacedTerm for PlacedPotentialTerm<E> {
    fn place_blocks(&mut self, dofs: &DofMap, pattern: &Pattern) {
        if self.character().curved && self.maps.upper.is_empty() {
            self.maps = ScatterMaps::new(&self.active, self.stencils(), dofs, pattern);
        }
    }

    fn forget_blocks(&mut self) {
        self.maps = ScatterMaps::default();
    }

    fn restricted(&self, restriction: &Restriction<'_>) -> Option<Box<dyn PlacedTerm>> {
        Some(Box::new(self.restricted_to(restriction)))
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
        let mut energies = Vec::with_capacity(self.active.len());
        self.packed.each_gradient(x, &mut |number, energy, _| energies.push((self.active.element(number), energy)));
        Some(energies)
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.tally(self.forces(&[self.all()], 0, state.x, force))
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let (flagged, projected) = self.linearisation(&[self.all()], (0, 0), state, sum);
        Tally { projected, ..self.tally(flagged) }
    }

    fn find_non_finite(&self, quantity: Quantity, state: State<'_>) -> Option<usize> {
        let mut found = None;
        self.packed.each_gradient(state.x, &mut |number, energy, gradient| {
            let is_finite = match quantity {
                Quantity::Energy => energy.is_finite(),
                Quantity::Force => gradient.iter().all(|number| number.is_finite()),
            };
            found = found.or((!is_finite).then_some(number));
        });
        found.map(|number| self.active.element(number))
    }
}
