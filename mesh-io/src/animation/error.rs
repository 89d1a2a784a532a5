/// An animation that cannot be encoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnimationError {
    /// The file exceeds 4 GiB, the limit of binary glTF.
    #[error("the animation would take {bytes} bytes, but a .glb file holds less than 4 GiB; write fewer frames")]
    TooLarge {
        /// The size it would have, in bytes.
        bytes: usize,
    },
    /// A frame has no time.
    #[error("{name} has {frames} frames, but the animation has {times} times")]
    MissingTimes {
        /// Name of the mesh.
        name: String,
        /// Number of its frames.
        frames: usize,
        /// Number of times.
        times: usize,
    },
    /// A time is not finite, or not later than the one before in single precision.
    #[error("time {number} of the animation is {time} s, which is not later than the time before it")]
    Times {
        /// Number of the time, from 0.
        number: usize,
        /// The time, in s.
        time: f64,
    },
    /// A frame has another number of vertices than the first.
    #[error("frame {frame} of {name} has {vertices} positions and {normals} normals, unlike the first frame")]
    Unlike {
        /// Name of the mesh.
        name: String,
        /// The frame, from 0.
        frame: usize,
        /// Number of positions in this frame.
        vertices: usize,
        /// Number of normals in this frame.
        normals: usize,
    },
    /// An element has a vertex that does not exist.
    #[error("{name} has {vertices} vertices, but an element has vertex {vertex}")]
    Vertex {
        /// Name of the mesh.
        name: String,
        /// The vertex, from 0.
        vertex: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// The JSON part cannot be written.
    #[error("cannot encode the JSON part of the animation")]
    Json(#[from] gltf_json::Error),
}
