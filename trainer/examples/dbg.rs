use dermis_runtime::*;
use dermis_trainer::{draw::*, import, scene::*, train::runtime_pose};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let m = import::load(a[1].as_ref()).unwrap();
    let bytes = std::fs::read(&a[2]).unwrap();
    let av = Avatar::parse(&bytes).unwrap();
    let dirs = training_directions();
    let painter = Painter::new(&m);
    let fr = reenactment_key_frames(&m, &[0, 1], 4);
    let tr = training_key_frames(&m, &[0, 1], 4);
    let mut all = vec![];
    for f in fr.iter().chain(&tr) {
        println!("{:?}", f);
        let posed = posed_vertices(&m, &f.pose(&m));
        let d = [dirs[13], dirs[0]];
        for cam in RigScale::of(&m).cameras(&d, &posed, 540, 540) {
            let t = render(&painter, &posed, &cam, [1.0; 3], 4);
            let dr = draw(&av, &runtime_pose(f), &Plan::with_budget(&av, u32::MAX), &cam, [1.0; 3])
                .unwrap();
            let tb = t.picture.to_bytes();
            let db = rgb_of(&dr.rgba);
            let diff: Vec<u8> = tb
                .iter()
                .zip(&db)
                .map(|(a, b)| 255 - ((*a as i32 - *b as i32).abs() * 3).min(255) as u8)
                .collect();
            all.push((tb, db, diff));
        }
    }
    let n = all.len();
    let w = 540 * 3;
    let mut img = image::RgbImage::new(w as u32, 540 * n as u32);
    for (i, (t, d, e)) in all.iter().enumerate() {
        for (k, b) in [t, d, e].iter().enumerate() {
            for y in 0..540 {
                for x in 0..540 {
                    let p = (y * 540 + x) * 3;
                    img.put_pixel(
                        (k * 540 + x) as u32,
                        (i * 540 + y) as u32,
                        image::Rgb([b[p], b[p + 1], b[p + 2]]),
                    );
                }
            }
        }
    }
    img.save(&a[3]).unwrap();
}
