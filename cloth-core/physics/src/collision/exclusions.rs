use std::collections::{BTreeMap, BTreeSet};

use energy_dsl::Vector3;
use energy_solve::index;

use super::CollisionMesh;
use crate::geometry::{Bounds, Hierarchy, norm, subtract};

/// Pairs of features that do not collide: those that the scene excludes, and parts that are pinned in an obstacle.
#[derive(Clone, Debug, Default)]
pub struct Exclusions {
    /// Vertices that are attached to an obstacle, with its index. Their features do not collide with it.
    attached: BTreeSet<(u32, usize)>,
    /// The named sets of each vertex of cloth and hair, one bit each. Empty if no set is excluded.
    own: Vec<u64>,
    /// The same for each obstacle.
    obstacles: Vec<u64>,
    /// Pairs of sets whose features do not collide.
    sets: Vec<[u64; 2]>,
    /// Pairs of vertices whose features do not collide, the smaller first.
    vertices: BTreeSet<[u32; 2]>,
    /// The bit of each name.
    names: BTreeMap<String, u64>,
}

/// Members of a named set.
pub enum Members {
    /// Vertices of cloth or hair.
    Vertices(Vec<usize>),
    /// An obstacle, by its index.
    Obstacle(usize),
}

impl Exclusions {
    /// The largest number of names.
    pub const MOST_NAMES: usize = 64;

    /// Creates the exclusions of a model, which exclude nothing yet.
    pub fn new(vertices: usize, obstacles: usize) -> Self {
        Self { own: vec![0; vertices], obstacles: vec![0; obstacles], ..Self::default() }
    }

    /// Excludes pairs of features in which one has a vertex of the first set and the other one of the second. Returns
    /// `false`, and changes nothing, if there are too many names.
    ///
    /// If a pair collides, so do the pairs of vertices and edges of its features: a pair is certified by these.
    #[must_use]
    pub fn add_sets(&mut self, sets: [(&str, Members); 2]) -> bool {
        let new: BTreeSet<&str> = sets.iter().map(|(name, _)| *name).collect();
        let new = new.into_iter().filter(|name| !self.names.contains_key(*name)).count();
        if self.names.len() + new > Self::MOST_NAMES {
            return false;
        }
        let bits = sets.map(|(name, members)| self.set(name, members));
        self.sets.push(bits);
        true
    }

    /// Returns the bit of a set.
    fn set(&mut self, name: &str, members: Members) -> u64 {
        let number = self.names.len();
        let bit = *self.names.entry(name.to_owned()).or_insert_with(|| 1 << number);
        match members {
            Members::Vertices(vertices) => vertices.into_iter().for_each(|vertex| self.own[vertex] |= bit),
            Members::Obstacle(number) => self.obstacles[number] |= bit,
        }
        bit
    }

    /// Excludes pairs of features with vertices of cloth or hair that are closer than `distance` at x, in m. Only
    /// vertices that `counts` accepts matter.
    pub fn add_close(&mut self, x: &[Vector3<f64>], distance: f64, counts: impl Fn(usize) -> bool) {
        let some: Vec<usize> = (0..x.len()).filter(|&vertex| counts(vertex)).collect();
        let around: Vec<Bounds> =
            some.iter().map(|&vertex| Bounds::of(&[x[vertex]]).extended(0.5 * distance)).collect();
        Hierarchy::new(&around).overlaps_within([[0, 0]], |one, other| {
            let (a, b) = (some[one], some[other]);
            if norm(subtract(x[a], x[b])) < distance {
                self.vertices.insert([index(a.min(b)), index(a.max(b))]);
            }
        });
    }

    /// Excludes the features of a vertex that an obstacle holds from collisions with it.
    pub fn attach(&mut self, vertex: usize, obstacle: usize) {
        self.attached.insert((index(vertex), obstacle));
    }

    /// Returns the exclusions among some vertices, with their new numbers.
    pub fn restricted(&self, local: &[Option<usize>], vertices: usize) -> Self {
        let mut own = vec![0; vertices];
        for (sets, new) in self.own.iter().zip(local) {
            if let Some(new) = new {
                own[*new] = *sets;
            }
        }
        let new = |vertex: u32| local[vertex as usize].map(index);
        let renumbered = |&[a, b]: &[u32; 2]| Some([new(a)?, new(b)?]).map(|[a, b]| [a.min(b), a.max(b)]);
        let vertices = self.vertices.iter().filter_map(renumbered).collect();
        let attached = self.attached.iter().filter_map(|&(vertex, obstacle)| Some((new(vertex)?, obstacle))).collect();
        let (obstacles, sets) = (self.obstacles.clone(), self.sets.clone());
        Self { attached, own, obstacles, sets, vertices, names: BTreeMap::new() }
    }

    /// Whether a pair of features does not collide.
    pub fn exclude(&self, mesh: &CollisionMesh, a: &[u32], b: &[u32]) -> bool {
        self.are_attached(mesh, a, b) || self.exclude_sets(mesh, a, b) || self.exclude_vertices(a, b)
    }

    /// Whether one of two features is an obstacle's that holds a vertex of the other.
    fn are_attached(&self, mesh: &CollisionMesh, a: &[u32], b: &[u32]) -> bool {
        if self.attached.is_empty() {
            return false;
        }
        let attaches = |obstacle: Option<usize>, other: &[u32]| {
            obstacle.is_some_and(|obstacle| other.iter().any(|vertex| self.attached.contains(&(*vertex, obstacle))))
        };
        attaches(mesh.obstacle(a[0]), b) || attaches(mesh.obstacle(b[0]), a)
    }

    fn exclude_sets(&self, mesh: &CollisionMesh, a: &[u32], b: &[u32]) -> bool {
        if self.sets.is_empty() {
            return false;
        }
        let sets_at = |&vertex: &u32| match mesh.obstacle(vertex) {
            Some(obstacle) => self.obstacles[obstacle],
            None => self.own[vertex as usize],
        };
        let [a, b] = [a, b].map(|feature| feature.iter().map(sets_at).fold(0, |any, sets| any | sets));
        self.sets.iter().any(|[one, other]| (a & one != 0 && b & other != 0) || (b & one != 0 && a & other != 0))
    }

    fn exclude_vertices(&self, a: &[u32], b: &[u32]) -> bool {
        let is_pair = |&p: &u32, &q: &u32| self.vertices.contains(&[p.min(q), p.max(q)]);
        !self.vertices.is_empty() && a.iter().any(|p| b.iter().any(|q| is_pair(p, q)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_that_collides_has_no_part_that_does_not() {
        // A strip of four triangles; the first three vertices are the collar. A triangle is above it.
        let triangles = [[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 5], [6, 7, 8]];
        let mesh = CollisionMesh::new(9, &triangles, &[], &[]);
        let mut exclusions = Exclusions::new(9, 0);
        let members = |range: std::ops::Range<usize>| Members::Vertices(range.collect());
        assert!(exclusions.add_sets([("collar", members(0..3)), ("body", members(6..9))]));
        let is_excluded = |feature: &[u32]| exclusions.exclude(&mesh, feature, &[6, 7, 8]);
        let excluded = |features: &[[u32; 3]]| features.iter().map(|one| is_excluded(one)).collect::<Vec<_>>();
        assert_eq!(excluded(&mesh.triangles()[..4]), [true, true, true, false]);
        for triangle in &mesh.triangles()[..4] {
            for part in [&triangle[..1], &triangle[1..2], &triangle[2..], &triangle[..2], &triangle[1..]] {
                assert!(is_excluded(triangle) || !is_excluded(part), "{triangle:?} {part:?}");
            }
        }
    }

    #[test]
    fn all_names_can_be_used_again() {
        let mut exclusions = Exclusions::new(1, 0);
        let names: Vec<String> = (0..=Exclusions::MOST_NAMES).map(|number| number.to_string()).collect();
        let mut add = |one: usize, other: usize| {
            exclusions.add_sets([one, other].map(|name| (&names[name][..], Members::Vertices(vec![0]))))
        };
        for name in 0..Exclusions::MOST_NAMES {
            assert!(add(name, name), "{name}");
        }
        assert!(!add(0, Exclusions::MOST_NAMES) && add(0, Exclusions::MOST_NAMES - 1));
    }
}
