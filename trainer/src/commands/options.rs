//! Options that several commands have.

use std::str::FromStr;

use anyhow::{Context, Result};
use dermis_runtime::prepare::MAX_SIZE;
use dermis_runtime::{Avatar, Plan, Pose};

/// Width and height, px.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Size(pub(crate) u32, pub(crate) u32);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let pixels = |part: &str| part.parse().ok().filter(|n| (1..=MAX_SIZE).contains(n));
        let size = text.split_once('x').and_then(|(w, h)| Some(Self(pixels(w)?, pixels(h)?)));
        size.ok_or_else(|| format!("give width x height, 1 to {MAX_SIZE} each, as in 540x540"))
    }
}

/// A pose of a clip, or the rest pose.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Posing {
    /// A clip's name [default: the rest pose].
    #[arg(long, value_name = "NAME")]
    clip: Option<String>,
    /// Seconds into the clip; beyond its ends it holds.
    #[arg(long, default_value_t = 0.0, requires = "clip", value_name = "SECONDS", value_parser = super::finite)]
    time: f32,
}

impl Posing {
    /// The pose.
    pub(crate) fn pose(&self, avatar: &Avatar<'_>) -> Result<Pose<'static>> {
        let Some(name) = &self.clip else { return Ok(Pose::Rest) };
        let clip = avatar.clips().position(|clip| clip.name == name).with_context(|| {
            let names: Vec<&str> = avatar.clips().map(|clip| clip.name).collect();
            match names.as_slice() {
                [] => format!("has no clip {name}, nor any other; leave --clip out"),
                _ => format!("has no clip {name}; choose one of: {}", names.join(", ")),
            }
        })?;
        Ok(Pose::Clip { clip, seconds: self.time })
    }
}

/// How many Gaussians are drawn.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Detail {
    /// At most this many Gaussians [default: all].
    #[arg(long, value_name = "N", conflicts_with = "level")]
    budget: Option<u32>,
    /// Level of detail: 0 is the first layer, all layers less one is everything; may lie between two, and above -1 be a part of
    /// the first.
    #[arg(long, value_name = "X", allow_hyphen_values = true, value_parser = super::finite)]
    level: Option<f32>,
}

impl Detail {
    /// The plan.
    pub(crate) fn plan(&self, avatar: &Avatar<'_>) -> Plan {
        match (self.budget, self.level) {
            (Some(budget), _) => Plan::with_budget(avatar, budget),
            (None, Some(level)) => Plan::at_level(avatar, level),
            (None, None) => Plan::with_budget(avatar, u32::MAX),
        }
    }
}

/// Which way is up.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Turning {
    /// Turn all Gaussians half around x: from y down, z forward to y up, z back, and the other way [default: axes stay].
    #[arg(long)]
    pub(crate) half_turn: bool,
}
