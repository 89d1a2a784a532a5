//! Numbers for a lab: forces of pins, strain of garments, and the drape coefficient.

mod drape;
mod outline;
mod reading;
mod shadow;
mod strain;

pub use drape::{Drape, DrapeError, DrapeOptions};
pub use outline::Outline;
pub use reading::{Measurements, PinReading, Reading};
pub use shadow::Shadow;
pub use strain::{Distribution, Strain, StrainGauge};
