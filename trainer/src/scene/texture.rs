//! Images prepared for area sampling: a chain of halved images, averaged as stored (sRGB) and
//! weighted by alpha, so that texels nobody sees lend no colour.

use glam::{Vec2, Vec4};

use crate::model::{Texture, Wrap};

/// Most samples along the long axis of a footprint. A longer one is sampled coarser, which blurs
/// across it: triangles more than this many times shorter in view than they are deep.
const MAX_TAPS: f32 = 8.0;

/// A texel's 1.
const FULL: f32 = u16::MAX as f32;

/// The part of a texture that one sample averages: a parallelogram around a point, spanned by
/// two displacements in uv units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Footprint {
    /// One side.
    pub along: Vec2,
    /// The other side.
    pub across: Vec2,
}

impl Footprint {
    /// No area: a magnified sample.
    pub const POINT: Self = Self { along: Vec2::ZERO, across: Vec2::ZERO };

    /// Its sides, for an image of `size` texels, in texels.
    fn sides(&self, size: Vec2) -> [Vec2; 2] {
        [self.along * size, self.across * size]
    }

    /// The rectangle with the same second moments, for an image of `size` texels: its long side,
    /// and the length of its short one, in texels.
    fn axes(&self, size: Vec2) -> (Vec2, f32) {
        let [s, t] = self.sides(size);
        // Eigenvalues and the larger one's vector of s·sᵀ + t·tᵀ = [[a, b], [b, c]].
        let (a, b, c) = (s.x * s.x + t.x * t.x, s.x * s.y + t.x * t.y, s.y * s.y + t.y * t.y);
        let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
        let radius = (half * half + b * b).sqrt();
        let vector =
            if half > 0.0 { Vec2::new(half + radius, b) } else { Vec2::new(b, radius - half) };
        let long = vector.normalize_or(Vec2::X) * (mean + radius).sqrt();
        (long, (mean - radius).max(0.0).sqrt())
    }
}

/// A texture as it is sampled.
pub(super) struct MipChain {
    /// The image, then halves of it down to 1 × 1.
    levels: Vec<Level>,
    wrap: [Wrap; 2],
    nearest: bool,
    /// Whether every texel's alpha is 1.
    opaque: bool,
}

/// One image of the chain: straight RGBA, 65535 is 1 (so that 8-bit values are exact).
struct Level {
    width: u32,
    height: u32,
    texels: Vec<[u16; 4]>,
}

impl MipChain {
    /// Prepares `texture`; its alpha counts as 1 everywhere unless `with_alpha`.
    pub(super) fn new(texture: &Texture, with_alpha: bool) -> Self {
        let texels: Vec<[u16; 4]> = texture
            .image
            .pixels()
            .map(|pixel| {
                let [r, g, b, a] = pixel.0.map(|value| u16::from(value) * 257);
                [r, g, b, if with_alpha { a } else { u16::MAX }]
            })
            .collect();
        let opaque = texels.iter().all(|texel| texel[3] == u16::MAX);
        let (width, height) = texture.image.dimensions();
        let mut levels = vec![Level { width, height, texels }];
        while let Some(half) = levels.last().and_then(Level::halved) {
            levels.push(half);
        }
        Self { levels, wrap: texture.wrap, nearest: texture.nearest, opaque }
    }

    pub(super) fn is_opaque(&self) -> bool {
        self.opaque
    }

    /// Mean colour (sRGB, weighted by alpha) and alpha over `footprint` around `uv`: some samples
    /// along its long axis, each bilinear in two images of the chain. White where the image
    /// has no texel.
    pub(super) fn sample(&self, uv: Vec2, footprint: &Footprint) -> Vec4 {
        let first = &self.levels[0];
        if first.texels.is_empty() || !uv.is_finite() {
            return Vec4::ONE;
        }
        let size = Vec2::new(first.width as f32, first.height as f32);
        let [s, t] = footprint.sides(size);
        if s.length_squared() + t.length_squared() <= 1.0 {
            // No axis is longer than a texel: what follows would come to the same.
            return straight(self.sample_level(uv, 0.0));
        }
        let (long, short) = footprint.axes(size);
        let length = long.length();
        if !length.is_finite() {
            return straight(self.sample_level(uv, f32::MAX));
        }
        // A texel is the least that is averaged, so a magnified sample is one tap.
        let taps = floor((length / short.max(1.0) + 0.5).clamp(1.0, MAX_TAPS));
        let level = (length / taps).max(short).log2();
        if taps == 1.0 {
            return straight(self.sample_level(uv, level));
        }
        let step = long / (size * taps);
        let first_tap = uv - 0.5 * (taps - 1.0) * step;
        let mut sum = Vec4::ZERO;
        for tap in 0..taps as u32 {
            sum += self.sample_level(first_tap + tap as f32 * step, level);
        }
        straight(sum / taps)
    }

    /// As [`Level::premultiplied`], between two images of the chain; `level` is log₂ of texels.
    fn sample_level(&self, uv: Vec2, level: f32) -> Vec4 {
        if level <= 0.0 {
            return if self.nearest {
                self.levels[0].nearest(uv, self.wrap)
            } else {
                self.levels[0].bilinear(uv, self.wrap)
            };
        }
        let last = self.levels.len() - 1;
        let fine = (level as usize).min(last);
        let share = level.min(last as f32) - fine as f32;
        let sample = self.levels[fine].bilinear(uv, self.wrap);
        if share == 0.0 || fine == last {
            return sample;
        }
        mix(sample, self.levels[fine + 1].bilinear(uv, self.wrap), share)
    }
}

impl Level {
    /// Each texel the mean over its area, also where a side is odd; `None` for a single texel.
    fn halved(&self) -> Option<Self> {
        if self.width <= 1 && self.height <= 1 || self.texels.is_empty() {
            return None;
        }
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let columns = halving_weights(self.width, width);
        let rows = halving_weights(self.height, height);
        let mut texels = Vec::with_capacity(width as usize * height as usize);
        for row in &rows {
            for column in &columns {
                let (mut premultiplied, mut plain) = (Vec4::ZERO, Vec4::ZERO);
                for &(y, weight_y) in row {
                    for &(x, weight_x) in column {
                        let weight = weight_x * weight_y;
                        premultiplied += weight * self.premultiplied(x, y);
                        plain += weight * self.stored(x, y);
                    }
                }
                // Where nothing is seen any colour would do; the plain mean is the tamest.
                let mean =
                    if premultiplied.w > 0.0 { FULL * straight(premultiplied) } else { plain };
                texels.push(mean.to_array().map(|value| value.round() as u16));
            }
        }
        Some(Self { width, height, texels })
    }

    /// Straight RGBA; 65535 is 1.
    fn stored(&self, x: u32, y: u32) -> Vec4 {
        let texel = self.texels[y as usize * self.width as usize + x as usize];
        Vec4::from_array(texel.map(f32::from))
    }

    /// RGB times alpha, and alpha; 65535 is 1.
    fn premultiplied(&self, x: u32, y: u32) -> Vec4 {
        let texel = self.stored(x, y);
        if texel.w == FULL { texel } else { (texel * (texel.w / FULL)).with_w(texel.w) }
    }

    /// As [`Self::premultiplied`], of the texel that `uv` is in.
    fn nearest(&self, uv: Vec2, wrap: [Wrap; 2]) -> Vec4 {
        let x = wrap_coordinate(uv.x, wrap[0]) * self.width as f32;
        let y = wrap_coordinate(uv.y, wrap[1]) * self.height as f32;
        self.premultiplied(
            wrap_index(x as i32, self.width, wrap[0]),
            wrap_index(y as i32, self.height, wrap[1]),
        )
    }

    /// As [`Self::premultiplied`], between the four texels around `uv`.
    fn bilinear(&self, uv: Vec2, wrap: [Wrap; 2]) -> Vec4 {
        let x = wrap_coordinate(uv.x, wrap[0]) * self.width as f32 - 0.5;
        let y = wrap_coordinate(uv.y, wrap[1]) * self.height as f32 - 0.5;
        let (left, top) = (floor(x), floor(y));
        let [x0, x1] = [0, 1].map(|i| wrap_index(left as i32 + i, self.width, wrap[0]));
        let [y0, y1] = [0, 1].map(|i| wrap_index(top as i32 + i, self.height, wrap[1]));
        let upper = mix(self.premultiplied(x0, y0), self.premultiplied(x1, y0), x - left);
        let lower = mix(self.premultiplied(x0, y1), self.premultiplied(x1, y1), x - left);
        mix(upper, lower, y - top)
    }
}

/// Between `a` and `b`; exactly `a` where they are equal.
fn mix(a: Vec4, b: Vec4, share: f32) -> Vec4 {
    a + share * (b - a)
}

/// For each of `to` texels, which of `from` it covers and with which share of it.
fn halving_weights(from: u32, to: u32) -> Vec<Vec<(u32, f32)>> {
    // In units of 1/to of a source texel everything is whole.
    (0..to)
        .map(|i| {
            let (start, end) = (i * from, (i + 1) * from);
            (start / to..end.div_ceil(to))
                .map(|x| {
                    let covered = end.min((x + 1) * to) - start.max(x * to);
                    (x, covered as f32 / from as f32)
                })
                .collect()
        })
        .collect()
}

/// The greatest whole number not above `x`, without a call on targets that have no instruction
/// for it: this is the innermost loop.
fn floor(x: f32) -> f32 {
    // From here on every number is whole.
    if x.abs() >= 8_388_608.0 {
        return x;
    }
    let truncated = x as i32 as f32;
    if truncated > x { truncated - 1.0 } else { truncated }
}

/// Into [0, 1], or [0, 2] for mirrored tiles.
fn wrap_coordinate(coordinate: f32, wrap: Wrap) -> f32 {
    match wrap {
        Wrap::Repeat => coordinate - floor(coordinate),
        Wrap::Mirror => coordinate - 2.0 * floor(0.5 * coordinate),
        Wrap::Clamp => coordinate.clamp(0.0, 1.0),
    }
}

/// The texel that stands for index `i` of a row of `count`. A wrapped coordinate leads at most one
/// texel outside the tile (or the pair of mirrored tiles), so one turn is enough.
fn wrap_index(i: i32, count: u32, wrap: Wrap) -> u32 {
    let count = count as i32;
    let turned = |i: i32, period: i32| match i {
        i if i < 0 => i + period,
        i if i >= period => i - period,
        i => i,
    };
    let wrapped = match wrap {
        Wrap::Repeat => turned(i, count),
        Wrap::Mirror => {
            let i = turned(i, 2 * count);
            if i < count { i } else { 2 * count - 1 - i }
        }
        Wrap::Clamp => i.clamp(0, count - 1),
    };
    wrapped as u32
}

/// From premultiplied values of which 65535 is 1 to straight ones of which 1 is.
fn straight(premultiplied: Vec4) -> Vec4 {
    let alpha = premultiplied.w;
    let divisor = if alpha > 0.0 { alpha } else { FULL };
    (premultiplied / divisor).with_w(alpha / FULL)
}
