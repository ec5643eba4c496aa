//! Small avatars and a camera.

use dermis_format::source::{Gaussians, Mathematics, Mesh, Region, Source};
use dermis_format::writer::encode;
use dermis_format::{Disc, FrameKind, Full, LowPass, ScaleLaw};
use dermis_runtime::Camera;

/// A triangle whose frame is the world's: centroid 0, x = (1, 0, 0), normal (0, 0, 1), area 1 m².
pub(crate) const UNIT: [[f32; 3]; 3] =
    [[1.0, 0.0, 0.0], [-0.5, 2.0 / 3.0, 0.0], [-0.5, -2.0 / 3.0, 0.0]];

/// White, opaque, round, a standard deviation of 1/8 of the frame's size.
pub(crate) const DOT: Disc = Disc {
    position: [0.0; 3],
    angle: 0.0,
    log2_scale: [-3.0, -3.0],
    color: [1.0; 3],
    opacity: 1.0,
};

/// White, opaque, round, a standard deviation of 1/8 m.
pub(crate) const BALL: Full = Full {
    position: [0.0; 3],
    rotation: [1.0, 0.0, 0.0, 0.0],
    log2_scale: [-3.0; 3],
    color: [1.0; 3],
    opacity: 1.0,
};

/// Classic low-pass and constant scales, so that expected numbers are short.
fn plain(frame: FrameKind) -> Mathematics {
    let (low_pass, scale_law) = (LowPass::Classic, ScaleLaw::Constant);
    Mathematics { frame, low_pass, scale_law, harmonics_degree: 0 }
}

/// Triangles that share no vertex, both sides seen, and discs, each on one of them, in one layer.
/// Vertices stand as far apart as the file can hold; poses say where they are.
pub(crate) fn triangles(count: u32, discs: &[(u32, Disc)]) -> Source {
    Source {
        mesh: Mesh {
            positions: (0..count).flat_map(|_| UNIT).collect(),
            triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            two_sided: vec![true; count as usize],
            ..Mesh::default()
        },
        regions: vec![Region {
            name: "all".into(),
            layers: vec![discs.len() as u32],
            gaussians: Gaussians::Disc(discs.iter().map(|(_, disc)| *disc).collect()),
            triangles: discs.iter().map(|(triangle, _)| *triangle).collect(),
            ..Region::default()
        }],
        mathematics: plain(FrameKind::Area),
        ..Source::default()
    }
}

/// One disc on one triangle.
pub(crate) fn one_disc(disc: Disc) -> Source {
    triangles(1, &[(0, disc)])
}

/// Full Gaussians in the world.
pub(crate) fn free(fulls: &[Full]) -> Source {
    Source {
        regions: vec![Region {
            name: "all".into(),
            layers: vec![fulls.len() as u32],
            gaussians: Gaussians::Full(fulls.to_vec()),
            ..Region::default()
        }],
        mathematics: plain(FrameKind::World),
        ..Source::default()
    }
}

pub(crate) fn compensated(mut source: Source) -> Vec<u8> {
    source.mathematics.low_pass = LowPass::Compensated;
    file(&source)
}

pub(crate) fn file(source: &Source) -> Vec<u8> {
    encode(source).expect("a valid source")
}

/// `distance` metres before the origin, looking at it along −z; `focal` pixels. At distance 1 a metre
/// at the origin is `focal` pixels, and the origin is in the middle.
pub(crate) fn camera(size: [u32; 2], focal: f32, distance: f32) -> Camera {
    Camera {
        width: size[0],
        height: size[1],
        fx: focal,
        fy: focal,
        cx: size[0] as f32 / 2.0,
        cy: size[1] as f32 / 2.0,
        world_to_camera: [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, distance]],
    }
}
