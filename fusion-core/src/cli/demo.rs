use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use energy_cli::Interrupts;
use fusion_core::skeleton::BoneNoise;

use super::evaluate::{Evaluate, summary};
use super::print;
use super::render::Render;
use super::session::{Ended, begin};
use super::track::Track;

/// The largest number of frames of a demonstration: half an hour.
const MOST_FRAMES: u64 = 54_000;

/// Options of `fusion demo`.
#[derive(Debug, Args)]
pub struct Demo {
    /// Output folder; replaces the files of an earlier demonstration.
    #[arg(short, long, default_value = "out/fusion")]
    output: PathBuf,
    /// Frames to track, at 30 Hz.
    #[arg(long, default_value_t = 60, value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=MOST_FRAMES))]
    frames: usize,
}

impl Demo {
    /// Renders, tracks and evaluates.
    pub fn run(&self, interrupts: &Interrupts) -> Result<Ended> {
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
            Render::figure(self.frames, noise, &recording).run_until(interrupts.flag())?;
            if begin(&Track::of(&recording, unknown_bones, &track), interrupts)? == Ended::Stopped {
                return Ok(Ended::Stopped);
            }
            rows.push((name, Evaluate::of(&recording, &track).run()?));
            // Nine tenths of the files, which can be computed again.
            for meshes in [recording.join("truth"), track.join("meshes")] {
                remove_meshes(&meshes)?;
            }
            print("\n")?;
        }
        let table: Vec<(String, &_)> = rows
            .iter()
            .flat_map(|(name, one)| {
                [(format!("{name}, tracked"), &one.track), (format!("{name}, skeleton alone"), &one.skeleton)]
            })
            .collect();
        let table: Vec<(&str, &_)> = table.iter().map(|(name, errors)| (name.as_str(), *errors)).collect();
        print(&format!("{}\n\n{EXPLANATION}", summary(&table)))?;
        Ok(Ended::Complete)
    }
}

const EXPLANATION: &str = "\
tracked         the body that follows depth images and bones
skeleton alone  the model skinned by the reported bones, without depth images

The truth is the model skinned by the true bones. Exact bones alone therefore have no error, and tracking
can only add some: a fraction of the sensor's noise. Noisy bones are what body trackers report; there,
tracking corrects the skeleton.

The meshes of truth and track were removed after the evaluation; `fusion render` and `fusion track` write
them again. Pictures are in errors.html next to each table.
";

/// Removes the meshes that the demonstration has written, and their folder.
fn remove_meshes(folder: &Path) -> Result<()> {
    let here = || format!("cannot remove the meshes of {}", folder.display());
    for entry in std::fs::read_dir(folder).with_context(here)? {
        let path = entry.with_context(here)?.path();
        if path.extension().is_some_and(|extension| extension == "obj") {
            std::fs::remove_file(&path).with_context(here)?;
        }
    }
    // Files of others remain, and so does their folder.
    let _ = std::fs::remove_dir(folder);
    Ok(())
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
