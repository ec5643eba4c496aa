//! What files of several formats take for the same Gaussians, and what of the picture they lose.
//!
//! The Gaussians, in floats, are those of a trained avatar at rest ([`of_mesh`]) or of another program's file
//! ([`of_splats`]). Each format is written by [`export`] or as our file, read back by the readers that
//! [`convert`](mod@convert) has for all, and drawn, as the floats are, by the reference renderer in f64 with decisions of
//! its own: whatever the format, with the low-pass of the floats and, on a mesh, the triangles whose front is seen. So
//! pictures differ by the numbers in the file alone.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use dermis_format::LowPass;
use dermis_format::packed;
use dermis_format::section::{head, holds_gaussians};
use dermis_runtime::gaussian::disc_on;
use dermis_runtime::{Avatar, Camera, Kernel, Plan, Pose as RuntimePose, Posed};
use glam::{DVec3, Vec3};
use serde::Serialize;

use super::CLOCK;
use crate::convert::splats::Splat;
use crate::convert::{self, LeftOut, Splats};
use crate::eval::reference::{draw_free_reference, draw_own_reference, exact_frame};
use crate::export::{self, Packed};
use crate::metrics::psnr::psnr_db;
use crate::model::Model;
use crate::optimize::cloud::{Cloud, Prefix};
use crate::options::Options;
use crate::scene::{self, Painter, Pose, RigScale};
use crate::train::train;

/// What a format takes and loses.
#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    /// Its name.
    pub format: &'static str,
    /// Of the file. Ours holds mesh, rig, clips and coarser levels, too.
    pub bytes: usize,
    /// Of these, the Gaussians': of ours at all levels.
    pub gaussian_bytes: usize,
    /// The same over the Gaussians.
    pub bytes_per_gaussian: f64,
    /// PSNR to the mesh over the pixels that it covers; none without a mesh.
    pub psnr_foreground_db: Option<f64>,
    /// By how much that is less than the floats have.
    pub lost_db: Option<f64>,
    /// PSNR to the pictures of the floats over the same pixels; without a mesh over those that either touches.
    pub psnr_to_floats_db: f64,
}

/// All formats.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// Gaussians of every file.
    pub gaussians: usize,
    /// Pictures that figures are means of, and their width and height, px.
    pub views: usize,
    /// See above.
    pub size: u32,
    /// Seconds of training by [`CLOCK`].
    pub seconds: Option<f64>,
    /// PSNR of the floats to the mesh over the pixels that it covers.
    pub floats_foreground_db: Option<f64>,
    /// From the greatest file to the smallest, ours at the end.
    pub rows: Vec<Entry>,
}

/// A file of a format, read back.
struct Filed {
    format: &'static str,
    bytes: usize,
    gaussian_bytes: usize,
    kept: Kept,
}

/// What comes back.
enum Kept {
    /// Free Gaussians, in the order in which they were written.
    Free(Splats),
    /// A file of ours.
    Avatar(Vec<u8>),
}

/// Trains an avatar and measures it at rest from `views` directions between those of training.
///
/// # Errors
///
/// Where it cannot be trained, or a format cannot hold it.
pub fn of_mesh(model: &Model, options: &Options) -> Result<Table> {
    let (trained, ms) = CLOCK.time(|| train(model, options))?;
    let avatar = Avatar::parse(&trained.bytes)?;
    let mut scratch = vec![0; Posed::scratch_len(&avatar)];
    let posed = Posed::new(&avatar, &RuntimePose::Rest, Kernel::detect(), &mut scratch)?;
    let (floats, triangles) = at_rest(&trained.clouds, &posed);
    let mut files = of_others(&floats)?;
    files.extend(of_ours(&trained.bytes)?);
    let is_whole = |filed: &Filed| match &filed.kept {
        Kept::Free(splats) => splats.gaussians.len() == floats.gaussians.len(),
        Kept::Avatar(_) => true,
    };
    // Triangles are known by the Gaussians' places.
    ensure!(files.iter().all(is_whole), "a format lost Gaussians; this is a fault of the program");
    let low_pass = avatar.header().low_pass;
    let at_rest = scene::posed_vertices(model, &Pose::rest(model));
    let directions = &scene::novel_directions()[..options.views.clamp(1, 42) as usize];
    let cameras = RigScale::of(model).cameras(directions, &at_rest, options.size, options.size);
    let shots = cameras.iter().map(|&camera| scene::View { posed: &at_rest, camera });
    let painter = Painter::new(model);
    let shots: Vec<_> = shots.collect();
    let pictures = scene::render_views(&painter, &shots, options.background, 4, |view, truth| {
        let camera = &cameras[view];
        let eye = camera.position();
        let shown = |index: usize| posed.shows(triangles[index], eye);
        let exact = truth.picture.to_bytes();
        let mask: Vec<bool> = truth.coverage.iter().map(|&share| share > 0.0).collect();
        let psnr = |a: &[u8], b: &[u8]| psnr_db(a, b, Some(&mask));
        let background = options.background;
        let free = |splats: &Splats| {
            bytes(&draw_free_reference(splats, shown, low_pass, camera, background))
        };
        let of_floats = free(&floats);
        let of_files = files.iter().map(|filed| {
            let drawn = match &filed.kept {
                Kept::Free(splats) => free(splats),
                Kept::Avatar(file) => of_avatar(file, camera, background)?,
            };
            Ok([psnr(&exact, &drawn), psnr(&of_floats, &drawn)])
        });
        Ok((psnr(&exact, &of_floats), of_files.collect::<Result<Vec<_>>>()?))
    });
    let pictures: Vec<_> = pictures.into_iter().collect::<Result<_>>()?;
    let floats_db = mean(pictures.iter().map(|(of_floats, _)| *of_floats));
    let floats_db = floats_db.context("the mesh is seen in no picture; scale it to metres")?;
    let row = |(index, filed): (usize, &Filed)| {
        let of = |which: usize| mean(pictures.iter().map(|(_, files)| files[index][which]));
        let psnr_foreground_db = of(0);
        Entry {
            psnr_foreground_db,
            lost_db: psnr_foreground_db.map(|db| floats_db - db),
            ..filed.entry(floats.gaussians.len(), of(1))
        }
    };
    Ok(Table {
        gaussians: floats.gaussians.len(),
        views: cameras.len(),
        size: options.size,
        seconds: Some(ms / 1e3),
        floats_foreground_db: Some(floats_db),
        rows: files.iter().enumerate().map(row).collect(),
    })
}

/// Measures a file of free Gaussians that another program trained, from `views` directions around.
///
/// # Errors
///
/// Where it cannot be read, or a format cannot hold it.
pub fn of_splats(path: &Path, views: u32, size: u32, background: [f32; 3]) -> Result<Table> {
    let (floats, _) = convert::read(path, None)?;
    let mut files = of_others(&floats)?;
    files.extend(of_ours(&convert::pack(floats.clone())?)?);
    let low_pass = if floats.compensated { LowPass::Compensated } else { LowPass::Classic };
    let cameras = around(&floats, views, size);
    let mut sums = vec![0.0; files.len()];
    for camera in &cameras {
        let free = |splats: &Splats| {
            bytes(&draw_free_reference(splats, |_| true, low_pass, camera, background))
        };
        let of_floats = free(&floats);
        let behind = bytes(&[background.map(f64::from)]);
        let is_touched = |pixels: (&[u8], &[u8])| pixels.0 != behind || pixels.1 != behind;
        for (filed, sum) in files.iter().zip(&mut sums) {
            let drawn = match &filed.kept {
                Kept::Free(splats) => free(splats),
                Kept::Avatar(file) => of_avatar(file, camera, background)?,
            };
            let pixels = of_floats.chunks_exact(3).zip(drawn.chunks_exact(3));
            let mask: Vec<bool> = pixels.map(is_touched).collect();
            *sum += psnr_db(&of_floats, &drawn, Some(&mask)).context("nothing of it is seen")?;
        }
    }
    let row = |(filed, sum): (&Filed, f64)| {
        filed.entry(floats.gaussians.len(), Some(sum / cameras.len() as f64))
    };
    Ok(Table {
        gaussians: floats.gaussians.len(),
        views: cameras.len(),
        size,
        seconds: None,
        floats_foreground_db: None,
        rows: files.iter().zip(sums).map(row).collect(),
    })
}

impl Filed {
    fn entry(&self, gaussians: usize, psnr_to_floats_db: Option<f64>) -> Entry {
        Entry {
            format: self.format,
            bytes: self.bytes,
            gaussian_bytes: self.gaussian_bytes,
            bytes_per_gaussian: self.gaussian_bytes as f64 / gaussians as f64,
            psnr_foreground_db: None,
            lost_db: None,
            psnr_to_floats_db: psnr_to_floats_db.unwrap_or(f64::NAN),
        }
    }
}

/// The Gaussians of a trained avatar in the world, in floats, and their triangles.
fn at_rest(clouds: &[Cloud], posed: &Posed<'_, '_>) -> (Splats, Vec<u32>) {
    let (mut splats, mut triangles) = (Splats::default(), Vec::new());
    for cloud in clouds {
        let all = Prefix::of(cloud.len() as u32, cloud);
        for (index, &triangle) in cloud.triangles.iter().enumerate() {
            let Some(frame) = exact_frame(posed, triangle) else { continue };
            let disc = cloud.disc(&all, index).map(f64::from);
            let on = disc_on(&frame, disc.position, disc.angle, disc.log2_scale);
            let [a, b] = orthogonal(on.axes.map(DVec3::from));
            let splat = Splat {
                position: on.center,
                color: disc.color,
                opacity: disc.opacity,
                ..export::of_axes([a, b, DVec3::ZERO])
            };
            if splats.push(&splat, &mut LeftOut::default()) {
                triangles.push(triangle);
            }
        }
    }
    (splats, triangles)
}

/// Orthogonal axes of the same covariance a aᵀ + b bᵀ: turned among each other by θ, tan 2θ = 2 a·b / (a·a − b·b).
fn orthogonal([a, b]: [DVec3; 2]) -> [DVec3; 2] {
    let twice = (2.0 * a.dot(b)).atan2(a.length_squared() - b.length_squared());
    let (sin, cos) = (0.5 * twice).sin_cos();
    [cos * a + sin * b, cos * b - sin * a]
}

/// Written and read again, from the greatest to the smallest.
fn of_others(splats: &Splats) -> Result<Vec<Filed>> {
    let folder = tempfile::tempdir().context("a folder for files cannot be made")?;
    let Packed { bytes: spz, .. } = export::spz(splats)?;
    let Packed { bytes: splat, .. } = export::splat(splats);
    let files = [("ply", export::ply(splats)), ("splat", splat), ("spz", spz)];
    let filed = |(format, bytes): (&'static str, Vec<u8>)| {
        let path = folder.path().join("a").with_extension(format);
        std::fs::write(&path, &bytes).with_context(|| path.display().to_string())?;
        let (splats, _) = convert::read(&path, None)?;
        let bytes = bytes.len();
        Ok(Filed { format, bytes, gaussian_bytes: bytes, kept: Kept::Free(splats) })
    };
    files.into_iter().map(filed).collect()
}

/// A file of ours, as it is read in place and as it is packed.
fn of_ours(file: &[u8]) -> Result<[Filed; 2]> {
    let sections = Avatar::parse(file)?.sections().filter(|s| holds_gaussians(s.tag));
    let packed = packed::pack(file)?;
    let filed = |format, bytes, gaussian_bytes, file| Filed {
        format,
        bytes,
        gaussian_bytes,
        kept: Kept::Avatar(file),
    };
    let in_place = sections.map(|section| head::LEN + section.payload.len()).sum();
    let unpacked = packed::unpack(&packed)?;
    Ok([
        filed("dermis", file.len(), in_place, file.to_vec()),
        filed("dermis, packed", packed.len(), packed::bytes_of_gaussians(&packed)?, unpacked),
    ])
}

/// All of a file of ours at rest.
fn of_avatar(file: &[u8], camera: &Camera, background: [f32; 3]) -> Result<Vec<u8>> {
    let avatar = Avatar::parse(file)?;
    let plan = Plan::with_budget(&avatar, u32::MAX);
    Ok(bytes(&draw_own_reference(&avatar, &RuntimePose::Rest, &plan, camera, background)?))
}

/// Rounded to 8 bits a channel.
fn bytes(picture: &[[f64; 3]]) -> Vec<u8> {
    let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
    picture.iter().flat_map(|rgb| rgb.map(byte)).collect()
}

/// Of those that are there.
fn mean(numbers: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let (sum, count) =
        numbers.flatten().fold((0.0, 0u32), |(sum, count), number| (sum + number, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

/// Cameras in a circle, above and below in turn, that see the ball in which nine of ten Gaussians are: captures have
/// some far away.
fn around(splats: &Splats, views: u32, size: u32) -> Vec<Camera> {
    let sorted = |of: &dyn Fn(&[f32; 3]) -> f32| {
        let mut numbers: Vec<f32> = splats.gaussians.iter().map(|g| of(&g.position)).collect();
        numbers.sort_by(f32::total_cmp);
        numbers
    };
    let center = [0, 1, 2].map(|axis| {
        let sorted = sorted(&|position| position[axis]);
        sorted[sorted.len() / 2]
    });
    let center = Vec3::from(center);
    let distances = sorted(&|position| center.distance(Vec3::from(*position)));
    let radius = distances[distances.len() * 9 / 10].max(1e-3);
    let vertical_fov = RigScale::of_extent(2.0 * radius).vertical_fov;
    let distance = radius / (0.5 * vertical_fov).sin();
    let camera = |view: u32| {
        let yaw = std::f32::consts::TAU * view as f32 / views.max(1) as f32;
        let pitch = [-25.0f32, 10.0][view as usize % 2].to_radians();
        let direction = Vec3::new(yaw.sin() * pitch.cos(), pitch.sin(), yaw.cos() * pitch.cos());
        scene::camera_towards(center, direction, distance, vertical_fov, size, size)
    };
    (0..views.max(1)).map(camera).collect()
}
