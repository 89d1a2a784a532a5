use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use anyhow::Result;
use clap::Args;
use cloth_core::run::Record;
use cloth_core::scene::Scene;
use cloth_core::survey::{Survey, SurveyOptions};
use energy_cli::{Interrupts, tell};

use super::allowed_folders::AllowedFolders;
use super::{positive, print, progress_bar};

#[derive(Debug, Args)]
pub struct Measure {
    /// Folder of a finished run, scene file (simulated to its end; nothing is written), or OBJ file.
    measured: PathBuf,
    /// Radius of the disc in Cusick's drape, in m; default: 0.6 of the specimen's.
    #[arg(long, value_name = "R", value_parser = positive)]
    disc: Option<f64>,
    /// Radius of the flat specimen, in m; default: that of a circle with the area at rest.
    #[arg(long, value_name = "R", value_parser = positive)]
    specimen: Option<f64>,
    /// Rise of the outline from which a maximum counts as a node, in m; default: 0.02 of the specimen's radius.
    #[arg(long, value_name = "D", value_parser = positive)]
    prominence: Option<f64>,
    /// A point on the axis of the disc, in m; default: the centroid of the shadow.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    centre: Option<Point>,
    /// The garment to measure; default: all.
    #[arg(long, value_name = "NAME")]
    garment: Option<String>,
    /// Two pins (`pin 0`) or groups of pins, by name, whose distance is the extension; default: the only two.
    #[arg(long, num_args = 2, value_names = ["PIN", "PIN"])]
    between: Option<Vec<String>>,
    /// Print everything that was measured as JSON, with all readings.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    allowed: AllowedFolders,
}

/// A point, in m.
#[derive(Clone, Copy, Debug)]
struct Point([f64; 3]);

impl Measure {
    pub fn run(self) -> Result<ExitCode> {
        let mut options = SurveyOptions::default();
        (options.drape.disc, options.drape.specimen) = (self.disc, self.specimen);
        (options.drape.prominence, options.drape.centre) = (self.prominence, self.centre.map(|Point(point)| point));
        options.garment.clone_from(&self.garment);
        options.between = self.between.as_deref().and_then(|pair| pair.to_vec().try_into().ok());
        let (survey, code) = self.survey(&options)?;
        let text = if self.json { serde_json::to_string_pretty(&survey)? } else { survey.to_string() };
        print(&format!("{text}\n"))?;
        Ok(code)
    }

    /// Measures what the path names. The exit code is that of a signal that ended the simulation early.
    fn survey(&self, options: &SurveyOptions) -> Result<(Survey, ExitCode)> {
        let path = &self.measured;
        if path.is_dir() {
            let record = Record::read(path)?;
            self.allowed.check(&record.scene, &record.path)?;
            return Ok((Survey::of_run(path, options)?, ExitCode::SUCCESS));
        }
        let is_mesh = Path::new(path).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj"));
        if is_mesh {
            return Ok((Survey::of_mesh(path, options)?, ExitCode::SUCCESS));
        }
        let text = Scene::text(path)?;
        self.allowed.check(&text, path)?;
        let scene = Scene::parse(&text, path)?;
        let (interrupts, bar) = (Interrupts::listen()?, progress_bar(scene.steps()));
        let is_stopped = || interrupts.flag().load(Ordering::Relaxed);
        let survey = Survey::of_scene(&scene, options, |simulation| {
            if simulation.steps_done() == 0 {
                simulation.warnings().iter().for_each(|warning| tell(&format!("warning: {warning}")));
            }
            bar.set_position(simulation.steps_done());
            !is_stopped()
        });
        bar.finish_and_clear();
        let survey = survey?;
        if is_stopped() {
            tell(&format!("stopped at t = {:.4} s of {} s", survey.time.unwrap_or(0.0), scene.duration));
            return Ok((survey, interrupts.exit_code()));
        }
        Ok((survey, ExitCode::SUCCESS))
    }
}

fn point(text: &str) -> Result<Point, String> {
    let numbers: Vec<f64> = text.split(',').map_while(|number| number.trim().parse().ok()).collect();
    match numbers[..] {
        [x, y, z] if numbers.iter().all(|number| number.is_finite()) => Ok(Point([x, y, z])),
        _ => Err("expected three numbers, such as 0,0,0.2".to_owned()),
    }
}
