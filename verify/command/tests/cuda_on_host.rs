//! Generated CUDA, device code and kernels alike, has the bits of Rust where a compiler of C++ runs it on the host.

use super::c::{Compiler, Loops, Suite, check, cuda_on_host, loops};

fn compiler() -> Compiler {
    let options = "-x c++ -std=c++17 -march=native -Wno-unused-function -include";
    Compiler::new(&format!("g++ {options} {}", cuda_on_host().display())).unoptimised()
}

#[test]
fn device_code_has_the_bits_of_rust() {
    check::<f64>(&compiler(), "cuda-on-host-f64", || Suite::of_points().sufficient());
    check::<f32>(&compiler(), "cuda-on-host-f32", || Suite::of_points().sufficient());
}

#[test]
fn kernels_have_the_bits_of_single_elements() {
    loops::<f64>("kernels-f64", 1, Loops::Kernels);
    loops::<f32>("kernels-f32", 4, Loops::Kernels);
}
