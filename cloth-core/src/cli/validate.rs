use anyhow::Result;
use clap::Args;
use clap::builder::PossibleValuesParser;
use cloth_core::validate::{self, Cantilever, Finding, LateralBuckling, MeshKind, ValidateError};

use super::{positive, print};

#[derive(Debug, Args)]
pub struct Validate {
    /// `cantilever`, `buckling`, `catenary`, `hanging-strip`, `modes`, `rods`, `orders`, `momentum`, `contact`,
    /// `long-run`; default: all.
    #[arg(value_parser = PossibleValuesParser::new(validate::QUESTIONS))]
    questions: Vec<String>,
    /// Use coarser meshes and fewer cases; takes a few seconds.
    #[arg(long)]
    quick: bool,
    /// Run a single cantilever with this Γ = σ g L³/D; with `buckling`, a single strip on edge.
    #[arg(long, value_parser = positive)]
    gamma: Option<f64>,
    /// Poisson's ratio of the plate.
    #[arg(long, value_parser = poisson_ratio)]
    nu: Option<f64>,
    /// Width over length.
    #[arg(long, value_parser = positive)]
    aspect: Option<f64>,
    /// Kind of mesh.
    #[arg(long)]
    mesh: Option<MeshKind>,
    /// Angle between mesh and strip, in degrees.
    #[arg(long, allow_negative_numbers = true)]
    orientation: Option<f64>,
    /// Edges along the strip.
    #[arg(long, value_parser = clap::value_parser!(u16).range(4..))]
    segments: Option<u16>,
}

impl Validate {
    pub fn run(&self) -> Result<()> {
        if self.is_single_case() {
            print_findings(|report| self.single_case().map(|finding| report(&finding)))
        } else {
            print_findings(|report| validate::ask(&self.questions, self.quick, report).map(drop))
        }
    }

    fn is_single_case(&self) -> bool {
        let Self { gamma, nu, aspect, mesh, orientation, segments, .. } = self;
        let numbers = [gamma, nu, aspect, orientation];
        numbers.iter().any(|number| number.is_some()) || mesh.is_some() || segments.is_some()
    }

    fn single_case(&self) -> Result<Finding, ValidateError> {
        let (poisson_ratio, aspect) = (self.nu.unwrap_or(0.0), self.aspect.unwrap_or(0.1));
        let (mesh, orientation) = (self.mesh.unwrap_or(MeshKind::Diagonal), self.orientation.unwrap_or(0.0));
        let segments = usize::from(self.segments.unwrap_or(if self.quick { 40 } else { 80 }));
        if self.questions.iter().any(|question| question == "buckling") {
            LateralBuckling { poisson_ratio, aspect, mesh, orientation, segments }.ask()
        } else {
            let gamma = self.gamma.unwrap_or(1.0);
            Cantilever { gamma, poisson_ratio, aspect, mesh, orientation, segments }.ask()
        }
    }
}

/// Prints each finding as it is made. Returns an error if one of them failed.
fn print_findings(ask: impl FnOnce(&mut dyn FnMut(&Finding)) -> Result<(), ValidateError>) -> Result<()> {
    print(&format!("{}\n", validate::head()))?;
    let (mut missed, mut all) = (0, 0);
    ask(&mut |finding| {
        all += 1;
        missed += usize::from(!finding.passed());
        // Keep validating if the reader closes the pipe: the exit code still matters.
        let _ = print(&format!("{}\n", validate::line(finding)));
    })?;
    print(&format!("{} of {all} answers within their limits\n", all - missed))?;
    anyhow::ensure!(missed == 0, "{missed} of {all} answers are outside their limits");
    Ok(())
}

fn poisson_ratio(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|x: &f64| x.abs() < 1.0);
    number.ok_or_else(|| "expected a number between −1 and 1".to_owned())
}
