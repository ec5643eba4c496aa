//! Joints, binds and clips to bytes.

use crate::quant::Linear;
use crate::record::{BindRecord, ChannelRecord, ClipRecord, JointRecord, Range};
use crate::section::tag;
use crate::source::{Channel, Clip, Rig};

use super::{EncodeError, STEPS, bytes_of, extent, name_bytes, narrow, refuse, section, shortened};

pub(super) fn write_rig(out: &mut Vec<u8>, rig: &Rig) -> Result<(), EncodeError> {
    if rig.joints.is_empty() {
        return Ok(());
    }
    let joints: Vec<JointRecord> = rig
        .joints
        .iter()
        .map(|joint| JointRecord {
            parent: joint.parent.unwrap_or(u16::MAX).into(),
            translation: joint.translation.map(Into::into),
            rotation: joint.rotation.map(Into::into),
            scale: joint.scale.map(Into::into),
        })
        .collect();
    section(out, tag::JOINTS, bytes_of(&joints))?;
    section(out, tag::JOINT_NAMES, &name_bytes(rig.joints.iter().map(|joint| &joint.name)))?;
    let binds: Vec<BindRecord> = rig
        .binds
        .iter()
        .map(|&(joint, inverse)| BindRecord {
            joint: joint.into(),
            inverse: inverse.map(|row| row.map(Into::into)),
        })
        .collect();
    section(out, tag::BINDS, bytes_of(&binds))
}

pub(super) fn clip_payload(clip: &Clip) -> Result<Vec<u8>, EncodeError> {
    let name = shortened(&clip.name, usize::from(u16::MAX));
    let head = ClipRecord {
        seconds: clip.seconds.into(),
        channels: narrow::<u16>("channels", clip.channels.len())?.into(),
        name_len: narrow::<u16>("bytes of a name", name.len())?.into(),
    };
    let mut payload = bytes_of(&[head]).to_vec();
    payload.extend(name.as_bytes());
    let ranges = clip.channels.iter().enumerate().map(|(index, channel)| {
        let place = format!("clip {name}, channel {index}");
        channel_range(channel, &place)
    });
    let ranges: Vec<Range> = ranges.collect::<Result<_, _>>()?;
    for (channel, &range) in clip.channels.iter().zip(&ranges) {
        let (property, target) = channel.property.code();
        let record = ChannelRecord {
            property,
            interpolation: u8::from(!channel.holds),
            target: target.into(),
            keys: narrow::<u32>("keys", channel.values.len() / channel.property.width())?.into(),
            range,
        };
        payload.extend(bytes_of(&[record]));
    }
    for (channel, range) in clip.channels.iter().zip(ranges) {
        payload.extend(
            channel.values.iter().flat_map(|&value| range.code(value, u16::MAX).to_le_bytes()),
        );
    }
    Ok(payload)
}

fn channel_range(channel: &Channel, place: &str) -> Result<Range, EncodeError> {
    let wanted = channel.step;
    if !STEPS.contains(&wanted) {
        return refuse(format!("{place}: a step of {wanted}; give 0 to 1e6"));
    }
    match extent(channel.values.iter().copied()) {
        Some((low, high)) if high.is_finite() => {
            let Range { offset, step } = Range::spanning(low, high, u16::MAX);
            Ok(Range { offset, step: wanted.max(step.get()).into() })
        }
        _ => refuse(format!("{place}: it has no keys, or one that is not finite")),
    }
}
