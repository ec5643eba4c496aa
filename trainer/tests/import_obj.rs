//! What the OBJ importer makes of small files.

use dermis_trainer::import;
use dermis_trainer::model::{AlphaMode, Model};
use glam::{Vec2, Vec4};

const QUAD: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0.25\n\
    usemtl skin\nf 1/1 2/2 3/2 4/1\n";

fn load(obj: &str, mtl: Option<&str>) -> anyhow::Result<Model> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(&path, obj).unwrap();
    if let Some(mtl) = mtl {
        std::fs::write(folder.path().join("a.mtl"), mtl).unwrap();
        image::RgbImage::new(2, 1).save(folder.path().join("my skin.png")).unwrap();
    }
    import::load(&path)
}

#[test]
fn a_textured_quad_becomes_two_triangles() {
    let mtl = "newmtl skin\nKd 0.5 0.25 1\nd 0.5\nmap_Kd -s 1 1 1 -clamp on my skin.png\n";
    let model = load(QUAD, Some(mtl)).unwrap_or_else(|error| panic!("{error:#}"));
    assert_eq!((model.vertices.len(), model.triangles.len()), (4, 2));
    assert_eq!(model.vertices[1].uv, Vec2::new(1.0, 0.75), "v points down");
    let material = &model.materials[0];
    assert_eq!(material.base_color, Vec4::new(0.5, 0.25, 1.0, 0.5));
    assert_eq!((material.alpha, material.texture), (AlphaMode::Blend, Some(0)));
    assert_eq!(model.textures[0].image.dimensions(), (2, 1));
}

/// Editors put a byte order mark before the first line.
#[test]
fn marked_files_are_the_same_files() {
    let mtl = "newmtl skin\nKd 1 0 0\n";
    let (plain, mark) = (load(QUAD, Some(mtl)).unwrap(), '\u{feff}');
    for obj in [QUAD, QUAD.trim_start_matches("mtllib a.mtl\n")] {
        let marked = load(&format!("{mark}{obj}"), Some(&format!("{mark}{mtl}"))).unwrap();
        assert_eq!(marked.vertices, plain.vertices);
    }
    let marked = load(&format!("{mark}{QUAD}"), Some(&format!("{mark}{mtl}"))).unwrap();
    assert_eq!(marked.materials[0].base_color, plain.materials[0].base_color);
    assert_eq!(plain.materials[0].base_color, Vec4::new(1.0, 0.0, 0.0, 1.0));
}

#[test]
fn a_missing_library_leaves_the_material_plain() {
    let model = load(QUAD, None).unwrap();
    assert_eq!(model.materials.len(), 1);
    assert_eq!((model.materials[0].texture, model.materials[0].base_color), (None, Vec4::ONE));
}

#[test]
fn bad_files_are_refused_by_name() {
    let fails = |obj: &str, mtl: &str, part: &str| {
        let error = format!("{:#}", load(obj, Some(mtl)).expect_err(part));
        assert!(error.contains(part) && error.contains("a.obj: "), "{error}");
    };
    fails(QUAD, "newmtl skin\nmap_Kd gone.jpg\n", "gone.jpg");
    fails("v 0 0 0\n", "", "has no triangles");
    fails("v 0 0 0\nv 1 0 0\nf 1 2 9\n", "", "line 3: names vertex 9 of 2");
    fails("v 0 0 0\nf 1 1 -2\n", "", "line 2: names vertex -2 of 1");
    fails("v 0 0 0\nvt 0 0\nf 1/-9 1/0 1/1\n", "", "names texture coordinate -9 of 1");
    fails("v 0 0\n", "", "a vertex of 2 numbers; give it 3");
    fails("v 0 zero 0\n", "", "\"zero\" for a number");
    fails("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "", "vertex 0 is not finite");
}

#[test]
fn libraries_with_slips_still_give_materials() {
    let model = load(QUAD, Some("Kd 1 1\nnewmtl skin\nKd 1 1\nd\nTr x\nnewmtl\n")).unwrap();
    assert_eq!(model.materials[0].base_color, Vec4::ONE);
}

#[test]
fn relative_indices_colours_and_continued_lines_are_read() {
    let obj = "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 1\nvt 0 0.5\nf -3 \\\n2//7 -1/-1 # last\n";
    let model = load(obj, None).unwrap();
    assert_eq!(model.triangles[0].corners, [0, 1, 2]);
    assert_eq!(model.vertices[0].color, Vec4::new(1., 0., 0., 1.));
    assert_eq!([model.vertices[1].uv, model.vertices[2].uv], [Vec2::ZERO, Vec2::new(0., 0.5)]);
}
