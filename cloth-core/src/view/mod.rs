//! Views of scenes and finished runs: everything of the program `cloth-window` except the window itself.
//!
//! - [`Stage`] holds the content and advances time.
//! - [`Orbit`] is the camera.
//! - [`pick`] finds the vertex under the mouse.
//! - [`Colouring`] maps quantities to colours.
//! - [`screenshot`] needs no display.

mod colouring;
mod grip;
mod orbit;
mod picking;
mod screenshot;
mod stage;
mod viewer;

pub use colouring::{Colouring, RestShape, colour, stored_energies, upper_end};
pub use orbit::{Orbit, Ray, Seen};
pub use picking::{Picked, pick};
pub use screenshot::{Screenshot, screenshot};
pub use stage::{Moment, Stage, ViewError};
pub use viewer::{Button, Command, HELP, Input, Viewer};
