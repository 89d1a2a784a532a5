use super::lane::Lane;
use super::level::Level;
use super::real::Real;

/// `f32` or `f64`: a number that fills the registers of every SIMD level.
pub trait Float: Real + Lane<Self> + 'static {
    /// The widest register of a level.
    type Lanes<L: Level>: Lane<Self>;
}

impl Float for f64 {
    type Lanes<L: Level> = L::F64;
}

impl Float for f32 {
    type Lanes<L: Level> = L::F32;
}
