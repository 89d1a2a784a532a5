use crate::check::{Input, Program};
use crate::diagnostic::Diagnostics;
use crate::emit::{Character, character};
use crate::graph::{self, NodeId, Op};
use crate::inspect::mutation::{Mutation, faults};
use crate::inspect::tape::Tape;
use crate::inspect::textbook::{file_programs, programs};
use crate::lower::{Repetition, lower};
use crate::properties::prove;
use crate::routines::{Routines, differentiate};
use energy_runtime::{
    Declaration, Field, Flags, Inputs, Kind, Mask, Number, Outputs, Ray, RestError, Roles, Routine, settle,
    triangle_index,
};

/// An element whose compiled routines are interpreted instead of emitted as Rust. Declarations read at run time are
/// evaluated and audited in this way. Results equal those of the generated code without fused operations.
///
/// ```
/// use energy_compiler::Interpreted;
/// use energy_runtime::Inputs;
///
/// let source = "energy Pull(p, q: Point; k: Scalar) { k / 2 * norm_squared(p - q) }";
/// let pull = Interpreted::from_source(source).unwrap().remove(0);
/// let x = [3.0, 0.0, 4.0, 0.0, 0.0, 0.0];
/// let outputs = pull.evaluate(&Inputs { parameters: &[2.0], rest: &[], positions: &x, velocities: &[] }).unwrap();
/// assert_eq!(outputs.blocks[0], ("energy", vec![25.0]));
/// assert_eq!(outputs.blocks[1].1[..3], [6.0, 0.0, 8.0]);
/// ```
#[derive(Clone, Debug)]
pub struct Interpreted {
    declaration: &'static Declaration,
    rest: Tape,
    routines: Vec<InterpretedRoutine>,
    /// The numbers of each term, if the routines compute one term of a sum.
    repetition: Option<Repetition>,
    audit_samples: Option<usize>,
}

/// Routines that blocks are taken from.
const EVALUATED: [&str; 8] =
    ["value", "gradient", "hessian", "force", "jacobians", "constraint_jacobian", "residual", "jacobian"];

#[derive(Clone, Debug)]
struct InterpretedRoutine {
    name: &'static str,
    ordinary: Tape,
    /// The flag of each mask of the tape.
    ordinary_flags: [bool; 2],
    general: Option<GeneralPath>,
}

#[derive(Clone, Debug)]
struct GeneralPath {
    guard: Tape,
    tape: Tape,
    flags: [bool; 2],
    /// Whether the first group is of values, not of derivatives.
    values_first: bool,
}

impl Interpreted {
    /// Compiles the declarations of a text.
    ///
    /// Their descriptions are leaked: like those of generated elements, they live until the program ends.
    ///
    /// # Errors
    /// Whatever is wrong with the text.
    pub fn from_source(source: &str) -> Result<Vec<Self>, Diagnostics> {
        Self::compiled(&programs(source)?)
    }

    /// Compiles the declarations in the text of a file.
    ///
    /// # Errors
    /// Whatever is wrong with the text, at its places in the file.
    pub fn from_file(text: &str, file: &str) -> Result<Vec<Self>, Diagnostics> {
        Self::compiled(&file_programs(text, file)?)
    }

    /// Compiles programs whose claims an audit may check.
    fn compiled(programs: &[Program]) -> Result<Vec<Self>, Diagnostics> {
        let mut diagnostics = Diagnostics::default();
        let mut compile = |program| {
            let routines = differentiate(program, lower(program));
            prove(program, &routines, true, &mut diagnostics);
            Self::new(program, &routines)
        };
        let elements = programs.iter().map(&mut compile).collect();
        diagnostics.finish(elements)
    }

    fn new(program: &Program, routines: &Routines) -> Self {
        let masks = |flags: [Option<NodeId>; 2]| flags.into_iter().flatten().collect::<Vec<_>>();
        let present = |flags: [Option<NodeId>; 2]| flags.map(|flag| flag.is_some());
        let graph = &routines.graph;
        let list = routines.list.iter().map(|routine| InterpretedRoutine {
            name: routine.name,
            ordinary: Tape::new(graph, &routine.groups, &masks(routine.flags)),
            ordinary_flags: present(routine.flags),
            general: routine.general.as_ref().map(|general| GeneralPath {
                guard: Tape::new(graph, &[], &[general.ordinary]),
                tape: Tape::new(graph, &general.groups, &masks(general.flags)),
                flags: present(general.flags),
                values_first: routine.has_values(),
            }),
        });
        let degenerate: Vec<NodeId> = routines.refused.into_iter().collect();
        Self {
            declaration: Box::leak(Box::new(describe(program, routines))),
            rest: Tape::new(&routines.rest.graph, std::slice::from_ref(&routines.rest.outputs), &degenerate),
            routines: list.collect(),
            repetition: routines.repetition.clone(),
            audit_samples: program.audit_samples,
        }
    }

    /// Returns the samples that `#[audit]` asks for; `None` without it.
    #[must_use]
    pub fn audit_samples(&self) -> Option<usize> {
        self.audit_samples
    }

    /// Returns the declaration.
    #[must_use]
    pub fn declaration(&self) -> &'static Declaration {
        self.declaration
    }

    /// Evaluates all blocks, as `Element::evaluate` of generated code does.
    ///
    /// # Errors
    /// When the rest shape is degenerate.
    ///
    /// # Panics
    /// When an input slice other than that of velocities is shorter than declared.
    pub fn evaluate<T: Number>(&self, inputs: &Inputs<'_, T>) -> Result<Outputs<T>, RestError> {
        let rest = self.precomputed(inputs)?;
        let run = |name: &str| {
            let routine = self.routines.iter().find(|r| r.name == name);
            self.run(routine.expect("compiler bug: the kind decides the routines"), inputs, &rest)
        };
        let points = self.declaration.points.len();
        let (mut blocks, mut repeats) = (Vec::new(), Vec::new());
        let mut flags = [Flags::clear(), Flags::clear(), Flags::clear()];
        if matches!(self.declaration.kind, Kind::Energy | Kind::Constraint) {
            let (value, gradient, hessian) = (run("value"), run("gradient"), run("hessian"));
            blocks.push(("energy", value.group(0)));
            blocks.push(("grad", gradient.group(1)));
            blocks.push(("hess", full_triangle(points, &hessian.group(2))));
            repeats.push(("gradient", "energy", gradient.group(0)));
            repeats.extend([("hessian", "energy", hessian.group(0)), ("hessian", "grad", hessian.group(1))]);
            flags = [value.flags, gradient.flags, hessian.flags];
        }
        if matches!(self.declaration.kind, Kind::Force | Kind::Constraint) {
            let (force, jacobians) = (run("force"), run("jacobians"));
            blocks.push(("force", force.group(0)));
            blocks.push(("dfdx", full_square(points, &jacobians.group(1))));
            blocks.push(("dfdv", full_square(points, &jacobians.group(2))));
            repeats.push(("jacobians", "force", jacobians.group(0)));
            if self.declaration.kind == Kind::Force {
                flags = [force.flags, jacobians.flags.clone(), jacobians.flags];
            }
        }
        match self.declaration.kind {
            Kind::Constraint => {
                let jacobian = run("constraint_jacobian");
                blocks.extend([("constraint", jacobian.group(0)), ("jacobian", jacobian.group(1))]);
            }
            Kind::Residual => {
                let (residual, jacobian) = (run("residual"), run("jacobian"));
                blocks.extend([("residual", residual.group(0)), ("jacobian", jacobian.group(1))]);
                repeats.push(("jacobian", "residual", jacobian.group(0)));
                flags = [residual.flags, jacobian.flags, Flags::clear()];
            }
            Kind::Energy | Kind::Force => {}
        }
        Ok(Outputs { blocks, repeats, flags })
    }

    /// Evaluates one routine (`value`, `gradient`, `hessian`, …) with the numbers of [`Self::precomputed`]. Returns its
    /// numbers by group (a Hessian as its triangle of blocks) and its flags. `None` if the kind has no such routine.
    ///
    /// ```
    /// use energy_compiler::Interpreted;
    /// use energy_runtime::Inputs;
    ///
    /// let source = "energy Pull(p, q: Point; k: Scalar) { k / 2 * norm_squared(p - q) }";
    /// let pull = Interpreted::from_source(source).unwrap().remove(0);
    /// let x = [3.0, 0.0, 4.0, 0.0, 0.0, 0.0];
    /// let inputs = Inputs { parameters: &[2.0], rest: &[], positions: &x, velocities: &[] };
    /// let rest = pull.precomputed(&inputs).unwrap();
    /// assert_eq!(pull.routine("value", &inputs, &rest).unwrap().0, [[25.0]]);
    /// ```
    #[must_use]
    pub fn routine<T: Number>(
        &self,
        name: &str,
        inputs: &Inputs<'_, T>,
        precomputed: &[T],
    ) -> Option<(Vec<Vec<T>>, Flags<T>)> {
        let routine = self.routines.iter().find(|routine| routine.name == name)?;
        let Results { groups, flags } = self.run(routine, inputs, precomputed);
        Some((groups, flags))
    }

    /// Returns the numbers that the rest shape determines, for [`Self::routine`].
    ///
    /// # Errors
    /// When the rest shape is degenerate.
    pub fn precomputed<T: Number>(&self, inputs: &Inputs<'_, T>) -> Result<Vec<T>, RestError> {
        let (mut groups, degenerate) = self.rest.run(inputs, &[]);
        let numbers = groups.remove(0);
        // False for infinite numbers and NaN.
        let sound = |x: &T| (x.clone() - x.clone()).equal(T::from_f64(0.0)).all();
        if degenerate.iter().any(|mask| mask.any()) || !numbers.iter().all(sound) {
            return Err(RestError { element: self.declaration.name });
        }
        Ok(numbers)
    }

    /// Returns the outcomes of all comparisons on the ordinary path: the branches that an input takes.
    ///
    /// # Errors
    /// When the rest shape is degenerate.
    pub fn branches(&self, inputs: &Inputs<'_, f64>) -> Result<Vec<bool>, RestError> {
        let rest = self.precomputed(inputs)?;
        let routines = self.routines.iter().filter(|r| EVALUATED.contains(&r.name));
        let terms = self.terms(&rest);
        let outcomes = |tape: &Tape| terms.iter().flat_map(|term| tape.comparisons(inputs, term)).collect::<Vec<_>>();
        Ok(routines.flat_map(|routine| outcomes(&routine.ordinary)).collect())
    }

    /// Returns the stored numbers that each term reads; all of them if the formula is no sum of like terms.
    fn terms<T: Number>(&self, precomputed: &[T]) -> Vec<Vec<T>> {
        match &self.repetition {
            None => vec![precomputed.to_vec()],
            Some(all) => (0..all.terms()).map(|term| all.numbers(term, precomputed, T::from_f64)).collect(),
        }
    }

    /// Runs a routine for all terms, and adds the results.
    fn run<T: Number>(&self, routine: &InterpretedRoutine, inputs: &Inputs<'_, T>, precomputed: &[T]) -> Results<T> {
        if self.repetition.is_none() {
            return routine.run(inputs, precomputed);
        }
        let mut results = self.terms(precomputed).into_iter().map(|term| routine.run(inputs, &term));
        let first = results.next().expect("compiler bug: a sum has terms");
        results.fold(first, Results::plus)
    }

    /// Returns every fault that can be planted in the numbers of the ordinary path. Operations that only choose between
    /// two equivalent forms are left alone: both are right.
    #[must_use]
    pub fn mutations(&self) -> Vec<Mutation> {
        let tapes = std::iter::once(("rest", &self.rest))
            .chain(self.routines.iter().filter(|r| EVALUATED.contains(&r.name)).map(|r| (r.name, &r.ordinary)));
        // The unknowns of a residual need not come in threes. A fault must not read a number that does not exist.
        let unknowns: usize = self.declaration.points.iter().map(|field| field.size).sum();
        let exists = |op: Op| !matches!(op, Op::Input(graph::Input::Position(i)) if usize::from(i) >= unknowns);
        let mut list = Vec::new();
        for (routine, tape) in tapes {
            let is_number = tape.are_numbers_of_results();
            for (place, &before) in tape.ops().iter().enumerate().filter(|(place, _)| is_number[*place]) {
                let planted = faults(before).into_iter().filter(|(_, after)| *after != before && exists(*after));
                list.extend(planted.map(|(fault, after)| Mutation { fault, routine, place, before, after }));
            }
        }
        list
    }

    /// Returns the element with a fault planted.
    #[must_use]
    pub fn mutated(&self, mutation: &Mutation) -> Self {
        let mut broken = self.clone();
        *broken.tape(mutation.routine) = self.clone().tape(mutation.routine).with(mutation.place, mutation.after);
        broken
    }

    /// Returns whether a fault provably changes nothing in exact arithmetic. Both routines are built into one graph in
    /// which equal expressions are one node, rounding errors are 0, and 0 and 1 fold. `false` if that proves nothing.
    #[must_use]
    pub fn is_proved_equivalent(&self, mutation: &Mutation) -> bool {
        let before = self.clone().tape(mutation.routine).clone();
        before.is_proved_equal(&before.with(mutation.place, mutation.after))
    }

    fn tape(&mut self, routine: &str) -> &mut Tape {
        let named = self.routines.iter_mut().find(|r| r.name == routine);
        named.map_or(&mut self.rest, |routine| &mut routine.ordinary)
    }
}

/// The results of a routine.
struct Results<T: Number> {
    groups: Vec<Vec<T>>,
    flags: Flags<T>,
}

impl<T: Number> Results<T> {
    fn group(&self, number: usize) -> Vec<T> {
        self.groups[number].clone()
    }

    fn plus(self, term: Self) -> Self {
        let add = |(sum, term): (Vec<T>, Vec<T>)| sum.into_iter().zip(term).map(|(a, b)| a + b).collect::<Vec<_>>();
        let groups: Vec<Vec<T>> = self.groups.into_iter().zip(term.groups).map(add).collect();
        let sum = groups.iter().flatten().cloned().fold(T::from_f64(0.0), |sum, number| sum + number);
        let finite = (sum.clone() - sum).equal(T::from_f64(0.0));
        let mut flags = self.flags.union(term.flags);
        flags.degenerate = flags.degenerate | !finite;
        Self { groups, flags }
    }
}

impl InterpretedRoutine {
    fn run<T: Number>(&self, inputs: &Inputs<'_, T>, rest: &[T]) -> Results<T> {
        if let Some(general) = self.general.as_ref().filter(|g| !g.guard.run(inputs, rest).1[0].all()) {
            return general.run(inputs, rest);
        }
        let (tape, present) = (&self.ordinary, self.ordinary_flags);
        let (groups, masks) = tape.run(inputs, rest);
        let mut masks = masks.into_iter();
        let mut mask = |is_there: bool| if is_there { masks.next() } else { None }.unwrap_or_else(T::Mask::none);
        let flags = Flags { degenerate: mask(present[0]), kink: mask(present[1]) };
        Results { groups, flags }
    }
}

impl GeneralPath {
    fn with_flags<T: Number>(&self, inputs: &Inputs<'_, T>, rest: &[T]) -> (Vec<Vec<T>>, Flags<T>) {
        let (groups, masks) = self.tape.run(inputs, rest);
        let mut masks = masks.into_iter();
        let mut mask = |is_there| if is_there { masks.next() } else { None }.unwrap_or_else(Mask::none);
        (groups, Flags { degenerate: mask(self.flags[0]), kink: mask(self.flags[1]) })
    }

    /// Runs the general path over numbers with an extended exponent.
    fn run<T: Number>(&self, inputs: &Inputs<'_, T>, rest: &[T]) -> Results<T> {
        let unbounded = |numbers: &[T]| numbers.iter().map(|x| x.unbounded(0)).collect::<Vec<_>>();
        let inputs = Inputs {
            parameters: &unbounded(inputs.parameters),
            rest: &unbounded(inputs.rest),
            positions: &unbounded(inputs.positions),
            velocities: &unbounded(inputs.velocities),
        };
        let rest = unbounded(rest);
        let (groups, mut flags) = self.with_flags(&inputs, &rest);
        let number = |value: T::Unbounded| {
            let mut number = T::from_f64(0.0);
            number.set_lane(0, value);
            number
        };
        let Inputs { parameters, rest: shape, positions, velocities } = inputs;
        let read = [parameters, shape, &rest, positions, velocities].concat();
        let fixed = parameters.len() + shape.len() + rest.len();
        let moves: Vec<bool> = (0..read.len()).map(|i| i >= fixed).collect();
        let sizes: Vec<usize> = groups.iter().map(Vec::len).collect();
        let mut results = groups.concat();
        let along = |rays: &[Ray]| {
            let mut rays = rays;
            let mut take = |count: usize| rays.split_off(..count).expect("as many rays as inputs");
            let (parameters, shape, rest) = (take(parameters.len()), take(shape.len()), take(rest.len()));
            let (positions, velocities) = (take(positions.len()), take(velocities.len()));
            let (groups, flags) = self.with_flags(&Inputs { parameters, rest: shape, positions, velocities }, rest);
            (!flags.degenerate).then(|| groups.concat())
        };
        let roles = Roles { moves: &moves, groups: &sizes, values_first: self.values_first };
        settle(&read, roles, &mut results, &mut flags, &along);
        let mut results = results.into_iter();
        let groups: Vec<Vec<T::Unbounded>> = sizes.iter().map(|&size| results.by_ref().take(size).collect()).collect();
        let groups = groups.into_iter().map(|group| group.into_iter().map(number).collect()).collect();
        let mask = |mask: <T::Unbounded as Number>::Mask| T::Mask::from_bits(u32::from(mask.any()));
        let flags = Flags { degenerate: mask(flags.degenerate), kink: mask(flags.kink) };
        Results { groups, flags }
    }
}

/// Expands a triangle of 3×3 blocks to a full matrix, row by row.
fn full_triangle<T: Number>(points: usize, triangle: &[T]) -> Vec<T> {
    entries(points)
        .map(|(row, column)| {
            let (row, column) = if row / 3 <= column / 3 { (row, column) } else { (column, row) };
            triangle[9 * triangle_index(points, row / 3, column / 3) + row % 3 * 3 + column % 3].clone()
        })
        .collect()
}

/// Expands a square of 3×3 blocks to a full matrix, row by row.
fn full_square<T: Number>(points: usize, square: &[T]) -> Vec<T> {
    entries(points)
        .map(|(row, column)| square[9 * (row / 3 * points + column / 3) + row % 3 * 3 + column % 3].clone())
        .collect()
}

fn entries(points: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..3 * points).flat_map(move |row| (0..3 * points).map(move |column| (row, column)))
}

/// Returns the self-description that generated code would have.
fn describe(program: &Program, routines: &Routines) -> Declaration {
    let implied = if program.kind == Kind::Constraint { 2 } else { 0 };
    let declared = &program.parameters[..program.parameters.len() - implied];
    let docs: Vec<&str> = program.docs.iter().map(|line| line.strip_prefix(' ').unwrap_or(line)).collect();
    let Character { curved, quadratic, velocity_dependent, symmetric } = character(program, routines);
    let vectors = routines.vectors.iter().map(|vector| &*vector.clone().leak()).collect::<Vec<_>>();
    let list = routines.list.iter().map(|routine| Routine {
        name: routine.name,
        reduced: routines.count(&routine.reduced_outputs()),
        full: routines.count(&routine.outputs()),
    });
    Declaration {
        name: program.name.clone().leak(),
        kind: program.kind,
        docs: docs.join("\n").leak(),
        formula: program.formula.clone().leak(),
        source: program.source.clone().leak(),
        points: fields(&program.moving),
        rest: fields(&program.rest),
        parameters: fields(declared),
        rows: program.rows(),
        properties: program.properties.iter().map(|(property, _)| *property).collect::<Vec<_>>().leak(),
        translation_invariant: routines.translation_invariant,
        curved,
        quadratic,
        velocity_dependent,
        symmetric,
        reduced_coordinates: routines.coordinates,
        reduced_vectors: vectors.leak(),
        primitives: routines.primitives.clone().leak(),
        routines: list.collect::<Vec<_>>().leak(),
    }
}

fn fields(inputs: &[Input]) -> &'static [Field] {
    let field = |input: &Input| Field {
        name: input.name.clone().leak(),
        size: input.input_type.size(),
        unit: input.unit.clone().leak(),
    };
    inputs.iter().map(field).collect::<Vec<_>>().leak()
}
