//! Whether two trainings are the same.

use std::fmt::{self, Debug, Write};

use crc32fast::Hasher;

use crate::model::{Model, Texture};
use crate::options::Options;

/// CRC32s of all that a result depends on. They tell mistakes apart, not forgeries: two trainings that differ have the
/// same ones in a case of 2³².
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Fingerprint {
    program: u32,
    mesh: u32,
    options: u32,
}

impl Fingerprint {
    /// Bytes in a file.
    pub(super) const LEN: usize = 12;

    /// Of a training by this program.
    pub(super) fn of(model: &Model, options: &Options) -> Self {
        // Other versions may take other steps, and other platforms have other powers and sines.
        let program = (env!("CARGO_PKG_VERSION"), std::env::consts::ARCH, std::env::consts::OS);
        // Where the truth lies in memory does not matter. All else does, also what is yet to come.
        let options = Options { memory_bytes: 0, ..options.clone() };
        Self { program: crc(&program), mesh: mesh(model), options: crc(&options) }
    }

    /// As in a file.
    pub(super) fn to_bytes(self) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        for (to, from) in bytes.chunks_exact_mut(4).zip([self.program, self.mesh, self.options]) {
            to.copy_from_slice(&from.to_le_bytes());
        }
        bytes
    }

    /// The inverse.
    pub(super) fn from_bytes(bytes: &[u8; Self::LEN]) -> Self {
        let [a, b, c, d, e, f, g, h, i, j, k, l] = *bytes;
        Self {
            program: u32::from_le_bytes([a, b, c, d]),
            mesh: u32::from_le_bytes([e, f, g, h]),
            options: u32::from_le_bytes([i, j, k, l]),
        }
    }

    /// What another training has that this one has not.
    pub(super) fn difference(self, other: Self) -> Option<&'static str> {
        if self.program != other.program {
            Some("another version of dermis, or another kind of machine")
        } else if self.mesh != other.mesh {
            Some("another mesh")
        } else if self.options != other.options {
            Some("other options or another seed")
        } else {
            None
        }
    }
}

/// Of all but the name, by which nothing is trained.
fn mesh(model: &Model) -> u32 {
    // Whatever is added to these must be added here.
    let Model {
        name: _,
        vertices,
        triangles,
        materials,
        textures,
        morph_targets,
        joints,
        binds,
        clips,
    } = model;
    let mut crc = Crc::default();
    crc.add(&(vertices, triangles, materials, morph_targets, joints, binds, clips));
    for Texture { image, wrap, nearest } in textures {
        crc.add(&(image.dimensions(), wrap, nearest));
        // Millions of bytes: their digits would take seconds.
        crc.0.update(image.as_raw());
    }
    crc.0.finalize()
}

fn crc(value: &dyn Debug) -> u32 {
    let mut crc = Crc::default();
    crc.add(value);
    crc.0.finalize()
}

/// Takes what `Debug` prints, which names every field and has every digit that tells floats apart.
#[derive(Default)]
struct Crc(Hasher);

impl Crc {
    fn add(&mut self, value: &dyn Debug) {
        // `write_str` never fails.
        let _ = write!(self, "{value:?}");
    }
}

impl Write for Crc {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::demo::demo_avatar;
    use crate::options::Preset;

    #[test]
    fn what_matters_tells_trainings_apart() {
        let (model, options) = (demo_avatar(), Options::preset(Preset::Draft));
        let ours = Fingerprint::of(&model, &options);
        assert_eq!(ours, Fingerprint::from_bytes(&ours.to_bytes()));
        let of = |change: fn(&mut Model, &mut Options)| {
            let (mut model, mut options) = (model.clone(), options.clone());
            change(&mut model, &mut options);
            ours.difference(Fingerprint::of(&model, &options))
        };
        assert_eq!(of(|_, _| {}), None);
        assert_eq!(of(|model, _| model.name.push('2')), None);
        assert_eq!(of(|_, options| options.memory_bytes = 5), None);
        assert_eq!(of(|_, options| options.seed += 1), Some("other options or another seed"));
        assert_eq!(
            of(|_, options| options.background[1] = -0.0),
            Some("other options or another seed")
        );
        assert_eq!(
            of(|_, options| options.clips.push("a".into())),
            Some("other options or another seed")
        );
        assert_eq!(of(|model, _| model.vertices[7].position.x += 1e-6), Some("another mesh"));
        assert_eq!(
            of(|model, _| model.textures[0].image.get_pixel_mut(3, 4).0[2] ^= 1),
            Some("another mesh")
        );
        assert_eq!(of(|model, _| model.clips[0].seconds += 1.0), Some("another mesh"));
        let newer = Fingerprint { program: !ours.program, ..ours };
        assert!(ours.difference(newer).is_some());
    }
}
