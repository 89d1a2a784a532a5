//! Looking at scenes and finished runs: what `cloth view` does, but for its window, which is in the feature `view`.
//!
//! [`Stage`] is what is shown and how time passes, [`Orbit`] the camera, [`pick`] finds the vertex under the mouse, [`Colouring`] what colours mean.
//! [`screenshot`] needs no display.

mod colouring;
mod grip;
mod orbit;
mod picking;
mod screenshot;
mod stage;
mod viewer;
#[cfg(feature = "view")]
mod window;

pub use colouring::{Colouring, RestShape, colour, stored_energies, upper_end};
pub use orbit::{Orbit, Ray, Seen};
pub use picking::{Picked, pick};
pub use screenshot::{Screenshot, screenshot};
pub use stage::{Moment, Stage, ViewError};
pub use viewer::{Button, Command, HELP, Input, Viewer};
#[cfg(feature = "view")]
pub use window::open_window;
