//! The `dermis` command.
use dermis_trainer::{import, options::*, train::train};
fn main() -> anyhow::Result<()> {
    let a: Vec<String> = std::env::args().collect();
    let m = import::load(a[1].as_ref())?;
    let mut o = Options::preset(Preset::Draft);
    if let Some(s) = a.get(3) {
        o.steps = s.parse()?;
    }
    let t0 = std::time::Instant::now();
    let t = train(&m, &o)?;
    eprintln!("{:?} {} bytes", t0.elapsed(), t.bytes.len());
    std::fs::write(&a[2], t.bytes)?;
    Ok(())
}
