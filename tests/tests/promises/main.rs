//! What holds over many frames, many sizes of scratch and many avatars: memory that was used before
//! does not show, nor how much of it there is, and how much it takes is bounded.

mod frame;
mod least_scratch;
mod long_run;
mod scratch_bound;
mod stereo;
