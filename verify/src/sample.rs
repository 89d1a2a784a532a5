//! Random inputs away from degeneracy, reproducible from a seed.

use std::fmt;

use energy_compiler::AuditScope;
use energy_dsl::{Declaration, Field, FieldKind, Inputs, Kind};
use fastrand::Rng;
use serde::{Deserialize, Serialize};

use crate::chart;
use crate::geometry::{Rotation, difference, is_well_shaped, rotate, shortest_distance};

/// One input of an element, flattened in declared order.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// Parameters, followed by a constraint's stiffness and damping, and by the state.
    #[serde(default)]
    pub parameters: Vec<f64>,
    /// Rest shape.
    #[serde(default)]
    pub rest: Vec<f64>,
    /// Positions, or the unknowns of a residual.
    pub positions: Vec<f64>,
    /// Velocities; empty for an energy or a residual.
    #[serde(default)]
    pub velocities: Vec<f64>,
}

impl Sample {
    /// Returns the input in the form that elements take.
    #[must_use]
    pub fn inputs(&self) -> Inputs<'_, f64> {
        Inputs {
            parameters: &self.parameters,
            rest: &self.rest,
            positions: &self.positions,
            velocities: &self.velocities,
        }
    }

    /// Checks that the sample has as many numbers as the declaration needs, all of them finite.
    ///
    /// # Errors
    /// If a list has the wrong length, or contains a number that is not finite.
    pub fn fits(&self, declaration: &Declaration) -> Result<(), String> {
        let size = |fields: &[Field]| fields.iter().map(|field| field.size).sum::<usize>();
        let implied = if declaration.kind == Kind::Constraint { 2 } else { 0 };
        let moving = size(&declaration.points);
        let velocities = matches!(declaration.kind, Kind::Force | Kind::Constraint);
        let check = |what: &str, list: &[f64], expected: usize| {
            if list.len() != expected {
                return Err(format!("`{what}` holds {} numbers, {} takes {expected}", list.len(), declaration.name));
            }
            let bad = list.iter().position(|x| !x.is_finite());
            bad.map_or(Ok(()), |at| Err(format!("`{what}`[{at}] is not finite")))
        };
        check("positions", &self.positions, moving)?;
        check("velocities", &self.velocities, if velocities { declaration.increments() } else { 0 })?;
        check("rest", &self.rest, size(&declaration.rest))?;
        check("parameters", &self.parameters, size(&declaration.parameters) + implied + size(&declaration.state))
    }

    /// Returns k_s and k_d, the last two parameters of a constraint before its state.
    pub fn stiffness_and_damping(&self, declaration: &Declaration) -> (f64, f64) {
        match self.parameters[..self.parameters.len() - state_size(declaration)] {
            [.., stiffness, damping] => (stiffness, damping),
            _ => (1.0, 0.0),
        }
    }

    /// Returns the length over which an element may change: the shortest distance between points, or 1 for fewer than
    /// two points.
    pub fn feature_length(&self, declaration: &Declaration) -> f64 {
        if has_points(declaration) { shortest_distance(&self.positions).unwrap_or(1.0) } else { 1.0 }
    }

    /// Formats the numbers by name with 17 significant digits, from which the same doubles can be read back.
    pub fn describe(&self, declaration: &Declaration) -> String {
        let mut text = String::new();
        let mut add = |title: &str, fields: &[(String, usize)], numbers: &[f64]| {
            let mut rest = numbers;
            for (name, size) in fields {
                let (own, others) = rest.split_at((*size).min(rest.len()));
                rest = others;
                text += &format!("\n    {title}{name} = {}", Numbers(own));
            }
        };
        let named =
            |fields: &[Field]| fields.iter().map(|field| (field.name.to_string(), field.size)).collect::<Vec<_>>();
        let mut parameters = named(&declaration.parameters);
        if declaration.kind == Kind::Constraint {
            parameters.extend([("(stiffness k_s)".to_owned(), 1), ("(damping k_d)".to_owned(), 1)]);
        }
        parameters.extend(named(&declaration.state).into_iter().map(|(name, size)| (format!("(state) {name}"), size)));
        add("", &named(&declaration.points), &self.positions);
        if !self.velocities.is_empty() {
            let rates = declaration.points.iter().map(|field| (field.name.to_string(), field.increments()));
            add("velocity of ", &rates.collect::<Vec<_>>(), &self.velocities);
        }
        add("rest ", &named(&declaration.rest), &self.rest);
        add("parameter ", &parameters, &self.parameters);
        text
    }
}

/// Formats numbers with 17 significant digits.
struct Numbers<'a>(&'a [f64]);

impl fmt::Display for Numbers<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [one] => write!(f, "{one:.16e}"),
            many => {
                let texts: Vec<String> = many.iter().map(|x| format!("{x:.16e}")).collect();
                write!(f, "[{}]", texts.join(", "))
            }
        }
    }
}

/// Returns the count of numbers of the state.
pub(crate) fn state_size(declaration: &Declaration) -> usize {
    declaration.state.iter().map(|field| field.size).sum()
}

/// Whether the positions are points in space, rather than other unknowns.
pub fn has_points(declaration: &Declaration) -> bool {
    let is_point = |field: &Field| field.kind == FieldKind::Point && field.size == 3;
    !declaration.points.is_empty() && declaration.points.iter().all(is_point)
}

/// Draws samples for one declaration.
pub struct Sampler<'a> {
    declaration: &'a Declaration,
    scope: AuditScope,
    random: Rng,
    /// Whether the rest shape of an input is regular.
    is_regular: Box<dyn Fn(&Sample) -> bool + 'a>,
}

/// Inputs that are drawn until one has a regular rest shape. Half of all triangles are inverted.
const MOST_DRAWS: usize = 1000;

impl<'a> Sampler<'a> {
    /// Creates a sampler whose samples depend on the seed and the declaration's name only.
    pub fn new(declaration: &'a Declaration, seed: u64) -> Self {
        Self::within(&AuditScope::default(), declaration, seed)
    }

    /// Creates a sampler of the domain that a declaration states.
    pub fn within(scope: &AuditScope, declaration: &'a Declaration, seed: u64) -> Self {
        // FNV-1a.
        let name = declaration
            .name
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
        let (scope, random) = (scope.clone(), Rng::with_seed(seed ^ name));
        Self { declaration, scope, random, is_regular: Box::new(|_| true) }
    }

    /// Draws inputs again whose rest shapes do not satisfy a condition.
    #[must_use]
    pub fn with_rest(self, is_regular: impl Fn(&Sample) -> bool + 'a) -> Self {
        Self { is_regular: Box::new(is_regular), ..self }
    }

    /// Returns a uniform number in [low, high).
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.random.f64()
    }

    fn uniforms(&mut self, count: usize, low: f64, high: f64) -> Vec<f64> {
        (0..count).map(|_| self.uniform(low, high)).collect()
    }

    /// Draws an input: points at distances of about one to eight, within a few units of the origin, or as the
    /// declaration states.
    pub fn sample(&mut self) -> Sample {
        let mut sample = self.draw();
        for _ in 1..MOST_DRAWS {
            if (self.is_regular)(&sample) {
                break;
            }
            sample = self.draw();
        }
        sample
    }

    fn draw(&mut self) -> Sample {
        let declaration = self.declaration;
        let count: usize = declaration.points.iter().map(|point| point.size).sum();
        let size = self.range("scale").map(|(low, high)| self.uniform(low.log2(), high.log2()).exp2());
        let positions = match has_points(declaration) {
            true => self.points(count, size),
            false if self.is_limited() => declaration.points.iter().flat_map(|field| self.unknown(field)).collect(),
            false => self.unknowns(count),
        };
        let mut rest = self.rest();
        if let Some(size) = size.filter(|_| declaration.rest_points().is_some()) {
            rest.iter_mut().for_each(|x| *x *= size);
        }
        let stretches = self.range("strain");
        let positions = stretches.map_or(positions, |stretches| self.deformed(&rest, stretches));
        let mut parameters = Vec::new();
        // Lengths are about the size of the configuration, so that springs are compressed and stretched, and barriers
        // near and far.
        let length = if has_points(declaration) { shortest_distance(&positions).unwrap_or(1.0) } else { 1.0 };
        for parameter in &*declaration.parameters {
            let is_stated = self.scope.range(&parameter.name).is_some();
            let scale = if parameter.unit == "m" && !is_stated { length } else { 1.0 };
            parameters.extend(self.parameter(parameter).into_iter().map(|x| scale * x));
        }
        let mut velocities = Vec::new();
        if declaration.kind == Kind::Constraint {
            parameters.extend(self.uniforms(2, 0.5, 2.0));
        }
        if matches!(declaration.kind, Kind::Constraint | Kind::Force) {
            velocities = self.uniforms(declaration.increments(), -1.0, 1.0);
        }
        for state in &*declaration.state {
            parameters.extend(self.parameter(state));
        }
        self.turned(Sample { parameters, rest, positions, velocities })
    }

    /// Scales rotations to unit length.
    fn turned(&self, mut sample: Sample) -> Sample {
        let Declaration { points, rest, parameters, state, kind, .. } = self.declaration;
        chart::normalise_fields(points, &mut sample.positions);
        chart::normalise_fields(rest, &mut sample.rest);
        let implied = if *kind == Kind::Constraint { 2 } else { 0 };
        let own = parameters.iter().map(|field| field.size).sum::<usize>();
        chart::normalise_fields(parameters, &mut sample.parameters[..own]);
        chart::normalise_fields(state, &mut sample.parameters[own + implied..]);
        sample
    }

    /// Draws an input whose points are the rest shape, deformed by principal stretches in a range; `None` unless the
    /// rest shape has one point for each point.
    pub fn strained_sample(&mut self, stretches: (f64, f64)) -> Option<Sample> {
        let points_at_rest = self.declaration.rest_points().map(|(_, count)| count);
        let has_shape = has_points(self.declaration) && points_at_rest == Some(self.declaration.points.len());
        has_shape.then(|| {
            let sample = self.sample();
            let positions = self.deformed(&sample.rest, stretches);
            Sample { positions, ..sample }
        })
    }

    /// Draws an input whose positions or unknowns are a part of ordinary ones.
    pub fn scaled_sample(&mut self, factor: f64) -> Sample {
        let sample = self.sample();
        self.turned(Sample { positions: sample.positions.iter().map(|x| factor * x).collect(), ..sample })
    }

    /// Draws unknowns of one size, from ¼ to 4.
    fn unknowns(&mut self, count: usize) -> Vec<f64> {
        let scale = self.uniform(-2.0, 2.0).exp2();
        self.uniforms(count, -scale, scale)
    }

    /// Draws an input whose points have small integer coordinates: edges along axes, right angles, zero components.
    pub fn lattice_sample(&mut self) -> Sample {
        let sample = self.sample();
        // A function of the coordinates themselves may have a kink at any integer.
        if !has_points(self.declaration) || !self.declaration.translation_invariant || self.is_limited() {
            return sample;
        }
        let mut demand = 1.0;
        loop {
            for _ in 0..1000 {
                let positions: Vec<f64> = sample.positions.iter().map(|_| f64::from(self.random.i32(-1..=1))).collect();
                if is_well_shaped(&positions, 3, demand) {
                    return Sample { positions, ..sample };
                }
            }
            demand /= 2.0;
        }
    }

    /// Draws an unusual but non-degenerate input: unknowns and parameters, or distances between points, of very
    /// different sizes.
    pub fn odd_sample(&mut self) -> Sample {
        let mut sample = self.sample();
        if self.is_limited() {
            return sample;
        }
        let shrink = |numbers: &mut [f64], random: &mut Rng| {
            let all = random.bool().then(|| random.i32(-20..1));
            for x in numbers.iter_mut() {
                *x *= f64::from(all.unwrap_or_else(|| random.i32(-6..1))).exp2();
            }
        };
        if self.random.bool() {
            shrink(&mut sample.parameters, &mut self.random);
        }
        if self.random.bool() {
            shrink(&mut sample.positions, &mut self.random);
        }
        self.turned(sample)
    }

    /// Returns the stated range of a name.
    fn range(&self, name: &str) -> Option<(f64, f64)> {
        // An input of that name has the range for itself.
        let Declaration { points, rest, parameters, .. } = self.declaration;
        let is_input = [points, rest, parameters].into_iter().any(|list| list.iter().any(|field| field.name == name));
        if is_input { None } else { self.scope.range(name) }
    }

    /// Whether the declaration states where it is used.
    fn is_limited(&self) -> bool {
        !self.scope.ranges.is_empty()
    }

    /// Draws a deformation of the rest shape by principal stretches in a range, turned and moved at random.
    fn deformed(&mut self, rest: &[f64], (low, high): (f64, f64)) -> Vec<f64> {
        let dimension = self.declaration.rest[0].entry_size();
        let mut axes = self.rotation();
        if dimension == 2 {
            // A turn in the plane.
            let half = self.uniform(0.0, std::f64::consts::PI);
            axes = Rotation::from_unit_quaternion([half.cos(), 0.0, 0.0, half.sin()]);
        }
        let stretches = [(); 3].map(|()| self.uniform(low, high));
        let turn = self.rotation();
        let offset = self.uniforms(3, -2.0, 2.0);
        rest.chunks(dimension)
            .flat_map(|point| {
                let point: Vec<f64> = (0..3).map(|axis| point.get(axis).copied().unwrap_or(0.0)).collect();
                let mut principal = rotate(&axes, &point);
                (0..3).for_each(|axis| principal[axis] *= stretches[axis]);
                rotate(&turn, &principal)
            })
            .enumerate()
            .map(|(i, x)| x + offset[i % 3])
            .collect()
    }

    fn unknown(&mut self, unknown: &Field) -> Vec<f64> {
        // Entries of arrays and parts of motions have the range of their input.
        let input = unknown.name.split(['[', '.']).next().unwrap_or_default();
        match self.scope.range(input) {
            Some((low, high)) => self.uniforms(unknown.size, low, high),
            None => self.unknowns(unknown.size),
        }
    }

    /// Draws well-shaped points, of a size or one from ½ to 4, and translated at random.
    fn points(&mut self, count: usize, size: Option<f64>) -> Vec<f64> {
        let points = self.shape(count, 3, |_, _| true);
        let scale = match size {
            Some(size) => size,
            None => self.uniform(-1.0, 2.0).exp2(),
        };
        let turn = self.rotation();
        let offset = self.uniforms(3, -2.0, 2.0);
        points.chunks(3).flat_map(|p| rotate(&turn, p)).enumerate().map(|(i, x)| scale * x + offset[i % 3]).collect()
    }

    /// Draws a rest shape: points in the plane or in space (a triangle or tetrahedron has positive size), and plain
    /// numbers.
    fn rest(&mut self) -> Vec<f64> {
        let fields = &*self.declaration.rest;
        let dimension = fields.iter().map(Field::entry_size).find(|size| (2..=3).contains(size));
        let are_points = |field: &Field| Some(field.entry_size()) == dimension;
        let count = fields.iter().filter(|field| are_points(field)).map(|field| field.size).sum();
        let mut shape = dimension.map(|dimension| self.shape(count, dimension, is_oriented)).unwrap_or_default();
        let one =
            |field: &Field| if are_points(field) { shape.drain(..field.size).collect() } else { self.parameter(field) };
        fields.iter().flat_map(one).collect()
    }

    /// Draws points in the box (−1, 1) that are well separated, with a demand that falls with each attempt, until
    /// `accepts` holds.
    fn shape(&mut self, count: usize, dimension: usize, accepts: fn(&[f64], usize) -> bool) -> Vec<f64> {
        let mut demand = 1.0;
        loop {
            for _ in 0..1000 {
                let points = self.uniforms(count, -1.0, 1.0);
                if is_well_shaped(&points, dimension, demand) && accepts(&points, dimension) {
                    return points;
                }
            }
            demand /= 2.0;
        }
    }

    /// Draws angles in (−2, 2), other scalars in [0.5, 2), and vectors of either sign.
    fn parameter(&mut self, field: &Field) -> Vec<f64> {
        if let Some((low, high)) = self.scope.range(&field.name) {
            return self.uniforms(field.size, low, high);
        }
        match (&*field.unit, field.size) {
            ("rad", size) => self.uniforms(size, -2.0, 2.0),
            (_, 1) => self.uniforms(1, 0.5, 2.0),
            (_, size) => self.uniforms(size, -2.0, 2.0),
        }
    }

    /// Draws a rotation.
    pub fn rotation(&mut self) -> Rotation {
        loop {
            let quaternion = [(); 4].map(|()| self.uniform(-1.0, 1.0));
            let length = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
            // Reject the corners, which would favour some directions, and the centre.
            if (0.1..1.0).contains(&length) {
                return Rotation::from_unit_quaternion(quaternion.map(|q| q / length));
            }
        }
    }
}

/// Whether a plane triangle is counter-clockwise, or four points in space are a tetrahedron of positive volume; `true`
/// for all other shapes.
fn is_oriented(points: &[f64], dimension: usize) -> bool {
    let corners: Vec<&[f64]> = points.chunks(dimension.max(1)).collect();
    match (dimension, corners.as_slice()) {
        (2, [a, b, c]) => {
            let (u, v) = (difference(b, a), difference(c, a));
            u[0] * v[1] - u[1] * v[0] > 0.0
        }
        (3, [a, b, c, d]) => {
            let [u, v, w] = [b, c, d].map(|corner| difference(corner, a));
            let minor = |i: usize, j: usize| v[i] * w[j] - v[j] * w[i];
            u[0] * minor(1, 2) + u[1] * minor(2, 0) + u[2] * minor(0, 1) > 0.0
        }
        _ => true,
    }
}
