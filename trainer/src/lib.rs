//! Turns a rigged, textured mesh into a `.dermis` avatar, and measures what came out.
//!
//! Data flows one way: mesh → truth → placement → descent → bytes → pictures → figures.
//!
//! 1. [`import`] reads GLB, glTF and OBJ into a [`model`]; [`demo`] makes one without any input.
//! 2. [`scene`] poses the model, places cameras, renders the textured mesh as ground truth;
//!    [`truth`] keeps its pictures.
//! 3. [`embed`] puts Gaussians on the triangles, coarse to fine.
//! 4. [`optimize`] draws them with the runtime's own stages and descends the gradient; [`methods`] are ways
//!    to do 3 and 4, ours and the papers'.
//! 5. [`package`] encodes mesh, rig, [`clips`], how far these move it ([`movements`]) and Gaussians; [`describe`] lists what a file holds.
//! 6. [`draw`] draws a file as its users will, [`orbit`] places a camera; [`eval`] and [`metrics`] compare with the mesh, and
//!    with a reference renderer in f64; [`page`] shows it.
//!
//! [`convert`] takes another way to the bytes, from Gaussians that are trained already, and [`export`] leads back
//! to files of other programs; [`mannequin`]
//! makes Gaussians to measure on, and [`mod@bench`] measures the time of a frame beside its error.
//!
//! [`reproduce`] makes the papers' tables for a mesh.
//!
//! [`train::train`] is the whole of 2 to 5; [`options`] says all that it depends on. The same mesh,
//! options and seed give the same bytes on one platform, whatever the number of threads (the truth is
//! rendered with the platform's own powers and sines), also where it was killed on the way and goes on from a
//! [`checkpoint`]. The command line stands in `main.rs` and `commands/`, which only read arguments and print.

pub mod bench;
pub mod camera_file;
pub mod checkpoint;
pub mod clips;
pub mod convert;
pub mod demo;
pub mod describe;
pub mod draw;
pub mod embed;
pub mod eval;
pub mod export;
pub mod import;
pub mod mannequin;
pub mod methods;
pub mod metrics;
pub mod model;
pub mod movements;
mod nearest;
pub mod optimize;
pub mod options;
pub mod orbit;
pub mod output;
pub mod package;
pub mod page;
pub mod picture;
pub mod progress;
pub mod reproduce;
pub mod scene;
pub mod train;
pub mod truth;
mod widest;
