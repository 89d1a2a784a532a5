//! Evaluates many elements on all cores, each thread with its own part of the outputs:
//! `cargo run --release -p energy-dsl --example threads`.

use energy_dsl::{BatchError, Flagged, Packed, energy};
use rayon::prelude::*;

energy! {
    energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) = "k/2 (‖p − q‖ − L)²";
}

/// Numbers per spring: 2 points, 3 blocks of 9 numbers in the triangle.
const GRADIENT: usize = 6;
const TRIANGLE: usize = 27;

fn main() -> Result<(), BatchError> {
    // A wavy chain, in single precision. All works the same in `f64`.
    let vertices = 10_000;
    let positions: Vec<[f32; 3]> = (0..vertices).map(|i| [i as f32, (0.1 * i as f32).sin(), 0.0]).collect();
    let springs: Vec<Spring<f32>> = (1..vertices).map(|_| Spring::new(100.0, 1.0)).collect();
    let stencils: Vec<[u32; 2]> = (1..vertices).map(|i| [i as u32 - 1, i as u32]).collect();
    let packed = Packed::new(&springs, &stencils);

    let count = packed.len();
    let (mut energies, mut gradients, mut triangles) =
        (vec![0.0; count], vec![0.0; GRADIENT * count], vec![0.0; TRIANGLE * count]);
    // Ranges start at whole blocks of elements; a range and its chunks of the outputs belong together.
    let part = packed.chunk_len(4 * rayon::current_num_threads());
    let flagged: Vec<Flagged> = energies
        .par_chunks_mut(part)
        .zip(gradients.par_chunks_mut(GRADIENT * part))
        .zip(triangles.par_chunks_mut(TRIANGLE * part))
        .enumerate()
        .map(|(number, ((energies, gradients), triangles))| {
            let start = number * part;
            packed.hessians(start..start + energies.len(), &positions, energies, gradients, triangles)
        })
        .collect::<Result<_, _>>()?;

    // The same bits as on one thread.
    let mut alone = vec![0.0; count];
    packed.values(0..count, &positions, &mut alone)?;
    assert_eq!(energies, alone);
    let total: f64 = energies.iter().map(|&energy| f64::from(energy)).sum();
    println!("{count} springs, {} flagged, {total:.3} J", flagged.concat().len());
    Ok(())
}
