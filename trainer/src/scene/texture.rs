//! Images prepared for area sampling: a chain of halved images, averaged as stored (sRGB) and
//! weighted by alpha, so that texels nobody sees lend no colour.

use glam::{Vec2, Vec4};

use crate::model::{Texture, Wrap};

/// Most samples along the long axis of a footprint. A longer one is sampled coarser, which blurs
/// across it: triangles more than this many times shorter in view than they are deep.
const MAX_TAPS: f32 = 8.0;

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

    /// The rectangle with the same second moments, for an image of `size` texels: its long side,
    /// and the length of its short one, in texels.
    fn axes(&self, size: Vec2) -> (Vec2, f32) {
        let (s, t) = (self.along * size, self.across * size);
        // Eigenvalues and the larger one's vector of s·sᵀ + t·tᵀ = [[a, b], [b, c]].
        let (a, b, c) = (s.x * s.x + t.x * t.x, s.x * s.y + t.x * t.y, s.y * s.y + t.y * t.y);
        let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
        let radius = half.hypot(b);
        let vector = if half > 0.0 {
            Vec2::new(half + radius, b)
        } else {
            Vec2::new(b, radius - half)
        };
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
        let (long, short) = footprint.axes(size);
        let length = long.length();
        if !length.is_finite() {
            return straight(self.sample_level(uv, f32::MAX));
        }
        // A texel is the least that is averaged, so a magnified sample is one tap.
        let taps = (length / short.max(1.0)).round().clamp(1.0, MAX_TAPS);
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

    /// Premultiplied sample between two images of the chain; `level` is log₂ of texels.
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
        sample.lerp(self.levels[fine + 1].bilinear(uv, self.wrap), share)
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
                let alpha = premultiplied.w;
                // Where nothing is seen any colour would do; the plain mean is the tamest.
                let mean = if alpha > 0.0 { premultiplied / alpha } else { plain };
                texels.push(
                    mean.with_w(alpha)
                        .to_array()
                        .map(|value| (value * f32::from(u16::MAX)).round() as u16),
                );
            }
        }
        Some(Self { width, height, texels })
    }

    /// Straight RGBA in [0, 1].
    fn stored(&self, x: u32, y: u32) -> Vec4 {
        let texel = self.texels[y as usize * self.width as usize + x as usize];
        Vec4::from_array(texel.map(f32::from)) / f32::from(u16::MAX)
    }

    /// RGB times alpha, and alpha.
    fn premultiplied(&self, x: u32, y: u32) -> Vec4 {
        let texel = self.stored(x, y);
        // Exact for alpha 1: x · 1 = x.
        (texel * texel.w).with_w(texel.w)
    }

    fn nearest(&self, uv: Vec2, wrap: [Wrap; 2]) -> Vec4 {
        let x = wrap_coordinate(uv.x, wrap[0]) * self.width as f32;
        let y = wrap_coordinate(uv.y, wrap[1]) * self.height as f32;
        self.premultiplied(
            wrap_index(x.floor() as i64, self.width, wrap[0]),
            wrap_index(y.floor() as i64, self.height, wrap[1]),
        )
    }

    fn bilinear(&self, uv: Vec2, wrap: [Wrap; 2]) -> Vec4 {
        let x = wrap_coordinate(uv.x, wrap[0]) * self.width as f32 - 0.5;
        let y = wrap_coordinate(uv.y, wrap[1]) * self.height as f32 - 0.5;
        let (left, top) = (x.floor(), y.floor());
        let [x0, x1] = [0, 1].map(|i| wrap_index(left as i64 + i, self.width, wrap[0]));
        let [y0, y1] = [0, 1].map(|i| wrap_index(top as i64 + i, self.height, wrap[1]));
        let upper = self.premultiplied(x0, y0).lerp(self.premultiplied(x1, y0), x - left);
        let lower = self.premultiplied(x0, y1).lerp(self.premultiplied(x1, y1), x - left);
        upper.lerp(lower, y - top)
    }
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

/// Into [0, 1], or [0, 2] for mirrored tiles, so that texel coordinates stay small.
fn wrap_coordinate(coordinate: f32, wrap: Wrap) -> f32 {
    match wrap {
        Wrap::Repeat => coordinate - coordinate.floor(),
        Wrap::Mirror => coordinate - 2.0 * (0.5 * coordinate).floor(),
        Wrap::Clamp => coordinate.clamp(0.0, 1.0),
    }
}

/// The texel that stands for index `i` of a row of `count`.
fn wrap_index(i: i64, count: u32, wrap: Wrap) -> u32 {
    let count = i64::from(count);
    let wrapped = match wrap {
        Wrap::Repeat => i.rem_euclid(count),
        Wrap::Mirror => {
            let i = i.rem_euclid(2 * count);
            if i < count { i } else { 2 * count - 1 - i }
        }
        Wrap::Clamp => i.clamp(0, count - 1),
    };
    wrapped as u32
}

fn straight(premultiplied: Vec4) -> Vec4 {
    let alpha = premultiplied.w;
    if alpha == 1.0 || alpha <= 0.0 {
        return premultiplied;
    }
    (premultiplied / alpha).with_w(alpha)
}
