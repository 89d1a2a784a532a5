//! Curled hair: strands with a natural curvature and torsion, whose material directors are in equilibrium after each
//! step.
//!
//! The twist of a hair has no inertia here. Directors keep their place in the material during a step. At its end, each
//! strand turns them about its edges to where its energy is least: a tridiagonal problem in the angles of the edges. As
//! the energy only falls, steps remain stable.

use energy_dsl::{Stateful, Vector3};
use energy_elements::CurledHair;
use energy_solve::{DrivenLaw, Stencils};

use crate::geometry::{add_scaled, cross, dot, norm};

/// The numbers of a hair's elements.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curled {
    /// Bending moment over curvature, in N m².
    pub bend: f64,
    /// Twisting moment over twist per length, in N m².
    pub twist: f64,
    /// Length of a segment, in m.
    pub length: f64,
    /// Natural curvature, in 1/m.
    pub curvature: f64,
    /// Natural torsion, in 1/m.
    pub torsion: f64,
}

/// An edge with its tangent and its director, both unit vectors.
#[derive(Clone, Copy, Debug)]
struct Edge {
    tangent: Vector3<f64>,
    director: Vector3<f64>,
}

/// The bending and twist of strands of one length.
#[derive(Debug)]
pub(super) struct CurledStrands {
    hair: Curled,
    /// One for each inner joint, strand by strand.
    elements: Vec<CurledHair>,
    /// Inner joints of a strand.
    joints: usize,
    /// Whether the first edge of a strand keeps its director.
    rooted: bool,
}

impl CurledStrands {
    /// Creates straight strands along a unit vector, with the natural torsion about it; the first director is `axis`.
    pub(super) fn new(
        hair: Curled,
        strands: usize,
        joints: usize,
        [tangent, axis]: [Vector3<f64>; 2],
        rooted: bool,
    ) -> Self {
        let side = cross(tangent, axis);
        let edge = |number: usize| {
            let (sine, cosine) = (number as f64 * hair.length * hair.torsion).sin_cos();
            Edge { tangent, director: turned(axis, side, sine, cosine) }
        };
        let one = (0..joints).map(|joint| hair.element([edge(joint), edge(joint + 1)])).collect::<Vec<_>>();
        Self { hair, elements: one.repeat(strands), joints, rooted }
    }
}

impl Curled {
    fn element(&self, [first, second]: [Edge; 2]) -> CurledHair {
        let Self { bend, twist, length, curvature, torsion } = *self;
        let (t0, t1, d0, d1) = (first.tangent, second.tangent, first.director, second.director);
        CurledHair::new(bend, twist, length, curvature, torsion, t0, t1, d0, d1)
    }
}

impl DrivenLaw for CurledStrands {
    type Element = CurledHair;

    fn element(&self, stencil: usize, _: f64) -> CurledHair {
        self.elements[stencil]
    }

    fn advance(&mut self, stencils: Stencils<'_>, x: &[Vector3<f64>]) -> bool {
        let mut changes = false;
        for (strand, elements) in self.elements.chunks_exact_mut(self.joints).enumerate() {
            let mut edges = Vec::with_capacity(self.joints + 1);
            for (joint, element) in elements.iter().enumerate() {
                let u = |place: usize| x[stencils.vertex(strand * self.joints + joint, place / 3) as usize][place % 3];
                let [first, second] = edges_of(&element.next(&std::array::from_fn(u)).state);
                if edges.is_empty() {
                    edges.push(first);
                }
                edges.push(second);
            }
            Strand::new(&self.hair, &edges, self.rooted).relax(&mut edges);
            for (element, pair) in elements.iter_mut().zip(edges.windows(2)) {
                let next = self.hair.element([pair[0], pair[1]]);
                if next.state() != element.state() {
                    *element = next;
                    changes = true;
                }
            }
        }
        changes
    }

    fn history(&self) -> Vec<f64> {
        self.elements.iter().flat_map(Stateful::state).collect()
    }

    fn restore(&mut self, history: &[f64]) {
        let (states, _) = history.as_chunks::<12>();
        for (element, state) in self.elements.iter_mut().zip(states) {
            element.set_state(state);
        }
    }
}

/// Returns the edges of a state: t0, t1, d0, d1.
fn edges_of(state: &[f64; 12]) -> [Edge; 2] {
    let vector = |place: usize| std::array::from_fn(|axis| state[3 * place + axis]);
    [0, 1].map(|edge| Edge { tangent: vector(edge), director: vector(edge + 2) })
}

/// cos u + sin v.
fn turned(u: Vector3<f64>, v: Vector3<f64>, sine: f64, cosine: f64) -> Vector3<f64> {
    std::array::from_fn(|axis| cosine * u[axis] + sine * v[axis])
}

/// The energy of a strand as a function of the angles α by which its directors turn:
/// Σ_edges −(P cos α + Q sin α) + Σ_joints C/2l (φ + α₁ − α₀)².
struct Strand {
    /// P and Q of each edge, in J.
    curl: Vec<[f64; 2]>,
    /// φ − l τ of each joint.
    twist: Vec<f64>,
    /// C/l, in J.
    stiffness: f64,
    rooted: bool,
}

impl Strand {
    /// Iterations at most. A strand that moves a little needs two.
    const ITERATIONS: usize = 20;
    /// Steps below this, in rad, are taken without a check of the energy.
    const SMALL: f64 = 1e-6;

    fn new(hair: &Curled, edges: &[Edge], rooted: bool) -> Self {
        let mut curl = vec![[0.0; 2]; edges.len()];
        let mut twist = Vec::with_capacity(edges.len() - 1);
        for (joint, pair) in edges.windows(2).enumerate() {
            let [a, b] = [pair[0].tangent, pair[1].tangent];
            let binormal = cross(a, b).map(|component| 2.0 / (1.0 + dot(a, b)) * component);
            for (edge, place) in [(&pair[0], joint), (&pair[1], joint + 1)] {
                let side = cross(edge.tangent, edge.director);
                for (sum, direction) in curl[place].iter_mut().zip([edge.director, side]) {
                    *sum += 0.5 * hair.bend * hair.curvature * dot(binormal, direction);
                }
            }
            // The first director without twist on the second edge.
            let along = dot(b, pair[0].director) / (1.0 + dot(a, b));
            let moved = add_scaled(add_scaled(pair[0].director, -along, a), -along, b);
            let angle = dot(cross(moved, pair[1].director), b).atan2(dot(moved, pair[1].director));
            twist.push(angle - hair.length * hair.torsion);
        }
        Self { curl, twist, stiffness: hair.twist / hair.length, rooted }
    }

    fn energy(&self, angles: &[f64]) -> f64 {
        let curl = self.curl.iter().zip(angles).map(|([p, q], angle)| -(p * angle.cos() + q * angle.sin()));
        let twist = self.twist.iter().zip(angles.windows(2)).map(|(twist, pair)| twist + pair[1] - pair[0]);
        curl.sum::<f64>() + 0.5 * self.stiffness * twist.map(|twist| twist * twist).sum::<f64>()
    }

    /// Returns Newton's step; if the energy is not convex there, that with second derivatives of the curl of 0 at least.
    fn step(&self, angles: &[f64]) -> Vec<f64> {
        let least = 1e-9 * self.stiffness;
        self.solve(angles, f64::NEG_INFINITY).or_else(|| self.solve(angles, least)).unwrap_or_default()
    }

    /// Solves for Newton's step, with second derivatives of the curl of at least `least`. `None` if the matrix is not
    /// positive definite: a free strand without curl may turn as a whole.
    fn solve(&self, angles: &[f64], least: f64) -> Option<Vec<f64>> {
        let count = angles.len();
        let (mut gradient, mut diagonal) = (vec![0.0; count], vec![0.0; count]);
        for (edge, ([p, q], angle)) in self.curl.iter().zip(angles).enumerate() {
            let (sine, cosine) = angle.sin_cos();
            gradient[edge] += p * sine - q * cosine;
            diagonal[edge] += (p * cosine + q * sine).max(least);
        }
        for (joint, twist) in self.twist.iter().enumerate() {
            let moment = self.stiffness * (twist + angles[joint + 1] - angles[joint]);
            gradient[joint] -= moment;
            gradient[joint + 1] += moment;
            diagonal[joint] += self.stiffness;
            diagonal[joint + 1] += self.stiffness;
        }
        if self.rooted {
            // The row of a fixed angle.
            (gradient[0], diagonal[0]) = (0.0, f64::INFINITY);
        }
        let is_pivot = |number: f64| number > 1e-10 * self.stiffness;
        // Elimination from the tip to the root; all other entries are −C/l.
        for edge in (1..count).rev() {
            if !is_pivot(diagonal[edge]) {
                return None;
            }
            let factor = self.stiffness / diagonal[edge];
            diagonal[edge - 1] -= factor * self.stiffness;
            gradient[edge - 1] += factor * gradient[edge];
        }
        if !is_pivot(diagonal[0]) {
            return None;
        }
        let mut step = vec![0.0; count];
        for edge in 0..count {
            let before = if edge == 0 { 0.0 } else { self.stiffness * step[edge - 1] };
            step[edge] = (before - gradient[edge]) / diagonal[edge];
        }
        Some(step)
    }

    /// Turns the directors of a strand's edges to where its energy is least. Steps that raise it are halved.
    fn relax(&self, edges: &mut [Edge]) {
        if self.stiffness == 0.0 {
            return;
        }
        let mut angles = vec![0.0; edges.len()];
        let mut energy = self.energy(&angles);
        for _ in 0..Self::ITERATIONS {
            let mut step = self.step(&angles);
            let largest = step.iter().fold(0.0, |most: f64, angle| most.max(angle.abs()));
            if largest < 1e-12 {
                break;
            }
            let found = (0..30).find_map(|_| {
                let next: Vec<f64> = angles.iter().zip(&step).map(|(angle, step)| angle + step).collect();
                let reached = self.energy(&next);
                step.iter_mut().for_each(|angle| *angle *= 0.5);
                // Rounding hides what small steps gain.
                (reached < energy || largest < Self::SMALL).then_some((next, reached))
            });
            // No step lowers the energy: it is NaN.
            let Some(found) = found else { break };
            (angles, energy) = found;
        }
        for (edge, angle) in edges.iter_mut().zip(angles) {
            let (sine, cosine) = angle.sin_cos();
            let director = turned(edge.director, cross(edge.tangent, edge.director), sine, cosine);
            edge.director = director.map(|component| component / norm(director));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HAIR: Curled = Curled { bend: 2e-6, twist: 1.4e-6, length: 0.01, curvature: 30.0, torsion: 12.0 };

    /// A zigzag with directors across the edges.
    fn edges() -> Vec<Edge> {
        (0..20)
            .map(|i| {
                let raw = [0.3 * f64::from(i % 3), 0.2 * f64::from(i % 5) - 0.4, 1.0];
                let tangent: Vector3<f64> = raw.map(|component| component / norm(raw));
                let side = cross(tangent, [1.0, 0.1 * f64::from(i), 0.0]);
                Edge { tangent, director: side.map(|component| component / norm(side)) }
            })
            .collect()
    }

    /// The angles' energy differs from that of the elements by a constant.
    #[test]
    fn the_energy_of_angles_is_that_of_the_elements() {
        let edges = edges();
        let strand = Strand::new(&HAIR, &edges, false);
        let points: Vec<Vector3<f64>> = edges.iter().fold(vec![[0.0; 3]], |mut points, edge| {
            points.push(add_scaled(points[points.len() - 1], HAIR.length, edge.tangent));
            points
        });
        let total = |angles: &[f64]| -> f64 {
            let turned: Vec<Edge> = edges
                .iter()
                .zip(angles)
                .map(|(edge, angle)| {
                    let (sine, cosine) = angle.sin_cos();
                    let director = turned(edge.director, cross(edge.tangent, edge.director), sine, cosine);
                    Edge { director, ..*edge }
                })
                .collect();
            let value = |joint: usize| {
                let element = HAIR.element([turned[joint], turned[joint + 1]]);
                energy_dsl::Potential::value(&element, &[points[joint], points[joint + 1], points[joint + 2]]).value
            };
            (0..edges.len() - 1).map(value).sum()
        };
        let none = vec![0.0; edges.len()];
        let some: Vec<f64> = (0..edges.len()).map(|i| 0.1 * (i as f64).sin()).collect();
        let (found, wanted) = (strand.energy(&some) - strand.energy(&none), total(&some) - total(&none));
        assert!((found - wanted).abs() < 1e-12 * total(&none), "{found} {wanted}");
    }

    #[test]
    fn directors_relax_to_equilibrium_and_the_root_stays() {
        for rooted in [false, true] {
            let mut relaxed = edges();
            Strand::new(&HAIR, &relaxed.clone(), rooted).relax(&mut relaxed);
            let strand = Strand::new(&HAIR, &relaxed, rooted);
            let none = vec![0.0; relaxed.len()];
            assert!(strand.energy(&none) < Strand::new(&HAIR, &edges(), rooted).energy(&none));
            assert!(strand.step(&none).iter().all(|angle| angle.abs() < 1e-9));
            let moved = norm(cross(relaxed[0].director, edges()[0].director));
            assert_eq!(rooted, moved < 1e-15);
        }
    }
}
