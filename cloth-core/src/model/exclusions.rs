//! Resolves the exclusions of a scene, and finds vertices that are pinned in an obstacle.

use energy_dsl::Vector3;

use super::Part;
use crate::collision::{Exclusions, Members};
use crate::contact::Obstacle;
use crate::geometry::{Bounds, Hierarchy, norm, subtract};
use crate::scene::{ContactChoice, Exclusion};

/// An exclusion that is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum ExclusionError {
    /// A name belongs to nothing.
    #[error("exclude[{exclusion}]: nothing is called `{name}`; there are {}", .known.join(", "))]
    Name {
        /// Index of the exclusion, from 0.
        exclusion: usize,
        name: String,
        /// The existing names.
        known: Vec<String>,
    },
    /// A name belongs to a garment and to an obstacle.
    #[error("exclude[{exclusion}]: `{name}` is a garment and an obstacle; give one of them another name")]
    Ambiguous {
        /// Index of the exclusion, from 0.
        exclusion: usize,
        name: String,
    },
    /// There are too many names.
    #[error("exclude[{exclusion}]: all exclusions together have more than {} names", Exclusions::MOST_NAMES)]
    TooManyNames {
        /// Index of the exclusion, from 0.
        exclusion: usize,
    },
    /// The scene has no seam.
    #[error("exclude[{exclusion}]: `near_seams` needs a seam, but the scene has none")]
    NoSeam {
        /// Index of the exclusion, from 0.
        exclusion: usize,
    },
}

/// The parts of a scene that exclusions refer to.
pub(super) struct Referents<'a> {
    pub parts: &'a [Part],
    pub obstacles: &'a [Obstacle],
    /// The positions of cloth and hair at the start, in m.
    pub x: &'a [Vector3<f64>],
    /// Pairs of vertices that seams join.
    pub sewn: &'a [[usize; 2]],
}

impl Referents<'_> {
    /// Resolves the exclusions of a scene.
    pub fn exclusions(&self, descriptions: &[Exclusion]) -> Result<Exclusions, ExclusionError> {
        let mut exclusions = Exclusions::new(self.x.len(), self.obstacles.len());
        for (number, description) in descriptions.iter().enumerate() {
            match description {
                Exclusion::Between([one, other]) => {
                    let sets = [(&one[..], self.members(number, one)?), (&other[..], self.members(number, other)?)];
                    if !exclusions.add_sets(sets) {
                        return Err(ExclusionError::TooManyNames { exclusion: number });
                    }
                }
                Exclusion::CloserThan(distance) => exclusions.add_close(self.x, *distance, |_| true),
                Exclusion::NearSeams(distance) => {
                    let near = self.near_seams(*distance).ok_or(ExclusionError::NoSeam { exclusion: number })?;
                    exclusions.add_close(self.x, 2.0 * distance, |vertex| near[vertex]);
                }
            }
        }
        Ok(exclusions)
    }

    /// Returns warnings of exclusions that exclude nothing, because nothing of theirs collides anyway.
    pub fn without_effect(&self, descriptions: &[Exclusion], contact: ContactChoice) -> Vec<String> {
        let is_obstacle = |name: &String| self.obstacles.iter().any(|obstacle| obstacle.name == *name);
        let meets_obstacle = |exclusion: &Exclusion| match exclusion {
            Exclusion::Between(names) => names.iter().any(is_obstacle),
            Exclusion::CloserThan(_) | Exclusion::NearSeams(_) => false,
        };
        let reason = |exclusion: &Exclusion| match contact {
            ContactChoice::Off => Some("nothing collides with `contact = \"off\"`"),
            ContactChoice::Obstacles if !meets_obstacle(exclusion) => {
                Some("with `contact = \"obstacles\"`, cloth and hair collide with obstacles only")
            }
            ContactChoice::Obstacles | ContactChoice::On => None,
        };
        let reasons = descriptions.iter().enumerate().filter_map(|(number, one)| Some((number, reason(one)?)));
        reasons.map(|(number, reason)| format!("exclude[{number}] has no effect: {reason}")).collect()
    }

    /// Whether each vertex is near a seam; `None` without seams.
    fn near_seams(&self, distance: f64) -> Option<Vec<bool>> {
        let seams: Vec<Vector3<f64>> = self.sewn.iter().flatten().map(|&vertex| self.x[vertex]).collect();
        let tree = Hierarchy::new(&seams.iter().map(|seam| Bounds::of(&[*seam])).collect::<Vec<_>>());
        let squared = |x: &Vector3<f64>, seam: usize| norm(subtract(*x, seams[seam])).powi(2);
        let is_near = |x: &Vector3<f64>| {
            tree.nearest(*x, |seam| (squared(x, seam), ())).is_some_and(|(nearest, ())| nearest <= distance * distance)
        };
        (!seams.is_empty()).then(|| self.x.iter().map(is_near).collect())
    }

    /// Returns what a name stands for.
    fn members(&self, exclusion: usize, name: &str) -> Result<Members, ExclusionError> {
        let part = self.vertices(name);
        let obstacle = self.obstacles.iter().position(|obstacle| obstacle.name == name);
        match (part, obstacle) {
            (Some(vertices), None) => Ok(Members::Vertices(vertices)),
            (None, Some(number)) => Ok(Members::Obstacle(number)),
            (Some(_), Some(_)) => Err(ExclusionError::Ambiguous { exclusion, name: name.to_owned() }),
            (None, None) => Err(ExclusionError::Name { exclusion, name: name.to_owned(), known: self.names() }),
        }
    }

    /// Returns the vertices of a part, or of a group of its OBJ file.
    fn vertices(&self, name: &str) -> Option<Vec<usize>> {
        if let Some(part) = self.parts.iter().find(|part| part.name == name) {
            return Some(part.vertices.clone().collect());
        }
        self.parts.iter().find_map(|part| {
            let group = name.strip_prefix(&part.name)?.strip_prefix('/')?;
            Some(part.groups.get(group)?.iter().map(|vertex| part.vertices.start + vertex).collect())
        })
    }

    fn names(&self) -> Vec<String> {
        let groups = |part: &Part| part.groups.keys().map(|group| format!("{}/{group}", part.name)).collect::<Vec<_>>();
        let parts = self.parts.iter().flat_map(|part| std::iter::once(part.name.clone()).chain(groups(part)));
        parts.chain(self.obstacles.iter().map(|obstacle| obstacle.name.clone())).collect()
    }
}

/// Excludes pinned vertices that start within reach of an obstacle, or inside, from collisions with it.
pub(super) fn hold(exclusions: &mut Exclusions, obstacles: &[Obstacle], x: &[Vector3<f64>], is_pinned: &[bool]) {
    for (number, obstacle) in obstacles.iter().enumerate() {
        let solid = obstacle.at(0.0);
        let is_near = |vertex: &usize| solid.signed_distance(x[*vertex]) < obstacle.thickness;
        let held = (0..x.len()).filter(|&vertex| is_pinned[vertex]).filter(is_near);
        held.for_each(|vertex| exclusions.attach(vertex, number));
    }
}
