//! The figure's surface: rounded cones, points on them, their colours.

use glam::{DVec3, dvec3};

use crate::optimize::schedule::Random;

const SKIN: DVec3 = dvec3(0.80, 0.60, 0.50);
const SHIRT: DVec3 = dvec3(0.20, 0.35, 0.70);
const TROUSERS: DVec3 = dvec3(0.25, 0.25, 0.30);
const SHOE: DVec3 = dvec3(0.12, 0.10, 0.10);
const HAIR: DVec3 = dvec3(0.25, 0.16, 0.10);

/// A cone between two half balls.
#[derive(Clone, Copy)]
struct Part {
    /// Centres of the balls, metres.
    ends: [DVec3; 2],
    /// Radii of the balls, metres.
    radii: [f64; 2],
    /// sRGB.
    color: DVec3,
}

const fn part(start: [f64; 3], end: [f64; 3], radii: [f64; 2], color: DVec3) -> Part {
    Part { ends: [DVec3::from_array(start), DVec3::from_array(end)], radii, color }
}

/// Chest, hips, neck, head.
const MIDDLE: [Part; 4] = [
    part([0.0, 1.00, 0.0], [0.0, 1.38, 0.0], [0.155, 0.165], SHIRT),
    part([0.0, 0.90, 0.0], [0.0, 1.02, 0.0], [0.16, 0.15], TROUSERS),
    part([0.0, 1.40, 0.0], [0.0, 1.52, 0.0], [0.055, 0.055], SKIN),
    part([0.0, 1.58, 0.0], [0.0, 1.60, 0.0], [0.095, 0.10], SKIN),
];

/// Upper arm, lower arm, hand, upper leg, lower leg, foot on the side of +X; the others mirror them.
const SIDE: [Part; 6] = [
    part([0.19, 1.40, 0.0], [0.36, 1.16, 0.0], [0.055, 0.045], SHIRT),
    part([0.36, 1.16, 0.0], [0.52, 0.94, 0.05], [0.042, 0.035], SKIN),
    part([0.54, 0.90, 0.06], [0.57, 0.85, 0.07], [0.04, 0.03], SKIN),
    part([0.095, 0.90, 0.0], [0.12, 0.50, 0.01], [0.09, 0.06], TROUSERS),
    part([0.12, 0.50, 0.01], [0.13, 0.09, 0.0], [0.058, 0.042], TROUSERS),
    part([0.13, 0.045, -0.02], [0.14, 0.045, 0.15], [0.045, 0.04], SHOE),
];

/// The plastic number's inverse and its square: steps of the R2 sequence (Roberts 2018), which
/// fills a square evenly.
const R2: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];

/// A place on the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Metres.
    pub(super) position: DVec3,
    /// Outward, unit.
    pub(super) normal: DVec3,
    /// Of its part, sRGB.
    color: DVec3,
}

fn parts() -> Vec<Part> {
    let mirrored = |part: &Part, side: f64| Part {
        ends: part.ends.map(|end| end * dvec3(side, 1.0, 1.0)),
        ..*part
    };
    let sides =
        [-1.0, 1.0].into_iter().flat_map(|side| SIDE.iter().map(move |p| mirrored(p, side)));
    MIDDLE.into_iter().chain(sides).collect()
}

/// `count` points, in each part as many as its share of the area says (the first takes what rounding
/// leaves), and the area in m².
pub(super) fn points(count: u32, random: &mut Random) -> (Vec<Point>, f64) {
    let parts = parts();
    let area: f64 = parts.iter().map(Part::area).sum();
    let mut counts: Vec<u32> =
        parts.iter().map(|part| (f64::from(count) * part.area() / area) as u32).collect();
    counts[0] += count - counts.iter().sum::<u32>();
    let mut points = Vec::with_capacity(count as usize);
    for (part, count) in parts.iter().zip(counts) {
        let start = f64::from(random.unit());
        points.extend((0..count).map(|k| {
            let [along, around] = R2.map(|step| (f64::from(k) + start) * step % 1.0);
            part.point(along, around)
        }));
    }
    (points, area)
}

/// Two unit directions at right angles to a unit direction and to each other.
pub(super) fn around(axis: DVec3) -> (DVec3, DVec3) {
    let other = if axis.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let u = axis.cross(other).normalize();
    (u, axis.cross(u))
}

/// Paint, light from above, and a pattern; not clamped.
pub(super) fn color(point: &Point) -> DVec3 {
    let [x, y, z] = point.position.to_array();
    let is_hair = y > 1.60 || (y > 1.52 && z < -0.02);
    let paint = if is_hair { HAIR } else { point.color };
    let light = 0.65 + 0.35 * point.normal.dot(dvec3(0.4, 0.7, 0.59)).clamp(-1.0, 1.0);
    let pattern =
        0.12 * libm::sin(y * 90.0) * libm::sin(x * 70.0) + 0.08 * libm::sin(z * 130.0 + y * 40.0);
    paint * light + 0.8 * pattern
}

impl Part {
    fn length(&self) -> f64 {
        self.ends[0].distance(self.ends[1])
    }

    /// Of cone and half balls, m².
    fn area(&self) -> f64 {
        let [a, b] = self.radii;
        let slant = (self.length() * self.length() + (a - b) * (a - b)).sqrt();
        std::f64::consts::PI * ((a + b) * slant + 2.0 * (a * a + b * b))
    }

    /// The point at shares `along` of the surface, from end to end, and `around` of a turn. The cone's
    /// normals are taken as a cylinder's: its radii differ little.
    fn point(&self, along: f64, around: f64) -> Point {
        let axis = (self.ends[1] - self.ends[0]) / self.length();
        let (u, v) = self::around(axis);
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * around);
        let radial = u * cos + v * sin;
        let [a, b] = self.radii;
        let (first, last) = (2.0 * a * a, 2.0 * b * b);
        let side = (a + b) * self.length();
        // Areas over π, up to this point.
        let reached = along * (first + side + last);
        let on_ball = |end: usize, height: f64, outward: DVec3| {
            let normal = radial * (1.0 - height * height).max(0.0).sqrt() + outward * height;
            (self.ends[end] + normal * self.radii[end], normal)
        };
        // A ball's area grows evenly with its height (Archimedes).
        let (position, normal) = if reached < first {
            on_ball(0, 1.0 - reached / first, -axis)
        } else if reached < first + side {
            let share = (reached - first) / side;
            let radius = a + (b - a) * share;
            (self.ends[0].lerp(self.ends[1], share) + radial * radius, radial)
        } else {
            on_ball(1, (reached - first - side) / last, axis)
        };
        Point { position, normal, color: self.color }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_lie_on_their_part() {
        for part in parts() {
            let [a, b] = part.radii;
            for i in 0..500 {
                let p = part.point(f64::from(i) / 500.0, f64::from(i) * 0.618 % 1.0);
                assert!((p.normal.length() - 1.0).abs() < 1e-12);
                let axis = (part.ends[1] - part.ends[0]) / part.length();
                let along = (p.position - part.ends[0]).dot(axis).clamp(0.0, part.length());
                let distance = p.position.distance(part.ends[0] + axis * along);
                let radius = a + (b - a) * along / part.length();
                assert!((distance - radius).abs() < 1e-9, "{distance} {radius}");
            }
        }
    }

    #[test]
    fn the_figure_is_symmetric_and_1_7_metres_high() {
        let (points, area) = points(20_000, &mut Random::new(1));
        assert_eq!(points.len(), 20_000);
        assert!((area - 2.798).abs() < 1e-3, "{area} m²");
        let sum: DVec3 = points.iter().map(|p| p.position).sum();
        assert!((sum.x / 20_000.0).abs() < 1e-3, "{sum}");
        let heights = points.iter().map(|p| p.position.y);
        let (low, high) = heights.fold((9.0, -9.0), |(l, h): (f64, f64), y| (l.min(y), h.max(y)));
        assert!(low.abs() < 0.01 && (high - 1.7).abs() < 0.01, "{low} {high}");
    }
}
