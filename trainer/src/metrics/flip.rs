//! FLIP: the difference that a person sees when two pictures alternate in one place.
//!
//! LDR-FLIP of Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", 2020, in
//! the version of the authors' reference implementation (filters clamped at the frame's edges).
//! Two pipelines see the 8-bit pictures: one blurs away colour that the eye cannot resolve at the
//! viewing distance and measures what is left as a distance in CIELab; the other compares edges
//! and points of the lightness. The second amplifies the first.

use std::sync::LazyLock;

use super::Rect;

/// Pixels per degree of visual angle that the paper assumes: a screen of 3840 pixels and 0.7 m
/// width seen from 0.7 m, 0.7 · 3840 / 0.7 · π / 180.
pub const PIXELS_PER_DEGREE: f32 = 67.020_64;

/// Exponent of the colour difference, q_c.
const COLOR_EXPONENT: f32 = 0.7;
/// Share of the greatest colour difference up to which most of the range is spent, p_c.
const KNEE_INPUT: f32 = 0.4;
/// What that difference becomes, p_t.
const KNEE_OUTPUT: f32 = 0.95;
/// Width of the feature detectors in degrees, w; their σ is half of it.
const FEATURE_WIDTH: f32 = 0.082;

/// Widths of the contrast sensitivity function's Gaussians, b, in degrees squared.
const ACHROMATIC_B: f32 = 0.0047;
const RED_GREEN_B: f32 = 0.0053;
/// Blue-yellow is the sum of two, (a, b) each.
const BLUE_YELLOW: [(f32, f32); 2] = [(34.1, 0.04), (13.5, 0.025)];

/// Linear sRGB → CIE XYZ (D65), the fractions that follow exactly from the primaries.
const TO_XYZ: [[f32; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// CIE XYZ (D65) → linear sRGB, the inverse of [`TO_XYZ`].
const FROM_XYZ: [[f32; 3]; 3] = [
    [3.241_003_3, -1.537_398_9, -0.498_615_9],
    [-0.969_224_3, 1.875_93, 0.041_554_226],
    [0.055_639_423, -0.204_011_2, 1.057_149],
];

/// Linear light of the 256 sRGB values.
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|value| {
        let value = value as f32 / 255.0;
        if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
    })
});

/// Mean FLIP over the frame, in [0, 1], at [`PIXELS_PER_DEGREE`]; 0 where the pictures are equal.
///
/// Both pictures hold (r, g, b) of each pixel, row-major. With a `region`, outside which the
/// pictures must be equal, only it and a margin are worked on; the mean is over the frame all the
/// same. A frame or region without pixels gives 0.
///
/// # Panics
///
/// Where a picture does not hold 3 · `width` · `height` values.
pub fn flip(reference: &[u8], test: &[u8], width: u32, height: u32, region: Option<Rect>) -> f64 {
    let pixels = width as usize * height as usize;
    assert!(reference.len() == 3 * pixels && test.len() == 3 * pixels, "two pictures of one size");
    let filters = Filters::new(PIXELS_PER_DEGREE);
    let region = region.unwrap_or(Rect::frame(width, height)).dilated(0, width, height);
    if region.pixels() == 0 {
        return 0.0;
    }
    // Differences spread by a radius, and the pixels they reach see a radius further. Beyond,
    // the pictures are equal, where clamping at the wrong edge still gives no difference.
    let area = region.dilated(2 * filters.radius as u32, width, height);
    let [reference, test] =
        [reference, test].map(|rgb| Seen::new(&crop(rgb, width as usize, area), area, &filters));
    let greatest = color_difference([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]).powf(COLOR_EXPONENT);
    let sum: f64 = (0..area.pixels())
        .map(|at| {
            if reference.rgb[at] == test.rgb[at] {
                return 0.0;
            }
            let difference = color_difference(reference.rgb[at], test.rgb[at]);
            let color = spread(difference.powf(COLOR_EXPONENT), greatest);
            let edge = (reference.edges[at] - test.edges[at]).abs();
            let point = (reference.points[at] - test.points[at]).abs();
            // Exponent q_f of the feature difference is 0.5.
            let feature = (edge.max(point) * std::f32::consts::FRAC_1_SQRT_2).sqrt();
            f64::from(color.powf(1.0 - feature))
        })
        .sum();
    sum / pixels as f64
}

/// Maps a colour difference to [0, 1], so that the few greatest ones take little of the range.
fn spread(difference: f32, greatest: f32) -> f32 {
    let knee = KNEE_INPUT * greatest;
    if difference < knee {
        KNEE_OUTPUT / knee * difference
    } else {
        KNEE_OUTPUT + (difference - knee) / (greatest - knee) * (1.0 - KNEE_OUTPUT)
    }
}

/// HyAB distance of two linear sRGB colours in Hunt-adjusted CIELab.
fn color_difference(a: [f32; 3], b: [f32; 3]) -> f32 {
    let ([l0, a0, b0], [l1, a1, b1]) = (hunt_lab(a), hunt_lab(b));
    (l0 - l1).abs() + ((a0 - a1).powi(2) + (b0 - b1).powi(2)).sqrt()
}

/// Linear sRGB → CIELab, whose chroma shrinks in the dark (Hunt's effect): a, b times 0.01·L.
fn hunt_lab(rgb: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = to_relative_xyz(rgb).map(|t| {
        const DELTA: f32 = 6.0 / 29.0;
        let cube = DELTA * DELTA * DELTA;
        if t > cube { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    });
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    [lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z)]
}

/// XYZ relative to white.
fn to_relative_xyz(rgb: [f32; 3]) -> [f32; 3] {
    TO_XYZ.map(|row| dot(row, rgb) / dot(row, [1.0; 3]))
}

/// XYZ relative to white → linear sRGB.
fn from_relative_xyz(xyz: [f32; 3]) -> [f32; 3] {
    let scaled = [0, 1, 2].map(|i| xyz[i] * dot(TO_XYZ[i], [1.0; 3]));
    FROM_XYZ.map(|row| dot(row, scaled))
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn crop(rgb: &[u8], frame_width: usize, area: Rect) -> Vec<[u8; 3]> {
    let rows = rgb.chunks_exact(3 * frame_width).skip(area.y as usize).take(area.height as usize);
    let pixels =
        rows.flat_map(|row| row.chunks_exact(3).skip(area.x as usize).take(area.width as usize));
    pixels.map(|p| [p[0], p[1], p[2]]).collect()
}

/// A picture after the eye's filters.
struct Seen {
    /// Linear sRGB in [0, 1] of what the eye resolves.
    rgb: Vec<[f32; 3]>,
    /// Strength of lightness edges, in [0, √2].
    edges: Vec<f32>,
    /// Strength of lightness points.
    points: Vec<f32>,
}

impl Seen {
    fn new(pixels: &[[u8; 3]], area: Rect, filters: &Filters) -> Self {
        let width = area.width as usize;
        let mut planes: [Vec<f32>; 3] = std::array::from_fn(|_| Vec::with_capacity(pixels.len()));
        for pixel in pixels {
            // YCxCz, the linear kin of CIELab; here without its offset and factors, lightness
            // being Y in [0, 1]: filters that sum to 1 commute with both.
            let [x, y, z] = to_relative_xyz(pixel.map(|value| LINEAR[usize::from(value)]));
            for (plane, value) in planes.iter_mut().zip([y, x - y, y - z]) {
                plane.push(value);
            }
        }
        let blur = |plane: &[f32], taps: &[f32]| {
            columns(&rows(plane, width, taps, false), width, taps, false)
        };
        let [lightness, cx, cz] = &planes;
        let (y, cx) = (blur(lightness, &filters.achromatic), blur(cx, &filters.red_green));
        let (wide, narrow) = (blur(cz, &filters.yellow[0]), blur(cz, &filters.yellow[1]));
        let rgb = (0..pixels.len())
            .map(|at| {
                let cz = filters.shares[0] * wide[at] + filters.shares[1] * narrow[at];
                from_relative_xyz([y[at] + cx[at], y[at], y[at] - cz])
                    .map(|value| value.clamp(0.0, 1.0))
            })
            .collect();

        let smooth = rows(lightness, width, &filters.smooth, false);
        let length = |along: &[f32], odd: bool, taps: &[f32]| -> Vec<f32> {
            let x = columns(&rows(lightness, width, along, odd), width, &filters.smooth, false);
            let y = columns(&smooth, width, taps, odd);
            x.iter().zip(&y).map(|(x, y)| (x * x + y * y).sqrt()).collect()
        };
        let edges = length(&filters.edge, true, &filters.edge);
        let points = length(&filters.point, false, &filters.point);
        Self { rgb, edges, points }
    }
}

/// Taps 0..=radius of the separable filters; the other half mirrors them.
struct Filters {
    achromatic: Vec<f32>,
    red_green: Vec<f32>,
    yellow: [Vec<f32>; 2],
    /// Weights of the two Gaussians of blue-yellow; they add up to 1.
    shares: [f32; 2],
    /// Gaussian across an edge or point.
    smooth: Vec<f32>,
    /// First derivative of the Gaussian (odd), halves summing to ±1.
    edge: Vec<f32>,
    /// Second derivative, positive and negative taps summing to ±1.
    point: Vec<f32>,
    /// Greatest radius in pixels.
    radius: usize,
}

impl Filters {
    fn new(pixels_per_degree: f32) -> Self {
        // All colour filters share the radius of the widest: 3σ of exp(−π²x²/b), σ² = b / (2π²).
        let widest = BLUE_YELLOW[0].1;
        let pi = std::f32::consts::PI;
        let radius = (3.0 * (widest / (2.0 * pi * pi)).sqrt() * pixels_per_degree).ceil() as usize;
        let color = |b: f32| -> Vec<f32> {
            let exponent = |d: usize| -(pi * d as f32 / pixels_per_degree).powi(2) / b;
            (0..=radius).map(|d| exponent(d).exp()).collect()
        };
        // The two-dimensional sum of a Gaussian is the square of the one-dimensional one.
        let volumes =
            BLUE_YELLOW.map(|(a, b)| a * (pi / b).sqrt() * mirrored_sum(&color(b)).powi(2));
        let shares = volumes.map(|volume| volume / (volumes[0] + volumes[1]));

        let sigma = 0.5 * FEATURE_WIDTH * pixels_per_degree;
        let feature_radius = (3.0 * sigma).ceil() as usize;
        let squared = |d: usize| (d as f32 / sigma).powi(2);
        let gaussian: Vec<f32> = (0..=feature_radius).map(|d| (-squared(d) / 2.0).exp()).collect();
        let edge: Vec<f32> = gaussian.iter().enumerate().map(|(d, g)| d as f32 * g).collect();
        let edge_sum: f32 = edge.iter().sum();
        let point: Vec<f32> =
            gaussian.iter().enumerate().map(|(d, g)| (squared(d) - 1.0) * g).collect();
        let halves = [f32::max, f32::min].map(|side| {
            mirrored_sum(&point.iter().map(|&tap| side(tap, 0.0)).collect::<Vec<_>>()).abs()
        });
        Self {
            achromatic: normalized(color(ACHROMATIC_B)),
            red_green: normalized(color(RED_GREEN_B)),
            yellow: BLUE_YELLOW.map(|(_, b)| normalized(color(b))),
            shares,
            smooth: normalized(gaussian),
            edge: edge.iter().map(|tap| tap / edge_sum).collect(),
            point: point.iter().map(|tap| tap / halves[usize::from(*tap < 0.0)]).collect(),
            radius: radius.max(feature_radius),
        }
    }
}

/// Sum of a symmetric filter.
fn mirrored_sum(taps: &[f32]) -> f32 {
    taps[0] + 2.0 * taps[1..].iter().sum::<f32>()
}

fn normalized(taps: Vec<f32>) -> Vec<f32> {
    let sum = mirrored_sum(&taps);
    taps.iter().map(|tap| tap / sum).collect()
}

/// Filters along rows, clamped at the edges. An odd filter weights what is to the left by −taps.
fn rows(plane: &[f32], width: usize, taps: &[f32], odd: bool) -> Vec<f32> {
    let radius = taps.len() - 1;
    let mut out = vec![0.0; plane.len()];
    let mut padded = vec![0.0; width + 2 * radius];
    for (row, out) in plane.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
        padded[..radius].fill(row[0]);
        padded[radius..radius + width].copy_from_slice(row);
        padded[radius + width..].fill(row[width - 1]);
        accumulate(out, taps, odd, |d| (&padded[radius - d..], &padded[radius + d..]));
    }
    out
}

/// Filters along columns, clamped at the edges. An odd filter weights what is above by −taps.
fn columns(plane: &[f32], width: usize, taps: &[f32], odd: bool) -> Vec<f32> {
    let last = plane.len() / width - 1;
    let mut out = vec![0.0; plane.len()];
    for (y, out) in out.chunks_exact_mut(width).enumerate() {
        accumulate(out, taps, odd, |d| {
            let (above, below) = (y.saturating_sub(d), (y + d).min(last));
            (&plane[above * width..], &plane[below * width..])
        });
    }
    out
}

/// out += Σ taps[d] · (before(d) ± after(d)).
fn accumulate<'a>(
    out: &mut [f32],
    taps: &[f32],
    odd: bool,
    sides: impl Fn(usize) -> (&'a [f32], &'a [f32]),
) {
    for (d, &tap) in taps.iter().enumerate() {
        let (before, after) = sides(d);
        // The middle tap has one side only; for an odd filter it is 0.
        let sign = if d == 0 {
            0.0
        } else if odd {
            -tap
        } else {
            tap
        };
        for ((out, before), after) in out.iter_mut().zip(before).zip(after) {
            *out += sign * before + tap * after;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::noise;

    const WIDTH: u32 = 48;
    const HEIGHT: u32 = 32;

    fn filled(color: [u8; 3]) -> Vec<u8> {
        color.repeat((WIDTH * HEIGHT) as usize)
    }

    /// A red disc on light noise.
    fn disc(shift: i32) -> Vec<u8> {
        let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
        let colors = pixels.flat_map(|(x, y)| {
            let (dx, dy) = (x as i32 - 20 - shift, y as i32 - 16);
            [0, 1, 2].map(|channel| {
                let noise = (noise::unit(3 * (y * WIDTH + x) + channel) * 40.0) as u8;
                let red = [220, 40, 60][channel as usize];
                if dx * dx + dy * dy < 81 { red } else { 200 + noise }
            })
        });
        colors.collect()
    }

    fn static_noise(seed: u32) -> Vec<u8> {
        (0..3 * WIDTH * HEIGHT).map(|i| (noise::unit(seed + i) * 255.99) as u8).collect()
    }

    #[test]
    fn equals_the_reference_implementation() {
        // Expected values: the authors' C++ implementation, at the same pixels per degree.
        for (reference, test, expected) in [
            (filled([0; 3]), filled([255; 3]), 0.967_387_86),
            (filled([0, 255, 0]), filled([0, 0, 255]), 1.0),
            (filled([100; 3]), filled([110; 3]), 0.153_504_22),
            (disc(0), disc(3), 0.155_443_46),
            (disc(0), disc(1), 0.071_288_58),
            (static_noise(1), static_noise(10_000), 0.449_133_72),
        ] {
            let value = flip(&reference, &test, WIDTH, HEIGHT, None);
            assert!((value - expected).abs() < 2e-5, "{value} {expected}");
            let swapped = flip(&test, &reference, WIDTH, HEIGHT, None);
            assert!((value - swapped).abs() < 1e-6, "{value} {swapped}");
        }
    }

    #[test]
    fn equal_pictures_do_not_differ() {
        assert_eq!(flip(&disc(0), &disc(0), WIDTH, HEIGHT, None), 0.0);
        assert_eq!(flip(&[], &[], 0, 0, None), 0.0);
        assert_eq!(flip(&[1, 2, 3], &[1, 2, 3], 1, 1, None), 0.0);
    }

    #[test]
    fn a_region_gives_the_mean_of_the_frame() {
        let (width, height) = (120, 100);
        let reference = vec![230; 3 * width * height];
        let mut test = reference.clone();
        let region = Rect { x: 60, y: 0, width: 10, height: 20 };
        for (row, column) in (0..20).flat_map(|row| (60..70).map(move |column| (row, column))) {
            test[3 * (row * width + column) + 1] = (7 * row + 11 * column) as u8;
        }
        let size = (width as u32, height as u32);
        let whole = flip(&reference, &test, size.0, size.1, None);
        let part = flip(&reference, &test, size.0, size.1, Some(region));
        assert!(whole > 0.005);
        assert!((whole - part).abs() < 1e-9, "{whole} {part}");
    }
}
