//! Friction of cloth with itself and with obstacles.
//!
//! A pair in contact has the potential μ λ (√(‖t‖² + ε²) − ε) ([`SlidingFriction`]) of the tangential displacement t
//! from where it sticks. The displacement is a bristle: it bends by up to a tenth of a millimetre, then the pair slips
//! and the bristle follows. A bristle at rest stays at rest, so a pair that sticks does not creep. With ε a tenth of
//! the length of a bristle, a pair that slips has 0.995 of the friction μ λ.
//!
//! A pair whose bristle is bent to its full length at the start of a step slips: it has the kinetic coefficient μ in
//! that step. All others have the static one.
//!
//! Closest points, normal and normal force λ are lagged: taken at the start of the step, so that friction has a
//! potential (Li et al. 2020, "Incremental potential contact", §5.5).
//!
//! On an obstacle, the closest point is a material point of its surface, which moves with it.

use energy_dsl::{Block, Packed, Vector3};
use energy_elements::SlidingFriction;
use energy_solve::threads::for_each;
use energy_solve::{Contact, ContactMemory, SlidingStiffness};

use super::PART;
use super::bristle::{Bristles, LENGTH, slips};
use super::law::Law;
use super::pair_friction::PairFriction;
use crate::Coulomb;
use crate::collision::{Closest, CollisionMesh, Pair};
use crate::geometry::{add_scaled, dot, norm, subtract};

/// The deflection ε of a bristle at which friction is μ/√2 times the normal force, in m.
const SOFTNESS: f64 = 0.1 * LENGTH;
/// The displacement below which the exact stiffness is that of the secant, in m.
const LEAST_SLIDING: f64 = 1e-3 * SOFTNESS;
/// Why an evaluation cannot fail.
const ONE_DISPLACEMENT: &str = "each pair has one displacement";

/// The friction of a step.
#[derive(Debug, Default)]
pub(super) struct Friction {
    /// The friction at each vertex of cloth and hair; empty without friction between them.
    pub coefficients: Vec<Coulomb>,
    /// The friction of chosen pairs of parts.
    pub chosen: PairFriction,
    /// The friction of each obstacle.
    pub obstacles: Vec<ObstacleFriction>,
    /// Positions at the start of the step.
    pub start: Vec<Vector3<f64>>,
    /// The deflections at the start.
    bristles: Bristles,
    /// The pairs in contact at the start; `None` before friction is lagged.
    lagged: Option<LaggedPairs>,
}

/// The friction of an obstacle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ObstacleFriction {
    /// The coefficients of friction.
    pub coefficients: Coulomb,
    /// The first of four vertices that move with the obstacle: an origin, and the ends of three orthogonal unit
    /// vectors from there. `None` if the obstacle is fixed or deforms.
    pub frame: Option<u32>,
    /// Whether the obstacle deforms. Its vertices are then material points.
    pub deforms: bool,
}

/// All pairs in contact at the start of the step, in order.
#[derive(Debug)]
struct LaggedPairs {
    pairs: Vec<LaggedPair>,
    /// The potentials, in parts. Element i of a part acts on the vector between the lagged points of its pair i.
    elements: Vec<Packed<SlidingFriction>>,
}

/// A pair in contact at the start of the step.
#[derive(Debug)]
struct LaggedPair {
    pair: Pair,
    /// The coefficients of the closest points at the start, without those of a rigid obstacle.
    weights: [f64; 4],
    /// The point of a moving obstacle that slides.
    anchor: Option<Anchor>,
    normal: Vector3<f64>,
    /// The vector between the lagged points while the bristle is straight, up to a multiple of the normal.
    straight: Vector3<f64>,
}

/// A material point of a moving obstacle.
#[derive(Clone, Copy, Debug)]
struct Anchor {
    /// The first vertex of the obstacle's frame.
    frame: u32,
    /// The coefficients of the frame's vertices in the displacement. Their sum is 1 or −1.
    weights: [f64; 4],
}

impl Friction {
    /// Begins a step at x, where the last step ended. After a step that failed, x is where that step began, and the
    /// bristles are as before.
    pub fn begin_step(&mut self, x: &[Vector3<f64>]) {
        self.bristles = self.bristles_at(x);
        self.lagged = None;
        if self.has_friction() {
            x.clone_into(&mut self.start);
        }
    }

    /// Returns the bristles at the end of a step.
    fn bristles_at(&self, x: &[Vector3<f64>]) -> Bristles {
        let Some(lagged) = &self.lagged else { return self.bristles.clone() };
        let tangential = |one: &LaggedPair| {
            let displacement = subtract(one.between(x), one.straight);
            (one.pair, one.normal, add_scaled(displacement, -dot(displacement, one.normal), one.normal))
        };
        Bristles::new(lagged.pairs.iter().map(tangential))
    }

    /// Returns the bristles at x, where the last step ended, for a checkpoint.
    pub fn memory(&self, x: &[Vector3<f64>]) -> ContactMemory {
        self.bristles_at(x).memory()
    }

    /// Restores the bristles of a checkpoint.
    pub fn restore(&mut self, memory: ContactMemory) {
        (self.bristles, self.lagged) = (Bristles::restored(memory), None);
    }

    /// Creates a model without friction for bodies and this number of obstacles.
    pub fn frictionless(obstacles: usize) -> Self {
        Self { obstacles: vec![ObstacleFriction::default(); obstacles], ..Self::default() }
    }

    /// Whether anything has friction.
    pub fn has_friction(&self) -> bool {
        !self.coefficients.is_empty()
            || self.chosen.has_friction()
            || self.obstacles.iter().any(|obstacle| !obstacle.coefficients.is_zero())
    }

    /// The coefficients of friction of a pair.
    fn coefficients(&self, mesh: &CollisionMesh, pair: &Pair) -> Coulomb {
        if let Some(chosen) = self.chosen.of(mesh, pair) {
            return chosen;
        }
        if let Some(obstacle) = mesh.obstacle_of(pair) {
            return self.obstacles[obstacle].coefficients;
        }
        let of = |vertex: u32| self.coefficients.get(vertex as usize).copied().unwrap_or_default();
        of(pair.vertices[0]).between(of(pair.vertices[pair.first()]))
    }

    /// Lags friction: takes the pairs in contact at the start, in order, with their laws and closest points.
    pub fn lag(&mut self, mesh: &CollisionMesh, in_contact: &[(Pair, Law, Closest)], threads: usize) {
        let of = |(pair, law, closest): &(Pair, Law, Closest)| {
            let (coefficients, force) = (self.coefficients(mesh, pair), law.force(law.apart(closest)));
            if coefficients.is_zero() || force <= 0.0 {
                return None;
            }
            let (weights, anchor) = self.lagged_point(mesh, pair, closest);
            let normal = closest.normal;
            let between = displacement(pair, &weights, anchor, &self.start);
            let is_on_obstacle = mesh.obstacle_of(pair).is_some();
            let deflection = self.bristles.deflection(pair, normal, is_on_obstacle);
            let straight = subtract(between, deflection);
            let limit = force * if slips(deflection) { coefficients.sliding } else { coefficients.at_rest };
            let element = SlidingFriction::new(normal, straight, limit, SOFTNESS);
            Some((LaggedPair { pair: *pair, weights, anchor, normal, straight }, element))
        };
        let part = |part: &[(Pair, Law, Closest)]| part.iter().filter_map(of).collect::<Vec<_>>();
        let parts = for_each(threads, in_contact.chunks(PART).collect(), part);
        let (pairs, elements): (Vec<_>, Vec<_>) = parts.into_iter().flatten().unzip();
        let stencils: Vec<[u32; 1]> = (0..).map(|number| [number]).take(PART).collect();
        let packed = |part: &[SlidingFriction]| Packed::new(part, &stencils[..part.len()]);
        self.lagged = Some(LaggedPairs { pairs, elements: elements.chunks(PART).map(packed).collect() });
    }

    /// Returns the coefficients of the closest points on cloth and hair, and the closest point of an obstacle.
    fn lagged_point(&self, mesh: &CollisionMesh, pair: &Pair, closest: &Closest) -> ([f64; 4], Option<Anchor>) {
        let Some(obstacle) = mesh.obstacle_of(pair).filter(|obstacle| !self.obstacles[*obstacle].deforms) else {
            return (closest.weights, None);
        };
        let is_own = pair.vertices.map(|vertex| mesh.obstacle(vertex).is_none());
        let weights = std::array::from_fn(|corner| if is_own[corner] { closest.weights[corner] } else { 0.0 });
        let anchor = self.obstacles[obstacle].frame.map(|frame| {
            let at = pair.corners(&self.start);
            let own = (0..4).fold([0.0; 3], |sum, corner| add_scaled(sum, weights[corner], at[corner]));
            // With the cloth first, its closest point is the sum; otherwise minus the sum.
            let sign = if is_own[0] { 1.0 } else { -1.0 };
            let point = own.map(|component| sign * component);
            let [origin, ends @ ..] = [0, 1, 2, 3].map(|corner| self.start[(frame + corner) as usize]);
            let along = ends.map(|end| dot(subtract(point, origin), subtract(end, origin)));
            let rest = 1.0 - along.iter().sum::<f64>();
            Anchor { frame, weights: [rest, along[0], along[1], along[2]].map(|weight| -sign * weight) }
        });
        (weights, anchor)
    }

    /// Returns Σ μ λ (√(‖t‖² + ε²) − ε), in J.
    pub fn energy(&self, x: &[Vector3<f64>], threads: usize) -> f64 {
        let sum = |part: Part<'_>| part.energies(x).iter().sum::<f64>();
        for_each(threads, self.parts().collect(), sum).iter().sum()
    }

    /// Adds the forces of friction, in N.
    pub fn add_force(&self, x: &[Vector3<f64>], threads: usize, force: &mut [Vector3<f64>]) {
        let gradients = for_each(threads, self.parts().collect(), |part| part.gradients(x));
        for (one, gradient) in self.pairs().iter().zip(gradients.iter().flatten()) {
            let drag = gradient.map(|component| -component);
            one.pair.add(one.weights, drag, force);
            for (vertex, weight) in one.anchor.iter().flat_map(Anchor::terms) {
                force[vertex] = add_scaled(force[vertex], weight, drag);
            }
        }
    }

    /// Returns the stiffness of friction.
    pub fn stiffness(&self, x: &[Vector3<f64>], sliding: SlidingStiffness, threads: usize) -> FrictionStiffness<'_> {
        let blocks = for_each(threads, self.parts().collect(), |part| match sliding {
            SlidingStiffness::Exact => part.blocks(x),
            SlidingStiffness::Secant => part.secant_blocks(x),
        });
        FrictionStiffness { pairs: self.pairs(), blocks: blocks.concat() }
    }

    fn pairs(&self) -> &[LaggedPair] {
        self.lagged.as_ref().map_or(&[], |lagged| &lagged.pairs)
    }

    /// The pairs in parts, each with its potentials.
    fn parts(&self) -> impl Iterator<Item = Part<'_>> {
        let elements = self.lagged.iter().flat_map(|lagged| &lagged.elements);
        self.pairs().chunks(PART).zip(elements).map(|(pairs, elements)| Part { pairs, elements })
    }
}

/// The stiffness of friction at one state.
pub(super) struct FrictionStiffness<'a> {
    pairs: &'a [LaggedPair],
    /// The Hessian of each pair's energy, in N/m.
    blocks: Vec<Block<f64>>,
}

impl FrictionStiffness<'_> {
    /// The pairs from one pair up to another, in order, each as a contact without rows. `None` stands for no bound.
    pub fn between(&self, first: Option<&Pair>, end: Option<&Pair>) -> impl Iterator<Item = (&Pair, Contact)> {
        let position = |pair: &Pair| self.pairs.partition_point(|one| one.pair < *pair);
        let range = first.map_or(0, position)..end.map_or(self.pairs.len(), position);
        let pairs = self.pairs[range.clone()].iter().zip(&self.blocks[range]);
        pairs.map(|(one, &block)| (&one.pair, Contact { rows: [Contact::FIXED; 4], weights: one.weights, block }))
    }
}

/// Some pairs in contact at the start of the step, with their potentials.
struct Part<'a> {
    pairs: &'a [LaggedPair],
    elements: &'a Packed<SlidingFriction>,
}

impl Part<'_> {
    /// The vector between the lagged points of each pair.
    fn displacements(&self, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        self.pairs.iter().map(|one| one.between(x)).collect()
    }

    /// The energy of each pair, in J.
    fn energies(&self, x: &[Vector3<f64>]) -> Vec<f64> {
        let displacements = self.displacements(x);
        let mut energies = vec![0.0; displacements.len()];
        self.elements.values(0..displacements.len(), &displacements, &mut energies).expect(ONE_DISPLACEMENT);
        energies
    }

    /// The gradient of each pair's energy, in N.
    fn gradients(&self, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let displacements = self.displacements(x);
        let (mut energies, mut gradients) = (vec![0.0; displacements.len()], vec![[0.0; 3]; displacements.len()]);
        self.elements
            .gradients(0..displacements.len(), &displacements, &mut energies, gradients.as_flattened_mut())
            .expect(ONE_DISPLACEMENT);
        gradients
    }

    /// The Hessian of each pair's energy, in N/m.
    fn blocks(&self, x: &[Vector3<f64>]) -> Vec<Block<f64>> {
        let displacements = self.displacements(x);
        let (mut energies, mut gradients) = (vec![0.0; displacements.len()], vec![0.0; 3 * displacements.len()]);
        let mut blocks = vec![[[0.0; 3]; 3]; displacements.len()];
        let numbers = blocks.as_flattened_mut().as_flattened_mut();
        self.elements
            .hessians(0..displacements.len(), &displacements, &mut energies, &mut gradients, numbers)
            .expect(ONE_DISPLACEMENT);
        blocks
    }

    /// The secant stiffness of each pair: ‖∂U/∂t‖/‖t‖ across the normal.
    fn secant_blocks(&self, x: &[Vector3<f64>]) -> Vec<Block<f64>> {
        let mut blocks = self.blocks(x);
        for ((one, gradient), block) in self.pairs.iter().zip(self.gradients(x)).zip(&mut blocks) {
            let displacement = subtract(one.between(x), one.straight);
            let sliding = norm(add_scaled(displacement, -dot(displacement, one.normal), one.normal));
            // A bristle that is nearly straight has the same stiffness in all directions.
            if sliding > LEAST_SLIDING {
                let (n, stiffness) = (one.normal, norm(gradient) / sliding);
                let entry = |i: usize, j: usize| stiffness * (f64::from(u8::from(i == j)) - n[i] * n[j]);
                *block = [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)));
            }
        }
        blocks
    }
}

impl LaggedPair {
    /// The vector between the points that were closest at the start.
    fn between(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        displacement(&self.pair, &self.weights, self.anchor, x)
    }
}

impl Anchor {
    /// Iterates over the vertices of the frame, with their coefficients.
    fn terms(&self) -> impl Iterator<Item = (usize, f64)> {
        (self.frame as usize..).zip(self.weights)
    }
}

/// The displacement between the lagged points, up to a constant: Σ cᵢ xᵢ. Differences to one corner lose fewer digits.
fn displacement(pair: &Pair, weights: &[f64; 4], anchor: Option<Anchor>, x: &[Vector3<f64>]) -> Vector3<f64> {
    let corners = pair.corners(x);
    // On a fixed obstacle the coefficients do not add up to 0.
    let is_balanced = weights.iter().sum::<f64>().abs() < 0.5;
    let origin = match anchor {
        Some(anchor) => x[anchor.frame as usize],
        None if is_balanced => corners[0],
        None => [0.0; 3],
    };
    let mut sum = [0.0; 3];
    for corner in 0..4 {
        sum = add_scaled(sum, weights[corner], subtract(corners[corner], origin));
    }
    if let Some(anchor) = anchor {
        for (vertex, weight) in anchor.terms() {
            sum = add_scaled(sum, weight, subtract(x[vertex], origin));
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collision::{Core, PairKind};
    use crate::geometry::Pose;

    const UP: Vector3<f64> = [0.0, 0.0, 1.0];
    /// A triangle of cloth, a triangle of an obstacle below it, and the obstacle's frame.
    const POSITIONS: [Vector3<f64>; 10] = [
        [0.2, 0.1, 0.01],
        [1.2, 0.1, 0.01],
        [0.2, 1.1, 0.02],
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [3.0, 2.0, 1.0],
        [4.0, 2.0, 1.0],
        [3.0, 3.0, 1.0],
        [3.0, 2.0, 2.0],
    ];

    fn pair(vertices: [u32; 4]) -> Pair {
        Pair { kind: PairKind::PointTriangle, features: [0, 0], vertices }
    }

    #[test]
    fn a_displacement_along_the_normal_bends_no_bristle() {
        let (weights, straight) = ([1.0, -0.5, -0.3, -0.2], [0.0; 3]);
        let pair = pair([0, 3, 4, 5]);
        let one = LaggedPair { pair, weights, anchor: None, normal: UP, straight };
        let friction =
            Friction { lagged: Some(LaggedPairs { pairs: vec![one], elements: Vec::new() }), ..Friction::default() };
        // Ten lengths of a bristle along the normal, and less than one across.
        let mut x = [[0.0; 3]; 6];
        x[0] = [3e-5, -4e-5, 10.0 * LENGTH];
        let deflection = friction.bristles_at(&x).deflection(&pair, UP, false);
        let error = norm(subtract(deflection, [3e-5, -4e-5, 0.0]));
        assert!(error < 1e-12 * LENGTH, "{deflection:?}");
    }

    #[test]
    fn the_secant_leads_from_rest_to_the_force() {
        let (weights, straight) = ([1.0, -0.5, -0.3, -0.2], [0.0; 3]);
        let one = LaggedPair { pair: pair([0, 3, 4, 5]), weights, anchor: None, normal: UP, straight };
        let elements = vec![Packed::new(&[SlidingFriction::new(UP, straight, 2.0, SOFTNESS)], &[[0_u32]])];
        let friction = Friction { lagged: Some(LaggedPairs { pairs: vec![one], elements }), ..Friction::default() };
        for sliding in [1e-9, 1e-6, 1e-5, 3e-4] {
            let (mut x, mut force) = ([[0.0; 3]; 6], [[0.0; 3]; 6]);
            let along = [0.6, -0.8, 0.0];
            x[0] = add_scaled([0.0, 0.0, 1e-3], sliding, along);
            friction.add_force(&x, 1, &mut force);
            let stiffness = |sliding| friction.stiffness(&x, sliding, 1).blocks[0];
            let [exact, secant] = [SlidingStiffness::Exact, SlidingStiffness::Secant].map(stiffness);
            let times = |block: Block<f64>, vector: Vector3<f64>| block.map(|row| dot(row, vector));
            let pull = times(secant, add_scaled([0.0; 3], sliding, along));
            assert!(
                (0..3).all(|axis| (pull[axis] + force[0][axis]).abs() < 1e-6 * norm(force[0])),
                "{pull:?} {force:?}"
            );
            // Both are the same across the slide, and the secant is stiffer along it.
            let across = [0.8, 0.6, 0.0];
            let [softer, stiffer] = [exact, secant].map(|block| dot(along, times(block, along)));
            let sides = [exact, secant].map(|block| dot(across, times(block, across)));
            assert!((sides[0] / sides[1] - 1.0).abs() < 1e-5 && norm(times(secant, UP)) < 1e-9 * stiffer);
            assert!(softer <= (1.0 + 1e-5) * stiffer && (sliding < 1e-5 || softer < 0.6 * stiffer));
        }
    }

    /// Returns a pair on an obstacle that moves, and the closest points on cloth and obstacle.
    fn on_obstacle(cloth_is_first: bool) -> (LaggedPair, [Vector3<f64>; 2]) {
        let core = Core { vertices: POSITIONS[3..6].to_vec(), triangles: vec![[0, 1, 2]], ..Core::default() };
        let mesh = CollisionMesh::new(3, &[[0, 1, 2]], &[], &[]).with_obstacles(&[core]);
        let obstacles = vec![ObstacleFriction { coefficients: Coulomb::uniform(0.5), frame: Some(6), deforms: false }];
        let friction = Friction { obstacles, start: POSITIONS.to_vec(), ..Friction::default() };
        let pair = pair(if cloth_is_first { [0, 3, 4, 5] } else { [4, 0, 1, 2] });
        let closest = Closest::of(&pair, &pair.corners(&POSITIONS));
        let (weights, anchor) = friction.lagged_point(&mesh, &pair, &closest);
        let own = |corner: usize| if pair.vertices[corner] < 3 { closest.weights[corner].abs() } else { 0.0 };
        let at = pair.corners(&POSITIONS);
        let point = (0..4).fold([0.0; 3], |sum, corner| add_scaled(sum, own(corner), at[corner]));
        let lagged = LaggedPair { pair, weights, anchor, normal: closest.normal, straight: [0.0; 3] };
        (lagged, [point, point])
    }

    #[test]
    fn the_point_of_a_moving_obstacle_moves_with_its_frame() {
        let turn = Pose::rotation([0.2, -0.5, 1.0], 30.0, [0.3, 0.1, -0.4]).translated([0.01, -0.02, 0.03]);
        for cloth_is_first in [true, false] {
            let (one, [cloth, anchored]) = on_obstacle(cloth_is_first);
            let start = one.between(&POSITIONS);
            assert!(start.iter().all(|component| component.abs() < 1e-14), "{start:?}");
            for (moves_cloth, moves_frame) in [(true, true), (true, false), (false, true)] {
                let moves = |vertex: usize| if vertex < 3 { moves_cloth } else { moves_frame };
                let x: Vec<Vector3<f64>> = (0..POSITIONS.len())
                    .map(|vertex| if moves(vertex) { turn.transform(POSITIONS[vertex]) } else { POSITIONS[vertex] })
                    .collect();
                let moved = |point: Vector3<f64>, moves: bool| if moves { turn.transform(point) } else { point };
                let away = subtract(moved(cloth, moves_cloth), moved(anchored, moves_frame));
                let sign = if cloth_is_first { 1.0 } else { -1.0 };
                for (found, away) in one.between(&x).into_iter().zip(away) {
                    assert!((found - sign * away).abs() < 1e-13, "{cloth_is_first}, {moves_cloth}, {moves_frame}");
                }
                // The forces on cloth and frame are opposite.
                assert!((one.weights.iter().sum::<f64>() - sign).abs() < 1e-14);
                let carried: f64 = one.anchor.unwrap().weights.iter().sum();
                assert!((carried + sign).abs() < 1e-13, "{carried}");
            }
        }
    }
}
