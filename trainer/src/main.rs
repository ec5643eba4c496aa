//! The `dermis` command.
use dermis_trainer::{eval::*, import, options::*, train::train};
fn main() -> anyhow::Result<()> {
    let a: Vec<String> = std::env::args().collect();
    let m = import::load(a[1].as_ref())?;
    let mut o = Options::preset(Preset::Draft);
    if let Some(s) = a.get(3) {
        o.steps = s.parse()?;
    }
    if let Ok(s) = std::env::var("LOSS") {
        let v: Vec<f32> = s.split(',').map(|x| x.parse().unwrap()).collect();
        o.loss = dermis_trainer::optimize::loss::Loss { l1: v[0], l2: v[1], dssim: v[2] };
    }
    if let Ok(s) = std::env::var("N") {
        o.gaussians = s.parse()?;
    }
    let t0 = std::time::Instant::now();
    let t = train(&m, &o)?;
    eprintln!("{:?} {} bytes", t0.elapsed(), t.bytes.len());
    std::fs::write(&a[2], &t.bytes)?;
    let av = dermis_format::Avatar::parse(&t.bytes)?;
    let e = evaluate(
        &av,
        &m,
        &EvalOptions {
            key_frames: 2,
            views: 10,
            size: 540,
            background: [1.; 3],
            budgets: vec![20000, 37500],
        },
    )?;
    for r in &e.rows {
        println!(
            "{:?} {} {:.2} {:.2} {:.4} {:.4}",
            r.split, r.gaussians, r.psnr_db, r.psnr_foreground_db, r.ssim, r.flip
        );
    }
    Ok(())
}
