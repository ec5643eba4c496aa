//! Hands the linker the board's memory map.

fn main() {
    let folder = std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
    println!("cargo:rustc-link-arg=-T{folder}/mps2-an386.ld");
    println!("cargo:rerun-if-changed=mps2-an386.ld");
}
