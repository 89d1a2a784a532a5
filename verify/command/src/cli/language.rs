//! Languages and precisions of generated code, as arguments.

use clap::ValueEnum;
use energy_compiler::{Precision, Target};

/// A language to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Language {
    /// C99, which is also C++17.
    C,
    /// The same, in files that end in .cpp.
    Cpp,
    /// CUDA C++: functions for host and device, and kernels with one element a thread.
    Cuda,
    /// A Python module of functions for kernels of Warp, with adjoints.
    Warp,
}

impl Language {
    pub(super) const fn target(self) -> Target {
        match self {
            Self::C => Target::C,
            Self::Cpp => Target::Cpp,
            Self::Cuda => Target::Cuda,
            Self::Warp => Target::Warp,
        }
    }
}

/// The numbers to write for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Numbers {
    F64,
    F32,
    Both,
}

impl Numbers {
    pub(super) const fn list(self) -> &'static [Precision] {
        match self {
            Self::F64 => &[Precision::Double],
            Self::F32 => &[Precision::Single],
            Self::Both => &[Precision::Double, Precision::Single],
        }
    }
}
