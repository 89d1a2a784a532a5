//! The tests of the public interface, one module a subject. One program links once and shares all cores.
#![allow(missing_docs)]

mod command_line;
mod damping;
mod deforming_obstacles;
mod drills;
mod endings;
mod exclusions;
mod exported_garment;
mod folders;
mod frame_rates;
mod hostile_folders;
mod hostile_scenes;
mod known_answers;
mod lab;
mod limits;
mod linear_solvers;
mod local_elimination;
mod mesh_obstacle;
mod motion;
mod moving_obstacles;
mod obstacles;
mod other_programs;
mod plate;
mod random_contact;
mod random_impacts;
mod random_mixtures;
mod runs;
mod scenes;
mod schema;
mod self_contact;
mod sleep;
mod stress;
mod threads;
mod untangling;
mod view;
mod yarns;
