//! The figure's texture: each texel is painted by the place on the body that it covers.

use glam::{FloatExt, Vec2, Vec3};
use image::{Rgba, RgbaImage};

use super::body::{EYE, HEAD, MOUTH, Part, Surface, hair_depth};
use super::rig::{SHOULDER, WRIST};

/// Columns and rows.
pub(super) const SIZE: u32 = 512;
/// Texels at each edge of a surface's rectangle that repeat its border, so that filtering does
/// not mix surfaces.
const GUTTER: f32 = 4.0;
/// Samples along each axis of a texel.
const SAMPLES: u32 = 3;

// Colours, sRGB in [0, 1].
const SKIN: Vec3 = Vec3::new(0.98, 0.80, 0.68);
const BLUSH: Vec3 = Vec3::new(0.97, 0.58, 0.52);
const HAIR: Vec3 = Vec3::new(0.46, 0.25, 0.13);
const HAIR_LIGHT: Vec3 = Vec3::new(0.66, 0.40, 0.21);
const INK: Vec3 = Vec3::new(0.16, 0.10, 0.10);
const WHITE: Vec3 = Vec3::new(0.99, 0.99, 0.98);
const IRIS: Vec3 = Vec3::new(0.16, 0.52, 0.56);
const IRIS_LIGHT: Vec3 = Vec3::new(0.42, 0.80, 0.72);
const LIPS: Vec3 = Vec3::new(0.72, 0.26, 0.27);
const STRIPE_A: Vec3 = Vec3::new(0.97, 0.95, 0.89);
const STRIPE_B: Vec3 = Vec3::new(0.88, 0.28, 0.24);
const STAR: Vec3 = Vec3::new(0.99, 0.80, 0.22);
const BADGE: Vec3 = Vec3::new(0.16, 0.24, 0.45);
const DENIM: Vec3 = Vec3::new(0.24, 0.40, 0.66);
const DENIM_DARK: Vec3 = Vec3::new(0.15, 0.26, 0.46);
const HEM: Vec3 = Vec3::new(0.62, 0.74, 0.88);
const THREAD: Vec3 = Vec3::new(0.93, 0.66, 0.30);
const LEATHER: Vec3 = Vec3::new(0.40, 0.24, 0.14);
const BRASS: Vec3 = Vec3::new(0.93, 0.80, 0.42);
const SOCK: Vec3 = Vec3::new(0.95, 0.94, 0.90);
const SHOE: Vec3 = Vec3::new(0.20, 0.62, 0.50);
const SOLE: Vec3 = Vec3::new(0.97, 0.96, 0.92);

/// Where a part's (u, v) lies in the texture, both in [0, 1].
pub(super) fn to_texture(surface: Surface, uv: Vec2) -> Vec2 {
    let (origin, extent) = rectangle(surface);
    // v runs up or along a limb, rows run down.
    (origin + Vec2::new(uv.x, 1.0 - uv.y) * extent) / SIZE as f32
}

/// Origin and extent in texels, without the gutter.
fn rectangle(surface: Surface) -> (Vec2, Vec2) {
    let [x, y, width, height] = surface.texels().map(|texels| texels as f32);
    (Vec2::new(x + GUTTER, y + GUTTER), Vec2::new(width, height) - 2.0 * GUTTER)
}

/// Paints the texture. Parts that share a rectangle are painted by the first of them.
pub(super) fn paint(parts: &[Part]) -> RgbaImage {
    let mut image = RgbaImage::from_pixel(SIZE, SIZE, Rgba([255; 4]));
    let mut done = Vec::new();
    for part in parts {
        if done.contains(&part.surface) {
            continue;
        }
        done.push(part.surface);
        let (origin, extent) = rectangle(part.surface);
        let [left, top, width, height] = part.surface.texels();
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |x| (row, x))) {
            let (x, y) = (left + column, top + row);
            let place = |texel: Vec2| {
                let place = ((texel - origin) / extent).clamp(Vec2::ZERO, Vec2::ONE);
                Vec2::new(place.x, 1.0 - place.y)
            };
            let normal = part.loft.normal(place(Vec2::new(x as f32, y as f32) + 0.5));
            let mut sum = Vec3::ZERO;
            for sample in 0..SAMPLES * SAMPLES {
                let offset = Vec2::new((sample % SAMPLES) as f32, (sample / SAMPLES) as f32);
                let texel = Vec2::new(x as f32, y as f32) + (offset + 0.5) / SAMPLES as f32;
                sum += color(part, place(texel), normal);
            }
            let mean = sum / (SAMPLES * SAMPLES) as f32 * 255.0;
            let [r, g, b] = mean.to_array().map(|value| value.round().clamp(0.0, 255.0) as u8);
            image.put_pixel(x, y, Rgba([r, g, b, 255]));
        }
    }
    image
}

/// The paint at a place, with a soft light from above baked in.
fn color(part: &Part, uv: Vec2, normal: Vec3) -> Vec3 {
    let place = part.loft.point(uv);
    let paint = match part.surface {
        Surface::Head => head(place),
        Surface::Torso => torso(uv, place),
        Surface::Hair => hair(uv, place),
        Surface::Arm => arm(place),
        Surface::Leg => leg(uv, place),
        Surface::Shoe => shoe(place, normal),
        // Shared by parts of several shapes: nothing that hangs on one of them.
        Surface::Skin => return skin(uv),
        Surface::Lock => return lock(uv),
    };
    paint * (0.91 + 0.09 * normal.dot(Vec3::new(0.0, 0.9, 0.44)))
}

/// Lays a colour over another where `amount` is above 0.
fn over(below: Vec3, above: Vec3, amount: f32) -> Vec3 {
    below.lerp(above, amount.clamp(0.0, 1.0))
}

/// 1 inside a shape given by a distance that is negative inside; `soft` is the width of its edge.
fn inside(distance: f32, soft: f32) -> f32 {
    (0.5 - distance / soft).clamp(0.0, 1.0)
}

/// Distance of an ellipse, about in metres near its border.
fn ellipse(offset: Vec2, radii: Vec2) -> f32 {
    ((offset / radii).length() - 1.0) * radii.min_element()
}

/// Distance of the segment from `a` to `b`.
fn segment(place: Vec2, a: Vec2, b: Vec2) -> f32 {
    let t = ((place - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    place.distance(a.lerp(b, t))
}

/// Smooth noise in [0, 1] of period 1 between its hashed lattice points.
fn noise(place: Vec2) -> f32 {
    let hash = |x: f32, y: f32| {
        let mut bits = (x as i32 as u32).wrapping_mul(0x9e37_79b9) ^ (y as i32 as u32);
        bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
        bits = (bits ^ (bits >> 12)).wrapping_mul(0x297a_2d39);
        (bits >> 8) as f32 / (1 << 24) as f32
    };
    let cell = place.floor();
    let t = place - cell;
    let t = t * t * (3.0 - 2.0 * t);
    let row = |y: f32| hash(cell.x, y).lerp(hash(cell.x + 1.0, y), t.x);
    row(cell.y).lerp(row(cell.y + 1.0), t.y)
}

fn head(place: Vec3) -> Vec3 {
    // The scalp takes the colour of the hair, so that the hairline is not a row of facets.
    let scalp = inside(hair_depth(place) - 1.0, 0.01);
    let mut paint = over(SKIN, HAIR, scalp);
    if place.z < 0.0 {
        return paint;
    }
    let flat = place.truncate();
    let near = Vec2::new(flat.x.abs(), flat.y);
    let cheek = near.distance(Vec2::new(0.128, 1.315)) / 0.042;
    paint = over(paint, BLUSH, 0.55 * (-cheek * cheek).exp());
    paint = eye(paint, near, flat.x.signum());
    // Brows: short arcs, thicker towards the nose.
    let arc = near - Vec2::new(EYE.x + 0.004, 1.445 - 0.055);
    let brow = (arc.length() - 0.078).abs() - 0.0085 + 0.05 * (near.x - 0.05).max(0.0);
    let within = (arc.x.abs() - 0.036).max(-arc.y);
    paint = over(paint, HAIR * 0.8, inside(brow.max(within), 0.003));
    mouth(paint, flat)
}

/// An eye; `near` is mirrored to the left one, `side` is the sign of x.
fn eye(below: Vec3, near: Vec2, side: f32) -> Vec3 {
    let offset = near - EYE;
    let white = ellipse(offset, Vec2::new(0.036, 0.044));
    let mut paint = below;
    // Lashes: the lid's edge, heavier above and outside.
    let heavy = 0.0065 * (offset.y / 0.044).max(0.0) + 0.003 * (offset.x / 0.036).max(0.0);
    paint = over(paint, INK, inside(white - 0.0015 - heavy, 0.002));
    let mut ball = over(WHITE, WHITE * 0.82, (offset.y - 0.018) / 0.02);
    let gaze = offset - Vec2::new(-0.004, -0.002);
    let iris = gaze.length();
    let ring = IRIS.lerp(IRIS_LIGHT, ((0.01 - gaze.y) / 0.03).clamp(0.0, 1.0));
    ball = over(ball, IRIS * 0.55, inside(iris - 0.0285, 0.002));
    ball = over(ball, ring, inside(iris - 0.0255, 0.002));
    ball = over(ball, INK * 0.7, inside(iris - 0.0145, 0.002));
    // Both highlights are on the same side of their eye: the light does not mirror.
    let light = |x: f32, y: f32| gaze.distance(Vec2::new(side * x, y));
    ball = over(ball, WHITE, inside(light(0.009, 0.011) - 0.0075, 0.002));
    ball = over(ball, WHITE, inside(light(-0.009, -0.010) - 0.0038, 0.002));
    over(paint, ball, inside(white + 0.001, 0.002))
}

/// A smile, a little open.
fn mouth(below: Vec3, flat: Vec2) -> Vec3 {
    let offset = flat - MOUTH;
    // Upper lip: a parabola whose ends turn up; lower lip: a deeper one through the same ends.
    let half = 0.055;
    let bow = 1.0 - (offset.x / half).powi(2);
    let upper = 0.014 - 0.016 * bow;
    let lower = 0.014 - 0.044 * bow;
    let open = (offset.y - upper).max(lower - offset.y);
    let paint = over(below, LIPS * 0.72, inside(open - 0.003, 0.002));
    let tongue = ellipse(offset - Vec2::new(0.0, -0.034), Vec2::new(0.026, 0.014));
    let mut inner = over(LIPS * 0.55, Vec3::new(0.93, 0.48, 0.46), inside(tongue, 0.002));
    let teeth = upper - 0.009 - offset.y;
    inner = over(inner, WHITE, inside(teeth, 0.002));
    over(paint, inner, inside(open, 0.002))
}

fn hair(uv: Vec2, place: Vec3) -> Vec3 {
    let strands = noise(Vec2::new(uv.x * 70.0, uv.y * 5.0)) - 0.5;
    let height = (place.y - HEAD.y) / 0.25 + 0.10 * strands;
    // A band of light around the crown.
    let shine = (-((height - 0.72) / 0.13).powi(2)).exp();
    over(HAIR * (1.0 + 0.25 * strands), HAIR_LIGHT, 0.6 * shine)
}

fn lock(uv: Vec2) -> Vec3 {
    let strands = noise(Vec2::new(uv.x * 16.0, uv.y * 3.0)) - 0.5;
    over(HAIR * (1.04 + 0.22 * strands), HAIR_LIGHT, 0.45 * (-((uv.y - 0.4) / 0.15).powi(2)).exp())
}

/// Stripes across a coordinate in metres.
fn stripes(along: f32) -> Vec3 {
    let phase = (along / 0.056).rem_euclid(1.0);
    over(STRIPE_A, STRIPE_B, inside(((phase - 0.5).abs() - 0.25) * 0.056, 0.002))
}

fn torso(uv: Vec2, place: Vec3) -> Vec3 {
    let front = place.z > 0.0;
    let flat = place.truncate();
    if place.y > 0.737 {
        let mut paint = stripes(place.y);
        let hem = (place.y - 0.747).abs() - 0.009;
        let collar = 1.092 - place.y;
        paint = over(paint, BADGE, inside(hem.min(collar), 0.002));
        if front {
            let offset = flat - Vec2::new(0.0, 0.925);
            paint = over(paint, BADGE, inside(offset.length() - 0.082, 0.002));
            let ring = (offset.length() - 0.0755).abs() - 0.0018;
            paint = over(paint, STRIPE_A, inside(ring, 0.002));
            paint = over(paint, STAR, inside(star(offset, 0.062), 0.002));
        }
        return paint;
    }
    let mut paint = denim(uv * Vec2::new(140.0, 160.0));
    if front {
        // The fly, and pockets that open to the side.
        let fly = (flat.x - 0.004).abs() - 0.002;
        paint = over(paint, DENIM_DARK, inside(fly.max(flat.y - 0.70), 0.002));
        let curve = segment(flat, Vec2::new(0.030, 0.70), Vec2::new(0.030, 0.62)) - 0.002;
        paint = over(paint, THREAD, inside(curve, 0.002) * dashes(flat.y));
        let near = Vec2::new(flat.x.abs(), flat.y);
        let pocket = (near.distance(Vec2::new(0.165, 0.715)) - 0.075).abs();
        paint = over(paint, DENIM_DARK, inside(pocket - 0.002, 0.002));
        paint = over(paint, THREAD, inside((pocket - 0.006).abs() - 0.0015, 0.002));
    } else {
        let near = Vec2::new(flat.x.abs(), flat.y) - Vec2::new(0.082, 0.642);
        let pocket = (near.x.abs() - 0.045).max(near.y.abs() - 0.036 + 0.25 * near.x.abs());
        paint = over(paint, THREAD, inside(pocket.abs() - 0.0018, 0.002));
    }
    paint = seam(paint, place.z, place.y);
    let belt = (place.y - 0.718).abs() - 0.017;
    paint = over(paint, LEATHER, inside(belt, 0.002));
    if front {
        let offset = (flat - Vec2::new(0.0, 0.718)).abs();
        let buckle = (offset.x - 0.028).max(offset.y - 0.019);
        let hole = (offset.x - 0.018).max(offset.y - 0.010);
        paint = over(paint, BRASS, inside(buckle.max(-hole), 0.002));
    }
    paint
}

/// Distance of a five-pointed star, one point up.
fn star(offset: Vec2, radius: f32) -> f32 {
    let step = std::f32::consts::TAU / 5.0;
    let angle = offset.x.atan2(offset.y);
    // Folded to half a point: between its tip at angle 0 and the notch at half a step.
    let folded = ((angle / step).round() * step - angle).abs();
    let place = Vec2::from_angle(folded) * offset.length();
    let tip = Vec2::new(radius, 0.0);
    let notch = Vec2::from_angle(0.5 * step) * (0.48 * radius);
    let edge = (notch - tip).normalize();
    -edge.perp_dot(place - tip)
}

/// Cloth with a fine weave; `place` in threads.
fn denim(place: Vec2) -> Vec3 {
    DENIM * (0.93 + 0.14 * noise(place))
}

/// 1 on a stitch, 0 between two.
fn dashes(along: f32) -> f32 {
    inside(((along / 0.012).rem_euclid(1.0) - 0.5).abs() - 0.3, 0.2)
}

/// A seam where `across` is 0, with a row of stitches on each side.
fn seam(below: Vec3, across: f32, along: f32) -> Vec3 {
    let paint = over(below, DENIM_DARK, inside(across.abs() - 0.0018, 0.002));
    let row = (across.abs() - 0.007).abs() - 0.0016;
    over(paint, THREAD, inside(row, 0.002) * dashes(along))
}

/// Rosier towards the end of a part, a little darker at its back.
fn skin(uv: Vec2) -> Vec3 {
    let back = 0.5 + 0.5 * (std::f32::consts::TAU * uv.x).cos();
    over(SKIN, BLUSH, 0.32 * uv.y * uv.y) * (0.98 - 0.07 * back)
}

fn arm(place: Vec3) -> Vec3 {
    let distance = (place - SHOULDER).dot((WRIST - SHOULDER).normalize());
    if distance > 0.097 {
        let band = (distance - 0.352).abs() - 0.010;
        let paint = over(SKIN, STAR, inside(band, 0.002));
        // A little shade under the sleeve.
        return paint * (1.0 - 0.15 * (1.0 - (distance - 0.097) / 0.02).clamp(0.0, 1.0));
    }
    over(stripes(distance + 0.01), BADGE, inside((distance - 0.086).abs() - 0.009, 0.002))
}

fn leg(uv: Vec2, place: Vec3) -> Vec3 {
    if place.y < 0.1195 {
        return over(SOCK, STRIPE_B, inside((place.y - 0.108).abs() - 0.004, 0.002));
    }
    let weave = denim(uv * Vec2::new(60.0, 150.0));
    if place.y < 0.1765 {
        let paint =
            over(HEM * (weave / DENIM), DENIM, inside((place.y - 0.17).abs() - 0.002, 0.002));
        return over(
            paint,
            THREAD,
            inside((place.y - 0.130).abs() - 0.0016, 0.002) * dashes(place.z),
        );
    }
    // Worn a little at the knee.
    let worn = ((place.y - 0.37) / 0.075).powi(2) + ((uv.x - 0.5) / 0.16).powi(2);
    let paint = over(weave, HEM, 0.35 * (-worn).exp());
    seam(paint, place.z, place.y)
}

fn shoe(place: Vec3, normal: Vec3) -> Vec3 {
    let mut paint = SHOE;
    let toe = 0.118 - place.z;
    paint = over(paint, SOLE, inside(toe + 0.12 * (0.05 - place.y), 0.002));
    let heel = place.z + 0.062;
    paint = over(paint, SHOE * 0.72, inside(heel, 0.002));
    // Tongue and laces on the instep.
    let across = place.x - 0.106;
    if normal.y > 0.2 && (0.005..0.112).contains(&place.z) {
        paint = over(paint, SHOE * 0.78, inside(across.abs() - 0.024, 0.002));
        let lace = (((place.z - 0.01) / 0.024).rem_euclid(1.0) - 0.5).abs() * 0.024 - 0.004;
        paint = over(paint, WHITE, inside(lace.max(across.abs() - 0.031), 0.002));
    }
    // A stripe on each side, then the sole.
    let slant = (place.z + 0.5 * place.y - 0.045).abs() - 0.009;
    if normal.y < 0.75 {
        paint = over(paint, STAR, inside(slant.max(place.y - 0.085), 0.002));
    }
    let line = (place.y - 0.021).abs() - 0.002;
    paint = over(paint, SOLE, inside(place.y - 0.023, 0.002));
    // The line fades at the toe, where facets would bend it.
    over(paint, STRIPE_B, inside(line, 0.002) * inside(place.z - 0.135, 0.02))
}
