//! Assembles a scene in three passes: parts and their meshes; islands; terms, pins and obstacles.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use energy_dsl::Vector3;
use energy_elements::ZeroLengthSpring;
use energy_solve::{DissipationTerm, DrivenTerm, ElementList, ListError, PotentialTerm, Term, index};

use super::closing_seam::ClosingSeam;
use super::exclusions::{self, ExclusionError, Referents};
use super::inflation::{self, PressureLaw};
use super::parts::{
    IslandModel, Model, ModelError, MovingPin, PairFrictionError, Part, PartKind, PinnedVertices, TermLabel,
    UnknownPart,
};
use super::seam::Side;
use super::soft_pin::{Held, SoftPinTerm};
use super::{PinError, SeamError, pins, seam};
use crate::Coulomb;
use crate::contact::AnySolid;
use crate::fabric::{self, Hair, Locking, StitchDamping, Surroundings, SystemPart};
use crate::geometry::{Pose, add_scaled, norm, subtract};
use crate::mesh::{CornerAttributes, DisjointSets, SpringNetwork, Topology, TriangleMesh};
use crate::motion::Motion;
use crate::scene::{ContactChoice, Garment, PairFriction, Pin, Scene, Seam, Shape, SoftPin};

/// A model under construction.
pub(super) struct Builder<'a> {
    scene: &'a Scene,
    /// The time, in s.
    time: f64,
    model: Model,
    /// Boundary vertices of all garments.
    edge: Vec<usize>,
    prefix_names: bool,
    pieces: Vec<Piece>,
    /// The spring network of each garment, for mass–spring fabrics.
    springs: Vec<SpringNetwork>,
    locations: Vec<Location>,
}

/// A connected component of a part, before seams join it to others.
struct Piece {
    part: usize,
    /// Its vertices, numbered within the part.
    vertices: Vec<usize>,
}

/// The location of a vertex: its island, and its index within the island.
#[derive(Clone, Copy, Default)]
struct Location {
    island: usize,
    index: usize,
}

/// Components of a garment with fewer vertices are grouped: the overhead of an island exceeds what its sleep saves.
const SMALL_PIECE: usize = 64;

/// How a vertex is held.
#[derive(Clone, Copy)]
struct Attachment {
    /// An index into [`Model::motions`]; `None` if the vertex is fixed.
    motion: Option<usize>,
    /// Whether the motion is that of an obstacle, which the vertex follows from where it is.
    follows: bool,
    /// The time at which the vertex becomes free, in s; `None` if it never does.
    release: Option<f64>,
}

impl<'a> Builder<'a> {
    /// Starts a model as it is at a time, in s: without the pins that were released before.
    pub(super) fn new(scene: &'a Scene, time: f64) -> Self {
        let prefix_names = scene.garments.len() + scene.hair.len() > 1;
        let (model, edge, pieces) = (Model::default(), Vec::new(), Vec::new());
        Self { scene, time, model, edge, prefix_names, pieces, springs: Vec::new(), locations: Vec::new() }
    }

    pub(super) fn model(mut self) -> Result<Model, ModelError> {
        for (number, garment) in self.scene.garments.iter().enumerate() {
            self.add_garment(number, garment)?;
        }
        for (number, hair) in self.scene.hair.iter().enumerate() {
            self.add_hair(number, hair);
        }
        self.check_names()?;
        let seams = self.seams()?;
        self.divide(&seams);
        self.apply_fabrics()?;
        self.apply_hair()?;
        self.add_seams(&seams)?;
        self.inflate()?;
        self.add_wind();
        self.add_obstacles()?;
        self.pin()?;
        self.exclude()?;
        self.model.pair_friction = self.pair_friction()?;
        Ok(self.model)
    }

    fn surroundings(&self) -> Surroundings {
        Surroundings { gravity: self.scene.gravity, drag: self.scene.drag }
    }

    /// Adds a part whose vertices were just added, and its pieces.
    fn add_part(&mut self, name: String, vertices: usize, kind: PartKind) {
        let (part, first) = (self.model.parts.len(), self.model.x.len() - vertices);
        let pieces = match &kind {
            PartKind::Cloth(mesh) => mesh.pieces(SMALL_PIECE),
            // Strands have few vertices each, so all of them form one piece.
            PartKind::Hair { .. } => vec![(0..vertices).collect()],
        };
        self.pieces.extend(pieces.into_iter().map(|vertices| Piece { part, vertices }));
        let (corners, groups) = (CornerAttributes::default(), BTreeMap::new());
        let colours = &self.scene.output.colours;
        let colour = match &kind {
            PartKind::Cloth(_) => colours.get(part).map(|colour| colour.map(|channel| channel as f32)),
            PartKind::Hair { .. } => None,
        };
        self.model.parts.push(Part { name, vertices: first..first + vertices, kind, colour, corners, groups });
    }

    fn add_garment(&mut self, number: usize, garment: &Garment) -> Result<(), ModelError> {
        let part = garment.name.clone().unwrap_or_else(|| format!("garment {number}"));
        let shape = garment.shape(&self.scene.folder);
        let Shape { mesh, start, velocities, springs, corners, groups, welded } =
            shape.map_err(|source| ModelError::Mesh { part: part.clone(), source })?;
        let model = &mut self.model;
        let first = model.x.len();
        model.triangles.extend(mesh.triangles().iter().map(|corners| corners.map(|corner| first + corner)));
        model.x.extend(start);
        model.v.extend(velocities);
        model.thickness.resize(model.x.len(), garment.fabric.thickness());
        model.friction.resize(model.x.len(), garment.fabric.friction);
        self.edge.extend(Topology::boundary(&mesh).iter().map(|vertex| first + vertex));
        self.springs.push(springs);
        self.model.notes.extend(welded.map(|welded| note_on(&part, &mesh, welded)));
        self.add_part(part, mesh.vertices().len(), PartKind::Cloth(mesh));
        if let Some(added) = self.model.parts.last_mut() {
            (added.corners, added.groups) = (corners, groups);
        }
        Ok(())
    }

    fn add_hair(&mut self, number: usize, hair: &Hair) {
        let part = hair.name.clone().unwrap_or_else(|| format!("hair {number}"));
        let vertices = hair.vertices();
        let count = vertices.len();
        self.model.v.extend(vec![[0.0; 3]; count]);
        self.model.thickness.extend(vec![hair.thickness(); count]);
        self.model.friction.extend(vec![Coulomb::default(); count]);
        self.model.x.extend(vertices);
        let segment = hair.length / hair.segments as f64;
        self.add_part(part, count, PartKind::Hair { joints: hair.segments + 1, segment, width: hair.thickness() });
    }

    fn check_names(&self) -> Result<(), ModelError> {
        check_unique("garments or hairs", self.model.parts.iter().map(|part| &part.name))
    }

    fn part(&self, name: &str) -> Result<&Part, UnknownPart> {
        let known = || self.model.parts.iter().map(|part| part.name.clone()).collect();
        let found = self.model.parts.iter().find(|part| part.name == name);
        found.ok_or_else(|| UnknownPart { name: name.to_owned(), known: known() })
    }

    /// Returns the boundary vertices of a range, numbered within it.
    fn edge_within(&self, range: &Range<usize>) -> Vec<usize> {
        self.edge.iter().filter(|vertex| range.contains(vertex)).map(|vertex| vertex - range.start).collect()
    }

    /// Returns the pairs of vertices that each seam joins.
    fn seams(&self) -> Result<Vec<Vec<[usize; 2]>>, ModelError> {
        let joined = |(number, description): (usize, &Seam)| {
            let [first, second] = &description.garments;
            let named = |name: &str| self.part(name).map_err(|error| SeamError::Name { seam: number, error });
            let ranges = [named(first)?.vertices.clone(), named(second)?.vertices.clone()];
            let edges = [&ranges[0], &ranges[1]].map(|range| self.edge_within(range));
            let side = |at: usize| Side { start: &self.model.x[ranges[at].clone()], edge: &edges[at] };
            let joined = seam::joined(description, number, [side(0), side(1)])?;
            Ok(joined.iter().map(|[p, q]| [ranges[0].start + p, ranges[1].start + q]).collect())
        };
        self.scene.seams.iter().enumerate().map(joined).collect()
    }

    /// Merges pieces that seams join, and makes an island of each group.
    fn divide(&mut self, seams: &[Vec<[usize; 2]>]) {
        let mut piece_of = vec![0; self.model.x.len()];
        for (number, piece) in self.pieces.iter().enumerate() {
            let first = self.model.parts[piece.part].vertices.start;
            piece.vertices.iter().for_each(|vertex| piece_of[first + vertex] = number);
        }
        let mut groups = DisjointSets::singletons(self.pieces.len());
        seams.iter().flatten().for_each(|&[p, q]| groups.join(piece_of[p], piece_of[q]));
        if self.scene.contact == ContactChoice::On {
            // Contact couples everything that may meet.
            (1..self.pieces.len()).for_each(|piece| groups.join(0, piece));
        }
        self.model.sewn = seams.concat();
        self.locations = vec![Location::default(); self.model.x.len()];
        for (piece, island) in self.pieces.iter().zip(groups.numbers()) {
            if island == self.model.islands.len() {
                self.model.islands.push(IslandModel::default());
            }
            let (members, first) =
                (&mut self.model.islands[island].vertices, self.model.parts[piece.part].vertices.start);
            for vertex in piece.vertices.iter().map(|vertex| first + vertex) {
                self.locations[vertex] = Location { island, index: members.len() };
                members.push(vertex);
            }
        }
    }

    /// Adds a term to an island. Reuses a matching label among those from index `since` on.
    fn add_term(&mut self, island: usize, since: usize, term: Box<dyn Term>) {
        let (name, element) = (term.name(), &*term.declaration().name);
        let labels = &mut self.model.labels;
        let known = labels[since..].iter().position(|label| label.name == name && label.element == element);
        let label = known.map_or(labels.len(), |at| since + at);
        if label == labels.len() {
            labels.push(TermLabel { name: name.to_owned(), element: element.to_owned() });
        }
        let island = &mut self.model.islands[island];
        island.labels.push(label);
        island.terms.push(term);
    }

    /// Returns the island of a piece, the piece's offset within it, and the prefix of its terms' names.
    fn island_of(&self, piece: &Piece) -> (usize, SystemPart) {
        let part = &self.model.parts[piece.part];
        let Location { island, index } = self.locations[part.vertices.start + piece.vertices[0]];
        let prefix = if self.prefix_names { format!("{}: ", part.name) } else { String::new() };
        (island, SystemPart { first: index, prefix })
    }

    /// Adds the terms of a fabric on a piece. `since` is the number of labels before its part.
    fn add_applied(&mut self, piece: &Piece, since: usize, applied: fabric::FabricTerms) {
        let (island, _) = self.island_of(piece);
        let first = self.model.parts[piece.part].vertices.start;
        piece.vertices.iter().zip(applied.masses).for_each(|(vertex, mass)| self.model.masses[first + vertex] = mass);
        applied.terms.into_iter().for_each(|term| self.add_term(island, since, term));
        let acts = |reason: &String| {
            self.model.labels[since..].iter().any(|label| *reason == format!("{}: nothing to act on", label.name))
        };
        let left_out: Vec<String> = applied.left_out.into_iter().filter(|reason| !acts(reason)).collect();
        add_once(&mut self.model.left_out, left_out);
        add_once(&mut self.model.warnings, applied.warnings);
        if let Some(locking) = applied.locking {
            self.note_locking(self.model.parts[piece.part].name.clone(), locking);
        }
    }

    /// Keeps the estimate of the piece of a garment that locks most.
    fn note_locking(&mut self, garment: String, locking: Locking) {
        match self.model.locking.iter_mut().find(|(known, _)| *known == garment) {
            Some((_, known)) if known.wasted >= locking.wasted => {}
            Some((_, known)) => *known = locking,
            None => self.model.locking.push((garment, locking)),
        }
    }

    /// Warns of garments that bend too stiffly.
    fn warn_of_locking(&mut self) {
        let locked = self.model.locking.iter().filter(|(_, locking)| locking.locks());
        self.model.warnings.extend(locked.map(|(garment, locking)| format!("garment `{garment}`: {locking}")));
    }

    fn apply_fabrics(&mut self) -> Result<(), ModelError> {
        self.model.masses = vec![0.0; self.model.x.len()];
        let springs = std::mem::take(&mut self.springs);
        for (part, (garment, springs)) in self.scene.garments.iter().zip(&springs).enumerate() {
            let since = self.model.labels.len();
            let pieces: Vec<Piece> = self.take_pieces(part);
            for piece in &pieces {
                let applied = self.applied(garment, piece, springs, pieces.len() == 1);
                self.add_applied(piece, since, applied?);
            }
        }
        self.warn_of_locking();
        Ok(())
    }

    /// Removes and returns the pieces of a part, which come first.
    fn take_pieces(&mut self, part: usize) -> Vec<Piece> {
        let count = self.pieces.iter().take_while(|piece| piece.part == part).count();
        self.pieces.drain(..count).collect()
    }

    /// Applies the fabric of a garment to one of its pieces. `is_whole` if it is the only piece.
    fn applied(
        &self,
        garment: &Garment,
        piece: &Piece,
        springs: &SpringNetwork,
        is_whole: bool,
    ) -> Result<fabric::FabricTerms, ModelError> {
        let part = &self.model.parts[piece.part];
        let PartKind::Cloth(mesh) = &part.kind else { unreachable!("garments come before hair") };
        let (_, in_island) = self.island_of(piece);
        let apply = |mesh: &TriangleMesh, springs: &SpringNetwork| {
            fabric::terms_at(&garment.fabric, mesh, springs, &self.surroundings(), in_island.clone())
        };
        let applied = if is_whole {
            apply(mesh, springs)
        } else {
            let (mesh_of_piece, springs_of_piece) = mesh.piece(&piece.vertices, springs);
            // Apply it to the whole garment, so that the error names triangles by the user's numbers.
            apply(&mesh_of_piece, &springs_of_piece).or_else(|error| apply(mesh, springs).and(Err(error)))
        };
        applied.map_err(|source| ModelError::Fabric { part: part.name.clone(), source })
    }

    fn apply_hair(&mut self) -> Result<(), ModelError> {
        for (number, hair) in self.scene.hair.iter().enumerate() {
            let (part, since) = (self.scene.garments.len() + number, self.model.labels.len());
            for piece in self.take_pieces(part) {
                let applied = fabric::hair_terms(hair, &self.surroundings(), self.island_of(&piece).1);
                let name = || self.model.parts[part].name.clone();
                let applied = applied.map_err(|source| ModelError::Fabric { part: name(), source })?;
                self.add_applied(&piece, since, applied);
            }
        }
        Ok(())
    }

    fn add_seams(&mut self, seams: &[Vec<[usize; 2]>]) -> Result<(), ModelError> {
        for (seam, (description, joined)) in self.scene.seams.iter().zip(seams).enumerate() {
            // The pairs of a seam may lie on several islands, if a garment of many pieces is sewn to itself.
            let mut pairs: BTreeMap<usize, (Vec<[usize; 2]>, Vec<f64>)> = BTreeMap::new();
            for &[p, q] in joined {
                let (pairs, gaps) = pairs.entry(self.locations[p].island).or_default();
                pairs.push([p, q].map(|vertex| self.locations[vertex].index));
                gaps.push(norm(subtract(self.model.x[p], self.model.x[q])));
            }
            let since = self.model.labels.len();
            for (island, (pairs, gaps)) in pairs {
                let terms = stitches(seam, description, &pairs, gaps)?;
                terms.into_iter().for_each(|term| self.add_term(island, since, term));
            }
        }
        Ok(())
    }

    /// Adds the overpressure inside closed garments.
    fn inflate(&mut self) -> Result<(), ModelError> {
        for (number, garment) in self.scene.garments.iter().enumerate() {
            let Some(inflation) = garment.inflation else { continue };
            let part = &self.model.parts[number];
            let PartKind::Cloth(mesh) = &part.kind else { continue };
            let (name, first) = (part.name.clone(), part.vertices.start);
            inflation::check_closed(mesh).map_err(|source| ModelError::Inflation { part: name.clone(), source })?;
            let mut triangles: BTreeMap<usize, Vec<[usize; 3]>> = BTreeMap::new();
            for corners in mesh.triangles().iter().map(|corners| corners.map(|corner| self.locations[first + corner])) {
                triangles.entry(corners[0].island).or_default().push(corners.map(|location| location.index));
            }
            let centre = mean(&self.model.x[part.vertices.clone()]);
            let (since, label) = (self.model.labels.len(), format!("{name}: pressure"));
            for (island, triangles) in triangles {
                let law = PressureLaw { inflation, centre };
                self.add_term(island, since, Box::new(DrivenTerm::new(label.clone(), law, &triangles)));
            }
        }
        Ok(())
    }

    fn add_wind(&mut self) {
        let Some(wind) = &self.scene.wind else { return };
        if self.model.triangles.is_empty() {
            self.model.left_out.push("wind: nothing to act on".to_owned());
        }
        let since = self.model.labels.len();
        let mut triangles = vec![Vec::new(); self.model.islands.len()];
        for corners in &self.model.triangles {
            triangles[self.locations[corners[0]].island].push(corners.map(|corner| self.locations[corner].index));
        }
        for (island, triangles) in triangles.iter().enumerate().filter(|(_, triangles)| !triangles.is_empty()) {
            self.add_term(island, since, wind.term(triangles));
        }
    }

    fn exclude(&mut self) -> Result<(), ExclusionError> {
        let Model { parts, obstacles, x, sewn, pinned_at_start, .. } = &self.model;
        let referents = Referents { parts, obstacles, x, sewn };
        let mut exclusions = referents.exclusions(&self.scene.exclusions)?;
        let idle = referents.without_effect(&self.scene.exclusions, self.scene.contact);
        exclusions::hold(&mut exclusions, obstacles, x, pinned_at_start);
        self.model.exclusions = exclusions;
        self.model.warnings.extend(idle);
        Ok(())
    }

    /// Returns the numbers and the friction of the chosen pairs of parts.
    fn pair_friction(&self) -> Result<Vec<([u32; 2], Coulomb)>, PairFrictionError> {
        let parts = self.model.parts.iter().map(|part| &part.name);
        let names: Vec<&String> = parts.chain(self.model.obstacles.iter().map(|obstacle| &obstacle.name)).collect();
        let mut chosen: Vec<([u32; 2], Coulomb)> = Vec::new();
        for (pair, PairFriction { between, coefficient }) in self.scene.pair_friction.iter().enumerate() {
            let number = |name: &String| {
                let unknown = || names.iter().map(|name| (*name).clone()).collect();
                let found = names.iter().position(|known| *known == name).map(index);
                found.ok_or_else(|| PairFrictionError::Name { pair, name: name.clone(), known: unknown() })
            };
            let (one, other) = (number(&between[0])?, number(&between[1])?);
            let numbers = [one.min(other), one.max(other)];
            if let Some(before) = chosen.iter().position(|(known, _)| *known == numbers) {
                return Err(PairFrictionError::Twice { pair, before });
            }
            chosen.push((numbers, *coefficient));
        }
        Ok(chosen)
    }

    fn add_obstacles(&mut self) -> Result<(), ModelError> {
        let obstacles = self.scene.obstacles.iter().enumerate();
        let obstacles = obstacles.map(|(number, one)| one.obstacle(number, &self.scene.folder));
        let obstacles = obstacles.collect::<Result<Vec<_>, _>>()?;
        check_unique("obstacles", obstacles.iter().map(|obstacle| &obstacle.name))?;
        let masses = |island: &IslandModel| island.vertices.iter().map(|&vertex| self.model.masses[vertex]).collect();
        let masses: Vec<Vec<f64>> = self.model.islands.iter().map(masses).collect();
        // Certified contact needs no terms: obstacles join the surface of the cloth.
        let is_penalty = self.scene.contact != ContactChoice::Off && !self.scene.is_certified();
        for obstacle in if is_penalty { &obstacles[..] } else { &[] } {
            let since = self.model.labels.len();
            for (island, masses) in masses.iter().enumerate() {
                obstacle.terms(masses).into_iter().for_each(|term| self.add_term(island, since, term));
            }
        }
        self.model.obstacles = obstacles;
        Ok(())
    }

    fn pin(&mut self) -> Result<(), ModelError> {
        let mut held: BTreeMap<usize, Attachment> = BTreeMap::new();
        let mut owned = BTreeSet::new();
        for (pin, description) in self.scene.pins.iter().enumerate() {
            let motion = self.motion_of(pin, description)?;
            let chosen = self.chosen(pin, description)?;
            self.model.pins.push(PinnedVertices::of(description.name.clone(), &chosen));
            if let Some(soft) = &description.soft {
                self.add_soft_pin(pin, soft, motion, &chosen);
                continue;
            }
            let motion = motion.map(|motion| self.add_motion(motion));
            let shared = Attachment { motion, follows: description.obstacle.is_some(), release: description.release };
            for vertex in chosen {
                let carried = self.carried(description, vertex).map(|motion| self.add_motion(motion));
                let attachment = Attachment { motion: carried.or(motion), ..shared };
                let known = held.get(&vertex).copied().unwrap_or(attachment);
                if !self.move_alike(known, attachment) {
                    return Err(PinError::Twice { pin, vertex }.into());
                }
                if description.release.is_none_or(|release| release > self.time) && owned.insert(vertex) {
                    self.model.pins[pin].held.push(vertex);
                }
                // The last pin to let go frees the vertex.
                let release = known.release.zip(attachment.release).map(|(one, other)| one.max(other));
                held.insert(vertex, Attachment { release, ..known });
            }
        }
        self.model.pins.iter_mut().for_each(|pin| pin.held.sort_unstable());
        for vertex in self.roots() {
            held.entry(vertex).or_insert(Attachment { motion: None, follows: false, release: None }).release = None;
        }
        self.attach(held);
        Ok(())
    }

    fn add_motion(&mut self, motion: Motion) -> usize {
        self.model.motions.push(motion);
        self.model.motions.len() - 1
    }

    /// Returns the motion of a vertex that is pinned to an obstacle that deforms.
    fn carried(&self, description: &Pin, vertex: usize) -> Option<Motion> {
        let obstacle = self.model.obstacles.iter().find(|one| Some(&one.name) == description.obstacle.as_ref())?;
        let (Some(deformation), AnySolid::Mesh(solid)) = (&obstacle.deformation, &obstacle.solid) else { return None };
        Some(deformation.carried(self.model.x[vertex], solid.surface().mesh().triangles()))
    }

    /// Returns the motion of a pin: its own, or that of its obstacle.
    fn motion_of(&self, pin: usize, description: &Pin) -> Result<Option<Motion>, PinError> {
        let Some(name) = &description.obstacle else { return Ok(description.motion.clone()) };
        let obstacles = &self.model.obstacles;
        match obstacles.iter().find(|obstacle| obstacle.name == *name) {
            Some(obstacle) if obstacle.deformation.is_some() && description.soft.is_some() => {
                Err(PinError::SoftOnDeforming { pin, name: name.clone() })
            }
            Some(obstacle) => Ok(obstacle.motion.clone()),
            None => {
                let known = obstacles.iter().map(|obstacle| obstacle.name.clone()).collect();
                Err(PinError::NoSuchObstacle { pin, name: name.clone(), known })
            }
        }
    }

    /// Whether two attachments prescribe the same motion.
    fn move_alike(&self, one: Attachment, other: Attachment) -> bool {
        let of = |one: Attachment| one.motion.map(|number| (&self.model.motions[number], one.follows));
        of(one) == of(other)
    }

    /// Pins vertices that are not yet released, and moves those with a motion to its start.
    fn attach(&mut self, held: BTreeMap<usize, Attachment>) {
        let (model, now) = (&mut self.model, self.time);
        let is_fixed = |one: &Attachment| one.release.is_none();
        let is_held = |one: &Attachment| one.release.is_none_or(|release| release > now);
        let marked = |is_marked: &dyn Fn(&Attachment) -> bool| -> Vec<bool> {
            (0..model.x.len()).map(|vertex| held.get(&vertex).is_some_and(is_marked)).collect()
        };
        let all = [marked(&|_| true), marked(&is_fixed), marked(&is_held)];
        [model.pinned_at_start, model.pinned_forever, model.pinned] = all;
        for (vertex, attachment) in held {
            model.v[vertex] = [0.0; 3];
            if let Some(motion) = attachment.motion {
                let start = model.motions[motion].pose(0.0);
                // Vertices on an obstacle stay where they are at the start.
                let initial =
                    if attachment.follows { start.inverse_transform(model.x[vertex]) } else { model.x[vertex] };
                if is_held(&attachment) {
                    model.moving.push(MovingPin { vertex, initial, motion });
                }
                model.x[vertex] = start.transform(initial);
            }
        }
    }

    /// Adds springs that hold vertices.
    fn add_soft_pin(&mut self, pin: usize, soft: &SoftPin, motion: Option<Motion>, chosen: &[usize]) {
        let Pin { obstacle, release, .. } = &self.scene.pins[pin];
        let follows = motion.as_ref().filter(|_| obstacle.is_some());
        let start = follows.map_or(Pose::IDENTITY, |motion| motion.pose(0.0));
        let mut held: BTreeMap<usize, Vec<Held>> = BTreeMap::new();
        for (number, &vertex) in chosen.iter().enumerate() {
            let stiffness = soft.stiffness * soft.weights.get(number).unwrap_or(&1.0);
            let Location { island, index } = self.locations[vertex];
            let initial = start.inverse_transform(self.model.x[vertex]);
            held.entry(island).or_default().push(Held { vertex: index, stiffness, initial });
        }
        let since = self.model.labels.len();
        for (island, held) in held {
            self.add_term(island, since, Box::new(SoftPinTerm::new(pin, held, motion.clone(), *release)));
        }
        self.model.pins[pin].springs = (since..self.model.labels.len()).collect();
    }

    fn chosen(&self, pin: usize, description: &Pin) -> Result<Vec<usize>, PinError> {
        let range = match &description.of {
            Some(name) => self.part(name).map_err(|error| PinError::Name { pin, error })?.vertices.clone(),
            None => 0..self.model.x.len(),
        };
        let edge = self.edge_within(&range);
        let chosen = pins::chosen(description, pin, &self.model.x[range.clone()], &edge, &self.groups_in(&range))?;
        Ok(chosen.into_iter().map(|vertex| range.start + vertex).collect())
    }

    /// Returns the vertices of each group of the parts in a range, numbered within it.
    fn groups_in(&self, range: &Range<usize>) -> BTreeMap<String, Vec<usize>> {
        let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        let parts = self.model.parts.iter().filter(|part| range.contains(&part.vertices.start));
        for (part, (name, vertices)) in parts.flat_map(|part| part.groups.iter().map(move |group| (part, group))) {
            let offset = part.vertices.start - range.start;
            groups.entry(name.clone()).or_default().extend(vertices.iter().map(|vertex| offset + vertex));
        }
        groups
    }

    /// The first two vertices of each rooted strand; pinned, they fix its position and direction.
    fn roots(&self) -> Vec<usize> {
        let hairs = self.model.parts.iter().filter(|part| matches!(part.kind, PartKind::Hair { .. }));
        let rooted = hairs.zip(&self.scene.hair).filter(|(_, hair)| hair.rooted);
        let roots = |(part, hair): (&Part, &Hair)| {
            part.vertices.clone().step_by(hair.segments + 1).flat_map(|start| [start, start + 1]).collect::<Vec<_>>()
        };
        rooted.flat_map(roots).collect()
    }
}

/// Creates the terms of the stitches of a seam on some pairs, which are `gaps` apart at the start, in m.
fn stitches(
    seam: usize,
    description: &Seam,
    pairs: &[[usize; 2]],
    gaps: Vec<f64>,
) -> Result<Vec<Box<dyn Term>>, ListError> {
    let (name, &Seam { stiffness, damping, close, .. }) = (format!("seam {seam}"), description);
    let springs: Box<dyn Term> = match close {
        Some(closing) => Box::new(DrivenTerm::new(name, ClosingSeam { stiffness, gaps, closing }, pairs)),
        None => {
            let stitches = vec![ZeroLengthSpring::new(stiffness, 0.0); pairs.len()];
            Box::new(PotentialTerm::new(ElementList::new(name, stitches, pairs)?))
        }
    };
    let mut terms = vec![springs];
    if damping != 0.0 {
        let law = StitchDamping { stitches: pairs.len(), damping };
        terms.push(Box::new(DissipationTerm::new(format!("seam {seam} damping"), law, pairs)));
    }
    Ok(terms)
}

/// Returns an error if two names are equal. `kind` says in the message what they name.
fn check_unique<'a>(kind: &'static str, mut names: impl Iterator<Item = &'a String>) -> Result<(), ModelError> {
    let mut known = BTreeSet::new();
    let repeated = names.find(|name| !known.insert(*name)).cloned();
    repeated.map_or(Ok(()), |name| Err(ModelError::SameName { kind, name }))
}

/// Returns the mean of some positions.
fn mean(x: &[Vector3<f64>]) -> Vector3<f64> {
    let sum = x.iter().fold([0.0; 3], |sum, x| add_scaled(sum, 1.0, *x));
    sum.map(|component| component / x.len().max(1) as f64)
}

/// Describes a garment from a file.
fn note_on(part: &str, mesh: &TriangleMesh, welded: usize) -> String {
    let pieces = match mesh.pieces(1).len() {
        1 => "1 piece".to_owned(),
        count => format!("{count} pieces"),
    };
    let welded = if welded == 0 { String::new() } else { format!(", {welded} doubled vertices welded") };
    format!("{part}: {} vertices in {pieces}{welded}", mesh.vertices().len())
}

fn add_once(all: &mut Vec<String>, more: Vec<String>) {
    more.into_iter().for_each(|one| {
        if !all.contains(&one) {
            all.push(one);
        }
    });
}
