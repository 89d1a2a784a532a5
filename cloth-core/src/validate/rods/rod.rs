//! A discrete elastic rod: points and angles of twist by turns, and loads that rise step by step.

use energy_dsl::energy;
use energy_elements::{Gravity, HookeSpring, RodBend, RodBendAnisotropic, RodTwist};
use energy_solve::{
    BandFactor, BandOrder, BorderedMatrix, Curvature, Extremum, KindSolver, MixedBody, MixedNewton, MixedNewtonOptions,
    MixedNewtonReport, MixedSystem, MixedTerm, UnknownKind,
};

use super::ValidateError;
use crate::geometry::{cross, norm, subtract};

pub(super) type Vector = energy_dsl::Vector3<f64>;

/// A rod: points along its centre line, and the moduli of its cross section.
#[derive(Clone, Debug)]
pub(super) struct Rod {
    pub(super) points: Vec<Vector>,
    /// Unit vectors perpendicular to the edges, from which angles of twist count.
    pub(super) directors: Vec<Vector>,
    /// Bending stiffness about the director, and about the axis perpendicular to it, in N m².
    pub(super) bending: [f64; 2],
    /// Twisting stiffness, in N m².
    pub(super) twisting: f64,
    /// Natural curvature about the director, in 1/m.
    pub(super) curvature: f64,
    /// Stretching stiffness, in N.
    pub(super) stretching: f64,
    pub(super) ends: Ends,
    /// Angle of twist of each edge at the start, in rad.
    pub(super) twists: Vec<f64>,
    /// Force on each point at the load factor 1, in N.
    pub(super) loads: Vec<Vector>,
    /// Force on each point at any load factor, in N.
    pub(super) dead_loads: Vec<Vector>,
    /// The longest move of a last Newton step, over the distance of points.
    pub(super) tolerance: f64,
}

/// How a rod is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ends {
    /// The first edge is fixed, and the rod begins at its end: only half of the joint there bends.
    Clamped,
    /// The first edge and the last one are fixed, and the rod reaches from the middle of one to the middle of the
    /// other.
    BothHeld,
    /// The first and the last point are fixed and may turn, but not about the rod.
    Hinged,
    /// The first point and the twist of the first edge are fixed.
    Strut,
    /// The ends are joined. Before, this twist was put in, in rad. An edge is fixed.
    Ring(f64),
    /// The ends are joined, with this twist, and nothing is fixed.
    FreeRing(f64),
}

impl Ends {
    /// Returns the twist of a ring; `None` for an open rod.
    fn ring(self) -> Option<f64> {
        match self {
            Self::Ring(twist) | Self::FreeRing(twist) => Some(twist),
            _ => None,
        }
    }
}

energy! {
    /// A load f that is applied in parts: −s f·x, where s is one load factor for all points.
    energy FactoredLoad(x: Point, shared s: Scalar[1]; f: Vec3[N]) { -s * dot(f, x) }

    /// A moment s M about an axis n on an edge; s is the load factor. The state counts turns.
    energy FactoredMoment(
        x0, x1: Point, shared s: Scalar[1];
        state t: Vec3[1], a: Scalar[rad];
        M: Scalar[N m], n: Vec3[1]
    ) {
        let e = x1 - x0;
        let turned = a + atan2(dot(n, cross(t, e)), dot(t, e));
        next { t = unit(e); a = turned; }
        -s * M * turned
    }

    /// A weak spring that keeps a point in the plane z = 0.
    energy InPlane(x: Point; k: Scalar[N/m]) { k / 2 * x.z^2 }

    /// Twist between an edge and a fixed frame.
    energy HeldTwist(twist: Scalar[rad]; k: Scalar[N m]) { k / 2 * twist^2 }
}

/// A rod at rest under loads that rise step by step.
pub(super) struct Loaded {
    pub(super) system: MixedSystem,
    newton: MixedNewton,
    pub(super) u: Vec<f64>,
    points: usize,
}

impl Rod {
    /// Creates a rod along points, without loads.
    pub(super) fn new(points: Vec<Vector>, director: Vector, ends: Ends, bending: [f64; 2], twisting: f64) -> Self {
        let count = points.len();
        let edges = if ends.ring().is_some() { count } else { count - 1 };
        let length = norm(subtract(points[1], points[2])) * edges as f64;
        // Stretches by less than 10⁻⁸ of what bends.
        let stretching = 1e5 * bending[0].max(bending[1]) / (length * length);
        // The twist of a ring is spread evenly.
        let twist = |edge: usize| ends.ring().map_or(0.0, |twist| twist * edge as f64 / edges as f64);
        Self {
            directors: vec![director; edges],
            twists: (0..edges).map(twist).collect(),
            loads: vec![[0.0; 3]; count],
            dead_loads: vec![[0.0; 3]; count],
            points,
            bending,
            twisting,
            curvature: 0.0,
            stretching,
            ends,
            tolerance: 1e-9,
        }
    }

    pub(super) fn edges(&self) -> usize {
        self.directors.len()
    }

    /// Returns the unknown of a point; that of an edge's twist follows.
    pub(super) fn point(&self, number: usize) -> usize {
        2 * (number % self.points.len())
    }

    pub(super) fn twist(&self, edge: usize) -> usize {
        2 * (edge % self.edges()) + 1
    }

    /// Returns the points whose edges bend against each other, in the middle.
    fn joints(&self) -> std::ops::Range<usize> {
        if self.ends.ring().is_some() { 0..self.points.len() } else { 1..self.points.len() - 1 }
    }

    fn tangent(&self, edge: usize) -> Vector {
        let count = self.points.len();
        unit(subtract(self.points[(edge + 1) % count], self.points[edge % count]))
    }

    /// Returns the unknowns that are fixed.
    fn fixed(&self) -> Vec<usize> {
        let last = 2 * (self.points.len() - 1);
        match self.ends {
            Ends::Clamped | Ends::Ring(_) => vec![0, 1, 2],
            Ends::BothHeld => vec![0, 1, 2, last - 2, last - 1, last],
            Ends::Hinged => vec![0, last],
            Ends::Strut => vec![0, 1],
            Ends::FreeRing(_) => Vec::new(),
        }
    }

    fn body(&self) -> Result<MixedBody, ValidateError> {
        let of_point = |point: usize| {
            [UnknownKind::Vector3, UnknownKind::Scalar].into_iter().take(if point < self.edges() { 2 } else { 1 })
        };
        let kinds: Vec<UnknownKind> = (0..self.points.len()).flat_map(of_point).collect();
        let spacing = norm(subtract(self.points[1], self.points[2]));
        let body = MixedBody::new(&kinds, spacing).with_shared(UnknownKind::Scalar, Extremum::Minimum, 1.0);
        Ok(body.with_fixed(&self.fixed())?.with_fixed_shared(&[0])?)
    }

    /// Returns the sum of the rod's terms and of others.
    fn system(&self, others: Vec<MixedTerm>) -> Result<MixedSystem, ValidateError> {
        let mut terms = self.elastic_terms()?;
        terms.extend(self.load_terms()?);
        terms.extend(others);
        Ok(MixedSystem::new(self.body()?, terms)?)
    }

    fn elastic_terms(&self) -> Result<Vec<MixedTerm>, ValidateError> {
        let count = self.points.len();
        let spacing = norm(subtract(self.points[1], self.points[2]));
        let edges: Vec<[usize; 2]> = (0..self.edges()).map(|edge| [self.point(edge), self.point(edge + 1)]).collect();
        let springs = (0..self.edges()).map(|edge| {
            let length = norm(subtract(self.points[edge], self.points[(edge + 1) % count]));
            HookeSpring::new(self.stretching / length, length)
        });
        let (mut bends, mut round, mut twists) = (Vec::new(), Vec::new(), Vec::new());
        let (mut stencils, mut of_points) = (Vec::new(), Vec::new());
        let is_round = self.bending[0] == self.bending[1] && self.curvature == 0.0;
        for joint in self.joints() {
            let before = (joint + self.edges() - 1) % self.edges();
            let [t0, t1] = [before, joint].map(|edge| self.tangent(edge));
            let [d0, d1] = [before, joint].map(|edge| self.directors[edge % self.edges()]);
            // Next to the clamp, only one of both half edges bends.
            let length = if self.ends == Ends::Clamped && joint == 1 { 0.5 * spacing } else { spacing };
            let [b1, b2] = self.bending;
            match is_round {
                true => round.push(RodBend::new(b1, length)),
                false => bends.push(RodBendAnisotropic::new(b1, b2, length, self.curvature, 0.0, t0, t1, d0, d1)),
            }
            let put_in = if joint == 0 { self.ends.ring().unwrap_or(0.0) } else { 0.0 };
            twists.push(RodTwist::new(self.twisting, length, 0.0, t0, t1, put_in));
            let points = [joint + count - 1, joint, joint + 1].map(|point| self.point(point));
            of_points.push(points);
            stencils.push([points[0], points[1], points[2], self.twist(before), self.twist(joint)]);
        }
        Ok(vec![
            MixedTerm::of_points("stretch", springs.collect(), &edges)?,
            MixedTerm::with_state("bend", bends, if is_round { &[] } else { &stencils })?,
            MixedTerm::of_points("bend", round, if is_round { &of_points } else { &[] })?,
            MixedTerm::with_state("twist", twists, &stencils)?,
        ])
    }

    fn load_terms(&self) -> Result<Vec<MixedTerm>, ValidateError> {
        let count = self.points.len();
        let factored: Vec<FactoredLoad> = self.loads.iter().map(|&load| FactoredLoad::new(load)).collect();
        let weights: Vec<Gravity> = self.dead_loads.iter().map(|&load| Gravity::new(1.0, load)).collect();
        let loaded: Vec<[usize; 1]> = (0..count).map(|point| [self.point(point)]).collect();
        let with_factor: Vec<[usize; 2]> = loaded.iter().map(|&[point]| [point, 0]).collect();
        // A ring turns about its fixed edge for nothing: its rod has no direction in which it bends more easily.
        let is_fixed_ring = matches!(self.ends, Ends::Ring(_));
        let held: Vec<[usize; 1]> = is_fixed_ring.then(|| [self.point(count / 2)]).into_iter().collect();
        let plane = held.iter().map(|_| InPlane::new(1e-4 * self.bending[0])).collect();
        // Half an edge twists between a hinge and the middle of the edge there.
        let spacing = norm(subtract(self.points[1], self.points[2]));
        let hinges = if self.ends == Ends::Hinged { vec![0, self.edges() - 1] } else { Vec::new() };
        let held_twists = hinges.iter().map(|_| HeldTwist::new(2.0 * self.twisting / spacing)).collect();
        let ends: Vec<[usize; 1]> = hinges.iter().map(|&edge| [self.twist(edge)]).collect();
        Ok(vec![
            MixedTerm::new("load", factored, &with_factor)?,
            MixedTerm::of_points("dead load", weights, &loaded)?,
            MixedTerm::of_points("plane", plane, &held)?,
            MixedTerm::new("hinges", held_twists, &ends)?,
        ])
    }

    /// Returns moments about axes on edges, for [`Rod::at_rest_with`].
    pub(super) fn moments(&self, moments: &[(usize, f64, Vector)]) -> Result<MixedTerm, ValidateError> {
        let element =
            |&(edge, moment, axis): &(usize, f64, Vector)| FactoredMoment::new(moment, axis, self.tangent(edge), 0.0);
        let stencil = |&(edge, ..): &(usize, f64, Vector)| [self.point(edge), self.point(edge + 1), 0];
        let stencils: Vec<[usize; 3]> = moments.iter().map(stencil).collect();
        Ok(MixedTerm::with_state("moments", moments.iter().map(element).collect(), &stencils)?)
    }

    /// Returns the rod without loads.
    pub(super) fn at_rest(&self) -> Result<Loaded, ValidateError> {
        self.at_rest_with(Vec::new())
    }

    /// Returns the rod with other terms, and without loads.
    pub(super) fn at_rest_with(&self, others: Vec<MixedTerm>) -> Result<Loaded, ValidateError> {
        let system = self.system(others)?;
        let spacing = norm(subtract(self.points[1], self.points[2]));
        let options =
            MixedNewtonOptions::new(self.tolerance * spacing).with_stride(20.0 * spacing).with_iteration_limit(300);
        let newton = MixedNewton::new(&system, &KindSolver::Automatic, options);
        let mut u = Vec::with_capacity(system.body().numbers());
        for (number, point) in self.points.iter().enumerate() {
            u.extend(point);
            u.extend(self.twists.get(number));
        }
        u.push(0.0);
        Ok(Loaded { system, newton, u, points: self.points.len() })
    }
}

impl Loaded {
    /// Finds the equilibrium at a load factor, and brings the frames of reference to it.
    pub(super) fn settle(&mut self, factor: f64) -> Result<MixedNewtonReport, ValidateError> {
        if let Some(last) = self.u.last_mut() {
            *last = factor;
        }
        let (u, report) = self.newton.minimise(&mut self.system, &self.u)?;
        self.system.advance(&u)?;
        self.u = u;
        Ok(report)
    }

    /// Raises the load to the factor 1 in equal steps.
    pub(super) fn raise(&mut self, steps: usize) -> Result<(), ValidateError> {
        for step in 1..=steps {
            let report = self.settle(step as f64 / steps as f64)?;
            if !report.converged() {
                return Err(ValidateError::NoRest(report));
            }
        }
        Ok(())
    }

    /// Returns the Hessian of the potential, with its factor, and the number of its negative eigenvalues.
    pub(super) fn factored(&mut self) -> Result<(BorderedMatrix, BandFactor, usize), ValidateError> {
        let mut matrix = self.system.matrix();
        self.system.linearise(&self.u, Curvature::Exact, &mut matrix)?;
        let mut factor = BandFactor::new(self.system.pattern(), &BandOrder::Narrowest);
        let negative = factor.factor(matrix.kinds())?;
        Ok((matrix, factor, negative))
    }

    pub(super) fn point(&self, number: usize) -> Vector {
        std::array::from_fn(|axis| self.u[4 * number + axis])
    }

    /// Returns where the rod ends.
    pub(super) fn tip(&self) -> Vector {
        self.point(self.points - 1)
    }

    /// Returns the force that holds the last edge, and the moment about the origin.
    pub(super) fn held_end(&mut self) -> Result<(Vector, Vector), ValidateError> {
        let (_, gradient) = self.system.gradient(&self.u)?;
        let at = |unknown: usize| self.system.body().first_increment(unknown);
        let (last, twist) = (self.points - 1, gradient[at(2 * self.points - 3)]);
        let along = unit(subtract(self.point(last), self.point(last - 1)));
        let (mut force, mut moment) = ([0.0; 3], along.map(|t| twist * t));
        for point in [last - 1, last] {
            let own: Vector = std::array::from_fn(|axis| gradient[at(2 * point) + axis]);
            let lever = cross(self.point(point), own);
            (0..3).for_each(|axis| force[axis] += own[axis]);
            (0..3).for_each(|axis| moment[axis] += lever[axis]);
        }
        Ok((force, moment))
    }
}

/// Returns the points of a clamped arc in the plane y = 0, which begins at the origin along the x axis: one edge before
/// it, and `segments` edges. It turns towards z by the curvature.
pub(super) fn arc(length: f64, curvature: f64, segments: usize) -> Vec<Vector> {
    let spacing = length / segments as f64;
    let turn = curvature * spacing;
    // Chords of an arc whose vertices turn by equal angles, half of it at the clamp.
    let mut points = vec![[-spacing, 0.0, 0.0], [0.0; 3]];
    for segment in 0..segments {
        let angle = (segment as f64 + 0.5) * turn;
        let last = points[points.len() - 1];
        points.push([last[0] + spacing * angle.cos(), 0.0, last[2] + spacing * angle.sin()]);
    }
    points
}

/// Returns the points of a ring of radius 1 about the z axis.
pub(super) fn ring(segments: usize) -> Vec<Vector> {
    let turn = std::f64::consts::TAU / segments as f64;
    (0..segments).map(|number| (number as f64 * turn).sin_cos()).map(|(s, c)| [c, s, 0.0]).collect()
}

/// Returns the load of a weight per length, by point: half of an edge's on each of its ends; 0 at the clamp.
pub(super) fn weights(points: usize, spacing: f64, weight: Vector) -> Vec<Vector> {
    let share = |number: usize| match number {
        0 => 0.0,
        _ if number == 1 || number == points - 1 => 0.5,
        _ => 1.0,
    };
    (0..points).map(|number| weight.map(|w| share(number) * spacing * w)).collect()
}

pub(super) fn unit(v: Vector) -> Vector {
    let length = norm(v);
    v.map(|x| x / length)
}
