//! The bones of a glTF skin.

use mesh_io::gltf::json::{Root, Skin};
use mesh_io::gltf::{Accessors, Fault, Usage, Values};
use nalgebra::{Matrix4, Point3, Vector3};

use super::skinned::Bone;

/// The bones of a skin, parents first.
#[derive(Debug)]
pub(super) struct SkinBones {
    pub bones: Vec<Bone>,
    /// The bone of each joint of the skin.
    pub order: Vec<usize>,
}

impl SkinBones {
    /// Reads the bones of a skin. The inverse bind matrices give the joints' positions at rest.
    pub(super) fn read(root: &Root, skin: &Skin, accessors: &mut Accessors<'_>) -> Result<Self, Fault> {
        let fault = |reason: String| Fault::new("the skin", reason);
        let matrices = skin.inverse_bind_matrices.ok_or_else(|| fault("it has no inverse bind matrices".into()))?;
        let binds: Values<'_, 16> = accessors.read(matrices.value(), &Usage::BIND_MATRICES)?;
        let joints: Vec<usize> = skin.joints.iter().map(|node| node.value()).collect();
        if binds.len() < joints.len() {
            return Err(fault(format!("it has {} joints, but {} inverse bind matrices", joints.len(), binds.len())));
        }
        let heads: Result<Vec<Vector3<f64>>, String> = binds.iter().take(joints.len()).enumerate().map(head).collect();
        let heads = heads.map_err(fault)?;
        let parents = parents(root, &joints).map_err(fault)?;
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); joints.len()];
        for (joint, parent) in parents.iter().enumerate() {
            if let Some(parent) = parent {
                children[*parent].push(joint);
            }
        }
        let sorted = parents_first(&parents).ok_or_else(|| fault("its joints are a cycle".into()))?;
        let mut order = vec![0; joints.len()];
        let mut bones = Vec::with_capacity(joints.len());
        for joint in sorted {
            let ends = &children[joint];
            let sum = || ends.iter().map(|&child| heads[child]).sum::<Vector3<f64>>();
            let tail = if ends.is_empty() { heads[joint] } else { sum() / ends.len() as f64 };
            order[joint] = bones.len();
            bones.push(Bone {
                name: root.nodes[joints[joint]].name.clone().unwrap_or_else(|| format!("joint {joint}")),
                parent: parents[joint].map(|parent| order[parent]),
                head: heads[joint].into(),
                tail: tail.into(),
            });
        }
        Ok(Self { bones, order })
    }
}

/// Returns the position of a joint at rest.
fn head((joint, columns): (usize, [f64; 16])) -> Result<Vector3<f64>, String> {
    let inverse = Matrix4::from_column_slice(&columns).try_inverse();
    let head = inverse.map(|matrix| matrix.transform_point(&Point3::origin()).coords);
    head.filter(|head| head.iter().all(|x| x.is_finite()))
        .ok_or_else(|| format!("the inverse bind matrix of joint {joint} cannot be inverted"))
}

/// Returns the parent of each joint among the joints; `None` for a root.
fn parents(root: &Root, joints: &[usize]) -> Result<Vec<Option<usize>>, String> {
    let mut joint_of = vec![None; root.nodes.len()];
    for (joint, &node) in joints.iter().enumerate() {
        if joint_of[node].replace(joint).is_some() {
            return Err(format!("node {node} is a joint twice"));
        }
    }
    let mut parents = vec![None; joints.len()];
    for (joint, &node) in joints.iter().enumerate() {
        for child in root.nodes[node].children.iter().flatten() {
            let Some(child_joint) = joint_of[child.value()] else { continue };
            if parents[child_joint].replace(joint).is_some() {
                return Err(format!("node {} is a child twice", child.value()));
            }
        }
    }
    Ok(parents)
}

/// Sorts joints so that parents come first, and otherwise as in the file. `None` if there is a cycle.
///
/// A joint whose parent comes later waits for the next pass over the file. The pass of each joint follows from that of
/// its parent, without a search.
fn parents_first(parents: &[Option<usize>]) -> Option<Vec<usize>> {
    let mut passes: Vec<Option<usize>> = vec![None; parents.len()];
    for joint in 0..parents.len() {
        let mut waiting = Vec::new();
        let mut at = Some(joint);
        while let Some(unknown) = at.filter(|&at| passes[at].is_none()) {
            if waiting.len() >= parents.len() {
                return None;
            }
            waiting.push(unknown);
            at = parents[unknown];
        }
        for &joint in waiting.iter().rev() {
            let pass = |parent: usize| Some(passes[parent]? + usize::from(joint < parent));
            passes[joint] = Some(parents[joint].map_or(Some(0), pass)?);
        }
    }
    let mut sorted: Vec<usize> = (0..parents.len()).collect();
    sorted.sort_by_key(|&joint| (passes[joint], joint));
    Some(sorted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parents_come_first_and_cycles_are_found() {
        assert_eq!(parents_first(&[None, Some(0), Some(1)]), Some(vec![0, 1, 2]));
        assert_eq!(parents_first(&[Some(2), None, Some(1), Some(0)]), Some(vec![1, 2, 0, 3]));
        assert_eq!(parents_first(&[Some(1), Some(0), None]), None);
        assert_eq!(parents_first(&[Some(0)]), None);
    }

    #[test]
    fn a_long_chain_takes_no_time() {
        let joints = 1_000_000;
        let backwards: Vec<Option<usize>> = (1..joints).map(Some).chain([None]).collect();
        assert_eq!(parents_first(&backwards).unwrap()[0], joints - 1);
    }
}
