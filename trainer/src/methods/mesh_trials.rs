//! Which coarser meshes the first layers stand on.
//!
//! Few triangles are cheap to pose, but how few still carry the picture, and whether they have to show their backs, depends on
//! the avatar: an arm of five sides opens where a side turns away, and a white shirt shows the stripes of its back. So each
//! level is tried: alone, placed by a survey of its own, it is trained for a while on pictures of the size that suits it, first
//! on the surface, then on meshes of more and more triangles, until one does as well. That takes a few seconds for each layer,
//! which a run that goes on from a checkpoint takes again, to the same end.

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

/// Triangles of a mesh for each Gaussian that is to stand on it, as they are tried. The most are less than four times the
/// least, so that the mesh of a layer, four times as many Gaussians as the one before, is the finer one.
const TRIANGLES_PER_GAUSSIAN: [f64; 4] = [0.65, 1.0, 1.5, 2.25];
/// PSNR that a level may lose by its mesh in its trial, dB. What views and poses between the training's lose is up to 0.2 more.
const MOST_LOSS_DB: f64 = 0.1;
/// A mean squared error that nobody sees, of a pixel's three channels: a quarter of an 8-bit step of each.
const UNSEEN: f64 = 3.0 * (0.25 / 255.0) * (0.25 / 255.0);
/// Steps of a trial.
const STEPS: u32 = 300;
/// Pictures that tell how good it is, at most, each over black and over white.
const MOST_VIEWS: usize = 84;

/// What was found for a layer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshTrial {
    /// Gaussians up to that layer.
    pub gaussians: u32,
    /// What was tried, in turn; nothing where no mesh has fewer triangles than they need.
    pub tried: Vec<TriedMesh>,
    /// Whether the layer stands on the last of these; if not, on the surface, as none does as well.
    pub is_taken: bool,
}

/// A mesh that was tried.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TriedMesh {
    /// Triangles.
    pub triangles: u32,
    /// Whether all show their backs, too.
    pub two_sided: bool,
    /// PSNR that the level lost by it and the meshes of layers before, to all on the surface, dB.
    pub loss_db: f64,
}

/// The meshes of as many layers as options ask for, from fine to coarse, and what was found layer by layer. From the first
/// layer on for which there is none all stand on the surface.
///
/// # Errors
///
/// Where a picture cannot be read, or a number is not finite.
pub fn choose_meshes(
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
        let least = before.first().map_or(0, |mesh| mesh.triangles.len());
        let mut meshes: Vec<CoarserMesh> = TRIANGLES_PER_GAUSSIAN
            .iter()
            .filter_map(|per_gaussian| coarsener.mesh(f64::from(gaussians) * per_gaussian))
            .filter(|mesh| mesh.triangles.len() > least)
            .collect();
        meshes.dedup_by_key(|mesh| mesh.triangles.len());
        if meshes.is_empty() {
            return Ok((None, MeshTrial { gaussians, tried: Vec::new(), is_taken: false }));
        }
        let seeds = self.seeds()?;
        let surface = self.errors(&seeds, &[])?;
        let loss_db = |mesh: &CoarserMesh| {
            let errors = self.errors(&seeds, &[slice::from_ref(mesh), before].concat())?;
            Ok(loss_db(errors, surface))
        };
        let (mesh, tried) = first_as_good(meshes, loss_db)?;
        let is_taken = mesh.is_some();
        Ok((mesh, MeshTrial { gaussians, tried, is_taken }))
    }

    fn workshop(&self, source: &Source) -> Result<Workshop<'_>> {
        Workshop::new(source, &Setting { options: &self.options, ..*self.setting })
    }

    /// What its Gaussians are on the surface.
    fn seeds(&self) -> Result<Vec<Seed>> {
        let gaussians = self.options.gaussians;
        self.workshop(self.source)?.place(&self.options.layers(gaussians), |_| gaussians)
    }

    /// Mean squared errors, before black and before white, of the level after a trial on such meshes, from fine to coarse.
    fn errors(&self, seeds: &[Seed], meshes: &[CoarserMesh]) -> Result<[f64; 2]> {
        let source = package::with_coarser(self.source.clone(), meshes);
        let mut shop = self.workshop(&source)?;
        let clouds = dermis::clouds(&shop, seeds, &self.options);
        let mut schedule = self.options.schedule(Prefixes::All);
        (schedule.steps, schedule.shift) = (STEPS, self.shift);
        (schedule.warm_up, schedule.finish) = (0.0, 0.0);
        let clouds = shop.descend(clouds, &schedule)?;
        errors_of(&clouds, &shop.problem(), self.shift)
    }
}

/// Of `meshes`, from coarse to fine, the first that loses no more than may be lost, and what was tried until then. Each is
/// tried with its front first, as that has less to blend; of the sides what loses more by the first mesh is not tried again.
fn first_as_good(
    meshes: Vec<CoarserMesh>,
    mut loss_db: impl FnMut(&CoarserMesh) -> Result<f64>,
) -> Result<(Option<CoarserMesh>, Vec<TriedMesh>)> {
    let mut sides = vec![false, true];
    let mut tried: Vec<TriedMesh> = Vec::new();
    for mesh in meshes {
        for &two_sided in &sides {
            let mesh = CoarserMesh { two_sided, ..mesh.clone() };
            let (triangles, loss_db) = (mesh.triangles.len() as u32, loss_db(&mesh)?);
            tried.push(TriedMesh { triangles, two_sided, loss_db });
            if loss_db <= MOST_LOSS_DB {
                return Ok((Some(mesh), tried));
            }
        }
        let last = &tried[tried.len() - sides.len()..];
        let better = last.iter().min_by(|a, b| a.loss_db.total_cmp(&b.loss_db));
        sides = better.iter().map(|better| better.two_sided).collect();
    }
    Ok((None, tried))
}

/// The greater loss of the two backgrounds, dB; errors that nobody sees are no loss, and what is no number is an infinite one.
fn loss_db(errors: [f64; 2], surface: [f64; 2]) -> f64 {
    let loss = |(error, surface): (f64, f64)| {
        let loss_db = 10.0 * ((error + UNSEEN) / (surface + UNSEEN)).log10();
        if loss_db.is_nan() { f64::INFINITY } else { loss_db }
    };
    errors.into_iter().zip(surface).map(loss).fold(f64::NEG_INFINITY, f64::max)
}

/// Mean squared errors, before black and before white, of clouds in the training views at 1/2^`shift` of their size.
fn errors_of(clouds: &[Cloud], problem: &Problem<'_>, shift: u32) -> Result<[f64; 2]> {
    let prefixes = Prefix::whole(clouds);
    let (mut reading, mut truth) = (Scratch::default(), Picture::default());
    let (mut sums, mut pictures) = ([0.0; 2], 0u32);
    for view in problem.some_views(MOST_VIEWS) {
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

#[cfg(test)]
mod tests {
    use super::*;

    const FRONT: bool = false;
    const BOTH: bool = true;

    /// Asserts which of meshes of 1, 2 and 3 triangles are tried, and that the last one is taken, or none, where fronts and
    /// both sides lose so much.
    fn check(losses: [[f64; 2]; 3], tried: &[(u32, bool)], is_taken: bool) {
        let mesh = |len| CoarserMesh { triangles: vec![[0; 3]; len], ..CoarserMesh::default() };
        let loss_db = |len: u32, two_sided: bool| losses[len as usize - 1][usize::from(two_sided)];
        let found = first_as_good((1..=3).map(mesh).collect(), |mesh| {
            Ok(loss_db(mesh.triangles.len() as u32, mesh.two_sided))
        });
        let (mesh, found) = found.expect("nothing fails");
        let expected: Vec<TriedMesh> = (tried.iter())
            .map(|&(triangles, two_sided)| TriedMesh {
                triangles,
                two_sided,
                loss_db: loss_db(triangles, two_sided),
            })
            .collect();
        assert_eq!(found, expected);
        let taken = mesh.map(|mesh| (mesh.triangles.len() as u32, mesh.two_sided));
        assert_eq!(taken, tried.last().copied().filter(|_| is_taken));
    }

    #[test]
    fn the_coarsest_mesh_that_is_as_good_is_taken_and_the_worse_sides_are_tried_once() {
        check([[0.05, -9.0]; 3], &[(1, FRONT)], true);
        check([[2.0, 0.1], [9.0; 2], [9.0; 2]], &[(1, FRONT), (1, BOTH)], true);
        let none = [[2.0, 1.0], [0.0, 0.5], [0.0, 0.2]];
        check(none, &[(1, FRONT), (1, BOTH), (2, BOTH), (3, BOTH)], false);
        let fronts = [[1.0, 2.0], [0.5, 0.0], [-0.3, 0.0]];
        check(fronts, &[(1, FRONT), (1, BOTH), (2, FRONT), (3, FRONT)], true);
    }

    #[test]
    fn the_worse_background_counts_and_errors_that_nobody_sees_do_not() {
        assert!((loss_db([0.02, 0.01], [0.01, 0.01]) - 3.01).abs() < 0.01);
        assert!((loss_db([0.01, 0.02], [0.04, 0.01]) - 3.01).abs() < 0.01);
        for surface in [0.0, 1e-9, UNSEEN / 50.0] {
            let loss = loss_db([surface, UNSEEN / 50.0], [0.0, surface]);
            assert!(loss.abs() < MOST_LOSS_DB, "{loss}");
        }
        for not_a_loss in [f64::INFINITY, f64::NAN, -f64::NAN] {
            assert_eq!(loss_db([not_a_loss; 2], [0.01; 2]), f64::INFINITY);
            assert_eq!(loss_db([0.01, not_a_loss], [0.01; 2]), f64::INFINITY);
        }
    }
}
