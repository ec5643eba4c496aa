//! Which coarser meshes the first layers stand on.
//!
//! Few triangles are cheap to pose, but how few still carry the picture, and whether they have to show their backs, depends on
//! the avatar: an arm of five sides opens where a side turns away, and a white shirt shows the stripes of its back. So each
//! level is tried: alone, its Gaussians spread evenly, it is trained for a while on pictures of the size that suits it,
//! first on the surface, then on meshes of more and more triangles, until one does as well.

use core::slice;

use anyhow::Result;
use dermis_format::source::Source;
use serde::{Deserialize, Serialize};

use super::dermis;
use super::workshop::{Setting, Workshop};
use crate::embed::mesh_levels::{Coarsener, CoarserMesh};
use crate::model::Model;
use crate::optimize::cloud::{Cloud, Prefix, Seed};
use crate::optimize::descend::Problem;
use crate::optimize::forward::draw;
use crate::optimize::schedule::Prefixes;
use crate::options::Options;
use crate::package;
use crate::picture::{Picture, mean_square};
use crate::truth::{Scratch, scaled};

/// Triangles of a mesh for each Gaussian that is to stand on it, as they are tried.
const TRIANGLES_PER_GAUSSIAN: [f64; 4] = [0.65, 1.0, 1.5, 2.25];
/// PSNR that a level may lose by its mesh in its trial, dB. What views and poses between the training's lose is up to 0.2 more.
const MOST_LOSS_DB: f64 = 0.1;
/// Steps of a trial.
const STEPS: u32 = 300;
/// Pictures that tell how good it is, at most, each over black and over white.
const MOST_VIEWS: usize = 84;

/// What was found for a layer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshTrial {
    /// Gaussians up to that layer.
    pub gaussians: u32,
    /// Triangles of the mesh that it stands on; none: no coarser one does as well as the surface.
    pub triangles: Option<u32>,
    /// PSNR that its level lost by it in its trial, dB; without a mesh the least that one of them would have lost.
    pub loss_db: f64,
}

/// The meshes of as many layers as options ask for, from fine to coarse, and what was found layer by layer. From the first
/// layer on for which there is none all stand on the surface.
pub fn choose(
    model: &Model,
    source: &Source,
    setting: &Setting<'_>,
) -> Result<(Vec<CoarserMesh>, Vec<MeshTrial>)> {
    let (mut meshes, mut trials) = (Vec::new(), Vec::new());
    let layers = setting.options.coarser_layers();
    if layers == 0 {
        return Ok((meshes, trials));
    }
    let coarsener = Coarsener::new(model, &setting.parts.regions, setting.key_frames);
    for layer in 0..layers {
        let Some(level) = Level::new(layer, source, setting) else { continue };
        let (mesh, trial) = level.choose(&coarsener, &meshes)?;
        trials.push(trial);
        let Some(mesh) = mesh else { break };
        meshes.insert(0, mesh);
    }
    Ok((meshes, trials))
}

/// A level to be tried.
struct Level<'a> {
    source: &'a Source,
    setting: &'a Setting<'a>,
    /// As if there were no level above.
    options: Options,
    /// Pictures that suit it have 1/2^shift of the size.
    shift: u32,
}

impl<'a> Level<'a> {
    /// The level that ends with a layer; `None` if it has no Gaussians.
    fn new(layer: u32, source: &'a Source, setting: &'a Setting<'a>) -> Option<Self> {
        let options = setting.options;
        let layers = options.layers(options.gaussians);
        let gaussians = layers.iter().take(layer as usize + 1).sum();
        let shift = (options.levels - 1 - layer).min(options.nested.afar.len() as u32);
        let options = Options { gaussians, levels: layer + 1, ..options.clone() };
        (gaussians > 0).then_some(Self { source, setting, options, shift })
    }

    /// The cheapest mesh that does as well as the surface, beside those of the layers before.
    fn choose(
        &self,
        coarsener: &Coarsener,
        before: &[CoarserMesh],
    ) -> Result<(Option<CoarserMesh>, MeshTrial)> {
        let gaussians = self.options.gaussians;
        let seeds = self.seeds()?;
        let surface = self.errors(&seeds, &[])?;
        // Without backs there is less to blend; what does less well at first is not tried again.
        let mut sides = vec![false, true];
        let mut least = f64::INFINITY;
        for per_gaussian in TRIANGLES_PER_GAUSSIAN {
            let Some(mesh) = coarsener.mesh(f64::from(gaussians) * per_gaussian) else { break };
            let triangles = mesh.triangles.len() as u32;
            let mut losses = Vec::new();
            for two_sided in sides {
                let mesh = CoarserMesh { two_sided, ..mesh.clone() };
                let ratios = self.errors(&seeds, &[&[mesh.clone()], before].concat())?;
                let ratios = ratios.iter().zip(surface).map(|(error, surface)| error / surface);
                let loss_db = 10.0 * ratios.fold(0.0, f64::max).log10();
                if loss_db <= MOST_LOSS_DB {
                    let trial = MeshTrial { gaussians, triangles: Some(triangles), loss_db };
                    return Ok((Some(mesh), trial));
                }
                losses.push((loss_db, two_sided));
            }
            losses.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            sides = losses.iter().map(|&(_, two_sided)| two_sided).take(1).collect();
            least = losses.iter().fold(least, |least, &(loss_db, _)| least.min(loss_db));
        }
        Ok((None, MeshTrial { gaussians, triangles: None, loss_db: least }))
    }

    fn workshop(&self, source: &Source) -> Result<Workshop<'_>> {
        Workshop::new(source, &Setting { options: &self.options, ..*self.setting })
    }

    /// What its Gaussians are on the surface.
    fn seeds(&self) -> Result<Vec<Seed>> {
        let gaussians = self.options.gaussians;
        self.workshop(self.source)?.place(&self.options.layers(gaussians), |_| gaussians)
    }

    /// Mean squared errors, over black and over white, of the level after a trial on such meshes, from fine to coarse.
    fn errors(&self, seeds: &[Seed], meshes: &[CoarserMesh]) -> Result<[f64; 2]> {
        let source = package::with_coarser(self.source.clone(), meshes);
        let mut shop = self.workshop(&source)?;
        let clouds = dermis::clouds(&shop, seeds, &self.options);
        let mut schedule = self.options.schedule(Prefixes::All);
        (schedule.steps, schedule.shift) = (STEPS, self.shift);
        (schedule.warm_up, schedule.finish) = (0.0, 0.0);
        let clouds = shop.descend(clouds, &schedule)?;
        errors(&clouds, &shop.problem(), self.shift)
    }
}

/// Of pictures of 1/2^`shift` of the size.
fn errors(clouds: &[Cloud], problem: &Problem<'_>, shift: u32) -> Result<[f64; 2]> {
    let prefixes = Prefix::whole(clouds);
    let (mut reading, mut truth) = (Scratch::default(), Picture::default());
    let (mut sums, mut pictures) = ([0.0; 2], 0u32);
    let step = problem.views.len().div_ceil(MOST_VIEWS).max(1);
    for view in problem.views.iter().step_by(step) {
        let (stage, camera) = (&problem.stages[view.stage], scaled(&view.camera, shift));
        for (sum, background) in sums.iter_mut().zip([[0.0; 3], [1.0; 3]]) {
            view.truth.draw(background, shift, &mut reading, &mut truth)?;
            let forward = draw(clouds, &prefixes, stage, &camera, problem.low_pass, background);
            *sum += mean_square(&[forward.picture], slice::from_ref(&truth));
        }
        pictures += 1;
    }
    Ok(sums.map(|sum| sum / f64::from(pictures.max(1))))
}
