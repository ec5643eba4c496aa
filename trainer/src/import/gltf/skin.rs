//! Folding of skins, rigid parts and static parts into one list of joints and binds.
//!
//! A *family* is a set of joints with inverse binds that agree on one bind space, so vertices of
//! that space can follow any of them. The first family's bind space is the world at rest: a rigid
//! part always fits it, and a skin does when its rest pose is its bind pose up to one transform B,
//! the same for all joints: world_j · inverse_j = B. Such vertices are baked by B and share the
//! family's binds. A skin that fits no family founds one.

use super::accessor::Accessor;
use super::document::{Document, item};
use super::mesh::Part;
use super::nodes::Nodes;
use crate::model::{Bind, Joint, Model, Trs, Vertex};
use anyhow::{Context, Result, ensure};
use glam::{Affine3A, DAffine3, DVec3};
use std::collections::BTreeMap;

/// Inverse binds agree if they place a part's corners within this share of the part's size.
const TOLERANCE: f64 = 1e-4;

/// The family whose bind space is the world at rest.
const WORLD: usize = 0;
/// The family whose inverse binds are the identity, for nodes collapsed at rest.
const LOCAL: usize = 1;
/// Stands in influences for what no joint moves, until it is known whether anything moves.
const STATIC: u16 = u16::MAX;

/// The joints and binds of a model in the making.
pub(super) struct Skeleton<'a> {
    document: &'a Document,
    nodes: &'a Nodes,
    /// Inverse bind matrices of each skin, once read.
    inverses: BTreeMap<usize, Vec<DAffine3>>,
    /// Inverse binds by node, from the third family on.
    families: Vec<BTreeMap<usize, DAffine3>>,
    binds: Vec<(usize, DAffine3)>,
    /// From family and node.
    bind_index: BTreeMap<(usize, usize), u16>,
}

/// A joint of a skin as one part uses it.
struct Use {
    node: usize,
    inverse: DAffine3,
    /// Of all vertices.
    weight: f64,
}

impl<'a> Skeleton<'a> {
    pub(super) fn new(document: &'a Document, nodes: &'a Nodes) -> Self {
        Self {
            document,
            nodes,
            inverses: BTreeMap::new(),
            families: Vec::new(),
            binds: Vec::new(),
            bind_index: BTreeMap::new(),
        }
    }

    /// Brings the part of a node to bind space, and names binds in its influences.
    pub(super) fn attach(&mut self, node: usize, part: &mut Part) -> Result<()> {
        match self.document.root.nodes[node].skin {
            Some(skin) if part.skinned => self
                .attach_skinned(skin.value(), part)
                .with_context(|| format!("skin {}", skin.value())),
            _ => self.attach_rigid(node, part),
        }
    }

    /// Writes joints and binds; says which joint each node became.
    pub(super) fn finish(self, model: &mut Model) -> Result<Vec<Option<u16>>> {
        let mut joints = vec![None; self.nodes.len()];
        if self.binds.is_empty() {
            model.vertices.iter_mut().for_each(|vertex| vertex.influences = [(0, 0.0); 4]);
            return Ok(joints);
        }
        let mut needed = vec![false; self.nodes.len()];
        for &(node, _) in &self.binds {
            let mut next = Some(node);
            while let Some(node) = next.filter(|&node| !needed[node]) {
                needed[node] = true;
                next = self.nodes.parent(node);
            }
        }
        for node in self.nodes.parents_first().filter(|&node| needed[node]) {
            joints[node] = Some(
                u16::try_from(model.joints.len())
                    .context("has more than 65536 joints; export fewer")?,
            );
            model.joints.push(Joint {
                name: self.nodes.name(node).to_owned(),
                parent: self.nodes.parent(node).and_then(|parent| joints[parent]),
                rest: self.nodes.rest(node),
            });
        }
        model.binds = self
            .binds
            .iter()
            .map(|&(node, inverse)| Bind {
                joint: joints[node].expect("every bound node is needed"),
                inverse: Affine3A::from_mat3_translation(
                    inverse.matrix3.as_mat3(),
                    inverse.translation.as_vec3(),
                ),
            })
            .collect();
        let finite = model.binds.iter().all(|bind| bind.inverse.is_finite());
        ensure!(finite, "has an inverse bind matrix that is not finite; export it again");
        bind_static(model)?;
        Ok(joints)
    }

    fn attach_rigid(&mut self, node: usize, part: &mut Part) -> Result<()> {
        let world = self.nodes.world(node);
        if world.matrix3.determinant() < 0.0 {
            // glTF 3.7.2.1: a mirroring node turns its triangles round.
            part.triangles.iter_mut().for_each(|triangle| triangle.corners.swap(1, 2));
        }
        let bind = match self.nodes.mover(node) {
            None => {
                bake(part, world);
                STATIC
            }
            Some(mover) if self.inverse(WORLD, mover).is_some() => {
                bake(part, world);
                self.bind(WORLD, mover)?
            }
            Some(mover) => {
                bake(part, self.relative(node, mover));
                self.bind(LOCAL, mover)?
            }
        };
        let influences = [(bind, 1.0), (0, 0.0), (0, 0.0), (0, 0.0)];
        part.vertices.iter_mut().for_each(|vertex| vertex.influences = influences);
        Ok(())
    }

    /// Transform at rest from a node to the space of an ancestor.
    fn relative(&self, node: usize, ancestor: usize) -> DAffine3 {
        let (mut relative, mut node) = (DAffine3::IDENTITY, node);
        while node != ancestor {
            let Some(parent) = self.nodes.parent(node) else { break };
            relative = self.nodes.local(node) * relative;
            node = parent;
        }
        relative
    }

    fn attach_skinned(&mut self, skin: usize, part: &mut Part) -> Result<()> {
        let uses = self.uses(skin, part)?;
        let corners = corners(&part.vertices);
        let (family, base) = match self.fitting_family(&uses, &corners) {
            Some(found) => found,
            None => self.found_family(&uses),
        };
        // Joints new to a fitting family join it: their inverse binds, seen from its bind space.
        if let Some(known) = family.checked_sub(LOCAL + 1) {
            let back = base.inverse();
            for joint in &uses {
                let family = &mut self.families[known];
                family.entry(joint.node).or_insert_with(|| joint.inverse * back);
            }
        }
        bake(part, base);
        let joints = &self.document.root.skins[skin].joints;
        for vertex in &mut part.vertices {
            for influence in vertex.influences.iter_mut().filter(|(_, weight)| *weight > 0.0) {
                influence.0 = self.bind(family, joints[usize::from(influence.0)].value())?;
            }
        }
        Ok(())
    }

    /// The joints that move any vertex of the part, by node.
    fn uses(&mut self, skin: usize, part: &Part) -> Result<Vec<Use>> {
        let joints = &item(&self.document.root.skins, skin, "skin")?.joints;
        let mut weights = vec![0.0; joints.len()];
        for (joint, weight) in part.vertices.iter().flat_map(|vertex| vertex.influences) {
            let count = joints.len();
            match weights.get_mut(usize::from(joint)) {
                Some(sum) => *sum += f64::from(weight),
                None if weight == 0.0 => {}
                None => anyhow::bail!("a vertex names joint {joint} of {count}; export it again"),
            }
        }
        let inverses = self.inverse_binds(skin)?;
        let used =
            weights.iter().zip(joints).zip(inverses).filter(|((weight, _), _)| **weight > 0.0);
        let mut uses: Vec<Use> = used
            .map(|((&weight, joint), &inverse)| Use { node: joint.value(), inverse, weight })
            .collect();
        uses.sort_by_key(|joint| joint.node);
        let twice = uses.windows(2).any(|pair| pair[0].node == pair[1].node);
        ensure!(!twice, "names a joint twice; export it again");
        Ok(uses)
    }

    fn inverse_binds(&mut self, skin: usize) -> Result<&[DAffine3]> {
        if !self.inverses.contains_key(&skin) {
            let json = &self.document.root.skins[skin];
            let count = json.joints.len();
            let inverses = match json.inverse_bind_matrices {
                None => vec![DAffine3::IDENTITY; count],
                Some(index) => Accessor::open(self.document, index.value(), &[16])?
                    .truncated(count)
                    .with_context(|| format!("has under {count} inverse bind matrices"))?
                    .floats::<16>(0.0)
                    .iter()
                    .map(affine)
                    .collect(),
            };
            self.inverses.insert(skin, inverses);
        }
        Ok(&self.inverses[&skin])
    }

    /// A family that agrees with the skin on all joints they share, and B to its bind space.
    fn fitting_family(&self, uses: &[Use], corners: &[DVec3; 8]) -> Option<(usize, DAffine3)> {
        let families = std::iter::once(WORLD).chain(LOCAL + 1..LOCAL + 1 + self.families.len());
        families.into_iter().find_map(|family| {
            let shared: Vec<_> = uses
                .iter()
                .filter_map(|joint| Some((joint, self.inverse(family, joint.node)?)))
                .collect();
            let (anchor, known) =
                shared.iter().max_by(|(a, _), (b, _)| a.weight.total_cmp(&b.weight))?;
            let base = inverted(*known)? * anchor.inverse;
            let complete = shared.len() == uses.len();
            let joinable = family != WORLD && inverted(base).is_some();
            let agrees = shared
                .iter()
                .all(|(joint, known)| same_place(joint.inverse, *known * base, corners));
            ((complete || joinable) && agrees).then_some((family, base))
        })
    }

    /// A new family, its bind space the world as the most used joint sees it at rest.
    fn found_family(&mut self, uses: &[Use]) -> (usize, DAffine3) {
        let anchor = uses.iter().max_by(|a, b| a.weight.total_cmp(&b.weight));
        let base = anchor.map(|anchor| self.nodes.world(anchor.node) * anchor.inverse);
        let base = base.filter(|base| inverted(*base).is_some()).unwrap_or(DAffine3::IDENTITY);
        self.families.push(BTreeMap::new());
        (LOCAL + self.families.len(), base)
    }

    /// Bind space of a family to the space of a node, if the family has that node.
    fn inverse(&self, family: usize, node: usize) -> Option<DAffine3> {
        match family {
            WORLD => inverted(self.nodes.world(node)),
            LOCAL => Some(DAffine3::IDENTITY),
            _ => self.families[family - LOCAL - 1].get(&node).copied(),
        }
    }

    fn bind(&mut self, family: usize, node: usize) -> Result<u16> {
        if let Some(&index) = self.bind_index.get(&(family, node)) {
            return Ok(index);
        }
        let index = self.binds.len();
        // One is kept for what stands still, one as its mark.
        ensure!(index < usize::from(STATIC) - 1, "has more than {} binds", STATIC - 1);
        let inverse = self.inverse(family, node).context("uses a joint without inverse")?;
        self.binds.push((node, inverse));
        self.bind_index.insert((family, node), index as u16);
        Ok(index as u16)
    }
}

/// Binds what nothing moves to a joint that stands still, because every vertex needs one.
fn bind_static(model: &mut Model) -> Result<()> {
    let is_static = |vertex: &&mut Vertex| vertex.influences[0].0 == STATIC;
    let bind = model.binds.len() as u16;
    let mut found = false;
    for vertex in model.vertices.iter_mut().filter(is_static) {
        vertex.influences[0].0 = bind;
        found = true;
    }
    if found {
        let joint = u16::try_from(model.joints.len())
            .context("has more than 65536 joints; export fewer")?;
        model.joints.push(Joint { name: "static".into(), parent: None, rest: Trs::IDENTITY });
        model.binds.push(Bind { joint, inverse: Affine3A::IDENTITY });
    }
    Ok(())
}

fn affine(columns: &[f32; 16]) -> DAffine3 {
    DAffine3::from_mat4(glam::Mat4::from_cols_array(columns).as_dmat4())
}

fn inverted(transform: DAffine3) -> Option<DAffine3> {
    let inverse = transform.inverse();
    (transform.matrix3.determinant() != 0.0 && inverse.is_finite()).then_some(inverse)
}

/// Moves vertices and, by the linear part, displacements.
fn bake(part: &mut Part, transform: DAffine3) {
    for vertex in &mut part.vertices {
        vertex.position = transform.transform_point3(vertex.position.as_dvec3()).as_vec3();
    }
    for (_, delta) in part.targets.iter_mut().flatten() {
        *delta = transform.transform_vector3(delta.as_dvec3()).as_vec3();
    }
}

/// Of the box around all vertices.
fn corners(vertices: &[Vertex]) -> [DVec3; 8] {
    let positions = vertices.iter().map(|vertex| vertex.position.as_dvec3());
    let low = positions.clone().reduce(DVec3::min).unwrap_or_default();
    let high = positions.reduce(DVec3::max).unwrap_or_default();
    std::array::from_fn(|i| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
        DVec3::new(pick(0), pick(1), pick(2))
    })
}

/// Whether two transforms place the corners alike, to [`TOLERANCE`] of the box's size there and
/// to the rounding of f32 numbers of that magnitude.
fn same_place(a: DAffine3, b: DAffine3, corners: &[DVec3; 8]) -> bool {
    const ROUNDING: f64 = 1e-6;
    let placed = corners.map(|corner| a.transform_point3(corner));
    let size = placed.iter().map(|p| p.distance(placed[0])).fold(0.0, f64::max);
    placed.iter().zip(corners).all(|(p, &corner)| {
        p.distance(b.transform_point3(corner)) <= TOLERANCE * size + ROUNDING * p.length()
    })
}
