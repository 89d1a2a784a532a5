//! The tests of the public interface, one module a subject. One program links once and shares all cores.

mod attachments;
mod bad_input;
mod command_line;
mod drills;
mod figure;
mod gltf_files;
mod hostile_files;
mod inputs;
mod joints;
mod real_body;
mod resumed_tracks;
mod surface;
