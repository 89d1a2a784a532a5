use energy_dsl::{Block, Declaration, Element, Potential, Vector3};
use energy_solve::{
    Character, Curvature, DofMap, Linearisation, Pattern, PlacedTerm, Quantity, State, Stencils, StepStart, Tally,
    Term, TermDescription, index,
};

use super::solid::Solid;
use crate::geometry::{Pose, dot, norm};
use crate::motion::Motion;

/// Contact of all vertices with one solid. Evaluates only vertices within the thickness and counts the others as
/// skipped. Each contact changes only the diagonal block of its vertex, so the matrix pattern never changes.
#[derive(Debug)]
pub(super) struct ContactTerm<S> {
    name: String,
    /// The solid before its motion, and at the end of the current step.
    solid: S,
    now: S,
    motion: Option<Motion>,
    thickness: f64,
    /// Contact stiffness of each vertex, in N/m.
    stiffness: Vec<f64>,
    stencils: Vec<u32>,
    /// The free vertices, with the slots of their diagonal blocks.
    free: Vec<(usize, usize)>,
}

impl<S: Solid> ContactTerm<S> {
    pub(super) fn new(
        name: String,
        solid: S,
        motion: Option<Motion>,
        thickness: f64,
        stiffness: Vec<f64>,
        time: f64,
    ) -> Self {
        let stencils = (0..index(stiffness.len())).collect();
        let now = solid.clone();
        let mut term = Self { name, solid, now, motion, thickness, stiffness, stencils, free: Vec::new() };
        term.move_to(time);
        term
    }

    fn move_to(&mut self, time: f64) {
        if let Some(motion) = &self.motion {
            self.now = self.solid.moved(&motion.pose(time));
        }
    }

    /// Iterates over the free vertices within the thickness, with their slots and elements.
    fn near<'a>(&'a self, x: &'a [Vector3<f64>]) -> impl Iterator<Item = (usize, usize, S::Contact)> + 'a {
        self.free.iter().filter_map(|&(vertex, slot)| {
            let element = self.now.touched(vertex, x[vertex], self.stiffness[vertex], self.thickness)?;
            Some((vertex, slot, element))
        })
    }

    fn tally(&self, evaluated: u64, flagged: u64) -> Tally {
        Tally { evaluated, skipped: self.stencils.len() as u64 - evaluated, flagged, projected: 0 }
    }
}

impl<S: Solid> TermDescription for ContactTerm<S> {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &Declaration {
        <S::Contact as Element>::DECLARATION
    }

    fn character(&self) -> Character {
        Character { symmetric: true, velocity_dependent: false, quadratic: false, curved: true }
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(1, &self.stencils)
    }
}

impl<S: Solid + 'static> Term for ContactTerm<S> {
    fn place(mut self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        self.free = dofs.free().iter().enumerate().map(|(row, &vertex)| (vertex, pattern.diagonal(row))).collect();
        self
    }
}

impl<S: Solid> PlacedTerm for ContactTerm<S> {
    /// Moves the solid to its pose at the end of the step.
    fn begin_step(&mut self, start: StepStart<'_>) {
        self.move_to(start.time + start.dt);
    }

    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        let (mut sum, mut evaluated, mut flagged) = (0.0, 0, 0);
        for (vertex, _, element) in self.near(x) {
            let result = element.value(&[x[vertex]]);
            sum += result.value;
            evaluated += 1;
            flagged += u64::from(result.flags.any());
        }
        Some((sum, self.tally(evaluated, flagged)))
    }

    fn add_force(&self, State { x, .. }: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        let (mut evaluated, mut flagged) = (0, 0);
        for (vertex, _, element) in self.near(x) {
            let result = element.gradient(&[x[vertex]]);
            (0..3).for_each(|axis| force[vertex][axis] -= result.gradient[0][axis]);
            evaluated += 1;
            flagged += u64::from(result.flags.any());
        }
        self.tally(evaluated, flagged)
    }

    fn add_linearisation(&self, State { x, v }: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let (mut evaluated, mut flagged, mut projected) = (0, 0, 0);
        for (vertex, slot, element) in self.near(x) {
            let result = element.hessian(&[x[vertex]]);
            let (gradient, mut hessian) = (result.gradient[0], result.hessian.as_ref()[0]);
            if sum.curvature != Curvature::Exact {
                hessian = along(gradient, &hessian);
                projected += 1;
            }
            sum.matrix.add(slot, -sum.weights.position, &hessian);
            for i in 0..3 {
                sum.force[vertex][i] -= gradient[i];
                if let Some(product) = &mut sum.stiffness_times_velocity {
                    product[vertex][i] -= dot(hessian[i], v[vertex]);
                }
            }
            evaluated += 1;
            flagged += u64::from(result.flags.any());
        }
        Tally { projected, ..self.tally(evaluated, flagged) }
    }

    fn find_non_finite(&self, quantity: Quantity, State { x, .. }: State<'_>) -> Option<usize> {
        let is_finite = |(vertex, _, element): &(usize, usize, S::Contact)| {
            let result = element.gradient(&[x[*vertex]]);
            match quantity {
                Quantity::Energy => result.value.is_finite(),
                Quantity::Force => result.gradient.as_flattened().iter().all(|number| number.is_finite()),
            }
        };
        self.near(x).find(|near| !is_finite(near)).map(|(vertex, ..)| vertex)
    }
}

/// Returns the nearest positive semi-definite matrix: the part of the Hessian along the gradient. The penalty decreases
/// with distance and no feature of a solid curves towards the point, so the curvature across the gradient is never
/// positive.
fn along(gradient: Vector3<f64>, hessian: &Block<f64>) -> Block<f64> {
    let size = norm(gradient);
    if size == 0.0 {
        return [[0.0; 3]; 3];
    }
    let n = gradient.map(|component| component / size);
    let curvature = dot(n, hessian.map(|row| dot(row, n))).max(0.0);
    std::array::from_fn(|i| std::array::from_fn(|j| curvature * n[i] * n[j]))
}

/// A contact, as friction needs it.
pub(super) struct Touch {
    /// Index of the vertex.
    pub vertex: usize,
    /// Unit normal, pointing out of the solid.
    pub normal: Vector3<f64>,
    /// Normal force, in N.
    pub force: f64,
}

/// Returns the contacts of the given vertices with a solid.
pub(super) fn touches<S: Solid>(
    solid: &S,
    thickness: f64,
    stiffness: impl Fn(usize) -> f64,
    x: &[Vector3<f64>],
    vertices: impl IntoIterator<Item = usize>,
) -> Vec<Touch> {
    let touch = |vertex: usize| {
        let element = solid.touched(vertex, x[vertex], stiffness(vertex), thickness)?;
        let gradient = element.gradient(&[x[vertex]]).gradient[0];
        let force = norm(gradient);
        (force > 0.0).then(|| Touch { vertex, normal: gradient.map(|component| -component / force), force })
    };
    vertices.into_iter().filter_map(touch).collect()
}

/// Returns the mean velocity, over a step, of the material point of a solid that is at x at the start (or end) of the
/// step, in m/s.
pub(super) fn surface_velocity(motion: Option<&Motion>, step: [f64; 2], x: Vector3<f64>, at_end: bool) -> Vector3<f64> {
    let [from, to] = step;
    let Some(motion) = motion.filter(|motion| motion.moves(from, to)) else {
        return [0.0; 3];
    };
    let [before, after]: [Pose; 2] = step.map(|time| motion.pose(time));
    let [start, end] = if at_end {
        [before.transform(after.inverse_transform(x)), x]
    } else {
        [x, after.transform(before.inverse_transform(x))]
    };
    std::array::from_fn(|axis| (end[axis] - start[axis]) / (to - from))
}
