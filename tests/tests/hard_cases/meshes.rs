//! Triangles that are hardly any, folded, huge and tiny.

use dermis_format::Disc;
use dermis_format::source::{Joint, Rig, Source};
use dermis_runtime::math::{Affine, IDENTITY};

use crate::case::{Case, Stand, check};
use crate::scenes::{DOT, UNIT, camera, file, one_disc, triangles};

/// One disc on a triangle with these corners, 2 m before a camera of 33 × 33 pixels.
fn on(name: &'static str, corners: [[f32; 3]; 3], disc: Disc) -> Case {
    Case::new(name, file(&one_disc(disc)), camera([33, 33], 40.0, 2.0))
        .standing(Stand::Vertices(corners.to_vec()))
}

#[test]
fn triangles_without_area() {
    let [a, b, c] = UNIT;
    let half = b.map(|x| 0.5 * x);
    check([
        on("a point", [a; 3], DOT),
        on("two corners in one place", [a, b, b], DOT),
        on("out and back", [a, b, a], DOT),
        on("a line", [a, [0.0; 3], a.map(|x| -x)], DOT),
        on("a slanted line", [b, half, [0.0; 3]], DOT),
        on("corners that differ by the least number", [c, c, c.map(f32::next_up)], DOT),
    ]);
}

#[test]
fn inverted_triangles() {
    let [a, b, c] = UNIT;
    // Half a metre to the right, a quarter up.
    let disc = Disc { position: [0.5, 0.25, 0.0], ..DOT };
    let mut one_sided = one_disc(disc);
    one_sided.mesh.two_sided = vec![false];
    let one_sided =
        |name, corners: [[f32; 3]; 3]| Case { file: file(&one_sided), ..on(name, corners, disc) };
    check([
        one_sided("upright, one side", [a, b, c]).shows(1, 211).pixel([26, 11], [252, 254, 255]),
        one_sided("inverted, one side", [a, c, b]),
        on("upright, two sides", [a, b, c], disc).shows(1, 211).pixel([26, 11], [252, 254, 255]),
        // Its y points down.
        on("inverted, two sides", [a, c, b], disc)
            .shows(1, 211)
            .pixel([26, 21], [252, 254, 255])
            .pixel([26, 11], [0, 128, 255]),
    ]);
}

/// A slanted needle 1.6 m long and `thin` of that wide, whose disc is as large as [`DOT`] on [`UNIT`].
fn needle(name: &'static str, thin: f32) -> Case {
    let (a, b) = ([-0.7, -0.43, 0.11], [0.69, 0.37, -0.13]);
    let c = [-0.005 - 0.8 * thin, -0.03 + 1.39 * thin, -0.01];
    let area = 0.5 * thin * 1.6 * 1.6;
    let log2_scale = [-3.0 - 0.5 * area.log2(); 2];
    on(name, [a, b, c], Disc { log2_scale, ..DOT })
}

#[test]
fn needle_triangles() {
    const WHY: &str = "nearly parallel edges leave the normal 24 bits less those of 1 / thinness";
    check([
        needle("a needle a hundredth as wide as long", 1e-2).shows(1, 226).within(0.01, WHY),
        needle("a needle a thousandth as wide", 1e-3).shows(1, 229).within(0.01, WHY),
        needle("a needle 1e-5 as wide", 1e-5).shows(1, 229).within(0.1, WHY),
        needle("a needle 1e-6 as wide", 1e-6).shows(1, 226).within(3.0, WHY),
        on("a needle 1e-12 as wide, upright", UNIT.map(|[x, y, z]| [x, 1e-12 * y, z]), DOT)
            .shows(1, 9)
            .pixel([16, 16], [252, 254, 255]),
    ]);
}

/// Two segments of 0.5 m, two triangles each, the upper one on a joint of its own: red below, blue above.
fn limb(two_sided: bool) -> Source {
    let of = |color: [f32; 3]| Disc { log2_scale: [-2.5, -2.5], color, opacity: 0.8, ..DOT };
    let colors = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]];
    let discs: Vec<_> = (0..4).zip(colors.map(of)).collect();
    let mut source = triangles(4, &discs);
    let corner = |x: f32, y: f32| [x, y, 0.0];
    let segment = |low: f32| {
        let (a, b, c, d) = (
            corner(-0.25, low),
            corner(0.25, low),
            corner(0.25, low + 0.5),
            corner(-0.25, low + 0.5),
        );
        [a, b, c, a, c, d]
    };
    source.mesh.positions = [segment(-0.5), segment(0.0)].concat();
    source.mesh.two_sided = vec![two_sided; 4];
    let one = |bind| [(bind, 1.0), (1 - bind, 0.0), (0, 0.0), (0, 0.0)];
    source.mesh.influences = (0..12).map(|vertex| one(u16::from(vertex >= 6))).collect();
    let joint = |parent| Joint { name: "joint".into(), parent, ..Joint::default() };
    source.rig = Rig {
        joints: vec![joint(None), joint(Some(0))],
        binds: vec![(0, IDENTITY), (1, IDENTITY)],
        clips: Vec::new(),
    };
    source
}

/// Half a turn about x.
const FOLDED: Affine = [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0]];

#[test]
fn limbs_folded_flat() {
    let case = |name, two_sided, upper| {
        Case::new(name, file(&limb(two_sided)), camera([33, 33], 33.0, 1.0))
            .standing(Stand::Joints(vec![IDENTITY, upper], Vec::new()))
    };
    // Each corner half on either joint: of its height half a turn leaves what differs between
    // 128/255 and 127/255.
    let mut wrapper = limb(true);
    wrapper.mesh.influences[6..].fill([(0, 0.5), (1, 0.5), (0, 0.0), (0, 0.0)]);
    check([
        case("stretched", false, IDENTITY)
            .shows(4, 491)
            .pixel([19, 27], [203, 26, 52])
            .pixel([19, 10], [0, 29, 255]),
        // The upper half looks away.
        case("folded onto itself, one side", false, FOLDED)
            .shows(2, 249)
            .pixel([19, 22], [18, 118, 237])
            .pixel([19, 27], [203, 26, 52])
            .pixel([19, 10], [0, 128, 255]),
        // Both at one depth: the file's order, red before blue.
        case("folded onto itself, two sides", true, FOLDED)
            .shows(4, 319)
            .pixel([19, 22], [18, 27, 237])
            .pixel([19, 27], [203, 25, 52])
            .pixel([19, 10], [0, 128, 255]),
        Case { file: file(&wrapper), ..case("wrung out by half a turn", true, FOLDED) }
            .shows(4, 257)
            .pixel([19, 10], [0, 128, 255]),
    ]);
}

#[test]
fn triangles_far_away_and_tiny() {
    // It and the camera 1,000 km from the origin along every axis, the camera twice `scale` before it.
    let far = |name, scale: f32| {
        let corners = UNIT.map(|v| v.map(|x| 1e6 + scale * x));
        let mut case = on(name, corners, DOT);
        let distance = 2.0 * scale;
        case.camera.world_to_camera =
            [[1.0, 0.0, 0.0, -1e6], [0.0, -1.0, 0.0, 1e6], [0.0, 0.0, -1.0, 1e6 + distance]];
        case
    };
    // The frame's size is a nanometre, the disc's 2²⁷ of them.
    let tiny = Disc { log2_scale: [27.0, 27.0], ..DOT };
    let tiny_corners = UNIT.map(|v| v.map(|x| 1e-9 * x));
    check([
        far("a triangle of 16 m at 1e6 m", 16.0)
            .shows(1, 227)
            .pixel([16, 16], [252, 254, 255])
            .within(4.9, "1/16 m, f32's step there, is 0.078 px, and the slope at most 62 a pixel"),
        far("a triangle of 1 km at 1e6 m", 1024.0)
            .shows(1, 225)
            .pixel([16, 16], [252, 254, 255])
            .within(4.9 / 64.0, "1/16 m is a 64th of that on the screen"),
        on("a triangle of 1e-9 m", tiny_corners, DOT).shows(1, 9).pixel([16, 16], [252, 254, 255]),
        on("a triangle of 1e-9 m under a disc of 13 cm", tiny_corners, tiny)
            .shows(1, 261)
            .pixel([16, 16], [252, 254, 255]),
    ]);
}
