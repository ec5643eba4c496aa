//! What a case gives beside frames: its Gaussians for those who draw by themselves, plans for three of its avatars under one
//! budget, splats for both eyes of a headset, and what is posed for a plan alone.

use crc32fast::Hasher;
use dermis_runtime::budget::{self, Budget, Gaze, Instance};
use dermis_runtime::math::Affine;
use dermis_runtime::{
    Camera, Kernel, Part, Plan, Pose, Posed, PosedGaussian, Prepared, Sides, pose, rate,
};

use crate::cases::Case;
use crate::draw::{self, Error};

/// Its column of the table.
pub const COLUMN: &str = "exported";

/// Words of a record.
const RECORD: usize = size_of::<PosedGaussian>() / 4;

/// CRC32 of the Gaussians of a case, those that its camera sees, then those of all sides, of the plans, of the splats of
/// both eyes, and of the Gaussians posed for the plan alone in another moment, where little movements are left out.
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
    draw::pose(case, kernel, scratch, |posed, plan, rest| {
        let mut hasher = Hasher::new();
        for sides in [Sides::Seen, Sides::All] {
            let written = posed.export(plan, camera.position(), sides, records)?;
            let records = records.get(..written).unwrap_or(&[]);
            hasher.update(bytemuck::try_cast_slice(records).unwrap_or_default());
        }
        let words = bytemuck::try_cast_slice_mut(&mut *records).unwrap_or_default();
        share(posed, &camera, words, &mut hasher)?;
        see(posed, plan, &camera, rest, &mut hasher)?;
        move_little(posed, plan, rest, records, &mut hasher)?;
        Ok(hasher.finalize())
    })
}

/// Hashes the splats of a pair of eyes, the left one being the camera.
fn see(
    posed: &Posed<'_, '_>,
    plan: &Plan,
    left: &Camera,
    scratch: &mut [u32],
    hasher: &mut Hasher,
) -> Result<(), Error> {
    let mut right = *left;
    right.world_to_camera[0][3] -= 0.063;
    let len = Prepared::scratch_len(posed.avatar(), plan.gaussians(), left.width, left.height);
    let missing = Error::Memory { needed: len.saturating_mul(2), lent: scratch.len() };
    let (first, rest) = scratch.split_at_mut_checked(len).ok_or(missing)?;
    let second = rest.get_mut(..len).ok_or(missing)?;
    let project = |parts: &mut [Part<'_, '_, 2>]| parts.iter_mut().for_each(Part::project);
    for eye in Prepared::of_eyes(posed, plan, [left, &right], [first, second], 2, project)? {
        hasher.update(bytemuck::cast_slice(eye.splats()));
    }
    Ok(())
}

/// Hashes what the first clip does to the Gaussians of a plan, but for what moves less than 5 cm.
fn move_little(
    posed: &Posed<'_, '_>,
    plan: &Plan,
    scratch: &mut [u32],
    records: &mut [PosedGaussian],
    hasher: &mut Hasher,
) -> Result<(), Error> {
    let avatar = posed.avatar();
    let moves = avatar.header().clips > 0;
    let pose = if moves { Pose::Clip { clip: 0, seconds: 0.4 } } else { Pose::Rest };
    let plan = plan.clone().with_still_below(0.05);
    let posed = Posed::for_plan(avatar, &pose, &plan, posed.kernel(), scratch)?;
    let written = posed.export(&plan, [0.0; 3], Sides::All, records)?;
    let records = records.get(..written).unwrap_or(&[]);
    hasher.update(bytemuck::try_cast_slice(records).unwrap_or_default());
    let carried = pose::carried(avatar, &pose);
    hasher.update(bytemuck::cast_slice(&carried));
    let frames = rate::frames_to_hold(avatar, 0, 100.0, 1.0 / 72.0, 0.5);
    hasher.update(&[u8::from(plan.is_still(avatar)), frames as u8]);
    Ok(())
}

/// Where three instances stand: as they are, further away, and half out of the frame.
const PLACES: [Affine; 3] = [
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    [[1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, -0.25], [0.0, 0.0, 1.0, -4.0]],
    [[0.6, 0.0, 0.8, -1.5], [0.0, 1.0, 0.0, 0.0], [-0.8, 0.0, 0.6, 0.0]],
];

/// Budgets that bind, one of Gaussians and one of blends.
const BUDGETS: [Budget; 2] = [
    Budget { gaussians: 150, blends: f32::INFINITY, movement: 0.5 },
    Budget { gaussians: 1_000, blends: 20_000.0, movement: 0.0 },
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
