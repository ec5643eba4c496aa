//! Which triangles tell how much of a picture a region covers, and what each stands for: a plan looks at no others.

use crate::header::Header;
use crate::record::{SampleRecord, plane};

/// The greatest number of a sample.
pub const MOST: f32 = crate::movement::MOST;

/// A triangle that stands for a part of its region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Its index.
    pub triangle: u32,
    /// Footprint of what it stands for, to its own.
    pub area: f32,
    /// The same, each px² weighted by how many Gaussians are blended there, to the mean over the region.
    pub fill: f32,
}

/// Those of all regions, in the file.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a>(&'a [SampleRecord]);

impl<'a> Samples<'a> {
    /// `None` where the payload is no whole number of records, triangles do not exist or do not ascend, or a number is out
    /// of its range.
    pub(crate) fn split(payload: &'a [u8], header: &Header) -> Option<Self> {
        let samples = Self(plane(payload)?);
        let in_range = |number: f32| (0.0..=MOST).contains(&number);
        let valid = samples.iter().all(|Sample { triangle, area, fill }| {
            triangle < header.triangles && in_range(area) && in_range(fill)
        });
        let ascend = samples.0.is_sorted_by(|a, b| a.triangle.get() < b.triangle.get());
        (valid && ascend).then_some(samples)
    }

    /// By ascending triangle.
    pub fn iter(&self) -> impl Iterator<Item = Sample> + 'a {
        self.0.iter().map(|record| Sample {
            triangle: record.triangle.get(),
            area: record.area.get(),
            fill: record.fill.get(),
        })
    }
}
