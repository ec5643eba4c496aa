//! What a case gives those who draw by themselves: its Gaussians, and plans for three of its avatars under one budget.

use crc32fast::Hasher;
use dermis_runtime::budget::{self, Budget, Gaze, Instance};
use dermis_runtime::math::Affine;
use dermis_runtime::{Camera, Kernel, Plan, Posed, PosedGaussian, Sides};

use crate::cases::Case;
use crate::draw::{Error, pose};

/// Its column of the table.
pub const COLUMN: &str = "exported";

/// Words of a record.
const RECORD: usize = size_of::<PosedGaussian>() / 4;

/// CRC32 of the Gaussians of a case, those that its camera sees, then those of all sides, and of the plans.
pub fn export(
    case: &Case,
    kernel: Kernel,
    scratch: &mut [u32],
    records: &mut [u32],
) -> Result<u32, Error> {
    // Records are made of words.
    let records: &mut [PosedGaussian] =
        bytemuck::try_cast_slice_mut(records.as_chunks_mut::<RECORD>().0).unwrap_or_default();
    let camera = case.view.camera(case.size);
    pose(case, kernel, scratch, |posed, plan, _| {
        let mut hasher = Hasher::new();
        for sides in [Sides::Seen, Sides::All] {
            let written = posed.export(plan, camera.position(), sides, records)?;
            let records = records.get(..written).unwrap_or(&[]);
            hasher.update(bytemuck::try_cast_slice(records).unwrap_or_default());
        }
        let words = bytemuck::try_cast_slice_mut(records).unwrap_or_default();
        share(posed, &camera, words, &mut hasher)?;
        Ok(hasher.finalize())
    })
}

/// Where three instances stand: as they are, further away, and half out of the frame.
const PLACES: [Affine; 3] = [
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    [[1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, -0.25], [0.0, 0.0, 1.0, -4.0]],
    [[0.6, 0.0, 0.8, -1.5], [0.0, 1.0, 0.0, 0.0], [-0.8, 0.0, 0.6, 0.0]],
];

/// Budgets that bind, one of Gaussians and one of blends.
const BUDGETS: [Budget; 2] = [
    Budget { gaussians: 150, blends: f32::INFINITY },
    Budget { gaussians: 1_000, blends: 20_000.0 },
];

/// Hashes the counts of regions of plans for the three places.
fn share(
    posed: &Posed<'_, '_>,
    camera: &Camera,
    scratch: &mut [u32],
    hasher: &mut Hasher,
) -> Result<(), Error> {
    let gaze = Gaze { point: [0.25 * camera.width as f32, 10.0], falloff: 20.0 };
    let instances = PLACES.map(|place| Instance {
        avatar: posed.avatar(),
        footprints: posed.footprints(&camera.for_place(&place)),
        weight: 1.0,
    });
    for budget in &BUDGETS {
        let mut plans = PLACES.map(|_| Plan::default());
        budget::plan(&instances, budget, Some(&gaze), scratch, &mut plans)?;
        for region in plans.iter().flat_map(Plan::regions) {
            hasher.update(&region.count.to_le_bytes());
        }
    }
    Ok(())
}
