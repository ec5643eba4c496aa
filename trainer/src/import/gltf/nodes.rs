//! The node tree: parents, rest transforms, which nodes are in the scene and which can move.

use super::document::{Document, item};
use crate::model::Trs;
use anyhow::{Result, bail, ensure};
use glam::{DAffine3, DMat4, Mat4, Quat, Vec3};
use gltf::json::animation::Property;
use gltf::json::validation::Checked;

/// All nodes of a file, checked to be a forest.
pub(super) struct Nodes {
    names: Vec<String>,
    parents: Vec<Option<usize>>,
    /// Parents before children.
    order: Vec<usize>,
    rests: Vec<Trs>,
    /// Node space to world at rest, in f64 because skins are compared through it.
    worlds: Vec<DAffine3>,
    in_scene: Vec<bool>,
    /// Itself, or the nearest ancestor, that a clip or a caller's pose can move.
    movers: Vec<Option<usize>>,
}

impl Nodes {
    pub(super) fn read(document: &Document) -> Result<Self> {
        let json = &document.root.nodes;
        let names = json.iter().enumerate().map(|(index, node)| match &node.name {
            Some(name) if !name.is_empty() => name.clone(),
            _ => format!("node{index}"),
        });
        let rests: Vec<Trs> = json.iter().map(rest).collect();
        if let Some(index) = rests.iter().position(|rest| !is_finite(rest)) {
            bail!("node {index} has a transform that is not finite; export it again");
        }
        let parents = parents(document)?;
        let order = order(document, &parents)?;
        let mut worlds = vec![DAffine3::IDENTITY; json.len()];
        let mut movers = movable(document)?;
        for &node in &order {
            worlds[node] = affine(&rests[node]);
            if let Some(parent) = parents[node] {
                worlds[node] = worlds[parent] * worlds[node];
                movers[node] = movers[node].or(movers[parent]);
            }
        }
        let in_scene = in_scene(document, &parents, &order)?;
        Ok(Self { names: names.collect(), parents, order, rests, worlds, in_scene, movers })
    }

    pub(super) fn name(&self, node: usize) -> &str {
        &self.names[node]
    }

    pub(super) fn parent(&self, node: usize) -> Option<usize> {
        self.parents[node]
    }

    /// Number of nodes.
    pub(super) fn len(&self) -> usize {
        self.parents.len()
    }

    /// Transform to the parent at rest.
    pub(super) fn rest(&self, node: usize) -> Trs {
        self.rests[node]
    }

    /// Transform to the parent at rest, as a matrix.
    pub(super) fn local(&self, node: usize) -> DAffine3 {
        affine(&self.rests[node])
    }

    /// Transform to the world at rest.
    pub(super) fn world(&self, node: usize) -> DAffine3 {
        self.worlds[node]
    }

    /// The node that moves this one, itself perhaps; `None` where nothing does.
    pub(super) fn mover(&self, node: usize) -> Option<usize> {
        self.movers[node]
    }

    /// All nodes, parents before their children.
    pub(super) fn parents_first(&self) -> impl Iterator<Item = usize> {
        self.order.iter().copied()
    }

    /// Nodes of the default scene, in the order of the file.
    pub(super) fn in_scene(&self) -> impl Iterator<Item = usize> {
        (0..self.in_scene.len()).filter(|&node| self.in_scene[node])
    }
}

fn rest(node: &gltf::json::Node) -> Trs {
    if let Some(matrix) = &node.matrix {
        return decompose(Mat4::from_cols_array(matrix).as_dmat4());
    }
    let rotation = node.rotation.unwrap_or_default().0;
    Trs {
        translation: node.translation.map_or(Vec3::ZERO, Vec3::from),
        rotation: unit(Quat::from_array(rotation)),
        scale: node.scale.map_or(Vec3::ONE, Vec3::from),
    }
}

/// glTF demands that node matrices decompose; what shear one has is lost.
fn decompose(matrix: DMat4) -> Trs {
    let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
    let collapsed = !rotation.is_finite() && matrix.is_finite();
    Trs {
        translation: translation.as_vec3(),
        rotation: if collapsed { Quat::IDENTITY } else { unit(rotation.as_quat()) },
        scale: scale.as_vec3(),
    }
}

/// Of unit length; the identity where it has no direction.
pub(super) fn unit(rotation: Quat) -> Quat {
    let rotation = rotation.as_dquat();
    let length = rotation.length();
    if length > 0.0 { (rotation / length).as_quat() } else { Quat::IDENTITY }
}

fn is_finite(trs: &Trs) -> bool {
    trs.translation.is_finite() && trs.rotation.is_finite() && trs.scale.is_finite()
}

fn affine(trs: &Trs) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        trs.scale.as_dvec3(),
        trs.rotation.as_dquat().normalize(),
        trs.translation.as_dvec3(),
    )
}

fn parents(document: &Document) -> Result<Vec<Option<usize>>> {
    let json = &document.root.nodes;
    let mut parents = vec![None; json.len()];
    for (parent, node) in json.iter().enumerate() {
        for child in node.children.iter().flatten().map(|child| child.value()) {
            item(json, child, "node")?;
            ensure!(
                parents[child].is_none_or(|other| other == parent),
                "node {child} has two parents; export it again"
            );
            parents[child] = Some(parent);
        }
    }
    Ok(parents)
}

/// Walks down from the roots without recursion; nodes it does not reach form cycles.
fn order(document: &Document, parents: &[Option<usize>]) -> Result<Vec<usize>> {
    let json = &document.root.nodes;
    let mut seen = vec![false; json.len()];
    let mut stack: Vec<usize> = (0..json.len()).filter(|&node| parents[node].is_none()).collect();
    stack.reverse();
    let mut order = Vec::with_capacity(json.len());
    while let Some(node) = stack.pop() {
        if std::mem::replace(&mut seen[node], true) {
            continue;
        }
        order.push(node);
        stack.extend(json[node].children.iter().flatten().rev().map(|child| child.value()));
    }
    if let Some(node) = seen.iter().position(|seen| !seen) {
        bail!("node {node} is its own ancestor; export it again");
    }
    Ok(order)
}

/// Nodes that clips move or that are joints of a skin, each naming itself.
fn movable(document: &Document) -> Result<Vec<Option<usize>>> {
    let root = &document.root;
    let mut movers = vec![None; root.nodes.len()];
    let joints = root.skins.iter().flat_map(|skin| &skin.joints);
    let channels = root.animations.iter().flat_map(|animation| &animation.channels);
    let moved = channels.filter_map(|channel| match channel.target.path {
        Checked::Valid(Property::MorphTargetWeights) | Checked::Invalid => None,
        Checked::Valid(_) => Some(&channel.target.node),
    });
    for node in joints.chain(moved).map(|node| node.value()) {
        item(&root.nodes, node, "node")?;
        movers[node] = Some(node);
    }
    Ok(movers)
}

/// Those of the default scene, else of the first; all where the file has no scene.
fn in_scene(document: &Document, parents: &[Option<usize>], order: &[usize]) -> Result<Vec<bool>> {
    let root = &document.root;
    if root.scenes.is_empty() && root.scene.is_none() {
        return Ok(vec![true; root.nodes.len()]);
    }
    let scene = item(&root.scenes, root.scene.map_or(0, |scene| scene.value()), "scene")?;
    let mut inside = vec![false; root.nodes.len()];
    for node in scene.nodes.iter().map(|node| node.value()) {
        item(&root.nodes, node, "node")?;
        inside[node] = true;
    }
    for &node in order {
        inside[node] |= parents[node].is_some_and(|parent| inside[parent]);
    }
    Ok(inside)
}
