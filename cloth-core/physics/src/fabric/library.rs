//! Measured fabrics, as tables for scene files, each with its source.

/// A measured fabric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeasuredFabric {
    /// The name in scene files.
    pub name: &'static str,
    /// The table `[fabric]` of a scene file, with the source of its values as a comment.
    pub table: &'static str,
}

/// All measured fabrics.
///
/// ```
/// use cloth_physics::fabric::MEASURED;
/// let denim = MEASURED.iter().find(|fabric| fabric.name == "denim").unwrap();
/// assert!(denim.table.contains("Wang, O'Brien and Ramamoorthi"));
/// ```
pub const MEASURED: [MeasuredFabric; 10] = [
    MeasuredFabric { name: "denim", table: include_str!("measured/denim.toml") },
    MeasuredFabric { name: "interlock", table: include_str!("measured/interlock.toml") },
    MeasuredFabric { name: "ribbon", table: include_str!("measured/ribbon.toml") },
    MeasuredFabric { name: "dots", table: include_str!("measured/dots.toml") },
    MeasuredFabric { name: "ponte", table: include_str!("measured/ponte.toml") },
    MeasuredFabric { name: "rib", table: include_str!("measured/rib.toml") },
    MeasuredFabric { name: "sweat", table: include_str!("measured/sweat.toml") },
    MeasuredFabric { name: "swim", table: include_str!("measured/swim.toml") },
    MeasuredFabric { name: "jacket", table: include_str!("measured/jacket.toml") },
    MeasuredFabric { name: "target", table: include_str!("measured/target.toml") },
];
