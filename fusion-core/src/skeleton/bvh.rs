use std::path::{Path, PathBuf};

use energy_files::excerpt;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

/// The largest file, in bytes: hours of motion at 30 Hz.
const LARGEST_FILE: u64 = 256 << 20;
/// The largest number in a file, in degrees or its unit of length. Products of larger ones may overflow.
const LARGEST_NUMBER: f64 = 1e9;

/// A file that is not a BVH motion.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BvhError {
    /// The file cannot be read.
    #[error("cannot read {}", .path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is malformed.
    #[error("{}:{line}: {message}", .path.display())]
    Malformed {
        /// Path of the file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Description of the error.
        message: String,
    },
}

/// The meaning of one number of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Channel {
    Shift(usize),
    Turn(usize),
}

/// A joint of the hierarchy.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name of the joint.
    pub name: String,
    /// Index of the parent; `None` for the root.
    pub parent: Option<usize>,
    /// Position relative to the parent, in the file's unit.
    pub offset: Vector3<f64>,
    channels: Vec<Channel>,
}

/// A motion in Biovision's format: a hierarchy of joints, and the numbers of their channels for each frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    /// Joints, parents first.
    pub joints: Vec<Joint>,
    /// End sites: the joint, and the position relative to it.
    pub ends: Vec<(usize, Vector3<f64>)>,
    /// Seconds per frame.
    pub frame_time: f64,
    /// The numbers of all frames, one frame after the other.
    numbers: Vec<f64>,
    frame_count: usize,
}

impl Bvh {
    /// Reads a file.
    ///
    /// # Errors
    /// If the file cannot be read, or is malformed; the error has the line.
    pub fn read(path: &Path) -> Result<Self, BvhError> {
        let text = energy_files::read_text(path, LARGEST_FILE)
            .map_err(|source| BvhError::Unreadable { path: path.to_owned(), source })?;
        Self::parse(&text).map_err(|(line, message)| BvhError::Malformed {
            path: path.to_owned(),
            line: line + 1,
            message,
        })
    }

    /// Parses a text. An error has its line, from 0.
    fn parse(text: &str) -> Result<Self, (usize, String)> {
        let lines: Vec<&str> = text.lines().collect();
        let mut at = 0;
        let (joints, ends) = hierarchy(&lines, &mut at)?;
        let value = |at: usize, key: &str| -> Result<f64, (usize, String)> {
            let rest = lines.get(at).and_then(|line| line.trim().strip_prefix(key));
            let number = rest.and_then(|rest| finite(rest.trim()).ok());
            number.ok_or_else(|| (at, format!("expected `{key}` and a finite number")))
        };
        let count = value(at, "Frames:")?;
        let frame_time = value(at + 1, "Frame Time:")?;
        if frame_time <= 0.0 {
            return Err((at + 1, "expected a frame time greater than 0".into()));
        }
        let channels: usize = joints.iter().map(|joint| joint.channels.len()).sum();
        let (mut numbers, mut frame_count) = (Vec::new(), 0_usize);
        for (number, line) in lines.iter().enumerate().skip(at + 2).filter(|(_, line)| !line.trim().is_empty()) {
            let start = numbers.len();
            for word in line.split_whitespace() {
                numbers.push(finite(word).map_err(|message| (number, message))?);
            }
            let found = numbers.len() - start;
            if found != channels {
                return Err((number, format!("expected {channels} numbers, one per channel, got {found}")));
            }
            frame_count += 1;
        }
        if frame_count as f64 != count {
            return Err((lines.len(), format!("expected {count:?} frames, got {frame_count}")));
        }
        Ok(Self { joints, ends, frame_time, numbers, frame_count })
    }

    /// Returns the number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frame_count
    }

    /// Returns position and rotation of each joint in a frame, in the file's unit; `None` past the last frame.
    #[must_use]
    pub fn pose(&self, frame: usize) -> Option<Vec<Isometry3<f64>>> {
        let channels = self.numbers.len() / self.frame_count.max(1);
        let mut numbers = self.numbers.get(frame.checked_mul(channels)?..)?.get(..channels)?.iter();
        if frame >= self.frame_count {
            return None;
        }
        let mut pose: Vec<Isometry3<f64>> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let (mut shift, mut rotation) = (joint.offset, UnitQuaternion::identity());
            for (channel, &number) in joint.channels.iter().zip(numbers.by_ref()) {
                match *channel {
                    Channel::Shift(axis) => shift[axis] += number,
                    Channel::Turn(axis) => {
                        let mut turn = Vector3::zeros();
                        turn[axis] = number.to_radians();
                        rotation *= UnitQuaternion::from_scaled_axis(turn);
                    }
                }
            }
            let own = Isometry3::from_parts(Translation3::from(shift), rotation);
            pose.push(joint.parent.map_or(own, |parent| pose[parent] * own));
        }
        Some(pose)
    }
}

type Ends = Vec<(usize, Vector3<f64>)>;

/// Parses the joints between `HIERARCHY` and `MOTION`.
fn hierarchy(lines: &[&str], at: &mut usize) -> Result<(Vec<Joint>, Ends), (usize, String)> {
    let (mut joints, mut ends): (Vec<Joint>, Ends) = (Vec::new(), Vec::new());
    // Stack of open braces: joints, or `None` for an end site.
    let mut open: Vec<Option<usize>> = Vec::new();
    let mut next: Option<usize> = None;
    while let Some(line) = lines.get(*at) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let wrong = |message: &str| (*at, message.to_owned());
        match words.as_slice() {
            [] | ["HIERARCHY"] => {}
            ["MOTION"] if open.is_empty() && !joints.is_empty() => {
                *at += 1;
                return Ok((joints, ends));
            }
            ["ROOT" | "JOINT", name @ ..] if !name.is_empty() => {
                let parent = open.last().copied().flatten();
                if parent.is_none() && !joints.is_empty() {
                    return Err(wrong("expected one root, and joints inside it"));
                }
                next = Some(joints.len());
                joints.push(Joint { name: name.join(" "), parent, offset: Vector3::zeros(), channels: Vec::new() });
            }
            ["End", "Site"] => next = None,
            ["{"] => open.push(next.take()),
            ["}"] => {
                open.pop().ok_or_else(|| wrong("a `}` too many"))?;
            }
            ["OFFSET", numbers @ ..] => {
                let numbers: Result<Vec<f64>, String> = numbers.iter().take(4).map(|word| finite(word)).collect();
                let numbers = numbers.map_err(|message| wrong(&message))?;
                let &[x, y, z] = numbers.as_slice() else { return Err(wrong("expected three numbers after OFFSET")) };
                match open.as_slice() {
                    [.., Some(joint)] => joints[*joint].offset = Vector3::new(x, y, z),
                    [.., Some(joint), None] => ends.push((*joint, Vector3::new(x, y, z))),
                    _ => return Err(wrong("OFFSET outside a joint")),
                }
            }
            ["CHANNELS", count, names @ ..] => {
                let joint = open.last().copied().flatten().ok_or_else(|| wrong("channels outside of a joint"))?;
                let channels: Option<Vec<Channel>> = names.iter().map(|name| channel(name)).collect();
                let channels = channels.ok_or_else(|| wrong("channels are Xposition, …, Zrotation"))?;
                if count.parse() != Ok(channels.len()) {
                    return Err(wrong("the number of channels differs from the number of their names"));
                }
                joints[joint].channels = channels;
            }
            _ => return Err(wrong("expected JOINT, End Site, OFFSET, CHANNELS, a brace or MOTION")),
        }
        *at += 1;
    }
    Err((*at, "the file ends before MOTION".into()))
}

/// Parses a number that is neither infinite, nor NaN, nor too large to compute with.
fn finite(word: &str) -> Result<f64, String> {
    let number = word.parse::<f64>().map_err(|_| format!("expected a number, got `{}`", excerpt(word)))?;
    let fits = number.abs() <= LARGEST_NUMBER;
    if fits { Ok(number) } else { Err(format!("expected a number up to {LARGEST_NUMBER:e}, got `{}`", excerpt(word))) }
}

fn channel(name: &str) -> Option<Channel> {
    let axis = "XYZ".find(name.get(..1)?)?;
    match &name[1..] {
        "position" => Some(Channel::Shift(axis)),
        "rotation" => Some(Channel::Turn(axis)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: &str = "HIERARCHY
ROOT Shoulder
{
  OFFSET 1 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT Elbow
  {
    OFFSET 0 2 0
    CHANNELS 3 Zrotation Yrotation Xrotation
    End Site
    {
      OFFSET 0 3 0
    }
  }
}
MOTION
Frames: 2
Frame Time: .01
0 0 0 0 0 0 0 0 0
5 0 0 90 0 0 -90 0 0
";

    #[test]
    fn joints_rotate_their_descendants() {
        let bvh = Bvh::parse(ARM).unwrap();
        assert_eq!((bvh.frames(), bvh.joints.len(), bvh.ends[0].0), (2, 2, 1));
        let pose = bvh.pose(1).unwrap();
        // The upper arm points to −x, the lower one up again.
        assert!((pose[1].translation.vector - Vector3::new(4.0, 0.0, 0.0)).norm() < 1e-12);
        let hand = pose[1].transform_point(&bvh.ends[0].1.into()).coords;
        assert!((hand - Vector3::new(4.0, 3.0, 0.0)).norm() < 1e-12);
        assert!(bvh.pose(2).is_none());
    }

    #[test]
    fn mistakes_are_reported_with_their_line() {
        for (from, to, line) in [
            ("Frames: 2", "Frames: 3", 20),
            ("-90 0 0", "-90 0", 19),
            ("-90 0 0", "-90 0 nan", 19),
            ("-90 0 0", "-90 0 1e308", 19),
            ("OFFSET 0 2 0", "OFFSET 0 inf 0", 7),
            ("OFFSET 0 2 0", "OFFSET nan nan nan", 7),
            ("OFFSET 0 3 0", "OFFSET 0 -1e308 0", 11),
            ("Frames: 2", "Frames: nan", 16),
            ("Frame Time: .01", "Frame Time: inf", 17),
            ("OFFSET 0 2 0", "OFFSET 0 2", 7),
            ("CHANNELS 3 Z", "CHANNELS 3 W", 8),
            ("CHANNELS 3", "CHANNELS 2", 8),
            ("Frame Time: .01", "Frame Time: 0", 17),
        ] {
            let (found, message) = Bvh::parse(&ARM.replacen(from, to, 1)).unwrap_err();
            assert_eq!(found, line, "{to}: {message}");
        }
        assert!(Bvh::parse("HIERARCHY\nROOT a\n{\n").is_err());
        assert!(Bvh::parse("").is_err());
    }
}
