//! Tracking of a deforming body in depth images.
//!
//! A [`model::DeformationModel`] has nodes on a mesh. Each node moves by a twist, and vertices move by the dual
//! quaternion blend of their nodes. [`energy::FusionEnergy`] sums the declared residuals of `energy-elements`, E = λ_n
//! E_nonrigid + λ_s E_skeleton + λ_g E_graph + λ_b E_binding, with generated Jacobians. A [`tracker::Tracker`]
//! minimises it by Gauss–Newton (`energy-solve`), image after image.
//!
//! Units are metres and radians.
//!
//! ```
//! use fusion_core::body::{figure, figure_motion};
//! use fusion_core::depth::{Camera, SensorNoise};
//! use fusion_core::evaluation::{ErrorSummary, FrameErrors};
//! use fusion_core::model::{DeformationModel, ModelOptions};
//! use fusion_core::protocol::Recording;
//! use fusion_core::tracker::{Tracker, TrackerOptions};
//!
//! // A figure of tubes in front of a depth camera, 1/30 s after it started to move.
//! let motions: Vec<_> = [0.0, 1.0 / 30.0].map(figure_motion).to_vec();
//! let recording = Recording::new(&figure(), &motions, Camera::VGA, 2.6);
//! let model = DeformationModel::new(&recording.body, ModelOptions::default())?;
//! let mut tracker = Tracker::new(model, recording.camera, TrackerOptions::default())?;
//! let image = recording.image(1, SensorNoise::default());
//! tracker.track(&image, Some(&recording.motions[1]))?;
//!
//! let truth = recording.truth(1).vertices;
//! let errors = FrameErrors::new(&tracker.vertices(), &truth, &vec![true; truth.len()]);
//! assert!(ErrorSummary::of(errors.all).median < 2.0, "mm");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]
// The declared residuals keep the symbols of their sources.
#![allow(confusable_idents, mixed_script_confusables, uncommon_codepoints)]

pub mod animation;
pub mod body;
pub mod correspondence;
pub mod depth;
pub mod energy;
pub mod evaluation;
pub mod focal_length;
mod json_file;
pub mod model;
pub mod model_size;
mod option_error;
pub mod picture;
pub mod plot;
pub mod protocol;
mod random;
pub mod silhouette;
pub mod skeleton;
pub mod surface;
pub mod tracker;
pub mod twist;
pub mod usd;

pub use json_file::JsonFileError;
pub use option_error::OptionError;
