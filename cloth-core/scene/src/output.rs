use schemars::JsonSchema;
use serde::Deserialize;

use super::style::{Style, Viewpoint};
use cloth_physics::bounded::{Angle, Channel, Colours, Counts, MaybeReals, Number, Real, Reals};

/// The files that a run writes. Keys that are not given keep their defaults.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OutputChoice {
    /// `cloth.png`, the last frame. Default true.
    pub picture: bool,
    /// `cloth.glb`, animated glTF. Default true.
    pub gltf: bool,
    /// `cloth.usda`, animated USD. Default true.
    pub usd: bool,
    /// `frames/cloth_0000.obj`, …. Default true.
    pub obj: bool,
    /// `frames/cloth_0000.ply`, …: binary, with velocities. Default false.
    pub ply: bool,
    /// `frames/cloth_0000.png`, …. Default false.
    pub png: bool,
    /// `caches/NAME.pc2`: a point cache of each garment and hair. Default false.
    pub pc2: bool,
    /// `caches/NAME.mdd`: a point cache of each garment and hair. Default false.
    pub mdd: bool,
    /// Velocities in the USD file, for motion blur. Default false.
    pub velocities: bool,
    /// Forces of certified contact at each vertex: `primvars:contactForce` in the USD file, and `fx`, `fy`, `fz` in PLY
    /// files. Default false.
    pub contact_forces: bool,
    /// `ledger.csv` and `ledger.svg`: energies, work and momenta at each step. Default true.
    pub ledger: bool,
    /// `measurements.csv`: force, moment and position of each pin, and strain of each garment, at each frame. Default
    /// true.
    pub measurements: bool,
    /// `cloth.apng`, an animated PNG of the pictures of frames, which are then written, too. Default false.
    pub apng: bool,
    /// `cloth.mp4`, a film of the pictures of frames, which are then written, too. Needs the program ffmpeg. Default
    /// false.
    pub mp4: bool,
    /// Width and height of pictures, in pixels. Default [1200, 1000].
    #[serde(with = "Counts::<16, 8192, 2>")]
    pub size: [usize; 2],
    /// Camera of pictures. Default: frames everything that is visible.
    pub camera: Option<CameraChoice>,
    /// RGB colour of the background of pictures, from 0 to 1, as screens show it. Default: a grey that darkens
    /// downwards.
    #[serde(with = "MaybeReals::<Channel, 3>")]
    pub background: Option<[f64; 3]>,
    /// RGB colours of the garments in their order, from 0 to 1, as screens show them. Default: those of the program,
    /// also for garments beyond the list.
    #[serde(with = "Colours")]
    pub colours: Vec<[f64; 3]>,
}

/// A camera for pictures.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CameraChoice {
    /// Position, in m.
    #[serde(with = "Reals::<Number, 3>")]
    pub eye: [f64; 3],
    /// The point in the middle of the picture, in m.
    #[serde(with = "Reals::<Number, 3>")]
    pub target: [f64; 3],
    /// Angle between the upper and the lower edge of the picture, in degrees. Default 30.
    #[serde(default = "usual_angle", with = "Real::<Angle>")]
    pub angle: f64,
}

fn usual_angle() -> f64 {
    30.0
}

impl OutputChoice {
    /// Whether pictures of all frames are drawn.
    #[must_use]
    pub fn has_frame_pictures(&self) -> bool {
        self.png || self.apng || self.mp4
    }

    /// Returns the size, camera and background of pictures.
    #[must_use]
    pub fn style(&self) -> Style {
        let viewpoint = self.camera.map(|CameraChoice { eye, target, angle }| Viewpoint { eye, target, angle });
        let background = self.background.map(|colour| colour.map(|channel| channel as f32));
        Style { size: self.size.map(|pixels| pixels as u32), viewpoint, background }
    }
}

impl Default for OutputChoice {
    fn default() -> Self {
        Self {
            picture: true,
            gltf: true,
            usd: true,
            obj: true,
            ply: false,
            png: false,
            pc2: false,
            mdd: false,
            velocities: false,
            contact_forces: false,
            ledger: true,
            measurements: true,
            apng: false,
            mp4: false,
            size: [1200, 1000],
            camera: None,
            background: None,
            colours: Vec::new(),
        }
    }
}
