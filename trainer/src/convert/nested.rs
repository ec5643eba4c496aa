//! Converted Gaussians in a nested order: any prefix of it is a picture.
//!
//! 1. A space-filling curve (Morton's) goes through the centres (of those on a mesh: through their
//!    triangles').
//! 2. Ranks are given along it by reversed bits (van der Corput's sequence), so a prefix is evenly
//!    spread along the curve, and so in space. The square root law widens it until it covers what all
//!    of them covered.
//! 3. Each layer has three times the Gaussians of all before it. Where layers are given, 1 and 2
//!    are done in each by itself.
//! 4. A block stands along the curve (on a mesh: by triangle first, as the format wants it). Its
//!    groups, which share ranges, are runs of the curve, hence small in space; and ranks inside the
//!    block, which the format gives by reversed bits of the place, are spread along the curve again.
//!
//! What is large or opaque does not come first: `notes/convert.md` says why.

use dermis_format::header::MAX_LAYERS;
use dermis_format::order;

/// The coarsest layer has at least so many Gaussians, unless there are fewer: a group of the format,
/// whose head would weigh more than they save if it were shared by less.
const COARSEST: u32 = 256;

/// Bits of a coordinate on the curve: three of them fill 63 of 64 bits.
const CURVE_BITS: u32 = 21;

/// Gaussians in the order of the file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Nested {
    /// How many each layer has.
    pub(super) layers: Vec<u32>,
    /// Index of each.
    pub(super) order: Vec<u32>,
}

impl Nested {
    /// Orders Gaussians by their centres, less than 2³² of them, all finite, and by their
    /// triangles; none without a mesh.
    pub(super) fn of(centers: &[[f32; 3]], triangles: &[u32]) -> Self {
        let curve = along_curve(centers);
        let ranked = ranked(&curve);
        Self::in_blocks(layers(centers.len() as u32), &curve, ranked, triangles)
    }

    /// The same for layers that are given, as they stand one after the other.
    pub(super) fn of_layers(centers: &[[f32; 3]], triangles: &[u32], layers: Vec<u32>) -> Self {
        let (mut curve, mut ranks) = (Vec::new(), Vec::new());
        for &len in &layers {
            let first = curve.len();
            let own = along_curve(&centers[first..first + len as usize]);
            let own: Vec<u32> = own.into_iter().map(|index| index + first as u32).collect();
            ranks.extend(ranked(&own));
            curve.extend(own);
        }
        Self::in_blocks(layers, &curve, ranks, triangles)
    }

    /// Sorts what stands in a block by triangle, then along the curve.
    fn in_blocks(layers: Vec<u32>, curve: &[u32], ranked: Vec<u32>, triangles: &[u32]) -> Self {
        let mut places = vec![0u32; curve.len()];
        for (place, &index) in (0..).zip(curve) {
            places[index as usize] = place;
        }
        let mut order = ranked;
        for (_, first, count) in order::blocks(&layers) {
            order[first as usize..(first + count) as usize].sort_unstable_by_key(|&index| {
                let index = index as usize;
                (triangles.get(index), places[index])
            });
        }
        Self { layers, order }
    }
}

/// What stands along a curve in the order of rank.
fn ranked(curve: &[u32]) -> Vec<u32> {
    let mut places: Vec<u32> = (0..curve.len() as u32).collect();
    places.sort_unstable_by_key(|place| place.reverse_bits());
    places.into_iter().map(|place| curve[place as usize]).collect()
}

/// Gaussians of each layer.
pub(super) fn layers(count: u32) -> Vec<u32> {
    let mut ends = vec![count];
    while ends.len() < MAX_LAYERS && ends[0] / 4 >= COARSEST {
        ends.insert(0, ends[0] / 4);
    }
    let starts = [0].into_iter().chain(ends.clone());
    ends.iter().zip(starts).map(|(end, start)| end - start).collect()
}

/// Indices of the Gaussians along Morton's curve through cubes; where cubes agree, as they came.
pub(super) fn along_curve(centers: &[[f32; 3]]) -> Vec<u32> {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for center in centers {
        for (axis, &x) in center.iter().enumerate() {
            low[axis] = low[axis].min(x);
            high[axis] = high[axis].max(x);
        }
    }
    let low = low.map(f64::from);
    let extents = high.iter().zip(low).map(|(&high, low)| f64::from(high) - low);
    let extent = extents.fold(0.0, f64::max);
    let cells = f64::from((1u32 << CURVE_BITS) - 1);
    let scale = if extent > 0.0 { cells / extent } else { 0.0 };
    let key = |(index, center): (usize, &[f32; 3])| {
        let cell = |axis: usize| ((f64::from(center[axis]) - low[axis]) * scale) as u64;
        (spread(cell(0)) | spread(cell(1)) << 1 | spread(cell(2)) << 2, index as u32)
    };
    let mut keys: Vec<(u64, u32)> = centers.iter().enumerate().map(key).collect();
    keys.sort_unstable();
    keys.into_iter().map(|(_, index)| index).collect()
}

/// The lowest 21 bits, two zeros between each and the next.
fn spread(x: u64) -> u64 {
    let mut x = x & 0x1f_ffff;
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        x = (x | x << shift) & mask;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::schedule::Random;

    /// On a square of 1 m.
    fn square(count: u32) -> Vec<[f32; 3]> {
        let mut random = Random::new(3);
        (0..count).map(|_| [random.unit(), random.unit(), 0.0]).collect()
    }

    #[test]
    fn bits_are_spread() {
        for bit in 0..CURVE_BITS {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread(0x1f_ffff).count_ones(), 21);
    }

    #[test]
    fn layers_grow_by_four() {
        assert_eq!(layers(1), [1]);
        assert_eq!(layers(1023), [1023]);
        assert_eq!(layers(1024), [256, 768]);
        assert_eq!(layers(75_770), [295, 888, 3552, 14_207, 56_828]);
        assert!(layers(u32::MAX).len() <= MAX_LAYERS);
    }

    #[test]
    fn every_gaussian_stands_once() {
        for count in [1, 2, 255, 256, 1000, 4097, 20_000] {
            let mut order = Nested::of(&square(count), &[]).order;
            order.sort_unstable();
            assert!(order.into_iter().eq(0..count), "{count}");
        }
        // All in one place.
        let same = vec![square(1)[0]; 300];
        assert_eq!(Nested::of(&same, &[]).order.len(), 300);
    }

    #[test]
    fn given_layers_keep_their_gaussians() {
        let centers = square(9000);
        let triangles: Vec<u32> = (0..9000).map(|i| i * 7919 % 500).collect();
        let given = vec![700, 0, 8300];
        let Nested { layers, mut order } = Nested::of_layers(&centers, &triangles, given.clone());
        assert_eq!(layers, given);
        for (_, first, count) in order::blocks(&layers) {
            let block = &order[first as usize..(first + count) as usize];
            assert!(block.is_sorted_by_key(|&i| triangles[i as usize]));
        }
        order[..700].sort_unstable();
        order[700..].sort_unstable();
        assert!(order.into_iter().eq(0..9000));
    }

    #[test]
    fn prefixes_are_spread() {
        let centers = square(20_000);
        let Nested { layers, order } = Nested::of(&centers, &[]);
        let mut by_rank = vec![0; order.len()];
        for (_, first, count) in order::blocks(&layers) {
            for place in 0..count {
                let rank = (first + order::rank(place, count)) as usize;
                by_rank[rank] = order[(first + place) as usize];
            }
        }
        for prefix in [64, 700, 4096, 11_000] {
            // In each of 8 × 8 squares there is as much of the prefix as of all, within a third.
            let mut counts = [0u32; 64];
            for &index in &by_rank[..prefix] {
                let [x, y, _] = centers[index as usize];
                counts[(y * 8.0) as usize * 8 + (x * 8.0) as usize] += 1;
            }
            let mean = prefix as f64 / 64.0;
            let off = |&n: &u32| (f64::from(n) - mean).abs();
            let worst = counts.iter().map(off).fold(0.0, f64::max);
            assert!(worst <= 2.0 + mean / 3.0, "{prefix}: {counts:?}");
        }
    }

    #[test]
    fn groups_are_small() {
        let centers = square(20_000);
        let Nested { layers, order } = Nested::of(&centers, &[]);
        let mut areas = Vec::new();
        for (_, first, count) in order::blocks(&layers) {
            for group in order[first as usize..(first + count) as usize].chunks(256) {
                let extent = |axis: usize| {
                    let at = |&i: &u32| centers[i as usize][axis];
                    group.iter().map(at).fold(0.0, f32::max)
                        - group.iter().map(at).fold(1.0, f32::min)
                };
                areas.push(extent(0) * extent(1) * (count as f32 / group.len() as f32));
            }
        }
        // A group's box is at most a few times its share of the square.
        let mean = areas.iter().sum::<f32>() / areas.len() as f32;
        assert!(mean < 3.0, "{mean}: {areas:?}");
    }
}
