//! Makes the avatars of the conformance set that are named:
//! `cargo run --release -p dermis-tests --example conformance_avatars -- layered leveled`.
//!
//! They are stored as bytes and made on demand only, so that neither training nor the encoder can
//! change what the set draws. `figure` is of a trainer before parameters per level and affine frames, and is kept.
//! Renew the table of checksums afterwards (`tests/conformance`).

use dermis_format::source::{Gaussians, Mathematics, Mesh, Region, Source};
use dermis_format::{FrameKind, Full, LowPass, ScaleLaw, writer};
use dermis_tests::files::workspace;
use dermis_tests::small;
use dermis_trainer::optimize::schedule::Random;
use dermis_trainer::options::Options;

fn main() {
    for name in std::env::args().skip(1) {
        let bytes = match &name[..] {
            "layered" => writer::encode(&layered()).expect("the source is valid"),
            "leveled" => leveled(),
            _ => panic!("{name} is none of layered, leveled"),
        };
        let path = workspace().join("tests/conformance/data").join(format!("{name}.dermis"));
        std::fs::write(path, bytes).expect("the data folder can be written");
    }
}

/// Sides of the layered avatar's column, and its rows.
const SIDES: u32 = 8;
const ROWS: u32 = 6;
/// Gaussians of each layer in each of its two regions.
const LAYERS: [u32; 3] = [40, 80, 160];
/// Coefficients of harmonics of degree 3 beyond the constant, three channels each.
const HARMONICS: usize = 45;

/// The built-in figure as it is trained: discs on affine frames, each level with parameters of its own and the last with shapes, the
/// first on a coarser mesh, the low-pass of a pixel.
fn leveled() -> Vec<u8> {
    let options = Options {
        key_frames: 3,
        size: 240,
        max_loss_db: 0.1,
        mesh_levels: 2,
        ..small::options(1_500, 600)
    };
    small::trained_demo(&options).1.bytes
}

/// What the figure leaves out: full Gaussians on edge frames of an unrigged mesh, two regions, harmonics
/// of degree 3, an opacity for each level (some below occupancy), classic low-pass, scales as they
/// are, one side in three seen from behind.
fn layered() -> Source {
    let mut random = Random::new(11);
    let corner = |row: u32, side: u32| {
        let turn = std::f64::consts::TAU * f64::from(side) / f64::from(SIDES);
        let y = f64::from(row) / f64::from(ROWS) - 0.5;
        [0.3 * turn.cos(), y, 0.3 * turn.sin()].map(|x| x as f32)
    };
    let positions = (0..=ROWS).flat_map(|row| (0..SIDES).map(move |side| corner(row, side)));
    let triangles = (0..ROWS).flat_map(|row| {
        (0..SIDES).flat_map(move |side| {
            let at = |row, side| row * SIDES + side % SIDES;
            let (a, b) = (at(row, side), at(row, side + 1));
            let (c, d) = (at(row + 1, side + 1), at(row + 1, side));
            [[a, c, b], [a, d, c]]
        })
    });
    let triangles: Vec<[u32; 3]> = triangles.collect();
    let half = triangles.len() as u32 / 2;
    let region = |name: &str, first: u32, random: &mut Random| Region {
        name: name.into(),
        layers: LAYERS.to_vec(),
        gaussians: Gaussians::Full(fulls(random)),
        triangles: in_blocks(|| first + random.below(half)),
        later_opacities: later_opacities(random),
        harmonics: (0..LAYERS.iter().sum())
            .map(|_| (0..HARMONICS).map(|_| 0.24 * random.unit() - 0.12).collect())
            .collect(),
        ..Region::default()
    };
    let regions = vec![region("lower", 0, &mut random), region("upper", half, &mut random)];
    Source {
        mesh: Mesh {
            positions: positions.collect(),
            two_sided: (0..triangles.len()).map(|triangle| triangle % 3 == 0).collect(),
            triangle_regions: (0..2 * half).map(|triangle| u8::from(triangle >= half)).collect(),
            triangles,
            ..Mesh::default()
        },
        regions,
        mathematics: Mathematics {
            frame: FrameKind::Edge,
            low_pass: LowPass::Classic,
            scale_law: ScaleLaw::Constant,
            harmonics_degree: 3,
        },
        bounds: [[-0.3, -0.5, -0.3], [0.3, 0.5, 0.3]],
        ..Source::default()
    }
}

/// Triangles of all layers, ascending in each: inside a block Gaussians stand by triangle.
fn in_blocks(mut triangle: impl FnMut() -> u32) -> Vec<u32> {
    let layer = |len| {
        let mut triangles: Vec<u32> = (0..len).map(|_| triangle()).collect();
        triangles.sort_unstable();
        triangles
    };
    LAYERS.into_iter().flat_map(layer).collect()
}

fn fulls(random: &mut Random) -> Vec<Full> {
    let mut full = |layer: usize| {
        let mut signed = || 2.0 * random.unit() - 1.0;
        let rotation: [f32; 4] = [0; 4].map(|_| signed());
        let length = rotation.iter().map(|x| x * x).sum::<f32>().sqrt().max(0.1);
        Full {
            position: [0.6 * signed(), 0.1 * signed(), 0.6 * signed()],
            rotation: rotation.map(|x| x / length),
            log2_scale: [0; 3].map(|_| -1.8 - 0.6 * layer as f32 + signed()),
            color: [0; 3].map(|_| 0.5 + 0.5 * signed()),
            opacity: 0.6 + 0.39 * signed(),
        }
    };
    let layers = LAYERS.iter().enumerate();
    layers.flat_map(|(layer, &len)| vec![layer; len as usize]).map(&mut full).collect()
}

/// Opacities at the levels after a Gaussian's own: fading, and in part below occupancy.
fn later_opacities(random: &mut Random) -> Vec<Vec<f32>> {
    let layers = LAYERS.iter().enumerate();
    let later = layers.flat_map(|(layer, &len)| vec![LAYERS.len() - 1 - layer; len as usize]);
    let mut opacity = || if random.below(4) == 0 { 0.0 } else { 0.7 * random.unit() };
    later.map(|levels| (0..levels).map(|_| opacity()).collect()).collect()
}
