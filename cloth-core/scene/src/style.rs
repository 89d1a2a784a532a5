use energy_dsl::Vector3;

/// The size, camera and background of pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Width and height, in pixels.
    pub size: [u32; 2],
    /// The camera; `None` to frame everything that is visible.
    pub viewpoint: Option<Viewpoint>,
    /// RGB colour of the background, from 0 to 1, as screens show it; `None` for a grey that darkens downwards.
    pub background: Option<[f32; 3]>,
}

/// A camera in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewpoint {
    /// Position, in m.
    pub eye: Vector3<f64>,
    /// The point in the middle of the picture, in m.
    pub target: Vector3<f64>,
    /// Angle between the upper and the lower edge of the picture, in degrees.
    pub angle: f64,
}

impl Default for Style {
    fn default() -> Self {
        Self { size: [1200, 1000], viewpoint: None, background: None }
    }
}
