//! Colours of surfaces in the light of the lamp, of the surroundings, and of a weaker light at the eye.

use energy_dsl::Vector3;

use crate::geometry::{dot, norm};

/// A colour in the dark and in full light.
pub(super) type Colours = [[f32; 3]; 2];

/// Direction from the cloth to the lamp.
pub(super) const LAMP: Vector3<f64> = [-0.25, -0.45, 1.0];

/// Returns the unit vector towards the lamp.
pub(super) fn towards_lamp() -> Vector3<f64> {
    LAMP.map(|component| component / norm(LAMP))
}

/// Returns a colour in shade and in light.
pub(super) fn lit(colour: [f32; 3]) -> Colours {
    [colour.map(|channel| 0.35 * channel), colour]
}

/// Returns the colours of the two sides of cloth of a colour; the back is paler, also in the dark.
pub(super) fn sides(colour: [f32; 3]) -> [Colours; 2] {
    let pale = colour.map(|channel| 0.5 * channel + 0.42);
    [(colour, 0.2), (pale, 0.42)].map(|(colour, dark)| [colour.map(|channel| dark * channel), colour])
}

pub(super) fn mixed([dark, bright]: &Colours, brightness: f64) -> [f32; 3] {
    std::array::from_fn(|channel| dark[channel] + brightness as f32 * (bright[channel] - dark[channel]))
}

/// Returns the brightness from the lamp, a weaker light at the eye, the sky and the floor below, and a sheen at grazing
/// angles. The last argument holds the visible parts of the lamp and of the surroundings.
pub(super) fn shade(normal: Vector3<f64>, lamp: Vector3<f64>, eye: Vector3<f64>, [sunlit, open]: [f64; 2]) -> f64 {
    let facing = dot(normal, eye).clamp(0.0, 1.0);
    let grazing = (1.0 - facing) * (1.0 - facing) * (1.0 - facing);
    let around = 0.10 + 0.20 * facing * facing + 0.14 * (0.5 + 0.5 * normal[2]) + 0.16 * grazing;
    (0.70 * sunlit * dot(normal, lamp).max(0.0) + (0.25 + 0.75 * open) * around).min(1.0)
}
