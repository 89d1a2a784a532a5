use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use fusion_core::skeleton::BoneNoise;

use super::evaluate::{Evaluate, summary};
use super::print;
use super::render::Render;
use super::track::Track;

/// Options of `fusion demo`.
#[derive(Debug, Args)]
pub struct Demo {
    /// Output folder; replaces the files of an earlier demonstration.
    #[arg(short, long, default_value = "out/fusion")]
    output: PathBuf,
    /// Frames to track, at 30 Hz.
    #[arg(long, default_value_t = 60, value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    frames: usize,
}

impl Demo {
    pub fn run(&self) -> Result<()> {
        audit()?;
        let runs = [
            ("exact bones", BoneNoise::default(), false),
            ("noisy bones", BoneNoise { turn: 5.0_f64.to_radians(), shift: 0.02 }, true),
        ];
        let mut rows = Vec::new();
        for (name, noise, unknown_bones) in runs {
            print(&format!("{name}:\n"))?;
            let folder = self.output.join(name.replace(' ', "-"));
            let (recording, track) = (folder.join("recording"), folder.join("track"));
            Render::figure(self.frames, noise, &recording).run()?;
            Track::of(&recording, unknown_bones, &track).run()?;
            rows.push((name, Evaluate::of(&recording, &track).run()?));
            print("\n")?;
        }
        let table: Vec<(String, &_)> = rows
            .iter()
            .flat_map(|(name, one)| {
                [(format!("{name}, tracked"), &one.track), (format!("{name}, skeleton alone"), &one.skeleton)]
            })
            .collect();
        let table: Vec<(&str, &_)> = table.iter().map(|(name, errors)| (name.as_str(), *errors)).collect();
        print(&format!("{}\n", summary(&table)))
    }
}

/// Compares the derivatives of every term with dual numbers and finite differences.
#[cfg(feature = "audit")]
fn audit() -> Result<()> {
    use energy_dsl::AnyElement;
    use energy_elements::{Binding, BlendedPoint4, BoneBinding, GraphEdge, NonrigidPlane4, SkeletonPlane};
    use verify::audit::{Options, Target, audit_all, describe_failure};

    // The declared residuals of the demonstration's energy.
    const TERMS: &[AnyElement] = &[
        AnyElement::of::<NonrigidPlane4<f64>>(),
        AnyElement::of::<GraphEdge<f64>>(),
        AnyElement::of::<Binding<f64>>(),
        AnyElement::of::<BoneBinding<f64>>(),
        AnyElement::of::<SkeletonPlane<f64>>(),
        AnyElement::of::<BlendedPoint4<f64>>(),
    ];
    let options = Options { samples: 50, ..Options::default() };
    let targets: Vec<Target> = TERMS.iter().map(Target::of_element).collect();
    let report = audit_all(&targets, None, options);
    if !report.passed() {
        let failures: Vec<String> = report.failures().map(describe_failure).collect();
        anyhow::bail!("the audit failed; nothing was tracked\n{}", failures.join("\n"));
    }
    print(&format!("audit of {} terms on {} random inputs each: passed\n\n", TERMS.len(), options.samples))
}

#[cfg(not(feature = "audit"))]
fn audit() -> Result<()> {
    print("audit skipped: built without the feature `audit`\n\n")
}
