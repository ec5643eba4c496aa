//! The `.dermis` container, version 3: a layered Gaussian avatar bound to a skinned mesh.
//!
//! The bytes are normative in `SPEC.md`; this crate is one program that reads and writes them.
//! Reading is `no_std`, needs no heap and copies nothing: [`Avatar::parse`] checks every length,
//! index, checksum and number once, and from then on all accessors are total (they cannot fail
//! and cannot panic).
//!
//! 1. [`section`] cuts the bytes into tagged sections, each with a CRC32.
//! 2. [`header`] says what the file holds and how wide its records are.
//! 3. [`record`] names every byte of the planes of fixed-size records.
//! 4. [`block`] is a band of a region's nested order, self-contained: [`discs`] packed bit by bit, on [`triangles`].
//! 5. [`level`] is a block's Gaussians at a later level, all of their numbers or scales and opacities alone, [`walk`] puts both side by side.
//! 6. [`quant`] turns codes into numbers, and back.
//! 7. [`order`] states which Gaussians of a block come first.
//! 8. [`curves`] say how good a picture each count makes.
//! 9. [`movement`] says how far joints and morph targets move the mesh.
//! 10. [`samples`] say which triangles stand for the others when a plan asks what is covered.
//! 11. [`mesh_levels`] say which triangles are the surface's, and which those of coarser meshes.
//! 12. [`avatar`] is the checked view of it all.
//! 13. `source` and `writer` (feature `std`) encode what a trainer or converter has.
#![cfg_attr(not(feature = "std"), no_std)]

pub mod avatar;
mod bits;
pub mod block;
pub mod curves;
pub mod discs;
pub mod error;
pub mod header;
pub mod level;
mod level_order;
pub mod mesh_levels;
pub mod movement;
pub mod names;
pub mod order;
pub mod packed;
pub mod quant;
pub mod record;
pub mod rig;
pub mod samples;
pub mod section;
#[cfg(feature = "std")]
pub mod source;
pub mod triangles;
pub mod walk;
#[cfg(feature = "std")]
pub mod writer;

pub use avatar::Avatar;
pub use block::{Block, Fulls, Records};
pub use curves::{CurvePoint, Curves};
pub use discs::{DiscLayout, Discs};
pub use error::Error;
pub use header::{FrameKind, Header, LowPass, PerLevel, RecordKind, ScaleLaw};
pub use level::Level;
pub use mesh_levels::MeshLevels;
pub use movement::Movements;
pub use quant::{Disc, Full};
pub use record::DiscWidths;
pub use samples::{Sample, Samples};
pub use triangles::Triangles;
pub use walk::Levels;
