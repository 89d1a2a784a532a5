//! The demonstration: a sheet of cotton, horizontal at first, held by two corners.

use crate::scene::{Scene, SceneError};

/// The demonstration's scene; also in `scenes/hang.toml`.
pub const SCENE: &str = include_str!("../../scenes/hang.toml");

/// The scene.
///
/// # Errors
/// Never, unless the file was changed.
pub fn scene() -> Result<Scene, SceneError> {
    Scene::parse(SCENE, "scenes/hang.toml".as_ref())
}
