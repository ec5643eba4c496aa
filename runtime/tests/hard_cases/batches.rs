//! What is done many at once equals what is done one by one, which is the specification.

use dermis_format::record::{Bf16, DiscGroup, FullGroup, FullRecord, Range, ShortRange};
use dermis_format::source::{Gaussians, Mathematics, Region, Source};
use dermis_format::writer::packed;
use dermis_format::{
    Block, Disc, DiscWidths, Discs, FrameKind, Full, Fulls, LowPass, PerLevel, Records, ScaleLaw,
    Triangles,
};
use dermis_runtime::batch::BATCH;
use dermis_runtime::coded::{Coded, Coding};
use dermis_runtime::frame::Frame;
use dermis_runtime::kernel::Work;
use dermis_runtime::lanes::Lanes;
use dermis_runtime::mix::mixed;
use dermis_runtime::project::{Splat, View};
use dermis_runtime::screen::SplatCamera;
use dermis_runtime::select::{Place, for_each_block, for_each_of_block};
use dermis_runtime::{Avatar, Camera, Error, Kernel, Part, Plan, Pose, Posed, Prepared};
use proptest::prelude::*;

use crate::scenes::{DOT, bytes, camera, kernels, sheet};

/// Numbers from a seed.
struct Numbers(u32);

impl Numbers {
    fn word(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let x = self.0 ^ self.0 >> 15;
        x.wrapping_mul(0x2c1b_3c6d) ^ x >> 12
    }

    /// In [−1, 1).
    fn signed(&mut self) -> f32 {
        (self.word() >> 8) as f32 / 8_388_608.0 - 1.0
    }
}

/// What a cloud is of.
#[derive(Clone, Copy, Debug)]
struct Kind {
    frame: FrameKind,
    /// Degree of the harmonics of full records; none: discs.
    full: Option<u8>,
    low_pass: LowPass,
    law: ScaleLaw,
    /// What later levels have of their own.
    per_level: PerLevel,
}

fn kinds() -> impl Strategy<Value = Kind> {
    let frame = prop::sample::select(vec![
        (FrameKind::Area, false),
        (FrameKind::Edge, false),
        (FrameKind::Affine, false),
        (FrameKind::Area, true),
        (FrameKind::Edge, true),
        (FrameKind::Affine, true),
        (FrameKind::World, true),
    ]);
    let per_level = prop::sample::select(vec![PerLevel::Nothing, PerLevel::Opacity, PerLevel::All]);
    let low_pass =
        prop::sample::select(vec![LowPass::Classic, LowPass::Compensated, LowPass::Pixel]);
    (frame, 0..4u8, low_pass, any::<bool>(), per_level).prop_map(
        |((frame, full), degree, low_pass, constant, per_level)| {
            // Discs alone have all of their own, and one law.
            let per_level =
                if full && per_level == PerLevel::All { PerLevel::Opacity } else { per_level };
            let constant = constant && per_level != PerLevel::All;
            Kind {
                frame,
                full: full.then_some(degree),
                low_pass,
                law: if constant { ScaleLaw::Constant } else { ScaleLaw::SquareRoot },
                per_level,
            }
        },
    )
}

/// A cloud in layers, some of it behind the camera, off screen or too faint, on triangles that
/// look to all sides, some of them without area.
fn cloud(kind: Kind, layers: [u32; 3], numbers: &mut Numbers) -> Source {
    let mut source = sheet(&[]);
    source.mathematics = Mathematics {
        frame: kind.frame,
        low_pass: kind.low_pass,
        scale_law: kind.law,
        harmonics_degree: kind.full.unwrap_or(0),
    };
    let triangles = 3 + numbers.word() % 50;
    if kind.frame == FrameKind::World {
        source.mesh = Default::default();
    } else {
        source.mesh.positions =
            (0..3 * triangles).map(|_| [0; 3].map(|_| numbers.signed())).collect();
        source.mesh.triangles = (0..triangles).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        source.mesh.triangles[1] = [0, 0, 1];
        source.mesh.two_sided = (0..triangles).map(|_| numbers.word() >> 31 == 0).collect();
    }
    let discs: Vec<Disc> = (0..layers.iter().sum()).map(|_| disc(numbers)).collect();
    let mut region = Region { name: "all".into(), layers: layers.to_vec(), ..Region::default() };
    if kind.frame != FrameKind::World {
        // In a block Gaussians stand by triangle.
        let of =
            |len: u32| (0..len).map(move |i| (u64::from(i * triangles) / u64::from(len)) as u32);
        region.triangles = layers.into_iter().flat_map(of).collect();
    }
    if kind.per_level == PerLevel::Opacity {
        for (later, len) in [2, 1, 0].into_iter().zip(layers) {
            let mut list = || (0..later).map(|_| numbers.signed().abs()).collect();
            region.later_opacities.extend((0..len).map(|_| list()));
        }
    }
    if kind.per_level == PerLevel::All {
        let earlier = [layers[0], layers[0] + layers[1]];
        let lens = [0, 1].map(|i| if layers[i + 1] > 0 { earlier[i] } else { 0 });
        region.levels =
            lens.map(|len| (0..len).map(|_| disc(numbers)).collect()).into_iter().collect();
    }
    region.gaussians = match kind.full {
        None => Gaussians::Disc(discs),
        Some(degree) => {
            let coefficients = 3 * ((usize::from(degree) + 1).pow(2) - 1);
            if degree > 0 {
                let mut list = || (0..coefficients).map(|_| 0.6 * numbers.signed()).collect();
                region.harmonics = discs.iter().map(|_| list()).collect();
            }
            Gaussians::Full(discs.iter().map(|disc| full(disc, numbers)).collect())
        }
    };
    source.regions = vec![region];
    source
}

fn disc(numbers: &mut Numbers) -> Disc {
    Disc {
        position: [0; 3].map(|_| 1.5 * numbers.signed()),
        angle: 1.5 + 1.5 * numbers.signed(),
        log2_scale: [0; 2].map(|_| -4.0 + 5.0 * numbers.signed()),
        color: [0; 3].map(|_| 0.5 + 0.7 * numbers.signed()),
        opacity: numbers.signed().abs(),
    }
}

fn full(disc: &Disc, numbers: &mut Numbers) -> Full {
    let rotation = [0; 4].map(|_| numbers.signed());
    let length = rotation.iter().map(|x| x * x).sum::<f32>().sqrt().max(0.05);
    let Disc { position, log2_scale: [a, b], color, opacity, .. } = *disc;
    let log2_scale = [a, b, -4.0 + 5.0 * numbers.signed()];
    Full { position, rotation: rotation.map(|x| x / length), log2_scale, color, opacity }
}

/// Splats one by one.
fn one_by_one(posed: &Posed<'_, '_>, plan: &Plan, camera: &Camera) -> Vec<Splat> {
    let avatar = posed.avatar();
    let screen = SplatCamera { view: View::new(camera), low_pass: avatar.header().low_pass };
    let mut splats = Vec::new();
    let shows = |triangle| posed.shows(triangle, screen.view.eye);
    for_each_block(avatar, plan, |block, region, drawn| {
        for_each_of_block(block, region, drawn, shows, |place| {
            let frame = match place.triangle {
                Some(triangle) => posed.frame(triangle).expect("what shows has a frame"),
                None => Frame::world(),
            };
            let selected = place.decode().expect("a place is in its block");
            splats.extend(screen.splat(&selected, &frame));
        });
    });
    splats
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// By every kernel, and by each kernel's own frames; what is culled before it is projected touches
    /// no pixel, near the origin and 1,000 km from it.
    #[test]
    fn splats_of_a_frame_are_those_one_by_one(
        kind in kinds(),
        layers in prop::array::uniform3(prop_oneof![9 => 0..300u32, 1 => Just(0)]),
        share in 0f32..1.2,
        distance in prop::sample::select(vec![0.3f32, 1.0, 3.0, 30.0]),
        seed in any::<u32>(),
        away in prop::sample::select(vec![0f32, 0.0, 100.0, 1e6]),
        focal in prop::sample::select(vec![50f32, 500.0, 5000.0]),
    ) {
        let file = bytes(&cloud(kind, layers, &mut Numbers(seed)));
        let avatar = Avatar::parse(&file).unwrap();
        let budget = (share * avatar.header().gaussians as f32) as u32;
        let plan = Plan::with_budget(&avatar, budget);
        let mut camera = Camera { fy: focal * 0.82, cx: 20.0, ..camera(61, 47, focal, distance) };
        let away = if kind.frame == FrameKind::World { 0.0 } else { away };
        let vertex = |index| avatar.vertex_position(index).map(|x| x + away);
        let vertices: Vec<_> = (0..avatar.header().vertices as usize).map(vertex).collect();
        camera.world_to_camera[0][3] -= away;
        camera.world_to_camera[1][3] += away;
        camera.world_to_camera[2][3] += away;
        let pose = Pose::Vertices(&vertices);
        let mut posing = vec![u32::MAX; Posed::scratch_len(&avatar)];
        let posed = Posed::new(&avatar, &pose, Kernel::Scalar, &mut posing).unwrap();
        let expected = one_by_one(&posed, &plan, &camera);
        for kernel in kernels() {
            let mut posing = vec![0; Posed::scratch_len(&avatar)];
            let posed = Posed::new(&avatar, &pose, kernel, &mut posing).unwrap();
            let len = Prepared::scratch_len(&avatar, plan.gaussians(), 61, 47);
            let mut preparing = vec![u32::MAX; len];
            let prepared = Prepared::new(&posed, &plan, &camera, &mut preparing).unwrap();
            let found: &[u8] = bytemuck::cast_slice(prepared.splats());
            prop_assert_eq!(prepared.splats().len(), expected.len());
            prop_assert!(found == bytemuck::cast_slice::<_, u8>(&expected), "{}", kernel.name());
            prop_assert!(one_by_one(&posed, &plan, &camera) == expected, "{}", kernel.name());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Cameras that share what they can see what each sees alone: beside each other, one behind the avatar, of other sizes,
    /// in any number of shares.
    #[test]
    fn eyes_see_together_what_each_sees_alone(
        kind in kinds(),
        layers in prop::array::uniform3(0..200u32),
        seed in any::<u32>(),
        share in 0.3f32..1.2,
        distance in prop::sample::select(vec![0.3f32, 1.0, 3.0]),
        apart in 0f32..0.5,
        parts in 1usize..6,
    ) {
        let file = bytes(&cloud(kind, layers, &mut Numbers(seed)));
        let avatar = Avatar::parse(&file).unwrap();
        let plan = Plan::with_budget(&avatar, (share * avatar.header().gaussians as f32) as u32);
        let left = camera(61, 47, 50.0, distance);
        let mut right = left;
        right.world_to_camera[0][3] -= apart;
        let mut behind = camera(40, 70, 30.0, distance);
        behind.world_to_camera[0][0] = -1.0;
        behind.world_to_camera[2][2] *= -1.0;
        let cameras = [&left, &right, &behind];
        let len = |camera: &Camera| {
            Prepared::scratch_len(&avatar, plan.gaussians(), camera.width, camera.height)
        };
        for kernel in kernels() {
            let mut posing = vec![0; Posed::scratch_len(&avatar)];
            let posed = Posed::new(&avatar, &Pose::Rest, kernel, &mut posing).unwrap();
            let mut scratch = cameras.map(|camera| vec![u32::MAX; len(camera)]);
            let lent = scratch.each_mut().map(|scratch| &mut scratch[..]);
            let together = Prepared::of_eyes(&posed, &plan, cameras, lent, parts, |parts| {
                parts.iter_mut().rev().for_each(Part::project);
            });
            for (eye, (together, camera)) in together.unwrap().iter().zip(cameras).enumerate() {
                let mut scratch = vec![0; len(camera)];
                let alone = Prepared::new(&posed, &plan, camera, &mut scratch).unwrap();
                prop_assert!(together.splats() == alone.splats(), "{eye} by {}", kernel.name());
            }
        }
    }
}

#[test]
fn eyes_without_scratch_are_refused() {
    let file = bytes(&sheet(&[DOT; 4]));
    let avatar = Avatar::parse(&file).unwrap();
    let mut posing = vec![0; Posed::scratch_len(&avatar)];
    let posed = Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, &mut posing).unwrap();
    let (plan, camera) = (Plan::with_budget(&avatar, 4), camera(61, 47, 50.0, 1.0));
    let needed = Prepared::scratch_len(&avatar, 4, 61, 47);
    let (mut enough, mut less) = (vec![0; needed], vec![0; needed - 1]);
    let lent = [&mut enough[..], &mut less[..]];
    let refused = Prepared::of_eyes(&posed, &plan, [&camera; 2], lent, 1, |_| {});
    assert_eq!(refused.err(), Some(Error::Scratch { needed, lent: needed - 1 }));
}

/// The strategy above makes clouds of which something is seen, and something is not.
#[test]
fn clouds_are_seen_in_part() {
    let kind = Kind {
        frame: FrameKind::Edge,
        full: Some(3),
        low_pass: LowPass::Compensated,
        law: ScaleLaw::SquareRoot,
        per_level: PerLevel::Opacity,
    };
    for seed in 0..20 {
        let file = bytes(&cloud(kind, [200, 200, 200], &mut Numbers(seed)));
        let avatar = Avatar::parse(&file).unwrap();
        let mut posing = vec![0; Posed::scratch_len(&avatar)];
        let posed = Posed::new(&avatar, &Pose::Rest, Kernel::Scalar, &mut posing).unwrap();
        let plan = Plan::with_budget(&avatar, u32::MAX);
        let seen = one_by_one(&posed, &plan, &camera(61, 47, 50.0, 1.0)).len();
        assert!((50..550).contains(&seen), "{seen} of 600");
    }
}

/// Ranges of any size and sign.
fn disc_group(numbers: &mut Numbers) -> DiscGroup {
    let mut range = |offset: f32, step: f32| ShortRange {
        offset: Bf16::at_most(offset * numbers.signed()),
        step: Bf16::at_most(step * numbers.signed().abs()),
    };
    DiscGroup {
        position: [range(1.0, 0.01), range(100.0, 3.0), range(1e-3, 1e-7)],
        log2_scale: range(8.0, 0.05),
        color: [range(0.5, 0.005), range(0.5, 0.005), range(0.5, 0.005)],
        opacity: range(0.5, 0.005),
    }
}

fn full_group(numbers: &mut Numbers) -> FullGroup {
    let mut range = |offset: f32, step: f32| Range {
        offset: (offset * numbers.signed()).into(),
        step: (step * numbers.signed().abs()).into(),
    };
    FullGroup {
        position: [range(1.0, 0.01), range(100.0, 3.0), range(1e-3, 1e-7)],
        log2_scale: range(8.0, 0.05),
        color: [range(0.5, 0.005), range(0.5, 0.005), range(0.5, 0.005)],
        ..FullGroup::default()
    }
}

/// A block without triangles.
fn block_of<'a>(records: Records<'a>, below: Option<Discs<'a>>) -> Block<'a> {
    let count = match records {
        Records::Disc(discs) => discs.len(),
        Records::Full(fulls) => fulls.records.len(),
    };
    Block {
        region: 0,
        layer: 0,
        first: 0,
        count: count as u32,
        triangles: Triangles::default(),
        records,
        opacities: &[],
        later_levels: 0,
        harmonics: &[],
        below,
    }
}

/// Gathers and decodes a block's Gaussians, at most 64, as the runtime does for a frame, `share` of the way to the level
/// below: the numbers of each that `columns` names.
fn decoded<'a, R: Coding<'a>, const N: usize>(
    kernel: Kernel,
    block: &Block<'a>,
    records: R,
    share: f32,
    [first, len]: [usize; 2],
    columns: impl Columns<'a, R, N>,
) -> Vec<[f32; N]> {
    let mut coded = Coded::new(block, records);
    for index in first..first + len {
        let opacity = index as f32;
        let place = Place { block, index, triangle: None, opacity, log2_factor: 0.75, share };
        assert!(coded.takes(&place));
        coded.push(&place, None);
    }
    kernel.run(DecodeTo { coded: &coded, columns, len })
}

/// Decodes a batch to the numbers that `columns` names.
struct DecodeTo<'c, 'a, R, C, const N: usize> {
    coded: &'c Coded<'a, R>,
    columns: C,
    len: usize,
}

/// Names numbers of decoded Gaussians.
trait Columns<'a, R: Coding<'a>, const N: usize> {
    fn of<V: Lanes>(&self, decoded: R::Decoded<V>) -> [V; N];
}

struct DiscColumns;

impl<'a> Columns<'a, Discs<'a>, 10> for DiscColumns {
    fn of<V: Lanes>(&self, disc: Disc<V>) -> [V; 10] {
        let ([x, y, z], [s, t], [r, g, b]) = (disc.position, disc.log2_scale, disc.color);
        [x, y, z, disc.angle, s, t, r, g, b, disc.opacity]
    }
}

struct FullColumns;

impl<'a> Columns<'a, Fulls<'a>, 14> for FullColumns {
    fn of<V: Lanes>(&self, full: Full<V>) -> [V; 14] {
        let ([x, y, z], [s, t, u], [r, g, b]) = (full.position, full.log2_scale, full.color);
        let [w, i, j, k] = full.rotation;
        [x, y, z, w, i, j, k, s, t, u, r, g, b, full.opacity]
    }
}

impl<'a, R: Coding<'a>, const N: usize, C: Columns<'a, R, N>> Work for DecodeTo<'_, 'a, R, C, N> {
    type Output = Vec<[f32; N]>;

    fn run<V: Lanes>(self, token: V::Token) -> Vec<[f32; N]> {
        let mut numbers = Vec::new();
        for at in (0..self.len).step_by(V::LEN) {
            let columns = self.columns.of::<V>(self.coded.decode(token, at)).map(|column| {
                let mut lanes = [0.0; 16];
                column.store(&mut lanes);
                lanes
            });
            numbers.extend((0..V::LEN).map(|lane| columns.map(|column| column[lane])));
        }
        numbers.truncate(self.len);
        numbers
    }
}

/// Widths of 8 bits, of what a trainer chooses, of all kinds, and of none.
const WIDTHS: [[u8; 9]; 4] =
    [[8; 9], [7, 7, 6, 6, 5, 7, 5, 4, 2], [1, 2, 3, 4, 5, 6, 7, 8, 0], [0; 9]];

fn widths([x, y, z, angle, scale, luma, orange, green, opacity]: [u8; 9]) -> DiscWidths {
    let (position, color) = ([x, y, z], [luma, orange, green]);
    DiscWidths { position, angle, scale, color, opacity }
}

/// 256 records of any codes, and angles of all codes, each the next by `step`.
fn records(numbers: &mut Numbers, widths: DiscWidths, step: u16) -> Vec<u8> {
    let codes: Vec<Disc<u16>> = (0..256)
        .map(|i| {
            let words = [(); 3].map(|()| numbers.word().to_le_bytes().map(u16::from));
            let [[x, y, z, s], [t, luma, orange, green], [opacity, ..]] = words;
            Disc {
                position: [x, y, z],
                angle: i * step,
                log2_scale: [s, t],
                color: [luma, orange, green],
                opacity,
            }
        })
        .collect();
    packed(&codes, widths)
}

/// Every code of the angle, in full batches and in short ones.
#[test]
fn discs_are_decoded_alike_one_by_one_and_in_lanes() {
    let numbers = &mut Numbers(1);
    for (round, widths) in WIDTHS.map(widths).into_iter().cycle().take(8).enumerate() {
        let groups = [disc_group(numbers)];
        let records = records(numbers, widths, 1);
        let discs = Discs::new(widths, &groups, &records, 256).expect("the planes fit");
        let block = block_of(Records::Disc(discs), None);
        for kernel in kernels() {
            let mut first = 0;
            while first < 256 {
                let len = (256 - first).min(BATCH - round);
                let found = decoded(kernel, &block, discs, 0.0, [first, len], DiscColumns);
                for (found, index) in found.into_iter().zip(first..) {
                    let disc = discs.get(index).expect("it is one of 256");
                    let code = index as u32 & ((1 << widths.angle) - 1);
                    let step = core::f32::consts::FRAC_PI_2 / (1u32 << widths.angle) as f32;
                    assert_eq!(disc.angle.to_bits(), ((code as f32 + 0.5) * step).to_bits());
                    let disc = Disc { opacity: index as f32, ..disc };
                    let expected = Columns::<Discs<'_>, 10>::of::<f32>(&DiscColumns, disc);
                    let [found, expected] = [found, expected].map(|all| all.map(f32::to_bits));
                    assert_eq!(found, expected, "{index} by {}: {disc:?}", kernel.name());
                }
                first += len;
            }
        }
    }
}

/// Between two levels: every difference of angles, at shares that round and that do not.
#[test]
fn discs_between_levels_are_mixed_alike_one_by_one_and_in_lanes() {
    let numbers = &mut Numbers(2);
    for (share, other) in
        [0.0, 1e-7, 0.25, 0.3, 0.75, 0.999_999_9, 1.0].into_iter().zip(WIDTHS.iter().cycle())
    {
        let widths = [widths([8; 9]), widths(*other)];
        let groups = [[disc_group(numbers)], [disc_group(numbers)]];
        let records = [records(numbers, widths[0], 1), records(numbers, widths[1], 3)];
        let [upper, lower] = [0, 1]
            .map(|i| Discs::new(widths[i], &groups[i], &records[i], 256).expect("the planes fit"));
        let block = block_of(Records::Disc(upper), Some(lower));
        for kernel in kernels() {
            for first in (0..256).step_by(BATCH) {
                let found = decoded(kernel, &block, upper, share, [first, BATCH], DiscColumns);
                for (found, index) in found.into_iter().zip(first..) {
                    let [upper, lower] =
                        [upper, lower].map(|discs| discs.get(index).expect("it is one of 256"));
                    let disc = mixed(&upper, &lower, share);
                    // The short way: no more than an eighth of a turn, and to the same axes.
                    assert!((disc.angle - upper.angle).abs() <= 0.787, "{upper:?} {lower:?}");
                    let rest = (disc.angle - lower.angle) / core::f32::consts::FRAC_PI_2;
                    assert!(share < 1.0 || (rest - rest.round()).abs() < 1e-6, "{disc:?}");
                    let disc = Disc { opacity: index as f32, ..disc };
                    let expected = Columns::<Discs<'_>, 10>::of::<f32>(&DiscColumns, disc);
                    let [found, expected] = [found, expected].map(|all| all.map(f32::to_bits));
                    assert_eq!(found, expected, "{index} by {}: {disc:?}", kernel.name());
                }
            }
        }
    }
}

/// Rotations of any 32 bits, those whose three components are together too long among them; all
/// 65,536 codes of a position.
#[test]
fn full_records_are_decoded_alike_one_by_one_and_in_lanes() {
    let numbers = &mut Numbers(2);
    let groups = [full_group(numbers); 256];
    let mut too_long = 0;
    let records: Vec<FullRecord> = (0..=u16::MAX)
        .map(|i| {
            let [a, b, c, _] = numbers.word().to_le_bytes();
            // Greatest and least components, and the middle, each with the others.
            let component = |shift: u16| [0, 511, 512, 1022, 1023][usize::from(i / shift % 5)];
            let ends =
                u32::from(i) << 30 | component(4) << 20 | component(20) << 10 | component(100);
            let rotation = if i < 500 { ends } else { numbers.word() };
            too_long += u32::from(dermis_format::quant::quaternion_value(rotation).contains(&0.0));
            FullRecord {
                position: [i.into(), i.wrapping_mul(3).into(), i.wrapping_mul(12_345).into()],
                rotation: rotation.into(),
                scale: [i as u8, a, b],
                color: [c, a ^ b, b ^ c],
                opacity: 255,
            }
        })
        .collect();
    assert!(too_long > 1000, "{too_long} codes that no encoder makes");
    let fulls = Fulls { groups: &groups, records: &records };
    let block = block_of(Records::Full(fulls), None);
    for kernel in kernels() {
        for first in (0..records.len()).step_by(BATCH) {
            let found = decoded(kernel, &block, fulls, 0.0, [first, BATCH], FullColumns);
            for (found, index) in found.into_iter().zip(first..) {
                let full = Full { opacity: index as f32, ..fulls.get(index).expect("it is one") };
                let expected = Columns::<Fulls<'_>, 14>::of::<f32>(&FullColumns, full);
                let [found, expected] = [found, expected].map(|all| all.map(f32::to_bits));
                assert_eq!(found, expected, "{index} by {}: {full:?}", kernel.name());
            }
        }
    }
}
