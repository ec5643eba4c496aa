//! Small avatars, cameras and pictures.

use dermis_format::source::{Gaussians, Mathematics, Mesh, Region, Source};
use dermis_format::writer::encode;
use dermis_format::{Disc, FrameKind, Full, LowPass, ScaleLaw};
use dermis_runtime::raster::TilePixels;
use dermis_runtime::{
    Avatar, Background, Camera, Framebuffer, Kernel, Level, Pixels, Plan, Pose, Posed, Prepared,
    Statistics, render, scratch_len,
};

/// A triangle whose frame is the world's: centroid 0, x = (1, 0, 0), normal (0, 0, 1), area 1 m².
pub(crate) const UNIT: [[f32; 3]; 3] =
    [[1.0, 0.0, 0.0], [-0.5, 2.0 / 3.0, 0.0], [-0.5, -2.0 / 3.0, 0.0]];

/// White, opaque, a standard deviation of 1/8 m.
pub(crate) const DOT: Disc = Disc {
    position: [0.0; 3],
    angle: 0.0,
    log2_scale: [-3.0, -3.0],
    color: [1.0; 3],
    opacity: 1.0,
};

pub(crate) const BALL: Full = Full {
    position: [0.0; 3],
    rotation: [1.0, 0.0, 0.0, 0.0],
    log2_scale: [-3.0; 3],
    color: [1.0; 3],
    opacity: 1.0,
};

/// Classic low-pass and constant scales, so that expected numbers are short.
pub(crate) fn plain(frame: FrameKind) -> Mathematics {
    Mathematics {
        frame,
        low_pass: LowPass::Classic,
        scale_law: ScaleLaw::Constant,
        harmonics_degree: 0,
    }
}

/// Discs on [`UNIT`] in one layer.
pub(crate) fn sheet(discs: &[Disc]) -> Source {
    Source {
        mesh: Mesh {
            positions: UNIT.to_vec(),
            triangles: vec![[0, 1, 2]],
            two_sided: vec![false],
            ..Mesh::default()
        },
        regions: vec![Region {
            name: "all".into(),
            layers: vec![discs.len() as u32],
            gaussians: Gaussians::Disc(discs.to_vec()),
            triangles: vec![0; discs.len()],
            ..Region::default()
        }],
        mathematics: plain(FrameKind::Area),
        ..Source::default()
    }
}

/// Full Gaussians in the world.
pub(crate) fn cloud(fulls: &[Full]) -> Source {
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

/// The number `i` of row `salt` of random ones in [0, 1).
pub(crate) fn random(i: u32, salt: u32) -> f32 {
    let mut x = (i.wrapping_mul(0x9e37_79b9) ^ salt.wrapping_mul(0x85eb_ca6b)).wrapping_add(1);
    x ^= x >> 15;
    x = x.wrapping_mul(0x2c1b_3c6d);
    x ^= x >> 12;
    (x >> 8) as f32 / 16_777_216.0
}

/// 400 discs of all colours and sizes on 40 triangles, in two regions of two layers.
pub(crate) fn crowd() -> Source {
    let disc = |i: u32| {
        let r = |salt| random(i, salt);
        Disc {
            position: [r(0) - 0.5, r(1) - 0.5, 0.0],
            angle: 3.0 * r(2),
            log2_scale: [-3.0 * r(3), -3.0 * r(4)],
            color: [r(5), r(6), r(7)],
            opacity: 0.05 + 0.95 * r(8),
        }
    };
    let corner = |i: u32, salt| {
        [1.6 * random(i, salt) - 0.8, 1.6 * random(i, salt + 1) - 0.8, 0.4 * random(i, salt + 2)]
    };
    let positions: Vec<[f32; 3]> = (0..40)
        .flat_map(|i| {
            let [x, y, z] = corner(i, 20);
            [[x, y, z], [x + 0.2, y, z], [x, y + 0.2, z + 0.1 * random(i, 30)]]
        })
        .collect();
    let region = |name: &str, first: u32| Region {
        name: name.into(),
        layers: vec![80, 120],
        gaussians: Gaussians::Disc((first..first + 200).map(disc).collect()),
        triangles: (0..80).map(|i| i / 2).chain((0..120).map(|i| i / 3)).collect(),
        ..Region::default()
    };
    Source {
        mesh: Mesh {
            positions,
            triangles: (0..40).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
            triangle_regions: vec![0; 40],
            ..Mesh::default()
        },
        regions: vec![region("a", 0), region("b", 200)],
        ..Source::default()
    }
}

/// 400 discs in two regions of three levels, an empty layer between them, each with parameters of its own; of the first one's last
/// level with shapes of its own.
pub(crate) fn leveled_crowd() -> Source {
    let mut source = crowd();
    for (salt, region) in (40u32..).step_by(10).zip(&mut source.regions) {
        region.layers = vec![30, 0, 60, 110];
        region.triangles =
            [30, 60, 110].into_iter().flat_map(|n| (0..n).map(move |i| 40 * i / n)).collect();
        let disc = |i: u32| {
            let r = |number| random(i, salt + number);
            Disc {
                position: [r(0) - 0.5, r(1) - 0.5, 0.0],
                angle: 3.0 * r(2),
                log2_scale: [-3.0 * r(3), -3.0 * r(4)],
                color: [r(5), r(6), r(7)],
                opacity: 0.05 + 0.95 * r(8),
            }
        };
        region.levels = vec![vec![], (0..30).map(disc).collect(), (100..190).map(disc).collect()];
    }
    let region = &mut source.regions[0];
    let Gaussians::Disc(own) = &region.gaussians else { panic!("discs") };
    let before: Vec<Disc> = region.levels[1].iter().chain(&own[30..]).copied().collect();
    for (here, before) in region.levels[2].iter_mut().zip(before) {
        *here = Disc { log2_scale: here.log2_scale, opacity: here.opacity, ..before };
    }
    source
}

/// `distance` metres before the origin, looking at it along −z; `focal` pixels. At distance 1 a metre
/// at the origin is `focal` pixels, and the origin is in the middle.
pub(crate) fn camera(width: u32, height: u32, focal: f32, distance: f32) -> Camera {
    Camera {
        width,
        height,
        fx: focal,
        fy: focal,
        cx: width as f32 / 2.0,
        cy: height as f32 / 2.0,
        world_to_camera: [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, distance]],
    }
}

/// The same from behind, looking along +z.
pub(crate) fn camera_behind(width: u32, height: u32, focal: f32, distance: f32) -> Camera {
    let world_to_camera = [[-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, distance]];
    Camera { world_to_camera, ..camera(width, height, focal, distance) }
}

pub(crate) fn bytes(source: &Source) -> Vec<u8> {
    encode(source).expect("a valid source")
}

/// A drawn frame over black.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) pixels: Vec<u8>,
    pub(crate) statistics: Statistics,
}

impl Picture {
    /// Drawn by every kernel: all pictures are the same, and so are their statistics but for the
    /// lanes.
    pub(crate) fn of(avatar: &Avatar<'_>, pose: &Pose<'_>, plan: &Plan, camera: &Camera) -> Self {
        let scalar = Self::by(Kernel::Scalar, avatar, pose, plan, camera);
        for kernel in kernels() {
            let mut other = Self::by(kernel, avatar, pose, plan, camera);
            let lanes = &mut other.statistics.counts.evaluations;
            assert!(*lanes >= scalar.statistics.counts.blends, "{}", kernel.name());
            *lanes = scalar.statistics.counts.evaluations;
            assert!(other == scalar, "{} draws another picture than scalar", kernel.name());
        }
        scalar
    }

    fn by(
        kernel: Kernel,
        avatar: &Avatar<'_>,
        pose: &Pose<'_>,
        plan: &Plan,
        camera: &Camera,
    ) -> Self {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let mut scratch =
            vec![0x7fc0_1234; scratch_len(avatar, plan.gaussians(), camera.width, camera.height)];
        let mut pixels = vec![0x5a; width * height * 4];
        let mut framebuffer = Framebuffer {
            pixels: Pixels::Rgba8(&mut pixels),
            stride: width * 4,
            background: Background::Color([0.0; 3]),
            depth: None,
        };
        let statistics =
            render(avatar, pose, plan, camera, kernel, &mut scratch, &mut framebuffer).unwrap();
        Self { width, pixels, statistics }
    }

    /// At rest, all of it.
    pub(crate) fn of_all(source: &Source, camera: &Camera) -> Self {
        let bytes = bytes(source);
        let avatar = Avatar::parse(&bytes).unwrap();
        Self::of(&avatar, &Pose::Rest, &Plan::with_budget(&avatar, u32::MAX), camera)
    }

    /// Green of each pixel as one of ten characters, from 0 to 255, between bars.
    pub(crate) fn art(&self) -> String {
        let letter = |pixel: &[u8]| char::from(b" .:-=+*#%@"[usize::from(pixel[1]) * 10 / 256]);
        let row =
            |row: &[u8]| format!("|{}|\n", row.chunks_exact(4).map(letter).collect::<String>());
        self.pixels.chunks_exact(self.width * 4).map(row).collect()
    }

    pub(crate) fn pixel(&self, x: usize, y: usize) -> [u8; 4] {
        let at = (y * self.width + x) * 4;
        [0, 1, 2, 3].map(|i| self.pixels[at + i])
    }
}

/// Every kernel of this machine, and the one that vectors fall back to where there are none.
pub(crate) fn kernels() -> impl Iterator<Item = Kernel> {
    Kernel::available().into_iter().chain([Kernel::Simd(Level::fallback())])
}

/// Every tile's pixels before they become bytes, whole frame, the same bits by every kernel.
/// Asserts that they are finite, that colours are not negative and that transmittance is in [0, 1].
pub(crate) fn tiles(
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    camera: &Camera,
) -> Vec<TilePixels> {
    let scalar = tiles_by(Kernel::Scalar, avatar, pose, plan, camera);
    for kernel in kernels() {
        let other = tiles_by(kernel, avatar, pose, plan, camera);
        let same = bytemuck::cast_slice::<_, u8>(&other) == bytemuck::cast_slice::<_, u8>(&scalar);
        assert!(same, "{} gives other bits than scalar", kernel.name());
    }
    scalar
}

fn tiles_by(
    kernel: Kernel,
    avatar: &Avatar<'_>,
    pose: &Pose<'_>,
    plan: &Plan,
    camera: &Camera,
) -> Vec<TilePixels> {
    let (width, height, budget) = (camera.width, camera.height, plan.gaussians());
    let mut posing = vec![u32::MAX; Posed::scratch_len(avatar)];
    let mut preparing = vec![u32::MAX; Prepared::scratch_len(avatar, budget, width, height)];
    let mut drawing = vec![u32::MAX; Prepared::band_scratch_len(budget, width, height)];
    let posed = Posed::new(avatar, pose, kernel, &mut posing).unwrap();
    let prepared = Prepared::new(&posed, plan, camera, &mut preparing).unwrap();
    let mut tiles = Vec::new();
    prepared
        .for_each_tile(0..prepared.tile_rows(), &mut drawing, |_, _, pixels| {
            for [r, g, b, t] in &pixels.0 {
                let good = [r, g, b].into_iter().flatten().all(|c| c.is_finite() && *c >= 0.0);
                assert!(
                    good && t.iter().all(|t| (0.0..=1.0).contains(t)),
                    "{r:?} {g:?} {b:?} {t:?}"
                );
            }
            tiles.push(*pixels);
        })
        .unwrap();
    tiles
}

/// Draws all of it both ways; how many Gaussians touched a pixel's bounds.
pub(crate) fn visible(avatar: &Avatar<'_>, pose: &Pose<'_>, camera: &Camera) -> u32 {
    let plan = Plan::with_budget(avatar, u32::MAX);
    tiles(avatar, pose, &plan, camera);
    Picture::of(avatar, pose, &plan, camera).statistics.gaussians_visible
}
