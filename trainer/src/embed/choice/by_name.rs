//! Choosing triangles by the names of what moves or paints them.

use anyhow::{Result, bail, ensure};

use crate::model::{Model, Vertex};

/// A corner is moved by joints whose weights add up to more than this.
const MOST: f32 = 0.5;

/// Whether each triangle has all its corners moved by more than half by the joints of these names
/// and those below them.
pub(super) fn moved_by(model: &Model, names: &[String]) -> Result<Vec<bool>> {
    ensure!(!model.joints.is_empty(), "has no joints; choose by mask or material");
    check(names, model.joints.iter().map(|joint| joint.name.as_str()), "joint")?;
    let mut chosen: Vec<bool> = Vec::with_capacity(model.joints.len());
    for joint in &model.joints {
        // Parents stand before their children.
        let below = joint.parent.is_some_and(|parent| chosen[usize::from(parent)]);
        chosen.push(below || names.contains(&joint.name));
    }
    let is_chosen = |bind: u16| {
        let bind = model.binds.get(usize::from(bind));
        bind.is_some_and(|bind| chosen[usize::from(bind.joint)])
    };
    let weight = |vertex: &Vertex| -> f32 {
        let influences = vertex.influences.iter().filter(|(bind, _)| is_chosen(*bind));
        influences.map(|(_, weight)| weight).sum()
    };
    let moved: Vec<bool> = model.vertices.iter().map(|vertex| weight(vertex) > MOST).collect();
    let whole = |corners: [u32; 3]| corners.iter().all(|&corner| moved[corner as usize]);
    let choice = model.triangles.iter().map(|triangle| whole(triangle.corners)).collect();
    super::not_empty(choice, || {
        let names = names.join(", ");
        format!("joints {names}: move no triangle by more than half; choose joints above them")
    })
}

/// Whether each triangle has a material of one of these names.
pub(super) fn painted_with(model: &Model, names: &[String]) -> Result<Vec<bool>> {
    check(names, model.materials.iter().map(|material| material.name.as_str()), "material")?;
    let chosen: Vec<bool> =
        model.materials.iter().map(|material| names.contains(&material.name)).collect();
    let choice = model.triangles.iter().map(|t| chosen[t.material as usize]).collect();
    super::not_empty(choice, || {
        format!("materials {}: paint no triangle; choose others", names.join(", "))
    })
}

/// Refuses a name that nothing has, and lists those that are close to it, or all.
fn check<'a>(
    names: &[String],
    known: impl Iterator<Item = &'a str> + Clone,
    what: &str,
) -> Result<()> {
    for name in names {
        if known.clone().any(|other| other == name) {
            continue;
        }
        let named = known.filter(|other| !other.is_empty());
        let close: Vec<&str> = named.clone().filter(|other| are_close(name, other)).collect();
        let listed = if close.is_empty() { named.collect() } else { close };
        match listed.as_slice() {
            [] => bail!("has no {what} {name}, nor any other with a name; choose by mask"),
            _ => bail!("has no {what} {name}; choose one of: {}", listed.join(", ")),
        }
    }
    Ok(())
}

/// Whether one name holds the other, but for case and separators.
fn are_close(a: &str, b: &str) -> bool {
    let [a, b] = [a, b].map(|name| {
        name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
    });
    let (a, b): (String, String) = (a, b);
    !a.is_empty() && !b.is_empty() && (a.contains(&b) || b.contains(&a))
}
