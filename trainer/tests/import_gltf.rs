//! What the glTF importer makes of small files, each built here around one feature.

use base64::Engine;
use dermis_trainer::import;
use dermis_trainer::model::{AlphaMode, ChannelTarget, Interpolation, Model, Wrap};
use glam::{Vec2, Vec3, Vec4};
use serde_json::{Value, json};

/// A glTF file under construction, with one buffer.
struct File {
    json: Value,
    buffer: Vec<u8>,
}

/// The component type of f32.
const FLOAT: u32 = 5126;

impl File {
    /// One node with one mesh of one triangle: (0,0,0), (1,0,0), (0,1,0).
    fn triangle() -> Self {
        let mut file = Self { json: json!({"asset": {"version": "2.0"}}), buffer: Vec::new() };
        let positions = file.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
        file.json["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": positions}}]}]);
        file.json["nodes"] = json!([{"mesh": 0, "name": "body"}]);
        file
    }

    fn push(&mut self, list: &str, value: Value) -> usize {
        if self.json.get(list).is_none() {
            self.json[list] = json!([]);
        }
        let list = self.json[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        let offset = self.buffer.len();
        self.buffer.extend(bytes);
        let view = json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()});
        self.push("bufferViews", view)
    }

    fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessor =
            json!({"bufferView": view, "componentType": component, "type": kind, "count": count});
        self.push("accessors", accessor)
    }

    fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "MAT4" => 16,
            vector => usize::from(vector.as_bytes()[3] - b'0'),
        };
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(kind, FLOAT, values.len() / width, &bytes)
    }

    fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    fn set_attribute(&mut self, name: &str, accessor: usize) {
        self.primitive()["attributes"][name] = accessor.into();
    }

    /// Adds a 1 × 1 red texture as the base colour of material 0.
    fn set_texture(&mut self, info: Value) {
        let mut png = Vec::new();
        let pixel = image::RgbaImage::from_pixel(1, 1, image::Rgba([255, 0, 0, 255]));
        pixel.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
        let view = self.view(&png);
        self.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
        self.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]);
        self.json["textures"] = json!([{"source": 0, "sampler": 0}]);
        self.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": info}}]);
        self.primitive()["material"] = 0.into();
    }

    /// Skins the triangle: all vertices on the first joint with weight 1.
    fn set_skin_attributes(&mut self) {
        let joints = self.accessor("VEC4", 5121, 3, &[0; 12]);
        let weights = self.floats("VEC4", &[1., 0., 0., 0.].repeat(3));
        self.set_attribute("JOINTS_0", joints);
        self.set_attribute("WEIGHTS_0", weights);
    }

    fn text(&self) -> String {
        let mut json = self.json.clone();
        let data = base64::engine::general_purpose::STANDARD.encode(&self.buffer);
        let uri = format!("data:application/octet-stream;base64,{data}");
        if json.get("buffers").is_none() {
            json["buffers"] = json!([{"byteLength": self.buffer.len(), "uri": uri}]);
        }
        json.to_string()
    }

    fn load(&self) -> anyhow::Result<Model> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gltf");
        std::fs::write(&path, self.text()).unwrap();
        import::load(&path)
    }

    fn read(&self) -> Model {
        self.load().unwrap_or_else(|error| panic!("{error:#}"))
    }

    /// The error's line, which must hold `part`.
    fn fails_with(&self, part: &str) {
        let error = format!("{:#}", self.load().expect_err(part));
        assert!(error.contains(part), "{error:?} does not say {part:?}");
        assert!(error.contains("a.gltf: "), "{error:?} does not name the file");
    }
}

fn positions(model: &Model) -> Vec<Vec3> {
    model.vertices.iter().map(|vertex| vertex.position).collect()
}

fn translation_matrix(x: f32, y: f32, z: f32) -> [f32; 16] {
    glam::Mat4::from_translation(Vec3::new(x, y, z)).to_cols_array()
}

const TRIANGLE: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

#[test]
fn a_plain_triangle_needs_no_joints() {
    let model = File::triangle().read();
    assert_eq!(positions(&model), TRIANGLE);
    assert_eq!(model.triangles[0].corners, [0, 1, 2]);
    assert_eq!((model.joints.len(), model.binds.len(), model.materials.len()), (0, 0, 1));
    assert_eq!(model.vertices[0].color, Vec4::ONE);
    assert_eq!(model.vertices[0].influences, [(0, 0.0); 4]);
}

#[test]
fn the_three_interpolations_arrive() {
    let mut file = File::triangle();
    let times = file.floats("SCALAR", &[0., 1.]);
    let steps = file.floats("VEC3", &[0., 0., 0., 1., 2., 3.]);
    // Not of unit length, as some exporters round.
    let turns = file.floats("VEC4", &[0., 0., 0., 2., 0., 1., 0., 0.]);
    let splines = file.floats("VEC3", &(0..18).map(|i| i as f32).collect::<Vec<_>>());
    file.json["animations"] = json!([{
        "name": "all",
        "samplers": [
            {"input": times, "output": steps, "interpolation": "STEP"},
            {"input": times, "output": turns},
            {"input": times, "output": splines, "interpolation": "CUBICSPLINE"}],
        "channels": [
            {"sampler": 0, "target": {"node": 0, "path": "translation"}},
            {"sampler": 1, "target": {"node": 0, "path": "rotation"}},
            {"sampler": 2, "target": {"node": 0, "path": "scale"}}],
    }]);
    let model = file.read();
    assert_eq!((model.joints.len(), model.binds.len()), (1, 1));
    let clip = &model.clips[0];
    assert_eq!((clip.name.as_str(), clip.seconds), ("all", 1.0));
    let [step, turn, spline] = &clip.channels[..] else { panic!("three channels") };
    assert_eq!(step.target, ChannelTarget::Translation(0));
    assert_eq!(step.interpolation, Interpolation::Step);
    assert_eq!(step.values, [0., 0., 0., 1., 2., 3.]);
    assert_eq!(turn.interpolation, Interpolation::Linear);
    assert_eq!(turn.values, [0., 0., 0., 1., 0., 1., 0., 0.]);
    assert_eq!(spline.target, ChannelTarget::Scale(0));
    assert_eq!(spline.interpolation, Interpolation::CubicSpline);
    assert_eq!(spline.values.len(), 18);
}

#[test]
fn weights_split_into_a_channel_a_target() {
    let mut file = File::triangle();
    let near = file.floats("VEC3", &[0., 0., 0., 0., 0., 1., 0., 0., 0.]);
    let far = file.floats("VEC3", &[0., 0., 5., 0., 0., 0., 0., 0., 0.]);
    file.primitive()["targets"] = json!([{"POSITION": near}, {"POSITION": far}]);
    file.json["meshes"][0]["weights"] = json!([0.25, 0.5]);
    file.json["meshes"][0]["extras"] = json!({"targetNames": ["near"]});
    let times = file.floats("SCALAR", &[1., 2.]);
    let linear = file.floats("SCALAR", &[10., 20., 11., 21.]);
    // In-tangents of both targets, values of both, out-tangents of both; then the next key.
    let spline = file.floats("SCALAR", &[1., 2., 3., 4., 5., 6., 7., 8., 9., 10., 11., 12.]);
    file.json["animations"] = json!([
        {"samplers": [{"input": times, "output": linear}],
         "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]},
        {"samplers": [{"input": times, "output": spline, "interpolation": "CUBICSPLINE"}],
         "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}]);
    let model = file.read();
    assert_eq!(model.morph_targets[0].name, "near");
    assert_eq!(model.morph_targets[1].name, "body.1");
    assert_eq!(model.morph_targets[0].deltas, [(1, Vec3::Z)]);
    assert_eq!(model.morph_targets[1].deltas, [(0, Vec3::Z * 5.0)]);
    assert_eq!(model.morph_targets[1].default_weight, 0.5);
    let [linear, spline] = &model.clips[..] else { panic!("two clips") };
    assert_eq!((linear.name.as_str(), linear.seconds), ("clip0", 2.0));
    assert_eq!(linear.channels[0].values, [10., 11.]);
    assert_eq!(linear.channels[1].target, ChannelTarget::Weight(1));
    assert_eq!(linear.channels[1].values, [20., 21.]);
    assert_eq!(spline.channels[0].values, [1., 3., 5., 7., 9., 11.]);
    assert_eq!(spline.channels[1].values, [2., 4., 6., 8., 10., 12.]);
}

#[test]
fn clips_beyond_reason_are_refused_by_name() {
    let lasting = |seconds: f32| {
        let mut file = File::triangle();
        let times = file.floats("SCALAR", &[0., seconds]);
        let moves = file.floats("VEC3", &[0., 0., 0., 1., 0., 0.]);
        file.json["animations"] = json!([{
            "name": "walk",
            "samplers": [{"input": times, "output": moves}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]);
        file
    };
    assert_eq!(lasting(3600.0).read().clips[0].seconds, 3600.0);
    for seconds in [3e6, 1e30, f32::MAX] {
        lasting(seconds).fails_with("clip \"walk\": its ");
    }
}

#[test]
fn repeated_keys_are_left_out() {
    let mut file = File::triangle();
    let times = file.floats("SCALAR", &[0., 1., 1., 2.]);
    let moves = file.floats("VEC3", &(0..12).map(|i| i as f32).collect::<Vec<_>>());
    file.json["animations"] = json!([{
        "samplers": [{"input": times, "output": moves}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]);
    let channel = &file.read().clips[0].channels[0];
    assert_eq!(channel.times, [0., 1., 2.]);
    assert_eq!(channel.values, [0., 1., 2., 3., 4., 5., 9., 10., 11.]);
}

#[test]
fn strided_normalized_and_sparse_accessors_are_read() {
    let mut file = File::triangle();
    // x, y, z as i16 and one pad: a stride of 8. The third vertex is replaced.
    let words = [0i16, 0, 0, 9, 32767, -32768, 0, 9, 0, 0, 0, 9];
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let positions = file.accessor("VEC3", 5122, 3, &bytes);
    let view = file.json["accessors"][positions]["bufferView"].as_u64().unwrap() as usize;
    file.json["bufferViews"][view]["byteStride"] = 8.into();
    let index = file.view(&[2]);
    let value = file.view(&[0, 0, 0xff, 0x7f, 0, 0]);
    file.json["accessors"][positions]["normalized"] = true.into();
    file.json["accessors"][positions]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": index, "componentType": 5121}, "values": {"bufferView": value}});
    file.set_attribute("POSITION", positions);
    let colors = file.accessor("VEC3", 5121, 3, &[255, 0, 51, 0, 0, 0, 255, 255, 255]);
    file.json["accessors"][colors]["normalized"] = true.into();
    file.set_attribute("COLOR_0", colors);
    // Only the sparse elements exist; all others are zero.
    let delta = file.floats("VEC3", &[0., 0., 7.]);
    let delta_view = file.json["accessors"][delta]["bufferView"].clone();
    let target = file.push(
        "accessors",
        json!({"componentType": FLOAT, "type": "VEC3", "count": 3,
        "sparse": {"count": 1, "indices": {"bufferView": index, "componentType": 5121},
            "values": {"bufferView": delta_view}}}),
    );
    file.primitive()["targets"] = json!([{"POSITION": target}]);
    let model = file.read();
    assert_eq!(positions_of(&model), [[0., 0., 0.], [1., -1., 0.], [0., 1., 0.]]);
    assert_eq!(model.vertices[0].color, Vec4::new(1.0, 0.0, 0.2, 1.0));
    assert_eq!(model.morph_targets[0].deltas, [(2, Vec3::Z * 7.0)]);
}

fn positions_of(model: &Model) -> Vec<[f32; 3]> {
    model.vertices.iter().map(|vertex| vertex.position.to_array()).collect()
}

/// Two nodes with the same triangle and a skin each over the joints 2 and 3; the second skin's
/// inverse binds are given.
fn two_skins(second: [[f32; 16]; 2]) -> Model {
    let mut file = File::triangle();
    let joints = file.accessor("VEC4", 5121, 3, &[0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]);
    let weights = file.floats("VEC4", &[0.5, 0.5, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0.]);
    file.set_attribute("JOINTS_0", joints);
    file.set_attribute("WEIGHTS_0", weights);
    let first = [translation_matrix(0., 0., 0.), translation_matrix(0., -1., 0.)];
    let first = file.floats("MAT4", &first.concat());
    let second = file.floats("MAT4", &second.concat());
    file.json["skins"] = json!([
        {"joints": [2, 3], "inverseBindMatrices": first},
        {"joints": [2, 3], "inverseBindMatrices": second}]);
    // The translation of a skinned mesh's node is ignored.
    file.json["nodes"] = json!([{"mesh": 0, "skin": 0, "translation": [9, 9, 9]},
        {"mesh": 0, "skin": 1}, {"children": [3]}, {"translation": [0, 1, 0]}]);
    file.read()
}

#[test]
fn skins_that_differ_by_one_transform_share_binds() {
    // The second mesh is 100 times as large in its file, and shifted.
    let base = glam::Mat4::from_scale(Vec3::splat(0.01))
        * glam::Mat4::from_translation(Vec3::new(0., 0., 200.));
    let second = [0.0, -1.0]
        .map(|y| (glam::Mat4::from_translation(Vec3::new(0., y, 0.)) * base).to_cols_array());
    let model = two_skins(second);
    assert_eq!((model.binds.len(), model.joints.len()), (2, 2));
    assert_eq!(positions(&model)[..3], TRIANGLE);
    let moved = TRIANGLE.map(|p| base.transform_point3(p));
    for (read, expected) in positions(&model)[3..].iter().zip(moved) {
        assert!(read.distance(expected) < 1e-5, "{read} is not {expected}");
    }
}

#[test]
fn skins_of_other_bind_poses_keep_their_binds() {
    let model = two_skins([translation_matrix(0., 0., 0.), translation_matrix(0., -3., 0.)]);
    assert_eq!((model.binds.len(), model.joints.len()), (4, 2));
}

#[test]
fn the_four_greatest_influences_stay() {
    let mut file = File::triangle();
    let low = file.accessor("VEC4", 5121, 3, &[0, 1, 2, 3].repeat(3));
    let high = file.accessor("VEC4", 5121, 3, &[4, 5, 0, 0].repeat(3));
    let first = file.floats("VEC4", &[0.1, 0.3, 0.05, 0.2].repeat(3));
    let second = file.floats("VEC4", &[0.25, 0.1, 0., 0.].repeat(3));
    for (name, accessor) in
        [("JOINTS_0", low), ("WEIGHTS_0", first), ("JOINTS_1", high), ("WEIGHTS_1", second)]
    {
        file.set_attribute(name, accessor);
    }
    file.json["skins"] = json!([{"joints": [1, 2, 3, 4, 5, 6]}]);
    file.json["nodes"] = json!([{"mesh": 0, "skin": 0}, {}, {}, {}, {}, {}, {}]);
    let model = file.read();
    let names: Vec<(&str, f32)> = model.vertices[0]
        .influences
        .iter()
        .map(|&(bind, weight)| {
            let joint = model.binds[usize::from(bind)].joint;
            (model.joints[usize::from(joint)].name.as_str(), weight)
        })
        .collect();
    let expected = [("node2", 0.3), ("node5", 0.25), ("node4", 0.2), ("node1", 0.1)];
    for ((name, weight), (other, share)) in names.into_iter().zip(expected) {
        assert_eq!(name, other);
        assert!((weight - share / 0.85).abs() < 1e-6, "{name}: {weight}");
    }
    // The joints of vanished weights are gone.
    assert_eq!(model.joints.len(), 4);
}

#[test]
fn texture_coordinates_are_transformed() {
    let mut file = File::triangle();
    file.set_texture(json!({"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform":
        {"offset": [0.5, 0.25], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 3],
         "texCoord": 1}}}));
    let uvs = file.floats("VEC2", &[0., 0., 1., 0., 0., 1.]);
    file.set_attribute("TEXCOORD_1", uvs);
    file.json["extensionsRequired"] = json!(["KHR_texture_transform"]);
    let model = file.read();
    // A quarter turn counter-clockwise on the image, v down: u goes to -v, v to u.
    let expected = [Vec2::new(0.5, 0.25), Vec2::new(0.5, -1.75), Vec2::new(3.5, 0.25)];
    for (vertex, uv) in model.vertices.iter().zip(expected) {
        assert!(vertex.uv.distance(uv) < 1e-6, "{} is not {uv}", vertex.uv);
    }
    let texture = &model.textures[0];
    assert_eq!((texture.wrap, texture.nearest), ([Wrap::Clamp, Wrap::Mirror], true));
    assert_eq!(texture.image.get_pixel(0, 0).0, [255, 0, 0, 255]);
}

#[test]
fn materials_keep_what_an_unlit_picture_shows() {
    let mut file = File::triangle();
    file.json["materials"] = json!([
        {"name": "cut", "alphaMode": "MASK", "alphaCutoff": 0.75, "doubleSided": true,
         "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4]}},
        {"alphaMode": "BLEND", "extensions": {"KHR_materials_pbrSpecularGlossiness":
            {"diffuseFactor": [1, 0, 0, 0.5]}}}]);
    file.primitive()["material"] = 0.into();
    let second = json!({"attributes": file.primitive()["attributes"], "material": 1});
    file.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(second);
    let model = file.read();
    assert_eq!(model.vertices.len(), 3, "primitives over the same vertices share them");
    assert_eq!([model.triangles[0].material, model.triangles[1].material], [0, 1]);
    let [cut, glass] = &model.materials[..] else { panic!("two materials") };
    assert_eq!((cut.alpha, cut.double_sided), (AlphaMode::Mask(0.75), true));
    assert_eq!(cut.base_color, Vec4::new(0.1, 0.2, 0.3, 0.4));
    assert_eq!((glass.alpha, glass.base_color), (AlphaMode::Blend, Vec4::new(1., 0., 0., 0.5)));
}

#[test]
fn static_parts_are_baked_and_mirrors_turn_triangles() {
    let mut file = File::triangle();
    let mirror = [-1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 5., 0., 0., 1.];
    file.json["nodes"] = json!([{"mesh": 0, "matrix": mirror}, {"mesh": 0}]);
    let model = file.read();
    assert_eq!(positions(&model)[..3], [Vec3::X * 5.0, Vec3::X * 4.0, Vec3::new(5., 1., 0.)]);
    assert_eq!(model.triangles[0].corners, [0, 2, 1]);
    assert_eq!(model.triangles[1].corners, [3, 4, 5]);
}

#[test]
fn rigid_parts_follow_the_node_that_moves() {
    let mut file = File::triangle();
    let times = file.floats("SCALAR", &[0.]);
    let moves = file.floats("VEC3", &[0., 0., 0.]);
    // 0 moves 1; 2 stands still and needs a joint that does so, too.
    file.json["nodes"] = json!([{"children": [1], "translation": [0, 2, 0], "name": "arm"},
        {"mesh": 0, "translation": [1, 0, 0]}, {"mesh": 0}]);
    file.json["animations"] = json!([{
        "samplers": [{"input": times, "output": moves}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}]);
    let model = file.read();
    let names: Vec<&str> = model.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["arm", "static"]);
    assert_eq!(positions(&model)[0], Vec3::new(1., 2., 0.));
    let arm = model.binds[0].inverse.transform_point3(model.vertices[0].position);
    assert_eq!(arm, Vec3::X, "the inverse leads back to the joint's space");
    assert_eq!(model.vertices[0].influences[0], (0, 1.0));
    assert_eq!(model.vertices[3].influences[0], (1, 1.0));
}

#[test]
fn nodes_collapsed_at_rest_keep_their_shape() {
    let mut file = File::triangle();
    let times = file.floats("SCALAR", &[0.]);
    let scales = file.floats("VEC3", &[1., 1., 1.]);
    file.json["nodes"] = json!([{"mesh": 0, "scale": [0, 0, 0]}]);
    file.json["animations"] = json!([{
        "samplers": [{"input": times, "output": scales}],
        "channels": [{"sampler": 0, "target": {"node": 0, "path": "scale"}}]}]);
    let model = file.read();
    assert_eq!(positions(&model), TRIANGLE);
    assert_eq!(model.binds[0].inverse, glam::Affine3A::IDENTITY);
}

#[test]
fn strips_and_fans_become_triangles() {
    let mut file = File::triangle();
    let square = [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.];
    let square = file.floats("VEC3", &square);
    file.set_attribute("POSITION", square);
    file.primitive()["mode"] = 5.into();
    let corners = |model: Model| model.triangles.iter().map(|t| t.corners).collect::<Vec<_>>();
    assert_eq!(corners(file.read()), [[0, 1, 2], [1, 3, 2]]);
    file.primitive()["mode"] = 6.into();
    assert_eq!(corners(file.read()), [[1, 2, 0], [2, 3, 0]]);
    file.primitive()["mode"] = 0.into();
    file.fails_with("has no triangles");
}

#[test]
fn bad_files_are_refused_by_name() {
    let broken = |edit: &dyn Fn(&mut File), part: &str| {
        let mut file = File::triangle();
        edit(&mut file);
        file.fails_with(part);
    };
    broken(
        &|f| f.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]),
        "requires the extension KHR_draco_mesh_compression",
    );
    broken(
        &|f| f.json["buffers"] = json!([{"byteLength": 36, "uri": "gone%20far.bin"}]),
        "gone far.bin",
    );
    broken(
        &|f| f.json["buffers"] = json!([{"byteLength": 36, "uri": "data:;base64,AAAA"}]),
        "holds 3 bytes where 36 are promised",
    );
    broken(&|f| f.json["accessors"][0]["count"] = 4_000_000_000u64.into(), "export it again");
    broken(&|f| f.json["accessors"][0]["count"] = u64::MAX.into(), "export it again");
    broken(&|f| f.json["accessors"][0]["bufferView"] = 7.into(), "refers to buffer view 7");
    broken(
        &|f| {
            f.json["accessors"][0] =
                json!({"componentType": FLOAT, "type": "VEC3", "count": 4_000_000_000u64})
        },
        "claims",
    );
    broken(&|f| f.json["nodes"] = json!([{"mesh": 0, "children": [0]}]), "its own ancestor");
    broken(&|f| f.json["nodes"][0]["mesh"] = 3.into(), "refers to mesh 3");
    broken(&|f| f.json["nodes"][0]["children"] = json!([5]), "refers to node 5");
    broken(&|f| f.json["meshes"][0]["primitives"] = json!([]), "has no triangles");
    broken(&|f| f.json["asset"]["version"] = "1.0".into(), "glTF 1.0");
    broken(&|f| f.json = json!({"hello": 1}), "is not glTF 2.0");
    broken(
        &|f| {
            let points = f.floats("VEC3", &[0., 0., 0., f32::NAN, 0., 0., 0., 1., 0.]);
            f.set_attribute("POSITION", points);
        },
        "vertex 1 is not finite",
    );
    broken(
        &|f| {
            let points = f.floats("VEC3", &[0., 0., 0., 1., 1., 1., 2., 2., 2.]);
            f.set_attribute("POSITION", points);
        },
        "no triangle with an area",
    );
    broken(
        &|f| {
            let indices = f.accessor("SCALAR", 5121, 3, &[0, 1, 3]);
            f.primitive()["indices"] = indices.into();
        },
        "has index 3, but only 3 vertices",
    );
    broken(
        &|f| {
            f.set_skin_attributes();
            f.json["skins"] = json!([{"joints": []}]);
            f.json["nodes"][0]["skin"] = 0.into();
        },
        "names joint 0 of 0",
    );
    broken(
        &|f| {
            f.set_texture(json!({"index": 0}));
            f.json["images"] = json!([{"uri": "gone.png"}]);
        },
        "gone.png",
    );
    broken(
        &|f| {
            f.set_texture(json!({"index": 0}));
            f.json["images"] = json!([{"bufferView": 0, "name": "skin"}]);
        },
        "image 0 (skin): is not an intact PNG, JPEG or WebP",
    );
    broken(
        &|f| {
            f.set_texture(json!({"index": 0}));
            f.json["textures"] = json!([{}]);
        },
        "has no PNG, JPEG or WebP image",
    );
}
