//! The built-in avatar: a small toy-like person that the program makes itself, so that the whole
//! path can run without any input.
//!
//! `loft` sweeps closed surfaces, `body` lists the figure's parts, `rig` gives it joints and
//! weights, `texture` paints it, `motion` animates it. All of it is arithmetic on constants:
//! every call gives the same model.

mod body;
mod loft;
mod motion;
mod rig;
#[cfg(test)]
mod tests;
mod texture;

use glam::{Vec3, Vec4};

use crate::model::{Material, Model, MorphTarget, Texture, Triangle, Vertex, Wrap};
use body::{Expression, Part, Surface};

/// Index of the morph target that closes both eyes.
const BLINK: u16 = 0;
/// Index of the morph target that widens the mouth.
const SMILE: u16 = 1;

/// Makes the built-in avatar: a person 1.7 m tall who stands on y = 0 and looks along +Z.
///
/// It has 18 joints, the morph targets `blink` and `smile`, one 512×512 texture and the clips
/// `wave`, `walk` and `turn`; the last is meant for evaluation on poses that training did not see.
/// Every part is a closed surface, so its one material is single-sided.
pub fn demo_avatar() -> Model {
    let parts = body::parts();
    let (joints, binds) = rig::skeleton();
    let mut model = Model {
        name: "demo".to_owned(),
        materials: vec![Material {
            name: "paint".to_owned(),
            texture: Some(0),
            ..Material::default()
        }],
        textures: vec![Texture {
            image: texture::paint(&parts),
            wrap: [Wrap::Clamp; 2],
            nearest: false,
        }],
        morph_targets: ["blink", "smile"]
            .map(|name| MorphTarget { name: name.to_owned(), ..MorphTarget::default() })
            .to_vec(),
        joints,
        binds,
        clips: motion::clips(),
        ..Model::default()
    };
    for part in &parts {
        append(&mut model, part, false);
        if part.paired {
            append(&mut model, part, true);
        }
    }
    model
}

/// Adds a part, or its mirror image at −x.
fn append(model: &mut Model, part: &Part, mirror: bool) {
    let first = model.vertices.len() as u32;
    let (vertices, triangles) = part.loft.mesh();
    for (index, &(place, uv)) in (first..).zip(&vertices) {
        let influences = rig::influences(part.hold, place);
        let (position, influences) = if mirror {
            (place * Vec3::new(-1.0, 1.0, 1.0), rig::mirrored(influences))
        } else {
            (place, influences)
        };
        let uv = texture::to_texture(part.surface, uv);
        model.vertices.push(Vertex { position, uv, color: Vec4::ONE, influences });
        if part.surface == Surface::Head {
            for (target, expression) in [(BLINK, Expression::Blink), (SMILE, Expression::Smile)] {
                let displacement = expression.displacement(position);
                if displacement != Vec3::ZERO {
                    model.morph_targets[usize::from(target)].deltas.push((index, displacement));
                }
            }
        }
    }
    for [a, b, c] in triangles {
        // A mirror turns counter-clockwise into clockwise.
        let corners = if mirror { [a, c, b] } else { [a, b, c] };
        model.triangles.push(Triangle { corners: corners.map(|c| first + c), material: 0 });
    }
}
