//! Known answers of elastic rods with bending, twist and natural curvature: heavy columns, hanging curls, buckling rings
//! and a bent cantilever. Reference frames are transported in time, so loads are applied in steps.

use energy_dsl::energy;
use energy_elements::{Gravity, HookeSpring, RodBend, RodBendAnisotropic, RodTwist};
use energy_solve::{
    Extremum, KindSolver, MixedBody, MixedNewton, MixedNewtonOptions, MixedNewtonReport, MixedSystem, MixedTerm,
    UnknownKind,
};

use super::critical_load::{Symmetry, critical_load};
use super::{Finding, ValidateError};

type Vector = [f64; 3];

/// Tips of naturally curved rods that hang from a clamp, by Kirchhoff's equations: w L³/B, κ₀ L, and how far they reach
/// sideways and down, over L.
const CURLS: [(f64, f64, [f64; 2]); 3] = [
    (10.0, 1.0, [0.236_977_507_3, 0.954_674_497_9]),
    (50.0, 3.0, [0.267_678_761_9, 0.910_069_281_8]),
    (100.0, std::f64::consts::TAU, [0.316_271_897_4, 0.802_612_032_7]),
];

/// Displacement of the tip of the bend of Bathe and Bolourchi (1979) against the start's tangent, along the load and
/// towards the centre. By Kirchhoff's equations with B = E/12 and C = 0.1406 E/2; published values of other theories are
/// 23.5, 53.4 and 13.5.
const BEND: [f64; 3] = [23.817_642_9, 53.600_977_2, 13.731_123_3];

/// Answers the question `rods`: errors at 100 edges, and the orders with which they fall from 50.
pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let (coarse, fine) = (50, 100);
    let mut compare = |case: &str, at: &dyn Fn(usize) -> Result<f64, ValidateError>, exact: f64| {
        let last = at(fine)?;
        report(Finding::relative("rods", case.to_owned(), last, exact, 5e-3));
        if !quick {
            let order = ((at(coarse)? - exact) / (last - exact)).abs().log2();
            let error = (1.8 - order).max(0.0);
            report(Finding {
                question: "rods",
                case: format!("{case}: order"),
                measured: order,
                exact: 2.0,
                error,
                limit: 0.0,
            });
        }
        Ok::<(), ValidateError>(())
    };
    compare("heavy column, w L³/B", &heavy_column, 7.837_347)?;
    for (weight, curvature, tip) in CURLS {
        for (axis, what) in ["aside", "down"].into_iter().enumerate() {
            let case = format!("hanging curl, w {weight:.0}, κ₀ {curvature:.2}, {what}");
            compare(&case, &|segments| Ok(hanging_curl(weight, curvature, segments)?[axis]), tip[axis])?;
        }
    }
    for (axis, what) in [(0, "back"), (1, "along"), (2, "in")] {
        let case = format!("45° bend of a cantilever, {what}");
        compare(&case, &|segments| Ok(bent_cantilever(segments)?[axis].abs()), BEND[axis])?;
    }
    for ratio in [1.0, 1.5] {
        let exact = std::f64::consts::TAU * 3_f64.sqrt() * ratio;
        compare(&format!("twisted ring, B/C = {ratio}"), &|segments| ring_buckling(ratio, segments), exact)?;
    }
    Ok(())
}

/// A rod: points along its centre line, and the moduli of its cross section.
#[derive(Clone, Debug)]
struct Rod {
    points: Vec<Vector>,
    /// Unit vectors perpendicular to the edges, from which angles of twist count.
    directors: Vec<Vector>,
    /// Bending stiffness about the director, and about the axis perpendicular to it, in N m².
    bending: [f64; 2],
    /// Twisting stiffness, in N m².
    twisting: f64,
    /// Natural curvature about the director, in 1/m.
    curvature: f64,
    /// Stretching stiffness, in N.
    stretching: f64,
    /// Twist that was put in before the ends of a ring were joined, in rad; `None` for an open rod.
    ring: Option<f64>,
    /// Force on each point at the load factor 1, in N.
    loads: Vec<Vector>,
    /// Force on each point at any load factor, in N.
    dead_loads: Vec<Vector>,
}

energy! {
    /// A load f that is applied in parts: −s f·x, where s is one load factor for all points.
    energy FactoredLoad(x: Point, shared s: Scalar[1]; f: Vec3[N]) { -s * dot(f, x) }

    /// A weak spring that keeps a point in the plane z = 0.
    energy InPlane(x: Point; k: Scalar[N/m]) { k / 2 * x.z^2 }
}

/// A rod at rest under loads that rise step by step.
struct Loaded {
    system: MixedSystem,
    newton: MixedNewton,
    u: Vec<f64>,
    points: usize,
}

impl Rod {
    /// Creates an open rod along points. Its first edge is clamped: the rod begins at the second point.
    fn clamped(points: Vec<Vector>, director: Vector, bending: [f64; 2], twisting: f64) -> Self {
        let (count, edges) = (points.len(), points.len() - 1);
        let length = distance(points[1], points[2]) * (count - 2) as f64;
        // Stretches by less than 10⁻⁸ of what bends.
        let stretching = 1e5 * bending[0].max(bending[1]) / (length * length);
        let (directors, loads) = (vec![director; edges], vec![[0.0; 3]; count]);
        let dead_loads = loads.clone();
        Self { points, directors, bending, twisting, curvature: 0.0, stretching, ring: None, loads, dead_loads }
    }

    fn edges(&self) -> usize {
        self.directors.len()
    }

    /// Returns the unknown of a point; that of an edge's twist follows.
    fn point(&self, number: usize) -> usize {
        2 * (number % self.points.len())
    }

    fn twist(&self, edge: usize) -> usize {
        2 * (edge % self.edges()) + 1
    }

    /// Returns the points whose edges bend against each other, in the middle.
    fn joints(&self) -> std::ops::Range<usize> {
        if self.ring.is_some() { 0..self.points.len() } else { 1..self.points.len() - 1 }
    }

    fn tangent(&self, edge: usize) -> Vector {
        let count = self.points.len();
        unit(difference(self.points[(edge + 1) % count], self.points[edge % count]))
    }

    fn system(&self) -> Result<MixedSystem, ValidateError> {
        let count = self.points.len();
        let kinds: Vec<UnknownKind> = (0..count)
            .flat_map(|point| {
                [UnknownKind::Vector3, UnknownKind::Scalar].into_iter().take(if point < self.edges() { 2 } else { 1 })
            })
            .collect();
        let spacing = distance(self.points[1], self.points[2 % count]);
        // The first edge holds the rod, or keeps a ring from moving as a rigid body.
        let body = MixedBody::new(&kinds, spacing)
            .with_shared(UnknownKind::Scalar, Extremum::Minimum, 1.0)
            .with_fixed(&[0, 1, 2])?
            .with_fixed_shared(&[0])?;
        let edges: Vec<[usize; 2]> = (0..self.edges()).map(|edge| [self.point(edge), self.point(edge + 1)]).collect();
        let springs = (0..self.edges()).map(|edge| {
            let length = distance(self.points[edge], self.points[(edge + 1) % count]);
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
            let length = if self.ring.is_none() && joint == 1 { 0.5 * spacing } else { spacing };
            let [b1, b2] = self.bending;
            match is_round {
                true => round.push(RodBend::new(b1, length)),
                false => bends.push(RodBendAnisotropic::new(b1, b2, length, self.curvature, 0.0, t0, t1, d0, d1)),
            }
            let put_in = if joint == 0 { self.ring.unwrap_or(0.0) } else { 0.0 };
            twists.push(RodTwist::new(self.twisting, length, 0.0, t0, t1, put_in));
            let points = [joint + count - 1, joint, joint + 1].map(|point| self.point(point));
            of_points.push(points);
            stencils.push([points[0], points[1], points[2], self.twist(before), self.twist(joint)]);
        }
        let factored: Vec<FactoredLoad> = self.loads.iter().map(|&load| FactoredLoad::new(load)).collect();
        let weights: Vec<Gravity> = self.dead_loads.iter().map(|&load| Gravity::new(1.0, load)).collect();
        let loaded: Vec<[usize; 1]> = (0..count).map(|point| [self.point(point)]).collect();
        let with_factor: Vec<[usize; 2]> = loaded.iter().map(|&[point]| [point, 0]).collect();
        // A ring turns about its fixed edge for nothing: its rod has no direction in which it bends more easily.
        let held: Vec<[usize; 1]> = self.ring.iter().map(|_| [self.point(count / 2)]).collect();
        let plane = held.iter().map(|_| InPlane::new(1e-4 * self.bending[0])).collect();
        let terms = vec![
            MixedTerm::of_points("plane", plane, &held)?,
            MixedTerm::of_points("stretch", springs.collect(), &edges)?,
            MixedTerm::with_state("bend", bends, if is_round { &[] } else { &stencils })?,
            MixedTerm::of_points("bend", round, if is_round { &of_points } else { &[] })?,
            MixedTerm::with_state("twist", twists, &stencils)?,
            MixedTerm::new("load", factored, &with_factor)?,
            MixedTerm::of_points("dead load", weights, &loaded)?,
        ];
        Ok(MixedSystem::new(body, terms)?)
    }

    /// Returns the rod without loads.
    fn at_rest(&self) -> Result<Loaded, ValidateError> {
        let system = self.system()?;
        let spacing = distance(self.points[1], self.points[2]);
        let options = MixedNewtonOptions::new(1e-9 * spacing).with_stride(20.0 * spacing).with_iteration_limit(300);
        let newton = MixedNewton::new(&system, &KindSolver::Automatic, options);
        let mut u = Vec::with_capacity(system.body().numbers());
        for (number, point) in self.points.iter().enumerate() {
            u.extend(point);
            // The twist of a ring is spread evenly.
            let twist = self.ring.map_or(0.0, |twist| twist * number as f64 / self.edges() as f64);
            u.extend((number < self.edges()).then_some(twist));
        }
        u.push(0.0);
        Ok(Loaded { system, newton, u, points: self.points.len() })
    }
}

impl Loaded {
    /// Finds the equilibrium at a load factor, and brings the frames of reference to it.
    fn settle(&mut self, factor: f64) -> Result<MixedNewtonReport, ValidateError> {
        if let Some(last) = self.u.last_mut() {
            *last = factor;
        }
        let (u, report) = self.newton.minimise(&mut self.system, &self.u)?;
        self.system.advance(&u)?;
        self.u = u;
        Ok(report)
    }

    /// Raises the load to the factor 1 in equal steps.
    fn raise(&mut self, steps: usize) -> Result<(), ValidateError> {
        for step in 1..=steps {
            let report = self.settle(step as f64 / steps as f64)?;
            if !report.converged() {
                return Err(ValidateError::NoRest(report));
            }
        }
        Ok(())
    }

    fn point(&self, number: usize) -> Vector {
        std::array::from_fn(|axis| self.u[4 * number + axis])
    }

    /// Returns where the rod ends.
    fn tip(&self) -> Vector {
        self.point(self.points - 1)
    }
}

/// Returns the points of a clamped arc in the plane y = 0, which begins at the origin along the x axis: one edge before it,
/// and `segments` edges. It turns towards z by the curvature.
fn arc(length: f64, curvature: f64, segments: usize) -> Vec<Vector> {
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

/// Returns the load of a weight per length, by point: half of an edge's on each of its ends. The clamp has none.
fn weights(points: usize, spacing: f64, weight: Vector) -> Vec<Vector> {
    let share = |number: usize| match number {
        0 => 0.0,
        _ if number == 1 || number == points - 1 => 0.5,
        _ => 1.0,
    };
    (0..points).map(|number| weight.map(|w| share(number) * spacing * w)).collect()
}

/// Returns w L³/B at which a column buckles under its own weight. A small force at the top measures its stiffness.
fn heavy_column(segments: usize) -> Result<f64, ValidateError> {
    let points: Vec<Vector> = arc(1.0, 0.0, segments).into_iter().map(|[x, ..]| [0.0, 0.0, x]).collect();
    let mut rod = Rod::clamped(points, [0.0, 1.0, 0.0], [1.0, 1.0], 1.0);
    rod.loads = weights(segments + 2, 1.0 / segments as f64, [0.0, 0.0, -1.0]);
    let force = 1e-6;
    rod.dead_loads[segments + 1] = [force, 0.0, 0.0];
    critical_load("the column", Symmetry::None, 4.0, |gamma| {
        let mut loaded = rod.at_rest()?;
        let report = loaded.settle(gamma)?;
        let moved = loaded.tip()[0];
        Ok((report.converged() && moved > 0.0 && moved < 0.01).then_some(force / moved))
    })
}

/// Returns how far a naturally curved rod that hangs from a clamp reaches sideways and down, over its length L = 1.
fn hanging_curl(weight: f64, curvature: f64, segments: usize) -> Result<[f64; 2], ValidateError> {
    // The clamp points down. The weight straightens the curl, so the search starts with a straight rod.
    let points: Vec<Vector> = arc(1.0, 0.0, segments).into_iter().map(|[x, _, z]| [z, 0.0, -x]).collect();
    // Stiff against leaving the plane, as a tape is: a round rod would.
    let mut rod = Rod::clamped(points, [0.0, 1.0, 0.0], [1.0, 100.0], 100.0);
    rod.curvature = -curvature;
    rod.loads = weights(segments + 2, 1.0 / segments as f64, [0.0, 0.0, -weight]);
    let mut loaded = rod.at_rest()?;
    loaded.raise(1)?;
    let [x, _, z] = loaded.tip();
    Ok([x, -z])
}

/// Returns the displacement of the tip of Bathe and Bolourchi's bend: an eighth of a circle, with a load across its plane.
fn bent_cantilever(segments: usize) -> Result<Vector, ValidateError> {
    const RADIUS: f64 = 100.0;
    let modulus: f64 = 1e7;
    let points = arc(RADIUS * std::f64::consts::FRAC_PI_4, 1.0 / RADIUS, segments);
    let mut rod = Rod::clamped(points.clone(), [0.0, 1.0, 0.0], [modulus / 12.0; 2], 0.1406 * modulus / 2.0);
    rod.curvature = -1.0 / RADIUS;
    rod.loads[segments + 1] = [0.0, 600.0, 0.0];
    let mut loaded = rod.at_rest()?;
    loaded.raise(10)?;
    Ok(difference(loaded.tip(), points[segments + 1]))
}

/// Returns the twist at which a ring of radius 1 that is closed from a straight rod leaves its plane.
fn ring_buckling(stiffness_ratio: f64, segments: usize) -> Result<f64, ValidateError> {
    let turn = std::f64::consts::TAU / segments as f64;
    let points: Vec<Vector> =
        (0..segments).map(|number| (number as f64 * turn).sin_cos()).map(|(s, c)| [c, s, 0.0]).collect();
    let is_stable = |twist: f64| -> Result<bool, ValidateError> {
        let bending = [stiffness_ratio; 2];
        let rod = Rod {
            points: points.clone(),
            directors: vec![[0.0, 0.0, 1.0]; segments],
            bending,
            twisting: 1.0,
            curvature: 0.0,
            stretching: 1e5 * stiffness_ratio,
            ring: Some(twist),
            loads: vec![[0.0; 3]; segments],
            dead_loads: vec![[0.0; 3]; segments],
        };
        let mut loaded = rod.at_rest()?;
        // The flat ring is at rest but for tiny changes of its radius.
        let report = loaded.settle(0.0)?;
        Ok(report.converged() && report.projected == 0)
    };
    let (mut low, mut high) = (0.0, 40.0);
    while high - low > 1e-4 * high {
        let twist = 0.5 * (low + high);
        *(if is_stable(twist)? { &mut low } else { &mut high }) = twist;
    }
    Ok(0.5 * (low + high))
}

fn difference(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn distance(a: Vector, b: Vector) -> f64 {
    difference(a, b).iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn unit(v: Vector) -> Vector {
    let length = distance(v, [0.0; 3]);
    v.map(|x| x / length)
}
