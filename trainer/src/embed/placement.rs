//! Even placement in coarse to fine order: progressive Poisson-disk sampling by darts.
//!
//! Random points of the surface are accepted where no accepted point is nearer than a radius;
//! when darts no longer find room the radius shrinks and the darts are thrown again. The order of
//! acceptance is the nested order: every prefix is blue noise of its own density.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use glam::Vec3;

use super::surface::{Surface, SurfacePoint};
use crate::optimize::schedule::Random;

/// Darts per point that a radius is meant for.
const DARTS: usize = 10;
/// The density grows by √2 from radius to radius.
const SHRINK: f32 = 0.840_896_4;
/// No density is less than this share of the others'.
const LEAST_WEIGHT: f32 = 0.01;
/// Points of the coarsest radius.
const FIRST: f32 = 16.0;

/// `count` points in coarse to fine order; fewer where darts run out, none without area. `weights` is the wanted
/// density on each triangle, relative to the others; `accept` says whether a point is on the
/// surface at all (a texture may cut it out).
pub fn spread(
    surface: &Surface,
    weights: &[f32],
    count: usize,
    random: &mut Random,
    accept: impl Fn(&SurfacePoint) -> bool,
) -> Vec<SurfacePoint> {
    let mut darts = throw(surface, weights, count * DARTS, random, accept);
    let Some(total) = weighted_area(surface, weights).filter(|_| !darts.is_empty()) else {
        return Vec::new();
    };
    let mut chosen: Vec<SurfacePoint> = Vec::with_capacity(count);
    // Of squares of this side the surface holds `FIRST`; darts at that distance fill it about so.
    let mut radius = (total / FIRST).sqrt();
    let mut meant_for = FIRST;
    while chosen.len() < count && meant_for < count as f32 * 64.0 {
        let mut grid = Grid::new(radius);
        for point in &chosen {
            grid.insert(surface.position(point), surface.normal(point.triangle));
        }
        let tried = darts.len().min(meant_for as usize * DARTS);
        let mut kept = Vec::with_capacity(darts.len());
        for (index, dart) in darts.iter().enumerate() {
            let (position, normal) = (surface.position(dart), surface.normal(dart.triangle));
            // Where the wanted density is w points stand 1/√w as far apart.
            let reach = radius / weights[dart.triangle as usize].max(LEAST_WEIGHT).sqrt();
            if index < tried && chosen.len() < count && !grid.has_near(position, normal, reach) {
                grid.insert(position, normal);
                chosen.push(*dart);
            } else {
                kept.push(*dart);
            }
        }
        darts = kept;
        radius *= SHRINK;
        meant_for /= SHRINK * SHRINK;
    }
    chosen
}

fn weighted_area(surface: &Surface, weights: &[f32]) -> Option<f32> {
    let total: f64 =
        weights.iter().enumerate().map(|(t, w)| f64::from(w * surface.area(t as u32))).sum();
    (total > 0.0).then_some(total as f32)
}

/// Random points, by weighted area.
fn throw(
    surface: &Surface,
    weights: &[f32],
    count: usize,
    random: &mut Random,
    accept: impl Fn(&SurfacePoint) -> bool,
) -> Vec<SurfacePoint> {
    let mut sums = Vec::with_capacity(surface.len());
    let mut sum = 0.0f64;
    for (triangle, weight) in weights.iter().enumerate() {
        sum += f64::from(weight * surface.area(triangle as u32));
        sums.push(sum);
    }
    if sum <= 0.0 {
        return Vec::new();
    }
    let points = (0..count).map(|_| {
        let at = f64::from(random.bits()) / f64::from(u32::MAX) * sum;
        let triangle = sums.partition_point(|&s| s < at).min(sums.len() - 1) as u32;
        let (u, v) = (random.unit(), random.unit());
        // The square folded along its diagonal is the triangle.
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        SurfacePoint { triangle, barycentrics: Vec3::new(1.0 - u - v, u, v) }
    });
    points.filter(|point| surface.area(point.triangle) > 0.0 && accept(point)).collect()
}

/// Points by cells as wide as the radius.
struct Grid {
    cell: f32,
    heads: HashMap<u64, u32, BuildHasherDefault<CellHasher>>,
    points: Vec<(Vec3, Vec3, u32)>,
}

const NONE: u32 = u32::MAX;

impl Grid {
    fn new(cell: f32) -> Self {
        Self { cell, heads: HashMap::default(), points: Vec::new() }
    }

    fn cell_of(&self, position: Vec3) -> [i32; 3] {
        (position / self.cell).floor().as_ivec3().to_array()
    }

    fn key([x, y, z]: [i32; 3]) -> u64 {
        // 21 bits an axis: cells that collide far away only cost time.
        let part = |i: i32| u64::from(i as u32 & 0x1f_ffff);
        part(x) | part(y) << 21 | part(z) << 42
    }

    fn insert(&mut self, position: Vec3, normal: Vec3) {
        let head = self.heads.entry(Self::key(self.cell_of(position))).or_insert(NONE);
        self.points.push((position, normal, *head));
        *head = self.points.len() as u32 - 1;
    }

    /// Whether a point on the same side of the surface is nearer than `reach`.
    fn has_near(&self, position: Vec3, normal: Vec3, reach: f32) -> bool {
        let [x, y, z] = self.cell_of(position);
        let cells = (reach / self.cell).ceil() as i32;
        let around = || -cells..=cells;
        around().any(|i| {
            around().any(|j| {
                around().any(|k| self.cell_has_near([x + i, y + j, z + k], position, normal, reach))
            })
        })
    }

    fn cell_has_near(&self, cell: [i32; 3], position: Vec3, normal: Vec3, reach: f32) -> bool {
        let mut at = self.heads.get(&Self::key(cell)).copied().unwrap_or(NONE);
        while let Some(&(other, other_normal, next)) = self.points.get(at as usize) {
            let near = other.distance_squared(position) < reach * reach;
            if near && other_normal.dot(normal) > 0.0 {
                return true;
            }
            at = next;
        }
        false
    }
}

/// Multiplies (Fibonacci hashing): cells need no defence against attackers.
#[derive(Default)]
struct CellHasher(u64);

impl Hasher for CellHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(u64::from(byte));
        }
    }

    fn write_u64(&mut self, key: u64) {
        self.0 = (self.0 ^ key).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    }
}
