//! The first Gaussians on a coarser mesh: few vertices are posed, and the picture is as good.

use dermis_runtime::{Avatar, Kernel, Plan, Pose, Posed};
use dermis_tests::small::{options, trained_demo};
use dermis_trainer::describe::Info;
use dermis_trainer::eval::{EvalOptions, evaluate};
use dermis_trainer::options::Options;

/// Of training at half the size: there a quarter of the Gaussians belongs.
const SIZE: u32 = 48;

/// Vertices that posing for the first layer takes.
fn posed_vertices(avatar: &Avatar<'_>) -> usize {
    let plan = Plan::at_level(avatar, 0.0);
    let mut scratch = vec![0; Posed::scratch_len_for_plan(avatar)];
    let pose = Pose::Clip { clip: 0, seconds: 0.4 };
    let posed = Posed::for_plan(avatar, &pose, &plan, Kernel::detect(), &mut scratch);
    let vertices = posed.expect("it can be posed").vertices();
    vertices.iter().filter(|vertex| vertex[0].is_finite()).count()
}

#[test]
fn a_level_on_its_coarse_mesh_is_as_good_as_on_the_surface() {
    let usual = options(3200, 900);
    let mut figures = Vec::new();
    for mesh_levels in [1, 2] {
        let (model, trained) = trained_demo(&Options { mesh_levels, ..usual.clone() });
        let avatar = Avatar::parse(&trained.bytes).expect("what was trained is valid");
        let mesh = Info::of(&avatar).mesh;
        assert_eq!(mesh.coarser.len() as u32, mesh_levels - 1);
        assert_eq!(mesh.triangles as usize, model.triangles.len());
        if let [coarser] = mesh.coarser[..] {
            assert!(coarser.gaussians >= 190 && coarser.triangles <= 130, "{coarser:?}");
        }
        let measure = EvalOptions {
            key_frames: 2,
            views: 8,
            size: SIZE / 2,
            background: [1.0; 3],
            budgets: Vec::new(),
            prefixes: Vec::new(),
            packed: None,
            planned: false,
            distance: None,
        };
        let rows = evaluate(&avatar, &model, &measure).expect("it can be measured").rows;
        let first = rows.iter().find(|row| row.gaussians == 200).expect("the first level");
        let vertices = posed_vertices(&avatar);
        println!("{mesh_levels}: {:.2} dB, {vertices} vertices", first.psnr_foreground_db);
        figures.push((first.psnr_foreground_db, vertices));
    }
    let [(fine, many), (coarse, few)] = figures[..] else { panic!("two trainings") };
    assert!(coarse > fine - 0.3, "{coarse} dB on its coarse mesh, {fine} on the surface");
    assert!(3 * few < many, "{few} vertices on the coarse mesh, {many} on the surface");
}
