use std::fmt::Write as _;

use proc_macro2::TokenStream;

use crate::budget::{Budget, Limits, Progress, grouped};
use crate::check::Program;
use crate::diagnostic::Diagnostics;
use crate::diff::Route;
use crate::emit::emit;
use crate::graph::{Interpreter, NodeId};
use crate::inspect::layout::{layout, methods};
use crate::inspect::textbook::{file_programs, programs};
use crate::lower::lower;
use crate::plan::{Plan, operations};
use crate::routines::{Routines, differentiate};
use energy_runtime::{Inputs, Mask, Number, OperationCount, RoutineKind};

/// The two paths of a routine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// The ordinary path for ordinary configurations, as generated code chooses.
    Chosen,
    /// The general path, with all precautions.
    General,
}

/// The code of a declaration, and how the compiler got there.
///
/// ```
/// let source = "energy Pull(p, q: Point; k: Scalar) { k / 2 * norm_squared(p - q) }";
/// let listing = energy_compiler::Listing::from_source(source).unwrap().remove(0);
/// let hessian = listing.routine("hessian").unwrap();
/// assert!(hessian.contains("fn hessian_at<L: ::energy_dsl::Level>"));
/// assert!(hessian.contains("fn reduced_hessian_at<L: ::energy_dsl::Level>") && hessian.contains("fn expand<"));
/// assert!(listing.plans().contains("adjoint-weighted"));
/// assert!(listing.plans().contains("of 10,000,000 steps to compile"));
/// ```
#[derive(Clone, Debug)]
pub struct Listing {
    name: String,
    code: TokenStream,
    routines: Routines,
    /// The budget before the declaration was lowered, and after its code was written.
    spent: [Progress; 2],
}

impl Listing {
    /// Compiles the declarations of a text.
    ///
    /// # Errors
    /// Whatever is wrong with the text.
    pub fn from_source(source: &str) -> Result<Vec<Self>, Diagnostics> {
        Self::of(&programs(source, &Budget::default())?)
    }

    /// Compiles the declarations in the text of a file.
    ///
    /// # Errors
    /// Whatever is wrong with the text, at its places in the file.
    pub fn from_file(text: &str, file: &str) -> Result<Vec<Self>, Diagnostics> {
        Self::from_file_within(text, file, &Budget::default())
    }

    /// Compiles the declarations in the text of a file within a budget.
    ///
    /// # Errors
    /// Whatever is wrong with the text, and a budget that is spent.
    pub fn from_file_within(text: &str, file: &str, budget: &Budget) -> Result<Vec<Self>, Diagnostics> {
        Self::of(&file_programs(text, file, budget)?)
    }

    fn of(programs: &[Program]) -> Result<Vec<Self>, Diagnostics> {
        let listing = |program: &Program| {
            let before = program.budget.progress();
            let mut routines = differentiate(program, lower(program));
            let code = emit(program, &Plan::new(program, &routines));
            let spent = [before, program.budget.progress()];
            // Later counts are not part of the compilation.
            routines.graph = routines.graph.paid_by(&Budget::new(Limits::NONE));
            Self { name: program.name.clone(), code, routines, spent }
        };
        let within = |program: &Program| program.budget.within(|| listing(program));
        programs.iter().map(|program| within(program).map_err(|stop| program.stopped(stop).into())).collect()
    }

    /// Returns the name of the declaration.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns all generated code. Of general paths, which are data, it says `b"…"`.
    #[must_use]
    pub fn code(&self) -> String {
        layout(&self.code)
    }

    /// Returns the method of a routine (`value`, `hessian`, …), with its ordinary and its general path. Where it only
    /// expands the routine in reduced coordinates, these and the expansion follow.
    #[must_use]
    pub fn routine(&self, name: &str) -> Option<String> {
        let all = methods(&self.code);
        let methods_of = |name: &str| {
            let wanted = ["at", "has_guards", "if_ordinary", "in_general"].map(|part| format!("{name}_{part}"));
            all.iter().filter(move |(name, _)| wanted.contains(name)).map(|(_, text)| text.clone())
        };
        let mut methods: Vec<String> = methods_of(name).collect();
        let reduced = format!("reduced_{name}");
        if methods.iter().any(|text| text.contains(&format!("{reduced}_at::<L>"))) {
            methods.extend(methods_of(&reduced));
            methods.extend(all.iter().filter(|(name, _)| name == "expand").map(|(_, text)| text.clone()));
        }
        (!methods.is_empty()).then(|| methods.join("\n"))
    }

    /// Returns the names that [`Self::routine`] accepts.
    #[must_use]
    pub fn routines(&self) -> Vec<String> {
        methods(&self.code).iter().filter_map(|(name, _)| name.strip_suffix("_at").map(str::to_owned)).collect()
    }

    /// Interprets a routine of a declaration without rest shape. Returns its results by group; `None` for an unknown
    /// routine.
    ///
    /// # Panics
    /// When an input slice is shorter than declared.
    #[must_use]
    pub fn evaluate<T: Number>(&self, routine: &str, path: Path, inputs: &Inputs<'_, T>) -> Option<Vec<Vec<T>>> {
        let routine = self.routines.find(RoutineKind::named(routine)?)?;
        let graph = &self.routines.graph;
        let groups = match &routine.general {
            Some(general) if path == Path::General || !self.mask(general.ordinary, inputs).all() => &general.groups,
            _ => &routine.groups,
        };
        Some(groups.iter().map(|group| Interpreter::new(graph, group).evaluate(inputs, &[])).collect())
    }

    /// Returns whether a routine of a declaration without rest shape raises a flag; `None` for an unknown routine.
    #[must_use]
    pub fn is_flagged<T: Number>(&self, routine: &str, inputs: &Inputs<'_, T>) -> Option<bool> {
        let routine = self.routines.find(RoutineKind::named(routine)?)?;
        let flags = routine.general.as_ref().map_or(routine.flags, |general| general.flags);
        Some(flags.into_iter().flatten().any(|flag| self.mask(flag, inputs).any()))
    }

    fn mask<T: Number>(&self, node: NodeId, inputs: &Inputs<'_, T>) -> T::Mask {
        Interpreter::new(&self.routines.graph, &[node]).masks(inputs)[0]
    }

    /// Lists what each routine costs on the ordinary path, and the Hessian if a point is pinned: total operations, and
    /// instructions with fused operations.
    #[must_use]
    pub fn counts(&self) -> String {
        let mut text = format!("{:<34} operations  instructions\n", self.name);
        let mut row = |name: &str, count: OperationCount| {
            writeln!(text, "  {name:<32} {:>10}  {:>12}", count.total(), count.instructions())
                .expect("writing to a string succeeds");
        };
        for (graph, routine) in self.routines.all() {
            row(routine.kind.name(), operations(&self.routines, graph, &routine.outputs()));
        }
        let hessian = self.routines.find(RoutineKind::Hessian);
        let Some([value, gradient, triangle]) = hessian.map(|routine| &routine.groups[..]) else { return text };
        let points = gradient.len() / 3;
        for pinned in 0..points {
            let mut outputs: Vec<NodeId> = value.clone();
            outputs.extend((0..3 * points).filter(|i| i / 3 != pinned).map(|i| gradient[i]));
            let pairs = (0..points).flat_map(|i| (i..points).map(move |j| (i, j)));
            for (_, block) in pairs.zip(triangle.chunks(9)).filter(|((i, j), _)| *i != pinned && *j != pinned) {
                outputs.extend(block);
            }
            row(&format!("hessian, point {pinned} pinned"), operations(&self.routines, &self.routines.graph, &outputs));
        }
        text
    }

    /// Lists the routes to the derivatives of each routine, with their operations on the ordinary path in reduced
    /// coordinates. The first one was taken. The last line has the steps and the memory of the compiler.
    #[must_use]
    pub fn plans(&self) -> String {
        let mut text = String::new();
        for routes in &self.routines.routes {
            writeln!(text, "{} {}", self.name, routes.routine).expect("writing to a string succeeds");
            let taken = routes.list.first().map_or(0, |route| route.cost);
            let least = routes.list.iter().map(|route| route.cost).min().unwrap_or(0);
            let width = routes.list.iter().map(|route| name_of(route).chars().count()).max().unwrap_or(0);
            for (place, route) in routes.list.iter().enumerate() {
                let why = match place {
                    0 if taken == least => "taken: costs least".to_owned(),
                    0 => "taken: none is shorter by a twentieth".to_owned(),
                    _ if route.cost == taken => "as cheap, but listed later".to_owned(),
                    _ => format!("costs {:.2}×", route.cost as f64 / taken as f64),
                };
                writeln!(
                    text,
                    "  {:<width$} cost {:>5}, {:>4} operations ({} fused, {} divisions and roots, {} transcendental, {} \
                     error terms)  {why}",
                    name_of(route),
                    route.cost,
                    route.count.total(),
                    route.count.fused,
                    route.count.divisions_and_roots,
                    route.count.transcendental,
                    route.count.error_terms,
                )
                .expect("writing to a string succeeds");
            }
        }
        let [before, after] = self.spent;
        let (steps, bytes) = (after.steps - before.steps, after.bytes - before.bytes);
        let megabytes = |bytes: u64| bytes as f64 / 1e6;
        writeln!(
            text,
            "{} took {} of {} steps to compile, and {:.1} of {:.0} MB",
            self.name,
            grouped(steps),
            grouped(after.limits.steps),
            megabytes(bytes),
            megabytes(after.limits.bytes)
        )
        .expect("writing to a string succeeds");
        text
    }
}

/// Returns the name of a route, and how many numbers its derivatives are gathered at.
fn name_of(route: &Route) -> String {
    let mut name = match route.gathered_at {
        None => route.name.to_owned(),
        Some(1) => format!("{} (1 number)", route.name),
        Some(count) => format!("{} ({count} numbers)", route.name),
    };
    if route.factored {
        name += ", factored";
    }
    if route.forms.spelled_out {
        name += ", inverses spelled out";
    }
    if route.forms.collapsed {
        name += ", lengths and powers collapsed";
    }
    name
}

/// Writes the code of a declaration to `folder/name.rs`.
///
/// # Errors
/// When the folder cannot be made or the file not be written; then no file stands under that name that was not there
/// before.
pub(crate) fn write_code(folder: &std::path::Path, name: &str, code: &TokenStream) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let unfinished = folder.join(format!(".{name}.{}.rs", std::process::id()));
    std::fs::write(&unfinished, layout(code))?;
    std::fs::rename(&unfinished, folder.join(format!("{name}.rs")))
}
