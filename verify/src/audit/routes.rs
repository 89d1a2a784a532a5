//! Comparison of the routes to each block: generated code, multi-precision, dual numbers, finite differences.

use super::accuracy::{amplification, in_roundoffs};
use super::auditor::{Auditor, Finding};
use super::cases::Case;
use super::entry::entry_name;
use super::report::{Accuracy, Check, StepCurve};
use crate::blocks::{Answer, Block, BlockName, NoAnswer, largest};
use crate::finite_difference::{Sweep, antiderivative, sweep};

/// A block as computed by one route.
struct Route<'a> {
    name: String,
    numbers: &'a [f64],
    /// Relative error of the route at an ordinary input.
    uncertainty: f64,
    /// The check that compares the route with the code; `None` if another does.
    check: Option<Check>,
}

impl Auditor<'_> {
    /// Compares each block with all routes to it. Returns the errors of the differences against their steps.
    pub(super) fn routes(
        &mut self,
        case: &Case<'_>,
        answer: &Answer,
        accuracy: &mut Vec<Accuracy>,
    ) -> Result<Vec<StepCurve>, NoAnswer> {
        let mut curves = Vec::new();
        for block in &answer.blocks {
            let differences = self.differences(case, block)?;
            self.count_differences(block.name, differences.is_some());
            if let Some((lower, sweep)) = &differences {
                let (block, of) = (block.name, *lower);
                curves.push(StepCurve { block, of, errors: relative(&sweep.curve, answer.block(block).largest()) });
            }
            self.compare_all(case, answer, block, differences.as_ref());
            self.measure(case, answer, block, accuracy);
        }
        Ok(curves)
    }

    /// Returns the differences whose inputs are all on the side of the sample; `None` if no step is small enough for
    /// that, or if the block is not a derivative.
    fn differences(&self, case: &Case<'_>, block: &Block) -> Result<Option<(BlockName, Sweep)>, NoAnswer> {
        let Some((lower, stepped)) = antiderivative(block.name, self.declaration.kind) else { return Ok(None) };
        let length = self.length(&case.sample, stepped);
        let here = self.subject.branches(&case.sample);
        let found = sweep(
            self.declaration,
            &case.sample,
            stepped,
            length,
            (block.name, &block.numbers),
            |moved| self.subject.lower_block(lower, moved),
            |moved| {
                (here.is_empty() || self.subject.branches(moved) == here)
                    && !(case.is_bounded && self.subject.is_outside(moved))
            },
        )?;
        Ok(found.map(|found| (lower, found)))
    }

    fn compare_all(
        &mut self,
        case: &Case<'_>,
        answer: &Answer,
        block: &Block,
        differences: Option<&(BlockName, Sweep)>,
    ) {
        let digits: Option<Vec<f64>> = case
            .truth(block.name)
            .filter(|t| t.is_defined)
            .map(|t| t.block.numbers.iter().map(|x| x.to_f64()).collect());
        let mut routes =
            vec![Route { name: "generated code".into(), numbers: &block.numbers, uncertainty: 0.0, check: None }];
        if let Some(digits) = &digits {
            routes.push(Route { name: "multi-precision".into(), numbers: digits, uncertainty: 0.0, check: None });
        }
        let dual = self.subject.tolerance(Check::DualNumbers);
        // If the formula as written is 0/0, dual numbers have no value to compare a limit with.
        let numbers = &case.dual(block.name).numbers;
        if !numbers.iter().any(|number| number.is_nan()) {
            routes.push(Route {
                name: "dual numbers".into(),
                numbers,
                uncertainty: dual,
                check: Some(Check::DualNumbers),
            });
        }
        if let Some((lower, sweep)) = differences {
            routes.push(Route {
                name: format!("differences of `{lower}` (step {:.1e})", sweep.step),
                numbers: &sweep.best,
                uncertainty: self.subject.tolerance(Check::FiniteDifferences),
                check: Some(Check::FiniteDifferences),
            });
        }
        let scale = routes.iter().map(|route| largest(route.numbers)).fold(0.0, f64::max);
        let scale = scale.max(self.natural_size(&case.sample, answer, block.name));
        let vanishes = routes.iter().filter(|route| route.check != Some(Check::FiniteDifferences));
        let scale = match vanishes.map(|route| largest(route.numbers)).fold(0.0, f64::max) {
            0.0 => {
                // If derivatives of all orders vanish, as at the minimum of x⁴, differences still fall with their steps.
                let of_long_steps = differences.map_or(0.0, |(_, sweep)| sweep.largest_deviation());
                scale.max(self.size_of_derivatives(&case.sample, answer, block.name)).max(of_long_steps)
            }
            _ => scale,
        };
        let order = differences.and_then(|(_, sweep)| sweep.order);
        for route in &routes[1..] {
            let Some(check) = route.check else { continue };
            let (entry, error) = distance(&block.numbers, route.numbers);
            let declaration = self.declaration;
            let order = if check == Check::FiniteDifferences { order } else { None };
            let finding = Finding {
                check,
                block: block.name,
                error: if scale == 0.0 { 0.0 * error } else { error / scale },
                order,
                sample: &case.sample,
            };
            self.record(&finding, || {
                let values: Vec<String> =
                    routes.iter().map(|r| format!("{} {:.17e}", r.name, r.numbers[entry])).collect();
                format!(
                    "  entry {}: {}\n  {}\n  at{}",
                    entry_name(declaration, block, entry),
                    values.join(", "),
                    verdict(&routes, scale),
                    case.sample.describe(declaration)
                )
            });
        }
    }

    /// Measures the error in units of roundoff, and divided by κ.
    fn measure(&mut self, case: &Case<'_>, answer: &Answer, block: &Block, accuracy: &mut Vec<Accuracy>) {
        let Some(truth) = case.truth(block.name).filter(|truth| truth.is_defined) else { return };
        let natural = self.natural_size(&case.sample, answer, block.name);
        let error = in_roundoffs(truth, &block.numbers, natural);
        let at = accuracy.iter().position(|a| a.block == block.name).unwrap_or_else(|| {
            accuracy.push(Accuracy::new(block.name));
            accuracy.len() - 1
        });
        let line = &mut accuracy[at];
        line.inputs += 1;
        let entry = || entry_name(self.declaration, block, truth.worst_entry(&block.numbers));
        if line.input.is_none() || error > line.worst || error.is_nan() {
            (line.worst, line.entry, line.input) = (error, entry(), Some(case.sample.clone()));
        }
        // κ is at least 1: compute it only if the error without it is the worst so far.
        let by_kappa = if error > line.worst_kappa || error.is_nan() {
            error / amplification(self.subject, &case.sample, answer, block.name).max(1.0)
        } else {
            0.0
        };
        if line.input_kappa.is_none() || by_kappa > line.worst_kappa || by_kappa.is_nan() {
            (line.worst_kappa, line.input_kappa) = (by_kappa, Some(case.sample.clone()));
        }
        let finding =
            Finding { check: Check::Accuracy, block: block.name, error: by_kappa, order: None, sample: &case.sample };
        let declaration = self.declaration;
        self.record(&finding, || {
            let worst = truth.worst_entry(&block.numbers);
            format!(
                "  entry {}: generated code {:.17e}, multi-precision {}\n  at{}",
                entry_name(declaration, block, worst),
                block.numbers[worst],
                truth.block.numbers[worst].to_decimal(DIGITS_SHOWN),
                case.sample.describe(declaration)
            )
        });
    }
}

const DIGITS_SHOWN: usize = 25;

fn relative(curve: &[(f64, f64, f64)], size: f64) -> Vec<(f64, f64, f64)> {
    let size = if size > 0.0 { size } else { 1.0 };
    curve.iter().map(|(step, plain, extrapolated)| (*step, plain / size, extrapolated / size)).collect()
}

/// Returns the largest difference and its position.
fn distance(a: &[f64], b: &[f64]) -> (usize, f64) {
    let errors = a.iter().zip(b).map(|(x, y)| (x - y).abs()).enumerate();
    errors.fold((0, 0.0_f64), |worst, next| if next.1 > worst.1 || next.1.is_nan() { next } else { worst })
}

/// Names the routes that agree, and so the one to suspect. Multi-precision is taken as right; without it, the majority.
fn verdict(routes: &[Route<'_>], scale: f64) -> String {
    let agree = |a: &Route<'_>, b: &Route<'_>| {
        let allowed = a.uncertainty.max(b.uncertainty).max(1e-10) * scale;
        distance(a.numbers, b.numbers).1 <= allowed
    };
    let mut camps: Vec<Vec<&Route<'_>>> = Vec::new();
    for route in routes {
        match camps.iter_mut().find(|camp| camp.iter().any(|other| agree(other, route))) {
            Some(camp) => camp.push(route),
            None => camps.push(vec![route]),
        }
    }
    let names = |camp: &[&Route<'_>]| camp.iter().map(|r| r.name.as_str()).collect::<Vec<_>>().join(", ");
    if camps.len() == 1 {
        return "all routes agree to within what each can tell".into();
    }
    let is_true = |camp: &Vec<&Route<'_>>| camp.iter().any(|r| r.name == "multi-precision");
    let believed = camps.iter().position(is_true).or_else(|| {
        let most = camps.iter().map(Vec::len).max()?;
        let largest: Vec<usize> = (0..camps.len()).filter(|&i| camps[i].len() == most).collect();
        (largest.len() == 1).then(|| largest[0])
    });
    match believed {
        Some(believed) => {
            let others: Vec<String> = (0..camps.len()).filter(|&i| i != believed).map(|i| names(&camps[i])).collect();
            let with = names(&camps[believed]);
            format!("wrong: {}; in agreement: {with}", others.join(", and otherwise "))
        }
        None => format!("no two routes agree: {}", names(&routes.iter().collect::<Vec<_>>())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn route(name: &str, numbers: &'static [f64], uncertainty: f64) -> Route<'static> {
        Route { name: name.into(), numbers, uncertainty, check: None }
    }

    #[test]
    fn the_odd_one_out_is_named() {
        let routes = [
            route("generated code", &[1.0, 2.0], 0.0),
            route("multi-precision", &[1.0, 2.0], 0.0),
            route("dual numbers", &[1.0, 2.5], 1e-9),
            route("differences of `energy`", &[1.0, 2.000_000_01], 2e-7),
        ];
        assert_eq!(
            verdict(&routes, 2.0),
            "wrong: dual numbers; in agreement: generated code, multi-precision, differences of `energy`"
        );
        let tie = [route("generated code", &[1.0], 0.0), route("dual numbers", &[2.0], 1e-9)];
        assert!(verdict(&tie, 2.0).starts_with("no two routes agree"));
    }
}
