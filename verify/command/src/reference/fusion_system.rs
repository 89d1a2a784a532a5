//! A complete system of body tracking against multi-precision values, assembled and solved by `energy-solve`.

use std::sync::Arc;

use energy_elements::{Binding, GraphEdge, NonrigidPlane4};
use energy_solve::{Couplings, GaussNewton, GaussNewtonOptions, LeastSquaresTerm, Pattern, Placed, ResidualTerm};
use serde_json::Value;

use super::fusion::{Case, Lines, bound_place, fixed, numbers, weights};

/// The three terms of the system.
struct Terms {
    data: ResidualTerm<NonrigidPlane4, 6>,
    graph: ResidualTerm<GraphEdge, 6>,
    binding: ResidualTerm<Binding, 6>,
    pattern: Arc<Pattern>,
}

/// system: r, JᵀJ, Jᵀr, the pattern of blocks, the step, and the energy after it.
pub(super) fn system(case: &Case<'_>, lines: &mut Lines) -> Result<(), String> {
    const BOUND: f64 = 1e-12;
    let x = case.twists()?;
    let terms = Terms::new(case, x.len())?;
    let all: [&dyn LeastSquaresTerm<6>; 3] = [&terms.data, &terms.graph, &terms.binding];
    let fail = |error: &dyn std::fmt::Display| error.to_string();
    let mut solver = GaussNewton::new(terms.pattern.clone(), GaussNewtonOptions::default()).map_err(|e| fail(&e))?;
    let costs = solver.linearise(&all, &x).map_err(|e| fail(&e))?;
    let mut compare = |name: &str, found: &[f64]| lines.compare(case, (name, 0.0, BOUND), found, case.out(name)?);

    let mut residuals = weighted(&terms.data, &x);
    residuals.extend(weighted(&terms.graph, &x));
    residuals.extend(weighted(&terms.binding, &x));
    compare("r", &residuals)?;
    for (name, cost) in ["E_n", "E_g", "E_b"].into_iter().zip(&costs) {
        compare(name, &[cost.energy])?;
    }
    let energy: f64 = costs.iter().map(|cost| cost.energy).sum();
    compare("E", &[energy])?;
    let right = solver.equations().right.as_flattened();
    compare("Jtr", right)?;
    compare("gradE", &right.iter().map(|entry| 2.0 * entry).collect::<Vec<f64>>())?;
    let matrix = &solver.equations().matrix;
    let size = x.len();
    let mut dense = Vec::with_capacity(36 * size * size);
    for row in 0..size {
        for i in 0..6 {
            (0..size).for_each(|column| dense.extend(matrix.block(row, column)[i]));
        }
    }
    compare("JtJ", &dense)?;
    let (step, _) = solver.solve(case.number("mu")?).map_err(|e| fail(&e))?;
    compare("step", step.as_flattened())?;
    compare("predicted_decrease", &[solver.predicted_decrease(&step)])?;
    let after: Vec<[f64; 6]> = x.iter().zip(&step).map(|(x, d)| std::array::from_fn(|i| x[i] + d[i])).collect();
    let energy_after = all.iter().map(|term| term.energy(&after).energy).sum();

    // Its error is the error of the step times the slope of the energy.
    let truth = case.out("E_after_full_step")?;
    lines.compare(case, ("E_after_full_step", 0.0, 10.0 * BOUND), &[energy_after], truth)?;

    let coupled = |row: usize, column: usize| terms.pattern.slot(row, column).is_some();
    let pattern: Vec<f64> = (0..size * size).map(|at| f64::from(u8::from(coupled(at / size, at % size)))).collect();
    lines.exact(case, "block_pattern", numbers(case.out("block_pattern")?)? == pattern);
    lines.exact(case, "rows", numbers(case.out("rows")?)? == [residuals.len() as f64]);
    Ok(())
}

/// Returns the residuals of a term times the square roots of their weights.
fn weighted<E>(term: &ResidualTerm<E, 6>, x: &[[f64; 6]]) -> Vec<f64>
where
    E: energy_dsl::PackedResidual<f64> + std::fmt::Debug,
{
    let residuals = term.residuals(x);
    let rows = residuals.len() / LeastSquaresTerm::<6>::len(term).max(1);
    residuals.iter().enumerate().map(|(at, r)| r * term.weight(at / rows).sqrt()).collect()
}

impl Terms {
    fn new(case: &Case<'_>, nodes: usize) -> Result<Self, String> {
        let turn = case.turn()?;
        let vertices = case.field("verts")?.as_array().ok_or("`verts` is no list")?;
        let ids: Vec<[u32; 4]> = vertices.iter().map(|vertex| indices(&vertex["ids"])).collect::<Result<_, _>>()?;
        let graph = case.field("graph")?.as_array().ok_or("`graph` is no list")?;
        let mut edges: Vec<[u32; 2]> = Vec::new();
        for (i, around) in graph.iter().enumerate() {
            edges.extend(numbers(around)?.iter().map(|&j| [i as u32, j as u32]));
        }
        let own: Vec<[u32; 1]> = (0..nodes as u32).map(|node| [node]).collect();
        let stencils = ids.iter().map(<[u32; 4]>::as_slice).chain(edges.iter().map(<[u32; 2]>::as_slice));
        let pattern = Arc::new(Couplings::pattern(nodes, stencils).map_err(|error| error.to_string())?);
        let lambda = |name: &str| -> Result<f64, String> {
            numbers(&case.field("lambda")?[name])?.first().copied().ok_or_else(|| format!("`lambda.{name}` is empty"))
        };
        let mut data = ResidualTerm::new("nonrigid", coupled(&pattern, &ids)?, lambda("n")?);
        let mut elements = Vec::new();
        for (at, vertex) in vertices.iter().enumerate() {
            let vector = |name: &str| fixed::<3>(&numbers(&vertex[name])?, name);
            let w = fixed::<4>(&numbers(&vertex["w"])?, "w")?;
            let element = NonrigidPlane4::new(turn, w, vector("v")?, vector("n")?, vector("u")?);
            elements.push(Placed { element, stencil: at as u32, weight: 1.0 });
        }
        data.set_elements(elements);

        let places = case.numbers("node_x")?;
        let place = |node: usize| -> [f64; 3] { std::array::from_fn(|axis| places[3 * node + axis]) };
        let rows = case.numbers("H")?;
        let bones = rows.len() / nodes;
        let attachment = |node: usize| &rows[bones * node..][..bones];
        let mode = case.field("psi_mode")?.as_str().unwrap_or_default();
        let delta = case.number("delta")?;
        let mut graph_term = ResidualTerm::new("graph", coupled(&pattern, &edges)?, lambda("g")?);
        let mut elements = Vec::new();
        for (at, &[i, j]) in edges.iter().enumerate() {
            let (a, b) = (attachment(i as usize), attachment(j as usize));
            let s = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
            let psi = weights(s, delta).into_iter().find(|(name, _)| *name == mode);
            let (_, weight) = psi.ok_or_else(|| format!("unknown psi_mode `{mode}`"))?;
            let element = GraphEdge::new(turn, place(j as usize));
            elements.push(Placed { element, stencil: at as u32, weight });
        }
        graph_term.set_elements(elements);

        let motions = case.numbers("Tb")?;
        let mut binding = ResidualTerm::new("binding", coupled(&pattern, &own)?, lambda("b")?);
        binding.set_elements((0..nodes).map(|node| {
            let x = place(node);
            let target = bound_place(&motions, attachment(node), &x);
            Placed { element: Binding::new(turn, x, target), stencil: node as u32, weight: 1.0 }
        }));
        Ok(Self { data, graph: graph_term, binding, pattern })
    }
}

fn coupled<const K: usize>(pattern: &Pattern, stencils: &[[u32; K]]) -> Result<Arc<Couplings>, String> {
    Couplings::new(pattern, stencils).map(Arc::new).map_err(|error| error.to_string())
}

fn indices<const K: usize>(value: &Value) -> Result<[u32; K], String> {
    Ok(fixed::<K>(&numbers(value)?, "ids")?.map(|id| id as u32))
}
