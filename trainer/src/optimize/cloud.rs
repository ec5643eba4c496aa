//! The Gaussians in training: parameters in the order of the file.

use dermis_format::Disc;

/// Numbers that describe one disc.
pub const PARAMETERS: usize = 10;

/// Parameters of one disc, in the frame of its triangle, lengths in units of the frame's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// x, y in the triangle's plane, z along its normal.
    pub position: [f32; 3],
    /// From the frame's x to the first axis, radians.
    pub angle: f32,
    /// log₂ of the standard deviations.
    pub log2_scale: [f32; 2],
    /// log(o / (1 − o)) of the opacity o.
    pub logit: f32,
    /// Display-referred sRGB.
    pub color: [f32; 3],
}

impl Parameters {
    /// In the order of the fields.
    pub fn to_array(self) -> [f32; PARAMETERS] {
        let ([x, y, z], [s, t], [r, g, b]) = (self.position, self.log2_scale, self.color);
        [x, y, z, self.angle, s, t, self.logit, r, g, b]
    }

    /// The inverse of [`Self::to_array`].
    pub fn from_array([x, y, z, angle, s, t, logit, r, g, b]: [f32; PARAMETERS]) -> Self {
        Self { position: [x, y, z], angle, log2_scale: [s, t], logit, color: [r, g, b] }
    }

    /// In [0, 1].
    pub fn opacity(&self) -> f32 {
        1.0 / (1.0 + libm::expf(-self.logit))
    }

    /// As the file stores it.
    pub fn disc(&self) -> Disc {
        Disc {
            position: self.position,
            angle: self.angle,
            log2_scale: self.log2_scale,
            color: self.color,
            opacity: self.opacity(),
        }
    }
}

/// What training may move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// Nothing: a Gaussian of an earlier layer.
    Fixed,
    /// All but the position: a Gaussian on a vertex (LoDAvatar, 3.5).
    Anchored,
    /// Everything.
    Free,
}

/// A Gaussian before it has a place in the file.
#[derive(Clone, Copy, Debug)]
pub struct Seed {
    /// Its triangle.
    pub triangle: u32,
    /// What it is.
    pub parameters: Parameters,
    /// What training may move.
    pub freedom: Freedom,
}

/// All Gaussians of an avatar (one region), in the order of the file.
#[derive(Clone, Debug, Default)]
pub struct Cloud {
    /// Gaussians of each layer.
    pub layers: Vec<u32>,
    /// Each Gaussian.
    pub gaussians: Vec<Seed>,
    /// Rank of each in the nested order.
    pub ranks: Vec<u32>,
    /// Index of each among the seeds it was arranged from.
    pub origins: Vec<u32>,
}

impl Cloud {
    /// How many.
    pub fn len(&self) -> usize {
        self.gaussians.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.gaussians.is_empty()
    }

    /// Puts Gaussians that stand coarse to fine into the order of the file: layer by layer, block by
    /// block, in a block by triangle. Inside a block the format's rule takes the place of the rank
    /// they came with. A cloud that is arranged again keeps its order.
    pub fn arrange(layers: Vec<u32>, coarse_to_fine: &[Seed]) -> Self {
        let mut cloud = Self { layers: layers.clone(), ..Self::default() };
        for (_, first, count) in dermis_format::order::blocks(&layers) {
            let mut block: Vec<u32> = (first..first + count).collect();
            block.sort_by_key(|&origin| coarse_to_fine[origin as usize].triangle);
            for (place, origin) in block.into_iter().enumerate() {
                cloud.gaussians.push(coarse_to_fine[origin as usize]);
                cloud.ranks.push(first + dermis_format::order::rank(place as u32, count));
                cloud.origins.push(origin);
            }
        }
        cloud
    }
}
