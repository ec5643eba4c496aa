//! Fewer Gaussians that look like many: pairs are merged, the least important ones first.
//!
//! A pair becomes the Gaussian of the same mass, mean and covariance. What that costs is Runnalls' bound on the Kullback–Leibler
//! divergence of a mixture (2007, eq. 20), ½ [(m₁ + m₂) ln det Σ − m₁ ln det Σ₁ − m₂ ln det Σ₂]: in the plane of a surface little,
//! across it much. Mass is opacity times the mean area that an ellipsoid shows. Colour counts as three more
//! dimensions, and how far a pair is apart in other poses as one.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use rstar::RTree;
use rstar::primitives::GeomWithData;

/// Neighbours with which a Gaussian may be merged, and at most so many of a pair's own.
const NEIGHBORS: usize = 10;

/// Colours that differ by this much, sRGB, are as different as places one standard deviation apart.
const COLOR_SIGMA: f64 = 0.1;

/// A Gaussian in the world, as merging sees it.
#[derive(Clone, Debug)]
pub(super) struct Blob {
    /// Opacity times area, m².
    pub(super) mass: f64,
    /// Metres.
    pub(super) mean: DVec3,
    /// m².
    pub(super) covariance: DMat3,
    /// sRGB.
    pub(super) color: DVec3,
    /// Where it is in other poses, metres.
    pub(super) posed: Vec<DVec3>,
}

/// All Gaussians that there ever were: those at the start, then each pair.
pub(super) struct Merged {
    pub(super) blobs: Vec<Blob>,
    /// The two of each pair, which stand after the first ones.
    pairs: Vec<[u32; 2]>,
    leaves: usize,
    /// Who a blob is part of now.
    wholes: Vec<u32>,
    /// ln det Σ of each.
    log_dets: Vec<f64>,
    neighbors: Vec<Vec<u32>>,
    /// What is invisible, m²: no axis counts as less.
    floor: f64,
}

/// π √(½ (tr² Σ − tr Σ²) / 3): about the mean area of an ellipsoid's shadows of one standard deviation, exact for balls.
pub(super) fn area(covariance: &DMat3) -> f64 {
    let trace = covariance.x_axis.x + covariance.y_axis.y + covariance.z_axis.z;
    let square: f64 = covariance.to_cols_array().iter().map(|x| x * x).sum();
    core::f64::consts::PI * ((trace * trace - square) / 6.0).max(0.0).sqrt()
}

impl Merged {
    /// Of Gaussians, none of which shows what is smaller than `least`, metres.
    pub(super) fn new(blobs: Vec<Blob>, least: f64) -> Self {
        let leaves = blobs.len();
        let mut merged = Self {
            wholes: (0..leaves as u32).collect(),
            pairs: Vec::new(),
            leaves,
            log_dets: Vec::new(),
            neighbors: Vec::new(),
            floor: least * least,
            blobs,
        };
        merged.log_dets =
            merged.blobs.iter().map(|blob| merged.log_det(&blob.covariance)).collect();
        merged
    }

    /// Merges until only `count` are left, and gives those.
    pub(super) fn reduce_to(&mut self, count: usize) -> Vec<u32> {
        let mut alive = self.alive();
        while alive.len() > count.max(1) {
            let mut heap = self.pairs_of_neighbors(&alive);
            let mut left = alive.len();
            while left > count
                && let Some(Reverse((_, a, b))) = heap.pop()
            {
                if self.wholes[a as usize] == a && self.wholes[b as usize] == b {
                    self.merge(a, b, &mut heap);
                    left -= 1;
                }
            }
            alive = self.alive();
        }
        alive
    }

    /// The Gaussians at the start that are parts of `blob`.
    pub(super) fn parts(&self, blob: u32) -> Vec<u32> {
        let (mut open, mut parts) = (vec![blob], Vec::new());
        while let Some(blob) = open.pop() {
            match (blob as usize).checked_sub(self.leaves) {
                Some(pair) => open.extend(self.pairs[pair]),
                None => parts.push(blob),
            }
        }
        parts
    }

    fn alive(&self) -> Vec<u32> {
        (0..).zip(&self.wholes).filter(|(i, whole)| i == *whole).map(|(i, _)| i).collect()
    }

    fn whole(&self, mut blob: u32) -> u32 {
        while self.wholes[blob as usize] != blob {
            blob = self.wholes[blob as usize];
        }
        blob
    }

    fn pairs_of_neighbors(&mut self, alive: &[u32]) -> Heap {
        let place = |&i: &u32| GeomWithData::new(self.blobs[i as usize].mean.to_array(), i);
        let tree = RTree::bulk_load(alive.iter().map(place).collect());
        let near = |&i: &u32| -> Vec<u32> {
            let all = tree.nearest_neighbor_iter(self.blobs[i as usize].mean.to_array());
            all.map(|other| other.data).filter(|&other| other != i).take(NEIGHBORS).collect()
        };
        let lists: Vec<Vec<u32>> = alive.par_iter().map(near).collect();
        self.neighbors.resize(self.blobs.len(), Vec::new());
        for (&i, list) in alive.iter().zip(lists) {
            self.neighbors[i as usize] = list;
        }
        let this = &*self;
        let pairs = alive.par_iter().flat_map_iter(|&a| {
            this.neighbors[a as usize].iter().map(move |&b| Reverse((this.cost(a, b), a, b)))
        });
        pairs.collect::<Vec<_>>().into()
    }

    fn merge(&mut self, a: u32, b: u32, heap: &mut Heap) {
        let blob = self.joined(a, b);
        let index = self.blobs.len() as u32;
        self.log_dets.push(self.log_det(&blob.covariance));
        self.blobs.push(blob);
        self.pairs.push([a, b]);
        self.wholes.push(index);
        self.wholes[a as usize] = index;
        self.wholes[b as usize] = index;
        let old = [a, b].map(|i| std::mem::take(&mut self.neighbors[i as usize]));
        let near: BTreeSet<u32> = old.into_iter().flatten().map(|i| self.whole(i)).collect();
        let mut near: Vec<(u64, u32)> =
            near.into_iter().filter(|&i| i != index).map(|i| (self.cost(index, i), i)).collect();
        near.sort_unstable();
        near.truncate(2 * NEIGHBORS);
        heap.extend(near.iter().map(|&(cost, i)| Reverse((cost, index, i))));
        self.neighbors.push(near.into_iter().map(|(_, i)| i).collect());
    }

    fn joined(&self, a: u32, b: u32) -> Blob {
        let [a, b] = [a, b].map(|i| &self.blobs[i as usize]);
        let mass = a.mass + b.mass;
        let (s, t) = (a.mass / mass, b.mass / mass);
        let apart = b.mean - a.mean;
        let outer = DMat3::from_cols(apart * apart.x, apart * apart.y, apart * apart.z);
        let mean = |a: DVec3, b: DVec3| s * a + t * b;
        Blob {
            mass,
            mean: mean(a.mean, b.mean),
            covariance: a.covariance * s + b.covariance * t + outer * (s * t),
            color: mean(a.color, b.color),
            posed: a.posed.iter().zip(&b.posed).map(|(&a, &b)| mean(a, b)).collect(),
        }
    }

    /// Bits of the cost, which is not below 0 and so is ordered as they are.
    fn cost(&self, a: u32, b: u32) -> u64 {
        let joined = self.joined(a, b);
        let dets = [a, b].map(|i| self.log_dets[i as usize]);
        let [a, b] = [a, b].map(|i| &self.blobs[i as usize]);
        let (s, t) = (a.mass / joined.mass, b.mass / joined.mass);
        let shape = self.log_det(&joined.covariance) - s * dets[0] - t * dets[1];
        let unlike = s * t * a.color.distance_squared(b.color) / (COLOR_SIGMA * COLOR_SIGMA);
        let at_rest = a.mean.distance_squared(b.mean);
        let posed = a.posed.iter().zip(&b.posed).map(|(a, b)| a.distance_squared(*b) - at_rest);
        let apart = posed.fold(0.0, f64::max);
        let c = &joined.covariance;
        let size = (c.x_axis.x + c.y_axis.y + c.z_axis.z) / 3.0 + self.floor;
        let apart = s * t * apart / size;
        let cost = joined.mass * (shape + unlike.ln_1p() + apart.ln_1p());
        cost.max(0.0).to_bits()
    }

    fn log_det(&self, covariance: &DMat3) -> f64 {
        (*covariance + DMat3::from_diagonal(DVec3::splat(self.floor)))
            .determinant()
            .max(1e-300)
            .ln()
    }
}

type Heap = BinaryHeap<Reverse<(u64, u32, u32)>>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::schedule::Random;

    const SIGMA: f64 = 0.01;

    fn ball(mean: DVec3, color: DVec3, posed: Vec<DVec3>) -> Blob {
        let covariance = DMat3::from_diagonal(DVec3::splat(SIGMA * SIGMA));
        Blob { mass: area(&covariance), mean, covariance, color, posed }
    }

    #[test]
    fn like_merges_with_like_and_moments_stay() {
        let mut random = Random::new(3);
        let mut place = || DVec3::from([(); 3].map(|()| SIGMA * f64::from(random.unit())));
        let colors = [DVec3::X, DVec3::Z];
        let blobs: Vec<Blob> = (0..60).map(|i| ball(place(), colors[i % 2], vec![])).collect();
        let sums = |blobs: &[&Blob]| {
            let outer = |m: DVec3| DMat3::from_cols(m * m.x, m * m.y, m * m.z);
            let mass: f64 = blobs.iter().map(|b| b.mass).sum();
            let mean: DVec3 = blobs.iter().map(|b| b.mass * b.mean).sum();
            let second = blobs.iter().map(|b| (b.covariance + outer(b.mean)) * b.mass);
            (mass, mean, second.fold(DMat3::ZERO, |sum, b| sum + b))
        };
        let before = sums(&blobs.iter().collect::<Vec<_>>());
        let mut merged = Merged::new(blobs, 1e-4);
        for count in [11, 2] {
            let left = merged.reduce_to(count);
            assert_eq!(left.len(), count);
            let left: Vec<&Blob> = left.iter().map(|&i| &merged.blobs[i as usize]).collect();
            assert!(left.iter().all(|b| colors.iter().any(|c| c.abs_diff_eq(b.color, 1e-9))));
            let after = sums(&left);
            assert!((after.0 - before.0).abs() < 1e-9 * before.0);
            assert!(after.1.abs_diff_eq(before.1, 1e-9 * before.0));
            assert!(after.2.abs_diff_eq(before.2, 1e-9 * before.0));
        }
        let mut parts: Vec<u32> =
            merged.alive().into_iter().flat_map(|whole| merged.parts(whole)).collect();
        parts.sort_unstable();
        assert!(parts.into_iter().eq(0..60), "each is part of one");
    }

    #[test]
    fn what_parts_in_a_pose_stays_apart() {
        let at = |x: f64, posed: f64| ball(DVec3::X * x, DVec3::ONE, vec![DVec3::X * posed]);
        // By place at rest the second one is the first one's nearest.
        let blobs = vec![at(0.0, 0.0), at(0.001, 1.0), at(0.01, 0.01), at(0.011, 1.01)];
        let mut merged = Merged::new(blobs, 1e-4);
        let mut pairs: Vec<Vec<u32>> =
            merged.reduce_to(2).into_iter().map(|whole| merged.parts(whole)).collect();
        pairs.iter_mut().for_each(|pair| pair.sort_unstable());
        pairs.sort();
        assert_eq!(pairs, [[0, 2], [1, 3]]);
    }
}
