use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use energy_dsl::{
    BLOCK, Baseline, Batch, BatchWork, Block, Declaration, Element, Lane, Level, Mask, Packed, Potential, Vector3,
    dispatch, for_each_batch,
};
use energy_elements::ArcAngle;
use energy_solve::{
    Blocks, Character, Curvature as CurvaturePolicy, DofMap, Linearisation, Pattern, PlacedTerm, Precision, Quantity,
    Restriction, ScatterMaps, State, Stencils, Tally, Term, TermDescription, index,
};

use super::assembly::{CurvedPart, Energies, OuterProducts};
use super::friction::Friction;
use super::patch::{Angle, Matrix, Patch, append_gradients, residual};
use super::rigidity::cholesky;
use super::{Rigidity, RigidityError, ThreadError, curvatures};
use crate::fabric::lists::Lists;
use crate::fabric::patch_blocks::{PatchSlots, Row, padded_stencils};
use crate::fabric::plasticity::{angle_of_curvature, flow};
use crate::geometry::dot;
use crate::mesh::Warp;
use crate::mesh::{Topology, TriangleMesh};

/// Plate bending of a mesh: Σ ½ ‖r‖² over the triangles. Each r = Σ b (θ − θ̄) consists of three combinations of the
/// dihedral angles of [`ArcAngle`].
///
/// Each dihedral angle is evaluated once, even if several triangles need it. The Gauss–Newton part of the Hessian, Σ ∇r
/// ∇rᵀ, is positive semi-definite and serves as the projected Hessian. The exact Hessian adds Σ m ∇²θ with the moments
/// m = ∂U/∂θ, which is smaller by a factor of the angle between neighbours.
#[derive(Debug)]
pub struct PlateTerm {
    name: String,
    pub(super) hinges: Vec<[usize; 4]>,
    rest: Vec<f64>,
    /// The largest |θ − θ̄| of each hinge; `None` if hinges do not yield.
    limits: Option<Vec<f64>>,
    /// L of the rigidity D = L Lᵀ.
    factor: Matrix,
    /// All triangles that resist bending; a restricted term has the lists of its active ones alone.
    patches: Vec<Patch>,
    /// How each patch yields; empty if they do not.
    frictions: Vec<Friction>,
    /// Vertices of the patches, padded to the same number by repeating the first.
    stencils: Vec<u32>,
    arity: usize,
    /// Patches with a free vertex, their hinges, vertices and the slots of their blocks; set by [`Term::place`].
    pub(super) active: Vec<usize>,
    pub(super) angles: Lists<Angle>,
    pub(super) vertices: Lists<usize>,
    pub(super) patch_slots: PatchSlots,
    /// Hinges that active patches need; the same, packed; and the slots of their blocks.
    pub(super) needed: Vec<usize>,
    packed: Packed<ArcAngle>,
    pub(super) hinge_slots: ScatterMaps,
    /// U where forces or Jacobians were last evaluated, as bits.
    found: AtomicU64,
}

/// A plate that does not fit a mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlateError {
    /// The rigidities contradict each other.
    #[error(transparent)]
    Rigidity(#[from] RigidityError),
    /// A triangle has no warp direction.
    #[error(transparent)]
    Threads(#[from] ThreadError),
    /// Neighbours run the same way along their edge: the sense of an angle differs between them.
    #[error(
        "triangles {} and {} are neighbours with opposite fronts; turn the corners of one around, in Blender by Mesh > \
         Normals > Recalculate Outside", .triangles[0], .triangles[1]
    )]
    Unoriented {
        /// The two triangles.
        triangles: [usize; 2],
    },
}

impl PlateTerm {
    /// Creates the term from the rest shape of a mesh, which may be curved. `warp` is projected onto each triangle.
    ///
    /// # Errors
    /// Returns an error if the rigidities contradict each other, or a triangle of woven cloth is perpendicular to the
    /// warp.
    pub fn new(
        name: impl Into<String>,
        mesh: &TriangleMesh,
        rigidity: &Rigidity,
        warp: impl Into<Warp>,
    ) -> Result<Self, PlateError> {
        let factor = cholesky(&rigidity.matrix()?);
        let topology = Topology::of(mesh);
        let hinges: Vec<[usize; 4]> = topology.hinges.iter().map(|hinge| hinge.vertices).collect();
        let angle = ArcAngle::<f64>::new();
        let rest = topology.hinges.iter().map(|hinge| angle.value(&mesh.hinge_at_rest(hinge)).value).collect();
        let woven = matches!(rigidity, Rigidity::Orthotropic { .. });
        let curvatures = curvatures(mesh, &topology, woven.then(|| warp.into()))?;
        let patches: Vec<Patch> = curvatures.iter().filter_map(|one| Patch::new(one, &factor, &hinges)).collect();
        let (stencils, arity) = padded_stencils(patches.iter().map(|patch| &patch.vertices[..]));
        Ok(Self {
            name: name.into(),
            hinges,
            rest,
            limits: None,
            factor,
            patches,
            frictions: Vec::new(),
            stencils,
            arity,
            active: Vec::new(),
            angles: Lists::default(),
            vertices: Lists::default(),
            patch_slots: PatchSlots::default(),
            needed: Vec::new(),
            packed: Packed::new::<4>(&[], &[]),
            hinge_slots: ScatterMaps::default(),
            found: AtomicU64::default(),
        })
    }

    /// Lets hinges yield: at the end of each step, angles at rest follow what differs from them by more than a fold of
    /// this curvature, in 1/m. `mesh` is that of [`PlateTerm::new`].
    #[must_use]
    pub fn yielding(self, mesh: &TriangleMesh, curvature: f64) -> Self {
        let limit = |hinge| angle_of_curvature(mesh, hinge, curvature);
        Self { limits: Some(Topology::of(mesh).hinges.iter().map(limit).collect()), ..self }
    }

    /// Lets triangles yield: at the end of each step, the plastic curvature of each follows until the moment tensor of
    /// an isotropic plate has at most this Frobenius norm, in N (radial return). For a cylinder that is its moment per
    /// width. Other plates yield at ½ ‖r‖² = ½ A M²/D₁₁.
    #[must_use]
    pub fn with_plastic_curvature(self, moment: f64) -> Self {
        let friction = |patch: &Patch| Friction::of_all(largest(moment, patch, &self.factor));
        Self { frictions: self.patches.iter().map(friction).collect(), ..self }
    }

    /// Adds an isotropic plate that yields at this moment, in N, as [`PlateTerm::with_plastic_curvature`] says. One term
    /// for both takes as long as one plate. Its rigidity is not zero.
    ///
    /// # Errors
    /// Returns an error if rigidities contradict each other.
    ///
    /// ```
    /// use cloth_physics::fabric::{PlateTerm, Rigidity};
    /// use cloth_physics::mesh::{Diagonals, Plane, Sheet};
    ///
    /// let (diagonals, plane) = (Diagonals::Regular, Plane::Horizontal);
    /// let mesh = Sheet { cells: [4, 4], size: [0.1; 2], diagonals, plane, pleats: None }.mesh()?;
    /// let yarns = Rigidity::Orthotropic { warp: 9e-6, weft: 4e-6, bias: 5e-6, poisson_ratio: 0.1 };
    /// let friction = Rigidity::Flexural { rigidity: 8e-6, poisson_ratio: 0.0 };
    /// let plate = PlateTerm::new("bending", &mesh, &yarns, [1.0, 0.0, 0.0])?.with_friction(&friction, 0.16e-3)?;
    /// assert_eq!(plate.triangles(), 32);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn with_friction(mut self, rigidity: &Rigidity, moment: f64) -> Result<Self, PlateError> {
        let second = cholesky(&rigidity.matrix()?);
        let friction = |patch: &mut Patch| {
            Friction::of_part(patch.add_plate(&self.factor, &second), largest(moment, patch, &second))
        };
        self.frictions = self.patches.iter_mut().map(friction).collect();
        Ok(self)
    }

    /// Shifts the vertex indices by `first`, for a mesh that is one of several in a system.
    #[must_use]
    pub fn on_vertices_from(mut self, first: usize) -> Self {
        self.hinges.iter_mut().flatten().for_each(|vertex| *vertex += first);
        self.patches.iter_mut().flat_map(|patch| &mut patch.vertices).for_each(|vertex| *vertex += first);
        self.stencils.iter_mut().for_each(|vertex| *vertex += index(first));
        self
    }

    /// Number of triangles that resist bending.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.patches.len()
    }

    fn tally(&self, flagged: u64) -> Tally {
        let evaluated = self.active.len() as u64;
        Tally { evaluated, skipped: self.stencils().len() as u64 - evaluated, flagged, projected: 0 }
    }

    /// Evaluates θ − θ̄ of all needed hinges.
    fn values(&self, x: &[Vector3<f64>]) -> Values<'_> {
        let mut values =
            Values { needed: &self.needed, angles: self.rest.iter().map(|rest| -rest).collect(), flagged: 0 };
        for_each_batch(&self.packed, x, &mut values);
        values
    }

    /// Returns the energy of an active patch and its derivative by r, from the angles θ − θ̄ of all hinges.
    #[inline(always)]
    pub(super) fn response<L: Level>(&self, number: usize, angles: &[f64]) -> (f64, [f64; 3]) {
        let r = residual::<L>(self.angles.get(number), angles);
        self.frictions.get(self.active[number]).map_or_else(|| (0.5 * dot(r, r), r), |friction| friction.response(r))
    }

    /// Returns the energy of each patch with a free vertex.
    fn energies(&self, angles: &[f64]) -> Vec<f64> {
        dispatch(Energies { of: self, angles, moments: None })
    }

    /// Evaluates θ − θ̄, ∇θ and ∂U/∂θ of all needed hinges, and notes U.
    fn angles(&self, x: &[Vector3<f64>]) -> Angles<'_> {
        let mut angles = Angles {
            needed: &self.needed,
            values: self.rest.iter().map(|rest| -rest).collect(),
            gradients: vec![[[0.0; 4]; 4]; self.hinges.len()],
            moments: vec![0.0; self.hinges.len()],
            rows: [0.0; 12 * BLOCK],
            flagged: 0,
        };
        for_each_batch(&self.packed, x, &mut angles);
        let energies = dispatch(Energies { of: self, angles: &angles.values, moments: Some(&mut angles.moments) });
        self.found.store(energies.iter().sum::<f64>().to_bits(), Relaxed);
        angles
    }

    fn subtract_force(&self, angles: &Angles<'_>, force: &mut [Vector3<f64>]) {
        for ((hinge, moment), gradient) in self.hinges.iter().zip(&angles.moments).zip(&angles.gradients) {
            for (point, &vertex) in hinge.iter().enumerate() {
                for axis in 0..3 {
                    force[vertex][axis] -= moment * gradient[point][axis];
                }
            }
        }
    }

    /// Adds −Σ m ∇²θ to the matrix, and its product with v.
    fn add_curved_part(&self, moments: &[f64], state: State<'_>, sum: &mut Linearisation<'_>) {
        let mut curved_part = CurvedPart::new(self, moments, state.v, sum);
        for_each_batch(&self.packed, state.x, &mut curved_part);
    }
}

/// Returns the largest ‖r‖ of a plate with D = L Lᵀ that has at most this moment, in N: ‖r‖ = √A M/√D₁₁.
fn largest(moment: f64, patch: &Patch, factor: &Matrix) -> f64 {
    moment * patch.area.sqrt() / factor[0][0]
}

/// θ − θ̄ of each hinge; starts at −θ̄.
struct Values<'a> {
    needed: &'a [usize],
    angles: Vec<f64>,
    flagged: u64,
}

impl BatchWork<ArcAngle> for Values<'_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, ArcAngle, L::F64>) {
        let result = batch.element.value_at::<L>(batch.points);
        for lane in 0..batch.count {
            self.angles[self.needed[batch.first + lane]] += result.value.extract(lane);
        }
        self.flagged += flagged((result.flags.degenerate | result.flags.kink).bits(), batch.count);
    }
}

/// θ − θ̄ (starts at −θ̄) and ∇θ of each hinge.
pub(super) struct Angles<'a> {
    needed: &'a [usize],
    values: Vec<f64>,
    /// Four vectors, each padded to four components.
    pub(super) gradients: Vec<[[f64; 4]; 4]>,
    /// ∂U/∂θ of each hinge.
    moments: Vec<f64>,
    rows: [f64; 12 * BLOCK],
    flagged: u64,
}

impl BatchWork<ArcAngle> for Angles<'_> {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, ArcAngle, L::F64>) {
        let result = batch.element.gradient_at::<L>(batch.points);
        L::F64::store_transposed(result.gradient.as_flattened(), batch.count, &mut self.rows, 12);
        for lane in 0..batch.count {
            let hinge = self.needed[batch.first + lane];
            self.values[hinge] += result.value.extract(lane);
            for (point, gradient) in self.gradients[hinge].iter_mut().enumerate() {
                gradient[..3].copy_from_slice(&self.rows[12 * lane + 3 * point..][..3]);
            }
        }
        self.flagged += flagged((result.flags.degenerate | result.flags.kink).bits(), batch.count);
    }
}

/// Counts the flagged lanes among the first `count`.
fn flagged(lanes: u32, count: usize) -> u64 {
    u64::from((lanes & (u32::MAX >> (32 - count))).count_ones())
}

impl TermDescription for PlateTerm {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &Declaration {
        <ArcAngle as Element>::DECLARATION
    }

    fn character(&self) -> Character {
        Character { symmetric: true, velocity_dependent: false, quadratic: false, curved: true }
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(self.arity, &self.stencils)
    }
}

impl Term for PlateTerm {
    fn place(mut self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let is_free = |&vertex: &usize| dofs.row(vertex).is_some();
        self.active =
            (0..self.patches.len()).filter(|&patch| self.patches[patch].vertices.iter().any(is_free)).collect();
        let active = || self.active.iter().map(|&patch| &self.patches[patch]);
        self.angles = active().map(|patch| patch.angles.iter().copied()).collect();
        self.vertices = active().map(|patch| patch.vertices.iter().copied()).collect();
        let mut needed: Vec<usize> = self.angles.items().iter().map(Angle::hinge).collect();
        needed.sort_unstable();
        needed.dedup();
        let element = ArcAngle::new();
        self.packed =
            Packed::from_fn(needed.len(), 4, |_| &element, |number, point| index(self.hinges[needed[number]][point]));
        self.needed = needed;
        let vertices: Vec<u32> = self.needed.iter().flat_map(|&hinge| self.hinges[hinge].map(index)).collect();
        self.hinge_slots = ScatterMaps::of_all(Stencils::new(4, &vertices), dofs, pattern);
        self.patch_slots = PatchSlots::new(self.vertices.iter(), dofs, pattern);
        self
    }
}

impl PlacedTerm for PlateTerm {
    /// Keeps the patches with a chosen vertex and the hinges that they need. Hinges get new indices: sums over hinges
    /// then take as long as the restricted term is large.
    fn restricted(&self, restriction: &Restriction<'_>) -> Option<Box<dyn PlacedTerm>> {
        let numbers = restriction.remaining(self.active.iter().copied(), self.stencils());
        let stencil = |&number: &usize| self.stencils().stencil(self.active[number]);
        let mut is_needed = vec![false; self.hinges.len()];
        let angles = || numbers.iter().map(|&number| self.angles.get(number).iter());
        angles().flatten().for_each(|angle| is_needed[angle.hinge()] = true);
        let kept: Vec<usize> = (0..self.needed.len()).filter(|&number| is_needed[self.needed[number]]).collect();
        let hinges: Vec<usize> = kept.iter().map(|&number| self.needed[number]).collect();
        let mut new_index = vec![0; self.hinges.len()];
        hinges.iter().enumerate().for_each(|(new, &hinge)| new_index[hinge] = new);
        Some(Box::new(Self {
            name: self.name.clone(),
            hinges: hinges.iter().map(|&hinge| self.hinges[hinge]).collect(),
            rest: hinges.iter().map(|&hinge| self.rest[hinge]).collect(),
            limits: None,
            factor: self.factor,
            frictions: numbers.iter().filter_map(|&number| self.frictions.get(self.active[number]).copied()).collect(),
            patches: Vec::new(),
            stencils: numbers.iter().flat_map(stencil).collect(),
            arity: self.arity,
            active: (0..numbers.len()).collect(),
            angles: angles().map(|angles| angles.map(|angle| angle.renumbered(&new_index))).collect(),
            vertices: numbers.iter().map(|&number| self.vertices.get(number).iter().copied()).collect(),
            patch_slots: self.patch_slots.restricted(&numbers, restriction),
            needed: (0..hinges.len()).collect(),
            packed: self.packed.selected(&kept),
            hinge_slots: self.hinge_slots.restricted(&kept, restriction),
            found: AtomicU64::default(),
        }))
    }

    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        let values = self.values(x);
        Some((self.energies(&values.angles).iter().sum(), self.tally(values.flagged)))
    }

    fn end_step(&mut self, end: State<'_>) {
        if let Some(limits) = &self.limits {
            let strains = self.values(end.x).angles;
            // Other hinges were not evaluated.
            for &hinge in &self.needed {
                flow(&mut self.rest[hinge..=hinge], &strains[hinge..=hinge], &limits[hinge..=hinge]);
            }
        }
        if !self.frictions.is_empty() {
            let angles = self.values(end.x).angles;
            for (&patch, own) in self.active.iter().zip(self.angles.iter()) {
                self.frictions[patch].flow(residual::<Baseline>(own, &angles));
            }
        }
    }

    fn is_driven(&self) -> bool {
        self.limits.is_some() || !self.frictions.is_empty()
    }

    fn history(&self) -> Vec<f64> {
        let rest = self.limits.as_ref().map_or(&[][..], |_| &self.rest);
        rest.iter().copied().chain(self.frictions.iter().flat_map(|friction| friction.plastic)).collect()
    }

    fn restore_history(&mut self, history: &[f64]) {
        let rest = if self.limits.is_some() { self.rest.len() } else { 0 };
        if history.len() != rest + 3 * self.frictions.len() {
            return;
        }
        self.rest[..rest].copy_from_slice(&history[..rest]);
        for (friction, saved) in self.frictions.iter_mut().zip(history[rest..].chunks_exact(3)) {
            friction.plastic.copy_from_slice(saved);
        }
    }

    fn energy_found(&self) -> Option<f64> {
        Some(f64::from_bits(self.found.load(Relaxed)))
    }

    fn element_energies(&self, x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        Some(self.active.iter().copied().zip(self.energies(&self.values(x).angles)).collect())
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        let angles = self.angles(state.x);
        self.subtract_force(&angles, force);
        self.tally(angles.flagged)
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let angles = self.angles(state.x);
        self.subtract_force(&angles, sum.force);
        match &mut sum.matrix {
            Blocks::Single(matrix) => self.add_outer_products(&angles, -sum.weights.position, matrix),
            Blocks::Double(matrix) => self.add_outer_products(&angles, -sum.weights.position, matrix),
        }
        if let Some(product) = &mut sum.stiffness_times_velocity {
            self.subtract_products(&angles, state.v, product);
        }
        if sum.curvature == CurvaturePolicy::Exact {
            self.add_curved_part(&angles.moments, state, sum);
        }
        self.tally(angles.flagged)
    }

    fn find_non_finite(&self, _: Quantity, state: State<'_>) -> Option<usize> {
        let angles = self.angles(state.x);
        let is_finite = |own: &[Angle]| {
            let finite =
                |angle: &Angle| angles.gradients[angle.hinge()].as_flattened().iter().all(|number| number.is_finite());
            residual::<Baseline>(own, &angles.values).iter().all(|number| number.is_finite()) && own.iter().all(finite)
        };
        self.active.iter().zip(self.angles.iter()).find(|(_, own)| !is_finite(own)).map(|(&patch, _)| patch)
    }
}

impl PlateTerm {
    /// Adds s Σ ∇r ∇rᵀ to the matrix.
    fn add_outer_products<T: Precision>(&self, angles: &Angles<'_>, s: f64, matrix: &mut [Block<T>]) {
        dispatch(OuterProducts { of: self, angles, s, matrix });
    }

    /// Subtracts Σ ∇r (∇r · v) from the product.
    fn subtract_products(&self, angles: &Angles<'_>, v: &[Vector3<f64>], product: &mut [Vector3<f64>]) {
        let mut rows = Vec::new();
        for (own, vertices) in self.angles.iter().zip(self.vertices.iter()) {
            rows.clear();
            append_gradients::<Baseline, f64>(own, vertices.len(), &angles.gradients, &mut rows);
            for k in 0..3 {
                let along = |(&i, row): (&usize, &Row<f64>)| (0..3).map(|axis| row[k][axis] * v[i][axis]).sum::<f64>();
                let rate: f64 = vertices.iter().zip(&rows).map(along).sum();
                for (&i, row) in vertices.iter().zip(&rows) {
                    (0..3).for_each(|axis| product[i][axis] -= rate * row[k][axis]);
                }
            }
        }
    }
}
