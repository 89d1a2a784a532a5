//! Renders a moving figure as a depth camera sees it and tracks three frames:
//! `cargo run -p fusion-core --example track`.

use fusion_core::body::{figure, figure_motion};
use fusion_core::depth::{Camera, SensorNoise};
use fusion_core::evaluation::{ErrorSummary, FrameErrors};
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::protocol::Recording;
use fusion_core::tracker::{Tracker, TrackerOptions};

const FRAMES: usize = 3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let motions: Vec<_> = (0..=FRAMES).map(|frame| figure_motion(frame as f64 / 30.0)).collect();
    let recording = Recording::new(&figure(), &motions, Camera::VGA, 2.6);
    let model = DeformationModel::new(&recording.body, ModelOptions::default())?;
    let mut tracker = Tracker::new(model, recording.camera, TrackerOptions::default())?;
    for frame in 1..=FRAMES {
        tracker.track(&recording.image(frame, SensorNoise::default()), Some(&recording.motions[frame]))?;
        let truth = recording.truth(frame).vertices;
        let errors = FrameErrors::new(&tracker.vertices(), &truth, &vec![true; truth.len()]);
        let median = ErrorSummary::of(errors.all).median;
        println!("frame {frame}: median error {median:.2} mm");
        assert!(median < 3.0);
    }
    Ok(())
}
