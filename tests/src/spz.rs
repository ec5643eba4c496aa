//! Gaussians in SPZ, by code that shares nothing with the trainer's.

use std::io::Write as _;

use ruzstd::encoding::{CompressionLevel, compress_to_vec};

use crate::splat_files::{Columns, byte};
use crate::splats::SplatPly;

/// The planes of an SPZ before they are compressed.
#[derive(Clone, Debug)]
pub struct Spz {
    /// Of 2 and 3 the 16 bytes of the header, of 4 its 32.
    pub header: Vec<u8>,
    /// Positions, alphas, colours, scales, rotations, harmonics.
    pub planes: [Vec<u8>; 6],
    /// What follows the planes, or the header of version 4.
    pub extensions: Vec<u8>,
}

impl Spz {
    /// Gaussians in planes, 14 bits after the binary point, and what they say.
    pub fn new(ply: &SplatPly, version: u32) -> (Self, SplatPly) {
        let columns = Columns::of(ply);
        let mut planes: [Vec<u8>; 6] = Default::default();
        let mut said = ply.clone();
        for row in &mut said.rows {
            for &c in &columns.center {
                let fixed = (f64::from(row[c]) * 16_384.0).round();
                planes[0].extend(&(fixed as i32).to_le_bytes()[..3]);
                row[c] = (fixed / 16_384.0) as f32;
            }
            let alpha = byte(255.0 * columns.opacity(row));
            planes[1].push(alpha);
            for channel in 0..3 {
                let code = byte((0.15 * f64::from(row[columns.dc[channel]]) + 0.5) * 255.0);
                planes[2].push(code);
                row[columns.dc[channel]] = ((f64::from(code) / 255.0 - 0.5) / 0.15) as f32;
            }
            for &c in &columns.scale {
                let code = byte((f64::from(row[c]) + 10.0) * 16.0);
                planes[3].push(code);
                row[c] = f32::from(code) / 16.0 - 10.0;
            }
            let turn = columns.rotation(row);
            let turn = if version == 2 {
                first_three(turn, &mut planes[4])
            } else {
                smallest_three(turn, &mut planes[4])
            };
            columns.turn.iter().zip(turn).for_each(|(&c, x)| row[c] = x as f32);
            let bands = columns.rest.len() / 3;
            for band in 0..bands {
                for channel in 0..3 {
                    let x = &mut row[columns.rest[channel * bands + band]];
                    let code = byte(f64::from(*x) * 128.0 + 128.0);
                    planes[5].push(code);
                    *x = (f32::from(code) - 128.0) / 128.0;
                }
            }
            columns.set_opacity(row, f64::from(alpha) / 255.0);
        }
        let (count, degree) = (ply.rows.len() as u32, ply.degree() as u8);
        let mut header = b"NGSP".to_vec();
        header.extend([version, count].map(u32::to_le_bytes).concat());
        let streams = if version < 4 { 0 } else { 5 + u8::from(degree > 0) };
        header.extend([degree, 14, 0, streams]);
        if version >= 4 {
            header.extend(32u32.to_le_bytes());
            header.extend([0; 12]);
        }
        (Self { header, planes, extensions: Vec::new() }, said)
    }

    /// The flags of the header.
    pub fn flags(&mut self) -> &mut u8 {
        &mut self.header[14]
    }

    /// What versions 2 and 3 compress as one.
    pub fn plain(&self) -> Vec<u8> {
        [&self.header, &self.planes.concat(), &self.extensions].map(Vec::as_slice).concat()
    }

    /// The file.
    pub fn bytes(&self) -> Vec<u8> {
        if self.header[4] < 4 {
            return gzip(&self.plain());
        }
        let mut bytes = self.header.clone();
        bytes[16..20].copy_from_slice(&(32 + self.extensions.len() as u32).to_le_bytes());
        bytes.extend(&self.extensions);
        let planes = self.planes.iter().filter(|plane| !plane.is_empty());
        let packed: Vec<_> = planes
            .map(|plane| {
                (plane.len(), compress_to_vec(plane.as_slice(), CompressionLevel::Fastest))
            })
            .collect();
        for (len, packed) in &packed {
            bytes.extend([packed.len() as u64, *len as u64].map(u64::to_le_bytes).concat());
        }
        packed.iter().for_each(|(_, packed)| bytes.extend(packed));
        bytes
    }
}

/// A gzip stream.
pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut stream = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    stream.write_all(bytes).expect("memory takes it");
    stream.finish().expect("memory takes it")
}

fn first_three([w, x, y, z]: [f64; 4], to: &mut Vec<u8>) -> [f64; 4] {
    let sign = if w < 0.0 { -1.0 } else { 1.0 };
    let codes = [x, y, z].map(|x| byte(127.5 * sign * x + 127.5));
    to.extend(codes);
    let [x, y, z] = codes.map(|code| f64::from(code) / 127.5 - 1.0);
    [(1.0 - (x * x + y * y + z * z)).max(0.0).sqrt(), x, y, z]
}

/// Two bits for the greatest of x, y, z, w; signs and magnitudes of the others, the last one lowest.
fn smallest_three([w, x, y, z]: [f64; 4], to: &mut Vec<u8>) -> [f64; 4] {
    let q = [x, y, z, w];
    let greatest =
        (0..4).max_by(|&a, &b| q[a].abs().total_cmp(&q[b].abs())).expect("there are four");
    let mut said = [0.0f64; 4];
    let mut bits = format!("{greatest:02b}");
    for i in (0..4).filter(|&i| i != greatest) {
        let x = q[i] * q[greatest].signum();
        let magnitude = (x.abs() * 2f64.sqrt() * 511.0).round().min(511.0);
        bits += &format!("{}{:09b}", u8::from(x < 0.0), magnitude as u32);
        said[i] = (magnitude / 511.0 / 2f64.sqrt()).copysign(x);
    }
    said[greatest] = (1.0 - said.iter().map(|x| x * x).sum::<f64>()).max(0.0).sqrt();
    to.extend(u32::from_str_radix(&bits, 2).expect("32 bits").to_le_bytes());
    [said[3], said[0], said[1], said[2]]
}
