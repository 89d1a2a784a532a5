//! The text of a tester's scene.

/// A scene without its fabric, in three parts: the keys of the scene, those of the garment, and the pins.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SceneText {
    pub head: String,
    pub mesh: String,
    pub tail: String,
}

impl SceneText {
    /// Returns the scene as TOML, without the fabric.
    pub(super) fn toml(&self) -> String {
        let Self { head, mesh, tail } = self;
        let output = "[output]\ngltf = false\nusd = false\nledger = false\n";
        format!("{head}{output}[[garment]]\nname = \"specimen\"\n{mesh}{tail}")
    }
}

/// A key of a motion: time in s, angle in degrees, translation in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Key {
    pub time: f64,
    pub angle: f64,
    pub translate: [f64; 3],
}

/// Creates a key without rotation.
pub(super) fn key(time: f64, translate: [f64; 3]) -> Key {
    Key { time, angle: 0.0, translate }
}

/// The motion of a pin.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Keys {
    pub axis: [f64; 3],
    pub centre: [f64; 3],
    /// Keys; empty for a pin that rests.
    pub keys: Vec<Key>,
}

impl Default for Keys {
    fn default() -> Self {
        Self { axis: [0.0, 0.0, 1.0], centre: [0.0; 3], keys: Vec::new() }
    }
}

impl Keys {
    pub(super) fn of(keys: Vec<Key>) -> Self {
        Self { keys, ..Self::default() }
    }

    /// Returns the keys of the table of a pin.
    pub(super) fn toml(&self) -> String {
        let Self { axis, centre, keys } = self;
        let one = |Key { time, angle, translate }: &Key| {
            format!("{{ time = {time:?}, angle = {angle:?}, translate = {translate:?} }}")
        };
        match keys.iter().map(one).collect::<Vec<_>>() {
            keys if keys.is_empty() => String::new(),
            keys => format!("motion = {{ axis = {axis:?}, centre = {centre:?}, keys = [{}] }}\n", keys.join(", ")),
        }
    }
}

/// Returns the table of a pin that holds what lies between two x, up to a width to either side. `motion` is that of
/// [`Keys::toml`].
pub(super) fn pin(name: &str, [low, high]: [f64; 2], side: f64, motion: &str) -> String {
    let corners = format!("min = [{low:?}, -{side:?}, -1e-3], max = [{high:?}, {side:?}, 1e-3]");
    format!("[[pins]]\nname = \"{name}\"\nbox = {{ {corners} }}\n{motion}")
}
