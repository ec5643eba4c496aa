//! What training may be told.

use crate::embed::detail::Detail;
use crate::embed::regions::Region;
use crate::methods::Method;
use crate::movements::Edit;
use crate::optimize::adam::Rates;
use crate::optimize::loss::Loss;
use crate::optimize::schedule::{Nested, Prefixes, Schedule};

/// How much effort training takes: steps and key frames, never a clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Preset {
    /// 1,600 steps of 540×540, 4 key frames: a minute for a person on two cores.
    Draft,
    /// 13,600 steps of 540×540, 20 key frames: five minutes.
    Default,
    /// 9,400 steps of 1080×1080, 20 key frames: twenty minutes for 296,000 Gaussians.
    Best,
}

/// Everything that training depends on, beside the mesh. Same options, same bytes; `memory_bytes`
/// does not change them.
#[derive(Clone, Debug)]
pub struct Options {
    /// How Gaussians are placed and trained.
    pub method: Method,
    /// Gaussians wanted.
    pub gaussians: u32,
    /// Layers: of the nested order, or LoDAvatar's levels 0, 1, ….
    pub levels: u32,
    /// Directions from which each key frame is seen, at most 42.
    pub views: u32,
    /// Poses.
    pub key_frames: u32,
    /// Width and height of the pictures, px.
    pub size: u32,
    /// Names of the clips to train on; empty: all but the last.
    pub clips: Vec<String>,
    /// Steps of one picture each.
    pub steps: u32,
    /// Steps of a first cloud, whose error says where Gaussians go; with 0 they are spread evenly. Not of
    /// [`Method::Lodavatar`], whose places follow from the mesh.
    pub survey_steps: u32,
    /// Of everything random.
    pub seed: u64,
    /// Behind the avatar.
    pub background: [f32; 3],
    /// Share of the steps, the first ones, that match pictures of half the size.
    pub warm_up: f32,
    /// Share of the steps, the last ones, that draw Gaussians rounded to the file's codes, so that what is written is
    /// what was matched. A step of them takes a sixth longer.
    pub finish: f32,
    /// PSNR that a level may lose to the few bits of the file's numbers, on the training views, dB; 0: 8 bits each.
    pub max_loss_db: f32,
    /// What to lessen.
    pub loss: Loss,
    /// What a blend in each pixel of a picture adds to the loss: pictures that are cheaper to draw.
    pub blend_price: f32,
    /// Share of the steps before a background of a random colour, without which parts as bright as [`Self::background`]
    /// would be free to be transparent.
    pub random_background: f32,
    /// Whether each level's Gaussians have parameters of their own.
    pub per_level: bool,
    /// How prefixes are drawn.
    pub nested: Nested,
    /// Where more Gaussians go.
    pub detail: Detail,
    /// Parts of the mesh with an order of their own, beside the rest; of [`Method::Dermis`] alone.
    pub regions: Vec<Region>,
    /// Meshes at most, the first Gaussians standing on coarser ones where trials find one as good: layer i on the i-th coarsest.
    /// 1: all on the surface itself, as by all methods but [`Method::Dermis`].
    pub mesh_levels: u32,
    /// How far joints and morph targets move the mesh, where the author knows better than what is measured.
    pub movements: Vec<Edit>,
    /// Bound of the ground truth that is held in memory, bytes; the rest lies in a temporary file.
    pub memory_bytes: u64,
}

impl Options {
    /// Of a preset.
    pub fn preset(preset: Preset) -> Self {
        // Of what a level may lose before the last steps, these leave 0.09 dB of draft and of default (notes/training.md).
        let (steps, survey_steps, key_frames, size, max_loss_db) = match preset {
            Preset::Draft => (1_600, 150, 4, 540, 0.15),
            Preset::Default => (13_600, 300, 20, 540, 0.24),
            Preset::Best => (9_400, 300, 20, 1080, 0.24),
        };
        Self {
            method: Method::Dermis,
            gaussians: 75_000,
            levels: 4,
            views: 42,
            key_frames,
            size,
            clips: Vec::new(),
            steps,
            survey_steps,
            seed: 1,
            background: [1.0; 3],
            warm_up: 0.1,
            finish: 0.05,
            max_loss_db,
            loss: Loss::default(),
            blend_price: 0.0,
            random_background: 0.3,
            per_level: true,
            nested: Nested {
                whole: 0.35,
                level: 0.5,
                least: 1.0 / 64.0,
                afar: [0.4, 0.5, 1.0],
                apart: 0.25,
                flatness_price: [0.005, 0.04, 0.02],
            },
            detail: Detail::default(),
            regions: Vec::new(),
            mesh_levels: 1,
            movements: Vec::new(),
            memory_bytes: 2048 << 20,
        }
    }

    /// LoDAvatar: levels of chosen triangles alone, on top of [`Self::levels`].
    pub fn detail_levels(&self) -> u32 {
        if self.detail.is_asked() { self.detail.levels } else { 0 }
    }

    /// How a cloud descends.
    pub fn schedule(&self, prefixes: Prefixes) -> Schedule {
        Schedule {
            steps: self.steps,
            rates: Rates::default(),
            last_rate: 0.1,
            prefixes,
            shift: 0,
            warm_up: self.warm_up,
            finish: self.finish,
            max_loss_db: self.max_loss_db,
            random_background: self.random_background,
        }
    }

    /// How many layers may stand on coarser meshes.
    pub fn coarser_layers(&self) -> u32 {
        let coarser = self.mesh_levels.min(self.levels).saturating_sub(1);
        if self.method == Method::Dermis { coarser } else { 0 }
    }

    /// Gaussians of each layer of a nested order of `count`: each layer but the first holds three
    /// quarters of all up to it, so that levels differ by a factor of 4.
    pub fn layers(&self, count: u32) -> Vec<u32> {
        let levels = self.levels.max(1);
        let up_to = |level: u32| (u64::from(count) >> (2 * (levels - 1 - level)).min(63)) as u32;
        let layers =
            (0..levels).map(|level| up_to(level) - if level == 0 { 0 } else { up_to(level - 1) });
        layers.collect()
    }
}
