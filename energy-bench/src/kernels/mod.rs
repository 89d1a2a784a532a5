//! The five kernels. Each file contains random inputs, hand-derived code and the textbook formula over dual numbers.

mod hair_bend;
mod hinge;
mod point_to_plane;
mod spring;
mod stvk;

pub use hair_bend::HairBendKernel;
pub use hinge::HingeKernel;
pub use point_to_plane::PointToPlaneKernel;
pub use spring::SpringKernel;
pub use stvk::StVKKernel;

/// Calls a macro with every kernel's type.
#[macro_export]
macro_rules! for_each_kernel {
    ($call:path) => {{
        $call!($crate::kernels::SpringKernel);
        $call!($crate::kernels::HairBendKernel);
        $call!($crate::kernels::HingeKernel);
        $call!($crate::kernels::StVKKernel);
        $call!($crate::kernels::PointToPlaneKernel);
    }};
}
