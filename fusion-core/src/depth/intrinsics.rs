//! Cameras of recorded sequences: `intrinsics.json`, or a camera given by name or numbers.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::camera::Camera;
use super::distortion::{Distortion, DistortionCoefficients};

/// Contents of a sequence's `intrinsics.json`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "StoredInfo")]
pub struct SequenceInfo {
    /// The depth camera.
    #[serde(flatten)]
    pub camera: Camera,
    /// Steps of the images per metre.
    pub depth_scale: f64,
}

/// The keys of the file. Unknown ones are errors, which `flatten` would hide.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredInfo {
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    width: usize,
    height: usize,
    #[serde(default = "millimetres")]
    depth_scale: f64,
    distortion: Option<Distortion>,
}

impl From<StoredInfo> for SequenceInfo {
    fn from(stored: StoredInfo) -> Self {
        let StoredInfo { fx, fy, cx, cy, width, height, depth_scale, distortion } = stored;
        Self { camera: Camera { fx, fy, cx, cy, width, height, distortion }, depth_scale }
    }
}

fn millimetres() -> f64 {
    1000.0
}

impl SequenceInfo {
    /// Returns a description of an invalid parameter; `None` if all are valid.
    #[must_use]
    pub fn fault(&self) -> Option<&'static str> {
        let scale = self.depth_scale > 0.0 && self.depth_scale.is_finite();
        self.camera.fault().or((!scale).then_some("expected a `depth_scale` greater than 0"))
    }
}

/// A camera for a sequence without `intrinsics.json`, such as those that the TUM publishes. The size of the image is
/// that of the first one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GivenCamera {
    /// Focal lengths fx and fy, in pixels.
    pub focal: [f64; 2],
    /// Principal point cx and cy, in pixels.
    pub centre: [f64; 2],
    /// Distortion of the lens; `None` for a pinhole.
    pub distortion: Option<Distortion>,
    /// Steps of the images per metre.
    pub depth_scale: f64,
}

impl GivenCamera {
    /// Steps per metre of the TUM's depth images.
    pub const TUM_SCALE: f64 = 5000.0;

    /// Returns the camera of images of this size.
    #[must_use]
    pub fn with_size(&self, width: usize, height: usize) -> SequenceInfo {
        let ([fx, fy], [cx, cy]) = (self.focal, self.centre);
        let camera = Camera { fx, fy, cx, cy, width, height, distortion: self.distortion };
        SequenceInfo { camera, depth_scale: self.depth_scale }
    }
}

/// A name that is unknown, or numbers that do not describe a camera.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected `fx,fy,cx,cy` in pixels, or one of freiburg1, freiburg2, freiburg3, got `{0}`")]
#[non_exhaustive]
pub struct CameraNameError(String);

/// Calibration of the colour cameras, to which the TUM's depth images are registered, from
/// <https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats>.
const PRESETS: [(&str, [f64; 4], [f64; 5]); 3] = [
    ("freiburg1", [517.3, 516.5, 318.6, 255.3], [0.2624, -0.9531, -0.0054, 0.0026, 1.1633]),
    ("freiburg2", [520.9, 521.0, 325.1, 249.7], [0.2312, -0.7849, -0.0033, -0.0001, 0.9172]),
    ("freiburg3", [535.4, 539.2, 320.1, 247.6], [0.0; 5]),
];

impl FromStr for GivenCamera {
    type Err = CameraNameError;

    /// Parses `fx,fy,cx,cy`, or the name of a TUM camera. The depth scale is the TUM's.
    fn from_str(text: &str) -> Result<Self, CameraNameError> {
        if let Some((_, numbers, [k1, k2, p1, p2, k3])) = PRESETS.iter().find(|(name, ..)| *name == text) {
            let (k1, k2, p1, p2, k3) = (*k1, *k2, *p1, *p2, *k3);
            let coefficients = DistortionCoefficients { k1, k2, p1, p2, k3, ..DistortionCoefficients::default() };
            let distorted = coefficients != DistortionCoefficients::default();
            return Ok(Self { distortion: distorted.then(|| coefficients.into()), ..pinhole(*numbers) });
        }
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[fx, fy, cx, cy]) => Ok(pinhole([fx, fy, cx, cy])),
            _ => Err(CameraNameError(text.to_owned())),
        }
    }
}

fn pinhole([fx, fy, cx, cy]: [f64; 4]) -> GivenCamera {
    GivenCamera { focal: [fx, fy], centre: [cx, cy], distortion: None, depth_scale: GivenCamera::TUM_SCALE }
}

#[cfg(test)]
mod tests {
    use super::super::pixel_rays::PixelRays;
    use super::*;

    #[test]
    fn every_preset_covers_its_image() {
        for (name, ..) in PRESETS {
            let camera = name.parse::<GivenCamera>().unwrap().with_size(640, 480).camera;
            assert!(PixelRays::new(camera).is_ok(), "{name}");
            assert_eq!(camera.distortion.is_none(), name == "freiburg3");
        }
    }

    #[test]
    fn cameras_are_four_numbers_or_a_name() {
        let camera = "525, 526,319.5,239.5".parse::<GivenCamera>().unwrap();
        assert_eq!((camera.focal, camera.centre, camera.depth_scale), ([525.0, 526.0], [319.5, 239.5], 5000.0));
        for wrong in ["freiburg4", "525,525,319.5", "525,525,319.5,239.5,0", ""] {
            let error = wrong.parse::<GivenCamera>().unwrap_err().to_string();
            assert!(error.contains("fx,fy,cx,cy") && error.contains(wrong), "{error}");
        }
    }
}
