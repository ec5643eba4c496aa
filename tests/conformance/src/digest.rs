//! All that the reader's accessors say of a file, so that a program which links this links them, too,
//! and shows whether they hold a panic path.

use crc32fast::Hasher;
use dermis_format::Error;
use dermis_runtime::{Avatar, Plan};

use crate::avatars::File;

/// CRC32 of what the accessors say of a file. They are asked for one thing more than there is,
/// everywhere: that is answered, too.
pub fn digest(file: File) -> Result<u32, Error> {
    let avatar = Avatar::parse(file.bytes())?;
    let mut digest = Digest(Hasher::new());
    digest.mesh(&avatar);
    digest.layers(&avatar);
    digest.rig(&avatar);
    avatar.sections().for_each(|section| digest.bytes(&section.tag));
    Ok(digest.0.finalize())
}

struct Digest(Hasher);

impl Digest {
    fn bytes(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    fn number(&mut self, number: u32) {
        self.bytes(&number.to_le_bytes());
    }

    fn mesh(&mut self, avatar: &Avatar<'_>) {
        for vertex in 0..=avatar.header().vertices as usize {
            for x in avatar.vertex_position(vertex) {
                self.number(x.to_bits());
            }
            for (bind, weight) in avatar.influences(vertex) {
                self.number(bind);
                self.bytes(&[weight]);
            }
        }
        for triangle in 0..=avatar.header().triangles as usize {
            avatar.triangle(triangle).into_iter().for_each(|corner| self.number(corner));
            let two_sided = avatar.is_two_sided(triangle);
            self.bytes(&[avatar.triangle_region(triangle), two_sided.into()]);
        }
    }

    fn layers(&mut self, avatar: &Avatar<'_>) {
        avatar.region_names().for_each(|name| self.bytes(name.as_bytes()));
        for region in 0..=usize::from(avatar.header().regions) {
            self.number(avatar.region_len(region));
            for layer in 0..=usize::from(avatar.header().layers) {
                self.number(avatar.layer_len(region, layer));
            }
        }
        let third = Plan::with_budget(avatar, avatar.header().gaussians / 3);
        self.number(third.level(avatar).to_bits());
    }

    fn rig(&mut self, avatar: &Avatar<'_>) {
        avatar.joint_names().for_each(|name| self.bytes(name.as_bytes()));
        for target in avatar.morph_targets() {
            self.bytes(target.name.as_bytes());
            target.vertices.iter().for_each(|vertex| self.number(vertex));
        }
        for clip in avatar.clips() {
            self.bytes(clip.name.as_bytes());
            for channel in clip.channels() {
                (0..=channel.keys).for_each(|key| self.number(channel.value(key, 0).to_bits()));
            }
        }
        avatar.key_frames().iter().for_each(|key| self.number(key.seconds.get().to_bits()));
    }
}
