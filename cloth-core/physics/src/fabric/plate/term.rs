use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use energy_dsl::{
    BLOCK, Batch, BatchWork, Block, Declaration, Element, Lane, Level, Mask, Packed, Potential, Vector3, dispatch,
    for_each_batch,
};
use energy_elements::ArcAngle;
use energy_solve::{
    Blocks, Character, Curvature as CurvaturePolicy, DofMap, Linearisation, Pattern, PlacedTerm, Precision, Quantity,
    Restriction, ScatterMaps, State, Stencils, Tally, Term, TermDescription, index,
};

use super::assembly::{CurvedPart, OuterProducts};
use super::rigidity::cholesky;
use super::{Curvature, Rigidity, RigidityError, ThreadError, curvatures};
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
    /// The moment at which triangles yield, in N; `None` if they do not.
    largest_moment: Option<f64>,
    pub(super) patches: Vec<Patch>,
    /// Vertices of the patches, padded to the same number by repeating the first.
    stencils: Vec<u32>,
    arity: usize,
    /// Patches with a free vertex, and the slots of their blocks; set by [`Term::place`].
    pub(super) active: Vec<usize>,
    pub(super) patch_slots: Vec<PatchSlots>,
    /// Hinges that active patches need; the same, packed; and the slots of their blocks.
    pub(super) needed: Vec<usize>,
    packed: Packed<ArcAngle>,
    pub(super) hinge_slots: ScatterMaps,
    /// U where forces or Jacobians were last evaluated, as bits.
    found: AtomicU64,
}

/// A triangle and the hinges that its curvature depends on.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// Its vertices, in ascending order.
    vertices: Vec<usize>,
    /// Its hinges: their indices, their b, and the positions of their points in `vertices`.
    angles: Vec<Angle>,
    /// Rest area, in m².
    area: f64,
    /// √(A D₁₁).
    scale: f64,
    /// The part of Σ b (θ − θ̄) that is plastic.
    plastic: [f64; 3],
}

#[derive(Clone, Copy, Debug)]
struct Angle {
    hinge: usize,
    b: [f64; 3],
    local: [u8; 4],
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
            largest_moment: None,
            patches,
            stencils,
            arity,
            active: Vec::new(),
            patch_slots: Vec::new(),
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
        Self { largest_moment: Some(moment), ..self }
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
        Tally { evaluated, skipped: self.patches.len() as u64 - evaluated, flagged, projected: 0 }
    }

    /// Evaluates θ − θ̄ of all needed hinges.
    fn values(&self, x: &[Vector3<f64>]) -> Values<'_> {
        let mut values =
            Values { needed: &self.needed, angles: self.rest.iter().map(|rest| -rest).collect(), flagged: 0 };
        for_each_batch(&self.packed, x, &mut values);
        values
    }

    /// Returns ½ ‖r‖² of each patch with a free vertex, from the angles θ − θ̄ of all hinges.
    fn half_squares<'a>(&'a self, angles: &'a [f64]) -> impl Iterator<Item = (usize, f64)> + 'a {
        let half_square = |patch: usize| {
            let r = self.patches[patch].residual(angles);
            0.5 * dot(r, r)
        };
        self.active.iter().map(move |&patch| (patch, half_square(patch)))
    }

    fn sum(&self, angles: &[f64]) -> f64 {
        self.half_squares(angles).map(|(_, energy)| energy).sum()
    }

    /// Evaluates θ − θ̄ and ∇θ of all needed hinges, and notes U.
    fn angles(&self, x: &[Vector3<f64>]) -> Angles<'_> {
        let mut angles = Angles {
            needed: &self.needed,
            values: self.rest.iter().map(|rest| -rest).collect(),
            gradients: vec![[[0.0; 4]; 4]; self.hinges.len()],
            rows: [0.0; 12 * BLOCK],
            flagged: 0,
        };
        for_each_batch(&self.packed, x, &mut angles);
        self.found.store(self.sum(&angles.values).to_bits(), Relaxed);
        angles
    }

    /// Returns m = ∂U/∂θ of all hinges.
    fn moments(&self, angles: &Angles<'_>) -> Vec<f64> {
        let mut moments = vec![0.0; self.hinges.len()];
        for &patch in &self.active {
            let patch = &self.patches[patch];
            let r = patch.residual(&angles.values);
            for angle in &patch.angles {
                moments[angle.hinge] += dot(angle.b, r);
            }
        }
        moments
    }

    fn subtract_force(&self, angles: &Angles<'_>, moments: &[f64], force: &mut [Vector3<f64>]) {
        for ((hinge, moment), gradient) in self.hinges.iter().zip(moments).zip(&angles.gradients) {
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

impl Patch {
    /// Sets r = √A (1 − Q Qᵀ) Lᵀ κ with D = L Lᵀ. Q spans the directions that the angles at free edges can reach;
    /// minimising over them makes these components 0. Returns `None` if nothing remains.
    fn new(curvature: &Curvature, factor: &[[f64; 3]; 3], hinges: &[[usize; 4]]) -> Option<Self> {
        let scaled = |b: &[f64; 3]| -> [f64; 3] {
            std::array::from_fn(|k| curvature.area.sqrt() * (0..3).map(|i| factor[i][k] * b[i]).sum::<f64>())
        };
        let mut directions: Vec<[f64; 3]> = Vec::new();
        for free in &curvature.free {
            let mut direction = scaled(free);
            let before = dot(direction, direction);
            directions.iter().for_each(|q| project_out(&mut direction, q));
            let length = dot(direction, direction);
            if length > 1e-20 * before {
                directions.push(direction.map(|component| component / length.sqrt()));
            }
        }
        let mut angles = Vec::new();
        for &(hinge, b) in &curvature.angles {
            let mut b = scaled(&b);
            directions.iter().for_each(|q| project_out(&mut b, q));
            angles.push(Angle { hinge, b, local: [0; 4] });
        }
        let largest = angles.iter().map(|angle| dot(angle.b, angle.b)).fold(0.0, f64::max);
        angles.retain(|angle| dot(angle.b, angle.b) > 1e-24 * largest);
        let mut vertices: Vec<usize> = angles.iter().flat_map(|angle| hinges[angle.hinge]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        for angle in &mut angles {
            angle.local = hinges[angle.hinge].map(|vertex| {
                u8::try_from(vertices.partition_point(|&known| known < vertex)).expect("a patch has few vertices")
            });
        }
        let (area, scale) = (curvature.area, curvature.area.sqrt() * factor[0][0]);
        (!angles.is_empty()).then_some(Self { vertices, angles, area, scale, plastic: [0.0; 3] })
    }

    /// Moves the plastic part until the moment is at most the given one, in N.
    fn flow(&mut self, values: &[f64], moment: f64) {
        let r = self.residual(values);
        // ‖r‖ = √(A/D) M of an isotropic plate; `scale` is √(A D).
        let (size, limit) = (dot(r, r).sqrt(), moment * self.area / self.scale);
        if size > limit {
            (0..3).for_each(|k| self.plastic[k] += (1.0 - limit / size) * r[k]);
        }
    }

    /// Returns the same patch, whose hinges have new indices.
    fn renumbered(&self, new_index: &[usize]) -> Self {
        let angles = self.angles.iter().map(|angle| Angle { hinge: new_index[angle.hinge], ..*angle }).collect();
        Self { vertices: self.vertices.clone(), angles, ..*self }
    }

    fn residual(&self, values: &[f64]) -> [f64; 3] {
        let mut r = self.plastic.map(|part| -part);
        for angle in &self.angles {
            for k in 0..3 {
                r[k] += angle.b[k] * values[angle.hinge];
            }
        }
        r
    }

    /// Appends ∇r: three vectors per vertex.
    #[inline(always)]
    pub(super) fn append_gradients<T: Precision>(&self, gradients: &[[[f64; 4]; 4]], all: &mut Vec<Row<T>>) {
        let first = all.len();
        all.resize(first + self.vertices.len(), [[T::from_f64(0.0); 4]; 3]);
        let rows = &mut all[first..];
        for angle in &self.angles {
            let gradient = &gradients[angle.hinge];
            for point in 0..4 {
                let row = &mut rows[angle.local[point] as usize];
                for k in 0..3 {
                    let b = T::from_f64(angle.b[k]);
                    for axis in 0..4 {
                        row[k][axis] = row[k][axis] + b * T::from_f64(gradient[point][axis]);
                    }
                }
            }
        }
    }
}

fn project_out(vector: &mut [f64; 3], unit: &[f64; 3]) {
    let part = dot(*vector, *unit);
    (0..3).for_each(|k| vector[k] -= part * unit[k]);
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
        let mut needed: Vec<usize> =
            self.active.iter().flat_map(|&patch| self.patches[patch].angles.iter().map(|angle| angle.hinge)).collect();
        needed.sort_unstable();
        needed.dedup();
        let element = ArcAngle::new();
        self.packed =
            Packed::from_fn(needed.len(), 4, |_| &element, |number, point| index(self.hinges[needed[number]][point]));
        self.needed = needed;
        let vertices: Vec<u32> = self.needed.iter().flat_map(|&hinge| self.hinges[hinge].map(index)).collect();
        self.hinge_slots = ScatterMaps::of_all(Stencils::new(4, &vertices), dofs, pattern);
        let slots = |&patch: &usize| PatchSlots::new(&self.patches[patch].vertices, dofs, pattern);
        self.patch_slots = self.active.iter().map(slots).collect();
        self
    }
}

impl PlacedTerm for PlateTerm {
    /// Keeps the patches with a chosen vertex and the hinges that they need. Hinges get new indices: sums over hinges
    /// then take as long as the restricted term is large.
    fn restricted(&self, restriction: &Restriction<'_>) -> Option<Box<dyn PlacedTerm>> {
        let numbers = restriction.remaining(self.active.iter().copied(), self.stencils());
        let patches: Vec<&Patch> = numbers.iter().map(|&number| &self.patches[self.active[number]]).collect();
        let stencil = |&number: &usize| self.stencils().stencil(self.active[number]);
        let mut is_needed = vec![false; self.hinges.len()];
        patches.iter().flat_map(|patch| &patch.angles).for_each(|angle| is_needed[angle.hinge] = true);
        let kept: Vec<usize> = (0..self.needed.len()).filter(|&number| is_needed[self.needed[number]]).collect();
        let hinges: Vec<usize> = kept.iter().map(|&number| self.needed[number]).collect();
        let mut new_index = vec![0; self.hinges.len()];
        hinges.iter().enumerate().for_each(|(new, &hinge)| new_index[hinge] = new);
        Some(Box::new(Self {
            name: self.name.clone(),
            hinges: hinges.iter().map(|&hinge| self.hinges[hinge]).collect(),
            rest: hinges.iter().map(|&hinge| self.rest[hinge]).collect(),
            limits: None,
            largest_moment: None,
            patches: patches.iter().map(|patch| patch.renumbered(&new_index)).collect(),
            stencils: numbers.iter().flat_map(stencil).collect(),
            arity: self.arity,
            active: (0..numbers.len()).collect(),
            patch_slots: numbers.iter().map(|&number| self.patch_slots[number].restricted(restriction)).collect(),
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
        Some((self.sum(&values.angles), self.tally(values.flagged)))
    }

    fn end_step(&mut self, end: State<'_>) {
        if let Some(limits) = &self.limits {
            let strains = self.values(end.x).angles;
            // Other hinges were not evaluated.
            for &hinge in &self.needed {
                flow(&mut self.rest[hinge..=hinge], &strains[hinge..=hinge], &limits[hinge..=hinge]);
            }
        }
        if let Some(moment) = self.largest_moment {
            let angles = self.values(end.x).angles;
            self.active.iter().for_each(|&patch| self.patches[patch].flow(&angles, moment));
        }
    }

    fn is_driven(&self) -> bool {
        self.limits.is_some() || self.largest_moment.is_some()
    }

    fn history(&self) -> Vec<f64> {
        let rest = self.limits.as_ref().map_or(&[][..], |_| &self.rest);
        let patches = if self.largest_moment.is_some() { &self.patches[..] } else { &[] };
        rest.iter().copied().chain(patches.iter().flat_map(|patch| patch.plastic)).collect()
    }

    fn restore_history(&mut self, history: &[f64]) {
        let rest = if self.limits.is_some() { self.rest.len() } else { 0 };
        let patches = if self.largest_moment.is_some() { self.patches.len() } else { 0 };
        if history.len() != rest + 3 * patches {
            return;
        }
        self.rest[..rest].copy_from_slice(&history[..rest]);
        for (patch, saved) in self.patches.iter_mut().zip(history[rest..].chunks_exact(3)) {
            patch.plastic.copy_from_slice(saved);
        }
    }

    fn energy_found(&self) -> Option<f64> {
        Some(f64::from_bits(self.found.load(Relaxed)))
    }

    fn element_energies(&self, x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        Some(self.half_squares(&self.values(x).angles).collect())
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        let angles = self.angles(state.x);
        self.subtract_force(&angles, &self.moments(&angles), force);
        self.tally(angles.flagged)
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let angles = self.angles(state.x);
        let moments = self.moments(&angles);
        self.subtract_force(&angles, &moments, sum.force);
        match &mut sum.matrix {
            Blocks::Single(matrix) => self.add_outer_products(&angles, -sum.weights.position, matrix),
            Blocks::Double(matrix) => self.add_outer_products(&angles, -sum.weights.position, matrix),
        }
        if let Some(product) = &mut sum.stiffness_times_velocity {
            self.subtract_products(&angles, state.v, product);
        }
        if sum.curvature == CurvaturePolicy::Exact {
            self.add_curved_part(&moments, state, sum);
        }
        self.tally(angles.flagged)
    }

    fn find_non_finite(&self, _: Quantity, state: State<'_>) -> Option<usize> {
        let angles = self.angles(state.x);
        let is_finite = |patch: &Patch| {
            let finite =
                |angle: &Angle| angles.gradients[angle.hinge].as_flattened().iter().all(|number| number.is_finite());
            patch.residual(&angles.values).iter().all(|number| number.is_finite()) && patch.angles.iter().all(finite)
        };
        self.active.iter().copied().find(|&patch| !is_finite(&self.patches[patch]))
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
        for patch in self.active.iter().map(|&patch| &self.patches[patch]) {
            rows.clear();
            patch.append_gradients(&angles.gradients, &mut rows);
            for k in 0..3 {
                let along = |(&i, row): (&usize, &Row<f64>)| (0..3).map(|axis| row[k][axis] * v[i][axis]).sum::<f64>();
                let rate: f64 = patch.vertices.iter().zip(&rows).map(along).sum();
                for (&i, row) in patch.vertices.iter().zip(&rows) {
                    (0..3).for_each(|axis| product[i][axis] -= rate * row[k][axis]);
                }
            }
        }
    }
}
