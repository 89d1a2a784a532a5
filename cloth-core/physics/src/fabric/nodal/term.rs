use std::fmt;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use energy_dsl::{Declaration, PackedPotential, RestError, Vector3, dispatch};
use energy_solve::{
    Blocks, Character, Divisible, DofMap, Linearisation, Pattern, PlacedTerm, Quantity, Restriction, Share, State,
    Stencils, Tally, Term, TermDescription,
};

use super::assembly::Strains;
use super::fan::{Fan, fans};
use super::law::{Order, Response, StrainLaw, TriangleLaw, total_energy};
use super::patch::Patches;
use crate::fabric::patch_blocks::{PatchSlots, padded_stencils};
use crate::fabric::plasticity::flowed;
use crate::geometry::dot;
use crate::mesh::{MaterialTriangle, TriangleMesh};

/// The law of patches with these areas, in m².
type LawOfAreas = Box<dyn Fn(&[f64]) -> Result<Box<dyn StrainLaw>, RestError> + Send + Sync>;

/// Moduli by strain (E_uu, E_vv, 2 E_uv), in N/m.
pub(in super::super) type Moduli = [[f64; 3]; 3];

/// Σ A_v (W(Ē_v) − ½ Ē_v : C_v : Ē_v) over the vertices of a mesh; see the [module](super).
#[derive(Debug)]
pub(in super::super) struct NodalMembrane {
    name: String,
    declaration: &'static Declaration,
    /// The laws of the active patches, [`CHUNK`] by [`CHUNK`]; before [`Term::place`], a single one for all patches.
    pub(super) chunks: Vec<Chunk>,
    /// C_v, which plain triangles carry.
    plain: Vec<Moduli>,
    pub(super) patches: Patches,
    /// Vertices of the patches, padded to the same number by repeating the first.
    stencils: Vec<u32>,
    arity: usize,
    /// Patches with a free vertex, and the slots of their blocks; set by [`Term::place`].
    pub(super) active: Vec<usize>,
    pub(super) slots: PatchSlots,
    /// How rest shapes yield; `None` if they do not.
    flow: Option<Flow>,
    /// The chunks with a patch at a vertex of each share; set by [`PlacedTerm::divide`].
    pub(super) shares: Vec<Vec<usize>>,
}

/// Patches whose laws are evaluated together.
pub(super) const CHUNK: usize = 64;

/// The law of consecutive active patches.
#[derive(Debug)]
pub(super) struct Chunk {
    /// Their numbers among the active patches.
    pub numbers: Range<usize>,
    law: Box<dyn StrainLaw>,
    /// U where forces or Jacobians were last evaluated, as bits.
    pub found: AtomicU64,
}

impl Chunk {
    fn new(numbers: Range<usize>, law: Box<dyn StrainLaw>) -> Self {
        Self { numbers, law, found: AtomicU64::default() }
    }
}

/// A mesh at rest, divided into fans.
pub(in super::super) struct RestShapes<'a> {
    mesh: &'a TriangleMesh,
    rest: &'a [MaterialTriangle],
    fans: Vec<Fan>,
}

/// Triangles that yield where a principal stretch exceeds a limit.
struct Flow {
    triangles: Vec<[usize; 3]>,
    rest: Vec<MaterialTriangle>,
    fans: Vec<Fan>,
    law: LawOfAreas,
    limit: f64,
}

impl fmt::Debug for Flow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Flow").field("limit", &self.limit).finish_non_exhaustive()
    }
}

impl<'a> RestShapes<'a> {
    /// Divides a mesh into fans. Woven triangles have their first axis along the warp.
    pub fn new(mesh: &'a TriangleMesh, rest: &'a [MaterialTriangle], is_woven: bool) -> Self {
        Self { mesh, rest, fans: fans(mesh, rest, is_woven) }
    }

    /// Returns a mean edge length per fan, in m.
    pub fn edge_lengths(&self) -> Vec<f64> {
        let of_fan = |fan: &Fan| mean_edge(fan.iter().map(|corner| &self.rest[corner.triangle]));
        self.fans.iter().map(of_fan).collect()
    }

    /// Returns the mean over the corners of each triangle of a matrix per fan.
    pub fn means_of_corners(&self, of_fans: &[Moduli]) -> Vec<Moduli> {
        let mut means = vec![[[0.0; 3]; 3]; self.mesh.triangles().len()];
        for (fan, moduli) in self.fans.iter().zip(of_fans) {
            for corner in fan {
                let mean = means[corner.triangle].as_flattened_mut();
                mean.iter_mut().zip(moduli.as_flattened()).for_each(|(sum, entry)| *sum += entry / 3.0);
            }
        }
        means
    }
}

/// Returns the mean length of the sides of triangles, in m.
pub(in super::super) fn mean_edge<'a>(triangles: impl ExactSizeIterator<Item = &'a MaterialTriangle>) -> f64 {
    let sides = 3 * triangles.len();
    let perimeter = |&[a, b, c]: &MaterialTriangle| -> f64 {
        [[a, b], [b, c], [c, a]].iter().map(|[from, to]| (to[0] - from[0]).hypot(to[1] - from[1])).sum()
    };
    triangles.map(perimeter).sum::<f64>() / sides as f64
}

impl NodalMembrane {
    /// Creates the term. `plain` holds C_v per fan; triangles that stretch beyond `limit` yield.
    pub fn new<E: PackedPotential<f64> + fmt::Debug + Send + Sync + 'static>(
        name: String,
        first: usize,
        shapes: RestShapes<'_>,
        plain: Vec<Moduli>,
        element: impl Fn(MaterialTriangle) -> Result<E, RestError> + Send + Sync + 'static,
        limit: Option<f64>,
    ) -> Result<Self, RestError> {
        let law: LawOfAreas = Box::new(move |areas| Ok(Box::new(TriangleLaw::new(areas, &element)?)));
        let RestShapes { mesh, rest, fans } = shapes;
        let patches = Patches::new(&fans, mesh.triangles(), rest, first);
        let triangles = mesh.triangles().iter().map(|corners| corners.map(|vertex| first + vertex)).collect();
        let areas: Vec<f64> = (0..patches.len()).map(|patch| patches.area(patch)).collect();
        let (stencils, arity) = padded_stencils(patches.vertices());
        let of_all = law(&areas)?;
        Ok(Self {
            name,
            declaration: of_all.declaration(),
            chunks: vec![Chunk::new(0..patches.len(), of_all)],
            shares: Vec::new(),
            stencils,
            arity,
            plain,
            active: Vec::new(),
            slots: PatchSlots::default(),
            patches,
            flow: limit.map(|limit| Flow { triangles, rest: rest.to_vec(), fans, law, limit }),
        })
    }

    pub(super) fn tally(&self, flagged: u64) -> Tally {
        let evaluated = self.active.len() as u64;
        Tally { evaluated, skipped: self.patches.len() as u64 - evaluated, flagged, projected: 0 }
    }

    /// Evaluates the patches of a chunk: A_v (W(Ē) − ½ Ē : C_v : Ē) and its derivatives by Ē. Returns the number of
    /// flagged patches as well, and notes U.
    pub(super) fn responses(&self, chunk: &Chunk, x: &[Vector3<f64>], order: Order) -> (Vec<Response>, u64) {
        let patches = &self.active[chunk.numbers.clone()];
        let strains = dispatch(Strains { of: self, patches, x });
        let (mut all, flagged) = chunk.law.respond(&strains, order);
        for ((response, strain), &patch) in all.iter_mut().zip(&strains).zip(patches) {
            for i in 0..3 {
                let moduli = self.plain[patch][i].map(|entry| self.patches.area(patch) * entry);
                let stress = dot(moduli, *strain);
                response.energy -= 0.5 * stress * strain[i];
                response.stress[i] -= stress;
                (0..3).for_each(|j| response.moduli[i][j] -= moduli[j]);
            }
        }
        if order != Order::Value {
            chunk.found.store(total_energy(&all).to_bits(), Relaxed);
        }
        (all, flagged)
    }

    /// Evaluates all active patches.
    fn all_responses(&self, x: &[Vector3<f64>], order: Order) -> Vec<Response> {
        self.chunks.iter().flat_map(|chunk| self.responses(chunk, x, order).0).collect()
    }

    /// Returns the laws of active patches with these numbers, which ascend.
    fn chunks_of(&self, numbers: &[usize]) -> Vec<Chunk> {
        let (mut chunks, mut first) = (Vec::new(), 0);
        for chunk in &self.chunks {
            let end = numbers.partition_point(|&number| number < chunk.numbers.end);
            let within: Vec<usize> = numbers[first..end].iter().map(|number| number - chunk.numbers.start).collect();
            if !within.is_empty() {
                chunks.push(Chunk::new(first..end, chunk.law.selected(&within)));
            }
            first = end;
        }
        chunks
    }

    /// Takes the rest shapes of the flow.
    fn fit(&mut self) {
        let Some(flow) = &self.flow else { return };
        self.patches.fit(&flow.fans, &flow.rest);
        for chunk in &mut self.chunks {
            let patches = self.active[chunk.numbers.clone()].iter();
            let areas: Vec<f64> = patches.map(|&patch| self.patches.area(patch)).collect();
            // Rest shapes that the elements refuse are not taken.
            if let Ok(law) = (flow.law)(&areas) {
                chunk.law = law;
            }
        }
    }
}

/// Returns the share of a single thread, for which all chunks are evaluated.
fn whole(vertices: usize, blocks: usize) -> Share {
    Share { number: usize::MAX, vertices: 0..vertices, blocks: 0..blocks }
}

impl TermDescription for NodalMembrane {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &Declaration {
        self.declaration
    }

    fn character(&self) -> Character {
        Character { symmetric: true, velocity_dependent: false, quadratic: false, curved: true }
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(self.arity, &self.stencils)
    }
}

impl Term for NodalMembrane {
    fn place(mut self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let is_free = |&vertex: &usize| dofs.row(vertex).is_some();
        self.active =
            (0..self.patches.len()).filter(|&patch| self.patches.get(patch).vertices.iter().any(is_free)).collect();
        let starts = (0..self.active.len()).step_by(CHUNK);
        let chunks = starts.map(|start| start..(start + CHUNK).min(self.active.len()));
        let all = &self.chunks[0].law;
        self.chunks = chunks.map(|numbers| Chunk::new(numbers.clone(), all.selected(&self.active[numbers]))).collect();
        let vertices = self.active.iter().map(|&patch| self.patches.get(patch).vertices);
        self.slots = PatchSlots::new(vertices, dofs, pattern);
        self
    }
}

impl PlacedTerm for NodalMembrane {
    fn restricted(&self, restriction: &Restriction<'_>) -> Option<Box<dyn PlacedTerm>> {
        let numbers = restriction.remaining(self.active.iter().copied(), self.stencils());
        let chosen = || numbers.iter().map(|&number| self.active[number]);
        let of = self.stencils();
        Some(Box::new(Self {
            name: self.name.clone(),
            declaration: self.declaration,
            chunks: self.chunks_of(&numbers),
            shares: Vec::new(),
            plain: chosen().map(|patch| self.plain[patch]).collect(),
            patches: self.patches.selected(chosen()),
            stencils: chosen().flat_map(|patch| of.stencil(patch)).collect(),
            arity: self.arity,
            active: (0..numbers.len()).collect(),
            slots: self.slots.restricted(&numbers, restriction),
            flow: None,
        }))
    }

    fn divide(&mut self, shares: &[Share]) {
        self.shares = shares.iter().map(|share| self.chunks_at(&share.vertices)).collect();
    }

    fn divisible(&self) -> Option<&dyn Divisible> {
        Some(self)
    }

    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        let add = |(sum, tally): (f64, Tally), (part, other): (f64, Tally)| {
            let flagged = tally.flagged + other.flagged;
            (sum + part, Tally { flagged, ..tally })
        };
        let parts = (0..self.energy_parts()).map(|part| self.energy_part(part, x));
        Some(parts.fold((0.0, self.tally(0)), add))
    }

    fn end_step(&mut self, end: State<'_>) {
        let Some(flow) = &mut self.flow else { return };
        let mut flows = false;
        for (rest, corners) in flow.rest.iter_mut().zip(&flow.triangles) {
            if let Some(moved) = flowed(*rest, corners.map(|vertex| end.x[vertex]), flow.limit) {
                (*rest, flows) = (moved, true);
            }
        }
        if flows {
            self.fit();
        }
    }

    fn is_driven(&self) -> bool {
        self.flow.is_some()
    }

    fn history(&self) -> Vec<f64> {
        self.flow.as_ref().map_or_else(Vec::new, |flow| flow.rest.as_flattened().as_flattened().to_vec())
    }

    fn restore_history(&mut self, history: &[f64]) {
        let Some(flow) = &mut self.flow else { return };
        let numbers = flow.rest.as_flattened_mut().as_flattened_mut();
        if history.len() == numbers.len() {
            numbers.copy_from_slice(history);
            self.fit();
        }
    }

    fn energy_found(&self) -> Option<f64> {
        Some(self.chunks.iter().fold(0.0, |sum, chunk| sum + f64::from_bits(chunk.found.load(Relaxed))))
    }

    fn element_energies(&self, x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        let energies = self.all_responses(x, Order::Value).into_iter().map(|response| response.energy);
        Some(self.active.iter().copied().zip(energies).collect())
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.add_force_of(&whole(force.len(), 0), state, force)
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let blocks = match &sum.matrix {
            Blocks::Single(matrix) => matrix.len(),
            Blocks::Double(matrix) => matrix.len(),
        };
        self.add_linearisation_of(&whole(sum.force.len(), blocks), state, sum)
    }

    fn find_non_finite(&self, _: Quantity, state: State<'_>) -> Option<usize> {
        let responses = self.all_responses(state.x, Order::Gradient);
        let is_finite = |response: &Response| (response.energy + response.stress.iter().sum::<f64>()).is_finite();
        self.active.iter().zip(&responses).find(|(_, response)| !is_finite(response)).map(|(&patch, _)| patch)
    }
}
